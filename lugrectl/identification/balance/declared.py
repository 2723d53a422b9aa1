"""Declared effects as terms: their own functions, evaluated along the motion.

An effect is a term where it is linear in its strength and what else it has is known, or is a
phase: A f(x, phi) = A cos(phi) f(x, 0) + A sin(phi) f(x, pi/2).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ...blocks.block import Block
from ...blocks.model import Model, Part
from .terms import GRAVITY, Column, Term
from .track import Track

DELAY = "input_delay"
LEVELS = {"Fc": np.sign, "Fv": lambda w: w}


@dataclass(frozen=True, eq=False)
class Use:
    """A declared effect in the balance.

    ``terms`` are its columns: one, or two where a phase is fitted. ``per`` is the level ("Fc",
    "Fv") by which its coefficient is divided, None for a torque. ``held`` is the coefficient of
    its one term where that is known.
    """

    part: Part
    terms: tuple[Term, ...]
    per: str | None = None
    phase: str | None = None
    held: float | None = None

    @property
    def loaded(self) -> bool:
        return "load" in self.part.block.inputs


def uses_of(
    model: Model, tracks: Sequence[Track], held: Mapping[str, float], middle: float
) -> tuple[list[Use], list[str]]:
    """The declared effects that are terms, and one sentence for each that is not."""
    uses, notes = [], []
    if {"constant_torque", "coulomb_asymmetry"} <= {part.block.name for part in model.effects}:
        notes.append(
            "coulomb_asymmetry and constant_torque are one term of the balance: they differ at "
            "rest only. It is given as constant_torque."
        )
    for part in model.effects:
        if part.block.name in ("constant_torque", "gravity", "coulomb_asymmetry", DELAY):
            continue  # terms that the balance has anyway
        made = _use(part, tracks[0], held, middle)
        if isinstance(made, str):
            notes.append(f"{part.key} is declared but is not a term of the balance: {made}.")
        else:
            uses.append(made)
    return uses, notes


def _use(part: Part, track: Track, held: Mapping[str, float], middle: float) -> Use | str:
    """The effect as a term, or why it is none."""
    block, gain = part.block, str(part.block.gain)
    if block.states or {"input", "sensor"} & {*block.acts} or not block.acts:
        return "it has a state of its own or acts on a signal"
    acts = {act.removeprefix("+") for act in block.acts} - {"Fs"}
    if len(acts) != 1 or not acts <= {"torque", *LEVELS} or len(block.fresh) != 1:
        return "it does not act on one torque alone"
    if track.theta is None and "theta" in block.inputs:
        return "the record has no theta"
    act = acts.pop()
    level, relative = None if act == "torque" else act, act in block.acts and act != "torque"
    values, phase = _fixed(part, held, middle)
    unknown = [name for name, value in values.items() if value is None]
    if unknown:
        return f"its {unknown[0]} is not known; declare a value"
    starts = [{}] if phase is None else [{phase: 0.0}, {phase: np.pi / 2}]
    columns = [_column(block, {**values, gain: 1.0, **start}, level) for start in starts]
    one, two = columns[0](track), _column(block, {**values, **starts[0], gain: 2.0}, level)(track)
    if not np.allclose(two, 2 * one, rtol=1e-9, atol=1e-12 * np.abs(one).max(initial=0)):
        return f"it is not linear in {gain}"
    keys = (gain,) if phase is None else ("sin", "cos")
    terms = [
        Term(f"{part.key}.{k}", column, friction=level is not None)
        for k, column in zip(keys, columns, strict=True)
    ]
    known = None if phase or relative else held.get(f"{part.key}.{gain}")
    return Use(part, tuple(terms), act if relative else None, phase, known)


def _column(block: Block, values: Mapping[str, float | None], level: str | None) -> Column:
    """The torque of an effect at given values; on a level, that of the level it changes."""

    def column(track: Track) -> np.ndarray:
        signals = {"theta": track.theta, "w": track.speed, "load": track.load, "t": track.t}
        out = block(*(signals[name] for name in block.reads), **values)[0]
        out = np.broadcast_to(np.asarray(out, float), len(track))
        return out if level is None else out * LEVELS[level](track.speed)

    return column


def _fixed(
    part: Part, held: Mapping[str, float], middle: float
) -> tuple[dict[str, float | None], str | None]:
    """The parameters beside the strength: values, and the name of a phase that is fitted."""
    values, phase = {}, None
    for name, p in part.block.own.items():
        value = held.get(f"{part.key}.{name}")
        if name == part.block.gain:
            continue
        if value is None and p.span is not None and p.angle:
            phase = name
        elif value is None and p.span is not None:
            values[name] = middle  # a constant beside it takes the rest
        else:
            values[name] = part.values.get(name) if value is None else value
    return values, phase


def held_terms(
    held: Mapping[str, float], uses: Sequence[Use], terms: Sequence[Term]
) -> list[tuple[Term, float]]:
    """The terms whose coefficients are known."""
    known = [(term, held[term.key]) for term in terms if term.key in held]
    amplitude, phase = held.get("gravity.amplitude"), held.get("gravity.phase")
    if amplitude is not None and (phase is not None or amplitude == 0):
        angle = phase or 0.0
        parts = (amplitude * np.cos(angle), amplitude * np.sin(angle))
        known += [(g, v) for g, v in zip(GRAVITY, parts, strict=True) if g in terms]
    return known + [(use.terms[0], use.held) for use in uses if use.held is not None]

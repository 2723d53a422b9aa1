"""Runs of one drive compared: a run whose torque, motion or time is in another unit or sign."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...blocks.model import Model
from ...core.option_names import option
from ...record.stretches import Stretch
from .constants import ALIKE, LITTLE, MOST_RUNS, QUARTER
from .estimate import first_fit
from .problem import Ground, ground_of
from .result import LEVELS

DEG, RPM = 180 / np.pi, 30 / np.pi
POWERS = {"u": (1, 1, 1), "theta": (-1, 0, -1), "w": (-1, 0, -1)}  # of J, Fc and Fv
TORQUES = {-1.0: "u=-1", 1e3: "u=mN m", 1e-3: "u=1000", 1e2: "u=0.01", 1e-2: "u=100"}
TIMES = {1e3: "t=ms", 1e6: "t=us", 1e-3: "t=1000"}
ANGLES = {DEG: "theta=deg", 1 / DEG: "theta=57.29578", 0.5 / np.pi: "theta=turn"}
ANGLES[2 * np.pi] = "theta=0.1591549"
SPEEDS = {DEG: "w=deg/s", RPM: "w=rpm", 1 / RPM: "w=9.549297", 1 / DEG: "w=57.29578"}
LENGTHS = {1e3: "theta=mm", 1e-3: "theta=1000"}
OPPOSITE = "{}: u has the opposite sign of {}: give {} for it, or leave it out."
TIMES_OTHERS = "{}: {} is {:.4g} times that of {}: give {} for it, or leave it out."
FRICTION = "{}: {:.0f} % {} friction than {}."


@dataclass(frozen=True)
class Levels:
    """J, Fc and Fv of one run (3,), twice their relative errors, and which of them are known."""

    parts: Sequence[Stretch]
    value: np.ndarray
    error: np.ndarray

    @property
    def run(self) -> int:
        return self.parts[0].run

    @property
    def known(self) -> np.ndarray:
        return self.error < QUARTER

    def agrees(self, other: Levels, ratios: np.ndarray | float = 1.0) -> bool:
        """Whether ratios explain how all that is known of both runs differs."""
        both = self.known & other.known
        gap = np.abs(self.value / (other.value * ratios) - 1)
        return bool(both.any() and np.all((gap < ALIKE + np.hypot(self.error, other.error))[both]))


@dataclass(frozen=True)
class Unlike:
    """Runs that another unit or sign separates from the others, and sentences on all runs."""

    left_out: frozenset[int] = frozenset()
    said: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()


def unlike(stretches: Sequence[Stretch], model: Model, names: Sequence[str]) -> Unlike:
    """The runs that contradict the others; ``names`` are those of the runs."""
    runs = sorted({s.run for s in stretches})
    if not 2 <= len(runs) <= MOST_RUNS:
        return Unlike()
    with np.errstate(all="ignore"):
        each = [_levels([s for s in stretches if s.run == run], model) for run in runs]
        found = [levels for levels in each if levels is not None]
        return _compared(found, model, names) if len(found) > 1 else Unlike()


def _compared(found: Sequence[Levels], model: Model, names: Sequence[str]) -> Unlike:
    """Every other run against the one with which most agree; of two, the one that is possible."""
    votes = [sum(one.agrees(other) for other in found) for one in found]
    possible = [not np.any(one.known & (one.value < 0)) for one in found]
    best = max(range(len(found)), key=lambda i: (votes[i], possible[i]))  # the first of equal ones
    reference = found[best]
    usual = "the other runs" if votes[best] > 1 else names[reference.run]
    out, said, notes = set(), [], []
    for one in found:
        if one is reference or one.agrees(reference):
            continue
        name = names[one.run]
        if sentence := _another_unit(one, reference, model, name, usual):
            out.add(one.run)
            said.append(sentence)
        else:
            notes += _another_friction(one, reference, name, usual)
    return Unlike(frozenset(out), tuple(said), tuple(notes))


def _levels(parts: Sequence[Stretch], model: Model) -> Levels | None:
    """The levels of one run; None where it has no answer of its own."""
    try:
        ground = ground_of(parts, model, {})
        if not isinstance(ground, Ground) or ground.is_map:
            return None
        made = first_fit(replace(ground, widths=ground.widths[::2]))  # a rough answer
    except np.linalg.LinAlgError:
        return None
    if made is None or not {*LEVELS} <= {*made.names}:
        return None
    at = [made.names.index(key) for key in LEVELS]
    levels = Levels(parts, made.p[at], 2 * np.sqrt(np.diag(made.V)[at]) / np.abs(made.p[at]))
    return levels if levels.known[:2].any() else None


def _another_unit(
    one: Levels, reference: Levels, model: Model, name: str, usual: str
) -> str | None:
    """The one factor that explains the difference, in a sentence."""
    linear, turns = model.motion == "linear", one.parts[0].theta is not None
    motion = (LENGTHS if linear else ANGLES) if turns else {} if linear else SPEEDS
    for factors in (TORQUES, TIMES, motion):
        for size, undone in factors.items():
            channel = undone.split("=")[0]
            if not _explains(size, channel, one, reference, model):
                continue
            undo = option("scale" if undone.split("=")[1][-1].isdigit() else "units", undone)
            if size == -1.0:
                return OPPOSITE.format(name, usual, undo)
            return TIMES_OTHERS.format(name, channel, size, usual, undo)
    return None


def _explains(size: float, channel: str, one: Levels, reference: Levels, model: Model) -> bool:
    """Whether a channel of the run is that many times that of the reference."""
    if channel != "t":
        known = (one.known & reference.known)[:2].all()
        return bool(known) and one.agrees(reference, size ** np.array(POWERS[channel], float))
    longer = np.log(one.parts[0].dt / reference.parts[0].dt)
    if abs(longer - np.log(size)) >= abs(longer):
        return False
    # windows have a length in s: fitted again at the other rate
    again = _levels([replace(s, dt=s.dt / size, t=s.t / size) for s in one.parts], model)
    return again is not None and again.agrees(reference)


def _another_friction(one: Levels, reference: Levels, name: str, usual: str) -> list[str]:
    """A sentence on friction that differs by more than chance."""
    change = one.value[1] / reference.value[1] - 1
    chance = np.hypot(one.error[1], reference.error[1]) * (1 + abs(change))
    if not (one.known & reference.known)[1] or change < -1:
        return []
    if abs(change) < LITTLE + chance:
        return []
    return [FRICTION.format(name, 100 * abs(change), "more" if change > 0 else "less", usual)]

"""Runs of one drive compared: a run whose torque, motion or time is in another unit or sign.

A factor k of u multiplies J, Fc and Fv by k; a factor m of the motion divides J and Fv by m; a
factor f of the time multiplies J by f^2 and Fv by f.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...blocks.model import Model
from ...core.option_names import option
from ...record.stretches import Stretch
from .constants import (
    ALIKE,
    ANOTHER_FRICTION,
    MOST_RUNS_COMPARED,
    SHARE_OF_VALUE,
    SPREADS,
)
from .estimate import first_fit
from .problem import Ground, ground_of

LEVELS = ("J", "Fc", "Fv")
OPPOSITE = "u has the opposite sign of {}: give {} for it, or leave it out."
TIMES = "{} is {:.4g} times that of {}: give {} for it, or leave it out."
FRICTION = "{}: {:.0f} % {} friction than {}."
OTHERS = "the other runs"


@dataclass(frozen=True)
class Factor:
    """What one channel of a run may be multiplied by, and the option with the value that undoes
    it."""

    channel: str
    size: float
    undone: tuple[str, str]

    def ratios(self) -> np.ndarray:
        """By what it multiplies J, Fc and Fv."""
        k = self.size
        if self.channel == "u":
            return np.array([k, k, k])
        return np.array([k**2, 1.0, k]) if self.channel == "t" else np.array([1 / k, 1.0, 1 / k])


NONE = Factor("u", 1.0, ("scale", "u=1"))
FACTORS = (
    Factor("u", -1.0, ("scale", "u=-1")),
    Factor("u", 1e3, ("units", "u=mN m")),
    Factor("u", 1e-3, ("scale", "u=1000")),
    Factor("u", 1e2, ("scale", "u=0.01")),
    Factor("u", 1e-2, ("scale", "u=100")),
    Factor("t", 1e3, ("units", "t=ms")),
    Factor("t", 1e6, ("units", "t=us")),
    Factor("t", 1e-3, ("scale", "t=1000")),
)
TURNING = (
    Factor("theta", 180 / np.pi, ("units", "theta=deg")),
    Factor("theta", np.pi / 180, ("scale", "theta=57.29578")),
    Factor("theta", 0.5 / np.pi, ("units", "theta=turn")),
    Factor("theta", 2 * np.pi, ("scale", "theta=0.1591549")),
)
SPEEDS = (
    Factor("w", 180 / np.pi, ("units", "w=deg/s")),
    Factor("w", 30 / np.pi, ("units", "w=rpm")),
    Factor("w", np.pi / 30, ("scale", "w=9.549297")),
    Factor("w", np.pi / 180, ("scale", "w=57.29578")),
)
LENGTHS = (
    Factor("theta", 1e3, ("units", "theta=mm")),
    Factor("theta", 1e-3, ("scale", "theta=1000")),
)


@dataclass(frozen=True)
class Levels:
    """J, Fc and Fv of one run (3,), their relative errors."""

    run: int
    value: np.ndarray
    error: np.ndarray

    def certain(self) -> np.ndarray:
        """Which of them are known well enough to compare."""
        return self.error < SHARE_OF_VALUE

    def physical(self) -> bool:
        """Whether no level that is known is negative."""
        return not np.any(self.certain() & (self.value < 0))


@dataclass(frozen=True)
class Unlike:
    """Runs that another unit or sign separates from the others, and sentences on all runs."""

    left_out: frozenset[int] = frozenset()
    said: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()


def unlike(stretches: Sequence[Stretch], model: Model, names: Sequence[str]) -> Unlike:
    """The runs that contradict the others; ``names`` are those of the runs."""
    runs = sorted({s.run for s in stretches})
    if not 2 <= len(runs) <= MOST_RUNS_COMPARED:
        return Unlike()
    by_run = {run: [s for s in stretches if s.run == run] for run in runs}
    with np.errstate(all="ignore"):
        found = [levels for run in runs if (levels := _levels(run, by_run[run], model))]
        if len(found) < 2:
            return Unlike()
        reference = _reference(found)
        return _compared(found, reference, by_run, model, names)


def _compared(
    found: Sequence[Levels],
    reference: Levels,
    by_run: dict[int, list[Stretch]],
    model: Model,
    names: Sequence[str],
) -> Unlike:
    """Every other run against the reference."""
    out, said, notes = set(), [], []
    many = sum(_agree(one, reference, NONE) for one in found) > 1
    usual = OTHERS if many else names[reference.run]
    for one in found:
        if one is reference or _agree(one, reference, NONE):
            continue
        factor = _factor(one, reference, by_run, model)
        if factor is not None:
            out.add(one.run)
            said.append(f"{names[one.run]}: {_sentence(factor, usual)}")
        elif (note := _friction(one, reference, names[one.run], usual)) is not None:
            notes.append(note)
    return Unlike(frozenset(out), tuple(said), tuple(notes))


def _levels(run: int, parts: Sequence[Stretch], model: Model) -> Levels | None:
    """The levels of one run; None where it has no answer of its own."""
    try:
        ground = ground_of(parts, model, {})
        made = None
        if isinstance(ground, Ground) and not ground.is_map:  # half of the widths: a rough answer
            made = first_fit(replace(ground, widths=ground.widths[::2]))
    except np.linalg.LinAlgError:
        return None
    if made is None or "Fc" not in made.names:
        return None
    at = [made.names.index(key) for key in LEVELS if key in made.names]
    if len(at) < len(LEVELS):
        return None
    value, spread = made.p[at], np.sqrt(np.diag(made.V)[at])
    levels = Levels(run, value, SPREADS * spread / np.abs(value))
    return levels if levels.certain()[:2].any() else None


def _agree(one: Levels, other: Levels, factor: Factor) -> bool:
    """Whether a factor explains how all that is known of both runs differs, within 3 %."""
    both = one.certain() & other.certain()
    gap = np.abs(one.value / (other.value * factor.ratios()) - 1)
    allowed = ALIKE + np.hypot(one.error, other.error)
    return bool(both.any() and np.all(gap[both] < allowed[both]))


def _reference(found: Sequence[Levels]) -> Levels:
    """The run with which most others agree; of two, the one that physics allows, or the first."""
    votes = [sum(_agree(one, other, NONE) for other in found) for one in found]
    order = sorted(range(len(found)), key=lambda i: (-votes[i], not found[i].physical(), i))
    return found[order[0]]


def _factor(
    one: Levels, reference: Levels, by_run: dict[int, list[Stretch]], model: Model
) -> Factor | None:
    """The one factor that explains the difference."""
    parts = by_run[one.run]
    for factor in _factors(parts[0], model):
        levels = one
        if factor.channel == "t":  # windows have a length in s: fitted again at the other rate
            if not _rates_fit(parts[0], by_run[reference.run][0], factor):
                continue
            again = _levels(one.run, [_rescaled(s, factor.size) for s in parts], model)
            if again is not None and _agree(again, reference, NONE):
                return factor
            continue
        both = levels.certain() & reference.certain()
        if both[:2].all() and _agree(levels, reference, factor):
            return factor
    return None


def _factors(part: Stretch, model: Model) -> Iterator[Factor]:
    yield from FACTORS
    if part.theta is not None:
        yield from LENGTHS if model.motion == "linear" else TURNING
    elif model.motion != "linear":
        yield from SPEEDS


def _rates_fit(part: Stretch, other: Stretch, factor: Factor) -> bool:
    """Whether a factor of the time brings the rates of two runs closer."""
    ratio = part.dt / other.dt
    return abs(np.log(ratio / factor.size)) < abs(np.log(ratio))


def _rescaled(part: Stretch, factor: float) -> Stretch:
    return replace(part, dt=part.dt / factor, t=part.t / factor)


def _sentence(factor: Factor, usual: str) -> str:
    undone = option(*factor.undone)
    if factor.size == -1.0:
        return OPPOSITE.format(usual, undone)
    return TIMES.format(factor.channel, factor.size, usual, undone)


def _friction(one: Levels, reference: Levels, name: str, usual: str) -> str | None:
    """A sentence on friction that differs by more than chance."""
    if not (one.certain()[1] and reference.certain()[1]):
        return None
    change = one.value[1] / reference.value[1] - 1
    chance = np.hypot(one.error[1], reference.error[1]) * (1 + abs(change))
    if abs(change) < ANOTHER_FRICTION + chance:
        return None
    if change < -1:
        return None
    return FRICTION.format(name, 100 * abs(change), "more" if change > 0 else "less", usual)

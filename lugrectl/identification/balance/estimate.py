"""The fit of a record: width of the windows, delay of u, friction near rest."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from .constants import (
    COSTLY,
    FEWEST_CHANGES,
    LATE,
    NO_DELAY,
    PARTS,
    ROUNDS,
    SLOWEST_DIP,
)
from .fit import Fit, Setting, fit
from .friction_shapes import with_dip, with_turning
from .interval import interval
from .load_torque import with_load
from .problem import Ground
from .result import CurvePoint
from .runs_as_points import of_runs
from .terms import ECCENTRICITY, Term, near_rest
from .windows import Source


@dataclass(frozen=True, eq=False)
class Estimated:
    """A fit, and the covariance of its coefficients with all that it leaves open.

    ``freedom`` are the degrees of freedom of their errors; 0 where nothing is left to tell them.
    ``curve`` are the points of a map.
    """

    fit: Fit
    V: np.ndarray
    freedom: float
    notes: tuple[str, ...] = ()
    curve: tuple[CurvePoint, ...] | None = None


def estimate(ground: Ground) -> Estimated | None:
    """The fit of a record; None where there is no window."""
    made = first_fit(ground)
    for _ in range(ROUNDS):
        if made is None or not any(use.loaded for use in ground.uses):
            break
        ground = with_load(ground, made)
        made = first_fit(ground)
    if made is None:
        return None
    if ground.is_map:
        whole = of_runs(ground, made)
        return Estimated(whole.fit, whole.V, whole.freedom, whole.notes, whole.curve())
    made = with_turning(ground.source, _with_shapes(ground, made), ground.speed)
    lowest = max(made.setting.rest, SLOWEST_DIP * ground.speed)
    made, rivals = with_dip(ground.source, made, ground.speed, lowest)
    rivals = [*rivals, *_prompt(ground.source, made)]
    V = interval(ground.source, ground.widths, made, rivals, ground.travel, ground.model.motion)
    return Estimated(made, V, _freedom(made))


def _freedom(made: Fit) -> int:
    """Degrees of freedom: blocks in time beyond the terms, or parts of the range if fewer."""
    terms = sum(term.share is None for term in made.terms)
    return max(min(made.blocks - terms, PARTS - 1), 2)


def first_fit(ground: Ground) -> Fit | None:
    """The terms at the best width; those that depend on a load once there is one."""
    loaded = [t for use in ground.uses if use.loaded for t in use.terms]
    known = any(np.any(p.load) for p in ground.tracks)
    terms = [t for t in ground.terms if known or t not in loaded]
    widths = ground.widths[-1:] if ground.is_map else ground.widths
    return best_width(ground.source, widths, terms, ground.setting)


def best_width(
    source: Source, widths: Sequence[float], terms: Sequence[Term], setting: Setting
) -> Fit | None:
    """The fit with the least expected error of J, Fc and Fv, from wide windows to narrow ones.

    Wide windows suffer from what they average away, narrow ones from noise: so the width
    follows from the noise of the record.
    """
    tried, delay = [], 0.0
    for half_width in reversed(widths):
        made = fit(source, half_width, terms, setting, delay)
        if made is not None:
            tried.append(made)
            delay = made.delay
    return min(tried, key=lambda f: f.merit, default=None)


def _with_shapes(ground: Ground, made: Fit) -> Fit:
    """The fit with what friction may do near rest, at another width where that costs too much."""

    def shaped(half_width: float) -> Fit | None:
        eccentric = ECCENTRICITY if {"J", "gravity.sin"} <= {*made.names} else ()
        terms = [*made.terms, *eccentric, *near_rest(ground.speed, half_width)]
        return fit(ground.source, half_width, terms, made.setting, made.delay)

    own = shaped(made.half_width)
    if own is not None and own.merit < COSTLY * made.merit:
        return own
    others = [shaped(width) for width in ground.widths if width != made.half_width]
    return min((f for f in (own, *others) if f), key=lambda f: f.merit, default=made)


def _prompt(source: Source, late: Fit) -> list[Fit]:
    """The fit without a large delay, where the torque hardly changes: inertia looks like one."""
    dt = late.windows.dt
    if not late.setting.delay_prior or abs(late.delay) <= max(dt, LATE) or _follows(late):
        return []
    setting = replace(late.setting, delay_prior=NO_DELAY * dt)
    other = fit(source, late.half_width, late.terms, setting)
    return [] if other is None else [other]


def _follows(made: Fit) -> bool:
    """Whether the torque changes often enough to distinguish a delay from inertia.

    The independent changes are (sum q)^2 / sum q^2 over windows, with q the squared rate of u, by
    the windows in which that rate remembers itself. (How long the residual remembers says nothing
    of how often the torque changes.)
    """
    rate = made.windows.du[:, 0]
    power = rate**2
    changes = float(power.sum() ** 2 / np.sum(power**2)) / _remembered(rate, made.windows.run)
    return changes > FEWEST_CHANGES


def _remembered(x: np.ndarray, run: np.ndarray) -> float:
    """Windows for each independent square of x: 1 + 2 sum of r^2, r its correlation up to where
    that is first not above 0."""
    total, square = 1.0, float(x @ x)
    for lag in range(1, len(x)):
        r = float(x[lag:] @ np.where(run[lag:] == run[:-lag], x[:-lag], 0.0)) / square
        if not r > 0.0:
            break
        total += 2.0 * r**2
    return total

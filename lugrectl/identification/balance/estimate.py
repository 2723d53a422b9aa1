"""The fit of a record: width of the windows, delay of u, friction near rest."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from .constants import (
    CLEARLY,
    COHERENT_BLOCKS,
    COST_OF_SHAPES,
    FEWEST_CHANGES,
    LATE_SAMPLES,
    LATE_SECONDS,
    NO_DELAY,
    ROUNDS_OF_LOAD,
    SLOWEST_DIP,
)
from .fit import Fit, Setting, fit
from .friction_shapes import Chosen, shapes_near_rest, turns_often, with_dip, with_turning
from .interval import interval, unexplained
from .load_torque import with_load
from .problem import Ground
from .result import CurvePoint
from .runs_as_points import curve_of_runs, of_runs
from .terms import ECCENTRICITY, Term
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
    for _ in range(ROUNDS_OF_LOAD):
        if made is None or not any(use.loaded for use in ground.uses):
            break
        ground = with_load(ground, made)
        made = first_fit(ground)
    if made is None:
        return None
    if ground.is_map:
        whole = of_runs(ground, made)
        return Estimated(whole.fit, whole.V, whole.freedom, whole.notes, curve_of_runs(whole))
    choices, rivals = _shaped(ground, made)
    made = choices[-1].fit
    choices, rivals, notes = _late_or_not(ground, choices, rivals)
    made = choices[-1].fit
    V = interval(ground.source, ground.widths, made, choices, rivals, ground.travel)
    V = V + unexplained(made, ground.model.motion)
    return Estimated(made, V, _freedom(made), tuple(notes))


def _freedom(made: Fit) -> int:
    """Degrees of freedom: blocks in time beyond the terms, or parts of the range if fewer."""
    terms = sum(term.share is None for term in made.terms)
    return max(min(made.blocks - terms, COHERENT_BLOCKS - 1), 2)


def first_fit(ground: Ground) -> Fit | None:
    """The terms at the best width; those that depend on a load once there is one."""
    loaded = [t for use in ground.uses if use.loaded for t in use.terms]
    known = any(np.any(p.load) for p in ground.tracks)
    terms = [t for t in ground.terms if known or t not in loaded]
    widths = ground.widths[-1:] if ground.is_map else ground.widths
    return best_width(ground.source, widths, terms, ground.setting)


def _shaped(ground: Ground, made: Fit) -> tuple[list[Chosen], list[Fit]]:
    """The fit with what friction does near rest, and a fit that may as well be right."""
    source, setting, rivals = ground.source, made.setting, []
    made = _with_shapes(ground, made)
    choices = [Chosen(made)]
    if turns_often(ground.tracks, setting.rest):
        choices.append(with_turning(source, made, ground.speed))
        made = choices[-1].fit
    lowest = max(setting.rest, SLOWEST_DIP * ground.speed)
    choices.append(with_dip(source, made, ground.speed, lowest))
    made = choices[-1].fit
    if made.names[-1] == "dip" and made.p[len(made.names) - 1] < 0:
        # no law has a negative dip: the fit without it counts as well
        rivals += [fit(source, made.half_width, made.terms[:-1], setting, made.delay)]
    return choices, [f for f in rivals if f is not None]


def _with_shapes(ground: Ground, made: Fit) -> Fit:
    """The fit with what friction may do near rest, at another width where that costs too much."""

    def shaped(half_width: float) -> Fit | None:
        eccentric = ECCENTRICITY if {"J", "gravity.sin"} <= {*made.names} else ()
        terms = [*made.terms, *eccentric, *shapes_near_rest(ground.speed, half_width)]
        return fit(ground.source, half_width, terms, made.setting, made.delay)

    own = shaped(made.half_width)
    if own is not None and own.merit < COST_OF_SHAPES * made.merit:
        return own
    others = [shaped(width) for width in ground.widths if width != made.half_width]
    return min((f for f in (own, *others) if f), key=lambda f: f.merit, default=made)


def _late_or_not(
    ground: Ground, choices: list[Chosen], rivals: list[Fit]
) -> tuple[list[Chosen], list[Fit], list[str]]:
    """A large delay against none: friction that turns over slowly looks like a delay.

    The more likely one is taken; where the other is not clearly less likely, or the torque
    hardly changes, the interval covers both.
    """
    late = choices[-1].fit
    dt = late.windows.dt
    if abs(late.delay) <= max(LATE_SAMPLES * dt, LATE_SECONDS) or not ground.setting.delay_prior:
        return choices, rivals, []
    prompt = replace(ground, setting=replace(ground.setting, delay_prior=NO_DELAY * dt))
    plain = [t for t in late.terms if t in ground.terms]
    first = fit(prompt.source, late.half_width, plain, prompt.setting)
    if first is None:
        return choices, rivals, []
    others, more = _shaped(prompt, first)
    other = others[-1].fit
    if late.score > other.score + CLEARLY:
        return choices, rivals if _follows(late) else [*rivals, other], []
    note = (
        f"u seems shifted by {late.delay * 1e3:.0f} ms, but friction that turns over slowly "
        "explains the record as well: the shift is not used."
    )
    return others, [*more, late], [note]


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
    if not tried:
        return None
    return _with_inertia(source, min(tried, key=lambda f: f.merit))


def _with_inertia(source: Source, made: Fit) -> Fit:
    """Of (J, T) and (-J, T + 2 J / Fv), which have one gain and one phase, the first."""
    J, Fv = made.value("J"), made.value("Fv")
    if not (made.setting.delay_prior and J < 0 < Fv and "J" in made.names):
        return made
    other = fit(source, made.half_width, made.terms, made.setting, made.delay + 2 * J / Fv)
    if other is None or other.value("J") < 0 or other.score < made.score - CLEARLY:
        return made
    return other

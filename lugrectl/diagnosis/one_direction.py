"""Runs that each move in one direction: friction there is a sum with a constant torque."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from ..blocks.model import Model
from ..estimates.findings import Estimate
from ..identification.balance import Balance
from ..identification.balance.result import Combination
from ..identification.dataset.run_effects import MOST_RUNS
from ..record import Stretch

ONE_WAY = (
    "This log moves in one direction only, so {0} is not determined alone: in the fitted model it "
    "is {1}, {2:.4g} {3}."
)
AS_DECLARED = " With {0} as declared, {1:.6g} {2}, the constant torque is {3:.3g} {2}."
EACH = (
    "Each run moves in one direction only, and the fit leaves the offset of the torque free in "
    "each: in the fitted model {0} is {1}, {2:.4g} {3}. The plain torque balance takes one offset "
    "for all runs: {0} = {4:.4g} {3}, constant_torque = {5:.3g} {3}."
)
OVER = 0.1  # s over which a speed is taken
MOVING = 0.05  # of the top speed: slower, it may be noise
WAY = "the other direction"
OTHER = "Record the other direction, too."
NEXT = "{}, too: it separates the parts of {}."


def not_alone(found: Mapping[str, Estimate], plain: Balance) -> dict[str, Estimate]:
    """The estimates, with the sum in place of an interval where a value is not known alone.

    A value that is held, or of an effect, stays.
    """
    return {
        key: replace(e, ci95=None, together=plain.together[key].text)
        if key in plain.together and not e.held
        else e
        for key, e in found.items()
    }


def one_way(found: Mapping[str, Estimate], plain: Balance, model: Model) -> list[str]:
    """A sentence for each value that stands for a sum, with the sum and what to record."""
    return [_sum(key, e, plain, model) for key, e in found.items() if e.together]


def next_way(plain: Balance, then: str | None) -> str | None:
    """What to record next: what ``then`` says, and the other direction where it is missing."""
    sums: dict[str, Combination] = {c.text: c for c in plain.together.values()}
    said = [NEXT.format(_capital(c.to_separate), c.text) for c in sums.values() if c.to_separate]
    return " ".join(filter(None, (then, *said))) or None


def _sum(key: str, e: Estimate, plain: Balance, model: Model) -> str:
    declared, load = model.known().get(key), plain.parameters.get("constant_torque")
    if load is not None and not plain.together[key].to_separate:
        both = plain.parameters[key].value, load.value
        return EACH.format(key, e.together, e.value, e.unit, *both)
    said = ONE_WAY.format(key, e.together, e.value, e.unit)
    if declared is not None and load is not None:
        said += AS_DECLARED.format(key, declared, e.unit, load.value)
    return f"{said} {OTHER}"


def of_runs(parts: Sequence[Stretch], found: Balance) -> dict[str, Combination]:
    """The sum that Fc is in a fit of runs in one direction each, with offsets of their own."""
    ways = [_way([p for p in parts if p.run == run]) for run in sorted({p.run for p in parts})]
    Fc, load = found.parameters.get("Fc"), found.parameters.get("constant_torque")
    if not 1 < len(ways) <= MOST_RUNS or 0 in ways or Fc is None or load is None:
        return {}
    if Fc.ci95 is None or load.ci95 is None or load.ci95[0] <= 0.0 <= load.ci95[1]:
        return {}
    value = Fc.value + ways[0] * load.value
    half = 0.5 * (np.diff(Fc.ci95)[0] + np.diff(load.ci95)[0])
    text = f"Fc {'+' if ways[0] > 0 else '-'} constant_torque"
    return {"Fc": Combination(text, value, Fc.unit, (value - half, value + half), "")}


def moves_one_way(parts: Sequence[Stretch]) -> bool:
    """Whether each run moves in one direction only."""
    return all(_way([p for p in parts if p.run == run]) for run in {p.run for p in parts})


def without_other_way(found: Balance) -> Balance:
    """The answer of runs in both directions, which need no other one."""

    def cleared(c: Combination) -> Combination:
        wants = c.to_separate.removeprefix("record ").split(" and ")
        kept = [w for w in wants if w != WAY] or ["other speeds"]
        return replace(c, to_separate=f"record {' and '.join(kept)}" if c.to_separate else "")

    return replace(found, combinations=type(found.combinations)(map(cleared, found.combinations)))


def _way(run: Sequence[Stretch]) -> int:
    """1 or -1 where a run moves in one direction only, else 0."""
    speeds = np.concatenate([_speed(part) for part in run])
    speeds = speeds[np.isfinite(speeds)]
    moving = speeds[np.abs(speeds) > MOVING * np.max(np.abs(speeds), initial=0.0)]
    return int(np.all(moving > 0)) - int(np.all(moving < 0)) if len(moving) else 0


def _speed(part: Stretch) -> np.ndarray:
    if part.theta is None:
        return np.zeros(0) if part.w is None else part.w
    n = max(1, round(OVER / part.dt))
    return (part.theta[n:] - part.theta[:-n]) / (n * part.dt)


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]

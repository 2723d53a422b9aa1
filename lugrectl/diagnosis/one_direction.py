"""Runs that each move in one direction: friction there is a sum with a constant torque."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from ..blocks.model import Model
from ..estimates.findings import Estimate
from ..identification.balance import Balance
from ..identification.balance.constants import QUARTER
from ..identification.balance.parameters import said_of
from ..identification.balance.result import Combination
from ..identification.dataset.run_effects import MOST_RUNS
from ..record import Stretch

ONE_WAY = (
    "This log moves in one direction only, so {0} not determined alone: in the fitted model {1} is "
    "{2:.4g} {3}."
)
AS_DECLARED = " With {0} as declared, {1:.6g} {2}, the constant torque is {3:.3g} {2}."
EACH = (
    "Each run moves in one direction only, and the fit leaves the offset of the torque free in "
    "each: in the fitted model {0} is {1}, {2:.4g} {3}. The plain torque balance takes one offset "
    "for all runs: {0} = {4:.4g} {3}, constant_torque = {5:.3g} {3}."
)
OVER = 0.1  # s over which a speed is taken
MOVING = 0.05  # of the top speed: slower, it may be noise
LOAD = "constant_torque"
WAY = "the other direction"
OTHER = "Record the other direction, too."
NEXT = "{}, too: it separates the parts of {}."


def shown_sums(found: Mapping[str, Estimate], plain: Balance) -> dict[str, Combination]:
    """The sums that values of a fitted model stand for, by key, with their values there.

    A value that its fit is certain of is no part of them: the model may have what the plain balance
    has not, and which biases its sums. A value that is held, or of an effect, stands alone.
    """
    made = {}
    for key, c in plain.together.items():
        e = found.get(key)
        lead = next((k for k in c.parts if k in found), key)
        if e is not None and not e.held and (key == lead or not _certain(e)):
            made[key] = _of_fit(lead, c, found)
    return made


def _certain(e: Estimate) -> bool:
    return e.held or e.ci95 is not None and e.ci95[1] - e.ci95[0] < 2 * QUARTER * abs(e.value)


def _of_fit(lead: str, c: Combination, found: Mapping[str, Estimate]) -> Combination:
    """A sum of the plain balance without what a fit is certain of, with its values."""
    alone = {k for k in c.parts if k != lead and k in found and _certain(found[k])}
    parts = {k: factor for k, factor in c.parts.items() if k not in alone}
    text, wants = said_of(parts)
    value = sum(factor * _value(k, found) for k, factor in parts.items())
    return replace(c, text=text, value=value, parts=parts, to_separate=c.to_separate and wants)


def _value(key: str, found: Mapping[str, Estimate]) -> float:
    """A value of a fitted model; 0 of what it has not."""
    own = found.get(f"{key}.torque" if key == LOAD else key)
    return own.value if own else 0.0


def not_alone(
    found: Mapping[str, Estimate], sums: Mapping[str, Combination], plain: Balance
) -> dict[str, Estimate]:
    """The estimates, with the sum in place of an interval where a value is not known alone.

    Where the drive never rests, nothing but the fall of friction with speed shows Fs: without a vs
    there is none.
    """
    made = {
        k: replace(e, ci95=None, together=sums[k].text) if k in sums else e
        for k, e in found.items()
    }
    vs, Fs = made.get("vs"), made.get("Fs")
    if sums and vs and Fs and not (vs.held or vs.ci95 or Fs.held) and _never_rests(plain.stretches):
        made["Fs"] = replace(Fs, ci95=None)
    return made


def one_way(
    found: Mapping[str, Estimate],
    sums: Mapping[str, Combination],
    plain: Balance,
    model: Model,
) -> list[str]:
    """A sentence for each sum that stands for values, and what to record."""
    by_text: dict[str, list[str]] = {}
    for key, c in sums.items():
        by_text.setdefault(c.text, []).append(key)
    return [_sum(keys, sums[keys[0]], found, plain, model) for keys in by_text.values()]


def next_way(sums: Mapping[str, Combination], then: str | None) -> str | None:
    """What to record next: what ``then`` says, and the other direction where it is missing."""
    each = {c.text: c for c in sums.values()}
    said = [NEXT.format(_capital(c.to_separate), c.text) for c in each.values() if c.to_separate]
    return " ".join(filter(None, (then, *said))) or None


def _sum(
    keys: Sequence[str],
    c: Combination,
    found: Mapping[str, Estimate],
    plain: Balance,
    model: Model,
) -> str:
    key, load = keys[0], plain.parameters.get(LOAD)
    if load is not None and not c.to_separate:
        both = plain.parameters[key].value, load.value
        return EACH.format(key, c.text, c.value, c.unit, *both)
    names = f"{' and '.join(keys)} {'is' if len(keys) == 1 else 'are'}"
    said, declared = ONE_WAY.format(names, c.text, c.value, c.unit), model.known().get(key)
    if declared is not None and LOAD in c.parts:
        less = c.parts[key] * (found[key].value - declared)
        torque = _value(LOAD, found) + less / c.parts[LOAD]
        said += AS_DECLARED.format(key, declared, c.unit, torque)
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
    both = {"Fc": 1.0, LOAD: float(ways[0])}
    ends = (value - half, value + half)
    return {"Fc": Combination(said_of(both)[0], value, Fc.unit, ends, "", both)}


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


def _never_rests(parts: Sequence[Stretch]) -> bool:
    """Whether all speeds are far above noise."""
    speeds = np.abs(np.concatenate([_speed(part) for part in parts]))
    return bool(np.all(speeds > MOVING * np.max(speeds, initial=0.0)))


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

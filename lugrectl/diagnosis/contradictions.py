"""What makes a log impossible as it was given: a sign, a column, the unit of a run, a held value.

Each is seen by base rows alone: the log as it is, and as it would be without the fault.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from ..blocks.block import unit_for
from ..blocks.model import Model
from ..core.display import with_interval
from ..core.errors import Refused
from ..core.option_names import option
from ..estimates.balance import LEVELS, Balance
from ..estimates.findings import AGAINST_HELD, Estimate
from ..record import Stretch
from ..torque_balance.maps import is_map
from ..torque_balance.values import base_row, means_the_same, misfit
from ..torque_balance.verdict import Answer

BETTER = 0.7  # of what a log leaves as it is: what it must leave without its fault
EXPLAINED = 0.1  # of the torque: with less left nothing is wrong
SIGN = "u has the wrong sign: give {}. The plain answer is that of the other sign."
SWAPPED = (
    "u and {0} seem to be swapped: the other way round the balance leaves {1:.2g} % of the RMS "
    "torque with a possible inertia. Give {2}."
)
HELD = (
    "{0} is {1} {2:.6g}{3}, but this log says {4}{3} ({5}): correct the value or its unit, or let "
    "it be fitted."
)
WOULD_BE = "{} is held at {:.4g}, but would be {:.4g}"
COULOMB = {"Fc": ("Coulomb", "N m"), "Fv": ("viscous", "N m s/rad")}
COMPARE = "Declare another law, or compare them ({})."
LACKS = "The declared law '{}' has no {} friction, and the log shows {:.3g} {} of it. "
UNFIT = "The declared law '{}' does not fit this log, whatever its values. "
OFF = 1.5  # times another value: farther than a missing effect takes a balance
SHARE, HALF = 0.05, 0.5  # of the torque that a held value leaves more; and of all: no answer

MOST_RUNS = 20  # that are compared with one another
ALIKE, QUARTER, LITTLE = 0.03, 0.25, 0.1  # relative: runs agree; a level is known; friction differs
ABOUT, FARTHER = 2.0, 3.0  # times a declared value: as it may be; a J so far off is looked at
DEG, RPM = 180 / np.pi, 30 / np.pi
# units and scales that undo it where a channel is so many times what it should be
TORQUES = {"u=-1": -1.0, "u=mN m": 1e3, "u=1000": 1e-3, "u=0.01": 1e2, "u=100": 1e-2}
TIMES = {"t=ms": 1e3, "t=us": 1e6, "t=1000": 1e-3}
ANGLES = {"theta=deg": DEG, "theta=57.29578": 1 / DEG, "theta=turn": 0.5 / np.pi,
          "theta=0.1591549": 2 * np.pi}  # fmt: skip
SPEEDS = {"w=deg/s": DEG, "w=rpm": RPM, "w=9.549297": 1 / RPM, "w=57.29578": 1 / DEG}
LENGTHS = {"theta=mm": 1e3, "theta=1000": 1e-3}
UNIT = (
    "{} is {:.4g} times what it is with the declared J and friction: give {}, or correct the model."
)
OPPOSITE = "{}: u has the opposite sign of {}: give {} for it, or leave it out."
TIMES_OTHERS = "{}: {} is {:.4g} times that of {}: give {} for it, or leave it out."
FRICTION = "{}: {:.0f} % {} friction than {}."
OTHERS = "The plain answer is that of the other runs."


def plain_row(parts: Sequence[Stretch], model: Model) -> Balance:
    """The base row; where it is refused, a balance that says why."""
    try:
        return base_row(parts, model)
    except Refused as no:
        said = f"{no} {no.experiment or ''}".rstrip()
        return Balance(refused=said, notes=(said,), motion=model.motion, stretches=tuple(parts))


def checked(parts: Sequence[Stretch], model: Model, names: Sequence[str]) -> Balance:
    """The base row, without runs in another unit, with what contradicts it; ``names`` of runs."""
    if is_map(parts):  # one run tells no levels, and none is known without the others
        return against_stated(parts, model, plain_row(parts, model))
    left_out, notes = unlike(parts, model, names)
    parts = [part for part in parts if part.run not in left_out]
    found = plain_row(parts, model)
    found = replace(found, unlike=tuple(left_out.values()), notes=(*notes, *found.notes))
    if said := in_another_unit(parts, model, found):
        return replace(found, against=(said,), hopeless=True)
    if not parts or not doubtful(found):
        return against_stated(parts, model, found)
    others = {SIGN: [replace(part, u=-part.u) for part in parts]}
    role = "w" if parts[0].theta is None else "theta"  # a w beside theta may be left out: no sign
    if all(getattr(p, role) is not None for p in parts) and any(np.ptp(p.u) for p in parts):
        others[SWAPPED] = [replace(p, **{"u": getattr(p, role), role: p.u}) for p in parts]
    made = {said: plain_row(other, model) for said, other in others.items()}
    made = {said: other for said, other in made.items() if _makes_a_drive(other, found)}
    if not made:
        return against_stated(parts, model, found)
    said, other = min(made.items(), key=lambda one: one[1].left or 0.0)
    if said == SIGN:
        said = SIGN.format(option("scale", "u=-1"))
        return replace(other, unlike=found.unlike, against=(said,), hopeless=True)
    given = option("columns", f"u=NAME,{role}=NAME")
    said = SWAPPED.format(role, 100.0 * (other.left or 0.0), given)
    return replace(found, refused=found.refused and said, against=(said,), hopeless=True)


def doubtful(found: Balance) -> bool:
    """Whether a balance is none of a drive: no inertia and much is left, or friction drives."""
    if found.refused or found.left is None:
        return True
    friction = [c.ci95 for c in found.combinations if "Fc" in c.parts]
    drives = any(ends is not None and ends[1] < 0 for ends in friction)
    return drives or "J" not in found.parameters and found.left > EXPLAINED


def _makes_a_drive(other: Balance, found: Balance) -> bool:
    """Whether a log without its supposed fault is a drive, and explains more."""
    if other.refused or other.left is None or doubtful(other) and "J" not in other.parameters:
        return False
    return found.left is None or other.left < BETTER * found.left


# ---- values that are held or bounded


def against_stated(parts: Sequence[Stretch], model: Model, found: Balance) -> Balance:
    """The balance with a sentence for each held or bounded value that the log contradicts by far;
    where nothing can be answered with it, that of the log without what is stated."""
    keys = {k for k, s in model.stated.items() if s.fixed or s.bounded}
    keys = sorted(k for k in keys if not model.declarations()[k].angle)
    free = plain_row(parts, replace(model, stated={})) if keys else Balance()
    if free.refused or free.left is None or free.left > HALF:
        return found  # nothing is stated, or the log itself is at fault
    said, most = [], 0.0
    for key in keys:
        e = free.parameters.get(key)
        value = None if e is None else model.kept({key: e.value})[key]  # the nearest allowed one
        if e is None or value is None or not _far(value, e):
            continue
        left = plain_row(parts, replace(model, stated={key: model.stated[key]})).left or 1.0
        if left > free.left + SHARE:
            said.append(_sentence(key, value, e, model))
            most = max(most, left)
    if not said:
        return found
    return replace(free if most > HALF else found, against=tuple(said), hopeless=most > HALF)


def contradicted(parts: Sequence[Stretch], model: Model) -> list[str]:
    """A sentence for each held value that the same law, fitted to the log, does not have."""
    held = {k: model.known()[k] for k in sorted(model.held())}
    found = plain_row(parts, replace(model, stated={})).parameters if held else {}
    off = {k: x for k, x in held.items() if k in found and not found[k].may_be(x)}
    made = [WOULD_BE.format(k, x, found[k].value) for k, x in off.items()]
    return [f"{AGAINST_HELD}: {', '.join(made)}."] if made else []


def _far(value: float, e: Estimate) -> bool:
    low, high = sorted((abs(value), abs(e.value)))
    return e.ci95 is not None and not e.may_be(value) and (high > OFF * low or value * e.value < 0)


def _sentence(key: str, value: float, e: Estimate, model: Model) -> str:
    stated = model.stated[key]
    how = "held at" if stated.fixed else "at least" if value > e.value else "at most"
    unit = model.unit(key)
    return HELD.format(key, how, value, "" if unit == "1" else f" {unit}", *with_interval(e))


# ---- a law that is not that of the drive


def unfit_law(made: Answer, shown: Model, plain: Balance, least: float) -> str:
    """A sentence where the declared law, at the values shown, cannot be the drive's; or ""."""
    law, motion = shown.friction.block, shown.motion
    lacks = [k for k in COULOMB if k not in law.own]
    if not lacks and means_the_same(law) or misfit(made.last, shown) < 2 * least:
        return ""
    for key in lacks:
        level = {**plain.uncertain, **plain.parameters}.get(key)
        if level is not None and level.ci95 is not None and level.ci95[0] > 0:
            kind, unit = COULOMB[key]
            said = LACKS.format(law.name, kind, level.value, unit_for(unit, motion))
            return said + COMPARE.format(option("law", "auto"))
    return UNFIT.format(law.name) + COMPARE.format(option("law", "auto"))


# ---- a channel in another unit or sign: the log is fitted again without each such fault


# J, Fc and Fv, and their relative errors (2, 3); those that are unknown are nan
Levels = np.ndarray


def levels(found: Balance) -> Levels | None:
    """What of the levels a balance knows; None where it is none of a drive."""
    both: Mapping[str, Estimate] = {**found.uncertain, **found.parameters}
    if doubtful(found) or not {*LEVELS} <= both.keys():
        return None
    value = np.array([both[k].value for k in LEVELS])
    ends = np.array([both[k].ci95 or (-np.inf, np.inf) for k in LEVELS])
    error = np.diff(ends)[:, 0] / 2 / np.abs(value)
    return np.where(error < QUARTER, [value, error], np.nan)


def agree(one: Levels | None, other: Levels | None, least: int, times: float = 1.0 + ALIKE) -> bool:
    """Whether at least so many levels are known of both, and none differs by more than chance and
    this factor allow."""
    if one is None or other is None:
        return False
    ratio, error = one[0] / other[0], np.hypot(one[1], other[1])
    known = np.isfinite(ratio)
    off = np.abs(np.log(np.maximum(ratio[known], 1e-300)))
    return known.sum() >= least and bool(np.all(off < np.log(times) + error[known]))


def fault(
    parts: Sequence[Stretch], model: Model, right: Levels, of: Mapping[str, float], times: float
) -> tuple[str, str, float]:
    """Which channel is how many times what makes the levels right, and what undoes it; or ""."""
    for undone, size in of.items():
        channel = undone.split("=")[0]
        if channel == "t":
            tried = [replace(p, dt=p.dt / size, t=p.t / size) for p in parts]
        else:
            tried = [replace(p, **{channel: getattr(p, channel) / size}) for p in parts]
        if agree(levels(plain_row(tried, model)), right, 2, times):
            return channel, option("scale" if undone[-1].isdigit() else "units", undone), size
    return "", "", 1.0


def of_motion(parts: Sequence[Stretch], model: Model) -> Mapping[str, float]:
    linear, turns = model.motion == "linear", parts[0].theta is not None
    return (LENGTHS if linear else ANGLES) if turns else {} if linear else SPEEDS


def unlike(
    parts: Sequence[Stretch], model: Model, names: Sequence[str]
) -> tuple[dict[int, str], list[str]]:
    """Runs that another unit or sign separates from the others, each with its sentence, and notes
    on the others; ``names`` are those of the runs."""
    runs = {run: [s for s in parts if s.run == run] for run in sorted({s.run for s in parts})}
    if not 2 <= len(runs) <= MOST_RUNS:
        return {}, []
    model, left_out, notes = replace(model, J=None, stated={}), dict[int, str](), []
    with np.errstate(all="ignore"):
        each = {run: levels(plain_row(own, model)) for run, own in runs.items()}
        votes = {run: sum(agree(x, y, 1) for y in each.values()) for run, x in each.items()}
        best = max(votes, key=votes.__getitem__)
        right, usual = each.pop(best), "the other runs" if votes[best] > 1 else names[best]
        for run, own in each.items():
            if right is None or agree(own, right, 1):
                continue
            if own is not None and agree(own, right, 1, ABOUT):  # no unit is so small a factor
                notes += another_friction(names[run], own[:, 1], right[:, 1], usual)
                continue
            of = {**TORQUES, **TIMES, **of_motion(runs[run], model)}
            channel, undo, size = fault(runs[run], model, right, of, 1.0 + ALIKE)
            if channel:
                other = OPPOSITE.format(names[run], usual, undo)
                times = TIMES_OTHERS.format(names[run], channel, size, usual, undo)
                left_out[run] = other if size == -1.0 else times
    return left_out, notes + [OTHERS] * bool(left_out)


def another_friction(name: str, one: np.ndarray, right: np.ndarray, usual: str) -> list[str]:
    """A sentence on Fc, with its error, that differs by more than chance."""
    change = one[0] / right[0] - 1
    if not abs(change) >= LITTLE + np.hypot(one[1], right[1]) * (1 + abs(change)):
        return []
    more = "more" if change > 0 else "less"
    return [FRICTION.format(name, 100 * abs(change), more, usual)]


def far_off(found: Balance, model: Model) -> bool:
    """Whether the log has an inertia so far from the declared one that a unit may be wrong."""
    declared, J = model.known().get("J"), {**found.uncertain, **found.parameters}.get("J")
    if not declared or J is None or J.ci95 is None:
        return False
    return J.ci95[0] > FARTHER * declared or 0 < J.ci95[1] < declared / FARTHER


def in_another_unit(parts: Sequence[Stretch], model: Model, found: Balance) -> str:
    """A sentence where one unit of the motion makes the declared J, Fc and Fv of those of the log;
    "" where none does. Another scale of u is no fault: shares of friction stay."""
    declared = np.array([model.known().get(k) or np.nan for k in LEVELS])
    if not far_off(found, model) or np.isnan(declared).any():
        return ""
    right, free = np.array([declared, 0 * declared]), replace(model, J=None, stated={})
    channel, undo, size = fault(parts, free, right, of_motion(parts, model), ABOUT)
    return UNIT.format(channel, size, undo) if channel else ""

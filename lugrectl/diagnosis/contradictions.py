"""What makes a log impossible as it was given: a sign, a column, the unit of a run, a held value.

Each is seen by base rows alone: the log as it is, and as it would be without the fault.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

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
from ..torque_balance.model_values import means_the_same, misfit
from ..torque_balance.plain import base_row
from ..torque_balance.verdict import Answer

BETTER = 0.7  # of what a log leaves as it is: what it must leave without its fault
EXPLAINED = 0.1  # of the torque: with less left nothing is wrong
SIGN = "u has the wrong sign: give {}. The plain answer is that of the other sign."
SWAPPED = (
    "u and {0} seem to be swapped: the other way round the balance leaves {1:.2g} % of the RMS "
    "torque with a possible inertia, as they are it {2}. Give {3}."
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
DEG, RPM = 180 / np.pi, 30 / np.pi
POWERS = {"u": (1, 1, 1), "theta": (-1, 0, -1), "w": (-1, 0, -1)}  # of J, Fc and Fv
# units and scales that undo it where a channel is so many times what it should be
TORQUES = {"u=-1": -1.0, "u=mN m": 1e3, "u=1000": 1e-3, "u=0.01": 1e2, "u=100": 1e-2}
TIMES = {"t=ms": 1e3, "t=us": 1e6, "t=1000": 1e-3}
ANGLES = {"theta=deg": DEG, "theta=57.29578": 1 / DEG, "theta=turn": 0.5 / np.pi,
          "theta=0.1591549": 2 * np.pi}  # fmt: skip
SPEEDS = {"w=deg/s": DEG, "w=rpm": RPM, "w=9.549297": 1 / RPM, "w=57.29578": 1 / DEG}
LENGTHS = {"theta=mm": 1e3, "theta=1000": 1e-3}
OPPOSITE = "{}: u has the opposite sign of {}: give {} for it, or leave it out."
ABOUT, FARTHER = 2.0, 3.0  # times a declared value: as it may be; a J so far off is looked at
UNIT = (
    "{} is {:.4g} times what it is with the declared J and friction: give {}, or correct the model."
)
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
    if not doubtful(found):
        return against_stated(parts, model, found)
    turned = _turned(parts, model)
    if said := swapped(parts, model, found, turned):
        return replace(found, refused=found.refused and said, against=(said,), hopeless=True)
    if _makes_a_drive(turned, found):
        said = SIGN.format(option("scale", "u=-1"))
        return replace(turned, unlike=found.unlike, against=(said,), hopeless=True)
    return against_stated(parts, model, found)


def doubtful(found: Balance) -> bool:
    """Whether a balance is none of a drive: no inertia and much is left, or friction drives."""
    if found.refused or found.left is None:
        return True
    friction = [c.ci95 for c in found.combinations if "Fc" in c.parts]
    drives = any(ends is not None and ends[1] < 0 for ends in friction)
    return drives or "J" not in found.parameters and found.left > EXPLAINED


def _turned(parts: Sequence[Stretch], model: Model) -> Balance:
    """The base row with the other sign of u."""
    return plain_row([replace(part, u=-part.u) for part in parts], model)


def _makes_a_drive(other: Balance, found: Balance) -> bool:
    """Whether a log without its supposed fault is a drive, and explains more."""
    if other.refused or other.left is None or doubtful(other) and "J" not in other.parameters:
        return False
    return found.left is None or other.left < BETTER * found.left


def swapped(parts: Sequence[Stretch], model: Model, found: Balance, turned: Balance) -> str:
    """A sentence where only the exchange of u with theta or w makes a drive of the log, else ""."""
    if all(np.ptp(p.u) == 0 for p in parts):
        return ""
    role = "w" if parts[0].theta is None else "theta"  # a w beside theta may be left out: no sign
    if any(getattr(p, role) is None for p in parts):
        return ""
    other = plain_row([replace(p, **{"u": getattr(p, role), role: p.u}) for p in parts], model)
    if other.refused or other.left is None or "J" not in other.parameters:
        return ""
    known = [b.left for b in (found, turned) if b.left is not None]
    if other.left >= min([HALF, *known]):
        return ""
    how = "finds none" if found.left is None or found.refused else "leaves more"
    given = option("columns", f"u=NAME,{role}=NAME")
    return SWAPPED.format(role, 100.0 * other.left, how, given)


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
    """ "J is held at 22 kg m2, but this log says 0.0022 kg m2 (0.0021 to 0.0023): ..." """
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


# ---- runs in another unit or sign


@dataclass(frozen=True)
class Levels:
    """J, Fc and Fv of one run (3,), twice their relative errors, and which of them are known."""

    name: str
    parts: Sequence[Stretch]
    value: np.ndarray
    error: np.ndarray

    @property
    def known(self) -> np.ndarray:
        return self.error < QUARTER

    def agrees(self, other: Levels, ratios: np.ndarray | float = 1.0) -> bool:
        """Whether ratios explain how all that is known of both runs differs."""
        both = self.known & other.known
        gap = np.abs(self.value / (other.value * ratios) - 1)
        return bool(both.any() and np.all((gap < ALIKE + np.hypot(self.error, other.error))[both]))


def unlike(
    parts: Sequence[Stretch], model: Model, names: Sequence[str]
) -> tuple[dict[int, str], list[str]]:
    """Runs that another unit or sign separates from the others, each with its sentence, and notes
    on the others; ``names`` are those of the runs."""
    runs = sorted({s.run for s in parts})
    if not 2 <= len(runs) <= MOST_RUNS:
        return {}, []
    model = replace(model, J=None, stated={})
    with np.errstate(all="ignore"):
        each = [_levels(names[run], [s for s in parts if s.run == run], model) for run in runs]
        found = [levels for levels in each if levels is not None]
        return _compared(found, model) if len(found) > 1 else ({}, [])


def _levels(name: str, parts: Sequence[Stretch], model: Model) -> Levels | None:
    """The levels of one run, of either sign; None where it has no answer of its own."""
    found, sign = plain_row(parts, model), 1.0
    if doubtful(found):
        turned = _turned(parts, model)
        if _makes_a_drive(turned, found):
            found, sign = turned, -1.0
    both: Mapping[str, Estimate] = {**found.uncertain, **found.parameters}
    if found.refused or not {*LEVELS} <= both.keys():
        return None
    value = np.array([both[k].value for k in LEVELS])
    ends = np.array([both[k].ci95 or (-np.inf, np.inf) for k in LEVELS])
    levels = Levels(name, parts, sign * value, np.diff(ends)[:, 0] / 2 / np.abs(value))
    return levels if levels.known[:2].any() else None


def _compared(found: Sequence[Levels], model: Model) -> tuple[dict[int, str], list[str]]:
    """Every other run against the one with which most agree; of two, the one that is possible."""
    votes = [sum(one.agrees(other) for other in found) for one in found]
    possible = [not np.any(one.known & (one.value < 0)) for one in found]
    best = max(range(len(found)), key=lambda i: (votes[i], possible[i]))  # the first of equal ones
    reference = found[best]
    usual = "the other runs" if votes[best] > 1 else reference.name
    left_out, notes = dict[int, str](), []
    for one in found:
        if one is reference or one.agrees(reference):
            continue
        if said := _another_unit(one, reference, model, usual):
            left_out[one.parts[0].run] = said
        else:
            notes += _another_friction(one, reference, usual)
    return left_out, notes + [OTHERS] * bool(left_out)


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
    one = _levels("the log", parts, replace(model, J=None, stated={}))
    if one is None:
        return ""
    for undone, size in _of_motion(one, model).items():
        channel = undone.split("=")[0]
        ratio = one.value / (declared * size ** np.array(POWERS[channel]))
        if np.all((ratio > 1 / ABOUT) & (ratio < ABOUT)):
            return UNIT.format(channel, size, _undo(undone))
    return ""


def _of_motion(one: Levels, model: Model) -> dict[str, float]:
    """Units and scales of the channel that the motion of a run is taken from."""
    linear, turns = model.motion == "linear", one.parts[0].theta is not None
    return (LENGTHS if linear else ANGLES) if turns else {} if linear else SPEEDS


def _undo(undone: str) -> str:
    return option("scale" if undone[-1].isdigit() else "units", undone)


def _another_unit(one: Levels, reference: Levels, model: Model, usual: str) -> str:
    """The one factor that explains the difference, in a sentence; "" if none does."""
    for undone, size in (TORQUES | TIMES | _of_motion(one, model)).items():
        channel = undone.split("=")[0]
        if _explains(size, channel, one, reference, model):
            if size == -1.0:
                return OPPOSITE.format(one.name, usual, _undo(undone))
            return TIMES_OTHERS.format(one.name, channel, size, usual, _undo(undone))
    return ""


def _explains(size: float, channel: str, one: Levels, reference: Levels, model: Model) -> bool:
    """Whether a channel of the run is that many times that of the reference."""
    if channel != "t":
        known = (one.known & reference.known)[:2].all()
        return bool(known) and one.agrees(reference, size ** np.array(POWERS[channel], float))
    longer = np.log(one.parts[0].dt / reference.parts[0].dt)
    if abs(longer - np.log(size)) >= abs(longer):
        return False
    # windows have a length in s: fitted again at the other rate
    again = _levels(one.name, [replace(s, dt=s.dt / size, t=s.t / size) for s in one.parts], model)
    return again is not None and again.agrees(reference)


def _another_friction(one: Levels, reference: Levels, usual: str) -> list[str]:
    """A sentence on friction that differs by more than chance."""
    change = one.value[1] / reference.value[1] - 1
    chance = np.hypot(one.error[1], reference.error[1]) * (1 + abs(change))
    known = (one.known & reference.known)[1] and change >= -1
    if not known or abs(change) < LITTLE + chance:
        return []
    more = "more" if change > 0 else "less"
    return [FRICTION.format(one.name, 100 * abs(change), more, usual)]

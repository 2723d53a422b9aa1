"""The recorded speed against the position's: unit, sign, offset and lag."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from ..core.errors import InputError
from ..core.option_names import option
from .columns.units import UNITS, Unit, si_unit
from .motion_band import BLOCKS, long_enough, longest, low_passed, regression
from .record import Record
from .samples.clock import plausible

_CLOSE = 0.02  # a ratio this close to that of two units means that these were mixed up
_SAME = 0.9  # share of a channel's power that the other's derivative must explain
_OFF = 0.03  # a ratio this far from 1 is reported
_LAG = 1.5  # samples
_GEARS = 500.0  # the usual ratios
_SURE = 8.0  # standard errors
_STEADY = 0.1  # least change of a speed, as a share of it, by which signals can be compared
_LEAST_OFFSET = 0.005  # of the RMS speed


def fitting_speed(record: Record, labels: Mapping[str, str | None] | None = None) -> Record:
    """The record with a w that is consistent with d theta/dt; ``labels`` as for :func:`audit`.

    theta in rad, w in rad/s (m, m/s on a linear axis); the record's messages report each change.
    A w that does not fit d theta/dt is left out.
    """
    return _velocity(record, labels or {})


@dataclass(frozen=True)
class Mistake:
    """A channel that is in another unit than it was taken in.

    ``factor`` is what its values in SI are to be multiplied by, ``unit`` the name of its unit.
    """

    role: str
    unit: str
    factor: float
    said: str


def unit_mistake(record: Record, labels: Mapping[str, str | None]) -> Mistake | None:
    """The unit that w, theta or t is in, where w and d theta/dt differ by a factor of units.

    None where they agree, or differ by another factor. Raises InputError where the unit of t is
    the one that is not as assumed: all rates depend on it.
    """
    if not _comparable(record):
        return None
    found = _compared(record)
    ratio = found.ratio if found.related else _steady_ratio(record)
    if not ratio or abs(abs(ratio) - 1) <= _OFF:
        return None
    _check_time(record, labels, ratio)
    return _mistake(record, labels, ratio)


def _comparable(record: Record) -> bool:
    """Whether w and theta are both there, long enough, and change."""
    if record.w is None or record.theta is None or not long_enough(record):
        return False
    return bool(np.ptp(record.w) > 0 and np.ptp(record.theta) > 0)


@dataclass(frozen=True)
class _Compared:
    """w over d theta/dt, 1 or -1 where it may be that; its lag and the least one, in s."""

    ratio: float
    agreement: float
    lag: float = 0.0
    least_lag: float = 0.0

    @property
    def related(self) -> bool:
        return self.agreement >= 0.25


def _compared(record: Record) -> _Compared:
    """Compare w with d theta/dt.

    Noise in the regressor biases a fitted ratio towards zero, so the two regressions, w on
    d theta/dt and d theta/dt on w, bracket the true ratio. With few swings of the motion it is
    less certain.
    """
    slope, (ratio, lead), (inverse, lag) = _both_ways(record)
    agreement = ratio * inverse
    if agreement < 0.25:
        return _Compared(0.0, agreement)
    swings = 1 + np.count_nonzero(np.diff(np.sign(slope - slope.mean())))
    margin = _OFF + 3 * np.sqrt(max(1 - agreement, 0.0) / swings)
    low, high = sorted((abs(ratio), abs(1 / inverse)))
    same = low <= 1 + margin and high >= 1 - margin
    size = 1.0 if same else float(np.sqrt(ratio / inverse))
    return _Compared(size * float(np.sign(ratio)), agreement, lag, min(lag, -lead))


def _velocity(record: Record, labels: Mapping[str, str | None]) -> Record:
    if not _comparable(record):
        return record
    found = _compared(record)
    if not found.related:
        steady = _steady_ratio(record)
        if steady:
            same = abs(steady - 1) <= _OFF
            return record if same else _converted(record, labels, steady)[1]
        swapped = replace(record, theta=record.w, w=record.theta)
        if _derives(swapped):
            return swapped.with_messages("theta is d w/dt: the two were exchanged.")
        little = f"has little in common with it (R2 = {max(found.agreement, 0.0):.2f})"
        return _ignored(record, little)
    if abs(found.ratio) == 1.0:
        fits, record = True, _turned(record) if found.ratio < 0 else record
    else:
        fits, record = _converted(record, labels, found.ratio)
    offset = _offset(record) if fits else 0.0
    if offset:
        unit = si_unit("w", record.motion)
        return replace(record, w=None).with_messages(
            f"w is {abs(offset):.3g} {unit} too {'high' if offset > 0 else 'low'} against "
            "d theta/dt: w is ignored and the velocity is computed from theta."
        )
    if fits and found.least_lag > _LAG * record.dt:
        record = record.with_messages(
            f"w lags theta by {1e3 * found.lag:.3g} ms, as a filtered velocity does: not changed."
        )
    return record


def _both_ways(record: Record) -> tuple[np.ndarray, tuple[float, float], tuple[float, float]]:
    """d theta/dt, the regression of w on it, and that of it on w."""
    part = longest(record)
    assert part.w is not None and part.theta is not None
    w, slope = low_passed(part, part.w, np.gradient(part.theta, part.dt))
    return slope, regression(w, slope, part.dt), regression(slope, w, part.dt)


def _steady_ratio(record: Record) -> float:
    """Mean w over mean d theta/dt if the speed does not vary enough to compare them; else 0."""
    part = longest(record)
    assert part.w is not None and part.theta is not None
    w, slope = low_passed(part, part.w, np.gradient(part.theta, part.dt))
    mean = float(slope.mean())
    if not np.std(w - slope * (w.mean() / mean if mean else 0.0)) < _STEADY * abs(w.mean()):
        return 0.0
    return float(w.mean() / mean) if np.std(slope) < _STEADY * abs(mean) else 0.0


def _offset(record: Record) -> float:
    """The offset of w against d theta/dt, beside gain and lag; 0 where it may be none."""
    part = longest(record)
    assert part.w is not None and part.theta is not None
    w, slope = low_passed(part, part.w, np.gradient(part.theta, part.dt))
    first = np.gradient(slope, part.dt)
    terms = np.column_stack([slope, first, np.gradient(first, part.dt), np.ones_like(slope)])
    size = np.linalg.norm(terms, axis=0)
    if not size.all():
        return 0.0
    blocks = np.array_split(np.arange(len(w)), BLOCKS)
    grams = np.array([terms[b].T @ terms[b] for b in blocks]) / np.outer(size, size)
    sides = np.array([terms[b].T @ w[b] for b in blocks]) / size

    def constant(keep: np.ndarray) -> float:
        found = np.linalg.lstsq(grams[keep].sum(0), sides[keep].sum(0), rcond=1e-12)[0]
        return float(found[-1] / size[-1])

    every = np.arange(BLOCKS)
    offset = constant(every)
    error = np.sqrt((BLOCKS - 1) * np.var([constant(every != k) for k in every]))
    least = _LEAST_OFFSET * float(np.sqrt(np.mean(slope**2)))
    return offset if abs(offset) > max(_SURE * float(error), least) else 0.0


def _derives(record: Record) -> bool:
    """Whether w is d theta/dt, in the same unit."""
    _, (ratio, _), (inverse, _) = _both_ways(record)
    return ratio * inverse > _SAME and abs(np.sqrt(ratio / inverse) - 1.0) < _OFF


def _ignored(record: Record, why: str) -> Record:
    return replace(record, w=None).with_messages(
        f"w is not d theta/dt but {why}: w is ignored and the velocity is computed from theta."
    )


def _turned(record: Record) -> Record:
    assert record.w is not None
    return replace(record, w=-record.w).with_messages(
        "w has the opposite sign of d theta/dt: its sign was changed."
    )


def _mistakes(
    record: Record, labels: Mapping[str, str | None]
) -> list[tuple[float, str, Unit, Unit]]:
    """Return (ratio of w to d theta/dt, role, unit assumed, unit meant) of each mix-up of units.

    A channel without a stated unit is suspected first, then one stated in SI: another unit is
    stated on purpose, SI often by habit.
    """
    found = []
    for role in ("w", "theta"):
        label = labels.get(role)
        taken = UNITS[label or si_unit(role, record.motion)]
        order = 0 if label is None else 1 if taken.factor == 1 else 2
        for meant in UNITS.values():
            if (meant.quantity, meant.motion) == (taken.quantity, record.motion):
                ratio = taken.factor / meant.factor
                found.append((order, ratio if role == "w" else 1 / ratio, role, taken, meant))
    found = [row for row in found if row[3] is not row[4] and row[3].quantity != "raw"]
    return [row[1:] for row in sorted(found, key=lambda row: row[0])]


def _mistake(record: Record, labels: Mapping[str, str | None], ratio: float) -> Mistake | None:
    """The first mix-up of units that makes w so many times d theta/dt."""
    for expected, role, taken, meant in _mistakes(record, labels):
        if abs(abs(ratio) / expected - 1) <= _CLOSE:
            stated = "stated" if labels.get(role) else "taken"
            return Mistake(
                role,
                meant.name,
                meant.factor / taken.factor,
                f"{role} is {stated} in {taken.name} but in fact in {meant.name} "
                f"(w is {abs(ratio):.4g} times d theta/dt): converted.",
            )
    return None


def _check_time(record: Record, labels: Mapping[str, str | None], ratio: float) -> None:
    """InputError if the unit of t is what makes w so many times d theta/dt.

    It is where no drive is logged at the rate that the taken unit means, or where the others have
    a stated unit and t has none; and where one is at the rate that the other unit means.
    """
    if "t" not in labels:
        return
    stated = labels["t"] is not None
    taken = UNITS[labels["t"] or "s"]
    clear = not stated and labels.get("w") is not None and labels.get("theta") is not None
    for unit in UNITS.values():
        finer = unit.factor / taken.factor
        if unit.quantity != "time" or unit == taken or abs(abs(ratio) * finer - 1) > _CLOSE:
            continue
        if (clear or not plausible(record.dt)) and plausible(record.dt * finer):
            how = f"is stated in {taken.name} and" if stated else "has no unit and"
            raise InputError(
                f"{record.source}: t {how} does not look like {taken.name} (w is "
                f"{abs(ratio):.4g} times d theta/dt): give {option('units', f't={unit.name}')}"
                + ("." if stated else f", or {option('units', 't=s')} if that is right.")
            )


def _geared(ratio: float) -> str:
    """What to give where w is the motor's and theta the joint's."""
    if not 2.0 < ratio < _GEARS:
        return ""
    joint, motor = option("scale", f"w={1 / ratio:.4g}"), option("scale", f"theta={ratio:.4g}")
    gives = f"{joint} gives the joint's motion, {motor} the motor's"
    return f" (a motor with a gear of {ratio:.4g}? Then {gives})"


def _converted(
    record: Record, labels: Mapping[str, str | None], ratio: float
) -> tuple[bool, Record]:
    """Whether a wrong unit explains the ratio, and the record with it corrected or without w."""
    found = _mistake(record, labels, ratio)
    if found is None:
        return False, _ignored(record, f"{ratio:.4g} times it{_geared(abs(ratio))}")
    values = getattr(record, found.role) * found.factor
    record = replace(record, **{found.role: values}).with_messages(found.said)
    return True, _turned(record) if ratio < 0 else record

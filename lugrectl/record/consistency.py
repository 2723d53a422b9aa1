"""Checks of a record: faults that are corrected, faults that are only reported, refusals."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from scipy.signal import butter, sosfiltfilt

from ..core.errors import InputError, Refused
from ..core.numeric import column_sizes, rms
from ..core.option_names import option
from ..core.unit_names import si_unit
from .columns.names import UNITS
from .columns.raw_numbers import asked
from .record import Record
from .samples.clock import plausible
from .samples.rows import REQUIRED

_BAND = 30.0  # Hz; the motion below this frequency is compared
_BLOCKS = 20  # of time, whose spread gives the error of what is estimated
_SURE = 8.0  # standard errors
_STEADY = 0.1  # least change of a speed, as a share of it, by which signals can be compared
_CLOSE = 0.02  # a ratio this close to that of two units means that these were mixed up
_ALIKE = 0.95  # least R2 of a speed with its angle
_OFF = 0.03  # a ratio this far from 1 is reported
_LAG = 1.5  # samples
_GEARS = 500.0  # the usual ratios
_LEAST_OFFSET = 0.005  # of the RMS speed
# w in one unit and theta in another, neither stated: (w over d theta/dt, theta, w).
_BOTH = ((60.0, "rev", "rpm"), (1 / 6, "deg", "rpm"), (360.0, "rev", "deg/s"),
         (1 / 360, "deg", "rev/s"))  # fmt: skip
_IGNORED = "w is ignored and the velocity is computed from theta."
Labels = Mapping[str, str | None]


def audit(record: Record, *, alone: bool = True) -> Record:
    """Correct faults of a record that have one possible cause, report others; Refused if dead."""
    return fitting_speed(_alive(record, alone))


# ---- dead channels ------------------------------------------------------------------


def refuse_dead(records: Sequence[Record]) -> None:
    """Refuse channels that are constant over all records."""
    for role in REQUIRED:
        given = [r.channels()[role] for r in records if role in r.channels()]
        if given and _is_constant(np.array([f(x) for x in given for f in (np.min, np.max)])):
            source = records[0].source if len(records) == 1 else f"{len(records)} records"
            raise _dead(source, role, min(map(np.min, given)), "reverses at several speeds")


def _dead(source: str, role: str, value: float, how: str) -> Refused:
    meaning = "nothing moves"
    if role == "u":
        one = "one torque throughout, which does not tell inertia from friction"
        meaning = f"dead torque channel, or {one if value else 'a drive that coasts'}"
    return Refused(
        f"{source}: {role} is constant ({value:.6g}): {meaning}.",
        f"Record a motion that starts, stops and {how}, with its torque.",
    )


def _is_constant(values: np.ndarray) -> bool:
    return bool(np.ptp(values) <= 1e-9 * np.abs(values).max(initial=0.0))


def _is_steady(record: Record) -> bool:
    """Return whether the drive keeps one speed."""
    edges = np.linspace(0, record.samples - 1, 9).astype(int)
    if record.samples < 18:
        return False
    if record.theta is not None:
        means = np.diff(record.theta[edges]) / np.diff(edges)
    else:
        assert record.w is not None
        means = np.array([part.mean() for part in np.split(record.w, edges[1:-1])])
    return bool(np.ptp(means) < _STEADY * abs(means.mean()))


def _is_noise(values: np.ndarray) -> bool:
    """Return whether values are uncorrelated from sample to sample, about zero."""
    spread, x = np.std(values), values - values.mean()
    sure = min(5 / np.sqrt(len(x)), 0.5)  # a few samples can show that only roughly
    lag1 = np.mean(x[1:] * x[:-1]) / spread**2
    return bool(abs(lag1) < sure and abs(values.mean()) < sure * spread)


def _alive(record: Record, alone: bool) -> Record:
    """The record without a w that is constant while theta is not; Refused if it is dead."""
    theta, w = record.theta, record.w
    moves = theta is not None and not (_is_constant(theta) or _is_steady(record))
    if w is not None and moves and _is_constant(w):
        record = _without_w(record, f"constant ({w[0]:.6g})")
    for role in REQUIRED:
        values = getattr(record, role)
        if values is None or not _is_constant(values):
            continue
        # one point of a friction curve, and beside other runs one of several torques
        on_a_curve = role != "theta" and values[0] != 0 and _is_steady(record)
        if not on_a_curve and (alone or role != "u"):
            raise _dead(record.source, role, values[0], "reverses")
    if theta is not None and (few := len(np.unique(theta))) < 4:
        why = f"theta takes {few} values only: nothing moves by more than the sensor's step."
        raise Refused(f"{record.source}: {why}", "Record a motion of many sensor steps.")
    if theta is None and w is not None and _is_noise(w):
        why = "w is noise about zero: nothing moves."
        raise Refused(f"{record.source}: {why}", "Record a motion well above the sensor's noise.")
    return record


def _without_w(record: Record, what: str) -> Record:
    said = f"w is not d theta/dt but {what}: {_IGNORED}"
    return replace(record, w=None).with_messages(said)


# ---- the speed against the position's: unit, sign and offset ------------------------


class _Speeds(NamedTuple):
    """How w relates to d theta/dt below ``_BAND``: their ratio, 1 or -1 where it may be that, how
    far they agree, the offset of w and its error, the RMS speed, and the lag of w, s, with the
    least one."""

    ratio: float
    agreement: float
    offset: float = 0.0
    error: float = np.inf
    size: float = 0.0
    lag: float = 0.0
    least_lag: float = 0.0


def _speeds(record: Record) -> _Speeds | None:
    """Compare both; None where one is missing, too short, or does not change."""
    edge = min(_BAND, record.rate / 20)
    part = max(record.segments(), key=lambda s: s.stop - s.start)
    cut = int(record.rate / edge)  # a period at each end, which the filter spoils
    if record.w is None or record.theta is None or part.stop - part.start <= 2 * (cut + _BLOCKS):
        return None
    if not (np.ptp(record.w[part]) > 0 and np.ptp(record.theta[part]) > 0):
        return None
    sos, dt = butter(3, edge, fs=record.rate, output="sos"), record.dt
    w, slope = (
        sosfiltfilt(sos, x)[cut : len(x) - cut]
        for x in (record.w[part], np.gradient(record.theta[part], dt))
    )
    # noise biases a ratio towards 0, so two regressions bracket the true one
    (ratio, lead, offset, error), (inverse, lag, *_) = _fitted(w, slope, dt), _fitted(slope, w, dt)
    agreement = ratio * inverse
    if agreement < 0.25:
        return _Speeds(_steady_ratio(w, slope), agreement)
    swings = 1 + np.count_nonzero(np.diff(np.sign(slope - slope.mean())))
    margin = _OFF + 3 * np.sqrt(max(1 - agreement, 0.0) / swings)
    low, high = sorted((abs(ratio), abs(1 / inverse)))
    same = low <= 1 + margin and high >= 1 - margin
    size = 1.0 if same else float(np.sqrt(ratio / inverse))
    sign = float(np.sign(ratio))
    return _Speeds(size * sign, agreement, offset, error, rms(slope), lag, min(lag, -lead))


def _fitted(target: np.ndarray, source: np.ndarray, dt: float) -> tuple[float, float, float, float]:
    """Fit target = g (source + T d source/dt) + ... + c: g, T, c, and the error of c by leaving out
    blocks of time."""
    first = np.gradient(source, dt)
    x = np.column_stack([source, first, np.gradient(first, dt), np.ones_like(source)])
    size = column_sizes(x)
    blocks = np.array_split(np.arange(len(x)), _BLOCKS)
    grams = np.array([(x[b] / size).T @ (x[b] / size) for b in blocks])
    sides = np.array([(x[b] / size).T @ target[b] for b in blocks])

    def solved(keep: Any) -> np.ndarray:
        return np.linalg.lstsq(grams[keep].sum(0), sides[keep].sum(0), rcond=1e-12)[0] / size

    every = np.arange(_BLOCKS)
    left, (g, first_g, _, c) = [solved(every != k)[3] for k in every], solved(every)
    error = np.sqrt((_BLOCKS - 1) * np.var(left))
    return float(g), float(first_g / g) if g else 0.0, float(c), float(error)


def _steady_ratio(w: np.ndarray, slope: np.ndarray) -> float:
    """Mean w over mean d theta/dt if the speed varies too little to compare them; else 0."""
    mean, other = float(w.mean()), float(slope.mean())
    ratio = mean / other if other else 0.0
    alike = np.std(w - ratio * slope) < _STEADY * abs(mean)
    if not alike or np.std(slope) >= _STEADY * abs(other):
        return 0.0
    return 1.0 if abs(ratio - 1) <= _OFF else ratio


def fitting_speed(record: Record) -> Record:
    """The record with a w that fits d theta/dt, or without one; each change is a message."""
    speeds = _speeds(record)
    if speeds is None or record.w is None:
        return record
    ratio, size = speeds.ratio, abs(speeds.ratio)
    if size != 1.0:
        _refuse_swapped(record)
    if not ratio:
        r2 = max(speeds.agreement, 0.0)
        return _without_w(record, f"has little in common with it (R2 = {r2:.2f})")
    if size != 1.0:
        gear = ""
        if 2.0 < size < _GEARS:  # w may be the motor's and theta the joint's
            joint, motor = (
                option("scale", f"w={1 / size:.4g}"),
                option("scale", f"theta={size:.4g}"),
            )
            gives = f"{joint} gives the joint's motion, {motor} the motor's"
            gear = f" (a motor with a gear of {size:.4g}? Then {gives})"
        return _without_w(record, f"{ratio:.4g} times it{gear}")
    if ratio < 0:
        said = "w has the opposite sign of d theta/dt: its sign was changed."
        record = replace(record, w=-record.w).with_messages(said)
    offset = ratio * speeds.offset
    if abs(offset) > max(_SURE * speeds.error, _LEAST_OFFSET * speeds.size):
        side = f"{si_unit('w', record.motion)} too {'high' if offset > 0 else 'low'}"
        said = f"w is {abs(offset):.3g} {side} against d theta/dt: {_IGNORED}"
        return replace(record, w=None).with_messages(said)
    if speeds.least_lag > _LAG * record.dt:
        said = (
            f"w lags theta by {1e3 * speeds.lag:.3g} ms, as a filtered velocity does: not changed."
        )
        record = record.with_messages(said)
    return record


def _refuse_swapped(record: Record) -> None:
    """InputError where another pair of the channels is a speed and the angle that it integrates."""
    theta, w = record.theta, record.w
    for name, one in (
        ("u", replace(record, w=record.u)),
        ("theta", replace(record, theta=w, w=theta)),
    ):
        speeds = _speeds(one)
        if speeds and speeds.ratio == 1.0 and speeds.agreement > _ALIKE:
            why = f"{name} holds the speed, and w does not: {name} and w seem to be swapped"
            given = option("columns", f"{name}=NAME,w=NAME")
            raise InputError(f"{record.source}: {why}: give {given} the other way round.")


# ---- units --------------------------------------------------------------------------


def unit_mistake(record: Record, labels: Labels) -> tuple[str, str, float, str] | None:
    """The likeliest mix-up by which w is not d theta/dt, else None (units in SI are often stated by
    habit): the role, its true unit, the factor on its values in SI, and a sentence; InputError if
    the unit of t is wrong."""
    speeds = _speeds(record)
    ratio = abs(speeds.ratio) if speeds else 0.0
    if not ratio or abs(ratio - 1) <= _OFF:
        return None
    _check_time(record, labels, ratio)
    for expected, angle, per_second in _BOTH if labels["w"] is labels["theta"] is None else ():
        if abs(ratio / expected - 1) < _OFF:
            why = f"w is {ratio:.4g} times d theta/dt, as with {per_second} and {angle}"
            raise asked(record.source, why, angle, per_second)
    found: list[tuple[int, str, Any, Any]] = []
    for role in ("w", "theta"):
        label = labels.get(role)
        taken = UNITS[label or si_unit(role, record.motion)]
        order = 0 if label is None else 1 if taken.factor == 1 else 2
        for meant in UNITS.values():
            same = (meant.quantity, meant.motion) == (taken.quantity, record.motion)
            expected = (taken.factor / meant.factor) ** (1 if role == "w" else -1)
            if same and meant is not taken and abs(ratio / expected - 1) <= _CLOSE:
                found.append((order, role, taken, meant))
    if not found:
        return None
    _, role, taken, meant = min(found, key=lambda row: row[0])
    said = (
        f"{role} is {'stated' if labels.get(role) else 'taken'} in {taken.name} but in fact in "
        f"{meant.name} (w is {ratio:.4g} times d theta/dt): converted."
    )
    return role, meant.name, meant.factor / taken.factor, said


def _check_time(record: Record, labels: Labels, ratio: float) -> None:
    """InputError if a wrong unit of t makes w so many times d theta/dt, and the rate unusual."""
    if "t" not in labels:
        return
    stated = labels["t"] is not None
    taken = UNITS[labels["t"] or "s"]
    clear = not stated and labels.get("w") is not None and labels.get("theta") is not None
    for unit in UNITS.values():
        finer = unit.factor / taken.factor
        if unit.quantity != "time" or unit == taken or abs(ratio * finer - 1) > _CLOSE:
            continue
        if (clear or not plausible(record.dt)) and plausible(record.dt * finer):
            how = f"is stated in {taken.name} and" if stated else "has no unit and"
            other = "" if stated else f", or {option('units', 't=s')} if that is right"
            raise InputError(
                f"{record.source}: t {how} does not look like {taken.name} (w is {ratio:.4g} "
                f"times d theta/dt): give {option('units', f't={unit.name}')}{other}."
            )

"""Checks of a record: faults that are corrected, faults that are only reported, refusals."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from scipy.signal import butter, sosfiltfilt

from ..core.errors import InputError, Refused
from ..core.numeric import column_sizes
from ..core.option_names import option
from ..core.unit_names import si_unit
from .columns.names import UNITS
from .record import Record
from .samples.clock import plausible

_BAND, _SLOW_BAND = 30.0, 5.0  # Hz; the motion below this frequency is compared
_BLOCKS = 20  # of time, whose spread gives the error of what is estimated
_SURE = 8.0  # standard errors
_STEADY = 0.1  # least change of a speed, as a share of it, by which signals can be compared
_CLOSE = 0.02  # a ratio this close to that of two units means that these were mixed up
_SAME = 0.9  # share of a channel's power that the other's derivative must explain
_OFF = 0.03  # a ratio this far from 1 is reported
_LAG = 1.5  # samples
_GEARS = 500.0  # the usual ratios
_LEAST_OFFSET = 0.005  # of the RMS speed
_DEAD = ("u", "w", "theta")
_IGNORED = "w is ignored and the velocity is computed from theta."
Labels = Mapping[str, str | None]


def audit(record: Record, *, alone: bool = True) -> Record:
    """Correct faults of a record that have one possible cause, report others; Refused if dead."""
    return _saturation(_torque_sign(fitting_speed(_alive(record, alone))))


# ---- slow signals -------------------------------------------------------------------


def _longest(record: Record, band: float = _BAND) -> tuple[Record, float] | None:
    """The longest stretch, and its band below ``band``, Hz; None where, without a period of that at
    each end, which the filter spoils, it is too short."""
    edge = min(band, record.rate / 20)
    part = max(record.segments(), key=lambda s: s.stop - s.start)
    if part.stop - part.start <= 2 * (int(record.rate / edge) + _BLOCKS):
        return None
    return record.slice(part.start, part.stop), edge


def _low_passed(
    rate: float, edge: float, *signals: np.ndarray, ends: bool = False
) -> list[np.ndarray]:
    """Low-pass filtered signals (the band of the motion), with or without their ends."""
    sos, cut = butter(3, edge, fs=rate, output="sos"), 0 if ends else int(rate / edge)
    return [sosfiltfilt(sos, signal)[cut : len(signal) - cut] for signal in signals]


def _jackknifed(
    columns: Sequence[np.ndarray], y: np.ndarray, function: Callable[[np.ndarray], np.ndarray]
) -> tuple[np.ndarray, np.ndarray]:
    """Coefficients of a fit of y, and the error of a function of them by leaving out blocks."""
    x = np.column_stack(columns)
    size = column_sizes(x)
    x = x / size
    blocks = np.array_split(np.arange(len(y)), _BLOCKS)
    grams = np.array([x[b].T @ x[b] for b in blocks])
    sides = np.array([x[b].T @ y[b] for b in blocks])

    def solved(keep: np.ndarray) -> np.ndarray:
        return np.linalg.lstsq(grams[keep].sum(0), sides[keep].sum(0), rcond=1e-12)[0] / size

    every = np.arange(_BLOCKS)
    left = [function(solved(every != k)) for k in every]
    return solved(every), np.sqrt((_BLOCKS - 1) * np.var(left, axis=0))


# ---- dead channels ------------------------------------------------------------------


def refuse_dead(records: Sequence[Record]) -> None:
    """Refuse channels that are constant over all records."""
    for role in _DEAD:
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
    for role in _DEAD:
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


# ---- the speed against the position's: unit, sign, offset and lag -------------------


class _Speeds(NamedTuple):
    """``w`` and d theta/dt (N,), ``slope``, of the longest piece, low-passed; their ratio, 1 or -1
    where it may be that, how far they agree, and the lag of w in s with the least one."""

    w: np.ndarray
    slope: np.ndarray
    dt: float
    ratio: float = 0.0
    agreement: float = 0.0
    lag: float = 0.0
    least_lag: float = 0.0


def _speeds(record: Record) -> _Speeds | None:
    """Compare both; None where one is missing, too short, or does not change."""
    if record.w is None or record.theta is None or (found := _longest(record)) is None:
        return None
    part, edge = found
    if not (np.ptp(record.w) > 0 and np.ptp(record.theta) > 0):
        return None
    assert part.w is not None and part.theta is not None
    w, slope = _low_passed(part.rate, edge, part.w, np.gradient(part.theta, part.dt))
    made = _Speeds(w, slope, part.dt)
    # noise biases a ratio towards 0, so two regressions bracket the true one
    (ratio, lead, *_), (inverse, lag, *_) = _fitted(made, w, slope), _fitted(made, slope, w)
    agreement = ratio * inverse
    if agreement < 0.25:
        return made._replace(agreement=agreement)
    swings = 1 + np.count_nonzero(np.diff(np.sign(slope - slope.mean())))
    margin = _OFF + 3 * np.sqrt(max(1 - agreement, 0.0) / swings)
    low, high = sorted((abs(ratio), abs(1 / inverse)))
    same = low <= 1 + margin and high >= 1 - margin
    size = 1.0 if same else float(np.sqrt(ratio / inverse))
    sign = float(np.sign(ratio))
    return _Speeds(w, slope, part.dt, size * sign, agreement, lag, min(lag, -lead))


def _fitted(
    speeds: _Speeds, target: np.ndarray, source: np.ndarray
) -> tuple[float, float, float, float]:
    """Fit target = g (source + T d source/dt) + ... + c: g, T, c and the error of c."""
    first = np.gradient(source, speeds.dt)
    columns = [source, first, np.gradient(first, speeds.dt), np.ones_like(source)]
    found, error = _jackknifed(columns, target, lambda p: p[3:])
    g, T = found[0], found[1] / found[0] if found[0] else 0.0
    return float(g), float(T), float(found[3]), float(error[0])


def _steady_ratio(speeds: _Speeds) -> float:
    """Mean w over mean d theta/dt if the speed varies too little to compare them; else 0."""
    w, slope = float(speeds.w.mean()), float(speeds.slope.mean())
    ratio = w / slope if slope else 0.0
    alike = np.std(speeds.w - ratio * speeds.slope) < _STEADY * abs(w)
    return ratio if alike and np.std(speeds.slope) < _STEADY * abs(slope) else 0.0


def fitting_speed(record: Record) -> Record:
    """The record with a w that fits d theta/dt, or without one; each change is a message."""
    speeds = _speeds(record)
    if speeds is None:
        return record
    ratio = speeds.ratio or _steady_ratio(speeds)
    if not ratio:
        return _unrelated(record, speeds.agreement)
    if ratio != 1.0 and not (abs(ratio - 1) <= _OFF and not speeds.ratio):
        if ratio != -1.0:
            return _other_speed(record, ratio)
        assert record.w is not None
        said = "w has the opposite sign of d theta/dt: its sign was changed."
        record = replace(record, w=-record.w).with_messages(said)
        speeds = speeds._replace(w=-speeds.w)
    if not speeds.ratio:
        return record
    *_, offset, error = _fitted(speeds, speeds.w, speeds.slope)
    least = max(_SURE * error, _LEAST_OFFSET * float(np.sqrt(np.mean(speeds.slope**2))))
    if abs(offset) > least and np.ptp(speeds.slope) > 0:
        size = f"{abs(offset):.3g} {si_unit('w', record.motion)}"
        return replace(record, w=None).with_messages(
            f"w is {size} too {'high' if offset > 0 else 'low'} against d theta/dt: {_IGNORED}"
        )
    if speeds.least_lag > _LAG * record.dt:
        record = record.with_messages(
            f"w lags theta by {1e3 * speeds.lag:.3g} ms, as a filtered velocity does: not changed."
        )
    return record


def _unrelated(record: Record, agreement: float) -> Record:
    """A record whose w does not vary with d theta/dt: the two are exchanged, or w is left out."""
    swapped = replace(record, theta=record.w, w=record.theta)
    other = _speeds(swapped)
    if other is not None and other.agreement > _SAME and other.ratio == 1.0:
        return swapped.with_messages("theta is d w/dt: the two were exchanged.")
    return _without_w(record, f"has little in common with it (R2 = {max(agreement, 0.0):.2f})")


def _other_speed(record: Record, ratio: float) -> Record:
    size, gear = abs(ratio), ""
    if 2.0 < size < _GEARS:  # w may be the motor's and theta the joint's
        joint, motor = option("scale", f"w={1 / size:.4g}"), option("scale", f"theta={size:.4g}")
        gives = f"{joint} gives the joint's motion, {motor} the motor's"
        gear = f" (a motor with a gear of {size:.4g}? Then {gives})"
    return _without_w(record, f"{ratio:.4g} times it{gear}")


# ---- units --------------------------------------------------------------------------


class Mistake(NamedTuple):
    """A channel in another unit than it was taken in; ``factor`` is on its values in SI."""

    role: str
    unit: str
    factor: float
    said: str


def unit_mistake(record: Record, labels: Labels) -> Mistake | None:
    """The likeliest mix-up by which w is not d theta/dt, else None (units in SI are often stated by
    habit); InputError if the unit of t is wrong."""
    speeds = _speeds(record)
    ratio = abs(speeds.ratio or _steady_ratio(speeds)) if speeds else 0.0
    if not ratio or abs(ratio - 1) <= _OFF:
        return None
    _check_time(record, labels, ratio)
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
    return Mistake(role, meant.name, meant.factor / taken.factor, said)


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


# ---- sign of the torque -------------------------------------------------------------


def _torque_fit(record: Record, band: float = _BAND) -> tuple[float, float, float] | None:
    """Fit ``u = J dw/dt + Fv w + Fc sign(w) + ...`` to the longest stretch, up to ``band`` Hz: J
    and the mean friction power over their standard errors, and the share of u that is explained."""
    found = _longest(record, band)
    if found is None or _is_constant(record.u):
        return None
    part, edge = found
    angle, speed = part.theta, part.w
    if speed is None:
        assert angle is not None
        speed = np.gradient(angle, part.dt)
    angle = np.cumsum(speed) * part.dt if angle is None else angle
    (slow,) = _low_passed(part.rate, edge, speed, ends=True)
    still = 0.02 * np.std(slow)
    if not still > 0:
        return None
    friction = [slow, slow / (np.abs(slow) + still)]
    terms = [np.gradient(slow, part.dt), *friction, np.ones_like(slow), angle - angle.mean()]
    if part.motion == "rotary":
        terms += [np.sin(angle), np.cos(angle)]
    u, *terms = _low_passed(part.rate, edge, part.u, *terms)
    power = np.array([terms[1] @ terms[1], terms[1] @ terms[2]])

    def inertia_and_power(p: np.ndarray) -> np.ndarray:
        return np.array([p[0], p[1:3] @ power])

    p, error = _jackknifed(terms, u, inertia_and_power)
    if not np.all(error > 0):
        return None
    inertia, friction_power = inertia_and_power(p) / error
    r2 = 1 - np.var(u - np.column_stack(terms) @ p) / np.var(u)
    return float(inertia), float(friction_power), float(r2)


def _torque_sign(record: Record) -> Record:
    """Invert a torque that drives against its own motion; only report it if that is uncertain.

    Delay and filters make the fitted friction of a light drive negative, so the fitted inertia
    decides. Above a resonance a correct torque looks inverted: the slow part must agree."""
    whole = None if _is_steady(record) else _torque_fit(record)
    if whole is None or whole[2] >= 0.05 and min(whole[:2]) >= -_SURE:
        return record
    slow = _torque_fit(record, _SLOW_BAND)
    if slow is None:
        return record
    if whole[2] < 0.05 and _is_noise(record.u - record.u.mean()):
        raise Refused(
            f"{record.source}: u is noise that is not related to the motion: dead torque channel.",
            "Record the torque that the drive applies.",
        )
    inertias, powers, explained = zip(whole, slow, strict=True)
    if max(inertias) < -_SURE and min(explained) > 0.8:
        return replace(record, u=-record.u).with_messages(
            "u drives against the motion it causes (the fitted inertia is negative): "
            "its sign was changed for the simulation, not in the plain torque balance. "
            f"Give {option('scale', 'u=-1')} to change it in both."
        )
    turned = whole[0] < -_SURE and slow[0] < -2 and max(explained) > 0.8
    if turned or max(powers) < -_SURE and max(inertias) < 2:
        return record.with_messages(
            "u seems to drive against the motion it causes, but not clearly enough to change "
            f"its sign; if it is wrong, give {option('scale', 'u=-1')}."
        )
    return record


def _saturation(record: Record) -> Record:
    """Report if u stays at its largest value; a torque of a few levels does so on purpose."""
    if len(np.unique(record.u)) <= 20:
        return record
    for extreme in (record.u.max(), record.u.min()):
        at = record.u == extreme
        pairs = at & (np.r_[False, at[:-1]] | np.r_[at[1:], False])
        if pairs.mean() >= 0.02:
            record = record.with_messages(
                f"u stays at exactly {extreme:.6g} {si_unit('u', record.motion)} for "
                f"{100 * pairs.mean():.2g} % of the samples: the drive or the log saturates there."
            )
    return record

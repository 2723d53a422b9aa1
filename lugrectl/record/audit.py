"""Checks of a record: faults that are corrected, faults that are only reported, refusals."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.signal import butter, sosfiltfilt

from ..errors import Refused
from .samples import Record
from .units import UNITS, Unit, si_unit

_BAND = 30.0  # Hz; the motion below this frequency is compared
_SLOW_BAND = 5.0  # Hz
_CLOSE = 0.02  # a ratio this close to that of two units means that these were mixed up
_SAME = 0.9  # share of a channel's power that the other's derivative must explain
_OFF = 0.03  # a ratio this far from 1 is reported
_LAG = 1.5  # samples
_BLOCKS = 20
_SURE = 8.0  # standard errors


def audit(record: Record, labels: Mapping[str, str | None] | None = None) -> Record:
    """Check a record: correct the faults that have one possible cause, report the others.

    Wrapped angles are unwrapped. ``w`` in another unit or of the opposite sign than d theta/dt
    is converted, and ignored if it does not fit d theta/dt at all. A torque of the wrong sign
    is inverted. A lag of ``w`` and a saturated ``u`` are reported. ``labels`` are the units by
    role that the file or the user stated (None: not stated); they decide which of two channels
    has the wrong unit.

    Raises Refused when ``u`` or the motion is constant or only noise.
    """
    _alive(record)
    record = fitting_speed(record, labels)
    record = _torque_sign(record)
    return _saturation(record)


def fitting_speed(record: Record, labels: Mapping[str, str | None] | None = None) -> Record:
    """The record on uniform time, with theta unwrapped and w consistent with d theta/dt.

    ``labels`` as for :func:`audit`. theta in rad, w in rad/s (m, m/s on a linear axis); the
    record's messages report each change. A w that does not fit d theta/dt is left out. Raises
    Refused if the time cannot be repaired.
    """
    return _velocity(record, labels or {})


# ---- dead channels ------------------------------------------------------------------


def _alive(record: Record) -> None:
    what = {"u": "dead torque channel", "w": "nothing moves", "theta": "nothing moves"}
    for role, meaning in what.items():
        values = getattr(record, role)
        if values is not None and np.ptp(values) <= 1e-9 * np.abs(values).max(initial=0.0):
            raise Refused(
                f"{record.source}: {role} is constant ({values[0]:.6g}): {meaning}.",
                "Record a motion that starts, stops and reverses, with its torque.",
            )
    if record.theta is not None and len(np.unique(record.theta)) < 4:
        raise Refused(
            f"{record.source}: theta takes {len(np.unique(record.theta))} values only: "
            "nothing moves by more than the sensor's step.",
            "Record a motion of many sensor steps.",
        )
    if record.theta is None and record.w is not None and _is_noise(record.w):
        raise Refused(
            f"{record.source}: w is noise about zero: nothing moves.",
            "Record a motion well above the sensor's noise.",
        )


def _is_noise(values: np.ndarray) -> bool:
    """Whether values are uncorrelated from sample to sample, about zero."""
    spread = np.std(values)
    x = values - values.mean()
    lag1 = np.mean(x[1:] * x[:-1]) / spread**2
    return bool(
        abs(lag1) < 5 / np.sqrt(len(x)) and abs(values.mean()) < 5 * spread / np.sqrt(len(x))
    )


# ---- w against d theta/dt -----------------------------------------------------------


def _longest(record: Record) -> Record:
    part = max(record.segments(), key=lambda s: s.stop - s.start)
    return record.slice(part.start, part.stop)


def _low_passed(
    record: Record, *signals: np.ndarray, band: float = _BAND, keep_ends: bool = False
) -> list[np.ndarray]:
    """Return low-pass filtered signals (the band of the motion), without their ends."""
    edge, end = _edge(record, band)
    sos = butter(3, edge, fs=record.rate, output="sos")
    cut = 0 if keep_ends else end
    return [sosfiltfilt(sos, signal)[cut : len(signal) - cut] for signal in signals]


def _edge(record: Record, band: float) -> tuple[float, int]:
    """The cut-off frequency, Hz, and the number of samples that the filter spoils at each end."""
    edge = min(band, record.rate / 20)
    return edge, int(record.rate / edge)


def _long_enough(record: Record, band: float = _BAND) -> bool:
    """Whether the longest stretch, without its ends, is long enough for slow signals."""
    part = _longest(record)
    return len(part.u) > 2 * (_edge(part, band)[1] + _BLOCKS)


def _regression(target: np.ndarray, source: np.ndarray, dt: float) -> tuple[float, float]:
    """Fit target = g (source + T d source/dt) + ...; return g and T."""
    first = np.gradient(source, dt)
    terms = np.column_stack([source, first, np.gradient(first, dt), np.ones_like(source)])
    size = np.linalg.norm(terms, axis=0)
    found = np.linalg.lstsq(terms / size, target, rcond=None)[0] / size
    return float(found[0]), float(found[1] / found[0]) if found[0] else 0.0


def _velocity(record: Record, labels: Mapping[str, str | None]) -> Record:
    """Compare w with d theta/dt.

    Noise in the regressor biases a fitted ratio towards zero, so the two regressions, w on
    d theta/dt and d theta/dt on w, bracket the true ratio. With few swings of the motion it is
    less certain.
    """
    if record.w is None or record.theta is None or not _long_enough(record):
        return record
    if np.ptp(record.w) == 0 or np.ptp(record.theta) == 0:
        return record
    slope, (ratio, lead), (inverse, lag) = _both_ways(record)
    agreement = ratio * inverse
    if agreement < 0.25:
        swapped = replace(record, theta=record.w, w=record.theta)
        if _derives(swapped):
            return swapped.with_messages("theta is d w/dt: the two were exchanged.")
        return _ignored(record, f"has little in common with it (R2 = {max(agreement, 0.0):.2f})")
    swings = 1 + np.count_nonzero(np.diff(np.sign(slope - slope.mean())))
    margin = _OFF + 3 * np.sqrt(max(1 - agreement, 0.0) / swings)
    low, high = sorted((abs(ratio), abs(1 / inverse)))
    middle = float(np.sqrt(ratio / inverse)) * np.sign(ratio)
    if low <= 1 + margin and high >= 1 - margin:
        factor, record = np.sign(ratio), _turned(record) if ratio < 0 else record
    else:
        factor, record = _converted(record, labels, float(middle))
    if factor and min(lag, -lead) > _LAG * record.dt:
        record = record.with_messages(
            f"w lags theta by {1e3 * lag:.3g} ms, as a filtered velocity does: not changed."
        )
    return record


def _both_ways(record: Record) -> tuple[np.ndarray, tuple[float, float], tuple[float, float]]:
    """d theta/dt, the regression of w on it, and that of it on w."""
    part = _longest(record)
    assert part.w is not None and part.theta is not None
    w, slope = _low_passed(part, part.w, np.gradient(part.theta, part.dt))
    return slope, _regression(w, slope, part.dt), _regression(slope, w, part.dt)


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


def _converted(
    record: Record, labels: Mapping[str, str | None], ratio: float
) -> tuple[float, Record]:
    """Return the record with the wrong unit corrected, or without w."""
    for expected, role, taken, meant in _mistakes(record, labels):
        if abs(abs(ratio) / expected - 1) > _CLOSE:
            continue
        values = getattr(record, role) * (meant.factor / taken.factor)
        stated = "stated" if labels.get(role) else "taken"
        record = replace(record, **{role: values}).with_messages(
            f"{role} is {stated} in {taken.name} but in fact in {meant.name} "
            f"(w is {abs(ratio):.4g} times d theta/dt): converted."
        )
        return 1.0, _turned(record) if ratio < 0 else record
    return 0.0, _ignored(record, f"{ratio:.4g} times it")


# ---- sign of the torque -------------------------------------------------------------


@dataclass(frozen=True)
class TorqueFit:
    """A plain balance ``u = J dw/dt + Fv w + Fc sign(w) + ...`` of slow signals.

    ``inertia_t`` and ``power_t`` are J and the mean friction power over their standard
    errors (jackknife over blocks of time); ``r2`` is the share of u that is explained.
    """

    inertia_t: float
    power_t: float
    r2: float


def torque_fit(record: Record, band: float = _BAND) -> TorqueFit | None:
    """Fit the balance to the longest stretch, up to ``band`` Hz; None without motion, or if the
    stretch is too short.

    The terms include the angle, for a spring, and on a rotary drive its sin and cos, for a
    gravity load.
    """
    if not _long_enough(record, band):
        return None
    part = _longest(record)
    angle, speed = _motion(part)
    (slow,) = _low_passed(part, speed, band=band, keep_ends=True)
    still = 0.02 * np.std(slow)
    if not still > 0:
        return None
    terms = [
        np.gradient(slow, part.dt),
        slow,
        slow / (np.abs(slow) + still),
        np.ones_like(slow),
    ]
    terms.append(angle - angle.mean())
    if part.motion == "rotary":
        terms += [np.sin(angle), np.cos(angle)]
    u, *terms = _low_passed(part, part.u, *terms, band=band)
    return _jackknife(np.column_stack(terms), u)


def _motion(record: Record) -> tuple[np.ndarray, np.ndarray]:
    """Return angle and speed; if one was not recorded it is computed from the other."""
    angle, speed = record.theta, record.w
    if speed is None:
        assert angle is not None
        return angle, np.gradient(angle, record.dt)
    return (np.cumsum(speed) * record.dt if angle is None else angle), speed


def _jackknife(terms: np.ndarray, u: np.ndarray) -> TorqueFit | None:
    size = np.linalg.norm(terms, axis=0)
    blocks = np.array_split(np.arange(len(u)), _BLOCKS)
    grams = np.array([terms[b].T @ terms[b] for b in blocks]) / np.outer(size, size)
    sides = np.array([terms[b].T @ u[b] for b in blocks]) / size
    power = np.array([(terms[:, 1] * terms[:, 1]).sum(), (terms[:, 1] * terms[:, 2]).sum()])

    def solve(keep: np.ndarray) -> np.ndarray:
        x = np.linalg.lstsq(grams[keep].sum(0), sides[keep].sum(0), rcond=1e-12)[0] / size
        return np.array([x[0], x[1:3] @ power])

    every = np.arange(len(blocks))
    full = solve(every)
    left = np.array([solve(every != k) for k in every])
    error = np.sqrt((len(every) - 1) * np.var(left, axis=0))
    if not np.all(error > 0):
        return None
    x = np.linalg.lstsq(terms / size, u, rcond=None)[0]
    r2 = 1 - np.var(u - (terms / size) @ x) / np.var(u)
    return TorqueFit(float(full[0] / error[0]), float(full[1] / error[1]), float(r2))


def _torque_sign(record: Record) -> Record:
    """Invert a torque that drives against its own motion; only report it if that is uncertain.

    Delay and filters make the fitted friction of a light drive negative, so the sign of the
    fitted inertia decides. Above a resonance between motor and sensor a correct torque looks
    inverted: the inverted balance must hold in the whole motion and in its slow part alone.
    """
    fit, slow = torque_fit(record), torque_fit(record, _SLOW_BAND)
    if fit is None or slow is None:
        return record
    if fit.r2 < 0.05 and _is_noise(record.u - record.u.mean()):
        raise Refused(
            f"{record.source}: u is noise that is not related to the motion: dead torque channel.",
            "Record the torque that the drive applies.",
        )
    if max(fit.inertia_t, slow.inertia_t) < -_SURE and min(fit.r2, slow.r2) > 0.8:
        return replace(record, u=-record.u).with_messages(
            "u drives against the motion it causes (the fitted inertia is negative): "
            "its sign was changed."
        )
    turned = fit.inertia_t < -_SURE and slow.inertia_t < -2
    brakes = max(fit.power_t, slow.power_t) < -_SURE and max(fit.inertia_t, slow.inertia_t) < 2
    if turned and max(fit.r2, slow.r2) > 0.8 or brakes:
        return record.with_messages(
            "u seems to drive against the motion it causes, but not clearly enough to change "
            "its sign; if it is wrong, give --scale u=-1."
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

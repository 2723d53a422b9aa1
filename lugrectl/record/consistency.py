"""Checks of a record: faults that are corrected, faults that are only reported, refusals."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..core.errors import Refused
from ..core.option_names import option
from .columns.units import si_unit
from .motion_band import BAND, BLOCKS, long_enough, longest, low_passed
from .record import Record
from .recorded_speed import fitting_speed

_SLOW_BAND = 5.0  # Hz
_SURE = 8.0  # standard errors
_STEADY = 0.1  # least change of a speed, as a share of it, by which signals can be compared
_DEAD = ("u", "w", "theta")
_COASTS = "dead torque channel, or a drive that coasts"
_ONE = "dead torque channel, or one torque throughout, which does not tell inertia from friction"


def audit(
    record: Record, labels: Mapping[str, str | None] | None = None, *, alone: bool = True
) -> Record:
    """Check a record: correct the faults that have one possible cause, report the others.

    ``w`` in another unit or of the opposite sign than d theta/dt is converted, and ignored if it
    does not fit d theta/dt at all or has an offset. A torque of the wrong sign is inverted. A lag
    of ``w`` and a saturated ``u`` are reported. ``labels`` are the units by role that the file or
    the user stated (None: not stated); they decide which of two channels has the wrong unit.

    Raises Refused when ``u`` or the motion is constant or only noise. A constant torque at a
    steady speed is a point of a friction curve; beside other runs (not ``alone``) it may be one of
    several torques, which :func:`refuse_dead` judges together.
    """
    _alive(record, alone)
    record = fitting_speed(record, labels)
    record = _torque_sign(record)
    return _saturation(record)


# ---- dead channels ------------------------------------------------------------------


def named(records: Sequence[Record]) -> str:
    """Subject of a message: the record's source, or the number of records."""
    return records[0].source if len(records) == 1 else f"{len(records)} records"


def refuse_dead(records: Sequence[Record]) -> None:
    """Refuse channels that are constant over all records."""
    for role in _DEAD:
        given = [r.channels()[role] for r in records if role in r.channels()]
        low, high = min(map(np.min, given), default=0.0), max(map(np.max, given), default=1.0)
        if high - low <= 1e-9 * max(abs(low), abs(high)):
            raise Refused(
                f"{named(records)}: {role} is constant ({low:.6g}): {_meaning(role, low)}.",
                "Record a motion that starts, stops and reverses at several speeds, with its "
                "torque.",
            )


def _meaning(role: str, value: float) -> str:
    """What a channel that is constant at a value may be."""
    return "nothing moves" if role != "u" else _COASTS if value == 0 else _ONE


def _alive(record: Record, alone: bool) -> None:
    for role in _DEAD:
        values = getattr(record, role)
        if values is not None and _is_constant(values):
            if role != "theta" and values[0] != 0 and _is_steady(record):
                continue
            if role == "u" and not alone:
                continue
            raise Refused(
                f"{record.source}: {role} is constant ({values[0]:.6g}): "
                f"{_meaning(role, values[0])}.",
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


def _is_constant(values: np.ndarray) -> bool:
    return bool(np.ptp(values) <= 1e-9 * np.abs(values).max(initial=0.0))


def _is_steady(record: Record) -> bool:
    """Whether the drive keeps one speed."""
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
    """Whether values are uncorrelated from sample to sample, about zero.

    A few samples can show that only roughly: no bound is wider than a half.
    """
    spread = np.std(values)
    x = values - values.mean()
    lag1 = np.mean(x[1:] * x[:-1]) / spread**2
    sure = min(5 / np.sqrt(len(x)), 0.5)
    return bool(abs(lag1) < sure and abs(values.mean()) < sure * spread)


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


def torque_fit(record: Record, band: float = BAND) -> TorqueFit | None:
    """Fit the balance to the longest stretch, up to ``band`` Hz; None without motion, under a
    constant torque, or if the stretch is too short.

    The terms include the angle, for a spring, and on a rotary drive its sin and cos, for a
    gravity load.
    """
    if _is_constant(record.u) or not long_enough(record, band):
        return None
    part = longest(record)
    angle, speed = _motion(part)
    (slow,) = low_passed(part, speed, band=band, keep_ends=True)
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
    u, *terms = low_passed(part, part.u, *terms, band=band)
    return _jackknife(np.column_stack(terms), u)


def _motion(record: Record) -> tuple[np.ndarray, np.ndarray]:
    """Return angle and speed; if one was not recorded it is computed from the other."""
    angle, speed = record.theta, record.w
    if speed is None:
        assert angle is not None
        return angle, np.gradient(angle, record.dt)
    return (np.cumsum(speed) * record.dt if angle is None else angle), speed


def _jackknife(terms: np.ndarray, u: np.ndarray) -> TorqueFit | None:
    blocks = list(zip(np.array_split(terms, BLOCKS), np.array_split(u, BLOCKS), strict=True))
    grams = np.array([x.T @ x for x, _ in blocks])
    size = np.sqrt(np.diag(grams.sum(0)))
    grams, sides = grams / np.outer(size, size), np.array([x.T @ y for x, y in blocks]) / size
    power = np.array([(terms[:, 1] * terms[:, 1]).sum(), (terms[:, 1] * terms[:, 2]).sum()])

    def solve(keep: np.ndarray) -> np.ndarray:
        return np.linalg.lstsq(grams[keep].sum(0), sides[keep].sum(0), rcond=1e-12)[0] / size

    def told(x: np.ndarray) -> np.ndarray:
        return np.array([x[0], x[1:3] @ power])

    every = np.arange(len(blocks))
    x = solve(every >= 0)
    left = np.array([told(solve(every != k)) for k in every])
    error = np.sqrt((len(every) - 1) * np.var(left, axis=0))
    if not np.all(error > 0):
        return None
    r2 = 1 - np.var(u - terms @ x) / np.var(u)
    inertia, friction = told(x) / error
    return TorqueFit(float(inertia), float(friction), float(r2))


def _torque_sign(record: Record) -> Record:
    """Invert a torque that drives against its own motion; only report it if that is uncertain.

    Delay and filters make the fitted friction of a light drive negative, so the sign of the
    fitted inertia decides. Above a resonance between motor and sensor a correct torque looks
    inverted: the inverted balance must hold in the whole motion and in its slow part alone.
    """
    if _is_steady(record):
        return record  # nothing accelerates
    fit = torque_fit(record)
    if fit is None or fit.r2 >= 0.05 and min(fit.inertia_t, fit.power_t) >= -_SURE:
        return record
    slow = torque_fit(record, _SLOW_BAND)
    if slow is None:
        return record
    if fit.r2 < 0.05 and _is_noise(record.u - record.u.mean()):
        raise Refused(
            f"{record.source}: u is noise that is not related to the motion: dead torque channel.",
            "Record the torque that the drive applies.",
        )
    if max(fit.inertia_t, slow.inertia_t) < -_SURE and min(fit.r2, slow.r2) > 0.8:
        return replace(record, u=-record.u).with_messages(
            "u drives against the motion it causes (the fitted inertia is negative): "
            "its sign was changed for the simulation, not in the plain torque balance. "
            f"Give {option('scale', 'u=-1')} to change it in both."
        )
    turned = fit.inertia_t < -_SURE and slow.inertia_t < -2
    brakes = max(fit.power_t, slow.power_t) < -_SURE and max(fit.inertia_t, slow.inertia_t) < 2
    if turned and max(fit.r2, slow.r2) > 0.8 or brakes:
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

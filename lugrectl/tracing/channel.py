"""Checks of the torque channel: dead, clipped, a copy of another column, or of another motion."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from ..errors import Refused
from ..model import Model
from ..record import Record
from ..spec import unit_for
from .balance import Balance, Cells, balance, cells, moving, named, running
from .data import Data

COPY = 1e-4  # share of the torque's variance left by another column: below, it is a copy
STUCK = 0.05  # s, time at one value from which the torque may be dead
HELD = 0.01  # share of the samples at one value, from which it may be a limit or dead
RELEVANT = 0.1  # of the torque's RMS: as large as an effect that is to be found
RELATED = 4.0  # standard errors over blocks of time that J or the friction power must exceed
VERY_SURE = 8.0  # standard errors over blocks of time
ACCELERATES = 0.1  # accelerating share of the torque that makes the balance's J reliable
DOUBTED = 3.0  # factor from the declared inertia, above which a remark is made
ANOTHER_UNIT = 30.0  # factor from the declared inertia that only a wrong unit explains


def copied(record: Record, data: Data, run: slice) -> None:
    """Refuse a torque that repeats another column, including that column's noise."""
    u = record.u - record.u.mean()
    if not u.any():
        return
    steps = np.abs(np.diff(u))
    steps = steps[steps > 1e-9 * np.ptp(u)]
    rounding = float(np.quantile(steps, 0.001)) ** 2 / 6.0 if len(steps) else 0.0
    for name, x, noise in _columns(record, data, run):
        inside = np.isfinite(x)
        x = x - x[inside].mean()
        power = float(x[inside] @ x[inside])
        if not power:
            continue
        slope = float(x[inside] @ u[inside]) / power
        left = float(np.mean((u[inside] - slope * x[inside]) ** 2))
        total = float(np.mean(u**2))
        exact = left < 1e-12 * total + (0.5 * slope * noise) ** 2 + rounding
        if left > COPY * total or not exact or _obeys(record, data, run, name, slope):
            continue
        raise Refused(
            f"{record.source}: u equals {slope:.4g} times {name} to within "
            f"{100 * np.sqrt(left / total):.2g} %, including its noise, so u is not the torque.",
            "Record the torque that the drive applies, and check the names of the columns.",
        )


def _columns(record: Record, data: Data, run: slice) -> Iterator[tuple[str, np.ndarray, float]]:
    """Columns and the differences of w and theta, each with noise that a torque cannot contain."""
    dt, noise = record.dt, data.noise
    if record.w is not None:
        yield "w", record.w, noise.w
        a = np.append(np.diff(record.w), np.nan) / dt
        yield "the difference of w", a, noise.w / dt
        yield "the difference of w", np.r_[np.nan, a[:-1]], noise.w / dt
        yield "the difference of w", np.gradient(record.w, dt), 0.5 * noise.w / dt
    if record.theta is not None:
        yield "theta", record.theta, noise.theta
        yield "d theta/dt", np.gradient(record.theta, dt), 0.5 * noise.theta / dt
        second = np.r_[np.nan, np.diff(record.theta, 2), np.nan] / dt**2
        yield "the second difference of theta", second, noise.theta / dt**2
    if record.r is not None and _is_motion(record.r, data, run):
        yield "the reference r", record.r, np.inf


def _is_motion(r: np.ndarray, data: Data, run: slice) -> bool:
    """True if the reference is one of speed or position (u may well repeat one of torque)."""
    x = r - r.mean()
    for signal in (data.log.w[run], data.log.theta[run]):
        y = signal - signal.mean()
        product = float(x @ y)
        gain, back = product / max(float(y @ y), 1e-300), product / max(float(x @ x), 1e-300)
        if 0.8 < gain < 1.25 and gain * back > 0.8:
            return True
    return False


def _obeys(record: Record, data: Data, run: slice, name: str, slope: float) -> bool:
    """True if a proportional controller with a constant reference explains the copy.

    It opposes what it copies. On speed it still does positive work; on position the motion decays.
    """
    if slope > 0.0 or name not in ("w", "d theta/dt", "theta"):
        return False
    if name != "theta":
        return float(record.u @ data.log.w[run]) > 0.0
    first, last = np.array_split(data.log.w[run], 2)
    return bool(np.std(last) < 0.5 * np.std(first))


def stuck(records: Sequence[Record], data: Data, at: Cells, remarks: list[str]) -> None:
    """Check the values at which u stays: the balance of the other samples shows whether the
    motion needs another torque."""
    found = [(*one, at.mean(running(one[1].astype(float))) > 0.5) for one in _values_held(data)]
    if not found:
        return
    _, slides = moving(data, at)
    fit = balance(data, at, ~np.any([held for *_, held in found], axis=0))
    alive = fit is not None and _in_one(fit, balance(data, at))
    for value, flagged, clipped, held in found:
        which = held & slides
        if fit is None or not which.any() or (alive and not clipped):
            continue
        missing = fit.torque(data, at.only(which)) - value
        rms, share = float(np.sqrt(np.mean(missing**2))), float(which.sum() / slides.sum())
        beyond = float(np.sign(value - np.median(data.u)) * missing.mean())
        if rms < 3.0 * fit.left or clipped and beyond < 0.7 * rms:
            continue
        unit, kind = unit_for("N m", data.motion), "clipped" if clipped else "dead"
        noticed = (
            f"{named(records)}: u stays at {value:.4g} {unit} for {100 * flagged.mean():.2g} % of "
            f"the samples, but the motion there needs a torque that differs by {rms:.3g} {unit} RMS"
        )
        if np.sqrt(share) * rms > RELEVANT * np.std(fit.u):
            cure = "Raise the range of the log" if clipped else "Repair the torque channel"
            reason = f"{noticed}: the torque channel is {kind} there."
            raise Refused(reason, f"{cure} and record again, or cut that part out.")
        remarks.append(f"{noticed}: the torque channel may be {kind} there.")


def _in_one(fit: Balance, whole: Balance | None) -> bool:
    """Whether one balance also describes the samples that ``fit`` leaves out: a drive that coasts
    takes no torque, and slows down by its friction."""
    if whole is None:
        return False
    return whole.left < max(3.0 * fit.left, RELEVANT * float(np.std(whole.u)))


def _values_held(data: Data) -> Iterator[tuple[float, np.ndarray, bool]]:
    """Values at which u may be stuck: the one held longest, then the extremes.

    Yields the value, where u has it, and whether it may be a limit.
    """
    u, least = data.u, max(10, round(STUCK / data.dt))
    edges = np.r_[0, np.flatnonzero(np.diff(u)) + 1, len(u)]
    lengths = np.diff(edges)
    long = lengths >= least
    extremes = float(u.min()), float(u.max())
    if long.any():
        values, index = np.unique(u[edges[:-1][long]], return_inverse=True)
        value = float(values[np.argmax(np.bincount(index, lengths[long]))])
        flagged = np.repeat(long, lengths) & (u == value)
        if value not in extremes and flagged.mean() >= HELD:
            yield value, flagged, False
    for value in extremes:
        flagged = (u == value) & np.repeat(lengths > 1, lengths)
        if flagged.mean() >= HELD:
            yield value, flagged, extremes[0] < 0.0 < extremes[1]


def related(
    records: Sequence[Record], model: Model, data: Data, fit: Balance, remarks: list[str]
) -> None:
    """Refuse a torque that is unrelated to the motion or gives an implausible inertia.

    Remark on an inertia that the record hardly determines.
    """
    where, sure = named(records), fit.J / max(fit.error, 1e-300)
    clear = "Record a motion with clear acceleration in both directions, with its torque."
    coarse = balance(data, cells(data, 8.0 * fit.cells.size * data.dt))
    slow = coarse.J / max(coarse.error, 1e-300) if coarse else sure
    if sure < -VERY_SURE and slow < -2.0:
        raise Refused(
            f"{where}: torque and acceleration are of opposite sign (fitted inertia {fit.J:.3g}, "
            f"{-sure:.0f} standard errors below 0): u is not the torque that causes this motion.",
            clear + " If its sign is wrong, give --scale u=-1.",
        )
    if max(sure, fit.power_t) < RELATED:
        raise Refused(
            f"{where}: u is unrelated to the motion: it neither accelerates the drive nor "
            "overcomes its friction.",
            "Record the torque that the drive applies, in the same run as the motion.",
        )
    remarks += _right_size(where, model, data, fit, coarse)
    if model.J is None or fit.error < 0.5 * model.J:  # an undeclared J is identified by the fit
        return
    needed = 10.0 * fit.error / model.J * fit.acceleration
    unit, torque = unit_for("rad/s", data.motion), unit_for("N m", data.motion)
    remarks.append(
        f"{where}: the record hardly determines the inertia: the acceleration is "
        f"{fit.acceleration:.3g} {unit}2 RMS, and a simple torque balance leaves {fit.left:.3g} "
        f"{torque} RMS unexplained. The result relies on the declared J; an acceleration of about "
        f"{needed:.2g} {unit}2 would identify it."
    )


def _right_size(
    where: str, model: Model, data: Data, fit: Balance, coarse: Balance | None
) -> list[str]:
    """Refuse a declared inertia so far off that a unit must be wrong; remark on a smaller
    deviation.

    It counts by the cells, short or long, that deviate less: over short cells the steps of a coarse
    encoder look like accelerations without a torque.
    """
    felt = fit.J * fit.acceleration > ACCELERATES * float(np.sqrt(np.mean(fit.u**2)))
    if model.J is None or fit.J < VERY_SURE * fit.error or not felt:
        return []
    every = [one.J for one in (fit, coarse) if one is not None and one.J > 0.0]
    off, J = min((max(model.J / J, J / model.J), J) for J in every)
    unit = unit_for("kg m2", data.motion)
    noticed = (
        f"{where}: the model declares J = {model.J:.3g} {unit}, but torque and acceleration "
        f"give {J:.3g} {unit}"
    )
    if off > ANOTHER_UNIT:
        raise Refused(
            f"{noticed}: J or the torque is in another unit.",
            "Give J and u in SI units (--units, --scale), or leave J out to have it identified.",
        )
    advice = "check the units of u and of the motion (rpm taken for rad/s is a factor of 9.5)"
    return [f"{noticed}, a factor of {off:.2g}: {advice}."] if off > DOUBTED else []

"""Informativeness of the records: refuse what cannot answer, with the reason and what to record."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from ..errors import Refused
from ..model import Model
from ..record import Record
from ..spec import unit_for
from .balance import Cells, balance, cells, moving, named
from .channel import copied, related, stuck
from .data import Data
from .skewed import sensors_skewed, torque_skewed

FEW = 10  # encoder steps (noise times sqrt(12)): with fewer, rounding exceeds 3 % of the motion
SLIDING = 1.0  # s, least duration of sliding motion
ONE_WAY = 0.01  # least share of the sliding time in either direction
ONE_SPEED = 0.1  # relative half-width about the median that holds nearly all speeds
PIECE = 2.25  # s, a held-out block and its lead-in: shorter pieces cannot be used
LOST = 0.5  # share of a record lost to gaps, above which it is refused


def refuse_unfit(records: Sequence[Record], model: Model, data: Data) -> tuple[str, ...]:
    """Refuse records from which a missing effect cannot be identified.

    Checked are the channels themselves, the torque balance
    ``u - d = J a + friction(w) + T0 + K theta + gravity`` along the sliding motion, and its errors
    over 20 blocks of time. No threshold depends on the machine.

    Parameters
    ----------
    records : the runs that ``data`` was prepared from, pooled.
    model : the declared model; only J and which values are missing are used.
    data : as prepared.

    Returns
    -------
    tuple of str
        What cannot be tested with these records, a sentence each.

    Raises
    ------
    Refused
        When the torque is dead, clipped, another column's copy or unrelated to the motion; when
        channels are skewed in time; when inertia or friction cannot be identified from this
        motion; when too little of it was recorded.

    Notes
    -----
    A skew between torque and motion shows only where the accelerating torque is at least a tenth of
    the whole. The lag of an effect behind its cause is no skew.
    """
    refuse_dead(records)
    remarks: list[str] = []
    for record, run in _each(records):
        _whole_time(record, remarks)
        copied(record, data, run)
    at = cells(data)
    _moves(records, data, at)
    fit = balance(data, at)
    stuck(records, data, at, remarks)
    if not sensors_skewed(records, data):  # else it is unknown which of them is in time
        torque_skewed(records, data, remarks)
    _varied(records, model, data, at, remarks)  # before the balance, which needs both directions
    if fit is not None:
        related(records, model, data, fit, remarks)
    return tuple(remarks)


def refuse_dead(records: Sequence[Record]) -> None:
    """Refuse channels that are constant over all records; needs no ``Data``."""
    dead = "dead torque channel, or a drive that coasts"
    what = {"u": dead, "w": "nothing moves", "theta": "nothing moves"}
    for role, meaning in what.items():
        given = [r.channels()[role] for r in records if role in r.channels()]
        low, high = min(map(np.min, given), default=0.0), max(map(np.max, given), default=1.0)
        if high - low <= 1e-9 * max(abs(low), abs(high)):
            raise Refused(
                f"{named(records)}: {role} is constant ({low:.6g}): {meaning}.",
                "Record a motion that starts, stops and reverses at several speeds, with its "
                "torque.",
            )


def _each(records: Sequence[Record]) -> Iterator[tuple[Record, slice]]:
    first = 0
    for record in records:
        yield record, slice(first, first + record.samples)
        first += record.samples


# ---- time ---------------------------------------------------------------------------


def _whole_time(record: Record, remarks: list[str]) -> None:
    """Refuse a record that gaps leave less than half of, or with irregular time steps."""
    between = np.delete(np.arange(record.samples - 1), np.array(record.gaps, dtype=int) - 1)
    off = np.abs(np.diff(record.t)[between] / record.dt - 1.0) > 0.5
    if off.sum() > 0.01 * record.samples:
        raise Refused(
            f"{record.source}: {100 * off.mean():.2g} % of the time steps differ from "
            f"{record.dt:.6g} s by more than half of it: samples are lost or irregular.",
            "Record at a fixed rate without loss, or read the file with read_record.",
        )
    lengths = np.array([s.stop - s.start for s in record.segments()]) * record.dt
    span = float(record.t[-1] - record.t[0]) + record.dt
    useful = float(lengths[lengths >= min(PIECE, lengths.max())].sum())
    lost = 1.0 - useful / span
    if record.gaps and lost > LOST:
        raise Refused(
            f"{record.source}: {100 * lost:.0f} % of its {span:.4g} s are lost: {len(record.gaps)} "
            f"gaps leave {useful:.3g} s in pieces of at least {PIECE:g} s.",
            "Record 20 s or more without loss.",
        )
    if record.gaps and lost > 0.05:
        remarks.append(
            f"{record.source}: {100 * lost:.0f} % of the time is lost to gaps or lies in pieces "
            f"shorter than {PIECE:g} s."
        )


# ---- motion -------------------------------------------------------------------------


def _moves(records: Sequence[Record], data: Data, at: Cells) -> None:
    where = named(records)
    if np.isfinite(data.noise.theta):
        travel, count = float(np.ptp(data.y[:, 0])), data.noise.theta * np.sqrt(12.0)
        if travel < FEW * count:
            raise Refused(
                f"{where}: theta travels {travel / max(count, 1e-300):.3g} steps of the sensor, "
                f"{travel:.3g} {unit_for('rad', data.motion)}: the drive hardly moves.",
                f"Record a motion of at least {FEW} steps, better thousands.",
            )
    else:
        travel = float(np.ptp(np.cumsum(data.y[:, 1]) * data.dt))
        random = data.noise.w * data.dt * np.sqrt(len(data.t))
        if travel < 5.0 * random:
            raise Refused(
                f"{where}: w integrates to {travel:.3g} {unit_for('rad', data.motion)} of "
                f"travel, its noise alone to {random:.3g}: the drive hardly moves.",
                "Record a motion well above the sensor's noise.",
            )
    time = float(moving(data, at)[1].sum()) * at.size * data.dt
    if time < SLIDING:
        raise Refused(
            f"{where}: the record is too short: the drive moves for {time:.2g} s in all; "
            f"at least {SLIDING:g} s are needed.",
            "Record 20 s or more of motion.",
        )


def _varied(
    records: Sequence[Record], model: Model, data: Data, at: Cells, remarks: list[str]
) -> None:
    """Coulomb friction needs both directions to be distinguished from a load, and several speeds
    to be distinguished from Fv."""
    w, slides = moving(data, at)
    w, where = w[slides], named(records)
    friction = model.friction.values
    other = float(min(np.mean(w > 0), np.mean(w < 0)))
    if other < ONE_WAY:
        way = f"{100 * other:.2g} % in the other"
        noticed = f"{where}: the drive slides in one direction only ({way})"
        if "Fc" in friction:
            raise Refused(
                f"{noticed}: Coulomb friction cannot be distinguished from a constant torque.",
                "Record the same motion in both directions.",
            )
        remarks.append(f"{noticed}: differences between the directions were not tested.")
    low, middle, high = np.quantile(np.abs(w), [0.025, 0.5, 0.975])
    if high - low < 2.0 * ONE_SPEED * middle:
        noticed = (
            f"{where}: the drive slides at one speed only ({low:.3g} to {high:.3g} "
            f"{unit_for('rad/s', data.motion)} for 95 % of the time)"
        )
        if {"Fc", "Fv"} <= friction.keys():
            raise Refused(
                f"{noticed}: Coulomb and viscous friction cannot be distinguished.",
                "Record several speeds, from slow to fast.",
            )
        remarks.append(f"{noticed}: how friction depends on speed was not tested.")
    turns = int(np.count_nonzero(np.diff(np.sign(w))))
    if other >= ONE_WAY and turns < 2:
        remarks.append(
            f"{where}: the motion reverses only once: a drift in time can look like a difference "
            "between the directions. Record more reversals."
        )

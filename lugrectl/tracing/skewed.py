"""Time-delay estimation between channels: a motion ahead of its torque shows a time skew."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ..bristles import deflection
from ..errors import Refused
from ..model import Parameters
from ..record import Record
from .balance import BLOCKS, LEVEL, Cells, cells, motion_terms, moving, named, running
from .data import Data

FARTHEST = 0.2  # s, the largest skew that is searched for
SAVED = 0.2  # of the disagreement, least part that a shift must remove to be a skew
PARTS = 8  # of the record, each with its own Coulomb friction, as friction may change
LATE = 0.75  # samples: w is late beyond this, as differences delay it less
AWAY = 1.25  # samples: no way of logging makes a torque later than this
DATED = 0.1  # least accelerating part of the torque for its delay to be estimated
SOFT = (0.003, 0.012, 0.05)  # s at the RMS speed, in which friction builds up
SURE = 3.0  # standard errors between blocks of time, which differ much

Terms = Callable[[np.ndarray], Sequence[np.ndarray]]  # more regressors from the usual ones
Left = Callable[[int], np.ndarray]  # squared residual of each cell after a shift of so many samples


def sensors_skewed(records: Sequence[Record], data: Data) -> bool:
    """Refuse a w that is early. True if it is late, as after a low-pass filter.

    Differences of neighbouring samples may be half a sample early and are accepted.
    """
    if not (np.isfinite(data.noise.w) and np.isfinite(data.noise.theta)):
        return False
    lag = _clear_skew(data)
    if lag > 1.4 * data.dt:
        raise Refused(
            f"{named(records)}: w is {1e3 * lag:.3g} ms ahead of d theta/dt: the channels "
            "are skewed in time relative to each other.",
            "Record w and theta at the same instants, or leave one of them out.",
        )
    return lag < -LATE * data.dt


def lateness(data: Data) -> float:
    """Delay of w relative to d theta/dt, s; 0 if it is not significant."""
    late = -_clear_skew(data)
    return late if late > LATE * data.dt else 0.0


def _clear_skew(data: Data) -> float:
    """Lead of w relative to d theta/dt, s; 0 if it is not significant."""
    found = sensor_skew(data, FARTHEST)
    if found is None or found.t < SURE or found.gain < SAVED:
        return 0.0
    return found.lag


def torque_skewed(records: Sequence[Record], data: Data, remarks: list[str]) -> None:
    """Refuse, or remark on, a motion that is ahead of the torque that causes it.

    This can only be seen if the accelerating torque is a good part of the whole.
    """
    found = skew(data, FARTHEST)
    if found is None or found.lag > -AWAY * data.dt or found.t < SURE or found.inertial < DATED:
        return
    for explained in (_changing, _turning) if data.motion == "rotary" else (_changing,):
        other = skew(data, FARTHEST, explained)
        if other is None or other.lag > 0.5 * found.lag:
            return
    noticed = f"{named(records)}: the motion is {-1e3 * found.lag:.3g} ms ahead of the torque"
    if found.gain > SAVED:
        raise Refused(
            f"{noticed} that causes it: u and the motion are skewed in time.",
            "Record u and the motion at the same instants, or shift u by that time.",
        )
    if found.gain > 0.25 * SAVED:
        remarks.append(
            f"{noticed} by the torque balance: they may be skewed in time. "
            "Check how both are logged."
        )


@dataclass(frozen=True)
class Skew:
    """``lag`` in s at which two channels agree best; negative: the effect precedes its cause.

    ``gain`` is the share of the disagreement that the shift removes, beyond what the opposite shift
    removes; ``t`` is its mean over blocks of time divided by the standard error. ``inertial`` is
    the RMS of the accelerating torque relative to that of all torque, negative if the estimated
    inertia is.
    """

    lag: float
    gain: float
    t: float
    inertial: float = np.nan


def skew(data: Data, farthest: float, also: Terms = lambda terms: ()) -> Skew | None:
    """Delay of the motion relative to the torque, up to ``farthest`` s; None if there is no best.

    ``also`` adds regressors on which the torque may depend.
    """
    room = max(2, round(farthest / data.dt))
    at = cells(data, room=room)
    at = at.only(moving(data, at)[1]) if len(at.start) else at
    if len(at.start) < 5 * BLOCKS:
        return None
    terms = motion_terms(data, at)[0]
    terms = np.column_stack([terms, *_building_up(data, at), *also(terms)])
    size = np.linalg.norm(terms, axis=0)
    Q, R = np.linalg.qr(terms / np.where(size > 0, size, 1.0))
    total = running(data.u - data.d)

    def left(k: int) -> np.ndarray:
        u = at.mean(total, -k)
        return (u - Q @ (Q.T @ u)) ** 2

    k = _best(left, room, at.size)
    u = at.mean(total, -k)
    x = np.linalg.lstsq(R, Q.T @ u, rcond=1e-9)[0]
    inertial = float(x[0] / max(np.linalg.norm(u - u.mean()), 1e-300))
    return _judged(left, k, room, data.dt, inertial)


def _changing(terms: np.ndarray) -> list[np.ndarray]:
    """Coulomb friction with a different size in each part of the record."""
    part = np.arange(len(terms)) * PARTS // len(terms)
    return [terms[:, LEVEL] * (part == n) for n in range(1, PARTS)]


def _turning(terms: np.ndarray) -> list[np.ndarray]:
    """Effects of an encoder mounted off centre on all torques of a rotary drive, and of an inertia
    that varies with the angle."""
    a, w, *_, sin, cos = terms.T
    products = [x * wave for x in (a, w, w**2) for wave in (sin, cos)]
    return [*products, sin * cos, cos * cos]


def _building_up(data: Data, at: Cells) -> list[np.ndarray]:
    """Presliding friction, which lags the motion although the torque is not late."""
    w = data.log.w
    usual = float(np.sqrt(np.mean(w**2)))
    made = []
    for span in SOFT:
        soft = Parameters(J=1, sigma0=1, sigma1=0, Fc=span * usual, Fs=span * usual, Fv=0, vs=1)
        made.append(at.mean(running(deflection(w, data.dt, soft))))
    return made


def sensor_skew(data: Data, farthest: float) -> Skew | None:
    """Delay of d theta/dt relative to w; negative: w is late, as a filtered velocity is."""
    room = max(2, round(farthest / data.dt))
    at = cells(data, room=room + 1)
    if len(at.start) < 5 * BLOCKS:
        return None
    theta, w, span = data.y[:, 0], data.y[:, 1], at.size * data.dt
    slope, total = (theta[at.start + at.size] - theta[at.start]) / span, running(w)
    slope -= slope.mean()

    def left(k: int) -> np.ndarray:
        a = at.start - k
        mean = at.mean(total, -k) - 0.5 * (w[a] - w[a + at.size]) / at.size  # trapezoidal rule
        mean -= mean.mean()
        return (slope - mean * (mean @ slope) / max(float(mean @ mean), 1e-300)) ** 2

    k = _best(left, room, at.size)
    return _judged(left, k, room, data.dt)


def _best(left: Left, room: int, stride: int) -> int:
    """The shift with the least residual: first on a coarse grid, then sample by sample."""
    sums: dict[int, float] = {}

    def total(k: int) -> float:
        if k not in sums:
            sums[k] = float(left(k).sum())
        return sums[k]

    k = min((0, *range(-(room // stride) * stride, room + 1, stride)), key=total)
    step = stride
    while step > 1:
        step = max(1, step // 2)
        k = min((n for n in (k, k - step, k + step) if abs(n) <= room), key=total)
    return k


def _judged(left: Left, k: int, room: int, dt: float, inertial: float = np.nan) -> Skew | None:
    if k == 0 or abs(k) >= room - 1:
        return None
    none, best = left(0), left(k)
    before, least, after = float(left(k - 1).sum()), float(best.sum()), float(left(k + 1).sum())
    bend = before - 2.0 * least + after
    beside = 0.5 * (before - after) / bend if bend > 0.0 else 0.0  # minimum of a parabola
    # smoothing alone makes a torque with steps agree better after a shift to either side
    other = min(none, left(-k), key=np.sum)
    gain = (float(other.sum()) - least) / max(float(none.sum()), 1e-300)
    blocks = np.linspace(0, len(best), BLOCKS, endpoint=False).astype(int)
    saved = np.add.reduceat(other - best, blocks)
    t = float(saved.mean() / max(saved.std() / np.sqrt(BLOCKS - 1), 1e-300))
    return Skew((k + float(np.clip(beside, -0.5, 0.5))) * dt, gain, t, inertial)

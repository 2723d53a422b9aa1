"""Standard bench tests in the logs of one drive, recognised by their motion and torque, and
answered as such: each is one function of the table at the end.

All share one regression. Over strokes it is the balance of momentum, of which nothing is
differentiated:

    x(t) = x0 + w0 t + (1/J) II u - (Fc/J) II sign(w) - (Fv/J) II w - ...      (II: twice over time)

where the angle was recorded, the same once integrated where only the speed was. It is linear in
1/J, Fc/J and Fv/J; x0 and w0 are free in each stroke.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise, product

import numpy as np
from scipy import stats
from scipy.signal import correlate, savgol_coeffs, savgol_filter

from ...blocks.block import unit_for
from ...blocks.friction import level
from ...blocks.model import Model
from ...core.display import number
from ...core.numeric import Z95, rms
from ...core.regression import TINY, spread
from ...core.result import plain
from ...estimates.findings import ALONE, ONE_WAY, BenchTable, BenchTest, Estimate, in_words
from ...record import Log
from ...record.samples.rows import Stamped
from ...record.signal_noise import quantum, repeats, white_noise
from ...record.signal_noise import spread as without_peaks
from ...record.uniform_time import usable
from ..constants import AGAIN, FIRSTS, KNOWN, LEAST_ROWS, LITTLE, SEVERAL, SLIGHT, STANDS

# ---- the motion and the torque of one log


FLAT = 0.02  # of the span of u, of a ramp's own height, of the largest torque: less is none
CERTAIN = 5.0  # standard deviations of noise, that are no step of u and no motion
NOISE = 3.0  # standard deviations of the noise that are allowed beside a motion
MOST = 400  # bends: a torque with more is no bench test's
SHORTEST = 4  # rows of a piece
WINDOWS = (1, 3, 5, 9, 17, 33, 65, 129)  # rows over which a speed is a mean or a slope
LEVELS = 12  # of u: of fewer no register is known
FEW = 16  # rows, for which a speed may stay the same before it is stale


@dataclass(frozen=True, eq=False)
class Piece:
    """Rows ``at``; the torque is ``level + slope (t - t0)``, with t0 that of the first row."""

    at: slice
    level: float
    slope: float
    held: bool
    ramp: bool


@dataclass(frozen=True, eq=False)
class Motion:
    """Rows in time order of one part of a log."""

    t: np.ndarray
    u: np.ndarray
    x: np.ndarray  # the angle, or the integral of w
    y: np.ndarray  # what was measured: the angle or the speed
    angle: bool
    fresh: np.ndarray  # rows whose motion was measured anew
    noise: float  # standard deviation of a sample of y
    step: float  # that of u
    dt: float

    def __len__(self) -> int:
        return len(self.t)

    @cached_property
    def speeds(self) -> tuple[np.ndarray, float, int]:
        """The speed at every row, the standard deviation of its noise, and rows of its window."""
        v, noise, rows = self.y, self.noise, 1
        for rows in WINDOWS[self.angle :]:
            of = {"polyorder": int(self.angle), "deriv": int(self.angle), "delta": self.dt}
            v = np.asarray(savgol_filter(self.y, rows, **of))
            noise = self.noise * float(np.linalg.norm(savgol_coeffs(rows, **of)))
            if noise < STANDS * _top(v) or 4 * rows > len(self):
                break
        return v, noise, rows

    @property
    def v(self) -> np.ndarray:
        return self.speeds[0]

    @property
    def window(self) -> int:
        return self.speeds[2]

    @cached_property
    def still(self) -> float:
        """The speed below which the axis rests."""
        return max(CERTAIN * self.speeds[1], STANDS * _top(self.v))

    @cached_property
    def side(self) -> np.ndarray:
        """The direction of the motion in each row, 0 at rest and where it is not renewed."""
        return np.sign(self.v) * ((np.abs(self.v) > self.still) & self.fresh)

    @cached_property
    def strokes(self) -> list[slice]:
        edges = np.flatnonzero(np.diff(self.side, prepend=0.0, append=0.0)).tolist()
        return [slice(a, b) for a, b in pairwise(edges) if self.side[a]]

    @cached_property
    def pieces(self) -> list[Piece]:
        """The torque between its steps and its bends (Douglas and Peucker, 1973)."""
        t, u = self.t, self.u
        span = without_peaks(u)
        noise = spread(np.diff(u)) / np.sqrt(2)
        far = FLAT * span + CERTAIN * noise
        jumps = np.flatnonzero(np.abs(np.diff(u)) > far) + 1
        left = [ends for ends in pairwise([0, *jumps.tolist(), len(u)])][::-1]
        made, bends = [], 0
        while left:
            a, b = left.pop()
            if b - a < SHORTEST:
                continue
            chord = np.interp(t[a:b], t[[a, b - 1]], u[[a, b - 1]])
            bend = a + int(np.argmax(np.abs(u[a:b] - chord)))
            if bends < MOST and abs(u[bend] - chord[bend - a]) > far + self.step:
                bends += 1
                left += [(bend, b), (a, bend)]
            else:
                made.append(self._piece(slice(a, b), span, self.step + noise))
        return made

    def _piece(self, at: slice, span: float, step: float) -> Piece:
        t, u = self.t[at] - self.t[at.start], self.u[at]
        slope, level = np.polyfit(t, u, 1)
        height = abs(slope) * t[-1]
        straight = float(np.std(u - level - slope * t)) < FLAT * height + step
        if straight and height > 5 * FLAT * span > 0:
            return Piece(at, float(level), float(slope), False, True)
        return Piece(at, float(np.mean(u)), 0.0, bool(np.std(u) <= FLAT * span + step), False)


def _top(v: np.ndarray) -> float:
    return float(np.quantile(np.abs(v), 0.995))


def motions(log: Log) -> list[Motion]:
    rows = usable(log)
    role = "theta" if "theta" in rows.channels else "w"
    if not {"u", role} <= set(rows.channels):
        return []
    made = [_motion(rows, part, role) for part in rows.parts()]
    return [one for one in made if one is not None]


def _motion(rows: Stamped, part: slice, role: str) -> Motion | None:
    t, u, y = rows.t[part], rows.channels["u"][part], rows.channels[role][part]
    good = np.isfinite(t) & np.isfinite(u) & np.isfinite(y)
    t, u, y = t[good], u[good], y[good]
    if len(t) < LEAST_ROWS or np.any(np.diff(t) <= 0):
        return None
    x, fresh = y, np.ones(len(t), bool)
    if role == "w":
        fresh = np.diff(y, prepend=np.nan) != 0
        fresh |= repeats(fresh) <= FEW  # a value that stays for a few rows is new in each
        w = np.interp(t, t[fresh], y[fresh])  # straight between the rows that renew it
        x = np.append(0.0, np.cumsum(0.5 * (w[1:] + w[:-1]) * np.diff(t)))
    dt, step = float(np.median(np.diff(t))), quantum(u) if len(np.unique(u)) > LEVELS else 0.0
    return Motion(t, u, x, y, role == "theta", fresh, white_noise([y]), step, dt)


# ---- the regression


CLEARLY = 4.0  # standard errors from which a further term is there
LEAST = 8  # fresh rows of a stroke
FAST = 0.1  # of the top speed of a stroke: slower, friction may be above its Coulomb level
SCALE = 1e-3  # relative error of any scale and clock, standard deviation
Values = Mapping[str, float]
Columns = dict[str, np.ndarray]


@dataclass(frozen=True, eq=False)
class Fitted:
    """Coefficients by name, their covariance and its degrees of freedom."""

    p: Values
    V: np.ndarray
    freedom: float
    left: float  # RMS of what is left
    moved: float  # RMS of what is fitted
    cost: float
    rows: float  # how many are independent

    def of(self, what: Callable[[Values], float]) -> tuple[float, float]:
        """A function of the coefficients with its standard error."""
        value, slopes = what(self.p), []
        for name, error in zip(self.p, np.sqrt(np.diag(self.V)), strict=False):
            step = SLIGHT * error + TINY
            ahead, behind = (what({**self.p, name: self.p[name] + s}) for s in (step, -step))
            slopes.append((ahead - behind) / (2 * step))
        return float(value), float(np.sqrt(np.maximum(slopes @ self.V @ slopes, 0.0)))

    def clear(self, name: str) -> float:
        value, error = self.of(lambda p: p[name])
        return abs(value) / max(error, TINY)


def solved(
    columns: Columns,
    y: np.ndarray,
    taken: int = 0,
    ends: Sequence[int] = (),
    known: float = 1.0,
    white: bool = False,
) -> Fitted | None:
    """Fit y by columns, without ``taken`` coefficients; None where they cannot be separated. The
    covariance is of what is left, at least of the variance ``known``, with its memory unless it is
    ``white``, or of what differs between strokes with these ``ends``."""
    A = np.column_stack([*columns.values()])
    size, free = np.linalg.norm(A, axis=0), len(y) - A.shape[1] - taken
    if free < 1 or not np.all(size) or not np.all(np.isfinite(A)):
        return None
    B = A / size
    H = B.T @ B
    if np.linalg.cond(H) > 1e12:
        return None
    H = np.linalg.inv(H)
    p = H @ (B.T @ y)
    r = y - B @ p
    cost, strokes = float(r @ r), len(ends) - 1
    rows = free if white else free / min(memory(r), free / 4 + 1)
    V, freedom = H * max(cost / free, known) * free / rows, rows
    if strokes >= AGAIN:
        M = np.array([B[a:b].T @ r[a:b] for a, b in pairwise(ends)])
        apart = H @ (M.T @ M) @ H * strokes / (strokes - 1)
        more = np.sqrt(np.maximum(np.diag(apart) / np.diag(V), 1.0))
        V, freedom = V * np.outer(more, more), min(rows, strokes - 1.0)
    found = dict(zip(columns, (p / size).tolist(), strict=True))
    left = float(np.sqrt(cost / free))
    return Fitted(found, V / np.outer(size, size), freedom, left, rms(y), cost, rows)


def memory(r: np.ndarray) -> float:
    """The integral of the autocorrelation, in rows, up to its first zero."""
    c = correlate(r, r)[len(r) - 1 :]
    if c[0] <= 0:
        return 1.0
    end = int(np.argmax(c <= 0)) or len(c)
    return float(1 + 2 * np.sum(c[1:end]) / c[0])


def interval(value: float, error: float, freedom: float, unit: str, known: float = 0.0) -> Estimate:
    """A value with its 95 % interval, of its standard error and that of sensors."""
    student = float(stats.t.ppf(0.975, max(freedom, 1.0)))
    half = float(np.hypot(student * error, Z95 * np.hypot(known, SCALE * value)))
    return Estimate(float(value), unit, (float(value - half), float(value + half)))


# ---- strokes ---------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Stroke:
    """A motion without a rest; ``at`` are its rows."""

    motion: Motion
    at: slice

    def __getattr__(self, name: str) -> np.ndarray:
        return getattr(self.motion, name)[self.at]

    def integral(self, rate: np.ndarray) -> np.ndarray:
        return np.append(0.0, np.cumsum(0.5 * (rate[1:] + rate[:-1]) * np.diff(self.t)))


Impulse = Callable[[Stroke], np.ndarray]
IMPULSES: dict[str, Impulse] = {  # what each coefficient multiplies, integrated once
    "1/J": lambda s: np.append(0.0, np.cumsum(s.u[:-1] * np.diff(s.t))),
    "Fc": lambda s: -s.integral(np.sign(s.v)),
    "Fv": lambda s: s.x[0] - s.x,
    "constant": lambda s: s.t[0] - s.t,
    "late": lambda s: -s.u,  # acting later than it was logged, to first order
    "sin": lambda s: -s.integral(np.sin(s.x)),
    "cos": lambda s: -s.integral(np.cos(s.x)),
}


def stroked(one: Motion, at: slice) -> list[Stroke]:
    """A stroke without its slow ends, whose speed is smeared with the rest; none of few rows."""
    edge, v = one.window // 2 + 1, np.abs(one.v[at])
    fast = at.start + np.flatnonzero(v > FAST * v.max())
    first = max(int(fast[0]), at.start + edge * (at.start > 0))
    cut = slice(first, min(int(fast[-1]) + 1, at.stop - edge * (at.stop < len(one))))
    enough = cut.stop - cut.start >= LEAST and one.fresh[cut].sum() >= LEAST
    return [Stroke(one, cut)] if enough else []


class Table:
    """Columns of all strokes in units of the noise, with what is free in each taken off."""

    def __init__(self, strokes: Sequence[Stroke]) -> None:
        self.each = []
        for s in strokes:
            at = np.flatnonzero(s.fresh)
            t = s.t[at] - s.t[at[0]]
            powers = np.vander(t / t[-1], 2 if s.motion.angle else 1)
            self.each.append((s, at, np.linalg.qr(powers)[0]))
        self.ends = np.cumsum([0, *(len(at) for _, at, _ in self.each)]).tolist()
        self.y = self._column(lambda s: s.y - s.y[0])

    def of(self, impulse: Impulse) -> np.ndarray:
        return self._column(lambda s: s.integral(impulse(s)) if s.motion.angle else impulse(s))

    def _column(self, of: Impulse) -> np.ndarray:
        made = []
        for s, at, Q in self.each:
            x = of(s)[at]
            made.append((x - Q @ (Q.T @ x)) / s.motion.noise)
        return np.concatenate(made)

    def fit(self, columns: Columns) -> Fitted | None:
        return solved(columns, self.y, sum(Q.shape[1] for _, _, Q in self.each), self.ends)


def best(
    strokes: Sequence[Stroke], terms: Mapping[str, Impulse], more: Sequence[Sequence[str]] = ()
) -> Fitted | None:
    """The fit of the terms, with further ones that are clearly there."""
    table = Table(strokes)
    columns = {k: table.of(impulse) for k, impulse in terms.items()}
    made = table.fit(columns)
    if made is None:
        return None
    for added in more:
        tried = columns | {k: table.of(IMPULSES[k]) for k in added}
        other = table.fit(tried)
        if other is not None and max(map(other.clear, added)) > CLEARLY:
            made, columns = other, tried
    return made


# ---- what the tests have in common


EXPLAINED = 0.015  # of the motion, beyond the noise, that may be left of a test
Found = Mapping[str, Estimate]


@dataclass(frozen=True)
class Bench:
    """The motions of all logs, the declared inertia, and the kind of motion."""

    motions: Sequence[Motion]
    J: float | None
    motion: str

    @cached_property
    def moving(self) -> int:
        return sum(int(np.count_nonzero(one.side)) for one in self.motions)

    def free(self, one: Motion) -> list[slice]:
        least = FLAT * max(float(np.abs(one.u).max()) for one in self.motions)
        return [p.at for p in one.pieces if p.held and abs(p.level) <= least]

    def value(self, fit: Fitted, what: Callable[[Values], float], unit: str) -> Estimate:
        return interval(*fit.of(what), fit.freedom, unit_for(unit, self.motion))


def _both(a: slice, b: slice) -> slice:
    return slice(max(a.start, b.start), max(min(a.stop, b.stop), a.start, b.start))


def _rows(parts: Sequence[slice]) -> int:
    return sum(part.stop - part.start for part in parts)


def _of_strokes(
    strokes: Sequence[Stroke], terms: str, late: bool = False
) -> tuple[Fitted | None, str]:
    """The fit of these terms with Fc and Fv to strokes, and what is said of a single direction."""
    if not strokes:
        return None, ""
    one_way = len({np.sign(s.v[0]) for s in strokes}) == 1
    more = [] if one_way else [["constant"]]
    more += [["late"]] * late + [["sin", "cos"]] * all(s.motion.angle for s in strokes)
    made = best(strokes, {k: IMPULSES[k] for k in terms.split()}, more)
    if made is None or made.p["Fc"] <= 0 or _unexplained(made):
        return None, ""
    return made, ALONE if one_way else ""


def _unexplained(made: Fitted) -> bool:
    return made.left > 1 + EXPLAINED * made.moved


# ---- coast-down: no torque, and the motion dies out


DIES = 0.3  # of the speed at its start, to which a coast falls at least
COASTING = 0.2  # of the moving rows


def coast_down(bench: Bench) -> BenchTest | None:
    """Fc/J and Fv/J of all coasts, and both with J where it is known."""
    coasts = [s for one in bench.motions for s in _coasts(one, bench.free(one))]
    if _rows([s.at for s in coasts]) < COASTING * bench.moving:
        return None
    made, alone = _of_strokes(coasts, "Fc Fv")
    if made is None or made.p["Fv"] < -2 * made.of(lambda p: p["Fv"])[1]:
        return None  # no friction: something else brakes
    values = {f"{k}/J": bench.value(made, lambda p, k=k: p[k], unit)
              for k, unit in (("Fc", "rad/s2"), ("Fv", "1/s"))}  # fmt: skip
    if J := bench.J:
        values |= {k: bench.value(made, lambda p, k=k, J=J: J * p[k], unit)
                   for k, unit in (("Fc", "N m"), ("Fv", "N m s/rad"))}  # fmt: skip
    many = f"{len(coasts)} coast-downs" if len(coasts) > 1 else "One coast-down"
    return BenchTest("coast_down", f"{many}: {in_words(values)}.{alone}", values)


def _coasts(one: Motion, free: Sequence[slice]) -> list[Stroke]:
    """The strokes without torque in which the speed falls and does not rise again."""
    found = []
    for at in (_both(*pair) for pair in product(free, one.strokes)):
        v = np.abs(one.v[at])
        if len(v) > 3 * one.window and v[-1] < DIES * v[0]:
            rises = np.maximum.accumulate(v[::-1])[::-1] - v
            if np.all(rises < LITTLE * v[0] + NOISE * one.speeds[1]):
                found += stroked(one, at)
    return found


# ---- steps and pulses of the torque


HELD = 0.9  # of the moving rows, in which the torque must be held
DRIVEN = 0.1  # of the largest torque: more drives the motion
APART = 0.2  # of the largest torque, by which two levels differ
CHANGED = 0.5  # of all changes of the speed, that happen while the torque is held


def steps_and_pulses(bench: Bench) -> BenchTest | None:
    """J, Fc and Fv of the motion between the steps of the torque."""
    found = [one for one in bench.motions if _is_held(one)]
    levels = np.sort([p.level for one in found for p in one.pieces if p.held])
    if not np.any(np.diff(levels) > APART * np.abs(levels).max(initial=0.0)):
        return None
    strokes = [s for one in found for at in one.strokes for s in stroked(one, at)]
    made, alone = _of_strokes(strokes, "1/J Fc Fv", late=True)
    if made is None or made.p["1/J"] <= 0:
        return None
    values = {"J": bench.value(made, lambda p: 1 / p["1/J"], "kg m2")}
    values |= {k: bench.value(made, lambda p, k=k: p[k] / p["1/J"], unit)
               for k, unit in (("Fc", "N m"), ("Fv", "N m s/rad"))}  # fmt: skip
    pushes = sum(p.held and p.level != 0 for one in found for p in one.pieces)
    said = f"{pushes} torque steps or pulses: {in_words(values)}.{alone}"
    return BenchTest("steps_and_pulses", said, values)


def _is_held(one: Motion) -> bool:
    """Whether nearly all motion is under a held torque, which does not only keep a speed."""
    moving, held = np.abs(one.side) > 0, np.zeros(len(one), bool)
    pieces = [p.at for p in one.pieces if p.held]
    for at in pieces:
        held[at] = True
    driven = moving & (np.abs(one.u) > DRIVEN * np.abs(one.u).max())
    if not driven.any() or held[moving].mean() < HELD:
        return False
    parts = [one.v[_both(*pair)] for pair in product(one.strokes, pieces)]
    changed = sum(abs(v[-1] - v[0]) for v in parts if len(v))
    sizes = [np.abs(one.v[at]) for at in one.strokes]
    return bool(changed > CHANGED * sum(2 * v.max() - v[0] - v[-1] for v in sizes))


# ---- free swing about the lowest angle of the load


G = 9.81  # m/s2
SWUNG = 0.02  # rad, of a half-swing, at least
PER_PART = 2  # half-swings, over which an integral keeps its noise small


def free_swing(bench: Bench) -> BenchTest | None:
    """Length, gravity, damping and friction of the longest swing, for each unit of inertia."""
    swings = [(one, halves) for one in bench.motions for at in bench.free(one)
              for halves in _alternating(one, at) if len(halves) >= SEVERAL]  # fmt: skip
    if not swings or bench.motion != "rotary":
        return None
    one, halves = max(swings, key=lambda swing: len(swing[1]))
    edges = [h.start for h in halves[::PER_PART]] + [halves[-1].stop]
    strokes = [Stroke(one, slice(a, b)) for a, b in pairwise(edges)]
    made = best(strokes, {k: IMPULSES[k] for k in ("Fc", "Fv", "sin", "cos")})
    if made is None or _unexplained(made):
        return None

    def pull(p: Values) -> float:
        return float(np.hypot(p["sin"], p["cos"]))

    values = {"length": bench.value(made, lambda p: G / pull(p), "m"),
              "gravity/J": bench.value(made, pull, "rad/s2"),
              "Fc/J": bench.value(made, lambda p: p["Fc"], "rad/s2"),
              "Fv/J": bench.value(made, lambda p: p["Fv"], "1/s")}  # fmt: skip
    said = f"Free swing, {len(halves)} times through: {in_words(values)}."
    return BenchTest("free_swing", said, values)


def _alternating(one: Motion, at: slice) -> list[list[slice]]:
    """Strokes in turn forwards and backwards, each shorter than the last; the first may be cut."""
    found: list[list[slice]] = [[]]
    for stroke in one.strokes:
        if stroke.start < at.start or stroke.stop > at.stop or np.ptp(one.x[stroke]) < SWUNG:
            continue
        if found[-1]:
            last = found[-1][-1]
            turned = one.side[last.start] != one.side[stroke.start]
            soon = stroke.start - last.stop < last.stop - last.start
            shorter = np.ptp(one.x[stroke]) < np.ptp(one.x[last]) or len(found[-1]) == 1
            if not (turned and soon and shorter):
                found.append([])
        found[-1].append(stroke)
    return found


# ---- breakaway ramps: the torque rises until the axis runs away


RAMPS, MOSTLY = 0.3, 0.8  # of the rows: ramps that end in motion; these and held torque
REST = 5  # rows of rest before a breakaway


def breakaway_ramps(bench: Bench) -> BenchTest | None:
    """Static friction in each direction and at each place, with its scatter."""
    parts = [(one, piece) for one in bench.motions for piece in one.pieces]
    held, every = _rows([p.at for _, p in parts if p.held]), sum(map(len, bench.motions))
    tried = [(p.at, _breakaway(one, p)) for one, p in parts if p.ramp]
    found = [b for _, b in tried if b is not None]
    ramps = _rows([at for at, b in tried if b is not None])
    if len(found) < SEVERAL or ramps < RAMPS * every or ramps + held < MOSTLY * every:
        return None
    torque, known, angle = np.array(found).T
    ways = {"Fs_forward": torque > 0, "Fs_backward": torque < 0}
    ways = {k: at for k, at in ways.items() if at.any()}
    freedom, unit = len(found) - len(ways), unit_for("N m", bench.motion)
    means = {k: float(np.abs(torque[at]).mean()) for k, at in ways.items()}
    off = np.concatenate([np.abs(torque[at]) - means[k] for k, at in ways.items()])
    scatter = float(np.sqrt(off @ off / freedom))
    values = {k: interval(means[k], scatter / np.sqrt(at.sum()), freedom, unit, known[at].mean())
              for k, at in ways.items()}  # fmt: skip
    low, high = scatter * np.sqrt(freedom / stats.chi2.ppf((0.975, 0.025), freedom))
    ends = (max(float(low - known.mean()), 0.0), float(high + known.mean()))
    values["Fs_scatter"] = Estimate(scatter, unit, ends)
    many = " and ".join(f"{at.sum()} {k[3:]}" for k, at in ways.items())
    x = "x [m]" if bench.motion == "linear" else "theta [rad]"
    rows = tuple((float(x), "forward" if u > 0 else "backward", abs(float(u)))
                 for x, u in zip(angle, torque, strict=True))  # fmt: skip
    table = BenchTable((x, "direction", f"Fs [{unit}]"), rows)
    said = f"Breakaway in {many} ramps: {in_words(values)}."
    return BenchTest("breakaway_ramps", said, values, table)


def _breakaway(one: Motion, ramp: Piece) -> tuple[float, float, float] | None:
    """The torque at which the axis runs away, what is not known of it, and the angle. It moves with
    the third power of time, as under a torque that rises from balance: it began as long before it
    is seen as it then takes to move eight times as far."""
    side = np.sign(ramp.slope)
    inside = [s for s in one.strokes if ramp.at.start + REST <= s.start < ramp.at.stop]
    inside = [s for s in inside if one.side[s.start] == side]
    stroke = max(inside, key=lambda s: np.ptp(one.x[s]), default=None)
    if stroke is None:
        return None
    before = max(stroke.start - one.window - REST, ramp.at.start)
    rest = np.median(one.y[max(before - 2 * REST, ramp.at.start) : before + 1])
    moved = side * (one.y[before : stroke.stop] - rest)
    seen = len(moved) - int(np.argmax(moved[::-1] <= NOISE * one.noise))
    far = (moved > moved[min(seen, len(moved) - 1)] * (8 if one.angle else 4)).nonzero()[0]
    if not len(far) or seen >= len(moved):
        return None
    later = 0.5 * float(one.t[before + far[0]] - one.t[before + seen])
    since = one.t[before + seen] - one.t[ramp.at.start] - later - one.dt / 2
    torque = ramp.level + ramp.slope * since
    unsure = np.hypot(abs(ramp.slope) * np.hypot(later, one.dt), one.step / np.sqrt(12))
    found = float(torque), float(unsure), float(one.x[before])
    return found if torque * side > 0 else None


# ---- slow scan both ways: half the difference of the directions is friction


EVEN = 0.4  # of its mean, by which the speed of a scan may vary (RMS)
DRIFT = 0.15  # of its mean, by which thirds of a scan may differ in speed
ALIKE = 1.25  # ratio of the speeds of two scans of one test, at most
ENDS = 0.04  # of a scan at each end, in which the speed settles
SCANNED = 0.5  # of the moving rows that are scans
CELLS = 360  # of a turn, over which rows are averaged
BINS = 72  # of a turn in the table
ORDERS = range(1, 41)  # per turn


def slow_scan(bench: Bench) -> BenchTest | None:
    """Friction at the speed of the scan, and the cogging over the turn."""
    scans = [(one, at) for one in bench.motions for stroke in one.strokes
             if (at := _scan(one, stroke)) is not None]  # fmt: skip
    rows = _rows([at for _, at in scans])
    if bench.motion != "rotary" or not scans or rows < SCANNED * bench.moving:
        return None
    x, u, a, w = np.concatenate([_cells(one, at) for one, at in scans], axis=1)
    if np.ptp(np.sign(w)) == 0 or np.abs(w).max() > ALIKE * np.abs(w).min():
        return None
    columns, u = {"Fc": np.sign(w), **_harmonics(x)}, u - (bench.J or 0.0) * a
    rival = solved(columns, u, known=0.0)
    if rival is None:
        return None
    # J shows in how the directions differ, as does friction that varies
    made = rival if bench.J else solved(columns | {"J": a}, u, known=0.0) or rival

    def value(what: Callable[[Values], float]) -> Estimate:
        off = abs(what(made.p) - what(rival.p)) / np.sqrt(2)
        return interval(*made.of(what), made.freedom, "N m", off)

    values = {"Fc": value(lambda p: p["Fc"])}
    size = {n: value(lambda p, n=n: float(np.hypot(p[f"cos{n}"], p[f"sin{n}"]))) for n in ORDERS}
    for n in sorted(size, key=lambda n: -size[n].value)[:FIRSTS]:
        if (size[n].ci95 or (0.0,))[0] > 0.5 * size[n].value:
            values[f"cogging.{n}"] = size[n]
    speed = number(float(np.abs(w).mean()), 3)
    said = f"Slow scan both ways at {speed} rad/s (Fc is the friction there): {in_words(values)}."
    table = _over_turn(x, u - made.p.get("J", 0.0) * a, w > 0)
    return BenchTest("slow_scan", said, values, table)


def _scan(one: Motion, at: slice) -> slice | None:
    """The rows of a motion of a turn or more at one speed."""
    cut = int(ENDS * (at.stop - at.start))
    at = slice(at.start + cut, at.stop - cut)
    if at.stop - at.start < 2 * BINS or np.ptp(one.x[at]) < 2 * np.pi:
        return None
    v = one.v[at]
    w, thirds = abs(float(v.mean())), [float(part.mean()) for part in np.array_split(v, 3)]
    even = np.std(v) < EVEN * w + 2 * one.speeds[1] and np.ptp(thirds) < DRIFT * w
    return at if even else None


def _cells(one: Motion, at: slice) -> np.ndarray:
    """The angle, the torque, the acceleration and the speed of a scan in cells of the turn."""
    w = float(one.v[at].mean())
    many = max(round(2 * np.pi / CELLS / (abs(w) * one.dt)), 1)
    count = (at.stop - at.start) // many
    x, u, v = (z[at][: count * many].reshape(count, many).mean(1) for z in (one.x, one.u, one.v))
    fit = solved(_harmonics(x), v, known=0.0)
    p, a = fit.p if fit else dict.fromkeys(_harmonics(x), 0.0), 0 * x
    for n in ORDERS:  # of the harmonics of the speed
        a += n * w * (p[f"sin{n}"] * np.cos(n * x) - p[f"cos{n}"] * np.sin(n * x))
    # the torque is held over the step that follows
    return np.array([x + 0.5 * one.dt * w, u, a, 0 * x + w])


def _harmonics(x: np.ndarray) -> dict[str, np.ndarray]:
    made = {"1": np.ones(len(x))}
    for n in ORDERS:
        made |= {f"cos{n}": np.cos(n * x), f"sin{n}": np.sin(n * x)}
    return made


def _over_turn(x: np.ndarray, u: np.ndarray, ahead: np.ndarray) -> BenchTable:
    of = {"bins": BINS, "range": (0.0, 2 * np.pi)}
    forward, backward = (stats.binned_statistic(np.mod(x[at], 2 * np.pi), u[at], **of).statistic
                         for at in (ahead, ~ahead))  # fmt: skip
    sums, angle = 0.5 * (forward + backward), (np.arange(BINS) + 0.5) * 2 * np.pi / BINS
    columns = angle, sums - np.nanmean(sums), 0.5 * (forward - backward)
    rows = tuple(map(tuple, plain(np.transpose(columns))))
    return BenchTable(("theta [rad]", "cogging [N m]", "friction [N m]"), rows)


# ---- staircase of speeds: a point of the friction curve from each plateau


BLOCK = 0.1  # s, over which a speed is taken
MANY = 3000  # blocks of a log
KEEPS = 0.06  # of its speed, within which a plateau keeps it
FEWEST = 4  # blocks of a plateau
SETTLING = 0.3  # of a plateau, at its start, in which the loop settles
STEADY = 0.004  # of its speed, by which the second half of a plateau may differ
SWINGS = 1.2  # standard deviations of the noise, by which the axis that sticks leaves a line
LEVEL, SPEEDS = 1.12, 4  # ratio of two speeds that are two, and how many there must be
COVERED = 0.6  # of the moving rows, that must be on plateaus
PARTS = 8  # of a plateau, at most, whose scatter tells its error
SLOWLY = 2.0  # times its change from row to row, by which a torque wanders: no noise of a loop
SWINGING = 0.25  # of the torque's RMS, by which its mean is no friction where the speed swings
TRIED, LOWEST = 200, 0.25  # speeds of a fall of friction, and the first over the slowest plateau
SURELY = 16.0  # chi square by which a fall of friction, three more values, lowers the misfit
TOO_FAST = "No plateau is slow and steady enough for Fs and vs."


def staircase(bench: Bench) -> BenchTest | None:
    """The friction curve of the plateaus with Fc, Fv, and Fs and vs where friction falls."""
    both = [(one, *ends) for one in bench.motions for ends in _plateaus(one)]
    found = [(one, at) for one, _, at in both]
    if not found or _rows([whole for _, whole, _ in both]) < COVERED * bench.moving:
        return None
    w = np.array([np.diff(one.x[at][[0, -1]])[0] / np.ptp(one.t[at]) for one, at in found])
    if 1 + np.sum(np.diff(np.log(np.sort(np.abs(w)))) > np.log(LEVEL)) < SPEEDS:
        return None
    u, error = np.array([_torque(one, at) for one, at in found]).T
    values = _stribeck(bench, w, u, np.hypot(error, 1e-4 * np.abs(u).max()))
    if values is None:
        return None
    torque, speed = unit_for("N m", bench.motion), unit_for("rad/s", bench.motion)
    ends = Z95 * np.hypot(error, SCALE * u)
    rows = tuple(map(tuple, np.column_stack([w, u, ends])[np.argsort(w)].tolist()))
    table = BenchTable((f"w [{speed}]", f"u [{torque}]", f"+- [{torque}]"), rows)
    fast = "" if "vs" in values else f" {TOO_FAST}"
    said = f"Staircase of {len(w)} plateaus: {in_words(values)}.{fast}"
    return BenchTest("staircase", said, values, table)


def _plateaus(one: Motion) -> list[tuple[slice, slice]]:
    """The rows of each plateau, and those in which it has settled."""
    size = max(int(BLOCK / one.dt), len(one) // MANY, 5)
    edges = np.arange(0, len(one), size)
    b = np.diff(one.x[edges]) / np.diff(one.t[edges])  # mean speeds of blocks
    noise = one.noise * (np.sqrt(2) / (size * one.dt) if one.angle else size**-0.5)
    ends, made = [0], []
    for k in range(1, len(b)):  # a block whose speed is another
        mean = b[ends[-1] : k].mean()
        if abs(b[k] - mean) > KEEPS * abs(mean) + NOISE * noise:
            ends.append(k)
    for k, end in (at for at in pairwise([*ends, len(b)]) if np.ptp(at) >= FEWEST):
        first = k + max(int(np.ceil(SETTLING * (end - k))), 1)
        last = max(end - 1, first + 1)
        w, later = b[first:last], b[(first + last) // 2 : last]
        off, error = abs(later.mean() - w.mean()), noise / np.sqrt(len(w))
        if off < STEADY * abs(w.mean()) + 2 * error and abs(w.mean()) > 2 * NOISE * error:
            made.append((slice(k * size, end * size), slice(first * size, last * size)))
    return made


def _torque(one: Motion, at: slice) -> tuple[float, float]:
    """The mean torque of a plateau and its error, a large one where the axis sticks and slips."""
    u, t = one.u[at], one.t[at] - one.t[at.start]
    parts = np.array_split(u, min(PARTS, len(u)))
    error = float(np.std([part.mean() for part in parts], ddof=1) / np.sqrt(len(parts)))
    off = one.y[at] - np.polyval(np.polyfit(t, one.y[at], int(one.angle)), t)
    slow = np.std(u) > SLOWLY * np.std(np.diff(u))
    if slow or np.std(off) > SWINGS * one.noise:
        error = np.hypot(error, SWINGING * float(np.std(u)))
    return float(u.mean()), float(np.hypot(error, one.step / np.sqrt(12)))


def _stribeck(bench: Bench, w: np.ndarray, u: np.ndarray, error: np.ndarray) -> Found | None:
    """Stribeck's law along the points, at each vs that it may have."""
    side, more = np.sign(w), "" if np.ptp(np.sign(w)) else ONE_WAY
    columns = {"Fc": side / error, "Fv": w / error}
    columns |= {} if more else {"constant": 1 / error}

    def fallen(vs: float) -> np.ndarray:
        return side * level(w, 0.0, 1.0, vs) / error

    made, y = solved(columns, u / error, white=True), u / error
    if made is None:
        return None
    speeds = np.geomspace(LOWEST * np.abs(w).min(), np.abs(w).max(), TRIED).tolist()
    fits = {vs: solved(columns | {"fall": fallen(vs)}, y, white=True) for vs in speeds}
    fits = {vs: one for vs, one in fits.items() if one is not None and one.p["fall"] > 0}
    vs = min(fits, key=lambda vs: fits[vs].cost, default=0.0)
    if vs and made.cost - fits[vs].cost > SURELY * max(fits[vs].cost / fits[vs].rows, 1.0):
        bend = fits[vs].p["fall"] * (fallen(1.01 * vs) - fallen(vs / 1.01)) / np.log(1.01**2)
        made = solved(columns | {"fall": fallen(vs), "log": bend}, y, white=True) or made
    if made.left * np.median(error) > LITTLE * np.abs(u).mean() or made.p["Fc"] <= 0:
        return None  # on no curve, or no friction: the axis only seems to keep its speed
    values = {"Fc" + more: bench.value(made, lambda p: p["Fc"], "N m"),
              "Fv": bench.value(made, lambda p: p["Fv"], "N m s/rad")}  # fmt: skip
    if "log" in made.p:
        static = bench.value(made, lambda p: p["Fc"] + p["fall"], "N m")
        low, high = bench.value(made, lambda p: p["log"], "1").ci95 or (0.0, 0.0)
        if high - low < 2 and (static.ci95 or (0.0,))[0] > 0:  # slow enough plateaus
            best, *ends = (vs * np.exp([made.p["log"], low, high])).tolist()
            own = Estimate(best, unit_for("rad/s", bench.motion), (ends[0], ends[1]))
            values |= {"Fs" + more: static, "vs": own}
    return values


# ---- the table


KINDS = {  # with other kinds that a test's own rows look like
    breakaway_ramps: ("coast_down",),  # from the low speed at which a ramp ends
    slow_scan: ("staircase",),  # where its speed is coarse
    coast_down: (),
    free_swing: (),
    steps_and_pulses: (),
    staircase: ("steps_and_pulses",),  # of its loop in saturation
}


def bench_tests(logs: Sequence[Log], model: Model) -> tuple[BenchTest, ...]:
    """Every standard test in the logs of one drive; none where there is none."""
    made, other = list[BenchTest](), set[str]()
    with np.errstate(all="ignore"), suppress(np.linalg.LinAlgError):
        found = [one for log in logs for one in motions(log)]
        bench = Bench(found, model.known().get("J"), model.motion)
        for kind, instead in KINDS.items() if found else ():
            with suppress(np.linalg.LinAlgError):  # the numbers of a log have no solution
                test = kind(bench)
                if test is not None and _answers(test):
                    made.append(test)
                    other.update(instead)
    return tuple(test for test in made if test.kind not in other)


def _answers(test: BenchTest) -> bool:
    """Whether a value is known by more than its size, as where the log is such a test."""
    sizes = [(abs(e.value), e.ci95) for k, e in test.values.items() if k != "Fs_scatter"]
    return any(ends and ends[1] - ends[0] < 2 * KNOWN * size for size, ends in sizes)

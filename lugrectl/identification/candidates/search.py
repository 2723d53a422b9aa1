"""The contenders: each effect at the values of its parameters that explain most."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from ...blocks.block import Block, members
from ..regression.smooth_motion import shifted, spline
from . import dwell_stiction
from .any_parameters import over_all, simplex
from .base_model import OFFSET, TURN, Base, Columns, rms
from .candidate import Entry, enter
from .declared_effects import through
from .effect_columns import by_run, column, columns, over, searched, spanned
from .friction_terms import NAMES
from .residual_spectrum import lowest, spectrum
from .search_ranges import grid_of
from .spring_loads import springs

WAYS = 2  # values of an order that are entered
POLISH = 20  # evaluations
ACTIVE = 4  # searches at most, each beside the terms that are not at a bound after the last one
PASSED = 6.0  # rad of an order within a window: beyond, nothing of it is left
FEW = 4.0  # rad of an order within the travel, at least: a slower torque is a spring or gravity
TIMES = (3e-4, 0.05, 14)  # delays and lags to try beyond the free ones: from, to (s), how many
# quantiles of |u| to try as a limit: no drive is saturated most of the time
CLIPPED = (0.6, 0.65, 0.7, 0.75, 0.8, 0.85, 0.9, 0.93, 0.95, 0.97, 0.98, 0.99, 0.995, 0.999, 1.0)
SOONEST, LATEST = 0.04, 0.96  # of the record, for a change in time
MISSING_LAW = ("stribeck", "presliding", "sublinear_viscous")
KINEMATIC = ("velocity_sensor_lag",)
INSTEAD = {
    "constant_torque": OFFSET,
    "coulomb_asymmetry": OFFSET,
    "gravity": TURN,
}  # of what every drive has


def shown(base: Base) -> list[Block]:
    """The effects that the record may show."""
    return [
        block
        for name, block in members("effect").items()
        if name not in (*MISSING_LAW, *KINEMATIC, *base.inside) and not _pointless(base, block)
    ]


def _pointless(base: Base, block: Block) -> bool:
    """An effect that this record cannot show: of one direction, of a load, of a turn."""
    m = base.record.motion
    both = {"constant_torque", "coulomb_asymmetry", "viscous_asymmetry"}
    if m.one_way and block.name in both:
        return True
    if "load" in block.inputs and not (np.any(base.weight) or np.any(m.d)):
        return True
    turned = m.motion == "linear"
    if "sensor" in block.acts and (turned or m.span < 3.0):
        return True
    return block.name == "gravity" and (base.gravity or turned)


def entries(base: Base, block: Block) -> Iterator[Entry]:
    """An entry or a few for an effect."""
    free = searched(block)
    if block.states and "input" in block.acts and block.exact is None:
        return  # one of the user's own, to be declared: its states are not known along the record
    if block.states and "Fs" in block.acts:
        yield from dwell_stiction.entries(base, block)
    elif block.states and "input" not in block.acts:
        yield from springs(base, block)
    elif "input" in block.acts and block.gain in ("delay", "time_constant", "limit", "half_width"):
        yield _of_torque(base, block)
    elif "load" in block.inputs:
        yield from _of_load(base, block)
    elif not free:
        yield from _linear(base, block)
    elif {*free} == {"position", "side"} and block.own["position"].passed:
        yield _stop(base, block)
    elif free == ["frequency"] and block.reads == ("t",) and spanned(block):
        yield from _sinusoid(base, block)
    elif len(free) == 1 and grid_of(block, free[0]) is not None:
        yield from _over_grid(base, block, free[0])
    else:
        yield from over_all(base, block, free)


def _linear(base: Base, block: Block) -> Iterator[Entry]:
    made = columns(base, block, {})
    entry = Entry(block.name, {}, made, instead=INSTEAD.get(block.name, ()))
    if block.name == "return_spring":
        k, c = enter(base, entry).coefficients
        if k <= 0 or abs(c / k) > base.record.motion.span:
            return  # its rest lies outside of the travel
    yield entry
    if block.name == "quadratic_drag":  # or in place of the longest Stribeck curve, which bends so
        tail = 2 + NAMES.index("dip 5")
        yield Entry(block.name, {}, made, cost=float(np.log(2)), instead=[tail])


def _of_load(base: Base, block: Block) -> Iterator[Entry]:
    """The load is the weight, fitted or as declared, and a load that was measured, alone and with
    the torque of the inertia.

    A fitted weight is not zero at the right place where the travel is small: there an offset is
    a part of it. Friction under the torque of the inertia is part of what opposes an acceleration:
    the plain answer, which has no such friction, counts it as inertia.
    """
    m, weights = base.record.motion, [base.weight, *_declared_weight(base)]
    known = [m.d + w for w in weights if np.any(m.d) or np.any(w)]
    loads = [(load, part > 0) for w in known for part, load in enumerate((w, w + base.J * m.a))]
    for load, inertial in loads:
        out = block(load, **{block.gain: 1.0})[0]
        own = Columns.free(base.record.mean(out * base.law.z)[:, None], 0.0)
        cost = float(np.log(len(loads)))
        yield Entry(block.name, {}, own, cost=cost, inertial=inertial)


def _declared_weight(base: Base) -> list[np.ndarray]:
    """Its size as fitted, its phase as declared, if it is."""
    m, size = base.record.motion, rms(base.weight)
    parts = [p.values for p in base.record.parts if p.block.name == "gravity"]
    phases = [p.get("phase") for p in parts]
    waves = [np.sin(m.theta + phase) for phase in phases if phase is not None]
    return [size / (rms(wave) + 1e-300) * wave for wave in waves]


def _over_grid(base: Base, block: Block, key: str) -> Iterator[Entry]:
    """One parameter over its declared grid."""
    grid = _grid(base, block, key)
    if not len(grid):
        return
    pair = spanned(block) is not None
    C = over(base, block, key, grid)
    gains = base.gains_of_pairs(C) if pair else base.gains(C)[0]
    kept = block.own[key].whole and base.record.motion.motion != "linear"
    if kept and pair:
        yield from _of_each_run(base, block, key, grid, C)
    for i in np.argsort(gains)[::-1][: WAYS if kept else 1]:
        value = float(grid[i])
        if not kept and len(grid) > 2:
            value = _polished(base, block, key, grid, int(i), pair)
        entered = columns(base, block, {key: value})
        yield Entry(block.name, {key: value}, entered, cost=float(np.log(len(grid))),
                    inertial="J" in block.acts)  # fmt: skip


def _of_each_run(
    base: Base, block: Block, key: str, grid: np.ndarray, C: np.ndarray
) -> Iterator[Entry]:
    """An order with another phase in each run, whose positions need not have one zero."""
    run = base.record.motion.run[base.record.rows.at]
    runs = np.unique(run)
    if len(runs) < 2:
        return
    i = int(np.argmax(sum(base.gains_of_pairs(C * (run == r)[:, None]) for r in runs)))
    made = by_run(base, columns(base, block, {key: float(grid[i])}))
    cost = float(np.log(2 * len(grid)))
    yield Entry(block.name, {key: float(grid[i])}, made, cost=cost, inertial="J" in block.acts,
                by_run=True)  # fmt: skip


def _grid(base: Base, block: Block, key: str) -> np.ndarray:
    declared = grid_of(block, key)
    m, rows = base.record.motion, base.record.rows
    if declared is None:
        return np.zeros(0)
    grid = np.asarray(declared(m), float)
    if block.own[key].whole:
        speed = float(np.median(np.abs(m.w[rows.at])))
        few = 0.0 if "J" in block.acts else FEW  # no other row is an inertia that changes slowly
        seen = (grid * m.span > few) & (grid * speed * rows.h < PASSED)
        return grid[seen]
    if key == "time":
        return m.t[-1] * np.linspace(SOONEST, LATEST, 93)
    return grid


def _polished(base: Base, block: Block, key: str, grid: np.ndarray, i: int, pair: bool) -> float:
    """The likeliest value around one of the grid; what lies beyond it was not asked for."""
    step = float(np.min(np.diff(grid)[max(i - 1, 0) : i + 1]))
    low, high = np.min(grid), np.max(grid)

    def gain(x: float) -> float:
        if not low <= x <= high:
            return -1.0
        C = columns(base, block, {key: x}, screening=True).X
        return float(base.gains_of_pairs(C)[0] if pair else base.gains(C)[0][0])

    return float(simplex(lambda p: gain(p[0]), [grid[i]], [0.3 * step], POLISH)[0])


def _sinusoid(base: Base, block: Block) -> Iterator[Entry]:
    """A frequency: the spectrum of the residual in the windows, then polished."""
    rows, m = base.record.rows, base.record.motion
    f, power = spectrum(base)
    if not np.any(power):
        return  # no wave that the windows show comes back in the record
    start, least = float(f[np.argmax(power)]), lowest(base)

    def gain(p: np.ndarray) -> float:
        if p[0] < least:
            return -1.0
        at = 2 * np.pi * p[0] * rows.t
        return float(base.gains_of_pairs(np.column_stack([np.sin(at), np.cos(at)]))[0])

    found = float(simplex(gain, [start], [0.15 / m.t[-1]], POLISH)[0])
    made = columns(base, block, {"frequency": found})
    cost = float(np.log(max(np.sum(power > 0) / 2, 1.0)))
    yield Entry(block.name, {"frequency": found}, made, cost=cost)


def _of_torque(base: Base, block: Block) -> Entry:
    """The torque that reaches the drive is another one: the motion given that torque.

    Terms of the base that are at a bound without the effect may leave it beside the effect: a delay
    acts against viscous friction.
    """
    key, p = block.gain, block.own[block.gain]
    timed = p.unit == "s"
    grid = _of_torques(base, key, timed, p.neutral or 0.0)
    free = base.made.free
    for _ in range(ACTIVE):
        value = _likeliest(base, block, grid, free, timed)
        u = applied(base, block, {key: value})
        entry = Entry(block.name, {key: value}, u=u, cost=float(np.log(8)), timed=timed)
        before, free = free, enter(base, entry).made.free
        if np.array_equal(before, free):
            break
    return entry


def _likeliest(base: Base, block: Block, grid: np.ndarray, free: np.ndarray, timed: bool) -> float:
    """The value with which the torque is most like the acceleration, beside the terms ``free``."""
    free = free.copy()
    free[1] = free[1] and not timed
    a, Q = base.acceleration_beside(free)

    def mean(x: float) -> np.ndarray:
        return base.record.driving(applied(base, block, {block.gain: x}))

    def likeness(x: float, searched: bool = True) -> float:
        y = mean(x) if searched else base.record.once((block.name, x), base.u, lambda: mean(x))
        y = y * base.roots
        y = y - Q @ (Q.T @ y)
        return float((y @ a) ** 2 / (y @ y + 1e-300))

    i = int(np.argmax([likeness(float(x), searched=False) for x in grid]))
    return _golden(likeness, grid[max(i - 1, 0)], grid[min(i + 1, len(grid) - 1)])


def _of_torques(base: Base, key: str, timed: bool, neutral: float) -> np.ndarray:
    size, record = np.abs(base.u), base.record
    if timed:
        return np.append(1e-5, max(record.latest, 0.0) + np.geomspace(*TIMES))
    if np.isinf(neutral):
        return np.quantile(size, CLIPPED)
    return np.append(0.0, np.geomspace(0.01, 0.6, 12) * np.quantile(size, 0.7))


def applied(base: Base, block: Block, values: dict[str, float]) -> np.ndarray:
    """The torque behind an effect on the input, stretch by stretch."""
    m = base.record.motion
    if block.gain == "delay":
        return _late(base, values["delay"])
    return through(block, values, base.u, m)


def _late(base: Base, delay: float) -> np.ndarray:
    """u(t - delay) with a cubic between the samples."""
    m = base.record.motion
    parts = base.record.once("splines of u", base.u, lambda: [spline(base.u[p]) for p in m.pieces])
    return np.concatenate([shifted(part, delay / m.dt) for part in parts])


def _golden(f: Callable[[float], float], low: float, high: float, rounds: int = 8) -> float:
    for _ in range(rounds):
        a, b = low + 0.382 * (high - low), low + 0.618 * (high - low)
        low, high = (low, b) if f(a) > f(b) else (a, high)
    return 0.5 * (low + high)


def _stop(base: Base, block: Block) -> Entry:
    """A position that a minority of the samples pass, on one side."""
    m = base.record.motion
    th, span = m.theta, float(np.ptp(m.theta))
    inner = np.quantile(th, [0.3, 0.7])
    deep = span * np.linspace(0.02, 0.35, 15)
    tails = np.quantile(
        th, np.concatenate([np.linspace(0.003, 0.3, 20), np.linspace(0.7, 0.997, 20)])
    )
    at = np.unique(np.concatenate([tails, th.min() + deep, th.max() - deep]))
    at = at[(at <= inner[0]) | (at >= inner[1])]

    def side(x: float) -> float:
        return 1.0 if x >= inner[1] else -1.0

    def of(x: float, s: float) -> np.ndarray:
        return column(base, block, {"position": x, "side": s, block.gain: 1.0})[:, None]

    gains, b = base.gains(np.column_stack([of(x, side(x)) for x in at]))
    start = float(at[np.argmax(np.where(b > 0, gains, 0.0))])
    s = side(start)

    def gain(p: np.ndarray) -> float:
        outside = p[0] >= inner[1] if s > 0 else p[0] <= inner[0]
        return float(base.gains(of(p[0], s))[0][0]) if outside else -1.0

    x = float(simplex(gain, [start], [0.01 * span], 15)[0])
    values = {"position": x, "side": s}
    return Entry(block.name, values, Columns.free(of(x, s), 0.0), cost=float(np.log(len(at))))

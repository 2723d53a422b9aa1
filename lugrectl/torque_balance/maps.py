"""Runs at a steady speed each, a friction map: means over stretches as rows of the one table.

    mean u = F(w) + mean of what depends on theta + residual

No inertia is in it: nothing changes the speed. A run may be short, of any rate, and
have w or theta only. Errors that a whole run shares are what a map is uncertain by, so runs are
left out, and runs are held out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.sparse import csr_matrix
from scipy.stats import norm, rankdata

from ..blocks.block import Block, members
from ..blocks.model import Model
from ..core.errors import Refused
from ..core.regression import TINY, Blocks
from ..record import Stretch
from . import constants as const
from .columns import Along, needs_inertia
from .friction import View, declared_terms
from .motion import Motion, in_turn
from .table import errors_of
from .windows import Rows

PLAIN_LAW = {"J", "late", "Fc", "bump", "Fv"}


@dataclass(frozen=True, eq=False)
class Run:
    """A run at steady speed ``w`` (rad/s), sampled every ``dt`` s, as nodes (n,)."""

    number: int
    w: float
    dt: float
    t: np.ndarray  # means of time, torque, load torque and angle ...
    u: np.ndarray
    d: np.ndarray
    theta: np.ndarray
    size: np.ndarray  # ... over so many samples ...
    part: np.ndarray  # ... in these stretches


def is_map(stretches: Sequence[Stretch]) -> bool:
    """Whether the logs are four or more runs at a steady speed each, of three speeds at least."""
    runs = [_Steady(parts) for parts in _by_run(stretches)]
    if len(runs) < const.LEAST_RUNS or not all(r.steady for r in runs):
        return False
    return len({round(np.log(abs(r.w)) / const.NEAR) for r in runs}) >= const.SEVERAL


def _by_run(stretches: Sequence[Stretch]) -> list[list[Stretch]]:
    return [[s for s in stretches if s.run == run] for run in sorted({s.run for s in stretches})]


class _Steady:
    """One log: its parts at its own speed ``w``, pairs of a stretch and the places of samples."""

    def __init__(self, parts: Sequence[Stretch]) -> None:
        sound = [(s, np.flatnonzero(s.ok)) for s in parts]
        total = sum(len(at) for _, at in sound)
        cells = [(s, at) for s, whole in sound
                 for at in np.array_split(whole, max(1, round(const.CELLS * len(whole) / total)))
                 if len(at) > 1]  # fmt: skip
        speeds = np.array([_speed(s, at) for s, at in cells])
        usual = float(np.median(speeds)) if len(speeds) else 0.0
        own = np.abs(speeds - usual) < const.PART * abs(usual)
        self.number = parts[0].run
        self.steady = (
            total >= 2 * const.CELLS and usual != 0 and float(np.mean(own)) > (1 - const.PART)
        )
        self.cells = [cell for cell, on in zip(cells, own, strict=True) if on]
        self.w = self._whole() if self.steady else 0.0

    def _whole(self) -> float:
        """Speed over all cells of a stretch at once: coarse counts tell little of a short one."""
        first = {id(s): s for s, _ in self.cells}
        each = [(s, np.concatenate([at for x, at in self.cells if x is s])) for s in first.values()]
        return float(
            np.average([_speed(s, at) for s, at in each], weights=[len(at) for _, at in each])
        )

    @property
    def turns(self) -> float:
        return abs(self.w) * sum(len(at) * s.dt for s, at in self.cells) / (2 * np.pi)

    def run(self, fine: int) -> Run:
        """With every cell as ``fine`` stretches, where there are samples for them."""
        rows, first = [], 0
        for s, at in self.cells:
            many = int(np.clip(len(at) // const.NODES, 1, fine))
            nodes = int(np.clip(len(at) // many, 1, const.NODES))
            ends = np.linspace(0, len(at), many * nodes + 1).astype(int)
            size = np.diff(ends)
            d, theta = (np.zeros(len(s.u)) if x is None else x for x in (s.d, s.theta))
            theta = theta + 0.5 * s.dt * self.w  # a held torque acts half a sample later
            means = (
                np.add.reduceat(np.column_stack([s.t, s.u, d, theta])[at], ends[:-1])
                / size[:, None]
            )
            part = first + np.repeat(np.arange(many), nodes)
            rows.append(np.column_stack([means, size, part]))
            first += many
        t, u, d, theta, size, part = np.vstack(rows).T
        dt = self.cells[0][0].dt
        return Run(self.number, self.w, dt, t, u, d, theta, size, part.astype(int))


def _speed(s: Stretch, at: np.ndarray) -> float:
    """Slope of theta at these samples, or the mean of w, rad/s."""
    if s.theta is None:
        assert s.w is not None
        return float(np.mean(s.w[at]))
    t = s.t[at] - np.mean(s.t[at])
    return float(t @ s.theta[at] / (t @ t))


class Nodes(Motion):
    """The nodes of all runs one after the other, (n,): a motion that nothing accelerates. ``row``
    is the stretch of each; a run lasts as long as a block, so that blocks are runs."""

    def __init__(self, runs: Sequence[Run], angle: bool) -> None:
        many = [len(r.t) for r in runs]
        n = sum(many)
        parts = np.array([r.part[-1] + 1 for r in runs])
        self.stamp, self.u, self.d, theta, self.size, part = (
            np.concatenate([getattr(r, k) for r in runs])
            for k in ("t", "u", "d", "theta", "size", "part")
        )
        self.runs, self.angle, self.count = (), angle, 0.0
        self.theta = self.path = theta if angle else np.zeros(n)
        self.w = self.fine_w = np.repeat([r.w for r in runs], many)
        self.run = np.repeat([r.number for r in runs], many)
        self.row = part + np.repeat(np.cumsum(parts) - parts, many)
        place = np.repeat(np.arange(len(runs)), many) + (part + 0.5) / np.repeat(parts, many)
        self.t = self.elapsed = const.BLOCK * place
        self.dt, self.duration = const.BLOCK / int(parts.max()), const.BLOCK * len(runs)
        self.acceleration, self.shake = np.zeros(n), np.zeros(n)
        self.hold = const.FREE_LATE + np.repeat([0.5 * r.dt for r in runs], many)
        self.fine_steps, self.ok = np.zeros(n - 1), np.ones(n, bool)
        self.pieces = tuple((at, self.dt) for at in in_turn(many))

    def held(self, u: np.ndarray) -> np.ndarray:
        return u

    def coarse(self, X: np.ndarray) -> np.ndarray:
        return X

    def slope(self, x: np.ndarray) -> np.ndarray:
        made = np.zeros(x.shape)
        for at, _ in self.pieces:
            if at.stop - at.start > 1:
                made[at] = np.gradient(x[at], self.stamp[at])
        return made

    def varied(self, stiffer: float) -> Motion:
        raise Refused("Means over stretches are not smoothed.")


class StretchMeans(Rows):
    """A row for each stretch: the mean over its nodes."""

    def __init__(self, motion: Nodes) -> None:
        n, m = len(motion), int(motion.row[-1]) + 1
        share = motion.size / np.bincount(motion.row, motion.size)[motion.row]
        self.K = self.narrow = csr_matrix((share, (motion.row, np.arange(n))), (m, n))
        self.at = np.searchsorted(motion.row, np.arange(m))
        self.h, self.step, self.reach, self.smear = 0.0, motion.dt, 0.0, np.full(n, 1e-12)
        self.t, self.w = motion.elapsed[self.at], np.abs(motion.w[self.at])
        self.a, self.shake = np.zeros(m), np.zeros(m)


class MapView(View):
    """A map as a regression sees it: in every run the bristle has its full length."""

    is_map = True
    motion: Nodes

    def __init__(self, motion: Nodes, model: Model) -> None:
        terms = declared_terms(model, Along.of(motion))
        super().__init__(motion, StretchMeans(motion), model, None, terms)
        self.sure, self.signals = False, frozenset({"w", "theta"} if motion.angle else {"w"})
        self.longest_fall = const.TAIL * motion.top
        effects = members("effect").items()
        self.never = frozenset(n for n, b in effects if not shown(b, motion.angle))
        self.held_out = [(int(run), -np.inf, np.inf) for run in _every_third(motion)]

    def _blocked(self) -> Blocks:
        many = int(self.apart[-1]) + 1
        return Blocks(self.apart + 0.5, many, many)

    @property
    def apart(self) -> np.ndarray:
        run = self.motion.run[self.rows.at]
        return np.searchsorted(np.unique(run), run)

    @cached_property
    def with_offset(self) -> np.ndarray:
        """None: an offset of each run would be any friction."""
        return np.zeros(0, int)

    @property
    def backward(self) -> bool:
        """Whether torque takes power at the mean of all speeds, beside what depends on theta."""
        m = self.motion
        X = np.column_stack([np.sign(m.w), m.w, np.ones(len(m)), np.sin(m.theta), np.cos(m.theta)])
        b = np.linalg.lstsq(self.K @ X, self.K @ (m.u - m.d), rcond=None)[0]
        return bool(b[0] * np.sum(np.abs(m.w)) + b[1] * np.sum(m.w**2) < 0)

    def by_run(self, x: np.ndarray) -> np.ndarray:
        """Means (runs,) of rows (m,)."""
        return np.bincount(self.apart, x) / np.bincount(self.apart)

    def _ways(self, x: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
        """Speeds, slow to fast, and values (runs,) in either direction."""
        w = self.by_run(self.motion.w[self.rows.at])
        ways = [np.flatnonzero(side * w > 0) for side in (1, -1)]
        order = [way[np.argsort(np.abs(w[way]))] for way in ways]
        return [(np.abs(w[at]), x[at]) for at in order]

    def follows_speed(self, r: np.ndarray) -> bool:
        """Residuals of neighbours in speed, or of one speed both ways, are alike, by ranks."""
        mean = self.by_run(r)
        z = norm.ppf(rankdata(mean) / (len(mean) + 1))
        (w, forth), (v, back) = self._ways(z / np.std(z))
        beside = np.concatenate([x[1:] * x[:-1] for x in (forth, back)])
        tests = [np.sum(beside) / np.sqrt(max(len(beside), 1))]
        if len(w) and len(v):
            across = forth * np.interp(w, v, back)
            tests.append(abs(np.sum(across)) / np.sqrt(len(across)))
        return bool(
            max(tests) > errors_of(const.ALPHA / 2) and np.std(mean) > const.FLOOR * self.size
        )

    def scatter(self, r: np.ndarray) -> float:
        """How far a run lies from the line through its neighbours in speed, or a stretch from its
        run (Gasser, Sroka and Jennen-Steinmetz, Biometrika 73(3), 1986)."""
        off, mean = [0.0], self.by_run(r)
        for x, y in self._ways(mean):
            if len(x) > 2:
                a = (x[2:] - x[1:-1]) / np.maximum(x[2:] - x[:-2], TINY)
                e = y[1:-1] - a * y[:-2] - (1 - a) * y[2:]
                off += (np.abs(e) / np.sqrt(1 + a**2 + (1 - a) ** 2)).tolist()
        own = np.median(np.abs(r - mean[self.apart]))
        return 1.4826 * float(np.hypot(np.median(off), own))

    def most(self, name: str) -> float:
        """A few speeds tell a plain law: what bends it otherwise is an effect."""
        return np.inf if name in PLAIN_LAW else 0.0

    def deflection(self, x0: float) -> tuple[np.ndarray, np.ndarray]:
        way = np.sign(self.motion.w)
        return way, way

    def follows(self, x0: float) -> np.ndarray:
        return np.ones(len(self.motion))

    def grids(self) -> tuple[np.ndarray, np.ndarray]:
        """One bristle; Stribeck speeds from the slowest run on."""
        slow, top = float(np.abs(self.motion.w).min()), self.motion.top
        return np.ones(1), np.geomspace(min(slow, 0.1 * top), const.TAIL * top, const.BINS)


@dataclass(frozen=True)
class Still:
    """What such runs tell of the inertia, as :class:`.windows.Width` says it: nothing."""

    sure = heavy = impossible = against = False


def map_of(stretches: Sequence[Stretch], model: Model) -> MapView:
    """The map of runs at steady speeds, with the declared effects that it shows."""
    steady = [_Steady(parts) for parts in _by_run(stretches)]
    angle = all(s.theta is not None for s in stretches)
    turns = float(np.median([r.turns for r in steady])) if angle else 0.0
    fine = int(np.clip(np.ceil(turns * const.PER_TURN / const.CELLS), 1, const.FINEST))
    effects = tuple(p for p in model.effects if shown(p.block, angle))
    motion = Nodes([r.run(fine) for r in steady], angle)
    return MapView(motion, replace(model, effects=effects))


def shown(block: Block, angle: bool) -> bool:
    """Whether an effect shows at steady speeds: by the speed, or by the angles where ``angle``."""
    acts = {"J", "+J", "input", "sensor"} & {*block.acts}
    moving = block.states or block.exact is not None or block.timed and not block.load
    place = any(p.passed for p in block.own.values())  # a few runs pass it, if any
    return not (acts or moving or place or needs_inertia(block)
                or "theta" in block.inputs and not angle)  # fmt: skip


def _every_third(motion: Nodes) -> list[int]:
    """One of three speeds in either direction, neither the slowest nor the fastest."""
    runs, first = np.unique(motion.run, return_index=True)
    w, made = motion.w[first], []
    for side in (-1, 1):
        way = np.flatnonzero(side * w > 0)
        made += runs[way[np.argsort(np.abs(w[way]))][1 : -1 : const.SEVERAL]].tolist()
    return made

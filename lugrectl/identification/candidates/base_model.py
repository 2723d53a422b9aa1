"""The declared model in the table: inertia, friction, lateness of u, what is in it already."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.sparse import csr_matrix, diags

from ...blocks.model import Part
from ...core.numeric import rms
from ..regression.numbers import APART, BLOCK, TIMING
from ..regression.robust_regression import Scale, Solution, solve
from ..regression.score import Blocks, left_out, seen
from ..regression.smooth_motion import Motion, shifted, spline
from ..regression.weak_form import Rows
from .declared_effects import TURNING, applied
from .friction_terms import FORCES, LAW, NAMES, VISCOUS, Law, Laws

WIDE = 30.0  # all torque times this: the prior of what a record does not say
LEVELS = slice(2, 2 + len(NAMES))  # columns of friction, after inertia and lateness
OFFSET = [LEVELS.stop]  # what every drive has of an offset, and of a wave a turn
TURN = [LEVELS.stop + 1, LEVELS.stop + 2]
SLIGHT = [*OFFSET, *TURN]
WEIGHT = LEVELS.stop + len(SLIGHT)  # the first column of gravity, if it has one
SCREENED = 4  # samples in the half-width of a window that a screening uses
LEAST_FRICTION = 0.05  # friction counts as this share of the torque at least


@dataclass(frozen=True, eq=False)
class Record:
    """What all rows of the table share: the motion, its windows and blocks, what is declared.

    ``has`` are the parameters of the declared friction law, with a value or not, ``lag``
    that of a speed with a sensor of its own behind dtheta/dt and its standard error, s. The torque
    of its motion is ``shift`` (s) later than recorded, ``logged`` (s) of it because it was written
    down after the motion that it causes. ``lighter``: the inertia, where it is certainly far below
    the declared one, whatever is missing.
    """

    motion: Motion
    rows: Rows
    laws: Laws
    blocks: Blocks
    declared: Mapping[str, float]
    J: tuple[float, float] | None
    sure: bool
    heavy: bool = False
    parts: Sequence[Part] = ()
    has: frozenset[str] = frozenset()
    lag: tuple[float, float] | None = None
    shift: float = 0.0
    logged: float = 0.0
    lighter: float | None = None
    _kept: dict[Hashable, tuple[object, Any]] = field(default_factory=dict, repr=False)

    def once(self, key: Hashable, of: object, make: Callable[[], Any]) -> Any:
        """What ``make`` returns, kept for later tables while ``of`` is the same object."""
        found = self._kept.get(key)
        if found is None or found[0] is not of:
            found = self._kept[key] = (of, make())
        return found[1]

    @property
    def lateness(self) -> float:
        """The torque may be late or early by this for nothing, s: half a hold, a current loop."""
        return 0.5 * self.motion.dt + TIMING

    def mean(self, x: np.ndarray) -> np.ndarray:
        """Samples (n,) or (n, k) in the windows."""
        return self.rows.K @ x

    @property
    def latest(self) -> float:
        """By how much the torque of its motion may be later still for nothing, s: it may as well be
        in time as it was logged, where a missing effect has looked like a lateness."""
        return self.lateness + max(self.logged, 0.0) - self.shift

    @property
    def earliest(self) -> float:
        """By how much it may be later at least, s."""
        return -self.lateness + min(self.logged, 0.0) - self.shift

    def later(self, shift: float) -> Record:
        """The same with the torque later by ``shift``, exactly: a derivative is too coarse.

        The motion, and so its friction laws, stay.
        """
        m = self.motion
        u = np.concatenate([shifted(spline(m.u[p]), shift / m.dt) for p in m.pieces])
        return replace(self, motion=replace(m, u=u), shift=self.shift + shift)

    def driving(self, u: np.ndarray) -> np.ndarray:
        """What drives the motion in the windows (m,), of the torque u (n,): u less the load."""
        return self.rows.K @ (u - self.motion.d)

    @cached_property
    def u(self) -> np.ndarray:
        """The torque behind the declared effects on the input, (n,)."""
        return applied(self.parts, self.motion)

    @property
    def independent(self) -> int:
        """How many of its blocks have motion in them and share little noise with the others."""
        return min(len(self.blocks.full), max(1, int(self.motion.t[-1] / _apart(self.rows))))

    @property
    def turning(self) -> bool:
        """Whether gravity is declared."""
        return any(p.block.name == TURNING for p in self.parts)

    @cached_property
    def fewer(self) -> int:
        """Every so many samples are enough to compute the mean of a term that is screened."""
        return max(1, int(self.rows.wide / SCREENED / self.motion.dt))

    @cached_property
    def few(self) -> tuple[csr_matrix, csr_matrix]:
        """The operators to the windows from these samples only."""
        made = []
        for k in (self.rows.K, self.rows.narrow):
            some = csr_matrix(k[:, :: self.fewer])
            made.append(diags(1.0 / np.asarray(some.sum(axis=1)).ravel()) @ some)
        return made[0], made[1]

    @cached_property
    def single(self) -> tuple[csr_matrix, csr_matrix]:
        """The same in single precision."""
        K, narrow = self.few
        return csr_matrix(K, dtype=np.float32), csr_matrix(narrow, dtype=np.float32)

    @classmethod
    def of(
        cls,
        motion: Motion,
        rows: Rows,
        declared: Mapping[str, float],
        J: tuple[float, float] | None,
        sure: bool,
        heavy: bool,
        parts: Sequence[Part],
        has: frozenset[str] = frozenset(),
        lag: tuple[float, float] | None = None,
    ) -> Record:
        laws = Laws(motion, declared, 3 * rows.rough + 1e-12)
        blocks = Blocks.of(rows.t, motion.t[-1], _apart(rows))
        return cls(motion, rows, laws, blocks, declared, J, sure, heavy, parts, has, lag)


def _apart(rows: Rows) -> float:
    """The length of a piece that shares little noise with its neighbours, s."""
    return max(BLOCK, APART * rows.h)


@dataclass(frozen=True, eq=False)
class Columns:
    """Terms in the windows, with the precision of their prior and their bounds."""

    X: np.ndarray
    prior: np.ndarray
    low: np.ndarray
    high: np.ndarray

    def __add__(self, other: Columns) -> Columns:
        joined = (
            np.concatenate([a, b], axis=-1) for a, b in zip(self._all, other._all, strict=True)
        )
        return Columns(*joined)

    @property
    def _all(self) -> tuple[np.ndarray, ...]:
        return self.X, self.prior, self.low, self.high

    @classmethod
    def free(cls, X: np.ndarray, low: float = -np.inf, high: float = np.inf) -> Columns:
        """Terms whose coefficients have bounds but no prior."""
        k = X.shape[1]
        return cls(X, np.zeros(k), np.full(k, low), np.full(k, high))


@dataclass(frozen=True)
class View:
    """How the rows of the table are looked at.

    ``scale`` of the residual, ``weights`` of the windows under the richest description and its
    inertia ``J``. ``quick``: densities of the fit to all, without leaving blocks out.
    """

    scale: Scale
    weights: np.ndarray | None = None
    J: float | None = None
    quick: bool = True


@dataclass(frozen=True, eq=False)
class Base:
    """A model against which contenders are judged.

    ``inside`` are the names of the effects in it, ``u`` the torque that reaches the drive,
    ``weight`` the torque of its gravity (n,), 0 without,
    ``levels`` those of friction, where they are not its own,
    ``known`` the frequency, damping and gap of loads that were searched before.
    """

    record: Record
    law: Law
    columns: Columns
    u: np.ndarray
    view: View
    inside: tuple[str, ...] = ()
    gravity: bool = False
    friction: float | None = None
    levels: np.ndarray | None = None
    known: Mapping[str, tuple[float, ...]] = field(default_factory=dict)

    @cached_property
    def y(self) -> np.ndarray:
        return self.record.driving(self.u)

    @cached_property
    def made(self) -> Solution:
        c = self.columns
        return solve(c.X, self.y, c.prior, c.low, c.high, self.view.scale)

    @cached_property
    def J(self) -> float:
        size = float(np.sqrt(np.mean(self.record.rows.a**2))) + 1e-300
        return max(float(self.made.b[0]), 1e-9 * self.view.scale.sigma / size)

    @cached_property
    def of_any_inertia(self) -> Base:
        """The same with an inertia that no other answer holds: a part of what that one counted may
        be a load's."""
        if self.record.J is None:
            return self
        low, high = self.columns.low.copy(), self.columns.high.copy()
        low[0], high[0] = 0.0, np.inf
        return replace(self, columns=replace(self.columns, low=low, high=high))

    @property
    def written_late(self) -> float:
        """By how much its torque was written down after the motion, s; 0 where it was in time."""
        record = self.record
        late = -record.shift - float(self.made.b[1]) > record.lateness
        return max(-record.logged, 0.0) if late else 0.0

    @property
    def richest(self) -> float:
        """Inertia of the richest description, which sets the scale of the motion's noise."""
        return self.J if self.view.quick or self.view.J is None else self.view.J

    @cached_property
    def score(self) -> np.ndarray:
        return self.judged(self.made, self.columns, self.J)

    def judged(self, made: Solution, c: Columns, J: float) -> np.ndarray:
        """The log density of each block, (blocks,)."""
        record, factor = self.record, 1.0
        if record.sure:
            factor = max(1.0, self.richest / max(J, 1e-3 * self.richest))
        if self.view.quick:
            free = c.prior[made.free]
            moment = np.sum(c.X[:, made.free] ** 2, axis=0) / self.view.scale.sigma**2
            cost = np.sum(free < 1e-3 * moment) / len(record.blocks)
            return seen(made, record.blocks, factor) - cost
        return left_out(made, c.X, c.prior, self.view.scale, record.blocks, factor)

    # ------------------------------------------------------------------ its friction
    def _of(self, names: tuple[str, ...]) -> np.ndarray:
        own = self.made.b[LEVELS] if self.levels is None else self.levels
        return self.law.part(own, names)

    @cached_property
    def coulomb(self) -> np.ndarray:
        """Torque that scales with the level of friction, (n,)."""
        return self._of(FORCES)

    @cached_property
    def viscous(self) -> np.ndarray:
        return self._of(VISCOUS)

    @cached_property
    def friction_rms(self) -> float:
        """RMS friction torque in the windows, of all shapes: large ones may cancel near rest.

        No more than what the drive has to overcome beside its inertia: in one direction friction
        and a load may cancel.
        """
        if self.friction is not None:
            return self.friction
        mean = self.record.mean(self._of(NAMES))
        beside = self.y - self.columns.X[:, 0] * self.made.b[0]
        return max(min(rms(mean), rms(beside)), LEAST_FRICTION * rms(self.y))

    @cached_property
    def level(self) -> np.ndarray:
        """Level of Coulomb friction over the speed, (n,)."""
        b = self.made.b[LEVELS] if self.levels is None else self.levels
        w = np.abs(self.record.motion.w)
        curves = self.record.laws.curves(w, self.law.vs)
        return b[0] + sum(c * curve for c, curve in zip(b[1:], curves, strict=False))

    @cached_property
    def weight(self) -> np.ndarray:
        """Torque of its gravity (n,); 0 without."""
        m = self.record.motion
        if not self.gravity:
            return np.zeros(len(m))
        b = self.made.b[WEIGHT : WEIGHT + 2]
        return b[0] * np.sin(m.theta) + b[1] * np.cos(m.theta)

    @cached_property
    def left(self) -> float:
        """What it leaves, as a share of friction; outliers count little."""
        r = np.abs(self.made.r * self.view.scale.sigma)
        return rms(np.minimum(r, 5 * np.median(r))) / self.friction_rms

    @cached_property
    def noise(self) -> float:
        """What the noise of the sensors makes of J a in the windows, as a share of friction."""
        return self.J * rms(self.record.rows.shake) / self.friction_rms

    # ------------------------------------------------------------------ screening
    @cached_property
    def roots(self) -> np.ndarray:
        """Square roots of the weights of the windows."""
        own = self.view.weights
        return np.sqrt(self.made.weight if own is None else own)

    @cached_property
    def basis(self) -> np.ndarray:
        """Orthonormal columns that span its free terms, weighted."""
        X = self.columns.X
        free = self.made.free & np.any(X != 0, axis=0)
        return np.linalg.qr(X[:, free] * self.roots[:, None])[0]

    @cached_property
    def residual(self) -> np.ndarray:
        """What its free terms leave, weighted; those at a bound stay there."""
        held = np.where(self.made.free, 0.0, self.made.b)
        y = (self.y - self.columns.X @ held) * self.roots
        return y - self.basis @ (self.basis.T @ y)

    @cached_property
    def open(self) -> np.ndarray:
        """Orthonormal columns that span its free terms but the lateness of u."""
        return self._span([0, *range(2, self.columns.X.shape[1])])

    @cached_property
    def law_alone(self) -> np.ndarray:
        """The same of the declared law, without what else is open of friction."""
        law = [LEVELS.start + NAMES.index(name) for name in LAW]
        return self._span([0, *law, *range(WEIGHT, self.columns.X.shape[1])])

    def _span(self, kept: list[int]) -> np.ndarray:
        B = self.columns.X[:, [i for i in kept if self.made.free[i]]]
        U, s, _ = np.linalg.svd(B, full_matrices=False)
        return U[:, s > np.finfo(float).eps * max(B.shape) * s.max(initial=0.0)]

    def acceleration_beside(self, free: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The acceleration without its part in the other terms that are ``free``, weighted (m,),
        and an orthonormal basis of these terms."""
        X, others = self.columns.X, free.copy()
        others[0] = False
        Q = np.linalg.qr(X[:, others] * self.roots[:, None])[0]
        a = X[:, 0] * self.roots
        return a - Q @ (Q.T @ a), Q

    def as_inertia(self, C: np.ndarray) -> np.ndarray:
        """The inertia that a fit without these torques (m, k) makes of each of them, kg m2."""
        a = self.acceleration_beside(self.made.free)[0]
        return (a @ (C * self.roots[:, None])) / (a @ a + 1e-300)

    def gains(self, C: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """What each column would take off half the sum of squares, and its coefficient."""
        W, P = self._weighted(C)
        c, n = W.T @ self.residual.astype(W.dtype), _left(W, P)
        return c**2 / n / self.view.scale.sigma**2, c / n

    def gains_of_pairs(self, C: np.ndarray) -> np.ndarray:
        """The same for neighbouring columns together, (k/2,)."""
        W, P = self._weighted(C)
        c, n = W.T @ self.residual.astype(W.dtype), _left(W, P)
        a, b, na, nb = c[::2], c[1::2], n[::2], n[1::2]
        x = np.einsum("ij,ij->j", W[:, ::2], W[:, 1::2])
        x -= np.einsum("ij,ij->j", P[:, ::2], P[:, 1::2])
        det = np.maximum(na * nb - x * x, 1e-9 * na * nb)
        return (a * a * nb - 2 * a * b * x + b * b * na) / det / self.view.scale.sigma**2

    def _weighted(self, C: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The columns, weighted, and their parts along the basis; in the precision of C."""
        W = C * self.roots.astype(C.dtype)[:, None]
        return W, self.basis.astype(C.dtype).T @ W

    # ------------------------------------------------------------------ other views of it
    def seen_as(self, view: View) -> Base:
        return replace(self, view=view)

    def beside(self, more: Sequence[Columns]) -> Base:
        """The same with more terms in it."""
        c = self.columns
        for part in more:
            c = c + part
        return replace(self, columns=c, friction=self.friction_rms)


def _left(W: np.ndarray, P: np.ndarray) -> np.ndarray:
    """The squares of columns without their parts along a basis; never less than rounding makes."""
    whole = np.einsum("ij,ij->j", W, W)
    least = 10 * np.finfo(W.dtype).eps * whole
    return np.maximum(whole - np.einsum("ij,ij->j", P, P), least + 1e-300)

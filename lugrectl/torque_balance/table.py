"""The table: one base row and one row for each contender, every row a regression of its own.

A row counts by the density of the motion given the torque, block by block under fits that have not
seen the block: the residual over the inertia, so that what imitates u gains nothing. Unknown
torques are smooth functions of each set of signals.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field
from functools import partial
from statistics import NormalDist
from typing import Any

import numpy as np
from scipy.interpolate import BSpline

from ..blocks.block import Block
from ..core.numeric import rms
from ..core.regression import TINY, Fit, Prior, normal_equations, robust, spread, weight
from . import constants as const
from .columns import linear
from .friction import IMITATES, Term, View


def is_lateness(block: Block | None) -> bool:
    """Whether an effect is itself a delay of the torque: beside it none is left for nothing."""
    return block is not None and "input" in block.acts and block.own[block.gain].unit == "s"


def errors_of(alpha: float) -> float:
    """How many standard errors are exceeded by chance so often, on one side."""
    return NormalDist().inv_cdf(1.0 - alpha)


def proven(gain: float, error: float, alpha: float = const.ALPHA) -> bool:
    """Whether a gain in nats, with its standard error, is more than chance."""
    return gain > -np.log(alpha) and gain > errors_of(alpha) * error


@dataclass(eq=False)
class Contender:
    """One row of the table: an effect with its nonlinear values, or an unknown torque, by its
    columns ``C`` or by what it makes of the torque."""

    name: str
    q: Mapping[str, float]
    block: Block | None = None
    C: np.ndarray | None = None  # (m, k)
    u: np.ndarray | None = None  # (n,)
    prior: Prior = field(default_factory=partial(Prior.free, 0))
    cost: float = 0.0  # nats for values that were searched
    depends_on: Collection[str] = ()  # the signals of an unknown torque
    more: Collection[Mapping[str, float]] = ()  # values of other effects of this name at once

    # once entered
    X: np.ndarray = field(init=False)
    y: np.ndarray = field(init=False)
    full: Prior = field(init=False)
    e: np.ndarray = field(init=False)
    J: float = field(init=False)
    gain: float = field(init=False, default=0.0)  # nats
    share: float = field(init=False, default=0.0)  # of friction, beside the declared law

    def __post_init__(self) -> None:
        block, self.q, self.depends_on = self.block, dict(self.q), frozenset(self.depends_on)
        self.each = (self.q, *map(dict, self.more))
        self.k = 0 if self.C is None else self.C.shape[1]
        self.b = np.zeros(self.k)
        self.lateness = is_lateness(block)
        # it has an inertia of its own, so that J is not held
        of_mass = block is not None and block.own[block.gain].unit == "kg m2"
        self.inertial = of_mass or block is not None and "J" in block.acts

    @property
    def order(self) -> tuple[float, ...]:
        """The whole numbers among its values: orders of the angle."""
        own = {} if self.block is None else self.block.own
        return tuple(x for k, x in self.q.items() if own[k].whole)

    def terms(self, used: Collection[str] = ()) -> list[Term]:
        """Its effects, with names of their own beside those that are used."""
        if self.block is None:
            return []
        many = len(linear(self.block)) if self.C is not None else 0
        count, made = list(used).count(self.name), []
        for i, q in enumerate(self.each):
            n = count + i + 1
            key = self.name if n == 1 else f"{self.name}_{n}"
            b = np.array(self.b[i * many : (i + 1) * many])
            made.append(Term(self.block, key, dict(q), b))
        return made

    def added(
        self, view: View, X: np.ndarray, y: np.ndarray, prior: Prior
    ) -> tuple[np.ndarray, np.ndarray, Prior]:
        """Rows, torque and prior of a base with this contender."""
        if self.u is not None:
            X, y = X.copy(), view.torque(self.u) - view.K @ view.motion.d
            X[:, 1] = view.lateness(self.u) * (1e-9 if self.lateness else 1.0)
        if self.C is not None:
            X, prior = np.column_stack([X, self.C]), Prior.joined(prior, self.prior)
        return X, y, prior


class Table:
    """The base as it stands (the declared model and what was chosen) and scores beside it: ``e``
    (blocks,) is its score, on rows that fits have seen in the ``quick`` first pass, ``left`` what
    it does not explain. A given ``scale`` says that friction's shape is settled already."""

    def __init__(self, view: View, scale: float | None = None) -> None:
        self.view = view
        self.scale: Any = scale
        self.weights: Any = None
        self.scale_J: Any = None
        self.quick, self.chosen = True, []
        self.restart(settled=scale is not None)

    def restart(self, beside: Contender | None = None, settled: bool = False) -> None:
        """The base without any chosen effect, friction's shape settled (beside the likeliest)."""
        v = self.view
        v.start()
        self.likeliest = beside
        if settled:
            v.set_law(v.x0, v.vs)
        else:
            found = v.choose(self.scale, beside)
            self.scale = found if self.scale is None else self.scale
        self.X, self.y, self.prior = v.B, v.y, v.prior
        joined = {t.key for t in v.terms}
        self.imitates = np.array(
            [n in IMITATES or isinstance(n, tuple) and n[0] in joined for n in v.names]
        )
        self.own = np.array([n != "late" for n in v.names])
        self.settle()

    def settle(self) -> None:
        v = self.view
        fit = self.fit = robust(self.X, self.y, self.prior, self.scale, v.noise)
        self.J = max(float(fit.b[0]), 1e-9 * self.scale / (rms(v.rows.a) or 1.0))
        if not self.chosen:  # what effects scale is the friction and inertia of the declared model
            b = fit.b
            if self.likeliest is not None:
                X, y, prior = self.likeliest.added(v, self.X, self.y, self.prior)
                b = robust(X, y, prior, self.scale, v.noise, fit.w, 3).b
            v.torques(b)
            v.J = self.J
        v.set_load([*v.terms, *(t for c in self.chosen for t in c.terms())])
        if self.quick or self.scale_J is None:
            self.scale_J = self.J
        r = np.abs(self.y - self.X @ fit.b)
        self.left = rms(np.minimum(r, 5 * np.median(r))) / v.size
        self.stays = rms(r) / v.size
        self.e = self._score(fit, self.X, self.prior, 0.0, self.J)
        self.e_seen = v.blocks.seen(fit.r, self.stretch(self.J))
        # weights of the richest description: only true outliers lose weight
        self.root = np.sqrt(fit.w if self.weights is None else self.weights)
        # a bound of J is none for what changes J
        open_ = fit.free | (np.arange(len(fit.b)) == 0)
        self.Q, _ = np.linalg.qr(self.X[:, open_] * self.root[:, None])
        rooted = self.y * self.root
        self.rest_of_y = rooted - self.Q @ (self.Q.T @ rooted)

    def stretch(self, J: float) -> float:
        """The residual is one of the motion, over J; where J is not determined, of the torque."""
        if not (self.scale_J and self.view.sure):
            return 1.0
        return max(1.0, self.scale_J / max(J, 1e-3 * self.scale_J))

    def _score(self, fit: Fit, X: np.ndarray, prior: Prior, cost: float, J: float) -> np.ndarray:
        """Log density of the motion given the torque, block by block."""
        blocks, stretch = self.view.blocks, self.stretch(J)
        if self.quick:
            told = np.sum(X[:, fit.free] ** 2, axis=0) / self.scale**2
            cost = cost + float(np.sum(prior.precision[fit.free] < 1e-3 * told))
            return blocks.seen(fit.r, stretch) - cost / blocks.number
        left_out = blocks.left_out(fit, X, prior, self.scale, stretch)
        return left_out - cost / blocks.number

    # ---- screening on what the base leaves
    def beside(self, C: np.ndarray) -> np.ndarray:
        """Weighted columns without what the base explains of them."""
        W = C * self.root[:, None]
        before = (W * W).sum(axis=0)
        W = W - self.Q @ (self.Q.T @ W)
        new = (W * W).sum(axis=0) > const.SLIGHT**2 * before  # else the base has it already
        return W * new

    def gains(self, C: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """What each column takes off the weighted sum of squares (nats, doubled); coefficients."""
        W = self.beside(C)
        c, n = W.T @ self.rest_of_y, (W * W).sum(axis=0) + TINY
        return c**2 / n / self.scale**2, c / n

    def gains_of_pairs(self, C: np.ndarray) -> np.ndarray:
        """The same for columns two by two."""
        W = self.beside(C)
        c, n, x = W.T @ self.rest_of_y, (W * W).sum(axis=0), (W[:, ::2] * W[:, 1::2]).sum(axis=0)
        det = np.maximum(n[::2] * n[1::2] - x * x, 1e-9 * n[::2] * n[1::2])
        both = c[::2] ** 2 * n[1::2] - 2 * c[::2] * c[1::2] * x + c[1::2] ** 2 * n[::2]
        return both / (det + TINY) / self.scale**2

    def promise(self, c: Contender) -> float:
        """Screened gain in nats: all of its columns at once, at the weights of the base."""
        if c.C is None:
            return np.inf
        W = self.beside(c.C)
        G, g = W.T @ W, W.T @ self.rest_of_y
        own = c.prior.precision * self.scale**2
        G[np.diag_indices(c.k)] += own + 1e-9 * np.diag(G) + TINY
        return float(g @ np.linalg.solve(G, g)) / self.scale**2 / 2

    # ---- one row
    def entered(self, promised: Collection[tuple[float, Contender]]) -> list[Contender]:
        """The contenders that come near the best one, by what the screening promises of each."""
        made: list[Contender] = []
        for promise, c in sorted(promised, key=lambda pair: -pair[0]):
            if promise < const.FAINT * max((one.gain for one in made), default=0.0):
                break
            made.append(self.enter(c))
        return made

    def enter(self, c: Contender) -> Contender:
        """The whole model settled again with this contender: score, gain, torque."""
        v = self.view
        X, y, prior = c.added(v, self.X, self.y, self.prior)
        if c.inertial or c.u is not None:  # another torque has another inertia
            prior = prior.but(0, low=0.0, high=np.inf)
        fit = robust(X, y, prior, self.scale, v.noise, self.root**2, turns=4)
        c.X, c.y, c.full = X, y, prior
        at, a = len(self.prior), v.rows.a
        c.b, c.J = fit.b[at:], float(fit.b[0])
        if c.inertial:  # the part of the inertia that it has taken
            c.J += float(c.b[0] * (X[:, at] @ a) / (a @ a))
        seen = v.blocks.seen(fit.r, self.stretch(c.J))
        hopeless = not self.quick and float(np.sum(seen - self.e_seen)) < const.SCREEN
        none = self.e - 1.0 / len(self.e)
        c.e = none if hopeless else self._score(fit, X, prior, c.cost, c.J)
        self._measure(c)
        c.gain = float(np.sum(c.e - self.e))
        return c

    def _measure(self, c: Contender) -> None:
        """Its torque beside what the declared law, of an unknown one all of it, can imitate."""
        v, own = self.view, len(self.own)
        tau = c.X[:, len(self.prior) :] @ c.b if c.k else np.zeros(len(self.y))
        if c.u is not None:
            tau = tau + self.y - c.y - c.lateness * self.X[:, 1] * self.fit.b[1]
        law = (self.own if c.depends_on else self.imitates) & self.fit.free[:own]
        at = np.flatnonzero(np.r_[law, self.fit.free[own:]])
        X = self.X[:, at]
        c.share = rms(tau - X @ np.linalg.lstsq(X, tau, rcond=None)[0]) / v.size
        if c.depends_on:  # beside what a bound of the base holds it may be large: it is not
            c.share = min(c.share, self.stays)

    def extend(self, c: Contender) -> None:
        """The chosen contender becomes part of the base."""
        self.X, self.y, self.prior = c.X, c.y, c.full
        if c.u is not None:
            self.view.u = c.u
            if c.lateness:
                self.prior = self.prior.but(1, low=-1e-12, high=1e-12)
        self.chosen.append(c)
        self.settle()

    def back(self, mark: tuple[Any, ...]) -> None:
        """The base as it was before anything was chosen."""
        if self.chosen:
            self.X, self.y, self.prior, self.view.u = mark
            self.chosen = []
            self.settle()

    def richest(self, named: Collection[Contender], unknown: Collection[Contender]) -> None:
        """Scale and weights from everything at once; the inertia stays that of the base."""
        v = self.view
        columns, priors = [self.X], [self.prior]
        for c in named:
            if c.gain > 2 and c.share > 0.002:
                C = (self.y - c.y)[:, None] if c.C is None else c.C
                columns.append(C)
                precision = np.mean(C**2, axis=0) / (0.3 * v.size) ** 2
                priors.append(Prior.free(C.shape[1], precision=precision))
        for c in unknown:
            if c.gain > 2:
                columns.append(c.C)
                priors.append(Prior.free(c.k, precision=c.prior.precision))
        X = np.column_stack(columns)
        own = Prior.joined(*priors)
        prior = own.but(0, precision=1 / (0.03 * self.J) ** 2, low=-np.inf, high=np.inf)
        fit = robust(X, self.y - self.J * X[:, 0], prior, self.scale, v.noise, turns=4)
        r = self.y - self.J * X[:, 0] - X @ fit.b
        self.scale_J = max(float(fit.b[0]) + self.J, 0.5 * self.J)
        self.quick = False
        self._weigh(X, r, prior)
        self.settle()

    def _weigh(self, X: np.ndarray, r: np.ndarray, prior: Prior) -> None:
        """Scale of the residual, and weights, as a fit without the row would leave it."""
        most = const.CLIP * spread(r)
        r = np.clip(r, -most, most)
        wider = np.sqrt(1 + min(0.5, X.shape[1] / len(r)))
        scale = 1.38 * float(np.median(np.abs(r))) * wider + TINY
        w = weight(r / scale)
        G, _ = normal_equations(X, r, w, prior, scale, 0.0)
        lever = np.einsum("ij,ij->i", X, np.linalg.solve(G, X.T).T) * w
        alone = np.abs(r) / np.maximum(1 - lever, 0.05)
        alike = self.view.scatter(self.y - self.X @ self.fit.b)
        self.scale = max(scale, 1.38 * float(np.median(alone)), alike)
        self.rest = rms(r) / self.view.size
        self.weights = weight(r / self.scale)


Signals = tuple[str, ...]


class Unknown:
    """Unknown torques beside one base: penalised columns over sets of signals."""

    def __init__(self, table: Table, linear: bool, sure: bool) -> None:
        self.table, self.view, self.sure = table, table.view, sure
        m = self.view.motion
        turns = float(np.ptp(m.theta)) > 6.5 and not linear
        x = (m.theta - m.theta.min()) / (float(np.ptp(m.theta)) + 1e-12)
        w = 0.5 + 0.5 * np.clip(m.w / m.top, -1, 1)
        time = m.elapsed / m.duration
        K = self.view.K
        self.place = waves(m.theta, 12) if turns else spline(x, 16)
        self.coarse = waves(m.theta, 6) if turns else spline(x, 8)
        self.places = [self.place, *([spline(x, 16)] if turns else [])]
        self.times = spline(time, 10)
        sided = spline(np.abs(m.w) / m.top, 16) * np.sign(m.w)[:, None]
        if self.view.is_map:  # a few speeds of several decades, both directions or one
            pace = np.unique(np.abs(m.w), return_inverse=True)[1]
            by_speed = spline(pace / pace.max(), 12)
            sided = by_speed * np.sign(m.w)[:, None]
            ways = [K @ (by_speed * on[:, None]) for on in (m.w > 0, m.w < 0) if on.any()]
        self.still: dict[Signals, list[np.ndarray]] = {
            ("theta",): [K @ place for place in self.places],
            ("w",): [K @ sided, *ways] if self.view.is_map else [K @ sided],
            ("t",): [K @ spline(time, 24)],
        }
        self.mixed = K @ product(spline(w, 6), self.coarse)

    def _bases(self) -> Iterator[tuple[Signals, list[np.ndarray]]]:
        """Columns (m, k) over each set of signals; what depends on u or the law is made anew."""
        v, m, K = self.view, self.view.motion, self.view.K
        u = m.held(v.u)
        yield from self.still.items()
        size = max(np.quantile(np.abs(u), 0.995), 0.1 * np.abs(u).max(), TINY)
        of_u = spline(0.5 + 0.5 * np.clip(u / size, -1, 1), 12)
        friction = np.column_stack([v.z, m.w / m.top])
        of_u = of_u[:, np.mean(of_u > 0.05, axis=0) > 0.02]  # one that is rare is u elsewhere
        if self.sure:  # without J any function of u is u
            yield ("u",), [K @ without_line(of_u, u)]
        here = [K @ (v.z[:, None] * place) for place in self.places]
        yield ("theta", "w"), [*here, self.mixed]
        yield ("t", "w"), [K @ product(self.times, friction)]
        if self.sure:
            yield ("t", "u"), [K @ without_line(u[:, None] * self.times, u)]
            yield ("theta", "u"), [K @ without_line(u[:, None] * self.coarse, u)]

    def rows(self) -> list[Contender]:
        """The contenders, the likeliest first; in the first pass by their promise alone."""
        made, quick = [], self.table.quick
        for depends_on, bases in self._bases():
            for C in bases if self.view.signals >= set(depends_on) else ():
                for size in (const.MUCH,) if quick else const.UNKNOWN_SIZES:
                    c = self._contender(depends_on, C, size, len(bases))
                    c.gain = self.table.promise(c) - c.cost
                    made.append(c)
        if not quick:
            made = self.table.entered([(c.gain, c) for c in made if c.gain > 2 * const.SCREEN])
        return likeliest(made)

    def _contender(self, depends_on: Signals, C: np.ndarray, size: float, many: int) -> Contender:
        large = np.sqrt(np.mean(C**2, axis=0))
        sigma = size * self.view.size / np.maximum(large, 1e-3 * rms(large) + TINY)
        prior = Prior.free(C.shape[1], precision=1 / sigma**2)
        name = f"g({','.join(depends_on)})"
        cost = float(np.log(3 * many))
        return Contender(name, {}, C=C, prior=prior, cost=cost, depends_on=depends_on)


def likeliest(contenders: list[Contender]) -> list[Contender]:
    """The best of each name, the likeliest first."""
    best: dict[str, Contender] = {}
    for c in contenders:
        if c.name not in best or c.gain > best[c.name].gain:
            best[c.name] = c
    return sorted(best.values(), key=lambda c: -c.gain)


def waves(theta: np.ndarray, n: int) -> np.ndarray:
    """The first n harmonics of an angle, (m, 2 n)."""
    turns = theta[:, None] * np.arange(1, n + 1)
    return np.stack([np.sin(turns), np.cos(turns)], axis=2).reshape(len(theta), -1)


def spline(x: np.ndarray, n: int) -> np.ndarray:
    """n cubic B-splines over [0, 1] at x."""
    knots = np.r_[[0.0] * 3, np.linspace(0, 1, n - 2), [1.0] * 3]
    return BSpline.design_matrix(np.clip(x, 0, 1 - 1e-12), knots, 3).toarray()


def product(A: np.ndarray, B: np.ndarray) -> np.ndarray:
    """Every column of A times every column of B."""
    return (A[:, :, None] * B[:, None, :]).reshape(len(A), -1)


def without_line(X: np.ndarray, u: np.ndarray) -> np.ndarray:
    """X without what 1 and u explain of it."""
    A = np.column_stack([np.ones(len(u)), u])
    return X - A @ np.linalg.lstsq(A, X, rcond=None)[0]

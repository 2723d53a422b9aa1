"""A row of the table: the base with one more explanation, all of it settled again."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ..regression.numbers import ALONE, NEIGHBOURS
from ..regression.robust_regression import Solution, solve
from ..regression.score import losses, paired
from .base_model import Base, Columns, Record, rms
from .friction_shape import along, relaid

OTHER_J = (0.5, 2.0)  # inertia beside an effect as large as all friction, over that without it
ROUNDS = 3  # of a fit that begins with the weights of the base
IMITATES = 0.6  # of the inertia: an unknown torque of u that changes it by more stands for it


@dataclass(frozen=True, eq=False)
class Contender:
    """A base with an effect, or an unknown torque of the signals ``depends_on``.

    ``entry`` is what it was made from, ``own`` the number of its columns, the last ones.
    ``blocks`` are the scores of the blocks, ``torque`` (m,) what the base cannot imitate of it,
    ``share`` its RMS over that of friction, ``whole`` that of all of its torque.
    """

    entry: Entry
    base: Base
    columns: Columns
    made: Solution
    own: int
    blocks: np.ndarray
    torque: np.ndarray
    whole: float
    J: float

    @property
    def name(self) -> str:
        return self.entry.name

    @property
    def values(self) -> Mapping[str, float]:
        """Those of the effect's parameters that were searched."""
        return self.entry.values

    @property
    def u(self) -> np.ndarray | None:
        """The torque that reaches the drive, where it changes that."""
        return self.entry.u

    @property
    def depends_on(self) -> frozenset[str]:
        """The signals of an unknown torque; empty for an effect."""
        return self.entry.depends_on

    @property
    def coefficients(self) -> np.ndarray:
        """Those of its own columns."""
        return self.made.b[len(self.made.b) - self.own :]

    @property
    def its(self) -> Columns:
        """Its own columns."""
        c, k = self.columns, len(self.made.b) - self.own
        return Columns(c.X[:, k:], c.prior[k:], c.low[k:], c.high[k:])

    @cached_property
    def share(self) -> float:
        return rms(self.torque) / self.base.friction_rms

    @property
    def size(self) -> float:
        """RMS of all of its torque over that of friction; of what the base cannot imitate, where
        that is next to nothing of it."""
        return self.whole if self.share > ALONE * self.whole else self.share

    @cached_property
    def gain(self) -> float:
        """Nats by which it predicts the blocks better than the base."""
        return float(np.sum(self.blocks - self.base.score))

    @cached_property
    def freedom(self) -> float:
        """Its effective parameters: those that the rows determine, not the prior."""
        c, sigma = self.columns, self.base.view.scale.sigma
        Z = c.X * (np.sqrt(self.made.weight) / sigma)[:, None]
        H = Z.T @ Z + np.diag(c.prior)
        return float(np.trace(np.linalg.lstsq(H, Z.T @ Z, rcond=None)[0][-self.own :, -self.own :]))

    def above(self, other: Contender | Base) -> tuple[float, float]:
        """By how much it is better, and the standard error of that.

        A function of anything follows one incident from block to block: neighbours count together.
        """
        many = NEIGHBOURS if self.depends_on else 1
        if isinstance(other, Contender):
            return paired(self.blocks, other.blocks, many)
        gain, se = paired(self.blocks, other.score, many)
        return gain, max(se, losses(self.blocks - other.score))

    def joined(self) -> Base:
        """The base with this explanation in it."""
        base = self.entry.seen_from(self.base)
        return replace(
            base,
            columns=self.columns,
            u=base.u if self.u is None else self.u,
            friction=base.friction_rms,
            inside=(*base.inside, self.name),
        )


@dataclass(frozen=True)
class Entry:
    """What a contender is made from.

    ``columns`` are its own; ``u`` its torque; ``cost`` the logarithm of the number of places that
    were searched. ``timed``: it is a time, so that the base's lateness of u is not free beside it.
    ``instead``: columns of the base that it replaces. ``inertial``: it changes the inertia by the
    last coefficient and is not held to the plain answer's. ``moved``: the record
    along another motion, in which the whole base is seen. ``law``: the presliding distance and the
    Stribeck speed that are the likeliest beside it. ``by_run``: it has a phase of its own in each
    run, as many columns for one after the other.
    """

    name: str
    values: Mapping[str, float]
    columns: Columns | None = None
    u: np.ndarray | None = None
    cost: float = 0.0
    timed: bool = False
    instead: Sequence[int] = ()
    inertial: bool = False
    depends_on: frozenset[str] = frozenset()
    moved: Record | None = None
    law: tuple[float, float] | None = None
    by_run: bool = False

    def seen_from(self, base: Base) -> Base:
        """The base in its motion and its law."""
        base = base if self.moved is None else along(base, self.moved)
        return base if self.law is None else relaid(base, self.law)


def enter(base: Base, entry: Entry) -> Contender:
    """The row of the table for an entry."""
    record, columns = base.record, _beside(entry.seen_from(base), entry)
    own = 0 if entry.columns is None else entry.columns.X.shape[1]
    made = _fitted(base, entry, columns)
    balanced = np.isfinite(columns.high[0])  # J is held to the plain answer's, not a declared one
    if made.state[0] and balanced and not entry.depends_on and not entry.inertial:
        columns = _with_its_inertia(base, entry, columns, own)
        made = _fitted(base, entry, columns)
    J = float(made.b[0])
    if entry.inertial:  # the whole inertia counts
        a = record.rows.a
        J += float(made.b[-1] * (columns.X[:, -1] @ a) / (a @ a))
    blocks = base.judged(made, columns, J) - entry.cost / len(record.blocks)
    whole, torque = _torque(base, entry, columns, made, own)
    found = Contender(
        entry=entry,
        base=base,
        columns=columns,
        made=made,
        own=own,
        blocks=blocks,
        torque=torque,
        whole=rms(whole) / base.friction_rms,
        J=J,
    )
    return replace(found, blocks=base.score - 1e-9) if _unidentified(found) else found


def _fitted(base: Base, entry: Entry, columns: Columns) -> Solution:
    y = base.y if entry.u is None else base.record.driving(entry.u)
    c, scale = columns, base.view.scale
    near = base.made.state
    return solve(c.X, y, c.prior, c.low, c.high, scale, base.roots**2, rounds=ROUNDS, near=near)


def _with_its_inertia(base: Base, entry: Entry, columns: Columns, own: int) -> Columns:
    """The columns with the bounds of J where they are for a drive that has the effect.

    The plain answer, which does not know the effect, counts as inertia what it is like J a.
    """
    k = columns.X.shape[1] - own
    X, low, high = columns.X, columns.low.copy(), columns.high.copy()
    if own:
        as_inertia, turned = base.as_inertia(X[:, k:]), X.copy()
        turned[:, k:] -= X[:, :1] * as_inertia
        made = _fitted(base, entry, replace(columns, X=turned))
        counted = float(as_inertia @ made.b[k:])
    else:
        u = base.u if entry.u is None else entry.u
        counted = float(base.as_inertia(base.record.mean(base.u - u)[:, None])[0])
    low[0], high[0] = max(low[0] - counted, 0.0), max(high[0] - counted, 0.0)
    return replace(columns, low=low, high=high)


def _beside(base: Base, entry: Entry) -> Columns:
    c = (base.of_any_inertia if entry.inertial else base).columns
    X = c.X
    if entry.u is not None or len(entry.instead):
        X = X.copy()
    if entry.u is not None:
        m = base.record.motion
        X[:, 1] = base.record.mean(m.slope(entry.u)) * (1e-9 if entry.timed else 1.0)
    X[:, list(entry.instead)] = 0.0
    made = Columns(X, c.prior, c.low, c.high)
    return made if entry.columns is None else made + entry.columns


def _torque(
    base: Base, entry: Entry, columns: Columns, made: Solution, own: int
) -> tuple[np.ndarray, np.ndarray]:
    """Its torque in the windows, and this without what the declared model can imitate of it.

    A named effect is compared with the declared law. An unknown torque is what the fit with it
    predicts beyond the fit of the base: what is open of the law, and held at its bounds, can turn
    against it otherwise.
    """
    if entry.depends_on or entry.moved is not None:
        added = columns.X @ made.b - base.columns.X @ base.made.b
        return added, added
    k = columns.X.shape[1] - own
    torque = columns.X[:, k:] @ made.b[k:]
    if entry.u is not None:
        torque = torque + base.record.mean(base.u - entry.u)
        if entry.timed:
            torque = torque - base.columns.X[:, 1] * base.made.b[1]
    Q = base.law_alone
    return torque, torque - Q @ (Q.T @ torque)


def _unidentified(c: Contender) -> bool:
    """What such a term does is not known.

    The law imitates nearly all of it; or it has more torque than all friction and another inertia.
    """
    ratio = c.J / c.base.J
    if not c.depends_on and not c.entry.inertial and c.share < ALONE * c.whole:
        return True
    if c.share > 1 and c.name != "gravity" and not OTHER_J[0] < ratio < OTHER_J[1]:
        return True
    return "u" in c.depends_on and not IMITATES < ratio < 1 / IMITATES

"""Where the torque goes, which models were compared, how small an effect would have shown, and an
unknown torque as a table over the signals that it depends on: hat functions in the rows of a last
fit, as stiff as left-out blocks ask (Eilers and Marx, Statistical Science 11(2), 1996).
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass
from statistics import NormalDist

import numpy as np
from scipy.interpolate import BSpline
from scipy.sparse import csr_matrix

from ..blocks.block import Block, unit_for
from ..core.errors import Refused
from ..core.numeric import Z95, rms
from ..core.regression import TINY, paired
from ..estimates.findings import Compared, Comparison, Detectable, Share, Table
from . import constants as const
from .constants import LITTLE, LONG_BLOCKS, MOSTLY, MUCH, ORDERS
from .friction import View
from .last_fit import LastFit, places
from .table import Contender
from .verdict import LONGER, Answer, Decision

POWER = 0.8
UNJUDGED = (
    "the record is too short, or its noise too large, to judge what is missing: no effect below "
    "{:.2g} % of friction would have been seen."
)
OF_THE_DRIVE = {
    "inertia": ("a", "J"),
    "coulomb": ("w", "Fc", "dip", "damping"),
    "viscous": ("w", "Fv", "grease"),
    "offset and unbalance": ("theta", "offset", "run"),
}


def comparison(made: Answer, least: float, alpha: float) -> Comparison:
    """The comparison behind an answer."""
    d = made.decision
    assert d is not None  # there is no comparison without a search
    friction = max(rms(made.last.friction), LITTLE * made.view.force)
    return Comparison(
        made.verdict,
        rows=tuple(_rows(d)),
        budget=tuple(budget(made, friction)),
        detectable=tuple(detectable(d, least, alpha)) if made.verdict == "adequate" else (),
        least=least,
        friction=friction,
        stretches=made.interval.stretches,
    )


def refuse_unjudged(found: Comparison) -> None:
    """Refused where not even a large effect would have been seen."""
    if found.detectable and found.detectable[0].share > max(MUCH, found.least):
        raise Refused(UNJUDGED.format(100 * found.detectable[0].share), LONGER)


def signals(block: Block) -> tuple[str, ...]:
    """The signals on which the torque of an effect depends."""
    level = {"Fc", "Fs", "Fv", "+Fc"} & set(block.acts)
    own = [k for k in ("t", *block.inputs) if k != "t" or block.timed]
    return tuple(dict.fromkeys([*own, *(["w"] if level else [])]))


def budget(made: Answer, size: float) -> list[Share]:
    """Each term with its RMS along the log, as a share of friction ``size``, largest first."""
    last, d = made.last, made.last.design
    terms: list[tuple] = []  # name, torque in the rows, RMS along the log, coefficients, signals
    for name, (on, *parts) in OF_THE_DRIVE.items():
        torque, at = last.part(*parts), [j for j, n in enumerate(d.names) if n in parts]
        terms.append((name, torque, rms(torque), at, (on,)))
    for i, term in enumerate(last.state.terms):
        along = last.view.rms(last.along(i)[:, None])
        terms.append((term.key, last.torque[i], along, places(d, i), signals(term.block)))
    shares = []
    for name, torque, along, at, on in (term for term in terms if term[2] > 0):
        slope = d.X[:, at].T @ torque / np.sum(torque**2) * along
        V = made.interval.coefficients[np.ix_(at, at)]
        half = Z95 * float(np.sqrt(max(slope @ V @ slope, 0.0)))
        ends = (max(along - half, 0.0) / size, (along + half) / size) if at else None
        shares.append(Share(name, along, along / size, ends, on))
    if made.verdict == "unexplained" and made.depends_on:
        shares += _unknown(made, size)
    shares.sort(key=lambda s: -s.rms)
    left = rms(last.left)
    noise = min(float(np.sqrt(made.view.noise)) * abs(last.values["J"]), left)
    return [*shares, Share("left", left, left / size, None, ()),
            Share("noise", noise, noise / size, None, ())]  # fmt: skip


def _unknown(made: Answer, friction: float) -> list[Share]:
    """The unknown torque that the verdict is about."""
    on = set(made.depends_on)
    unknown = made.decision.unknown if made.decision else ()
    odd = next((c for c in unknown if c.depends_on == on), None)
    if odd is None:
        return []
    size = odd.share * made.view.size
    return [Share("unknown torque", size, size / friction, None, tuple(sorted(on)))]


def _rows(d: Decision) -> list[Compared]:
    free = int(d.free_of_base)
    rows = [Compared("declared", 0.0, 0.0, 0.0, free)]
    others = []
    for c in (*d.named, *d.unknown):
        elpd, error = paired(c.e, d.e0)
        name = f"unknown({', '.join(sorted(c.depends_on))})" if c.depends_on else c.name
        own = sum(map(len, c.each)) + c.k
        others.append(Compared(name, elpd, error, c.share, free + own))
    return rows + sorted(others, key=lambda row: -row.elpd)


def detectable(d: Decision, least: float, alpha: float) -> list[Detectable]:
    """The smallest share of friction at which each effect would have been seen, 80 % power.

    (z_alpha/K + z_0.8) standard errors of its strength, with K contenders; at least ``least``.
    """
    tried = d.search.tried
    normal = NormalDist()
    z = normal.inv_cdf(1 - alpha / max(len(tried), 1) / 2) + normal.inv_cdf(POWER)
    best: dict[str, float] = {}
    finest = _finest(d.view)
    for c in tried:
        seen = max(least, z * _error(d, c) * _lost(d.view, c))
        best[c.name] = min(seen, best.get(c.name, np.inf))
    waves = {c.name for c in tried if c.order}
    made = [Detectable(k, x, finest if k in waves else None)
            for k, x in best.items() if np.isfinite(x)]  # fmt: skip
    return sorted(made, key=lambda one: one.share)


def _finest(view: View) -> float | None:
    """The finest wave over theta, 1/rev (rad/m), of which the rows still show half."""
    if view.is_map:
        return None
    N = np.geomspace(0.1, 10.0, 200) / view.rows.passed
    shown = N[np.sqrt(np.mean(view.seen_of(N) ** 2, axis=0)) >= MOSTLY]
    if view.model.motion == "linear":
        return float(shown.max(initial=N[0]))
    return float(np.clip(np.floor(shown.max(initial=1.0)), 1.0, ORDERS))


def _lost(view: View, c: Contender) -> float:
    """RMS of its torque along the log over that in the rows: how much windows take of it."""
    if c.C is None or c.block is None:
        return 1.0
    along = np.column_stack([view.columns(c.block, q).torque for q in c.each])
    return max(1.0, view.rms(along) / (float(np.sqrt(np.mean(np.sum(c.C**2, axis=1)))) + TINY))


def _error(d: Decision, c: Contender) -> float:
    """Standard error of its strength, as a share of friction."""
    table, m = d.table, len(d.table.y)
    memory = np.sqrt(max(1.0, m / max(4.0 * d.view.blocks.number, 1.0)))
    usual = table.scale * memory / np.sqrt(m) / d.view.size
    if c.C is None:
        return usual
    W = table.beside(c.C)
    left = float(np.sqrt(np.sum(W**2)))
    law = table.X[:, np.r_[table.imitates, np.zeros(table.X.shape[1] - len(table.imitates), bool)]]
    beside = c.C - law @ np.linalg.lstsq(law, c.C, rcond=None)[0]
    seen = float(np.sqrt(np.sum(beside**2)))
    return usual * seen / left if left > 0 else np.inf


KNOWN = (("theta",), ("theta", "w"), ("w",), ("t",), ("t", "w"), ("u",))
INSTEAD: dict[tuple[str, ...], tuple[str, ...]]
INSTEAD = {("t", "u"): ("t", "w"), ("theta", "u"): ("theta", "w")}  # u has mostly the sign of w
POINTS = 48  # at most
STIFFNESS = tuple(10.0 ** np.arange(-9.0, 1.0))  # of the curvature, over the rows
FOLDS = 4  # of the blocks


@dataclass(frozen=True, eq=False)
class _Grid:
    """Points (m,) of a table, its normal equations and curvature by block."""

    points: np.ndarray
    periodic: bool
    G: np.ndarray  # (blocks, k, k)
    g: np.ndarray  # (blocks, k)
    S: np.ndarray  # curvature (k, k)

    def system(self, stiffness: float, seen: np.ndarray) -> np.ndarray:
        H, stiff = self.G[seen].sum(0), stiffness * self.S
        firm = 1e-10 + 1e-14 * np.trace(stiff)  # data at one place determine no straight line
        return H + np.trace(H) * (stiff + firm * np.eye(len(H)))

    def gain(self, stiffness: float, seen: np.ndarray) -> np.ndarray:
        """Power that the table by the blocks ``seen`` explains in each: |r|^2 - |r - A v|^2."""
        v = np.linalg.solve(self.system(stiffness, seen), self.g[seen].sum(0))
        return 2 * self.g @ v - np.einsum("i,bij,j->b", v, self.G, v, optimize=True)

    def left_out(self, stiffness: float, seen: np.ndarray) -> float:
        """The same of blocks that each of the folds of ``seen`` leaves out, in all."""
        folds = [seen & ((np.cumsum(seen) - 1) % FOLDS == k) for k in range(FOLDS)]
        return sum(float(self.gain(stiffness, seen & ~own)[own].sum()) for own in folds)


def tabulated(last: LastFit, depends_on: Collection[str]) -> Table | None:
    """The residual torque of a last fit over ``depends_on``, on the resisting side; None for other
    signals (a function of the acceleration is an inertia), or where nothing is predicted.

    ``share`` of its power is that which tables predict of blocks left out of fit and choice;
    standard errors are those of blocks, widened for the stiffness (Nychka, J. American Statistical
    Association 83, 1988).
    """
    name = tuple(s for s in ("theta", "t", "w", "u") if s in depends_on)
    name, t = INSTEAD.get(name, name), last.view.rows.t
    blocks = np.array_split(np.argsort(t, kind="stable"), min(LONG_BLOCKS, max(1, len(t) // 8)))
    if name not in KNOWN or len(blocks) < 2 * FOLDS:
        return None
    r = last.left
    grids, power = list(_grids(last, name, r, blocks)), np.array([r[b] @ r[b] for b in blocks])
    gain, every = np.zeros(len(blocks)), np.ones(len(blocks), bool)
    for own in (np.arange(len(blocks)) % FOLDS == k for k in range(FOLDS)):
        grid, stiffness = _chosen(grids, ~own)
        gain[own] = grid.gain(stiffness, ~own)[own]
    whole = float(power.sum()) + TINY
    share = float(gain.sum()) / whole
    half = Z95 * float(np.sqrt(np.sum((gain - share * power) ** 2))) / whole
    if share - half <= 0:
        return None
    grid, stiffness = _chosen(grids, every)
    inverse, G = np.linalg.inv(grid.system(stiffness, every)), grid.G.sum(0)
    v = inverse @ grid.g.sum(0)
    wider = np.diag(inverse) / np.maximum(np.diag(inverse @ G @ inverse), TINY)
    error = np.sqrt(np.sum(((grid.g - grid.G @ v) @ inverse) ** 2, 0) * np.maximum(wider, 1.0))
    shape, motion = (2, -1) if len(name) == 2 else (-1,), last.view.model.motion
    return Table(
        signals=name, points=grid.points, values=v.reshape(shape), error=error.reshape(shape),
        periodic=grid.periodic, share=share, share95=(share - half, share + half),
        rms=float(np.sqrt(v @ G @ v / len(r))), unit=unit_for("N m", motion), windows=len(blocks),
        motion=motion,
    )  # fmt: skip


def _chosen(grids: list[_Grid], seen: np.ndarray) -> tuple[_Grid, float]:
    """The first grid, and its stiffness, that loses next to nothing by blocks left out."""
    tried = [max((grid.left_out(s, seen), s) for s in STIFFNESS) for grid in grids]
    best = max(gain for gain, _ in tried)
    i = next(i for i, (gain, _) in enumerate(tried) if gain >= best - const.FAINT * abs(best))
    return grids[i], tried[i][1]


def _grids(
    last: LastFit, name: tuple[str, ...], r: np.ndarray, blocks: list[np.ndarray]
) -> Iterator[_Grid]:
    """A table of one turn where the drive turns, then one of the whole range."""
    m, K = last.view.motion, last.view.K
    x = m.held(m.u) if name[0] == "u" else getattr(m, name[0])
    turning = name[0] == "theta" and last.view.model.motion == "rotary" and np.ptp(x) > 2 * np.pi
    sides = [m.w > 0, m.w < 0] if len(name) == 2 else [np.ones(len(x), bool)]
    n = min(POINTS, max(12, len(r) // 8))
    one = np.eye(n)
    for turns in (True, False)[not turning :]:
        ends = np.linspace(-np.pi, np.pi, n + 1) if turns else np.linspace(x.min(), x.max(), n)
        at = (x + np.pi) % (2 * np.pi) - np.pi if turns else x
        hats = BSpline.design_matrix(at, np.r_[ends[0], ends, ends[-1]], 1)
        parts = [csr_matrix(K @ hats.multiply(side[:, None])).toarray() for side in sides]
        if turns:  # the last point is the first one
            parts = [np.column_stack([X[:, 0] + X[:, -1], X[:, 1:-1]]) for X in parts]
        change = np.roll(one, 1, 0) - 2 * one + np.roll(one, -1, 0)
        change = change if turns else change[1:-1]
        A, S = np.hstack(parts), np.kron(np.eye(len(sides)), change.T @ change * float(n) ** 3)
        G, g = np.array([A[b].T @ A[b] for b in blocks]), np.array([A[b].T @ r[b] for b in blocks])
        yield _Grid(ends[:n], turns, G, g, S)

"""The declared model as a row of the table: inertia, friction as far as it may be declared wrongly,
declared effects, and what differs between runs.

    K u = J K a + late K (h du/dt) + K F(w, z) + declared effects + offsets of runs + residual

Friction has more shapes than its declared law: what the law imitates is kept apart from what it
does not (IMITATES).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, replace
from functools import cache, cached_property
from typing import Any

import numpy as np

from ..blocks.block import Block, members
from ..blocks.friction import along as bristle
from ..blocks.friction import free_level, level, strokes
from ..blocks.model import Model
from ..core.errors import Refused
from ..core.numeric import rms
from ..core.regression import TINY, Blocks, Prior, log_density, robust, spread
from . import constants as const
from .columns import Along, Columns, changed_input, columns, linear, scaled, to_coefficients
from .motion import Motion, one_way
from .windows import Rows

FRICTION = ("Fc", "bump", "short_tail", "long_tail", "Fv", "grease", "bend", "turn", "smear")
IMITATES = {"J", "Fc", "bump", "Fv", "turn", "run"}  # the rest extends a declared law
NO_ROWS = "no windows in motion are left: the samples are {:.3g} s apart."
UNIT_OF_T = "Check the unit of t, or record faster."
SETTLED = ("x0", "vs", "size", "force")  # what a table settles of friction


WEIGHT, OFFSET = "gravity", "constant_torque"


@dataclass
class Term:
    """An effect in a regression: nonlinear values ``q``, linear coefficients ``b``."""

    block: Block
    key: str  # its name in a model
    q: dict[str, float]
    b: np.ndarray
    declared: bool = False  # the model has it

    def copy(self) -> Term:
        return replace(self, q=dict(self.q), b=self.b.copy())

    @property
    def name(self) -> str:
        return self.block.name

    @property
    def on_input(self) -> bool:
        return "input" in self.block.acts


class Regression:
    """Columns (m,) with their names, and what is known of the coefficient of each; none is above
    LARGE times all torque, ``force``."""

    def __init__(self, force: float) -> None:
        self.force = force
        self.names: list[Any] = []
        self._columns: list[np.ndarray] = []
        self._known: list[tuple[float, ...]] = []  # precision, centre, low and high of each

    def add(
        self,
        name: Any,
        column: np.ndarray,
        sd: float = np.inf,
        low: float = -np.inf,
        high: float = np.inf,
        centre: float = 0.0,
    ) -> None:
        most = const.LARGE * self.force / max(rms(column), TINY)
        self.names.append(name)
        self._columns.append(column)
        self._known.append(((1 / min(sd, most)) ** 2, centre, low, high))

    @cached_property
    def X(self) -> np.ndarray:
        return np.column_stack(self._columns)

    @cached_property
    def prior(self) -> Prior:
        return Prior(*np.array(self._known).T)


class View:
    """One description of a log, as one regression sees it: motion, windows, a friction law. ``u``
    (n,) is the torque after the drive's own effects on it, ``z``, ``coulomb``, ``viscous``,
    ``level``, ``load`` (n,) what effects scale; ``size`` and ``force`` are the RMS of friction and
    of all torque."""

    is_map = False  # runs at steady speeds
    backward = False  # friction would drive all of them
    logged_late = 0.0  # s: each torque acted so long before its row
    w_above = 0.0, 0.0  # rad/s: what a w alone says at rest, with its standard error
    longest_fall = np.inf  # rad/s: the largest Stribeck speed
    signals = frozenset({"t", "theta", "w", "u"})  # on which an unknown torque may depend
    never: frozenset[str] = frozenset()  # effects that such a log cannot show
    held_out: Sequence[tuple[int, float, float]] = ()  # (run, start, end), s; none: alternate parts

    def __init__(
        self,
        motion: Motion,
        rows: Rows,
        model: Model,
        J_range: tuple[float, float] | None = None,
        terms: Sequence[Term] = (),
    ) -> None:
        self.motion, self.rows, self.model, self.K = motion, rows, model, rows.K
        self.J_range, self.sure = J_range, True
        self.declared = model.known()
        self.terms = [t.copy() for t in terms]
        self.hold = motion.hold  # a torque that is read at instants is so early
        self.longest_hold = float(motion.hold.max())
        self.latest = (
            const.FREE_LATE / self.longest_hold
        )  # a held torque is no later than a current loop
        self.noise = float(np.mean(rows.shake**2))
        self.blocks = self._blocked()
        self.typical = float(np.median(rows.w))
        self.u = motion.u
        self.J = self.declared.get("J", 0.0)
        self.load = motion.d
        self._path = strokes(motion.fine_steps)
        self._follows: dict[float, np.ndarray] = {}
        self._bristles: dict[float, tuple[np.ndarray, np.ndarray]] = {}
        self._in_rows: dict[Any, np.ndarray] = {}

    def _blocked(self) -> Blocks:
        number = int(
            np.clip(self.motion.duration / const.BLOCK, const.FEWEST_BLOCKS, const.MOST_BLOCKS)
        )
        return Blocks(self.rows.t, self.motion.duration, number)

    @property
    def values(self) -> int:
        """How many values the law and the declared effects have to fit."""
        law = [p for p in self.model.friction.block.own.values() if p.fitted]
        return len(law) + sum(len(t.b) for t in self.terms)

    @property
    def several(self) -> bool:
        """Whether the drive has more than one speed."""
        slow, fast = np.quantile(self.rows.w, [0.05, 0.95])
        return bool(fast - slow > const.PART * self.typical)

    def on(self, mask: Any = slice(None)) -> View:
        """The same motion and law on some of the rows, by default on all."""
        made = copy(self)
        made.rows, made.terms = self.rows.only(mask), [t.copy() for t in self.terms]
        made.K, made._in_rows = made.rows.K, {}
        made.noise = float(np.mean(made.rows.shake**2))
        made.blocks = made._blocked()
        return made

    def seen_of(self, N: np.ndarray) -> np.ndarray:
        """What the rows leave (m, k) of waves over theta of orders N (k,)."""
        key = N.tobytes()
        if key not in self._in_rows:
            m, passed = self.motion.main, self.rows.w[:, None] * N
            slow = (passed * (m.dt * m.spread)) ** 2
            self._in_rows[key] = np.exp(-((passed * self.rows.h) ** 2) / 18) / (1 + slow**2 * slow)
        return self._in_rows[key]

    @cached_property
    def with_offset(self) -> np.ndarray:
        """Runs with an own offset; none where each has one direction: there it is any friction."""
        m, runs = self.motion, np.unique(self.motion.run)
        apart = not m.one_way and all(one_way(m.w[m.run == r], m.top) for r in runs)
        return runs[:0] if apart else runs[1:]

    @property
    def apart(self) -> np.ndarray | None:
        """Numbers (m,) of the rows that err together; None where the residual says it."""
        return None

    def scatter(self, r: np.ndarray) -> float:
        """The noise of residuals (m,) that is known without a model, N m."""
        return 0.0

    def torque(self, u: np.ndarray) -> np.ndarray:
        """A torque (n,) that is held from sample to sample, in the rows (m,)."""
        return self.K @ self.motion.held(u)

    def lateness(self, u: np.ndarray) -> np.ndarray:
        """What a torque that is later by a hold adds to the rows (m,), to first order."""
        return self.K @ (self.hold * self.motion.slope(self.motion.held(u)))

    def by(self, motion: Motion, rows: Rows) -> View:
        """The same log by another description of its motion."""
        made = View(motion, rows, self.model, self.J_range, self.terms)
        made.sure, made.logged_late, made.w_above = self.sure, self.logged_late, self.w_above
        return made

    def lowered(self, above: float) -> View:
        """The same rows with speeds that are lower by so much (rad/s)."""
        made = self.by(self.motion.lowered(above), self.rows)
        made.settle_as(self)
        return made

    def settle_as(self, other: View) -> None:
        """Friction as a table has settled it beside another view of the log."""
        for key in SETTLED if self.motion is not other.motion else (*SETTLED, "z"):
            setattr(self, key, getattr(other, key))

    # ---- the law
    def deflection(self, x0: float) -> tuple[np.ndarray, np.ndarray]:
        """A bristle of length x0 (rad) over its level: between the samples, and at them."""
        if x0 not in self._bristles:
            fine = np.r_[0.0, bristle(*self._path, x0)]
            self._bristles[x0] = fine, self.motion.coarse(fine)
        return self._bristles[x0]

    def bristle_rows(self, x0: float) -> np.ndarray:
        """The bristle in the rows (m, 3), its rate, and what a reversal inside a window blurs."""
        if x0 not in self._in_rows:
            (fine, z), m = self.deflection(x0), self.motion
            blurred = m.coarse(fine * level(m.fine_w, 0.0, 1.0, self.rows.smear))
            self._in_rows[x0] = self.K @ np.column_stack([z, m.slope(z), blurred])
        return self._in_rows[x0]

    def near_rest(self, x0: float) -> np.ndarray:
        """What friction may do near rest beside a bristle of length x0, in the rows (m, k)."""
        key, m, made = ("near", x0), self.motion, []
        if key not in self._in_rows:
            fine = last = self.deflection(x0)[0]
            for kind, x, _ in const.NEAR_REST:
                if kind == "turn":
                    new = self.deflection(x * m.top * self.rows.h + self.x0)[0]
                    shape, last = new - last, new
                else:
                    shape = fine * free_level(m.fine_w, 0.0, 1.0, x * m.top, 1.0)
                made.append(self.K @ m.coarse(shape))
            self._in_rows[key] = np.column_stack(made)
        return self._in_rows[key]

    def grease_rows(self, exponent: float) -> np.ndarray:
        """|w|^exponent sign(w) in the rows (m,)."""
        key = "grease", exponent
        if key not in self._in_rows:
            self._in_rows[key] = self.K @ self.grease(exponent)
        return self._in_rows[key]

    def follows(self, x0: float) -> np.ndarray:
        """How the bristle (n,) follows an asymmetry of its level."""
        if x0 not in self._follows:
            up, down = (bristle(*self._path, x0, side * const.SLIGHT) for side in (1, -1))
            self._follows[x0] = self.motion.coarse(np.r_[0.0, (up - down) / (2 * const.SLIGHT)])
        return self._follows[x0]

    def stribeck(self, x0: float, vs: float) -> np.ndarray:
        """Columns (n, 4) that depend on the Stribeck speed: bump, short and long tail, bend."""
        fine, m = self.deflection(x0)[0], self.motion
        bump = level(m.fine_w, 0.0, 1.0, vs)
        tails = (free_level(m.fine_w, 0.0, 1.0, v, 1.0) for v in self.tails(vs))
        law = [fine * bump, *(fine * tail for tail in tails), m.fine_w * bump]
        return m.coarse(np.column_stack(law))

    def tails(self, vs: float) -> tuple[float, float]:
        """The speeds (rad/s) over which the short and the long tail fall."""
        short = 1.5 * vs
        return short, min(5 * vs, max(const.TAIL * self.motion.top, short))

    def grease(self, exponent: float) -> np.ndarray:
        """|w|^exponent sign(w), (n,)."""
        law = members("effect")["sublinear_viscous"]
        return law(self.motion.w, coefficient=1.0, exponent=exponent)[0]

    # ---- the rows
    def start(self) -> None:
        """What no law changes: the torque, and columns of terms and of runs."""
        m, self.u, self.others = self.motion, self.motion.u, []
        for term in self.terms:
            if term.on_input:
                self.u = self.changed(term.block, term.q)
        for term in self.terms:
            if not term.on_input:
                made = self.columns(term.block, term.q)
                for k, x in enumerate(self.in_rows(made).T):
                    self.others.append(((term.key, k), x, np.inf, made.low[k], made.high[k]))
        self.y, self.late = self.torque(self.u) - self.K @ m.d, self.lateness(self.u)
        known = self.declared.get("J", 0.0) * self.rows.a  # coasting: no torque but that
        self.force = float(np.sqrt(max(np.mean(self.y**2), np.mean(known**2)))) + TINY
        self.others += self.offsets(self.force)

    def offsets(self, level: float) -> Iterator[tuple]:
        """A column for each run whose torque has an offset of its own."""
        most = const.MUCH * self.force
        for run in self.with_offset:
            column = self.K @ (1.0 * (self.motion.run == run))
            yield "run", column, const.BACKGROUND * level, -most, most

    def most(self, name: str) -> float:
        return np.inf

    def base(self, x0: float, vs: float) -> Regression:
        """The declared model for one bristle length and one Stribeck speed."""
        m, made = self.motion, Regression(self.force)
        low, high = self.J_range or (0.0, np.inf)
        made.add("J", self.rows.a, low=low, high=high)
        made.add("late", self.late, sd=3.0, low=-1.0, high=self.latest)
        z, law = self.bristle_rows(x0), self.K @ self.stribeck(x0, vs)
        ways = self.K @ m.w, self.grease_rows(const.GREASE[0])
        parts = z[:, 0], *law[:, :3].T, *ways, law[:, 3], *z[:, 1:].T
        # in one direction Coulomb friction and an offset are one
        signs = {"smear", "Fc"} if m.one_way else {"smear"}
        for name, column in zip(FRICTION, parts, strict=True):
            made.add(name, column, low=-np.inf if name in signs else 0.0, high=self.most(name))
        for other in self.others:
            made.add(*other)
        return made

    def grids(self) -> tuple[np.ndarray, np.ndarray]:
        """Bristle lengths and Stribeck speeds to try, around declared ones."""
        known, top = self.declared, self.motion.top
        reach, count = float(np.ptp(self.motion.theta)), self.motion.count
        if known.get("sigma0"):
            lengths = known.get("Fc", 1.0) / known["sigma0"] * np.array([0.5, 1, 2, 4, 8])
        else:
            longest = 2e-3 * min(reach, 12.6) + 1e-9
            lengths = np.geomspace(max(0.5 * count, 1e-5 * reach), longest, 6)
        speeds = known.get("vs", 0.01 * top) * np.array([0.5, 0.8, 1.2, 2, 4])
        return lengths, np.unique(np.clip(speeds, 1e-4 * top, 0.3 * top))

    def choose(self, scale: float | None, beside: Any = None) -> float:
        """Settle bristle length and Stribeck speed, ``beside`` a contender; the residual scale."""
        if not len(self.y):
            raise Refused(NO_ROWS.format(self.motion.dt), UNIT_OF_T)
        lengths, speeds = (x.tolist() for x in self.grids())
        if scale is None:
            base = self.base(lengths[len(lengths) // 2], speeds[0])
            low, high = base.prior.low[0], base.prior.high[0]
            first = int(low == high > 0)  # a J that is held explains all
            r, X = self.y - base.X[:, :first] @ np.full(first, low), base.X[:, first:]
            scale = spread(r - X @ np.linalg.lstsq(X, r, rcond=None)[0])

        @cache
        def likelihood(x0: float, vs: float) -> float:
            base = self.base(x0, vs)
            X, y, prior = base.X, self.y, base.prior
            if beside is not None:
                X, y, prior = beside.added(self, X, y, prior)
            fit = robust(X, y, prior, scale, self.noise, turns=3)
            return float(np.sum(log_density(fit.r)))

        x0 = lengths[len(lengths) // 2]
        for _ in range(3):
            vs = max(speeds, key=lambda v: likelihood(x0, v))
            x0 = max(lengths, key=lambda x: likelihood(x, vs))
        self.set_law(x0, vs)
        return scale

    def set_law(self, x0: float, vs: float) -> None:
        self.x0, self.vs, base = x0, vs, self.base(x0, vs)
        self.B, self.prior, self.names = base.X, base.prior, base.names
        _, self.z = self.deflection(x0)
        self.law = self.stribeck(x0, vs)

    # ---- along the log
    def torques(self, b: np.ndarray) -> None:
        """Friction and load along the log from the coefficients of the base."""
        m, k = self.motion, dict(zip(self.names, b, strict=False))
        near_rest = [k[n] for n in ("bump", "short_tail", "long_tail", "bend")]
        self.coulomb = k["Fc"] * self.z + self.law @ near_rest
        self.viscous = k["Fv"] * m.w + k["grease"] * self.grease(const.GREASE[0])
        self.friction, self.J = self.coulomb + self.viscous, float(b[0])
        for term in self.terms:
            if not term.on_input:
                term.b = np.array([k[term.key, i] for i in range(len(linear(term.block)))])
        self.set_load(self.terms)
        self.level = self._level(k)
        self.size = max(rms(self.K @ self.friction), const.LITTLE * self.force)

    def set_load(self, terms: Sequence[Term]) -> None:
        """The load torque (n,): measured, and of terms that are loads."""
        loads = [self.columns(t.block, t.q).wide @ t.b for t in terms if t.block.load]
        self.load = self.motion.d + sum(loads)

    def _level(self, k: Mapping[Any, float]) -> np.ndarray:
        """The level of sliding friction (n,), as it is declared where it is."""
        m = self.motion
        made = k["Fc"] + (k["bump"] + k["bend"] * np.abs(m.w)) * level(m.w, 0.0, 1.0, self.vs)
        for name, v in zip(("short_tail", "long_tail"), self.tails(self.vs), strict=True):
            made = made + k[name] * free_level(m.w, 0.0, 1.0, v, 1.0)
        return made

    def along(self, **other: Any) -> Along:
        """The signals of the log for blocks, some of them replaced."""
        known = {
            k: getattr(self, k) for k in ("z", "coulomb", "level", "viscous") if hasattr(self, k)
        }
        if hasattr(self, "x0"):
            known["follows"] = self.follows(self.x0)
        known |= {"u": self.u, "load": self.load, "J": self.J, "values": self.declared}
        return Along.of(self.motion, **known | other)

    def columns(self, block: Block, q: Mapping[str, float]) -> Columns:
        """The columns of an effect along the log."""
        return columns(block, q, self.along(u=self.motion.held(self.u)))

    def in_rows(self, made: Columns) -> np.ndarray:
        """Columns along the log -> in the rows (m, k)."""
        if made.narrow is None:
            return self.K @ made.wide
        narrow = self.rows.narrow @ made.narrow
        return narrow if made.wide is None else self.K @ made.wide + narrow

    def rms(self, torque: np.ndarray) -> float:
        """RMS of torques (n, k) where the log is used, all together; waves that are finer than a
        window count in full."""
        return float(np.sqrt(np.mean(self.rows.narrow @ np.sum(torque**2, axis=1))))

    def changed(self, block: Block, q: Mapping[str, float]) -> np.ndarray:
        """What an effect on the torque makes of it (n,)."""
        return changed_input(block, q, self.along())


def declared_terms(model: Model, along: Along) -> list[Term]:
    """The declared effects with their values; their strength is where a fit starts."""
    made = []
    for part in model.effects:
        known = {k: v for k, v in part.values.items() if v is not None}
        own = linear(part.block)
        strength = known.get(part.block.gain)
        per = scaled(part.block) or ()
        q = {k: v / strength if k in per and strength else v
             for k, v in known.items() if k not in own}  # fmt: skip
        full = set(own) <= known.keys()
        b = to_coefficients(part.block, known, along) if full else np.zeros(len(own))
        made.append(Term(part.block, part.key, q, b, declared=True))
    return made

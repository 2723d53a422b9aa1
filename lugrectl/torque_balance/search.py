"""Contenders for the table: every effect of the catalogue at its most promising values.

What an effect is not linear in is searched on what the base leaves, by what its declaration says
of it: an order of the angle, a frequency, an instant, a duration, a place, a load behind a spring,
a change of the torque itself; anything else by a grid around its default.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from itertools import product
from typing import Any

import numpy as np

from ..blocks.block import Block, P, members
from ..core.regression import TINY, Prior
from . import constants as const
from .columns import Along, lanes, linear, needs_inertia, refused, searched
from .table import Contender, Table, is_lateness, likeliest

OF_THE_LAW = {"sublinear_viscous", "stribeck", "presliding"}  # parts of friction: see last_fit

Values = dict[str, float]


def polish(
    gains: Callable[[np.ndarray], np.ndarray], x: Sequence[float], step: Sequence[float], turns: int
) -> np.ndarray:
    """The largest gain near x (k,), around the tops of parabolas; ``gains`` of points at once."""
    centre, size = np.array(x, float), np.array(step, float)
    one = np.eye(len(centre))
    around = np.vstack([0 * one[:1], one, -one])
    best, most = centre, -np.inf
    for _ in range(turns):
        made = gains(centre + around * size)
        i = int(np.argmax(made))
        if made[i] > most:
            best, most = centre + around[i] * size, float(made[i])
        up, down = np.split(made[1:], 2)
        bend = 2 * made[0] - up - down
        top = 0.5 * (up - down) / np.maximum(bend, TINY)
        near = bool(np.all(bend > 0) and np.max(np.abs(top)) < const.FARTHEST)
        centre = centre + top * size if near else best
        size = size * (const.CLOSER if near or i == 0 else 1.0)
    return best


def golden(gain: Callable[[float], float], a: float, b: float, turns: int = 7) -> float:
    """The largest gain between a and b, by golden sections."""
    for _ in range(turns):
        x, y = a + 0.382 * (b - a), a + 0.618 * (b - a)
        a, b = (a, y) if gain(x) > gain(y) else (x, b)
    return 0.5 * (a + b)


class Search:
    """All contenders beside one base; ``tried``: whether they promise something or not. ``sure``:
    the log determines the inertia; else only what does not depend on it is tried. ``memory`` keeps
    the loads that earlier searches beside other bases found."""

    def __init__(
        self,
        table: Table,
        sure: bool,
        never: Collection[str],
        memory: dict[str, Any],
        only: Collection[str] | None = None,
    ) -> None:
        self.table, self.view, self.sure, self.never = table, table.view, sure, frozenset(never)
        self.memory, self.only = memory, only
        self.linear = self.view.model.motion == "linear"
        self.span = float(np.ptp(self.view.motion.theta))
        self.along = self.view.along(u=self.view.motion.held(self.view.u))
        self.turns = 2 if table.quick and only is None else const.TURNS
        self.few = self._at_rows()

    def rows(self) -> list[Contender]:
        """The likeliest first; only those that the screening promises something are entered."""
        self.tried = [c for c in self._contenders() if not self._there(c)]
        worth = [(self.table.promise(c), c) for c in self.tried]
        entered = self.table.entered([(x, c) for x, c in worth if x > const.SCREEN])
        return likeliest([c for c in entered if self._possible(c)])

    def _contenders(self) -> Iterator[Contender]:
        for name, block in members("effect").items():
            of_the_law = name in OF_THE_LAW and not (self.view.is_map and linear(block))
            asked = name not in self.never and (self.only is None or name in self.only)
            if not asked or of_the_law or refused(block):
                continue
            if needs_inertia(block) and not self.sure or "sensor" in block.acts and block.states:
                continue
            of_angle = any(p.angle and p.unit == "rad" for p in block.own.values())
            if self.linear and of_angle and not {"harmonic", "frequency"} & block.own.keys():
                continue
            yield from self._of(block)

    def _of(self, block: Block) -> Iterator[Contender]:
        keys = searched(block)
        own = block.own
        if "input" in block.acts and not linear(block):
            yield from self._of_input(block, keys) if self.sure else ()
        elif not keys:
            yield self._contender(block, {})
        elif any(own[k].whole for k in keys):
            yield from self._of_orders(block, keys)
        elif len(keys) == 1 and own[keys[0]].unit == "Hz":
            yield from self._of_frequency(block, keys[0])
        elif own[block.gain].unit == "kg m2" and {"stiffness", "damping"} <= {*keys}:
            yield from self._of_spring(block, keys)
        else:
            yield from self._of_any(block, keys)

    # ---- what the rows show of an effect
    def _at_rows(self) -> Along:
        """The signals at the rows, for screening: quicker than columns of every sample."""
        v, a = self.view, self.along
        at, K = v.rows.at, v.K
        means = {k: K @ getattr(a, k) for k in ("z", "follows", "coulomb", "viscous", "load", "u")}
        ends = [*np.flatnonzero(np.diff(v.motion.run[at])) + 1, len(at)]
        pieces = tuple((slice(0 if i == 0 else ends[i - 1], e), v.rows.step)
                       for i, e in enumerate(ends))  # fmt: skip
        return Along(
            t=a.t[at], theta=a.theta[at], w=a.w[at], acceleration=v.rows.a, path=a.path[at],
            pieces=pieces, level=a.level[at], J=a.J, values=a.values, d=v.K @ v.motion.d, **means,
        )  # fmt: skip

    def _seen(
        self, block: Block, sets: Sequence[Values], screening: bool = False
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Columns of an effect at each set of values, in the rows (m, k sets), and the bounds of
        their coefficients; for ``screening`` by the signals at the rows, where it has no memory."""
        few = screening and not (block.states or block.exact is not None or self.view.is_map)
        each = lanes(block, sets, self.few if few else self.along)
        return each.torque if few else self.view.in_rows(each), each.low, each.high

    def _gains(self, block: Block, X: np.ndarray) -> np.ndarray:
        """Gain of each set of values."""
        if len(linear(block)) == 2:
            return self.table.gains_of_pairs(X)
        gain, b = self.table.gains(X)
        p = block.own[block.gain]
        meant = (b >= p.low) & (b <= p.high)
        if any(one.passed for one in block.own.values()):
            meant &= np.mean(np.abs(X) > 1e-9 * np.abs(X).max(), axis=0) < const.PART
        return np.where(meant, gain, 0.0)

    def _each(self, block: Block, sets: Sequence[Values]) -> np.ndarray:
        """Gain of each set of values, from all samples; -1 beyond bounds."""
        own, made = block.own, np.full(len(sets), -1.0)
        inside = [i for i, q in enumerate(sets)
                  if all(own[k].low <= x <= own[k].high for k, x in q.items())]  # fmt: skip
        if inside:
            X = self._seen(block, [sets[i] for i in inside])[0]
            made[inside] = np.nan_to_num(self._gains(block, X), nan=-1.0)
        return made

    def _polished(
        self, block: Block, q: Values, steps: Mapping[str, float], gain: float = np.inf
    ) -> Values:
        """The best values near q; itself where its ``gain`` promises nothing."""
        if gain < const.SCREEN:
            return q

        def at(x: np.ndarray) -> Values:
            return q | dict(zip(steps, x.tolist(), strict=True))

        def gains(points: np.ndarray) -> np.ndarray:
            return self._each(block, [*map(at, points)])

        turns = self.turns + 2 * (len(steps) == 1)
        return at(polish(gains, [q[k] for k in steps], [*steps.values()], turns))

    def _contender(self, block: Block, *each: Values, cost: float = 0.0, **other: Any) -> Contender:
        """The contender of one effect, or of several of its kind at once."""
        made = [self._seen(block, [q]) for q in each]
        C, low, high = (np.concatenate(x, axis=-1) for x in zip(*made, strict=True))
        prior = Prior.free(C.shape[1], low=low, high=high)
        return Contender(block.name, each[0], block, C=C, prior=prior, cost=cost,
                         more=each[1:], **other)  # fmt: skip

    def again(self, c: Contender) -> Contender:
        """The same contender beside this base."""
        assert c.block is not None
        if c.C is None:
            return Contender(c.name, c.q, c.block, u=self.view.changed(c.block, c.q), cost=c.cost)
        return self._contender(c.block, *c.each, cost=c.cost)

    def _there(self, c: Contender) -> bool:
        """Whether it has joined the base already, at these values."""

        def place(one: Contender) -> tuple:
            own = one.block.own if one.block else {}
            hertz = [round(v, 1) for k, v in one.q.items() if own[k].unit == "Hz"]
            return one.name, *one.order, *hertz

        return place(c) in {place(one) for one in self.table.chosen}

    def _possible(self, c: Contender) -> bool:
        """The rest of a spring lies within reach of the travel."""
        known = linear(c.block) if c.block and c.C is not None else ()
        if len(known) < 2 or c.block is None or c.C is None or c.block.own[known[1]].angle:
            return True
        told = self.table.beside(c.C[:, 1:2]).any()  # else a constant of the base has it already
        return c.b[0] > 0 and not (told and abs(c.b[1] / c.b[0]) > 0.7 * self.span)

    # ---- by what is to be searched
    def _of_orders(self, block: Block, keys: Sequence[str]) -> Iterator[Contender]:
        """Waves over theta, all orders at once: what the rows leave of a wave passed at speed w."""
        if len(keys) > 1:
            return
        (key,), rows = keys, self.view.rows
        N = np.arange(1, const.ORDERS + 1.0)
        if self.linear:
            N = 2 * np.pi * np.arange(1, 2 * const.ORDERS) / (2 * self.span)
        whole = "J" in block.acts or N * self.span > 4  # no torque is alike over less of a wave
        N = N[whole & (N * rows.passed < 6)]
        if not self.linear and set(block.acts) == {"torque"}:
            N = N[N >= 2]  # a torque of order 1 is gravity
        if not len(N):
            return
        X = self._seen(block, [{key: n} for n in N], screening=True)[0]
        if not self.view.is_map:  # the middle of a row stands for its window
            X = X * np.repeat(self.view.seen_of(N), 2, axis=1)
        gains = self.table.gains_of_pairs(X)
        cost = float(np.log(len(N)))
        for i in np.argsort(gains)[::-1][: const.ORDER_WAYS.get(block.name, 1)]:
            q = {key: float(N[i])}
            if self.linear:
                step = 0.3 * (N[1] - N[0]) if len(N) > 1 else 0.1 * q[key]
                q = self._polished(block, q, {key: step})
            yield self._contender(block, q, cost=cost)
        if set(block.acts) == {"torque"} and not self.linear:
            yield from self._of_waves(block, key, N, gains, X)

    def _of_waves(
        self, block: Block, key: str, N: np.ndarray, gains: np.ndarray, X: np.ndarray
    ) -> Iterator[Contender]:
        """A ripple of several waves is one effect: each wave for what it still explains."""
        table, chosen = self.table, []
        pool = [i for i in np.argsort(gains)[::-1] if N[i] * self.span > 2 * np.pi][:32]
        W = {i: table.beside(X[:, 2 * i : 2 * i + 2]) for i in pool}
        left, least = table.rest_of_y.copy(), 2 * (const.SCREEN + np.log(len(N)))
        whole = float(np.sum((table.y * table.root) ** 2))
        while len(chosen) < const.FIRSTS:
            # waves over less than a turn imitate one another
            W = {i: w for i, w in W.items()
                 if all(abs(N[i] - N[j]) * self.span > 4 for j in chosen)}  # fmt: skip
            if not W:
                break
            fits = {i: w @ np.linalg.lstsq(w, left, rcond=None)[0] for i, w in W.items()}
            i = max(fits, key=lambda k: float(fits[k] @ fits[k]))
            power = float(fits[i] @ fits[i])
            if power / table.scale**2 < max(least, 0.01 * gains.max()):
                break
            if not chosen and power < const.MUCH * whole:
                return  # a series of small waves is any function of the angle
            chosen.append(i)
            q, _ = np.linalg.qr(W.pop(i))
            left = left - q @ (q.T @ left)
            W = {j: w - q @ (q.T @ w) for j, w in W.items()}
        if len(chosen) > 1:
            cost = len(chosen) * float(np.log(len(N)))
            yield self._contender(block, *({key: float(N[i])} for i in chosen), cost=cost)

    def _of_frequency(self, block: Block, key: str) -> Iterator[Contender]:
        """All frequencies by the Fourier transform of what the base leaves, over what the base
        leaves of each frequency. At one speed a wave over time is one over the angle."""
        v, table = self.view, self.table
        if v.motion.steady:
            return
        step, T = v.rows.step, v.motion.duration
        at = np.round(v.rows.t / step).astype(int)
        n = 1 << int(np.ceil(np.log2(2 * (at.max() + 1))))
        f = np.fft.rfftfreq(n, step)

        def spectrum(x: np.ndarray) -> np.ndarray:
            return np.abs(np.fft.rfft(np.bincount(at, x * table.root, minlength=n))) ** 2

        room = np.sum(table.root**2) - np.sum([spectrum(q) for q in table.Q.T], axis=0)
        # a wave of few periods is any course in time
        seen = (f > max(0.2, const.AGAIN / T)) & (f < min(60.0, 0.4 / step))
        if not seen.any():
            return
        power = spectrum(table.rest_of_y) / np.maximum(room, 1e-3 * room.max()) * seen
        q = {key: float(f[int(np.argmax(power))])}
        q = self._polished(block, q, {key: 0.15 / T}, power.max() / table.scale**2)
        if q[key] * T > const.AGAIN:
            yield self._contender(block, q, cost=float(np.log(seen.sum() / 2)))

    def _of_input(self, block: Block, keys: Sequence[str]) -> Iterator[Contender]:
        """The torque itself is another one: what fits the acceleration best, whatever J is."""
        grid = self._input_grid(block.own[keys[0]]) if len(keys) == 1 else None
        if grid is None:
            return
        key, table, v = keys[0], self.table, self.view
        on = table.fit.free.copy()
        on[0], on[1] = False, on[1] and not is_lateness(block)
        Q, _ = np.linalg.qr(table.X[:, on] * table.root[:, None])
        y = table.X[:, 0] * table.root
        y = y - Q @ (Q.T @ y)

        def gain(x: float) -> float:
            made = v.torque(v.changed(block, {key: x})) * table.root
            made = made - Q @ (Q.T @ made)
            return float((made @ y) ** 2 / (made @ made + TINY))

        i = int(np.argmax([gain(x) for x in grid]))
        best = golden(gain, grid[max(i - 1, 0)], grid[min(i + 1, len(grid) - 1)])
        q = {key: float(best)}
        yield Contender(block.name, q, block, u=v.changed(block, q), cost=float(np.log(8)))

    def _input_grid(self, p: P) -> np.ndarray | None:
        """Values of a delay, a limit, or a torque that is lost."""
        size = np.abs(self.view.u)
        if p.unit == "s":
            return np.r_[1e-6, const.FREE_LATE + np.geomspace(3e-4, 0.05, 15)]
        if p.unit != "N m":
            return None
        if p.neutral == np.inf:
            shares = 1.0 - np.r_[0.0, np.geomspace(1e-3, 0.7, 16)]
            return np.quantile(size, shares)
        return np.r_[0, np.geomspace(0.01, 0.6, 12) * np.quantile(size, 0.7)]

    def _of_spring(self, block: Block, keys: Sequence[str]) -> Iterator[Contender]:
        """A load behind a spring or a gap, driven by the measured motion. Where a gap lies depends
        little on the spring and on other effects: it is searched once, and only polished again."""
        many = 3 if "gap" in keys else 2
        again = block.name in self.memory
        tried = self._springs(block, keys)
        if not tried:
            return
        gains = self._loads(block, [self._load(keys, *one) for one in tried])
        best, slowest = tried[int(np.argmax(gains))], min(f for f, _, _ in tried)
        self.memory[block.name] = best if gains.max() >= 2 * const.SCREEN else None
        if gains.max() < 2 * const.SCREEN:
            return

        def around(points: np.ndarray) -> np.ndarray:
            p = np.exp(points)
            inside = (p[:, 0] > 0.8 * slowest) & (p[:, 0] < const.FASTEST) & (p[:, 1] <= 1)
            made = np.full(len(p), -1.0)
            if inside.any():
                made[inside] = self._each(block, [self._load(keys, *x) for x in p[inside].tolist()])
            return made

        steps = [0.08, 0.3, 0.2 if self.table.quick else 0.03]
        turns = 2 if again else self.turns
        x = polish(around, np.log(best[:many]).tolist(), steps[:many], turns)
        f, z, *gap = np.exp(x).tolist()
        if f < 0.84 * slowest or z > 0.95:
            return  # at the edge of what a resonance may be: J that falls with frequency
        self.memory[block.name] = (f, z, *gap) if gap else (f, z, 0.0)
        cost = np.log(len(tried) if many == 2 else 3 * const.GAPS)
        yield self._contender(block, self._load(keys, f, z, *gap), cost=float(cost))

    def _springs(self, block: Block, keys: Sequence[str]) -> list[tuple[float, float, float]]:
        """Frequencies (Hz), damping ratios and gaps (rad) to try."""
        if "gap" not in keys:
            fast = min(const.RINGING[1], 0.3 / self.view.motion.dt)
            rates = np.geomspace(const.RINGING[0], fast, 22).tolist()
            return [(f, z, 0.0) for f in rates for z in (0.03, 0.1, 0.3)]
        if block.name in self.memory:
            known = self.memory[block.name]
            near = (0.96, 1.0, 1.04) if known else ()
            return [(known[0], known[1], x * known[2]) for x in near]
        reach, count = min(self.span, 6.28), self.view.motion.count
        gaps = 2 * np.geomspace(max(count, 4e-4 * reach), 0.04 * reach, const.GAPS)
        at = int(np.argmax(self._loads(block, [self._load(keys, 80.0, 0.3, g) for g in gaps])))
        near = gaps[max(at - 1, 0) : at + 2].tolist()
        return [(f, 0.3, gap) for f in (45.0, 80.0, 140.0) for gap in near]

    def _load(self, keys: Sequence[str], f: float, z: float, gap: float = 0.0) -> Values:
        """Values of a load of 1 kg m2 with this frequency (Hz), damping ratio and gap (rad)."""
        omega = 2 * np.pi * f
        made = {"stiffness": omega**2, "damping": 2 * z * omega}
        return made | ({"gap": float(gap)} if "gap" in keys else {})

    def _loads(self, block: Block, sets: Sequence[Values]) -> np.ndarray:
        return self._gains(block, self._seen(block, sets)[0])

    def _of_any(self, block: Block, keys: Sequence[str]) -> Iterator[Contender]:
        """A grid of all values, the best of it polished."""
        own, many = block.own, (24, 9, 5, 3)[min(len(keys), 4) - 1]
        grids = [self._grid(block, own[k], many) for k in keys]
        sets = [dict(zip(keys, x, strict=True)) for x in product(*(g.tolist() for g in grids))]
        chosen = float(np.prod([len(own[k].choices) or 1 for k in keys]))
        cost = float(np.log(len(sets) / chosen))
        if self.view.is_map:  # few rows: each is entered, as the screening knows no bounds
            yield from (self._contender(block, q, cost=cost) for q in sets)
            return
        gains = self._gains(block, np.nan_to_num(self._seen(block, sets, screening=True)[0]))
        q = sets[int(np.argmax(gains))]
        steps = {k: 0.5 * float(np.gradient(g)[g == q[k]][0]) if len(g) > 1 else 0.1
                 for k, g in zip(keys, grids, strict=True) if not own[k].choices}  # fmt: skip
        yield self._contender(block, self._polished(block, q, steps, gains.max()), cost=cost)

    def _grid(self, block: Block, p: P, many: int) -> np.ndarray:
        """Values of any parameter, within its bounds."""
        m = self.view.motion
        # a width, no place; a memory may be as short as a row
        scales = {
            "rad": (0.01 * self.span, self.span),
            "rad/s": (0.003 * m.top, m.top),
            "s": (self.view.rows.h if block.states else 0.05 * m.duration, 3 * m.duration),
        }
        if p.choices:
            return np.array(p.choices)
        if p.grid is not None:
            grid = np.asarray(p.grid(m), float)
        elif p.passed:  # beyond it lies a minority of the samples
            shares, inner = np.linspace(0.003, 0.3, 20), self.span * np.linspace(0.02, 0.35, 15)
            ends = np.quantile(m.theta, np.r_[shares, 1.0 - shares])
            grid = np.r_[ends, m.theta.min() + inner, m.theta.max() - inner]
        elif p.instant:
            grid = m.t.min() + np.linspace(0.04, 0.96, 93) * m.duration
        elif p.low >= 0 and p.unit in scales:
            grid = np.geomspace(*scales[p.unit], many)
        elif p.unit == "rad":
            grid = np.quantile(m.theta, (np.arange(4 * many) + 0.5) / (4 * many))
        elif np.isfinite(p.low) and np.isfinite(p.high) and not 0 < 100 * p.low < p.high:
            grid = np.linspace(p.low, p.high, many)
        else:
            grid = (abs(p.value) or 1.0) * np.geomspace(1 / 30, 30, many)
            grid = grid if p.low >= 0 or p.value > 0 else np.r_[-grid[::-1], grid]
        return np.unique(np.clip(grid, p.low, p.high))

"""The intervals of the last fit.

Blocks are left out; laws that the log does not tell apart count by their likelihood; other
descriptions of the same drive, a stiffer and a softer motion in wider windows and the drive with an
alternative in place of a name, count by how far their values lie apart; and no sensor is better
than SCALE.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ..core.errors import Refused
from ..core.numeric import Z95, rms
from ..core.regression import left_out_covariance, memory_blocks, robust
from .constants import ALONG, BACKGROUND, GREASE, ONE_MORE, SCALE, VIEWS, WHOLE
from .friction import View
from .last_fit import KAPPA, LastFit, State, quantities
from .table import is_lateness
from .windows import Rows

FEWEST = 15  # blocks
SPEEDS = (0.35, 0.6, 1.0, 1.7, 3.0)  # Stribeck speeds that are tried, over the fitted one
EXPONENTS = (1.0, 2.0)  # of the Stribeck curve
STEP = 0.3  # standard deviations of a coefficient, for the slopes of what is reported
PART_OF_SAMPLE = 0.1  # standard deviation of a delay, in samples
CERTAIN = 0.5  # half-width over value up to which an inertia is given
WITHOUT_SCALE = ("phase", "harmonic", "side")

Value = tuple[float, float, float]


class Law(NamedTuple):
    """A friction law beside the fitted one."""

    likelihood: float  # less the price of its parameters
    b: np.ndarray
    vs: float
    exponent: float  # of the Stribeck curve
    grease: float  # exponent, 0: none


class Interval:
    """Covariance of what a last fit reports, and the friction laws beside its own."""

    def __init__(self, last: LastFit) -> None:
        self.last, self.names = last, tuple(last.values)

    @cached_property
    def blocks(self) -> list[np.ndarray]:
        fit, apart = self.last.fit, self.last.view.apart
        if apart is not None:
            return [apart]
        return memory_blocks(fit.r * fit.w**0.5, FEWEST)

    @cached_property
    def kappa(self) -> float:
        """Rows that tell as much as one that knows nothing of its neighbours."""
        memory = 4 if self.last.view.apart is None else 1  # blocks are so many memories long
        return max(KAPPA, len(self.last.fit.r) / (memory * (self.blocks[0][-1] + 1)))

    @property
    def likelihood(self) -> float:
        own = ONE_MORE * self.kappa if self.last.state.grease else 0.0
        return self.last.score(self.last.fit.r) - own

    @cached_property
    def laws(self) -> list[Law]:
        """Other Stribeck speeds and exponents, then with and without grease."""
        last, state = self.last, self.last.state
        v, d = last.view, last.design
        m, fine = v.motion, v.deflection(state.bristle(v))[0]
        shapes = [(min(share * v.vs, v.longest_fall), e) for share in SPEEDS for e in EXPONENTS]
        falls = [state.copy(vs=vs, exponent=e).fall(m.fine_w) for vs, e in shapes]
        dips = v.K @ m.coarse(np.column_stack([fine * fall for fall in falls]))
        dip, grease = d.names.index("dip"), d.names.index("grease")
        made, X = [], d.X.copy()

        def fit(j: int, exponent: float, turns: int = 2) -> None:
            X[:, dip] = dips[:, j]
            if exponent and exponent != state.grease:
                X[:, grease] = v.grease_rows(exponent)
            prior = d.prior.but(grease, high=np.inf if exponent else 0.0)
            f = robust(X, d.y, prior, last.scale, v.noise, last.fit.w, turns)
            price = ONE_MORE * self.kappa if exponent else 0.0
            made.append(Law(last.score(f.r) - price, f.b, *shapes[j], exponent))

        for j in range(len(shapes)):
            fit(j, state.grease)
        best = max(range(len(shapes)), key=lambda j: made[j].likelihood)
        if "sublinear_viscous" not in {t.name for t in state.terms}:
            for exponent in (0.0, *GREASE):
                if exponent != state.grease:
                    fit(best, exponent, 3)
        return made

    @cached_property
    def coefficients(self) -> np.ndarray:
        """Covariance (k, k) of the coefficients: blocks left out, and laws by likelihood."""
        last, d = self.last, self.last.design
        v, b = last.view, last.fit.b
        size = np.mean(d.X**2, axis=0) * len(d.y)
        at = {n: j for j, n in enumerate(d.names) if isinstance(n, str)}
        told = last.fit.free | np.isin(np.arange(len(b)), [at[k] for k in ("J", "Fc", "Fv")])
        precision = np.where(told, d.prior.precision, 1e9 * size / last.scale**2)
        if v.J_range and not v.sure:  # a declared J that is held is known that well
            precision[0] = 16 / max(float(np.ptp(v.J_range)), SCALE * v.J_range[1]) ** 2
        prior = d.prior.but(slice(None), precision=precision)
        noise = v.noise if last.fit.free[0] else 0.0  # it takes nothing from a J that is held
        V = left_out_covariance(d.X, d.y, last.fit, prior, last.scale, noise, self.blocks)
        laws = self.laws
        score = np.array([law.likelihood for law in laws] + [self.likelihood]) / self.kappa
        share = np.exp(score - score.max())
        share /= share.sum()
        apart = np.array([law.b for law in laws] + [b]) - b
        return WHOLE**2 * V + (share[:, None] * apart).T @ apart + np.diag(self._little**2)

    @cached_property
    def _little(self) -> np.ndarray:
        """Of each coefficient (k,), the standard deviation by what every drive has a little of: a
        torque of the same kind as what is named, friction of another warmth, and an inertia of
        another motor's constant."""
        last, d, b = self.last, self.last.design, self.last.fit.b
        at = {n: j for j, n in enumerate(d.names) if isinstance(n, str)}
        level = max(abs(float(b[at["Fc"]])), 0.1 * rms(d.y))
        share = np.zeros(len(b))
        share[
            [j for j, n in enumerate(d.names) if isinstance(n, tuple) and isinstance(n[1], int)]
        ] = 1
        share[[at["Fc"], at["Fv"], *([at["offset"]] if d.constant else [])]] = 1
        share[at["J"]] = ALONG * last.fit.free[at["J"]]
        return share * BACKGROUND * level / np.sqrt(np.mean(d.X**2, axis=0) + 1e-300)

    @property
    def of_constant(self) -> float:
        """The variance of J by what the motor's constant may differ over the angle."""
        return float(self._little[self.last.design.names.index("J")] ** 2)

    @cached_property
    def _slopes(self) -> np.ndarray:
        """Derivatives (values, k) of what is reported by the coefficients."""
        d, b = self.last.design, self.last.fit.b
        sd = np.sqrt(np.maximum(np.diag(self.coefficients), 0.0)) + 1e-300
        made = np.zeros((len(self.names), len(b)))
        for j in range(len(b)):
            step = np.zeros(len(b))
            step[j] = STEP * sd[j]
            up, down = quantities(d, b + step), quantities(d, b - step)
            made[:, j] = [wrapped(up[k] - down[k], k) / (2 * step[j]) for k in self.names]
        return made

    def covariance(self) -> np.ndarray:
        """Covariance (values, values) of ``names`` by this description of the log alone."""
        V = self._slopes @ self.coefficients @ self._slopes.T
        own = self.last.values
        for i, k in enumerate(self.names):
            if k.rpartition(".")[2].split("_")[0] not in WITHOUT_SCALE:
                V[i, i] += (SCALE * own[k]) ** 2
        for term in self.last.state.terms:  # no clock of two channels is better
            if is_lateness(term.block):
                i = self.names.index(f"{term.key}.{term.block.gain}")
                V[i, i] += (PART_OF_SAMPLE * self.last.view.motion.dt) ** 2
        return V

    def between(self, others: Sequence[Mapping[str, float]]) -> np.ndarray:
        """What other descriptions add to it, by how far (some of) the values are from these."""
        apart = [[wrapped(one.get(k, 0.0), k) for k in self.names] for one in others]
        A = np.array(apart).reshape(-1, len(self.names))
        return A.T @ A / max(len(others), 1)

    def values(self, V: np.ndarray | None = None) -> dict[str, Value]:
        """(value, low, high) of each; by this description alone where no covariance is given."""
        V = self.covariance() if V is None else V
        half = Z95 * np.sqrt(np.maximum(np.diag(V), 0.0))
        own = self.last.values
        return {k: (own[k], own[k] - h, own[k] + h)
                for k, h in zip(self.names, half.tolist(), strict=True)}  # fmt: skip


def tells(x: Value) -> bool:
    """Whether the interval of an inertia is narrow enough for it to be an answer."""
    return x[0] > 0 and x[2] - x[1] < 2 * CERTAIN * x[0]


def wrapped(x: float, key: str) -> float:
    """A difference of phases lies between -pi and pi."""
    is_phase = key.rpartition(".")[2].startswith("phase")
    return (x + np.pi) % (2 * np.pi) - np.pi if is_phase else x


def best_law(view: View, state: State, scale: float, straight: bool = False) -> LastFit:
    """The fit at its best friction law; ``straight``: without grease."""
    last = LastFit(view, state, scale)
    interval = Interval(last)
    laws = [law for law in interval.laws if not (straight and law.grease)]
    best = max(laws, key=lambda law: law.likelihood)
    if best.likelihood <= interval.likelihood + 1:
        return last
    moved = last.state.updated(last.design.names, best.b, view)
    moved = moved.copy(vs=best.vs, exponent=best.exponent, grease=best.grease)
    return LastFit(view, moved, scale, turns=2)


def apart(other: LastFit, last: LastFit) -> dict[str, float]:
    """How far the values of another fit are from those of the last one."""
    return {k: other.values[k] - x for k, x in last.values.items() if k in other.values}


def other_views(last: LastFit, widest: float = np.inf) -> list[dict[str, float]]:
    """How far the values are by other motions, in windows up to ``widest`` times as wide."""
    made, view = [], last.view
    for stiffer, wider in VIEWS:
        try:
            motion = view.motion.varied(stiffer)
            rows = Rows(motion, max(1.0, min(wider, widest)) * view.rows.h)
            other = view.by(motion, rows)
            other.settle_as(view)
            made.append(apart(LastFit(other, last.state.copy(), last.scale, turns=2), last))
        except (Refused, np.linalg.LinAlgError):
            continue
    return made

"""Load identification from prescribed motion: what a load behind a gap or a spring explains.

The load is driven by the measured motion, whatever the model predicts. So an impact that is
simulated a little early does not spoil what follows. Masses are accurate to some per cent;
stiffness and damping only roughly, as they suffer from the smoothing of the motion.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import OptimizeResult, differential_evolution, minimize

from ..blocks.parts import Part as Placed
from ..spec import Block
from .balance import Cells, cells, running
from .beside import beside
from .fit import Fitted
from .proof import off
from .score import alone_by_parts, orthonormal
from .slide import fitted_cells, friction_terms, sliding

SPANS = (0.02, 0.08)  # s over which impacts are averaged: short cells punish bad timing more
FEWEST = 60  # cells
LONGEST = 100_000  # samples of a log that are used, to limit the computing time
CROWD, ROUNDS, POLISH = 12, 40, 120  # population, generations, evaluations of the last step
STEP = 0.05  # size of the first simplex, in logarithms
ALIKE = 1e-6  # of the largest singular value: below, terms are the same
MOST, SOME = 0.85, 0.2  # of the missing power, explained in the fitted windows, elsewhere
STRENGTHS = ("kg m2", "N m/rad", "N m s/rad")


@dataclass(frozen=True)
class Driven:
    """All values with a load driven by the measured motion, and what it explains.

    ``share`` is the part of the power missing from the balance in the fitted windows that the load
    explains, ``elsewhere`` the same in the other cells.
    """

    values: dict[str, float]
    share: float
    elsewhere: float


def driven(found: Fitted, key: str) -> list[Driven]:
    """The effect at ``key`` with the values that explain most of the torque missing from the
    balance of a rigid drive, once for each length of the cells."""
    spans = [span for span in SPANS if np.sum(_cells(found, span)[1]) >= FEWEST]
    made = beside(lambda span: _Balance(found, key, span).best(), spans)
    return [one for one in made if one is not None]


def _cells(found: Fitted, span: float) -> tuple[Cells, np.ndarray]:
    """Sliding cells of the first part of the log, and which of them lie in fitted windows."""
    data = found.predictor.data
    at = cells(data, span)
    at = at.only(sliding(data, at) & (at.start + at.size <= LONGEST))
    return at, fitted_cells(found, at)


def strengths(block: Block) -> set[str]:
    """Parameters that together scale the torque of a load: mass, spring and damper."""
    return {k for k, p in block.own.items() if p.unit in STRENGTHS}


def convincing(loads: Sequence[Driven]) -> bool:
    """True if such a load explains nearly all, and some of it where nothing was fitted.

    The bounds were chosen from 17 drives without a load, sound or with other effects (share at most
    0.41), and 14 with one (at least 0.88).
    """
    share = max((d.share for d in loads), default=0.0)
    return share > MOST and max(d.elsewhere for d in loads) > SOME


class _Balance:
    """Torque balance of the sliding cells, with inertia and friction free."""

    def __init__(self, found: Fitted, key: str, span: float) -> None:
        predictor = found.predictor
        data, self.log = predictor.data, predictor.data.log.first(LONGEST)
        self.values, self.block, self.key = found.values, predictor.model.part(key).block, key
        self.at, self.fitted = _cells(found, span)
        net = predictor.torque(off(predictor.model, found.values, key))
        self.torque = self.at.mean(running(net))
        columns = [self.at.mean(running(data.log.a)), *friction_terms(found, data, self.at)]
        self.terms = np.column_stack([c for c in columns if np.any(c[self.fitted])])
        own = self.terms[self.fitted]
        self.basis = orthonormal((own / np.linalg.norm(own, axis=0)).T, ALIKE)
        self.missing = self._rest(self.torque[self.fitted])
        assert self.block.box is not None
        self.box = self.block.box(self.log, found.values)

    def best(self) -> Driven | None:
        """The best fit of the effect; None if its strength or J would not be positive."""
        bounds = list(zip(self.box.low[self.box.shape], self.box.high[self.box.shape], strict=True))
        wide = differential_evolution(
            self._left, bounds, maxiter=ROUNDS, popsize=CROWD, tol=0.0, polish=False, init="sobol",
            rng=np.random.default_rng(len(bounds)), updating="deferred", vectorized=True,
        )  # fmt: skip
        own = self._own(self._polished(wide).x)
        loaded = np.column_stack([self._loads([own])[0], self.terms])
        strength, J, *_ = _solved(loaded[self.fitted], self.torque[self.fitted])[0]
        if not (strength > 0.0 and J > 0.0):
            return None
        strong = strengths(self.block)
        scaled = {k: v * strength if k in strong else v for k, v in own.items()}
        values = self.values | {"J": float(J)} | {f"{self.key}.{k}": v for k, v in scaled.items()}
        load = strength * loaded[:, 0]
        share, elsewhere = (self._taken(load, which) for which in (self.fitted, ~self.fitted))
        return Driven(values, share, elsewhere)

    def _taken(self, load: np.ndarray, which: np.ndarray) -> float:
        """Share of the missing power that a load explains, inertia and friction free."""
        if np.sum(which) < FEWEST:
            return 0.0
        with_it, without = (
            _solved(self.terms[which], y[which])[1] for y in (self.torque - load, self.torque)
        )
        return 1.0 - float(with_it @ with_it / max(without @ without, 1e-300))

    def _polished(self, wide: OptimizeResult) -> OptimizeResult:
        simplex = wide.x + np.vstack([np.zeros(len(wide.x)), STEP * np.eye(len(wide.x))])
        options = {"maxfev": POLISH, "initial_simplex": simplex}
        return minimize(
            lambda x: self._left(x[:, None])[0], wide.x, method="Nelder-Mead", options=options
        )

    def _own(self, x: np.ndarray) -> dict[str, float]:
        whole = 0.5 * (self.box.low + self.box.high)
        whole[self.box.shape] = x
        given = self.box.at(whole)
        return {k: given[k] for k in self.block.own}

    def _left(self, crowd: np.ndarray) -> np.ndarray:
        """Missing power that remains with each column of the crowd (shape, sets), at its best
        strength."""
        loads = self._loads([self._own(x) for x in crowd.T])[:, self.fitted]
        loads = self._rest(loads)
        size = np.maximum(np.sum(loads * loads, axis=1), 1e-300)
        taken = np.maximum(loads @ self.missing, 0.0) ** 2 / size
        return np.nan_to_num(self.missing @ self.missing - taken, nan=np.inf)

    def _loads(self, sets: Sequence[dict[str, float]]) -> np.ndarray:
        """Torque of each set on the motor, (sets, cells)."""
        placed = Placed(f"{self.key}.", self.block)
        own = [placed.arguments({f"{self.key}.{k}": v for k, v in s.items()}) for s in sets]
        parts = alone_by_parts(self.block, self.log, own)
        return np.array([self.at.mean(running(one)) for part in parts for one in part])

    def _rest(self, series: np.ndarray) -> np.ndarray:
        return series - (series @ self.basis) @ self.basis.T


def _solved(terms: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Coefficients of the terms, and the residual."""
    size = np.maximum(np.linalg.norm(terms, axis=0), 1e-300)
    weights = np.linalg.lstsq(terms / size, y, rcond=ALIKE)[0] / size
    return weights, y - terms @ weights

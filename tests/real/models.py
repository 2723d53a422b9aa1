"""Models that are fitted to some runs and give the torque residual of others.

Each is a function of the training runs that returns a function of a run: residual (N,) in the
unit of u, over all samples.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from .along import residual
from .motion import Motion, Run
from .sets import Cut, Split

Residual = Callable[[Run], np.ndarray]
BUMP = 2 * np.pi * 5 / 60  # rad/s, width of the low-speed bump of the worm drive's fit by hand


LIFTED = 0.49 * 0.1**2, 0.49 * 9.81 * 0.1  # kg m2, N m: the pendulum of the hobby servo


def load(m: Motion) -> np.ndarray:
    """|torque of the lifted pendulum| sign(w), its inertia and weight as its README has them."""
    inertia, weight = LIFTED
    return np.abs(inertia * m.a + weight * np.sin(m.angle())) * np.sign(m.w)


COLUMNS: Mapping[str, Callable[[Motion], np.ndarray]] = {
    "a": lambda m: m.a,
    "w": lambda m: m.w,
    "w+": lambda m: np.maximum(m.w, 0.0),
    "w-": lambda m: np.minimum(m.w, 0.0),
    "sign": lambda m: np.sign(m.w),
    "1": lambda m: np.ones_like(m.w),
    "sin": lambda m: np.sin(m.angle()),
    "cos": lambda m: np.cos(m.angle()),
    "load": load,
    "bump+": lambda m: np.exp(-((m.w / BUMP) ** 2)) * (m.w > 0),
    "bump-": lambda m: np.exp(-((m.w / BUMP) ** 2)) * (m.w < 0),
}


@dataclass(frozen=True)
class StandIn:
    """The torque itself, where a diagnosis has no model."""

    def __call__(self, run: Run) -> np.ndarray:
        return run.motion.u


def hand(train: Sequence[Run], split: Split, cut: Cut) -> Residual:
    """Least squares on the columns of the README."""
    names, shift = split.columns, cut.shift
    b = _least_squares(train, names, shift)
    return lambda run: run.motion.late(shift) - _design(run.motion, names) @ b


def _design(m: Motion, names: Sequence[str]) -> np.ndarray:
    return np.column_stack([COLUMNS[name](m) for name in names])


def _least_squares(train: Sequence[Run], names: Sequence[str], shift: float) -> np.ndarray:
    X = np.concatenate([_design(r.motion, names)[r.motion.use] for r in train])
    y = np.concatenate([r.motion.late(shift)[r.motion.use] for r in train])
    size = np.sqrt(np.mean(X**2, axis=0))
    return np.linalg.lstsq(X / size, y, rcond=None)[0] / size


def trees(train: Sequence[Run], split: Split, cut: Cut) -> Residual:
    """Boosted trees over theta, w and a, on the residual of the diagnosis: no physics."""
    from sklearn.ensemble import HistGradientBoostingRegressor

    first = ours(train, split, cut)

    def features(m: Motion) -> np.ndarray:
        return np.column_stack([m.angle(), m.w, m.a])

    X = np.concatenate([features(r.motion)[r.motion.use] for r in train])
    y = np.concatenate([first(r)[r.motion.use] for r in train])
    forest = HistGradientBoostingRegressor(random_state=0).fit(X, y)
    return lambda run: first(run) - forest.predict(features(run.motion))


def ours(train: Sequence[Run], split: Split, cut: Cut) -> Residual:
    """The model of the package's diagnosis; the torque itself where there is none."""
    import lugrectl as lg

    runs = [run.log for run in train]
    result = lg.diagnose(runs if len(runs) > 1 else runs[0], dict(split.model))
    if result.map is not None:
        curve = result.map.curves["augmented"]
        return lambda run: run.motion.u - np.interp(run.motion.w, result.map.at, curve)
    if result.model is None or None in result.model.values().values():
        return StandIn()
    return lambda run: residual(result.model, run)


MODELS = {"ours": ours, "hand": hand, "trees": trees}

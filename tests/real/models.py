"""Models that are fitted to some runs and give the torque residual of others.

Each is a function of the training runs that returns a function of a run: residual (N,) in the
unit of u, over all samples.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from scipy.optimize import least_squares

from .along import balanced, residual
from .motion import Motion, Run
from .sets import Cut, Split

Residual = Callable[[Run], np.ndarray]
BUMP = 2 * np.pi * 5 / 60  # rad/s, width of the low-speed bump of the worm drive's fit by hand
COLUMNS: Mapping[str, Callable[[Motion], np.ndarray]] = {
    "a": lambda m: m.a,
    "w": lambda m: m.w,
    "w+": lambda m: np.maximum(m.w, 0.0),
    "w-": lambda m: np.minimum(m.w, 0.0),
    "sign": lambda m: np.sign(m.w),
    "1": lambda m: np.ones_like(m.w),
    "sin": lambda m: np.sin(m.angle()),
    "cos": lambda m: np.cos(m.angle()),
    "bump+": lambda m: np.exp(-((m.w / BUMP) ** 2)) * (m.w > 0),
    "bump-": lambda m: np.exp(-((m.w / BUMP) ** 2)) * (m.w < 0),
}


def plain(train: Sequence[Run], split: Split, cut: Cut) -> Residual:
    """The package's torque balance, with all its terms."""
    return balanced([run.log for run in train], split.model)


def hand(train: Sequence[Run], split: Split, cut: Cut) -> Residual:
    """Least squares on the columns of the README. "load" is |load| sign(w), the load being the
    inertia and weight of the fit itself."""
    linear = [name for name in split.columns if name != "load"]
    b = _least_squares(train, linear, cut.shift)
    if "load" not in split.columns:
        return lambda run: run.motion.late(cut.shift) - _design(run.motion, linear) @ b
    both = _with_load(train, linear, cut.shift, b)
    return lambda run: run.motion.late(cut.shift) - _loaded(run.motion, linear, both)


def _with_load(
    train: Sequence[Run], names: Sequence[str], shift: float, start: np.ndarray
) -> np.ndarray:
    """The coefficients and that of the load, by least squares; inertia and weight enter twice."""
    scale = np.abs(start) + 1e-9

    def missed(x: np.ndarray) -> np.ndarray:
        made = np.append(x[:-1] * scale, x[-1])
        parts = [
            (r.motion.late(shift) - _loaded(r.motion, names, made))[r.motion.use] for r in train
        ]
        return np.concatenate(parts)

    found = least_squares(missed, np.append(start / scale, 0.1)).x
    return np.append(found[:-1] * scale, found[-1])


def _loaded(m: Motion, names: Sequence[str], b: np.ndarray) -> np.ndarray:
    """The torque of the columns, and b[-1] |inertia and weight| sign(w)."""
    X = _design(m, names)
    load = X @ np.where(np.isin(names, ("a", "sin", "cos")), b[:-1], 0.0)
    return X @ b[:-1] + b[-1] * np.abs(load) * np.sign(m.w)


def _design(m: Motion, names: Sequence[str]) -> np.ndarray:
    return np.column_stack([COLUMNS[name](m) for name in names])


def _least_squares(train: Sequence[Run], names: Sequence[str], shift: float) -> np.ndarray:
    X = np.concatenate([_design(r.motion, names)[r.motion.use] for r in train])
    y = np.concatenate([r.motion.late(shift)[r.motion.use] for r in train])
    size = np.sqrt(np.mean(X**2, axis=0))
    return np.linalg.lstsq(X / size, y, rcond=None)[0] / size


def trees(train: Sequence[Run], split: Split, cut: Cut) -> Residual:
    """Boosted trees over theta, w and a, on the residual of the balance: no physics."""
    from sklearn.ensemble import HistGradientBoostingRegressor

    first = plain(train, split, cut)

    def features(m: Motion) -> np.ndarray:
        return np.column_stack([m.angle(), m.w, m.a])

    X = np.concatenate([features(r.motion)[r.motion.use] for r in train])
    y = np.concatenate([first(r)[r.motion.use] for r in train])
    forest = HistGradientBoostingRegressor(random_state=0).fit(X, y)
    return lambda run: first(run) - forest.predict(features(run.motion))


def ours(train: Sequence[Run], split: Split, cut: Cut) -> Residual:
    """The model of the package's diagnosis; that of the balance where there is none."""
    import lugrectl as lg

    runs = [run.log for run in train]
    result = lg.diagnose(runs if len(runs) > 1 else runs[0], dict(split.model))
    if result.map is not None:
        curve = result.map.curves["augmented"]
        return lambda run: run.motion.u - np.interp(run.motion.w, result.map.at, curve)
    if result.model is None or None in result.model.values().values():
        return plain(train, split, cut)
    return lambda run: residual(result.model, run)


MODELS = {"plain": plain, "hand": hand, "trees": trees, "ours": ours}

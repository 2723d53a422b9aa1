"""Log-likelihood of the innovations, the noise of dw/dt that maximises it, and sensitivities."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np

from ...engine.runtime.batch_run import Lanes
from ...engine.runtime.sensitivity_run import Moved, Tangent
from ..dataset.kalman import Noise
from ..dataset.windows import Windows
from .parameters import Coordinate
from .predictor import Predictor, Values

FOUR = (-1.5, -0.5, 0.5, 1.5)  # points of a grid, in steps
SHORT_LOOK = 0.5  # natural log units: steps of a grid that a cubic follows well enough
DIGITS = 6  # of such a logarithm
FARTHEST = 20.0  # the same: limit of the logarithm of the noise in rad/s2
LARGEST = 2_000_000  # counted samples in one call
WORST = 1e100  # innovation of a model that diverges; its square can still be added up
RTOL = 1e-5  # of the run along which the derivatives are taken
STEEPEST = 1e100  # derivative of a model that diverges; its square can still be added up


def whitened(
    predictor: Predictor,
    sets: Sequence[Values],
    where: Windows,
    noise: Noise | Sequence[Noise],
) -> np.ndarray:
    """Innovations scaled to unit covariance for a correct model, (sets, windows, length, 2).

    Repeated encoder counts are down-weighted.
    """
    y, _ = predictor.run(sets, where, noise)
    e = compared(predictor.data.y[where.counted], y)
    root = np.sqrt(predictor.data.weight[where.counted])
    noises = [noise] * len(sets) if isinstance(noise, Noise) else noise
    for i, (q, values) in enumerate(zip(noises, sets, strict=True)):
        _, S = predictor.filter(q, values)
        e[i] = e[i] @ np.linalg.inv(np.linalg.cholesky(S)).T * root
    return e


def compared(recorded: np.ndarray, predicted: np.ndarray) -> np.ndarray:
    """Recorded minus predicted values: 0 where nothing was recorded, ``WORST`` if the prediction
    is not a number."""
    e = np.clip(np.nan_to_num(recorded - predicted, nan=WORST), -WORST, WORST)
    e[..., np.isnan(recorded)] = 0.0
    return e


def loglik(
    predictor: Predictor, white: np.ndarray, noise: Noise, values: Values, where: Windows
) -> np.ndarray:
    """Gaussian log-likelihood of each window.

    Repeated encoder counts are down-weighted: they are not independent samples, and predicting
    them at rest is no merit of a model.
    """
    _, S = predictor.filter(noise, values)
    size = np.sum(white**2, axis=(1, 2))
    new = np.sum(predictor.data.weight[where.counted], axis=1)
    return -0.5 * size - new @ np.log(np.diag(np.linalg.cholesky(S)))


def tune(
    predictor: Predictor,
    values: Values,
    where: Windows,
    noise: Noise,
    *,
    width: float = 2.0,
) -> tuple[Noise, np.ndarray]:
    """The noise of dw/dt that maximises the likelihood, and the log-likelihood of each window.

    ``width`` is the half-width of the first grid of four points, in natural log units. The result
    is the peak of a cubic through four points at most half a unit apart.
    """
    seen: dict[float, np.ndarray] = {}

    def look(points: Sequence[float]) -> float:
        """The best of these points; the results are kept in ``seen``."""
        points = [round(x, DIGITS) for x in points]
        new = [x for x in points if x not in seen]
        noises = [replace(noise, jump=float(np.exp(x))) for x in new]
        white = whitened(predictor, [values] * len(noises), where, noises) if new else []
        for x, w, q in zip(new, white, noises, strict=True):
            seen[x] = np.nan_to_num(loglik(predictor, w, q, values, where), nan=-1e300)
        return max(points, key=lambda x: seen[x].sum())

    middle, step = float(np.log(noise.jump)), 2.0 * width / 3.0
    while True:
        best = look([middle + step * k for k in FOUR])
        aside = 2 * round(0.5 * (best - middle) / step)
        if aside and abs(middle) < FARTHEST:
            middle += aside * step
        elif step > SHORT_LOOK:
            middle, step = _peak(seen, middle, step), 0.2 * step
        else:
            break
    look([_peak(seen, middle, step)])
    best = max(seen, key=lambda x: seen[x].sum())
    return replace(noise, jump=float(np.exp(best))), seen[best]


def _peak(seen: Mapping[float, np.ndarray], middle: float, step: float) -> float:
    """Where the cubic through the four points around ``middle`` is highest between them."""
    around = sorted(seen, key=lambda x: abs(x - middle))[: len(FOUR)]
    y = np.array([seen[x].sum() for x in around])
    cubic = np.polyfit((np.array(around) - middle) / step, y - y.max(), 3)
    fine = np.linspace(FOUR[0], FOUR[-1], 301)
    return middle + step * float(fine[np.argmax(np.polyval(cubic, fine))])


def whitened_by_parts(
    predictor: Predictor, sets: Sequence[Values], where: Windows, noise: Noise
) -> np.ndarray:
    """Whitened innovations, in calls that limit the memory."""
    most = max(1, LARGEST // max(1, where.counted.size, len(predictor.data.t) // 2))
    parts = [sets[i : i + most] for i in range(0, len(sets), most)]
    return np.concatenate([whitened(predictor, part, where, noise) for part in parts])


def slopes(
    predictor: Predictor,
    values: Values,
    coords: Sequence[Coordinate],
    where: Windows,
    noise: Noise,
    *,
    graph: bool = True,
) -> tuple[np.ndarray, np.ndarray]:
    """Whitened innovations r and -dr/dx for each coordinate x, (coords, windows, length, 2).

    Derivatives of the plant come from the graph, in one run. Inputs from effects outside the
    plant and initial states are known without a run: their finite differences pass through the
    plant's derivatives. Coordinates on which the Kalman gain depends (sensors with states inside
    the plant) are stepped, each in its own run; all are if there is no compiler or not ``graph``.
    """
    sets = stepped(coords, values)
    graph = graph and predictor.lanes.compiled
    gained = _in_gain(predictor)
    known = [i for i, c in enumerate(coords) if graph and c.key not in gained]
    rest = [i for i in range(len(coords)) if i not in known]
    A = np.empty((len(coords), *where.counted.shape, 2))
    with np.errstate(over="ignore", invalid="ignore"):
        if rest or not known:
            white = whitened(predictor, [values, *(sets[i] for i in rest)], where, noise)
            r = white[0]
            for i, w in zip(rest, white[1:], strict=True):
                A[i] = (r - w) / coords[i].step
        if known:
            few = [coords[i] for i in known], [sets[i] for i in known]
            r, A[known] = _from_graph(predictor, values, *few, where, noise)
    return r, np.clip(np.nan_to_num(A, posinf=0.0, neginf=0.0), -STEEPEST, STEEPEST)


def stepped(coords: Sequence[Coordinate], values: Values) -> list[dict[str, float]]:
    """All values with one coordinate stepped, for each coordinate."""
    sets = []
    for c in coords:
        moved = dict(values)
        moved[c.key] = c.ahead(values)
        if c.key == "Fc":  # Fs moves along if its coordinate is its excess over Fc
            moved |= {q.key: q.back(q.into(values), moved) for q in coords if q.kind == "excess"}
        sets.append(moved)
    return sets


def _in_gain(predictor: Predictor) -> set[str]:
    parts = [p for p in predictor.core.effects if "sensor" in p.block.acts and p.block.states]
    return {f"{p.key}.{k}" for p in parts for k in p.block.own}


@lru_cache(maxsize=8)
def _tangent(lanes: Lanes) -> Tangent:
    return Tangent(lanes)


def _from_graph(
    predictor: Predictor,
    values: Values,
    coords: Sequence[Coordinate],
    sets: Sequence[Values],
    where: Windows,
    noise: Noise,
) -> tuple[np.ndarray, np.ndarray]:
    """Innovations and slopes; first by key, then by coordinate, as Fs moves with Fc."""
    along, step = _chain(values, coords, sets)
    alone = [values, *({**values, c.key: s[c.key]} for c, s in zip(coords, sets, strict=True))]
    lanes, data, length = predictor.lanes, predictor.data, where.burn + where.length
    names = dict(zip(predictor.keys, lanes.parameters, strict=True))
    columns = [names.get(c.key, c.key) for c in coords]
    rows = where.start[:, None] + np.arange(length)
    series, du, error, derror = _fed(predictor, alone, step, columns)
    x0 = predictor.initial(alone, where)
    y = data.y - error
    gain, S = predictor.filter(noise, values)
    made = _tangent(lanes).run(
        x0[0],
        where.start,
        length,
        series,
        np.tile([values[k] for k in predictor.keys], (len(x0[0]), 1)),
        columns,
        dt=data.dt,
        substeps=predictor.substeps,
        t0=data.t[where.start] - where.start * data.dt,
        y=y,
        gain=gain,
        rounding=data.rounding,
        rtol=RTOL,
        floor=predictor.floor,
        dx0=np.moveaxis(x0[1:] - x0[0], 0, -1) / step,
        du=du,
        dseen=None if derror is None else -derror[rows],
    )
    slope = made.dy if derror is None else made.dy + derror[rows]
    known = np.isfinite(y[rows]) & np.isfinite(made.y)
    slope = np.where(known[..., None], slope, 0.0)[:, where.burn :]
    e = compared(y[rows], made.y)[:, where.burn :]
    W, root = np.linalg.inv(np.linalg.cholesky(S)), np.sqrt(data.weight[where.counted])
    return e @ W.T * root, root * np.einsum("ck,ij,wljk->cwli", along, W, slope, optimize=True)


def _chain(
    values: Values, coords: Sequence[Coordinate], sets: Sequence[Values]
) -> tuple[np.ndarray, np.ndarray]:
    """Derivatives of keys (columns) by coordinates (rows), and the step of each key."""
    ahead = np.array([[s[c.key] - values[c.key] for c in coords] for s in sets])
    turns = [i for i, c in enumerate(coords) if c.kind == "angle"]  # a step may cross half a turn
    ahead[turns, turns] = [coords[i].step for i in turns]
    step = ahead.diagonal()
    return ahead / [[c.step] for c in coords], np.where(step == 0.0, np.inf, step)


def _fed(
    predictor: Predictor, alone: Sequence[Values], step: np.ndarray, columns: Sequence[str]
) -> tuple[np.ndarray, Moved, np.ndarray | float, np.ndarray | None]:
    """Input series of the plant, their slopes, the sensor error and its slopes (N, 2, keys)."""
    every, errors, index = predictor.distinct(alone)
    series, du = every[index[0]], {}
    for column, k, h in zip(columns, index[1:], step, strict=True):
        if k == index[0]:  # the step does not change the inputs
            continue
        for i, name in enumerate(predictor.lanes.inputs):
            slope = (every[k, :, i] - series[:, i]) / h
            if np.any(slope):
                du[name, column] = slope[None]
    error = [e for e in errors if e is not None]
    if not error:
        return series, du, 0.0, None
    slopes = [(error[k] - error[index[0]]) / h for k, h in zip(index[1:], step, strict=True)]
    return series, du, error[index[0]], np.stack(slopes, axis=-1)

"""Sensitivities of the innovations to the free values: from the graph, else by differences."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from ...engine.runtime.batch_run import Lanes
from ...engine.runtime.sensitivity_run import Moved, Tangent
from ..dataset.sensor_noise import Noise
from ..dataset.windows import Windows
from .likelihood import compared, whitened
from .parameters import Coordinate
from .predictor import Predictor, Values

RTOL = 1e-5  # of the run along which the derivatives are taken
STEEPEST = 1e100  # derivative of a model that diverges; its square can still be added up


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

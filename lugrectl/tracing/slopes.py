"""How the innovations change with the free values: from the graph, differences where it ends."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from weakref import WeakSet

import numpy as np

from ..engine.lanes import Lanes
from ..engine.tangent import Moved, Tangent
from .coordinates import Coordinate
from .likelihood import compared, whitened
from .noise import Noise
from .predictor import Predictor, Values
from .windows import Windows

RTOL = 1e-5  # of the run along which the derivatives are taken
STEEPEST = 1e100  # derivative, where a model runs away; its square can still be added up


def slopes(
    predictor: Predictor,
    values: Values,
    coords: Sequence[Coordinate],
    where: Windows,
    noise: Noise,
    *,
    graph: bool = True,
) -> tuple[np.ndarray, np.ndarray]:
    """Whitened innovations r and -dr/dx by each coordinate x, (coords, windows, length, 2).

    The plant's derivatives are those of the graph, along one run. What effects outside of it
    feed in, and where the windows start, is known without a run, so it is differenced and goes
    through the plant's derivatives as well. Coordinates on which the gain depends (sensors with
    states inside the plant) are stepped, each with a run of its own; without a compiler or
    ``graph`` all are.
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
    """All values with each of the coordinates a step on."""
    sets = []
    for c in coords:
        moved = dict(values)
        moved[c.key] = c.back(c.into(values) + c.step, values)
        if c.key == "Fc":  # Fs follows where it is stepped by its excess
            moved |= {q.key: q.back(q.into(values), moved) for q in coords if q.kind == "excess"}
        sets.append(moved)
    return sets


def _in_gain(predictor: Predictor) -> set[str]:
    parts = [p for p in predictor.core.effects if "sensor" in p.block.acts and p.block.states]
    return {f"{p.key}.{k}" for p in parts for k in p.block.own}


_COMPILED: WeakSet[Lanes] = WeakSet()


@lru_cache(maxsize=8)
def _tangent(lanes: Lanes) -> Tangent:
    _COMPILED.add(lanes)
    return Tangent(lanes)


def is_compiled(predictor: Predictor) -> bool:
    """Whether the plant's derivatives are there already."""
    return predictor.lanes in _COMPILED


def _from_graph(
    predictor: Predictor,
    values: Values,
    coords: Sequence[Coordinate],
    sets: Sequence[Values],
    where: Windows,
    noise: Noise,
) -> tuple[np.ndarray, np.ndarray]:
    """Innovations and slopes by each key alone, then along the coordinates: Fs moves with Fc."""
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
        rtol=RTOL,
        floor=predictor.floor,
        dx0=np.moveaxis(x0[1:] - x0[0], 0, -1) / step,
        du=du,
        dseen=None if derror is None else -derror[rows],
    )
    slope = made.dy if derror is None else made.dy + derror[rows]
    told = np.isfinite(y[rows]) & np.isfinite(made.y)
    slope = np.where(told[..., None], slope, 0.0)[:, where.burn :]
    e = compared(y[rows], made.y)[:, where.burn :]
    W, root = np.linalg.inv(np.linalg.cholesky(S)), np.sqrt(data.weight[where.counted])
    return e @ W.T * root, root * np.einsum("ck,ij,wljk->cwli", along, W, slope, optimize=True)


def _chain(
    values: Values, coords: Sequence[Coordinate], sets: Sequence[Values]
) -> tuple[np.ndarray, np.ndarray]:
    """Derivatives of keys (columns) by coordinates (rows), and how far each key is stepped."""
    ahead = np.array([[s[c.key] - values[c.key] for c in coords] for s in sets])
    turns = [i for i, c in enumerate(coords) if c.kind == "angle"]  # may pass half a turn
    ahead[turns, turns] = [coords[i].step for i in turns]
    step = ahead.diagonal()
    return ahead / [[c.step] for c in coords], np.where(step == 0.0, np.inf, step)


def _fed(
    predictor: Predictor, alone: Sequence[Values], step: np.ndarray, columns: Sequence[str]
) -> tuple[np.ndarray, Moved, np.ndarray | float, np.ndarray | None]:
    """Series fed into the plant, their slopes, the sensors' error and its slopes (N, 2, keys)."""
    every, errors, index = predictor.distinct(alone)
    series, du = every[index[0]], {}
    for column, k, h in zip(columns, index[1:], step, strict=True):
        if k == index[0]:  # fed as without the step
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

"""Candidate screening: the gain of each effect by a score test, and its first estimates."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from scipy.optimize import least_squares

from ..spec import Block, P, members
from .beside import beside
from .coordinates import typical
from .data import Log, thinned
from .evaluate import missing_torque
from .fit import Fitted, tuned
from .predictor import Predictor
from .score import Score, orthonormal, whitened_by_parts
from .series import resisting
from .tries import tried
from .windows import coarser, spread

ENOUGH = 40_000  # counted samples that the search uses
MANY_WINDOWS = 24
COARSE = 2e-3  # s, longest sampling interval used in the search
FEW = 4  # grid points that are all tested exactly
STEPS = 30.0  # size of a test step, in typical steps
KEPT = 4  # points of a longer grid kept after a comparison with the residual torque
NEARLY = 0.6  # of the best point's promise, from which the next one is also a start
SHORT = 0.7  # of the distance to a bound, to which a linear step is limited
ZOOMS = 2  # finer grids around the best point


@dataclass(frozen=True)
class Trial:
    """An effect added to a fitted model, with a first estimate of its values.

    ``promise`` is the expected gain in log-likelihood; ``others`` are more initial values.
    """

    name: str
    fitted: Fitted
    key: str
    values: dict[str, float]
    promise: float
    others: tuple[dict[str, float], ...] = ()

    @property
    def boxed(self) -> bool:
        """True if its likelihood has so many local maxima that a global search is used."""
        return members("effect")[self.name].box is not None

    @property
    def rough(self) -> bool:
        """True if its series is an approximation.

        It is computed from the measured motion, or the effects found already would scale what it
        adds to a level.
        """
        block = members("effect")[self.name]
        hidden = bool(block.states) and block.exact is None
        added = {a[1:] for a in block.acts if a.startswith("+")}
        scaled = any(added & set(p.block.acts) for p in self.fitted.predictor.core.effects)
        return hidden or block.abrupt or "sensor" in block.acts or scaled


def lightened(base: Fitted) -> Fitted:
    """The base model on as few samples as are needed to distinguish effects."""
    data = base.predictor.data
    every = max(1, int(COARSE / data.dt + 1e-9))
    where = base.where if every == 1 else coarser(base.where, data.runs, every)
    where = spread(where, ENOUGH, MANY_WINDOWS)
    if every == 1 and where is base.where:
        return base
    predictor = base.predictor.on(thinned(data, every)) if every > 1 else base.predictor
    return tuned(replace(base, predictor=predictor, where=where))


def screen(score: Score, names: Sequence[str]) -> list[Trial]:
    """First estimates of each effect, best promise first.

    The promise is the gain in log-likelihood by the score test, with the parameters of the base
    model as nuisance parameters.
    """
    trials = beside(lambda name: _screen_one(score, name), names)
    return sorted((t for t in trials if t), key=lambda trial: -trial.promise)


def placed_at(score: Score, name: str, order: float) -> Trial | None:
    """The first estimate of an effect with ``order`` periods per 2 pi of theta."""
    return _screen_one(score, name, [order])


def _screen_one(score: Score, name: str, places: Sequence[float] | None = None) -> Trial | None:
    base, made = score.base, members("effect")[name]
    model = base.predictor.model.with_effect(name, _open(made))
    predictor, key = base.predictor.like(model), model.effects[-1].key
    if made.tries:
        found = tried(base, made, predictor, key, score)
    else:
        found = _linear(made, predictor, key, score, places)
    if not found:
        return None
    (promise, values), *others = found
    trial = replace(base, predictor=predictor)
    return Trial(name, trial, key, values, promise, tuple(v for _, v in others))


def _open(made: Block) -> dict[str, float]:
    return {k: p.value for k, p in made.own.items()}


def _linear(
    made: Block,
    predictor: Predictor,
    key: str,
    score: Score,
    places: Sequence[float] | None,
) -> list[tuple[float, dict[str, float]]]:
    """A linear step from the neutral value, on a grid of the parameter that is not linear, or at
    given ``places`` of it.

    A second estimate is added if another grid point promises nearly as much.
    """
    base = score.base
    spans, points = _spans(made), _grid(base, made, places)
    step = STEPS * typical(made.parameters[made.gain], predictor.data.log)

    def score_of(tried: Sequence[dict[str, float]]) -> list[tuple[float, np.ndarray, dict]]:
        sets = [
            base.values | opened(key, made, {made.gain: step, **point, **span})
            for point in tried
            for span in spans
        ]
        white = whitened_by_parts(predictor, sets, base)
        columns = ((score.white - white) / step).reshape(len(tried), len(spans), -1)
        return [(*score.gain(c), point) for c, point in zip(columns, tried, strict=True)]

    found = sorted(score_of(points), key=lambda one: -one[0])
    best, second = found[0], found[1:2]
    if places is None and _continuous(base, made):
        name, grid = _gridded(made)
        closer, p = grid(base.predictor.data.log), made.parameters[name]
        for _ in range(ZOOMS):
            closer = np.clip(_closer(closer, best[2][name]), p.low, p.high)
            more = score_of([{name: float(v)} for v in closer])
            best = max([best, *more], key=lambda one: one[0])
    near = [one for one in second if one[0] > NEARLY * best[0]]
    made_of = [(gain, _combine(base, made, point, spans, c)) for gain, c, point in [best, *near]]
    return [(gain, base.values | opened(key, made, v)) for gain, v in made_of if v is not None]


def _closer(points: np.ndarray, at: float) -> np.ndarray:
    """A finer grid between the neighbours of the best point."""
    known = np.unique(np.append(points, at))
    i = int(np.searchsorted(known, at))
    gaps = np.diff(known)
    below, above = gaps[max(i - 1, 0)], gaps[min(i, len(gaps) - 1)]
    finer = [at - below * np.linspace(0.9, 0.1, 5), at + above * np.linspace(0.1, 0.9, 5)]
    return np.concatenate(finer)


def opened(key: str, made: Block, given: Mapping[str, float]) -> dict[str, float]:
    """An effect's values in the model; declared values for those that are not given."""
    return {f"{key}.{k}": given.get(k, p.value) for k, p in made.own.items()}


def _continuous(base: Fitted, made: Block) -> bool:
    rotary = base.predictor.model.motion == "rotary"
    return any(p.grid and not (p.whole and rotary) for p in made.parameters.values())


def _spans(made: Block) -> list[dict[str, float]]:
    named = [(k, p.span) for k, p in made.parameters.items() if p.span]
    return [
        dict(zip([k for k, _ in named], pick, strict=True))
        for pick in product(*[span for _, span in named])
    ]


def _gridded(made: Block) -> tuple[str, Callable]:
    """The parameter that is tested on a grid, and the grid."""
    return next((k, p.grid) for k, p in made.parameters.items() if p.grid is not None)


def _grid(base: Fitted, made: Block, places: Sequence[float] | None) -> list[dict[str, float]]:
    if not any(p.grid for p in made.parameters.values()):
        return [{}]
    name, grid = _gridded(made)
    tried = grid(base.predictor.data.log) if places is None else places
    points = [{name: float(v)} for v in tried]
    return points if len(points) <= FEW else _prescreened(base, made, points)


def _prescreened(base: Fitted, made: Block, points: list[dict]) -> list[dict[str, float]]:
    """The points whose effect resembles the residual torque most, best first.

    What the plant's own parameters can explain does not count. Single precision is enough to
    compare points, and a sine takes a thirtieth of the time in it.
    """
    index, target = (
        base.where.counted.ravel(),
        missing_torque(base.predictor, base.values, base.where, base.noise).ravel(),
    )
    every = max(1, int(0.002 / base.predictor.data.dt))
    index, target = index[::every], target[::every] - target.mean()
    few, weights = _thinned(base, index)
    basis = orthonormal(np.array(list(weights.values())))
    target = target - basis @ (basis.T @ target)
    (name, *_), spans = points[0], _spans(made)
    places = np.array([point[name] for point in points], dtype=np.float32)
    few, (target, basis) = _single(few), (x.astype(np.float32) for x in (target, basis))
    weights = {k: v.astype(np.float32) for k, v in weights.items()}
    power = [
        _resemblance(made, few, weights, name, part, spans, target, basis)
        for part in np.array_split(places, -(-len(places) // 32))
    ]
    tops = _peaks(np.concatenate(power))[:KEPT].tolist()
    around = [i for i in (tops[0] - 1, tops[0] + 1) if 0 <= i < len(points)]
    return [points[i] for i in dict.fromkeys([*tops, *around])]


def _resemblance(
    made: Block,
    log: Log,
    weights: dict,
    name: str,
    tried: np.ndarray,
    spans: list[dict],
    target: np.ndarray,
    basis: np.ndarray,
) -> np.ndarray:
    """Power of the target that the effect explains at each value of one parameter.

    The torques of the ``basis`` are projected out of both.
    """
    unit = made.defaults() | {made.gain: 1.0, name: tried[:, None]}
    B = np.stack([resisting(made, log, unit | span, weights) for span in spans], axis=1)
    own = B @ basis
    H, g = B @ B.transpose(0, 2, 1) - own @ own.transpose(0, 2, 1), B @ target
    H, g = H.astype(float), g.astype(float)
    ridge = 1e-6 * np.trace(H, axis1=1, axis2=2) + 1e-300
    H = H + ridge[:, None, None] * np.eye(len(spans))
    return np.sum(g * np.linalg.solve(H, g[..., None])[..., 0], axis=1)


def _thinned(base: Fitted, index: np.ndarray) -> tuple[Log, dict[str, np.ndarray]]:
    """Some samples of the log, and of the torque weights of levels along it."""
    log, weights = base.predictor.data.log, base.predictor.weights(base.values)
    signals = {k: signal[index] for k, signal in log.signals.items()}
    return replace(log, **signals), {k: v[index] for k, v in weights.items()}


def _single(log: Log) -> Log:
    return replace(log, **{k: signal.astype(np.float32) for k, signal in log.signals.items()})


def _peaks(power: np.ndarray) -> np.ndarray:
    """Indices of the local maxima, highest first."""
    padded = np.pad(power, 1, constant_values=-np.inf)
    tops = np.flatnonzero((power >= padded[:-2]) & (power >= padded[2:]))
    return tops[np.argsort(-power[tops])]


def _combine(
    base: Fitted, made: Block, point: dict, spans: list[dict], c: np.ndarray
) -> dict[str, float] | None:
    """The values of one effect that equals the combination found; None if out of bounds."""
    strength, *own = c if len(spans) == 1 else _alone(base, made, point, spans, c)
    within = _within(made.parameters[made.gain], float(strength))
    names = list(spans[0])
    found = dict(zip(names, map(float, own), strict=True))
    return None if within is None else {made.gain: within, **found, **point}


def _alone(base: Fitted, made: Block, point: dict, spans: list[dict], c: np.ndarray) -> np.ndarray:
    """Gain and span parameters of the single effect that equals a combination of several; nan
    if there is none."""
    gain = made.parameters[made.gain]
    samples = len(base.predictor.data.log.t)
    few, weights = _thinned(base, np.unique(np.linspace(0, samples - 1, 2000).astype(int)))
    known = made.defaults() | point
    target = sum(
        ci * resisting(made, few, known | {made.gain: 1.0} | span, weights)
        for ci, span in zip(c, spans, strict=True)
    )
    names = list(spans[0])
    size = max(float(np.std(target)), 1e-12)

    def miss(x: np.ndarray) -> np.ndarray:
        own = dict(zip([made.gain, *names], x, strict=True))
        return (resisting(made, few, known | own, weights) - target) / size

    starts = [[float(np.abs(c).sum()), *span.values()] for span in spans]
    starts += [[float(np.abs(c).sum()), *(-v for v in span.values())] for span in spans]
    fits = [least_squares(miss, x0) for x0 in starts]
    fits = [f for f in fits if _within(gain, f.x[0]) is not None and f.cost < 1e-3 * len(few.t)]
    return min(fits, key=lambda f: f.cost).x if fits else np.full(1 + len(names), np.nan)


def _within(gain: P, strength: float) -> float | None:
    """Strength found by a linear step, limited to below the bound, which a large effect exceeds.

    None if it is not a number, or on the wrong side of the neutral value.
    """
    if np.isnan(strength):
        return None
    bound = gain.low if strength < gain.low else gain.high if strength > gain.high else None
    if bound is None:
        return strength
    none = gain.neutral or 0.0
    far = bound - none
    return none + SHORT * far if far and np.isfinite(far) else None

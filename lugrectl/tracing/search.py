"""Which effect of the catalogue would explain what the model fails to predict."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from scipy.optimize import least_squares

from ..spec import Block, members
from .data import Log
from .evaluate import missing_torque
from .fit import Fitted, fit, free_keys, tune, typical, whitened
from .predictor import Predictor, along

FEW = 40  # grid points that are all tried exactly
KEPT = 6  # of a longer grid, after a look at the residual torque
ZOOMS = 2  # finer grids around the best point
HOPELESS = 0.1  # of the leader's gain after a short fit, below which a candidate is dropped
LARGEST = 2_000_000  # counted samples in one engine call

Say = Callable[[str], None]


@dataclass(frozen=True)
class Trial:
    """An effect added to a fitted model: a first estimate, and how much it should gain."""

    name: str
    fitted: Fitted
    key: str
    values: dict[str, float]
    promise: float


@dataclass(frozen=True)
class Contest:
    """All effects by promise, and those that were fitted, best first."""

    trials: list[Trial]
    fits: list[tuple[Trial, Fitted]]


def screen(base: Fitted, names: Sequence[str]) -> list[Trial]:
    """First estimates of each effect, best promise first.

    The promise is the score test's gain in log-likelihood, with the parameters of the base
    model free to follow.
    """
    score = _Score(base)
    trials = [trial for name in names if (trial := _screen_one(base, name, score))]
    return sorted(trials, key=lambda trial: -trial.promise)


class _Score:
    """Gain in log-likelihood from small changes, the base model's own directions taken out."""

    def __init__(self, base: Fitted) -> None:
        self.base = base
        sets = [base.values]
        for c in base.free:
            moved = dict(base.values)
            moved[c.key] = c.back(c.into(base.values) + c.step, base.values)
            sets.append(moved)
        white = whitened(base.predictor, sets, base.where, base.noise)
        A = (white[0] - white[1:]).reshape(len(base.free), -1)
        size = np.linalg.norm(A, axis=1)
        A = A[size > 0] / size[size > 0, None]
        U, s, _ = np.linalg.svd(A.T, full_matrices=False)
        self.basis = U[:, s > 1e-8 * s[0]] if len(s) else U
        self.r = white[0].ravel()
        self.white = white[0]

    def gain(self, columns: np.ndarray) -> tuple[float, np.ndarray]:
        """Gain and coefficients for directions (k, n), each an innovation change per unit."""
        B = columns - (columns @ self.basis) @ self.basis.T
        H, g = B @ B.T, B @ self.r
        scale = np.sqrt(np.maximum(np.diag(H), 1e-300))
        unit = H / np.outer(scale, scale) + 1e-9 * np.eye(len(H))
        c = np.linalg.solve(unit, g / scale) / scale
        return 0.5 * float(g @ c), c


def _screen_one(base: Fitted, name: str, score: _Score) -> Trial | None:
    made = members("effect")[name]
    model = base.predictor.model.with_effect(name, made.defaults())
    predictor, key = base.predictor.like(model), model.effects[-1].key
    spans, points = _spans(made), _grid(base, made)
    step = typical(made.parameters[made.gain], predictor.data.log)

    def score_of(tried: Sequence[dict[str, float]]) -> list[tuple[float, np.ndarray, dict]]:
        sets = [
            base.values | _values(key, made, {made.gain: step, **point, **span})
            for point in tried
            for span in spans
        ]
        white = _whitened_by_parts(predictor, sets, base)
        columns = ((score.white - white) / step).reshape(len(tried), len(spans), -1)
        return [(*score.gain(c), point) for c, point in zip(columns, tried, strict=True)]

    best = max(score_of(points), key=lambda found: found[0])
    for _ in range(ZOOMS if _continuous(base, made) else 0):
        points = _closer(points, best[2])
        best = max([best, *score_of(points)], key=lambda found: found[0])
    values = _combine(base, made, best[2], spans, best[1])
    if values is None:
        return None
    start = base.values | _values(key, made, values)
    return Trial(name, replace(base, predictor=predictor), key, start, best[0])


def _whitened_by_parts(predictor: Predictor, sets: list[dict], base: Fitted) -> np.ndarray:
    """In calls of bounded size, for the memory's sake."""
    most = max(1, LARGEST // max(1, base.where.counted.size))
    parts = [sets[i : i + most] for i in range(0, len(sets), most)]
    return np.concatenate([whitened(predictor, p, base.where, base.noise) for p in parts])


def _closer(points: list[dict], best: dict) -> list[dict]:
    """A finer grid between the neighbours of the best point."""
    (name, at), *_ = best.items()
    tried = np.sort([p[name] for p in points])
    cell = np.min(np.diff(tried)) if len(tried) > 1 else 0.0
    return [{name: float(v)} for v in at + cell * np.linspace(-0.9, 0.9, 10)]


def _values(key: str, made: Block, given: dict[str, float]) -> dict[str, float]:
    return {f"{key}.{k}": given.get(k, p.value) for k, p in made.parameters.items()}


def _continuous(base: Fitted, made: Block) -> bool:
    rotary = base.predictor.model.motion == "rotary"
    return any(p.grid and not (p.whole and rotary) for p in made.parameters.values())


def _spans(made: Block) -> list[dict[str, float]]:
    named = [(k, p.span) for k, p in made.parameters.items() if p.span]
    return [
        dict(zip([k for k, _ in named], pick, strict=True))
        for pick in product(*[span for _, span in named])
    ]


def _grid(base: Fitted, made: Block) -> list[dict[str, float]]:
    gridded = {k: p.grid for k, p in made.parameters.items() if p.grid}
    if not gridded:
        return [{}]
    log = base.predictor.data.log
    (name, grid), *_ = gridded.items()
    points = [{name: float(v)} for v in grid(log)]
    return points if len(points) <= FEW else _prescreened(base, made, points)


def _prescreened(base: Fitted, made: Block, points: list[dict]) -> list[dict[str, float]]:
    """The points whose effect resembles the residual torque most, best first."""
    index, target = (
        base.where.counted.ravel(),
        missing_torque(base.predictor, base.values, base.where, base.noise).ravel(),
    )
    every = max(1, int(0.002 / base.predictor.data.dt))
    index, target = index[::every], target[::every] - target.mean()
    few = _thinned(base.predictor.data.log, index)
    (name, *_), spans = points[0], _spans(made)
    tried = np.array([point[name] for point in points])
    power = [
        _resemblance(made, few, name, part, spans, target)
        for part in np.array_split(tried, -(-len(tried) // 32))
    ]
    return [points[i] for i in _peaks(np.concatenate(power))[:KEPT]]


def _resemblance(
    made: Block, log: Log, name: str, tried: np.ndarray, spans: list[dict], target: np.ndarray
) -> np.ndarray:
    """Power of the target that the effect explains at each value of one parameter."""
    unit = made.defaults() | {made.gain: 1.0, name: tried[:, None]}
    B = np.stack([along(made, log, unit | span) for span in spans], axis=1)
    H, g = B @ B.transpose(0, 2, 1), B @ target
    H = H + 1e-9 * np.trace(H, axis1=1, axis2=2)[:, None, None] * np.eye(len(spans))
    return np.sum(g * np.linalg.solve(H, g[..., None])[..., 0], axis=1)


def _thinned(log: Log, index: np.ndarray) -> Log:
    return replace(log, **{k: getattr(log, k)[index] for k in ("t", "theta", "w", "a", "u")})


def _peaks(power: np.ndarray) -> np.ndarray:
    """Indices of the local maxima, highest first."""
    padded = np.pad(power, 1, constant_values=-np.inf)
    tops = np.flatnonzero((power >= padded[:-2]) & (power >= padded[2:]))
    return tops[np.argsort(-power[tops])]


def _combine(
    base: Fitted, made: Block, point: dict, spans: list[dict], c: np.ndarray
) -> dict[str, float] | None:
    """The gain and span parameters whose effect is the combination found; None out of bounds."""
    gain = made.parameters[made.gain]
    if len(spans) == 1:
        return {made.gain: float(c[0]), **point} if gain.low <= c[0] <= gain.high else None
    log = base.predictor.data.log
    few = _thinned(log, np.unique(np.linspace(0, len(log.t) - 1, 2000).astype(int)))
    known = made.defaults() | point
    target = sum(
        ci * along(made, few, known | {made.gain: 1.0} | span)
        for ci, span in zip(c, spans, strict=True)
    )
    names = list(spans[0])
    size = max(float(np.std(target)), 1e-12)

    def miss(x: np.ndarray) -> np.ndarray:
        own = dict(zip([made.gain, *names], x, strict=True))
        return (along(made, few, known | own) - target) / size

    starts = [[float(np.abs(c).sum()), *span.values()] for span in spans]
    starts += [[float(np.abs(c).sum()), *(-v for v in span.values())] for span in spans]
    fits = [least_squares(miss, x0) for x0 in starts]
    fits = [f for f in fits if gain.low <= f.x[0] <= gain.high and f.cost < 1e-3 * len(few.t)]
    if not fits:
        return None
    x = min(fits, key=lambda f: f.cost).x
    return dict(zip([made.gain, *names], map(float, x), strict=True)) | point


def at_anchor(base: Fitted) -> Fitted:
    """The base model at the values that were believed beforehand.

    A model that lacks an effect bends its other parameters to make up for it, sometimes too far
    to find the way back: candidates start from here as well.
    """
    values = base.values | base.anchor
    noise, loglik = tune(base.predictor, values, base.where, base.noise)
    return replace(base, values=values, noise=noise, loglik=loglik)


def refine(trial: Trial, *, most: int = 30) -> Fitted:
    """Fit the model with the trial's effect, all parameters free."""
    base, predictor = trial.fitted, trial.fitted.predictor
    own = {k: v for k, v in trial.values.items() if k not in base.anchor}
    anchor = base.anchor | own
    free = free_keys(predictor)
    return fit(predictor, trial.values, free, base.where, base.noise, anchor=anchor, most=most)


def contest(base: Fitted, names: Sequence[str], gate: float, tried: int, say: Say) -> Contest:
    """Fit the promising effects shortly from each start, then the best of them to the end."""
    promising = screen(base, names)
    chosen = [t for t in promising if t.promise > gate][:tried]
    if chosen:
        chosen += [t for t in screen(at_anchor(base), names) if t.promise > gate][:tried]
    short: dict[str, tuple[Trial, Fitted]] = {}
    for trial in chosen:
        say(f"trying {trial.name}")
        fitted = refine(trial, most=5)
        known = short.get(trial.name)
        if known is None or fitted.total > known[1].total:
            short[trial.name] = trial, fitted
    best = sorted(short.values(), key=lambda pair: -pair[1].total)[:tried]
    finished = []
    for trial, fitted in best:
        say(f"fitting {trial.name}")
        top = max(f.total for _, f in finished) if finished else fitted.total
        if fitted.total - base.total > HOPELESS * (top - base.total):
            fitted = refine(replace(trial, fitted=fitted, values=fitted.values))
        finished.append((trial, fitted))
    return Contest(promising, sorted(finished, key=lambda pair: -pair[1].total))

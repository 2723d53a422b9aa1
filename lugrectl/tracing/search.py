"""Which effect of the catalogue would explain what the model fails to predict."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from scipy.optimize import least_squares

from ..spec import Block, members
from .blows import sought
from .coordinates import typical
from .data import Log, thinned
from .evaluate import missing_torque
from .fit import Fitted, again, moved
from .likelihood import tune
from .predictor import Predictor, coarser, spread
from .score import Score, whitened_by_parts
from .series import resisting
from .tries import tried

ENOUGH = 40_000  # counted samples to search on
MANY_WINDOWS = 24
COARSE = 2e-3  # s, longest sampling interval on which effects are searched
FEW = 4  # grid points that are all tried exactly
SHAKES = (0.7, 0.7, 0.3)  # largest spread of a random search about what a short fit found
STEPS = 30.0  # typical steps by which an effect is tried
SHAKEN = 40  # sets of it
ANEW = 3  # best fits that start once more with the plant as it was believed to be
KEPT = 4  # of a longer grid, after a look at the residual torque
NEARLY = 0.6  # of the best point's promise, from which the next one is a start, too
ZOOMS = 2  # finer grids around the best point
UNLIKELY = 0.01  # promise over what another effect has gained, below which one is not tried
SOUGHT = 0.4  # of the leader's gain, from which all sets of an effect with many optima are tried
LEAST_SOUGHT = 50.0  # gain in log-likelihood, below which that is not worth the time
SLIGHT = 3.0  # gain after a short fit, below which nothing more is tried
HOPELESS = 0.1  # of the leader's gain after a short fit, below which a candidate is dropped

Say = Callable[[str], None]


@dataclass(frozen=True)
class Trial:
    """An effect added to a fitted model: a first estimate, and how much it should gain.

    ``others`` are more values to start from.
    """

    name: str
    fitted: Fitted
    key: str
    values: dict[str, float]
    promise: float
    others: tuple[dict[str, float], ...] = ()

    @property
    def boxed(self) -> bool:
        """Whether its likelihood has so many optima that all of its sets are searched."""
        return members("effect")[self.name].box is not None

    @property
    def rough(self) -> bool:
        """Whether its series is an approximation: it sees the measured motion."""
        block = members("effect")[self.name]
        return bool(block.states and block.exact is None) or "sensor" in block.acts


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
    score = Score(base)
    trials = [trial for name in names if (trial := _screen_one(base, name, score))]
    return sorted(trials, key=lambda trial: -trial.promise)


def _screen_one(base: Fitted, name: str, score: Score) -> Trial | None:
    made = members("effect")[name]
    model = base.predictor.model.with_effect(name, _open(made))
    predictor, key = base.predictor.like(model), model.effects[-1].key
    if made.tries:
        found = tried(base, made, predictor, key, score)
    else:
        found = _linear(base, made, predictor, key, score)
    if not found:
        return None
    (promise, values), *others = found
    trial = replace(base, predictor=predictor)
    return Trial(name, trial, key, values, promise, tuple(v for _, v in others))


def _open(made: Block) -> dict[str, float]:
    return {k: p.value for k, p in made.own.items()}


def _linear(
    base: Fitted, made: Block, predictor: Predictor, key: str, score: Score
) -> list[tuple[float, dict[str, float]]]:
    """A step from the neutral value, over a grid of what the effect is not linear in.

    A second one where another point of the grid promises nearly as much.
    """
    spans, points = _spans(made), _grid(base, made)
    step = STEPS * typical(made.parameters[made.gain], predictor.data.log)

    def score_of(tried: Sequence[dict[str, float]]) -> list[tuple[float, np.ndarray, dict]]:
        sets = [
            base.values | _values(key, made, {made.gain: step, **point, **span})
            for point in tried
            for span in spans
        ]
        white = whitened_by_parts(predictor, sets, base)
        columns = ((score.white - white) / step).reshape(len(tried), len(spans), -1)
        return [(*score.gain(c), point) for c, point in zip(columns, tried, strict=True)]

    found = sorted(score_of(points), key=lambda one: -one[0])
    best, second = found[0], found[1:2]
    if _continuous(base, made):
        name, grid = _gridded(made)
        places, p = grid(base.predictor.data.log), made.parameters[name]
        for _ in range(ZOOMS):
            places = np.clip(_closer(places, best[2][name]), p.low, p.high)
            more = score_of([{name: float(v)} for v in places])
            best = max([best, *more], key=lambda one: one[0])
    near = [one for one in second if one[0] > NEARLY * best[0]]
    made_of = [(gain, _combine(base, made, point, spans, c)) for gain, c, point in [best, *near]]
    return [(gain, base.values | _values(key, made, v)) for gain, v in made_of if v is not None]


def _closer(points: np.ndarray, at: float) -> np.ndarray:
    """A finer grid between the neighbours of the best point."""
    known = np.unique(np.append(points, at))
    i = int(np.searchsorted(known, at))
    gaps = np.diff(known)
    below, above = gaps[max(i - 1, 0)], gaps[min(i, len(gaps) - 1)]
    finer = [at - below * np.linspace(0.9, 0.1, 5), at + above * np.linspace(0.1, 0.9, 5)]
    return np.concatenate(finer)


def _values(key: str, made: Block, given: dict[str, float]) -> dict[str, float]:
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
    """The parameter that is tried on a grid, and the grid."""
    return next((k, p.grid) for k, p in made.parameters.items() if p.grid is not None)


def _grid(base: Fitted, made: Block) -> list[dict[str, float]]:
    if not any(p.grid for p in made.parameters.values()):
        return [{}]
    name, grid = _gridded(made)
    points = [{name: float(v)} for v in grid(base.predictor.data.log)]
    return points if len(points) <= FEW else _prescreened(base, made, points)


def _prescreened(base: Fitted, made: Block, points: list[dict]) -> list[dict[str, float]]:
    """The points whose effect resembles the residual torque most, best first."""
    index, target = (
        base.where.counted.ravel(),
        missing_torque(base.predictor, base.values, base.where, base.noise).ravel(),
    )
    every = max(1, int(0.002 / base.predictor.data.dt))
    index, target = index[::every], target[::every] - target.mean()
    few, weights = _thinned(base, index)
    (name, *_), spans = points[0], _spans(made)
    tried = np.array([point[name] for point in points])
    power = [
        _resemblance(made, few, weights, name, part, spans, target)
        for part in np.array_split(tried, -(-len(tried) // 32))
    ]
    tops = _peaks(np.concatenate(power))[:KEPT].tolist()
    beside = [i for i in (tops[0] - 1, tops[0] + 1) if 0 <= i < len(points)]
    return [points[i] for i in dict.fromkeys([*tops, *beside])]


def _resemblance(
    made: Block,
    log: Log,
    weights: dict,
    name: str,
    tried: np.ndarray,
    spans: list[dict],
    target: np.ndarray,
) -> np.ndarray:
    """Power of the target that the effect explains at each value of one parameter."""
    unit = made.defaults() | {made.gain: 1.0, name: tried[:, None]}
    B = np.stack([resisting(made, log, unit | span, weights) for span in spans], axis=1)
    H, g = B @ B.transpose(0, 2, 1), B @ target
    ridge = 1e-9 * np.trace(H, axis1=1, axis2=2) + 1e-300
    H = H + ridge[:, None, None] * np.eye(len(spans))
    return np.sum(g * np.linalg.solve(H, g[..., None])[..., 0], axis=1)


def _thinned(base: Fitted, index: np.ndarray) -> tuple[Log, dict[str, np.ndarray]]:
    """Some samples of the log and of the weights of levels on it."""
    log, weights = base.predictor.data.log, base.predictor.weights(base.values)
    signals = {k: getattr(log, k)[index] for k in ("t", "theta", "w", "a", "u", "load")}
    return replace(log, **signals), {k: v[index] for k, v in weights.items()}


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


def refine(trial: Trial, *, most: int = 30, rough: bool = False) -> Fitted:
    """Fit the model with the trial's effect, all parameters free."""
    anchor = trial.values | trial.fitted.anchor
    start = replace(trial.fitted, values=trial.values, anchor=anchor)
    return again(start, most=most, rough=rough)


def _short(trial: Trial) -> tuple[Trial, Fitted]:
    """A few steps from each of a trial's starts; inside the plant where its series is rough."""
    if trial.rough:
        inside = Predictor(trial.fitted.predictor.model, trial.fitted.predictor.data)
        trial = replace(trial, fitted=replace(trial.fitted, predictor=inside))
    fits = [
        refine(replace(trial, values=v), most=5, rough=True) for v in (trial.values, *trial.others)
    ]
    best = max(fits, key=lambda f: f.total)
    worth = trial.rough and best.total > trial.fitted.total + SLIGHT
    for reach in SHAKES if worth else ():
        start = _shaken(best, trial.key, reach)
        if start is not None:
            other = refine(replace(trial, values=start), most=5, rough=True)
            best = max(best, other, key=lambda f: f.total)
    return trial, best


def _shaken(found: Fitted, key: str, spread: float) -> dict[str, float] | None:
    """Values near those found that do better as they are.

    Blows make many optima. Drawn with the shape of the uncertainty, the plant's values along
    with the effect's, whose logarithms spread so far.
    """
    own = [i for i, c in enumerate(found.free) if c.key.startswith(f"{key}.") and c.kind == "log"]
    if len(own) < 2:
        return None
    C = found.covariance()
    size = np.sqrt(np.max(np.diag(C)[own]))
    if not (np.all(np.isfinite(C)) and 0.0 < size < np.inf):
        return None
    values, axes = np.linalg.eigh(C * (spread / size) ** 2)
    draws = np.random.default_rng(len(own)).normal(size=(SHAKEN, len(C)))
    steps = (draws * np.sqrt(np.maximum(values, 0.0))) @ axes.T
    sets = [moved(found.values, found.free, step) for step in steps]
    white = np.nan_to_num(whitened_by_parts(found.predictor, sets, found), posinf=1e150)
    cost = np.sum(white**2, axis=(1, 2, 3))
    best = int(np.argmin(cost))
    return sets[best] if cost[best] < np.sum(found.innovations**2) else None


def lightened(base: Fitted) -> Fitted:
    """The base model on as few samples as tell effects apart."""
    data = base.predictor.data
    every = max(1, int(COARSE / data.dt + 1e-9))
    where = base.where if every == 1 else coarser(base.where, data.runs, every)
    where = spread(where, ENOUGH, MANY_WINDOWS)
    if every == 1 and where is base.where:
        return base
    predictor = base.predictor.on(thinned(data, every)) if every > 1 else base.predictor
    noise, loglik = tune(predictor, base.values, where, base.noise)
    return replace(base, predictor=predictor, where=where, noise=noise, loglik=loglik)


def _heavy(trial: Trial, base: Fitted, values: dict[str, float]) -> Trial:
    """A trial on all samples again."""
    found = trial.fitted.predictor
    predictor = found.on(base.predictor.data) if trial.rough else base.predictor.like(found.model)
    return replace(trial, fitted=replace(base, predictor=predictor), values=values)


def contest(base: Fitted, names: Sequence[str], gate: float, tried: int, say: Say) -> Contest:
    """Fit the promising effects shortly from each start, then the best of them to the end.

    All but the end goes on fewer samples a second.
    """
    light = lightened(base)
    promising = screen(light, names)
    chosen = [t for t in promising if t.promise > gate][: 2 * tried]
    believed = at_anchor(light)
    if light.total - believed.total > gate:
        chosen += [t for t in screen(believed, names) if t.promise > gate][:tried]
    short: dict[str, tuple[Trial, Fitted]] = {}
    for trial in sorted(chosen, key=lambda trial: -trial.promise):
        lead = max((f.total for _, f in short.values()), default=light.total) - light.total
        if trial.promise < UNLIKELY * lead:
            continue
        say(f"trying {trial.name}")
        trial, fitted = _short(trial)
        known = short.get(trial.name)
        if known is None or fitted.total > known[1].total:
            short[trial.name] = trial, fitted
    best = sorted(short.values(), key=lambda pair: -pair[1].total)[:tried]
    lead = best[0][1].total - light.total if best else 0.0
    finished = []
    for trial, fitted in best:
        if fitted.total - light.total > max(HOPELESS * lead, SLIGHT):
            say(f"fitting {trial.name}")
            finished.append(_finished(trial, fitted, base, lead))
    finished.sort(key=lambda pair: -pair[1].total)
    for i, (trial, fitted) in enumerate(finished[:ANEW]):
        if not trial.boxed:
            finished[i] = trial, max(fitted, _anew(trial, fitted), key=lambda f: f.total)
    return Contest(promising, sorted(finished, key=lambda pair: -pair[1].total))


def _finished(trial: Trial, short: Fitted, base: Fitted, lead: float) -> tuple[Trial, Fitted]:
    """A trial on all samples again, fitted to the end."""
    gain = short.total - trial.fitted.total
    wanted = trial.boxed and gain > max(SOUGHT * lead, LEAST_SOUGHT)
    whole = _heavy(trial, base, sought(short, trial.key) if wanted else short.values)
    return whole, refine(whole, most=0 if wanted else 30)


def _anew(trial: Trial, fitted: Fitted) -> Fitted:
    """The effects as found, with the plant from where it was believed to be."""
    plant = {k: v for k, v in trial.fitted.anchor.items() if "." not in k}
    return refine(replace(trial, values=fitted.values | plant))

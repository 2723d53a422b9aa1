"""Parameters from records: maximum likelihood of the one-step predictions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy import stats

from .block import P
from .data import Log
from .noise import Noise, observer_gain
from .predictor import Predictor, Values, Windows

PRIOR = 1.5  # natural log units: a friction parameter is believed within a factor of 4.5
LEAST_EXCESS = 1e-4  # of Fs over Fc, relative
DROP = 1.92  # of the log-likelihood at the ends of a 95 % interval


@dataclass(frozen=True)
class Coordinate:
    """One free parameter and the coordinate in which it is stepped."""

    key: str
    kind: str  # "log", "excess" (Fs over Fc) or "linear"
    low: float
    high: float
    step: float

    def into(self, values: Values) -> float:
        if self.kind == "log":
            return float(np.log(values[self.key]))
        if self.kind == "excess":
            return float(np.log(max(values[self.key] / values["Fc"] - 1.0, LEAST_EXCESS)))
        return values[self.key]

    def back(self, x: float, values: Values) -> float:
        if self.kind == "log":
            return float(np.clip(np.exp(x), max(self.low, 1e-12), self.high))
        if self.kind == "excess":
            return float(values["Fc"] * (1.0 + np.exp(min(x, 5.0))))
        return float(np.clip(x, self.low, self.high))


def coordinates(predictor: Predictor, keys: Sequence[str]) -> list[Coordinate]:
    """How each of the keys is stepped: positive plant parameters in their logarithm."""
    declared = predictor.model.declarations()
    made = []
    for key in keys:
        p = declared[key]
        if key == "Fs":
            made.append(Coordinate(key, "excess", p.low, p.high, 1e-3))
        elif "." not in key:
            made.append(Coordinate(key, "log", p.low, p.high, 5e-4))
        else:
            size = typical(p, predictor.data.log)
            made.append(Coordinate(key, "linear", p.low, p.high, size))
    return made


def typical(p: P, log: Log) -> float:
    """A small step for an effect parameter, from its unit and the size of the log."""
    torque, travel = float(np.std(log.u)), float(np.ptp(log.theta))
    speed, length = float(np.max(np.abs(log.w))), float(log.t[-1] - log.t[0])
    sizes = {
        "N m": 1e-4 * torque,
        "N m/rad": 1e-4 * torque / travel,
        "N m s2/rad2": 1e-4 * torque / speed**2,
        "1/rev": 1e-3 / travel,
        "Hz": 1e-4 / length,
        "s": 0.01 * log.dt,
    }
    return sizes.get(p.unit, 1e-4)


def free_keys(predictor: Predictor) -> list[str]:
    """All parameters that a record can identify; a count per turn is found by search alone."""
    rotary = predictor.model.motion == "rotary"
    declared = predictor.model.declarations()
    return [k for k, p in declared.items() if p.fitted and not (p.whole and rotary)]


def is_instant(p: P) -> bool:
    """A moment in time: the likelihood has steps in it, so it is placed, not descended."""
    return p.unit == "s" and p.grid is not None


@dataclass(frozen=True)
class Fitted:
    """Values at the maximum, with what is needed to judge them.

    ``anchor`` holds the values that were believed beforehand; ``loglik`` has one value for each
    window; ``information`` and ``scores`` are those of the
    coordinates, for intervals; ``innovations`` are whitened, (windows, length, channels).
    """

    predictor: Predictor
    values: dict[str, float]
    free: tuple[Coordinate, ...]
    where: Windows
    noise: Noise
    loglik: np.ndarray
    innovations: np.ndarray = field(repr=False)
    information: np.ndarray = field(repr=False)
    scores: np.ndarray = field(repr=False)
    anchor: dict[str, float] = field(default_factory=dict)
    instants: dict[str, tuple[float, float]] = field(default_factory=dict)

    @property
    def total(self) -> float:
        return float(self.loglik.sum())

    @property
    def torque_noise(self) -> float:
        """Standard deviation of the torque that the model does not foresee, per sample."""
        return self.noise.jump * self.values["J"]

    def covariance(self) -> np.ndarray:
        """Of the coordinates: the larger of the model's own and the windows' scatter.

        The second (sandwich over windows) stays honest where the innovations are coloured.
        """
        inverse = _inverse(self.information)
        n = len(self.scores)
        spread = inverse @ (self.scores.T @ self.scores) @ inverse * n / max(n - 1, 1)
        own = np.maximum(np.diag(inverse), 1e-300)
        ratio = np.sqrt(np.maximum(np.diag(spread) / own, 1.0))
        return inverse * np.outer(ratio, ratio)

    def intervals(self) -> dict[str, tuple[float, float]]:
        """95 % intervals by key."""
        width = np.sqrt(np.diag(self.covariance())) * stats.t.ppf(0.975, len(self.scores) - 1)
        made = dict(self.instants)
        for c, half in zip(self.free, width, strict=True):
            x = c.into(self.values)
            made[c.key] = (c.back(x - half, self.values), c.back(x + half, self.values))
        return made


def _inverse(information: np.ndarray) -> np.ndarray:
    scale = np.sqrt(np.maximum(np.diag(information), 1e-300))
    unit = information / np.outer(scale, scale)
    return np.linalg.pinv(unit, rcond=1e-12, hermitian=True) / np.outer(scale, scale)


def fit(
    predictor: Predictor,
    values: Values,
    free: Sequence[str],
    where: Windows,
    noise: Noise,
    *,
    anchor: Values | None = None,
    rounds: int = 3,
    steps: int = 8,
) -> Fitted:
    """Maximise the likelihood of the predictions over the free values and the noise of dw/dt.

    ``anchor`` is what was believed beforehand (default: ``values``): a weak prior around it
    keeps directions that the record does not tell where they were declared.
    """
    anchor = dict(values) | dict(anchor or {})
    declared = predictor.model.declarations()
    moments = [k for k in free if is_instant(declared[k])]
    coords = coordinates(predictor, [k for k in free if k not in moments])
    current, prior = dict(values), _Prior.at(coords, anchor)
    placed: dict[str, tuple[float, float]] = {}
    noise, loglik = tune(predictor, current, where, noise)
    for turn in range(rounds):
        before = loglik.sum()
        for key in moments:
            current[key], placed[key] = place(predictor, current, key, where, noise)
        current, linear = _descend(predictor, current, coords, where, noise, prior, steps)
        noise, loglik = tune(predictor, current, where, noise)
        if turn and loglik.sum() - before < 0.5:
            break
    linear, _ = _linearise(predictor, current, coords, where, noise, prior)
    white = whitened(predictor, [current], where, noise)[0]
    loglik = _loglik(predictor, white, noise)
    return Fitted(
        predictor, current, tuple(coords), where, noise, loglik, white,
        linear.information, linear.scores, anchor, placed,
    )  # fmt: skip


def place(
    predictor: Predictor, values: Values, key: str, where: Windows, noise: Noise
) -> tuple[float, tuple[float, float]]:
    """The moment of highest likelihood and its 95 % interval, the other values held.

    Where samples are missing around it the likelihood is level: the middle is returned.
    """
    dt = predictor.data.dt
    first, last = float(predictor.data.t[0]), float(predictor.data.t[-1])

    def loglik(times: np.ndarray) -> np.ndarray:
        sets = [dict(values) | {key: float(t)} for t in times]
        white = whitened(predictor, sets, where, noise)
        return -0.5 * np.sum(white**2, axis=(1, 2, 3))

    center, reach = values[key], 0.04 * (last - first)
    while reach > dt:
        times = np.clip(center + reach * np.linspace(-1.0, 1.0, 9), first, last)
        center, reach = float(times[np.argmax(loglik(times))]), 0.3 * reach
    floor = loglik(np.array([center]))[0] - DROP

    def edge(sign: float) -> float:
        inside, step = center, dt
        while first < inside < last and loglik(np.array([inside + sign * step]))[0] > floor:
            inside, step = inside + sign * step, 1.5 * step
        while step > 0.5 * dt:
            step *= 0.5
            if loglik(np.array([inside + sign * step]))[0] > floor:
                inside += sign * step
        return float(np.clip(inside + sign * 0.5 * dt, first, last))

    low, high = edge(-1.0), edge(1.0)
    middle = 0.5 * (low + high)
    level = loglik(np.array([middle]))[0] > floor
    return (middle if level else center), (low, high)


@dataclass(frozen=True)
class _Prior:
    """A weak belief that keeps flat directions where the user declared them."""

    center: np.ndarray
    weight: np.ndarray

    @classmethod
    def at(cls, coords: Sequence[Coordinate], values: Values) -> _Prior:
        weight = [0.0 if c.kind == "linear" else PRIOR**-2 for c in coords]
        return cls(np.array([c.into(values) for c in coords]), np.array(weight))

    def cost(self, x: np.ndarray) -> float:
        return 0.5 * float(self.weight @ (x - self.center) ** 2)


@dataclass(frozen=True)
class _Linear:
    """The innovations' derivative: A'A and one score A'r for each window."""

    information: np.ndarray
    scores: np.ndarray


def _descend(predictor, values, coords, where, noise, prior, steps) -> tuple[dict, _Linear]:
    """Levenberg-Marquardt at fixed noise."""
    current, damping = dict(values), 1e-3
    linear, cost = _linearise(predictor, current, coords, where, noise, prior)
    for _ in range(steps):
        x = np.array([c.into(current) for c in coords])
        gradient = linear.scores.sum(0) - prior.weight * (x - prior.center)
        H = linear.information + np.diag(prior.weight)
        moved = _move(H, gradient, damping, coords, current)
        trial, reached = _linearise(predictor, moved, coords, where, noise, prior)
        if not reached < cost:
            damping *= 20.0
            if damping > 1e4:
                break
            continue
        gained, current, linear, cost = cost - reached, moved, trial, reached
        damping = max(0.1 * damping, 1e-8)
        if gained < 0.2:
            break
    return current, linear


def _move(H, gradient, damping, coords, values) -> dict[str, float]:
    scale = np.sqrt(np.maximum(np.diag(H), 1e-300))
    unit = H / np.outer(scale, scale) + damping * np.eye(len(scale))
    dx = np.linalg.lstsq(unit, gradient / scale, rcond=1e-12)[0] / scale
    moved = dict(values)
    for c, step in zip(coords, dx, strict=True):
        limited = np.clip(step, -0.7, 0.7) if c.kind != "linear" else step
        moved[c.key] = c.back(c.into(values) + limited, moved)
    return moved


def _linearise(predictor, values, coords, where, noise, prior) -> tuple[_Linear, float]:
    sets = [dict(values)]
    for c in coords:
        moved = dict(values)
        moved[c.key] = c.back(c.into(values) + c.step, values)
        sets.append(moved | _tied(c, coords, values, moved))
    with np.errstate(over="ignore", invalid="ignore"):
        return _derivative(whitened(predictor, sets, where, noise), values, coords, prior)


def _derivative(white, values, coords, prior) -> tuple[_Linear, float]:
    r = white[0]
    A = np.stack([(r - w) / c.step for w, c in zip(white[1:], coords, strict=True)])
    A = A.reshape(len(coords), len(r), -1)
    scores = np.einsum("pwn,wn->wp", A, r.reshape(len(r), -1))
    flat = A.reshape(len(coords), -1)
    x = np.array([c.into(values) for c in coords])
    cost = 0.5 * float(np.sum(r**2)) + prior.cost(x)
    return _Linear(flat @ flat.T, scores), cost if np.isfinite(flat).all() else np.inf


def _tied(c: Coordinate, coords: Sequence[Coordinate], values: Values, moved: Values) -> dict:
    """Fs follows Fc where it is stepped by its excess."""
    if c.key != "Fc":
        return {}
    return {q.key: q.back(q.into(values), moved) for q in coords if q.kind == "excess"}


def whitened(
    predictor: Predictor,
    sets: Sequence[Values],
    where: Windows,
    noise: Noise | Sequence[Noise],
) -> np.ndarray:
    """Innovations with unit covariance where the model is right, (sets, windows, length, 2)."""
    y, _ = predictor.run(sets, where, noise)
    e = np.nan_to_num(predictor.data.y[where.counted] - y, nan=0.0, posinf=1e150, neginf=-1e150)
    noises = [noise] * len(sets) if isinstance(noise, Noise) else noise
    for i, q in enumerate(noises):
        _, S = observer_gain(predictor.data.dt, q)
        e[i] = e[i] @ np.linalg.inv(np.linalg.cholesky(S)).T
    return e


def _loglik(predictor: Predictor, white: np.ndarray, noise: Noise) -> np.ndarray:
    """Gaussian log-likelihood of each window."""
    _, S = observer_gain(predictor.data.dt, noise)
    return -0.5 * np.sum(white**2, axis=(1, 2)) - 0.5 * white.shape[1] * np.linalg.slogdet(S)[1]


def tune(
    predictor: Predictor, values: Values, where: Windows, noise: Noise
) -> tuple[Noise, np.ndarray]:
    """The noise of dw/dt under which the innovations are most likely."""
    width = 2.0
    for _ in range(6):
        factors = np.exp(width * np.linspace(-1.0, 1.0, 5))
        noises = [replace(noise, jump=noise.jump * f) for f in factors]
        white = whitened(predictor, [values] * len(noises), where, noises)
        logliks = [_loglik(predictor, w, q) for w, q in zip(white, noises, strict=True)]
        best = int(np.argmax([ll.sum() for ll in logliks]))
        noise, loglik = noises[best], logliks[best]
        if 0 < best < 4:
            width *= 0.35
    return noise, loglik

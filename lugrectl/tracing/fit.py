"""Parameters from records: maximum likelihood of the one-step predictions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np
from scipy import stats

from ..spec import P
from .data import Log
from .noise import Noise
from .predictor import Predictor, Values, Windows

PRIOR = 1.5  # natural log units: a friction parameter is believed within a factor of 4.5
REACH = {"J": 2.5, "Fc": 4.0, "Fs": 4.0}  # factor by which a value may leave the declared one
FAR = 10.0  # the same for all others
LEAST_EXCESS = 1e-4  # of Fs over Fc, relative
NOISE_STEPS = (1.0, 0.6, 0.25, 1.5)  # factors tried at each step of a fit
DROP = 1.92  # of the log-likelihood at the ends of a 95 % interval


@dataclass(frozen=True)
class Coordinate:
    """One free parameter and the coordinate in which it is stepped."""

    key: str
    kind: str  # "log", "excess" (Fs over Fc), "angle" or "linear"
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
            return float(min(values["Fc"] * (1.0 + np.exp(min(x, 5.0))), self.high))
        if self.kind == "angle":
            return float(np.pi - (np.pi - x) % (2.0 * np.pi))
        return float(np.clip(x, self.low, self.high))


def coordinates(predictor: Predictor, keys: Sequence[str], anchor: Values) -> list[Coordinate]:
    """How each of the keys is stepped: positive plant parameters in their logarithm.

    Those stay within a factor of what was declared: a model that lacks an effect would send
    them anywhere to make up for it.
    """
    declared = predictor.model.declarations()
    made = []
    for key in keys:
        p = declared[key]
        if "." not in key:
            far = REACH.get(key, FAR)
            low, high = max(p.low, anchor[key] / far), min(p.high, anchor[key] * far)
            kind, step = ("excess", 1e-3) if key == "Fs" else ("log", 5e-4)
            made.append(Coordinate(key, kind, low, high, step))
        elif p.low >= 0.0 and p.neutral != 0.0 and anchor[key] > 0.0:
            made.append(Coordinate(key, "log", max(p.low, 1e-12), p.high, 1e-3))
        else:
            size = typical(p, predictor.data.log)
            kind = "angle" if p.angle else "linear"
            made.append(Coordinate(key, kind, p.low, p.high, size))
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
    fixed = {k for k, p in declared.items() if p.choices or (p.whole and rotary)}
    return [k for k, p in declared.items() if p.fitted and k not in fixed]


def is_instant(p: P) -> bool:
    """A moment in time: the likelihood has steps in it, so it is placed, not descended."""
    return p.unit == "s" and p.grid is not None and p.low < 0.0


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
        """95 % intervals by key; that of a phase may reach beyond half a turn."""
        width = np.sqrt(np.diag(self.covariance())) * stats.t.ppf(0.975, len(self.scores) - 1)
        made = dict(self.instants)
        for c, half in zip(self.free, width, strict=True):
            x = c.into(self.values)
            ends = x - half, x + half
            if c.kind != "angle":
                ends = c.back(ends[0], self.values), c.back(ends[1], self.values)
            made[c.key] = ends
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
    most: int = 30,
) -> Fitted:
    """Maximise the likelihood of the predictions over the free values and the noise of dw/dt.

    Levenberg-Marquardt steps, the noise following at each, at most ``most`` of them. ``anchor``
    is what was believed beforehand (default: ``values``): a weak prior around it keeps
    directions that the record does not tell where they were declared.
    """
    anchor = dict(values) | dict(anchor or {})
    declared = predictor.model.declarations()
    moments = [k for k in free if is_instant(declared[k])]
    coords = coordinates(predictor, [k for k in free if k not in moments], anchor)
    place_all = partial(_placed, predictor, moments, where)
    climb = _Climb(predictor, coords, where, _Prior.at(coords, anchor))
    noise, _ = tune(predictor, values, where, noise)
    values, _ = place_all(values, noise)
    values, noise = climb.up(values, noise, most if not moments else max(1, most // 3))
    for _ in range(2 if moments and most > 3 else 0):
        values, _ = place_all(values, noise)
        values, noise = climb.up(values, noise, most // 3)
    noise, loglik = tune(predictor, values, where, noise, width=0.3)
    values, placed = place_all(values, noise)
    linear = climb.linearised(values, noise)
    white = whitened(predictor, [values], where, noise)[0]
    loglik = _loglik(predictor, white, noise, values)
    return Fitted(
        predictor, values, tuple(coords), where, noise, loglik, white,
        linear.information, linear.scores, anchor, placed,
    )  # fmt: skip


def _placed(
    predictor: Predictor, moments: Sequence[str], where: Windows, values: Values, noise: Noise
) -> tuple[dict[str, float], dict[str, tuple[float, float]]]:
    current, intervals = dict(values), {}
    for key in moments:
        current[key], intervals[key] = place(predictor, current, key, where, noise)
    return current, intervals


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
        weight = [PRIOR**-2 if c.kind in ("log", "excess") else 0.0 for c in coords]
        return cls(np.array([c.into(values) for c in coords]), np.array(weight))

    def cost(self, x: np.ndarray) -> float:
        return 0.5 * float(self.weight @ (x - self.center) ** 2)


@dataclass(frozen=True)
class _Linear:
    """The innovations' derivative: A'A and one score A'r for each window."""

    information: np.ndarray
    scores: np.ndarray


@dataclass(frozen=True)
class _Climb:
    """Steps towards the maximum of likelihood and prior."""

    predictor: Predictor
    coords: Sequence[Coordinate]
    where: Windows
    prior: _Prior

    def up(self, values: Values, noise: Noise, most: int) -> tuple[dict[str, float], Noise]:
        current, damping = dict(values), 1e-3
        noise, total = self.judged(current, noise, (1.0,))
        linear, small = self.linearised(current, noise), 0
        for _ in range(most):
            moved = self.moved(linear, current, damping)
            better, reached = self.judged(moved, noise, NOISE_STEPS)
            if not reached > total:
                damping *= 20.0
                if damping > 1e5:
                    break
                continue
            small = small + 1 if reached - total < 0.3 else 0
            current, noise, total = moved, better, reached
            damping = max(0.1 * damping, 1e-8)
            if small == 2:
                break
            linear = self.linearised(current, noise)
        return current, noise

    def judged(self, values: Values, noise: Noise, factors: Sequence[float]) -> tuple[Noise, float]:
        """The best of some noises for these values, and the sum of log-likelihood and prior."""
        noises = [replace(noise, jump=noise.jump * f) for f in factors]
        white = whitened(self.predictor, [values] * len(noises), self.where, noises)
        totals = [
            _loglik(self.predictor, w, q, values).sum() for w, q in zip(white, noises, strict=True)
        ]
        best = int(np.argmax(np.nan_to_num(totals, nan=-np.inf)))
        return noises[best], float(totals[best]) - self.prior.cost(self.at(values))

    def at(self, values: Values) -> np.ndarray:
        return np.array([c.into(values) for c in self.coords])

    def moved(self, linear: _Linear, values: Values, damping: float) -> dict[str, float]:
        prior = self.prior
        gradient = linear.scores.sum(0) - prior.weight * (self.at(values) - prior.center)
        H = linear.information + np.diag(prior.weight)
        return _move(H, gradient, damping, self.coords, values)

    def linearised(self, values: Values, noise: Noise) -> _Linear:
        sets = [dict(values)]
        for c in self.coords:
            moved = dict(values)
            moved[c.key] = c.back(c.into(values) + c.step, values)
            sets.append(moved | _tied(c, self.coords, values, moved))
        with np.errstate(over="ignore", invalid="ignore"):
            return _derivative(whitened(self.predictor, sets, self.where, noise), self.coords)


def _move(H, gradient, damping, coords, values) -> dict[str, float]:
    scale = np.sqrt(np.maximum(np.diag(H), 1e-300))
    unit = H / np.outer(scale, scale) + damping * np.eye(len(scale))
    dx = np.linalg.lstsq(unit, gradient / scale, rcond=1e-12)[0] / scale
    moved = dict(values)
    for c, step in zip(coords, dx, strict=True):
        limited = step if c.kind == "linear" else np.clip(step, -0.7, 0.7)
        moved[c.key] = c.back(c.into(values) + limited, moved)
    return moved


def _derivative(white: np.ndarray, coords: Sequence[Coordinate]) -> _Linear:
    r = white[0]
    A = np.stack([(r - w) / c.step for w, c in zip(white[1:], coords, strict=True)])
    A = np.nan_to_num(A.reshape(len(coords), len(r), -1), posinf=0.0, neginf=0.0)
    scores = np.einsum("pwn,wn->wp", A, r.reshape(len(r), -1))
    flat = A.reshape(len(coords), -1)
    return _Linear(flat @ flat.T, scores)


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
    for i, (q, values) in enumerate(zip(noises, sets, strict=True)):
        _, S = predictor.filter(q, values)
        e[i] = e[i] @ np.linalg.inv(np.linalg.cholesky(S)).T
    return e


def _loglik(predictor: Predictor, white: np.ndarray, noise: Noise, values: Values) -> np.ndarray:
    """Gaussian log-likelihood of each window."""
    _, S = predictor.filter(noise, values)
    return -0.5 * np.sum(white**2, axis=(1, 2)) - 0.5 * white.shape[1] * np.linalg.slogdet(S)[1]


def tune(
    predictor: Predictor, values: Values, where: Windows, noise: Noise, *, width: float = 2.0
) -> tuple[Noise, np.ndarray]:
    """The noise of dw/dt under which the innovations are most likely, to 2 %.

    ``width`` is how far the first look reaches, in natural log units.
    """
    while True:
        factors = np.exp(width * np.linspace(-1.0, 1.0, 5))
        noises = [replace(noise, jump=noise.jump * f) for f in factors]
        white = whitened(predictor, [values] * len(noises), where, noises)
        logliks = [_loglik(predictor, w, q, values) for w, q in zip(white, noises, strict=True)]
        best = int(np.argmax([ll.sum() for ll in logliks]))
        edge = best in (0, 4) and 1e-9 < noise.jump < 1e9
        noise, loglik = noises[best], logliks[best]
        if not edge:
            if width < 0.04:
                return noise, loglik
            width *= 0.35

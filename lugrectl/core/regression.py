"""Robust linear regression with bounds and priors, and what left-out blocks say of it.

    y = X b + r,    r / scale ~ Student t with NU degrees of freedom,    lower <= b <= upper

Column 0 may carry noise of known variance (an acceleration): it is taken off its moment, so that
the coefficient does not shrink.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

NU = 4.0  # degrees of freedom of Student's t: a few bad rows cannot rule
TINY = 1e-300
SETTLED = 0.01  # change of a weight that is none
LEVER = 0.02  # a block that tells all of a value by itself has nothing to be compared with
CLIPS = (3.0, 10.0, 30.0)  # nats: a gain must also stand when no block counts for more


@dataclass(frozen=True, eq=False)
class Prior:
    """What is known of coefficients (k,) beforehand: ``precision`` 1/sigma^2 around ``centre``,
    and the bounds ``low``, ``high``."""

    precision: np.ndarray
    centre: np.ndarray
    low: np.ndarray
    high: np.ndarray

    @classmethod
    def free(cls, k: int, **known: Any) -> Prior:
        """Nothing is known of k coefficients but ``known``, a number or (k,) by name."""
        made = {"precision": 0.0, "centre": 0.0, "low": -np.inf, "high": np.inf} | known
        return cls(**{name: np.broadcast_to(np.asarray(x, float), k) for name, x in made.items()})

    @classmethod
    def joined(cls, *parts: Prior) -> Prior:
        names = ("precision", "centre", "low", "high")
        return cls(*(np.concatenate([getattr(p, k) for p in parts]) for k in names))

    def __len__(self) -> int:
        return len(self.precision)

    def but(self, at: Any, **known: Any) -> Prior:
        """The same, with other things known of the coefficients ``at``."""
        made = {k: getattr(self, k).copy() for k in known}
        for k, value in known.items():
            made[k][at] = value
        return replace(self, **made)


@dataclass(frozen=True, eq=False)
class Fit:
    """Coefficients ``b`` (k,), residuals ``r`` (m,) in scales, weights ``w`` (m,) of the rows, and
    ``free`` (k,), False where a bound holds."""

    b: np.ndarray
    r: np.ndarray
    free: np.ndarray
    w: np.ndarray


def bounded(
    G: np.ndarray,
    g: np.ndarray,
    lower: np.ndarray,
    upper: np.ndarray,
    fixed: np.ndarray | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Minimise b'Gb - 2 g'b with lower <= b <= upper, by an active set that starts at ``fixed``: b
    (k,) and the mask of those that no bound holds."""
    scale = np.sqrt(np.maximum(np.diag(G), TINY))
    fixed = np.zeros(len(g), bool) if fixed is None else fixed.copy()
    b = np.clip(0.0, lower, upper)
    b[fixed] = np.where(np.isfinite(lower), lower, upper)[fixed]
    for _ in range(24 + 3 * len(g)):
        at = np.flatnonzero(~fixed)
        own = G[at]
        best = np.linalg.solve(own[:, at], g[at] - own[:, fixed] @ b[fixed])
        way, bound = best - b[at], np.where(best > b[at], upper[at], lower[at])
        over = (best > upper[at]) | (best < lower[at])
        if over.any():  # as far as the first bound
            part = np.where(over, (bound - b[at]) / np.where(over, way, 1.0), 1.0)
            j = int(np.argmin(part))
            b[at] += part[j] * way
            b[at[j]], fixed[at[j]] = bound[j], True
            continue
        b[at] = best
        push = (g - G @ b) / scale
        push = np.where(b == lower, push, -push) * (lower < upper)
        push[at] = 0.0
        j = int(np.argmax(push))
        if push[j] <= 1e-9 * np.sqrt(np.abs(g @ b)) + TINY:
            break
        fixed[j] = False
    return b, ~fixed


def normal_equations(
    X: np.ndarray, y: np.ndarray, w: np.ndarray, prior: Prior, scale: float, noise: float
) -> tuple[np.ndarray, np.ndarray]:
    """X'WX and X'Wy with their prior; ``noise`` is the variance of column 0 in each row."""
    weighted = X * w[:, None]
    G, g = weighted.T @ X, weighted.T @ y
    size = np.diag(G).copy()
    G[0, 0] -= min(noise * w.sum(), 0.3 * size[0])
    rounding = 1e-12 * size + 1e-18 * size.max() * (size < 1e-24 * size.max())
    G[np.diag_indices(len(size))] += prior.precision * scale**2 + rounding
    return G, g + prior.precision * scale**2 * prior.centre


def robust(
    X: np.ndarray,
    y: np.ndarray,
    prior: Prior,
    scale: float,
    noise: float = 0.0,
    weights: np.ndarray | None = None,
    turns: int = 5,
) -> Fit:
    """Fit y = X b by Student's t at a given ``scale``, by reweighting ``turns`` times at most."""
    w = np.ones(len(y)) if weights is None else weights
    fixed = None
    for _ in range(turns):
        G, g = normal_equations(X, y, w, prior, scale, noise)
        b, free = bounded(G, g, prior.low, prior.high, fixed)
        fixed = ~free & (b != prior.high)
        r = (y - X @ b) / scale
        before, w = w, weight(r)
        if np.max(np.abs(w - before)) < SETTLED:
            break
    return Fit(b, r, free, w)


def weight(r: np.ndarray) -> np.ndarray:
    """Weights (m,) of rows with these residuals, in scales."""
    return (NU + 1) / (NU + r * r)


def spread(r: np.ndarray) -> float:
    """Standard deviation of residuals (m,) of which a few may be bad: by their median size."""
    return 1.4826 * float(np.median(np.abs(r)))


def log_density(r: np.ndarray, stretch: float = 1.0) -> np.ndarray:
    """Log density of each residual (in scales, ``stretch`` times as large), less a constant."""
    return -0.5 * (NU + 1) * np.log1p(r * r * stretch**2 / NU)


class Blocks:
    """Stretches of time over which descriptions are compared: those of ``most`` of equal length in
    which there are rows, ``number`` in all. ``t`` (m,) are the times of the rows, up to
    ``duration``."""

    def __init__(self, t: np.ndarray, duration: float, most: int) -> None:
        at = np.minimum((t / duration * most).astype(int), most - 1)
        first = np.flatnonzero(np.r_[True, np.diff(at) > 0])
        self.most, self.number, self.cut = most, len(first), np.r_[first, len(at)]
        self.parts = [*map(slice, self.cut[:-1], self.cut[1:])]

    def seen(self, r: np.ndarray, stretch: float) -> np.ndarray:
        """Log density of each block (number,) under a fit that has seen it."""
        total = np.r_[0.0, np.cumsum(log_density(r, stretch))]
        return total[self.cut[1:]] - total[self.cut[:-1]]

    def left_out(
        self, fit: Fit, X: np.ndarray, prior: Prior, scale: float, stretch: float
    ) -> np.ndarray:
        """Log density of each block (number,) under the fit without it, by one Newton step."""
        own, r = X[:, fit.free], fit.r
        weighted = own * (fit.w / scale**2)[:, None]
        score = own * (weight(r) * r / scale)[:, None]
        H = own.T @ weighted
        size = np.diag(H).copy()
        rounding = 1e-9 * size + size.max() * (size < 1e-24 * size.max())
        H[np.diag_indices(len(H))] += prior.precision[fit.free] + rounding
        M = np.stack([H - own[k].T @ weighted[k] for k in self.parts])
        S = np.stack([score[k].sum(axis=0) for k in self.parts])
        try:
            step = -np.linalg.solve(M, S[:, :, None])[:, :, 0]
        except np.linalg.LinAlgError:
            step = np.zeros_like(S)
        out = np.zeros(self.number)
        for i, (k, d) in enumerate(zip(self.parts, step, strict=True)):
            out[i] = log_density(r[k] - own[k] @ d / scale, stretch).sum()
        return out


def paired(a: np.ndarray, b: np.ndarray) -> tuple[float, float]:
    """Difference of two scores by block (n,) and its standard error; an effect that few blocks show
    counts by how many they are, not by how much they gain."""
    d = a - b
    total, error = float(d.sum()), float(np.sqrt(len(d)) * d.std(ddof=1)) + 1e-9
    for most in CLIPS:
        c = np.clip(d, -most, most)
        z = float(c.sum() / (np.sqrt(np.sum(c**2)) + 1e-9))  # any sign of a block was as likely
        if z * np.sign(total) > abs(total) / error:
            error = abs(total) / abs(z)
    return total, error


def memory_blocks(r: np.ndarray, fewest: int) -> list[np.ndarray]:
    """Numbers of blocks (m,) longer than the memory of the residual, 4, 8 and 16 times as long."""
    n, x = len(r), r - r.mean()
    lags = range(1, max(min(n // 4, 400), 2))
    c = np.array([np.mean(x[: n - i] * x[i:]) for i in lags]) / (np.mean(x**2) + TINY)
    memory = len(c) if (c >= 0.1).all() else int((c < 0.1).argmax()) + 1
    sizes = {int(np.clip(m * memory, 6, max(n / fewest, 2))) for m in (4, 8, 16)}
    return [np.arange(n) * max(2, n // size) // n for size in sorted(sizes)]


def left_out_covariance(
    X: np.ndarray,
    y: np.ndarray,
    fit: Fit,
    prior: Prior,
    scale: float,
    noise: float,
    blocks: Sequence[np.ndarray],
) -> np.ndarray:
    """Covariance (k, k) of b from fits that leave one block out, the widest over block sizes; what
    one block alone tells is as wide as white noise leaves it, what no row tells as wide as its
    prior."""
    w, k = fit.w / scale**2, X.shape[1]
    G, _ = normal_equations(X, y, fit.w, prior, scale, noise)
    inverse = np.linalg.inv(G / scale**2)
    score = X * (w * (y - X @ fit.b))[:, None]
    taken = min(noise * w.sum(), 0.3 * float(np.sum(w * X[:, 0] ** 2)))
    score[:, 0] += taken * fit.b[0] * w / w.sum()
    V = None
    for block in blocks:
        first = np.flatnonzero(np.r_[True, np.diff(block) > 0])
        parts = np.split(X * w[:, None] ** 0.5, first[1:])
        told = np.stack([x.T @ x for x in parts])
        moved = np.add.reduceat(score, first)[:, :, None]
        d = np.linalg.solve(np.eye(k) * (1 + LEVER) - told @ inverse, moved)[:, :, 0] @ inverse
        new = d.T @ d * (len(first) - 1) / len(first)
        V = new if V is None else widest(V, new)
    assert V is not None
    V = widest(V, inverse)
    P = np.diag(prior.precision)
    return V + inverse @ P @ inverse


def widest(V: np.ndarray, other: np.ndarray) -> np.ndarray:
    """The covariance V, widened to ``other`` in every direction in which that is wider."""
    size = np.sqrt(np.maximum(np.maximum(np.diag(V), np.diag(other)), TINY))
    grown, E = np.linalg.eigh((other - V) / np.outer(size, size))
    return V + np.outer(size, size) * ((E * np.maximum(grown, 0.0)) @ E.T)

"""A robust regression whose columns have noise too.

Minimises, over p, the Student-t likelihood of r = y - X p with

    A p = X' W y - c,    A = X' W X - N + P,    W_i = (nu + 1) / (nu (s^2 + l_i^2) + r_i^2)

N is the information that is only noise of the columns, c the noise that y and a column share,
P the prior, l_i the torque that a window near rest leaves open. Everything is in the units of y.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from .constants import (
    FLOOR_OF_NOISE,
    HUGE,
    MAJORITY,
    MOST,
    NOTHING,
    PASSES,
    RARE,
    ROBUST_PASSES,
    SLIDING,
    STUDENT,
)


@dataclass(frozen=True, eq=False)
class Problem:
    """What is regressed: ``y`` (n,) on ``X`` (n, m), whose last ``derivatives`` columns are
    derivatives of u.

    ``prior`` (m,) are standard deviations of the coefficients around 0, ``level`` is the sliding
    torque, which a window at rest leaves open, ``rest`` (n,) the share of each window at rest.
    ``noise``, ``shared`` (m,) are the variance of the noise of each column, and its covariance
    with that of y, whose variance is ``noise_y``.
    """

    y: np.ndarray
    X: np.ndarray
    prior: np.ndarray
    level: float
    rest: np.ndarray
    noise: np.ndarray
    shared: np.ndarray
    noise_y: float
    derivatives: int = 0

    def with_noise_of_u(self, share: float) -> Problem:
        """With a share of the noise of u."""
        noise = np.where(self.own, self.noise, share * self.noise)
        return replace(self, noise=noise, shared=share * self.shared, noise_y=share * self.noise_y)

    @property
    def own(self) -> np.ndarray:
        """True for the columns that are no derivatives of u."""
        return np.arange(len(self.prior)) < len(self.prior) - self.derivatives


@dataclass(frozen=True, eq=False)
class Solution:
    """Coefficients ``p``, residual ``r``, Student weights ``t``, the scale of each window
    (``variance``), and the matrices: ``A`` that was solved, ``N`` taken off it, ``P`` the prior's
    diagonal, ``c`` the shared noise that was taken off."""

    p: np.ndarray
    r: np.ndarray
    t: np.ndarray
    variance: np.ndarray
    A: np.ndarray
    N: np.ndarray
    P: np.ndarray
    c: np.ndarray


def solve(problem: Problem, weights: np.ndarray | None = None) -> Solution:
    """The fit, starting from the Student weights of a fit nearby, or from ones."""
    y, X, rest = problem.y, problem.X, problem.rest
    huge = (rest > MAJORITY) * HUGE * np.mean(y**2)
    open_torque = (problem.level * rest) ** 2 + huge
    least = FLOOR_OF_NOISE * problem.noise_y + (NOTHING * problem.level) ** 2
    slides = rest < SLIDING
    slides = slides if slides.sum() > 5 * X.shape[1] else np.ones(len(y), bool)
    p, s2 = np.zeros(X.shape[1]), float(np.var(y)) + 1e-300
    t, passes = (np.ones(len(y)), PASSES) if weights is None else (weights, PASSES // 2)
    for i in range(passes):
        W = t / (s2 + open_torque)
        H = X.T @ (W[:, None] * X)
        P = 1 / problem.prior**2 + 1e-12 * np.diag(H)
        N, c = _noise(problem, W.sum(), H, P)
        A = H - N + np.diag(P)
        new = np.linalg.solve(A, X.T @ (W * y) - c)
        r = y - X @ new
        s = _scale(r[slides], s2, least, robust=i < ROBUST_PASSES)
        step = new - p
        settled = abs(s / s2 - 1) < RARE and step @ A @ step < RARE**2
        p, s2, t = new, s, student(r, s + open_torque)
        if settled and i > 2:
            break
    return Solution(p, r, t, s2 + open_torque, A, N, P, c)


def student(r: np.ndarray, variance: np.ndarray | float) -> np.ndarray:
    """Student weights (nu + 1) / (nu + r^2 / variance)."""
    return (STUDENT + 1) / (STUDENT + r**2 / variance)


def deviation(r: np.ndarray) -> float:
    """Standard deviation of a normal density with the median of |r|."""
    return 1.4826 * float(np.median(np.abs(r)))


def weights_near(problem: Problem, p: np.ndarray) -> np.ndarray:
    """Student weights of the residual of given coefficients."""
    r = problem.y - problem.X @ p
    s2 = deviation(r) ** 2 + 1e-300
    return student(r, s2 + (problem.level * problem.rest) ** 2)


def _noise(problem: Problem, total: float, H: np.ndarray, P: np.ndarray) -> tuple:
    """The information N that is noise of the columns, and that of y and the columns together.

    In no direction more than a share of what there is, so that A stays positive definite.
    """
    most = np.where(problem.own, 1.0, MAJORITY)
    noise = np.minimum(problem.noise * total, most * np.diag(H))
    ratio = problem.shared / np.where(problem.noise > 0, problem.noise, 1.0)
    N = np.diag(noise)
    if noise @ np.diag(np.linalg.inv(H + np.diag(P))) > MOST:  # above the largest share
        root = np.linalg.cholesky(H + np.diag(P))
        share, E = np.linalg.eigh(np.linalg.solve(root, np.linalg.solve(root, N).T))
        E = root @ E
        N = (E * np.minimum(share, MOST)) @ E.T
    return N, N @ ratio


def _scale(r: np.ndarray, s2: float, least: float, robust: bool) -> float:
    """Variance of the Student density: from the median at first, then a step of its likelihood.

    The step is that of expectation and maximisation with an expanded scale,
    s^2 = sum w r^2 / sum w with w = (nu + 1) / (nu + r^2 / s^2), which never lowers the likelihood.
    """
    if robust:
        return max(deviation(r) ** 2, least) + 1e-300
    w = student(r, s2)
    return max(float(np.sum(w * r**2) / np.sum(w)), least) + 1e-300


def log_density(solution: Solution) -> float:
    """Log of the density of the residual."""
    return float(np.sum(densities(solution)))


def densities(solution: Solution) -> np.ndarray:
    """Log of the density of the residual in each window (n,), up to a constant."""
    v, nu = solution.variance, STUDENT
    return -0.5 * np.log(v) - (nu + 1) / 2 * np.log1p(solution.r**2 / (nu * v))

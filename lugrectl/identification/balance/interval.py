"""The covariance of the answer: beyond the blocks of one fit, what others would have said."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..unknown_torque.discrepancy import Motion, Rows, discrepancy
from .channel_noise import quantum
from .constants import (
    ENCODER_ERROR,
    LOADED,
    NEIGHBOUR,
    PASSES,
    SCALE_ERROR,
    SLOW_TURN,
    SLOW_TURNS,
)
from .fit import Fit, fit, wide_covariance
from .terms import Term, Travel, turning
from .windows import Source

TORQUES = ("J", "Fc", "Fv", "constant_torque", "slope", "gravity.sin", "gravity.cos")


def interval(
    source: Source,
    widths: Sequence[float],
    made: Fit,
    rivals: Sequence[Fit],
    travel: Travel,
    motion: str,
) -> np.ndarray:
    """V + sum of (p - p')(p - p')' over fits that might as well be right, what is always missing
    from friction, an unknown smooth torque, and the scale error."""
    V = wide_covariance(made) + always_missing(source, made) + unexplained(made, motion)
    near = neighbours(source, widths, made)
    gaps = [beyond_chance(difference(made, other), made.V, other.V) for other in near]
    for gap in (*gaps, *(difference(made, other) for other in rivals)):
        V = V + np.outer(gap, gap)
    return V + of_scale(source, travel, made)


def difference(made: Fit, other: Fit) -> np.ndarray:
    """What another fit says of the coefficients, minus what this one says."""
    gap, said = np.zeros(len(made.p)), dict(zip(other.names, other.p, strict=False))
    for i, name in enumerate(made.names):
        gap[i] = said.get(name, made.p[i]) - made.p[i]
    of_u, of_its_u = made.p[len(made.names) :], other.p[len(other.names) :]
    if len(of_u) == len(of_its_u):
        gap[len(made.names) :] = of_its_u - of_u
    return gap


def neighbours(source: Source, widths: Sequence[float], made: Fit) -> list[Fit]:
    """The fits at the next wider and narrower windows and with another limit of rest."""
    i, setting = list(widths).index(made.half_width), made.setting
    others = {(width, 1.0) for width in widths[max(i - 1, 0) : i + 2]}
    others |= {(made.half_width, NEIGHBOUR)} if setting.rest else set()
    fits = []
    for width, factor in others - {(made.half_width, 1.0)}:
        own = replace(setting, rest=factor * setting.rest)
        other = fit(source, width, made.terms, own, made.delay, rounds=2, start=made.p)
        if other is not None and other.merit < NEIGHBOUR * made.merit:
            fits.append(other)
    return fits


def beyond_chance(gap: np.ndarray, V: np.ndarray, other: np.ndarray) -> np.ndarray:
    """The difference of two fits of one record, without what the worse one has by chance.

    Of two estimates of the same data the better one is uncorrelated with their difference, whose
    covariance is then V' - V. Each component keeps what its square has beyond that.
    """
    s = np.sqrt(np.maximum(np.diag(V), 1e-300))
    size, E = np.linalg.eigh(V / np.outer(s, s))
    size = np.sqrt(np.maximum(size, 1e-12))
    root, back = s[:, None] * E * size, (E / size).T / s  # root root' = V
    share, E = np.linalg.eigh(back @ other @ back.T)
    along = E.T @ (back @ gap)
    chance = np.maximum(share - 1, 0) / np.maximum(along**2, 1e-300)
    return root @ E @ (along * np.sqrt(np.maximum(1 - chance, 0)))


def of_scale(source: Source, travel: Travel, made: Fit) -> np.ndarray:
    """What errors of clock, scale and encoder add to the covariance, (m, m): a value changes by
    itself, a constant torque by Fc."""
    theta, error = source.tracks[0].theta, SCALE_ERROR
    if theta is not None and travel.span:
        error = np.hypot(error, ENCODER_ERROR * quantum(theta) / min(travel.span, 1.0))
    sizes = made.p.copy()
    if "constant_torque" in made.names:
        sizes[made.names.index("constant_torque")] = made.value("Fc")
    return np.diag((error * sizes) ** 2)


def unexplained(made: Fit, motion: str) -> np.ndarray:
    """What an unknown smooth torque may do to the coefficients, (m, m)."""
    d, fit, X = made.windows, made.solution, made.problem.X
    W, P = fit.t / fit.variance / made.overlap, fit.P / made.overlap
    rows = Rows(W * fit.r, (X * W[:, None]).T, W)
    functions = Motion(d.t - d.t.min(), d.theta, d.w, d.u, motion).functions()
    if made.setting.delay_prior:
        next(functions)  # a later torque, which is a term already
    H, score = X.T @ (W[:, None] * X) + np.diag(P), X.T @ (W * fit.r) - P * fit.p
    return discrepancy(H, score, rows, functions)


def always_missing(source: Source, made: Fit) -> np.ndarray:
    """The mean of (C z)(C z)', (m, m), over the sizes z of friction that rises with the load, and
    that turns over slowly after a reversal: every machine has some."""
    if "Fc" not in made.names:
        return np.zeros_like(made.V)
    d, fit, X = made.windows, made.solution, made.problem.X
    travel = max(float(np.ptp(np.cumsum(p.speed)) * p.dt) for p in source.tracks)
    turns = [Term(f"slow turn {x}", turning(0.0, x * travel)) for x in SLOW_TURNS]
    slow = source.windows(made.half_width, turns, made.setting.rest, d.delay)
    if slow is None:
        return np.zeros_like(made.V)
    at = [i for i, name in enumerate(made.names) if name in TORQUES]
    load = np.abs(d.X[:, at] @ made.p[at]) * d.X[:, made.names.index("Fc")]
    Z = np.c_[LOADED * load, SLOW_TURN * made.problem.level * slow.X]
    W = (fit.t / fit.variance)[:, None]
    B = X.T @ (W * Z)
    own = Z - X @ np.linalg.solve(X.T @ (W * X) + np.diag(fit.P), B)
    S, score = own.T @ (W * own) / made.overlap, own.T @ (W[:, 0] * fit.r) / made.overlap
    square, mean = np.eye(len(score)), 1.0
    for _ in range(PASSES):
        spread = np.linalg.inv(S + np.eye(len(score)) / mean)
        square = np.outer(spread @ score, spread @ score) + spread
        mean = float(np.trace(square)) / len(score)
    C = np.linalg.solve(fit.A, B)
    return C @ square @ C.T

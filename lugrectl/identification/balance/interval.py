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
    PASSES_OF_SIZE,
    RATIO_OF_NEIGHBOURS,
    REST_TO_TRY,
    SCALE_ERROR,
    SLOW_TURN,
    SLOW_TURNS,
)
from .fit import Fit, fit, independent, wide_covariance
from .friction_shapes import Between, Chosen, difference, spread
from .terms import Term, Travel
from .windows import Source

TORQUES = ("J", "Fc", "Fv", "constant_torque", "slope", "gravity.sin", "gravity.cos")


def interval(
    source: Source,
    widths: Sequence[float],
    made: Fit,
    choices: Sequence[Chosen],
    rivals: Sequence[Fit],
    travel: Travel,
) -> np.ndarray:
    """V + sum of (p - p')(p - p')' over fits that might as well be right, and the scale error.

    These are the fits at other widths, with another limit of rest and with other shapes.
    """
    V = wide_covariance(made) + allowance(source, made)
    for other in _neighbours(source, widths, made):
        gap = _beyond_chance(difference(made, other, made), made.V, other.V)
        V += np.outer(gap, gap)
    for choice in choices:
        if choice.anchor is not None:
            V += spread(made, choice.anchor, choice.others)
    for other in rivals:
        gap = difference(made, other, made)
        V += np.outer(gap, gap)
    return V + of_scale(source, travel, made)


def of_scale(source: Source, travel: Travel, made: Fit) -> np.ndarray:
    """What errors of clock, scale and encoder add to the covariance, (m, m)."""
    return np.diag((_scale_error(source, travel) * _sizes(made)) ** 2)


def unexplained(made: Fit, motion: str) -> np.ndarray:
    """What an unknown smooth torque may do to the coefficients, (m, m)."""
    d, fit, X = made.windows, made.solution, made.problem.X
    many = independent(made)
    W = fit.t / fit.variance / many
    rows = Rows(W * fit.r, (X * W[:, None]).T, W)
    signals = Motion(d.t - d.t.min(), d.theta, d.w, d.u, motion)
    H, score = fit.H + np.diag(fit.P), X.T @ (W * fit.r) - fit.P * fit.p / many
    return discrepancy(H / many, score, rows, signals.functions())


def _beyond_chance(gap: np.ndarray, V: np.ndarray, other: np.ndarray) -> np.ndarray:
    """The difference of two fits of one record, without what the worse one has by chance.

    Of two estimates of the same data the better one is uncorrelated with their difference, whose
    covariance is then V' - V. Each component keeps what its square has beyond that.
    """
    root, back = _square_root(V)
    inner = back @ other @ back.T
    share, E = np.linalg.eigh((inner + inner.T) / 2)
    along = E.T @ (back @ gap)
    chance = np.maximum(share - 1, 0) / np.maximum(along**2, 1e-300)
    return root @ E @ (along * np.sqrt(np.maximum(1 - chance, 0)))


def _square_root(V: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """R and its inverse, with R R' = V up to rounding."""
    s = np.sqrt(np.maximum(np.diag(V), 1e-300))
    size, E = np.linalg.eigh(V / np.outer(s, s))
    size = np.sqrt(np.maximum(size, 1e-12))
    return s[:, None] * E * size, (E / size).T / s


def _neighbours(source: Source, widths: Sequence[float], made: Fit) -> list[Fit]:
    """The fits at the next wider and narrower windows and with another limit of rest."""
    i, setting = list(widths).index(made.half_width), made.setting
    others = {(widths[min(i + 1, len(widths) - 1)], 1.0), (widths[max(i - 1, 0)], 1.0)}
    others |= {(made.half_width, REST_TO_TRY)} if setting.rest else set()
    fits = []
    for width, factor in others - {(made.half_width, 1.0)}:
        own = replace(setting, rest=factor * setting.rest)
        other = fit(source, width, made.terms, own, made.delay, rounds=2, start=made.p)
        if other is not None and other.merit < RATIO_OF_NEIGHBOURS * made.merit:
            fits.append(other)
    return fits


def _scale_error(source: Source, travel: Travel) -> float:
    """Relative error of clock, scale and encoder."""
    theta = source.tracks[0].theta
    if theta is None or not travel.span:
        return SCALE_ERROR
    return float(np.hypot(SCALE_ERROR, ENCODER_ERROR * quantum(theta) / min(travel.span, 1.0)))


def _sizes(made: Fit) -> np.ndarray:
    """What a relative error of scale changes: a value by itself, a constant by Fc."""
    sizes = made.p.copy()
    if "constant_torque" in made.names:
        sizes[made.names.index("constant_torque")] = made.value("Fc")
    return sizes


def allowance(source: Source, made: Fit) -> np.ndarray:
    """The mean of (C z)(C z)' over what z may be (m, m)."""
    Z = _columns(source, made)
    if Z is None:
        return np.zeros_like(made.V)
    fit, X = made.solution, made.problem.X
    W = (fit.t / fit.variance)[:, None]
    B = X.T @ (W * Z)
    C = np.linalg.solve(fit.A, B)
    own = Z - X @ np.linalg.solve(X.T @ (W * X) + np.diag(fit.P), B)
    S = own.T @ (W * own) / independent(made)
    score = own.T @ (W[:, 0] * fit.r) / independent(made)
    square, mean = np.eye(len(score)), 1.0
    for _ in range(PASSES_OF_SIZE):
        spread = np.linalg.inv(S + np.eye(len(score)) / mean)
        z = spread @ score
        square = np.outer(z, z) + spread
        mean = float(np.trace(square)) / len(score)
    return C @ square @ C.T


def _columns(source: Source, made: Fit) -> np.ndarray | None:
    """Friction that rises with the load, or turns over slowly, of usual size (n, effects)."""
    if "Fc" not in made.names:
        return None
    travel = max(float(np.ptp(np.cumsum(p.speed)) * p.dt) for p in source.tracks)
    turns = [Term(f"slow turn {x}", Between(0.0, x * travel)) for x in SLOW_TURNS]
    windows = source.windows(made.half_width, turns, made.setting.rest, made.windows.delay)
    if windows is None:
        return None
    d, at = made.windows, [i for i, name in enumerate(made.names) if name in TORQUES]
    load = np.abs(d.X[:, at] @ made.p[at]) * d.X[:, made.names.index("Fc")]
    return np.c_[LOADED * load, SLOW_TURN * made.problem.level * windows.X]

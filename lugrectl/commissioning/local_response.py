"""The response by local polynomials and instrumental variables.

    W(k) = P(k) V(k) + T(k)        within each window; P and T are polynomials of order 2

Instruments are the spectrum of the logged reference times the powers of the distance, so that
noise in the loop does not bias P (Pintelon and Schoukens 2012, ch. 7). P is estimated directly:
the map from the reference to V is not smooth while friction reverses. Without a reference:
least squares of W on V and of V on W, and their geometric mean.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import f as f_distribution

from .runs import ORDER, Run, Spacing, Window

SPACING = Spacing(12, 0.014)


@dataclass(frozen=True, eq=False)
class Response:
    """P (n,) at ``w`` (n,) in rad/s, its standard deviation, the radius of its 95 % disc, and the
    coherence: the share of the speed's power in a window that P explains."""

    w: np.ndarray
    P: np.ndarray
    sd: np.ndarray
    radius: np.ndarray
    coherence: np.ndarray


@dataclass(frozen=True, eq=False)
class Shape:
    """A response known up to a smooth factor, num/den: in its windows only that factor is fitted,
    so that a resonance narrower than a window does no harm."""

    num: np.ndarray
    den: np.ndarray


def local_response(
    runs: Sequence[Run],
    windows: Sequence[Window],
    V: Sequence[np.ndarray],
    shapes: Sequence[Shape],
    at: Shape,
) -> Response:
    """P from the torques V of the runs to their speeds; ``at`` is the shape at the centres."""
    top = [shape.num * X for shape, X in zip(shapes, V, strict=True)]
    out = [shape.den * run.W for shape, run in zip(shapes, runs, strict=True)]
    E = [run.E for run in runs if run.E is not None]
    known = E if len(E) == len(runs) else None
    found = np.array([_estimate(one, out, top, known) for one in windows]).T
    scale = at.num / at.den
    sd, radius = found[1].real * abs(scale), found[2].real * abs(scale)
    w = np.array([one.centre for one in windows])
    return Response(w, found[0] * scale, sd, radius, found[3].real)


def _estimate(
    at: Window,
    out: Sequence[np.ndarray],
    top: Sequence[np.ndarray],
    known: Sequence[np.ndarray] | None,
) -> tuple[complex, float, float, float]:
    """P, its standard deviation, the radius of its 95 % disc, and the coherence."""
    W, V = (at.without_transient(at.rows(X)) for X in (out, top))
    wide_w, wide_v = (at.without_transient(at.poly * at.rows(X)[:, None]) for X in (out, top))
    free = max(at.free - ORDER - 1, 1)
    if known is not None:
        Z = at.without_transient(at.poly * at.rows(known)[:, None])
        P, sd, noise = _solve(W, wide_v, Z, free)
    else:
        P, sd, noise = _solve(W, wide_v, wide_v, free)
        back = 1.0 / _solve(V, wide_w, wide_w, free)[0]
        sd = max(sd, 0.5 * abs(back - P))
        P *= np.sqrt(abs(back / P)) * np.exp(0.5j * np.angle(back / P))
    power = float(np.sum(np.abs(W) ** 2)) / max(at.free, 1)
    radius = sd * float(np.sqrt(f_distribution.ppf(0.95, 2, 2 * free)))
    return P, sd, radius, max(1.0 - noise / power, 0.0) if power > 0 else 0.0


def _solve(y: np.ndarray, X: np.ndarray, Z: np.ndarray, free: int) -> tuple[complex, float, float]:
    """The response at the centre of y = X p with instruments Z, its deviation, and the noise."""
    size = np.linalg.norm(X, axis=0) + 1e-300
    Q = np.linalg.qr(Z)[0]
    inverse = np.linalg.pinv(Q.conj().T @ (X / size), rcond=1e-10) / size[:, None]
    p = inverse @ (Q.conj().T @ y)
    noise = float(np.sum(np.abs(y - X @ p) ** 2)) / free
    return p[0], float(np.sqrt(noise * np.sum(np.abs(inverse[0]) ** 2))), noise

"""Gravity and a constant torque over a small angle."""

from __future__ import annotations

import numpy as np

from .constants import BLOCK_MEMORIES
from .fit import Fit
from .terms import Bend, Slope, Term
from .windows import Source


def open_constant(source: Source, made: Fit) -> float:
    """Variance of that part of the constant torque which gravity may take.

    Over a small angle gravity is a constant with a slope; what distinguishes them is the bend,
    (theta - middle)^2 / 2. With the information I on the bend, beside all terms,

        variance = p^2 / (1 + I p^2),

    where p is the constant torque.
    """
    slope = next((term.column for term in made.terms if isinstance(term.column, Slope)), None)
    constant = made.value("constant_torque")
    if slope is None or not constant:
        return 0.0
    terms = [*made.terms, Term("bend", Bend(slope.middle))]
    windows = source.windows(made.half_width, terms, made.setting.rest, made.delay)
    if windows is None:
        return constant**2
    W = 1 / np.sqrt(np.median(made.r**2) + (windows.rest * made.torque) ** 2 + 1e-300)
    others, bend = windows.X[:, :-1] * W[:, None], windows.X[:, -1] * W
    c = np.linalg.lstsq(others, bend, rcond=1e-9)[0]
    information = float(np.sum((bend - others @ c) ** 2))
    information *= BLOCK_MEMORIES[0] * made.blocks / len(bend)
    return constant**2 / (1 + information * constant**2)

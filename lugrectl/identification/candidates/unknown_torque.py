"""An unknown torque as a row of the table: a smooth function of some signals.

Splines or waves with a Gaussian prior on their coefficients; its width is one of two, the more
likely one. It competes like any effect.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np
from scipy.ndimage import uniform_filter1d

from ..unknown_torque.smooth_functions import (
    FINE,
    Surfaces,
    of_law,
    of_motion,
    of_torque,
    spline,
)
from .base_model import Base, Columns, rms
from .candidate import Entry
from .residual_spectrum import spectrum

AMPLITUDES = (0.04, 0.2)  # width of the prior, in friction
MIDDLE = "frequency"  # Hz, in the values of an unknown torque that swings

# columns (m, k), how many places were searched for them, and where they are
Basis = tuple[np.ndarray, int, dict[str, float]]


def entries(base: Base) -> Iterator[Entry]:
    """An entry for each set of signals and width of the prior."""
    size = base.friction_rms
    for signals, bases in _bases(base).items():
        for C, places, middle in bases:
            own = np.sqrt(np.mean(C**2, axis=0))
            own = np.maximum(own, 1e-3 * rms(own) + 1e-300)
            for amplitude in AMPLITUDES if not base.view.quick else (0.1,):
                prior = (own / (amplitude * size)) ** 2
                free = np.full(C.shape[1], np.inf)
                cost = float(np.log(3 * len(bases) * places))
                yield Entry(
                    "unknown(" + ", ".join(signals) + ")",
                    {"amplitude": amplitude, **middle},
                    Columns(C, prior, -free, free),
                    cost=cost,
                    depends_on=frozenset(signals),
                )


class _Some(NamedTuple):
    """The samples of a motion from which the functions are averaged: they are smooth."""

    t: np.ndarray
    theta: np.ndarray
    w: np.ndarray
    motion: str


def _bases(base: Base) -> dict[tuple[str, ...], list[Basis]]:
    """For each set of signals its functions, in more than one way for some."""
    record, m = base.record, base.record.motion
    every = slice(None, None, record.fewer)
    few = _Some(m.t[every], m.theta[every], m.w[every], m.motion)

    def once(key: str, of: object, make: Callable[[], Surfaces]) -> Surfaces:
        return record.once(key, of, lambda: _in_windows(base, make()))

    smooth = {
        **once("unknown of motion", None, lambda: of_motion(few)),
        **once("unknown of torque", base.u, lambda: of_torque(few, base.u[every])),
        **once("unknown of law", base.law, lambda: of_law(few, base.law.z[every])),
    }
    made = {signals: [(C, 1, {}) for C in columns] for signals, columns in smooth.items()}
    made[("t",)].append(_swinging(base))
    return made


def _swinging(base: Base) -> Basis:
    """A wave in time whose amplitude and frequency drift, in the band that is the likeliest."""
    t, record = base.record.rows.t, base.record
    f, power = spectrum(base)
    band = max(1, round(0.5 * FINE / t[-1] / f[1]))  # what so many functions of time can follow
    middle = float(f[np.argmax(uniform_filter1d(power, 2 * band + 1, mode="constant"))])
    phase = 2 * np.pi * middle * t
    drifting = record.once("drifting", None, lambda: spline(t / t[-1], FINE))
    waves = [drifting * wave[:, None] for wave in (np.sin(phase), np.cos(phase))]
    return np.hstack(waves), max(1, int(np.sum(power > 0)) // band), {MIDDLE: middle}


def _in_windows(base: Base, surfaces: Surfaces) -> Surfaces:
    K = base.record.few[0]
    return {k: [K @ x for x in v] for k, v in surfaces.items()}

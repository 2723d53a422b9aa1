"""Slow signals: the band of the motion, in which channels are compared."""

from __future__ import annotations

import numpy as np
from scipy.signal import butter, sosfiltfilt

from .record import Record

BAND = 30.0  # Hz; the motion below this frequency is compared
BLOCKS = 20  # of time, whose spread gives the error of what is estimated


def longest(record: Record) -> Record:
    part = max(record.segments(), key=lambda s: s.stop - s.start)
    return record.slice(part.start, part.stop)


def low_passed(
    record: Record, *signals: np.ndarray, band: float = BAND, keep_ends: bool = False
) -> list[np.ndarray]:
    """Return low-pass filtered signals (the band of the motion), without their ends."""
    edge, end = _edge(record, band)
    sos = butter(3, edge, fs=record.rate, output="sos")
    cut = 0 if keep_ends else end
    return [sosfiltfilt(sos, signal)[cut : len(signal) - cut] for signal in signals]


def _edge(record: Record, band: float) -> tuple[float, int]:
    """The cut-off frequency, Hz, and the number of samples that the filter spoils at each end."""
    edge = min(band, record.rate / 20)
    return edge, int(record.rate / edge)


def long_enough(record: Record, band: float = BAND) -> bool:
    """Whether the longest stretch, without its ends, is long enough for slow signals."""
    part = longest(record)
    return len(part.u) > 2 * (_edge(part, band)[1] + BLOCKS)


def regression(target: np.ndarray, source: np.ndarray, dt: float) -> tuple[float, float]:
    """Fit target = g (source + T d source/dt) + ...; return g and T."""
    first = np.gradient(source, dt)
    terms = np.column_stack([source, first, np.gradient(first, dt), np.ones_like(source)])
    gram = terms.T @ terms
    size = np.sqrt(np.diag(gram))
    size[size == 0] = 1.0  # a source that does not change explains nothing
    found = np.linalg.lstsq(gram / np.outer(size, size), terms.T @ target / size, rcond=1e-12)[0]
    found = found / size
    return float(found[0]), float(found[1] / found[0]) if found[0] else 0.0

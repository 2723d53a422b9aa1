"""Does the residual torque hang on a signal? Held-out smooth functions, no model of the effect."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .data import Log

CELL = 0.01  # s over which the residual torque is averaged
FOLDS = 4
BINS = 80


@dataclass(frozen=True)
class Dependence:
    """How much of the residual torque's power a function of some signals predicts.

    ``share`` is the cross-validated part in [0, 1], ``t`` its mean over its standard error over
    windows, ``rms`` the predicted torque in N m.
    """

    signals: tuple[str, ...]
    share: float
    t: float
    rms: float


def dependences(torque: np.ndarray, log: Log, counted: np.ndarray) -> list[Dependence]:
    """Cross-validated dependence on each signal, strongest first.

    Parameters
    ----------
    torque : (windows, length) array
        Residual torque, N m.
    log : Log
        Motion of the whole record.
    counted : (windows, length) int array
        Sample indices of ``torque``.
    """
    every = max(1, round(CELL / log.dt))
    n = torque.shape[1] // every * every
    r = torque[:, :n].reshape(len(torque), -1, every).mean(2)
    at = counted[:, :n].reshape(len(torque), -1, every)
    signal = {k: getattr(log, k)[at].mean(2) for k in ("t", "theta", "w", "u", "a")}
    way = signal["w"] > 0
    features = {
        ("theta",): _bins(signal["theta"]),
        ("theta", "w"): 2 * _bins(signal["theta"]) + way,
        ("w",): _bins(signal["w"]),
        ("t",): _bins(signal["t"], 24, equal=True),
        ("t", "w"): 2 * _bins(signal["t"], 24, equal=True) + way,
        ("u",): _bins(signal["u"]),
        ("a",): _bins(signal["a"]),
    }
    if log.motion == "rotary" and np.ptp(signal["theta"]) > 2.5 * np.pi:
        turn = np.floor(np.mod(signal["theta"], 2 * np.pi) * BINS / (2 * np.pi)).astype(int)
        features["theta", "turn"] = turn
        features["theta", "w", "turn"] = 2 * turn + way
    found = [_validated(k, r, bins) for k, bins in features.items()]
    return sorted(found, key=lambda d: -d.share)


def _bins(x: np.ndarray, count: int = BINS, equal: bool = False) -> np.ndarray:
    """Index of the cell of each value: equally wide, or equally full."""
    if equal:
        edges = np.linspace(x.min(), x.max(), count + 1)[1:-1]
    else:
        edges = np.quantile(x, np.linspace(0, 1, count + 1)[1:-1])
    return np.searchsorted(edges, x)


def _validated(name: tuple[str, ...], r: np.ndarray, bins: np.ndarray) -> Dependence:
    """Means by cell from the other folds predict each fold; neighbouring windows stay apart."""
    fold = np.arange(len(r)) % FOLDS
    predicted = np.zeros_like(r)
    size = int(bins.max()) + 1
    for k in range(FOLDS):
        own = fold == k
        count = np.bincount(bins[~own].ravel(), minlength=size)
        total = np.bincount(bins[~own].ravel(), r[~own].ravel(), minlength=size)
        predicted[own] = (total / (count + 3.0))[bins[own]]
    gain = np.sum(r**2 - (r - predicted) ** 2, axis=1)
    power = float(np.sum(r**2))
    spread = float(np.std(gain, ddof=1)) * np.sqrt(len(gain))
    signals = tuple(s for s in name if s != "turn")
    return Dependence(
        signals,
        max(0.0, float(gain.sum()) / max(power, 1e-300)),
        float(gain.sum()) / max(spread, 1e-300),
        float(np.sqrt(np.mean(predicted**2))),
    )

"""Is anything left, and on which signal does it hang? No model of the effect is used."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .data import Log

CELL = 0.01  # s over which the residual torque is averaged
FOLDS = 4
BINS = 80
ORDER = 12  # past innovations that are asked to predict the next
UNEVEN = 10.0  # times that the loudest quarter of the windows exceeds the quietest


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
    signal["u"] = _beside(signal["u"])
    way = signal["w"] > 0
    turning = log.motion == "rotary" and np.ptp(signal["theta"]) > 2.5 * np.pi
    around = _turn(signal["theta"]) if turning else _bins(signal["theta"], BINS // 2)
    features = {
        ("theta",): _bins(signal["theta"]),
        ("theta", "w"): 2 * _bins(signal["theta"]) + way,
        ("w",): _bins(signal["w"]),
        ("t",): _bins(signal["t"], 24, equal=True),
        ("t", "w"): 2 * _bins(signal["t"], 24, equal=True) + way,
        ("u",): _bins(signal["u"]),
        ("a",): _bins(signal["a"]),
    }
    if turning:
        features["theta", "turn"] = around
        features["theta", "w", "turn"] = 2 * around + way
    found = [_validated(k, r, bins) for k, bins in features.items()]
    found.append(_validated(("theta", "slope"), r, around, signal["a"]))
    return sorted(found, key=lambda d: -d.share)


def _beside(u: np.ndarray) -> np.ndarray:
    """Mean of the neighbouring cells: noise on the torque is in the residual, too."""
    padded = np.pad(u, ((0, 0), (1, 1)), mode="edge")
    return 0.5 * (padded[:, :-2] + padded[:, 2:])


def _turn(theta: np.ndarray) -> np.ndarray:
    return np.floor(np.mod(theta, 2 * np.pi) * BINS / (2 * np.pi)).astype(int)


def _bins(x: np.ndarray, count: int = BINS, equal: bool = False) -> np.ndarray:
    """Index of the cell of each value: equally wide, or equally full."""
    if equal:
        edges = np.linspace(x.min(), x.max(), count + 1)[1:-1]
    else:
        edges = np.quantile(x, np.linspace(0, 1, count + 1)[1:-1])
    return np.searchsorted(edges, x)


def _validated(
    name: tuple[str, ...], r: np.ndarray, bins: np.ndarray, slope: np.ndarray | None = None
) -> Dependence:
    """Means by cell (or slopes against a signal) from the other folds predict each fold."""
    x = np.ones_like(r) if slope is None else slope / np.std(slope)
    fold = np.arange(len(r)) % FOLDS
    predicted = np.zeros_like(r)
    size = int(bins.max()) + 1
    for k in range(FOLDS):
        own = fold == k
        count = np.bincount(bins[~own].ravel(), (x**2)[~own].ravel(), minlength=size)
        total = np.bincount(bins[~own].ravel(), (x * r)[~own].ravel(), minlength=size)
        predicted[own] = (total / (count + 3.0))[bins[own]] * x[own]
    gain = np.sum(r**2 - (r - predicted) ** 2, axis=1)
    power = float(np.sum(r**2))
    spread = float(np.std(gain, ddof=1)) * np.sqrt(len(gain))
    return Dependence(
        tuple(s for s in name if s not in ("turn", "slope")),
        max(0.0, float(gain.sum()) / max(power, 1e-300)),
        float(gain.sum()) / max(spread, 1e-300),
        float(np.sqrt(np.mean(predicted**2))),
    )


def uneven(innovations: np.ndarray) -> bool:
    """Whether some windows hardly surprise the model while others do: it is not noise then."""
    power = np.sort(np.sum(innovations**2, axis=(1, 2)))
    top = float(np.mean(power[-max(1, len(power) // 4) :]))
    return top > UNEVEN * float(power[len(power) // 10])


def colour(innovations: np.ndarray) -> np.ndarray:
    """Part of each channel's power that its own past predicts, (channels,): 0 for white noise.

    Fitted on every other window and counted on the rest.
    """
    return np.array([_predictable(e) for e in np.moveaxis(innovations, 2, 0)])


def _predictable(e: np.ndarray) -> float:
    if not np.any(e):
        return 0.0
    past = np.lib.stride_tricks.sliding_window_view(e[:, :-1], ORDER, axis=1)
    ahead = e[:, ORDER:]
    missed = total = 0.0
    for fold in (0, 1):
        own = np.arange(len(e)) % 2 == fold
        c, *_ = np.linalg.lstsq(past[~own].reshape(-1, ORDER), ahead[~own].ravel(), rcond=None)
        missed += float(np.sum((ahead[own] - past[own] @ c) ** 2))
        total += float(np.sum(ahead[own] ** 2))
    return 1.0 - missed / total

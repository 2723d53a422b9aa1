"""Is anything left? No model of the effect is used."""

from __future__ import annotations

import numpy as np

from .data import Log
from .shapes import wraps

CELL = 0.01  # s over which the residual torque is averaged
FOLDS = 4
BINS = 80
ORDER = 12  # past innovations that are asked to predict the next
ROW = 8  # samples in a row that may tell as little as one
UNEVEN = 10.0  # times that the loudest quarter of the windows exceeds the quietest


def predictable(torque: np.ndarray, log: Log, counted: np.ndarray) -> tuple[float, float]:
    """The largest share of a residual torque's power that a function of some signals predicts.

    A quick look along the torque, cross-validated. Returns the share, in [0, 1], and the mean
    gain over its standard error over windows.

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
    turning = wraps(signal["theta"], log.motion)
    around = _turn(signal["theta"]) if turning else _bins(signal["theta"], BINS // 2)
    place, time = _bins(signal["theta"]), _bins(signal["t"], 24, equal=True)
    cells = [place, 2 * place + way, time, 2 * time + way]
    cells += [_bins(signal[k]) for k in ("w", "u", "a")]
    if turning:
        cells += [around, 2 * around + way]
    found = [_validated(r, bins) for bins in cells]
    return max([*found, _validated(r, around, signal["a"])])


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
    r: np.ndarray, bins: np.ndarray, slope: np.ndarray | None = None
) -> tuple[float, float]:
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
    share, t = float(gain.sum()) / max(power, 1e-300), float(gain.sum()) / max(spread, 1e-300)
    return max(0.0, share), t


def uneven(innovations: np.ndarray, told: np.ndarray) -> bool:
    """Whether some windows hardly surprise the model while others do: it is not noise then.

    ``told`` (windows,): whether the sensors told more in it than that they stand on one count,
    where noise smaller than a count cannot be seen and nothing surprises any model.
    """
    power = np.sum(innovations**2, axis=(1, 2))
    top = float(np.mean(np.sort(power)[-max(1, len(power) // 4) :]))
    quiet = np.sort(power[told])
    return len(quiet) > 0 and top > UNEVEN * float(quiet[len(quiet) // 10])


def colour(innovations: np.ndarray) -> np.ndarray:
    """Part of each channel's power that its own past predicts, (channels,): 0 for white noise.

    Fitted on every other window and counted on the rest.
    """
    return np.array([_predictable(e) for e in np.moveaxis(innovations, 2, 0)])


def repeated(innovations: np.ndarray) -> float:
    """How many innovations in a row tell no more than one that is white, at least 1.

    By the power of their means over some samples, in the channel where that is the most. A coarse
    encoder says the same for a while.
    """
    e = innovations[:, : innovations.shape[1] // ROW * ROW]
    means = e.reshape(len(e), -1, ROW, e.shape[2]).mean(2)
    power = np.maximum(np.mean(e**2, axis=(0, 1)), 1e-300)
    return max(1.0, float(np.max(ROW * np.mean(means**2, axis=(0, 1)) / power)))


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

"""Whiteness and heteroskedasticity of the innovations, and explained variance of the residual.

No model of an effect is used.
"""

from __future__ import annotations

import numpy as np

from .data import Log
from .shapes import wraps

CELL = 0.01  # s over which the residual torque is averaged
FOLDS = 4
BINS = 80
ORDER = 12  # past innovations from which the next one is predicted
ROW = 8  # consecutive samples that may carry the information of one
UNEVEN = 10.0  # ratio of power: loudest quarter of the windows to the quietest tenth


def predictable(torque: np.ndarray, log: Log, counted: np.ndarray) -> tuple[float, float]:
    """The largest share of a residual torque's power that a function of some signals predicts.

    A quick cross-validated estimate. Returns the share, in [0, 1], and the mean gain divided by
    its standard error between windows.

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
    """Mean of the neighbouring cells, because noise of the torque is also in the residual."""
    padded = np.pad(u, ((0, 0), (1, 1)), mode="edge")
    return 0.5 * (padded[:, :-2] + padded[:, 2:])


def _turn(theta: np.ndarray) -> np.ndarray:
    return np.floor(np.mod(theta, 2 * np.pi) * BINS / (2 * np.pi)).astype(int)


def _bins(x: np.ndarray, count: int = BINS, equal: bool = False) -> np.ndarray:
    """Index of the bin of each value: bins of equal width, or with equally many values."""
    if equal:
        edges = np.linspace(x.min(), x.max(), count + 1)[1:-1]
    else:
        edges = np.quantile(x, np.linspace(0, 1, count + 1)[1:-1])
    return np.searchsorted(edges, x)


def _validated(
    r: np.ndarray, bins: np.ndarray, slope: np.ndarray | None = None
) -> tuple[float, float]:
    """Share and t of predicting each fold by the bin means (or slopes) of the other folds."""
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


def uneven(innovations: np.ndarray, informative: np.ndarray) -> bool:
    """True if innovations are small in some windows and large in others: that is not noise.

    ``informative`` (windows,): False where the sensors stay on one count. Noise below a count
    does not show there, and no model has large innovations.
    """
    power = np.sum(innovations**2, axis=(1, 2))
    top = float(np.mean(np.sort(power)[-max(1, len(power) // 4) :]))
    quiet = np.sort(power[informative])
    return len(quiet) > 0 and top > UNEVEN * float(quiet[len(quiet) // 10])


def colour(innovations: np.ndarray) -> np.ndarray:
    """Part of each channel's power that its own past predicts, (channels,): 0 for white noise.

    Fitted on every other window and evaluated on the others.
    """
    return np.array([_predictable(e) for e in np.moveaxis(innovations, 2, 0)])


def repeated(innovations: np.ndarray) -> float:
    """Number of consecutive innovations with the information of one white one, at least 1.

    From the power of their means over a few samples, in the channel where that is largest. A
    coarse encoder repeats its values.
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

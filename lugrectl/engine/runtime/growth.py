"""Solutions that grow without bound, although every number of them may still be finite."""

from __future__ import annotations

import contextlib
import warnings
from collections.abc import Iterator, Sequence

import numpy as np

from ...core.errors import Diverged

BOUND = 1e15  # of what starts and drives a run: beyond it no digit of a double is about the start
HALVED = 1e-4  # in the first half of the run at most this part: it grows like an exponential
SIGN = (
    " Does the feedback have the right sign? The controllers here act on e = measured - reference."
)


def bounded(
    name: str,
    t: np.ndarray,
    rows: Sequence[np.ndarray],
    labels: Sequence[Sequence[str]],
    driven: Sequence[np.ndarray],
    *,
    looped: bool,
) -> None:
    """Diverged, with signal and time, where a row grows without bound or is not a number.

    Parameters
    ----------
    rows, labels : lists of arrays (n, N) and of their names
        States first: the earliest one of the first array in which a row grows is named.
    driven : arrays
        Inputs and initial states: their largest value, at least 1, is the size of the run.
    looped : bool
        Several blocks: the message then mentions the sign of the feedback.
    """
    size = max([1.0, *(float(np.max(np.abs(part))) for part in driven if np.size(part))])
    for group, names in zip(rows, labels, strict=True):
        if not np.size(group) or np.abs(group).max() <= BOUND * size:
            continue
        found = []
        for row, label in zip(group, names, strict=True):
            k = _beyond(t, row, BOUND * size)
            if k is not None:
                found.append((k, label, row[k]))
        if found:
            k, label, value = min(found, key=lambda one: one[0])
            said = f"{name}: {label} grows without bound: it is {value:.3g} at t = {t[k]:.6g} s."
            raise Diverged(said + (SIGN if looped else ""))


def stopped(
    name: str, labels: Sequence[str], t: float, x: np.ndarray, message: str, *, looped: bool
) -> Diverged:
    """The error where a solver of SciPy gives up: its largest state, the time and why."""
    i = int(np.argmax(np.where(np.isfinite(x), np.abs(x), np.inf)))
    said = f"{name}: the solver stops at t = {t:.6g} s, where state {labels[i]} is {x[i]:.3g}: "
    return Diverged(said + message.rstrip(".") + "." + (SIGN if looped else ""))


@contextlib.contextmanager
def quiet() -> Iterator[None]:
    """Without the warnings of LSODA on convergence: the error names state and time."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "lsoda", UserWarning)
        yield


def _beyond(t: np.ndarray, row: np.ndarray, bound: float) -> int | None:
    """The first sample beyond the bound, of a row that grows like an exponential."""
    beyond = ~(np.abs(row) <= bound)
    if not beyond.any():
        return None
    k = int(np.argmax(beyond))
    if not np.isfinite(row).all():
        return k
    early = np.abs(row[t <= 0.5 * (t[0] + t[-1])]).max()
    return k if early <= HALVED * np.abs(row).max() else None

"""Runs that end badly: what grows without bound, is no number, or never settles."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence

import numpy as np

from ...core.errors import Diverged

BOUND = 1e15  # of what starts and drives a run: beyond it no digit of a double is about the start
HALVED = 1e-4  # in the first half of the run at most this part: it grows like an exponential
SIGN = (
    " Does the feedback have the right sign? The controllers here act on e = measured - reference."
)
STEPS = 5000  # of a solver that may be held at one time
LITTLE = 1e-4  # of the whole time


def bounded(
    name: str,
    t: np.ndarray,
    rows: Sequence[np.ndarray],
    labels: Callable[[], Sequence[Sequence[str]]],
    driven: Sequence[np.ndarray],
    *,
    looped: bool,
) -> None:
    """Raise Diverged, with signal and time, where a row of arrays (n, N) grows without bound or is
    not a number; the largest of ``driven``, at least 1, is the size of the run."""
    size = max([1.0, *(float(np.max(np.abs(part))) for part in driven if np.size(part))])
    large = [np.size(group) and not np.abs(group).max() <= BOUND * size for group in rows]
    for i, names in enumerate(labels() if any(large) else ()):
        group = rows[i]
        found = []
        for row, label in zip(group if large[i] else (), names, strict=False):
            beyond = ~(np.abs(row) <= BOUND * size)
            k, early = int(np.argmax(beyond)), np.abs(row[t <= 0.5 * (t[0] + t[-1])]).max()
            grows = early <= HALVED * np.abs(row).max()  # like an exponential
            if beyond.any() and (grows or not np.isfinite(row).all()):
                found.append((k, label, row[k]))
        if found:
            k, label, value = min(found, key=lambda one: one[0])
            said = f"{name}: {label} grows without bound: it is {value:.3g} at t = {t[k]:.6g} s."
            raise Diverged(said + (SIGN if looped else ""))


def no_bound(name: str, states: Sequence[str], status: np.ndarray) -> Diverged:
    """Return the error of generated code that gives up at a state and a time."""
    return Diverged(
        f"{name}: state {states[int(status[2])]} grows without bound, is not a number, or changes "
        f"faster than steps can follow, at t = {status[1]:.6g} s."
    )


def first_bad(t: np.ndarray, y: np.ndarray) -> tuple[int, int, str] | None:
    """Return row, sample and "nan at t = 1 s" of the earliest value that is not finite."""
    if np.isfinite(y).all():
        return None
    k, i = np.argwhere(~np.isfinite(y.T))[0]
    return int(i), int(k), f"{y[i, k]} at t = {t[k]:.6g} s."


def warn_unsettled(name: str, when: float, stacklevel: int) -> None:
    """Warn of a sign that switches without end near a time (nan: none does)."""
    if np.isfinite(when):
        warnings.warn(
            f"{name}: a sign or comparison switches without end near t = {when:.6g} s; the result "
            "there is coarse: write np.tanh(w/eps) for np.sign(w).",
            RuntimeWarning,
            stacklevel=stacklevel + 1,
        )


class Chatter:
    """An event function for ``solve_ivp`` that never occurs: it sees every step, and raises
    Diverged where a comparison in a block holds the solver at one time."""

    terminal = False

    def __init__(self, name: str, seconds: float) -> None:
        self.name, self.least, self.steps, self.begun = name, LITTLE * seconds, 0, -np.inf

    def __call__(self, t: float, x: np.ndarray) -> float:
        self.steps += 1
        if self.steps % STEPS == 0:
            if t - self.begun < self.least:
                raise Diverged(
                    f"{self.name}: a comparison (an if) in a block switches without end near "
                    f"t = {t:.6g} s: write np.where for it, or np.tanh(x/eps) for a sign."
                )
            self.begun = t
        return 1.0

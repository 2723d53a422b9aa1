"""The same drives as other logs hold them: what a scope or a PLC exports of theta, w and u."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace

import numpy as np
from scipy.signal import butter, filtfilt

from .hiding import find
from .record import Case

Columns = dict[str, np.ndarray]
COUNTS = 1e5  # of the encoder over the travel
CUTOFF = 40.0  # Hz, of a filtered speed


def _counted(columns: Columns) -> tuple[np.ndarray, np.ndarray]:
    """The position on an encoder, and its difference."""
    count = np.ptp(columns["theta"]) / COUNTS
    theta = np.round(columns["theta"] / count) * count
    return theta, np.diff(theta, prepend=theta[0]) / _dt(columns)


def _dt(columns: Columns) -> float:
    return float(np.median(np.diff(columns["t"])))


def _difference(columns: Columns) -> Columns:
    theta, w = _counted(columns)
    return {"theta": theta, "w": w}


def _smoothed(columns: Columns) -> Columns:
    theta, w = _counted(columns)
    b, a = butter(2, min(0.9, 2.0 * CUTOFF * _dt(columns)))
    return {"theta": theta, "w": filtfilt(b, a, w)}


def _difference_alone(columns: Columns) -> Columns:
    return {"w": _counted(columns)[1]}


def _position_alone(columns: Columns) -> Columns:
    return {"theta": _counted(columns)[0]}


def _one_late(columns: Columns) -> Columns:
    u = columns["u"]
    return {**_sensed(columns), "u": np.concatenate([u[:1], u[:-1]])}


def _half_late(columns: Columns) -> Columns:
    late = _one_late(columns)
    return late | {"u": 0.5 * (late["u"] + columns["u"])}


def _sensed(columns: Columns) -> Columns:
    return {k: columns[k] for k in ("theta", "w") if k in columns}


LATE = ("u half a sample late", "u a sample late")
EXPORTS: dict[str, Callable[[Columns], Columns]] = {
    "w differentiated": _difference,
    "w smoothed": _smoothed,
    "a difference alone": _difference_alone,
    "a position alone": _position_alone,
    **dict(zip(LATE, (_half_late, _one_late), strict=True)),
}


def forms(names: Iterable[str]) -> list[str]:
    """Those that leave these effects what they are."""
    if any(find(name).only == "tacho" for name in names):
        return []
    late = any(find(name).late for name in names)
    return [form for form in EXPORTS if not (late and form in LATE)]


def exported(case: Case, form: str) -> Case:
    """The case with its theta, w and u in another form."""
    made = EXPORTS[form](case.columns)
    rest = {k: v for k, v in case.columns.items() if k not in ("theta", "w")}
    more = tuple(exported(run, form) for run in case.more)
    return replace(
        case,
        columns=rest | made,
        truth=case.truth | {"hard": case.truth.get("hard") or form},
        more=more,
    )

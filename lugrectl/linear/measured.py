"""Checks of a measured frequency response: they hold for its frequencies, and say so."""

from __future__ import annotations

import math
from itertools import groupby
from typing import Any

import control as ct
import numpy as np

from ..core.errors import InputError

FREQUENT = 2  # least number of frequencies


def is_measured(T: Any) -> bool:
    """Whether T is a control.FrequencyResponseData."""
    return isinstance(T, ct.FrequencyResponseData)


def response(T: Any, name: str = "T") -> tuple[np.ndarray, np.ndarray]:
    """Frequencies w >= 0 in rad/s, ascending, and T(jw) there.

    Raises InputError for several channels, too few frequencies, or values that are not finite.
    """
    if (T.ninputs, T.noutputs) != (1, 1):
        raise InputError(
            f"{name} has {T.ninputs} inputs and {T.noutputs} outputs, but the check is for one of "
            f"each; pick one channel, such as {name}[0, 0]."
        )
    w, values = np.asarray(T.omega, dtype=float), np.asarray(T.frdata, dtype=complex)[0, 0]
    if len(w) < FREQUENT:
        raise InputError(f"{name} has {len(w)} frequencies; at least {FREQUENT} are needed.")
    if not (np.isfinite(w).all() and np.isfinite(values).all() and (w >= 0).all()):
        raise InputError(f"{name}: the frequencies and values of the response must be finite.")
    order = np.argsort(w, kind="stable")
    if not np.diff(w[order]).all():
        raise InputError(f"{name} has two values at one frequency; give each frequency once.")
    return w[order], values[order]


def span(w: np.ndarray) -> str:
    return f"the {len(w)} measured frequencies from {w[0]:.6g} to {w[-1]:.6g} rad/s"


def realness(T: Any) -> tuple[str, float, str]:
    """Classification, band edge in rad/s and reason, of Re T(jw) at the measured frequencies."""
    w, values = response(T)
    real = np.real(values)
    if (real > 0).all():
        kind, said = "SPR", f"Re T(jw) > 0 at all of {span(w)}; {_least(w, real)}"
    elif (real >= 0).all():
        kind, said = "PR", f"Re T(jw) >= 0 at all of {span(w)}; {_least(w, real)}"
    else:
        kind, said = "not PR", f"Re T(jw) < 0 {_bands(w, real)}, of {span(w)}"
    beyond = (
        "" if kind == "not PR" else "; outside them, and on whether T is stable, it says nothing"
    )
    return kind, _edge(w, real), said + beyond


def _least(w: np.ndarray, real: np.ndarray) -> str:
    k = int(np.argmin(real))
    return f"the least value is {real[k]:.4g} at {w[k]:.6g} rad/s"


def _bands(w: np.ndarray, real: np.ndarray) -> str:
    bands, k = [], 0
    for below, group in groupby(real < 0):
        many = len([*group])
        if below:
            bands.append(f"from {w[k]:.6g} to {w[k + many - 1]:.6g} rad/s")
        k += many
    return " and ".join(bands)


def _edge(w: np.ndarray, real: np.ndarray) -> float:
    """Where Re T, linear in log w between the measured frequencies, first reaches 0."""
    if real[0] <= 0:
        return 0.0
    bad = np.flatnonzero(real <= 0)
    if not len(bad):
        return float(w[-1])
    return _between(w, real, int(bad[0]))


def _between(w: np.ndarray, values: np.ndarray, k: int) -> float:
    """The zero of values between w[k - 1] and w[k]."""
    part = values[k - 1] / (values[k - 1] - values[k])
    if w[k - 1] <= 0:
        return float(w[k - 1] + part * (w[k] - w[k - 1]))
    return float(w[k - 1] * (w[k] / w[k - 1]) ** part)


def crossings(T: Any, power: float) -> tuple[tuple[float, ...], str]:
    """Where |T|^2, linear in dB over log w, crosses ``power`` times its value at the lowest
    frequency, falling and rising in turn, and what the answer depends on."""
    w, values = response(T)
    size = np.abs(values)
    if size[0] == 0:
        where = f"the lowest frequency, {w[0]:.6g} rad/s"
        return (), f"|T| is 0 at {where}, so there is no gain to measure a bandwidth from"
    with np.errstate(divide="ignore"):
        above = 20 * np.log10(np.maximum(size, 1e-300) / size[0]) - 10 * math.log10(power)
    found = [
        _between(w, above, k) for k in range(1, len(w)) if (above[k] < 0) != (above[k - 1] < 0)
    ]
    said = (
        f"relative to |T| = {size[0]:.6g} at the lowest frequency, of {span(w)}; on lower "
        "frequencies, and on whether T is stable, it says nothing"
    )
    return tuple(found), said

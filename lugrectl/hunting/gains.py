"""The gains of a position loop, and the values at which it begins or ceases to hunt."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache
from typing import Any

import numpy as np

from ..core.errors import InputError
from ..core.validation import number, positive, shown

GAINS = ("kp", "ki", "kd")
ALL = (*GAINS, "kv")
PAPER = {"kp": 15.0, "ki": 1.55, "kd": 0.0}  # the source paper's position loop
SCANNED = 9  # values of a gain between its ends
CLOSE = np.exp(1e-3)  # ratio of the two values between which a critical one lies

Hunts = Callable[..., bool | None]


def varied(*values: Any) -> Callable[..., dict[str, float]]:
    """Return kp, ki and kd of the PID by gains that are changed, from kp, ki, kd and kv."""
    own = {k: v for k, v in zip(ALL, values, strict=True) if v is not None}
    return lambda **changed: pid_gains(**dict.fromkeys(ALL) | (own or PAPER) | changed)


def pid_gains(kp: Any, ki: Any, kd: Any, kv: Any) -> dict[str, float]:
    """Return kp, ki and kd of the PID: the paper's if none is given, else 0 for those left out."""
    given = {k: v for k, v in zip(GAINS, (kp, ki, kd), strict=True) if v is not None}
    gains: dict[str, float] = {k: number(given.get(k, 0.0), k) for k in GAINS}
    gains = gains if given or kv is not None else dict(PAPER)
    if kv is not None:
        if kd is not None:
            raise InputError("with kv the loop is a cascade, which has no kd: give one of them.")
        kp, ki, kd = cascade_as_pid(number(kv, "kv"), gains["kp"], gains["ki"])
        gains = {"kp": kp, "ki": ki, "kd": kd}
    for k, v in gains.items():
        if v < 0.0 or (k == "kp" and v == 0.0):
            raise InputError(f"{k} = {v:g}: a position loop needs kp above 0, ki and kd from 0 on.")
    return gains


def cascade_as_pid(kv: Any, kp: Any, ki: Any, dt: float = 0.0) -> tuple[Any, Any, Any]:
    """Return kp, ki and kd of the PID that u = -(kp + ki int)(kv e + w) is.

    With a step ``dt``, where w is a difference and the integral that of trapezoids,
    int w = e - w dt/2.
    """
    return kp * kv + ki, ki * kv, kp - 0.5 * dt * ki


def ranges(given: Any, what: str, names: tuple[str, ...] = ALL) -> dict[str, tuple[float, float]]:
    """Return gains and their ends; InputError names the argument."""
    if isinstance(given, Mapping) and (unknown := [k for k in given if k not in names]):
        raise InputError(
            f"{what}: there is no gain {shown(unknown[0])}; known: {', '.join(names)}."
        )
    if not isinstance(given, Mapping) or not given:
        example = '{"ki": (1, 50)}'
        raise InputError(f"{what} must be gains and their ends, {example}, not {shown(given)}.")
    made = {}
    for name, ends in given.items():
        if not isinstance(ends, (tuple, list)) or len(ends) != 2:
            raise InputError(f"{what}: {name} needs its two ends, not {shown(ends)}.")
        low, high = (positive(v, f"{what}: {name}") for v in ends)
        if low >= high:
            raise InputError(f"{what}: {name} goes from {low:g} to {high:g}; give them increasing.")
        made[name] = (low, high)
    return made


def edge(
    holds: Callable[[float], bool],
    a: float,
    b: float,
    ratio: float = CLOSE,
    ends: Callable[[], bool] = lambda: False,
) -> tuple[float, float]:
    """Bisect to the last value from a towards b at which it holds, and the next at which it does
    not, until they are as near as ``ratio``."""
    while abs(np.log(b / a)) > np.log(ratio) and not ends():
        middle = float(np.sqrt(a * b))
        a, b = (middle, b) if holds(middle) else (a, middle)
    return a, b


def critical(hunts: Hunts, vary: Mapping[str, tuple[float, float]], what: str) -> dict[str, Any]:
    """Find by gain where ``hunts(ki=...)`` changes, and say where ``what`` begins and ends."""
    values, said = {}, []
    for name, ends in vary.items():
        changes, first = _changes(cache(lambda v, name=name: hunts(**{name: v})), *ends)
        values[name] = tuple(value for value, _ in changes)
        where = {True: "every value", False: "no value", None: "no value that is decided"}[first]
        words = [
            f"{'begins' if begins else 'ends'} "
            + (f"at {v:.4g}" if np.isscalar(v) else "between {:.4g} and {:.4g}".format(*v))
            for v, begins in changes
        ] or ["neither begins nor ends: it is there at {} from {:g} to {:g}".format(where, *ends)]
        said.append(f"as {name} rises, {what} {', '.join(words)}")
    return {"critical": values, "messages": tuple(said)}


def _changes(
    at: Callable[[float], bool | None], low: float, high: float
) -> tuple[list[tuple[Any, bool]], bool | None]:
    """Scan in even ratios, then bisect to each change, and whether something begins there; and
    the first answer. Two ends where it is None, undecided, between them."""

    def change(a: float, b: float) -> Any:
        """Where the answer at a ends, and that at b begins if it is later."""
        a, middle = edge(lambda v: at(v) == at(a), a, b)
        if at(middle) == at(b):
            return float(np.sqrt(a * middle))
        return a, edge(lambda v: at(v) == at(b), b, middle)[0]

    sure = [v for v in map(float, np.geomspace(low, high, SCANNED)) if at(v) is not None]
    pairs = zip(sure, sure[1:], strict=False)
    changes = [(change(a, b), bool(at(b))) for a, b in pairs if at(a) != at(b)]
    return changes, at(sure[0]) if sure else None

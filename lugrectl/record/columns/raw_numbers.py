"""What the numbers of a column show: an angle that is not in rad, a register without its sign."""

from __future__ import annotations

import numpy as np

from ...core.errors import InputError
from ...core.option_names import option
from ..samples.clock import HUGE

# ---- angles without a unit -------------------------------------------------------

_FASTEST = 1e4  # rad/s, 95 000 rpm: no drive that is logged by position turns faster
_CELLS = 100  # least number of encoder steps that show their size
_SPAN = 2000  # least range, in encoder steps: a grid of another size drifts out of step over it
_SHARP = 0.9  # coherence with a grid, 1 for a grid without rounding
_CHANGES = 0.02  # share of samples at which the count of steps changes: at one speed the samples
# themselves lie on a grid, and none does
_TURN = {"rad": 2 * np.pi, "deg": 360.0, "rev": 1.0}
# Steps per turn of usual encoders that are no power of two: four times the lines.
_LINES = (100, 125, 180, 200, 250, 300, 360, 400, 500, 600, 720, 800, 900, 1000, 1250, 1500,
          1800, 2000, 2500, 3000, 3600, 5000, 6000, 9000, 10000)  # fmt: skip


def check_angles(source: str, theta: np.ndarray, t: np.ndarray, speed: bool | None) -> None:
    """InputError if an angle without a unit shows that it is in deg or turns; ``speed``: whether w
    is without a unit, too, None if there is no w."""
    theta = np.where(np.abs(theta) < HUGE, theta, np.nan)
    if len(theta) < _CELLS:
        return
    k, found = max(1, len(theta) // 2000), encoder_unit(theta)
    with np.errstate(divide="ignore", invalid="ignore"):
        fast = np.abs((theta[k:] - theta[:-k]) / (t[k:] - t[:-k]))
    fastest = float(np.quantile(fast[np.isfinite(fast)], 0.9)) if np.isfinite(fast).any() else 0.0
    unit, why = "", ""
    if found is not None:
        unit = found[0]
        why = f"its step is 1/{found[1]} of a turn in {unit}, and no round part of one in rad"
    elif _wraps(theta):
        unit, why = "rev", "it wraps after 1"
    elif fastest > _FASTEST and speed is None:
        unit, why = "deg", f"read as rad it would turn at {fastest * 30 / np.pi:.3g} rpm"
    if unit:
        raise asked(source, why, unit, f"{unit}/s" if speed else "")


def asked(source: str, why: str, angle: str, per_second: str) -> InputError:
    """The question in which units theta, and perhaps w, are."""
    given = f"theta={angle}" + (f",w={per_second}" if per_second else "")
    usual = "theta=rad" + (",w=rad/s" if per_second else "")
    return InputError(
        f"{source}: theta has no unit and does not look like rad ({why}): give "
        f"{option('units', given)}, or {option('units', usual)} if that is right."
    )


def encoder_unit(theta: np.ndarray) -> tuple[str, int] | None:
    """deg or rev, and the steps per turn of the encoder on whose grid values (N,) lie, or None."""
    values = np.unique(theta[np.isfinite(theta)])
    if len(values) < _CELLS:
        return None
    grids = {unit: n for unit, turn in _TURN.items() if (n := _grid(values, turn)) is not None}
    if "rad" in grids or not grids:
        return None
    unit = max(grids, key=lambda unit: _TURN[unit] / grids[unit])
    counts = np.round(np.diff(theta) * (grids[unit] / _TURN[unit]))
    return (unit, grids[unit]) if np.mean(np.diff(counts) != 0) > _CHANGES else None


def _grid(values: np.ndarray, turn: float) -> int | None:
    """The steps per turn of the coarsest usual encoder on whose grid the values lie."""
    steps = np.diff(values)
    least = float(np.quantile(steps[steps > 1e-3 * np.median(steps)], 0.02))
    for n in sorted({2**m for m in range(6, 25)} | {4 * lines for lines in _LINES}):
        size = turn / n
        enough = _SPAN if n & (n - 1) else _SPAN / 4  # the more candidates, the more chance hits
        if not 0.5 < least / size < 4.5 or np.ptp(values) < enough * size:
            continue
        written = 10.0 ** np.ceil(np.log10(size) - 1e-9)  # the log may have been rounded to that
        if _on_grid(values, size) and not _on_grid(values, written):
            return n
    return None


def _on_grid(values: np.ndarray, size: float) -> bool:
    """Whether values are multiples of a size, up to one offset."""
    return bool(abs(np.mean(np.exp(2j * np.pi * values / size))) > _SHARP)


def _wraps(theta: np.ndarray) -> bool:
    values = theta[np.isfinite(theta)]
    steps = np.diff(values)
    jumps = np.abs(steps) > 0.5
    if np.count_nonzero(jumps) < 3 or np.ptp(values) > 1.001:
        return False
    usual = float(np.abs(steps[~jumps]).max(initial=0.0))
    return bool(np.all(np.abs(np.abs(steps[jumps]) - 1) <= 2 * usual + 0.01))


# ---- registers without a sign ----------------------------------------------------


def signed(role: str, values: np.ndarray) -> tuple[np.ndarray, list[str]]:
    """The column of a role (N,) with its signs, and a sentence where they were missing: a two's
    complement leaves the middle half of its range empty and has values on both sides."""
    x = values[np.isfinite(values)] if role in ("u", "w") else values[:0]
    for whole, bits in ((2.0**16, 16), (2.0**32, 32)) if len(x) and x.min() >= 0 else ():
        low, high = x < 0.25 * whole, x >= 0.75 * whole
        if (
            x.max() < whole
            and low.any()
            and high.any()
            and np.all(low | high)
            and not np.any(x % 1)
        ):
            said = (
                f"{role} is written as an unsigned number of {bits} bit: its values above "
                f"{int(whole / 2) - 1} are read as negative (minus {int(whole)})."
            )
            return np.where(values >= 0.5 * whole, values - whole, values), [said]
    return values, []

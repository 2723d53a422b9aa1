"""What the numbers of a column show: an angle that is not in rad, a register without its sign."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ...core.errors import InputError
from ...core.option_names import option

# ---- angles without a unit -------------------------------------------------------


_FASTEST = 1e4  # rad/s, 95 000 rpm: no drive that is logged by position turns faster
_MARK = 1e30  # what is larger is a mark of a missing value
_CELLS = 100  # least number of encoder steps that show their size
_SPAN = 2000  # least range, in encoder steps: a grid of another size drifts out of step over it
_SHARP = 0.9  # coherence with a grid, 1 for a grid without rounding
_CHANGES = 0.02  # share of samples at which the count of steps changes: at one speed the samples
# themselves lie on a grid, and none does
_TURN = {"rad": 2 * np.pi, "deg": 360.0, "rev": 1.0}
_PER_SECOND = {"rad": "rad/s", "deg": "deg/s", "rev": "rev/s"}
# Steps per turn of usual encoders that are no power of two: four times the lines.
_LINES = (100, 125, 180, 200, 250, 300, 360, 400, 500, 600, 720, 800, 900, 1000, 1250, 1500,
          1800, 2000, 2500, 3000, 3600, 5000, 6000, 9000, 10000)  # fmt: skip
# w in one unit and theta in another, neither stated: (w over d theta/dt, theta, w).
_BOTH = ((60.0, "rev", "rpm"), (1 / 6, "deg", "rpm"), (360.0, "rev", "deg/s"),
         (1 / 360, "deg", "rev/s"))  # fmt: skip


def check_angles(
    source: str, channels: Mapping[str, np.ndarray], rate: float | None, unstated: set[str]
) -> None:
    """InputError if an angle without a unit shows that it is in deg or turns, not in rad.

    It shows it by the step of its encoder, a round part of a turn in that unit only; by wrapping
    after 1; by a speed that no drive has; or, beside a w without a unit, by the ratio of the two.
    A w that contradicts theta in one unit only is left to the audit, which converts it.
    """
    channels = {k: np.where(np.abs(x) < _MARK, x, np.nan) for k, x in channels.items()}
    theta = channels.get("theta")
    if theta is None or "theta" not in unstated or len(theta) < _CELLS:
        return
    ratio = _ratio(channels, rate) if "w" in channels else None
    if ratio is not None and "w" in unstated:
        for expected, angle, speed in _BOTH:
            if abs(abs(ratio) / expected - 1) < 0.03:
                _ask(source, f"w is {abs(ratio):.4g} times d theta/dt, as with {speed} and {angle}",
                     angle, speed)  # fmt: skip
    if ratio is not None and abs(abs(ratio) - 1) > 0.1:
        return
    if ratio is not None and "w" not in unstated:
        return
    speed = "w" in unstated
    found = encoder_unit(theta)
    if found is not None:
        unit, steps = found
        why = f"its step is 1/{steps} of a turn in {unit}, and no round part of one in rad"
        _ask(source, why, unit, _PER_SECOND[unit] if speed else None)
    if _wraps(theta):
        _ask(source, "it wraps after 1", "rev", _PER_SECOND["rev"] if speed else None)
    fastest = _fastest(channels, rate)
    if fastest > _FASTEST:
        why = f"read as rad it would turn at {fastest * 30 / np.pi:.3g} rpm"
        _ask(source, why, "deg", _PER_SECOND["deg"] if speed else None)


def _ask(source: str, why: str, angle: str, speed: str | None) -> None:
    given = f"theta={angle}" + (f",w={speed}" if speed else "")
    usual = "theta=rad" + (",w=rad/s" if speed else "")
    raise InputError(
        f"{source}: theta has no unit and does not look like rad ({why}): give "
        f"{option('units', given)}, or {option('units', usual)} if that is right."
    )


def encoder_unit(theta: np.ndarray) -> tuple[str, int] | None:
    """deg or rev and the steps per turn, where values (N,) lie on the grid of an encoder.

    None where there is no grid, where it is a round part of 2 pi, or where it may be the last
    digit that was written, or the motion of a sample at one speed.
    """
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
        if _on_grid(values, size) and not _written(values, size):
            return n
    return None


def _on_grid(values: np.ndarray, size: float) -> bool:
    """Whether values are multiples of a size, up to one offset."""
    return bool(abs(np.mean(np.exp(2j * np.pi * values / size))) > _SHARP)


def _written(values: np.ndarray, size: float) -> bool:
    """Whether the values are multiples of a decimal place as well, at least as large as a step:
    the log may have been rounded to it."""
    return _on_grid(values, 10.0 ** np.ceil(np.log10(size) - 1e-9))


def _wraps(theta: np.ndarray) -> bool:
    values = theta[np.isfinite(theta)]
    steps = np.diff(values)
    jumps = np.abs(steps) > 0.5
    if np.count_nonzero(jumps) < 3 or np.ptp(values) > 1.001:
        return False
    usual = float(np.abs(steps[~jumps]).max(initial=0.0))
    return bool(np.all(np.abs(np.abs(steps[jumps]) - 1) <= 2 * usual + 0.01))


def _slope(channels: Mapping[str, np.ndarray], rate: float | None) -> np.ndarray | None:
    """d theta/dt over a few samples, (N - k,); None where the time is no time."""
    theta = channels["theta"]
    t = channels["t"] if rate is None else np.arange(len(theta)) / rate
    k = max(1, len(theta) // 2000)
    step = t[k:] - t[:-k]
    if not np.all(np.isfinite(step)) or not np.all(step > 0):
        return None
    return (theta[k:] - theta[:-k]) / step


def _fastest(channels: Mapping[str, np.ndarray], rate: float | None) -> float:
    slope = _slope(channels, rate)
    slope = slope[np.isfinite(slope)] if slope is not None else np.empty(0)
    return float(np.quantile(np.abs(slope), 0.9)) if slope.size else 0.0


def _ratio(channels: Mapping[str, np.ndarray], rate: float | None) -> float | None:
    """w over d theta/dt; None where the two have little in common."""
    slope = _slope(channels, rate)
    if slope is None:
        return None
    w, k = channels["w"], len(channels["w"]) - len(slope)
    mean = (np.cumsum(np.r_[0.0, w])[k:] - np.cumsum(np.r_[0.0, w])[:-k])[: len(slope)] / k
    good = np.isfinite(mean) & np.isfinite(slope)
    x, y = slope[good], mean[good]
    if len(x) < _CELLS or not x.any() or not y.any():
        return None
    both = float(x @ y)
    if both**2 < 0.6 * float(x @ x) * float(y @ y):
        return None
    return both / abs(both) * float(np.sqrt((y @ y) / (x @ x)))


# ---- registers without a sign ----------------------------------------------------


BITS = (16, 32)
SIGNED = ("u", "w")  # channels that have a sign
SAID = (
    "{0} is written as an unsigned number of {1} bit: its values above {2} are read as negative "
    "(minus {3})."
)


def signed(role: str, values: np.ndarray) -> tuple[np.ndarray, list[str]]:
    """The column of a role (N,) with its signs, and a sentence where they were missing.

    A two's complement leaves the middle half of its range empty and has values on both sides.
    """
    if role not in SIGNED:
        return values, []
    x = values[np.isfinite(values)]
    for bits in BITS:
        whole = 2.0**bits
        if len(x) and x.min() >= 0 and 0.75 * whole <= x.max() < whole and _split(x, whole):
            made = np.where(values >= 0.5 * whole, values - whole, values)
            return made, [SAID.format(role, bits, int(whole / 2) - 1, int(whole))]
    return values, []


def _split(x: np.ndarray, whole: float) -> bool:
    """Whether whole numbers lie on both sides of an empty middle."""
    middle = (x >= 0.25 * whole) & (x < 0.75 * whole)
    low = x < 0.25 * whole
    return not np.any(middle) and bool(low.any() and not low.all()) and not np.any(x % 1)

"""``lugrectl.hunting_map``: over two gains, where a loop is quiet, can be started, or hunts."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..blocks.model import as_model
from ..core.display import Row
from ..core.errors import InputError
from ..core.result import Result
from ..core.validation import whole
from ..core.views import view
from .critical import ranges
from .curve import curve_of
from .fixed_points import HIGH, LOW
from .hunt import pid_gains
from .lanes import Loop, together
from .rigid import proven
from .stick_map import excess_on

ERRORS = np.geomspace(LOW, HIGH, 72)  # units, at which T is compared with e
QUIET, STARTED, HUNTING = 0, 1, 2
REGIONS = ("quiet", "quiet, but can be started", "hunting")


@dataclass(frozen=True, repr=False)
class HuntingMap(Result):
    """Where a loop hunts, over two gains.

    Attributes
    ----------
    names : tuple of str
        The two gains.
    values : tuple of two arrays
        Their values.
    region : (N, M) array of int
        0 quiet, 1 quiet but can be started by a large error, 2 hunting from the smallest error on
        or unstable; a row for each value of the first gain.
    gains : dict
        The user's gains.
    messages : tuple of str
        What the map does not cover.

    Examples
    --------
    >>> drive = lg.Model.of(friction="coulomb", J=1.0, Fc=1.0, Fv=0.4)
    >>> lg.hunting_map(drive, {"ki": (0.3, 3.0), "kd": (2.0, 20.0)}, kp=3.0, points=3)
    HuntingMap over ki and kd
      quiet                       100 %
      quiet, but can be started   0 %
      hunting                     0 %
    """

    names: tuple[str, str]
    values: tuple[np.ndarray, np.ndarray]
    region: np.ndarray
    gains: dict[str, float]
    messages: tuple[str, ...] = ()

    def summary(self) -> dict[str, Any]:
        """Plain Python."""
        return {
            "names": list(self.names),
            "values": [v.tolist() for v in self.values],
            "region": self.region.tolist(),
            "gains": self.gains,
            "messages": list(self.messages),
        }

    def plot(self, ax: Any = None) -> Any:
        """Draw the three regions with the user's gains; returns the Axes."""
        return view("hunting_plots.regions")(self, ax)

    def _title(self) -> str:
        return f"HuntingMap over {' and '.join(self.names)}"

    def _rows(self) -> Iterable[Row]:
        for k, name in enumerate(REGIONS):
            yield Row(name, f"{100.0 * np.mean(self.region == k):.0f} %")
        yield from (Row("message", one) for one in self.messages)


def hunting_map(
    model: Any,
    ranges_of: Mapping[str, tuple[float, float]],
    *,
    kp: float | None = None,
    ki: float | None = None,
    kd: float | None = None,
    kv: float | None = None,
    points: int = 24,
) -> HuntingMap:
    """Over two gains: where a position loop is quiet, can be started, or hunts.

    Parameters
    ----------
    model : Model, Parameters or path
        The drive; it slides by its sliding curve, effects are left out.
    ranges_of : dict
        Two gains and their ends, ``{"ki": (1, 50), "kd": (0.1, 1)}``.
    kp, ki, kd, kv : float, optional
        As for :func:`limit_cycles`: the user's gains, which are marked.
    points : int
        Values of each gain, in even ratios.

    Returns
    -------
    HuntingMap
        ``.region``, ``.plot()``.

    Raises
    ------
    InputError
        As :func:`limit_cycles`, and where there are not two gains.

    Notes
    -----
    At each point D(e) = log(T(e)/e) of :func:`limit_cycles` on 72 errors from 1/1000 to 30 times
    Fs/kp: quiet where D < 0 at all, hunting where D > 0 at the smallest, else the loop comes to
    rest from small errors and keeps on hunting once a large one started it.

    Examples
    --------
    >>> drive = lg.Model.of(friction="stribeck", J=1.0, Fc=1.0, Fs=1.5, vs=0.1, Fv=0.4)
    >>> found = lg.hunting_map(drive, {"ki": (0.3, 10), "kd": (2, 20)}, kp=3, ki=4, kd=6, points=6)
    >>> found.region.shape
    (6, 6)
    """
    known, count = as_model(model), whole(points, "points", 2)
    ends = ranges(ranges_of, "hunting_map")
    if len(ends) != 2:
        raise InputError(f"hunting_map needs two gains, not {len(ends)}.")
    own = {"kp": kp, "ki": ki, "kd": kd, "kv": kv}
    (one, first), (two, second) = ((k, np.geomspace(*v, count)) for k, v in ends.items())
    curve, J = curve_of(known), float(known.J or 0.0)
    if curve.Fs <= 0.0:
        raise InputError(f"{known.name}: the law {known.friction.block.name} has no stiction.")
    loops = [
        Loop(curve, J, **pid_gains(**(own | {one: float(a), two: float(b)})))
        for a in first
        for b in second
    ]
    region = np.array(_regions(loops)).reshape(count, count)
    said = ["the drive slides by its sliding curve, without bristles"] * bool(
        known.friction.block.states
    )
    said += [f"left out: {', '.join(p.key for p in known.effects)}"] * bool(known.effects)
    marked = {k: v for k, v in own.items() if v is not None}
    return HuntingMap((one, two), (first, second), region, marked, tuple(said))


def _regions(loops: list[Loop]) -> list[int]:
    """The region of each loop; their slips are computed together."""
    open_ = [g for g in loops if g.is_stable() and not proven(g)]
    D = excess_on(together(open_, len(ERRORS)), ERRORS, len(open_)) if open_ else np.zeros((0, 1))
    rows = iter(D)
    return [
        HUNTING if not g.is_stable() else QUIET if proven(g) else _region(next(rows)) for g in loops
    ]


def _region(D: np.ndarray) -> int:
    if not np.any(D > 0.0):
        return QUIET
    return HUNTING if D[0] > 0.0 else STARTED

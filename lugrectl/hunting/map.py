"""``lugrectl.hunting_map``: over two gains, or a gain and how wrongly friction is believed, where a
loop is quiet, can be started, hunts, or stays undecided."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..blocks.model import Model, as_model
from ..core.display import Row
from ..core.errors import InputError
from ..core.result import Result, picked
from ..core.validation import number, positive, whole
from ..core.views import view
from .loop import (
    HIGH,
    LOW,
    NEVER,
    Loop,
    curve_of,
    excess_on,
    kept,
    pid_gains,
    proven,
    ranges,
    together,
)

ERRORS = np.geomspace(LOW, HIGH, 72)  # units, at which T is compared with e
QUIET, STARTED, HUNTING, UNDECIDED = 0, 1, 2, 3
REGIONS = ("quiet", "quiet, but can be started", "hunting", "undecided")


@dataclass(frozen=True, repr=False)
class HuntingMap(Result):
    """Where a loop hunts, over two gains or a gain and the friction.

    Attributes
    ----------
    names : tuple of str
        The two gains; "friction": how many times what the compensation believes it is.
    values : tuple of two arrays
        Their values.
    region : (N, M) array of int
        0 quiet, 1 quiet but can be started by a large error, 2 hunting from the smallest error on
        or unstable, 3 undecided; a row for each value of the first gain.
    proven : (N, M) array of bool
        Where quiet is proven; elsewhere it is searched.
    gains : dict
        The user's gains; friction is 1 where the compensation believes it rightly.
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
      undecided                   0 %
    """

    names: tuple[str, str]
    values: tuple[np.ndarray, np.ndarray]
    region: np.ndarray
    proven: np.ndarray
    gains: dict[str, float]
    messages: tuple[str, ...] = ()

    def summary(self) -> dict[str, Any]:
        """Plain Python."""
        return picked(self, "names values region proven tolerated gains messages")

    @property
    def tolerated(self) -> tuple[float, float] | None:
        """The friction about 1, times what is believed, at which the user's gain is quiet."""
        own = self.gains.get(self.names[0])
        if self.names[1] != "friction" or own is None:
            return None
        values = self.values[1]
        quiet = self.region[np.argmin(np.abs(np.log(self.values[0] / own)))] == QUIET
        ends = np.flatnonzero(~quiet)
        low = ends[values[ends] <= 1.0].max(initial=-1) + 1
        high = ends[values[ends] > 1.0].min(initial=len(values)) - 1
        return (float(values[low]), float(values[high])) if low <= high else None

    def plot(self, ax: Any = None) -> Any:
        """Draw the regions with the user's gains; returns the Axes."""
        return view("loop_plots.regions")(self, ax)

    def _title(self) -> str:
        return f"HuntingMap over {' and '.join(self.names)}"

    def _rows(self) -> Iterable[Row]:
        for k, name in enumerate(REGIONS):
            yield Row(name, f"{100.0 * np.mean(self.region == k):.0f} %")
        if self.tolerated:
            said = "times what is believed, at which your gain is quiet"
            yield Row("friction", "{:.3g} to {:.3g}".format(*self.tolerated), "", said)
        yield from (Row("message", one) for one in self.messages)


def hunting_map(
    model: Any,
    ranges_of: Mapping[str, tuple[float, float]],
    *,
    kp: float | None = None,
    ki: float | None = None,
    kd: float | None = None,
    kv: float | None = None,
    friction: tuple[float, float] | None = None,
    compensation: float = 1.0,
    vd: float | None = None,
    points: int = 24,
) -> HuntingMap:
    """Over two gains: where a position loop is quiet, can be started, or hunts.

    Parameters
    ----------
    model : Model, Parameters or path
        The drive; it slides by its sliding curve, effects are left out.
    ranges_of : dict
        Two gains and their ends, ``{"ki": (1, 50), "kd": (0.1, 1)}``; with ``friction`` one.
    kp, ki, kd, kv : float, optional
        As for :func:`limit_cycles`: the user's gains, which are marked.
    friction : tuple of two floats, optional
        ``(0.5, 2)``: in place of a second gain how many times the friction is what the
        compensation believes, which is the model's.
    compensation : float
        With ``friction``: the share of the believed sliding curve that is added to the torque.
    vd : float, optional
        In rad/s: below it what is added is in proportion to the speed. Default: vs of the law.
    points : int
        Values of each gain, in even ratios.

    Returns
    -------
    HuntingMap
        ``.region``, ``.proven``, ``.tolerated``, ``.plot()``.

    Raises
    ------
    InputError
        As :func:`limit_cycles`, and where there are not two axes.

    Notes
    -----
    At each point D(e) = log(T(e)/e) of :func:`limit_cycles` on 72 errors from 1/1000 to 30 times
    Fs/kp: quiet where D < 0 at all, hunting where D > 0 at the smallest, else the loop comes to
    rest from small errors and keeps on hunting once a large one started it. Undecided where a
    maximum of D between two errors may reach 0, and where D > 0 somewhere, but T, iterated, keeps
    no error: :func:`limit_cycles` answers there. Quiet is proven for
    Coulomb and viscous friction without compensation, and searched elsewhere.

    Examples
    --------
    >>> drive = lg.Model.of(friction="stribeck", J=1.0, Fc=1.0, Fs=1.5, vs=0.1, Fv=0.4)
    >>> found = lg.hunting_map(drive, {"ki": (0.3, 10), "kd": (2, 20)}, kp=3, ki=4, kd=6, points=6)
    >>> found.region.shape
    (6, 6)

    How far the friction may be from what half of it is compensated by:

    >>> found = lg.hunting_map(drive, {"ki": (0.01, 1)}, kp=3, ki=0.02, kd=6, points=8,
    ...                        friction=(0.5, 2), compensation=0.5)
    >>> found.names
    ('ki', 'friction')
    """
    known, count = as_model(model), whole(points, "points", 2)
    ends = ranges(ranges_of, "hunting_map")
    if len(ends) != (2 if friction is None else 1):
        raise InputError(
            f"hunting_map needs two gains, or one and friction=(0.5, 2), not {len(ends)} gains."
        )
    curve, J = curve_of(known), float(known.J or 0.0)
    if curve.Fs <= 0.0:
        raise InputError(f"{known.name}: the law {known.friction.block.name} has no stiction.")
    own = {"kp": kp, "ki": ki, "kd": kd, "kv": kv}
    marked = {k: v for k, v in own.items() if v is not None}
    curves = {}
    if friction is not None:
        share, below = _believed(known, compensation, vd)
        ends |= ranges({"friction": friction}, "hunting_map", ("friction",))
        curves = {
            s: curve.compensated(share, below, s)
            for s in map(float, np.geomspace(*ends["friction"], count))
        }
        marked["friction"] = 1.0
    (one, first), (two, second) = ((k, np.geomspace(*v, count)) for k, v in ends.items())

    def loop(a: float, b: float) -> Loop:
        given = own | {one: a} | ({} if curves else {two: b})
        return Loop(curves.get(b, curve), J, **pid_gains(**given))

    grid = [[loop(float(a), float(b)) for a in first] for b in second]
    rows = grid if curves else [[g for row in grid for g in row]]
    region = np.array([_regions(row) for row in rows]).reshape(count, count).T
    certain = np.array([[g.is_stable() and bool(proven(g)) for g in row] for row in grid]).T
    said = ["the drive slides by its sliding curve, without bristles"] * bool(
        known.friction.block.states
    )
    said += [f"left out: {', '.join(p.key for p in known.effects)}"] * bool(known.effects)
    said += ["quiet is searched, not proven"] * bool(np.any((region == QUIET) & ~certain))
    return HuntingMap((one, two), (first, second), region, certain, marked, tuple(said))


def _believed(model: Model, share: Any, vd: Any) -> tuple[float, float]:
    """The share of friction that is compensated, and the speed from which on it is in full."""
    below = dict(model.friction.values).get("vs") if vd is None else vd
    if below is None:
        raise InputError(f"hunting_map: {model.friction.block.name} has no vs: give vd in rad/s.")
    if number(share, "compensation") < 0.0:
        raise InputError(f"compensation = {share:g} is negative.")
    return float(share), positive(below, "vd", "rad/s")


def _regions(loops: list[Loop]) -> list[int]:
    """The region of each loop; their slips are computed together."""
    open_ = [g for g in loops if g.is_stable() and not proven(g)]
    D = excess_on(together(open_, len(ERRORS)), ERRORS, len(open_)) if open_ else np.zeros((0, 1))
    rows = iter(D)
    return [
        HUNTING if not g.is_stable() else QUIET if proven(g) else _region(next(rows)) for g in loops
    ]


def _region(D: np.ndarray) -> int:
    if not np.any(D > 0.0):  # a parabola through three points may reach 0 between them
        a, b, c = D[:-2], D[1:-1], D[2:]
        bend, slope = 2.0 * b - a - c, 0.5 * (c - a)
        top = (b >= a) & (b >= c) & (bend > 0.0) & (np.minimum(a, c) > -NEVER)
        touches = np.any(b[top] + 0.5 * slope[top] ** 2 / bend[top] > 0.0)
        return UNDECIDED if touches else QUIET
    if not np.any(D >= NEVER) and not len(kept(ERRORS, D)):
        return UNDECIDED
    return HUNTING if D[0] > 0.0 else STARTED

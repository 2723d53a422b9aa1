"""What a search for limit cycles found, and what is proven of it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..core.display import Row, Shown, noticed, number
from ..core.result import Result, picked
from ..core.unit_names import unit_for
from ..core.views import view

SCATTERS = 0.02  # of the amplitude: a swing that does not repeat
BORDER = "the smallest start that does not come to rest"
FIRST = "the smallest start that was searched does not come to rest"


@dataclass(frozen=True, repr=False)
class Cycle(Shown):
    """A limit cycle of a position loop.

    ``amplitude`` is half the peak to peak of theta, ``period`` in s. ``multipliers`` of one turn
    of the cycle: a small distance from it grows by them; stable where all are below 1 in size. They
    are empty where a cycle was found by waiting. ``stops`` in a period; None: not counted.
    ``scatter``, of the size of half turns about the amplitude, which is then their mean: counts and
    gaps make hunting irregular. ``amplitude`` is of the side that is controlled; where a gap or a
    spring is between motor and load, ``amplitude_motor`` and ``amplitude_load`` stand beside it.
    """

    amplitude: float
    period: float
    stable: bool
    multipliers: tuple[float, ...] = ()
    stops: int | None = None
    scatter: float = 0.0
    amplitude_motor: float | None = None
    amplitude_load: float | None = None
    _units = {"amplitude": "rad", "period": "s", "scatter": "rad"}

    @property
    def sides(self) -> dict[str, float]:
        """Amplitudes of motor and load, where they differ."""
        both = {k: getattr(self, f"amplitude_{k}") for k in ("motor", "load")}
        return {k: v for k, v in both.items() if v is not None}

    def summary(self) -> dict[str, Any]:
        """Plain Python."""
        own = picked(self, "amplitude period stable stops scatter multipliers")
        return own | {f"amplitude_{k}": v for k, v in self.sides.items()}


@dataclass(frozen=True, repr=False)
class LimitCycles(Result):
    """The limit cycles of a position loop; truthy if every start comes to rest.

    Attributes
    ----------
    outcome : "hunts", "rests" or "undecided"
        hunts: a start keeps on swinging, or grows without bound. rests: every start comes to rest,
        maybe past an unstable cycle. undecided: none is known to swing, and some neither came to
        rest nor repeated within the budget.
    cycles : tuple of Cycle
        By amplitude; ``amplitude`` in rad (m on a linear drive), ``period`` in s, ``stable``,
        ``multipliers``, ``stops``.
    basin : float or None
        The smallest start that does not come to rest: the error at breakaway in rad, or the step of
        r of a loop of blocks; 0: from the smallest that was searched; None: none is known.
    proof : str or None
        Why there can be no cycle; None where absence is searched, not proven.
    diverges : bool
        Whether the loop grows without bound, from large errors at least.
    loop : dict
        What was searched: gains, J, law, rate, dead time, counts.
    messages : tuple of str
        What the answer does not cover.
    critical : dict
        With ``vary``: by gain the values at which hunting begins or ends; two ends (low, high)
        where it is undecided between them.
    curve : tuple of two arrays, or None
        Errors at breakaway in rad and log(T(e)/e), how much they grow to the next stick on the
        other side; 50 and -50 stand for growth without a stick and for rest.
    motion : "rotary" or "linear"
        Of the drive.
    undecided : int
        Starts of a search by simulation that neither came to rest nor repeated.
    stick_slip : StickSlip or None
        With ``lugrectl hunt --speed``: the speeds of :func:`stick_slip_speed`.

    Examples
    --------
    >>> drive = lg.Model.of(friction="stribeck", J=1.0, Fc=1.0, Fs=1.5, vs=1e-3, Fv=0.4)
    >>> lg.limit_cycles(drive, kp=3.0, ki=4.0, kd=6.0)
    the loop hunts
      cycle  +-0.06692 rad, period 23.73 s, stable, 2 stops
      border  the smallest start that was searched does not come to rest
    """

    cycles: tuple[Cycle, ...]
    basin: float | None
    proof: str | None
    diverges: bool
    loop: dict[str, Any]
    messages: tuple[str, ...] = ()
    critical: Mapping[str, tuple[Any, ...]] = field(default_factory=dict)
    curve: tuple[np.ndarray, np.ndarray] | None = None
    motion: str = "rotary"
    undecided: int = 0
    stick_slip: Any = None

    def __bool__(self) -> bool:
        return self.outcome == "rests"

    @property
    def outcome(self) -> str:
        """hunts, rests or undecided."""
        if self.diverges or any(c.stable for c in self.cycles):
            return "hunts"
        return "undecided" if self.undecided else "rests"

    @property
    def hunts(self) -> bool | None:
        """Whether some start keeps on swinging or grows; None: undecided."""
        return None if self.outcome == "undecided" else not self

    def summary(self) -> dict[str, Any]:
        """Plain Python, as ``lugrectl hunt --json`` prints it."""
        names = "outcome hunts cycles basin proof diverges loop undecided stick_slip"
        return {"schema": 1, **picked(self, f"{names} critical messages")}

    def plot(self, ax: Any = None) -> Any:
        """Draw the growth of the error from stick to stick with the cycles; returns the Axes."""
        return view("loop_plots.growth")(self, ax)

    def _title(self) -> str:
        rest = f"no limit cycle: {'proven' if self.proof else 'none found'}"
        if self.outcome == "undecided":
            rest = "undecided: some starts neither came to rest nor repeated"
        elif self.outcome == "hunts":
            swings = any(c.stable for c in self.cycles)
            rest = "the loop hunts" if swings else "the loop diverges"
        elif self.cycles:
            rest = "every start comes to rest, past an unstable cycle"
        return f"{self.stick_slip._title()}; at rest {rest}" if self.stick_slip else rest

    def _rows(self) -> Iterable[Row]:
        unit = unit_for("rad", self.motion)
        for c in self.cycles:
            kind = "stable" if c.stable else "unstable"
            stops = "" if c.stops is None else f", {c.stops} stops"
            said = f"+-{number(c.amplitude)} {unit}, period {number(c.period)} s, {kind}{stops}"
            if c.scatter > SCATTERS * c.amplitude:
                said += f", half turns scatter by {number(c.scatter)} {unit}"
            sides = ", ".join(f"{k} +-{number(v)} {unit}" for k, v in c.sides.items())
            yield Row("cycle", said + (f" ({sides})" if sides else ""))
        if self.basin is not None:
            said = f"{number(self.basin)} {unit}: {BORDER}" if self.basin else FIRST
            yield Row("border", said)
        if self.proof:
            yield Row("proof", self.proof)
        if self.stick_slip:
            yield from self.stick_slip._rows()
        yield from noticed(self.messages, "messages")

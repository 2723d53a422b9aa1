"""What a search for limit cycles found, and what is proven of it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..core.display import Row, Shown, noticed, number
from ..core.result import Result
from ..core.views import view


@dataclass(frozen=True, repr=False)
class Cycle(Shown):
    """A limit cycle of a position loop.

    ``amplitude`` is half the peak to peak of theta, ``period`` in s. ``multipliers`` of one turn
    of the cycle: a small distance from it grows by them; stable where all are below 1 in size. They
    are empty where a cycle was found by waiting. ``stops`` in a period; None: not counted.
    ``scatter``, of the size of half turns about the amplitude: counts make hunting irregular.
    """

    amplitude: float
    period: float
    stable: bool
    multipliers: tuple[float, ...] = ()
    stops: int | None = None
    scatter: float = 0.0
    _units = {"amplitude": "rad", "period": "s", "scatter": "rad"}

    def summary(self) -> dict[str, Any]:
        """Plain Python."""
        own = {k: getattr(self, k) for k in ("amplitude", "period", "stable", "stops", "scatter")}
        return {**own, "multipliers": list(self.multipliers)}


@dataclass(frozen=True, repr=False)
class LimitCycles(Result):
    """The limit cycles of a position loop; truthy if there is none and the loop is stable.

    Attributes
    ----------
    cycles : tuple of Cycle
        By amplitude; ``amplitude`` in rad (m on a linear drive), ``period`` in s, ``stable``,
        ``multipliers``, ``stops``.
    basin : float or None
        The error at breakaway, rad, from which on the loop no longer comes to rest; 0: from the
        smallest that was searched; None: it comes to rest from all.
    proof : str or None
        Why there can be no cycle; None where absence is searched, not proven.
    diverges : bool
        Whether the loop grows without bound, from large errors at least.
    loop : dict
        What was searched: gains, J, law, rate, dead time, counts.
    messages : tuple of str
        What the answer does not cover.
    critical : dict
        With ``vary``: by gain the values at which hunting (stable cycles, or growth without
        bound) begins or ends.
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
      basin  0 rad error at breakaway beyond which it does not rest
    """

    cycles: tuple[Cycle, ...]
    basin: float | None
    proof: str | None
    diverges: bool
    loop: dict[str, Any]
    messages: tuple[str, ...] = ()
    critical: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    curve: tuple[np.ndarray, np.ndarray] | None = None
    motion: str = "rotary"
    undecided: int = 0
    stick_slip: Any = None

    def __bool__(self) -> bool:
        return not (self.cycles or self.diverges)

    @property
    def hunts(self) -> bool:
        """Whether there is a limit cycle, stable or not, or the loop diverges."""
        return not self

    def summary(self) -> dict[str, Any]:
        """Plain Python, as ``lugrectl hunt --json`` prints it."""
        return {
            "schema": 1,
            "hunts": self.hunts,
            "cycles": [c.summary() for c in self.cycles],
            "basin": self.basin,
            "proof": self.proof,
            "diverges": self.diverges,
            "loop": self.loop,
            "undecided": self.undecided,
            "stick_slip": self.stick_slip and self.stick_slip.summary(),
            "critical": {k: list(v) for k, v in self.critical.items()},
            "messages": list(self.messages),
        }

    def plot(self, ax: Any = None) -> Any:
        """Draw the growth of the error from stick to stick with the cycles; returns the Axes."""
        return view("hunting_plots.growth")(self, ax)

    def _title(self) -> str:
        if self.diverges and not self.cycles:
            return "the loop diverges"
        if any(c.stable for c in self.cycles):
            return "the loop hunts"
        if self.cycles:
            return "the loop can be made to swing, by an unstable cycle"
        return f"no limit cycle: {'proven' if self.proof else 'none found'}"

    def _rows(self) -> Iterable[Row]:
        unit = "rad" if self.motion == "rotary" else "m"
        for c in self.cycles:
            kind = "stable" if c.stable else "unstable"
            stops = "" if c.stops is None else f", {c.stops} stops"
            said = f"+-{number(c.amplitude)} {unit}, period {number(c.period)} s, {kind}{stops}"
            yield Row("cycle", said)
        if self.basin is not None:
            yield Row("basin", self.basin, unit, "error at breakaway beyond which it does not rest")
        for name, values in self.critical.items():
            said = ", ".join(f"{v:.4g}" for v in values)
            said = f"begins or ends at {name} {said}" if values else f"is the same at each {name}"
            yield Row("hunting", said)
        if self.proof:
            yield Row("proof", self.proof)
        if self.stick_slip:
            yield from self.stick_slip._rows()
        yield from noticed(self.messages, "messages")

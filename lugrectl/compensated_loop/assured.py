"""How much compensation to dare, with its probabilities."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..core.display import Row, noticed, number
from ..core.result import Result, plain
from ..core.views import view
from .chance import Chance, Outcomes


@dataclass(frozen=True)
class Tried:
    """A compensation that was tried on the first members: the error that a share 1 - confidence of
    them exceeds, the median, the share of them that it makes worse, and the share that hunts of
    those that were looked at, None where a better choice stood before it."""

    observer: str
    scale: float
    upper: float
    median: float
    worse: float
    hunts: float | None = None


@dataclass(frozen=True, repr=False, eq=False)
class Assurance(Result):
    """The answer of :func:`lugrectl.assure`.

    Attributes
    ----------
    kind : "velocity" or "position"
        The loop.
    scale : float
        The share of the observer's estimate to compensate; 0: none is to be dared.
    observer, gains, controller : str or None, dict, dict
        The observer with its gains, and the gains of the controller.
    confidence : float
        Share of the drives for which ``bound`` holds.
    error, band : float, (float, float)
        RMS tracking error in ``unit``: the median of the drives, and the interval in which a drive
        lies with 95 %.
    bound : float
        What the error is below on the share ``confidence`` of drives, itself sure to 95 %; infinite
        where too few members were drawn, or some diverge.
    none, none_band : float, (float, float)
        Median and interval without compensation.
    hunts, none_hunts : Outcomes
        That a drive swings at rest by more than ``still``, with the compensation and without:
        ``.value``, ``.ci95``, ``.count``, ``.members``, and the shares ``.rests`` and ``.unsure``.
    swing, none_swing : float
        What the swing at rest is below, peak to peak in rad, as ``bound`` for the error.
    still : float
        The swing that is no hunting, peak to peak in rad.
    worse : Chance
        That the error is larger than without compensation.
    unit : str
        Of the errors.
    tried : tuple of Tried
        All that was compared, on other members.
    errors : dict of arrays
        Those of the members, "assured" and "none".
    drive : dict
        Rate, dead time, sensor and reference, SI.
    models : tuple of (str, float)
        What the members are drawn from, with the weights.
    messages : tuple of str
        What the choice does not show.

    Examples
    --------
    >>> t = 1e-3 * np.arange(8000)
    >>> w = 3.0 * np.sin(np.pi * t) + 0.5 * np.sin(8.0 * t)
    >>> u = 0.002 * np.gradient(w, t) + 0.3 * np.tanh(w / 1e-3) + 0.02 * w
    >>> fit = lg.identify({"t": t, "u": u, "w": w}, lg.Model.of(friction="coulomb"))
    >>> found = lg.assure(fit, loop="velocity", members=60)
    >>> found.observer, bool(found.bound < found.none)
    ('extended_state', True)
    """

    kind: str
    scale: float
    observer: str | None
    gains: Mapping[str, Any]
    controller: Mapping[str, float]
    confidence: float
    error: float
    band: tuple[float, float]
    bound: float
    none: float
    none_band: tuple[float, float]
    hunts: Outcomes
    none_hunts: Outcomes
    swing: float
    none_swing: float
    still: float
    worse: Chance
    unit: str
    tried: tuple[Tried, ...]
    errors: Mapping[str, np.ndarray]
    drive: Mapping[str, Any]
    models: tuple[tuple[str, float], ...]
    messages: tuple[str, ...] = ()

    @property
    def members(self) -> int:
        """The number of drives behind the figures."""
        return self.worse.members

    def summary(self) -> dict[str, Any]:
        """Plain Python, as ``lugrectl assure --json`` prints it."""
        keys = ("kind", "scale", "observer", "gains", "controller", "confidence", "error", "band",
                "bound", "none", "none_band", "unit", "drive", "members", "swing", "none_swing",
                "still", "messages")  # fmt: skip
        made: dict[str, Any] = {"schema": 1, **{k: getattr(self, k) for k in keys}}
        made |= {k: getattr(self, k).summary() for k in ("hunts", "none_hunts", "worse")}
        made["models"] = [{"model": name, "weight": w} for name, w in self.models]
        return plain(made | {"tried": [vars(one) for one in self.tried]})

    def plot(self, ax: Any = None) -> Any:
        """Draw the errors over the share of compensation, into ``ax`` or a new figure; returns the
        Axes."""
        return view("loop_plots.assurance")(self, ax)

    def _title(self) -> str:
        if self.observer is None:
            return "Assurance: dare no compensation"
        return (
            f"Assurance: compensate {self.scale:g} of what the {self.observer} observer estimates"
        )

    def _rows(self) -> Iterable[Row]:
        said = "(95 % of the drives from {} to {})"
        yield Row("tracking error", self.error, self.unit, said.format(*map(number, self.band)))
        yield Row("without", self.none, self.unit, said.format(*map(number, self.none_band)))
        share = f"on {100.0 * self.confidence:g} % of the drives, sure to 95 %"
        yield Row("error below", self.bound, self.unit, share)
        yield Row("worse than without", self.worse.words())
        yield Row("hunts at rest", self.hunts.words())
        yield Row("without", self.none_hunts.words())
        angle = self.unit.removesuffix("/s")
        swings = f"{number(self.none_swing)} {angle} without; more than {number(self.still)} hunts"
        yield Row("swing at rest below", self.swing, angle, f"{share}; {swings}")
        gains = {**self.controller, **{f"observer {k}": v for k, v in self.gains.items()}}
        for name, value in gains.items():
            yield Row(name, value)
        d, speed = self.drive, f"{self.unit.removesuffix('/s')}/s"
        said = f"{number(d['speed'])} {speed} at {d['frequency']:g} Hz"
        yield Row("reference", said, "", f"sampled at {d['rate']:g} Hz")
        yield from noticed(self.messages, "messages")

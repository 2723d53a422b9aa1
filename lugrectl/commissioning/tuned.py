"""The answer: gains with their margins, and what they do."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import control as ct
import numpy as np

from ..bench import Recommendation, recommend_observer
from ..blocks.model import Model
from ..core.display import Row, noticed, number
from ..core.errors import InputError
from ..core.provenance import Provenance
from ..core.result import Result
from ..core.views import view
from ..hunting import LimitCycles
from ..linear.stability import StabilityVerdict
from .loop_shapes import Gains, Notch, of_reference

SETTLED = 40.0  # times 1/pace: the length of a step
LONGEST = 2**18  # samples of it
SMOOTH = 20.0  # samples in 1/crossover, of a continuous step
MARGINS = (
    ("gain margin", "gain_margin", ""),
    ("phase margin", "phase_margin", "deg"),
    ("delay margin", "delay_margin", "s"),
    ("modulus margin", "modulus_margin", ""),
)


@dataclass(frozen=True, eq=False, repr=False)
class Tuning(Result):
    """Gains of a loop, u = -(kp e + ki int e + kd w); of a PI, e is the error of the speed.

    Attributes
    ----------
    structure : str
        "P-PI", "PID" or "PI".
    kp, ki, kd : float
        N m/rad, N m/(rad s), N m s/rad: what :func:`limit_cycles` takes; a P-PI is exactly this
        PID. Of a PI kp in N m s/rad and ki in N m/rad, kd 0.
    cascade : dict or None
        Of a P-PI kv in 1/s, kp in N m s/rad, ki in N m/rad, as :func:`cascade_loop` takes them;
        sampled, the integral is that of trapezoids.
    notch : Notch or None
        (frequency in Hz, damping, depth), as ``cascade_loop(notch=)`` takes it; sampled by the
        bilinear transform that keeps the frequency.
    margins : StabilityVerdict
        Of ``loop``: Ms, gain, phase, modulus and delay margin, with their frequencies.
    worst : float
        The largest Ms of any axis in the band.
    bandwidth, crossover : float
        Where the answer to the reference (position over its reference; of a PI the speed) first
        falls below -3 dB, with hold, dead time and notch; and the highest frequency with |L| = 1.
        rad/s; a bandwidth of inf lies beyond the frequencies of ``loop``.
    controller : control.TransferFunction
        From the error (of the position; of a PI of the speed) to -u, with the notch.
    loop : control.FrequencyResponseData
        L of the response itself, opened at the torque.
    rate, dead_time : float
        Of the controller in Hz, None: continuous; in s.
    inertia : float
        At low frequencies.
    limit_cycles : LimitCycles or None
        With these gains; None where no friction is known.
    messages : tuple of str
        What was decided and assumed.
    """

    structure: str
    kp: float
    ki: float
    kd: float
    cascade: Mapping[str, float] | None
    notch: Notch | None
    margins: StabilityVerdict
    worst: float
    bandwidth: float
    crossover: float
    controller: ct.TransferFunction
    loop: ct.FrequencyResponseData
    rate: float | None
    dead_time: float
    inertia: float
    limit_cycles: LimitCycles | None = None
    messages: tuple[str, ...] = ()
    motion: str = "rotary"
    model: Model | None = field(default=None, repr=False)
    provenance: Provenance | None = field(default=None, repr=False)

    @property
    def Ti(self) -> float | None:
        """The integral time of the speed controller in s; None of a PID, or without integral."""
        c = self.cascade or {"kp": self.kp, "ki": self.ki}
        return c["kp"] / c["ki"] if self.structure != "PID" and c["ki"] else None

    @property
    def _pace(self) -> float:
        """Where the lowest asymptote of |L| is 1, rad/s: how fast the slowest part settles."""
        order = 2 if self.structure == "PI" else 3
        gains = self.ki, self.kp, self.kd
        return next(
            (g / self.inertia) ** (1.0 / (order - k)) for k, g in enumerate(gains) if g > 0.0
        )

    def step(self) -> tuple[np.ndarray, np.ndarray]:
        """t in s, and the position (of a PI the speed) after a step of 1 of its reference."""
        w, L = np.asarray(self.loop.omega), np.asarray(self.loop.frdata)[0, 0]
        dt = 1.0 / self.rate if self.rate else 1.0 / (SMOOTH * self.crossover)
        n = min(2 ** int(np.ceil(np.log2(SETTLED / self._pace / dt))), LONGEST)
        at = 2.0 * np.pi * np.arange(n // 2 + 1) / (n * dt)
        size = np.interp(at, w, np.log(np.abs(L)), right=-np.inf)
        turned = np.interp(at, w, np.unwrap(np.angle(L)))
        T = np.exp(size + 1j * turned)
        T = T / (1.0 + T)
        gains, kv = Gains(self.kp, self.ki, self.kd), (self.cascade or {}).get("kv", 0.0)
        T[1:] *= of_reference(self.structure, gains, kv, at[1:], dt if self.rate else None)
        T[0] = 1.0
        return dt * np.arange(n // 2), np.cumsum(np.fft.irfft(T, n))[: n // 2]

    def observer(self, **known: Any) -> Recommendation:
        """What friction observer adds most to this loop: :func:`recommend_observer` at its rate,
        dead time and crossover. It simulates for seconds to minutes; ``known`` as it takes them.
        """
        if self.model is None:
            raise InputError("an observer needs a model with friction: give model= to tune.")
        own = {"rate": self.rate, "delay": self.dead_time, "bandwidth": self.crossover}
        return recommend_observer(self.model, **(own | known))

    def plot(self) -> Sequence[Any]:
        """Draw the Nyquist curve with the circle of Ms, and a step; returns the Axes."""
        return view("check_plots.tuning")(self)

    def summary(self) -> dict[str, Any]:
        """Plain Python, as under ``gains`` of ``lugrectl bode --json``."""
        m = self.margins
        names = [name for _, name, _ in MARGINS]
        return {
            **{k: getattr(self, k) for k in ("structure", "kp", "ki", "kd")},
            "cascade": None if self.cascade is None else dict(self.cascade),
            "Ti": self.Ti,
            "notch": None if self.notch is None else self.notch._asdict(),
            "Ms": m.Ms,
            "worst": self.worst,
            **{k: getattr(m, k) for k in names},
            **{f"{k}_frequency": getattr(m, f"{k}_frequency") for k in names},
            **{k: getattr(self, k) for k in ("bandwidth", "crossover", "rate", "dead_time")},
            "hunts": None if self.limit_cycles is None else self.limit_cycles.hunts,
            "limit_cycles": None if self.limit_cycles is None else self.limit_cycles.summary(),
            "messages": list(self.messages),
        }

    def _title(self) -> str:
        last, f = (x / (2.0 * np.pi) for x in (self.loop.omega[-1], self.crossover))
        width = self.bandwidth / (2.0 * np.pi)
        said = f"{width:.3g} Hz" if np.isfinite(width) else f"above {last:.3g} Hz"
        return (
            f"{self.structure} gains: bandwidth {said} (-3 dB), crossover {f:.3g} Hz, "
            f"Ms {self.margins.Ms:.2f}"
        )

    def _rows(self) -> Iterable[Row]:
        turn, force = ("rad", "N m") if self.motion == "rotary" else ("m", "N")
        speed, pid = (f"{force} s/{turn}", f"{force}/{turn}"), ("kp", "ki", "kd")
        units = speed if self.structure == "PI" else (speed[1], f"{force}/({turn} s)", speed[0])
        values = zip(pid, (self.kp, self.ki, self.kd), strict=True)
        if self.cascade:
            units, values = ("1/s", *speed), self.cascade.items()
        for (name, value), unit in zip(values, units, strict=False):
            yield Row(name, number(value), unit)
        if self.cascade:
            yield Row("as a PID", ", ".join(f"{k} {getattr(self, k):.4g}" for k in pid))
        if self.Ti:
            yield Row("Ti", number(self.Ti), "s")
        if self.notch:
            yield Row("notch", "{:.4g} Hz, damping {:g}, depth {:g}".format(*self.notch))
        for name, key, unit in MARGINS:
            at = getattr(self.margins, f"{key}_frequency") / (2.0 * np.pi)
            note = f"at {at:.3g} Hz" if np.isfinite(at) else ""
            if key == "gain_margin":
                low, high = self.margins.gain_range
                note += f", stable from {low:.3g} to {high:.3g} times" if note else ""
            yield Row(name, number(getattr(self.margins, key), 3), unit, note)
        yield Row("worst Ms", number(self.worst, 3), "", "of every axis in the band")
        if self.limit_cycles is not None:
            yield Row("friction", self.limit_cycles._title())
        if self.model is not None:
            yield Row("observer", "what one adds: .observer()")
        yield from noticed(self.messages, "messages")

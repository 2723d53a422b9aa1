"""The excitation to record for a good frequency response: jogs that reverse, and a multisine.

The jogs keep the axis out of the presliding range and carry the low frequencies; the multisine on
the speed reference is a torque of the same size at all frequencies above the loop's bandwidth.
Both are sized by the torque that they cost a speed loop of gain kp on a rigid axis.
"""

from __future__ import annotations

import io
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..blocks.model import as_model
from ..core.display import Row, noticed, number
from ..core.errors import InputError
from ..core.result import Result
from ..core.unit_names import unit_for
from ..core.validation import positive, whole

PERIOD = 4.0  # s, of the multisine
HIGHEST = 0.45  # of the rate, of its lines
TIMES = 2.0  # Fc, the RMS torque of the multisine
SINE = 0.5  # of the speed, and of the torque that friction leaves: the multisine's peak at most
JOGS = 0.6  # of what then remains: a speed loop overshoots
LENGTHS, PAUSES = (0.25, 0.8), (0.0, 0.3)  # s
SLOWEST = 0.15  # of the top speed
STEEP = 0.2  # s of acceleration at most
REVERSALS = 0.8  # of all moves
BANDWIDTH = 10.0  # Hz, of the speed loop where its gain is not given
HOW = (
    "Give w to the speed loop as its reference; a position loop follows theta, and w is added to "
    "its output. Log torque, position and w."
)


@dataclass(frozen=True, eq=False, repr=False)
class ResponsePlan(Result):
    """The references to play: ``t`` in s, ``w`` of speed with the multisine, ``theta`` of position
    without it (rad/s and rad, or m/s and m); ``sine`` is the multisine's RMS torque (N m or N) in a
    speed loop of gain ``kp`` (N m s/rad or N s/m)."""

    t: np.ndarray
    w: np.ndarray
    theta: np.ndarray
    sine: float
    kp: float
    motion: str = "rotary"

    def to_csv(self) -> str:
        """The columns t, w and theta with a header."""
        angle, speed = (unit_for(unit, self.motion) for unit in ("rad", "rad/s"))
        made, head = io.StringIO(), f"t [s],w [{speed}],theta [{angle}]"
        rows = np.column_stack([self.t, self.w, self.theta])
        np.savetxt(made, rows, "%.9g", ",", header=head, comments="")
        return made.getvalue()

    def summary(self) -> dict[str, Any]:
        """Plain Python."""
        arrays = {"t": self.t, "w": self.w, "theta": self.theta}
        return {"schema": 1, **arrays, "sine": self.sine, "kp": self.kp}

    def _title(self) -> str:
        rate = (len(self.t) - 1) / (self.t[-1] - self.t[0])
        return f"Excitation for a frequency response: {len(self.t) / rate:.3g} s at {rate:.5g} Hz"

    def _rows(self) -> Iterable[Row]:
        names = ("rad/s", "rad", "N m", "N m s/rad")
        speed, angle, torque, gain = (unit_for(unit, self.motion) for unit in names)
        said = f"RMS, in a speed loop of gain {number(self.kp)} {gain}"
        return [
            Row("reference", number(float(np.abs(self.w).max())), speed, "at most"),
            Row("travel", number(float(np.ptp(self.theta))), angle),
            Row("multisine", number(self.sine), torque, said),
            *noticed([HOW], "HOW"),
        ]


def response_plan(
    model: Any,
    *,
    rate: float,
    w: float,
    u: float,
    theta: float | None = None,
    kp: float | None = None,
    seed: int = 0,
    duration: float = 30.0,
) -> ResponsePlan:
    """The excitation to record for :func:`frequency_response`: reversing jogs and a multisine.

    Parameters
    ----------
    model : Model, Parameters, dict or path
        With J and, where there is dry friction, Fc: rough values will do.
    rate : float
        Sampling rate of the references in Hz.
    w, u : float
        Largest speed in rad/s (or m/s) and torque in N m (or N).
    theta : float, optional
        Largest distance from the start in rad or m; default: none.
    kp : float, optional
        Proportional gain of the speed loop, N m s/rad or N s/m. Default: that of 10 Hz bandwidth.
    seed : int, optional
        Of lengths, speeds and phases.
    duration : float, optional
        In s, at least 10.

    Returns
    -------
    ResponsePlan
        ``t``, ``w`` and ``theta``; ``to_csv()``. The multisine's torque is twice Fc where the
        limits allow it.

    Raises
    ------
    InputError
        When an argument cannot be meant, J is not declared, or u does not exceed friction.

    Examples
    --------
    >>> plan = lg.response_plan(lg.table1(), rate=1000, w=20, u=1)
    >>> len(plan.t), round(plan.sine, 2), bool(abs(plan.w).max() <= 20)
    (30000, 0.11, True)
    """
    made = as_model(model)
    rate, w, u = positive(rate, "rate", "Hz"), positive(w, "w"), positive(u, "u")
    reach = np.inf if theta is None else positive(theta, "theta")
    g = np.random.default_rng(whole(seed, "seed"))
    values = made.values()
    J, Fc = values["J"], values.get("Fc", 0.0)
    if J is None or Fc is None:
        missing = "J" if J is None else "Fc"
        raise InputError(
            f"{missing} must be declared to size the excitation: a rough value will do."
        )
    if u <= Fc:
        raise InputError(f"u = {u:g} does not exceed Fc = {Fc:g}: the axis would not move.")
    kp = J * 2.0 * np.pi * BANDWIDTH if kp is None else positive(kp, "kp")
    n = round(max(positive(duration, "duration", "s"), 10.0) * rate)
    sine, peak = _multisine(g, n, rate, kp, J)
    top = float(np.abs(sine).max())
    most = min(TIMES * Fc if Fc else np.inf, SINE * (u - Fc) / peak, SINE * w / top)
    steep = JOGS * (u - Fc - most * peak) / J
    jogs = _jogs(g, n, rate, min(w - most * top, STEEP * steep), steep, reach)
    both, position = jogs + most * sine, np.cumsum(jogs) / rate
    return ResponsePlan(np.arange(n) / rate, both, position, most, kp, made.motion)


def _multisine(
    g: np.random.Generator, n: int, rate: float, kp: float, J: float
) -> tuple[np.ndarray, float]:
    """A speed reference (n,) that costs a torque of RMS 1, and the peak of that torque."""
    one = round(PERIOD * rate)
    lines = int(HIGHEST * one)
    X = np.zeros(one // 2 + 1, complex)
    X[1 : lines + 1] = np.exp(2j * np.pi * g.random(lines))
    s = 2j * np.pi / PERIOD * np.arange(len(X))
    torque = np.fft.irfft(X * kp * s / (s + kp / J), one)
    size = torque.std()
    repeated = np.resize(np.fft.irfft(X, one) / size, n)
    return repeated, float(np.abs(torque).max() / size)


def _jogs(
    g: np.random.Generator, n: int, rate: float, top: float, steep: float, reach: float
) -> np.ndarray:
    """Speeds (n,) of moves that mostly reverse and stay within reach of the start."""
    v, k, side, x = np.zeros(n), 0, 1.0, 0.0
    while k < n:
        side *= -1.0 if g.random() < REVERSALS else 1.0
        t = np.arange(round(g.uniform(*LENGTHS) * rate)) / rate
        size = g.uniform(SLOWEST, 1.0) * top
        move = np.minimum(size, steep * np.minimum(t, t[-1] - t))
        far = float(move.sum()) / rate
        if abs(x + side * far) > reach:  # back, and not too far
            side = -float(np.sign(x) or side)
            move *= min(1.0, (reach + abs(x)) / far)
        v[k : k + len(t)] = side * move[: n - k]
        x += side * float(move.sum()) / rate
        k += len(t) + round(g.uniform(*PAUSES) * rate)
    return v

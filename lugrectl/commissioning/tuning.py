"""From a response or a model to the gains of its loop."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from typing import Any

import control as ct
import numpy as np

from ..bench import Recommendation, recommend_observer
from ..blocks.model import Model, as_model, changed
from ..core.display import Row, noticed, number
from ..core.errors import InputError, Refused
from ..core.provenance import Provenance, stamped
from ..core.result import Result
from ..core.unit_names import unit_for
from ..core.validation import flag, positive
from ..core.views import view
from ..hunting import LimitCycles, limit_cycles
from ..hunting.loop import edge
from ..linear import stability_check
from ..linear.stability import StabilityVerdict
from .loop_axis import axis_of, endless
from .loop_shapes import STRUCTURES, Cascade, Gains, Notch, Search, Shape, of_reference

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

    def step(self) -> tuple[np.ndarray, np.ndarray]:
        """t in s, and the position (of a PI the speed) after a step of 1 of its reference."""
        w, L = np.asarray(self.loop.omega), np.asarray(self.loop.frdata)[0, 0]
        dt = 1.0 / self.rate if self.rate else 1.0 / (SMOOTH * self.crossover)
        # the slowest part settles as fast as where the lowest asymptote of |L| is 1, rad/s
        order = 2 if self.structure == "PI" else 3
        k, g = next((k, g) for k, g in enumerate((self.ki, self.kp, self.kd)) if g > 0.0)
        pace = (g / self.inertia) ** (1.0 / (order - k))
        n = min(2 ** int(np.ceil(np.log2(SETTLED / pace / dt))), LONGEST)
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
        return view("loop_plots.tuning")(self)

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
        pid, speed = ("kp", "ki", "kd"), ("N m s/rad", "N m/rad")
        units = speed if self.structure == "PI" else (speed[1], "N m/(rad s)", speed[0])
        values: Mapping[str, float] = {k: getattr(self, k) for k in pid}
        if self.cascade:
            units, values = ("1/s", *speed), self.cascade
        for (name, value), unit in zip(values.items(), units, strict=False):
            yield Row(name, number(value), unit_for(unit, self.motion))
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


FEWER, LEAST = 0.25, 1e-4  # shares of the integral action: how they fall, and the last
NEARLY = 1.2  # ratio of the one that hunts and the one that does not
NONE = (
    "no gains keep the distance 1/Ms to -1: the axis is not known well enough, or Ms is too near 1."
)
SHORT = (
    "the bandwidth asked for, {:.3g} Hz, is out of reach: at Ms {:g} this axis allows at {} "
    "{:.3g} Hz."
)
PAID = "The notch allows integral action that is {:.0f} % faster."
UNPAID = "No notch allows integral action that is 10 % faster."
QUIETER = (
    "To keep the loop from hunting, the integral action is {:.2g} of what Ms allows: the bandwidth "
    "is {:.3g} Hz in place of {:.3g} Hz."
)
PLAIN = (
    "Any integral action hunts, or may: it is left out, and a load moves the axis by {:.3g} {} a "
    "{}."
)
UNDECIDED = "Whether these gains hunt is not decided: they stay."
UNSEEN = "Limit cycles were not searched: {}"
MORE = "The search for limit cycles is without {}."


@stamped("lugrectl.tune")
def tune(
    axis: Any,
    structure: str = "P-PI",
    Ms: float = 1.6,
    dead_time: float = 0.0,
    rate: float | None = None,
    *,
    model: Any = None,
    hunting: bool = True,
    notch: bool = True,
    bandwidth: float | None = None,
) -> Tuning:
    """The gains with the most integral action under a modulus margin, for every axis in the band.

        u = -(kp e + ki int e + kd w),  |1 + L(jw)| >= 1/Ms

    The integral gain is the largest for which that holds at all frequencies and for every response
    in the band, magnitude and phase.

    Parameters
    ----------
    axis : FrequencyResponse, control.FRD, Model, Parameters, path, or control.TransferFunction
        From torque to motor speed, (rad/s)/(N m). Of a :func:`frequency_response` its band counts;
        a plain response and a system are believed. Of a model: inertia, viscous friction, elastic
        couplings, lags and delay; all values known.
    structure : "P-PI", "PID" or "PI"
        P position control around PI speed control; PID on the position, derivative on the measured
        speed; PI speed control.
    Ms : float
        Largest allowed peak of |1/(1 + L)|, above 1.
    dead_time : float
        In s, on top of what the response or model holds.
    rate : float, optional
        Samples of the controller in Hz, whose torque is held and whose speed is the difference of
        two positions. Default: that of the response; continuous time for a model.
    model : Model, Parameters, dict or path, optional
        With friction, for the check of limit cycles; default: ``axis`` where it is a model.
    hunting : bool
        Whether gains may hunt. False: the integral action is reduced until they do not; where
        it is not decided whether they do, they stay, and a message says so.
    notch : bool
        Whether a notch at a resonance is taken where it makes the integral action, (ki/J)^(1/3),
        of a PI (ki/J)^(1/2), 10 % faster; with ``bandwidth`` where that is out of reach without.
    bandwidth : float, optional
        In rad/s, as ``bandwidth`` of the result: gains with this one in place of the highest, and
        with margins that are no smaller.

    Returns
    -------
    Tuning
        ``kp``, ``ki``, ``kd``; of a P-PI also ``cascade`` with kv, kp, ki as :func:`cascade_loop`
        takes them; ``notch``, ``margins``, ``worst``, ``bandwidth``, ``crossover``,
        ``controller``, ``loop``, ``limit_cycles``, ``plot()``, ``observer()``.

    Raises
    ------
    InputError
        When an argument cannot be meant, or a value of the model is not known.
    Refused
        When friction governs all of a response, no gains keep the margin, or none of those
        that do has the ``bandwidth``.

    Notes
    -----
    Where the response is not certain, the fitted mechanics stands in for it with its interval if
    it agrees with it; else P may be wrong by |P| sqrt(1/coherence - 1), all that it does not
    explain, or by what may be left of friction where that governs. Below the lowest frequency the
    axis is a free inertia. Beyond the last one P is the fitted mechanics, with its interval and
    with the largest resonance (1 % damping) that the response leaves possible; where that says
    less, P is any phase of a magnitude that falls as 1/w from where the mechanics ends, from a peak
    that it has beyond, or, where it is not sure there, from the largest value of the last octave.
    A response sampled at another rate is turned into that of
    ``rate`` by the ratio of the holds. The torque limit is not in it. The zeros of a P-PI are real,
    those of a PID have a damping of 0.7 or more.

    ``bandwidth`` is -3 dB of the answer to the reference: theta/r (of a PI w/r) of the closed loop
    with hold, dead time and notch, and nothing in front of it; in :func:`assure` and
    :func:`compensate` the argument of that name is the speed of the poles.

    References
    ----------
    K. J. Astrom, H. Panagopoulos and T. Hagglund, Design of PI controllers based on non-convex
    optimization, Automatica 34(5), 1998 (most integral action under a bound on Ms).

    Examples
    --------
    A rigid axis of 0.01 kg m2 with 1 ms of dead time, sampled at 1 kHz:

    >>> found = lg.tune(ct.tf([1.0], [0.01, 0.01]), "P-PI", dead_time=1e-3, rate=1000.0)
    >>> round(found.margins.Ms, 2), {k: float(f"{v:.2g}") for k, v in found.cascade.items()}
    (1.6, {'kv': 51.0, 'kp': 1.8, 'ki': 91.0})
    """
    structure = {s.lower(): s for s in STRUCTURES}.get(str(structure).lower(), structure)
    if structure not in STRUCTURES:
        raise InputError(f"structure must be one of {', '.join(STRUCTURES)}, not {structure!r}.")
    if positive(Ms, "Ms") <= 1.0:
        raise InputError(f"Ms = {Ms:g} must be above 1: |1/(1 + L)| goes to 1.")
    made = axis_of(axis, dead_time, rate)
    made = made if model is None else replace(made, model=as_model(model))
    search = Search(made, structure, float(Ms))
    asked = None if bandwidth is None else positive(bandwidth, "bandwidth", "rad/s")
    shape, said = search.best(), []
    if np.isnan(shape.c):
        raise endless()
    if not shape.c:
        raise Refused(NONE, "")
    may_hunt = flag(hunting, "hunting")
    enough = asked is not None and search.bandwidth(shape) >= asked
    if flag(notch, "notch") and made.peaks and not enough:
        search, shape, ratio = search.with_notch(shape)
        said.append(UNPAID if search.notch is None else PAID.format(100.0 * (ratio - 1.0)))
    if asked is not None:
        search, shape = _asked(search, shape, asked)
    cycles = None
    try:
        cycles = _cycles(search, shape)
        if not may_hunt and _outcome(cycles) == "hunts":
            hunts = search.bandwidth(shape)
            search, shape, cycles = _quiet(search, shape)
            said.append(_quieter(search, shape, hunts))
        said += [UNDECIDED] if not may_hunt and _outcome(cycles) == "undecided" else []
    except InputError as no:
        if not may_hunt:
            raise
        said += [UNSEEN.format(no)] if made.model else []
    left = [*["notch"] * bool(search.notch), *["dead time"] * bool(made.dead_time and not made.dt)]
    if left and cycles is not None:
        said.append(MORE.format(" and ".join(left)))
    return _result(search, shape, cycles, (*said, *made.said))


def _asked(search: Search, shape: Shape, asked: float) -> tuple[Search, Shape]:
    """The same at a bandwidth in rad/s; Refused where it is out of reach."""
    low, high = (search.bandwidth(shape._replace(c=c)) for c in (search.lowest, shape.c))
    high = min(high, float(search.axis.w[search.axis.known][-1]))
    if not low <= asked <= high:
        bound, what = (low, "least") if asked < low else (high, "most")
        hertz = (x / (2.0 * np.pi) for x in (asked, bound))
        raise Refused(SHORT.format(next(hertz), search.Ms, what, next(hertz)), "")
    search = replace(search, asked=asked)
    return search, search.placed(shape)


def _cycles(search: Search, shape: Shape) -> LimitCycles | None:
    """The limit cycles with these gains; None without dry friction, InputError where it is not
    known. Where a sampled loop stays undecided, hunting in continuous time counts."""
    axis = search.axis
    if axis.model is None:
        raise InputError("whether a loop hunts is a matter of its friction: give model=.")
    if "Fc" not in axis.model.friction.values:
        return None
    model = axis.model if axis.model.J else changed(axis.model, {"J": axis.J}, "model")
    gains = search.gains(shape)._asdict()
    given: dict[str, Any] = {k: max(float(v), 0.0) for k, v in gains.items()}
    if axis.dt is None or not given["ki"]:
        return limit_cycles(model, **given)
    found = limit_cycles(model, **given, rate=1.0 / axis.dt, dead_time=axis.dead_time)
    exact = limit_cycles(model, **given) if found.hunts is None else found
    return exact if exact.hunts else found


def _outcome(found: LimitCycles | None) -> str:
    """Without dry friction a loop rests."""
    return "rests" if found is None else found.outcome


def _quiet(search: Search, shape: Shape) -> tuple[Search, Shape, LimitCycles | None]:
    """The same with the largest share of the integral action at which nothing hunts."""

    @cache
    def tried(share: float) -> tuple[Search, Shape, LimitCycles | None]:
        made = replace(search, share=share)
        now = made.placed(shape)
        return made, now, _cycles(made, now)

    def is_quiet(share: float) -> bool:
        return bool(tried(share)[2])

    share = FEWER
    while share and not is_quiet(share):
        share = FEWER * share if FEWER * share > LEAST else 0.0
    return tried(edge(is_quiet, share, share / FEWER, NEARLY)[0] if share else 0.0)


def _quieter(search: Search, shape: Shape, before: float) -> str:
    if search.share:
        hertz = (x / (2.0 * np.pi) for x in (search.bandwidth(shape), before))
        return QUIETER.format(search.share, *hertz)
    turn, force = (unit_for(unit, search.axis.motion) for unit in ("rad", "N m"))
    return PLAIN.format(1.0 / float(search.gains(shape).kp), turn, force)


def _result(
    search: Search, shape: Shape, cycles: LimitCycles | None, said: tuple[str, ...]
) -> Tuning:
    axis, g = search.axis, Gains(*map(float, search.gains(shape)))
    loop = ct.FrequencyResponseData(search.loop(g), axis.w[axis.known], axis.dt or 0)
    margins = stability_check(loop)
    if not margins:
        raise Refused(f"no gains are certain to be stable: {margins.reason}.", "")
    pid = search.structure == "PID"
    parts = None if pid else Cascade(*map(float, search.cascade(shape)))
    own = Gains(parts.kp, parts.ki, 0.0) if parts and search.structure == "PI" else g
    return Tuning(
        search.structure,
        *own,
        cascade=parts._asdict() if parts and search.structure == "P-PI" else None,
        notch=search.notch,
        margins=margins,
        worst=float(1.0 / search.distance(search.controller(g))[0]),
        bandwidth=search.bandwidth(shape),
        crossover=max(margins.crossovers, default=float("nan")),
        controller=own.system(axis.dt, search.notch),
        loop=loop,
        rate=1.0 / axis.dt if axis.dt else None,
        dead_time=axis.dead_time,
        inertia=axis.J,
        limit_cycles=cycles,
        messages=said,
        motion=axis.motion,
        model=axis.model,
    )

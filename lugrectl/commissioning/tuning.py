"""From a response or a model to the gains of its loop.

Each point of the axis, position over torque, is a disc of the complex plane; beyond the last
frequency it is centred at 0. The gains are those with the most integral action at which every
member of the band keeps its distance:

    L = G (kp + ki I + kd D) N        |1 + L| - |C| radius >= 1/Ms  at all frequencies

A shape is the place of the controller's zeros about its crossover c = kd/J: their geometric mean
m c and their damping zeta. Of each shape c is raised from far below until the distance is first
kept no more.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, cached_property
from itertools import product
from typing import Any, NamedTuple

import control as ct
import numpy as np

from ..bench.observers import Recommendation, recommend_observer
from ..blocks.model import Model, as_model, changed
from ..blocks.plant import plant
from ..core.display import Row, noticed
from ..core.display import number as figure
from ..core.errors import InputError, Refused
from ..core.option_names import option
from ..core.provenance import Provenance, stamped
from ..core.result import Result, picked
from ..core.unit_names import unit_for
from ..core.validation import flag, not_negative, positive
from ..core.views import view
from ..hunting.hunt import LimitCycles, limit_cycles
from ..hunting.loop import cascade_as_pid, edge
from ..linear import bandwidth_check, linearize, stability_check
from ..linear.stability import StabilityVerdict
from ..linear.transfer import response
from .fits import DISC, LOW, Mechanics, hold, is_low, point
from .of_record import LINEAR, UNIT, FrequencyResponse

FINER = 4  # steps between two measured frequencies
BELOW, ABOVE, BEYOND = 30.0, 30.0, 40  # how far the axis is continued, in so many points
LEAST_COHERENCE = 0.05  # one of 20 equations in a window: what chance alone explains
DENSE, SIDES = 150, np.linspace(-10.0, 10.0, 61)  # points in a decade; half-widths about a mode
ZERO = 1e-9  # of the fastest pole: a pole or zero that is slower is an integrator
LIGHT = 0.5  # damping ratio below which a mode has points of its own
PEAK = 2.0  # times what is an octave away: a resonance at which a notch may pay
TOP = (
    "Beyond {:.4g} Hz P may be any phase of what falls as 1/f from {:.3g} {}. A resonance that no "
    "point shows may be larger there, and bring the loop nearer to -1."
)
OPEN = (
    "{} of {} points, {:.3g} to {:.4g} Hz, are not certain: there the fitted mechanics holds where "
    "it agrees, else P may be wrong by all that it does not explain, or that is left of friction."
)
ENDLESS = "nothing limits the gains of this axis: give {} or {}."
GOVERNED = "friction governs this log at all frequencies that it shows: no gains follow from it."


@dataclass(frozen=True, eq=False)
class Axis:
    """G = theta/u (n,) in rad/(N m) at w (n,) in rad/s, and the radius (n,) of its discs; ``known``
    is where G itself means something. ``J`` is the inertia at low frequencies, ``corner`` B/J,
    ``dt`` the step of the controller in s, ``peaks`` the resonances in rad/s."""

    w: np.ndarray
    G: np.ndarray
    radius: np.ndarray
    known: np.ndarray
    J: float
    corner: float
    dt: float | None
    dead_time: float
    peaks: tuple[float, ...] = ()
    said: tuple[str, ...] = ()
    motion: str = "rotary"
    model: Model | None = field(default=None, repr=False)


def axis_of(given: Any, dead_time: Any, rate: Any) -> Axis:
    delay = not_negative(dead_time, "dead_time")
    dt = None if rate is None else 1.0 / positive(rate, "rate", "Hz")
    if isinstance(given, FrequencyResponse):
        sure, f = given.certain, given.frequency / (2.0 * np.pi)
        if not sure.any():
            raise Refused(GOVERNED, " ".join(given.messages[:1]))
        made, f = _discs(given).axis(delay, dt), f[~sure]
        said = [OPEN.format(len(f), len(sure), f[0], f[-1])] if len(f) else []
        return replace(made, said=(*said, *made.said))
    if isinstance(given, ct.FrequencyResponseData):
        w, P = response(given, "P")
        P, w = P[w > 0], w[w > 0]
        return _Measured(w, P, np.zeros(len(w)), _step(given.dt)).axis(delay, dt)
    if isinstance(given, ct.TransferFunction | ct.StateSpace):
        return _of_system(given, delay, dt)
    model = as_model(given)
    own = sum(p.values["delay"] or 0.0 for p in model.effects if p.block.name == "input_delay")
    made = _of_system(_free(model), delay + own, dt)
    return replace(made, motion=model.motion, model=model, dead_time=delay)


def _discs(found: FrequencyResponse) -> _Measured:
    """The response, or where it is not certain the fitted mechanics if it lies within what is."""
    w, P, sure, body = found.frequency, np.ravel(found.frd.frdata), found.certain, found.mechanics
    open_ = np.sqrt(1.0 / np.maximum(found.coherence, LEAST_COHERENCE) - 1.0)
    left = 1.0 if body is None else min(DISC * body.share, 1.0)
    left = left * np.abs(np.ravel(found.raw.frdata) / P - 1.0)
    open_ = np.where(found.governed, np.maximum(open_, left), open_)
    error, miss = np.where(sure, found.high / found.magnitude - 1.0, open_), 0.0
    if body is not None:
        fitted = body.response(w)
        miss = float(np.quantile(np.abs(fitted / P - 1.0)[sure], 0.95))
        narrow = body.radius(w) + miss
        better = (np.abs(fitted - P) <= error * np.abs(P)) & (narrow < error)
        P, error = np.where(better, fitted, P), np.where(better, narrow, error)
    return _Measured(w, P, error, _step(found.frd.dt), body, miss, found.motion)


def _step(dt: Any) -> float | None:
    return None if dt is None or isinstance(dt, bool) or not dt else float(dt)


@dataclass(frozen=True, eq=False)
class _Measured:
    """A speed over torque P (n,) with its relative error; ``own`` is the step of its hold, ``miss``
    what the fitted mechanics ``body`` misses, as a share."""

    w: np.ndarray
    P: np.ndarray
    error: np.ndarray
    own: float | None
    body: Mechanics | None = None
    miss: float = 0.0
    motion: str = "rotary"

    def axis(self, delay: float, dt: float | None) -> Axis:
        """The axis under a controller's hold and dead time, made finer and continued."""
        J, corner = _inertia(self.w, self.P)
        dt = self.own if dt is None else dt
        end = np.inf if dt is None else np.pi / dt
        w, P, error = self._finer(J)
        w, P, error = (part[w < end] for part in (w, P, error))
        G = P / (1j * w) * hold(w, dt) / hold(w, self.own) * np.exp(-1j * w * delay)
        high = np.geomspace(w[-1], min(0.999 * end, ABOVE * w[-1]), BEYOND + 1)[1:]
        most = self._largest(w, np.abs(P) * (1.0 + error), high[-1])
        return Axis(
            np.r_[w, high],
            np.r_[G, 0.0 * high],
            np.r_[np.abs(G) * error, most / high**2],
            np.arange(len(w) + BEYOND) < len(w),
            *(J, corner, dt, delay, _peaks(w, P)),
            (TOP.format(w[-1] / 2 / np.pi, most / w[-1], UNIT[self.motion]),),
            self.motion,
        )

    def _finer(self, J: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Between the frequencies, and below them."""
        n = len(self.w)
        x, fine = np.arange(n), np.linspace(0, n - 1, FINER * (n - 1) + 1)
        at, shape = np.exp(np.interp(fine, x, np.log(self.w))), np.ones(len(fine), complex)
        if self.body is not None:
            known = self.body.shape(at)
            shape = known.num / known.den
        smooth = self.P / shape[::FINER]
        log = np.interp(fine, x, np.log(np.abs(smooth)) + 0j)
        log += 1j * np.interp(fine, x, np.unwrap(np.angle(smooth)))
        error = np.interp(fine, x, self.error)
        low = np.geomspace(at[0] / BELOW, at[0], BEYOND, False)
        lowest = np.full(BEYOND, np.median(error[at <= LOW * at[0]]))
        return np.r_[low, at], np.r_[-1j / (J * low), np.exp(log) * shape], np.r_[lowest, error]

    def _largest(self, w: np.ndarray, size: np.ndarray, end: float) -> float:
        """w|P| from which it falls beyond the last frequency: of the last octave, or, where the
        mechanics explains the end of the response, there and of its resonances beyond."""
        octave = float(np.max((w * size)[w > 0.5 * w[-1]]))
        if self.body is None:
            return octave
        far = np.geomspace(w[-1], end, DENSE)
        off = np.minimum(self.body.radius(far) + self.miss, 1.0)
        beyond = float(np.max(far * np.abs(self.body.response(far)) * (1.0 + off)))
        return max(beyond, w[-1] * float(size[-1]) if off[0] < 1.0 else octave)


def endless() -> Refused:
    return Refused(ENDLESS.format(option("rate"), option("dead_time")), "")


def _inertia(w: np.ndarray, P: np.ndarray) -> tuple[float, float]:
    """J and B/J of 1/P = B + jwJ, at low frequencies."""
    low = is_low(w)
    resists = 1.0 / P[low]
    J, B = float(np.median(resists.imag / w[low])), float(np.median(resists.real))
    if not J > 0.0:
        raise Refused("at low frequencies the response is not that of an inertia.", "")
    return J, max(B, 0.0) / J


def _peaks(w: np.ndarray, P: np.ndarray) -> tuple[float, ...]:
    """Where w|P| is largest about an octave, by far: the two highest."""
    size = w * np.abs(P)

    def stands_out(k: int) -> bool:
        near = size[(w > w[k] / 2) & (w < w[k] * 2)]
        return size[k] == near.max() and size[k] > PEAK * np.median(near)

    found = filter(stands_out, range(1, len(w) - 1))
    return tuple(float(w[k]) for k in sorted(found, key=lambda k: -size[k])[:2])


def _free(model: Model) -> ct.StateSpace:
    kept = [p for p in model.effects if p.block.name in LINEAR and p.block.name != "input_delay"]
    effects = [{"name": p.block.name, **p.values} for p in kept]
    Fv = model.friction.values.get("Fv")
    made = Model.of(J=model.J, friction="viscous", Fv=Fv or 0.0, effects=effects)
    missing = [k for k, v in made.values().items() if v is None]
    if missing:
        raise InputError(f"{', '.join(missing)} must be known to tune: identify it first.")
    return linearize(plant(made), input="u", output="w")


def _of_system(system: Any, delay: float, dt: float | None) -> Axis:
    if (system.ninputs, system.noutputs) != (1, 1):
        raise InputError("tune needs a system from torque to speed, with one input and one output.")
    own = _step(system.dt)
    poles, zeros = np.asarray(system.poles()), np.asarray(system.zeros())
    if own:
        poles, zeros = (np.log(x[np.abs(x) > 0] + 0j) / own for x in (poles, zeros))
    if (np.real(poles) > 1e-6 * np.abs(poles)).any():
        raise InputError(
            "the system from torque to speed is not stable: tune is for axes that are."
        )
    dt = own if dt is None else dt
    w = _grid(np.r_[poles, zeros], [x for x in (delay, dt) if x], dt or own)
    P, none = np.asarray(system(point(w, own))), np.zeros(len(w))
    if own:
        return _Measured(w, P, none, own).axis(delay, dt)
    position: Any = ct.ss(system) * ct.ss(0, 1, 1, 0)
    held = position if dt is None else ct.sample_system(position, dt)
    G = held(point(w, dt)) * np.exp(-1j * w * delay)
    return Axis(w, G, none, none == 0.0, *_inertia(w, P), dt, delay, _peaks(w, P))


def _grid(features: np.ndarray, times: Sequence[float], dt: float | None) -> np.ndarray:
    """Frequencies from far below to far above all poles and zeros, dense about light ones."""
    size = np.abs(features)
    marks = np.r_[size[size > ZERO * max(size, default=0.0)], [1.0 / t for t in times]]
    if not len(marks):
        raise endless()
    end = 0.999 * np.pi / dt if dt else 1e3 * marks.max()
    low = min(1e-3 * marks.min(), 1e-3 * end)
    w = np.geomspace(low, end, int(DENSE * np.log10(end / low)))
    light = features[(np.imag(features) > 0) & (np.abs(np.real(features)) < LIGHT * size)]
    near = [abs(x) * (1.0 + abs(x.real) / abs(x) * SIDES) for x in light]
    w = np.unique(np.concatenate([w, *near]))
    return w[(w >= low) & (w <= end)]


STRUCTURES = ("P-PI", "PID", "PI")
MEAN, ZETA = np.geomspace(0.03, 1.2, 11), (0.7, 1.0, 1.3, 1.7, 2.5)  # shapes that are tried first
LEAST_ZETA = {"P-PI": 1.0, "PID": 0.7, "PI": 1.0}  # a P-PI has real zeros
STEPS, HALVINGS = 40, 12  # of c from the lowest to the highest, and then
CLOSE = 1.0 + 5e-7  # ratio of two c between which the bandwidth is that asked
ROUNDS, SPREAD = 4, 1.6  # of finer shapes about the best, at first by such factors
NOTCHES = [(d, depth) for d in (0.3, 0.8) for depth in (0.1, 0.3)]  # damping, depth
PAYS = 1.1  # times as fast


class Notch(NamedTuple):
    """As :func:`lugrectl.notch` and ``cascade_loop(notch=)`` take it; the frequency in Hz."""

    frequency: float
    damping: float
    depth: float

    def system(self, dt: float | None) -> Any:
        W = 2.0 * np.pi * self.frequency
        num, den = ([1.0, 2.0 * d * self.damping * W, W**2] for d in (self.depth, 1.0))
        made: Any = ct.tf(num, den)
        if dt is None:
            return made
        return ct.sample_system(made, dt, "bilinear", prewarp_frequency=W)


class Gains(NamedTuple):
    """Of u = -(kp e + ki int e + kd w), floats or (m,)."""

    kp: Any
    ki: Any
    kd: Any

    def system(self, dt: float | None, notch: Notch | None) -> Any:
        integral, speed = parts(dt)
        made = self.kp + self.ki * integral
        made = made + self.kd * speed if self.kd else made
        return made if notch is None else made * notch.system(dt)


class Shape(NamedTuple):
    """The crossover c in rad/s, and the place of the zeros about it."""

    c: Any
    mean: Any
    zeta: Any


@dataclass(frozen=True, eq=False)
class Search:
    """An axis and what is asked of its loop; ``share`` is that of the shape's integral action,
    ``asked`` a bandwidth in rad/s in place of the highest."""

    axis: Axis
    structure: str
    Ms: float
    notch: Notch | None = None
    share: float = 1.0
    asked: float | None = None

    def gains(self, shape: Shape) -> Gains:
        """Those of one shape, or of many."""
        if self.structure != "PID":
            return Gains(*cascade_as_pid(*self.cascade(shape), self.axis.dt or 0.0))
        kd, turn = self.axis.J * shape.c, shape.mean * shape.c
        return Gains(2.0 * shape.zeta * turn * kd, self.share * kd * turn**2, kd)

    def cascade(self, shape: Shape) -> tuple[Any, Any, Any]:
        """kv, kp, ki of a P-PI; of a PI without the position loop."""
        kp, turn = self.axis.J * shape.c, shape.mean * shape.c
        if self.structure == "PI":
            return 0.0, kp, self.share * kp * turn
        spread = np.sqrt(shape.zeta**2 - 1.0)
        kv, ki = turn * (shape.zeta - spread), kp * turn * (shape.zeta + spread)
        return kv, kp, self.share * ki

    @cached_property
    def _parts(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Notch, and with it integral and derivative, at the frequencies of the axis."""
        at, dt = point(self.axis.w, self.axis.dt), self.axis.dt
        filtered = np.ones(len(at)) if self.notch is None else self.notch.system(dt)(at)
        integral, speed = (filtered * part(at) for part in parts(dt))
        return filtered, integral, speed

    def controller(self, g: Gains) -> np.ndarray:
        return np.column_stack(np.broadcast_arrays(*map(np.atleast_1d, g))) @ np.array(self._parts)

    def bandwidth(self, shape: Shape) -> float:
        """Where the answer to the reference first falls below -3 dB, rad/s; inf: beyond the axis
        that is known."""
        g, w, dt = self.gains(shape), self.axis.w[self.axis.known], self.axis.dt
        kv = self.cascade(shape)[0] if self.structure == "P-PI" else 0.0
        L, part = self.loop(g), of_reference(self.structure, g, kv, w, dt)
        return float(bandwidth_check(ct.frd(L / (1.0 + L) * part, w)).bandwidth)

    def loop(self, g: Gains) -> np.ndarray:
        return (self.axis.G * self.controller(g)[0])[self.axis.known]

    def distance(self, C: np.ndarray) -> np.ndarray:
        """The least |1 + L| of all members of the band (m,), with controllers C (m, n)."""
        return np.min(np.abs(1.0 + self.axis.G * C) - np.abs(C) * self.axis.radius, axis=1)

    @property
    def lowest(self) -> float:
        """Where c begins: below the corner of viscous friction a position loop is of another
        kind."""
        first = 10.0 * float(self.axis.w[self.axis.known][0])
        return first if self.structure == "PI" else max(first, self.axis.corner)

    def highest(self, mean: np.ndarray, zeta: np.ndarray) -> np.ndarray:
        """The c (m,) at which the distance is first kept no more; 0 where it never is, nan where
        nothing ends it."""
        last = self.axis.w[self.axis.known][-1]
        low, high = np.zeros(len(mean)), np.full(len(mean), np.nan)
        for c in np.geomspace(self.lowest, last, STEPS):
            rising = np.isnan(high)
            kept = rising & self._keeps(Shape(c, mean, zeta))
            high[rising & ~kept & (low > 0.0)], low[kept] = c, c
        endless = np.isnan(high) & (low > 0.0)
        for _ in range(HALVINGS):
            c = np.sqrt(low * high)
            kept = self._keeps(Shape(c, mean, zeta))
            low, high = np.where(kept, c, low), np.where(kept, high, c)
        return np.where(endless, np.nan, low)

    def _keeps(self, shape: Shape) -> np.ndarray:
        """Whether the loop is stable (Nyquist) and keeps the distance, (m,)."""
        C, known = self.controller(self.gains(shape)), self.axis.known
        turned = np.unwrap(np.angle(1.0 + C[:, known] * self.axis.G[known]))
        first = turned[:, 0] - 2.0 * np.pi * (turned[:, 0] > 0.0)  # of up to three integrators
        ends = first + turned[:, -1] - turned[:, 0]
        return (np.abs(ends) < 0.5 * np.pi) & (self.distance(C) >= 1.0 / self.Ms)

    def best(self, about: Shape | None = None) -> Shape:
        """The shape with the most integral action, of all or near one; its c is 0 where no gains
        keep the distance, nan where nothing ends them."""
        found = self.at(about or self._best_of(MEAN, np.array(ZETA)))
        for k in range(ROUNDS):
            spread = SPREAD ** (np.linspace(-1.0, 1.0, 5) / 2**k)
            near = self._best_of(found.mean * spread, found.zeta * spread)
            found = max(near, found, key=self.action)
        return found

    def _best_of(self, mean: np.ndarray, zeta: np.ndarray) -> Shape:
        zeta = np.unique(np.maximum(zeta, LEAST_ZETA[self.structure]))
        m, z = (x.ravel() for x in np.meshgrid(mean, zeta[: 1 if self.structure == "PI" else None]))
        made = [Shape(*x) for x in zip(self.highest(m, z), m, z, strict=True)]
        return max(made, key=self.action)

    def at(self, shape: Shape) -> Shape:
        return shape._replace(c=self.highest(*np.array([[shape.mean], [shape.zeta]]))[0])

    def placed(self, shape: Shape) -> Shape:
        """The shape at its highest c, or below it at the bandwidth that is asked."""
        found = self.at(shape)
        if self.asked is None or not found.c or self.bandwidth(found) <= self.asked:
            return found

        def is_slower(c: float) -> bool:
            return self.bandwidth(shape._replace(c=c)) <= float(self.asked or 0.0)

        return shape._replace(c=edge(is_slower, self.lowest, found.c, CLOSE)[0])

    def action(self, shape: Shape) -> float:
        """ki, or kp of a speed loop's PID: infinite where nothing ends it."""
        made = self.gains(shape)
        size = made.kp if self.structure == "PI" else made.ki
        return np.inf if np.isnan(size) else float(size)

    def with_notch(self, plain: Shape) -> tuple[Search, Shape, float]:
        """The search and shape with the notch that pays most, and how much faster the integral
        action is with it; the same where none pays."""
        order = 2.0 if self.structure == "PI" else 3.0
        end = np.inf if self.axis.dt is None else 0.9 * np.pi / self.axis.dt
        peaks, best = [peak for peak in self.axis.peaks if peak < end], (self, plain, 1.0)
        for peak, (damping, depth) in product(peaks, NOTCHES):
            one = replace(self, notch=Notch(peak / (2.0 * np.pi), damping, depth))
            shape = one.best(plain)
            ratio = (self.action(shape) / self.action(plain)) ** (1.0 / order)
            if ratio > max(PAYS, best[2]):
                best = (one, shape, ratio)
        return best


def parts(dt: float | None) -> tuple[Any, Any]:
    """Return I and D: 1/s and s; of a sampled controller trapezoids, and the difference."""
    if dt is None:
        return ct.tf([1.0], [1.0, 0.0]), ct.tf([1.0, 0.0], [1.0])
    return ct.tf([dt / 2, dt / 2], [1.0, -1.0], dt), ct.tf([1 / dt, -1 / dt], [1.0, 0.0], dt)


def of_reference(
    structure: str, g: Gains, kv: float, w: np.ndarray, dt: float | None
) -> np.ndarray:
    if structure == "PI":
        return np.ones(len(w))
    integral, speed = (part(point(w, dt)) for part in parts(dt))
    if structure == "P-PI":
        return kv / (kv + speed)
    on_error = g.kp + g.ki * integral
    return on_error / (on_error + g.kd * speed)


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
        In kg m2 (kg on a linear drive), at low frequencies.
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
        own: Any = {"rate": self.rate, "delay": self.dead_time, "bandwidth": self.crossover}
        return recommend_observer(self.model, **(own | known))

    def plot(self) -> Sequence[Any]:
        """Draw the Nyquist curve with the circle of Ms, and a step; returns the Axes."""
        return view("loop_plots.tuning")(self)

    def summary(self) -> dict[str, Any]:
        """Plain Python, as under ``gains`` of ``lugrectl bode --json``."""
        names = "structure kp ki kd cascade Ti worst bandwidth crossover rate dead_time messages"
        margins = [key for _, name, _ in MARGINS for key in (name, f"{name}_frequency")]
        return {
            **picked(self, f"{names} limit_cycles"),
            **picked(self.margins, " ".join(["Ms", *margins])),
            "notch": None if self.notch is None else self.notch._asdict(),
            "hunts": None if self.limit_cycles is None else self.limit_cycles.hunts,
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
        pid, speed = {k: getattr(self, k) for k in Gains._fields}, ("N m s/rad", "N m/rad")
        units = speed if self.structure == "PI" else (speed[1], "N m/(rad s)", speed[0])
        units = ("1/s", *speed) if self.cascade else units
        for (name, value), unit in zip((self.cascade or pid).items(), units, strict=False):
            yield Row(name, figure(value), unit_for(unit, self.motion))
        if self.cascade:
            yield Row("as a PID", ", ".join(f"{k} {v:.4g}" for k, v in pid.items()))
        if self.Ti:
            yield Row("Ti", figure(self.Ti), "s")
        if self.notch:
            yield Row("notch", "{:.4g} Hz, damping {:g}, depth {:g}".format(*self.notch))
        for name, key, unit in MARGINS:
            at = getattr(self.margins, f"{key}_frequency") / (2.0 * np.pi)
            note = f"at {at:.3g} Hz" if np.isfinite(at) else ""
            if key == "gain_margin" and note:
                note += ", stable from {:.3g} to {:.3g} times".format(*self.margins.gain_range)
            yield Row(name, figure(getattr(self.margins, key), 3), unit, note)
        yield Row("worst Ms", figure(self.worst, 3), "", "of every axis in the band")
        if self.limit_cycles is not None:
            yield Row("friction", self.limit_cycles._title())
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
QUIETER = (
    "To keep the loop from hunting, the integral action is {:.2g} of what Ms allows: the bandwidth "
    "is {:.3g} Hz in place of {:.3g} Hz."
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
    axis is a free inertia. Beyond the last one P is any phase of a magnitude that falls as 1/w from
    where the fitted mechanics ends, from a peak that it has beyond, or, where it is not sure there,
    from the largest value of the last octave.
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
        said += [PAID.format(100.0 * (ratio - 1.0))] * bool(search.notch)
    if asked is not None:
        search, shape = _asked(search, shape, asked)
    cycles = None
    try:
        cycles = _cycles(search, shape)
        if not may_hunt and cycles is not None and cycles.outcome == "hunts":
            before = search.bandwidth(shape)
            search, shape, cycles = _quiet(search, shape)
            hertz = (x / (2.0 * np.pi) for x in (search.bandwidth(shape), before))
            said.append(QUIETER.format(search.share, *hertz))
        if not may_hunt and cycles is not None and cycles.outcome == "undecided":
            said.append(UNDECIDED)
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
    given: dict[str, Any] = {
        k: max(float(v), 0.0) for k, v in search.gains(shape)._asdict().items()
    }
    if axis.dt is None or not given["ki"]:
        return limit_cycles(model, **given)
    found = limit_cycles(model, **given, rate=1.0 / axis.dt, dead_time=axis.dead_time)
    exact = limit_cycles(model, **given) if found.hunts is None else found
    return exact if exact.hunts else found


def _quiet(search: Search, shape: Shape) -> tuple[Search, Shape, LimitCycles | None]:
    """The same with the largest share of the integral action at which nothing hunts."""

    @cache
    def tried(share: float) -> tuple[Search, Shape, LimitCycles | None]:
        made = replace(search, share=share)
        return made, (now := made.placed(shape)), _cycles(made, now)

    share = FEWER
    while share and not tried(share)[2]:
        share = FEWER * share if FEWER * share > LEAST else 0.0
    return tried(
        edge(lambda x: bool(tried(x)[2]), share, share / FEWER, NEARLY)[0] if share else 0.0
    )


def _result(
    search: Search, shape: Shape, cycles: LimitCycles | None, said: tuple[str, ...]
) -> Tuning:
    axis, g = search.axis, Gains(*map(float, search.gains(shape)))
    loop = ct.FrequencyResponseData(search.loop(g), axis.w[axis.known], axis.dt or 0)
    margins = stability_check(loop)
    if not margins:
        raise Refused(f"no gains are certain to be stable: {margins.reason}.", "")
    cascade: dict[str, float] | None = None
    if search.structure != "PID":
        cascade = dict(zip(("kv", "kp", "ki"), map(float, search.cascade(shape)), strict=True))
    own = Gains(cascade["kp"], cascade["ki"], 0.0) if cascade and search.structure == "PI" else g
    return Tuning(
        search.structure,
        *own,
        cascade=cascade if search.structure == "P-PI" else None,
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

"""What a controller meets: position over torque, with hold, dead time, and how well it is known.

Each point is a disc of the complex plane. Where the response is certain it is the 95 % disc; where
it is not, its radius is all that the response does not explain, |P| sqrt(1/coherence - 1), or what
may be left of friction where that governs. Beyond the last frequency the disc is centred at the
fitted mechanics, and its radius is that of the fit and of the largest resonance that the response
leaves possible there; where that is no smaller, it is centred at 0, of any phase.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import control as ct
import numpy as np

from ..blocks.model import Model, as_model
from ..blocks.plant import plant
from ..core.errors import InputError, Refused
from ..core.option_names import option
from ..core.validation import number, positive
from ..linear import linearize
from ..linear.transfer import response
from .mechanics import Mechanics
from .of_record import LINEAR, UNIT, FrequencyResponse
from .runs import hold, point

FINER = 4  # steps between two measured frequencies
BELOW, ABOVE, BEYOND = 30.0, 30.0, 40  # how far the axis is continued, in so many points
LEAST_COHERENCE = 0.05  # one of 20 equations in a window: what chance alone explains
WHOLE = np.sqrt(-np.log(0.05))  # deviations to the radius of a 95 % disc
LOW = 4.0  # times the lowest frequency: where the axis is a free inertia
DENSE, SIDES = 150, np.linspace(-10.0, 10.0, 61)  # points in a decade; half-widths about a mode
ZERO = 1e-9  # of the fastest pole: a pole or zero that is slower is an integrator
LIGHT = 0.5  # damping ratio below which a mode has points of its own
PEAK = 2.0  # times what is an octave away: a resonance at which a notch may pay
TOP = (
    "Beyond {:.4g} Hz the fitted mechanics counts where the response rules out a resonance; else "
    "|P| may be any phase of what falls as 1/f from {:.3g} {}. A resonance that no point "
    "shows may be larger there, and bring the loop nearer to -1."
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
    """Return the axis of a response, a model or a linear system; InputError for anything else."""
    delay = number(dead_time, "dead_time")
    if delay < 0.0:
        raise InputError(f"dead_time = {delay:g} is negative.")
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
    left = 1.0 if body is None else min(WHOLE * body.fit.share, 1.0)
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
    """The sample time of a control object, None where it has none."""
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
        far, open_ = self._beyond(high, most / high**2, delay, dt)
        return Axis(
            np.r_[w, high],
            np.r_[G, far],
            np.r_[np.abs(G) * error, open_],
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

    def _beyond(
        self, w: np.ndarray, open_: np.ndarray, delay: float, dt: float | None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Centres and radii beyond the last frequency, where ``open_`` is possible in any phase."""
        body, far = self.body, np.zeros(len(w), complex)
        if body is None:
            return far, open_

        def plain(w: np.ndarray) -> np.ndarray:
            return -body.response(w) / hold(w, self.own) / w**2

        fitted = plain(w) if dt is None else plain(w) + np.conj(plain(2.0 * np.pi / dt - w))
        turn = hold(w, dt) * np.exp(-1j * w * delay) * 1j * w
        radius = np.abs(fitted) * (body.radius(w) + self.miss) + body.unseen(w) / w**2
        centre, radius = fitted * turn, np.abs(turn) * radius
        inside = np.abs(centre) + radius <= open_
        return np.where(inside, centre, far), np.where(inside, radius, open_)


def endless() -> Refused:
    """Return what is said of an axis in continuous time without a dead time."""
    return Refused(ENDLESS.format(option("rate"), option("dead_time")), "")


def _inertia(w: np.ndarray, P: np.ndarray) -> tuple[float, float]:
    """J and B/J of 1/P = B + jwJ, at low frequencies."""
    low = w <= max(LOW * w[0], w[min(5, len(w) - 1)])
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
    """Torque to motor speed of a model, without dry friction and what is not linear."""
    kept = [p for p in model.effects if p.block.name in LINEAR and p.block.name != "input_delay"]
    effects = [{"name": p.block.name, **p.values} for p in kept]
    Fv = model.friction.values.get("Fv")
    made = Model.of(J=model.J, friction="viscous", Fv=Fv or 0.0, effects=effects)
    missing = [k for k, v in made.values().items() if v is None]
    if missing:
        raise InputError(f"{', '.join(missing)} must be known to tune: identify it first.")
    return linearize(plant(made), input="u", output="w")


def _of_system(system: Any, delay: float, dt: float | None) -> Axis:
    """A linear system from torque to speed."""
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

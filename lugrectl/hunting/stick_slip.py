"""``lugrectl.stick_slip_speed``: below which speeds a moving position loop sticks and slips.

Two questions: whether steady sliding is stable, from the loop linearized about it, bristles in
their steady deflection; and whether stick-slip persists, from simulations of e = theta - v t.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import control as ct
import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, root

from ..blocks import controllers
from ..blocks.model import Model, as_model
from ..blocks.plant import plant
from ..core.display import Row, noticed, number
from ..core.errors import Refused
from ..core.progress import Wanted, reporter, shows_progress
from ..core.result import Result, picked
from ..core.unit_names import unit_for
from ..core.views import view
from ..simulation.response import simulate
from .hunt import quietly
from .loop import Loop, critical, ranges, varied

NEAR = 1e-6  # relative step of a difference about steady sliding
SPEEDS = np.geomspace(1e4, 1e-8, 400)  # rad/s, at which sliding is looked at
ROUNDING = 1e-6  # of wn: elements that slip together have an eigenvalue of 0
BENDS = 100.0  # times its bend that a bristle is dragged
SMALLEST = 0.03  # units, of the errors at breakaway from which a simulation starts
STARTS = 8  # so many of them
PERIODS, STICK, WAITS = 20.0, 15.0, 3.0  # 2 pi/wn, Fs/(kp v) and kp/ki that a part of a run lasts
RUN_PARTS, POINTS = 8, 3000  # parts of a run, at most, and points of a part
STEADY = 0.99  # relative size of the error's swing in a part and the one before: it persists
STILL = 0.01, 0.1  # of v: a drive that is slower sticks, rigid or with bristles, which creep
FAST = 0.5  # of v: one that is always faster slides
SHARE = 0.9  # of the torque at breakaway: a stick in which a run begins
LOWEST, RATIO = 1e-5, 1.1  # the lowest speed in Fs/sqrt(kp J); from speed to speed of a search
CLOSE = 2e-3  # relative width of a bracket


class Moving:
    """The loop J dw/dt = u - F under r = v t: steady sliding at w = v, and the stick-slip in it; in
    e = theta - v t, so that nothing grows but theta."""

    def __init__(self, model: Model, gains: Mapping[str, float]) -> None:
        self.model, self.loop, self.law = model, Loop.of(model, gains), model.friction.block
        self.values = self.law.defaults() | dict(model.friction.values)
        self.count, self.bend, self.z = len(self.law.states), 0.0, np.zeros(0)
        if self.count:
            if self.law.reads != ("w",) or "sigma0" not in model.friction.values:
                raise Refused(f"{self.law.name} is no law of w with sigma0: stick-slip is unknown.")
            self.bend = self.loop.curve.Fs / float(self.values["sigma0"] or 0.0)

    def friction(self, w: float, z: np.ndarray) -> np.ndarray:
        """F and dz/dt."""
        if not self.count:
            return np.array([float(self.loop.curve.torque(np.array([w]))[0])])
        return np.array(self.law(w, *z, **self.values), float)

    def bent(self, v: float) -> np.ndarray:
        """z in steady sliding, found from that of the speed before."""
        if self.count and not len(self.z):
            span, z = (0.0, BENDS * self.bend / v), np.zeros(self.count)
            self.z = solve_ivp(lambda t, z: self.friction(v, z)[1:], span, z, "LSODA").y[:, -1]
        if self.count:
            done = root(lambda z: self.friction(v, z * self.bend)[1:], self.z / self.bend)
            self.z = done.x * self.bend
        return self.z

    def growth_at(self, v: float) -> float:
        """The largest real part of an eigenvalue of the loop linearized about w = v, 1/s; a
        rounding error counts as decay."""
        at = np.r_[v, self.bent(v)]
        steps = NEAR * np.r_[v, np.full(self.count, self.bend)]
        ends = [[self.friction(x[0], x[1:]) for x in (at + d, at - d)] for d in np.diag(steps)]
        slope = np.array([(a - b) / (2.0 * d) for (a, b), d in zip(ends, steps, strict=True)]).T
        A = np.zeros((3 + self.count, 3 + self.count))
        A[:3, :3], moved = self.loop.matrix, [1, *range(3, len(A))]
        A[1, moved] -= slope[0] / self.loop.J
        A[3:, moved] = slope[1:]
        if not self.loop.ki:
            A = np.delete(np.delete(A, 2, 0), 2, 1)
        return float(np.linalg.eigvals(A).real.max()) - ROUNDING * self.loop.wn

    @cached_property
    def growth(self) -> tuple[np.ndarray, np.ndarray]:
        """At falling speeds."""
        return SPEEDS, np.array([self.growth_at(v) for v in SPEEDS])

    def first_speed(self) -> float:
        v, growth = self.growth
        unstable = np.flatnonzero(growth > 0.0)
        if not len(unstable) or not unstable[0]:
            return float(v[0]) if len(unstable) else 0.0
        return float(brentq(self.growth_at, v[unstable[0]], v[unstable[0] - 1]))  # type: ignore

    @cached_property
    def blocks(self) -> list[Any]:
        frame = ct.nlsys(
            lambda t, x, u, p: [u[0] - u[1]], lambda t, x, u, p: x, inputs=["w", "v"],
            outputs=["e"], states=["e"], name="frame",
        )  # fmt: skip
        pid = controllers.pid(self.loop.kp, self.loop.ki, self.loop.kd)
        return [plant(self.model), frame, pid]

    def stuck(self, e: float) -> list[float]:
        """A stick at the error e, or without ki at the torque's, before it breaks away."""
        loop, u = self.loop, SHARE * self.loop.curve.Fs
        bends = np.zeros(self.count)
        bends[:1] = SHARE * self.bend
        own = [e, (u + loop.kp * e) / loop.ki] if loop.ki else [-u / loop.kp, 0.0]
        return [0.0, 0.0, *bends, *own]

    def run(self, v: float, state: Any) -> Any:
        """The state after a stick-slip that persists at v; None: it slides on."""
        loop, still = self.loop, STILL[self.count > 0] * v
        span = PERIODS * 2.0 * np.pi / loop.wn + STICK * loop.curve.Fs / (loop.kp * v)
        span = max(span, WAITS * loop.kp / loop.ki if loop.ki else 0.0)
        t, swing, slowest = np.linspace(0.0, span, POINTS), np.inf, 0.0
        for _ in range(RUN_PARTS):
            done = quietly(simulate, self.blocks, t, {"v": v}, state)
            rows = dict(zip(done.output_labels, done.outputs, strict=True))
            w, e = (rows[k][POINTS // 5 :] for k in "we")
            was, swing, slowest = swing, float(np.ptp(e)), float(w.min())
            if slowest > FAST * v:
                return None
            state = np.asarray(done.states)[:, -1]
            state[0] = 0.0  # theta, which nothing reads
            if slowest < still and STEADY * was < swing < was / STEADY:
                return state
        return state if slowest < still else None

    def persisting(self) -> Iterator[tuple[float, Any]]:
        """Speeds at which stick-slip persists and its state, from the highest on."""
        curve, loop = self.loop.curve, self.loop
        # by Popov's criterion steady sliding attracts all motions where F - Fs is viscous
        if curve.Fs <= 0.0 or (not self.count and curve.is_straight()):
            return
        (top, error), (v, growth) = loop.largest, self.growth
        low, top = LOWEST * loop.speed, top * loop.speed
        grid = np.geomspace(low, top, int(np.log(top / low) / np.log(RATIO)))
        grid = np.sort(np.r_[grid, np.clip(v[np.argmax(growth)], low, top)])
        x = np.geomspace(SMALLEST, max(error, 1.0), STARTS // 2)
        starts = [self.stuck(e * loop.unit) for e in (np.r_[x, -x] if loop.ki else np.ones(1))]
        for speed in map(float, grid[::-1]):
            found = (self.run(speed, start) for start in starts)
            state = next((s for s in found if s is not None), None)
            if state is not None:
                yield speed, state

    def last_speed(self) -> float:
        v, state = next(self.persisting(), (0.0, None))
        step = np.log(RATIO)
        while v and step > CLOSE:  # followed upwards, in smaller and smaller steps
            higher = float(v * np.exp(step))
            now = self.run(higher, state)
            v, state, step = (v, state, 0.5 * step) if now is None else (higher, now, step)
        return v


@dataclass(frozen=True, repr=False)
class StickSlip(Result):
    """Below which speeds a position loop that follows r = v t sticks and slips.

    Attributes
    ----------
    speed_start : float
        rad/s (m/s on a linear drive): below it steady sliding is unstable; 0: at no speed.
    speed_end : float
        Above it no stick-slip persists, whatever started it; 0: at no speed it persists. Both are
        infinite where fast motion does not decay.
    loop : dict
        Gains, J and law.
    critical : dict
        With ``vary``: by gain the values at which ``speed_end`` becomes 0.
    messages : tuple of str
        What the answer does not cover, and what happens between the two speeds.
    growth : tuple of two arrays
        Speeds, and how fast a small deviation from steady sliding grows there, 1/s.
    motion : "rotary" or "linear"
        Of the drive.

    Examples
    --------
    >>> drive = lg.Model.of(friction="stribeck", J=1.0, Fc=1.0, Fs=1.5, vs=0.1, Fv=0.4)
    >>> round(lg.stick_slip_speed(drive, kp=3.0, kd=0.1).speed_end, 2)
    0.37
    """

    speed_start: float
    speed_end: float
    loop: dict[str, Any]
    critical: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    messages: tuple[str, ...] = ()
    growth: tuple[np.ndarray, np.ndarray] | None = None
    motion: str = "rotary"

    def summary(self) -> dict[str, Any]:
        """Plain Python, as ``stick_slip`` of ``lugrectl hunt --speed --json``."""
        return picked(self, "speed_start speed_end critical loop messages")

    def plot(self, ax: Any = None) -> Any:
        """Draw the growth of a small deviation over the speed, with both speeds; the Axes."""
        return view("loop_plots.sliding")(self, ax)

    @property
    def unit(self) -> str:
        """Of the speeds."""
        return unit_for("rad/s", self.motion)

    def _title(self) -> str:
        if not np.isfinite(self.speed_end):
            return "the loop is unstable at each speed"
        if not self.speed_end:
            return "moving, the loop does not stick and slip"
        return f"moving, the loop sticks and slips up to {number(self.speed_end)} {self.unit}"

    def _rows(self) -> Iterable[Row]:
        yield Row("speed_start", self.speed_start, self.unit, "below it sliding is unstable")
        yield Row("speed_end", self.speed_end, self.unit, "above it no stick-slip persists")
        yield from noticed(self.messages, "messages")


@shows_progress
def stick_slip_speed(
    model: Any,
    *,
    kp: float | None = None,
    ki: float | None = None,
    kd: float | None = None,
    kv: float | None = None,
    vary: Mapping[str, tuple[float, float]] | None = None,
    progress: Wanted = None,
) -> StickSlip:
    """The speeds below which a position loop that follows a ramp sticks and slips.

    J dw/dt = u - F, u = -(kp e + ki int e + kd w), e = theta - r, r = v t.

    Parameters
    ----------
    model : Model, Parameters or path
        The drive, all values known.
    kp, ki, kd, kv : float, optional
        As for :func:`limit_cycles`. kd acts on w, not on w - v: the constant kd v is taken by the
        integral, without one by a constant error, so that both speeds are the same either way.
    vary : dict, optional
        ``{"kd": (0.1, 10)}``: also the values of a gain at which ``speed_end`` becomes 0.
    progress : callable, True, False or None
        ``progress(fraction, what)``, or whether to show a bar. None: in Jupyter only.

    Returns
    -------
    StickSlip
        ``.speed_start``, ``.speed_end``, ``.critical``, ``.messages``, ``.plot()``.

    Raises
    ------
    InputError
        For a value of the model that is not known, or a gain out of its range.
    Refused
        For a friction law that has states and is no law of w with bristles.

    Notes
    -----
    ``speed_start`` is the highest speed at which an eigenvalue of the loop about w = v has a
    positive real part, with bristles in their steady deflection. Without bristles that is Routh's
    (kd + dF/dw) kp > ki J.

    ``speed_end``: in a stick the error falls at v and u changes by kp v - ki e, so that breakaway
    at |u| = Fs has one free number, the error. The loop is simulated from 8 errors (without ki all
    breakaways are one) at speeds from the highest at which a drive can stop down to
    1e-5 Fs/sqrt(kp J); the first at which it goes on is followed upwards. What repeatedly falls
    below a hundredth of v sticks, with bristles a tenth; Coulomb and viscous friction alone never
    does (Popov). Steady sliding and stick-slip exist both between the two speeds where
    ``speed_end`` is the higher one; where it is the lower one, the loop swings about v without
    sticking. Absence is searched, not proven. What still sticks after some 160 periods counts as
    stick-slip: damping ratios below 1e-3 are not resolved. Effects are left out, and the loop is
    continuous.

    Dependence of the two speeds on damping: Armstrong-Helouvry, Stick Slip and Control in
    Low-Speed Motion, IEEE Trans. Automatic Control 38(10), 1993; Thomsen and Fidlin, Analytical
    Approximations for Stick-Slip Vibration Amplitudes, Int. J. Non-Linear Mechanics 38(3), 2003.

    Examples
    --------
    >>> drive = lg.Model.of(friction="stribeck", J=1.0, Fc=1.0, Fs=1.5, vs=0.1, Fv=0.4)
    >>> found = lg.stick_slip_speed(drive, kp=3.0, kd=0.1)
    >>> round(found.speed_start, 3), round(found.speed_end, 2)
    (0.191, 0.37)
    """
    known, gains = as_model(model), varied(kp, ki, kd, kv)
    ends = None if vary is None else ranges(vary, "vary")
    bare, report, asked = replace(known, effects=()), reporter(progress), [0]
    found = _found(bare, gains())
    said = (f"left out: {', '.join(p.key for p in known.effects)}",) * bool(known.effects)

    def sticks(**changed: float) -> bool:
        asked[0] += 1
        report(1.0 - 0.9 ** asked[0], "gains tried")
        moving = Moving(bare, gains(**changed))
        return not moving.loop.is_stable() or next(moving.persisting(), None) is not None

    more = critical(sticks, ends or {}, "stick-slip")
    said = (*more["messages"], *said, *found.messages)
    return replace(found, critical=more["critical"], messages=said)


def _found(model: Model, gains: Mapping[str, float]) -> StickSlip:
    moving = Moving(model, gains)
    loop, law = moving.loop, model.friction.block.name
    about = {**gains, "J": loop.J, "law": law, "model": model.name}
    if not loop.is_stable():
        said = "fast motion does not decay: (kd + Fv) kp > ki J does not hold"
        return StickSlip(np.inf, np.inf, about, messages=(said,), motion=model.motion)
    start, end = moving.first_speed(), moving.last_speed()
    said = tuple(_said(start, end))
    return StickSlip(start, end, about, {}, said, moving.growth, model.motion)


def _said(start: float, end: float) -> Iterator[str]:
    low, high = sorted([start, end])
    between = f"between {number(low)} and {number(high)}" if low else f"below {number(high)}"
    if end > start:
        yield f"{between} a disturbance decides whether it slides or sticks and slips"
    elif start > end:
        yield f"{between} it swings about v without sticking"
    yield "speed_end is searched, not proven"

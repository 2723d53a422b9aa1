"""``lugrectl.stick_slip_speed``: below which speeds a moving position loop sticks and slips."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import control as ct
import numpy as np

from ..blocks import controllers
from ..blocks.model import Model, as_model
from ..blocks.plant import plant
from ..core.display import Row, noticed, number
from ..core.progress import Wanted, reporter, shows_progress
from ..core.result import Result, picked
from ..core.unit_names import unit_for
from ..core.views import view
from ..simulation.response import simulate
from .bristles import SPEEDS, Bristles
from .loop import Lanes, Loop, critical, ranges, varied
from .search import quietly
from .stick_map import STICKS, next_stick

SMALLEST = 0.03  # units, of the errors at breakaway from which a search starts
ERRORS, STARTS = 16, 8  # so many of them for the map, and for a simulation
ALIKE = 1e-4  # relative change from breakaway to breakaway of what repeats
FOLLOWED = 4  # images of the errors at breakaway of a speed
SLOW, STRIDE = 0.2, 0.3  # shares of the way to where it repeats: of a slow breakaway, of a stride
SLOWEST = 3e-4  # the least such share that is known
SLIPS, BRIEF = 60, 12  # slips, after which what still sticks persists, or may do so
PERIODS, STICK, WAITS = 20.0, 15.0, 3.0  # 2 pi/wn, Fs/(kp v) and kp/ki that a part of a run lasts
RUN_PARTS, POINTS = 8, 3000  # parts of a run, at most, and points of a part
STEADY = 0.99  # relative size of the error's swing in a part and the one before: it persists
STILL, FAST = 0.1, 0.5  # of v: a drive that is slower sticks; one that is always faster slides
SHARE = 0.9  # of the torque at breakaway: a stick in which a run begins


def _errors(loop: Loop, error: float, count: int) -> np.ndarray:
    """Errors x at breakaway up to ``error``, units; without ki all breakaways are one, at 1."""
    x = np.geomspace(SMALLEST, max(error, 1.0), count // 2)
    return np.r_[-x, x] if loop.ki else np.ones(1)


@dataclass(frozen=True)
class RampMap:
    """Stick-slip of a rigid drive; its state is the error at breakaway, units."""

    loop: Loop

    def candidates(self, v: np.ndarray, error: float) -> Iterator[tuple[float, float]]:
        """Speeds at which stick-slip goes on for a while, and its state; highest first."""
        starts = np.tile(_errors(self.loop, error, ERRORS), (len(v), 1))
        found = persisting(self.loop, v, starts, BRIEF)
        for k in np.flatnonzero(np.isfinite(found))[::-1]:
            yield float(v[k]), float(found[k])

    def followed(self, v: np.ndarray, x: float) -> list[float | None]:
        """Where stick-slip from a state persists: the state then."""
        found = persisting(self.loop, v, np.full((len(v), 1), x), SLIPS)
        return [float(x) if np.isfinite(x) else None for x in found]


class RampRuns:
    """Stick-slip of a drive whose friction has states; its state is that of the loop of
    e = theta - v t, in which nothing grows but theta."""

    def __init__(self, model: Model, loop: Loop) -> None:
        frame = ct.nlsys(
            lambda t, x, u, p: [u[0] - u[1]], lambda t, x, u, p: x, inputs=["w", "v"],
            outputs=["e"], states=["e"], name="frame",
        )  # fmt: skip
        parts = [plant(model), frame, controllers.pid(loop.kp, loop.ki, loop.kd)]
        self.system = ct.interconnect(
            parts, inputs=["v"], outputs=["w", "e"], check_unused=False, name="loop"
        )
        self.model, self.loop = model, loop

    def run(self, v: float, state: Any) -> Any:
        """The state after a stick-slip that persists at v; None: it slides on."""
        loop = self.loop
        span = PERIODS * 2.0 * np.pi / loop.wn + STICK * loop.curve.Fs / (loop.kp * v)
        span = max(span, WAITS * loop.kp / loop.ki if loop.ki else 0.0)
        t, swing, slowest = np.linspace(0.0, span, POINTS), np.inf, 0.0
        for _ in range(RUN_PARTS):
            done = quietly(simulate, self.system, t, {"v": v}, state)
            w, e = np.asarray(done.outputs)[:, POINTS // 5 :]
            was, swing, slowest = swing, float(np.ptp(e)), float(w.min())
            if slowest > FAST * v:
                return None
            state = np.asarray(done.states)[:, -1]
            state[0] = 0.0  # theta, which nothing reads
            if slowest < STILL * v and STEADY * was < swing < was / STEADY:
                return state
        return state if slowest < STILL * v else None

    def candidates(self, v: np.ndarray, error: float) -> Iterator[tuple[float, Any]]:
        """Speeds at which stick-slip persists, and its state; highest first."""
        starts = [self._stuck(-x * self.loop.unit) for x in _errors(self.loop, error, STARTS)]
        for speed in map(float, v[::-1]):
            found = (self.run(speed, start) for start in starts)
            state = next((s for s in found if s is not None), None)
            if state is not None:
                yield speed, state

    def followed(self, v: np.ndarray, state: Any) -> list[Any]:
        """Where stick-slip from a state persists, from speed to speed: the state then."""
        made = []
        for speed in map(float, v):
            made.append(state := self.run(speed, state))
            if state is None:
                break
        return made

    def _stuck(self, e: float) -> list[float]:
        """A stick at the error e, or without ki at the torque's, before it breaks away."""
        loop, friction = self.loop, self.model.friction
        u = SHARE * loop.curve.Fs
        bends = [u / float(friction.values["sigma0"] or np.inf)]
        bends += [0.0] * (len(friction.block.states) - 1)
        own = [e, (u + loop.kp * e) / loop.ki] if loop.ki else [-u / loop.kp, 0.0]
        return [0.0, 0.0, *bends, *own]


def next_breakaway(lanes: Lanes, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the error x of the next breakaway under a reference, and whether there is one."""
    # a stick begins at an excess -2 <= y <= 0 and ends at 0, or backward at -2
    stop, v = next_stick(lanes, x), np.asarray(lanes.drift)
    rate, bend = v + lanes.rho * stop.x, lanes.rho * v
    with np.errstate(all="ignore"):
        back, ahead = rate**2 - 2.0 * bend * (stop.y + 2.0), np.sqrt(rate**2 - 2.0 * bend * stop.y)
        forward = np.where(rate > 0.0, -2.0 * stop.y / (rate + ahead), (ahead - rate) / bend)
        backward = 2.0 * (stop.y + 2.0) / (np.sqrt(np.maximum(back, 0.0)) - rate)
        new = stop.x + v * np.where((rate < 0.0) & (back >= 0.0), backward, forward)
    return new, stop.fate == STICKS


def persisting(loop: Loop, v: np.ndarray, x: np.ndarray, rounds: int) -> np.ndarray:
    """Return an error at breakaway that follows so many others, units, at each speed v in rad/s,
    from the first ones x (n, count); nan: none."""
    # where a slow integral lets the error change alike from breakaway to breakaway, many of them
    # are taken in one stride
    place, made = np.repeat(np.arange(len(v)), x.shape[1]), np.full(len(v), np.nan)
    lanes, x = loop.lanes(len(place), v[place]), x.ravel()
    was, stride = np.full(len(x), np.nan), np.ones(len(x))
    for k in range(rounds):
        new, sticks = next_breakaway(lanes, x)
        change = new - x
        nearing = np.clip(np.nan_to_num((1.0 - change / was) / stride, nan=1.0), -1.0, 1.0)
        close = ALIKE * (np.abs(x) + np.asarray(lanes.drift)) * np.clip(nearing, SLOWEST, 1.0)
        repeats = sticks & (np.abs(change) <= close)
        made[place[repeats]] = new[repeats]
        goes = sticks & np.isnan(made[place])
        for one in np.unique(place[goes]) if k == 0 else ():  # a few, from the least error on
            own = np.flatnonzero(goes & (place == one))
            goes[own], own = False, own[np.argsort(new[own])]
            goes[own[np.linspace(0, len(own) - 1, FOLLOWED).astype(int)]] = True
        slow = np.abs(nearing) < SLOW
        stride = np.where(slow, STRIDE / np.maximum(np.abs(nearing), SLOWEST), 1.0)[goes]
        was = change[goes]
        lanes, place, x = lanes[goes], place[goes], x[goes] + stride * was
        if not len(x):
            break
    made[place] = x
    return made


LOWEST, RATIO = 1e-5, 1.1  # the lowest speed in Fs/sqrt(kp J); from speed to speed of a search
CLOSE, PARTS = 2e-3, 8  # relative width of a bracket, and speeds in it at a time


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
    at |u| = Fs has one free number, the error. The map from breakaway to breakaway is iterated
    from 16 errors at speeds from 1e-5 Fs/sqrt(kp J) to the highest at which a drive can stop; the
    highest at which it goes on is followed upwards. Friction with states is simulated from 8
    errors instead; what repeatedly falls below a tenth of v sticks. Steady sliding and stick-slip
    exist both between the two speeds where ``speed_end`` is the higher one; where it is the lower
    one, the loop swings about v without sticking. Absence is searched, not proven. A slip of more
    than some 40 periods counts as sliding: damping ratios below 1e-3 are not resolved. Effects
    are left out, and the loop is continuous.

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
        search = _Search(bare, gains(**changed))
        return not search.loop.is_stable() or next(search.persisting(), None) is not None

    more = critical(sticks, ends or {}, "stick-slip")
    said = (*more["messages"], *said, *found.messages)
    return replace(found, critical=more["critical"], messages=said)


def _found(model: Model, gains: Mapping[str, float]) -> StickSlip:
    search = _Search(model, gains)
    loop, law = search.loop, model.friction.block.name
    about = {**gains, "J": loop.J, "law": law, "model": model.name}
    if not loop.is_stable():
        said = "fast motion does not decay: (kd + Fv) kp > ki J does not hold"
        return StickSlip(np.inf, np.inf, about, messages=(said,), motion=model.motion)
    start, end = search.bristles.first_speed(*search.growth), search.last_speed()
    said = tuple(_said(start, end, *search.growth))
    return StickSlip(start, end, about, {}, said, search.growth, model.motion)


def _said(start: float, end: float, v: np.ndarray, growth: np.ndarray) -> Iterator[str]:
    """What holds between the two speeds, and below the first."""
    low, high = sorted([start, end])
    between = f"between {number(low)} and {number(high)}" if low else f"below {number(high)}"
    if end > start:
        yield f"{between} a disturbance decides whether it slides or sticks and slips"
    elif start > end:
        yield f"{between} it swings about v without sticking"
    if start and growth[-1] <= 0.0:
        rest = v[np.flatnonzero(growth > 0.0)[-1] + 1]
        yield f"below about {number(rest, 2)} sliding is stable again, against small disturbances"
    yield "speed_end is searched, not proven"


class _Search:
    """A loop that is stable, and how stick-slip is found and followed in it."""

    def __init__(self, model: Model, gains: Mapping[str, float]) -> None:
        self.loop = Loop.of(model, gains)
        self.bristles = Bristles(model, self.loop)
        own = self.bristles.count
        self.ramps: Any = RampRuns(model, self.loop) if own else RampMap(self.loop)

    @cached_property
    def growth(self) -> tuple[np.ndarray, np.ndarray]:
        """At falling speeds."""
        return SPEEDS, np.array([self.bristles.growth(v) for v in SPEEDS])

    def persisting(self) -> Iterator[tuple[float, Any]]:
        """Speeds at which stick-slip persists and its state, from the highest on."""
        if self.loop.curve.Fs <= 0.0:
            return
        (top, error), unit, (v, growth) = self.loop.largest, self.loop.speed, self.growth
        low, top = LOWEST * unit, top * unit
        grid = np.geomspace(low, top, int(np.log(top / low) / np.log(RATIO)))
        grid = np.sort(np.r_[grid, np.clip(v[np.argmax(growth)], low, top)])
        for speed, x in self.ramps.candidates(grid, error):
            kept = self.ramps.followed(np.array([speed]), x)[0]
            if kept is not None:
                yield speed, kept

    def last_speed(self) -> float:
        """The highest speed at which stick-slip persists, rad/s; 0: at none."""
        v, x = next(self.persisting(), (0.0, None))
        step = np.log(RATIO) / PARTS
        while v and step > CLOSE / PARTS:
            tried = v * np.exp(step * np.arange(1, PARTS + 1))
            made = self.ramps.followed(tried, x)
            kept = [k for k, one in enumerate(made) if one is not None]
            if kept:
                v, x = float(tried[kept[-1]]), made[kept[-1]]
            step = step if kept and kept[-1] == PARTS - 1 else step / PARTS
        return v

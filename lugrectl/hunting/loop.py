"""A PID position loop around a rigid drive: its sliding curve, its units, and its gains, with the
values of them at which something begins or ends.

J dw/dt = u - F(w), de/dt = w, u = -(kp e + ki int e + kd w). Units: e in Fs/kp, torque in Fs, time
in 1/wn = sqrt(J/kp). What is left of the gains is delta = kd/sqrt(kp J) and rho = ki/(kp wn); the
linear loop is stable iff delta > rho (Routh). Many loops and starts at once are lanes.

From stick to stick the state is the error alone, as u changes by -ki e until |u| = Fs breaks away
towards zero. The half-turn map T(e) goes from breakaway at e > 0 to the first stick on the other
side, which it counts positive; it is continuous where stops appear and vanish.

A slip in the direction of -e, from w = 0 to w = 0, has the state (x, a, y): the error, the speed
a = -w >= 0, and the excess y = -u - Fs of the torque without damping over breakaway,

    dx/dt = -a,    da/dt = y - delta a + (Fs - F(a)),    dy/dt = rho x - a.

It begins at a = 0 and y >= 0 and ends at a = 0 with y <= 0; x is monotone, so that the largest
error stands at an end. Dormand and Prince, order 5; each lane has its own step.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import cache, cached_property
from typing import Any, NamedTuple

import numpy as np
from scipy.integrate import RK45

from ..blocks.friction import free_level, level
from ..blocks.model import Model, as_model
from ..core.display import Row
from ..core.errors import InputError
from ..core.result import Result, picked
from ..core.validation import not_negative, number, positive, shown, whole
from ..core.views import view

REST = 1e-12  # rad/s, where a curve is read for a speed of 0: its limit, not the sign of 0
SHARP = 1e-15  # rad/s, the width of a smooth sign: far below REST
PROBED = np.geomspace(1e-6, 1e3, 200)  # speeds in rad/s at which a curve is compared with a line
STRAIGHT = 1e-9  # of Fs, by which a straight curve may differ from its line
EARLY, LATE, TIMES = 1e-3, 15.0, 20_000  # of an L1 norm: in 1/wn, in the slowest decay, how many
SLOW = 1e-12  # of wn: a rate of 0, of an integral that is not used


@dataclass(frozen=True)
class Curve:
    """F(|w|) in N m between two sticks, its limit Fs at rest, and whether it is Fs + Fv |w|."""

    torque: Callable[[Any], Any]

    @cached_property
    def Fs(self) -> float:
        return float(self.torque(np.array([REST]))[0])

    def drop(self, speed: np.ndarray) -> np.ndarray:
        """(Fs - F)/Fs: what sliding takes off the friction."""
        return 1.0 - self.torque(np.maximum(speed, REST)) / self.Fs

    @property
    def viscous(self) -> float:
        """N m s/rad, the slope of F at high speed."""
        F = self.torque(PROBED[-2:])
        return float((F[1] - F[0]) / (PROBED[-1] - PROBED[-2]))

    @cached_property
    def most(self) -> float:
        """The largest |F - Fv w|, N m."""
        return max(self.Fs, float(np.abs(self.torque(PROBED) - self.viscous * PROBED).max()))

    def is_straight(self) -> bool:
        F = self.torque(PROBED)
        return bool(np.abs(F - self.Fs - self.viscous * PROBED).max() <= STRAIGHT * abs(F[-1]))

    def compensated(self, share: float, vd: float, scale: float) -> Curve:
        """Return ``scale`` times the curve with ``share`` of the curve added to the torque: in
        proportion to the speed below ``vd``, so that nothing is added at rest."""
        return Curve(lambda w: self.torque(w) * (scale - share * np.minimum(1.0, w / vd)))


def curve_of(model: Model) -> Curve:
    block, values = model.friction.block, dict(model.friction.values)
    unknown = [k for k, v in {"J": model.J, **values}.items() if v is None]
    if unknown:
        raise InputError(f"{model.name}: hunting needs {', '.join(unknown)}: give a value.")
    if block.states:
        if "Fc" not in values:
            raise InputError(
                f"the law {block.name} has states and no Fc: its sliding curve is not known."
            )
        Fc, delta, Fv = values["Fc"], values.get("delta"), values.get("Fv", 0.0)
        shape = Fc, values.get("Fs", Fc), values.get("vs", 1.0)
        if delta is None:
            return Curve(lambda w: level(w, *shape) + Fv * w)
        return Curve(lambda w: free_level(w, *shape, delta) + Fv * w)
    values |= {k: SHARP for k, p in block.parameters.items() if p.smooths}
    values = block.defaults() | values  # bound once: it is asked at each stage of each step
    return Curve(lambda w: block(w, **values)[0] + 0.0 * w)


@dataclass(frozen=True)
class Lanes:
    """delta, rho and the unit of speed in rad/s, each (n,); ``fall`` of a speed in rad/s. A stick
    at an error of at most ``calm`` (units) is known to come to rest; a swing beyond ``large`` grows
    without bound."""

    delta: np.ndarray
    rho: np.ndarray
    speed: np.ndarray
    fall: Callable[[np.ndarray], np.ndarray]
    calm: float = 0.0
    large: float = 300.0

    def __getitem__(self, which: np.ndarray) -> Lanes:
        own = (self.delta[which], self.rho[which], self.speed[which])
        return Lanes(*own, self.fall, self.calm, self.large)

    def many(self, count: int) -> Lanes:
        return self[np.zeros(count, int)]

    def drop(self, a: np.ndarray) -> np.ndarray:
        """1 - F/Fs at the speed a."""
        return self.fall(a * self.speed)


@dataclass(frozen=True)
class Loop:
    curve: Curve
    J: float
    kp: float
    ki: float
    kd: float

    @classmethod
    def of(cls, model: Model, gains: Mapping[str, float]) -> Loop:
        return cls(curve_of(model), float(model.J or 0.0), **gains)

    @property
    def wn(self) -> float:
        """1/s, the frequency that is the unit of time."""
        return float(np.sqrt(self.kp / self.J))

    @property
    def unit(self) -> float:
        """rad, the error at which kp alone breaks away."""
        return self.curve.Fs / self.kp

    @property
    def speed(self) -> float:
        """rad/s, the unit of speed."""
        return self.unit * self.wn

    def lanes(self, count: int) -> Lanes:
        return together([self], count)

    def is_stable(self) -> bool:
        """Whether fast motion decays (Routh): (kd + Fv) kp > ki J with the slope Fv of F there."""
        return (self.kd + self.curve.viscous) * self.kp > self.ki * self.J

    @cached_property
    def matrix(self) -> np.ndarray:
        """The loop without friction: the rates of e, w and the integral's torque by these."""
        gains = [-self.kp / self.J, -self.kd / self.J, 1.0 / self.J]
        return np.array([[0.0, 1.0, 0.0], gains, [-self.ki, 0.0, 0.0]])

    @cached_property
    def largest(self) -> tuple[float, float]:
        """The largest speed, and error, that friction can keep up about a steady motion, in units;
        inf where fast motion grows."""
        if not self.is_stable():
            return np.inf, np.inf
        # |F - Fv w| is bounded: that bound times the L1 norm from torque to each
        own, torque = self.matrix.copy(), np.array([0.0, 1.0 / self.J, 0.0])
        own[1, 1] -= self.curve.viscous / self.J
        rates, V = np.linalg.eig(own)
        slowest = np.abs(np.real(rates))[np.abs(rates) > SLOW * self.wn].min()
        t = np.r_[0.0, np.geomspace(EARLY / self.wn, LATE / slowest, TIMES)]
        made = (V[:2] * np.linalg.solve(V, torque + 0j)) @ np.exp(np.outer(rates, t))
        error, speed = np.trapezoid(np.abs(np.real(made)), t) * self.curve.most / self.unit
        return float(speed / self.wn), float(error)


def together(loops: list[Loop], count: int) -> Lanes:
    """Return ``count`` lanes of each loop, one loop after the other, all with one sliding curve."""
    rows = [(g.kd / np.sqrt(g.kp * g.J), g.ki / (g.kp * g.wn), g.speed) for g in loops]
    delta, rho, speed = np.repeat(np.array(rows), count, axis=0).T
    return Lanes(delta, rho, speed, loops[0].curve.drop)


GAINS = ("kp", "ki", "kd")
ALL = (*GAINS, "kv")
PAPER = {"kp": 15.0, "ki": 1.55, "kd": 0.0}  # the source paper's position loop
SCANNED = 9  # values of a gain between its ends
CLOSE = np.exp(1e-3)  # ratio of the two values between which a critical one lies

Hunts = Callable[..., bool | None]


def varied(*values: Any) -> Callable[..., dict[str, float]]:
    own = {k: v for k, v in zip(ALL, values, strict=True) if v is not None}
    return lambda **changed: pid_gains(**(own or PAPER) | changed)


def pid_gains(kp: Any = None, ki: Any = None, kd: Any = None, kv: Any = None) -> dict[str, float]:
    """Return kp, ki and kd of the PID, 0 for those left out."""
    given = zip(GAINS, (kp, ki, kd), strict=True)
    gains = {k: number(0.0 if v is None else v, k) for k, v in given}
    if kv is not None:
        if kd is not None:
            raise InputError("with kv the loop is a cascade, which has no kd: give one of them.")
        kp, ki, kd = cascade_as_pid(number(kv, "kv"), gains["kp"], gains["ki"])
        gains = {"kp": kp, "ki": ki, "kd": kd}
    for k, v in gains.items():
        if v < 0.0 or (k == "kp" and v == 0.0):
            raise InputError(f"{k} = {v:g}: a position loop needs kp above 0, ki and kd from 0 on.")
    return gains


def cascade_as_pid(kv: Any, kp: Any, ki: Any, dt: float = 0.0) -> tuple[Any, Any, Any]:
    """Return kp, ki and kd of the PID that u = -(kp + ki int)(kv e + w) is."""
    # with a step dt w is a difference and the integral that of trapezoids: int w = e - w dt/2
    return kp * kv + ki, ki * kv, kp - 0.5 * dt * ki


def ranges(given: Any, what: str, names: tuple[str, ...] = ALL) -> dict[str, tuple[float, float]]:
    """Return gains and their ends; InputError names the argument."""
    if isinstance(given, Mapping) and (unknown := [k for k in given if k not in names]):
        raise InputError(
            f"{what}: there is no gain {shown(unknown[0])}; known: {', '.join(names)}."
        )
    if not isinstance(given, Mapping) or not given:
        example = '{"ki": (1, 50)}'
        raise InputError(f"{what} must be gains and their ends, {example}, not {shown(given)}.")
    made = {}
    for name, ends in given.items():
        if not isinstance(ends, (tuple, list)) or len(ends) != 2:
            raise InputError(f"{what}: {name} needs its two ends, not {shown(ends)}.")
        low, high = (positive(v, f"{what}: {name}") for v in ends)
        if low >= high:
            raise InputError(f"{what}: {name} goes from {low:g} to {high:g}; give them increasing.")
        made[name] = (low, high)
    return made


def edge(
    holds: Callable[[float], bool],
    a: float,
    b: float,
    ratio: float = CLOSE,
    ends: Callable[[], bool] = lambda: False,
) -> tuple[float, float]:
    """Bisect to the last value from a towards b at which it holds, and the next at which it does
    not, until they are as near as ``ratio``."""
    while abs(np.log(b / a)) > np.log(ratio) and not ends():
        middle = float(np.sqrt(a * b))
        a, b = (middle, b) if holds(middle) else (a, middle)
    return a, b


def critical(hunts: Hunts, vary: Mapping[str, tuple[float, float]], what: str) -> dict[str, Any]:
    """Find by gain where ``hunts(ki=...)`` changes, and say where ``what`` begins and ends."""
    values, said = {}, []
    for name, ends in vary.items():
        changes, first = _changes(cache(lambda v, name=name: hunts(**{name: v})), *ends)
        values[name] = tuple(value for value, _ in changes)
        words = [
            f"{'begins' if begins else 'ends'} "
            + (f"at {v:.4g}" if np.isscalar(v) else "between {:.4g} and {:.4g}".format(*v))
            for v, begins in changes
        ]
        always = {True: "is there", False: "is absent", None: "is undecided"}[first]
        words = words or ["{} from {:g} to {:g}".format(always, *ends)]
        said.append(f"as {name} rises, {what} {', '.join(words)}")
    return {"critical": values, "messages": tuple(said)}


def _changes(
    at: Callable[[float], bool | None], low: float, high: float
) -> tuple[list[tuple[Any, bool]], bool | None]:
    """Scan in even ratios, then bisect to each change, and whether something begins there; and
    the first answer. Two ends where it is None, undecided, between them."""

    def change(a: float, b: float) -> Any:
        """Where the answer at a ends, and that at b begins if it is later."""
        a, middle = edge(lambda v: at(v) == at(a), a, b)
        if at(middle) == at(b):
            return float(np.sqrt(a * middle))
        return a, edge(lambda v: at(v) == at(b), b, middle)[0]

    sure = [v for v in map(float, np.geomspace(low, high, SCANNED)) if at(v) is not None]
    pairs = zip(sure, sure[1:], strict=False)
    changes = [(change(a, b), bool(at(b))) for a, b in pairs if at(a) != at(b)]
    return changes, at(sure[0]) if sure else None


RTOL, FLOOR = 1e-7, 1e-3  # error of a step, relative to a state or to this part of its unit
SMALL = 1e-6  # of the start or the unit: an error and speed below it have come to rest
SLIP_STEPS, LOOK = 3000, 50  # of one slip, that is not known then; looked for creeping so often
NEARLY = 0.02  # share of inertia in the torque of a creeping drive
SLOWER = np.array([1.0, 0.5, 0.25, 0.125])[:, None]  # speeds at which a creep must be damped
ENDED = 1e-9  # units: a speed at the end of a slip
FIRST = 1e-3  # the first step
NEWTON, STOPPED = 20, 1e-15  # steps to the end of a slip, and a speed of 0
A = np.vstack([np.pad(RK45.A[1:], ((0, 0), (0, 1))), RK45.B])  # stages, the last the new state
LOW, HIGH = 1e-3, 30.0  # units: errors at which T is looked at, and beyond while friction can
ROUNDS, NEAR = 300, 10.0  # of T, interpolated; |D| of a half turn that neither rests nor grows
COULOMB = (
    "Coulomb and viscous friction alone, with kd kp > ki J: the rest is globally asymptotically "
    "stable (Bisoffi, Da Lio, Teel and Zaccarian, IEEE Trans. Automatic Control 63(8), 2018)"
)
NO_INTEGRAL = (
    "without integral action the energy J w^2/2 + kp e^2/2 falls in every motion, since "
    "(kd w + F(w)) w > 0"
)


def proven(loop: Loop) -> str | None:
    """Return why the loop has no limit cycle, where that is known."""
    if loop.ki == 0.0:
        damped = np.all(loop.kd * PROBED + loop.curve.torque(PROBED) > 0.0)
        return NO_INTEGRAL if damped else None
    return COULOMB if loop.curve.is_straight() and loop.is_stable() else None


class End(NamedTuple):
    """Where slips end: error, excess and duration; ``rests`` where a slip creeps to zero. An error
    that is not known is nan, in a stick, and so is what follows from it."""

    x: np.ndarray
    y: np.ndarray
    t: np.ndarray
    rests: np.ndarray


def slip(lanes: Lanes, x: np.ndarray, y: np.ndarray) -> End:
    state, step, t = np.array([x, 0.0 * x, y]), np.full(len(x), FIRST), np.zeros(len(x))
    small, last = SMALL * np.minimum(1.0, np.abs(x)), step.copy()  # the step in which a lane stops
    rests, active = np.zeros(len(x), bool), np.arange(len(x))
    own, now, slope = lanes, state.copy(), _rates(lanes, state)
    for k in range(1, SLIP_STEPS + 1):
        new, slopes = _stepped(own, now, step, slope)
        missed = step * (RK45.E @ slopes.reshape(7, -1)).reshape(now.shape)
        size = np.maximum(np.abs(now), np.abs(new)) + FLOOR
        worst = np.max(np.abs(missed) / (RTOL * size), axis=0)  # by what is allowed
        good = worst <= 1.0
        stops = good & (new[1] <= 0.0)
        crept = good & (np.abs(new[0]) < small[active]) & (new[1] < small[active])
        crept |= (k % LOOK == 0) & good & ~stops & _creeps(own, new, slopes[-1])
        goes = good & ~stops & ~crept
        t[active[goes]] += step[goes]
        last[active[stops]], state[:, active[stops]] = step[stops], now[:, stops]
        rests[active[crept]] = True
        now, slope = np.where(goes, new, now), np.where(goes, slopes[-1], slope)
        step = step * np.clip(0.9 * np.maximum(worst, 1e-10) ** -0.2, 0.2, 5.0)
        left = ~(stops | crept)
        if not left.all():
            active, own = active[left], own[left]
            now, slope, step = now[:, left], slope[:, left], step[left]
        if not len(active):
            break
    ends, more = _stopped(lanes, state, last)
    lost = (np.abs(ends[1]) > ENDED) & ~rests
    lost[active] = True
    ends[:, lost] = np.array([[np.nan], [0.0], [0.0]])
    return End(ends[0], np.minimum(ends[2], 0.0), t + more, rests)


def _creeps(lanes: Lanes, state: np.ndarray, slope: np.ndarray) -> np.ndarray:
    """Whether the torque follows friction that grows with the speed: x decays, without a stop."""
    x, a, _ = state
    damped = lanes.delta * SLOWER * a - lanes.drop(SLOWER * a)
    rise = damped[:-1] - damped[1:]  # overdamped at each lower speed, near the slower rate
    holds = np.all((rise > 0.0) & (4.0 * lanes.rho * rise < SLOWER[1:] * a), axis=0)
    follows = (np.abs(slope[1]) < NEARLY * damped[0]) & (np.abs(slope[2]) < 0.5 * a)
    return (x > 0.0) & follows & holds & (damped[-1] > 0.0)


def _rates(lanes: Lanes, state: np.ndarray) -> np.ndarray:
    x, a, y = state
    return np.array([-a, y - lanes.delta * a + lanes.drop(a), lanes.rho * x - a])


def _stepped(
    lanes: Lanes, state: np.ndarray, h: np.ndarray, slope: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The state after a step, and the slopes of all stages; the last is that of the new state."""
    slopes, new = np.empty((7, *state.shape)), state
    rows, slopes[0] = slopes.reshape(7, -1), slope
    for k, row in enumerate(A, 1):
        new = state + h * (row[:k] @ rows[:k]).reshape(state.shape)
        slopes[k] = _rates(lanes, new)
    return new, slopes


def _stopped(lanes: Lanes, state: np.ndarray, h: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The end a = 0 within the last step, by Newton's method."""
    slope, tried, new = _rates(lanes, state), h, state
    for _ in range(NEWTON):
        new, slopes = _stepped(lanes, state, tried, slope)
        if np.all(np.abs(new[1]) <= STOPPED):
            break
        tried = np.clip(tried - new[1] / np.minimum(slopes[-1][1], -STOPPED), 0.0, h)
    return new, tried


STICKS, RESTS, GROWS, SWINGS = 0, 1, 2, 3  # fate: next stick, rest, too large, never a stick
REVERSALS = 300  # without a stick, after which a loop swings
RISES = 4  # reversals at a larger and larger error and torque, after which it goes on so
ALIKE = 1e-4  # relative change from reversal to reversal of a swing that repeats
STOPS = 60  # on one side, after which a loop creeps: it comes to rest
NEVER = 50.0  # the excess of what rests (negative) or never sticks


@dataclass
class Turn:
    """What happened up to the next stick of each lane: its error ``x`` (units), signed for a stop
    and positive for a half turn; ``t`` with the wait for breakaway; ``size``, the largest error."""

    x: np.ndarray
    t: np.ndarray
    size: np.ndarray
    stops: np.ndarray
    fate: np.ndarray

    @classmethod
    def begun(cls, x: np.ndarray) -> Turn:
        stops, fate = np.zeros((2, len(x)), int)
        return cls(x.copy(), np.zeros(len(x)), x.copy(), stops, fate)


def next_stick(lanes: Lanes, x: np.ndarray) -> Turn:
    """Follow each lane from breakaway at x > 0 to the next stick, through reversals without one."""
    made, active, at, side = Turn.begun(x), np.arange(len(x)), x.copy(), 1.0
    excess, rises = np.zeros(len(x)), np.zeros(len(x), int)
    for _ in range(REVERSALS):
        own = lanes[active]
        end = slip(own, at, excess)
        made.x[active] = side * end.x
        made.size[active] = np.maximum(made.size[active], np.abs(end.x))
        ahead, over = -end.x, -2.0 - end.y
        fate = np.where(end.rests, RESTS, np.where(over <= 0.0, STICKS, SWINGS))
        wait = np.where(end.x > 0.0, -end.y, -over) / (own.rho * np.abs(end.x) + 1e-300)
        made.t[active] += end.t + np.where(fate == STICKS, wait, 0.0)
        fate[np.abs(end.x) > lanes.large] = GROWS
        repeats = (np.abs(ahead - at) < ALIKE * at) & (np.abs(over - excess) < ALIKE * at)
        rises = np.where((ahead > at) & (over > excess), rises + 1, 0)
        made.fate[active] = fate
        goes = (fate == SWINGS) & ~(repeats | (rises >= RISES))
        active, side, at = active[goes], -side, ahead[goes]
        excess, rises = over[goes], rises[goes]
        if not len(active):
            break
    return made


def half_turn(lanes: Lanes, x: np.ndarray) -> Turn:
    """Return T(x): from breakaway at x > 0 to the first stick on the other side."""
    made, active, at = Turn.begun(x), np.arange(len(x)), x.copy()
    for _ in range(STOPS):
        one = next_stick(lanes[active], at)
        made.t[active] += one.t
        made.size[active] = np.maximum(made.size[active], one.size)
        made.stops[active] += one.fate == STICKS
        made.fate[active], made.x[active] = one.fate, np.abs(one.x)
        stays = (one.fate == STICKS) & (one.x > 0.0)
        made.fate[active[stays & (one.x <= lanes.calm)]] = RESTS
        goes = stays & (one.x > lanes.calm)
        active, at = active[goes], one.x[goes]
        if not len(active):
            break
    made.fate[active] = RESTS
    return made


def excess(lanes: Lanes, x: np.ndarray) -> np.ndarray:
    """Return log(T(x)/x), -NEVER for what comes to rest, NEVER for what never sticks or grows."""
    made = half_turn(lanes, x)
    with np.errstate(divide="ignore"):
        return _bounded(np.log(made.x / x), made.fate)


def _bounded(D: np.ndarray, fate: np.ndarray) -> np.ndarray:
    return np.where(fate == STICKS, D, np.where(fate == RESTS, -NEVER, NEVER))


def excess_on(lanes: Lanes, x: np.ndarray, loops: int = 1) -> np.ndarray:
    """:func:`excess` of so many loops, in rows, on an increasing grid, with one slip from each: a
    stop on the same side, at S(x) < x, goes on as from there, T(x) = T(S(x)), interpolated."""
    made = next_stick(lanes, np.tile(x, loops))
    rows = zip(made.x.reshape(loops, -1), made.fate.reshape(loops, -1), strict=True)
    return np.array([_followed(np.log(x), stop, fate) for stop, fate in rows])


def _followed(place: np.ndarray, stop: np.ndarray, fate: np.ndarray) -> np.ndarray:
    """D on a grid of log errors from the next stick of each."""
    stays = (fate == STICKS) & (stop > 0.0)
    with np.errstate(divide="ignore"):
        logT = np.log(np.abs(stop))
    fate[0] = RESTS if stays[0] else fate[0]
    for i in 1 + np.flatnonzero(stays[1:]):
        at = np.interp(logT[i], place[:i], np.arange(i))
        low, part = int(at), at % 1.0
        high = min(low + 1, i - 1)
        fate[i] = fate[low if part < 0.5 else high]
        logT[i] = logT[low] + part * (logT[high] - logT[low])
    return _bounded(logT - place, fate)


def kept(x: np.ndarray, D: np.ndarray) -> np.ndarray:
    """Return the errors that iterating T keeps, as it is interpolated on the grid of D."""
    place, at = np.log(x), np.log(x)
    for _ in range(ROUNDS):
        growth = np.interp(at, place, D)
        at = (at + growth)[(np.abs(growth) < NEAR) & (at + growth > np.log(LOW))]
    return np.exp(at)


ERRORS = np.geomspace(LOW, HIGH, 72)  # units, at which T is compared with e
NEAR_ZERO = 0.02  # |D|: a maximum between two errors may reach 0
QUIET, STARTED, HUNTING, UNDECIDED = 0, 1, 2, 3
REGIONS = ("quiet", "quiet, but can be started", "hunting", "undecided")


@dataclass(frozen=True, repr=False)
class HuntingMap(Result):
    """Where a loop hunts, over two gains or a gain and the friction.

    Attributes
    ----------
    names : tuple of str
        The two gains; "friction": how many times what the compensation believes it is.
    values : tuple of two arrays
        Their values.
    region : (N, M) array of int
        0 quiet, 1 quiet but can be started by a large error, 2 hunting from the smallest error on
        or unstable, 3 undecided; a row for each value of the first gain.
    proven : (N, M) array of bool
        Where quiet is proven; elsewhere it is searched.
    gains : dict
        The user's gains; friction is 1 where the compensation believes it rightly.
    messages : tuple of str
        What the map does not cover.

    Examples
    --------
    >>> drive = lg.Model.of(friction="coulomb", J=1.0, Fc=1.0, Fv=0.4)
    >>> lg.hunting_map(drive, {"ki": (0.3, 3.0), "kd": (2.0, 20.0)}, kp=3.0, points=3)
    HuntingMap over ki and kd
      quiet                       100 %
      quiet, but can be started   0 %
      hunting                     0 %
      undecided                   0 %
    """

    names: tuple[str, str]
    values: tuple[np.ndarray, np.ndarray]
    region: np.ndarray
    proven: np.ndarray
    gains: dict[str, float]
    messages: tuple[str, ...] = ()

    def summary(self) -> dict[str, Any]:
        """Plain Python."""
        return picked(self, "names values region proven tolerated gains messages")

    @property
    def tolerated(self) -> tuple[float, float] | None:
        """The friction about 1, times what is believed, at which the user's gain is quiet."""
        own = self.gains.get(self.names[0])
        if self.names[1] != "friction" or own is None:
            return None
        values = self.values[1]
        quiet = self.region[np.argmin(np.abs(np.log(self.values[0] / own)))] == QUIET
        ends = np.flatnonzero(~quiet)
        low = ends[values[ends] <= 1.0].max(initial=-1) + 1
        high = ends[values[ends] > 1.0].min(initial=len(values)) - 1
        return (float(values[low]), float(values[high])) if low <= high else None

    def plot(self, ax: Any = None) -> Any:
        """Draw the regions with the user's gains; returns the Axes."""
        return view("loop_plots.regions")(self, ax)

    def _title(self) -> str:
        return f"HuntingMap over {' and '.join(self.names)}"

    def _rows(self) -> Iterable[Row]:
        for k, name in enumerate(REGIONS):
            yield Row(name, f"{100.0 * np.mean(self.region == k):.0f} %")
        if self.tolerated:
            said = "times what is believed, at which your gain is quiet"
            yield Row("friction", "{:.3g} to {:.3g}".format(*self.tolerated), "", said)
        yield from (Row("message", one) for one in self.messages)


def hunting_map(
    model: Any,
    ranges_of: Mapping[str, tuple[float, float]],
    *,
    kp: float | None = None,
    ki: float | None = None,
    kd: float | None = None,
    kv: float | None = None,
    friction: tuple[float, float] | None = None,
    compensation: float = 1.0,
    vd: float | None = None,
    points: int = 24,
) -> HuntingMap:
    """Over two gains: where a position loop is quiet, can be started, or hunts.

    Parameters
    ----------
    model : Model, Parameters or path
        The drive; it slides by its sliding curve, effects are left out.
    ranges_of : dict
        Two gains and their ends, ``{"ki": (1, 50), "kd": (0.1, 1)}``; with ``friction`` one.
    kp, ki, kd, kv : float, optional
        As for :func:`limit_cycles`: the user's gains, which are marked.
    friction : tuple of two floats, optional
        ``(0.5, 2)``: in place of a second gain how many times the friction is what the
        compensation believes, which is the model's.
    compensation : float
        With ``friction``: the share of the believed sliding curve that is added to the torque.
    vd : float, optional
        In rad/s: below it what is added is in proportion to the speed. Default: vs of the law.
    points : int
        Values of each gain, in even ratios.

    Returns
    -------
    HuntingMap
        ``.region``, ``.proven``, ``.tolerated``, ``.plot()``.

    Raises
    ------
    InputError
        As :func:`limit_cycles`, and where there are not two axes.

    Notes
    -----
    At each point D(e) = log(T(e)/e) of :func:`limit_cycles` on 72 errors from 1/1000 to 30 times
    Fs/kp: quiet where D < 0 at all, hunting where D > 0 at the smallest, else the loop comes to
    rest from small errors and keeps on hunting once a large one started it. Undecided where D, or a
    parabola through three points of it, comes as near to 0 as 0.02, where D is not known, and where
    D > 0 somewhere, but T, iterated, keeps no error: :func:`limit_cycles` answers there. Quiet is
    proven for Coulomb and viscous friction without compensation, and searched elsewhere.

    Examples
    --------
    >>> drive = lg.Model.of(friction="stribeck", J=1.0, Fc=1.0, Fs=1.5, vs=0.1, Fv=0.4)
    >>> found = lg.hunting_map(drive, {"ki": (0.3, 10), "kd": (2, 20)}, kp=3, ki=4, kd=6, points=6)
    >>> found.region.shape
    (6, 6)

    How far the friction may be from what half of it is compensated by:

    >>> found = lg.hunting_map(drive, {"ki": (0.01, 1)}, kp=3, ki=0.02, kd=6, points=8,
    ...                        friction=(0.5, 2), compensation=0.5)
    >>> found.names
    ('ki', 'friction')
    """
    known, count = as_model(model), whole(points, "points", 2)
    ends = ranges(ranges_of, "hunting_map")
    if len(ends) != (2 if friction is None else 1):
        raise InputError(
            f"hunting_map needs two gains, or one and friction=(0.5, 2), not {len(ends)} gains."
        )
    curve, J = curve_of(known), float(known.J or 0.0)
    if curve.Fs <= 0.0:
        raise InputError(f"{known.name}: the law {known.friction.block.name} has no stiction.")
    own = {"kp": kp, "ki": ki, "kd": kd, "kv": kv}
    marked = {k: v for k, v in own.items() if v is not None}
    curves = {}
    if friction is not None:
        share, below = _believed(known, compensation, vd)
        ends |= ranges({"friction": friction}, "hunting_map", ("friction",))
        curves = {
            s: curve.compensated(share, below, s)
            for s in map(float, np.geomspace(*ends["friction"], count))
        }
        marked["friction"] = 1.0
    (one, first), (two, second) = ((k, np.geomspace(*v, count)) for k, v in ends.items())

    def loop(a: float, b: float) -> Loop:
        given = own | {one: a} | ({} if curves else {two: b})
        return Loop(curves.get(b, curve), J, **pid_gains(**given))

    grid = [[loop(float(a), float(b)) for a in first] for b in second]
    rows = grid if curves else [[g for row in grid for g in row]]
    region = np.array([_regions(row) for row in rows]).reshape(count, count).T
    certain = np.array([[g.is_stable() and bool(proven(g)) for g in row] for row in grid]).T
    said = ["the drive slides by its sliding curve, without bristles"] * bool(
        known.friction.block.states
    )
    said += [f"left out: {', '.join(p.key for p in known.effects)}"] * bool(known.effects)
    said += ["quiet is searched, not proven"] * bool(np.any((region == QUIET) & ~certain))
    return HuntingMap((one, two), (first, second), region, certain, marked, tuple(said))


def _believed(model: Model, share: Any, vd: Any) -> tuple[float, float]:
    """The share of friction that is compensated, and the speed from which on it is in full."""
    below = dict(model.friction.values).get("vs") if vd is None else vd
    if below is None:
        raise InputError(f"hunting_map: {model.friction.block.name} has no vs: give vd in rad/s.")
    return not_negative(share, "compensation"), positive(below, "vd", "rad/s")


def _regions(loops: list[Loop]) -> list[int]:
    """The region of each loop; their slips are computed together."""
    open_ = [g for g in loops if g.is_stable() and not proven(g)]
    D = excess_on(together(open_, len(ERRORS)), ERRORS, len(open_)) if open_ else np.zeros((0, 1))
    rows = iter(D)
    return [
        HUNTING if not g.is_stable() else QUIET if proven(g) else _region(next(rows)) for g in loops
    ]


def _region(D: np.ndarray) -> int:
    if not np.any(D > 0.0):
        return QUIET if _highest(D) <= -NEAR_ZERO else UNDECIDED
    if np.isnan(D).any() or (not np.any(D >= NEVER) and not len(kept(ERRORS, D))):
        return UNDECIDED
    return HUNTING if D[0] > 0.0 else STARTED


def _highest(D: np.ndarray) -> float:
    """The maximum of D, or of a parabola through three points of it; nan where one is."""
    a, b, c = D[:-2], D[1:-1], D[2:]
    top = (b >= a) & (b >= c) & (a + c < 2.0 * b) & (np.minimum(a, c) > -NEVER)
    a, b, c = a[top], b[top], c[top]
    return float(np.max(np.r_[D, b + 0.125 * (c - a) ** 2 / (2.0 * b - a - c)]))

"""Stability of a closed loop, and how far it is from -1: gain, phase, modulus and delay margin.

Nothing is read off a grid. |L| = 1, Im L = 0 and the peak of |1/(1 + L)| are conditions on
(quasi-)polynomials on the imaginary axis, whose changes of sign ``axis.signs`` isolates, or on the
eigenvalues of a state-space system; a sampled loop is mapped there (:mod:`border`). Between two
frequencies of a measured response log |L| and the phase are straight lines over log w (over w from
w = 0); its margins and Nyquist's criterion are exact for these.
"""

from __future__ import annotations

import cmath
import math
import warnings
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.optimize import minimize_scalar

from ..core.display import show_poles
from ..core.errors import InputError
from ..core.validation import whole
from ..core.views import view
from .axis import WINDOWS, Signs, largest, level_signs, limits, settled, signs, zeros
from .border import Axis, is_sampled
from .delayed import DelayedTransfer
from .exact import Quasi
from .state_system import StateSystem
from .systems import ExactSystem, has_many_states
from .transfer import along, cleared, crossings, is_measured, require_siso, response, span
from .verdict import NONE, UNKNOWN, Margin, Verdict

FAR = 1e100  # rad/s: no crossing is looked for beyond it, where powers of w overflow
SAME = 1e-9  # of |L|: a crossing that is lower by less is not looked for at higher frequencies
Intervals = tuple[tuple[float, float], ...]
LEAST = 1e-300
NEAR = 8  # steps between two frequencies, about which |1 + L| is then minimised
AMONG = 3  # of the lowest of these
LIKE_1 = 0.02  # of a measured L: closer to 1 is 1
AXIS = "This is the response of an axis, and no loop: give its product with the controller, C * fr."
CLOSED = "; L is 1 at w = 0, as a closed loop with integral action is: the open loop is asked for"
BEYOND = (
    "; from {:.6g} rad/s on nothing is measured: there the gain margin is at least {:.4g} if |L| "
    "stays below its last value"
)


class AxisAsLoopWarning(UserWarning):
    """The response of an axis alone is taken for an open loop."""


@dataclass(frozen=True, repr=False)
class StabilityVerdict(Verdict):
    """Truthy iff the closed loop L/(1 + L) is stable.

    A margin is inf if there is none, and nan of a loop that is not stable; the frequency beside
    it, in rad/s, is where L is then moved to -1: inf as w grows, nan where there is none.
    ``gain_margin``: the factor on L, nearest to 1 in dB, that makes the loop unstable; a loop that
    also needs a least gain may have one below 1. Of a measured response it is that inside its band,
    or the least that it has beyond it, as the reason says. ``gain_range``: between which factors it
    is stable. ``phase_margin`` in deg: the smallest phase lag that makes it unstable, between 0 and
    360. ``modulus_margin``: the least |1 + L(jw)|, the distance to -1; ``Ms`` = 1/modulus_margin is
    the peak of the sensitivity. ``delay_margin`` in s: the largest dead time that the loop stands
    on top of its own, the least of phase margin over frequency of all ``crossovers`` (rad/s, |L| =
    1). ``encirclements`` of -1 by L(jw), counterclockwise, and the numbers of poles right of the
    imaginary axis (outside the unit circle) of L (``open_poles``) and of the closed loop
    (``closed_poles``): encirclements = open_poles - closed_poles (Nyquist). ``disk_margins`` for
    the skews 1, -1 and 0 of ``control.disk_margins``: 1 over the largest |S|, |T| and |S - T|/2.
    ``stable_gains``: every interval of a factor on L with which the loop is stable, also where it
    is not so as it stands; with dead times up to the largest factor that is known, of a measured
    response up to that at which the last |L| is 1.
    """

    stable: bool
    delay_margin: float
    phase_margin: float
    crossovers: tuple[float, ...]
    encirclements: float
    open_poles: float
    closed_poles: float
    reason: str
    gain_margin: float
    gain_range: tuple[float, float]
    modulus_margin: float
    Ms: float
    gain_margin_frequency: float
    phase_margin_frequency: float
    modulus_margin_frequency: float
    delay_margin_frequency: float
    disk_margins: tuple[float, float, float]
    stable_gains: Intervals
    _units = {
        "delay_margin": "s",
        "phase_margin": "deg",
        "crossovers": "rad/s",
        **{f"{kind}_margin_frequency": "rad/s" for kind in ("gain", "phase", "modulus", "delay")},
    }

    def __bool__(self) -> bool:
        return self.stable

    def plot(self, ax: Any = None) -> Any:
        """Draw |L(jw)| and its phase with the margins, and the Nyquist curve; returns the Axes.

        ``ax``: an Axes for the first, or up to three; else a new figure.
        """
        return view("loop_plots.loop")(self, ax)


def stability_check(L: Any, open_poles: int = 0) -> StabilityVerdict:
    """Whether the loop closed over L is stable, and its gain, phase, modulus and delay margin.

    With L = n/d, sums of p(s) exp(-s h), the poles of L/(1 + L) are the zeros of n + d. Those
    right of the imaginary axis are counted by the argument of (n + d)(jw), which is the Nyquist
    criterion: it is followed without a grid, and to infinity by the leading terms. A factor of
    -1/L(jw) puts a pole on the axis where L is real and negative; a further dead time of
    (phase margin)/w where |L(jw)| = 1. The least |1 + L(jw)| is 1/max |d/(n + d)|.

    Parameters
    ----------
    L : control.TransferFunction, StateSpace, frd, pair (num, den) or DelayedTransfer
        The open loop, continuous, sampled or measured, with one input and one output; feedback is
        negative. With a dead time: :func:`delayed`, or ``dead_time=`` of :func:`velocity_L` and
        :func:`position_L`; in L(z) it is z^-k. Of a loop made of blocks:
        ``lg.linearize(...).open_loop``.
    open_poles : int
        Of a measured response: the number of poles of L right of the imaginary axis, which it
        does not show.

    Returns
    -------
    StabilityVerdict
        Truthy if the closed loop is stable; ``gain_margin`` and ``modulus_margin`` without unit,
        ``phase_margin`` in deg, ``delay_margin`` in s, their frequencies and ``crossovers`` in
        rad/s, and the ``reason``.

    Raises
    ------
    InputError
        If L is none of these, and for ``open_poles`` of a loop that is not measured.

    Notes
    -----
    The crossovers do not depend on a dead time in series: of L = G(s) exp(-s h) they are isolated
    exactly, and the delay margin falls by as much as h grows. A loop with |L| >= 1 as w grows
    stands no further dead time at all: infinitely many poles are then right of the axis.
    Of a transfer function with the rounding of a conversion from state space (a pole at 4e-16 in
    place of 0, a numerator of full degree with a leading 4e-16) this is taken out, and said.

    A factor that cancels from L and is not stable makes the loop not stable, and the reason says
    so.

    Of L(z), L(exp(jw dt)) up to half the sampling rate is meant, w in rad/s (per sample where L.dt
    is True). The delay margin is that of whole samples: L(z) z^-k is stable for all k below
    delay_margin/dt. A dead time of a part of a sample changes L(z) itself.

    A loop of more than 6 states, given in state space, is decided by eigenvalues in floating point,
    and the reason says so: a pole within rounding of the border counts as not stable; of |L| = 1
    and Im L = 0 only changes of sign are found, no touching.

    A measured response is joined by straight lines of log |L| and of the phase over log w; the
    margins are exact for these. Steps of the phase above 180 deg between two frequencies are
    taken for smaller ones. Below the lowest frequency L is continued as a constant or as the
    integrators that its slope shows, above the highest, where |L| must be below 1, it is taken to
    stay so.

    References
    ----------
    K. J. Astrom and R. M. Murray, Feedback Systems, 2nd ed., 2021, section 10.3 (margins).

    Examples
    --------
    An integrator of gain K with dead time T is stable for K T < pi/2, with the delay margin
    pi/(2 K) - T and the gain margin pi/(2 K T):

    >>> check = lg.stability_check(lg.delayed(ct.tf([100.0], [1.0, 0.0]), 0.01))
    >>> bool(check), round(check.delay_margin, 6), round(check.phase_margin, 2)
    (True, 0.005708, 32.7)
    >>> round(check.gain_margin, 4), round(check.gain_margin_frequency, 2), round(check.Ms, 3)
    (1.5708, 157.08, 3.129)

    The velocity loop of the source paper stands 2.2 ms:

    >>> loop = lg.velocity_L(lg.table1(), kp=1.6, ki=0.16)
    >>> round(1e3 * lg.stability_check(loop).delay_margin, 2)
    2.16
    """
    open_poles = whole(open_poles, "open_poles")
    if is_measured(L):
        if getattr(L, "is_axis", False):
            warnings.warn(AXIS, AxisAsLoopWarning, stacklevel=2)
        return _verdict(MeasuredLoop(*response(L, "L"), open_poles)).of(L)
    if open_poles:
        raise InputError(
            "open_poles is for a measured response; of any other L the poles are counted."
        )
    if has_many_states(L):
        require_siso(L, "L")
        return _verdict(StateLoop(StateSystem.of(L))).of(L)
    if is_sampled(L):
        return _verdict(ExactLoop(ExactSystem.of(L, "L"))).of(L)
    given, said = cleared(L)
    of = DelayedTransfer.of(given, "L")
    return _verdict(ExactLoop(ExactSystem(of), said)).of(of)


def _verdict(loop: ExactLoop | StateLoop | MeasuredLoop) -> StabilityVerdict:
    crossovers, turns = loop.crossovers(), loop.real_crossings()
    gains = _stable_gains(loop, turns)
    phase = delay = below = above = UNKNOWN
    disks = [UNKNOWN] * 3
    if loop.cause:
        shown = " or ".join(f"{low:.4g} to {high:.4g}" for low, high in gains)
        reason = f"the closed loop is not stable: {loop.cause}; "
        reason += f"with L times {shown} it is" if gains else "no factor on L makes it stable"
    else:
        phase, delay = _lags(loop, crossovers)
        factors = [Margin(-1.0 / x, w) for w, x in turns]
        below = max((m for m in factors if m.value < 1), default=Margin(0.0))
        above = min((m for m in factors if m.value >= 1), default=NONE)
        disks = [loop.disk(skew) for skew in (1, -1, 0)]  # of S, of T and of S - T
        reason = _reason(delay, *loop.counts[:2]) + loop.basis
        reason += CLOSED * (abs(loop.static - 1) < loop.alike)
        if loop.end.value < above.value:
            reason += BEYOND.format(loop.end.at, loop.end.value)
            above = above if math.isfinite(above.value) else loop.end
    gain, modulus = above, disks[0]
    if below.value and above.value > 1.0 / below.value:  # in dB
        gain = below
    return StabilityVerdict(
        not loop.cause,
        delay.value,
        phase.value,
        tuple(w for w, _ in crossovers),
        *loop.counts,
        reason + loop.remark,
        gain_margin=gain.value,
        gain_range=(below.value, above.value),
        modulus_margin=modulus.value,
        Ms=1.0 / modulus.value if modulus.value else math.inf,
        gain_margin_frequency=gain.at,
        phase_margin_frequency=phase.at,
        modulus_margin_frequency=modulus.at,
        delay_margin_frequency=delay.at,
        disk_margins=(disks[0].value, disks[1].value, disks[2].value),
        stable_gains=gains,
    )


def _stable_gains(loop: Any, turns: list[tuple[float, float]]) -> Intervals:
    """The intervals of a factor on L, above 0, with which the closed loop is stable."""
    # poles reach the axis only at factors that move L to -1: one point of each interval decides
    factors = sorted({-1.0 / x for _, x in turns})
    most = loop.known(factors)
    borders = [0.0, *(x for x in factors if x < most), most]
    return tuple(
        (low, high)
        for low, high in pairwise(borders)
        if loop.unstable_poles(_between(low, high)) == 0
    )


def _lags(loop: Any, crossovers: list[tuple[float, complex]]) -> tuple[Margin, Margin]:
    """Phase margin in deg and delay margin in s, the least of all crossovers."""
    # the lag above 0 and up to 2 pi that turns L(jw) to the negative real axis
    angles = [(cmath.phase(-L) % (2 * math.pi) or 2 * math.pi, w) for w, L in crossovers]
    phase = min((Margin(math.degrees(angle), w) for angle, w in angles), default=NONE)
    delays = [Margin(angle / w, w) for angle, w in angles]
    if loop.open_at_infinity:  # there one sample turns L(z), and any dead time L(s)
        delays.append(Margin(loop.border.dt or 0.0, loop.border.frequency(math.inf)))
    return phase, min(delays, default=NONE)


def _reason(delay: Margin, turns: float, open_poles: float) -> str:
    start = "the closed loop is stable"
    if open_poles:
        poles = f"{open_poles:.0f} pole{'s' * (open_poles != 1)}"
        start += f": L encircles -1 {turns:.0f} times, once for each of its {poles} that are not"
        start += " stable"
    if math.isinf(delay.value):
        return f"{start}; |L(jw)| is 1 nowhere, so it is so with any further dead time"
    if math.isinf(delay.at):
        return (
            f"{start}, but |L| is not below 1 as w grows: any further dead time makes it unstable"
        )
    return (
        f"{start}; a further dead time of {delay.value:.6g} s puts a pair of poles on the border "
        f"of stability at the crossover {delay.at:.6g} rad/s"
    )


class Loop:
    """A closed loop L/(1 + L), by its open loop; a subclass for each kind of L.

    ``counts``: turns about -1, and poles of L and of the closed loop that are not stable.
    ``cause``: why the closed loop is not stable, "" where it is.
    ``static``: L at w = 0, nan where that is no number.
    ``crossovers()``: w and L where |L| = 1; ``real_crossings()``: where L is real and negative.
    ``disk()``: 1/max |S + (skew - 1)/2| of a stable loop, S = 1/(1 + L); skew 1: least |1 + L|.
    ``known(factors)``: the factor on L up to which these are all that move it to -1.
    ``unstable_poles(gain)``: how many the loop with L times ``gain`` has.
    """

    alike = 1e-9  # of L at w = 0: closer to 1 is 1
    basis = remark = ""  # what a verdict that it is stable, or any verdict, rests on
    end = NONE  # the factor on L up to which it is known beyond a band
    open_at_infinity = False  # whether |L| is not below 1 as w grows


@dataclass(frozen=True)
class ExactLoop(Loop):
    """L(s), also with dead times, or L(z); ``remark``: what was taken out of it."""

    system: ExactSystem
    remark: str = ""

    def __post_init__(self) -> None:
        if not self.system.given.num + self.system.given.den:
            raise InputError("L(s) is -1, so that the closed loop L/(1 + L) has no solution.")

    @property
    def border(self) -> Axis:
        return self.system.border

    @cached_property
    def L(self) -> DelayedTransfer:
        """L in the variable of the axis."""
        return self.system.axis

    @cached_property
    def counts(self) -> tuple[float, float, float]:
        mine, theirs = zeros(self.L.den).right, zeros(self.L.num + self.L.den).right
        turns = mine - theirs if math.isfinite(mine) and math.isfinite(theirs) else math.nan
        return turns, mine, theirs

    @cached_property
    def cause(self) -> str:
        given = self.system.given
        seen = self.system.why_unstable(given.num + given.den)
        return f"it has {seen}" if seen else self.system.hidden

    @property
    def open_at_infinity(self) -> bool:
        if self.L.num.degree != self.L.den.degree:
            return self.L.num.degree > self.L.den.degree
        last = self.L.den.leading
        own = abs(last.pop(0, Fraction(0))) - sum(map(abs, last.values()))
        top = sum(map(abs, self.L.num.leading.values()))
        return own <= 0 or top >= own

    def crossovers(self) -> list[tuple[float, complex]]:
        """Where |L| = 1, crossing or touching: w in rad/s and L there."""
        places = _places(level_signs(self.L, Fraction(1)))
        return [(self.border.frequency(v), self.L(1j * v)) for v in places]

    def real_crossings(self) -> list[tuple[float, float]]:
        """Where L is real and negative: w in rad/s and L there; with a dead time, which makes it so
        at ever higher frequencies, those with the largest |L| below 1 and every |L| above 1."""
        found = [(v, self.L(1j * v).real) for v in self._real_places]
        found += [(0.0, self.static), *((math.inf, x) for x in limits(self.L))]
        return [(self.border.frequency(v), x) for v, x in found if -math.inf < x < 0]

    @cached_property
    def _real_places(self) -> list[float]:
        """The v > 0 with Im L(jv) = 0."""
        product = self.L.num * self.L.den.mirror()
        odd = product + product.mirror().scaled(-1)
        turned = Quasi.of([(0, (0, 1))]) * odd  # s (N(s) D(-s) - N(-s) D(s)), even
        if not turned or turned.rational or settled(turned) is not None:
            return _places(signs(turned))
        end = max([1.0 / max(self.L.dead_times), *self._level(1.0)])
        places: list[float] = []
        for _ in range(WINDOWS):
            if end > FAR:
                break
            places = _places(signs(turned, end))
            below = [-x for v in places if -1 < (x := self.L(1j * v).real) < 0]
            beyond = self._level(max(below) * (1 - SAME)) if below else [math.inf]
            if beyond and max(beyond) <= end:
                break
            end = max([2.0 * end, *(1.01 * v for v in beyond if math.isfinite(v))])
        return places

    def _level(self, size: float) -> list[float]:
        """Where |L(jv)| = size."""
        try:
            found = level_signs(self.L, Fraction(size) ** 2)
        except (InputError, OverflowError):  # |L| has this size again and again, or too far out
            return [math.inf]
        return [*found.changes] if found.complete else [math.inf]

    def disk(self, skew: int = 1) -> Margin:
        closed = self.L.num + self.L.den
        if closed.degree < self.L.den.degree:
            return Margin(0.0, math.inf)
        off = self.L.den + closed.scaled(Fraction(skew - 1, 2))
        if not off:  # L = 1 at all frequencies: the middle of the disk
            return NONE
        places = [] if closed.rational and off.rational else self._real_places
        near = [v for v in places if abs(self.L(1j * v)) < 1]
        most, v = largest(DelayedTransfer(off, closed), *near)
        return Margin(1.0 / most if most else math.inf, self.border.frequency(v))

    def unstable_poles(self, gain: float) -> float:
        found = zeros(self.L.num.scaled(Fraction(gain)) + self.L.den)
        return found.right + found.origin

    @property
    def static(self) -> float:
        below = self.L.den.taylor(0)
        return float(self.L.num.taylor(0) / below) if below else math.nan

    def known(self, factors: list[float]) -> float:
        """With dead times there is no end of them."""
        return math.inf if self.system.rational else max(factors, default=math.inf)


@dataclass(frozen=True)
class StateLoop(Loop):
    """L = C (sI - A)^-1 B + D of many states, or L(z), in floating point."""

    L: StateSystem
    basis = " (in floating point)"

    def __post_init__(self) -> None:
        if self._direct == -1:
            raise InputError(
                "L(s) is -1 as s grows, so that the closed loop L/(1 + L) is improper."
            )

    @property
    def _direct(self) -> float:
        return float(self.L.D[0, 0])

    @property
    def border(self) -> Axis:
        return self.L.border

    @cached_property
    def counts(self) -> tuple[float, float, float]:
        both = self.L, self.L.sensitivity
        mine, theirs = (int((one.beyond > one.rounding).sum()) for one in both)
        return mine - theirs, mine, theirs

    @property
    def cause(self) -> str:
        closed = self.L.sensitivity
        right = closed.beyond >= -closed.rounding
        if not right.any():
            return ""
        upper = [p for p in map(complex, closed.poles[right]) if p.imag >= 0]
        where = self.border.outside
        where += "" if self.counts[2] else " or, within rounding, on its border"
        return f"it has poles {where} ({show_poles(upper)}), found in floating point"

    @property
    def open_at_infinity(self) -> bool:
        return abs(self._direct) >= 1

    @property
    def static(self) -> float:
        value, slack = self.L.at(0.0)
        return value.real if slack < abs(value) else math.nan

    def crossovers(self) -> list[tuple[float, complex]]:
        return self._changes(lambda L: abs(L) - 1.0, self.L.level_zeros(1.0))

    def real_crossings(self) -> list[tuple[float, float]]:
        places = self.L.mirrored_zeros(-1.0)
        found = [(w, L.real) for w, L in self._changes(lambda L: L.imag, places)]
        for v in (0.0, math.inf):
            value, slack = self.L.at(v)
            if abs(value) > slack:
                found.append((self.border.frequency(v), value.real))
        return [(w, x) for w, x in found if x < 0]

    def _changes(self, part: Any, zeros: np.ndarray) -> list[tuple[float, complex]]:
        """Where a part of L changes its sign, and L there."""

        def function(v: float) -> tuple[float, float]:
            value, slack = self.L.at(v)
            return part(value), slack

        edges = self.L.signs(function, self.L.places(zeros)).edges
        return [(e.at, self.L.at(self.border.place(e.at))[0]) for e in edges]

    def disk(self, skew: int = 1) -> Margin:
        most, w = self.L.sensitivity.plus(0.5 * (skew - 1)).largest()
        return Margin(1.0 / most if most else math.inf, w)

    def known(self, factors: list[float]) -> float:
        """A beginning or an end of L that is 0 within rounding may be reached beyond it."""
        ends = [slack for value, slack in map(self.L.at, (0.0, math.inf)) if abs(value) <= slack]
        return min((1.0 / float(slack) for slack in ends if slack), default=math.inf)

    def unstable_poles(self, gain: float) -> float:
        M = replace(self.L, C=gain * self.L.C, D=gain * self.L.D)
        return StateLoop(M).counts[2] if M.D[0, 0] != -1 else math.nan


@dataclass(frozen=True)
class MeasuredLoop(Loop):
    """L(jw) at frequencies w in rad/s; ``open_poles``: its poles right of the axis, as declared."""

    w: np.ndarray
    L: np.ndarray
    open_poles: int
    border, alike = Axis(), LIKE_1

    @property
    def basis(self) -> str:
        held = f"{self.open_poles or 'no'} pole{'s' * (self.open_poles != 1)}"
        return (
            f", of {span(self.w)}, if L has {held} right of the axis and no crossover beyond them"
        )

    @cached_property
    def _lines(self) -> tuple[np.ndarray, np.ndarray]:
        """log |L| and the phase in rad."""
        return np.log(np.maximum(np.abs(self.L), LEAST)), np.unwrap(np.angle(self.L))

    def _at(self, k: int, x: float) -> tuple[float, complex]:
        """w and L a part x of the way from point k to the next."""
        size, turned = (float(line[k] + x * (line[k + 1] - line[k])) for line in self._lines)
        return along(self.w, k, x), cmath.rect(math.exp(size), turned)

    @property
    def static(self) -> float:
        """L at the lowest frequency; nan where it is not real."""
        first = complex(self.L[0])
        return first.real if abs(first.imag) < LIKE_1 * abs(first) else math.nan

    @property
    def end(self) -> Margin:
        """The factor on L up to which the last |L| stays below 1."""
        size = float(abs(self.L[-1]))
        return Margin(1.0 / size if size else math.inf, float(self.w[-1]))

    def crossovers(self) -> list[tuple[float, complex]]:
        return [self._at(k, x) for k, x in crossings(self._lines[0])]

    def real_crossings(self) -> list[tuple[float, float]]:
        """Where L is real and negative, and L there; below the band as it is continued."""
        found = [(w, L.real) for w, L, _ in self._half_turns()]
        late, rise = self._before()
        return found if rise or late.real >= 1 else [(0.0, late.real - 1), *found]

    def _half_turns(self) -> list[tuple[float, complex, int]]:
        """Where the phase goes through an odd multiple of 180 deg, and whether it rises (1)."""
        turned = self._lines[1]
        low, high = (math.floor((x / math.pi - 1) / 2) for x in (turned.min(), turned.max()))
        return [
            (*self._at(k, x), 1 if turned[k + 1] > turned[k] else -1)
            for m in range(low, high + 2)
            for k, x in crossings(turned, (2 * m + 1) * math.pi)
        ]

    def disk(self, skew: int = 1) -> Margin:

        def away(L: Any) -> Any:
            return np.abs((1 + L) / np.maximum(np.abs(1 + 0.5 * (skew - 1) * (1 + L)), LEAST))

        size, turned = self._lines
        x = np.linspace(0.0, 1.0, NEAR + 1)
        a, b = (line[:-1, None] + x * np.diff(line)[:, None] for line in (size, turned))
        every, found = away(np.exp(a + 1j * b)), [Margin(float(away(0.0)), math.inf)]
        for flat in np.argsort(every, axis=None)[: AMONG * NEAR]:
            k, i = divmod(int(flat), NEAR + 1)
            ends = (max(x[i] - 1 / NEAR, 0.0), min(x[i] + 1 / NEAR, 1.0))
            best: Any = minimize_scalar(
                lambda part, k=k: float(away(self._at(k, part)[1])),
                bounds=ends,
                method="bounded",
                options={"xatol": 1e-12},
            )
            for part in (float(best.x), *ends):
                w, value = self._at(k, part)
                found.append(Margin(float(away(value)), w))
        return min(found)

    def known(self, factors: list[float]) -> float:
        """Beyond the band |L| may be as large as at its end."""
        return self.end.value

    def unstable_poles(self, gain: float) -> float:
        """Nan where it is open."""
        return MeasuredLoop(self.w, gain * self.L, self.open_poles).closed_poles

    @property
    def counts(self) -> tuple[float, float, float]:
        return self.open_poles - self.closed_poles, self.open_poles, self.closed_poles

    @cached_property
    def closed_poles(self) -> float:
        """Of L/(1 + L), right of the imaginary axis, by Nyquist; nan where |L| ends above 1."""
        if abs(self.L[-1]) >= 1:
            return math.nan
        late, rise = self._before()
        # From w = 0 the short way to the first point; at the last, 1 + L goes the short way to 1.
        first = complex(1 + self.L[0])
        turned = cmath.phase(first / late) - cmath.phase(first)
        turned += 2 * math.pi * sum(way for _, L, way in self._half_turns() if L.real < -1)
        return round(self.open_poles + rise / 2 - turned / math.pi)

    def _before(self) -> tuple[complex, int]:
        """The direction of 1 + L as w goes to 0, and the number of integrators of L."""
        slope = 0.0
        if self.w[0] > 0:
            size = self._lines[0]
            slope = float((size[0] - size[1]) / math.log(self.w[1] / self.w[0]))
        rise = max(round(slope), 0)
        along = (-1j) ** rise
        sign = 1 if (self.L[0] / along).real >= 0 else -1
        return (along * sign if rise else complex(1 + sign * abs(self.L[0]))), rise

    @property
    def cause(self) -> str:
        if not self.closed_poles:
            return ""
        if math.isnan(self.closed_poles):
            return (
                f"this is not decided, |L| is {abs(self.L[-1]):.4g} at the highest frequency and "
                "must be below 1; measure up to higher ones"
            )
        many = f"{self.closed_poles:.0f} pole{'s' * (self.closed_poles != 1)}"
        return f"it has {many} right of the imaginary axis{self.basis}"


def _places(found: Signs) -> list[float]:
    return sorted({*found.changes, *found.touches})


def _between(low: float, high: float) -> float:
    if math.isinf(high):
        return 2.0 * low or 1.0
    return math.sqrt(low * high) or 0.5 * high

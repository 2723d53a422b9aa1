"""Stability of a closed loop, and how far it is from instability."""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

import control as ct

from ..core.errors import InputError
from ..core.validation import whole
from ..core.views import view
from .axis import zeros
from .delayed import DelayedTransfer
from .delayed_checks import poles, unstable
from .exact import add
from .floating_loop import FloatingLoop
from .margins import NONE, UNKNOWN, Loop, Margin, gain_margins, lag, nearest, stable_gains
from .measured import is_measured
from .measured_loop import LIKE_1, MeasuredLoop
from .quasi import Quasi
from .rounded import cleared
from .sampled import Sampled, inside, is_sampled
from .verdict import Verdict

AXIS = "This is the response of an axis, and no loop: give its product with the controller, C * fr."
CLOSED = "; L is 1 at w = 0, as a closed loop with integral action is: the open loop is asked for"
SAME = 1e-9  # of L at w = 0: closer to 1 is 1
Intervals = tuple[tuple[float, float], ...]
EXACT = 6  # states up to which a loop in state space is decided in exact arithmetic
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
        "gain_margin_frequency": "rad/s",
        "phase_margin_frequency": "rad/s",
        "modulus_margin_frequency": "rad/s",
        "delay_margin_frequency": "rad/s",
    }

    def __bool__(self) -> bool:
        return self.stable

    def plot(self, ax: Any = None) -> Any:
        """Draw |L(jw)| and its phase with the margins, and the Nyquist curve; returns the Axes.

        ``ax``: an Axes for the first, or up to three; else a new figure.
        """
        return view("check_plots.loop")(self, ax)


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
        return _measured(MeasuredLoop.of(L, open_poles)).of(L)
    if open_poles:
        raise InputError(
            "open_poles is for a measured response; of any other L the poles are counted."
        )
    if isinstance(L, ct.StateSpace) and L.nstates > EXACT:
        return _floating(FloatingLoop.of(L)).of(L)
    if is_sampled(L):
        return _sampled(Sampled.of(L, "L")).of(L)
    given, said = cleared(L)
    made = DelayedTransfer.of(given, "L")
    closed = made.num + made.den
    _has_solution(closed)
    cause = f"it has {seen}" if (seen := unstable(closed)) else made.hidden
    found = _verdict(Loop(made), closed, cause)
    return replace(found, reason=found.reason + said).of(made)


def _has_solution(closed: Any) -> None:
    if not closed:
        raise InputError("L(s) is -1, so that the closed loop L/(1 + L) has no solution.")


def _sampled(T: Sampled) -> StabilityVerdict:
    """The verdict on L(z), as that on a function of v."""
    closed = add(T.num, T.den)
    _has_solution(closed)
    num, den = (Quasi.of([(0, p)]) for p in T.in_v)
    cause = "" if inside(closed) else _not_inside(T, num + den)
    return _verdict(Loop(DelayedTransfer(num, den), T.dt), num + den, cause or T.hidden)


def _not_inside(T: Sampled, closed: Quasi) -> str:
    right, origin, v = zeros(closed)
    if right:
        return f"it has {poles(int(right))} outside the unit circle"
    w = 0.0 if origin else T.nyquist if v is None else T.frequency(v)
    return f"it has a pole on the unit circle, at w = {w:.6g} rad/s"


def _verdict(loop: Loop, closed: Quasi, cause: str) -> StabilityVerdict:
    mine, theirs = zeros(loop.L.den).right, zeros(closed).right
    turns = mine - theirs if math.isfinite(mine) and math.isfinite(theirs) else math.nan
    return _decided(loop, (turns, mine, theirs), cause, _gain_at_infinity(loop.L))


def _floating(loop: FloatingLoop) -> StabilityVerdict:
    """The verdict on a loop of many states."""
    made = _decided(loop, loop.counts, loop.cause, loop.high)
    return made if loop.cause else replace(made, reason=f"{made.reason} (in floating point)")


def _decided(
    loop: Loop | FloatingLoop, counts: tuple[float, float, float], cause: str, high: Any
) -> StabilityVerdict:
    """``high`` is a bound on |L| as w grows."""
    found, turns = loop.crossovers(), loop.real_crossings()
    at, gains = tuple(w for w, _ in found), stable_gains(loop, turns)
    if cause:
        return _unstable(at, counts, cause, gains)
    phase, delay = _lags(found)
    if high >= 1:  # there one sample turns L(z), and any dead time L(s)
        dt, end = loop.dt or 0.0, loop.frequency(math.inf)
        delay = min(delay, Margin(dt, end)) if dt else Margin(0.0, end)
    reason = _reason(delay, counts[0], counts[1]) + CLOSED * (abs(loop.static - 1) < SAME)
    return _made(phase, delay, gain_margins(turns), _disks(loop), at, counts, reason, gains)


def _measured(loop: MeasuredLoop) -> StabilityVerdict:
    """The verdict on a measured response."""
    found = loop.crossovers()
    at = tuple(w for w, _ in found)
    counts = (loop.open_poles - loop.closed_poles, loop.open_poles, loop.closed_poles)
    turns = loop.real_crossings()
    gains = stable_gains(loop, turns)
    if loop.closed_poles:
        return _unstable(at, counts, loop.cause, gains)
    phase, delay = _lags(found)
    reason = f"{_reason(delay, counts[0], loop.open_poles)}, of {loop.said}"
    reason += CLOSED * (abs(loop.static - 1) < LIKE_1)
    below, above = gain_margins(turns)
    if (end := loop.end).value < above.value:
        reason += BEYOND.format(end.at, end.value)
        above = above if math.isfinite(above.value) else end
    return _made(phase, delay, (below, above), _disks(loop), at, counts, reason, gains)


def _disks(loop: Loop | FloatingLoop | MeasuredLoop) -> tuple[Margin, Margin, Margin]:
    """Those of S, of T and of S - T, as ``control.disk_margins`` has them."""
    return loop.disk(1), loop.disk(-1), loop.disk(0)


def _lags(found: list[tuple[float, complex]]) -> tuple[Margin, Margin]:
    """Phase margin in deg and delay margin in s, the least of all crossovers."""
    angles = [(lag(value), w) for w, value in found]
    phase = min((Margin(math.degrees(angle), w) for angle, w in angles), default=NONE)
    return phase, min((Margin(angle / w, w) for angle, w in angles), default=NONE)


def _unstable(
    crossovers: tuple[float, ...], counts: tuple[float, float, float], cause: str, gains: Intervals
) -> StabilityVerdict:
    reason = f"the closed loop is not stable: {cause}"
    if gains:
        shown = " or ".join(f"{low:.4g} to {high:.4g}" for low, high in gains)
        reason += f"; with L times {shown} it is"
    else:
        reason += "; no factor on L makes it stable"
    none = (UNKNOWN, UNKNOWN, (UNKNOWN, UNKNOWN), (UNKNOWN, UNKNOWN, UNKNOWN))
    return _made(*none, crossovers, counts, reason, gains, False)


def _made(
    phase: Margin,
    delay: Margin,
    gains: tuple[Margin, Margin],
    disks: tuple[Margin, Margin, Margin],
    crossovers: tuple[float, ...],
    counts: tuple[float, float, float],
    reason: str,
    stable_gains: Intervals,
    stable: bool = True,
) -> StabilityVerdict:
    gain, modulus = nearest(*gains), disks[0]
    return StabilityVerdict(
        stable,
        delay.value,
        phase.value,
        crossovers,
        *counts,
        reason,
        gain_margin=gain.value,
        gain_range=(gains[0].value, gains[1].value),
        modulus_margin=modulus.value,
        Ms=1.0 / modulus.value if modulus.value else math.inf,
        gain_margin_frequency=gain.at,
        phase_margin_frequency=phase.at,
        modulus_margin_frequency=modulus.at,
        delay_margin_frequency=delay.at,
        disk_margins=(disks[0].value, disks[1].value, disks[2].value),
        stable_gains=stable_gains,
    )


def _gain_at_infinity(L: DelayedTransfer) -> Fraction:
    """A bound on |L(jw)| as w grows; 0 for a strictly proper L."""
    if L.num.degree < L.den.degree:
        return Fraction(0)
    last = L.den.leading
    own = abs(last.pop(0, Fraction(0))) - sum(map(abs, last.values()))
    top = sum(map(abs, L.num.leading.values()))
    return top / own if own > 0 and L.num.degree == L.den.degree else Fraction(1)


def _reason(delay: Margin, turns: float, open_poles: float) -> str:
    start = "the closed loop is stable"
    if open_poles:
        start += (
            f": L encircles -1 {turns:.0f} times, once for each of its {poles(int(open_poles))}"
        )
        start += " that are not stable"
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

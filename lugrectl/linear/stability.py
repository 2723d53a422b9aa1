"""Stability of a closed loop, and how far it is from -1: gain, phase, modulus and delay margin.

Nothing is read off a grid: |L| = 1 and Im L = 0 are signs along the axis, and the peak of
|1/(1 + L)| is the gain of a system (:mod:`system`).
"""

from __future__ import annotations

import cmath
import math
import warnings
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

from ..core.errors import InputError
from ..core.validation import whole
from ..core.views import view
from .border import is_sampled
from .delayed import DelayedTransfer
from .state_system import StateSystem
from .systems import ExactSystem, MeasuredSystem, has_many_states
from .transfer import cleared, is_measured, require_siso, response
from .verdict import NONE, UNKNOWN, Margin, Verdict

Intervals = tuple[tuple[float, float], ...]
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
        return _verdict(MeasuredSystem(*response(L, "L"), open_poles)).of(L)
    if open_poles:
        raise InputError(
            "open_poles is for a measured response; of any other L the poles are counted."
        )
    if has_many_states(L):
        require_siso(L, "L")
        return _verdict(StateSystem.of(L)).of(L)
    if is_sampled(L):
        return _verdict(ExactSystem.of(L, "L")).of(L)
    given, said = cleared(L)
    of = DelayedTransfer.of(given, "L")
    return _verdict(ExactSystem(of), said).of(of)


def _verdict(L: Any, remark: str = "") -> StabilityVerdict:
    closed, turns, mine = L.closed(), _real_crossings(L), L.right
    crossovers = [(w, L.at(L.border.place(w))[0]) for w in L.signs("size", 1).places]
    cause = f"it has {closed.trouble}" if closed.trouble else L.hidden
    gains = _stable_gains(L, turns)
    phase = delay = below = above = UNKNOWN
    disks = [UNKNOWN] * 3
    if cause:
        shown = " or ".join(f"{low:.4g} to {high:.4g}" for low, high in gains)
        reason = f"the closed loop is not stable: {cause}; "
        reason += f"with L times {shown} it is" if gains else "no factor on L makes it stable"
    else:
        phase, delay = _lags(L, crossovers)
        factors = [Margin(-1.0 / x, w) for w, x in turns]
        below = max((m for m in factors if m.value < 1), default=Margin(0.0))
        above = min((m for m in factors if m.value >= 1), default=NONE)
        disks = [_disk(closed, skew) for skew in (1, -1, 0)]  # of S, of T and of S - T
        reason = _reason(delay, mine - closed.right, mine) + closed.basis
        reason += CLOSED * any(w == 0 and abs(x - 1) < L.alike for w, x in L.ends())
        if (end := L.beyond_band).value < above.value:
            reason += BEYOND.format(end.at, end.value)
            above = above if math.isfinite(above.value) else end
    in_dB = below.value and above.value > 1.0 / below.value
    margins = {"gain": below if in_dB else above, "phase": phase, "modulus": disks[0]}
    made: dict[str, Any] = {}
    for kind, margin in {**margins, "delay": delay}.items():
        made |= {f"{kind}_margin": margin.value, f"{kind}_margin_frequency": margin.at}
    known = math.isfinite(mine) and math.isfinite(closed.right)
    return StabilityVerdict(
        stable=not cause,
        crossovers=tuple(w for w, _ in crossovers),
        encirclements=mine - closed.right if known else math.nan,
        open_poles=mine,
        closed_poles=closed.right,
        reason=reason + remark,
        gain_range=(below.value, above.value),
        Ms=1.0 / disks[0].value if disks[0].value else math.inf,
        disk_margins=(disks[0].value, disks[1].value, disks[2].value),
        stable_gains=gains,
        **made,
    )


def _disk(S: Any, skew: int) -> Margin:
    """1/max |S + (skew - 1)/2|; of skew 1 the least |1 + L|."""
    most, w = S.plus(0.5 * (skew - 1)).largest()
    return Margin(1.0 / most, w) if most else NONE


def _real_crossings(L: Any) -> list[tuple[float, float]]:
    """Where L is real and negative, and L there."""
    places = [(w, L.at(L.border.place(w))[0].real) for w in L.signs("imag").places]
    return [(w, x) for w, x in [*places, *L.ends()] if -math.inf < x < 0]


def _stable_gains(L: Any, turns: list[tuple[float, float]]) -> Intervals:
    """The intervals of a factor on L, above 0, with which the closed loop is stable."""
    # poles reach the axis only at factors that move L to -1: one point of each interval decides
    factors = sorted({-1.0 / x for _, x in turns})
    most = L.known(factors)
    borders = [0.0, *(x for x in factors if x < most), most]
    return tuple(
        (low, high) for low, high in pairwise(borders) if L.closed(_between(low, high)).right == 0
    )


def _lags(L: Any, crossovers: list[tuple[float, complex]]) -> tuple[Margin, Margin]:
    """Phase margin in deg and delay margin in s, the least of all crossovers."""
    # the lag above 0 and up to 2 pi that turns L(jw) to the negative real axis
    angles = [(cmath.phase(-x) % (2 * math.pi) or 2 * math.pi, w) for w, x in crossovers]
    phase = min((Margin(math.degrees(angle), w) for angle, w in angles), default=NONE)
    delays = [Margin(angle / w, w) for angle, w in angles]
    if L.open_at_infinity:  # there one sample turns L(z), and any dead time L(s)
        delays.append(Margin(L.border.dt or 0.0, L.border.frequency(math.inf)))
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


def _between(low: float, high: float) -> float:
    if math.isinf(high):
        return 2.0 * low or 1.0
    return math.sqrt(low * high) or 0.5 * high

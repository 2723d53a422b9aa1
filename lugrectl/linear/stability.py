"""Stability of a closed loop with dead times, and how much more dead time it stands."""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from ..core.errors import InputError
from ..core.views import view
from .axis import signs, zeros
from .delayed import DelayedTransfer
from .delayed_checks import poles, square, unstable
from .sampled import is_sampled
from .verdict import Verdict


@dataclass(frozen=True, repr=False)
class StabilityVerdict(Verdict):
    """Truthy iff the closed loop L/(1 + L) is stable.

    ``delay_margin`` in s: the largest dead time that the loop stands on top of its own, the least
    of phase margin over frequency of all ``crossovers`` (rad/s, |L| = 1); inf if it stands any,
    nan if it is not stable. ``phase_margin`` in deg: the smallest phase lag that makes it unstable,
    between 0 and 360; inf without a crossover. ``encirclements`` of -1 by L(jw), counterclockwise,
    and the numbers of poles right of the imaginary axis of L (``open_poles``) and of the closed
    loop (``closed_poles``): encirclements = open_poles - closed_poles (Nyquist).
    """

    stable: bool
    delay_margin: float
    phase_margin: float
    crossovers: tuple[float, ...]
    encirclements: float
    open_poles: float
    closed_poles: float
    reason: str
    _units = {"delay_margin": "s", "phase_margin": "deg", "crossovers": "rad/s"}

    def __bool__(self) -> bool:
        return self.stable

    def plot(self, ax: Any = None) -> Any:
        """Draw |L(jw)| and its phase with the crossovers, and the Nyquist curve; returns the Axes.

        ``ax``: an Axes for the first, or up to three; else a new figure.
        """
        return view("check_plots.loop")(self, ax)


def stability_check(L: Any) -> StabilityVerdict:
    """Whether the loop closed over L(s) is stable, and its delay margin, with exact dead times.

    With L = n/d, sums of p(s) exp(-s h), the poles of L/(1 + L) are the zeros of n + d. Those
    right of the imaginary axis are counted by the argument of (n + d)(jw), which is the Nyquist
    criterion: it is followed without a grid, and to infinity by the leading terms. At a crossover,
    |L(jw)| = 1, a further dead time of (phase margin)/w puts a pair of poles on the axis; the
    least of these is the delay margin.

    Parameters
    ----------
    L : control.TransferFunction, control.StateSpace, pair (num, den) or DelayedTransfer
        The open loop, continuous, with one input and one output; feedback is negative. With a dead
        time: :func:`delayed`, or ``dead_time=`` of :func:`velocity_L` and :func:`position_L`. Of a
        loop made of blocks: ``lg.linearize(...).open_loop``.

    Returns
    -------
    StabilityVerdict
        Truthy if the closed loop is stable; ``delay_margin`` in s, ``phase_margin`` in deg,
        ``crossovers`` in rad/s, and the ``reason``.

    Raises
    ------
    InputError
        If L is none of these.

    Notes
    -----
    The crossovers do not depend on a dead time in series: of L = G(s) exp(-s h) they are isolated
    exactly, and the delay margin falls by as much as h grows. A loop with |L| >= 1 as w grows
    stands no further dead time at all: infinitely many poles are then right of the axis.
    A factor that cancels from L and is not stable makes the loop not stable, and the reason says
    so.

    Examples
    --------
    An integrator of gain K with dead time T is stable for K T < pi/2, with the delay margin
    pi/(2 K) - T:

    >>> check = lg.stability_check(lg.delayed(ct.tf([100.0], [1.0, 0.0]), 0.01))
    >>> bool(check), round(check.delay_margin, 6), round(check.phase_margin, 2)
    (True, 0.005708, 32.7)

    The velocity loop of the source paper stands 2.2 ms:

    >>> loop = lg.velocity_L(lg.table1(), kp=1.6, ki=0.16)
    >>> round(1e3 * lg.stability_check(loop).delay_margin, 2)
    2.16
    """
    if is_sampled(L):
        raise InputError(
            "L is sampled, but the check is for continuous time; there a dead time is a part of "
            "L(z), and (L/(1 + L)).poles() of control are all of them."
        )
    made = DelayedTransfer.of(L, "L")
    closed = made.num + made.den
    if not closed:
        raise InputError("L(s) is -1, so that the closed loop L/(1 + L) has no solution.")
    cause = f"it has {seen}" if (seen := unstable(closed)) else made.hidden
    mine, theirs = zeros(made.den).right, zeros(closed).right
    turns = mine - theirs if math.isfinite(mine) and math.isfinite(theirs) else math.nan
    counts = (turns, mine, theirs)
    found = _crossovers(made)
    if cause:
        reason = f"the closed loop is not stable: {cause}"
        return StabilityVerdict(False, math.nan, math.nan, found, *counts, reason).of(made)
    angles = [(_lag(made, w), w) for w in found]
    phase = math.degrees(min((angle for angle, _ in angles), default=math.inf))
    margin, at = min(((angle / w, w) for angle, w in angles), default=(math.inf, math.nan))
    if _gain_at_infinity(made) >= 1:
        margin, at = 0.0, math.inf
    reason = _reason(margin, at, turns, mine)
    return StabilityVerdict(True, margin, phase, found, *counts, reason).of(made)


def _crossovers(L: DelayedTransfer) -> tuple[float, ...]:
    """Where |L(jw)| = 1, in rad/s: where it crosses and where it touches."""
    above = square(L.num) + square(L.den).scaled(-1)
    if not above:
        return ()
    found = signs(above)
    return tuple(sorted({*found.changes, *found.touches}))


def _lag(L: DelayedTransfer, w: float) -> float:
    """The phase lag in rad, above 0 and up to 2 pi, that turns L(jw) to the negative real axis."""
    turned = -L(1j * w)
    angle = math.atan2(turned.imag, turned.real)
    return angle if angle > 0 else angle + 2 * math.pi


def _gain_at_infinity(L: DelayedTransfer) -> Fraction:
    """A bound on |L(jw)| as w grows; 0 for a strictly proper L."""
    if L.num.degree < L.den.degree:
        return Fraction(0)
    last = L.den.leading
    own = abs(last.pop(0, Fraction(0))) - sum(map(abs, last.values()))
    top = sum(map(abs, L.num.leading.values()))
    return top / own if own > 0 and L.num.degree == L.den.degree else Fraction(1)


def _reason(margin: float, at: float, turns: float, open_poles: float) -> str:
    start = "the closed loop is stable"
    if open_poles:
        start += (
            f": L encircles -1 {turns:.0f} times, once for each of its {poles(int(open_poles))}"
        )
        start += " right of the imaginary axis"
    if math.isinf(margin):
        return f"{start}; |L(jw)| is 1 nowhere, so it is so with any further dead time"
    if math.isinf(at):
        return (
            f"{start}, but |L| is not below 1 as w grows: any further dead time makes it unstable"
        )
    return (
        f"{start}; a further dead time of {margin:.6g} s puts a pair of poles on the imaginary "
        f"axis at the crossover {at:.6g} rad/s"
    )

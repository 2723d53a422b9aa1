"""L2 gain of the proposed observer's linear part, and of any linear system."""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import control as ct
import numpy as np

from ..blocks.model import values_of
from ..core.errors import InputError
from ..core.views import view
from .delayed import DelayedTransfer
from .state_system import StateSystem
from .systems import system_of
from .transfer import is_measured, number, parameter, to_float
from .verdict import Verdict

LINEAR = (ct.TransferFunction, ct.StateSpace, DelayedTransfer, tuple, list)


@dataclass(frozen=True, repr=False)
class L2Verdict(Verdict):
    """Truthy iff the L2 gain is finite.

    ``gain``: the L2 gain (inf if there is none). ``frequency``: where |G(jw)| is largest, in
    rad/s: 0 at DC or if |G| is constant, inf if the largest value is approached as w grows, nan
    if G is unstable (its gain is then not a peak on the axis). ``meaning``: the consequence for
    the error e_z = z - zhat of the proposed observer.
    """

    gain: float
    frequency: float
    reason: str
    meaning: str
    _units = {"gain": "s", "frequency": "rad/s"}

    def __bool__(self) -> bool:
        return bool(np.isfinite(self.gain))

    def plot(self, ax: Any = None) -> Any:
        """Draw |G(jw)| with its largest value, into ``ax`` or a new figure; returns the Axes."""
        return view("loop_plots.gain")(self, ax)


def l2_check(p: Any, K2: float | None = None) -> L2Verdict:
    """L2 gain of G(s) = (J s + K2)/(sigma1 s + sigma0), or of a transfer function.

    The pole is -sigma0/sigma1 for every K2: K2 moves the zero only, so no sign of K2 makes G
    unstable. |G(jw)|^2 = (K2^2 + J^2 w^2)/(sigma0^2 + sigma1^2 w^2) is monotone in w, so for
    sigma0/sigma1 > 0 the gain is the larger of |K2|/sigma0 (at DC) and J/sigma1 (as w grows).
    It is infinite for sigma1 = 0 (G improper), for sigma0 = 0 (integrator) unless K2 = 0, and
    for sigma0/sigma1 < 0 (unstable, also if the zero cancels the pole, because the mode
    remains). The comparison is exact for the given floats.

    Parameters
    ----------
    p : Parameters, Model or any object with attributes J, sigma0, sigma1
        In kg m2, N m/rad, N m s/rad; or a transfer function T(s) as for :func:`spr_check`, whose
        own H-infinity norm is then the answer, where T is stable and proper: the largest |T(jw)|,
        with several channels the largest singular value; or a measured response, control.frd:
        the largest value at its frequencies.
    K2 : float, optional
        Observer gain in N m s/rad; left out with a transfer function.

    Returns
    -------
    L2Verdict
        Truthy if the gain is finite; ``gain`` in s, ``frequency`` in rad/s where it is reached, and
        its ``meaning`` for the observer's error.

    Raises
    ------
    InputError
        For values that are not finite numbers and for sigma0 = sigma1 = 0.

    Notes
    -----
    Use (source paper, err_z_lap and lemma 5): with constant K2 the observer's errors obey
    sigma1 de_z/dt + sigma0 e_z = -(J de_w/dt + K2 e_w) for all u, w and K1, so with
    c = e_z(0) + (J/sigma1) e_w(0), which is missing in err_z_lap,

        e_z = -G e_w + c exp(-sigma0 t/sigma1),
        ||e_z||_2 <= gain ||e_w||_2 + |c| sqrt(sigma1/(2 sigma0)).

    Hence e_z is in L2 if e_w is; if w is bounded, so is de_z/dt, and e_z -> 0 (Barbalat). This
    gives no rate, and does not show that e_w is in L2: that depends on K1.

    With exact dead times (:class:`DelayedTransfer`) it is found to 1e-6 relative, and shown to be
    the largest: 1e-7 above it, gain^2 |d|^2 - |n|^2 has no zero on the axis (intervals with a bound
    of the second derivative, no grid).

    The norm is isolated exactly; with more than 6 states, or several channels, it is found in
    floating point by level sets (Bruinsma and Steinbuch 1990), to about 1e-12.

    A mode on the imaginary axis that does not show in T, as the position in a loop's speed, leaves
    the gain finite, and the reason names it; one right of the axis makes the gain infinite.

    Examples
    --------
    The gain of the source paper's observer is |K2|/sigma0, reached at DC:

    >>> check = lg.l2_check(lg.table1(), K2=22.0)
    >>> round(check.gain, 4), check.frequency
    (0.0846, 0.0)
    """
    if is_measured(p) or isinstance(p, LINEAR):
        if K2 is not None:
            raise InputError("K2 goes with a drive's parameters: leave it out beside T(s).")
        several = isinstance(p, ct.StateSpace) and p.ninputs * p.noutputs != 1
        system = StateSystem.of(p).shown() if several else system_of(p)
        meaning, hidden = system.meaning, f"; {system.hidden}" if system.hidden else ""
        gain, w, reason = math.inf, math.nan, ""
        if not system.stable:
            reason = system.unsettled
        elif system.lost:
            reason = system.hidden
        elif system.excess < 0:
            w = math.nan if system.border.dt else math.inf
            reason = f"T({system.border.variable}) is improper: it needs the input ahead, or |T| "
            reason += "grows with w without bound"
        if reason:
            meaning = "nothing follows for the output of an input in L2"
            return L2Verdict(gain, w, reason, meaning).of(p)
        gain, w = system.largest()
        where = f"at w = {w:.6g} rad/s" if np.isfinite(w) else "as w grows"
        reason = f"{system.size} is largest {where}: {gain:.6g}{system.basis}{hidden}"
        return L2Verdict(gain, w, reason, meaning.format(gain)).of(p)
    if K2 is None:
        raise InputError("l2_check needs K2, the observer's gain in N m s/rad.")
    p = values_of(p)
    J, sigma0, sigma1 = (parameter(p, name) for name in ("J", "sigma0", "sigma1"))
    gain, frequency, reason = _gain(J, number(K2, "K2"), sigma0, sigma1)
    verdict = L2Verdict(gain, frequency, reason, _meaning(gain, J, sigma0, sigma1))
    return verdict.of(([J, number(K2, "K2")], [sigma1, sigma0]))


def _gain(J: Fraction, K2: Fraction, s0: Fraction, s1: Fraction) -> tuple[float, float, str]:
    inf = float("inf")
    if not s0 and not s1:
        raise InputError("sigma0 and sigma1 are both 0: G(s) has no denominator; give one.")
    if not s1 and J:
        return inf, inf, "sigma1 = 0 makes G(s) improper: |G| grows with J w/sigma0 without bound"
    if not s0 and K2:
        return inf, 0.0, "sigma0 = 0 with K2 not 0 makes G(s) an integrator: |G| is unbounded at DC"
    if s0 * s1 < 0:
        pole = to_float(-s0 / s1)
        return inf, float("nan"), f"G(s) is unstable: its pole -sigma0/sigma1 is {pole:+.6g} 1/s"
    dc, high = abs(K2 / s0) if s0 else None, abs(J / s1) if s1 else None
    if dc == high or dc is None or high is None:
        gain = to_float(high if dc is None else dc)  # type: ignore
        return gain, 0.0, f"|G(jw)| is {gain:.6g} at every frequency"
    a, b = to_float(dc), to_float(high)
    if dc > high:
        return a, 0.0, f"|G| falls from |K2|/sigma0 = {a:.6g} at DC to J/sigma1 = {b:.6g}"
    return b, inf, f"|G| rises from |K2|/sigma0 = {a:.6g} at DC to J/sigma1 = {b:.6g} as w grows"


def _meaning(gain: float, J: Fraction, s0: Fraction, s1: Fraction) -> str:
    if gain == float("inf"):
        return "nothing follows for e_z: it need not be in L2 even if e_w is"
    bound = f"||e_z||_2 <= {gain:.6g} ||e_w||_2"
    if not s0:
        return f"{bound} if e_z(0) + (J/sigma1) e_w(0) = 0; else that part of e_z does not decay"
    if s1:
        root = to_float(s1 / (2 * s0)) ** 0.5
        bound += f" + {root:.6g} |e_z(0) + {to_float(J / s1):.6g} e_w(0)|"
    return f"{bound}: e_z is in L2 if e_w is, and for bounded w e_z tends to 0 (without a rate)"

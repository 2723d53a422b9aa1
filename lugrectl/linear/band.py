"""Bandwidth by exact root isolation of |T(jw)|^2 = c |T(0)|^2."""

from __future__ import annotations

import math
import re
import warnings
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from ..core.errors import InputError
from ..core.views import view
from .state_system import StateSystem
from .systems import system_of
from .transfer import number
from .verdict import Verdict

HERTZ = re.compile(r" \([^()]* Hz\)")
LEVELS = {"-3dB": Fraction(10 ** (-3 / 10)), "half-power": Fraction(1, 2)}


class UnstableLoopWarning(UserWarning):
    """The transfer function has poles that are not left of the imaginary axis."""


class NoBandwidthWarning(UserWarning):
    """The transfer function has no finite value at w = 0 that |T| could fall from."""


@dataclass(frozen=True, repr=False)
class BandwidthVerdict(Verdict):
    """Truthy iff T is stable and its bandwidth is a finite number.

    ``bandwidth`` in rad/s and ``hertz`` (nan where T.dt is True): the first fall of |T(jw)| through
    the level; nan without a DC gain (T(0) zero or infinite), inf if never below. ``crossings``: all
    crossings in rad/s, falling and rising in turn. ``poles`` in 1/s, rightmost first (sampled: in
    z, the largest first), empty with dead times, where there are infinitely many.
    """

    bandwidth: float
    hertz: float
    crossings: tuple[float, ...]
    stable: bool
    poles: tuple[complex, ...]
    reason: str
    _units = {
        "bandwidth": "rad/s",
        "hertz": "Hz",
        "crossings": "rad/s",
        "poles": "1/s",
    }

    def __bool__(self) -> bool:
        return self.stable and math.isfinite(self.bandwidth)

    def _per_sample(self) -> None:
        super()._per_sample()
        object.__setattr__(self, "hertz", math.nan)
        object.__setattr__(self, "reason", HERTZ.sub("", self.reason))

    def plot(self, ax: Any = None) -> Any:
        """Draw |T(jw)| with the bandwidth; returns a list of its Axes.

        ``ax``: an Axes; else a new figure.
        """
        return view("loop_plots.band")(self, ax)


def bandwidth_check(T: Any, level: str | float = "-3dB") -> BandwidthVerdict:
    """Where |T(jw)| first falls below its DC value by 3 dB.

    With x = w^2 and T = n/d in lowest terms, the sign changes on x > 0 of
    |n(jw)|^2 |d(0)|^2 - c |n(0)|^2 |d(jw)|^2 are isolated exactly; c = 10^(-3/10) for "-3dB"
    (amplitude 0.70795), 1/2 for "half-power" (0.70711), 10^(level/10) for a negative number of
    dB.

    Parameters
    ----------
    T : control.TransferFunction, control.StateSpace, control.frd or pair (num, den)
        A system with one input and one output, continuous or sampled; or a measured response: its
        lowest frequency then stands for DC, the crossing is interpolated (dB over log w), and T
        counts as stable. With an exact dead time: a :class:`DelayedTransfer`.
    level : "-3dB", "half-power" or float
        How far |T| falls; a negative number is in dB.

    Returns
    -------
    BandwidthVerdict
        Truthy if T is stable and its bandwidth finite; ``bandwidth`` in rad/s, ``hertz``, all
        ``crossings`` in rad/s, ``poles`` in 1/s and the ``reason``.

    Raises
    ------
    InputError
        If T is none of these, or for an unknown level.

    Notes
    -----
    Stability is decided exactly for the given coefficients (Routh), after cancelling common
    factors; touching the level does not count as a crossing. A state-space model of more than 6
    states is decided in floating point, at the cost of a few eigenvalue problems; a crossing that
    rounding blurs by more than 1e-6 is given by the frequency up to which there surely is none.

    With dead times the crossings are isolated in floating point, none is missed between points of
    a grid, and the poles that are not stable are counted by the argument of the denominator
    (Nyquist); ``poles`` is then empty. A dead time in front of T does not change its bandwidth.

    Of a sampled T(z), T(exp(jw dt)) is meant, up to half the sampling rate, w in rad/s (per sample
    where T.dt is True), ``poles`` are in z, and the same arithmetic decides.

    Examples
    --------
    The position loop of the source paper has a crossing at 20 Hz, but is unstable:

    >>> check = lg.bandwidth_check(lg.position_loop_tf(lg.table1(), kp=15.0, ki=1.55))
    >>> round(check.hertz, 1), check.stable, bool(check)
    (20.4, False, False)
    """
    return _verdict(system_of(T), level_power(level), level).of(T)


def _floating(T: Any, power: Fraction, level: str | float) -> BandwidthVerdict:
    """Return the verdict of floating point, whatever the number of states: to time it alone."""
    return _verdict(StateSystem.of(T).shown(), power, level)


def _verdict(system: Any, power: Fraction, level: str | float) -> BandwidthVerdict:
    name = level if isinstance(level, str) else f"{level:g} dB"
    dc, doubt = system.dc()
    base, width, crossings, said = f"|{system.base}|", math.nan, (), ""
    if 0 < dc < math.inf:
        found = system.signs("size", power * Fraction(dc) ** 2, doubt)
        crossings = tuple(edge.first for edge in found.edges)
        blurred = [edge for edge in found.touches if edge.low < edge.high]
        edges = sorted([*found.edges[:1], *blurred[:1]], key=lambda edge: edge.low)
        width = edges[0].first if edges else math.inf
        said = f"through {name} of {base} = {float(dc):.6g} at {width:.6g} rad/s "
        said = f"falls {said}({width / (2 * math.pi):.6g} Hz)"
        if not edges:
            said = f"never falls below {name} of {base} = {float(dc):.6g}"
        elif edges[0] in blurred or not edges[0].sharp:
            said += f", or up to {edges[0].high:.6g} rad/s: rounding decides"
        reason = f"|T({system.border.argument})| {said}"
    else:
        reason = f"{system.base} is {'infinite' if dc else 'zero'}, so there is no DC gain to "
        reason += "measure a bandwidth from"
        reason += "; of an open loop check T/(1 + T)" if dc else ""
    reason += system.basis + (f"; {system.hidden}" if system.hidden else "")
    if not system.stable:
        reason = f"{system.unsettled}: {reason}"
    poles, stable = tuple(map(complex, system.poles)), bool(system.stable)
    return BandwidthVerdict(width, width / (2 * math.pi), crossings, stable, poles, reason)


def bandwidth(T: Any, level: str | float = "-3dB") -> float:
    """Bandwidth in rad/s as ``bandwidth_check(T, level).bandwidth``.

    Parameters
    ----------
    T : control.TransferFunction, DelayedTransfer, control.StateSpace, control.frd or (num, den)
        As for :func:`bandwidth_check`.
    level : "-3dB", "half-power" or float
        As for :func:`bandwidth_check`.

    Returns
    -------
    float
        In rad/s. For an unstable T the crossing is returned with an UnstableLoopWarning that names
        the poles; nan without a DC gain, with a NoBandwidthWarning that says why; inf if |T| never
        falls below the level.

    Raises
    ------
    InputError
        As :func:`bandwidth_check`.

    Examples
    --------
    The velocity loop of the source paper, in Hz:

    >>> T = lg.velocity_loop_tf(lg.table1(), kp=1.6, ki=0.16)
    >>> round(lg.bandwidth(T) / (2 * np.pi), 1)
    115.5
    """
    verdict = bandwidth_check(T, level)
    if math.isnan(verdict.bandwidth):
        warnings.warn(f"No bandwidth: {verdict.reason}.", NoBandwidthWarning, stacklevel=2)
    elif not verdict.stable:
        warnings.warn(verdict.reason, UnstableLoopWarning, stacklevel=2)
    return verdict.bandwidth


def level_power(level: str | float) -> Fraction:
    if isinstance(level, str):
        if level not in LEVELS:
            raise InputError(f"Level {level!r} is unknown; use '-3dB', 'half-power' or dB < 0.")
        return LEVELS[level]
    if (db := float(number(level, "level"))) >= 0:
        raise InputError(f"Level {db:g} dB is not below the DC gain; use a negative number.")
    return Fraction(10 ** (db / 10))

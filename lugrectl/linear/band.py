"""Bandwidth by exact root isolation of |T(jw)|^2 = c |T(0)|^2."""

from __future__ import annotations

import math
import re
import warnings
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import control as ct
import numpy as np

from ..core.errors import InputError
from ..core.views import view
from .delayed import DelayedTransfer
from .delayed_checks import crossings as delayed_crossings
from .delayed_checks import unstable
from .exact import Poly, add, hurwitz, odd_roots, positive_roots, real_product, scale
from .floating import Model, level_signs
from .floating_sampled import SampledModel
from .hinf import UNKNOWN
from .measured import crossings, is_measured
from .sampled import Sampled, is_sampled
from .transfer import number, read_transfer
from .verdict import Verdict, show_poles

EXACT = 6  # states of a state-space model that is decided in exact arithmetic
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
        """Draw |T(jw)| with the bandwidth, and the phase; returns the Axes.

        ``ax``: an Axes for the first, or two; else a new figure.
        """
        return view("check_plots.band")(self, ax)


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
    c = level_power(level)
    if is_measured(T):
        return _measured(T, c, level).of(T)
    if isinstance(T, DelayedTransfer):
        return _delayed(T, c, level).of(T)
    if isinstance(T, ct.StateSpace) and (made := _floating(T, c, level)) is not None:
        return made.of(T)
    if is_sampled(T):
        sampled = Sampled.of(T)
        (num, den), stable, frequency = sampled.in_v, sampled.stable, sampled.frequency
        poles, hidden = sampled.poles, sampled.hidden
    else:
        transfer = read_transfer(T)
        num, den, _ = transfer
        stable, frequency = hurwitz(den), float
        poles, hidden = transfer.poles, transfer.hidden
    dc = bool(num) and bool(num[0]) and bool(den[0])
    found = tuple(map(frequency, _crossings(num, den, c))) if dc else ()
    width = (found[0] if found else math.inf) if dc else math.nan
    reason = _reason(num, den, width, level)
    reason += f"; {hidden}" if hidden else ""
    return _verdict(width, found, stable, poles, reason, is_sampled(T)).of(T)


def _verdict(
    width: float,
    found: tuple[float, ...],
    stable: bool | None,
    poles: tuple[complex, ...],
    reason: str,
    sampled: bool,
) -> BandwidthVerdict:
    if sampled:
        reason = reason.replace("|T(jw)|", "|T(exp(jw dt))|")
    if not stable:
        shown = f"z = {show_poles(poles)}" if sampled else f"poles {show_poles(poles)} 1/s"
        said = UNKNOWN if stable is None else "T is not stable"
        reason = f"{said} ({shown}): {reason}"
    return BandwidthVerdict(width, width / (2 * math.pi), found, bool(stable), poles, reason)


def _floating(T: Any, c: Fraction, level: str | float) -> BandwidthVerdict | None:
    """The verdict on a state-space model of many states; None of few."""
    sampled = is_sampled(T)
    if T.nstates <= EXACT:
        return None
    model, hidden = (SampledModel if sampled else Model).of(T).seen()
    dc, slack = model.at(0.0)
    edges, width = (), math.nan
    if slack < abs(dc):
        signs = level_signs(model, float(c))
        edges, touches = signs.edges, signs.touches
        first = min([*edges[:1], *touches[:1]], key=lambda e: e.low, default=None)
        width = first.first if first else math.inf
        reason = _falls(width, level, abs(dc))
        if first and (first in touches or not first.sharp):
            reason += f", or up to {first.high:.6g} rad/s: rounding decides"
    else:
        integrates = np.abs(model.marks).min() <= model.uncertain
        reason = _no_dc("infinite" if integrates else "zero", " within rounding")
    reason += f"; {hidden}" if hidden else ""
    poles, found = tuple(map(complex, model.poles)), tuple(e.first for e in edges)
    return _verdict(width, found, model.stable, poles, reason, sampled)


def _delayed(T: DelayedTransfer, c: Fraction, level: str | float) -> BandwidthVerdict:
    """The verdict on a transfer function with exact dead times."""
    dc, found = delayed_crossings(T, c)
    reason, width = _no_dc("infinite" if math.isinf(dc) else "zero"), math.nan
    if math.isfinite(dc):
        width = found[0] if found else math.inf
        reason = _falls(width, level, dc)
    cause = unstable(T.den)
    reason = f"T is not stable ({cause}): {reason}" if cause else reason
    reason += f"; {T.hidden}" if T.hidden else ""
    return BandwidthVerdict(width, width / (2 * math.pi), found, not cause, (), reason)


def _measured(T: Any, c: Fraction, level: str | float) -> BandwidthVerdict:
    """The verdict on a measured response."""
    found, said = crossings(T, float(c))
    name = level if isinstance(level, str) else f"{level:g} dB"
    if not found:
        width = math.nan if said.startswith("|T| is 0") else math.inf
        reason = said if math.isnan(width) else f"|T(jw)| does not fall below {name}, {said}"
        return BandwidthVerdict(width, width, (), True, (), reason)
    width, hertz = found[0], found[0] / (2 * math.pi)
    reason = f"|T(jw)| falls through {name} at {width:.6g} rad/s ({hertz:.6g} Hz), {said}"
    return BandwidthVerdict(width, hertz, found, True, (), reason)


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


def _crossings(num: Poly, den: Poly, c: Fraction) -> tuple[float, ...]:
    above = scale(real_product(num, num), den[0] ** 2)
    level = scale(real_product(den, den), -c * num[0] ** 2)
    return tuple(math.sqrt(x) for x in positive_roots(odd_roots(add(above, level))))


def _reason(num: Poly, den: Poly, width: float, level: str | float) -> str:
    if math.isnan(width):
        value = "infinite" if num and not den[0] else "zero"
        return _no_dc(value)
    return _falls(width, level, abs(float(Fraction(num[0]) / den[0])))


def _no_dc(value: str, sure: str = "") -> str:
    """Why there is no bandwidth: one clause, with what to check instead of an integrator."""
    open_loop = "; of an open loop check T/(1 + T)" if value == "infinite" else ""
    return f"T(0) is {value}{sure}, so there is no DC gain to measure a bandwidth from{open_loop}"


def _falls(width: float, level: str | float, dc: float) -> str:
    name = level if isinstance(level, str) else f"{level:g} dB"
    start = f"{name} of |T(0)| = {dc:.6g}"
    if math.isinf(width):
        return f"|T(jw)| never falls below {start}"
    return f"|T(jw)| falls through {start} at {width:.6g} rad/s ({width / (2 * math.pi):.6g} Hz)"

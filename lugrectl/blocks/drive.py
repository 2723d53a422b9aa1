"""What stands between a controller and the motor, and in front of a speed loop.

Limit, notch, current loop, dead time: each reads ``u_cmd`` and puts out ``u`` unless it is given
other names. The proportional position controller puts out the speed reference.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, Unpack

import numpy as np

from ..core.errors import InputError
from ..core.validation import number, one_name, positive, renamed
from .block import P, Steady
from .effects import actuator_lag, actuator_saturation, input_delay
from .factories import Names, built, factory, reading

TURN = 2.0 * np.pi
KV: Any = P(20.0, "1/s")
SPEED_LIMIT: Any = P(np.inf, "rad/s", 0.0, neutral=np.inf)
TORQUE_LIMIT: Any = P(np.inf, "N m", 0.0, neutral=np.inf)
MOST = 10_000  # samples of delay


@built("controller", out="u excess")
def limiter(u_cmd, limit=TORQUE_LIMIT):
    """The torque limit of a drive: input u_cmd, outputs u, excess.

    u = clip(u_cmd, -limit, limit), excess = u - u_cmd.

    Parameters
    ----------
    limit : float
        Largest torque in N m, >= 0.

    Returns
    -------
    Without states; torques in N m.

    Notes
    -----
    ``excess`` is 0 while the drive is not at its limit. A controller with ``tracking=`` reads it
    to keep its integral from winding up, wherever the limit stands: behind a notch, or where
    compensation and feed-forward have been added.

    Examples
    --------
    A command of 3 N m on a drive that can give 2 N m:

    >>> lg.limiter(2.0).output(0.0, [], [3.0])
    array([ 2., -1.])
    """
    (u,) = actuator_saturation(u_cmd, limit=limit)
    return u, u - u_cmd


@built("controller", out="w_ref")
def proportional(e, kv=KV, limit=SPEED_LIMIT):
    """The position controller of a cascade, w_ref = kv (-e): input e, output w_ref.

    w_ref = clip(kv (-e), -limit, limit).

    Parameters
    ----------
    kv : float
        In 1/s.
    limit : float
        Largest speed reference in rad/s, >= 0.

    Returns
    -------
    Without states; output w_ref in rad/s.

    Examples
    --------
    The position is 0.5 rad short; the speed reference is limited to 5 rad/s:

    >>> lg.proportional(kv=20.0, limit=5.0).output(0.0, [], [-0.5])
    array([5.])
    """
    return np.clip(-kv * e, -limit, limit)


@built("controller", needed="frequency", out="u", states="band area")
def notch(
    u_cmd,
    band,
    area,
    frequency: Any = P(100.0, "Hz", 1e-9),
    damping: Any = P(0.5, "1", 1e-9),
    depth: Any = P(0.1, "1", 0.0, 1.0),
):
    """A notch filter against a resonance: input u_cmd, output u.

    u/u_cmd = (s^2 + 2 depth D W s + W^2)/(s^2 + 2 D W s + W^2), W = 2 pi frequency.

    Parameters
    ----------
    frequency : float
        Its middle in Hz.
    damping : float
        D > 0, without unit; the notch is 2 D frequency wide (in Hz, where depth is 0 at -3 dB).
    depth : float
        The gain in the middle, 0 to 1; 1 switches the notch off.

    Returns
    -------
    States band and area in N m.

    Notes
    -----
    u = u_cmd - (1 - depth) band, where band = 2 D W s/(s^2 + 2 D W s + W^2) u_cmd has the unit
    of u; states ``band`` and ``area``, W times the integral of band. The gain is 1 at rest.

    Examples
    --------
    A resonance of the coupling at 120 Hz is reduced to a tenth:

    >>> notch = lg.notch(120.0, damping=0.5, depth=0.1)
    >>> linear = notch.linearize([0.0, 0.0], [0.0])
    >>> round(float(abs(linear(2j * np.pi * 120.0))), 3)
    0.1
    """
    W = TURN * frequency
    rate = 2.0 * damping * W * (u_cmd - band) - W * area
    return u_cmd - (1.0 - depth) * band, rate, W * band


@factory
def current_lag(time_constant: float, **names: Unpack[Names]):
    """The current loop of a drive as a first-order lag: input u_cmd, output u.

    tau du/dt + u = u_cmd: the effect ``actuator_lag`` as a block of the loop.

    Parameters
    ----------
    time_constant : float
        In s; 0 passes the command unchanged.

    Returns
    -------
    State lagged in N m.

    Raises
    ------
    For a time constant outside 0 to 10 s.

    Examples
    --------
    A current loop of 300 Hz bandwidth:

    >>> lag = lg.current_lag(1 / (2 * np.pi * 300.0))
    >>> pole = lag.linearize([0.0], [0.0]).poles()
    >>> round(float(-pole[0].real / (2 * np.pi)), 1)
    300.0
    """
    return actuator_lag.system(**reading(names, "u_cmd"), time_constant=time_constant)


# As a part of a drive it has no bound; an identification looks for an effect of up to 0.2 s.
_LATE = replace(input_delay, parameters={"delay": replace(input_delay.own["delay"], high=math.inf)})


@factory
def dead_time(delay: float, dt: float | None = None, **names: Unpack[Names]):
    """A dead time, u = u_cmd(t - T): input u_cmd, output u.

    Parameters
    ----------
    delay : float
        T in s, 0 or more, as :func:`delayed` takes it; 0 passes the command unchanged.
    dt : float, optional
        Sample time in s. Without it the block is continuous: exact in ``lg.simulate``, and
        elsewhere the Pade approximation of order 2 of the effect ``input_delay``, exact to 1
        degree of phase up to w T = 1.7. With it the block is discrete and delays by whole samples
        exactly; for a delay between two whole numbers of samples it mixes the two neighbours,
        which is the mean over each sample.

    Returns
    -------
    States p1 and p2 of the Pade form; with dt the last commands, in N m.

    Raises
    ------
    For a negative delay, and with dt for one of more than 10 000 samples.

    Notes
    -----
    The Pade form, which python-control uses, answers a unit step with 1 at the first instant,
    then -0.4 at its lowest, before it rises to 1. In a loop whose gain has fallen well below 1 at
    w T = 1.7 this does not matter. :func:`linearize` keeps the dead time exact.
    States of the discrete block: the last commands.

    Examples
    --------
    >>> lg.dead_time(2e-3).nstates  # continuous: a Pade approximation of order 2
    2
    >>> lg.dead_time(2e-3, dt=1e-3).dt  # in a drive that runs at 1 kHz, exact
    0.001
    """
    seconds = number(delay, "delay")
    if seconds < 0.0:
        raise InputError(f"delay is {seconds:g} s, but a dead time cannot be negative.")
    if dt is None:
        return _LATE.system(**reading(names, "u_cmd"), delay=seconds)
    step = positive(dt, "dt", "seconds")
    if seconds > MOST * step:
        raise InputError(f"delay = {seconds:g} s lies outside 0 to {MOST} samples of {step:g} s.")
    import control as ct

    name, samples = one_name(names.get("name")), seconds / step
    samples = float(round(samples)) if abs(samples - round(samples)) < 1e-9 else samples
    many, late = math.ceil(samples), _Late(int(samples), samples % 1.0)
    return ct.nlsys(
        replace(late, updates=True) if many else None,
        late,
        inputs=renamed(name, "inputs", ("u_cmd",), names.get("inputs")),
        outputs=renamed(name, "outputs", ("u",), names.get("outputs")),
        states=[f"late{k + 1}" for k in range(many)] or None,
        name=name,
        dt=step,
    )


@dataclass(frozen=True)
class _Late(Steady):
    """The command of ``whole`` samples ago, mixed with the one before by ``part``; or the states
    of the next sample, each the one before it."""

    whole: int
    part: float
    updates: bool = False

    def __call__(self, t: Any, x: Any, u: Any, params: Any) -> np.ndarray:
        known = [u[0], *x]
        if self.updates:
            return np.array(known[:-1])
        late = known[self.whole]
        if self.part:
            late = (1.0 - self.part) * late + self.part * known[self.whole + 1]
        return np.array([late])


class DeadTime(NamedTuple):
    """A dead time of ``seconds`` in a block; its two states are at ``place`` of the system's."""

    block: str
    seconds: float
    place: int


def dead_times(
    system: Any, params: Mapping[str, Any] | None = None, place: int = 0
) -> Iterator[DeadTime]:
    """The dead times of the package's continuous blocks, their own or those of a model inside."""
    for one in getattr(system, "syslist", ()):
        yield from dead_times(one, params, place)
        place += one.nstates
    answer: Any = getattr(system, "outfcn", None)
    made = getattr(answer, "block", None)
    if made is None or system.isdtime(strict=True):
        return
    parts = made.function.parts if made.kind == "plant" else ()
    for prefix, of in [("", made), *((part.prefix, part) for part in parts)]:
        name = answer.keys.get(f"{prefix}delay")
        if name is not None and getattr(of, "block", of).name == input_delay.name:
            at = place + made.states.index(of.states[0])
            yield DeadTime(system.name, float((params or {}).get(name, system.params[name])), at)

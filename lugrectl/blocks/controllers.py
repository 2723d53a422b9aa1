"""Controllers, compensation, feed-forward and prefilter, and what stands behind a controller.

e is measured - reference, so a controller acts on -e. All outputs named ``u`` are added. Limit,
notch, current loop and dead time read ``u_cmd`` and put out ``u`` unless they are given other
names; the proportional position controller puts out the speed reference of a cascade.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, NamedTuple, Unpack

import numpy as np

from ..core.errors import InputError
from ..core.validation import number, one_name, positive, renamed
from .block import Block, P, Steady
from .declaration import block
from .effects import actuator_lag, actuator_saturation, input_delay
from .factories import Names, built, factory, reading
from .friction import PAPER, J
from .model import Model, Parameters, as_model

if TYPE_CHECKING:
    import control as ct


KP, KI = P(1.6, "N m s/rad"), P(0.16, "N m/rad")
KP_ANGLE, KI_ANGLE = P(15.0, "N m/rad"), P(1.55, "N m/(rad s)")
KD, TAU = P(0.0, "N m s/rad"), P(0.0, "s", 0.0)
LIMIT: Any = P(np.inf, "N m", 0.0, neutral=np.inf)
TRACKING: Any = P(np.inf, "s", 1e-9, neutral=np.inf)
POLE = P(2.0, "1/s", 1e-12)
MEASURED = {"velocity": "w", "position": "theta"}
DERIVATIVE = {"velocity": "dr", "position": "ddr"}


def action(e: Any, q: Any, kp: Any, ki: Any, tau: Any) -> tuple[Any, Any]:
    """u = ki q - kp e; tau dq/dt = -e - q, and with tau = 0 the pure integral dq/dt = -e."""
    leak = np.where(tau > 0.0, 1.0, 0.0)
    return ki * q - kp * e, (-e - leak * q) / np.where(tau > 0.0, tau, 1.0)


def held_back(dq: Any, excess: Any, ki: Any, tracking: Any) -> Any:
    """dq/dt = dq + excess/(ki T): back-calculation, ki q changes by the excess in the time T."""
    none = ki == 0.0
    return dq + np.where(none, 0.0, excess / np.where(none, 1.0, ki * tracking))


def lag(r_cmd: Any, r: Any, pole: Any) -> Any:
    """dr/dt = pole (r_cmd - r)."""
    return pole * (r_cmd - r)


@block("controller", name="error", out="e", source=PAPER)
def _error(r, y):
    """e = y - r, measured - reference."""
    return y - r


@block("controller", name="pi", out="u", states="q", source=f"{PAPER}, section 2")
def _pi(e, q, kp=KP, ki=KI):
    """u = kp (-e) + ki q, dq/dt = -e.

    With ``limit=`` u = clip(v, -limit, limit), where v is the output without limit, and
    dq/dt = -e + (u - v)/(ki T): no wind-up. T is ``tracking``, kp/ki unless given.
    """
    return action(e, q, kp, ki, 0.0)


@block("controller", name="pid", out="u", states="q", source=f"{PAPER}, section 3.1")
def _pid(e, w, q, kp=KP_ANGLE, ki=KI_ANGLE, kd=KD, tau=TAU):
    """u = kp (-e) + ki q - kd w, tau dq/dt = -e - q (tau = 0: dq/dt = -e).

    ``limit=`` and ``tracking=`` as for ``pi``.
    """
    u, dq = action(e, q, kp, ki, tau)
    return u - kd * w, dq


@dataclass(frozen=True)
class _Held:
    """A controller whose integral a limit holds back: its own, or one elsewhere in the loop, whose
    excess it reads."""

    free: Block
    own: bool

    def __call__(self, *given: Any, tracking: Any, limit: Any = np.inf, **gains: Any) -> Any:
        *signals, q = given
        u, dq = self.free(*signals[: len(self.free.inputs)], q, **gains)
        inside, excess = u, signals[-1]
        if self.own:
            inside = np.clip(u, -limit, limit)
            excess = inside - u
        return inside, held_back(dq, excess, gains["ki"], tracking)

    def block(self) -> Block:
        free, more = self.free, {"limit": LIMIT} if self.own else {}
        inputs = (*free.inputs, *(() if self.own else ("excess",)))
        more = {**free.parameters, **more, "tracking": TRACKING}
        return replace(free, function=self, inputs=inputs, parameters=more)


@block("controller", name="compensation", out="u", source=f"{PAPER}, section 2")
def _compensation(Fhat):
    """u = Fhat; with ``scale=`` u = scale Fhat."""
    return Fhat


@block("variant", name="compensation_scaled", out="u")
def _compensation_scaled(Fhat, scale=P(1.0, "1", 0)):
    """u = scale Fhat."""
    return scale * Fhat


@block("controller", name="feedforward", out="u", source=f"{PAPER}, eq. Canudas_u")
def _feedforward(a, J=J):
    """u = J a, a the reference's acceleration."""
    return J * a


@block("controller", name="prefilter", out="r", states="r", source=PAPER)
def _prefilter(r_cmd, r, pole=POLE):
    """dr/dt = pole (r_cmd - r)."""
    return lag(r_cmd, r, pole)


@block("variant", name="prefilter_dr", out="r dr", states="r")
def _prefilter_dr(r_cmd, r, pole=POLE):
    """dr/dt = pole (r_cmd - r); dr/dt is also an output."""
    dr = lag(r_cmd, r, pole)
    return dr, dr


@block("variant", name="prefilter_ddr", out="r ddr", states="r ddr")
def _prefilter_ddr(r_cmd, ddr_cmd, r, ddr, pole=POLE):
    """dr/dt = pole (r_cmd - r), and the reference's second derivative through the same filter."""
    return lag(r_cmd, r, pole), lag(ddr_cmd, ddr, pole)


@block("variant", name="prefilter_motion", out="r dr ddr", states="r")
def _prefilter_motion(r_cmd, dr_cmd, r, pole=POLE):
    """dr/dt = pole (r_cmd - r), and both derivatives of r from that of r_cmd."""
    dr = lag(r_cmd, r, pole)
    return dr, lag(dr_cmd, dr, pole), dr


def tracking_time(kp: float, ki: float, tracking: float | None, of: str) -> float:
    """The time of the back-calculation in s: the given one, else kp/ki, the integral time."""
    if tracking is not None:
        return tracking
    gains = number(kp, f"{of}: kp"), number(ki, f"{of}: ki")
    if gains[1] == 0.0:
        return np.inf
    if gains[0] / gains[1] <= 0.0:
        raise InputError(f"{of}: give tracking in s; its default kp/ki is not positive here.")
    return max(gains[0] / gains[1], TRACKING.low)


def _built(
    of: str, gains: dict[str, Any], limit: float | None, tracking: float | None, names: Names
) -> ct.NonlinearIOSystem:
    """A controller without a limit, with its own, or with one elsewhere in the loop."""
    free = {"pi": _pi, "pid": _pid}[of]
    if limit is None and tracking is None:
        return free.system(**names, **gains)
    time = tracking_time(gains["kp"], gains["ki"], tracking, of)
    made = _Held(free, own=limit is not None).block()
    own: dict[str, Any] = {} if limit is None else {"limit": limit}
    return made.system(**names, **gains, tracking=time, **own)


_PREFILTERS = {
    None: _prefilter,
    "velocity": _prefilter_dr,
    "position": _prefilter_ddr,
    "motion": _prefilter_motion,
}


def check_kind(kind: Any, known: Iterable[Any]) -> None:
    if kind not in known:
        raise InputError(f"unknown kind {kind!r}; known: {', '.join(map(str, known))}.")


@factory
def error(kind: str = "velocity", **names: Unpack[Names]):
    """The control error e = measured - reference, as in the source paper.

    Parameters
    ----------
    kind : "velocity" or "position"
        Inputs r, w or r, theta.

    Returns
    -------
    Without states; output e in rad/s or rad.

    Raises
    ------
    For another kind.

    Examples
    --------
    >>> e = lg.error("position")
    >>> e.input_labels
    ['r', 'theta']
    >>> float(e.output(0.0, [], [1.0, 1.25])[0])  # measured - reference
    0.25
    """
    check_kind(kind, MEASURED)
    return _error.system(**reading(names, "r", MEASURED[kind]))


@factory
def pi(
    kp: float = 1.6,
    ki: float = 0.16,
    *,
    limit: float | None = None,
    tracking: float | None = None,
    **names: Unpack[Names],
):
    """The controller u = (kp + ki/s)(-e): input e, output u.

    Parameters
    ----------
    kp, ki : float
        On a velocity error N m s/rad and N m/rad (the source paper's 1.6 and 0.16); on another
        error per its unit.
    limit : float, optional
        Largest output >= 0: u = clip(v, -limit, limit), where v is the output without limit.
    tracking : float, optional
        Time T in s of the back-calculation that keeps the integral from winding up at a limit:
        dq/dt = -e + (u - v)/(ki T). Default: kp/ki, the integral time; ``np.inf`` is a limit
        without anti-windup. Without ``limit`` the block has a second input ``excess``, u - v of
        a limit elsewhere in the loop (:func:`lugrectl.limiter`).

    Returns
    -------
    State q in rad on a velocity error.

    Raises
    ------
    For a negative limit, a tracking time that is not positive, or none where kp/ki is not.

    Notes
    -----
    State q, the integral of -e; without ``limit`` and ``tracking`` there is no anti-windup.
    With the default time and the output at its limit, ki q settles at the limit: the output
    leaves it when e changes sign. Back-calculation as in Astrom and Hagglund, Advanced PID
    Control, 2006.

    Examples
    --------
    >>> lg.pi(kp=1.6, ki=0.16).output(0.0, [0.0], [0.1])  # 0.1 rad/s too fast
    array([-0.16])

    With a torque limit of 0.5 N m and anti-windup:

    >>> lg.pi(kp=1.6, ki=0.16, limit=0.5).output(0.0, [0.0], [-1.0])
    array([0.5])
    """
    return _built("pi", {"kp": kp, "ki": ki}, limit, tracking, names)


@factory
def pid(
    kp: float = 15.0,
    ki: float = 1.55,
    kd: float = 0.0,
    tau: float | None = None,
    *,
    limit: float | None = None,
    tracking: float | None = None,
    **names: Unpack[Names],
):
    """The controller u = (kp + ki/(tau s + 1))(-e) - kd w: inputs e, w, output u.

    Parameters
    ----------
    kp, ki, kd : float
        On a position error N m/rad, N m/rad (pure integral: N m/(rad s)), N m s/rad.
    tau : float or None
        Time constant of the filtered integral action in s; None or 0 is pure integral action
        ki/s (not the limit tau -> 0, which is proportional).
    limit, tracking : float, optional
        As in :func:`pi`: the largest torque in N m, and the time of the back-calculation in s.

    Returns
    -------
    State q in rad s on a position error with pure integral action.

    Raises
    ------
    For a negative tau or limit, or a tracking time as in :func:`pi`.

    Notes
    -----
    The C(s) of the source paper, section 3.1, with D on the measured velocity.

    Examples
    --------
    0.01 rad short of the reference, at 0.2 rad/s:

    >>> pid = lg.pid(kp=15.0, ki=30.0, kd=0.3)
    >>> pid.input_labels
    ['e', 'w']
    >>> np.round(pid.output(0.0, [0.0], [-0.01, 0.2]), 6)
    array([0.09])
    """
    gains = {"kp": kp, "ki": ki, "kd": kd, "tau": 0.0 if tau is None else tau}
    return _built("pid", gains, limit, tracking, names)


@factory
def compensation(scale: float | None = None, **names: Unpack[Names]):
    """Friction compensation u = Fhat, or scale Fhat (source paper, section 2).

    Its u is added to that of the controller, because both have the same signal name.

    Parameters
    ----------
    scale : float, optional
        The share of the estimate that is compensated, >= 0; :func:`lugrectl.assure` says how much.
        Default: all, without a parameter ``scale``.

    Returns
    -------
    Without states; torques in N m.

    Raises
    ------
    When ``inputs`` or ``outputs`` are not one name each.

    Examples
    --------
    A velocity loop wired by hand, in which Fhat is added to the controller's torque:

    >>> p = lg.table1()
    >>> control = [lg.error(), lg.pi(1.6, 0.16), lg.natural_observer(p), lg.compensation()]
    >>> outputs = ["theta", "w", "F", "Fhat", "zhat", "u"]
    >>> loop = ct.interconnect([*control, lg.plant(p)], inputs=["r", "d"], outputs=outputs)
    >>> loop.nstates
    5
    """
    if scale is None:
        return _compensation.system(**names)
    return _compensation_scaled.system(**names, scale=scale)


@factory
def feedforward(p: Parameters | Model, kind: str = "velocity", **names: Unpack[Names]):
    """Feed-forward of the reference's acceleration, u = J dr or J ddr: input dr or ddr, output u.

    Parameters
    ----------
    p : Parameters or Model
        Gives J.
    kind : "velocity" or "position"
        In a velocity loop the input is dr, the derivative of r; in a position loop ddr, its
        second derivative.

    Returns
    -------
    Without states; output u in N m.

    Raises
    ------
    For another kind, or when J has no value.

    Notes
    -----
    Source paper, eq. Canudas_u.

    Examples
    --------
    The torque that accelerates the inertia at 100 rad/s2:

    >>> ff = lg.feedforward(lg.table1())
    >>> ff.output(0.0, [], [100.0])
    array([0.22])
    """
    check_kind(kind, DERIVATIVE)
    return _feedforward.system(**reading(names, DERIVATIVE[kind]), J=as_model(p, "p").J)


@factory
def prefilter(pole: float = 2.0, kind: str | None = None, **names: Unpack[Names]):
    """The reference filter pole/(s + pole): input r_cmd, output r.

    Parameters
    ----------
    pole : float
        In 1/s; 2/(s + 2) in the source paper.
    kind : None, "velocity", "position" or "motion"
        The derivatives that other blocks need. "velocity" adds the output dr, the exact
        derivative of the filtered r. "position" filters a second input ddr_cmd, the second
        derivative of r_cmd, in the same way to the output ddr: a first-order filter does not
        provide its second derivative. ddr starts at 0; the resulting error decays like
        exp(-pole t). "motion" adds the outputs dr and ddr, the exact derivatives of the filtered
        r, from a second input dr_cmd, the derivative of r_cmd.

    Returns
    -------
    State r, and ddr for "position", in the units of the outputs.

    Raises
    ------
    For another kind, or a pole that is not positive.

    Examples
    --------
    A smooth reference for a velocity loop, with its derivative for the feed-forward:

    >>> smooth = lg.prefilter(2.0, kind="velocity")
    >>> smooth.output_labels
    ['r', 'dr']
    >>> smooth.output(0.0, [0.0], [1.0])  # at a step of 1 rad/s
    array([0., 2.])
    """
    check_kind(kind, _PREFILTERS)
    return _PREFILTERS[kind].system(**names, pole=pole)


KV: Any = P(20.0, "1/s")
SPEED_LIMIT: Any = P(np.inf, "rad/s", 0.0, neutral=np.inf)
MOST = 10_000  # samples of delay


@built("controller", out="u excess")
def limiter(u_cmd, limit=LIMIT):
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
    W = 2.0 * np.pi * frequency
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

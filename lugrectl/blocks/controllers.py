"""Controllers, compensation, feed-forward and prefilter.

e is measured - reference, so a controller acts on -e. All outputs named ``u`` are added.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Unpack

import numpy as np

from ..core.errors import InputError
from ..core.validation import number
from .block import Block, P
from .declaration import block
from .factories import Names, factory, reading
from .friction import PAPER, J
from .model import Model, Parameters, as_model

if TYPE_CHECKING:
    import control as ct


KP, KI = P(1.6, "N m s/rad"), P(0.16, "N m/rad")
KP_ANGLE, KI_ANGLE = P(15.0, "N m/rad"), P(1.55, "N m/(rad s)")
KD, TAU = P(0.0, "N m s/rad"), P(0.0, "s", 0.0)
LIMIT = P(np.inf, "N m", 0.0, neutral=np.inf)
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
    own = {} if limit is None else {"limit": limit}
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

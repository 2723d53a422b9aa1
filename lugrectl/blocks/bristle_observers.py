"""Observers that correct a copy of the LuGre bristles by what the drive shows.

All need the velocity w, and the torque u that drives the plant or the tracking error. Where the
original's equations could not be confirmed, the law is derived here and the docstring says so.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from .block import P
from .declaration import block
from .friction import (
    FC,
    FS,
    FV,
    SIGMA0,
    SIGMA1,
    VS,
    J,
    bristle,
    bristle_torque,
    level,
    relaxation,
)
from .observers import observer
from .plant import acceleration

if TYPE_CHECKING:
    import control as ct

    from .model import Model, Parameters

DAMPED = P(0.6, "N m s/rad", 1e-12)  # sigma1 where the observer divides by it
DERIVED = "derived here, in the spirit of"
LISCHINSKY = (
    "Canudas de Wit and Lischinsky, Int. J. Adaptive Control and Signal Processing 11, 1997"
)
IWASAKI = "Ruderman and Iwasaki, IEEE Trans. Industrial Electronics, 2015"
FREIDOVICH = "Freidovich et al., IEEE Trans. Control Systems Technology, 2010"


@block(
    "observer",
    name="temperature_observer",
    out="Fhat zhat slip",
    states="zhat excess xi",
    source=f"{DERIVED} {LISCHINSKY}",
)
def _temperature(
    w,
    u,
    zhat,
    excess,
    xi,
    J: Any = J,
    sigma0=SIGMA0,
    sigma1: Any = DAMPED,
    Fc=FC,
    Fs: Any = FS,
    Fv=FV,
    vs=VS,
    k=P(0.0, "1/s", 0.0),
    gamma: Any = P(5.0, "1", 0.0),
):
    """Fhat = sigma0 zhat + sigma1 (w - slip a zhat) + Fv w, slip = 1 + excess, a = sigma0 |w|/h(w).

    zbar = (xi - J w)/sigma1, dxi/dt = u - Fv w - sigma0 zbar,
    dzhat/dt = w - slip a zhat + k (zbar - zhat),
    dexcess/dt = -gamma a zhat (zbar - zhat) sigma0^2/Fs^2.
    """
    slip = 1.0 + excess
    worn = relaxation(w, sigma0, level(w, Fc, Fs, vs)) * zhat
    own = w - slip * worn
    zbar = (xi - J * w) / sigma1
    miss = zbar - zhat
    Fhat = bristle_torque(w, zhat, own, sigma0, sigma1, Fv)
    adapt = -gamma * worn * miss * (sigma0 / Fs) ** 2
    return Fhat, slip, own + k * miss, adapt, u - Fv * w - sigma0 * zbar


@block(
    "observer",
    name="friction_state_observer",
    out="Fhat what",
    states="what f",
    source=f"{DERIVED} {IWASAKI}",
)
def _friction_state(
    w,
    u,
    what,
    f,
    J: Any = J,
    sigma0: Any = SIGMA0,
    Fc=FC,
    Fs=FS,
    Fv=FV,
    vs=VS,
    bandwidth: Any = P(500.0, "1/s", 0.0),
):
    """Fhat = f + Fv w, J dwhat/dt = u - Fhat + 2 J p (w - what), p = bandwidth,
    df/dt = sigma0 (w - |w| f/h(w)) - J p^2 (w - what).
    """
    Fhat = bristle_torque(w, f / sigma0, 0.0, sigma0, 0.0, Fv)
    push = J * bandwidth * (w - what)
    df = sigma0 * bristle(w, f / sigma0, sigma0, Fc, Fs, vs) - bandwidth * push
    return Fhat, acceleration(u + 2.0 * push, Fhat, 0.0, J), df


@block(
    "observer",
    name="normal_force_observer",
    out="Fhat zhat scale",
    states="zhat excess",
    source=f"{DERIVED} {LISCHINSKY}",
)
def _normal_force(
    w,
    e,
    zhat,
    excess,
    sigma0: Any = SIGMA0,
    sigma1=SIGMA1,
    Fc=FC,
    Fs=FS,
    Fv=FV,
    vs=VS,
    k=P(1.0, "1/s", 0.0),
    gamma: Any = P(2e3, "1/(N m s)", 0.0),
):
    """Fhat = sigma0 y + sigma1 dy/dt + Fv w, y = scale zhat, scale = 1 + excess,
    dzhat/dt = w - sigma0 |w| zhat/h(w) - k e, dexcess/dt = -gamma sigma0 zhat e.
    """
    scale = 1.0 + excess
    dz = bristle(w, zhat, sigma0, Fc, Fs, vs) - k * e
    adapt = -gamma * sigma0 * zhat * e
    dy = adapt * zhat + scale * dz
    return bristle_torque(w, scale * zhat, dy, sigma0, sigma1, Fv), scale, dz, adapt


@block(
    "observer",
    name="lyapunov_observer",
    out="Fhat zhat",
    states="zhat",
    source=f"{DERIVED} {FREIDOVICH}",
)
def _lyapunov(
    w,
    s,
    zhat,
    sigma0: Any = SIGMA0,
    sigma1: Any = SIGMA1,
    Fc: Any = FC,
    Fs: Any = FS,
    Fv=FV,
    vs=VS,
    k: Any = P(0.35, "1", 0.0),
):
    """Fhat = sigma0 zhat + sigma1 b + Fv w, b = w - sigma0 |w| zhat/h(w),
    dzhat/dt = b - k (1 - sigma1 |w|/h(w)) s.
    """
    a = relaxation(w, sigma0, level(w, Fc, Fs, vs))
    b = w - a * zhat
    return bristle_torque(w, zhat, b, sigma0, sigma1, Fv), b - k * (1.0 - sigma1 / sigma0 * a) * s


def temperature_observer(
    p: Parameters | Model,
    k: float = 0.0,
    gamma: float = 5.0,
    *,
    name: str = "temperature_observer",
    inputs: Sequence[str] | None = None,
    outputs: Sequence[str] | None = None,
) -> ct.NonlinearIOSystem:
    """LuGre with an unknown level h(w), as by temperature: inputs w, u, outputs Fhat, zhat, slip.

    Fhat = sigma0 zhat + sigma1 (w - slip a zhat) + Fv w, a = sigma0 |w|/h(w),
    dzhat/dt = w - slip a zhat + k m, dslip/dt = -gamma a zhat m sigma0^2/Fs^2, m = zbar - zhat,
    zbar = (xi - J w)/sigma1, dxi/dt = u - Fv w - sigma0 zbar.

    Parameters
    ----------
    p : Parameters or Model
        The parameters used by the observer; sigma1 must be positive. The level of the drive is
        h(w)/slip, and slip starts at 1 (state excess = slip - 1).
    k : float
        Gain in 1/s that pulls zhat towards zbar; above 0 it helps if sigma0 is wrong or a load
        acts.
    gamma : float
        Gain of the adaptation, without unit. While the drive slides, m relaxes within 1/a and
        slip follows at about gamma a.
    name, inputs, outputs : str, list of str
        Block name and, in order, other names for the signals.

    Returns
    -------
    control.NonlinearIOSystem
        States zhat in rad, excess without unit and xi in N m s.

    Raises
    ------
    InputError
        When J or a LuGre parameter has no value, sigma1 is not positive, or a gain is negative.

    Notes
    -----
    For a drive with dz/dt = w - theta a z, theta constant and unknown: Fc and Fs are divided by
    theta, sigma0 and sigma1 stay. (J w + sigma1 z) has the derivative u - Fv w - sigma0 z, so
    that zbar - z decays like exp(-sigma0 t/sigma1): zbar is a measurement of the deflection that
    uses no friction law. With ez = z - zhat and V = ez^2/2 + (Fs/sigma0)^2 (theta - slip)^2
    /(2 gamma), dV/dt = -(theta a + k) ez^2 once zbar = z. At rest a = 0 and slip keeps its value.

    Noise of w reaches zbar with the factor J/sigma1. A load torque counts as friction. A wrong
    sigma0 is the weak point: 30 % low with Fc and Fs 20 % low, the tracking error of the source
    paper's velocity loop is 18 mrad/s (7 with k = 50) instead of 0.6. Start xi at J w.

    Status: derived here, in the spirit of Canudas de Wit and Lischinsky (1997); the equations of
    the original could not be confirmed.

    Examples
    --------
    A drive whose friction falls as it warms up, in a velocity loop:

    >>> p = lg.table1()
    >>> loop = lg.velocity_loop(p, "temperature", gains={"gamma": 5.0, "k": 50.0})
    >>> [name for name in loop.state_labels if name.startswith("temperature")]
    ['temperature_observer_zhat', 'temperature_observer_excess', 'temperature_observer_xi']
    """
    return observer(
        "temperature_observer", p, name=name, inputs=inputs, outputs=outputs, k=k, gamma=gamma
    )


def friction_state_observer(
    p: Parameters | Model,
    bandwidth: float = 500.0,
    *,
    name: str = "friction_state_observer",
    inputs: Sequence[str] | None = None,
    outputs: Sequence[str] | None = None,
) -> ct.NonlinearIOSystem:
    """Friction as a state with presliding in its rate: inputs w, u, outputs Fhat, what.

    Fhat = f + Fv w, J dwhat/dt = u - Fhat + 2 J p (w - what),
    df/dt = sigma0 (w - |w| f/h(w)) - J p^2 (w - what), p = bandwidth.

    Parameters
    ----------
    p : Parameters or Model
        The parameters used by the observer; sigma1 is not needed.
    bandwidth : float
        Both error poles are at -bandwidth at rest, in 1/s.
    name, inputs, outputs : str, list of str
        Block name and, in order, other names for the signals.

    Returns
    -------
    control.NonlinearIOSystem
        States what in rad/s and f in N m.

    Raises
    ------
    InputError
        When J or a friction parameter has no value, or the bandwidth is negative.

    Notes
    -----
    It is the extended-state observer with a friction law in it: without the term of sigma0 the
    two are equal. For the error x = (J p (w - what), f_true - f) the rates are
    [[-2 p, -p], [p, -a]] x, a = sigma0 |w|/h(w), plus what enters by wrong parameters. With
    V = |x|^2/(2 J p^2), dV/dt = -2 p J (w - what)^2 - a (f_true - f)^2/(J p^2): exponential
    and uniform, also at rest, where a = 0 and both poles are at -p. At a constant speed the error
    of Fhat by a wrong level is F (a' - a)/(a' + p/2), a' with the believed level; the natural
    observer has F (a' - a)/a'. A wrong Fv leaves its share a'/(a' + p/2).

    sigma1 dz/dt is not in the law: it counts as an error for about sigma1/sigma0 at reversals.
    Noise of w is amplified by up to J p/2. A load torque counts as friction. Start what at w.

    Status: derived here, in the spirit of Ruderman and Iwasaki (2015); the equations of the
    original could not be confirmed.

    Examples
    --------
    At rest the observer forgets a wrong start with both poles at -300 1/s:

    >>> observer = lg.friction_state_observer(lg.table1(), bandwidth=300.0)
    >>> observer.input_labels, observer.output_labels
    (['w', 'u'], ['Fhat', 'what'])
    >>> poles = observer.linearize([0.0, 0.0], [0.0, 0.0]).poles()
    >>> round(float(poles.real.mean()))
    -300
    """
    return observer(
        "friction_state_observer",
        p,
        name=name,
        inputs=inputs,
        outputs=outputs,
        bandwidth=bandwidth,
    )


def normal_force_observer(
    p: Parameters | Model,
    k: float = 1.0,
    gamma: float = 2e3,
    *,
    name: str = "normal_force_observer",
    inputs: Sequence[str] | None = None,
    outputs: Sequence[str] | None = None,
) -> ct.NonlinearIOSystem:
    """LuGre scaled as by a normal force: inputs w, e, outputs Fhat, zhat, scale.

    Fhat = sigma0 y + sigma1 dy/dt + Fv w, y = scale zhat,
    dzhat/dt = w - sigma0 |w| zhat/h(w) - k e, dscale/dt = -gamma sigma0 zhat e.

    Parameters
    ----------
    p : Parameters or Model
        The parameters used by the observer; the scale starts at 1 (state excess = scale - 1).
    k, gamma : float
        Gains >= 0 on the tracking error e (measured - reference): on a position error in 1/s
        and 1/(N m s), on a velocity error without unit and in 1/(N m).
    name, inputs, outputs : str, list of str
        Block name and, in order, other names for the signals.

    Returns
    -------
    control.NonlinearIOSystem
        States zhat in rad and excess, without unit.

    Raises
    ------
    InputError
        When a LuGre parameter has no value, or a gain is negative.

    Notes
    -----
    For a drive with F = theta (sigma0 z + sigma1 dz/dt) + Fv w, theta constant and unknown, in a
    loop with Fhat and the feed-forward J ddr. dy/dt contains dscale/dt zhat, so that F - Fhat =
    (sigma1 d/dt + sigma0) q, q = theta ez + (theta - scale) zhat, ez = z - zhat. The error is
    e = -T(s) q, T = (sigma1 s + sigma0)/(J s^2 + C(s)). Where T is strictly positive real (see
    :func:`lugrectl.spr_check`), T = c'(s - A)^-1 B has a P with P B = c, and
    V = x'Px + theta ez^2/k + (theta - scale)^2/(gamma sigma0) has
    dV/dt = -x'Qx - 2 theta a ez^2/k, a = sigma0 |w|/h(w): e goes to 0 for every wrong scale. With
    only Fc and Fs wrong this proof does not hold; see :func:`lugrectl.temperature_observer`.

    Status: derived here, in the spirit of Canudas de Wit and Lischinsky (1997); the equations of
    the original could not be confirmed.

    Examples
    --------
    An observer that starts with twice the friction of its parameters:

    >>> observer = lg.normal_force_observer(lg.table1(), k=1.0, gamma=2000.0)
    >>> Fhat, zhat, scale = observer.output(0.0, [1e-3, 1.0], [0.0, 0.0])
    >>> round(float(Fhat), 3), float(scale)
    (0.52, 2.0)
    """
    return observer(
        "normal_force_observer", p, name=name, inputs=inputs, outputs=outputs, k=k, gamma=gamma
    )


def lyapunov_observer(
    p: Parameters | Model,
    k: float = 0.35,
    *,
    name: str = "lyapunov_observer",
    inputs: Sequence[str] | None = None,
    outputs: Sequence[str] | None = None,
) -> ct.NonlinearIOSystem:
    """The observer with a proof at every speed: inputs w, s, outputs Fhat, zhat.

    Fhat = sigma0 zhat + sigma1 b + Fv w, b = w - sigma0 |w| zhat/h(w),
    dzhat/dt = b - k (1 - sigma1 |w|/h(w)) s.

    Parameters
    ----------
    p : Parameters or Model
        The parameters used by the observer.
    k : float
        Gain >= 0 on s, without unit if s is a velocity.
    name, inputs, outputs : str, list of str
        Block name and, in order, other names for the signals.

    Returns
    -------
    control.NonlinearIOSystem
        State zhat in rad.

    Raises
    ------
    InputError
        When a LuGre parameter has no value, or k is negative.

    Notes
    -----
    s is dV0/dx g of a Lyapunov function V0 of the loop without friction, dx/dt = f(x) + g (Fhat -
    F), dV0/dt = -W: the velocity error in a velocity loop with PI and feed-forward (wire e to it,
    V0 = J e^2/2 + ki q^2/2), de + c e in a position loop with PD and feed-forward, and the output
    of :func:`lugrectl.sliding_error` beside a controller that acts on it. With
    V = V0 + sigma0 (z - zhat)^2/(2 k), dV/dt = -W - sigma0^2 |w| (z - zhat)^2/(h(w) k), without
    any condition. The existing observer with e = s has the same function with a condition,
    |w|/h(w) <= (4/sigma1)(1 + KD/(k sigma1)) where W = KD s^2. That is a limit of the proof, not
    of the loop: with wrong parameters its term -sigma1 k s in Fhat is additional damping, and it
    is the better choice.

    Status: derived here, in the spirit of Freidovich et al. (2010); the equations of the original
    could not be confirmed.

    Examples
    --------
    In a velocity loop with the reference's acceleration fed forward:

    >>> p = lg.table1()
    >>> loop = lg.velocity_loop(p, "lyapunov", k=0.35, feedforward=True)
    >>> loop.input_labels
    ['r', 'dr']
    """
    return observer("lyapunov_observer", p, name=name, inputs=inputs, outputs=outputs, k=k)

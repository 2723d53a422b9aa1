"""Friction observers: an estimate Fhat of the friction torque from what the drive shows.

The first ones are copies of the LuGre law with a correction of dzhat/dt; Fhat is the torque of the
law with the corrected dzhat/dt. Those that need the torque u that drives the plant,
J dw/dt = u - F, count a load torque as friction. The last ones need only the measured position
theta and u. Their parameters are independent of those of the plant. Where the original's
equations could not be confirmed, the law is derived here and the docstring says so.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from .block import Block, Group, P
from .declaration import block, block_named
from .factories import believed, built
from .friction import FV, LAW, LUGRE, PAPER, SMOOTH, Bristles, J, bristle_torque, coulomb
from .plant import acceleration

if TYPE_CHECKING:
    import control as ct

    from .model import Model, Parameters


Gain = float | Callable[[Any], Any]
# where the observer divides by sigma1, and where it does without
DAMPED: Any = Group(Bristles, **LAW | {"sigma1": P(0.6, "N m s/rad", 1e-12)})
UNDAMPED: Any = Group(Bristles, **{k: p for k, p in LAW.items() if k != "sigma1"})
DERIVED = "derived here, in the spirit of"
LISCHINSKY = (
    "Canudas de Wit and Lischinsky, Int. J. Adaptive Control and Signal Processing 11, 1997"
)
IWASAKI = "Ruderman and Iwasaki, IEEE Trans. Industrial Electronics, 2015"
FREIDOVICH = "Freidovich et al., IEEE Trans. Control Systems Technology, 2010"
TAFAZOLI = (
    "Tafazoli, de Silva and Lawrence, IEEE Trans. Control Systems Technology, 1998; proof in the "
    "docstring of lugrectl.position_coulomb_observer"
)
OLSSON = "Olsson and Astrom, IEEE Conf. Decision and Control, 1996"
estimating = partial(built, "observer")


@block("observer", out="Fhat")
def no_observer(w):
    """Fhat = 0: nothing is compensated."""
    return 0.0 * w


@estimating(out="Fhat zhat", states="zhat", source=f"{PAPER}, eq. z_hat_dot and F_est")
def natural_observer(w, zhat, law=LAW):
    """The LuGre law itself, run on the measured velocity: input w, outputs Fhat, zhat.

    Fhat = sigma0 zhat + sigma1 dzhat/dt + Fv w, dzhat/dt = w - sigma0 |w| zhat / h(w).

    Returns
    -------
    State zhat in rad.

    Notes
    -----
    Source paper, eq. z_hat_dot and F_est. An error of zhat decays only while the drive moves;
    at rest it is constant.

    Examples
    --------
    At a constant speed the estimate settles at the friction h(w) + Fv w:

    >>> p = lg.table1()
    >>> t = np.linspace(0.0, 0.2, 101)
    >>> run = lg.simulate(lg.natural_observer(p), t, {"w": 0.1}, method="LSODA")
    >>> round(float(run.outputs[0, -1]), 3), round(p.Fc + p.Fv * 0.1, 3)
    (0.287, 0.287)
    """
    dz = law.rate(w, zhat)
    return law.torque(w, zhat, dz), dz


@estimating(out="Fhat zhat", states="zhat", source=LUGRE)
def existing_observer(w, e, zhat, law=LAW, k=P(0.35, "1", 0.0)):
    """The observer of Canudas de Wit et al. 1995: inputs w, e, outputs Fhat, zhat.

    Fhat = sigma0 zhat + sigma1 dzhat/dt + Fv w, dzhat/dt = w - sigma0 |w| zhat / h(w) - k e.

    Parameters
    ----------
    k : float
        Gain >= 0 on the tracking error e (measured - reference): without unit on a velocity
        error, in 1/s on a position error.

    Returns
    -------
    State zhat in rad.

    Notes
    -----
    Source paper, eq. Canudas_z. Its stability proof needs the feed-forward J ddr and a strictly
    positive real (sigma1 s + sigma0) / (J s^2 + C(s)); see :func:`lugrectl.spr_check`.

    Examples
    --------
    In the velocity loop, with the gain of the source paper:

    >>> p = lg.table1()
    >>> loop = lg.velocity_loop(p, "existing", k=0.35)
    >>> loop.output_labels
    ['theta', 'w', 'F', 'Fhat', 'u', 'e']

    Whether its proof holds beside a PD position controller:

    >>> bool(lg.spr_check(lg.position_T(p, kp=15.0, kd=1.2)))
    True
    """
    dz = law.rate(w, zhat) - k * e
    return law.torque(w, zhat, dz), dz


def _gain(K: Any, w: Any) -> Any:
    return K(w) if callable(K) else K


@estimating(out="Fhat zhat what", states="zhat what", source=f"{PAPER}, eq. obs_1 and obs_2")
def proposed_observer(w, u, zhat, what, J=J, law=LAW, K1=P(-10.24, "1"), K2=P(22.0, "N m s/rad")):
    """The source paper's observer: inputs w, u, outputs Fhat, zhat, what.

    Fhat = sigma0 zhat + sigma1 dzhat/dt + Fv w, J dwhat/dt = u - Fhat + K2 (w - what).

    dzhat/dt = w - sigma0 |w| zhat / h(w) + K1 (w - what).

    Parameters
    ----------
    K1 : float or callable
        Gain < 0 without unit, or a function of w that uses NumPy functions only; with the
        opposite sign the estimate is unstable near rest, and a warning says so.
    K2 : float or callable
        Gain in N m s/rad, or a function of w.

    Returns
    -------
    States zhat in rad and what in rad/s.

    Notes
    -----
    Source paper, eq. obs_1 and obs_2; Fhat contains the K1 term. u is the torque that drives
    the plant; the observer does not model a load torque. Its fastest pole is near
    -(K2 - sigma1 K1)/J, -12 790 1/s with the paper's gains: use a stiff solver.

    Examples
    --------
    With gains from a design rule, and the poles of its error at rest:

    >>> p = lg.table1()
    >>> design = lg.design_gains(p)
    >>> observer = lg.proposed_observer(p, **design.gains)
    >>> poles = observer.linearize([0.0, 0.0], [0.0, 0.0]).poles()
    >>> bool((poles.real < 0).all())
    True
    """
    miss = w - what
    dz = law.rate(w, zhat) + _gain(K1, w) * miss
    Fhat = law.torque(w, zhat, dz)
    return Fhat, dz, acceleration(u + _gain(K2, w) * miss, Fhat, 0.0, J)


@estimating(
    out="Fhat ahat",
    states="zeta",
    source="Friedland and Park, IEEE Trans. Automatic Control 37(10), 1992",
)
def friedland_park_observer(
    w,
    u,
    zeta,
    J=J,
    Fv=FV,
    k: Any = P(0.1, "N m (s/rad)^mu", 0.0),
    mu: Any = P(1.5, "1", 1.0, 10.0),
    eps=SMOOTH,
):
    """The Coulomb friction observer of Friedland and Park: inputs w, u, outputs Fhat, ahat.

    Fhat = ahat sign(w) + Fv w, ahat = zeta - k |w|^mu.

    dzeta/dt = k mu |w|^(mu - 1) sign(w) (u - Fhat) / J.

    Parameters
    ----------
    p : Parameters or Model
        Gives J and Fv, the known viscous friction (0 in the original paper).
    k : float
        Gain >= 0 in N m (s/rad)^mu.
    mu : float
        Exponent, 1 to 10, without unit.

    Returns
    -------
    State zeta in N m.

    Notes
    -----
    On a drive with F = a sign(w) + Fv w and no load, differentiation of ahat gives
    d(a - ahat)/dt = -k mu |w|^(mu - 1) (a - ahat) / J: the error decays while the drive moves
    (for mu > 1 faster at higher speed) and is constant at rest. |w| is computed as
    sqrt(w^2 + eps^2); sign(w) as tanh(w/eps) in Fhat, as in the ``coulomb`` law, and as d|w|/dw
    in dzeta/dt; eps is a parameter of the block, 1e-4 rad/s. On a drive with bristles Fhat jumps
    at a reversal, while friction does not: the compensation is too large for a moment.

    References
    ----------
    Friedland and Park, IEEE Trans. Automatic Control 37(10), 1992.

    Examples
    --------
    While the drive moves at w, ahat settles at the rate k mu |w|^(mu - 1)/J:

    >>> p = lg.table1()
    >>> observer = lg.friedland_park_observer(p, k=0.1, mu=1.5)
    >>> w, u = 0.5, p.Fc + p.Fv * 0.5
    >>> pole = observer.linearize([0.0], [w, u]).poles()[0]
    >>> round(float(pole.real)), round(-0.1 * 1.5 * w**0.5 / p.J)  # 1/s
    (-48, -48)
    """
    speed = np.sqrt(w * w + eps * eps)  # |w| without a kink, so that powers of it are smooth
    ahat = zeta - k * speed**mu
    (Fhat,) = coulomb(w, Fc=ahat, Fv=Fv, eps=eps)
    slope = k * mu * speed ** (mu - 2.0) * w
    return Fhat, ahat, slope * acceleration(u, Fhat, 0.0, J)


@estimating(
    out="Fhat ahat",
    states="zeta",
    source="derived here, in the spirit of Odabas, thesis, 2014: see the docstring of "
    "lugrectl.general_coulomb_observer",
)
def general_coulomb_observer(
    w,
    u,
    zeta,
    J=J,
    Fv=FV,
    k: Any = P(0.11, "N m s/rad", 0.0),
    w0: Any = P(0.1, "rad/s", 1e-12),
    eps=SMOOTH,
):
    """Friedland-Park with an adaptation that saturates: inputs w, u, outputs Fhat, ahat.

    Fhat = ahat sign(w) + Fv w, ahat = zeta - G, G = k (sqrt(w^2 + w0^2) - w0),
    dzeta/dt = (dG/dw) (u - Fhat) / J.

    Parameters
    ----------
    k : float
        Gain >= 0 in N m s/rad; the error decays at most at k/J, where |w| is well above w0.
    w0 : float
        Speed in rad/s below which it adapts more slowly.

    Returns
    -------
    State zeta in N m.

    Notes
    -----
    For any adaptation function G the error e = a - ahat on a drive with F = a sign(w) + Fv w has
    de/dt = -(G'(|w|)/J) e. So |e| never grows exactly if G' >= 0; it goes to 0 along a motion
    exactly if the integral of G' over time is infinite; it does so exponentially for every motion
    with |w| between two positive bounds exactly if G' > 0; and the rate is continuous at w = 0
    exactly if G'(0) = 0. ``friedland_park_observer`` is G = k |w|^mu. The G here is smooth, its
    rate is bounded, so that Euler steps of T are stable at every speed if T k < 2 J, and with
    G'(0) = 0 it does not adapt at rest. sign(w) is tanh(w/eps), eps = 1e-4 rad/s.

    Status: derived here, in the spirit of the generalised observer of Odabas (thesis, 2014),
    which could not be confirmed.

    Examples
    --------
    Well above w0 the estimate settles at k/J, here 50 1/s:

    >>> p = lg.table1()
    >>> observer = lg.general_coulomb_observer(p, k=50 * p.J, w0=0.1)
    >>> pole = observer.linearize([0.0], [5.0, 0.4]).poles()[0]
    >>> round(float(pole.real))
    -50
    """
    speed = np.sqrt(w * w + w0 * w0)
    ahat = zeta - k * (speed - w0)
    (Fhat,) = coulomb(w, Fc=ahat, Fv=Fv, eps=eps)
    return Fhat, ahat, k * w / speed * acceleration(u, Fhat, 0.0, J)


@estimating(out="Fhat", states="v", source="standard form (Ohnishi), derived by substitution")
def disturbance_observer(w, u, v, J=J, tau=P(0.01, "s", 1e-12)):
    """The disturbance observer Fhat = (u - J dw/dt) / (tau s + 1): inputs w, u, output Fhat.

    Fhat = J (v - w) / tau, dv/dt = (u - Fhat) / J.

    Parameters
    ----------
    tau : float
        Time constant in s.

    Returns
    -------
    State v in rad/s.

    Notes
    -----
    Uses no friction law: with the right J, tau dFhat/dt = D - Fhat, where D is the sum of all
    resisting torques, load included. Noise of w is amplified by J/tau. Start the state
    v = w + tau Fhat/J at w; started at 0 it gives Fhat = -J w/tau. Standard form (Ohnishi),
    derived by substitution.

    Examples
    --------
    A torque of 0.3 N m that does not move the drive is all friction, after a few tau:

    >>> observer = lg.disturbance_observer(lg.table1(), tau=0.005)
    >>> t = np.linspace(0.0, 0.05, 101)
    >>> run = lg.simulate(observer, t, {"u": 0.3, "w": 0.0}, method="LSODA")
    >>> Fhat = run.outputs.ravel()
    >>> round(float(Fhat[-1]), 3)
    0.3
    """
    Fhat = J * (v - w) / tau
    return Fhat, acceleration(u, Fhat, 0.0, J)


@estimating(
    out="Fhat what",
    states="what Fhat",
    source="Gao's bandwidth parametrisation, derived by substitution",
)
def extended_state_observer(w, u, what, Fhat, J=J, bandwidth: Any = P(100.0, "1/s", 0.0)):
    """The linear extended-state observer: inputs w, u, outputs Fhat, what.

    dFhat/dt = -J p^2 (w - what), dwhat/dt = (u - Fhat) / J + 2 p (w - what), p = bandwidth.

    Parameters
    ----------
    bandwidth : float
        Both error poles are at -bandwidth, in 1/s.

    Returns
    -------
    States what in rad/s and Fhat in N m.

    Notes
    -----
    Uses no friction law: with the right J, Fhat = D / (s/p + 1)^2, where D is the sum of all
    resisting torques, load included; exact for constant D. Noise of w is amplified by up to
    J p/2. Start the state what at w. Gao's bandwidth parametrisation written in w; derived by
    substitution.

    Examples
    --------
    Both poles of the estimate are at -bandwidth:

    >>> observer = lg.extended_state_observer(lg.table1(), bandwidth=200.0)
    >>> poles = observer.linearize([0.0, 0.0], [0.0, 0.0]).poles()
    >>> round(float(poles.real.mean()))
    -200
    """
    push = J * bandwidth * (w - what)
    return acceleration(u + 2.0 * push, Fhat, 0.0, J), -bandwidth * push


@estimating(
    out="Fhat zhat what scale",
    states="zhat what excess",
    source="derived here: see the docstring of lugrectl.adaptive_observer",
)
def adaptive_observer(
    w,
    u,
    zhat,
    what,
    excess,
    J=J,
    law=LAW,
    K2=P(1.0, "N m s/rad", 0.0),
    gamma: Any = P(10.0, "1/s", 0.0),
):
    """LuGre with an unknown constant scale: inputs w, u, outputs Fhat, zhat, what, scale.

    Fhat = scale phi + Fv w, phi = sigma0 zhat + sigma1 dzhat/dt, scale = 1 + excess.

    dzhat/dt = w - sigma0 |w| zhat / h(w), J dwhat/dt = u - Fhat + K2 (w - what),
    dexcess/dt = -gamma K2 phi (w - what) / Fs^2.

    Parameters
    ----------
    p : Parameters or Model
        The parameters used by the observer; the scale starts at 1 (state excess = scale - 1).
    K2 : float
        Gain in N m s/rad; the speed estimate has the rate K2/J.
    gamma : float
        Rate in 1/s at which the scale settles when friction is at the level Fs, for gamma well
        below K2/J.

    Returns
    -------
    States zhat in rad, what in rad/s and excess, without unit.

    Notes
    -----
    For a drive with F = theta (sigma0 z + sigma1 dz/dt) + Fv w, theta constant and unknown
    (sigma0, sigma1, Fc, Fs all scaled, as by a normal force), no load. With e = w - what and
    q = theta - scale, and once zhat = z, J de/dt = -q phi - K2 e and dq/dt = gamma K2 phi e/Fs^2,
    so that V = J e^2/2 + q^2 Fs^2/(2 gamma K2) has dV/dt = -K2 e^2: bounded, e -> 0, and q -> 0
    if phi is persistently exciting (sliding at a constant speed is enough).
    An error of zhat decays independently like exp(-integral of sigma0 |w|/h) and adds
    -theta (sigma0 - sigma1 sigma0 |w|/h)(z - zhat) to J de/dt: if |w| is bounded and
    persistently exciting, this term is square integrable, V stays bounded and the limits are the
    same. At rest the scale continues to adapt to the torque that balances u. If only Fc and Fs
    change, the estimate is right in sliding, and too stiff or too soft before it. Derived here;
    this is not the law of Canudas de Wit and Lischinsky (1997), which adapts by the tracking
    error.

    Examples
    --------
    The speed estimate settles at the rate K2/J, here 500 1/s:

    >>> p = lg.table1()
    >>> observer = lg.adaptive_observer(p, K2=500 * p.J, gamma=10.0)
    >>> observer.output_labels
    ['Fhat', 'zhat', 'what', 'scale']
    """
    dz = law.rate(w, zhat)
    phi = bristle_torque(w, zhat, dz, law.sigma0, law.sigma1, 0.0)
    scale = 1.0 + excess
    Fhat = law.torque(w, scale * zhat, scale * dz)
    push = K2 * (w - what)
    return Fhat, scale, dz, acceleration(u + push, Fhat, 0.0, J), -gamma * phi * push / law.Fs**2


@estimating(out="Fhat zhat slip", states="zhat excess xi", source=f"{DERIVED} {LISCHINSKY}")
def temperature_observer(
    w, u, zhat, excess, xi, J=J, law=DAMPED, k=P(0.0, "1/s", 0.0), gamma: Any = P(5.0, "1", 0.0)
):
    """LuGre with an unknown level h(w), as by temperature: inputs w, u, outputs Fhat, zhat, slip.

    Fhat = sigma0 zhat + sigma1 (w - slip a zhat) + Fv w, slip = 1 + excess, a = sigma0 |w|/h(w).

    zbar = (xi - J w)/sigma1, dxi/dt = u - Fv w - sigma0 zbar,
    dzhat/dt = w - slip a zhat + k (zbar - zhat),
    dexcess/dt = -gamma a zhat (zbar - zhat) sigma0^2/Fs^2.

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

    Returns
    -------
    States zhat in rad, excess without unit and xi in N m s.

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
    slip = 1.0 + excess
    worn = law.relaxation(w) * zhat
    own = w - slip * worn
    zbar = (xi - J * w) / law.sigma1
    miss = zbar - zhat
    Fhat = law.torque(w, zhat, own)
    adapt = -gamma * worn * miss * (law.sigma0 / law.Fs) ** 2
    return Fhat, slip, own + k * miss, adapt, u - law.Fv * w - law.sigma0 * zbar


@estimating(out="Fhat what", states="what f", source=f"{DERIVED} {IWASAKI}")
def friction_state_observer(
    w, u, what, f, J=J, law=UNDAMPED, bandwidth: Any = P(500.0, "1/s", 0.0)
):
    """Friction as a state with presliding in its rate: inputs w, u, outputs Fhat, what.

    Fhat = f + Fv w, J dwhat/dt = u - Fhat + 2 J p (w - what), p = bandwidth,
    df/dt = sigma0 (w - |w| f/h(w)) - J p^2 (w - what).

    Parameters
    ----------
    p : Parameters or Model
        The parameters used by the observer; sigma1 is not needed.
    bandwidth : float
        Both error poles are at -bandwidth at rest, in 1/s.

    Returns
    -------
    States what in rad/s and f in N m.

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
    Fhat = bristle_torque(w, f / law.sigma0, 0.0, law.sigma0, 0.0, law.Fv)
    push = J * bandwidth * (w - what)
    df = law.sigma0 * law.rate(w, f / law.sigma0) - bandwidth * push
    return Fhat, acceleration(u + 2.0 * push, Fhat, 0.0, J), df


@estimating(out="Fhat zhat scale", states="zhat excess", source=f"{DERIVED} {LISCHINSKY}")
def normal_force_observer(
    w, e, zhat, excess, law=LAW, k=P(1.0, "1/s", 0.0), gamma: Any = P(2e3, "1/(N m s)", 0.0)
):
    """LuGre scaled as by a normal force: inputs w, e, outputs Fhat, zhat, scale.

    Fhat = sigma0 y + sigma1 dy/dt + Fv w, y = scale zhat, scale = 1 + excess,
    dzhat/dt = w - sigma0 |w| zhat/h(w) - k e, dexcess/dt = -gamma sigma0 zhat e.

    Parameters
    ----------
    p : Parameters or Model
        The parameters used by the observer; the scale starts at 1 (state excess = scale - 1).
    k, gamma : float
        Gains >= 0 on the tracking error e (measured - reference): on a position error in 1/s
        and 1/(N m s), on a velocity error without unit and in 1/(N m).

    Returns
    -------
    States zhat in rad and excess, without unit.

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
    scale = 1.0 + excess
    dz = law.rate(w, zhat) - k * e
    adapt = -gamma * law.sigma0 * zhat * e
    dy = adapt * zhat + scale * dz
    return law.torque(w, scale * zhat, dy), scale, dz, adapt


@estimating(out="Fhat zhat", states="zhat", source=f"{DERIVED} {FREIDOVICH}")
def lyapunov_observer(w, s, zhat, law=LAW, k: Any = P(0.35, "1", 0.0)):
    """The observer with a proof at every speed: inputs w, s, outputs Fhat, zhat.

    Fhat = sigma0 zhat + sigma1 b + Fv w, b = w - sigma0 |w| zhat/h(w),
    dzhat/dt = b - k (1 - sigma1 |w|/h(w)) s.

    Parameters
    ----------
    k : float
        Gain >= 0 on s, without unit if s is a velocity.

    Returns
    -------
    State zhat in rad.

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
    a = law.relaxation(w)
    b = w - a * zhat
    return law.torque(w, zhat, b), b - k * (1.0 - law.sigma1 / law.sigma0 * a) * s


@estimating(
    out="Fhat ahat what", states="that zeta", start="theta 0", source=f"{DERIVED} {TAFAZOLI}"
)
def position_coulomb_observer(
    theta,
    u,
    that,
    zeta,
    J=J,
    Fv=FV,
    k: Any = P(0.11, "N m s/rad", 0.0),
    L: Any = P(400.0, "1/s", 1e-12),
    eps=SMOOTH,
):
    """Coulomb friction and velocity from the position: inputs theta, u, outputs Fhat, ahat, what.

    Fhat = ahat sign(what) + Fv what, what = L (theta - that), ahat = zeta - k |what|,
    dthat/dt = what - (u - Fhat)/(J L), dzeta/dt = k sign(what) (u - Fhat)/J.

    Parameters
    ----------
    k : float
        Gain >= 0 in N m s/rad.
    L : float
        Rate in 1/s at which what follows the velocity.

    Returns
    -------
    States that in rad and zeta in N m.

    Notes
    -----
    The Friedland-Park observer with exponent 1 on its own estimate of the velocity. sign(x) is
    x/sqrt(x^2 + eps^2) and |x| is sqrt(x^2 + eps^2), one the derivative of the other, so that
    dahat/dt = -k L sign(what) (w - what). On a drive with F = a sign(w) + Fv w and no load,
    V = J (w - what)^2/2 + (a - ahat)^2/(2 k L) has
    dV/dt = -(J L + Fv) (w - what)^2 - a (w - what)(sign(w) - sign(what)) <= 0, because the sign
    increases: through reversals and at rest too. While the drive slides the errors have the poles
    of x^2 + (L + Fv/J) x + k L/J = 0: for a rate r of ahat choose k = J r and L >= 4 r.

    With a controller weaker than stiction the drive never moves and nothing is learnt. At rest
    ahat follows the torque that balances u; a load counts as friction. Noise of theta is
    amplified by L in what and by k L in ahat. Start that at theta(0). The rates are not affine in
    the states, so there is no exact sampled form: :func:`lugrectl.sampled` runs it in substeps,
    within 1 % of Fc at 1 kHz.

    Status: derived here, in the spirit of Tafazoli, de Silva and Lawrence (1998), whose equations
    could not be confirmed; at least the smooth sign, the viscous part and the proof are
    additions.

    Examples
    --------
    For a drive with an encoder only, ahat settles at the rate r = 50 1/s where k = J r:

    >>> p = lg.table1()
    >>> observer = lg.position_coulomb_observer(p, k=50 * p.J, L=400.0)
    >>> observer.input_labels, observer.output_labels
    (['theta', 'u'], ['Fhat', 'ahat', 'what'])
    """
    what = L * (theta - that)
    size = np.sqrt(what * what + eps * eps)  # |what|; its slope is the sign
    side, ahat = what / size, zeta - k * size
    Fhat = ahat * side + Fv * what
    push = acceleration(u, Fhat, 0.0, J)
    return Fhat, ahat, what, what - push / L, k * side * push


@estimating(
    out="Fhat zhat what", states="that what zhat", start="theta 0 0", source=f"{DERIVED} {OLSSON}"
)
def position_lugre_observer(
    theta,
    u,
    that,
    what,
    zhat,
    J=J,
    law=LAW,
    l1: Any = P(900.0, "1/s", 0.0),
    l2: Any = P(2e5, "1/s2", 0.0),
    l3: Any = P(-100.0, "1/s"),
):
    """The whole drive copied and corrected by the position: inputs theta, u.

    Fhat = sigma0 zhat + sigma1 b + Fv what, b = what - sigma0 |what| zhat/h(what),
    m = theta - that, dthat/dt = what + l1 m, dwhat/dt = (u - Fhat)/J + l2 m,
    dzhat/dt = b + l3 m.

    Parameters
    ----------
    l1, l2, l3 : float
        In 1/s, 1/s2, 1/s. (2719.1, 2.118e6, -5742.4) puts three poles at -1000 1/s at rest for
        Table 1.

    Returns
    -------
    States that in rad, what in rad/s and zhat in rad.

    Notes
    -----
    The errors of that, what and zhat follow [[-l1, 1, 0], [-l2, -(sigma1 b + Fv)/J,
    -(sigma0 - sigma1 a)/J], [-l3, b, -a]] with a = sigma0 |what|/h(what) and
    b = 1 - z (a(w) - a(what))/(w - what), between -0.26 and 2.26 for Table 1: affine in each, so
    that the four corners decide. With three poles at -1000 1/s all corners are stable, and one
    quadratic function decays at 445, 414, 338 1/s for speeds up to 0.1, 0.5, 1 rad/s. In steady
    sliding z = h/sigma0 and b = w h'(w)/h(w), negative where friction falls with speed. There the
    default gains are just stable (-3 1/s near vs); three poles at -500 1/s, closer to
    sqrt(sigma0/J) = 344 1/s, are not (+90 1/s near vs).

    l2 amplifies noise of theta. Start that at theta(0). With friction overestimated by half a
    position loop with integral action still comes to rest, where the natural observer causes a
    limit cycle.

    Status: derived here, in the spirit of the observer-based compensation of Olsson and Astrom
    (1996), whose equations could not be confirmed.

    Examples
    --------
    Gains for three poles at -1000 1/s at rest:

    >>> p = lg.table1()
    >>> design = lg.design_gains(p, observer="position_lugre", pole=1000.0)
    >>> observer = lg.position_lugre_observer(p, **design.gains)
    >>> poles = observer.linearize([0.0, 0.0, 0.0], [0.0, 0.0]).poles()
    >>> round(float(poles.real.mean()), -1)
    -1000.0
    """
    m, b = theta - that, law.rate(what, zhat)
    Fhat = law.torque(what, zhat, b)
    return Fhat, what + l1 * m, acceleration(u, Fhat, 0.0, J) + l2 * m, b + l3 * m


def observer_block(name: str) -> Block:
    """The registered observer of a name; ``_observer`` at its end may be left out."""
    return block_named("observer", name)


def observer(kind: str, p: Parameters | Model, **given: Any) -> ct.NonlinearIOSystem:
    """Build any registered observer, with J and the friction parameters of p."""
    return believed(observer_block(kind), p, **given)

"""Observers for comparison: Friedland-Park, disturbance, extended state, adaptive LuGre.

All need the torque u that drives the plant, J dw/dt = u - F; a load torque counts as friction.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from .block import P
from .declaration import block
from .friction import FC, FS, FV, SIGMA0, SIGMA1, SMOOTH, VS, J, bristle, bristle_torque, coulomb
from .observers import observer
from .plant import acceleration

if TYPE_CHECKING:
    import control as ct

    from .model import Model, Parameters


@block(
    "observer",
    name="friedland_park_observer",
    out="Fhat ahat",
    states="zeta",
    source="Friedland and Park, IEEE Trans. Automatic Control 37(10), 1992",
)
def _friedland_park(
    w,
    u,
    zeta,
    J=J,
    Fv=FV,
    k: Any = P(0.1, "N m (s/rad)^mu", 0.0),
    mu: Any = P(1.5, "1", 1.0, 10.0),
    eps: Any = SMOOTH,
):
    """Fhat = ahat sign(w) + Fv w, ahat = zeta - k |w|^mu.

    dzeta/dt = k mu |w|^(mu - 1) sign(w) (u - Fhat) / J.
    """
    speed = np.sqrt(w * w + eps * eps)  # |w| without a kink, so that powers of it are smooth
    ahat = zeta - k * speed**mu
    (Fhat,) = coulomb(w, Fc=ahat, Fv=Fv, eps=eps)
    slope = k * mu * speed ** (mu - 2.0) * w
    return Fhat, ahat, slope * acceleration(u, Fhat, 0.0, J)


@block(
    "observer",
    name="general_coulomb_observer",
    out="Fhat ahat",
    states="zeta",
    source="derived here, in the spirit of Odabas, thesis, 2014: see the docstring of "
    "lugrectl.general_coulomb_observer",
)
def _general_coulomb(
    w,
    u,
    zeta,
    J=J,
    Fv=FV,
    k: Any = P(0.11, "N m s/rad", 0.0),
    w0: Any = P(0.1, "rad/s", 1e-12),
    eps: Any = SMOOTH,
):
    """Fhat = ahat sign(w) + Fv w, ahat = zeta - G, G = k (sqrt(w^2 + w0^2) - w0),
    dzeta/dt = (dG/dw) (u - Fhat) / J.
    """
    speed = np.sqrt(w * w + w0 * w0)
    ahat = zeta - k * (speed - w0)
    (Fhat,) = coulomb(w, Fc=ahat, Fv=Fv, eps=eps)
    return Fhat, ahat, k * w / speed * acceleration(u, Fhat, 0.0, J)


@block(
    "observer",
    name="disturbance_observer",
    out="Fhat",
    states="v",
    source="standard form (Ohnishi), derived by substitution",
)
def _disturbance(w, u, v, J: Any = J, tau=P(0.01, "s", 1e-12)):
    """Fhat = J (v - w) / tau, dv/dt = (u - Fhat) / J."""
    Fhat = J * (v - w) / tau
    return Fhat, acceleration(u, Fhat, 0.0, J)


@block(
    "observer",
    name="extended_state_observer",
    out="Fhat what",
    states="what Fhat",
    source="Gao's bandwidth parametrisation, derived by substitution",
)
def _extended_state(w, u, what, Fhat, J: Any = J, bandwidth: Any = P(100.0, "1/s", 0.0)):
    """dFhat/dt = -J p^2 (w - what), dwhat/dt = (u - Fhat) / J + 2 p (w - what), p = bandwidth."""
    push = J * bandwidth * (w - what)
    return acceleration(u + 2.0 * push, Fhat, 0.0, J), -bandwidth * push


@block(
    "observer",
    name="adaptive_observer",
    out="Fhat zhat what scale",
    states="zhat what excess",
    source="derived here: see the docstring of lugrectl.adaptive_observer",
)
def _adaptive(
    w,
    u,
    zhat,
    what,
    excess,
    J=J,
    sigma0=SIGMA0,
    sigma1=SIGMA1,
    Fc=FC,
    Fs: Any = FS,
    Fv=FV,
    vs=VS,
    K2=P(1.0, "N m s/rad", 0.0),
    gamma: Any = P(10.0, "1/s", 0.0),
):
    """Fhat = scale phi + Fv w, phi = sigma0 zhat + sigma1 dzhat/dt, scale = 1 + excess.

    dzhat/dt = w - sigma0 |w| zhat / h(w), J dwhat/dt = u - Fhat + K2 (w - what),
    dexcess/dt = -gamma K2 phi (w - what) / Fs^2.
    """
    dz = bristle(w, zhat, sigma0, Fc, Fs, vs)
    phi = bristle_torque(w, zhat, dz, sigma0, sigma1, 0.0)
    scale = 1.0 + excess
    Fhat = bristle_torque(w, scale * zhat, scale * dz, sigma0, sigma1, Fv)
    push = K2 * (w - what)
    return Fhat, scale, dz, acceleration(u + push, Fhat, 0.0, J), -gamma * phi * push / Fs**2


def friedland_park_observer(
    p: Parameters | Model,
    k: float = 0.1,
    mu: float = 1.5,
    *,
    name: str = "friedland_park_observer",
    inputs: Sequence[str] | None = None,
    outputs: Sequence[str] | None = None,
) -> ct.NonlinearIOSystem:
    """The Coulomb friction observer of Friedland and Park: inputs w, u, outputs Fhat, ahat.

    ahat = zeta - k |w|^mu, dzeta/dt = k mu |w|^(mu - 1) sign(w) (u - Fhat) / J,
    Fhat = ahat sign(w) + Fv w.

    Parameters
    ----------
    p : Parameters or Model
        Gives J and Fv, the known viscous friction (0 in the original paper).
    k : float
        Gain >= 0 in N m (s/rad)^mu.
    mu : float
        Exponent, 1 to 10, without unit.
    name, inputs, outputs : str, list of str
        Block name and, in order, other names for the signals.

    Returns
    -------
    control.NonlinearIOSystem
        State zeta in N m.

    Raises
    ------
    InputError
        When J or Fv has no value, or a gain is out of bounds.

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
    return observer(
        "friedland_park_observer", p, name=name, inputs=inputs, outputs=outputs, k=k, mu=mu
    )


def general_coulomb_observer(
    p: Parameters | Model,
    k: float = 0.11,
    w0: float = 0.1,
    *,
    name: str = "general_coulomb_observer",
    inputs: Sequence[str] | None = None,
    outputs: Sequence[str] | None = None,
) -> ct.NonlinearIOSystem:
    """Friedland-Park with an adaptation that saturates: inputs w, u, outputs Fhat, ahat.

    ahat = zeta - G(|w|), G = k (sqrt(w^2 + w0^2) - w0), dzeta/dt = (dG/dw) (u - Fhat) / J,
    Fhat = ahat sign(w) + Fv w.

    Parameters
    ----------
    p : Parameters or Model
        Gives J and Fv.
    k : float
        Gain >= 0 in N m s/rad; the error decays at most at k/J, where |w| is well above w0.
    w0 : float
        Speed in rad/s below which it adapts more slowly.
    name, inputs, outputs : str, list of str
        Block name and, in order, other names for the signals.

    Returns
    -------
    control.NonlinearIOSystem
        State zeta in N m.

    Raises
    ------
    InputError
        When J or Fv has no value, or a gain is out of bounds.

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
    return observer(
        "general_coulomb_observer", p, name=name, inputs=inputs, outputs=outputs, k=k, w0=w0
    )


def disturbance_observer(
    p: Parameters | Model,
    tau: float = 0.01,
    *,
    name: str = "disturbance_observer",
    inputs: Sequence[str] | None = None,
    outputs: Sequence[str] | None = None,
) -> ct.NonlinearIOSystem:
    """The disturbance observer Fhat = (u - J dw/dt) / (tau s + 1): inputs w, u, output Fhat.

    Without a derivative: Fhat = J (v - w) / tau, dv/dt = (u - Fhat) / J.

    Parameters
    ----------
    p : Parameters or Model
        Gives J.
    tau : float
        Time constant in s.
    name, inputs, outputs : str, list of str
        Block name and, in order, other names for the signals.

    Returns
    -------
    control.NonlinearIOSystem
        State v in rad/s.

    Raises
    ------
    InputError
        When J has no value or tau is not positive.

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
    return observer("disturbance_observer", p, name=name, inputs=inputs, outputs=outputs, tau=tau)


def extended_state_observer(
    p: Parameters | Model,
    bandwidth: float = 100.0,
    *,
    name: str = "extended_state_observer",
    inputs: Sequence[str] | None = None,
    outputs: Sequence[str] | None = None,
) -> ct.NonlinearIOSystem:
    """The linear extended-state observer: inputs w, u, outputs Fhat, what.

    dwhat/dt = (u - Fhat) / J + 2 p (w - what), dFhat/dt = -J p^2 (w - what), p = bandwidth.

    Parameters
    ----------
    p : Parameters or Model
        Gives J.
    bandwidth : float
        Both error poles are at -bandwidth, in 1/s.
    name, inputs, outputs : str, list of str
        Block name and, in order, other names for the signals.

    Returns
    -------
    control.NonlinearIOSystem
        States what in rad/s and Fhat in N m.

    Raises
    ------
    InputError
        When J has no value or the bandwidth is negative.

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
    return observer(
        "extended_state_observer",
        p,
        name=name,
        inputs=inputs,
        outputs=outputs,
        bandwidth=bandwidth,
    )


def adaptive_observer(
    p: Parameters | Model,
    K2: float = 1.0,
    gamma: float = 10.0,
    *,
    name: str = "adaptive_observer",
    inputs: Sequence[str] | None = None,
    outputs: Sequence[str] | None = None,
) -> ct.NonlinearIOSystem:
    """LuGre with an unknown constant scale: inputs w, u, outputs Fhat, zhat, what, scale.

    Fhat = scale phi + Fv w, phi = sigma0 zhat + sigma1 dzhat/dt,
    dzhat/dt = w - sigma0 |w| zhat / h(w), J dwhat/dt = u - Fhat + K2 (w - what),
    dscale/dt = -gamma K2 phi (w - what) / Fs^2.

    Parameters
    ----------
    p : Parameters or Model
        The parameters used by the observer; the scale starts at 1 (state excess = scale - 1).
    K2 : float
        Gain in N m s/rad; the speed estimate has the rate K2/J.
    gamma : float
        Rate in 1/s at which the scale settles when friction is at the level Fs, for gamma well
        below K2/J.
    name, inputs, outputs : str, list of str
        Block name and, in order, other names for the signals.

    Returns
    -------
    control.NonlinearIOSystem
        States zhat in rad, what in rad/s and excess, without unit.

    Raises
    ------
    InputError
        When J or a LuGre parameter has no value, or a gain is negative.

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
    return observer(
        "adaptive_observer", p, name=name, inputs=inputs, outputs=outputs, K2=K2, gamma=gamma
    )

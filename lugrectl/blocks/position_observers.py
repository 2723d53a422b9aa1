"""Observers that need only the measured position theta and the torque u.

Where the original's equations could not be confirmed, the law is derived here and the docstring
says so.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from .block import P
from .bristle_observers import DERIVED
from .declaration import block
from .friction import FC, FS, FV, SIGMA0, SIGMA1, SMOOTH, VS, J, bristle, bristle_torque
from .observers import observer
from .plant import acceleration

if TYPE_CHECKING:
    import control as ct

    from .model import Model, Parameters

TAFAZOLI = (
    "Tafazoli, de Silva and Lawrence, IEEE Trans. Control Systems Technology, 1998; proof in the "
    "docstring of lugrectl.position_coulomb_observer"
)
OLSSON = "Olsson and Astrom, IEEE Conf. Decision and Control, 1996"


@block(
    "observer",
    name="position_coulomb_observer",
    out="Fhat ahat what",
    states="that zeta",
    start="theta 0",
    source=f"{DERIVED} {TAFAZOLI}",
)
def _position_coulomb(
    theta,
    u,
    that,
    zeta,
    J: Any = J,
    Fv=FV,
    k: Any = P(0.11, "N m s/rad", 0.0),
    L: Any = P(400.0, "1/s", 1e-12),
    eps: Any = SMOOTH,
):
    """Fhat = ahat sign(what) + Fv what, what = L (theta - that), ahat = zeta - k |what|,
    dthat/dt = what - (u - Fhat)/(J L), dzeta/dt = k sign(what) (u - Fhat)/J.
    """
    what = L * (theta - that)
    size = np.sqrt(what * what + eps * eps)  # |what|; its slope is the sign
    side, ahat = what / size, zeta - k * size
    Fhat = ahat * side + Fv * what
    push = acceleration(u, Fhat, 0.0, J)
    return Fhat, ahat, what, what - push / L, k * side * push


@block(
    "observer",
    name="position_lugre_observer",
    out="Fhat zhat what",
    states="that what zhat",
    start="theta 0 0",
    source=f"{DERIVED} {OLSSON}",
)
def _position_lugre(
    theta,
    u,
    that,
    what,
    zhat,
    J: Any = J,
    sigma0=SIGMA0,
    sigma1=SIGMA1,
    Fc=FC,
    Fs=FS,
    Fv=FV,
    vs=VS,
    l1: Any = P(900.0, "1/s", 0.0),
    l2: Any = P(2e5, "1/s2", 0.0),
    l3: Any = P(-100.0, "1/s"),
):
    """Fhat = sigma0 zhat + sigma1 b + Fv what, b = what - sigma0 |what| zhat/h(what),
    m = theta - that, dthat/dt = what + l1 m, dwhat/dt = (u - Fhat)/J + l2 m,
    dzhat/dt = b + l3 m.
    """
    m, b = theta - that, bristle(what, zhat, sigma0, Fc, Fs, vs)
    Fhat = bristle_torque(what, zhat, b, sigma0, sigma1, Fv)
    return Fhat, what + l1 * m, acceleration(u, Fhat, 0.0, J) + l2 * m, b + l3 * m


def position_coulomb_observer(
    p: Parameters | Model,
    k: float = 0.11,
    L: float = 400.0,
    *,
    name: str = "position_coulomb_observer",
    inputs: Sequence[str] | None = None,
    outputs: Sequence[str] | None = None,
) -> ct.NonlinearIOSystem:
    """Coulomb friction and velocity from the position: inputs theta, u, outputs Fhat, ahat, what.

    what = L (theta - that), ahat = zeta - k |what|, Fhat = ahat sign(what) + Fv what,
    dthat/dt = what - (u - Fhat)/(J L), dzeta/dt = k sign(what) (u - Fhat)/J.

    Parameters
    ----------
    p : Parameters or Model
        Gives J and Fv.
    k : float
        Gain >= 0 in N m s/rad.
    L : float
        Rate in 1/s at which what follows the velocity.
    name, inputs, outputs : str, list of str
        Block name and, in order, other names for the signals.

    Returns
    -------
    control.NonlinearIOSystem
        States that in rad and zeta in N m.

    Raises
    ------
    InputError
        When J or Fv has no value, or a gain is out of bounds.

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
    return observer(
        "position_coulomb_observer", p, name=name, inputs=inputs, outputs=outputs, k=k, L=L
    )


def position_lugre_observer(
    p: Parameters | Model,
    l1: float = 900.0,
    l2: float = 2e5,
    l3: float = -100.0,
    *,
    name: str = "position_lugre_observer",
    inputs: Sequence[str] | None = None,
    outputs: Sequence[str] | None = None,
) -> ct.NonlinearIOSystem:
    """The whole drive copied and corrected by the position: inputs theta, u.

    Outputs Fhat, zhat, what. m = theta - that, dthat/dt = what + l1 m,
    dwhat/dt = (u - Fhat)/J + l2 m, dzhat/dt = b + l3 m, b = what - sigma0 |what| zhat/h(what),
    Fhat = sigma0 zhat + sigma1 b + Fv what.

    Parameters
    ----------
    p : Parameters or Model
        The parameters used by the observer.
    l1, l2, l3 : float
        In 1/s, 1/s2, 1/s. (2719.1, 2.118e6, -5742.4) puts three poles at -1000 1/s at rest for
        Table 1.
    name, inputs, outputs : str, list of str
        Block name and, in order, other names for the signals.

    Returns
    -------
    control.NonlinearIOSystem
        States that in rad, what in rad/s and zhat in rad.

    Raises
    ------
    InputError
        When J or a LuGre parameter has no value, or l1 or l2 is negative.

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
    gains = {"l1": l1, "l2": l2, "l3": l3}
    return observer(
        "position_lugre_observer", p, name=name, inputs=inputs, outputs=outputs, **gains
    )

"""Velocity control of a drive whose torque acts late, J dw/dt = u(t - h) - F.

A predictor is a model of the drive without the delay, driven by u. It knows the friction h ahead;
the measured velocity only corrects it: ws = wp + (w - wp(t - h)).

With a LuGre law, or any other that a plant may have, the predictor is a second plant::

    lg.plant(believed, name="predictor", inputs=["u", "none"], outputs=["theta_p", "wp", "Fp"])
    lg.smith_velocity()                       # w, wp, wp_late -> ws
    lg.error(inputs=["r", "ws"]), lg.pi(1.6, 0.0), lg.compensation(inputs=["Fp"])

and wp_late is wp through a dead time of h. With Coulomb friction that is not known,
``friedland_park_observer(p, inputs=["w", "u_late"])`` finds ahat from the torque that acts, and
:func:`coulomb_predictor` and :func:`coulomb_compensation` use it. Friction along a known
reference needs neither: ``natural_observer(p, inputs=["r"])``, or another law,
``friction("two_state", inputs=["r"], outputs=["Fhat"])``, beside a feed-forward.
"""

from __future__ import annotations

from .factories import built
from .friction import FV, SMOOTH, J, coulomb
from .observers import DERIVED
from .plant import acceleration

MORGUL = "Odabas and Morgul, 2014 (Friedland-Park with a time delay)"
RUDERMAN = "Ruderman, IEEE Trans. Industrial Electronics, 2014"


@built("controller", out="ws", source=f"{DERIVED} {RUDERMAN}")
def smith_velocity(w, wp, wp_late):
    """The predicted velocity with the measured error of the prediction: inputs w, wp, wp_late.

    ws = wp + (w - wp_late).

    wp_late is wp delayed by the dead time of the drive.

    Returns
    -------
    Without states; output ws in rad/s.

    Notes
    -----
    Without the correction the model moves while the drive sticks. With exact parameters and equal
    states w(t + h) = wp(t), and the loop is that without delay, h later. A wrong friction level
    is not found by it: Fc and Fs 20 % low or high cost most of the gain.

    Status: derived here, in the spirit of the feed-forward friction observer of Ruderman (2014);
    the equations of the original could not be confirmed.

    Examples
    --------
    >>> smith = lg.smith_velocity()
    >>> smith.input_labels
    ['w', 'wp', 'wp_late']
    >>> np.round(smith.output(0.0, [], [0.9, 1.2, 1.0]), 3)
    array([1.1])
    """
    return wp + (w - wp_late)


@built("controller", out="wp", states="wp", source=f"{DERIVED} {MORGUL}")
def coulomb_predictor(u, ahat, wp, J=J, Fv=FV, eps=SMOOTH):
    """A drive with the Coulomb friction that an observer has found: inputs u, ahat, output wp.

    J dwp/dt = u - ahat sign(wp) - Fv wp, sign(wp) = tanh(wp/eps).

    Returns
    -------
    State wp in rad/s.

    Notes
    -----
    On a drive with F = a sign(w) + Fv w the error e = w(t + h) - wp(t) has J e de/dt <=
    -Fv e^2 + |a - ahat| |e|, because the sign increases: it converges for every delay once ahat
    does. The law of ahat contains no delay if its u is the torque that acts. On bristles this
    holds only where friction does not fall with speed. A gain k of the observer of 0.02 is better
    than 0.1 here. Start the controller stronger than stiction, because ahat starts at 0.

    Status: derived here, in the spirit of Odabas and Morgul (2014), whose equations could not be
    confirmed; only the velocity loop, and a predictor that contains friction.

    Examples
    --------
    A loop with a dead time of 5 ms sees the predicted speed without it:

    >>> p = lg.table1()
    >>> model = lg.coulomb_predictor(p)
    >>> late = lg.dead_time(5e-3, name="late", inputs=["wp"], outputs=["wp_late"])
    >>> model.output_labels, late.input_labels
    (['wp'], ['wp'])
    """
    (F,) = coulomb(wp, Fc=ahat, Fv=Fv, eps=eps)
    return acceleration(u, F, 0.0, J)


@built("controller", out="u", source=f"{DERIVED} {MORGUL}")
def coulomb_compensation(ws, ahat, Fv=FV, eps=SMOOTH):
    """The friction at the predicted velocity: inputs ws, ahat, output u.

    u = ahat sign(ws) + Fv ws, sign(ws) = tanh(ws/eps).

    Returns
    -------
    Without states; output u in N m.

    Examples
    --------
    >>> block = lg.coulomb_compensation(lg.table1())
    >>> block.input_labels
    ['ws', 'ahat']
    >>> np.round(block.output(0.0, [], [1.0, 0.3]), 3)  # 0.3 N m of Coulomb friction, at 1 rad/s
    array([0.318])
    """
    (F,) = coulomb(ws, Fc=ahat, Fv=Fv, eps=eps)
    return F

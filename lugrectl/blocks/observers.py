"""Friction observers: an estimate Fhat of the friction torque from the measured velocity.

All are copies of the LuGre law with a correction of dzhat/dt; Fhat is the torque of the law with
the corrected dzhat/dt. Their parameters are independent of those of the plant.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from ..core.errors import InputError
from ..core.validation import real, shown
from .aliases import meant, name_of
from .block import Block, P, members
from .declaration import block
from .friction import (
    FC,
    FS,
    FV,
    LUGRE,
    PAPER,
    SIGMA0,
    SIGMA1,
    VS,
    J,
    bristle,
    bristle_torque,
    lugre,
)
from .model import Model, Parameters, as_model
from .plant import acceleration

if TYPE_CHECKING:
    import control as ct


Gain = float | Callable[[Any], Any]


@block("observer", out="Fhat")
def no_observer(w):
    """Fhat = 0: nothing is compensated."""
    return 0.0 * w


@block(
    "observer",
    name="natural_observer",
    out="Fhat zhat",
    states="zhat",
    source=f"{PAPER}, eq. z_hat_dot and F_est",
)
def _natural(w, zhat, sigma0=SIGMA0, sigma1=SIGMA1, Fc=FC, Fs=FS, Fv=FV, vs=VS):
    """Fhat = sigma0 zhat + sigma1 dzhat/dt + Fv w, dzhat/dt = w - sigma0 |w| zhat / h(w)."""
    dz = bristle(w, zhat, sigma0, Fc, Fs, vs)
    return bristle_torque(w, zhat, dz, sigma0, sigma1, Fv), dz


@block("observer", name="existing_observer", out="Fhat zhat", states="zhat", source=LUGRE)
def _existing(
    w, e, zhat, sigma0=SIGMA0, sigma1=SIGMA1, Fc=FC, Fs=FS, Fv=FV, vs=VS, k=P(0.35, "1", 0.0)
):
    """Fhat = sigma0 zhat + sigma1 dzhat/dt + Fv w, dzhat/dt = w - sigma0 |w| zhat / h(w) - k e."""
    dz = bristle(w, zhat, sigma0, Fc, Fs, vs) - k * e
    return bristle_torque(w, zhat, dz, sigma0, sigma1, Fv), dz


@block(
    "observer",
    name="proposed_observer",
    out="Fhat zhat what",
    states="zhat what",
    source=f"{PAPER}, eq. obs_1 and obs_2",
)
def _proposed(
    w,
    u,
    zhat,
    what,
    J=J,
    sigma0=SIGMA0,
    sigma1=SIGMA1,
    Fc=FC,
    Fs=FS,
    Fv=FV,
    vs=VS,
    K1=P(-10.24, "1"),
    K2=P(22.0, "N m s/rad"),
):
    """Fhat = sigma0 zhat + sigma1 dzhat/dt + Fv w, J dwhat/dt = u - Fhat + K2 (w - what).

    dzhat/dt = w - sigma0 |w| zhat / h(w) + K1 (w - what).
    """
    miss = w - what
    dz = bristle(w, zhat, sigma0, Fc, Fs, vs) + _gain(K1, w) * miss
    Fhat = bristle_torque(w, zhat, dz, sigma0, sigma1, Fv)
    return Fhat, dz, acceleration(u + _gain(K2, w) * miss, Fhat, 0.0, J)


def _gain(K: Any, w: Any) -> Any:
    return K(w) if callable(K) else K


def observer_block(name: str) -> Block:
    """The registered observer of a name; ``_observer`` at its end may be left out.

    Raises
    ------
    InputError
        When there is no observer of that name.
    """
    known, name = members("observer"), name_of("observer", name)
    for key in (name, f"{name}_observer") if isinstance(name, str) else ():
        if key in known:
            return known[key]
    short = [key.removesuffix("_observer") for key in known if key != "no_observer"]
    hint = meant(str(name).removesuffix("_observer"), short)
    hint = hint if hint.endswith("?") else f"{hint[:-1]}, and None for no observer."
    raise InputError(f"unknown observer {shown(name)}; {hint}")


def observer(
    kind: str,
    p: Parameters | Model,
    *,
    name: str | None = None,
    inputs: Sequence[str] | None = None,
    outputs: Sequence[str] | None = None,
    **gains: Any,
) -> ct.NonlinearIOSystem:
    """Any registered observer as a block, with J and the friction parameters of p.

    ``gains`` are the observer's other parameters; those left out keep their defaults.

    Raises
    ------
    InputError
        For an unknown observer or gain, or when p does not give a LuGre parameter that it needs.
    """
    made = observer_block(kind)
    return believed(made, p, name=name, inputs=inputs, outputs=outputs, **gains)


def believed(
    made: Block,
    p: Parameters | Model,
    *,
    name: str | None = None,
    inputs: Sequence[str] | None = None,
    outputs: Sequence[str] | None = None,
    **gains: Any,
) -> ct.NonlinearIOSystem:
    """An observer or controller with those of J and the LuGre parameters that it has, from p.

    Raises
    ------
    InputError
        For an unknown gain, or when p does not give a parameter that the block needs.
    """
    model = as_model(p, "p")
    have = model.values()
    needed = [k for k in ("J", *lugre.parameters) if k in made.parameters and k not in gains]
    missing = [k for k in needed if have.get(k) is None]
    if missing:
        raise InputError(
            f"{made.name} needs {', '.join(missing)}, which {model.name} does not give; "
            "give it the parameters of a LuGre model."
        )
    values = {k: have[k] for k in needed} | gains
    _warn_of_sign(made, values)
    return made.system(name=name, inputs=inputs, outputs=outputs, **values)


def _warn_of_sign(made: Block, values: Mapping[str, Any]) -> None:
    """Near rest the proposed observer's poles have the product -K1 sigma0/J: K1 > 0 is a saddle."""
    K1 = values.get("K1") if made is _proposed else None
    at_rest = real(K1(0.0) if callable(K1) else K1)
    if at_rest is not None and at_rest > 0.0:
        warnings.warn(
            f"{made.name}: K1 = {at_rest:g} makes the estimate unstable near rest; K1 must be "
            "negative (-10.24 in the source paper).",
            RuntimeWarning,
            stacklevel=4,
        )


def natural_observer(
    p: Parameters | Model,
    *,
    name: str = "natural_observer",
    inputs: Sequence[str] | None = None,
    outputs: Sequence[str] | None = None,
) -> ct.NonlinearIOSystem:
    """The LuGre law itself, run on the measured velocity: input w, outputs Fhat, zhat.

    Fhat = sigma0 zhat + sigma1 dzhat/dt + Fv w, dzhat/dt = w - sigma0 |w| zhat / h(w).

    Parameters
    ----------
    p : Parameters or Model
        The parameters used by the observer; keyed ``natural_observer.Fc`` ...
    name, inputs, outputs : str, list of str
        Block name and, in order, other names for the signals.

    Returns
    -------
    control.NonlinearIOSystem
        State zhat in rad.

    Raises
    ------
    InputError
        When a LuGre parameter has no value.

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
    return observer("natural_observer", p, name=name, inputs=inputs, outputs=outputs)


def existing_observer(
    p: Parameters | Model,
    k: float = 0.35,
    *,
    name: str = "existing_observer",
    inputs: Sequence[str] | None = None,
    outputs: Sequence[str] | None = None,
) -> ct.NonlinearIOSystem:
    """The observer of Canudas de Wit et al. 1995: inputs w, e, outputs Fhat, zhat.

    dzhat/dt = w - sigma0 |w| zhat / h(w) - k e, Fhat as in the natural observer.

    Parameters
    ----------
    p : Parameters or Model
        The parameters used by the observer.
    k : float
        Gain >= 0 on the tracking error e (measured - reference): without unit on a velocity
        error, in 1/s on a position error.
    name, inputs, outputs : str, list of str
        Block name and, in order, other names for the signals.

    Returns
    -------
    control.NonlinearIOSystem
        State zhat in rad.

    Raises
    ------
    InputError
        When a LuGre parameter has no value or k is negative.

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
    return observer("existing_observer", p, name=name, inputs=inputs, outputs=outputs, k=k)


def proposed_observer(
    p: Parameters | Model,
    K1: Gain = -10.24,
    K2: Gain = 22.0,
    *,
    name: str = "proposed_observer",
    inputs: Sequence[str] | None = None,
    outputs: Sequence[str] | None = None,
) -> ct.NonlinearIOSystem:
    """The source paper's observer: inputs w, u, outputs Fhat, zhat, what.

    dzhat/dt = w - sigma0 |w| zhat / h(w) + K1 (w - what),
    J dwhat/dt = u - Fhat + K2 (w - what), Fhat = sigma0 zhat + sigma1 dzhat/dt + Fv w.

    Parameters
    ----------
    p : Parameters or Model
        The parameters used by the observer.
    K1 : float or callable
        Gain < 0 without unit, or a function of w that uses NumPy functions only; with the
        opposite sign the estimate is unstable near rest, and a warning says so.
    K2 : float or callable
        Gain in N m s/rad, or a function of w.
    name, inputs, outputs : str, list of str
        Block name and, in order, other names for the signals.

    Returns
    -------
    control.NonlinearIOSystem
        States zhat in rad and what in rad/s.

    Raises
    ------
    InputError
        When J or a LuGre parameter has no value.

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
    return observer("proposed_observer", p, name=name, inputs=inputs, outputs=outputs, K1=K1, K2=K2)

"""Ready-made loops: blocks connected by their signal names alone."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from ..blocks import controllers
from ..blocks.observers import Gain
from ..blocks.plant import plant
from ..core.errors import InputError
from ..core.validation import flag, positive
from .parts import OUTPUTS, OWN, Controller, Limit, both, connected, loop_observer, models

if TYPE_CHECKING:
    import control as ct

    from ..blocks.model import Model, Parameters


def velocity_loop(
    p: Parameters | Model,
    observer: str | None = None,
    *,
    kp: float = 1.6,
    ki: float = 0.16,
    K1: Gain | str | None = OWN,
    K2: Gain | str | None = OWN,
    k: float | str | None = OWN,
    gains: Mapping[str, Any] | None = None,
    observer_parameters: Parameters | Model | None = None,
    prefilter: bool | float = False,
    feedforward: bool = False,
    load: bool = False,
    limit: float | None = None,
    tracking: float | None = None,
    controller: str | None = None,
    controller_gains: Mapping[str, Any] | None = None,
    name: str = "velocity_loop",
    **more: Any,
) -> ct.InterconnectedSystem:
    """PI velocity control with friction compensation, u = (kp + ki/s)(r - w) + Fhat.

    Parameters
    ----------
    p : Parameters or Model
        The plant; friction and effects of a whole model act inside it.
    observer : str or None
        "natural", "existing", "proposed", "temperature", "disturbance", or the name of any
        registered observer (``lugrectl.observers()``) whose inputs are among theta, w, u, e, r,
        s. None: Fhat = 0.
    kp, ki : float
        N m s/rad, N m/rad.
    K1, K2, k : float, optional
        Gains of the proposed (K1, K2: numbers or functions of w; -10.24, 22) and existing (k;
        0.35) observer, or of another that has them; the observer's own default where left out.
    gains : dict, optional
        Any other parameters of the observer by name, ``gains={"tau": 0.005}``.
    observer_parameters : Parameters or Model, optional
        The parameters used by the observer; default: those of the plant.
    prefilter : bool or float
        Filter the input r by pole/(s + pole); True is the source paper's 2/(s + 2).
    feedforward : bool
        Add u = J dr with the plant's J. dr, the derivative of r in rad/s2, becomes an input;
        with a prefilter it is the exact derivative of the filtered reference, not an input.
    load : bool
        Add the input d, a load torque in N m that opposes positive w.
    limit : float, optional
        Largest torque of the drive in N m. It acts on the sum of controller, compensation and
        feed-forward; u is the limited torque, which the observer sees too.
    tracking : float, optional
        Time of the back-calculation in s that keeps the integral from winding up at the limit;
        default kp/ki, ``np.inf`` for none. See :func:`lugrectl.pi`.
    controller : str, optional
        Another controller instead of the PI: "slotine_li", "adaptive_slotine_li",
        "dual_observer_control", "repetitive_control", "backstepping_smc", or any registered one
        (``lugrectl.controllers()``) with an output u. It uses the observer's parameters, acts on
        s = w - r, and contains J dr: dr becomes an input as with ``feedforward``, which is then
        refused. An observer that is corrected by e then takes s.
    controller_gains : dict, optional
        Parameters of that controller by name.
    name : str
        Name of the loop.
    **more : float
        Other parameters of the observer by name, in place of ``gains``: ``bandwidth=300``, or
        ``**design_gains(p, observer=...).gains``.

    Returns
    -------
    control.InterconnectedSystem
        Inputs r [, dr] [, d]; outputs theta, w, F, Fhat, u, e. With a prefilter e refers to the
        filtered reference. Parameters of a block are set at simulation time by its key,
        ``params={"plant.Fc": 0.3}``, and change no other block; blocks: plant,
        *observer*_observer, pi, feedforward, prefilter, limiter.

    Raises
    ------
    InputError
        For an unknown observer or controller, a gain that it does not have, or a parameter that
        is missing or out of bounds.

    Notes
    -----
    Source paper, fig. sys (a). Stiff: with python-control, simulate with
    ``solve_ivp_method="LSODA"`` and an atol of 1e-8 or less, because z is about 1e-3. SciPy's
    BDF and Radau can stop with an error: no rate depends on theta, so the finite difference step
    that they use for theta grows until it overflows.

    Examples
    --------
    The RMS error in mrad/s on a sine of 0.1 rad/s, with an observer that believes in 20 % less
    friction than there is:

    >>> p = lg.table1()
    >>> less = lg.Model.of(p, Fc=0.8 * p.Fc, Fs=0.8 * p.Fs)
    >>> loop = lg.velocity_loop(p, "proposed", observer_parameters=less)
    >>> t = np.linspace(0.0, 1.0, 501)
    >>> run = lg.simulate(loop, t, 0.1 * np.sin(2 * np.pi * t))
    >>> e = run.outputs[loop.output_labels.index("e")]
    >>> round(1e3 * float(np.sqrt(np.mean(e**2))))
    12
    """
    own, most = {"kp": kp, "ki": ki}, Limit(limit, tracking)
    drives = models(p, observer_parameters, observer)
    act = Controller("velocity", own, observer, controller, controller_gains, most)
    compensating = {"K1": K1, "K2": K2, "k": k}, both(observer, gains, more)
    front = Reference(prefilter, feedforward, load)
    return _closed(drives, act, observer, compensating, front, name)


def position_loop(
    p: Parameters | Model,
    observer: str | None = None,
    *,
    kp: float = 15.0,
    ki: float = 1.55,
    kd: float = 0.0,
    tau: float | None = None,
    K1: Gain | str | None = OWN,
    K2: Gain | str | None = OWN,
    k: float | str | None = OWN,
    gains: Mapping[str, Any] | None = None,
    observer_parameters: Parameters | Model | None = None,
    prefilter: bool | float = False,
    feedforward: bool = False,
    load: bool = False,
    limit: float | None = None,
    tracking: float | None = None,
    controller: str | None = None,
    controller_gains: Mapping[str, Any] | None = None,
    name: str = "position_loop",
    **more: Any,
) -> ct.InterconnectedSystem:
    """PID position control with friction compensation.

    u = (kp + ki/(tau s + 1))(r - theta) - kd w + Fhat; tau None or 0: pure integral action.

    Parameters
    ----------
    p, observer, K1, K2, k, gains, observer_parameters, prefilter, load, limit, tracking, name
        As in :func:`velocity_loop`; e is the position error, k is in 1/s. tau belongs to the
        controller: give that of the disturbance observer in ``gains``.
    kp, ki, kd, tau : float
        N m/rad, N m/rad (pure integral: N m/(rad s)), N m s/rad, s.
    feedforward : bool
        Add u = J ddr with the plant's J. ddr, the second derivative of r in rad/s2, becomes an
        input, also with a prefilter; the prefilter then filters it as well.
    controller, controller_gains
        As in :func:`velocity_loop`, with s = (w - dr) + lam (theta - r), lam (1/s, 20) among the
        gains: dr and ddr become inputs; with a prefilter r and dr, the derivatives of the
        filtered reference are exact. An observer that takes s needs dr too.
    **more : float
        Other parameters of the observer by name, in place of ``gains``.

    Returns
    -------
    control.InterconnectedSystem
        Inputs r [, dr] [, ddr] [, d]; outputs theta, w, F, Fhat, u, e. The controller's block
        is ``pid``, or has the controller's name.

    Raises
    ------
    InputError
        For an unknown observer or controller, or a parameter that is missing or out of bounds.

    Notes
    -----
    Source paper, fig. sys (b). Its gains, the defaults, make the compensated loop unstable:
    J s^3 + kp s + ki has no s^2 term, and the growth has a time constant of 19 s. kd > 0 with
    kd kp > J ki makes it stable.

    Examples
    --------
    A PID controller with a limit of 2 N m, and compensation by an observer:

    >>> loop = lg.position_loop(lg.table1(), "proposed", kp=15.0, ki=30.0, kd=0.3, limit=2.0)
    >>> loop.input_labels, loop.output_labels
    (['r'], ['theta', 'w', 'F', 'Fhat', 'u', 'e'])
    >>> loop.state_labels[-1]
    'pid_q'
    """
    own, most = {"kp": kp, "ki": ki, "kd": kd, "tau": tau}, Limit(limit, tracking)
    drives = models(p, observer_parameters, observer)
    act = Controller("position", own, observer, controller, controller_gains, most)
    compensating = {"K1": K1, "K2": K2, "k": k}, both(observer, gains, more)
    front = Reference(prefilter, feedforward, load)
    return _closed(drives, act, observer, compensating, front, name)


@dataclass(frozen=True)
class Reference:
    """What stands in front of a loop, and whether it has the input d."""

    prefilter: bool | float
    feedforward: bool
    load: bool

    def blocks(self, p: Model, act: Controller) -> tuple[list[str], list[Any], dict[str, str]]:
        """Return the loop's reference inputs, the blocks from them to the error and the
        feed-forward, and what the loop calls the reference and its derivatives."""
        measured, derivative = controllers.MEASURED[act.kind], controllers.DERIVATIVE[act.kind]
        if flag(self.feedforward, "feedforward") and derivative in act.needs:
            raise InputError("feedforward=True: this controller contains J times the acceleration.")
        ahead = {derivative} if self.feedforward else set()
        wanted = [k for k in ("dr", "ddr") if k in {*act.needs} | ahead]
        inputs, smooth, names = self._filtered(["r", *wanted])
        parts = [*smooth, controllers.error(act.kind, inputs=[names.get("r", "r"), measured])]
        if self.feedforward:
            inner, outer = [names.get(derivative, derivative)], [act.torque]
            parts.append(controllers.feedforward(p, act.kind, inputs=inner, outputs=outer))
        return inputs, parts, names

    def _filtered(self, signals: list[str]) -> tuple[list[str], list[Any], dict[str, str]]:
        """Return the inputs of the prefilter of these signals, its block, and their new names:
        an input keeps its name, so that what is filtered needs another."""
        if self.prefilter is False or self.prefilter is None:
            return signals, [], {}
        names = {k: f"{k}_filtered" for k in signals}
        pole = 2.0 if self.prefilter is True else positive(self.prefilter, "prefilter", "1/s")
        kind, inputs = _FILTERS[tuple(signals[1:])]
        made = controllers.prefilter(pole, kind, inputs=inputs, outputs=list(names.values()))
        return list(inputs), [made], names


_FILTERS = {  # derivatives wanted: kind of the prefilter, inputs of the loop
    (): (None, ["r"]),
    ("dr",): ("velocity", ["r"]),
    ("ddr",): ("position", ["r", "ddr"]),
    ("dr", "ddr"): ("motion", ["r", "dr"]),
}


def _closed(
    drives: tuple[Model, Model],
    act: Controller,
    observer: str | None,
    gains: tuple[Mapping[str, Any], Mapping[str, Any] | None],
    front: Reference,
    name: str,
) -> ct.InterconnectedSystem:
    """Wire the drive that is there, the controller, and an observer by the drive it believes in."""
    p, believed = drives
    estimate = loop_observer(observer, believed, *gains, act.sliding)
    inputs, reference, names = front.blocks(p, act)
    parts = [plant(p), estimate, *act.blocks(believed, names), *reference]
    parts += [controllers.compensation(outputs=[act.torque]), *act.limit.blocks()]
    return connected(parts, [*inputs, *["d"] * flag(front.load, "load")], OUTPUTS, name)

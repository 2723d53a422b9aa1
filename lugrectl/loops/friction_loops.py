"""Ready-made loops: blocks connected by their signal names alone."""

from __future__ import annotations

from collections.abc import Mapping
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

from ..blocks import controllers
from ..blocks.drive import limiter
from ..blocks.observers import Gain, believed, observer_block
from ..blocks.plant import plant
from ..core.errors import InputError
from ..core.validation import flag, positive
from .parts import (
    DEFAULTS,
    OUTPUTS,
    OWN,
    SLIDING,
    both,
    connected,
    controller_block,
    derivatives,
    error_s,
    loop_observer,
    mapped,
    models,
    tracked,
)

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
    return _closed("velocity", {"kp": kp, "ki": ki}, SimpleNamespace(**locals()))


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
    own = {"kp": kp, "ki": ki, "kd": kd, "tau": tau}
    return _closed("position", own, SimpleNamespace(**locals()))


def _closed(kind: str, own: dict[str, Any], a: SimpleNamespace) -> ct.InterconnectedSystem:
    """Wire the drive that is there, a controller with the gains ``own`` or another one by name, and
    an observer by the drive it believes in; ``a``: the arguments of the loop."""
    p, known = models(a.p, a.observer_parameters, a.observer)
    make = controllers.pi if kind == "velocity" else controllers.pid
    other = None
    if a.controller is not None and a.controller != make.__name__:
        other = controller_block(a.controller)
    held = _held(kind, own, other, make.__name__, a)
    seen = () if a.observer is None else observer_block(a.observer).inputs
    read = () if other is None else other.inputs
    sliding, torque = bool({*SLIDING} & {*read}), "u" if a.limit is None else "u_cmd"
    needs = derivatives(kind, [*read, *(s for s in seen if s == "s")])
    inputs, reference, names = _referenced(kind, p, needs, torque, a)
    shared, gains = {"K1": a.K1, "K2": a.K2, "k": a.k}, both(a.observer, a.gains, a.more)
    parts = [plant(p), loop_observer(a.observer, known, shared, gains, sliding)]
    if sliding or "s" in seen:
        parts.append(error_s(kind, a.controller_gains, names))
    if other is None:
        parts.append(make(**own, **held, outputs=[torque]))
    else:
        values = {k: v for k, v in mapped(a.controller_gains, "").items() if k != "lam"}
        values["inputs"] = [names.get(k, k) for k in other.inputs]
        values["outputs"] = [torque if k == "u" else k for k in other.outputs]
        parts.append(believed(other, known, **values))
    parts += [*reference, controllers.compensation(outputs=[torque])]
    parts += [] if a.limit is None else [limiter(a.limit)]
    return connected(parts, [*inputs, *["d"] * flag(a.load, "load")], OUTPUTS, a.name)


def _held(kind: str, own: dict[str, Any], other: Any, usual: str, a: SimpleNamespace) -> Any:
    """The back-calculation of the usual controller; what another one cannot take is refused."""
    if other is None:
        if mapped(a.controller_gains, "controller_gains"):
            raise InputError(f"controller_gains belong to another controller; {usual} has its own.")
        return tracked(a.limit, a.tracking, own["kp"], own["ki"], f"{kind}_loop")
    mapped(a.controller_gains, "controller_gains")
    if strange := [k for k, v in own.items() if v != DEFAULTS[kind][k]]:
        raise InputError(
            f"{strange[0]} is a gain of {usual}; give those of {other.name} in controller_gains."
        )
    if a.tracking is not None:
        raise InputError(
            f"tracking holds back the integral of {usual}; leave it out with {other.name}."
        )
    return {}


def _referenced(
    kind: str, p: Model, needs: list[str], torque: str, a: SimpleNamespace
) -> tuple[list[str], list[Any], dict[str, str]]:
    """The loop's reference inputs, the blocks from them to the error and the feed-forward, and what
    the loop calls the reference and its derivatives: behind a prefilter they need other names."""
    measured, derivative = controllers.MEASURED[kind], controllers.DERIVATIVE[kind]
    if flag(a.feedforward, "feedforward") and derivative in needs:
        raise InputError("feedforward=True: this controller contains J times the acceleration.")
    wanted = {*needs, *[derivative] * bool(a.feedforward)}
    inputs, names, parts = ["r", *(k for k in ("dr", "ddr") if k in wanted)], {}, []
    if a.prefilter is not False and a.prefilter is not None:
        names = {k: f"{k}_filtered" for k in inputs}
        pole = 2.0 if a.prefilter is True else positive(a.prefilter, "prefilter", "1/s")
        form, inputs = _FILTERS[tuple(inputs[1:])]
        outputs = list(names.values())
        parts.append(controllers.prefilter(pole, form, inputs=inputs, outputs=outputs))
    parts.append(controllers.error(kind, inputs=[names.get("r", "r"), measured]))
    if a.feedforward:
        ahead = [names.get(derivative, derivative)]
        parts.append(controllers.feedforward(p, kind, inputs=ahead, outputs=[torque]))
    return list(inputs), parts, names


_FILTERS = {  # derivatives wanted: kind of the prefilter, inputs of the loop
    (): (None, ["r"]),
    ("dr",): ("velocity", ["r"]),
    ("ddr",): ("position", ["r", "ddr"]),
    ("dr", "ddr"): ("motion", ["r", "dr"]),
}

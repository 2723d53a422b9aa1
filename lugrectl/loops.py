"""Ready-made loops: blocks connected by their signal names alone."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import control as ct

from .blocks import comparison, controllers  # noqa: F401  comparison registers its observers
from .blocks.drive import limiter
from .blocks.observers import Gain, observer_block
from .blocks.observers import observer as build_observer
from .blocks.plant import plant
from .checks import flag, one_name, positive, real, shown
from .door import as_model
from .errors import InputError
from .spec import Block

if TYPE_CHECKING:
    from .model import Model, Parameters

OUTPUTS = ("theta", "w", "F", "Fhat", "u", "e")
SEEN = ("theta", "w", "u", "e", "r")
OWN = "own"  # a gain that is left out: the observer's own default


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
    name: str = "velocity_loop",
) -> ct.InterconnectedSystem:
    """PI velocity control with friction compensation, u = (kp + ki/s)(r - w) + Fhat.

    Parameters
    ----------
    p : Parameters or Model
        The plant; friction and effects of a whole model act inside it.
    observer : str or None
        "natural", "existing", "proposed", "friedland_park", "disturbance", "extended_state",
        "adaptive", or the name of any registered observer whose inputs are among theta, w, u,
        e, r. None: Fhat = 0.
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
    name : str
        Name of the loop.

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
        For an unknown observer, a gain that it does not have, or a parameter that is missing or
        out of bounds.

    Notes
    -----
    Source paper, fig. sys (a). Stiff: with python-control, simulate with
    ``solve_ivp_method="LSODA"`` and an atol of 1e-8 or less, because z is about 1e-3. SciPy's
    BDF and Radau can stop with an error: no rate depends on theta, so the finite difference step
    that they use for theta grows until it overflows.
    """
    shared = {"K1": K1, "K2": K2, "k": k}
    p, believed = _models(p, observer_parameters)
    estimate = _observer(observer, believed, shared, gains)
    sum_of, held = _limited("velocity_loop", kp, ki, limit, tracking)
    inputs, reference = _reference(p, "velocity", prefilter, feedforward, sum_of)
    parts = [plant(p), estimate, controllers.pi(kp, ki, **held), *reference]
    return _closed(parts, inputs, load, name, limit)


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
    name: str = "position_loop",
) -> ct.InterconnectedSystem:
    """PID position control with friction compensation.

    u = (kp + ki/(tau s + 1))(r - theta) - kd w + Fhat; tau None or 0: pure integral action.

    Parameters
    ----------
    kp, ki, kd, tau : float
        N m/rad, N m/rad (pure integral: N m/(rad s)), N m s/rad, s.
    feedforward : bool
        Add u = J ddr with the plant's J. ddr, the second derivative of r in rad/s2, becomes an
        input, also with a prefilter; the prefilter then filters it as well.
    p, observer, K1, K2, k, gains, observer_parameters, prefilter, load, limit, tracking, name
        As in :func:`velocity_loop`; e is the position error, k is in 1/s.

    Returns
    -------
    control.InterconnectedSystem
        Inputs r [, ddr] [, d]; outputs theta, w, F, Fhat, u, e. The controller's block is
        ``pid``.

    Raises
    ------
    InputError
        For an unknown observer, or a parameter that is missing or out of bounds.

    Notes
    -----
    Source paper, fig. sys (b). Its gains, the defaults, make the compensated loop unstable:
    J s^3 + kp s + ki has no s^2 term, and the growth has a time constant of 19 s. kd > 0 with
    kd kp > J ki makes it stable.
    """
    shared = {"K1": K1, "K2": K2, "k": k}
    p, believed = _models(p, observer_parameters)
    estimate = _observer(observer, believed, shared, gains)
    sum_of, held = _limited("position_loop", kp, ki, limit, tracking)
    inputs, reference = _reference(p, "position", prefilter, feedforward, sum_of)
    parts = [plant(p), estimate, controllers.pid(kp, ki, kd, tau, **held), *reference]
    return _closed(parts, inputs, load, name, limit)


def _models(p: Any, believed: Any) -> tuple[Model, Model]:
    """The plant's model, and what the observer believes."""
    made = as_model(p, "p")
    return made, made if believed is None else as_model(believed, "observer_parameters")


def _observer(
    name: str | None,
    p: Model,
    shared: Mapping[str, Any],
    gains: Mapping[str, Any] | None,
) -> Any:
    """The observer block of a loop with its gains."""
    made = observer_block("no_observer" if name is None else name)
    _fits(made)
    if not (gains is None or isinstance(gains, Mapping)):
        raise InputError(f"gains must be a dict of numbers by name, not {shown(gains)}.")
    known = {}
    for gain, value in shared.items():
        absent = gain not in made.parameters
        if value is OWN or (absent and (value is None or real(value) == 0.0)):
            continue
        if absent:
            who = "without an observer there is" if name is None else f"the observer {name!r} has"
            raise InputError(f"{gain} = {shown(value)}: {who} no such gain; leave it out.")
        if value is None:
            own = f"{made.parameters[gain].value:g}"
            raise InputError(f"{gain} = None is no gain: leave it out for the default, {own}.")
        known[gain] = value
    return build_observer(made.name, p, **(known | dict(gains or {})))


def _fits(made: Block) -> None:
    strange = [s for s in made.inputs if s not in SEEN]
    if strange:
        raise InputError(
            f"{made.name} needs {', '.join(strange)}; a ready-made loop offers {', '.join(SEEN)}: "
            "wire it with control.interconnect."
        )
    if "Fhat" not in made.outputs:
        raise InputError(f"{made.name} has no output Fhat; an observer in a loop needs one.")


def _limited(
    loop: str, kp: float, ki: float, limit: float | None, tracking: float | None
) -> tuple[str, dict[str, Any]]:
    """The name of the sum of all torques, and what a limit behind it asks of the controller."""
    if limit is None:
        if tracking is not None:
            raise InputError(f"{loop}: tracking belongs to a limit: give limit in N m too.")
        return "u", {}
    time = controllers.tracking_time(kp, ki, tracking, loop)
    return "u_cmd", {"tracking": time, "outputs": ["u_cmd"]}


def _reference(
    p: Model, kind: str, prefilter: bool | float, feedforward: bool, sum_of: str = "u"
) -> tuple[list[str], list[Any]]:
    """The loop's reference inputs, and the blocks from them to the error and the feed-forward."""
    measured, derivative = controllers.MEASURED[kind], controllers.DERIVATIVE[kind]
    added, wanted = [sum_of], flag(feedforward, "feedforward")
    ahead = [controllers.feedforward(p, kind, outputs=added)] if wanted else []
    if prefilter is False or prefilter is None:
        return ["r", derivative][: 1 + len(ahead)], [controllers.error(kind), *ahead]
    # the input keeps its name, so the filtered signals need other names
    inputs, outputs = ["r"], ["r_filtered"]
    if feedforward:
        inputs += [derivative] if kind == "position" else []
        outputs += [f"{derivative}_filtered"]
        ahead = [controllers.feedforward(p, kind, inputs=outputs[1:], outputs=added)]
    pole = 2.0 if prefilter is True else positive(prefilter, "prefilter", "1/s")
    smooth = controllers.prefilter(
        pole, kind if feedforward else None, inputs=inputs, outputs=outputs
    )
    return inputs, [smooth, controllers.error(kind, inputs=["r_filtered", measured]), *ahead]


def _closed(
    parts: list[Any], inputs: list[str], load: bool, name: str, limit: float | None = None
) -> ct.InterconnectedSystem:
    if limit is None:
        parts = [*parts, controllers.compensation()]
    else:
        parts = [*parts, controllers.compensation(outputs=["u_cmd"]), limiter(limit)]
    return ct.interconnect(
        parts,
        inputs=inputs + ["d"] * flag(load, "load"),
        outputs=list(OUTPUTS),
        # empty: else two loops in one system would share the values of the last one
        params={},
        check_unused=False,
        name=one_name(name),
    )

"""The loop that drives have: position, speed and current in cascade."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from ..blocks import controllers
from ..blocks.drive import current_lag, dead_time, limiter, proportional
from ..blocks.drive import notch as notch_block
from ..blocks.observers import Gain
from ..blocks.plant import load_outputs, plant
from ..core.errors import InputError
from ..core.validation import flag, real, shown
from .parts import OUTPUTS, OWN, connected, error_s, loop_observer, models, tracked

if TYPE_CHECKING:
    import control as ct

    from ..blocks.model import Model, Parameters

POSITION = {"motor": "theta", "load": "theta_load"}


def cascade_loop(
    p: Parameters | Model,
    observer: str | None = None,
    *,
    kv: float = 20.0,
    kp: float = 1.6,
    ki: float = 16.0,
    limit: float | None = None,
    tracking: float | None = None,
    speed_limit: float | None = None,
    notch: float | Sequence[float] | Mapping[str, float] | None = None,
    lag: float = 0.0,
    delay: float = 0.0,
    feedback: str = "motor",
    K1: Gain | str | None = OWN,
    K2: Gain | str | None = OWN,
    k: float | str | None = OWN,
    gains: Mapping[str, Any] | None = None,
    observer_parameters: Parameters | Model | None = None,
    feedforward: bool = False,
    load: bool = False,
    name: str = "cascade_loop",
) -> ct.InterconnectedSystem:
    """P position control around PI velocity control, with limit, current loop and dead time.

    w_ref = kv (r - theta), u = clip((kp + ki/s)(w_ref - w) + Fhat, -limit, limit); the motor's
    torque is u after the dead time and the lag of the current loop.

    Parameters
    ----------
    p : Parameters or Model
        The plant; friction and effects of a whole model act inside it.
    observer : str or None
        As in :func:`velocity_loop`; it sees the limited torque u and the position error e. One
        that takes s = (w - dr) + 20 (theta - r) adds the input dr.
    kv : float
        Gain of the position controller in 1/s.
    kp, ki : float
        Gains of the velocity controller in N m s/rad and N m/rad.
    limit : float, optional
        Largest torque of the drive in N m, on the sum of controller, compensation and
        feed-forward.
    tracking : float, optional
        Time of the back-calculation in s that keeps the integral from winding up at the limit;
        default kp/ki, ``np.inf`` for none. See :func:`lugrectl.pi`.
    speed_limit : float, optional
        Largest speed reference of the position controller in rad/s.
    notch : float, tuple or dict, optional
        A notch in front of the limit: its frequency in Hz, or (frequency, damping, depth), or
        these by name. See :func:`lugrectl.notch`.
    lag : float
        Time constant of the current loop in s; 0: none.
    delay : float
        Dead time between command and current in s; 0: none. See :func:`lugrectl.dead_time`.
    feedback : "motor" or "load"
        Where the position is measured: theta, or theta_load of a model with a load behind
        ``elastic_coupling`` or ``backlash``. The speed is that of the motor.
    K1, K2, k, gains, observer_parameters
        As in :func:`velocity_loop`; k is in 1/s.
    feedforward : bool
        Add the inputs dr, the derivative of r in rad/s, to the speed reference, and ddr in
        rad/s2, times the plant's J, to the torque.
    load : bool
        Add the input d, a load torque in N m that opposes positive w.
    name : str
        Name of the loop.

    Returns
    -------
    control.InterconnectedSystem
        Inputs r [, dr, ddr] [, d]; outputs theta, w, F, Fhat, u, e, w_ref, then u_motor (the
        torque that reaches the motor, with a lag or a delay) and theta_load, w_load where they
        exist. e is the position error. Blocks, whose parameters are set at simulation time by
        their key (``params={"limiter.limit": 2.0}``): plant, *observer*_observer, proportional,
        pi, notch, limiter, dead_time, current_lag, feedforward.

    Raises
    ------
    InputError
        For an unknown observer, a parameter that is missing or out of bounds, or
        ``feedback="load"`` without a load of its own.

    Notes
    -----
    The velocity loop crosses over near kp/J (727 1/s for Table 1), the position loop near kv:
    keep kv and ki/kp well below kp/J, and kp/J below about 0.5/(lag + delay). The same loop can
    be wired by hand from the blocks that carry these names.

    Examples
    --------
    A servo axis with 2 N m, a current loop of 0.5 ms and an observer of friction:

    >>> p = lg.table1()
    >>> loop = lg.cascade_loop(p, "natural", kv=20.0, limit=2.0, lag=5e-4)
    >>> loop.output_labels
    ['theta', 'w', 'F', 'Fhat', 'u', 'e', 'w_ref', 'u_motor']

    A step of 0.1 rad, integrated by SciPy; it arrives within 0.3 s:

    >>> t = np.linspace(0.0, 0.3, 31)
    >>> run = lg.simulate(lg.cascade_loop(p, limit=2.0), t, {"r": 0.1}, method="LSODA")
    >>> round(float(run.outputs[0, -1]), 2)
    0.1
    """
    p, believed = models(p, observer_parameters, observer)
    measured = _measured(p, feedback)
    estimate = loop_observer(observer, believed, {"K1": K1, "K2": K2, "k": k}, gains)
    held = tracked(limit, tracking, kp, ki, "cascade_loop")
    before: list[Stage] = [] if notch is None else [(notch_block, _notch_values(notch), [])]
    before += [] if limit is None else [(limiter, [limit], ["excess"])]
    late = ((dead_time, delay), (current_lag, lag))
    behind: list[Stage] = [(make, [x], []) for make, x in late if real(x) != 0.0]
    torque, shaping = _in_series("u_cmd", "u", before)
    _, actuating = _in_series("u", "u_motor", behind)
    motor = "u_motor" if actuating else "u"
    parts = [
        plant(p, inputs=[motor, "d"]),
        estimate,
        controllers.error("position", inputs=["r", measured]),
        proportional(kv, math.inf if speed_limit is None else speed_limit),
        controllers.error("velocity", name="speed_error", inputs=["w_ref", "w"], outputs=["e_w"]),
        controllers.pi(kp, ki, **held, inputs=["e_w", *["excess"] * bool(held)], outputs=[torque]),
        controllers.compensation(outputs=[torque]),
        *shaping,
        *actuating,
    ]
    ahead, sliding = flag(feedforward, "feedforward"), "s" in estimate.input_labels
    if sliding:
        parts.append(error_s("position", None, {"theta": measured}))
    if ahead:
        parts += [
            controllers.compensation(name="speed_feedforward", inputs=["dr"], outputs=["w_ref"]),
            controllers.feedforward(p, "position", outputs=[torque]),
        ]
    inputs = ["r", *["dr"] * (ahead or sliding), *["ddr"] * ahead, *["d"] * flag(load, "load")]
    outputs = [*OUTPUTS, "w_ref", *["u_motor"] * bool(actuating), *load_outputs(p)]
    return connected(parts, inputs, outputs, name)


def _measured(p: Model, feedback: str) -> str:
    if feedback not in POSITION:
        raise InputError(f"feedback must be 'motor' or 'load', not {shown(feedback)}.")
    signal = POSITION[feedback]
    if feedback == "load" and signal not in load_outputs(p):
        raise InputError(
            f"feedback = 'load': {p.name} has no load of its own; declare elastic_coupling or "
            "backlash."
        )
    return signal


def _notch_values(given: Any) -> tuple[Any, ...]:
    """Frequency, damping and depth, as far as they are given."""
    own = {"frequency": None, "damping": 0.5, "depth": 0.1}
    if isinstance(given, Mapping) and "frequency" in given and {*given} <= {*own}:
        return tuple({**own, **given}.values())
    values = (given,) if real(given) is not None else given
    if not isinstance(values, (list, tuple)) or not 1 <= len(values) <= 3:
        raise InputError(
            "notch must be a frequency in Hz, or (frequency, damping, depth), or these by name, "
            f"not {shown(given)}."
        )
    return tuple(values)


Stage = tuple[Callable[..., Any], Sequence[Any], Sequence[str]]  # factory, values, more outputs


def _in_series(first: str, last: str, stages: Sequence[Stage]) -> tuple[str, list[Any]]:
    """Return the name at the start of a chain of blocks from one signal to another, and them."""
    if not stages:
        return last, []
    names = [first, *(f"{first}_{k}" for k in range(1, len(stages))), last]
    ends = zip(stages, names, names[1:], strict=False)
    return first, [
        make(*values, inputs=[enters], outputs=[leaves, *more])
        for (make, values, more), enters, leaves in ends
    ]

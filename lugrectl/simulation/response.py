"""Time responses of python-control systems, traced, compiled and stepped with located events."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from typing import Any

import control as ct
import numpy as np
from numpy.typing import ArrayLike
from scipy.integrate import solve_ivp

from ..core.errors import Diverged, InputError
from ..core.validation import positive
from ..engine.expression.numpy_protocol import TraceError
from ..engine.runtime.chatter import Chatter
from ..engine.runtime.delayed_run import delayed
from ..engine.runtime.growth import bounded, quiet, stopped
from ..engine.runtime.memo import compiled
from ..engine.runtime.slow_functions import said_if_slow
from ..engine.tracing.locate_fault import Instant, culprit
from . import arguments
from .block_list import simulate_blocks, simulate_discrete, together, wired
from .dead_time_warning import warn_if_approximate
from .wiring_warnings import warn_of_interconnection, warn_of_wiring

LONG = (
    1000  # a discrete system is traced from this many samples on: python-control takes 12 us each
)
_respond: Any = ct.input_output_response  # its type annotations do not include arrays


def simulate(
    system: Any,
    t: ArrayLike | None = None,
    inputs: Mapping[str, ArrayLike] | ArrayLike | Sequence[Any] | None = None,
    x0: ArrayLike | Sequence[Any] | None = None,
    *,
    timepts: ArrayLike | None = None,
    initial_state: ArrayLike | Sequence[Any] | None = None,
    params: Mapping[str, Any] | None = None,
    method: str | None = None,
    hold: bool = False,
    rtol: float = 1e-6,
    atol: float | None = None,
    squeeze: bool | None = None,
) -> ct.TimeResponseData:
    """The response of a block, an interconnection or a list of blocks with any sample times.

    Parameters
    ----------
    system : control.NonlinearIOSystem, control.TransferFunction or list of them
        Any python-control system; or blocks that are connected by their signal names as
        ``ct.interconnect`` does (outputs of the same name are added). Continuous blocks and
        sampled ones with one or several sample times may be mixed.
    t : (N,) array_like
        Increasing times in s, evenly spaced or not. For a discrete-time system: its samples.
    inputs : dict, array_like or list, optional
        A dict by name, each value a number or (N,), 0 if left out; or (m, N), or (N,) for one
        input, a number, or a list of such parts; default 0. The inputs of a list of blocks are
        the signals that a block reads and no block outputs, in the order of the blocks. Where a
        dict leaves one of them out, other than a load d, and nothing reads the outputs of some
        block, a warning names both.
    x0 : array_like or list
        Initial states, default 0: a number for all, or a list that is padded with zeros; for a
        list of blocks, the states of one block after the other.
    timepts, initial_state
        python-control's names for t and x0.
    params : dict, optional
        Parameters in place of the defaults; other values need no new compilation.
    method : str, optional
        "rosenbrock" (default), or a method of ``scipy.integrate.solve_ivp``, which
        python-control then runs.
    hold : bool
        True to hold inputs between samples, as a drive holds its torque; else they are linear.
    rtol : float
        Error allowed in a step, relative to the size of each state: its value, or the largest of
        its last swing, which is forgotten in about the time in which the state fell (at least
        1e-7 of the largest value that it has had).
    atol : float, optional
        The same in the unit of the state, for values near zero; default 1e-9 rtol, and 1e-4 rtol
        where SciPy integrates.
    squeeze : bool, optional
        As for ``ct.input_output_response``.

    Returns
    -------
    control.TimeResponseData
        With the labels, shapes and parameters of ``ct.input_output_response``; for a list of
        blocks, all their outputs and the states, named ``block_state``.

    Raises
    ------
    InputError
        For times that do not increase, shapes that do not fit, a NaN in an input, an unknown
        input or parameter, a value outside its bounds, an unknown method, an rtol outside
        (0, 1), or an algebraic loop that has no linear equations with one solution (the blocks
        are named).
    Diverged
        When a state or signal grows without bound or becomes NaN; the message names it, its
        block and the time. Without bound is beyond 1e15 of the inputs and initial states (at
        least 1), where it grew by 1e4 or more in the second half of the run.

    Notes
    -----
    The blocks' own functions are traced to one expression graph (``lugrectl.engine``), compared
    with the system's right-hand side, and stepped by an L-stable Rosenbrock method of order 4
    (Hairer and Wanner, Solving Ordinary Differential Equations II, section IV.7). Steps end at
    the samples and where an absolute value, a sign, a comparison or a limit switches. If a sign
    or comparison drives its own argument back to zero from both sides, the argument stays at
    zero (Filippov), as a drive at rest on Coulomb friction does, and the outputs contain the
    value that keeps it there. If such a rest is only approached, in ever shorter swings, a
    warning reports it. Compiled code serves the next call while the equations are the same: what
    a function of yours reads from outside (a global, an entry of a dictionary, an array) is read
    again at each call. A system whose functions cannot be traced is simulated by LSODA, with a
    warning that names the block. Outputs that depend on themselves at the same instant are
    solved where their equations are linear in them (two lags with feed-through in a loop);
    python-control refuses such a loop.

    A sampled block is updated at the multiples of its sample time. It reads its inputs at that
    instant, sets its outputs at once, holds them until the next update, and advances its
    states. Before the first update it holds the outputs of its initial state. In the result, its
    states at an update are those before it. Blocks without states and sample time act at every
    instant. A sampled block that cannot be traced is called at its updates, without a warning:
    the result is the same.

    A dead time (``lg.dead_time``, the effect ``input_delay``) is exact: its output is the input of
    T ago, and before that p1 of the initial states (default 0). Its states in the result are the
    delayed signal and 0. With another method, or beside a block that cannot be traced, it is the
    Pade approximation of order 2, and a warning reports it; so is a delay below 1/50 000 of the
    run.

    A controller that acts on e makes it smaller: e is measured - reference. A warning names a
    controller of the package in a feedback of the wrong sign, from the blocks' derivatives at
    rest.

    Examples
    --------
    A velocity loop that follows a sine of 0.1 rad/s and 1 Hz:

    >>> loop = lg.velocity_loop(lg.table1(), "proposed")
    >>> t = np.linspace(0.0, 1.0, 501)
    >>> run = lg.simulate(loop, t, 0.1 * np.sin(2 * np.pi * t))
    >>> run.outputs.shape
    (6, 501)

    The same loop with 10 % more Coulomb friction, which needs no new compilation:

    >>> more = lg.simulate(loop, t, 0.1 * np.sin(2 * np.pi * t), params={"plant.Fc": 0.3135})
    >>> torque = loop.output_labels.index("u")
    >>> bool(more.outputs[torque].max() > run.outputs[torque].max())
    True
    """
    rtol = arguments.settings(rtol, hold, method, squeeze)
    atol = None if atol is None else positive(atol, "atol")
    options = {"params": params, "hold": hold, "rtol": rtol, "atol": atol, "squeeze": squeeze}
    times = arguments.times(t, timepts)
    if x0 is not None and initial_state is not None:
        raise InputError("the initial states are given twice: give x0 or initial_state.")
    x0 = initial_state if x0 is None else x0
    if isinstance(system, (list, tuple)):
        system = [arguments.system(block, "a block") for block in system]
        arguments.parameters(system, params)
        warn_of_wiring(wired(system)[0], inputs, params)
        if any(block.dt not in (None, 0) for block in system):
            return simulate_blocks(system, times, inputs, x0, method=method, **options)
        system = together(system)
    else:
        system = arguments.system(system)
        arguments.parameters([system], params)
        warn_of_interconnection(system, params)
    u = arguments.inputs(system.name, system.input_labels, times, inputs)
    start = arguments.start(system.name, system.nstates, x0)
    if system.isdtime(strict=True):
        states, y = _discrete(system, times, u, start, params)
    else:
        states, y = _continuous(system, times, u, start, params, method, hold, rtol, atol)
    _bounded(system, times, u, start, states, y)
    return _response(system, times, y, states, u, params, squeeze)


def _bounded(system: Any, t: Any, u: np.ndarray, x0: np.ndarray, states: Any, y: Any) -> None:
    n, looped = int(system.nstates or 0), isinstance(system, ct.InterconnectedSystem)
    rows = [np.asarray(states) if n else np.empty((0, len(t))), np.asarray(y)]
    labels = [[f"state {k}" for k in (system.state_labels or ())][:n]]
    labels.append([f"output {k}" for k in system.output_labels])
    bounded(system.name, t, rows, labels, [u, x0], looped=looped)


def _response(
    system: Any, t: np.ndarray, y: Any, states: Any, u: np.ndarray, params: Any, squeeze: Any
) -> ct.TimeResponseData:
    """The response, built from its first sample and given the arrays: python-control copies."""
    y, x = np.asarray(y), np.asarray(states) if system.nstates else None
    response = ct.TimeResponseData(
        t[:1],
        y[:, :1],
        None if x is None else x[:, :1],
        u[:, :1],
        params=params,
        issiso=system.issiso(),
        output_labels=system.output_labels,
        input_labels=system.input_labels,
        state_labels=system.state_labels if system.nstates else None,
        sysname=system.name,
        title="Input/output response for " + system.name,
        squeeze=squeeze,
    )
    response.t, response.y, response.x, response.u = t, y, x, u
    return response


def _discrete(
    system: Any, t: np.ndarray, u: np.ndarray, x0: np.ndarray, params: Any
) -> tuple[Any, np.ndarray]:
    """python-control's loop; the traced one for many samples."""
    steady = system.dt is not True and np.allclose(np.diff(t), system.dt, rtol=1e-6, atol=0.0)
    if steady and len(t) > LONG:
        try:
            return simulate_discrete(system, t, u, x0, params)
        except TraceError:
            pass
    try:
        with np.errstate(all="ignore"):
            response = _respond(system, t, u, x0, params=params, squeeze=False)
        return _of(system, response)
    except RuntimeError:
        return _updated(system, t, u, x0, params)


def _of(system: Any, response: Any) -> tuple[np.ndarray | None, np.ndarray]:
    """States and outputs; python-control has no answer for the states where there are none."""
    states = np.asarray(response.states) if system.nstates else None
    return states, np.asarray(response.outputs)


def _updated(
    system: Any, t: np.ndarray, u: np.ndarray, x0: np.ndarray, params: Any
) -> tuple[np.ndarray, np.ndarray]:
    """States and outputs at the samples, where python-control reports a loop that has an answer."""
    system._update_params(params)
    at, states, y = Instant(system), [x0], []
    for now, held in zip(t, u.T, strict=True):
        y.append(at.outputs(now, states[-1], held))
        states.append(at.rates(now, states[-1], held))
    return np.array(states[:-1]).T, np.array(y).T


def _continuous(
    system: Any,
    t: np.ndarray,
    u: np.ndarray,
    x0: np.ndarray,
    params: Mapping[str, Any] | None,
    method: str | None,
    hold: bool,
    rtol: float,
    atol: float | None,
) -> tuple[np.ndarray | None, np.ndarray]:
    """States and outputs in continuous time."""
    why = ""
    if method in (None, "rosenbrock"):
        try:
            return _by_rosenbrock(system, t, u, x0, params, hold, rtol, atol)
        except TraceError as error:
            why = str(error)
            warnings.warn(f"{why}; LSODA is used instead.", RuntimeWarning, stacklevel=3)
    warn_if_approximate([system], params)
    with (
        said_if_slow(why),
        quiet(),
        np.errstate(all="ignore"),
    ):  # what is not finite is reported by name
        return _by_scipy(system, t, u, x0, params, hold, rtol, atol, method or "LSODA")


def _by_rosenbrock(
    system: Any,
    t: np.ndarray,
    u: np.ndarray,
    x0: np.ndarray,
    params: Mapping[str, Any] | None,
    hold: bool,
    rtol: float,
    atol: float | None,
) -> tuple[np.ndarray, np.ndarray]:
    engine = compiled(system, params)
    p = engine.program.arguments(params)
    states = x0[:, None]
    exact = delayed(engine, system, t, params)
    y = None
    if exact is not None:
        run, y = exact.run(t, u, x0, params, hold=hold, rtol=rtol, atol=atol)
        states = run.states
        _settled(system, run.unsettled)
    elif system.nstates and len(t) > 1:
        run = engine.run(t, u, x0, p, hold=hold, rtol=rtol, atol=atol)
        states = run.states
        _settled(system, run.unsettled)
    elif not system.nstates:
        states = np.empty((0, len(t)))
    if y is None:
        y = engine.outputs(t, states, u, p)
    _all_finite(system, t, states, u, y)
    return states, y


def _settled(system: Any, unsettled: float) -> None:
    if np.isfinite(unsettled):
        warnings.warn(
            f"{system.name}: a sign or comparison switches without end near t = "
            f"{unsettled:.6g} s; the result there is coarse: write np.tanh(w/eps) for "
            "np.sign(w).",
            RuntimeWarning,
            stacklevel=5,
        )


def _all_finite(system: Any, t: np.ndarray, states: Any, u: np.ndarray, y: np.ndarray) -> None:
    if np.isfinite(y).all():
        return
    k, i = np.argwhere(~np.isfinite(y.T))[0]
    x = np.zeros(0) if states is None else states[:, k]
    first = culprit(system, float(t[k]), x, u[:, k])
    label = system.output_labels[i]
    if not isinstance(system, ct.InterconnectedSystem) or not first:
        first = f"output {label} is {y[i, k]}"
    raise Diverged(f"{system.name}: {first} at t = {t[k]:.6g} s.")


def _by_scipy(
    system: Any,
    t: np.ndarray,
    u: np.ndarray,
    x0: np.ndarray,
    params: Mapping[str, Any] | None,
    hold: bool,
    rtol: float,
    atol: float | None,
    method: str,
) -> tuple[np.ndarray | None, np.ndarray]:
    """python-control's simulation; sample by sample if the input is held or a loop is solved."""
    options = {"method": method, "rtol": rtol, "atol": 1e-4 * rtol if atol is None else atol}
    options["events"] = Chatter(system.name, t[-1] - t[0])
    try:
        if hold and system.nstates:
            states, y = _stepped(system, t, u, x0, params, hold, options)
        else:
            given = {k: v for k, v in options.items() if k != "method"}
            response = _respond(
                system,
                t,
                u,
                x0,
                params=params,
                solve_ivp_method=method,
                solve_ivp_kwargs=given,
                squeeze=False,
            )
            states, y = _of(system, response)
    except Diverged:
        raise
    except RuntimeError as error:
        try:  # block by block: it names what is not a number, and solves a loop that is linear
            states, y = _stepped(system, t, u, x0, params, hold, options)
        except RuntimeError:
            said = f"{system.name}: python-control's simulation failed: {error}."
            raise Diverged(said) from error
    _all_finite(system, t, states, u, y)
    return states, y


def _stepped(
    system: Any,
    t: np.ndarray,
    u: np.ndarray,
    x0: np.ndarray,
    params: Mapping[str, Any] | None,
    hold: bool,
    options: Mapping[str, Any],
) -> tuple[np.ndarray, np.ndarray]:
    """solve_ivp from sample to sample, with inputs that are held or linear in between."""
    system._update_params(params)
    at = Instant(system)
    states = np.empty((system.nstates, len(t)))
    states[:, 0] = x0
    at.outputs(t[0], x0, u[:, 0])
    for k in range(len(t) - 1 if system.nstates else 0):
        slope = 0.0 * u[:, k] if hold else (u[:, k + 1] - u[:, k]) / (t[k + 1] - t[k])

        def rates(now: float, x: np.ndarray, k: int = k, slope: Any = slope) -> np.ndarray:
            return at.rates(now, x, u[:, k] + (now - t[k]) * slope)

        part = solve_ivp(rates, (t[k], t[k + 1]), states[:, k], **options)
        if not part.success:
            raise stopped(
                system.name,
                system.state_labels,
                part.t[-1],
                part.y[:, -1],
                part.message,
                looped=isinstance(system, ct.InterconnectedSystem),
            )
        states[:, k + 1] = part.y[:, -1]
    y = [at.outputs(now, x, held) for now, x, held in zip(t, states.T, u.T, strict=True)]
    return states, np.array(y).reshape(len(t), -1).T

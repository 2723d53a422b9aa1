"""Time responses of python-control systems, traced, compiled and stepped with located events."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import control as ct
from numpy.typing import ArrayLike

from ..core.errors import InputError
from ..core.validation import positive
from ..engine.runtime.adaptive_run import Accuracy, Course
from . import arguments
from .net_run import Run, course_of, followed, net_of, response
from .wiring_warnings import warn_of_wiring


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
        "rosenbrock" (default), or a method of ``scipy.integrate.solve_ivp``, which then calls the
        blocks' own functions.
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
    accuracy = Accuracy(rtol, None if atol is None else positive(atol, "atol"))
    times = arguments.times(t, timepts)
    if x0 is not None and initial_state is not None:
        raise InputError("the initial states are given twice: give x0 or initial_state.")
    net, periods = net_of(system)
    arguments.parameters([part.block for part in net.parts], params)
    warn_of_wiring(net, inputs, params)
    u = arguments.inputs(net.name, net.outside, times, inputs)
    states = net.count(False) + net.count(True)
    start = arguments.start(net.name, states, initial_state if x0 is None else x0)
    if periods:
        course = course_of(times, u, periods, hold)
    else:
        course = Course.along(times, u, net.groups, hold)
    run = Run(net, course, start, params, method, accuracy)
    return response(run, followed(run), u, squeeze)

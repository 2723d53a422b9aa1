"""Time responses of python-control systems, traced, compiled and stepped with located events.

Also of a continuous plant under sampled control, whose torque is held between samples.
"""

from __future__ import annotations

import contextlib
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import control as ct
import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import block_diag

from ..blocks.controllers import dead_time, dead_times
from ..core.errors import Diverged, InputError
from ..core.validation import nearest, positive, whole
from ..engine.adaptive_run import (
    Accuracy,
    Called,
    Course,
    Track,
    bounded,
    first_bad,
    warn_unsettled,
)
from ..engine.delays import run_late
from ..engine.graph import TraceError
from ..engine.memo import ALONE, compiled, described
from ..engine.tracer import Net, Part, is_wired, traced_net
from . import arguments

MOST = 1e8  # updates in a run: an array of them is 0.8 GB
NEAR = 1e-6  # of the shortest sample time: updates and times closer than that are the same
AT = (1e-2, 1.0, 1e2, 1e4)  # 1/s: points of the positive real axis
TINY = 1e-6  # step of the differences


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
    warn_unfed(net, inputs)
    u = arguments.inputs(net.name, net.outside, times, inputs)
    states = net.count(False) + net.count(True)
    start = arguments.start(net.name, states, initial_state if x0 is None else x0)
    if periods:
        course = course_of(times, u, periods, hold)
    else:
        course = Course.along(times, u, net.groups, hold)
        block = net.parts[0].block
        if net.groups and block.dt is not True:
            _even(net.name, times, [block])
    run = Run(net, course, start, params, method, accuracy)
    return response(run, followed(run), u, squeeze)


def net_of(system: Any) -> tuple[Net, list[float]]:
    """The net of a system, or of a list of blocks with its sample times."""
    if not isinstance(system, (list, tuple)):
        return Net.of(arguments.system(system)), []
    blocks = [arguments.system(b, "a block") for b in system]
    names = [b.name for b in blocks]
    twice = [k for k in names if names.count(k) > 1]
    if twice or not blocks:
        raise InputError(
            f"two blocks are called {twice[0]}: give one of them another name="
            if twice
            else "the list of blocks is empty."
        )
    rates = [_rate(b, blocks) for b in blocks]
    periods = sorted({rate for rate in rates if rate is not None})
    parts = [
        Part.of(block, None if rate is None else periods.index(rate))
        for block, rate in zip(blocks, rates, strict=True)
    ]
    return Net("blocks", tuple(parts), outside(parts), len(periods)), periods


def _rate(block: Any, blocks: Sequence[Any]) -> float | None:
    """The sample time in s, None in continuous time; dt = True takes that of the others."""
    if not block.isdtime(strict=True):
        return None
    if block.dt is not True:
        return float(block.dt)
    known = {float(b.dt) for b in blocks if b.isdtime(strict=True) and b.dt is not True}
    if len(known) != 1:
        raise InputError(f"{block.name} has dt=True: give it a sample time in s.")
    return known.pop()


def outside(parts: Sequence[Part]) -> tuple[str, ...]:
    """Signals that a block reads and no block outputs, in the order in which they are read."""
    made = {k for part in parts for k in part.outputs}
    return tuple(dict.fromkeys(k for part in parts for k in part.inputs if k not in made))


def warn_unfed(net: Net, given: Any) -> None:
    """Warn of inputs of a list of blocks that are left out of a dict, where an output is left over
    or nearly has the name; a load d is usually meant to be 0."""
    if net.alone or not isinstance(given, Mapping):
        return
    read = {k for part in net.parts for k in part.inputs}
    for label in (k for k in net.outside if k not in given and k != "d"):
        idle = [
            f"{', '.join(part.outputs)} of {part.block.name}"
            for part in net.parts
            if part.outputs and not read & {*part.outputs} and label not in part.inputs
            and not (_kind(part.block) == "observer" and label[:1] != "F")  # often only watched
        ]  # fmt: skip
        near = nearest(label, [k for k in net.signals if k not in read])
        if near is None and not idle:
            continue
        hint = f"Nothing reads {'; '.join(idle)}: is it meant?"
        hint = hint if near is None else f"Did you mean {near} of {net.makers(near)}?"
        readers = ", ".join(part.block.name for part in net.parts if label in part.inputs)
        warnings.warn(
            f"{net.name}: nothing feeds the input {label} of {readers}; it is 0. {hint} Give "
            f"inputs={{'{label}': 0}} if 0 is meant.",
            RuntimeWarning,
            stacklevel=3,
        )


def _continuous(block: Any) -> Any:
    return getattr(getattr(block.outfcn, "step", None), "system", block)


def _kind(block: Any) -> str:
    """The kind of a block of this package, continuous or sampled."""
    return getattr(getattr(_continuous(block).outfcn, "block", None), "kind", "")


def _warn_of_sign(run: Run, right: set[bytes], p: np.ndarray) -> None:
    """Warn of feedback that drives e from zero; ``right``: signs of p for which none does."""
    signs = (p > 0.0).tobytes() + (p < 0.0).tobytes()
    if signs in right:
        return
    wrong = _wrong(run.net, run.params)
    if not wrong:
        right.add(signs)
    for name in wrong:
        warnings.warn(
            f"{run.net.name}: the feedback through {name} has the wrong sign: it drives the error "
            "away from zero. The controllers here act on e = measured - reference "
            "(lugrectl.error) with positive gains.",
            RuntimeWarning,
            stacklevel=5,
        )


def _wrong(net: Net, params: Mapping[str, Any] | None) -> list[str]:
    """The controllers whose error e makes itself rise further: the loop is cut there, and its gain
    on the positive real axis must not be positive."""
    system = net.parts[0].block
    wired = net.alone and is_wired(system)
    blocks = system.syslist if wired else [part.block for part in net.parts]
    ends = np.cumsum([0, *(block.ninputs for block in blocks)])
    own = [(k, b) for k, b in zip(ends, blocks, strict=False) if _kind(b) == "controller"]
    read = [(k, b.name, _continuous(b).outfcn.block.inputs) for k, b in own]
    rows = {int(k) + inputs.index("e"): name for k, name, inputs in read if "e" in inputs}
    if not rows or not net.looped:
        return []
    matrix = np.asarray(system.connect_map, dtype=float) if wired else net.connect
    try:
        with ALONE, np.errstate(all="ignore"):
            values = {**(system.params if wired else {}), **(params or {})}
            linear = [_linear(block, values) for block in blocks]
            H = [matrix @ block_diag(*(_gain(s, *one) for one in linear)) for s in AT]
            return [k for row, k in rows.items() if all(0 < _around(G, row) < np.inf for G in H)]
    except Exception:  # a block that cannot be evaluated at rest is reported by the simulation
        return []


def _around(H: np.ndarray, row: int) -> float:
    """What arrives at an input for 1 put in there, where v = H v are the inputs of all blocks."""
    one, cut = np.eye(len(H)), H.copy()
    cut[row] = 0.0
    return float(H[row] @ np.linalg.solve(one - cut, one[row]))


def _linear(block: Any, params: Mapping[str, Any]) -> tuple[np.ndarray, int, float]:
    """[[A, B], [C, D]] of a block at rest, its number of states and its sample time, 0 for none."""
    params, block = {**block.params, **params}, _continuous(block)
    block._update_params(params)
    n, m = int(block.nstates or 0), int(block.ninputs)

    def values(at: np.ndarray) -> np.ndarray:
        rates = block._rhs(0.0, at[:n], at[n:]) if n else ()
        return np.concatenate([np.ravel(rates), np.ravel(block._out(0.0, at[:n], at[n:]))])

    rows = [(values(h) - values(-h)) / (2 * TINY) for h in TINY * np.eye(n + m)]
    dt = float(block.dt) if block.isdtime(strict=True) else 0.0
    return np.reshape(rows, (n + m, n + block.noutputs)).T, n, dt


def _gain(s: float, J: np.ndarray, n: int, dt: float) -> np.ndarray:
    """C (z - A)^-1 B + D at z = s, in discrete time at exp(s dt)."""
    z = np.exp(min(s * dt, 50.0)) if dt else s
    return J[n:, n:] + J[n:, :n] @ np.linalg.solve(z * np.eye(n) - J[:n, :n], J[:n, n:])


def course_of(t: np.ndarray, u: np.ndarray, periods: Sequence[float], hold: bool) -> Course:
    """Updates at the multiples of each sample time, between the first and the last time."""
    near, updates = NEAR * min(periods), sum((t[-1] - t[0]) / dt for dt in periods)
    if updates > MOST:
        raise InputError(
            f"blocks with dt = {min(periods):g} s are updated {updates:.3g} times until "
            f"t = {t[-1]:g} s, more than {MOST:g}: is a time in ms?"
        )
    grid, ticks = t, []
    for dt in periods:
        first, last = np.ceil(t[0] / dt - NEAR), np.floor(t[-1] / dt + NEAR)
        ticks.append(more := dt * np.arange(first, last + 1))
        if len(more):  # those that are not in the grid
            new = more[np.abs(grid[_nearest(grid, more)] - more) > near]
            grid = np.sort(np.concatenate([grid, new]))
    flags = np.zeros((len(periods), len(grid)))
    for row, own in zip(flags, ticks, strict=True):
        row[_nearest(grid, own)] = 1.0
        row[0] = max(row[0], 0.5)  # before the first update: the output of the initial state
    if hold:
        given = u[:, np.searchsorted(t, grid + near, side="right") - 1]
    else:
        given = np.array([np.interp(grid, t, row) for row in u]).reshape(len(u), len(grid))
    return Course(grid, given, flags, hold, _nearest(grid, t))


def _nearest(grid: np.ndarray, times: np.ndarray) -> np.ndarray:
    right = np.clip(np.searchsorted(grid, times), 1, max(len(grid) - 1, 1))
    left = right - 1
    right = np.minimum(right, len(grid) - 1)
    return np.where(times - grid[left] <= grid[right] - times, left, right)


@dataclass(frozen=True)
class Run:
    """What is run and how; ``start`` are the states of one block after the other."""

    net: Net
    course: Course
    start: np.ndarray
    params: Mapping[str, Any] | None
    method: Any
    accuracy: Accuracy

    @property
    def starts(self) -> tuple[np.ndarray, np.ndarray]:
        """The continuous states and the sampled ones."""
        return self.start[~self.sampled], self.start[self.sampled]

    @cached_property
    def sampled(self) -> np.ndarray:
        """For each state in the blocks' order, whether it belongs to a sampled block."""
        parts = self.net.parts
        return np.repeat([part.sampled for part in parts], [part.nstates for part in parts])

    @property
    def discrete(self) -> bool:
        """Whether it is a discrete-time system."""
        return self.net.alone and self.net.groups > 0


def followed(run: Run) -> Track:
    """The track of a run, checked: Diverged where a signal grows without bound or is no number."""
    net, course = run.net, run.course
    track = _track(run)
    warn_unsettled(net.name, track.unsettled, 4)
    t, u = course.grid[course.kept], course.given[:, course.kept]
    bad = None if run.discrete else first_bad(t, track.y)  # of it the first state is named
    if bad is not None:
        i, k, _ = bad
        where = f"output {net.signals[i]}"
        if net.looped and not net.groups:
            made = traced_net(net, run.params, called=True)  # a loop without an answer is refused
            p = made.flow.arguments(run.params)
            where = made.culprit(float(t[k]), track.x[:, k], u[:, k], p)
        else:
            where += "" if net.alone else f" of block {net.makers(net.signals[i])}"
            where += f" is {track.y[i, k]}"
        raise Diverged(f"{net.name}: {where} at t = {t[k]:.6g} s.")

    def labels() -> list[list[str]]:
        states = [net.states(sampled=kind) for kind in (False, True)]
        groups = zip(("state", "state", "output"), (*states, net.signals), strict=True)
        return [[f"{what} {name}" for name in names] for what, names in groups]

    driven = [course.given, run.start]
    bounded(net.name, t, [track.x, track.q, track.y], labels, driven, looped=net.looped)
    return track


def _track(run: Run) -> Track:
    method, why, called = run.method, "", None
    if method in (None, "rosenbrock"):
        try:
            engine = compiled(run.net, run.params)
            p = engine.program.arguments(run.params)
            _warn_of_sign(run, engine.right, p)
            late = run_late(engine, run.course, run.starts, run.params, run.accuracy)
            return late or engine.follow(run.course, *run.starts, p, run.accuracy)
        except TraceError as error:
            method, why = "LSODA", str(error)
    sampled = (part.block for part in run.net.parts if part.sampled)
    if None not in (described(block, by_trace=False) for block in sampled):  # it may count calls
        _warn_of_sign(run, set(), np.zeros(0))
    try:
        if why and run.net.groups:
            with contextlib.suppress(TraceError):
                # a sampled block that cannot be traced is called at its updates
                called = Called(run.net, run.params)
        if why and called is None:
            warnings.warn(f"{why}; LSODA is used instead.", RuntimeWarning, stacklevel=4)
        _warn_if_approximate(run)
        called = called or Called(run.net, run.params, method)
        return called.follow(run.course, *run.starts, run.accuracy)
    except RuntimeError as error:  # of a user's function
        raise Diverged(f"{run.net.name}: the simulation failed: {error}.") from error


def _warn_if_approximate(run: Run) -> None:
    """Warn of the first block with a dead time, where a run cannot keep the past of a signal."""
    times = (one for part in run.net.parts for one in dead_times(part.block, run.params))
    late = next((one for one in times if one.seconds > 0.0), None)
    if late is not None:
        warnings.warn(
            f"{late.block}: in this run its dead time of {late.seconds:g} s is the Pade "
            "approximation of order 2; it is exact where lg.simulate compiles all blocks, "
            "with its own method.",
            RuntimeWarning,
            stacklevel=5,
        )


def response(
    run: Run, track: Track, u: np.ndarray, squeeze: bool | None = None
) -> ct.TimeResponseData:
    """The response, built from its first sample and given the arrays: python-control copies."""
    net, t = run.net, run.course.grid[run.course.kept]
    states = np.empty((len(run.sampled), track.x.shape[1]))
    states[~run.sampled], states[run.sampled] = track.x, track.q
    x = None if net.alone and not len(states) else states
    found = ct.TimeResponseData(
        t[:1],
        track.y[:, :1],
        None if x is None else x[:, :1],
        u[:, :1],
        params=run.params,
        issiso=len(net.outside) == len(net.signals) == 1,
        output_labels=list(net.signals),
        input_labels=list(net.outside),
        state_labels=None if x is None else list(net.states()),
        sysname=net.name,
        title="Input/output response for " + net.name,
        squeeze=squeeze,
    )
    found.t, found.y, found.x, found.u = t, track.y, x, u
    return found


LATE = " after the delay"

COARSE = 1e-4  # error allowed in a step of a plant whose encoder is coarser than that


def simulate_sampled(
    plant: ct.NonlinearIOSystem,
    drive: ct.NonlinearIOSystem | Sequence[ct.NonlinearIOSystem],
    t: ArrayLike,
    inputs: Mapping[str, ArrayLike] | ArrayLike | None = None,
    x0: ArrayLike = 0.0,
    *,
    drive_x0: ArrayLike = 0.0,
    delay: int = 0,
    params: Mapping[str, Any] | None = None,
    rtol: float = 1e-6,
) -> ct.TimeResponseData:
    """The response of a continuous plant with sampled control, blocks connected by signal names.

    Parameters
    ----------
    plant : control.NonlinearIOSystem
        Any continuous system; its outputs are measured at the samples.
    drive : control.NonlinearIOSystem or list of them
        Discrete-time blocks of one dt (see :func:`lugrectl.sampled`) and blocks without states,
        connected by their signal names; outputs of the same name are added. An output with the
        name of a plant input is held there until the next sample.
    t : (N,) array_like
        The sample times in s, dt apart.
    inputs : dict or array_like, optional
        Signals that are outputs of neither side, by name, each a number or (N,): a reference r,
        a load d, held between samples. Those left out are 0. A number or an array (N,) or (m, N)
        gives those that the drive reads, in the order of the result's ``input_labels``.
    x0, drive_x0 : float or array_like
        Initial states of plant and drive: a number for all, or a list padded with zeros. Those of
        the delay come last in a list; a number leaves them at 0.
    delay : int
        Number of samples between the measurement and the action of its torque: 0 acts at once, 1
        is a drive that computes for one period. Before the first command the plant's inputs are
        0. An observer in the drive reads the torque at the instant of the command.
    params : dict, optional
        Parameters in place of those of the blocks, ``{"plant.Fc": 0.3}``.
    rtol : float
        Error allowed in a step of the plant, relative to the states.

    Returns
    -------
    control.TimeResponseData
        At the samples: outputs of the plant, measured before the torque of this sample acts,
        then those of the drive; states of both. Those of the delay come last.

    Raises
    ------
    InputError
        When the parts do not fit together: no common signals, a block in continuous time in the
        drive, times that are not dt apart, unknown or missing inputs.
    Diverged
        When a state or signal grows without bound; the message names it and the time.

    Examples
    --------
    A velocity loop whose controller and observer run at 1 kHz:

    >>> dt, p = 1e-3, lg.table1()
    >>> drive = [lg.error(), lg.compensation(), lg.sampled(lg.pi(1.6, 0.16), dt),
    ...          lg.sampled(lg.proposed_observer(p), dt)]
    >>> t = dt * np.arange(500)
    >>> run = lg.simulate_sampled(lg.plant(p), drive, t, {"r": 0.1 * np.sin(2 * np.pi * t)})
    >>> w = run.outputs[run.output_labels.index("w")]
    >>> bool(abs(w - 0.1 * np.sin(2 * np.pi * t)).max() < 0.01)
    True
    """
    rtol, plant = arguments.settings(rtol), arguments.system(plant, "plant")
    listed = drive if isinstance(drive, (list, tuple)) else [drive]
    blocks = [arguments.system(block, "a block of the drive") for block in listed]
    parts = _parts(plant, blocks, whole(delay, "delay"))
    arguments.parameters([part.block for part in parts], params)
    net = Net(plant.name, parts, outside((*parts[1:], parts[0])), 1, earlier=True)
    times = _even(net.name, arguments.times(t), blocks)
    if not isinstance(inputs, Mapping):
        read = {k for part in parts[1:] for k in part.inputs}
        own = [k for k in net.outside if k in read]
        rows = arguments.inputs("the drive", own, times, inputs) if inputs is not None else ()
        inputs = dict(zip(own, rows, strict=False))
    warn_unfed(net, inputs)
    u = arguments.by_name(net.name, net.outside, times, inputs)
    start = arguments.start(plant.name, parts[0].nstates, x0)
    count, is_list = net.count(True), isinstance(drive_x0, (list, tuple)) or np.ndim(drive_x0) > 0
    own = count if is_list else sum(part.nstates for part in parts[1 : 1 + len(blocks)])
    driven = arguments.start("the drive", own, drive_x0, "drive_x0")
    states = np.concatenate([start, driven, np.zeros(count - own)])
    run = Run(net, Course.along(times, u, 1, True), states, params, None, Accuracy(rtol))
    return response(run, followed(run), u)


def _even(name: str, times: np.ndarray, blocks: Sequence[Any]) -> np.ndarray:
    """The times; InputError if they are not a sample time apart."""
    known = [float(b.dt) for b in blocks if b.isdtime(strict=True) and b.dt is not True]
    steps = np.diff(times)
    dt = known[0] if known else steps[:1].sum()
    if not np.allclose(steps, dt, rtol=1e-6, atol=0.0):
        raise InputError(f"{name}: t must increase in steps of the sample time, {dt:g} s.")
    return times


def _parts(plant: Any, blocks: Sequence[Any], delay: int) -> tuple[Part, ...]:
    """The plant, the drive's blocks, and the delay between them."""
    free = [b.name for b in blocks if b.nstates and not b.isdtime(strict=True)]
    if free:
        raise InputError(
            f"{free[0]} is a continuous-time block: use sampled({free[0]}, dt) in the drive."
        )
    rates = {float(b.dt) for b in blocks if b.nstates and b.dt is not True}
    if len(rates) > 1:
        raise InputError(f"the drive's blocks have different sample times: {sorted(rates)} s.")
    logic = [Part.of(b, 0) for b in blocks]
    made = {k for part in logic for k in part.outputs}
    read = {k for part in logic for k in part.inputs}
    twice = sorted({*plant.output_labels} & made)
    if twice:
        raise InputError(f"{plant.name} and the drive both have the output {', '.join(twice)}.")
    acting = [k for k in plant.input_labels if k in made]
    if not acting or not read & {*plant.output_labels}:
        raise InputError(
            f"the drive must have one of the outputs {', '.join(plant.input_labels)} and one of "
            f"the inputs {', '.join(plant.output_labels)}: {plant.name} and the drive are "
            "connected by signal names."
        )
    if not delay:
        return Part.of(plant), *logic
    late = {k: k + LATE for k in acting}
    first = replace(Part.of(plant), inputs=tuple(late.get(k, k) for k in plant.input_labels))
    lines = [dead_time(float(delay), 1.0, name=f"delay_{k}") for k in acting]
    pairs = zip(lines, late.items(), strict=True)
    return first, *logic, *(Part(line, (k,), (later,), 0) for line, (k, later) in pairs)

"""Nets of continuous and sampled blocks: how one is made of what is given, run, and checked."""

from __future__ import annotations

import contextlib
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import control as ct
import numpy as np

from ..blocks.drive import dead_times
from ..core.errors import Diverged, InputError
from ..engine.expression.numpy_protocol import TraceError
from ..engine.runtime.adaptive_run import Accuracy, Course, Track
from ..engine.runtime.delays import run_late
from ..engine.runtime.endings import bounded, first_bad, warn_unsettled
from ..engine.runtime.interpreted_run import Called
from ..engine.runtime.memo import compiled
from ..engine.tracing.network import Net, Part
from ..engine.tracing.tracer import traced_net
from . import arguments

MOST = 1e8  # updates in a run: an array of them is 0.8 GB
NEAR = 1e-6  # of the shortest sample time: updates and times closer than that are the same


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
            late = run_late(engine, run.course, run.starts, run.params, run.accuracy)
            p = engine.program.arguments(run.params)
            return late or engine.follow(run.course, *run.starts, p, run.accuracy)
        except TraceError as error:
            method, why = "LSODA", str(error)
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

"""A continuous plant under sampled control: the torque is held between samples."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import control as ct
import numpy as np
from numpy.typing import ArrayLike

from ..blocks.block import Steady
from ..core.errors import InputError
from ..core.validation import array, whole
from ..engine.adaptive_run import Accuracy, Course
from ..engine.tracer import Net, Part
from . import arguments
from .response import Run, followed, outside
from .wiring_warnings import warn_of_wiring

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
        Initial states of plant and drive: a number for all, or a list padded with zeros.
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
        then those of the drive; states of both.

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
    rtol = arguments.settings(rtol)
    plant, listed = arguments.system(plant, "plant"), isinstance(drive, (list, tuple))
    what, given = "a block of the drive" if listed else "drive", drive if listed else [drive]
    blocks = [arguments.system(block, what) for block in given]  # pyright: ignore
    parts = _parts(plant, blocks, whole(delay, "delay"))
    arguments.parameters([part.block for part in parts], params)
    net = Net(plant.name, parts, outside((*parts[1:], parts[0])), 1, earlier=True)
    times = _grid(t, parts)
    warn_of_wiring(net, {} if inputs is None else inputs, None)
    u = _inputs(net, times, inputs)
    names = [f"drive_{block.name}_" if listed else "drive_" for block in blocks]
    pairs = zip(names, parts[1:], strict=False)
    labels = [name + k for name, p in pairs if p.nstates for k in p.block.state_labels]
    start = arguments.start(plant.name, parts[0].nstates, x0)
    name = "drive" if listed else blocks[0].name
    driven = arguments.start(name, len(labels), drive_x0, "drive_x0")
    delayed = np.zeros(net.count(True) - len(labels))  # of the delay, 0 at the start
    states = np.concatenate([start, driven, delayed])
    run = Run(net, Course.along(times, u, 1, True), states, params, None, Accuracy(rtol))
    track = followed(run)
    shown = [i for i, label in enumerate(net.signals) if not label.endswith(LATE)]
    return ct.TimeResponseData(
        times,
        track.y[shown],
        np.vstack([track.x, track.q[: len(labels)]]),
        u,
        issiso=False,
        output_labels=[net.signals[i] for i in shown],
        input_labels=list(net.outside),
        state_labels=[*(plant.state_labels if plant.nstates else ()), *labels],
        sysname=plant.name,
        title=f"Sampled response of {plant.name}",
    )


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
    n, functions = len(late), [_Delay(len(late), moves) for moves in (True, False)]
    line = ct.nlsys(*functions, inputs=n, outputs=n, states=n * delay, dt=True, name="delay")
    first = replace(Part.of(plant), inputs=tuple(late.get(k, k) for k in plant.input_labels))
    return first, *logic, Part(line, tuple(late), tuple(late.values()), 0)


@dataclass(frozen=True)
class _Delay(Steady):
    """n signals in a row of samples: how the row moves on, or what leaves it."""

    n: int
    moves: bool

    def __call__(self, t: Any, x: Any, u: Any, params: Any) -> np.ndarray:
        return np.concatenate([x[self.n :], u]) if self.moves else x[: self.n]


def _inputs(net: Net, t: np.ndarray, given: Any) -> np.ndarray:
    """Inputs by name; an array or a number gives those that the drive reads."""
    read = {k for part in net.parts[1:] for k in part.inputs}
    references = [k for k in net.outside if k in read]
    if given is None:
        given = {}
    elif not isinstance(given, Mapping):
        rows = array(given, "inputs")
        rows = [rows] * len(references) if rows.ndim == 0 else np.atleast_2d(rows)
        if len(rows) != len(references):
            raise InputError(
                f"the drive has the external inputs {', '.join(references) or '(none)'}, "
                f"but {len(rows)} were given."
            )
        given = dict(zip(references, rows, strict=True))
    return arguments.by_name(net.name, net.outside, t, given)


def _grid(t: Any, parts: Sequence[Part]) -> np.ndarray:
    times = arguments.times(t)
    known = [p.block.dt for p in parts[1:] if p.block.isdtime(strict=True)]
    dt = next((float(dt) for dt in known if dt is not True), None)
    step = np.diff(times)
    wanted = float(step[0]) if dt is None and len(step) else dt
    if len(step) and np.max(np.abs(step - wanted)) > 1e-6 * float(wanted or 1.0):
        raise InputError(f"t must increase in steps of the drive's sample time, {wanted:g} s.")
    return times

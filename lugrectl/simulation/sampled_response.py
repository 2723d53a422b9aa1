"""A continuous plant under sampled control: the torque is held between samples."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import control as ct
import numpy as np
from numpy.typing import ArrayLike

from ..core.errors import InputError
from ..core.validation import array, whole
from ..engine.runtime.course import Accuracy, Course
from ..engine.tracing.network import Net, Part
from . import arguments
from .net_run import Run, followed
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
    plant, drive = arguments.system(plant, "plant"), _drive(drive)
    parts = _parts(plant, drive, whole(delay, "delay"))
    arguments.parameters([part.block for part in parts], params)
    net = Net(plant.name, parts, _outside(parts, plant), 1, earlier=True)
    times = _grid(t, parts)
    warn_of_wiring(net, {} if inputs is None else inputs, None)
    u = _inputs(net, times, inputs)
    held = u if u.size else np.zeros((len(net.outside), len(times)))
    start = np.concatenate([_start(plant, x0), _drive_start(drive, parts, drive_x0)])
    course = Course.along(times, held, 1, True)
    track = followed(Run(net, course, start, params, None, Accuracy(rtol)))
    shown = [i for i, label in enumerate(net.signals) if not label.endswith(LATE)]
    labels = _drive_states(drive, parts)
    return ct.TimeResponseData(
        times,
        track.y[shown],
        np.vstack([track.x, track.q[: len(labels)]]),
        u,
        issiso=False,
        output_labels=[net.signals[i] for i in shown],
        input_labels=list(net.outside),
        state_labels=[*_states(plant), *labels],
        sysname=plant.name,
        title=f"Sampled response of {plant.name}",
    )


def _drive(given: Any) -> Any:
    """The drive's block or list of blocks."""
    if isinstance(given, (list, tuple)):
        return [arguments.system(block, "a block of the drive") for block in given]
    return arguments.system(given, "drive")


def _parts(plant: Any, drive: Any, delay: int) -> tuple[Part, ...]:
    """The plant, the drive's blocks, and the delay between them."""
    blocks = [drive] if isinstance(drive, ct.NonlinearIOSystem) else list(drive)
    _fit(blocks)
    logic = [Part(b, tuple(b.input_labels), tuple(b.output_labels), 0) for b in blocks]
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
    late = LATE if delay else ""
    entries = tuple(k + late if k in acting else k for k in plant.input_labels)
    first = Part(plant, entries, tuple(plant.output_labels))
    last = [_delay_part(acting, delay, blocks)] if delay else []
    return (first, *logic, *last)


def _delay_part(acting: Sequence[str], samples: int, blocks: Sequence[Any]) -> Part:
    n = len(acting)
    line = ct.nlsys(
        _Delay(n, moves=True),
        _Delay(n, moves=False),
        inputs=list(acting),
        outputs=n,
        states=n * samples,
        dt=True,
        name="delay",
    )
    return Part(line, tuple(acting), tuple(k + LATE for k in acting), 0)


@dataclass(frozen=True)
class _Delay:
    """n signals in a row of samples: how the row moves on, or what leaves it."""

    n: int
    moves: bool

    def __call__(self, t: Any, x: Any, u: Any, params: Any) -> np.ndarray:
        return np.concatenate([x[self.n :], u]) if self.moves else x[: self.n]

    def rests_on(self) -> tuple[Any, ...]:
        return ()


def _fit(blocks: Sequence[Any]) -> None:
    free = [b.name for b in blocks if b.nstates and not b.isdtime(strict=True)]
    if free:
        raise InputError(
            f"{free[0]} is a continuous-time block: use sampled({free[0]}, dt) in the drive."
        )
    rates = {float(b.dt) for b in blocks if b.nstates and b.dt is not True}
    if len(rates) > 1:
        raise InputError(f"the drive's blocks have different sample times: {sorted(rates)} s.")


def _outside(parts: Sequence[Part], plant: Any) -> tuple[str, ...]:
    """Signals that no block outputs: first those the drive reads, then those of the plant only."""
    made = {k for part in parts for k in part.outputs}
    ordered = [k for part in (*parts[1:], parts[0]) for k in part.inputs]
    return tuple(dict.fromkeys(k for k in ordered if k not in made))


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


def _states(system: Any) -> list[str]:
    return list(system.state_labels or ()) if system.nstates else []


def _drive_states(drive: Any, parts: Sequence[Part]) -> list[str]:
    if isinstance(drive, ct.NonlinearIOSystem):
        return [f"drive_{k}" for k in _states(drive)]
    blocks = [p.block for p in parts[1:] if not p.outputs[0].endswith(LATE)]
    return [f"drive_{b.name}_{k}" for b in blocks for k in _states(b)]


def _drive_start(drive: Any, parts: Sequence[Part], x0: Any) -> np.ndarray:
    """The drive's states, then those of the delay, which are 0 at the start."""
    count, own = sum(p.nstates for p in parts[1:]), len(_drive_states(drive, parts))
    single = isinstance(drive, ct.NonlinearIOSystem)
    start = arguments.start(drive.name if single else "drive", own, x0, "drive_x0")
    return np.concatenate([start, np.zeros(count - own)])


def _start(system: Any, x0: Any) -> np.ndarray:
    return arguments.start(system.name, int(system.nstates or 0), x0)

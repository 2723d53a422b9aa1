"""A continuous plant under sampled control: the torque is held between samples."""

from __future__ import annotations

import warnings
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import control as ct
import numpy as np
from numpy.typing import ArrayLike

from .engine.adaptive import Diverged
from .engine.compiled import compiled
from .errors import InputError


def simulate_sampled(
    plant: ct.NonlinearIOSystem,
    drive: ct.NonlinearIOSystem | Sequence[ct.NonlinearIOSystem],
    t: ArrayLike,
    inputs: Mapping[str, ArrayLike] | ArrayLike | None = None,
    x0: ArrayLike = 0.0,
    *,
    drive_x0: ArrayLike = 0.0,
    delay: int = 0,
    rtol: float = 1e-6,
) -> ct.TimeResponseData:
    """The response of a continuous plant whose inputs come from sampled blocks, wired by names.

    Parameters
    ----------
    plant : control.NonlinearIOSystem
        Any continuous system; its outputs are measured at the samples.
    drive : control.NonlinearIOSystem or list of them
        Discrete-time blocks of one dt (see :func:`lugrectl.sampled`) and blocks without states,
        wired among themselves by their signal names; equal output names add up. What they put
        out under the name of a plant input is held there until the next sample.
    t : (N,) array_like
        The sample times in s, dt apart.
    inputs : dict or array_like, optional
        Signals that neither side puts out, by name, each a number or (N,): a reference r, a load
        d, held between samples. Those left out are 0. A number or an array (N,) or (m, N) stands
        for those that the drive reads, in the order of the result's ``input_labels``.
    x0, drive_x0 : float or array_like
        Initial states of plant and drive: a number for all, or a list padded with zeros.
    delay : int
        Samples between the measurement and the moment its torque acts: 0 acts at once, 1 is a
        drive that computes for one period. Inputs before the first are 0. An observer in the
        drive sees the torque when it is commanded.
    rtol : float
        Error allowed in a step of the plant, relative to the states.

    Returns
    -------
    control.TimeResponseData
        At the samples: outputs of the plant, as measured before this sample's torque acts, then
        of the drive; states of both.

    Raises
    ------
    InputError
        When the parts do not fit together: no common signals, a block in continuous time in the
        drive, times that are not dt apart, unknown or missing inputs.
    Diverged
        When a state or signal grows without bound: names it and the time.
    TraceError
        When the plant's functions cannot be followed (``lugrectl.engine``).

    Examples
    --------
    >>> dt, p = 1e-3, lg.table1()
    >>> drive = [lg.error(), lg.compensation(), lg.sampled(lg.pi(1.6, 0.16), dt),
    ...          lg.sampled(lg.proposed_observer(p), dt)]
    >>> t = dt * np.arange(1000)
    >>> resp = lg.simulate_sampled(lg.plant(p), drive, t, 0.1 * np.sin(6.28 * t))
    """
    logic = drive if isinstance(drive, ct.NonlinearIOSystem) else _wired(drive)
    wiring = _Wiring.of(plant, logic)
    times = _grid(t, logic)
    given = wiring.signals(inputs, len(times))
    if int(delay) != delay or delay < 0:
        raise InputError(f"delay is a whole number of samples, 0 or more, not {delay!r}.")
    starts = _start(plant, x0), _start(logic, drive_x0)
    with np.errstate(all="ignore"):  # what is not finite is refused by name
        states, y = _run(plant, logic, wiring, times, given, starts, int(delay), rtol)
    return ct.TimeResponseData(
        times,
        y,
        states,
        np.array([given[k] for k in wiring.outside]).reshape(-1, len(times)),
        issiso=False,
        output_labels=[*plant.output_labels, *logic.output_labels],
        input_labels=list(wiring.outside),
        state_labels=[*_states(plant), *(f"drive_{k}" for k in _states(logic))],
        sysname=plant.name,
        title=f"Sampled response of {plant.name}",
    )


def _run(
    plant: Any,
    logic: Any,
    wiring: _Wiring,
    t: np.ndarray,
    given: Mapping[str, np.ndarray],
    starts: tuple[np.ndarray, np.ndarray],
    delay: int,
    rtol: float,
) -> tuple[np.ndarray, np.ndarray]:
    """States (n, N) and outputs (ny, N) of both sides at the samples."""
    engine = compiled(plant)
    p = engine.program.arguments(None)
    plant._update_params(None)
    blocks = _Blocks(logic)
    u, v = (_rows(side.input_labels, given, len(t)) for side in (plant, logic))
    acting = np.zeros(len(wiring.acting))
    waiting = deque([acting] * delay)
    states, y, unsettled = [], [], []
    x, s = starts
    for k, now in enumerate(t):
        u[wiring.acted, k] = acting
        measured = plant._out(now, x, u[:, k])
        v[wiring.reading, k] = measured[wiring.read]
        answer, following = blocks.step(now, s, v[:, k])
        states.append(np.concatenate([x, s]))
        y.append(np.concatenate([measured, answer]))
        _all_finite(y[-1], plant, logic, now)
        if k + 1 == len(t):
            break
        waiting.append(answer[wiring.acting])
        u[wiring.acted, k] = acting = waiting.popleft()
        s = following()
        if plant.nstates:
            held = np.column_stack([u[:, k], u[:, k]])
            part = engine.run(t[k : k + 2], held, x, p, hold=True, rtol=rtol)
            x = part.states[:, -1]
            unsettled += [part.unsettled] if np.isfinite(part.unsettled) else []
    if unsettled:
        warnings.warn(
            f"{plant.name}: a sign or comparison switches without end near t = "
            f"{unsettled[0]:.6g} s; the result there is coarse: write np.tanh(w/eps) for "
            "np.sign(w).",
            RuntimeWarning,
            stacklevel=3,
        )
    return np.array(states).T, np.array(y).T


class _Blocks:
    """The drive's blocks, evaluated only where an input has changed: much quicker than
    python-control's passes over all of them."""

    def __init__(self, logic: Any) -> None:
        logic._update_params(None)
        whole = isinstance(logic, ct.InterconnectedSystem)
        self.name, self.parts = logic.name, logic.syslist if whole else [logic]
        m, n = logic.ninputs, logic.noutputs
        self.connect = logic.connect_map if whole else np.zeros((m, n))
        self.feed = logic.input_map if whole else np.eye(m)
        self.out = logic.output_map if whole else np.eye(n, n + m)
        slices = [self._slices(count) for count in ("ninputs", "noutputs", "nstates")]
        self.places = list(zip(*slices, strict=True))
        self.y = np.zeros(self.connect.shape[1])

    def _slices(self, count: str) -> list[slice]:
        ends = np.cumsum([getattr(part, count) or 0 for part in self.parts]).tolist()
        return [slice(a, b) for a, b in zip([0, *ends], ends, strict=False)]

    def step(self, t: float, s: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, Any]:
        """The outputs at this sample, and a function that returns the states at the next."""
        outside, y = self.feed @ v, self.y
        inputs: list[Any] = [None] * len(self.parts)
        changed, passes = True, 0
        while changed:
            changed, passes = False, passes + 1
            if passes > len(self.parts) + 1:
                if not np.isfinite(y).all():
                    break  # 0 * inf in the wiring never settles
                raise InputError(f"{self.name}: an output depends on itself within one sample.")
            for k, (part, (i, o, x)) in enumerate(zip(self.parts, self.places, strict=True)):
                u = outside[i] + self.connect[i] @ y
                if inputs[k] is None or u.tobytes() != inputs[k].tobytes():
                    inputs[k], changed = u, True
                    y[o] = part._out(t, s[x], u)

        def following() -> np.ndarray:
            rows = [
                part._rhs(t, s[x], u)
                for part, (_, _, x), u in zip(self.parts, self.places, inputs, strict=True)
                if part.nstates
            ]
            return np.concatenate(rows) if rows else s

        return self.out @ np.concatenate([y, *inputs]), following


@dataclass(frozen=True)
class _Wiring:
    """Which signals go where, by position: the drive's outputs ``acting`` on the plant inputs
    ``acted``, the plant outputs ``read`` by the drive's inputs ``reading``."""

    acting: list[int]
    acted: list[int]
    read: list[int]
    reading: list[int]
    outside: tuple[str, ...]
    references: tuple[str, ...]

    @classmethod
    def of(cls, plant: Any, logic: Any) -> _Wiring:
        twice = sorted({*plant.output_labels} & {*logic.output_labels})
        if twice:
            raise InputError(f"{plant.name} and the drive both put out {', '.join(twice)}.")
        acting = [k for k in logic.output_labels if k in plant.input_labels]
        reading = [k for k in logic.input_labels if k in plant.output_labels]
        if not acting or not reading:
            raise InputError(
                f"the drive must put out one of {', '.join(plant.input_labels)} and read one of "
                f"{', '.join(plant.output_labels)}: {plant.name} and the drive are wired by names."
            )
        references = [k for k in logic.input_labels if k not in reading]
        loads = [k for k in plant.input_labels if k not in [*acting, *references]]
        return cls(
            [logic.output_labels.index(k) for k in acting],
            [plant.input_labels.index(k) for k in acting],
            [plant.output_labels.index(k) for k in reading],
            [logic.input_labels.index(k) for k in reading],
            (*references, *loads),
            tuple(references),
        )

    def signals(self, inputs: Any, samples: int) -> dict[str, np.ndarray]:
        """The outside signals by name, each (N,)."""
        named = inputs
        if inputs is None or np.ndim(inputs) == 0 and not isinstance(inputs, Mapping):
            named = dict.fromkeys(self.references, 0.0 if inputs is None else inputs)
        elif not isinstance(inputs, Mapping):
            rows = np.atleast_2d(np.asarray(inputs, dtype=float))
            if len(rows) != len(self.references):
                raise InputError(
                    f"the drive reads {', '.join(self.references) or 'nothing'} from outside, "
                    f"but there are {len(rows)} inputs."
                )
            named = dict(zip(self.references, rows, strict=True))
        strange = [k for k in named if k not in self.outside]
        if strange:
            raise InputError(
                f"no input '{strange[0]}' comes from outside; there are {', '.join(self.outside)}."
            )
        return {k: _series(k, named.get(k, 0.0), samples) for k in self.outside}


def _series(label: str, values: Any, samples: int) -> np.ndarray:
    row = np.asarray(values, dtype=float)
    if row.shape not in ((), (samples,)) or not np.all(np.isfinite(row)):
        raise InputError(f"input {label} must be a finite number or {samples} of them.")
    return np.array(np.broadcast_to(row, (samples,)))


def _rows(labels: Sequence[str], given: Mapping[str, np.ndarray], samples: int) -> np.ndarray:
    rows = [given.get(k, np.zeros(samples)) for k in labels]
    return np.array(rows, dtype=float).reshape(len(labels), samples)


def _wired(blocks: Sequence[Any]) -> Any:
    """The drive's blocks as one system: all outputs, and the inputs that none of them puts out."""
    free = [b.name for b in blocks if b.nstates and not b.isdtime(strict=True)]
    if free:
        raise InputError(
            f"{free[0]} runs in continuous time: give the drive sampled({free[0]}, dt)."
        )
    rates = {float(b.dt) for b in blocks if b.nstates}
    if len(rates) > 1:
        raise InputError(f"the drive's blocks have different sample times: {sorted(rates)} s.")
    outputs = list(dict.fromkeys(k for b in blocks for k in b.output_labels))
    needed = dict.fromkeys(k for b in blocks for k in b.input_labels)
    inputs = [k for k in needed if k not in outputs]
    return ct.interconnect(
        list(blocks), inputs=inputs, outputs=outputs, params={}, check_unused=False, name="drive"
    )


def _grid(t: Any, logic: Any) -> np.ndarray:
    times = np.array(t, dtype=float)
    if times.ndim != 1 or not len(times) or not np.all(np.isfinite(times)):
        raise InputError("t must be a list of finite times.")
    dt = logic.dt if logic.isdtime(strict=True) and logic.dt is not True else None
    step = np.diff(times)
    if logic.nstates and dt is None:
        raise InputError(f"{logic.name} has no sample time: make it of sampled(block, dt).")
    wanted = float(step[0]) if dt is None and len(step) else dt
    if len(step) and np.max(np.abs(step - wanted)) > 1e-6 * float(wanted or 1.0):
        raise InputError(f"t must go in steps of the drive's sample time, {wanted:g} s.")
    return times


def _states(system: Any) -> list[str]:
    return list(system.state_labels or ()) if system.nstates else []


def _start(system: Any, x0: Any) -> np.ndarray:
    start = np.asarray(x0, dtype=float)
    if start.ndim == 0:
        return np.full(system.nstates or 0, float(start))
    if start.ndim != 1 or len(start) > (system.nstates or 0):
        raise InputError(f"{system.name} has {system.nstates} states, x0 has {start.shape}.")
    return np.concatenate([start, np.zeros(system.nstates - len(start))])


def _all_finite(y: np.ndarray, plant: Any, logic: Any, now: float) -> None:
    bad = np.flatnonzero(~np.isfinite(y))
    if len(bad):
        label = [*plant.output_labels, *logic.output_labels][bad[0]]
        raise Diverged(f"{plant.name}: output {label} is {y[bad[0]]} at t = {now:.6g} s.")

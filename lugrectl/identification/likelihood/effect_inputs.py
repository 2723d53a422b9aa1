"""Input series of effects outside the plant, evaluated along the log of measured motion."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...blocks.block import Block, members
from ...blocks.embedding import Part as Placed
from ...blocks.embedding import borrowed
from ...blocks.model import Model, Part
from ...blocks.plant import STAGES, stage
from ...engine.runtime.batch_run import Lanes
from ...engine.runtime.memo import keep
from ...engine.tracing.tracer import traced
from ..dataset.dataset import Data, Log
from ..dataset.run_effects import WARMED, along, displaced

LEAD = 2.0  # s, lead-in of an effect with states before its output is used
STRETCH = 6.0  # s, length of the output used after that
SHORT = 1.0  # s, the same without numba: NumPy is slow per step, not per lane
STEP = 1e-3  # s, approximate integration step of such an effect

UNDOING = 15  # iterations to remove a sensor's error

Values = Mapping[str, float]
Memory = dict[tuple, Any]  # output along the log, by part and its values


@dataclass(frozen=True)
class Fed:
    """Inputs that effects add to the plant, each (N,): torque applied, loads and other torques on
    the resisting side, relative changes of levels; ``error`` of the sensed theta, w, (N, 2)."""

    u: np.ndarray
    load: np.ndarray
    torque: np.ndarray
    levels: dict[str, np.ndarray]
    error: np.ndarray | None


def feed(
    model: Model,
    outside: Collection[str],
    values: Values,
    data: Data,
    levels: Sequence[str],
    memory: Memory | None = None,
) -> Fed:
    """The effects with the keys ``outside`` along the log, in the order of the physics."""
    log, zero = data.log, np.zeros(len(data.u))
    sensors = [p for p in model.effects if p.key in outside and "sensor" in p.block.acts]
    shift = displaced(model, data, values)
    agreeing = log if shift is None else replace(log, theta=log.theta + shift)
    signals, error = _behind_sensors(sensors, values, agreeing)
    if shift is not None:
        error = (0.0 if error is None else error) - np.outer(shift, [1.0, 0.0])
    load, torque = data.d, zero
    x = dict.fromkeys(levels, zero)
    if data.differing:
        signals["u"] = signals["u"] - along(data, values, "offset")
        friction = along(data, values, "friction")
        x |= {name: friction for name in WARMED if name in x}
    whole = dict(x)  # with the changes by effects inside the plant
    borrowing = any(depends_on_plant(p) for p in model.effects if p.key in outside)
    for part in sorted(model.effects, key=lambda part: STAGES.index(stage(part.block))):
        block, fed = part.block, part.key in outside
        lends = borrowing and stage(block) == "level" and not block.states
        if not (fed or block.load or lends) or "sensor" in block.acts:
            continue
        own = {k: values[f"{part.key}.{k}"] for k in block.own}
        if block.own.keys() != block.parameters.keys():
            plain = stage(block) == "level"
            own |= borrowed(block, values if plain else _changed(values, whole, zero))
        out = _outputs(part, signals, own, values, log, memory)
        for act, change in block.deeds(out):
            if act == "input":
                signals["u"] = change
            elif block.load:
                signals["load"] = signals["load"] + change
                load = load + change if fed else load
            elif act == "torque":
                torque = torque + change
            elif act.removeprefix("+") in x:
                for made in (x, whole) if fed else (whole,):
                    _change(made, act, change, values)
    return Fed(signals["u"], load, torque, x, error)


def _change(x: dict[str, np.ndarray], act: str, change: Any, values: Values) -> None:
    """Change a level: times 1 + change, or plus the change if the act starts with "+"."""
    name = act.removeprefix("+")
    if act == name:
        x[name] = (1.0 + x[name]) * (1.0 + change) - 1.0
    else:
        x[name] = x[name] + change / np.maximum(values[name], 1e-12)


def _changed(values: Values, x: Mapping[str, np.ndarray], zero: np.ndarray) -> dict[str, Any]:
    """The plant's values; an array along the log for each level that ``x`` changes."""
    plant = {k: v for k, v in values.items() if "." not in k}
    return plant | {k: plant[k] * (1.0 + d) for k, d in x.items() if k in plant and d is not zero}


def _behind_sensors(
    parts: Sequence[Part], values: Values, log: Log
) -> tuple[dict[str, Any], np.ndarray | None]:
    """The true signals from which these sensors measure the log, and the sensor error at the
    samples.

    The sensor equations are inverted by iteration. For sensors with states, the error is that
    computed from the measured motion.
    """
    signals: dict[str, Any] = log.signals
    if not parts:
        return signals, None
    total = np.zeros((len(log.t), 2))
    for part in reversed(parts):
        own = {k: values[f"{part.key}.{k}"] for k in part.block.own}
        measured = np.column_stack([signals["theta"], signals["w"]])
        error, before = np.zeros_like(measured), np.inf
        for _ in range(1 if part.block.states else UNDOING):
            signals["theta"], signals["w"] = (measured - error).T
            out = dict(zip(part.block.fresh, _outputs(part, signals, own, values, log, None),
                           strict=True))  # fmt: skip
            said = np.column_stack([out["theta_m"], out["w_m"]])
            error = said - (measured - error)
            change, before = abs(float(np.sum(error)) - before), float(np.sum(error))
            if change < 1e-12:
                break
        signals["theta"], signals["w"] = (measured - error).T
        total += error
    for a, b in log.runs:  # from the middles of the intervals to the samples
        total[a + 1 : b] = 0.5 * (total[a : b - 1] + total[a + 1 : b])
    return signals, total


def depends_on_plant(part: Part) -> bool:
    """True if the series of an effect depends on the plant's own values."""
    shared = any(p.shared for p in part.block.parameters.values())
    return shared or any(act.startswith("+") for act in part.block.acts)


def _outputs(
    part: Part,
    signals: Mapping[str, Any],
    own: Mapping[str, Any],
    values: Values,
    log: Log,
    memory: Memory | None,
) -> list[np.ndarray]:
    block = part.block
    if block.exact is not None:
        return [block.exact(signals["u"], log.dt, **own)]
    if block.states:
        numbers = Placed(f"{part.key}.", block).arguments(values)
        made = (memory or {}).get(run_as(part, values))
        made = run_alone(block, log, signals, [numbers])[0] if made is None else made
        return list(made.T[: len(block.fresh)])
    known = memory if _is_plain(block, signals, own, log) else None
    key = (part.key, *own.values())
    if known and key in known:
        return known[key]
    out = block(*_read(block, signals), **own)[: len(block.fresh)]
    made = [np.broadcast_to(o, np.broadcast_shapes(np.shape(o), log.t.shape)) for o in out]
    if known is not None:
        known[key] = made
    return made


def _is_plain(block: Block, signals: Mapping[str, Any], own: Mapping[str, Any], log: Log) -> bool:
    """True if an effect uses the unmodified log, so that equal values give an equal output."""
    raw = all(signals[k] is getattr(log, k) for k in block.inputs)
    return raw and not any(isinstance(v, np.ndarray) for v in own.values())


def _read(block: Block, signals: Mapping[str, Any]) -> list[Any]:
    return [signals[name] for name in block.reads]


def run_as(part: Part, values: Values) -> tuple:
    """Key of an effect with states in the memory."""
    return (part.key, *Placed(f"{part.key}.", part.block).arguments(values).values())


_engines: dict[Any, Lanes] = {}


def _engine(block: Block) -> Lanes:
    """Engine of a block by itself, with its outputs followed by its states.

    A block of the user is traced each time: a cell that runs again declares another block, and
    what its function reads may have changed.
    """
    made = members(block.kind)[block.name]
    made = made.with_inputs(tuple(k for k in block.inputs if k in made.parameters))
    whole = replace(made, outputs=(*made.fresh, *made.states))
    key: Any = (block.kind, block.name, block.inputs)
    if not whole.is_steady():
        key = traced(whole.bare()).outline()
    engine = _engines.get(key)
    if engine is None:
        engine = Lanes(whole.bare(), outputs=whole.outputs)
        keep(_engines, key, engine)
    return engine


def run_alone(
    block: Block, log: Log, signals: Mapping[str, Any], sets: Sequence[Values]
) -> np.ndarray:
    """Outputs and states (sets, N, both) of a block with states, driven by the log's signals.

    The log is cut into stretches that run in parallel, each with a lead-in from equilibrium. The
    step is fixed: dynamics too fast for it follow without delay (L-stable).
    """
    engine = _engine(block)
    many, u = len(sets), np.column_stack([signals[name] for name in block.inputs])
    keys = [name.split(".", 1)[1] for name in engine.parameters]
    p = np.array([[float(v[k]) for k in keys] for v in sets])
    y = np.zeros((many, len(log.t), len(engine.outputs)))
    counts = STRETCH if engine.compiled else SHORT
    stretch, lead = (max(2, round(s / log.dt)) for s in (counts, LEAD))
    for a, b in log.runs:
        length = min(b - a, stretch + lead)
        starts = [max(a, min(c - lead, b - length)) for c in range(a, b, stretch)]
        x0 = [[_rest(name, signals, s) for name in block.start] for s in starts]
        out, _ = engine.run(
            np.tile(np.array(x0, dtype=float).reshape(len(starts), -1), (many, 1)),
            np.tile(starts, many),
            length,
            u,
            np.repeat(p, len(starts), axis=0),
            dt=log.dt,
            t0=float(log.t[a] - a * log.dt),
            substeps=max(1, round(log.dt / STEP)),
            rtol=np.inf,
        )
        out = out.reshape(many, len(starts), length, -1)
        for i, (s, c) in enumerate(zip(starts, range(a, b, stretch), strict=True)):
            y[:, c : min(c + stretch, b)] = out[:, i, c - s : min(c + stretch, b) - s]
    return y


def _rest(name: str, signals: Mapping[str, Any], at: int) -> float:
    return 0.0 if name == "0" else float(signals[name][at])

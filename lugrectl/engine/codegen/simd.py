"""Code of the loop over lanes for a processor that computes several lanes at once."""

from __future__ import annotations

from collections.abc import Iterable

from ..expression.graph import reachable
from ..expression.operations import LIBRARY, OPS, WIDTH
from ..tracing.equations import Program
from .fixed_step import correction, fixed_step, trial, unpack
from .python_source import Emitter, indent
from .relay import relays

PLAIN = {"abs", "sqrt", "tanh"}  # available in processors, or written by other functions

# each place takes the next lane as soon as its own is done; none waits for another
_LOOP = """
import numpy as np


@fast
def run(x_start, start, length, u, series, p, y, gain, correct, dull, half, t0, dt, substeps, rtol,
        floor, y_hat, x_end, first, last):
    whole = dt / substeps
    lane_at, sample_at = np.zeros({width}, int), np.zeros({width}, int)
    turn_at = np.zeros({width}, int)
{rooms}
    for l in range({width}):
        lane = first
{unpack}
{keep}
        lane_at[l], sample_at[l] = -1, length
    following = first
    unfinished = 1.0
    while unfinished > 0.0:
        unfinished = 0.0
        for l in range({width}):
            if left_at[l] <= 0.0:
                lane, j, i = lane_at[l], sample_at[l], turn_at[l] + 1
                if i >= substeps:
                    j, i = j + 1, 0
                if j >= length:
                    if lane >= 0:
{finish}
                    lane = -1
                    if following < last:
                        lane, j, i = following, 0, 0
                        following = following + 1
{take}
                lane_at[l], sample_at[l], turn_at[l] = lane, j, i
                if lane >= 0:
                    own, k = series[lane], start[lane] + j
                    t = t0[lane] + (k + i / substeps) * dt
{read}
{keep_read}
                    if i == 0:
{load}
{output}
                        if correct:
{correct}
{scale}
{keep_moving}
                    t_at[l], left_at[l], h_at[l] = t, whole, whole
            unfinished = unfinished + left_at[l]
        for l in range({width}):
{load_step}
{step}
"""

# a place without a lane makes steps of zero length, which change nothing
_STEP = """
{before}
{code}
error = ({error}) if abs({state}) < inf else 0.0
good = 1.0 if error <= rtol or h <= shortest else 0.0
{back}
tired = {tired} if error > rtol else 1.0
shortest_at[l] = shortest * tired if good > 0.0 else shortest
growth = 0.8 * sqrt(sqrt(rtol / max(error, 1e-30)))
growth = min(max(growth, 0.1), 5.0) if growth == growth else 0.1
{shorten}
left = left - h if good > 0.0 else left
t_at[l] = t + h if good > 0.0 else t
left_at[l] = left
spent_at[l] = spent + 1.0
h_at[l] = left if good > 0.0 and (spent > most{landed}) else min(left, h * growth)
{advance}
"""


def is_wide(program: Program) -> bool:
    """Whether each operation of a program's step is available for several numbers at once."""
    new, error = fixed_step(program, relays(program))
    calls = {OPS[n.op].scalar.partition("(")[0] for n in reachable(new + error) if n.args}
    return {call for call in calls if call.isidentifier()} <= {*LIBRARY, *PLAIN}


def wide_code(program: Program) -> str:
    """The function ``run``, which works through the lanes by blocks of ``WIDTH``."""
    fixed = [node.value for node in program.p]
    at_sample, at_step = Emitter("wide", "a", fixed), Emitter("wide", "b", fixed)
    outputs = at_sample.write(program.y)
    states, inputs = ([node.value for node in of] for of in (program.x, program.u))
    advance = [f"{x}_at[l] = n{i} if good > 0.0 else {x}" for i, x in enumerate(states)]
    step = trial(program, "wide", at_step, _STEP, advance)
    scales = [f"s{i}" for i in range(len(states))]
    known = [
        *fixed,
        "shortest",
        "spent",
        *(line.split(" = ")[0] for line in at_sample.head + at_step.head),
    ]
    moving = [*states, *scales]
    rooms = [*known, *moving, *inputs, "t", "left", "h"]
    read = [f"{name} = u[own, k, {i}]" for i, name in enumerate(inputs)]
    store = [f"y_hat[lane, j, {i}] = {code}" for i, code in enumerate(outputs)]
    taken = [*unpack(program, "scalar"), *at_sample.head, *at_step.head]
    return _LOOP.format(
        width=WIDTH,
        rooms=indent([f"{name}_at = np.zeros({WIDTH})" for name in rooms], 1),
        unpack=indent(taken, 2),
        keep=indent(_kept([*known, *moving]), 2),
        take=indent([*taken, *_kept([*known, *moving])], 6),
        finish=indent([f"x_end[lane, {i}] = {x}_at[l]" for i, x in enumerate(states)], 6),
        read=indent(read, 5),
        keep_read=indent(_kept(inputs), 5),
        load=indent(_loaded([*known, *moving]), 6),
        output=indent([*at_sample.body, *store], 6),
        correct=indent(correction(outputs, states, "scalar"), 7),
        scale=indent([f"s{i} = max(s{i}, abs({x}))" for i, x in enumerate(states)], 6),
        keep_moving=indent(_kept(moving), 6),
        load_step=indent(_loaded(rooms), 3),
        step=indent(step, 3),
    )


def _kept(names: Iterable[str]) -> list[str]:
    return [f"{name}_at[l] = {name}" for name in names]


def _loaded(names: Iterable[str]) -> list[str]:
    return [f"{name} = {name}_at[l]" for name in names]

"""Code of a run that alternates between updates of sampled blocks and continuous flow."""

from __future__ import annotations

from collections.abc import Sequence

from ..tracing.tracer import Hybrid, Tick
from .adaptive_step import adaptive_code
from .outputs import unpacked
from .python_source import Emitter, Section, indent, summed

# x are the continuous states, q the sampled ones, u the external inputs followed by the values
# held between updates (ticks). column[k] is where the grid point is stored, -1: not stored.
_RUN = """
import numpy as np

{robust}
@fast
def alternate(
    grid, given, ticks, flags, column, held, p, rtol, floor, x, q, h, x_out, q_out, h_out, b_out,
    status
):
{unpack}
{head}
    last, k = len(grid) - 1, 0
    while True:
        c = column[k]
        if c >= 0:
{before}
        if ticks[k]:
            t = grid[k]
{read}
{tick}
            if not isfinite({total}):
{keep}
                status[1] = t
                return 2
        if c >= 0:
{store}
        if k == last:
{keep_last}
            return 0
        j = k + 1
        while j < last and not ticks[j]:
            j += 1
{flow}
        k = j
"""

_COMPILED_FLOW = """
size = j - k + 1
times, rows, part = np.empty(size), np.empty(({inputs}, size)), np.empty(({states}, size))
for i in range(size):
    times[i] = grid[k + i]
{rows}
"""

_PYTHON_FLOW = """
size = j - k + 1
times, part = grid[k : j + 1], [[0.0] * size for _ in range({states})]
rows = [{rows}]
"""

_ADVANCE = """
if not run(times, rows, held, x, p, rtol, floor, part, status):
    return 1
for i in range(1, size - 1):
    c = column[k + i]
    if c >= 0:
{store}
{end}
"""


def held_code(hybrid: Hybrid, tick: Tick, kind: str) -> str:
    """The function ``alternate``, with the ``run`` of the flow; ``kind`` "compiled" or
    "python"."""
    flow, outside, guarded = hybrid.flow, range(len(hybrid.net.outside)), kind == "python"
    fixed = [] if guarded else [node.value for node in flow.p]
    held, own = [node.value for node in flow.u[len(outside) :]], [q.value for q in tick.q]
    updates = Section([*own, *held], hybrid.ticked, "k", fixed, at_once=True)
    given = [f"given{i} = given[{i}]" for i in outside]
    unpack = [f"{p.value} = p[{i}]" for i, p in enumerate(flow.p)] + given
    unpack += _each("{1} = q[{0}]", own) + _each("{1} = h[{0}]", held)
    keep = indent(_each("q[{0}] = {1}", own) + _each("h[{0}] = {1}", held), 3)
    states = [x.value for x in flow.x]
    read = _each("{1} = x[{0}]", states) + [f"u{i} = given{i}[k]" for i in outside]
    store_q, store_h = _each("q_out[{0}][c] = {1}", own), _each("h_out[{0}][c] = {1}", held)
    store_b = _each("b_out[{0}][c] = {1}", held) if hybrid.net.earlier else []
    text = _RUN.format(
        robust=updates.robust() if guarded else "",
        unpack=indent(unpack, 1),
        head=indent(updates.emitter.head, 1),
        before=indent(store_q + store_b, 3),
        read=indent(read + [f"{g.value} = flags[{i}][k]" for i, g in enumerate(tick.g)], 3),
        tick=indent(updates.lines(guarded), 3),
        total=summed([f"0.0 * {name}" for name in (*own, *held)]),
        keep=indent(keep.split("\n"), 1),
        keep_last=keep,
        store=indent(_each("x_out[{0}][c] = x[{0}]", states) + store_h, 3),
        flow=indent(_flow(hybrid, kind, held, store_q + store_h + store_b), 2),
    )
    return (adaptive_code(flow, kind) if states else "") + text


def _each(line: str, names: Sequence[str]) -> list[str]:
    return [line.format(i, name) for i, name in enumerate(names)]


def _flow(hybrid: Hybrid, kind: str, held: Sequence[str], kept: Sequence[str]) -> list[str]:
    states, outside = [x.value for x in hybrid.flow.x], range(len(hybrid.net.outside))
    if not states:
        lines = ["for i in range(1, j - k):", "    c = column[k + i]", "    if c >= 0:"]
        return lines + ["        " + line for line in kept or ["pass"]]
    if kind == "compiled":
        rows = [f"rows[{i}, i] = given{i}[k + i]" for i in outside]
        rows += [f"rows[{len(outside) + i}, i] = {name}" for i, name in enumerate(held)]
        inputs = len(hybrid.flow.u)
        text = _COMPILED_FLOW.format(inputs=inputs, states=len(states), rows=indent(rows, 1))
    else:
        rows = [f"given{i}[k : j + 1]" for i in outside]
        rows += [f"[{name}] * size" for name in held]
        text = _PYTHON_FLOW.format(states=len(states), rows=", ".join(rows))
    inside = _each("x_out[{0}][c] = part[{0}][i]", states)
    end = "\n".join(_each("x[{0}] = part[{0}][size - 1]", states))
    return (text + _ADVANCE.format(store=indent(inside + [*kept], 2), end=end)).strip().split("\n")


def signal_code(hybrid: Hybrid) -> str:
    """The function ``signals``: all signals along the kept grid points."""
    flow, emitter = hybrid.flow, Emitter("array")
    codes = emitter.write(flow.y)
    count = len(hybrid.net.held) if hybrid.net.earlier else 0
    lines = unpacked(flow) + [f"b{i} = b[{i}]" for i in range(count)]
    lines += emitter.body + [f"y[{i}] = {code}" for i, code in enumerate(codes)]
    return f"def signals(t, x, u, b, p, y):\n{indent(lines, 1)}\n"

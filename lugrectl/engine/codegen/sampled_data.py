"""Code of a run that alternates between updates of sampled blocks and continuous flow."""

from __future__ import annotations

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
    guarded = kind == "python"
    fixed = [] if guarded else [node.value for node in hybrid.flow.p]
    targets = _targets(hybrid, tick)
    updates = Section(targets, hybrid.ticked, "k", fixed, at_once=True)
    text = _RUN.format(
        robust=updates.robust() if guarded else "",
        unpack=indent(_unpack(hybrid, tick), 1),
        head=indent(updates.emitter.head, 1),
        before=indent(_store("q", hybrid) + _store("b", hybrid), 3),
        read=indent(_read(hybrid, tick), 3),
        tick=indent(updates.lines(guarded), 3),
        total=summed([f"0.0 * {name}" for name in targets]),
        keep=indent(_keep(hybrid, tick), 4),
        keep_last=indent(_keep(hybrid, tick), 3),
        store=indent(_store("x", hybrid) + _store("h", hybrid), 3),
        flow=indent(_flow(hybrid, kind), 2),
    )
    return (adaptive_code(hybrid.flow, kind) if hybrid.flow.x else "") + text


def _held(hybrid: Hybrid) -> list[str]:
    return [node.value for node in hybrid.flow.u[len(hybrid.net.outside) :]]


def _targets(hybrid: Hybrid, tick: Tick) -> list[str]:
    return [node.value for node in tick.q] + _held(hybrid)


def _unpack(hybrid: Hybrid, tick: Tick) -> list[str]:
    lines = [f"{p.value} = p[{i}]" for i, p in enumerate(hybrid.flow.p)]
    lines += [f"given{i} = given[{i}]" for i in range(len(hybrid.net.outside))]
    lines += [f"{q.value} = q[{i}]" for i, q in enumerate(tick.q)]
    return lines + [f"{name} = h[{i}]" for i, name in enumerate(_held(hybrid))]


def _read(hybrid: Hybrid, tick: Tick) -> list[str]:
    lines = [f"{x.value} = x[{i}]" for i, x in enumerate(hybrid.flow.x)]
    lines += [f"u{i} = given{i}[k]" for i in range(len(hybrid.net.outside))]
    return lines + [f"{g.value} = flags[{i}][k]" for i, g in enumerate(tick.g)]


def _keep(hybrid: Hybrid, tick: Tick) -> list[str]:
    lines = [f"q[{i}] = {q.value}" for i, q in enumerate(tick.q)]
    return lines + [f"h[{i}] = {name}" for i, name in enumerate(_held(hybrid))]


def _store(letter: str, hybrid: Hybrid) -> list[str]:
    """Keep a grid point: states from x, q and held values from their names."""
    if letter == "x":
        return [f"x_out[{i}][c] = x[{i}]" for i in range(len(hybrid.flow.x))]
    if letter == "q":
        tick = hybrid.tick
        return [f"q_out[{i}][c] = {q.value}" for i, q in enumerate(tick.q if tick else ())]
    if letter == "b" and not hybrid.net.earlier:
        return []
    return [f"{letter}_out[{i}][c] = {name}" for i, name in enumerate(_held(hybrid))]


def _flow(hybrid: Hybrid, kind: str) -> list[str]:
    count, outside = len(hybrid.flow.x), len(hybrid.net.outside)
    kept = _store("q", hybrid) + _store("h", hybrid) + _store("b", hybrid)
    if not count:
        lines = ["for i in range(1, j - k):", "    c = column[k + i]", "    if c >= 0:"]
        return lines + ["        " + line for line in kept or ["pass"]]
    if kind == "compiled":
        rows = [f"rows[{i}, i] = given{i}[k + i]" for i in range(outside)]
        rows += [f"rows[{outside + i}, i] = {name}" for i, name in enumerate(_held(hybrid))]
        text = _COMPILED_FLOW.format(inputs=len(hybrid.flow.u), states=count, rows=indent(rows, 1))
    else:
        rows = [f"given{i}[k : j + 1]" for i in range(outside)]
        rows += [f"[{name}] * size" for name in _held(hybrid)]
        text = _PYTHON_FLOW.format(states=count, rows=", ".join(rows))
    inside = [f"x_out[{n}][c] = part[{n}][i]" for n in range(count)]
    end = [f"x[{n}] = part[{n}][size - 1]" for n in range(count)]
    text += _ADVANCE.format(store=indent(inside + kept, 2), end="\n".join(end))
    return text.strip().split("\n")


def signal_code(hybrid: Hybrid) -> str:
    """The function ``signals``: all signals along the kept grid points."""
    flow, emitter = hybrid.flow, Emitter("array")
    codes = emitter.write(flow.y)
    count = len(hybrid.net.held) if hybrid.net.earlier else 0
    lines = unpacked(flow) + [f"b{i} = b[{i}]" for i in range(count)]
    lines += emitter.body + [f"y[{i}] = {code}" for i, code in enumerate(codes)]
    return f"def signals(t, x, u, b, p, y):\n{indent(lines, 1)}\n"

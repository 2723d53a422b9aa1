"""Code of the loop over lanes, samples and substeps."""

from __future__ import annotations

from collections.abc import Sequence

from ..expression.graph import Node, rename
from ..tracing.equations import Program
from .python_source import Emitter, indent, lines_of, summed
from .relay import Relays, relays
from .rosenbrock import Equations, step

_LOOP = """
@fast
def run(x_start, start, length, u, series, p, y, gain, correct, dull, half, t0, dt, substeps, rtol,
        floor, y_hat, x_end, first, last):
    for lane in {lanes}:
{unpack}
        own, begins, zero = series[lane], start[lane], t0[lane]
        whole = dt / substeps
{fixed}
        for j in range(length):
            k = begins + j
            t = zero + k * dt
{read}
{output}
            if correct:
{correct}
{scale}
            for i in range(substeps):
                t = zero + (k + i / substeps) * dt
                left = {whole}
                h = left
                while {unfinished}:
{step}
{finish}
"""

_SCALAR_STEP = """
{before}
{code}
spent = spent + 1.0
error = {error}
if not isfinite({state}):
    error = 0.0
if not error <= rtol and h > shortest:
    h = h * max(0.1, 0.8 * sqrt(sqrt(rtol / error))) if error < inf else h * 0.1
    continue
{back}
{advance}
t = t + h
left = left - h
h = h * min(5.0, 0.8 * sqrt(sqrt(rtol / max(error, 1e-30))))
h = left if spent > most{landed} else min(left, h)
shortest = shortest * {tired} if error > rtol else shortest
"""

_ARRAY_STEP = """
{before}
{code}
spent = spent + 1.0
error = np.where(np.isfinite({state}), {error}, 0.0)
good = (error <= rtol) | (h <= shortest)
{back}
{advance}
t = np.where(good, t + h, t)
left = np.where(good, left - h, left)
growth = 0.8 * np.sqrt(np.sqrt(rtol / np.maximum(error, 1e-30)))
growth = np.where(growth == growth, np.clip(growth, 0.1, 5.0), 0.1)
{shorten}
h = np.minimum(left, np.where(good & ((spent > most){landed}), left, h * growth))
shortest = np.where(good & (error > rtol), shortest * {tired}, shortest)
"""

# A diverging run must not take minutes: each rejected shortest step makes the shortest step
# longer, and after too many steps each step tries to finish its substep.
TIRED = 1.005
MOST = 200  # to a substep, on average


def lane_code(program: Program, kind: str) -> str:
    """The function ``run``: lanes one by one ("scalar") or all at once ("array")."""
    fixed = [node.value for node in program.p]
    at_sample, at_step = Emitter(kind, "a", fixed), Emitter(kind, "b", fixed)
    outputs = at_sample.write(program.y)
    states, scalar = [node.value for node in program.x], kind == "scalar"
    taken = "{1} = n{0}" if scalar else "{1} = np.where(good, n{0}, {1})"
    advance = [taken.format(i, x) for i, x in enumerate(states)]
    inner = trial(program, kind, at_step, _SCALAR_STEP if scalar else _ARRAY_STEP, advance)
    store = [f"y_hat[lane, j, {i}] = {code}" for i, code in enumerate(outputs)]
    return _LOOP.format(
        lanes="range(first, last)" if scalar else "(slice(first, last),)",
        whole="whole" if scalar else "np.full(last - first, whole)",
        unfinished="left > 0.0" if scalar else "np.any(left > 0.0)",
        unpack=indent(unpack(program, kind), 2),
        fixed=indent(at_sample.head + at_step.head, 2),
        read=indent([f"u{i} = u[own, k, {i}]" for i in range(len(program.u))], 3),
        output=indent(at_sample.body + store, 3),
        correct=indent(correction(outputs, states, kind), 4),
        scale=indent([f"s{i} = {_most(kind, f's{i}', x)}" for i, x in enumerate(states)], 3),
        step=indent(inner, 5),
        finish=indent([f"x_end[lane, {i}] = {x}" for i, x in enumerate(states)], 2),
    )


def unpack(program: Program, kind: str) -> list[str]:
    """States, their scales and parameters of a lane, its shortest step and largest step count."""
    lines = ["shortest = dt / substeps * 1e-4", "spent = 0.0", f"most = {MOST} * length * substeps"]
    lines += [f"{x.value} = x_start[lane, {i}]" for i, x in enumerate(program.x)]
    lines += [
        f"s{i} = {_most(kind, f'floor[{i}]', x.value)} + 1e-9" for i, x in enumerate(program.x)
    ]
    return lines + [f"{p.value} = p[lane, {i}]" for i, p in enumerate(program.p)]


def _most(kind: str, a: str, b: str) -> str:
    return f"{'np.maximum' if kind == 'array' else 'max'}({a}, abs({b}))"


def trial(
    program: Program, kind: str, emitter: Emitter, template: str, advance: Sequence[str]
) -> list[str]:
    """A template of a trial step, filled with the new states n0, n1, ... and its error."""
    states = [node.value for node in program.x]
    switching = relays(program)
    after, estimate = fixed_step(program, switching)
    codes = emitter.write(after + estimate)
    new, errors = codes[: len(states)], codes[len(states) :]
    made = [f"n{i} = {code}" for i, code in enumerate(new)]
    parts = [f"abs({e}) / {_most(kind, f's{i}', f'n{i}')}" for i, e in enumerate(errors)]
    parts += ["slip"] if any(relay.turning for relay in switching.every) else []
    return lines_of(
        template.format(
            tired=TIRED,
            code="\n".join([*emitter.body, *made, *switching.after(kind)]),
            error=summed(parts),
            state=summed(states),
            advance="\n".join(advance),
            **switching.filling(kind),
        )
    )


def fixed_step(program: Program, switching: Relays) -> tuple[list[Node], list[Node]]:
    """The state after a step of length h with held inputs, and its error."""
    equations = Equations(
        graph=program.graph, t=program.t, x=program.x, u=program.u, xdot=switching.rates
    )
    begin = {program.graph.symbol("begin").index: program.t}
    new, error = step(equations)
    return rename(new, begin), rename(error, begin)


def correction(outputs: Sequence[str], states: Sequence[str], kind: str) -> list[str]:
    """x += gain e, e = y - y_hat, without the outputs that were not measured (nan).

    What e has within ``half`` is reduced by the part ``dull``.
    """
    drop, clip = "0.0 if c{0} != c{0} else c{0}", "max(-half[{0}], min(half[{0}], c{0}))"
    if kind == "array":
        drop, clip = "np.where(np.isnan(c{0}), 0.0, c{0})", "np.clip(c{0}, -half[{0}], half[{0}])"
    lines = []
    for o, code in enumerate(outputs):
        lines += [f"c{o} = y[k, {o}] - {code}", f"c{o} = " + drop.format(o)]
        less = f"c{o} = c{o} - dull[k, {o}] * {clip.format(o)}"
        lines += ["if len(dull) > 0:", f"    {less}"]
    for i, name in enumerate(states):
        gains = " + ".join(f"gain[lane, {i}, {o}] * c{o}" for o in range(len(outputs)))
        lines += [f"{name} = {name} + {gains}"] if gains else []
    return lines

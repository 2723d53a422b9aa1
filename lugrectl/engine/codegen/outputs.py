"""Code that computes the outputs along a run, in blocks of samples."""

from __future__ import annotations

from collections.abc import Sequence

from ..expression.graph import Node, symbols_in
from ..tracing.equations import Program
from .filippov import Sliding, names, sliding
from .python_source import Emitter, indent
from .switching import freeze_modes

# The intermediate results of a block fit into the processor's cache.
_BLOCKS = """
def outputs(t, x, u, p, y):
    {scales}
    for first in range(0, len(t), 4096):
        part = slice(first, first + 4096)
        block(t[part], x[:, part], u[:, part], p, y[:, part], scales)


def block(t, x, u, p, y, scales):
{code}
"""

_LEADS = """

def leads(t, x, u, p):
{code}
"""


def output_code(program: Program) -> str:
    """The function ``outputs(t, x, u, p, y)``.

    A sign or comparison that rests (``sliding``) has the value that keeps it at rest: the
    friction of a drive held by Coulomb friction is the torque on it, not sign(0). If its
    switching function depends on an input it has NumPy's value.
    """
    roots, fixed = [*program.xdot, *program.y], {node.value for node in program.p}
    smooth, leads, jumps = freeze_modes(roots, fixed)
    inputs = {node.value for node in program.u}
    wanted = [
        jump and not symbols_in([lead]) & inputs for lead, jump in zip(leads, jumps, strict=True)
    ]
    slides = sliding(program, smooth, leads, wanted)
    seen, n = symbols_in(smooth[len(program.x) :]), len(program.x)
    code, targets = unpacked(program), [f"y[{i}]" for i in range(len(program.y))]
    if not any(f"m{i}" in seen for i in slides.parts):
        code += _write(program.y, "v", targets)
        return _BLOCKS.format(scales="scales = ()", code=indent(code, 1))
    for i, lead in enumerate(leads):  # all sides by NumPy's rules
        code += _write([lead], f"lead{i}_", [f"a{i}"]) + [f"m{i} = np.sign(a{i})"]
    values = "".join(f"a{i}, " for i in slides.parts)
    own = [*code, *_resting(program, slides), *_write(slides.rates[n:], "v", targets)]
    return _BLOCKS.format(
        scales="scales = [np.nanmax(abs(a)) for a in leads(t, x, u, p)]", code=indent(own, 1)
    ) + _LEADS.format(code=indent([*code, f"return {values}"], 1))


def unpacked(program: Program) -> list[str]:
    """Code that gives the rows of the arguments their names."""
    rows = (("x", program.x), ("u", program.u), ("p", program.p))
    return [f"{node.value} = {name}[{i}]" for name, nodes in rows for i, node in enumerate(nodes)]


def _write(nodes: Sequence[Node], prefix: str, targets: Sequence[str]) -> list[str]:
    emitter = Emitter("array", prefix)
    codes = emitter.write(nodes)
    return emitter.body + [f"{name} = {code}" for name, code in zip(targets, codes, strict=True)]


def _resting(program: Program, made: Sliding) -> list[str]:
    """The code of ``settle``, for all samples at once."""
    lines = [f"du{i} = 0.0" for i in range(len(program.u))]
    for scale, i in enumerate(made.parts):
        lines += [f"on{i} = 1.0 * (abs(a{i}) <= 1e-11 * scales[{scale}])"]
        lines += [f"m{i} = np.where(on{i} > 0.0, 1.0, m{i})"]
    turn = _write([*made.parts.values(), *made.steps.values()], "rest", names(made))
    for i in made.parts:
        off = f"np.where(step{i} < 0.0, np.maximum(-part{i}, part{i} - 1.0), inf)"
        turn += [f"off{i} = np.where(on{i} > 0.0, {off}, -1.0)"]
    turn += [f"worst = np.maximum.reduce([{', '.join(f'off{i}' for i in made.parts)}])"]
    for i in made.parts:
        turn += [
            f"leaves = ~(off{i} < 0.0) & (off{i} >= worst)",
            f"side = np.where(off{i} < inf, np.where(part{i} < 0.5, 1.0, -1.0), np.sign(a{i}))",
            f"m{i}, on{i} = np.where(leaves, side, m{i}), np.where(leaves, 0.0, on{i})",
        ]
    return lines + [f"for _ in range({len(made.parts) + 1}):", *("    " + line for line in turn)]

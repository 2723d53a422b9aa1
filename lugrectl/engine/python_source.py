"""Straight-line code for expressions of floats: with ``math``, or with NumPy where that raises."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

from .graph import OPS, Node, reachable, substitute, symbols_in

SCALAR_HEADER = """from math import (
    acos, asin, atan, atan2, cos, cosh, exp, expm1, inf, isfinite, log, log10, log1p, nan,
    pow, sin, sinh, sqrt, tan, tanh
)
from math import floor as floored
"""

_INFIX = {"add", "subtract", "multiply", "divide", "negative"}
_LONGEST = 70
_SUM = 64  # terms without brackets
# exp is 0 there, but the library is slow to return it; tests for nan, and functions that few
# libraries provide for several numbers at once, keep compilers from vectorising
_OWN = {
    ("scalar", "exp"): "(0.0 if {0} < -745.2 else exp({0}))",
    ("wide", "exp"): "exp(max({0}, -700.0))",
    ("wide", "maximum"): "max({0}, {1})",
    ("wide", "minimum"): "min({0}, {1})",
    ("wide", "tanh"): "(1.0 - 2.0 / (1.0 + exp(max(min(2.0 * {0}, 700.0), -700.0))))",
}
_NAMED_TWICE = {"sign", "maximum", "minimum", "exp"}


class Emitter:
    """Writes each node once, what depends on ``fixed`` symbols only into ``head``.

    ``kind`` is "scalar", "numpy" (with its functions), or "wide": in a form that can be vectorised.
    ``prefix`` begins the names of the variables.
    """

    def __init__(self, kind: str, prefix: str = "v", fixed: Iterable[str] = ()) -> None:
        self.kind, self.prefix, self.fixed = kind, prefix, frozenset(fixed)
        self.head: list[str] = []
        self.body: list[str] = []

    def write(self, roots: Sequence[Node]) -> list[str]:
        """Write the code of the roots; returns the expressions that hold their values."""
        nodes = reachable(roots)
        still: dict[int, bool] = {}
        uses: dict[int, list[int]] = {root.index: [-1, -1] for root in roots}
        for node in nodes:
            own = node.op != "symbol" or node.value in self.fixed
            still[node.index] = own and all(still[a.index] for a in node.args)
            for argument in node.args:
                often = 2 if node.op in _NAMED_TWICE else 1
                uses.setdefault(argument.index, []).extend([node.index] * often)
        text: dict[int, str] = {}
        for node in nodes:
            if node.op == "symbol":
                text[node.index] = node.value
                continue
            if node.op == "constant":
                positive = node.value >= 0
                text[node.index] = repr(node.value) if positive else f"({node.value!r})"
                continue
            code = self._template(node).format(*(text[a.index] for a in node.args))
            users = uses[node.index]  # once, and only once in the user's code
            inline = len(users) == 1 and still[users[0]] == still[node.index]
            if inline and node.op in _INFIX and len(code) < _LONGEST:
                text[node.index] = f"({code})"
                continue
            text[node.index] = name = f"{self.prefix}{node.index}"
            (self.head if still[node.index] else self.body).append(f"{name} = {code}")
        return [text[root.index] for root in roots]

    def _template(self, node: Node) -> str:
        if node.op == "call":
            return f"called[{node.value}]({', '.join(['{}'] * len(node.args))})"
        if node.op == "item":
            return f"{{}}[{node.value}]"
        if self.kind == "numpy":
            return f"np.{node.op}({', '.join(['{}'] * len(node.args))})"
        return _OWN.get((self.kind, node.op), OPS[node.op])


class Section:
    """Code that leaves the values of nodes in named variables, ``at_once`` if they overlap."""

    def __init__(
        self,
        names: Sequence[str],
        nodes: Sequence[Node],
        prefix: str,
        fixed: Iterable[str] = (),
        *,
        at_once: bool = False,
        kind: str = "scalar",
    ) -> None:
        self.names, self.nodes, self.prefix, self.at_once = names, nodes, prefix, at_once
        self.emitter = Emitter(kind, prefix, fixed)
        self.codes = self.emitter.write(nodes)

    def lines(self, guarded: bool = False) -> list[str]:
        """The code; where plain Python raises, ``guarded`` code computes with :meth:`robust`."""
        if not self.names:
            return self.emitter.body
        left = ", ".join(self.names)
        if self.at_once:
            lines = [*self.emitter.body, f"{left}, = {', '.join(self.codes)},"]
        else:
            pairs = zip(self.names, self.codes, strict=True)
            lines = [*self.emitter.body, *(f"{name} = {code}" for name, code in pairs)]
        if not guarded:
            return lines
        again = f"    {left}, = robust_{self.prefix}({', '.join(self._arguments())})"
        tried = ["    " + line for line in lines]
        return ["try:", *tried, "except (ArithmeticError, ValueError):", again]

    def robust(self) -> str:
        """The same code as a function that returns inf or nan where ``math`` would raise."""
        emitter = Emitter("numpy", self.prefix)
        values = "".join(f"{code}, " for code in emitter.write(self.nodes))
        lines = [f"{name} = np.float64({name})" for name in sorted(symbols_in(self.nodes))]
        lines += [*emitter.body, f"return [float(v) for v in ({values})]"]
        head = f"def robust_{self.prefix}({', '.join(self._arguments())}):\n"
        return head + "    with np.errstate(all='ignore'):\n" + indent(lines, 2) + "\n\n\n"

    def _arguments(self) -> list[str]:
        calls = any(node.op == "call" for node in reachable(self.nodes))
        return sorted(symbols_in(self.nodes)) + ["called"] * calls


def reciprocals(roots: Sequence[Node]) -> list[Node]:
    """The roots with a (1/b) in place of a/b: 1/b is shared and moves out of the loop."""

    def rule(node: Node, args: tuple[Node, ...]) -> Node | None:
        plain = node.op != "divide" or args[0].is_constant(1.0)
        return None if plain else args[0] * (1.0 / args[1])

    return substitute(roots, rule)


def indent(lines: Iterable[str], depth: int) -> str:
    """The lines as one text, indented by ``depth`` steps; ``pass`` if there are none."""
    return "\n".join("    " * depth + line for line in (list(lines) or ["pass"]))


def written(
    template: str,
    groups: Mapping[str, Sequence[Mapping[str, Any]]],
    codes: Mapping[str, Sequence[str]],
    **words: Any,
) -> str:
    """The text of a template: what is below ``each NAME:`` is repeated for each row of a group,
    and the lines of a code stand for ``code NAME``. Braces hold words, or those of the row."""

    def of(lines: Sequence[str], words: Mapping[str, Any]) -> Iterator[str]:
        k = 0
        while k < len(lines):
            line, k = lines[k], k + 1
            what, _, name = line.strip().partition(" ")
            depth = len(line) - len(line.lstrip())
            if what == "each":
                begin = k
                while k < len(lines) and lines[k].startswith(" " * (depth + 4)):
                    k += 1
                for row in groups[name.rstrip(":")]:
                    yield from of([inner[4:] for inner in lines[begin:k]], {**words, **row})
            elif what == "code":
                yield from (" " * depth + own for own in codes[name] or ["pass"])
            else:
                yield line.format_map(words)

    return "\n".join(of(template.rstrip().split("\n"), words)) + "\n"


def numbered(names: Iterable[Any]) -> list[dict[str, Any]]:
    """The rows of a group of names."""
    return [{"i": i, "name": name} for i, name in enumerate(names)]


def summed(terms: Sequence[str]) -> str:
    """A sum of many terms in groups: Python and C read no deep nesting of operations."""
    parts = list(terms)
    while len(parts) > _SUM:
        parts = [f"({' + '.join(parts[i : i + _SUM])})" for i in range(0, len(parts), _SUM)]
    return " + ".join(parts) or "0.0"

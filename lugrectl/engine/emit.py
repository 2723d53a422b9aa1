"""Straight-line code for expressions: for floats with ``math``, or for arrays with NumPy."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from .graph import Node, reachable
from .ops import OPS

SCALAR_HEADER = """from math import (
    acos, asin, atan, atan2, cos, cosh, exp, expm1, inf, isfinite, log, log10, log1p, nan, pow,
    sin, sinh, sqrt, tan, tanh
)
"""
ARRAY_HEADER = "import numpy as np\nfrom numpy import inf, nan\n"

_INFIX = {"add", "subtract", "multiply", "divide", "negative"}
_LONGEST = 70


class Emitter:
    """Writes each node once: what hangs on ``fixed`` symbols only goes into ``head``.

    Parameters
    ----------
    kind : str
        "scalar" or "array".
    prefix : str
        First letters of the variables it makes.
    fixed : iterable of str
        Symbols that do not change inside the loop for which the code is written.
    """

    def __init__(self, kind: str, prefix: str = "v", fixed: Iterable[str] = ()) -> None:
        self.kind, self.prefix, self.fixed = kind, prefix, frozenset(fixed)
        self.head: list[str] = []
        self.body: list[str] = []

    def write(self, roots: Sequence[Node]) -> list[str]:
        """Write what the roots need; the expressions that then hold their values."""
        nodes = reachable(roots)
        still = self._still(nodes)
        user = self._single_users(nodes, roots)
        text: dict[int, str] = {}
        for node in nodes:
            text[node.index] = code = self._code(node, text)
            if not node.args:
                continue
            only = user.get(node.index)
            same_place = only is not None and still[only] == still[node.index]
            if same_place and node.op in _INFIX and len(code) < _LONGEST:
                text[node.index] = f"({code})"
                continue
            text[node.index] = name = f"{self.prefix}{node.index}"
            (self.head if still[node.index] else self.body).append(f"{name} = {code}")
        return [text[root.index] for root in roots]

    def _still(self, nodes: Sequence[Node]) -> dict[int, bool]:
        still: dict[int, bool] = {}
        for node in nodes:
            own = node.op != "symbol" or node.value in self.fixed
            still[node.index] = own and all(still[a.index] for a in node.args)
        return still

    @staticmethod
    def _single_users(nodes: Sequence[Node], roots: Sequence[Node]) -> dict[int, int]:
        """The user of each node that is used exactly once and whose code names it once."""
        uses: dict[int, list[int]] = {}
        for node in nodes:
            for argument in node.args:
                often = 2 if node.op in ("sign", "maximum", "minimum") else 1
                uses.setdefault(argument.index, []).extend([node.index] * often)
        for root in roots:
            uses.setdefault(root.index, []).extend([-1, -1])
        return {index: users[0] for index, users in uses.items() if len(users) == 1}

    def _code(self, node: Node, text: dict[int, str]) -> str:
        if node.op == "symbol":
            return node.value
        if node.op == "constant":
            return repr(node.value) if node.value >= 0 else f"({node.value!r})"
        op = OPS[node.op]
        template = op.scalar if self.kind == "scalar" else op.array
        return template.format(*(text[a.index] for a in node.args))


def indent(lines: Iterable[str], depth: int) -> str:
    """The lines as one text, indented by ``depth`` steps; ``pass`` if there is none."""
    return "\n".join("    " * depth + line for line in (list(lines) or ["pass"]))

"""The traced equations of a system."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..expression.graph import Graph, Node, evaluate, outline, sharp


@dataclass(frozen=True, eq=False)
class Program:
    """The equations of a system: xdot = f(t, x, u, p), y = g(t, x, u, p) as graph nodes.

    ``parameters`` are unique labels, ``keys`` their names in python-control (one key can have
    different defaults in different blocks), ``defaults`` their values, ``widths`` the largest
    value up to which each only smooths a sign (0: never). ``fixed`` holds the keys that were
    needed as numbers during tracing.
    """

    name: str
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    parameters: tuple[str, ...]
    keys: tuple[str, ...]
    defaults: np.ndarray
    widths: tuple[float, ...]
    fixed: Mapping[str, Any]
    graph: Graph
    t: Node
    x: tuple[Node, ...]
    u: tuple[Node, ...]
    p: tuple[Node, ...]
    xdot: tuple[Node, ...]
    y: tuple[Node, ...]

    def outline(self, *more: tuple[Node, ...]) -> tuple[Any, ...]:
        """The equations, and other nodes, as a hashable value.

        Programs of the same value differ in nothing but the defaults of their parameters.
        """
        names = (self.name, self.states, self.inputs, self.outputs, self.parameters, self.keys)
        return *names, outline([(self.t,), self.x, self.u, self.p, self.xdot, self.y, *more])

    def sharpened(
        self, params: Mapping[str, Any] | None = None, *, of: Sequence[Node] | None = None
    ) -> Program:
        """The program with sign(x) for tanh(x/p) where p only smooths the sign for solvers.

        ``of`` are the nodes x of which this is done, None: all.
        """
        rows = zip(self.p, self.widths, self.arguments(params), strict=True)
        narrow = [node for node, width, value in rows if 0.0 < value <= width]
        if not narrow:
            return self
        roots, n = sharp([*self.xdot, *self.y], narrow, of), len(self.x)
        return replace(self, xdot=tuple(roots[:n]), y=tuple(roots[n:]))

    def values(self, t: Any, x: Any, u: Any, p: Any | None = None) -> tuple[np.ndarray, np.ndarray]:
        """(xdot, y) by interpretation; x (n, ...), u (m, ...), p (q, ...) may be batches."""
        numbers = [t, *x, *u, *(self.defaults if p is None else p)]
        symbols = [self.t, *self.x, *self.u, *self.p]
        known = {node.value: v for node, v in zip(symbols, numbers, strict=True)}
        shape = np.broadcast_shapes(*(np.shape(v) for v in known.values()))
        rows = [np.broadcast_to(v, shape) for v in evaluate(self.xdot + self.y, known)]
        rows = np.array(rows, dtype=float).reshape(-1, *shape)
        return rows[: len(self.x)], rows[len(self.x) :]

    def arguments(self, params: Mapping[str, Any] | None) -> np.ndarray:
        """The parameter vector with ``params`` in place of defaults."""
        params = params or {}
        pairs = zip(self.keys, self.defaults, strict=True)
        return np.array([float(params.get(k, v)) for k, v in pairs])

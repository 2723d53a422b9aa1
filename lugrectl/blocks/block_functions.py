"""The functions of a block as python-control calls them: small objects that pickle.

Each holds the block and says on what its answers depend, so that the engine knows when code
that it has compiled still holds.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, is_dataclass
from types import FunctionType
from typing import TYPE_CHECKING, Any

import numpy as np

from ..core.pickling import carried

if TYPE_CHECKING:
    from .block import Block


class Called:
    """A block with values: ``keys`` of python-control by parameter, and ``functions`` of the
    user in place of parameters."""

    __slots__ = ("__weakref__", "_fresh", "_steady", "block", "functions", "keys", "name")

    def __init__(
        self,
        block: Block,
        name: str,
        keys: Mapping[str, str],
        functions: Mapping[str, Callable[..., Any]],
    ) -> None:
        self.block, self.name, self.keys, self.functions = block, name, keys, functions
        self._fresh, self._steady = block.fresh, not functions and block.is_steady()

    def values(self, t: Any, x: Any, u: Any, params: Mapping[str, Any]) -> tuple[Any, ...]:
        """Outputs that are not states, then the rates."""
        block = self.block
        signals = [t] if block.timed else []
        if getattr(u, "ndim", 1) == 0:  # control.describing_function gives a number
            u = u.reshape(1)
        signals += [u[i] for i in range(len(block.inputs))]
        signals += [x[i] for i in range(len(block.states))]
        return block(*signals, **{k: params[q] for k, q in self.keys.items()}, **self.functions)

    @property
    def declared(self) -> dict[str, Any]:
        """The declarations of the parameters by python-control's key."""
        return {q: self.block.parameters[k] for k, q in self.keys.items()}

    def rests_on(self) -> tuple[Any, ...] | None:
        """The systems whose state decides the answers besides the arguments: none; None where
        anything else may."""
        return () if self._steady else None

    def __reduce__(self) -> Any:
        for key, function in self.functions.items():
            carried(f"{self.name}.{key}", function)
        return type(self), (self.block, self.name, dict(self.keys), dict(self.functions))

    def __deepcopy__(self, memo: Any) -> Called:
        functions = copy.deepcopy(self.functions, memo)
        return type(self)(self.block, self.name, self.keys, functions)

    def __repr__(self) -> str:
        return f"<{type(self).__name__.lower()} of the block {self.block.name}>"


class Rates(Called):
    """dx/dt of a block."""

    __slots__ = ()

    def __call__(self, t: Any, x: Any, u: Any, params: Mapping[str, Any]) -> np.ndarray:
        return np.array(self.values(t, x, u, params)[len(self._fresh) :])


class Outputs(Called):
    """The outputs of a block."""

    __slots__ = ()

    def __call__(self, t: Any, x: Any, u: Any, params: Mapping[str, Any]) -> np.ndarray:
        fresh = self._fresh
        out = dict(zip(fresh, self.values(t, x, u, params), strict=False)) if fresh else {}
        for i, state in enumerate(self.block.states):
            out.setdefault(state, x[i])
        return np.array([out[o] for o in self.block.outputs])


@dataclass(frozen=True)
class WithInputs:
    """The function of a block some of whose parameters are inputs, after its own."""

    of: Block
    names: tuple[str, ...]

    def __call__(self, *signals: Any, **values: Any) -> tuple[Any, ...]:
        own, many = len(self.of.inputs) + self.of.timed, len(self.names)
        given = dict(zip(self.names, signals[own : own + many], strict=True))
        return self.of(*signals[:own], *signals[own + many :], **values, **given)

    def block(self) -> Block:
        return self.of.with_inputs(self.names)


def is_steady(value: Any) -> bool:
    """Whether a value cannot change, nor what it reads when it is called.

    True of numbers, texts, blocks and functions of this package, and of what is built from them
    alone; False of everything else, a function of the user first of all.
    """
    if value is None or isinstance(value, (bool, int, float, str)):
        return True
    if isinstance(value, tuple):
        return all(map(is_steady, value))
    if not _is_ours(value):
        return False
    if isinstance(value, FunctionType):
        return value.__closure__ is None
    if hasattr(value, "is_steady"):
        return value.is_steady()
    frozen = is_dataclass(value) and type(value).__dataclass_params__.frozen  # pyright: ignore
    return frozen and all(is_steady(getattr(value, f.name)) for f in fields(value))


def _is_ours(value: Any) -> bool:
    home = value if isinstance(value, FunctionType) else type(value)
    return str(home.__module__).startswith("lugrectl.")

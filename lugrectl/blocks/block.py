"""What a block is: one pure function, whose signature is the declaration.

Arguments without default are signals or states, arguments with default are parameters. It returns
the outputs that are not states, then one rate per state, by arithmetic, NumPy ufuncs and
``np.where`` alone: on floats, arrays, whole logs and the symbolic scalars of the engine.
"""

from __future__ import annotations

import copy
import inspect
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields, is_dataclass, replace
from functools import cached_property
from types import FunctionType
from typing import TYPE_CHECKING, Any

import numpy as np

from ..core.bare_system import BareSystem
from ..core.display import Row, Shown
from ..core.errors import InputError
from ..core.pickling import carried
from ..core.unit_names import unit_for as unit_for
from ..core.validation import one_name, renamed, shown, within

if TYPE_CHECKING:  # slow to import, and the catalogue does without it
    import control as ct


@dataclass(frozen=True)
class P:
    """Declaration of a parameter.

    Parameters
    ----------
    value : float
        Default.
    unit : str
        SI unit in rotary names; :func:`unit_for` gives the linear one.
    low, high : float
        Bounds, inclusive.
    neutral : float or None
        Value at which an effect changes nothing.
    span : tuple of float or None
        Two values whose effects, combined linearly, give the effect at any value (0 and
        pi/2 for a phase): the tracer then need not search this parameter, if that is true.
    grid : callable or None
        ``grid(log)`` returns the values to try on a log, for a parameter in which the effect is
        not linear.
    fitted : bool
        False for a numerical constant that cannot be identified from a record.
    whole : bool
        True for a count per turn, a whole number on a rotary drive.
    angle : bool
        True for a phase, which stays an angle on a linear drive.
    choices : tuple of float
        The only values allowed, if there are few (a side): one is chosen, none is fitted.
    shared : bool
        True for a value that an effect takes from the plant that contains it. There it is not a
        parameter of the effect; used alone, the effect has it as a parameter.
    passed : bool
        True for a position that the motion must cross: the record must show both sides of it.
    usual : bool
        True for a value that is held at its default unless the model gives it.
    smooths : bool
        True for the width of a sign(x) that is written tanh(x/width) for solvers. Up to the
        default width, ``simulate`` takes the sign itself.

    Examples
    --------
    A bounded friction level in N m, as an argument of a block of one's own:

    >>> Fc = lg.P(0.3, "N m", low=0.0, neutral=0.0)
    >>> Fc.value, Fc.unit, Fc.low
    (0.3, 'N m', 0.0)
    """

    value: float
    unit: str
    low: float = -math.inf
    high: float = math.inf
    neutral: float | None = None
    span: tuple[float, float] | None = None
    grid: Callable[[Any], np.ndarray] | None = None
    fitted: bool = True
    whole: bool = False
    angle: bool = False
    choices: tuple[float, ...] = ()
    shared: bool = False
    passed: bool = False
    usual: bool = False
    smooths: bool = False

    @property
    def instant(self) -> bool:
        """Whether it is a time of the log, before its start too, and no duration."""
        return self.unit == "s" and self.low < 0.0


class Group(dict[str, P]):
    """Parameters that a function takes as the attributes of one argument, an object of a kind."""

    def __init__(self, kind: type, **parameters: P) -> None:
        super().__init__(parameters)
        self.kind = kind


def defaults(function: Callable[..., Any]) -> dict[str, P]:
    """The parameters that a function declares by its defaults."""
    given = inspect.signature(function).parameters
    return {key: one.default for key, one in given.items() if isinstance(one.default, P)}


@dataclass(frozen=True, repr=False)
class Block(Shown):
    """A pure function with declared signals; ``system()`` makes it a python-control block."""

    name: str
    kind: str
    function: Callable[..., Any]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    states: tuple[str, ...]
    parameters: Mapping[str, P]
    timed: bool = False
    acts: tuple[str, ...] = ()
    confused: tuple[str, ...] = ()
    experiment: str = ""
    exact: Callable[..., np.ndarray] | None = field(default=None, compare=False)
    start: tuple[str, ...] = ()
    load: bool = False
    abrupt: bool = False
    home: str = field(default="", compare=False)
    source: str = field(default="", compare=False)
    form_keys: Mapping[str, P] = field(default_factory=dict, compare=False)
    """What an entry of a model file may give besides the parameters: see ``friction.formed``."""
    groups: tuple[tuple[str, type, tuple[str, ...]], ...] = ()
    """Arguments that are an object with parameters: name, kind, and its parameters."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "start", self.start or ("0",) * len(self.states))

    def _title(self) -> str:
        return f"Block {self.name} ({self.kind})"

    def _rows(self) -> Iterable[Row]:
        signals = {k: ", ".join(getattr(self, k)) for k in ("inputs", "outputs", "states")}
        shown = [Row(k, names) for k, names in signals.items() if names]
        return [*shown, *(Row(k, p.value, p.unit) for k, p in self.parameters.items())]

    @property
    def doc(self) -> str:
        return inspect.getdoc(self.function) or ""

    @property
    def equation(self) -> str:
        """First line of the docstring: the equation in the field's symbols."""
        return self.doc.split("\n", 1)[0]

    @property
    def gain(self) -> str:
        """Name of the first parameter with a neutral value (an effect's strength)."""
        return next(k for k, p in self.parameters.items() if p.neutral is not None)

    @property
    def own(self) -> dict[str, P]:
        """The parameters that are not taken from the plant."""
        return {k: p for k, p in self.parameters.items() if not p.shared}

    @cached_property
    def reads(self) -> tuple[str, ...]:
        """The signals that the function takes, in order: t if it is used, then the inputs."""
        return ("t", *self.inputs) if self.timed else self.inputs

    @cached_property
    def fresh(self) -> tuple[str, ...]:
        """The outputs that are not states; the function returns them before the rates."""
        return tuple(o for o in self.outputs if o not in self.states)

    def deeds(self, result: Sequence[Any]) -> tuple[tuple[str, Any], ...]:
        """Each act of an effect with its output: one shared output, or one for each act."""
        outputs = result[: len(self.fresh)]
        if len(outputs) == 1:
            return tuple((act, outputs[0]) for act in self.acts)
        return tuple(zip(self.acts, outputs, strict=True))

    def defaults(self) -> dict[str, float]:
        return {k: p.value for k, p in self.parameters.items()}

    def check(self, values: Mapping[str, Any]) -> None:
        for key, value in values.items():
            if key not in self.parameters:
                known = ", ".join(self.parameters)
                raise InputError(f"{self.name} has no parameter '{key}'; it has {known}.")
            if not callable(value):
                within(value, f"{self.name}.{key}", self.parameters[key])

    def __call__(self, *signals: Any, **values: Any) -> tuple[Any, ...]:
        """Outputs that are not states, then the rates; ``t`` is the first argument if used.

        A parameter without a value has its default.
        """
        own = (*self.reads, *self.states)
        left = own[len(signals) :]
        if left and not set(left) <= set(values):
            raise InputError(
                f"{self.name} is called with its signals, {', '.join(own)}; {self.wiring(values)}"
            )
        if len(signals) <= len(own) and len(values) < len(self.parameters) + len(left):
            values = self.defaults() | values
        for key, kind, names in self.groups:
            values[key] = kind(**{k: values.pop(k) for k in names})
        result = self.function(*signals, **values)
        return result if isinstance(result, tuple) else (result,)

    def wiring(self, values: Mapping[str, Any] | None = None) -> str:
        """What a sentence says of the block as a system with these values."""
        given = ", ".join(f"{k}={shown(v)}" for k, v in (values or {}).items())
        return f"{self.name}.system({given}) makes a python-control system of it."

    def system(
        self,
        name: str | None = None,
        inputs: Sequence[str] | None = None,
        outputs: Sequence[str] | None = None,
        **values: Any,
    ) -> ct.NonlinearIOSystem:
        """The block as a NonlinearIOSystem whose parameters are keyed ``name.param``, and under
        the new name in a copy.

        ``inputs`` and ``outputs`` rename the signals, in the declared order. A value may be a
        function of the block's first signal if the block allows it.
        """
        from ..core.block_system import BlockSystem

        return self._of(BlockSystem, name, inputs, outputs, values)

    def bare(self, **values: Any) -> BareSystem:
        """The block for the engine alone: python-control, slow to import, is not loaded."""
        return self._of(BareSystem, None, None, None, values)

    def _of(self, kind: Any, name: Any, inputs: Any, outputs: Any, values: dict[str, Any]) -> Any:
        self.check(values)
        name = one_name(self.name if name is None else name)
        functions = {k: v for k, v in values.items() if callable(v)}
        numbers = {
            k: float(values.get(k, p.value))
            for k, p in self.parameters.items()
            if k not in functions
        }
        keys = {k: f"{name}.{k}" for k in numbers}
        called = (self, name, keys, functions)
        return kind(
            Called(*called, rates=True) if self.states else None,
            Called(*called),
            inputs=renamed(name, "inputs", self.inputs, inputs),
            outputs=renamed(name, "outputs", self.outputs, outputs),
            states=list(self.states) or None,
            params={q: numbers[k] for k, q in keys.items()},
            name=name,
            **({} if self.states else {"dt": None}),
        )


REGISTRY: dict[tuple[str, str], Block] = {}  # by kind and name


def members(kind: str) -> dict[str, Block]:
    """The registered blocks of a kind, by name: those of the package, then the user's own."""
    return {name: made for (of, name), made in registered().items() if of == kind}


def registered() -> dict[tuple[str, str], Block]:
    """The registry with the blocks of the package, whatever was imported."""
    from . import fill  # they import this module

    fill()
    return REGISTRY


def is_ours(home: str) -> bool:
    return home.partition(".")[0] == "lugrectl"


class Steady:
    """A function of a system whose arguments alone decide its answers."""

    def rests_on(self) -> tuple[Any, ...]:
        return ()


@dataclass(frozen=True, eq=False, repr=False)
class Called:
    """Outputs or rates of a block with values: python-control's ``keys`` by parameter, and
    ``functions`` of the user."""

    block: Block
    name: str
    keys: Mapping[str, str]
    functions: Mapping[str, Callable[..., Any]]
    rates: bool = False

    @cached_property
    def steady(self) -> bool:
        return not self.functions and is_steady(self.block)

    def values(self, t: Any, x: Any, u: Any, params: Mapping[str, Any]) -> tuple[Any, ...]:
        block = self.block
        signals = [t] if block.timed else []
        if getattr(u, "ndim", 1) == 0:  # control.describing_function gives a number
            u = u.reshape(1)
        signals += [u[i] for i in range(len(block.inputs))]
        signals += [x[i] for i in range(len(block.states))]
        return block(*signals, **{k: params[q] for k, q in self.keys.items()}, **self.functions)

    @property
    def declared(self) -> dict[str, Any]:
        return {q: self.block.parameters[k] for k, q in self.keys.items()}

    @property
    def widths(self) -> dict[str, float]:
        """The largest widths, by python-control's key, that only smooth a sign for solvers."""
        return {q: p.value for q, p in self.declared.items() if p.smooths}

    def rests_on(self) -> tuple[Any, ...] | None:
        return () if self.steady else None

    def renamed(self, update: Any, name: str) -> tuple[Any, Any, dict[str, str]]:
        """Update and output function of the block under a new name, and the new keys by old."""
        keys = {k: f"{name}.{k}" for k in self.keys}
        if isinstance(update, Called):
            update = replace(update, name=name, keys=keys)
        answer = replace(self, name=name, keys=keys)
        return update, answer, {self.keys[k]: new for k, new in keys.items()}

    def __reduce__(self) -> Any:
        for key, function in self.functions.items():
            carried(f"{self.name}.{key}", function)
        values = dict(self.keys), dict(self.functions), self.rates
        return type(self), (self.block, self.name, *values)

    def __deepcopy__(self, memo: Any) -> Called:
        return replace(self, functions=copy.deepcopy(self.functions, memo))

    def __repr__(self) -> str:
        return f"<{'rates' if self.rates else 'outputs'} of the block {self.block.name}>"

    def __call__(self, t: Any, x: Any, u: Any, params: Mapping[str, Any]) -> np.ndarray:
        fresh = self.block.fresh
        values = self.values(t, x, u, params) if fresh or self.rates else ()
        if self.rates:
            return np.array(values[len(fresh) :])
        out = dict(zip(fresh, values, strict=False))
        for i, state in enumerate(self.block.states):
            out.setdefault(state, x[i])
        return np.array([out[o] for o in self.block.outputs])


def is_steady(value: Any) -> bool:
    """Whether neither a value nor what it reads can change: numbers, texts, this package's own."""
    if value is None or isinstance(value, (bool, int, float, str)):
        return True
    if isinstance(value, tuple):
        return all(map(is_steady, value))
    if isinstance(value, Block):
        return is_steady(value.function)
    if isinstance(value, FunctionType):
        return is_ours(value.__module__) and value.__closure__ is None
    if not is_ours(type(value).__module__):
        return False
    frozen = is_dataclass(value) and type(value).__dataclass_params__.frozen
    return frozen and all(is_steady(getattr(value, f.name)) for f in fields(value))

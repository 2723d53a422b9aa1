"""What a block is: one pure function, its signals, states and parameters.

A function becomes a block by one decorator line. Its signature is the declaration::

    @block("friction", out="F", states="z")
    def lugre(w, z, sigma0=P(260, "N m/rad", 0), ...):
        return F, dz

Arguments without default are signals or states, arguments with default are parameters.
It returns the outputs that are not states, then one rate per state. Use only arithmetic, NumPy
ufuncs and ``np.where`` on signals: then the same code works on floats, arrays, whole logs and
the symbolic scalars of the engine.
"""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields, is_dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ..core.display import Row, Shown
from ..core.errors import InputError
from ..core.pickling import carried, declared, from_fields, rebuilt
from ..core.unit_names import unit_for as unit_for
from ..core.validation import one_name, renamed, shown, within
from .block_functions import Outputs, Rates, WithInputs, is_steady
from .declaration import as_function, check, is_same, kind_of, signature

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
        pi/2 for a phase): the tracer then need not search this parameter.
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
    tries: Callable[..., list[dict[str, float]]] | None = field(default=None, compare=False)
    start: tuple[str, ...] = ()
    load: bool = False
    abrupt: bool = False
    home: str = field(default="", compare=False)
    source: str = field(default="", compare=False)

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

    @property
    def reads(self) -> tuple[str, ...]:
        """The signals that the function takes, in order: t if it is used, then the inputs."""
        return ("t", *self.inputs) if self.timed else self.inputs

    @property
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

    def with_inputs(self, names: Sequence[str]) -> Block:
        """The same block with some parameters as additional inputs."""
        rest = {k: p for k, p in self.parameters.items() if k not in names}
        function = WithInputs(self, tuple(names))
        return replace(self, function=function, inputs=(*self.inputs, *names), parameters=rest)

    def check(self, values: Mapping[str, Any]) -> None:
        """Raise InputError for an unknown parameter or one outside its bounds."""
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
        own = len(self.reads) + len(self.states)
        if len(signals) == own and len(values) < len(self.parameters):
            values = self.defaults() | values
        result = self.function(*signals, **values)
        return result if isinstance(result, tuple) else (result,)

    def is_steady(self) -> bool:
        """Whether nothing that the function reads can change: see ``functions.is_steady``."""
        return is_steady(self.function)

    def __reduce__(self) -> Any:
        """A registered block pickles by kind and name, a composed one by its parts."""
        known = REGISTRY.get((self.kind, self.name))
        if known is self:
            return declared, (self.kind, self.name, self.home)
        build = getattr(self.function, "block", None)
        if build is not None and is_dataclass(self.function) and build() == self:
            return rebuilt, (self.function,)
        cure = "" if known is None else "it was declared again since: build what holds it again"
        for what, value in self._fields().items():
            carried(f"the {what} of the block {self.name}", value, cure)
        return from_fields, (type(self), self._fields())

    def _fields(self) -> dict[str, Any]:
        return {f.name: getattr(self, f.name) for f in fields(self)}

    def system(
        self,
        name: str | None = None,
        inputs: Sequence[str] | None = None,
        outputs: Sequence[str] | None = None,
        **values: Any,
    ) -> ct.NonlinearIOSystem:
        """The block as a NonlinearIOSystem whose parameters are keyed ``name.param``.

        ``inputs`` and ``outputs`` rename the signals, in the declared order. A value may be a
        function of the block's first signal if the block allows it.
        """
        import control as ct

        from ..core import control_pickling  # noqa: F401  so that the block and its loops pickle

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
        return ct.nlsys(
            Rates(*called) if self.states else None,
            Outputs(*called),
            inputs=renamed(name, "inputs", self.inputs, inputs),
            outputs=renamed(name, "outputs", self.outputs, outputs),
            states=list(self.states) or None,
            params={q: numbers[k] for k, q in keys.items()},
            name=name,
            **({} if self.states else {"dt": None}),
        )


class _Registry(dict[tuple[str, str], Block]):
    """Blocks by kind and name; a name alone finds the first registered block of that name."""

    def __missing__(self, key: Any) -> Block:
        for (kind, name), made in registered().items():
            if key in (name, (kind, name)):
                return made
        raise KeyError(key)

    def get(self, key: Any, default: Any = None) -> Any:
        try:
            return self[key]
        except KeyError:
            return default


REGISTRY = _Registry()


def block(
    kind: str,
    *,
    out: str,
    states: str = "",
    name: str = "",
    acts: str = "",
    confused: str = "",
    experiment: str = "",
    exact: Callable[..., np.ndarray] | None = None,
    tries: Callable[..., list[dict[str, float]]] | None = None,
    start: str = "",
    load: bool = False,
    abrupt: bool = False,
    source: str = "",
) -> Callable[[Callable[..., Any]], Block]:
    """Declare a function as a block of a kind and enter it in the registry.

    Parameters
    ----------
    kind : str
        "friction", "plant", "observer", "controller" or "effect".
    out, states : str
        Names, separated by spaces; an output that is a state need not be returned.
    name : str
        The block's name, if it is not the name of the function.
    acts : str
        For an effect, what its output does: "torque" (added to the resisting side), "input"
        (replaces u), "sensor" (the outputs are the sensor signals), names of parameters that
        it multiplies by 1 + output, or names with a plus ("+Fc") to which it adds the output.
        One output serves all acts; otherwise each act has its own.
    confused, experiment : str
        For an effect: the effects that look similar in a record, and what to record to
        distinguish them.
    exact : callable
        ``exact(u, dt, **values)`` of an input effect on a held input: the mean of its output
        over each cell.
    tries : callable
        ``tries(log, values)``: complete sets of its parameters to try on a friction map (runs at
        steady speed), if a linear step from the neutral value cannot find them. ``values`` holds
        the plant's parameters; a set may contain plant parameters too, which are then changed
        with it.
    start : str
        For each state the input to which it is equal in equilibrium, or 0; default all 0.
    load : bool
        True for a torque effect that is a load: load-dependent friction includes it.
    abrupt : bool
        True if the torque jumps with the sign of w. The diagnosis lets it build up like the
        friction of the bristles.
    source : str
        Where the equation comes from: paper, year, number of the equation.

    Raises
    ------
    InputError
        When another block of the kind has the name (a cell or module that is run again replaces
        its own block), or the declaration cannot be meant: an unknown kind, signal or act, a
        default that is no P, another number of returned values, an effect without a neutral value.
    """

    for what, given in (("kind", kind), ("out", out), ("states", states), ("acts", acts)):
        if not isinstance(given, str):
            raise InputError(
                f"{what} must be a text, names separated by spaces, not {shown(given)}."
            )

    def declare(function: Callable[..., Any]) -> Block:
        if not callable(function):
            raise InputError(f"a block is declared of a function, not of {shown(function)}.")
        made = replace(
            _declared(function, name, kind, tuple(out.split()), tuple(states.split())),
            acts=tuple(acts.split()),
            confused=tuple(confused.split()),
            experiment=experiment,
            exact=exact,
            tries=tries,
            start=tuple(start.split()) or ("0",) * len(states.split()),
            load=load,
            abrupt=abrupt,
            source=source,
        )
        ours = _is_ours(made.home)
        known = REGISTRY if ours else registered()  # of the package, those so far
        if not ours:
            laws = (b.parameters for (of, _), b in known.items() if of == "friction")
            check(made, [key for law in laws for key in law])
        before = dict(known).get((kind, made.name))
        if before is not None and not is_same(before, function, made.home):
            raise InputError(f"{kind}: a block named '{made.name}' exists; choose another name.")
        REGISTRY[kind, made.name] = as_function(made)
        return made

    return declare


def _declared(
    function: Callable[..., Any],
    name: str,
    kind: str,
    out: tuple[str, ...],
    states: tuple[str, ...],
) -> Block:
    name = name or function.__name__
    signals, parameters = signature(name, function, P)
    timed = bool(signals) and signals[0] == "t"
    inputs = tuple(s for s in signals[timed:] if s not in states)
    if tuple(signals[timed:]) != inputs + states:
        raise InputError(f"{name}: signals come first, then states {states}.")
    return Block(
        name=name,
        kind=kind_of(kind),
        function=function,
        inputs=inputs,
        outputs=out,
        states=states,
        parameters=parameters,
        timed=timed,
        home=function.__module__,
    )


def members(kind: str) -> dict[str, Block]:
    """The registered blocks of a kind, by name: those of the package, then the user's own."""
    return {name: made for (of, name), made in registered().items() if of == kind}


def registered() -> _Registry:
    """The registry with the package's own blocks in it, whatever was imported so far."""
    from . import fill  # they import this module

    fill()
    return REGISTRY


def _is_ours(home: str) -> bool:
    return home.startswith(f"{__package__}.")

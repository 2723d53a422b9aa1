"""What a declaration of a block must say, checked where it is declared."""

from __future__ import annotations

import inspect
import itertools
import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ..core.errors import InputError
from ..core.validation import names, shown
from .aliases import meant
from .block import REGISTRY, Block, Group, Grouped, P, is_ours, registered

KINDS = ("friction", "plant", "observer", "controller", "effect")
SEEN = ("t", "theta", "w", "u", "d", "load")  # signals of a drive that an effect may read
ACTS = ("torque", "input", "sensor")
SENSED = ("w_m", "theta_m")
TRIED = (0.3, -0.7, 0.2)  # values of the signals with which a function is run once
SIZES, SHARES = (1.0, 3.7, -11.3), (-1.3, 0.4, 2.2)  # of them, and of a span
SMALL = 1e-9


def kind_of(kind: str) -> str:
    """A known kind; InputError with the nearest one for anything else."""
    if kind not in KINDS:
        raise InputError(f"there is no kind of block {kind!r}; {meant(kind, KINDS)}")
    return kind


def signature(name: str, function: Callable[..., Any]) -> tuple[list[str], dict, tuple[Any, ...]]:
    """The names of the signals, the parameters by name, and those that are taken in groups."""
    signals, parameters, groups = [], {}, []
    for key, one in inspect.signature(function).parameters.items():
        if one.kind in (one.VAR_POSITIONAL, one.VAR_KEYWORD):
            raise InputError(
                f"{name}: the function takes *{key}; name each signal and each parameter."
            )
        if isinstance(one.default, Group):
            parameters |= one.default
            groups.append((key, one.default.kind, tuple(one.default)))
        elif isinstance(one.default, P):
            parameters[key] = one.default
        elif one.default is one.empty:
            signals.append(key)
        else:
            raise InputError(
                f"{name}: the default of {key} is {shown(one.default)}; declare the parameter as "
                f"{key}=P({shown(one.default)}, unit)."
            )
    return signals, parameters, tuple(groups)


def check(made: Block, known: Iterable[str]) -> None:
    """InputError where a declaration cannot be meant; ``known``: the parameters of all laws."""
    _check_names(made)
    _check_values(made)
    if made.kind in ("effect", "friction"):
        _check_signals(made)
    if made.kind == "effect":
        _check_acts(made, [*known])
    elif made.acts:
        raise InputError(
            f"{made.name}: acts belongs to effects, not to a block of the kind {made.kind}."
        )
    results = _tried(made, made.defaults())
    if results is not None:
        _check_count(made, results)
    if made.kind == "effect" and made.acts:
        _check_neutral(made)


def _check_names(made: Block) -> None:
    for what, labels in (("out", made.outputs), ("states", made.states)):
        for name in labels:
            if not name.isidentifier() or labels.count(name) > 1:
                raise InputError(f"{made.name}: {what} names {name!r}, which is no single name.")
    if not made.outputs:
        raise InputError(f"{made.name}: out names no output.")
    if len(made.start) != len(made.states):
        raise InputError(
            f"{made.name}: start must give one of its inputs, or 0, for each of its states "
            f"({', '.join(made.states) or 'none'})."
        )
    for name in made.start:
        if name not in ("0", *made.inputs):
            raise InputError(f"{made.name}: start names {name!r}; {meant(name, made.inputs)}")


def _check_values(made: Block) -> None:
    for key, p in made.parameters.items():
        for what, value in (("default", p.value), ("neutral value", p.neutral)):
            if value is not None and not p.low <= value <= p.high:
                raise InputError(
                    f"{made.name}: the {what} of {key} is {value:g}, outside its bounds of "
                    f"{p.low:g} to {p.high:g}{'' if p.unit == '1' else ' ' + p.unit}."
                )
        if p.choices and p.value not in p.choices:
            known = ", ".join(f"{x:g}" for x in p.choices)
            raise InputError(
                f"{made.name}: the default of {key} is {p.value:g}, none of its choices {known}."
            )


def _check_signals(made: Block) -> None:
    for name in made.inputs:
        if name not in SEEN:
            raise InputError(
                f"{made.name} reads {name}, a signal that no drive has; {meant(name, SEEN)} A "
                "parameter needs a default: name=P(value, unit)."
            )
    if "load" in made.inputs and (made.load or "input" in made.acts):
        raise InputError(f"{made.name} reads load, which is known only after the loads and u.")


def _check_acts(made: Block, known: Sequence[str]) -> None:
    levels = [*dict.fromkeys(["J", *known])]
    for act in made.acts:
        if act not in ACTS and act.removeprefix("+") not in levels:
            raise InputError(
                f"{made.name} acts on {act!r}, which no drive has; "
                f"{meant(act.removeprefix('+'), [*ACTS, *levels])}"
            )
    fresh, many = made.fresh, len(made.acts)
    if "sensor" in made.acts and (many > 1 or set(made.outputs) != {*SENSED}):
        raise InputError(
            f"{made.name} acts on the sensor: its outputs must be {' '.join(SENSED)}, and it acts "
            "on nothing else."
        )
    if many and "sensor" not in made.acts and len(fresh) not in (1, many):
        raise InputError(
            f"{made.name} has {len(fresh)} outputs and acts on {', '.join(made.acts)}: give one "
            "output for all, or one for each."
        )


def _check_count(made: Block, results: tuple[Any, ...]) -> None:
    wanted = [f"output {k}" for k in made.fresh] + [f"rate of {k}" for k in made.states]
    if len(results) != len(wanted):
        raise InputError(
            f"{made.name} returns {len(results)} values, but {len(wanted)} are declared: "
            f"{', '.join(wanted) or 'none'}."
        )
    for what, value in zip(wanted, results, strict=True):
        try:
            float(value)
        except (TypeError, ValueError):
            raise InputError(f"{made.name}: the {what} is {shown(value)}, no number.") from None


def _check_neutral(made: Block) -> None:
    """An effect has a neutral value, and with it changes nothing."""
    neutral = {k: p.neutral for k, p in made.parameters.items() if p.neutral is not None}
    if not neutral:
        raise InputError(
            f"{made.name} has no neutral value, at which it changes nothing: give one parameter "
            "neutral=0.0 (or math.inf, for a limit): P(value, unit, neutral=0.0)."
        )
    first = next(iter(neutral))
    values = made.defaults() | {first: neutral[first]}
    results = None if made.states else _tried(made, values)
    if results is None:
        return
    given = dict(zip(made.reads, _signals(made), strict=False))
    for name, value in zip(made.fresh, results, strict=True):
        still = {"w_m": given.get("w"), "theta_m": given.get("theta")}.get(name, 0.0)
        still = given.get("u") if made.acts == ("input",) else still
        if still is not None and not abs(float(value) - still) <= SMALL:
            raise InputError(
                f"{made.name}: with {first} = {neutral[first]:g}, its neutral value, it must "
                f"change nothing, but {name} is {float(value):g} instead of {still:g}."
            )


def true_spans(made: Block) -> dict[str, Any]:
    """The parameters, without a span that the function does not fulfil: that one is searched.

    A phase must combine as f(x) = cos(x) f(0) + sin(x) f(pi/2), anything else in a straight line.
    """

    def at(key: str, x: float, size: float) -> np.ndarray:
        still = made.parameters[made.gain].neutral or 0.0
        values = made.defaults() | {key: x}
        gains = (1.0 if math.isinf(still) else still + 1.0, still)
        found = [_tried(made, values | {made.gain: gain}, size) for gain in gains]
        if found[0] is None or found[1] is None:
            return np.full(1, np.nan)
        return np.array(found[0], float) - np.array(found[1], float)  # what it changes

    def holds(key: str, p: Any) -> bool:
        first, second = p.span
        if p.angle and not np.allclose(p.span, (0.0, math.pi / 2)):
            return False
        for size, x in itertools.product(SIZES, SHARES):
            parts = (math.cos(x), math.sin(x)) if p.angle else (1.0 - x, x)
            there = x if p.angle else first + x * (second - first)
            found = [at(key, value, size) for value in (there, first, second)]
            if not np.all(np.isfinite(found)):
                return False
            mixed = parts[0] * found[1] + parts[1] * found[2]
            if not np.allclose(found[0], mixed, 1e-6, 1e-9 * np.abs(found).max()):
                return False
        return True

    if made.kind != "effect" or not made.acts:
        return dict(made.parameters)
    return {
        k: p if p.span is None or holds(k, p) else replace(p, span=None)
        for k, p in made.parameters.items()
    }


def _signals(made: Block) -> list[float]:
    return [TRIED[i % len(TRIED)] for i in range(len(made.reads) + len(made.states))]


def _tried(made: Block, values: dict[str, float], size: float = 1.0) -> tuple[Any, ...] | None:
    """What the function returns; None where it cannot be run yet, or not at these values."""
    try:
        with np.errstate(all="ignore"):
            signals = [np.float64(size * x) for x in _signals(made)]
            results = made.function(*signals, **values)
    except (NameError, ArithmeticError):  # a helper is defined below it; 1/0 of plain numbers
        return None
    except Exception as error:
        raise InputError(
            f"{made.name} cannot be run: {type(error).__name__}: {error}. Its arguments are "
            f"{', '.join([*made.reads, *made.states, *values])}."
        ) from error
    return results if isinstance(results, tuple) else (results,)


def is_same(known: Block, function: Callable[..., Any], home: str) -> bool:
    """Whether a block is declared again: its function has the same name and the same place."""
    if known.home == home == "__main__":
        return True
    old = known.function
    names = [getattr(f, "__qualname__", None) for f in (old, function)]
    files = [getattr(getattr(f, "__code__", None), "co_filename", "") for f in (old, function)]
    homes = known.home == home or files[0] == files[1] != ""
    return None not in names and names[0] == names[1] and homes


def block(
    kind: str,
    *,
    out: str | Sequence[str],
    states: str | Sequence[str] = "",
    name: str = "",
    acts: str | Sequence[str] = "",
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
    out, states : str or list of str
        Names, a list or a text with spaces between them; an output that is a state need not be
        returned.
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
        Accepted for blocks that give one, and not read: the search spreads its own values.
    start : str
        For each state the input to which it is equal in equilibrium, or 0; default all 0.
    load : bool
        True for a torque effect that is a load: load-dependent friction includes it.
    abrupt : bool
        True if the torque jumps with the sign of w. The diagnosis lets it build up like the
        friction of the bristles.
    source : str
        Where the equation comes from: paper, year, number of the equation.

    Returns
    -------
    callable
        The decorator. It returns the block, which is still called as the function was.

    Raises
    ------
    InputError
        When another block of the kind has the name (a cell or module that is run again replaces
        its own block), or the declaration cannot be meant: an unknown kind, signal or act, a
        default that is no P, another number of returned values, an effect without a neutral value.

    Examples
    --------
    The torque of a cable chain, which grows with the angle:

    >>> @lg.block("effect", out="d", acts="torque")
    ... def cable_chain(theta, stiffness=lg.P(0.0, "N m/rad", neutral=0.0)):
    ...     '''d = stiffness theta.'''
    ...     return stiffness * theta
    >>> lg.effects()["cable_chain"].equation
    'd = stiffness theta'
    >>> chain = lg.effect("cable_chain", stiffness=0.2)
    >>> chain.output(0.0, [], [0.5])
    array([0.1])
    """

    out, states, acts = (
        given if isinstance(given, str) else " ".join(names(given, what))
        for what, given in (("out", out), ("states", states), ("acts", acts))
    )
    if not isinstance(kind, str):
        raise InputError(f"kind must be a text, not {shown(kind)}.")

    def declare(function: Callable[..., Any]) -> Block:
        if not callable(function):
            raise InputError(f"a block is declared of a function, not of {shown(function)}.")
        label, own = name or function.__name__, tuple(states.split())
        signals, parameters, groups = signature(label, function)
        timed = signals[:1] == ["t"]
        inputs = tuple(s for s in signals[timed:] if s not in own)
        if tuple(signals[timed:]) != inputs + own:
            raise InputError(f"{label}: signals come first, then states {own}.")
        made = Block(
            name=label,
            kind=kind_of(kind),
            function=Grouped(function, groups) if groups else function,
            inputs=inputs,
            outputs=tuple(out.split()),
            states=own,
            parameters=parameters,
            timed=timed,
            acts=tuple(acts.split()),
            confused=tuple(confused.split()),
            experiment=experiment,
            exact=exact,
            tries=tries,
            start=tuple(start.split()) or ("0",) * len(own),
            load=load,
            abrupt=abrupt,
            home=function.__module__,
            source=source,
        )
        return _entered(made, function)

    return declare


def _entered(made: Block, function: Callable[..., Any]) -> Block:
    """The block as the registry then has it; InputError for one that it cannot have."""
    known = REGISTRY  # of the package, those so far
    if not is_ours(made.home):
        known = registered()
        laws = (b.parameters for (of, _), b in known.items() if of == "friction")
        check(made, [key for law in laws for key in law])
        made = replace(made, parameters=true_spans(made))
    before = dict(known).get((made.kind, made.name))
    if before is not None and not is_same(before, function, made.home):
        raise InputError(f"{made.kind}: a block named '{made.name}' exists; choose another name.")
    same = {"__doc__": function.__doc__, "__wrapped__": made.function}
    same["__signature__"] = inspect.signature(function)
    for key, value in same.items():
        object.__setattr__(made, key, value)
    REGISTRY[made.kind, made.name] = made
    return made

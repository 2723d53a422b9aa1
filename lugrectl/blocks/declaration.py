"""Blocks are declared, in code or in a file of the user's own, and found by their names."""

from __future__ import annotations

import contextlib
import copyreg
import importlib
import inspect
import itertools
import math
import re
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import fields, is_dataclass, replace
from hashlib import sha256
from pathlib import Path
from traceback import extract_tb
from types import ModuleType
from typing import Any

import numpy as np

from ..core.errors import InputError
from ..core.option_names import option
from ..core.pickling import carried, from_fields, rebuilt
from ..core.validation import as_path, like_it, names, nearest, shown
from .block import REGISTRY, Block, Group, P, is_ours, members, registered

KINDS = ("friction", "plant", "observer", "controller", "effect", "variant")
SEEN = ("t", "theta", "w", "u", "d", "load")  # signals of a drive that an effect may read
ACTS = ("torque", "input", "sensor")
SENSED = ("w_m", "theta_m")
TRIED = (0.3, -0.7, 0.2)  # values of the signals with which a function is run once
SIZES, SHARES = (1.0, 3.7, -11.3), (-1.3, 0.4, 2.2)  # of them, and of a span
SMALL = 1e-9


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
    told = (_of_names(made), _of_acts(made, known), _of_results(made))
    for fault in itertools.chain.from_iterable(told):
        raise InputError(f"{made.name}: {fault}")


def _of_names(made: Block) -> Iterator[str]:
    for what, labels in (("out", made.outputs), ("states", made.states)):
        for name in labels:
            if not name.isidentifier() or labels.count(name) > 1:
                yield f"{what} names {name!r}, which is no single name."
    if not made.outputs:
        yield "out names no output."
    if len(made.start) != len(made.states):
        yield f"start must give one of its inputs, or 0, for each of {', '.join(made.states)}."
    for name in made.start:
        if name not in ("0", *made.inputs):
            yield f"start names {name!r}; {meant(name, made.inputs)}"
    for key, p in made.parameters.items():
        for what, value in (("default", p.value), ("neutral value", p.neutral)):
            if value is not None and not p.low <= value <= p.high:
                bounds = f"{p.low:g} to {p.high:g}{'' if p.unit == '1' else ' ' + p.unit}"
                yield f"the {what} of {key} is {value:g}, outside its bounds of {bounds}."
        if p.choices and p.value not in p.choices:
            known = ", ".join(f"{x:g}" for x in p.choices)
            yield f"the default of {key} is {p.value:g}, none of its choices {known}."


def _of_acts(made: Block, known: Iterable[str]) -> Iterator[str]:
    many, sensor, drives = len(made.acts), "sensor" in made.acts, ("effect", "friction")
    for name in made.inputs if made.kind in drives else ():
        if name not in SEEN:
            yield (
                f"it reads {name}, a signal that no drive has; {meant(name, SEEN)} A parameter "
                "needs a default: name=P(value, unit)."
            )
    if "load" in made.inputs and (made.load or "input" in made.acts):
        yield "it reads load, which is known only after the loads and u."
    if made.acts and made.kind != "effect":
        yield f"acts belongs to effects, not to a block of the kind {made.kind}."
    levels = [*dict.fromkeys(["J", *known])]
    for act in made.acts:
        if act not in ACTS and act.removeprefix("+") not in levels:
            near = meant(act.removeprefix("+"), [*ACTS, *levels])
            yield f"it acts on {act!r}, which no drive has; {near}"
    if sensor and (many > 1 or set(made.outputs) != {*SENSED}):
        yield "it acts on the sensor: its outputs must be w_m theta_m, and it acts on nothing else."
    if many and not sensor and len(made.fresh) not in (1, many):
        yield f"give one output for all of {', '.join(made.acts)}, or one for each."


def _of_results(made: Block) -> Iterator[str]:
    results = _tried(made, made.defaults())
    wanted = [f"output {k}" for k in made.fresh] + [f"rate of {k}" for k in made.states]
    if results is not None and len(results) != len(wanted):
        many = f"{len(results)} values, but {len(wanted)} are declared"
        yield f"it returns {many}: {', '.join(wanted) or 'none'}."
    for what, value in zip(wanted, results or (), strict=False):
        try:
            float(value)
        except (TypeError, ValueError):
            yield f"the {what} is {shown(value)}, no number."
    if not made.acts:
        return
    first = next((k for k, p in made.parameters.items() if p.neutral is not None), None)
    if first is None:
        yield (
            "it has no neutral value, at which it changes nothing: give one parameter "
            "neutral=0.0 (or math.inf, for a limit): P(value, unit, neutral=0.0)."
        )
        return
    neutral = made.parameters[first].neutral
    results = None if made.states else _tried(made, made.defaults() | {first: neutral})
    given = dict(zip(made.reads, _signals(made), strict=False))
    for name, value in zip(made.fresh, results or (), strict=False):
        still = {"w_m": given.get("w"), "theta_m": given.get("theta")}.get(name, 0.0)
        still = given.get("u") if made.acts == ("input",) else still
        if still is not None and not abs(float(value) - still) <= SMALL:
            yield (
                f"with {first} = {neutral:g}, its neutral value, it must change nothing, but "
                f"{name} is {float(value):g} instead of {still:g}."
            )


def true_spans(made: Block) -> dict[str, P]:
    """The parameters, without a span that the function does not fulfil: that one is searched.

    A phase must combine as f(x) = cos(x) f(0) + sin(x) f(pi/2), anything else in a straight line.
    """

    def change(key: str, x: float, size: float) -> Any:
        still = made.parameters[made.gain].neutral or 0.0
        gains = (1.0 if math.isinf(still) else still + 1.0, still)
        values = made.defaults() | {key: x}
        on, off = (_tried(made, values | {made.gain: gain}, size) for gain in gains)
        return np.nan if on is None or off is None else np.subtract(on, off)

    def holds(key: str, p: P) -> bool:
        first, second = p.span or (0.0, 1.0)
        for size, x in itertools.product(SIZES, SHARES):
            a, b = (math.cos(x), math.sin(x)) if p.angle else (1.0 - x, x)
            there = x if p.angle else first + x * (second - first)
            found, at_first, at_second = (change(key, v, size) for v in (there, first, second))
            close = 1e-9 * np.max(np.abs([found, at_first, at_second]))
            if not np.allclose(found, a * at_first + b * at_second, 1e-6, close):
                return False
        return True

    return {
        k: replace(p, span=None) if made.acts and p.span and not holds(k, p) else p
        for k, p in made.parameters.items()
    }


def _signals(made: Block) -> list[float]:
    return [TRIED[i % len(TRIED)] for i in range(len(made.reads) + len(made.states))]


def _tried(made: Block, values: Mapping[str, Any], size: float = 1.0) -> tuple[Any, ...] | None:
    """What the function returns; None where it cannot be run yet, or not at these values."""
    try:
        with np.errstate(all="ignore"):
            return made(*[np.float64(size * x) for x in _signals(made)], **values)
    except (NameError, ArithmeticError):  # a helper is defined below it; 1/0 of plain numbers
        return None
    except Exception as error:
        raise InputError(
            f"{made.name} cannot be run: {type(error).__name__}: {error}. Its arguments are "
            f"{', '.join([*made.reads, *made.states, *values])}."
        ) from error


def is_same(known: Block, made: Block) -> bool:
    """Whether a block is declared again: its function has the same name and the same place."""
    if known.home == made.home == "__main__":
        return True
    names = [getattr(b.function, "__qualname__", None) for b in (known, made)]
    codes = [getattr(b.function, "__code__", None) for b in (known, made)]
    files = [getattr(code, "co_filename", "") for code in codes]
    homes = known.home == made.home or files[0] == files[1] != ""
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
    if not isinstance(kind, str) or kind not in KINDS:
        raise InputError(f"there is no kind of block {shown(kind)}; {meant(kind, KINDS)}")

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
            kind=kind,
            function=function,
            inputs=inputs,
            states=own,
            parameters=parameters,
            timed=timed,
            experiment=experiment,
            exact=exact,
            load=load,
            abrupt=abrupt,
            home=function.__module__,
            source=source,
            groups=groups,
            outputs=tuple(out.split()),
            acts=tuple(acts.split()),
            confused=tuple(confused.split()),
            start=tuple(start.split()),
        )
        return _entered(made)

    return declare


def _entered(made: Block) -> Block:
    """The block as the registry then has it; InputError for one that it cannot have."""
    known, function = REGISTRY, made.function  # of the package, those so far
    if not is_ours(made.home):
        known = registered()
        check(
            made, [k for (of, _), law in known.items() if of == "friction" for k in law.parameters]
        )
        made = replace(made, parameters=true_spans(made))
    before = known.get((made.kind, made.name))
    if before is not None and not is_same(before, made):
        raise InputError(f"{made.kind}: a block named '{made.name}' exists; choose another name.")
    same = {"__doc__": function.__doc__, "__wrapped__": function}
    for key, value in (same | {"__signature__": inspect.signature(function)}).items():
        object.__setattr__(made, key, value)
    REGISTRY[made.kind, made.name] = made
    return made


# --- the names that the field uses for them ---

# Only names with one meaning: "dead band" may be a backlash or a dead zone, so it is not here.
_COMMON = {
    "constant_torque": "torque_offset offset_torque",
    "gravity": "unbalance imbalance",
    "torque_ripple": "cogging cogging_torque detent detent_torque",
    "hard_stop": "end_stop endstop mechanical_stop",
    "thermal_drift": "warm_up warmup",
    "quadratic_drag": "windage air_drag aerodynamic_drag",
    "sublinear_viscous": "shear_thinning",
    "dwell_stiction": "stiction_growth aging frictional_aging",
    "stribeck": "stribeck_effect",
    "presliding": "pre_sliding",
    "input_delay": "dead_time transport_delay time_delay",
    "actuator_lag": "motor_lag current_loop_lag",
    "actuator_saturation": "saturation torque_limit current_limit",
    "actuator_dead_zone": "dead_zone deadzone",
    "torque_constant_ripple": "kt_ripple",
    "elastic_coupling": "joint_flexibility flexible_joint compliance two_mass",
    "backlash": "play lost_motion free_play gear_play clearance",
    "inertia_step": "payload_change",
    "pose_dependent_inertia": "variable_inertia",
    "velocity_sensor_lag": "velocity_filter speed_filter",
    "encoder_eccentricity": "eccentric_encoder encoder_runout",
}
COMMON = {common: name for name, many in _COMMON.items() for common in many.split()}


def name_of(kind: str, given: Any) -> Any:
    """The name of a block that stands in its place; anything else but a system as it is."""
    if isinstance(given, Block):
        if given.kind != kind:
            raise InputError(
                f"{given.name} is declared as {_word(given.kind)}, not as {_word(kind)}."
            )
        return given.name
    if hasattr(given, "ninputs") and hasattr(given, "noutputs"):
        raise InputError(
            f"{given.name} is a python-control system: give the name of the {_word(kind)} in its "
            "place and the values beside it, or write its equations as a function below "
            f'@lg.block("{kind}", ...); or wire the system by lg.simulate([...], t).'
        )
    factory = callable(given) and is_ours(getattr(given, "__module__", None) or "")
    return given.__name__ if factory and given.__name__ in members(kind) else given


def _word(kind: str) -> str:
    return "friction law" if kind == "friction" else kind


def listed(kind: str, given: Any) -> Any:
    """One name or block, or several, as a list of names; anything else as it is."""
    one = isinstance(given, str) or callable(given) or hasattr(given, "ninputs")
    several = [given] if one else given
    return [name_of(kind, g) for g in several] if isinstance(several, (list, tuple)) else several


def block_named(kind: str, name: Any, *, where: str = "", what: str = "") -> Block:
    """The registered block that a name means: its own first, a common name of an effect, or the
    name without its kind. The error starts with ``where`` and calls the kind ``what``."""
    known, name = members(kind), name_of(kind, name)
    if isinstance(name, str) and name in known:
        return known[name]
    names = COMMON | {_spelling(k): k for k in known} if kind == "effect" else {}
    names = names or {_spelling(k.removesuffix(f"_{kind}")): k for k in known}
    typed = _spelling(name).removesuffix(f"_{kind}")
    if names.get(typed) in known:
        return known[names[typed]]
    short = [k.removesuffix(f"_{kind}") for k in known if k != "no_observer"]
    hint = meant(typed, names, ", ".join(short))
    start = f"{where}: " if where else ""
    raise InputError(
        f"{start}there is no {what or _word(kind)} named {shown(name)}; {hint} One of your own: "
        f"{option('blocks', 'FILE.py')}."
    )


def meant(name: Any, known: Iterable[str], all_of: str = "") -> str:
    """What a sentence says of a mistyped name: the nearest known one, or all."""
    spelt = {_spelling(k): k for k in known}
    near = nearest(_spelling(name), spelt)
    all_of = all_of or ", ".join(spelt.values()) or "none"
    return f"did you mean '{spelt[near]}'?" if near else f"known: {all_of}."


def also_called(kind: str, name: str) -> tuple[str, ...]:
    """The common names of an effect, without those that a registered block has."""
    known = members(kind) if kind == "effect" else COMMON
    return tuple(c for c, meant in COMMON.items() if meant == name and c not in known)


def _spelling(name: Any) -> str:
    return re.sub(r"[\s_-]+", "_", str(name).strip().lower())


# --- in a file of the user's own ----


LOADED: dict[Path, tuple[str, str]] = {}  # file: (name of its module, SHA-256 of its text)


def load_blocks(path: str | Path) -> list[str]:
    """Declare the blocks of a Python file: effects, friction laws, observers, controllers.

    The file is run like a script in its own folder. A file that was loaded before is run again
    only if its text has changed, and then replaces its blocks.

    Parameters
    ----------
    path : str or Path
        A file with one or more ``@lugrectl.block``.

    Returns
    -------
    list of str
        The names of the blocks that it declares.

    Raises
    ------
    InputError
        When the file is missing, fails or declares nothing; the sentence names file and line. No
        block of it is declared then.

    Examples
    --------
    >>> from pathlib import Path
    >>> file = Path("mine.py")
    >>> lines = [
    ...     "import lugrectl as lg",
    ...     "@lg.block('effect', out='d', acts='torque')",
    ...     "def stiff(theta, k=lg.P(0.0, 'N m/rad3', neutral=0.0)):",
    ...     "    return k * theta**3",
    ... ]
    >>> size = file.write_text(chr(10).join(lines))
    >>> lg.load_blocks(file)
    ['stiff']
    """
    file, text = _read(path)
    stem = "".join(c if c.isalnum() else "_" for c in file.stem)
    # a name that no other file has; without a dot, so that what it holds pickles
    name = f"blocks_{stem}_{sha256(str(file).encode('utf-8', 'replace')).hexdigest()[:8]}"
    digest = sha256(text).hexdigest()
    if LOADED.get(file) != (name, digest):
        _run(file, text, name)
        LOADED[file] = name, digest
    return _declared_by(name)


def load_named(given: Any, folder: str | Path, where: str) -> tuple[str, ...]:
    """The files that ``blocks`` of a model names, loaded; InputError starts with ``where``."""
    given = [given] if isinstance(given, str) else given
    if not isinstance(given, (list, tuple)) or not all(isinstance(one, str) for one in given):
        raise InputError(f'{where}: blocks must be a list of files, such as ["mine.py"].')
    files = [Path(folder, one) for one in given]
    for file in files:
        try:
            load_blocks(file)
        except InputError as error:
            raise InputError(f"{where}: blocks: {error}") from error
    return tuple(str(file.resolve()) for file in files)


def files_of_blocks(homes: Iterable[str] | None = None) -> list[str]:
    """The files that were loaded by their path: all, or those among the homes of blocks."""
    by_name = {name: str(file) for file, (name, _) in LOADED.items()}
    return [*dict.fromkeys(by_name[home] for home in homes or by_name if home in by_name)]


def _read(path: str | Path) -> tuple[Path, bytes]:
    path = as_path(path, "a file of blocks")
    try:
        return path.resolve(), path.read_bytes()
    except OSError as error:
        why = error.strerror or error
        raise InputError(
            f"{path}: {why}{like_it(path)}; name a file of blocks, such as mine.py."
        ) from None


def _run(file: Path, text: bytes, name: str) -> None:
    """Run a file as a module of that name; one that fails leaves nothing behind."""
    module = ModuleType(name)
    module.__file__ = str(file)
    before, known, folder = dict(registered()), sys.modules.get(name), str(file.parent)
    sys.modules[name] = module  # as for an import: dataclasses and pickles look there
    sys.path.insert(0, folder)  # modules beside it can be imported, as from a script
    try:
        exec(compile(text, str(file), "exec", dont_inherit=True), module.__dict__)
        if not _declared_by(name):
            raise InputError("no block is declared: write @lugrectl.block above each function.")
    except BaseException as error:  # SystemExit of a script as well
        REGISTRY.clear()
        REGISTRY.update(before)
        sys.modules.pop(name, None)
        sys.modules.update({} if known is None else {name: known})
        if isinstance(error, KeyboardInterrupt):
            raise
        raise InputError(_sentence(file, error)) from error
    finally:
        with contextlib.suppress(ValueError):
            sys.path.remove(folder)


def _sentence(file: Path, error: BaseException) -> str:
    lines = [f.lineno for f in extract_tb(error.__traceback__) if f.filename == str(file)]
    what = " ".join(f"{error}".split()) or "no message"
    if isinstance(error, SyntaxError):
        lines += [error.lineno] if error.filename == str(file) else []
        what = error.msg
    where = f"{file}, line {lines[-1]}" if lines else str(file)
    own = isinstance(error, InputError)
    return f"{where}: {what}" if own else f"{where}: {type(error).__name__}: {what}."


def _declared_by(name: str) -> list[str]:
    return [made.name for made in registered().values() if made.home == name]


def declared(kind: str, name: str, where: str) -> Block:
    """A registered block; ``where`` its module is to be found, a name or the path of a file."""
    if (kind, name) not in registered() and where not in ("__main__", "__mp_main__", ""):
        with contextlib.suppress(ImportError):
            if where.endswith(".py"):
                load_blocks(where)
            else:
                importlib.import_module(where)
    if (kind, name) not in REGISTRY:
        home = "the notebook cell or script" if where == "__main__" else f"the module {where}"
        raise InputError(
            f"the {kind} '{name}' is not declared in this session: run {home} that declares it "
            "with @block, then load again; for worker processes, use jobs=1."
        )
    return REGISTRY[kind, name]


def _reduced(made: Block) -> Any:
    """A registered block pickles by kind and name, a composed one by its parts."""
    known = REGISTRY.get((made.kind, made.name))
    if known is made:
        where = next(iter(files_of_blocks([made.home])), made.home)
        return declared, (made.kind, made.name, where)
    build = getattr(made.function, "block", None)
    if build is not None and is_dataclass(made.function) and build() == made:
        return rebuilt, (made.function,)
    cure = "" if known is None else "it was declared again since: build what holds it again"
    own = {f.name: getattr(made, f.name) for f in fields(made)}
    for what, value in own.items():
        carried(f"the {what} of the block {made.name}", value, cure)
    return from_fields, (type(made), own)


copyreg.pickle(Block, _reduced)

"""Factories: public functions that make a python-control block of a drive's values.

A docstring leaves out what is the same in all of them. Most are one function, the equation itself:
:func:`built` enters the block and gives back the factory. One that does more is written with its
own arguments and ``**names``, below :func:`factory`.
"""

from __future__ import annotations

import inspect
import re
import textwrap
import warnings
from collections.abc import Callable, Sequence
from functools import wraps
from inspect import Parameter
from typing import TYPE_CHECKING, Any, ParamSpec, TypedDict

from ..core.errors import InputError
from ..core.validation import real
from .block import Block, is_ours
from .declaration import block, block_named
from .friction import formed, lugre
from .model import Model, Parameters, as_model

if TYPE_CHECKING:
    import control as ct

_PERIOD = ("harmonic", "frequency")  # of a periodic effect: no drive has a usual one
Arguments = ParamSpec("Arguments")


class Names(TypedDict, total=False):
    """The last arguments of every factory: the block's name and other names for its signals."""

    name: str
    inputs: Sequence[str] | None
    outputs: Sequence[str] | None


def reading(names: Names, *signals: str) -> Names:
    """The names with these inputs where none are given."""
    return {**names, "inputs": names.get("inputs") or signals}


_NAMES = """name, inputs, outputs : str, list of str
    Block name and, in order, other names for the signals."""
_SECTIONS = ("Parameters", "Returns", "Raises", "Notes", "References", "Examples")
_USUAL = Parameter.POSITIONAL_OR_KEYWORD


def built(
    kind: str, *, gains: str = "", needed: str = "", **declared: Any
) -> Callable[[Callable[..., Any]], Callable[..., ct.NonlinearIOSystem]]:
    """Declare a function as a block, and give back the factory of that block: of p, where the
    block has values of a drive, and ``gains``, all others that are fitted unless given, with a star
    at the end the rest as ``**gains``; one that is ``needed`` has no default."""

    def declare(function: Callable[..., Any]) -> Callable[..., ct.NonlinearIOSystem]:
        doc = inspect.getdoc(function) or ""
        function.__doc__ = re.split(r"\n\n\w+\n---", doc.partition("\n\n")[2])[0]
        made = block(kind, **declared)(function)
        known, own = _from_drive(made), made.parameters
        named, star, _ = gains.partition("*")
        others = [k for k, p in own.items() if p.fitted and k not in known]
        given = [Parameter("p", _USUAL)] if known else []
        given += [Parameter(k, _USUAL, default=own[k].value) for k in named.split() or others]
        given = [one.replace(default=one.empty) if one.name == needed else one for one in given]
        last = [Parameter("gains", Parameter.VAR_KEYWORD)] if star else []

        def build(**values: Any) -> ct.NonlinearIOSystem:
            values |= values.pop("gains", {})
            return believed(made, **values) if known else made.system(**values)

        return _completed(function, build, given, last, _documented(doc, made))

    return declare


def factory(written: Callable[Arguments, Any]) -> Callable[Arguments, ct.NonlinearIOSystem]:
    """Complete a factory with a body: the arguments of :class:`Names`, and its docstring."""
    *own, _ = inspect.signature(written).parameters.values()
    return _completed(written, written, own, [], _documented(inspect.getdoc(written) or ""))


def _completed(
    written: Callable[..., Any],
    build: Callable[..., Any],
    own: list[Any],
    last: list[Any],
    doc: str,
) -> Callable[..., ct.NonlinearIOSystem]:
    names = {"name": written.__name__, "inputs": None, "outputs": None}
    own = own + [Parameter(k, Parameter.KEYWORD_ONLY, default=v) for k, v in names.items()] + last
    signature = inspect.Signature(own, return_annotation="ct.NonlinearIOSystem")

    @wraps(written)
    def called(*args: Any, **given: Any) -> ct.NonlinearIOSystem:
        try:
            bound = signature.bind(*args, **given)
        except TypeError as error:
            raise TypeError(f"{written.__name__}() {error}") from None
        bound.apply_defaults()
        return build(**bound.arguments)

    called.__doc__, called.__dict__["__signature__"] = doc, signature
    return called


def _documented(doc: str, made: Block | None = None) -> str:
    """A docstring with the three names, with what a block takes and refuses, and with types."""
    lead, *found = re.split(r"\n\n(\w+)\n-+\n", doc)
    parts = dict(zip(found[::2], found[1::2], strict=True))
    own = [parts.get("Parameters", ""), _NAMES]
    if made is not None:
        known = ", ".join(_from_drive(made))
        first = f"{made.name}.{known.split(',')[0]}"
        if known and not own[0].startswith("p : "):
            own = [f"p : Parameters or Model\n    Gives {known}: ``{first}`` ...", *own]
        refused = [f"p has no value of {known}"] if known else []
        refused += ["a value is out of its bounds"] if made.parameters else []
        refused += ["``inputs`` or ``outputs`` are not one name for each signal"]
        said = f"When {', or '.join(refused)}."
        parts["Raises"] = textwrap.fill(said, 92, break_on_hyphens=False)
    parts["Parameters"] = "\n".join(filter(None, own))
    for head, kind in (("Returns", "control.NonlinearIOSystem"), ("Raises", "InputError")):
        if head in parts:
            parts[head] = f"{kind}\n{textwrap.indent(parts[head], '    ')}"
    said = [f"{k}\n{'-' * len(k)}\n{parts[k]}" for k in _SECTIONS if k in parts]
    return "\n\n".join([lead, *said])


def _from_drive(made: Block) -> list[str]:
    """The parameters of a block that the values of a drive give: J and those of LuGre."""
    return [k for k in ("J", *lugre.parameters) if k in made.parameters]


def believed(made: Block, p: Parameters | Model, **given: Any) -> ct.NonlinearIOSystem:
    """An observer or controller with those of J and the LuGre parameters that it has, from p."""
    model = as_model(p, "p")
    needed: dict[str, Any] = {k: model.values().get(k) for k in _from_drive(made) if k not in given}
    if missing := [k for k, value in needed.items() if value is None]:
        raise InputError(
            f"{made.name} needs {', '.join(missing)}, which {model.name} does not give; "
            "give it the parameters of a LuGre model."
        )
    # near rest the proposed observer's poles have the product -K1 sigma0/J: K1 > 0 is a saddle
    K1 = given.get("K1") if made.name == "proposed_observer" else None
    at_rest = real(K1(0.0) if callable(K1) else K1)
    if at_rest is not None and at_rest > 0.0:
        warnings.warn(
            f"{made.name}: K1 = {at_rest:g} makes the estimate unstable near rest; K1 must be "
            "negative (-10.24 in the source paper).",
            RuntimeWarning,
            stacklevel=4,
        )
    return made.system(**needed, **given)


def friction(
    law: str,
    *,
    name: str | None = None,
    inputs: Sequence[str] | None = None,
    outputs: Sequence[str] | None = None,
    **values: Any,
) -> ct.NonlinearIOSystem:
    """A friction law as a block: input w (rad/s), output F (N m), which opposes positive w.

    Parameters
    ----------
    law : str
        Name in the list ``lugrectl.laws()``: "viscous", "coulomb", "stribeck", "lugre", ...
    name, inputs, outputs : str, list of str
        Block name (default: that of the law) and, in order, other names for the signals.
    **values : float
        Parameters of the law (Fc, Fs, Fv, vs, sigma0, sigma1, ...); default: Table 1. Also what
        gives a law its form: ``delta``, ``elements``, ``stiffness``, ``share``.

    Returns
    -------
    control.NonlinearIOSystem
        States are those of the law: z in rad for "lugre", none for a static law.

    Raises
    ------
    InputError
        For an unknown law or parameter, or a value outside its bounds.

    Examples
    --------
    The Stribeck curve, in N m at 0.01, 0.1 and 1 rad/s:

    >>> law = lg.friction("stribeck", Fc=0.3, Fs=0.4, vs=0.02, Fv=0.02)
    >>> [round(float(law.output(0.0, [], [w])[0]), 3) for w in (0.01, 0.1, 1.0)]
    [0.378, 0.302, 0.32]
    """
    made, own = formed(block_named("friction", law, what="friction law"), values, law)
    return made.system(name=name, inputs=inputs, outputs=outputs, **own)


def effect(
    kind: str,
    *,
    name: str | None = None,
    inputs: Sequence[str] | None = None,
    outputs: Sequence[str] | None = None,
    **values: Any,
) -> ct.NonlinearIOSystem:
    """An effect of the catalogue as a block.

    A torque effect has the output d (N m), which is added to any other load torque of that name.
    An input effect has the input u and the output u. The output of a level effect is the
    relative change of the friction parameters that it acts on; a model builds it into
    :func:`lugrectl.plant`.

    Parameters
    ----------
    kind : str
        Name in the catalogue (``lugrectl effects``), or a common one: ``cogging``.
    name, inputs, outputs : str, list of str
        Block name (default: that of the effect) and, in order, other names for the signals.
    **values : float
        Its parameters; those left out have their neutral value.

    Returns
    -------
    control.NonlinearIOSystem
        Parameters keyed ``gravity.amplitude`` ...; their units are those of the catalogue.

    Raises
    ------
    InputError
        For an unknown effect or parameter, a value outside its bounds, or a periodic effect with
        an amplitude or ratio but without its harmonic or frequency.

    Examples
    --------
    An unbalanced arm, 0.4 N m when it is level:

    >>> arm = lg.effect("gravity", amplitude=0.4)
    >>> arm.input_labels, arm.output_labels
    (['theta'], ['d'])
    >>> np.round(arm.output(0.0, [], [np.pi / 2]), 3)
    array([0.4])
    """
    made = block_named("effect", kind)
    left = [k for k in _PERIOD if k in made.own and k not in values]
    # the default of a user's own may be that of the drive
    if is_ours(made.home) and left:
        if real(values.get(made.gain)) not in (None, made.own[made.gain].neutral):
            key, unit = left[0], made.own[left[0]].unit
            raise InputError(f"{made.name}: {key} is missing: give it in {unit}, {key}=NUMBER.")
    return made.system(name=name, inputs=inputs, outputs=outputs, **values)

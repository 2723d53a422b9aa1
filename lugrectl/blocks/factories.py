"""Factories: public functions that make a python-control block of a drive's values.

A factory is written as its own arguments, ``**names`` and a docstring without what is the same in
all of them, and without what its block says: the equation, the values that it takes from p, and
that these and its bounds are checked. :func:`factory` adds that. It needs a body only if it does
more than give the block its values::

    @factory(_natural)
    def natural_observer(p: Parameters | Model, **names: Unpack[Names]):
        '''The LuGre law itself ...'''
"""

from __future__ import annotations

import inspect
import textwrap
import warnings
from collections.abc import Callable, Mapping, Sequence
from functools import wraps
from typing import TYPE_CHECKING, Any, ParamSpec, TypedDict

from ..core.errors import InputError
from ..core.validation import real
from .aliases import block_named
from .block import Block, is_ours
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
RETURNED = "ct.NonlinearIOSystem"
_KINDS = {"Returns": "control.NonlinearIOSystem", "Raises": "InputError"}


def factory(
    made: Block | None = None,
) -> Callable[[Callable[Arguments, Any]], Callable[Arguments, ct.NonlinearIOSystem]]:
    """Complete a factory: the arguments of :class:`Names`, its docstring, and its body.

    One without a body builds ``made``, with its arguments as the block's parameters, and the rest
    of them from ``p`` if that is the first argument.
    """

    def complete(
        written: Callable[Arguments, Any],
    ) -> Callable[Arguments, ct.NonlinearIOSystem]:
        signature = _with_names(written)
        body: Callable[..., Any] = written

        @wraps(written)
        def build(*args: Arguments.args, **given: Arguments.kwargs) -> ct.NonlinearIOSystem:
            try:
                bound = signature.bind(*args, **given)
            except TypeError as error:
                raise TypeError(f"{written.__name__}() {error}") from None
            bound.apply_defaults()
            values = bound.arguments
            values.update(values.pop("gains", {}))
            if made is None:
                return body(**values)
            return believed(made, **values) if "p" in values else made.system(**values)

        build.__doc__, build.__dict__["__signature__"] = _completed(written, made), signature
        return build

    return complete


def _with_names(written: Callable[..., Any]) -> inspect.Signature:
    """The signature with the three names in place of ``**names``, or before ``**gains``."""
    signature = inspect.signature(written)
    *own, more = signature.parameters.values()
    named = {"name": ("str", written.__name__)}
    named |= {key: ("Sequence[str] | None", None) for key in ("inputs", "outputs")}
    own += [
        inspect.Parameter(key, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=kind)
        for key, (kind, default) in named.items()
    ]
    own += [] if more.name == "names" else [more]
    return signature.replace(parameters=own, return_annotation=RETURNED)


def _completed(written: Callable[..., Any], made: Block | None) -> str:
    """The docstring with what the block says, the names, and what is returned and raised."""
    parts = [part for part in (inspect.getdoc(written) or "").split("\n\n") if part]
    heads = [part.split("\n", 1)[0] for part in parts]
    at = heads.index("Returns")
    if heads[at - 1] != "Parameters":
        parts.insert(at, "Parameters\n----------")
        at += 1
    parts[at - 1] += f"\n{_NAMES}"
    of_drive = "p" in inspect.signature(written).parameters
    if made is not None:
        known = ", ".join(_from_drive(made))
        refused = [f"p has no value of {known}"] if of_drive else []
        refused += ["a value is out of its bounds"] if made.parameters else []
        refused += ["``inputs`` or ``outputs`` are not one name for each signal"]
        said = textwrap.fill(f"When {', or '.join(refused)}.", 92, break_on_hyphens=False)
        parts.insert(at + 1, f"Raises\n------\n{said}")
        if of_drive and "\np : " not in parts[at - 1]:
            first = known.split(",")[0]
            said = f"p : Parameters or Model\n    Gives {known}: ``{made.name}.{first}`` ..."
            parts[at - 1] = parts[at - 1].replace("----------", f"----------\n{said}", 1)
        if made.equation.rstrip(".,") not in parts[0]:
            parts.insert(1, made.doc)
    for i, part in enumerate(parts):
        head, *text = part.split("\n", 2)
        if head in _KINDS:
            said = textwrap.indent(text[1], "    ")
            parts[i] = f"{head}\n{text[0]}\n{_KINDS[head]}\n{said}"
    return "\n\n".join(parts)


def _from_drive(made: Block) -> list[str]:
    """The parameters of a block that the values of a drive give: J and those of LuGre."""
    return [k for k in ("J", *lugre.parameters) if k in made.parameters]


def believed(
    made: Block,
    p: Parameters | Model,
    *,
    name: str | None = None,
    inputs: Sequence[str] | None = None,
    outputs: Sequence[str] | None = None,
    **gains: Any,
) -> ct.NonlinearIOSystem:
    """An observer or controller with those of J and the LuGre parameters that it has, from p."""
    model = as_model(p, "p")
    have = model.values()
    needed = [k for k in _from_drive(made) if k not in gains]
    missing = [k for k in needed if have.get(k) is None]
    if missing:
        raise InputError(
            f"{made.name} needs {', '.join(missing)}, which {model.name} does not give; "
            "give it the parameters of a LuGre model."
        )
    values = {k: have[k] for k in needed} | gains
    _warn_of_sign(made, values)
    return made.system(name=name, inputs=inputs, outputs=outputs, **values)


def _warn_of_sign(made: Block, values: Mapping[str, Any]) -> None:
    """Near rest the proposed observer's poles have the product -K1 sigma0/J: K1 > 0 is a saddle."""
    K1 = values.get("K1") if made.name == "proposed_observer" else None
    at_rest = real(K1(0.0) if callable(K1) else K1)
    if at_rest is not None and at_rest > 0.0:
        warnings.warn(
            f"{made.name}: K1 = {at_rest:g} makes the estimate unstable near rest; K1 must be "
            "negative (-10.24 in the source paper).",
            RuntimeWarning,
            stacklevel=4,
        )


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

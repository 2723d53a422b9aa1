"""Friction laws and effects by name, as python-control blocks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from ..core.errors import InputError
from ..core.validation import real
from .aliases import block_named
from .block import Block, is_ours
from .law_forms import formed

if TYPE_CHECKING:
    import control as ct

_PERIOD = ("harmonic", "frequency")  # of a periodic effect: no drive has a usual one


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
    _has_its_period(made, values)
    return made.system(name=name, inputs=inputs, outputs=outputs, **values)


def _has_its_period(made: Block, values: Mapping[str, Any]) -> None:
    """InputError for an effect of the catalogue that has a size, and a period left to chance."""
    if not is_ours(made.home):  # the default of a user's own may be that of the drive
        return
    left = [k for k in _PERIOD if k in made.own and k not in values]
    if left and real(values.get(made.gain)) not in (None, made.own[made.gain].neutral):
        unit = made.own[left[0]].unit
        raise InputError(f"{made.name}: {left[0]} is missing: give it in {unit}, {left[0]}=NUMBER.")

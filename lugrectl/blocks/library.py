"""Friction laws and effects by name, as python-control blocks."""

from __future__ import annotations

import difflib
from collections.abc import Sequence
from typing import Any

import control as ct

from ..checks import shown
from ..errors import InputError
from ..spec import Block, members


def _chosen(kind: str, name: str) -> Block:
    known = members(kind)
    if not isinstance(name, str) or name not in known:
        near = difflib.get_close_matches(str(name), known, n=1)
        meant = f" Did you mean '{near[0]}'?" if near else ""
        raise InputError(f"no {kind} named {shown(name)}; known: {', '.join(known)}.{meant}")
    return known[name]


def friction(
    law: str,
    *,
    name: str | None = None,
    inputs: Sequence[str] | None = None,
    outputs: Sequence[str] | None = None,
    **values: float,
) -> ct.NonlinearIOSystem:
    """A friction law as a block: input w (rad/s), output F (N m), which opposes positive w.

    Parameters
    ----------
    law : str
        "viscous", "coulomb", "stribeck" or "lugre".
    values
        Parameters of the law (Fc, Fs, Fv, vs, sigma0, sigma1); Table 1 where left out.

    Raises
    ------
    InputError
        For an unknown law or parameter, or a value outside its bounds.
    """
    return _chosen("friction", law).system(name=name, inputs=inputs, outputs=outputs, **values)


def effect(
    kind: str,
    *,
    name: str | None = None,
    inputs: Sequence[str] | None = None,
    outputs: Sequence[str] | None = None,
    **values: Any,
) -> ct.NonlinearIOSystem:
    """An effect of the catalogue as a block.

    A torque effect has the output d (N m), which adds to any other load torque of that name; an
    input effect turns u into u; a level effect puts out the relative change of the friction
    parameters that it acts on, and is built into :func:`lugrectl.plant` by a model.

    Parameters
    ----------
    kind : str
        Name in the catalogue (``lugrectl effects``).
    values
        Its parameters; neutral where left out.

    Raises
    ------
    InputError
        For an unknown effect or parameter, or a value outside its bounds.
    """
    return _chosen("effect", kind).system(name=name, inputs=inputs, outputs=outputs, **values)

"""The fall of friction at low speed (Stribeck), which only slow runs show.

Beside ``Fc sign(w) + Fv w`` a law has ``(Fs - Fc) exp(-(w/vs)^2) sign(w)``. Where no run is slow
enough this may be nothing, or anything: Fs and vs are then as declared, or left open.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..blocks.block import unit_for
from ..blocks.model import Model
from .curve import Curve
from .fit import fit
from .select import CHANCE, by_chance

FALL = ("Fs", "vs")
NOWHERE = 1e-6  # of the slowest speed: a fall below it is none in the map
SLOWER = (
    "To see how friction falls at low speed (Fs and vs, which these runs leave open): record "
    "several runs slower than {:.3g} {}, in both directions."
)


def may_fall(curve: Curve, declared: Model) -> bool:
    """Whether the fit has a fall at low speed of which nothing is stated."""
    free = {c.key for c in curve.coords} & {*FALL}
    return bool(free) and not {*declared.statements()} & {*FALL}


def as_shown(curve: Curve, declared: Model, flat: Curve | None = None) -> Curve:
    """The same fit, without its fall at low speed where the map does not show it (F test).

    What is not shown may be there: the intervals hold that, too. ``flat``: the fit without it,
    where that is known.
    """
    if not may_fall(curve, declared):
        return curve
    flat = flat or without_fall(curve, declared)
    if by_chance(flat, curve) < CHANCE:
        return curve
    return replace(flat, rivals=(*flat.rivals, curve, *curve.rivals))


def without_fall(curve: Curve, declared: Model) -> Curve:
    """The law with Fs and vs as declared; without any fall where one of them is not."""
    known = declared.known()
    held = {k: known[k] for k in FALL if k in known}
    if len(held) < len(FALL):
        held = {"vs": NOWHERE * float(np.min(np.abs(curve.at.w)))}
        held["Fs"] = float(np.max(np.abs(curve.at.u)))  # out of the way of Fc, which it bounds
    values, anchor = curve.values | held, curve.anchor | held
    return fit(curve.model, curve.at, [values], anchor, curve.opened, FALL)


def slower(curve: Curve, declared: Model) -> str | None:
    """What to record where the map leaves Fs and vs open; None where it does not."""
    if "vs" not in curve.apart or {*FALL} <= declared.known().keys():
        return None
    slowest = float(np.min(np.abs(curve.at.w)))
    return SLOWER.format(slowest, unit_for("rad/s", declared.motion))

"""Torque and motion in each other's place: the balance fits them the other way round."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from ..blocks.model import Model
from ..core.option_names import option
from ..identification.balance import Balance, balance
from ..record import Stretch

EXPLAINED = 0.1  # of the torque is left by a balance that explains it
SAYS = (
    "u and {0} seem to be swapped: the other way round the balance leaves {1:.2g} % of the RMS "
    "torque with a possible inertia, as they are it {2}. Give {3}."
)


def swapped(
    parts: Sequence[Stretch], model: Model, fixed: Mapping[str, float], found: Balance
) -> str:
    """A sentence where only the exchange of u with theta or w makes a drive of the log, else "".

    It must explain more of its torque than the log does as it is, and than with the other sign of
    u: a torque of the wrong sign makes an impossible drive as well. A log that one level of torque
    explains as it is shows no inertia, and need not be swapped for that.
    """
    if "J" in found.parameters or found.is_map or not parts:
        return ""
    if found.left is not None and found.left < EXPLAINED:
        return ""
    rivals = [found, balance([replace(p, u=-p.u) for p in parts], model, fixed)]
    most = min(b.left for b in rivals if b.left is not None) if _known(rivals) else None
    for role in ("theta", "w") if parts[0].theta is None else ("theta",):
        if any(getattr(p, role) is None for p in parts):
            continue  # a w beside theta is left out where it is no dtheta/dt: that shows nothing
        turned = [replace(p, **{"u": getattr(p, role), role: p.u}) for p in parts]
        made = balance(turned, model, fixed)
        if made.refused or "J" not in made.parameters or made.left is None:
            continue
        if most is None or made.left < most:
            how = "finds none" if found.left is None or found.refused else "leaves more"
            given = option("columns", f"u=NAME,{role}=NAME")
            return SAYS.format(role, 100.0 * made.left, how, given)
    return ""


def _known(rivals: Sequence[Balance]) -> bool:
    return any(b.left is not None for b in rivals)

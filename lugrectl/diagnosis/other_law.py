"""Whether the declared friction law can be that of the drive.

The plain balance has ``F = Fc sign(w) + Fv w``. A law of the package means the same by ``Fc`` and
``Fv``; one of a user's own may mean anything by these names.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from ..blocks.block import Block, is_ours, members, unit_for
from ..blocks.model import Model
from ..core.option_names import option
from ..identification.balance import Balance
from ..identification.balance.result import LEVELS
from ..identification.selection.comparison import Comparison

FRICTION = frozenset(LEVELS[1:])
NONE = dict.fromkeys(FRICTION, 0.0)
SPEEDS = (-100.0, -10.0, -1.0, 1.0, 10.0, 100.0)  # rad/s
SAME = 0.01  # relative difference of two torques
COMPARE = "Declare another law, or compare them ({})."
LACKS = (
    "The declared law '{}' has no {} friction, and the log shows {:.3g} {} of it, {:.2g} % of the "
    "friction torque. "
)
TERMS = {"Fc": ("Coulomb", "N m"), "Fv": ("viscous", "N m s/rad")}
OWN = "The declared law '{}' does not fit this log: the simulation with it misses the motion. "


def means_the_same(model: Model) -> bool:
    """Whether Fc and Fv of the law are those of the plain balance.

    An own law is asked: with Fc alone and with Fv alone it must be the law "coulomb".
    """
    law = model.friction.block
    if is_ours(law.home):
        return True
    if law.states or law.inputs != ("w",):
        return False
    own, usual = law.defaults(), members("friction")["coulomb"]
    zero = dict.fromkeys(FRICTION & own.keys(), 0.0)
    return all(_alike(law, own | zero | {k: 1.0}, usual, NONE | {k: 1.0}) for k in zero)


def _alike(
    law: Block, values: Mapping[str, float], usual: Block, theirs: Mapping[str, float]
) -> bool:
    try:
        made = [float(law(w, **values)[0]) for w in SPEEDS]
    except Exception:  # whatever a function of the user raises
        return False
    return bool(np.allclose(made, [usual(w, **theirs)[0] for w in SPEEDS], rtol=SAME))


def of_its_law(model: Model, key: str) -> bool:
    """Whether a value of the plain balance is one of this model."""
    return key in model.declarations() and (key not in FRICTION or means_the_same(model))


def judged_with_law(found: Comparison, model: Model, plain: Balance, *, failed: bool) -> Comparison:
    """The comparison, which leaves the shape of friction open, where the declared law is another.

    A log that misses nothing but its law is ``unexplained``: friction depends on w in another way.
    """
    said = _said(found, model, plain, failed=failed)
    if said is None:
        return found
    found = replace(found, messages=(said, *found.messages))
    if found.verdict != "adequate":
        return found
    return replace(found, verdict="unexplained", depends_on=("w",))


def _said(found: Comparison, model: Model, plain: Balance, *, failed: bool) -> str | None:
    name = model.friction.block.name
    if not means_the_same(model):
        gone = failed and found.verdict == "adequate"
        return OWN.format(name) + COMPARE.format(option("law", "auto")) if gone else None
    return lacking(found, model, plain)


def lacking(found: Comparison, model: Model, plain: Balance) -> str | None:
    """What friction the declared law has not, and the log shows."""
    for key, (kind, unit) in TERMS.items():
        level = plain.parameters.get(key)
        if key in model.friction.block.own or level is None or level.ci95 is None:
            continue
        share = next((s.share for s in found.budget if s.term == kind.lower()), 0.0)
        if level.ci95[0] > 0.0 and share > found.least:
            shown = level.value, unit_for(unit, model.motion), 100.0 * share
            said = LACKS.format(model.friction.block.name, kind, *shown)
            return said + COMPARE.format(option("law", "auto"))
    return None

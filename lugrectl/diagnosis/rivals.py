"""The models that explain a record as well as the one that is shown, with what is known of each."""

from __future__ import annotations

import numpy as np

from ..estimates.covariance import Joint
from ..estimates.findings import Estimate
from ..estimates.members import Belief
from ..identification.selection import Comparison, Named, place_of
from .winning_model import Winner, with_effects


def rivals(won: Winner, found: Comparison) -> tuple[Belief, ...]:
    """A belief for each rival of the best effect, by its weight among those that are left.

    Its values are those of the comparison; of what that does not determine, presliding for one, the
    values of the model that is shown, independent of the others.
    """
    if not (found.alternatives and won.keys):
        return ()
    best = found.effects[place_of(found.effects)]
    whole = best.weight + sum(one.weight for one in found.alternatives)
    rest = [one for one in found.alternatives if one.valued is not None]
    return tuple(_belief(won, found, one, one.weight / whole) for one in rest)


def _belief(won: Winner, found: Comparison, rival: Named, weight: float) -> Belief:
    place, effects = place_of(found.effects), list(found.effects)
    effects[place] = rival
    base = won.job.base.predictor.model
    model, keys, _ = with_effects(base, effects)
    assert rival.valued is not None
    new = {e.name: key for e, key in zip(effects, keys, strict=True)}
    known = rival.valued.by({p.block.name: p.key for p in base.effects} | new)
    own = {k: v for k, v in won.whole.values.items() if k in model.values()}
    model = model.with_values(own | {k: v for k, v in known.values.items() if k in model.values()})
    sure = [k for k in known.values if k in known.sure and k in model.known()]
    at = [list(known.values).index(k) for k in sure]
    values = np.array([model.known()[k] for k in sure])
    C = known.matrix[np.ix_(at, at)]
    joint = Joint(tuple(sure), values, C, np.zeros(len(sure), bool))
    halves = dict(zip(sure, 1.96 * np.sqrt(np.diag(C)), strict=True))
    estimates = {k: e for k, e in won.estimates.items() if k in model.known()} | {
        k: Estimate(v, model.unit(k), (v - halves[k], v + halves[k]))
        for k, v in zip(sure, values.tolist(), strict=True)
    }
    return Belief.of(model, joint, estimates, weight)

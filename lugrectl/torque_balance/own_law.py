"""Friction laws whose values the balance does not know by name: own ones, and more than Fc, Fv."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.optimize import least_squares
from scipy.sparse import csr_matrix

from ..blocks.block import Block, is_ours, members
from ..blocks.model import Model
from .columns import torque
from .last_fit import LastFit

LEVELS = frozenset(("Fc", "Fv"))
SLIDING, BRISTLE = {"Fc", "Fs", "Fv", "vs"}, {"sigma0", "sigma1"}
SPEEDS = (-100.0, -10.0, -1.0, 1.0, 10.0, 100.0)  # rad/s
SAME = 0.01  # relative difference of two torques
MOST, FURTHEST = 60, 7.0  # evaluations; natural logarithm of a factor on a value
ENOUGH = 1500  # rows
DIPPED = 1.3  # of Fc: where Fs starts


def means_the_same(law: Block) -> bool:
    """Whether Fc and Fv of the law are those of the balance.

    An own law is asked: with Fc alone and with Fv alone it must be the law "coulomb".
    """
    if is_ours(law.home):
        return True
    if law.states or law.inputs != ("w",):
        return False
    own, usual = law.defaults(), members("friction")["coulomb"]
    zero = dict.fromkeys(LEVELS & own.keys(), 0.0)
    none = dict.fromkeys(LEVELS, 0.0)
    return all(_alike(law, own | zero | {k: 1.0}, usual, none | {k: 1.0}) for k in zero)


def _alike(
    law: Block, values: Mapping[str, float], usual: Block, theirs: Mapping[str, float]
) -> bool:
    try:
        made = [float(law(w, **values)[0]) for w in SPEEDS]
    except Exception:  # whatever a function of the user raises
        return False
    return bool(np.allclose(made, [usual(w, **theirs)[0] for w in SPEEDS], rtol=SAME))


def told_by_balance(model: Model) -> bool:
    """Whether a balance says what the law's values are, or where they cannot be far from."""
    law = model.friction.block
    own = {k for k, p in law.own.items() if p.fitted and not p.usual}
    known = own <= SLIDING or BRISTLE <= own <= SLIDING | BRISTLE
    return known and means_the_same(law)


def misfit(last: LastFit, model: Model) -> float:
    """How far the law at the values of a model is from the friction of a last fit: RMS in rows, as
    a share of friction."""
    made = torque(model.friction.block, model.friction.values, last.view.along()).wide
    if made is None:
        return 0.0
    off = last.view.K @ made[:, 0] - last.friction
    return float(np.sqrt(np.mean(np.nan_to_num(off, nan=1e6) ** 2))) / last.view.size


def law_values(last: LastFit, model: Model) -> dict[str, float]:
    """The values of an own law with which it comes nearest to the friction of a last fit, in rows.

    ``model`` has a value for everything; declared ones are where this starts, held ones stay.
    """
    law, known = model.friction.block, model.known()
    keys = [k for k, p in law.own.items() if p.fitted and not (p.choices or k in model.held())]
    return _nearest(last, law, {k: known[k] for k in law.own}, keys) if keys else {}


def static_values(last: LastFit, Fc: float, Fv: float) -> tuple[float, float]:
    """Fs and vs with which the Stribeck curve comes nearest to the friction of a last fit."""
    law = members("friction")["stribeck"]
    known = law.defaults() | {"Fc": Fc, "Fv": Fv, "vs": last.state.vs}
    found = _nearest(last, law, known | {"Fs": DIPPED * Fc}, ("Fs", "vs"))
    return max(found["Fs"], Fc), found["vs"]


def _nearest(
    last: LastFit, law: Block, known: Mapping[str, float], keys: Sequence[str]
) -> dict[str, float]:
    """The values of a law; ``keys`` are free, and start at the known ones."""
    v, own, target = last.view, law.own, last.friction + last.left
    rows = np.arange(0, len(target), max(1, len(target) // ENOUGH))
    K, alone = csr_matrix(v.K[rows]), not law.states and law.inputs == ("w",)
    if alone:  # samples at which no row looks do not matter
        used, places = np.unique(K.indices, return_inverse=True)
        K, w = csr_matrix((K.data, places, K.indptr)), v.motion.w[used]
    else:
        along = v.along()
    start = np.array([known[k] or own[k].value or 1e-3 for k in keys])
    ends = np.array([(own[k].low, own[k].high) for k in keys]).T

    def values(x: np.ndarray) -> dict[str, float]:
        found = np.clip(start * np.exp(x), *ends).tolist()
        return {**known, **dict(zip(keys, found, strict=True))}

    def off(x: np.ndarray) -> np.ndarray:
        if alone:
            made = law(w, **values(x))[0]
        else:
            wide = torque(law, values(x), along).wide
            assert wide is not None  # a law of friction acts along the log
            made = wide[:, 0]
        return np.nan_to_num((K @ made - target[rows]) / last.scale, nan=1e6)

    bounds = (-FURTHEST, FURTHEST)
    made = least_squares(off, np.zeros(len(keys)), bounds=bounds, loss="soft_l1",
                         diff_step=1e-3, max_nfev=MOST)  # fmt: skip
    return values(made.x)

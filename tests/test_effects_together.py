"""Two effects together: inside the plant, along a log, or one here and one there."""

from itertools import permutations

import numpy as np
import pytest

from lugrectl.blocks.plant import assemble
from lugrectl.tracing.data import prepare
from lugrectl.tracing.predictor import Predictor
from tests.rig import make

from .cases import record_of
from .drives import EFFECTS, model_of, own, strong

STATELESS = [m for m in EFFECTS.values() if not m.states and m.exact is None]
PLANT = [m for m in STATELESS if "sensor" not in m.acts]
PAIRS = list(permutations(PLANT, 2))


@pytest.fixture(scope="module")
def data():
    case = make("none", machine="wrist", excitation="rich", seed=5, rate=500.0, duration=5.0)
    return prepare([record_of(case)])


def law_of(*made):
    return "coulomb" if any(m.name == "stribeck" for m in made) else "stribeck"


def acceleration(model, data, inside):
    """dw/dt along the log with the first ``inside`` effects in the plant, the others fed in."""
    predictor, values = Predictor(model, data, inside), model.known()
    fed, names = predictor.fed(values), ("torque", *predictor.levels)
    block = assemble(predictor.core, levels=names, sensed=True)
    given = data.log.signals | {"u": fed.u, "d": fed.load, "x_torque": fed.torque}
    given |= {f"x_{n}": fed.levels[n] for n in predictor.levels}
    args = [given[n] for n in (*block.inputs, *block.states)]
    args = [given["t"], *args] if block.timed else args
    return block(*args, **{k: v for k, v in values.items() if k in block.parameters})[-1]


@pytest.mark.parametrize("pair", PAIRS, ids=lambda p: "-".join(m.name for m in p))
def test_it_does_not_matter_which_of_them_are_inside(pair, data):
    model = model_of(law_of(*pair))
    for made in pair:
        model = model.with_effect(made.name, own(made, strong(made)))
    whole = acceleration(model, data, 2)
    for inside in (0, 1):
        part = acceleration(model, data, inside)
        np.testing.assert_allclose(part, whole, rtol=1e-9, atol=1e-9)

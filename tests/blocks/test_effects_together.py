"""Two effects together: inside the plant, or fed in along a log."""

from dataclasses import replace
from itertools import permutations

import numpy as np
import pytest

from lugrectl.blocks.plant import assemble, stage
from lugrectl.identification.dataset.dataset import prepare
from lugrectl.identification.likelihood.effect_inputs import feed
from lugrectl.identification.likelihood.predictor import Predictor
from tests.rig import make

from ..cases.common import record_of
from ..cases.drives import EFFECTS, model_of, own, strong

STATELESS = [m for m in EFFECTS.values() if not m.states and m.exact is None]
PLANT = [m for m in STATELESS if "sensor" not in m.acts]
PAIRS = list(permutations(PLANT, 2))


@pytest.fixture(scope="module")
def data():
    case = make("none", machine="wrist", excitation="rich", seed=5, rate=500.0, duration=5.0)
    return prepare([record_of(case)])


def law_of(*made):
    return "coulomb" if any(m.name == "stribeck" for m in made) else "stribeck"


def acceleration(model, data, keys):
    """dw/dt along the log with the effects ``keys`` fed in, the others in the plant."""
    inside = tuple(part for part in model.effects if part.key not in keys)
    predictor, values = Predictor(replace(model, effects=inside), data), model.known()
    fed = feed(model, keys, values, data, predictor.levels)
    block = assemble(predictor.core, levels=("torque", *predictor.levels), sensed=True)
    given = data.log.signals | {"u": fed.u, "d": fed.load, "x_torque": fed.torque}
    given |= {f"x_{n}": fed.levels[n] for n in predictor.levels}
    args = [given[n] for n in (*block.inputs, *block.states)]
    args = [given["t"], *args] if block.timed else args
    return block(*args, **{k: v for k, v in values.items() if k in block.parameters})[-1]


def on_command(model):
    """The keys of effects on the command alone, which are always fed in."""
    return {part.key for part in model.effects if stage(part.block) == "command"}


@pytest.mark.parametrize("pair", PAIRS, ids=lambda p: "-".join(m.name for m in p))
def test_effects_fed_in_along_a_log_act_as_in_the_plant(pair, data):
    model = model_of(law_of(*pair))
    for made in pair:
        model = model.with_effect(made.name, own(made, strong(made)))
    whole = acceleration(model, data, on_command(model))
    part = acceleration(model, data, {part.key for part in model.effects})
    np.testing.assert_allclose(part, whole, rtol=1e-9, atol=1e-9)

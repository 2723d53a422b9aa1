"""A copy of a block, or a block under a new name, is a block of its own."""

from __future__ import annotations

import copy
import pickle

import numpy as np
import pytest

import lugrectl as lg

from ..cases.own import moving

T = np.linspace(0.0, 0.2, 21)
OWN = ["theta2", "w2", "F2"]


def twin(block=None):
    made = (block or lg.plant(lg.table1())).copy(name="twin")
    made.set_outputs(OWN)
    return made


def speeds(blocks, **options):
    found = lg.simulate(blocks, T, {"u": 0.5}, **options)
    labels = list(found.output_labels)
    return [found.outputs[labels.index(k)][-1] for k in ("w", "w2")]


def test_a_copy_has_parameters_of_its_own():
    blocks = [lg.plant(lg.table1()), twin()]
    plain, same = speeds(blocks)
    assert plain == same
    free, kept = speeds(blocks, params={"plant.Fc": 0.1})
    assert kept == pytest.approx(plain, rel=1e-6) and free > plain + 1.0
    kept, free = speeds(blocks, params={"twin.Fc": 0.1})
    assert kept == pytest.approx(plain, rel=1e-6) and free > plain + 1.0


@pytest.mark.parametrize(
    "carry", [lambda b: b, copy.deepcopy, lambda b: pickle.loads(pickle.dumps(b))]
)
def test_a_new_name_changes_the_keys_alone(carry):
    block = carry(lg.plant(lg.table1()))
    before = dict(block.params)
    block.name = "axis"
    assert list(block.params.values()) == list(before.values())
    assert list(block.params) == [k.replace("plant", "axis") for k in before]
    other = lg.plant(lg.table1(), name="axis")
    x, u = [0.1, 0.2, 1e-4], [0.3, 0.0]
    np.testing.assert_array_equal(block.dynamics(0, x, u), other.dynamics(0, x, u))
    np.testing.assert_array_equal(block.output(0, x, u), other.output(0, x, u))


def test_a_copy_of_a_sampled_block_has_its_own_gains():
    block = lg.sampled(lg.pi(1.0, 2.0), 1e-3)
    other = block.copy(name="second")
    assert set(other.params) == {"second.kp", "second.ki"}
    e = np.ones(5)
    t = 1e-3 * np.arange(5)
    weak = lg.simulate(other, t, e, params={"second.kp": 0.5}).outputs[0]
    assert weak == -0.5
    assert lg.simulate(block, t, e).outputs[0] == -1.0
    with pytest.raises(lg.InputError, match=r"parameter 'pi\.kp'"):
        lg.simulate([other], t, {"e": e}, params={"pi.kp": 0.5})


@pytest.mark.parametrize("value", [np.inf, -np.inf, np.nan])
def test_a_parameter_of_one_s_own_block_is_finite(value):
    own = moving(lambda t, x, u, p: -p["rate"] * x + u, "y", "own", rate=1.0)
    with pytest.raises(lg.InputError, match="rate"):
        lg.simulate(own, T, 1.0, params={"rate": value})

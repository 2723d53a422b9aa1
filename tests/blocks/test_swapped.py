"""A model behind what belongs behind it: one sentence, in every function that takes both."""

import re

import numpy as np
import pytest

import lugrectl as lg

P = lg.table1()
LOG = {"t": 1e-3 * np.arange(50), "u": np.ones(50), "w": np.ones(50)}
MODELS = {"parameters": P, "model": lg.Model.of(P), "dict": {"J": 0.002}, "file": "my.toml"}
CALLS = {
    "l2_check": (lg.l2_check, 22.0, "22.0", "K2"),
    "compare_observers": (lg.compare_observers, ["natural"], "['natural']", "observers"),
    "compare_one": (lg.compare_observers, "natural", "'natural'", "observers"),
    "recommend_observer": (lg.recommend_observer, LOG, "a log", "record"),
    "recommend_from_file": (lg.recommend_observer, "run.csv", "'run.csv'", "record"),
    "velocity_loop": (lg.velocity_loop, "proposed", "'proposed'", "observer"),
    "position_loop": (lg.position_loop, "proposed", "'proposed'", "observer"),
    "cascade_loop": (lg.cascade_loop, "disturbance", "'disturbance'", "observer"),
    "design_gains": (lg.design_gains, "constant", "'constant'", "method"),
}


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("call", CALLS)
def test_a_model_behind_what_belongs_behind_it_is_one_sentence(call, model):
    work, first, said, what = CALLS[call]
    sentence = re.escape(f"p is {said} and {what} is a model: swap them.")
    with pytest.raises(lg.InputError, match=f"^{sentence}$"):
        work(first, MODELS[model])


def test_what_is_known_of_a_drive_is_no_model_beside_one():
    with pytest.raises(lg.InputError, match=re.escape("{'rate': 1000} and record is a model")):
        lg.recommend_observer({"rate": 1000}, P)


@pytest.mark.parametrize("other", [P, {"J": 0.002}])
def test_two_models_are_not_swapped(other):
    with pytest.raises(lg.InputError) as no:
        lg.compare_observers(P, other)
    assert "swap" not in str(no.value)


def test_a_log_alone_is_no_model():
    with pytest.raises(lg.InputError, match="not a dict of samples: that is a log"):
        lg.plant(LOG)
    with pytest.raises(lg.InputError, match=re.escape("22.0 has no J: give Parameters")):
        lg.l2_check(22.0, 22.0)

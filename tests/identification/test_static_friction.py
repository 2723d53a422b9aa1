"""Drives declared with static friction: slow axes, bristles that show and bristles that do not."""

from dataclasses import replace

import pytest

from lugrectl import diagnose
from lugrectl.blocks.friction import EPS
from lugrectl.blocks.model import model_from_dict
from lugrectl.identification.dataset.dataset import prepare
from lugrectl.identification.likelihood.initial_values import holding

from ..blind.plan import Task
from ..blind.work import case_of
from ..cases.common import model_of, record_of


def case(name: str, seed: int):
    made = case_of(Task("effect", (name,), "weak", seed))
    return made, prepare([record_of(made)]), model_of(made)


def eps_of(model) -> float:
    return model.friction.values["eps"]


def test_the_creep_of_static_friction_goes_by_the_speed_of_the_drive():
    _, data, model = case("stribeck", 99010)  # 0.05 m/s at most
    assert eps_of(model) == EPS.value
    assert eps_of(holding(model, data)) == pytest.approx(1e-5 * data.log.fastest)
    assert eps_of(holding(model, data)) < 1e-6


def test_a_creep_of_the_users_own_and_one_that_is_small_stay():
    _, data, model = case("stribeck", 99010)
    own = model.with_values({"eps": 3e-5})
    assert holding(own, data) is own
    log = replace(data.log, w=data.log.w * 1e4)
    assert holding(model, replace(data, log=log)) is model
    parts = {"model": "lugre", "sigma0": 260.0, "sigma1": 0.6, "Fc": 1.0, "Fs": 1.2, "Fv": 0.1}
    lugre = model_from_dict({"plant": {"J": 1.0}, "friction": parts | {"vs": 0.01}}, "test")
    assert holding(lugre, data) is lugre


@pytest.mark.slow
def test_only_the_stribeck_effect_is_missing_from_a_slow_axis_that_rests():
    """With a creep of 0.1 mm/s the fit needed 34 times the true stiction to hold the axis."""
    made, _, model = case("stribeck", 99010)
    found = diagnose(record_of(made), model)
    assert found.verdict == "found"
    assert [e.name for e in found.effects] == ["stribeck"]
    assert found.effects[0].parameters["Fs"].value == pytest.approx(
        made.truth["parameters"]["Fs"], rel=0.01
    )
    assert found.error["augmented"] < 0.1 * found.error["refitted"]
    assert eps_of(found.model) < 1e-6

"""Drives declared with static friction: slow axes, bristles that show and bristles that do not."""

from dataclasses import replace

import numpy as np
import pytest

from lugrectl import diagnose
from lugrectl.blocks.friction import EPS
from lugrectl.model import model_from_dict
from lugrectl.tracing.data import prepare
from lugrectl.tracing.fit import fit
from lugrectl.tracing.predictor import Predictor
from lugrectl.tracing.proof import proven
from lugrectl.tracing.split import split
from lugrectl.tracing.start import holding

from .blind.plan import Task
from .blind.work import case_of
from .test_tracing import model_of, record_of


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
def test_a_slow_axis_that_rests_lacks_the_stribeck_effect_and_nothing_else():
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


def fitted_with_bristles(name: str, seed: int):
    """The declared structure with true friction, and with bristles beside it, both refitted."""
    made, data, model = case(name, seed)
    where = split(data, 1.0).train
    truth = made.truth["plant"]
    level = {"Fs": truth["Fs"], "vs": truth["vs"]}
    friction = {"model": "stribeck", "Fc": truth["Fc"], "Fv": truth["Fv"], **level}
    given = {"plant": {"J": truth["J"]}, "friction": friction, "motion": model.motion}
    static = holding(model_from_dict(given, "static"), data)
    soft = static.with_effect("presliding", {k: truth[k] for k in ("sigma0", "sigma1")})
    free = ["J", "Fc", "Fs"]
    plain, rubs = (Predictor(m, data) for m in (static, soft))
    before = fit(plain, static.known(), free, where, data.noise)
    own = [f"presliding.{k}" for k in ("sigma0", "sigma1")]
    return before, fit(rubs, soft.known(), [*free, *own], where, data.noise, anchor=before.values)


@pytest.mark.parametrize(("name", "seed", "shown"), [("presliding", 99013, True),
                                                     ("stribeck", 99019, False)])  # fmt: skip
def test_bristles_are_proven_where_their_stiffness_shows(name, seed, shown):
    before, after = fitted_with_bristles(name, seed)
    gain = after.loglik.sum() - before.loglik.sum()
    assert gain > 100.0  # either way they help through reversals
    assert np.isfinite(after.values["presliding.sigma0"])
    assert proven(before, before, after, "presliding") is shown

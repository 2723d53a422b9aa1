"""What is said of fitted values that are far from the declared ones."""

from types import SimpleNamespace

import pytest

from lugrectl import Model
from lugrectl.model import model_from_dict
from lugrectl.tracing.far import far_off

DECLARED = {"J": 0.1, "Fc": 1.0, "Fs": 1.5, "Fv": 0.2}


def model() -> Model:
    friction = {"model": "lugre", "sigma0": 100.0, "sigma1": 1.0, "vs": 0.01}
    friction |= {k: v for k, v in DECLARED.items() if k != "J"}
    plant = {"J": DECLARED["J"]}
    return model_from_dict({"motion": "rotary", "plant": plant, "friction": friction}, "m")


def said(half: float = 0.01, **factors: float) -> str:
    """What is said where these values came out by a factor, each within ``half`` of itself."""
    values = model().values() | {k: DECLARED[k] * r for k, r in factors.items()}
    ends = {k: (v * (1 - half), v * (1 + half)) for k, v in values.items()}
    return " ".join(far_off(SimpleNamespace(values=values, intervals=lambda: ends), model()))


@pytest.mark.parametrize("factor, way", [(1.5, "50 % above"), (0.7, "30 % below")])
def test_a_value_far_off_is_said_with_its_unit(factor, way):
    assert f"J is {way} the declared 0.1 kg m2" in said(J=factor)


def test_what_the_record_does_not_tell_or_is_near_is_not_said():
    assert said(Fc=1.15, J=0.9) == ""
    assert said(half=0.4, Fc=1.3) == ""


def test_a_higher_level_may_be_a_dead_zone():
    assert "dead zone" in said(Fc=1.3, Fs=1.2)
    assert "dead zone" not in said(Fc=0.7)


def test_a_common_factor_is_the_torques_scale():
    told = said(J=1.4, Fc=1.41, Fv=1.39, Fs=1.4)
    assert "factor 1.4" in told and "scale of u is wrong" in told and "dead zone" not in told
    assert "scale of u is wrong" not in said(J=1.4, Fc=1.41, Fv=0.7)

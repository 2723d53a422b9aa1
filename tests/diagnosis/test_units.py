"""The answer does not depend on the units, nor on which way is called forward."""

from dataclasses import replace

import numpy as np
import pytest

from lugrectl import diagnose
from tests.drives import make

from ..cases.common import model_of, record_of

POWERS = {  # of torque and of length
    "J": (1, -1), "Fc": (1, 0), "Fs": (1, 0), "Fv": (1, -1), "vs": (0, 1), "sigma0": (1, -1),
    "sigma1": (1, -1), "u": (1, 0), "theta": (0, 1), "w": (0, 1), "amplitude": (1, 0),
    "harmonic": (0, -1), "phase": (0, 0),
}  # fmt: skip


def in_units(case, torque, length):
    def changed(values):
        return {k: v * factor(k) for k, v in values.items()}

    def factor(name):
        a, b = POWERS[name]
        return abs(torque) ** a * abs(length) ** b

    sign = np.sign(length)
    columns = {k: v if k == "t" else v * factor(k) * sign for k, v in case.columns.items()}
    law = case.model["friction"]["model"]
    levels = changed({k: v for k, v in case.model["friction"].items() if k != "model"})
    model = {"plant": changed(case.model["plant"]), "friction": {"model": law, **levels}}
    truth = {"parameters": changed(case.truth["parameters"])}
    return replace(case, columns=columns, model=case.model | model, truth=case.truth | truth)


@pytest.fixture(scope="module")
def bumpy():
    return make("torque_ripple", machine="axis", excitation="rich", seed=2, rate=500.0,
                duration=20.0)  # fmt: skip


@pytest.mark.parametrize(
    "torque, length",
    [
        (1e-5, 1.0),
        (1e5, 1e3),
        pytest.param(1.0, 1e-3, marks=pytest.mark.sample),
        pytest.param(1.0, -1.0, marks=pytest.mark.sample),
    ],
)
@pytest.mark.slow
def test_a_ripple_is_found_in_any_units(bumpy, torque, length):
    case = in_units(bumpy, torque, length)
    result = diagnose(record_of(case), model_of(case))
    assert [e.name for e in result.effects] == ["torque_ripple"]
    for name, true in case.truth["parameters"].items():
        if name != "phase":
            assert result.effects[0].parameters[name].value == pytest.approx(true, rel=0.02)


@pytest.mark.slow
@pytest.mark.sample
def test_periods_of_a_micrometre_are_found(bumpy):
    """On a travel of a hundred of them."""
    case = in_units(bumpy, 1.0, 1e-4 / np.ptp(bumpy.columns["theta"]))
    found = diagnose(record_of(case), model_of(case))
    (ripple,) = found.effects
    assert ripple.name == "torque_ripple"
    harmonic = case.truth["parameters"]["harmonic"]
    assert ripple.parameters["harmonic"].value == pytest.approx(harmonic, rel=0.02)

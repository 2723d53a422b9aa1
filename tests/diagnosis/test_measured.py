"""Measured records and the bench of simulated ones, where they are at hand."""

import json
import os
from pathlib import Path

import pytest

from lugrectl import diagnose, read_model, read_record

DATA = Path(os.environ.get("LUGRECTL_DATA", Path(__file__).parents[3] / "shared" / "data"))
pytestmark = pytest.mark.skipif(
    not DATA.exists(), reason=f"the measured records are not at {DATA} (set LUGRECTL_DATA)"
)
EXPECTED = {
    "01": ("adequate", []),
    "02": ("found", ["torque_ripple"]),
    "03": ("found", ["input_delay"]),
    "04": ("found", ["friction_step"]),
}


def bench(number):
    folder = DATA / "bench" / number
    truth = json.loads((folder / "truth.json").read_text())
    return diagnose(read_record(folder / "record.csv"), read_model(folder / "model.toml")), truth


@pytest.mark.parametrize("number", EXPECTED)
@pytest.mark.slow
@pytest.mark.sample
def test_bench(number):
    result, truth = bench(number)
    assert (result.verdict, [f.name for f in result.effects]) == EXPECTED[number]
    for name, value in truth["parameters"].items():
        found = result.effects[0].parameters[name]
        assert found.value == pytest.approx(value, rel=0.05)
        if found.ci95 is not None:
            assert found.ci95[0] <= value <= found.ci95[1]


@pytest.mark.slow
@pytest.mark.sample
def test_bench_stranger():
    result, _ = bench("08")
    assert result.verdict == "unexplained" and "theta" in result.depends_on


@pytest.mark.slow
@pytest.mark.sample
def test_the_motion_of_a_pendulum_that_was_not_recorded_gets_no_name():
    """Qube: J 0.037 V s2/rad and Fc 0.07 V by hand; neither gravity nor backlash."""
    log = read_record(DATA / "real/qube-servo/qube_2.csv", scale={"u": 1.0}, units={"u": "N m"})
    found = diagnose(log, {})
    assert found.verdict == "unexplained" and found.effects == ()
    assert found.estimates["J"].value == pytest.approx(0.037, rel=0.05)
    low, high = found.estimates["Fc"].ci95
    assert low < 0.07 < high and high - low < 0.07


@pytest.mark.slow
@pytest.mark.sample
def test_a_speed_that_is_late_by_twenty_samples_is_told_with_its_lag():
    """TIAGo: w = 0.988 dtheta/dt, 190 ms late by hand; the inertia is not determined."""
    found = diagnose(DATA / "real/tiago-late-speed/arm_2.csv", {})
    assert found.error is None and "does not determine the inertia" in " ".join(found.messages)
    lag = found.plain.uncertain.get("w_lag") or found.plain.parameters["w_lag"]
    assert lag.value == pytest.approx(0.19, rel=0.05) and lag.ci95[1] - lag.ci95[0] < 0.03
    assert "J" not in found.plain.parameters


@pytest.mark.slow
@pytest.mark.sample
def test_friction_once_per_motor_turn_is_a_candidate_beside_a_larger_bend():
    """TX40, joint 6: 0.28 of Coulomb and a bent curve by hand, which is more than the wave."""
    found = diagnose(read_record(DATA / "real/tx40-joint6/joint6_1kHz.csv", scale={"u": 1.0}), {})
    assert found.verdict == "unexplained" and found.depends_on == ("theta", "w")
    assert "Candidates that are not certain: position_dependent_friction." in found.messages

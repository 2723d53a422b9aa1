"""Held values, declared effects, one direction and maps in the torque balance."""

from __future__ import annotations

import numpy as np
import pytest

import lugrectl as lg

from ..cases.balance_drive import FC, FV, J, inside, log_of, recorded, simulate

MODEL, DT = lg.Model.of(), 2e-3


@pytest.fixture(scope="module")
def one_way():
    """Speeds up and down, never back, under a constant torque."""
    dt = 2e-3
    t = np.arange(4000) * dt
    u = 0.25 + 0.08 * np.sin(2 * np.pi * 0.6 * t) + 0.06 * np.sin(2 * np.pi * 1.7 * t)
    theta, w = simulate(u, dt, w0=12.0, load=lambda theta, w: 0.03)
    assert w.min() > 0
    return log_of(u, dt, theta, w)


def test_one_direction_gives_the_sum_of_friction_and_constant_torque(one_way):
    found = lg.balance(one_way, MODEL)
    assert "Fc" not in found.parameters and "constant_torque" not in found.parameters
    text = [c for c in found.combinations if c.text == "Fc + constant_torque"]
    assert text and text[0].value == pytest.approx(FC + 0.03, rel=0.02)
    assert "other direction" in text[0].to_separate


@pytest.mark.parametrize(
    "effect, values, load",
    [
        ("quadratic_drag", {"coefficient": 8e-4}, lambda q, w: 8e-4 * w * abs(w)),
        ("torque_ripple", {"amplitude": 0.03, "phase": 1.0}, lambda q, w: 0.03 * np.sin(6 * q + 1)),
    ],
)
def test_a_declared_effect_is_a_term(effect, values, load):
    declared = {"name": effect, **({"harmonic": 6} if effect == "torque_ripple" else {})}
    found = lg.balance(recorded(8.0, load=load), lg.Model.of(effects=[declared]))
    for key, truth in values.items():
        estimate = found.parameters[f"{effect}.{key}"]
        assert estimate.value == pytest.approx(truth, rel=0.1, abs=0.02 if key == "phase" else 0)
    assert found.parameters["Fc"].value == pytest.approx(FC, rel=0.02)


def test_friction_that_depends_on_the_load_is_a_term():
    def load(q, w):
        gravity = 0.2 * np.sin(q)
        return gravity + 0.3 * abs(gravity) * np.tanh(w / 0.01)

    effects = ["gravity", "load_dependent_friction"]
    found = lg.balance([recorded(10.0, load=load)], lg.Model.of(effects=effects))
    value = found.values()["load_dependent_friction.coefficient"]
    assert value == pytest.approx(0.3, rel=0.15)
    assert found.values()["gravity.amplitude"] == pytest.approx(0.2, rel=0.03)


def test_a_held_friction_makes_one_direction_enough(one_way):
    found = lg.balance(one_way, MODEL.with_values({"Fc": FC}).fix("Fc"))
    assert inside(found.parameters["constant_torque"], 0.03)
    assert "Fc" not in found.parameters and inside(found.parameters["J"], J)


@pytest.fixture(scope="module")
def coasts():
    """Runs without torque from these speeds."""
    runs = []
    for w0 in (60.0, 40.0, -50.0):
        u = np.zeros(2000)
        runs.append(log_of(u, 1e-3, w=simulate(u, 1e-3, w0=w0)[1]))
    return runs


@pytest.mark.slow
def test_a_coast_down_with_a_known_inertia_gives_the_friction(coasts):
    for model in (MODEL.with_values({"J": J}), MODEL.with_values({"J": J}).fix("J")):
        found = lg.balance(coasts, model)
        assert found.parameters["Fc"].value == pytest.approx(FC, rel=0.02)
        assert found.parameters["Fv"].value == pytest.approx(FV, rel=0.02)
        assert not any("give J" in note for note in found.notes)
        assert any(note.startswith("J is taken as declared, 0.004 kg m2") for note in found.notes)


@pytest.mark.slow
def test_a_coast_down_without_the_inertia_gives_friction_per_inertia(coasts):
    found = lg.balance(coasts, MODEL)
    sums = {c.text: c.value for c in found.combinations}
    assert not found.parameters
    assert sums["Fc / J"] == pytest.approx(FC / J, rel=0.02)
    assert sums["Fv / J"] == pytest.approx(FV / J, rel=0.02)
    with pytest.raises(lg.Refused, match="or the drive coasts"):
        lg.identify(coasts, MODEL)


def test_a_declared_delay_is_fitted_and_a_held_one_is_used():
    log = recorded(5.0)
    late = log_of(np.roll(log["u"], -4)[10:-10], DT, log["theta"][10:-10])
    model = lg.Model.of(effects=[{"name": "input_delay", "delay": 0.008}])
    fitted = lg.balance([late], model)
    assert fitted.parameters["input_delay.delay"].value == pytest.approx(0.008, abs=3e-4)
    held = lg.balance(late, model.fix("input_delay.delay"))
    assert "u_delay" not in held.parameters
    assert held.parameters["J"].value == pytest.approx(J, rel=0.01)

"""A declared effect whose values are left open is identified, whichever it is."""

import numpy as np
import pytest

import lugrectl as lg
from lugrectl.blocks.effects import held_lagging, held_late

from ..cases.balance_drive import J, log_of, simulate
from ..cases.drives import EFFECTS

DT, FINE, LATE = 4e-3, 4, 6e-3
TRUE = {
    "constant_torque": {"torque": -0.1},
    "gravity": {"amplitude": 0.1, "phase": 0.5},
    "torque_ripple": {"amplitude": 0.05, "harmonic": 5.0, "phase": 0.7},
    "position_dependent_friction": {"ratio": 0.3, "harmonic": 2.0, "phase": 0.7},
    "coulomb_asymmetry": {"ratio": -0.2},
    "viscous_asymmetry": {"ratio": 0.4},
    "quadratic_drag": {"coefficient": 2e-3},
    "sublinear_viscous": {"coefficient": 0.05, "exponent": 0.5},
    "torque_constant_ripple": {"ratio": 0.2, "harmonic": 3.0, "phase": 0.7},
    "pose_dependent_inertia": {"ratio": 0.3, "harmonic": 1.0, "phase": 0.7},
    "periodic_disturbance": {"amplitude": 0.05, "frequency": 3.3, "phase": 0.7},
    "load_dependent_friction": {"coefficient": 0.3},
    "encoder_eccentricity": {"amplitude": 0.05, "phase": 0.7},
    "return_spring": {"stiffness": 0.03, "rest": 0.4},
    "hard_stop": {"stiffness": 0.5, "position": 2.0, "side": 1.0},
    "thermal_drift": {"ratio": -0.3, "time_constant": 3.0},
    "friction_step": {"ratio": 0.3, "time": 3.2},
    "inertia_step": {"ratio": 0.5, "time": 3.3},
    "input_delay": {"delay": 0.0123},
    "actuator_lag": {"time_constant": 0.02},
    "actuator_saturation": {"limit": 0.6},
    "actuator_dead_zone": {"half_width": 0.06},
    "elastic_coupling": {"load_inertia": 0.002, "stiffness": 2.0, "damping": 0.01},
}


def log(model):
    """8 s of the drive under a held torque, with the noise of its sensors."""
    t = DT / FINE * np.arange(round(8.0 / DT) * FINE)
    at, rng = t[::FINE], np.random.default_rng(0)
    u = 0.45 * np.sin(4.4 * at) + 0.35 * np.sin(14.5 * at + 1.0) + 0.2 * np.sin(1.1 * at)
    moved = lg.simulate(lg.plant(model), t, {"u": np.repeat(u, FINE)}, hold=True).outputs
    seen = lg.simulate(lg.sensor(model), t, {k: moved[k] for k in ("w", "theta")}).outputs
    theta, w = (seen[k][::FINE] for k in ("theta_m", "w_m"))
    theta = theta + 2e-5 * rng.standard_normal(len(at))
    return log_of(u, DT, theta, w + 1e-3 * rng.standard_normal(len(at)))


ALWAYS = ("hard_stop", "input_delay")
LONG = ("position_dependent_friction", "constant_torque", "coulomb_asymmetry", "torque_ripple")
SAMPLED = (pytest.mark.slow, pytest.mark.sample)


def marks(name):
    return () if name in ALWAYS else pytest.mark.slow if name in LONG else SAMPLED


@pytest.mark.parametrize("name", [pytest.param(name, marks=marks(name)) for name in TRUE])
def test_its_values_are_found(name):
    names = ["gravity", name] if name == "load_dependent_friction" else [name]
    known = [{"name": n, **TRUE[n]} for n in names]
    drive = lg.Model.of(J=J, friction="coulomb", Fc=0.2, Fv=0.02, effects=known)
    found = lg.identify(log(drive), lg.Model.of(friction="coulomb", effects=names))
    assert found.estimates["J"].value == pytest.approx(J, rel=0.02)
    for key in TRUE[name].keys() - {"rest"}:  # a constant torque does the same
        true = TRUE[name][key]
        assert found.estimates[f"{name}.{key}"].value == pytest.approx(true, rel=0.05), key


t = np.arange(0.0, 4.0, DT)
u = 0.45 * np.sin(4.4 * t) + 0.35 * np.sin(14.5 * t + 1.0) + 0.25 * np.sin(32.0 * t + 2.0)


def moved(acts):
    theta, _ = simulate(acts, DT)
    return {"t": t, "u": u, "theta": theta + np.random.default_rng(0).normal(0, 2e-5, len(t))}


def opened(name):
    return lg.Model.of(J=J, friction="coulomb").with_effect(name, {})


VAIN = (pytest.mark.slow, pytest.mark.scenario)


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=VAIN if name != "gravity" else ()) for name in EFFECTS]
)
def test_nothing_is_hidden(name):
    """What is declared in vain hardly moves the rest, and is within its bounds."""
    found = lg.identify(moved(u), opened(name))
    own = found.model.declarations()
    assert all(own[k].low <= v <= own[k].high for k, v in found.model.known().items())
    assert found.estimates["J"].value == pytest.approx(J, rel=0.02)


@pytest.mark.cases
@pytest.mark.parametrize(
    "name, acting", [("input_delay", held_late), ("actuator_lag", held_lagging)]
)
def test_a_late_torque_of_another_drive_is_no_missing_effect(name, acting):
    found = lg.diagnose(moved(acting(u, DT, LATE)), opened(name))
    (late,) = [e.value for k, e in found.estimates.items() if k.startswith(name)]
    assert late == pytest.approx(LATE, rel=0.05)

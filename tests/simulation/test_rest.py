"""A drive below break-away rests in ``simulate``, though its law is smooth for other solvers."""

import control as ct
import numpy as np
import pytest

import lugrectl as lg
from lugrectl.blocks.model import model_from_dict

from ..cases.own import moving

HOUR = np.linspace(0.0, 3600.0, 721)
LAWS = {
    "a slow direct drive": (20.0, {"model": "coulomb", "Fc": 2.0, "Fv": 1500.0}, 1.5),
    "a linear axis": (95.0, {"model": "coulomb", "Fc": 20.4, "Fv": 203.5}, 19.0),
    "stiction": (
        0.01,
        {"model": "stribeck", "Fc": 0.3, "Fs": 0.4, "vs": 0.05, "Fv": 0.02},
        0.35,
    ),
    "any exponent": (
        0.01,
        {"model": "stribeck", "Fc": 0.3, "Fs": 0.4, "vs": 0.05, "Fv": 0.02, "delta": 0.7},
        0.35,
    ),
}


def drive(J, friction, *effects):
    return lg.plant(
        model_from_dict({"plant": {"J": J}, "friction": friction, "effects": [*effects]}, "test")
    )


@pytest.mark.parametrize(("case", "sign"), [(k, (-1.0) ** i) for i, k in enumerate(LAWS)])
def test_a_load_that_friction_holds_is_held_for_an_hour(case, sign):
    J, friction, load = LAWS[case]
    found = lg.simulate(drive(J, friction), HOUR, [sign * load + 0.0 * HOUR, 0.0 * HOUR])
    theta, w, F = np.asarray(found.outputs)
    assert np.abs(theta).max() < 1e-10 and np.abs(w).max() < 1e-9
    assert F[1:] == pytest.approx(sign * load, rel=1e-9)  # of the hold, not of a speed


def test_it_is_held_in_a_list_of_blocks_behind_a_dead_time_and_in_a_sweep():
    J, friction, load = LAWS["stiction"]
    ends = {"u": load + 0.0 * HOUR}
    delayed = drive(J, friction, {"name": "input_delay", "delay": 0.01})
    sampled = lg.sampled(ct.tf([1.0], [0.1, 1.0], inputs="u0", outputs="u"), 5.0)
    alone = drive(J, friction)
    moved = [
        lg.simulate([alone], HOUR, ends),
        lg.simulate(delayed, HOUR, [ends["u"], 0.0 * HOUR]),
        lg.simulate([sampled, alone], HOUR, {"u0": ends["u"]}),
    ]
    for found in moved:
        theta = found.outputs[list(found.output_labels).index("theta")]
        assert np.abs(theta).max() < 1e-9
    few = HOUR[:50]
    swept = lg.sweep(alone, few, {"u": ends["u"][:50]}, {"plant.J": [0.01, 1.0]})
    assert np.abs(swept["theta"]).max() < 1e-9
    table = {"plant.eps": [1e-6, 1e-4]}
    smooth = lg.sweep(alone, few, {"u": ends["u"][:50]}, table)["theta"][:, -1]
    assert 0.0 < smooth[0] < 0.02 * smooth[1]  # one width of a sweep smooths, all do


def test_both_solvers_agree_where_a_drive_sticks_and_slides():
    friction = {"model": "stribeck", "Fc": 0.285, "Fv": 0.018, "Fs": 0.335, "vs": 0.01}
    t = np.linspace(0.0, 1.0, 1001)
    u = 0.5 * np.sin(2.0 * np.pi * t) + 0.1 * np.sin(6.6 * np.pi * t)
    plant = drive(0.0022, friction)
    ours = lg.simulate(plant, t, [u, 0.0 * t], rtol=1e-8).states
    options = {"method": "LSODA", "rtol": 1e-8, "atol": 1e-10}
    theirs = ct.input_output_response(plant, t, [u, 0.0 * t], solve_ivp_kwargs=options).states
    theta, w = np.abs(np.asarray(ours - theirs)).max(axis=1)
    assert theta < 2e-5 and w < 5e-4  # eps = 1e-6 rad/s there, none here


@pytest.mark.parametrize("a", [-2.0, -1e-9, 0.5])
def test_a_tanh_of_ones_own_is_no_sign(a):
    """Only a declared width smooths a sign, whatever the value of another parameter."""
    own = moving(
        lambda t, x, u, p: -np.tanh(x / p["a"]) / (1.0 + np.abs(1.0 / p["a"])), "y", "own", a=a
    )
    t = np.linspace(0.0, 1.0, 51)
    ours = lg.simulate(own, t, 0.0, 1e-3).outputs
    theirs = ct.input_output_response(
        own, t, 0.0 * t, [1e-3], solve_ivp_kwargs={"rtol": 1e-9, "atol": 1e-12}
    ).outputs
    assert np.asarray(ours).ravel() == pytest.approx(np.asarray(theirs).ravel(), abs=1e-6)

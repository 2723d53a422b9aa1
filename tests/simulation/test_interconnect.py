"""Loops that a user wires with control.interconnect, by signal names alone."""

import control as ct
import numpy as np
import pytest

import lugrectl as lg
from lugrectl.blocks.controllers import compensation, error, feedforward, pi, prefilter
from lugrectl.blocks.effects import gravity
from lugrectl.blocks.observers import existing_observer, natural_observer, proposed_observer
from lugrectl.loops.friction_loops import velocity_loop

from ..cases.drives import states
from ..cases.observed import P, signals_by
from ..cases.wired import LOW, OUTPUTS, T, simulate


def test_two_observers_side_by_side_on_one_plant():
    """The first drives the loop; the second, 20 % low, only watches."""
    system = ct.interconnect(
        [
            lg.plant(P),
            error(),
            pi(),
            compensation(),
            natural_observer(P),
            existing_observer(LOW, name="second", outputs=["F2", "z2"]),
            proposed_observer(LOW, name="third", outputs=["F3", "z3", "w3"]),
        ],
        inputs=["r"],
        outputs=["w", "F", "Fhat", "F2", "F3", "e"],
        check_unused=False,
    )
    t = np.arange(0, 0.0501, 1e-3)
    r = 0.3 * np.sin(2 * np.pi * 5 * t)
    resp = simulate(system, t, r)
    assert signals_by(resp, "w") == pytest.approx(ct.forced_response(T, t, r).outputs, abs=1e-4)
    assert signals_by(resp, "Fhat") == pytest.approx(signals_by(resp, "F"), abs=1e-4)
    late = t > 0.02
    for name in ("F2", "F3"):
        miss = np.abs(signals_by(resp, name) - signals_by(resp, "F"))[late]
        assert 0.01 < miss.mean() < 0.06  # a fifth of the friction level


def test_external_load_and_an_effect_add_up_on_d():
    system = ct.interconnect(
        [lg.plant(P), gravity.system(amplitude=0.2, phase=0.3)],
        inputs=["u", "d"],
        outputs=["theta", "w", "F"],
        check_unused=False,
    )
    x = states(system, plant_theta=0.5)
    pull = 0.2 * np.sin(0.8)
    assert system.dynamics(0, x, [0.4, 0.07])[1] == pytest.approx((0.4 - pull - 0.07) / P.J)
    neutral = ct.interconnect(
        [lg.plant(P), gravity.system()], inputs=["u", "d"], outputs=["w"], check_unused=False
    )
    assert neutral.dynamics(0, x, [0.4, 0.07]) == pytest.approx(
        lg.plant(P).dynamics(0, x, [0.4, 0.07])
    )


def test_own_loop_with_prefilter_and_feedforward_equals_the_ready_one():
    parts = [
        lg.plant(P),
        proposed_observer(LOW),
        pi(),
        prefilter(kind="velocity"),
        error(),
        feedforward(P),
        compensation(),
    ]
    own = ct.interconnect(parts, inputs=["r_cmd", "d"], outputs=OUTPUTS, check_unused=False)
    ready = velocity_loop(
        P,
        "proposed",
        observer_parameters=LOW,
        prefilter=True,
        feedforward=True,
        load=True,
    )
    rng = np.random.default_rng(1)
    for x, u in zip(rng.normal(size=(20, 7)), rng.normal(size=(20, 2)), strict=True):
        x = x * [1, 0.1, 1e-3, 1e-3, 0.1, 1, 1]
        assert own.dynamics(0, x, u) == pytest.approx(ready.dynamics(0, x, u), rel=1e-12)
        assert own.output(0, x, u) == pytest.approx(ready.output(0, x, u), rel=1e-12)

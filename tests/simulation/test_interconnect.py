"""Loops that a user wires with control.interconnect, by signal names alone."""

import control as ct
import numpy as np
import pytest

import lugrectl as lg
from lugrectl.blocks.controllers import compensation, error, feedforward, pi, prefilter
from lugrectl.blocks.effects import gravity
from lugrectl.blocks.observers import proposed_observer
from lugrectl.loops.friction_loops import velocity_loop

from ..cases.drives import states
from ..cases.observed import P
from ..cases.wired import LOW, OUTPUTS


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

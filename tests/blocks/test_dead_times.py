"""The dead times of a system of blocks are found wherever they stand."""

import control as ct
import pytest

import lugrectl as lg
from lugrectl.blocks.dead_times import dead_times

LATE = lg.Model.of(
    J=0.0022, friction="viscous", Fv=0.018, effects=[{"name": "input_delay", "delay": 5e-3}]
)


def test_each_dead_time_is_found_with_its_states():
    loop = lg.cascade_loop(LATE, kv=20.0, delay=2e-3, lag=1e-3)
    parts = [lg.prefilter(2.0), loop]
    outer = ct.interconnect(parts, inputs=["r_cmd"], outputs=["w"], params={}, check_unused=False)
    for system in (loop, outer):
        found = [*dead_times(system, {"plant.input_delay.delay": 1e-3})]
        assert sorted(one.seconds for one in found) == [1e-3, 2e-3]
        for one in found:
            first, second = system.state_labels[one.place : one.place + 2]
            assert first.endswith("_p1") and second.endswith("_p2") and one.block in first


@pytest.mark.parametrize(
    "block", [lg.limiter(2.0), lg.dead_time(2e-3, dt=1e-3), ct.tf([1], [1, 1])]
)
def test_other_systems_have_none(block):
    assert [*dead_times(block)] == []

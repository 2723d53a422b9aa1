"""Limit cycles: published figures, a simulation of its own, README's table, and what must hold."""

import re
from dataclasses import replace
from functools import cache
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pytest

import lugrectl as lg
from lugrectl.hunting.loop import critical

from .brute_force import HUNTS, RESTS
from .drawn_loops import drawn

README = (Path(__file__).parents[2] / "README.md").read_text()
PID = {"kp": 3.0, "ki": 4.0, "kd": 6.0}
LAW = {"J": 1.0, "Fc": 1.0, "Fs": 1.5, "vs": 1e-3, "Fv": 0.4}


def drive(law="stribeck", **changed):
    return lg.Model.of(friction=law, **{**LAW, **changed})


@cache
def published():
    """Canudas de Wit, Olsson, Astrom and Lischinsky 1995, gains 3, 4, 6."""
    return lg.limit_cycles(drive(), **PID)


def test_the_published_loop_with_set_valued_friction():
    found = published()
    assert not found and found.hunts and found.basin == 0.0
    (cycle,) = found.cycles
    assert cycle.amplitude == pytest.approx(66.92e-3, abs=5e-6)
    assert cycle.period == pytest.approx(23.73, abs=5e-3)
    assert cycle.stable and cycle.stops == 2
    assert cycle.multipliers[0] == pytest.approx(0.1085**2, rel=1e-3)


@pytest.mark.slow
def test_the_published_loop_with_bristles():
    model = lg.Model.of(friction="lugre", **LAW, sigma0=1e5, sigma1=1e5**0.5)
    found = lg.limit_cycles(model, **PID)
    (cycle,) = found.cycles
    assert cycle.amplitude == pytest.approx(63.90e-3, abs=5e-6)
    assert cycle.period == pytest.approx(24.44, abs=5e-3)
    assert 0.0 < cycle.multipliers[0] < 0.1 and "not proven" in found.messages[0]


def test_friction_that_is_more_than_believed_is_what_compensation_tolerates_least():
    model = drive(vs=0.1)
    more = {"friction": (0.5, 2.0), "compensation": 0.5, "points": 6}
    found = lg.hunting_map(model, {"ki": (0.02, 0.5)}, **PID | {"ki": 0.07}, **more)
    low, high = found.tolerated
    assert low == pytest.approx(0.5) and 1.0 < high < 2.0 and not found.proven.any()
    assert f"{low:.3g} to {high:.3g}" in repr(found) and "not proven" in found.messages[0]
    smooth = drive("coulomb", Fs=None, vs=None)
    assert lg.hunting_map(
        smooth, {"ki": (0.1, 1.0)}, **PID, **more | {"compensation": 0.0}, vd=1.0
    ).proven.all()
    with pytest.raises(lg.InputError, match="two gains, or one"):
        lg.hunting_map(model, {"ki": (1, 2), "kd": (1, 2)}, **PID, friction=(0.5, 2.0))


@pytest.mark.slow
def test_readmes_table_of_limit_cycles():
    block = README.split("<!-- figures:cycles -->")[1].split("<!-- end -->")[0]
    rows = dict(re.findall(r"^\|(\w+)\|([^|]+)\|", block, re.M))
    p = lg.table1()
    believed = lg.Model.of(p, Fc=1.2 * p.Fc, Fs=1.2 * p.Fs)
    for name in ("natural", "existing", "proposed"):
        gains = {"kp": 15.0, "ki": 30.0, "kd": 0.3}
        found = lg.limit_cycles(lg.position_loop(p, name, observer_parameters=believed, **gains))
        said = [f"{2e3 * c.amplitude:.1f} mrad" for c in found.cycles] or ["none"]
        assert said == [rows[name]], name


@pytest.mark.slow
def test_an_unstable_cycle_is_the_border_between_rest_and_hunting():
    loop = drawn(70)
    found = lg.limit_cycles(loop.model, **loop.options)
    small, large = found.cycles
    assert not small.stable and large.stable and small.multipliers[0] > 1.0
    assert found.basin == pytest.approx(small.amplitude)
    fates, sizes, _ = loop.from_breakaway([0.97 * found.basin, 1.03 * found.basin])
    assert [*fates] == [RESTS, HUNTS] and sizes[1] == pytest.approx(large.amplitude, rel=0.01)


@pytest.mark.slow
def test_a_loop_whose_only_cycle_is_unstable_comes_to_rest():
    """Two half turns grow apart by -2 about the cycle, and end at rest from all of 14 starts that
    were simulated elsewhere."""
    law = {"J": 0.008875, "Fc": 1.0515, "Fs": 1.49975, "Fv": 0.0707, "vs": 0.00667}
    model = lg.Model.of(friction="lugre", sigma0=1145.0, sigma1=2.7075, **law)
    found = lg.limit_cycles(model, kp=13.75, ki=47.45, kd=0.6255)
    (cycle,) = found.cycles
    assert found.outcome == "rests" and found and found.basin is None and not cycle.stable
    assert "every start comes to rest, past an unstable cycle" in repr(found)


def test_what_the_time_does_not_decide_is_undecided_and_which_effects_it_includes_is_said():
    effects = [{"name": "gravity", "amplitude": 0.1, "phase": 0.0}]
    effects += [{"name": "velocity_sensor_lag", "time_constant": 1e-3}]
    found = lg.limit_cycles(drive(effects=effects), **PID, rate=200.0, time_limit=1e-6)
    assert found.outcome == "undecided" and not found and found.hunts is None
    assert found.summary()["hunts"] is None and found.undecided > 5
    assert "stayed undecided" in found.messages[0] and repr(found).startswith("undecided")
    assert found.messages[-2] == "at rest, with the effects of the model: gravity"
    assert found.messages[-1] == "at rest, without the effects of the sensors: velocity_sensor_lag"


def test_beside_stick_slip_the_headline_says_what_is_of_rest():
    found = replace(lg.limit_cycles(drive(), kp=3.0, kd=6.0), stick_slip=lg.StickSlip(0.2, 0.4, {}))
    first = "moving, the loop sticks and slips up to 0.4000 rad/s; at rest no limit cycle: proven"
    assert repr(found).splitlines()[0] == first


LATE = {"J": 1e-3, "Fc": 4e-4, "Fv": 0.0}  # Coulomb friction and a dead time: it rests or swings


def test_a_dead_time_and_a_limit_swing_from_a_border_on():
    """A dead time feeds in more than friction takes out, the limit bounds the swing. Simulated
    elsewhere 0.036 rad comes to rest, 0.038 rad ends in +-4.695 rad."""
    model = lg.Model.of(friction="coulomb", **LATE)
    late = {"rate": 100.0, "dead_time": 0.08, "limit": 0.004}
    found = lg.limit_cycles(model, kp=0.033, kd=2e-4, **late)
    (cycle,) = found.cycles
    assert found.outcome == "hunts" and not found.diverges
    assert cycle.amplitude == pytest.approx(4.695, rel=1e-3)
    assert 0.035 < found.basin < 0.0395


@pytest.mark.slow
def test_a_torque_limit_voids_the_proof():
    smooth = drive("coulomb", Fs=None, vs=None)
    assert lg.limit_cycles(smooth, **PID).proof
    limited = lg.limit_cycles(smooth, **PID, limit=3.0)
    assert limited.proof is None and limited.outcome == "rests" and limited.loop["limit"] == 3.0


@pytest.mark.slow
def test_motor_and_load_have_their_own_amplitude():
    """Simulated elsewhere in steps of 10 us: the load swings +-16.7 mrad, the motor +-6.8."""
    gap = {"load_inertia": 0.006, "gap": 0.02, "stiffness": 200.0, "damping": 0.05}
    model = lg.Model.of(
        friction="coulomb", J=0.002, Fc=0.02, Fv=0.001, effects=[{"name": "backlash", **gap}]
    )
    loop = lg.cascade_loop(model, kv=15.0, kp=0.15, ki=1.5, feedback="load")
    (cycle,) = lg.limit_cycles(loop).cycles
    assert cycle.amplitude == cycle.amplitude_load == pytest.approx(16.7e-3, rel=0.01)
    assert cycle.amplitude_motor == pytest.approx(6.8e-3, rel=0.01)
    assert cycle.summary()["amplitude_load"] == cycle.amplitude_load


def test_where_hunting_is_undecided_a_critical_gain_has_two_ends():
    def hunts(ki):
        return None if 3.0 < ki < 4.0 else ki > 3.5

    found = critical(hunts, {"ki": (1.0, 10.0)}, "hunting")
    assert found["critical"]["ki"][0] == pytest.approx((3.0, 4.0), rel=2e-3)
    assert found["messages"][0].startswith("as ki rises, hunting begins between 3")
    found = critical(lambda ki: ki < 3.5, {"ki": (1.0, 10.0)}, "hunting")
    assert found["critical"]["ki"] == pytest.approx((3.5,), rel=2e-3)
    assert found["messages"] == ("as ki rises, hunting ends at 3.5",)


def test_nothing_hunts_without_an_integral():
    found = lg.limit_cycles(drive(), kp=3.0, kd=6.0)
    assert found and "energy" in found.proof
    assert lg.limit_cycles(drive(), kp=3.0, kd=6.0, rate=100.0)


@pytest.mark.slow
def test_a_loop_that_grows_is_no_quiet_one():
    found = lg.limit_cycles(drive(), kp=3.0, ki=40.0, kd=6.0)
    assert not found and found.diverges and "kd kp > ki J" in found.messages[0]


@pytest.mark.slow
def test_the_cascade_is_a_pid():
    kv, kp, ki = 2.0, 6.0, 2.0
    one = lg.limit_cycles(drive(), kv=kv, kp=kp, ki=ki)
    two = lg.limit_cycles(drive(), kp=kv * kp + ki, ki=ki * kv, kd=kp)
    assert one.cycles and one.cycles == two.cycles


@pytest.mark.slow
def test_a_law_of_ones_own_gives_the_same_cycle():
    @lg.block("friction", out="F", name="own_stribeck")
    def own(w, Fc=lg.P(1.0, "N m", 0), Fs=lg.P(1.5, "N m", 0), vs=lg.P(1e-3, "rad/s", 0)):
        return (Fc + (Fs - Fc) * np.exp(-((w / vs) ** 2))) * np.sign(w)

    model = lg.Model.of(friction=own, J=1.0, Fc=1.0, Fs=1.5, vs=1e-3)
    (one,) = lg.limit_cycles(model, **PID).cycles
    (two,) = lg.limit_cycles(drive(Fv=0.0), **PID).cycles
    assert one.amplitude == pytest.approx(two.amplitude, rel=1e-9)


def test_the_map_agrees_with_the_loops_on_it():
    loop = drawn(70)
    model, gains = loop.model, loop.options
    ends = {"ki": (gains["ki"] / 3.0, gains["ki"]), "kd": (gains["kd"], 3.0 * gains["kd"])}
    found = lg.hunting_map(model, ends, **gains, points=3)
    assert {*np.unique(found.region)} == {0, 1}
    for i, ki in enumerate(found.values[0]):
        j = (2 * i + 1) % 3
        own = lg.limit_cycles(model, **gains | {"ki": float(ki), "kd": float(found.values[1][j])})
        assert own.hunts == (found.region[i, j] > 0)
    assert found.plot().get_xlabel() == "ki"
    plt.close("all")


@pytest.mark.slow
def test_counts_scatter_the_size_of_half_turns():
    found = lg.limit_cycles(drive(), **PID, rate=50.0, counts=1000)
    (cycle,) = found.cycles
    assert found.loop["resolution"] == pytest.approx(2 * np.pi / 1000) and not cycle.multipliers
    assert 0.0 < cycle.scatter < 0.1 * cycle.amplitude


def test_the_picture_marks_the_cycle():
    found = published()
    ax = found.plot()
    assert ax.get_title("left") == "The loop hunts"
    assert found.cycles[0].amplitude in [x for line in ax.lines for x in line.get_xdata()]
    plt.close("all")


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"kp": -1.0}, "kp = -1"),
        ({"kp": 0.0, "ki": 1.0}, "kp above 0"),
        ({"kp": 1.0, "kd": 1.0, "kv": 2.0}, "no kd"),
        ({"counts": 100}, "give rate"),
        ({"rate": 100.0, "dead_time": -1.0}, "negative"),
        ({"rate": 100.0, "counts": 0.5}, "whole number"),
        ({"vary": {"ki": (2.0, 1.0)}}, "increasing"),
        ({"vary": {"Fc": (1.0, 2.0)}}, "no gain 'Fc'"),
        ({"vary": (1.0, 2.0)}, "gains and their ends"),
    ],
)
def test_what_cannot_be_meant_is_refused(options, said):
    with pytest.raises(lg.InputError, match=said):
        lg.limit_cycles(drive(), **options)


def test_a_model_with_an_unknown_value_is_refused():
    with pytest.raises(lg.InputError, match="needs J"):
        lg.limit_cycles(drive(J=None), **PID)
    with pytest.raises(lg.InputError, match="theta and u"):
        lg.limit_cycles(lg.pi(1.0, 2.0))

"""A loop with a dead time is stable or not by Nyquist's criterion, and its margin is exact."""

import math

import control as ct
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import lugrectl as lg
from lugrectl.core.errors import InputError

P = lg.table1()


@given(st.floats(0.1, 1e3), st.floats(0.0, 3.0))
@settings(max_examples=50, deadline=None)
def test_an_integrator_is_stable_below_pi_over_2(K, turn):
    found = lg.stability_check(lg.delayed(ct.tf([K], [1.0, 0.0]), turn / K))
    assert bool(found) == (turn < math.pi / 2)
    assert found.crossovers == pytest.approx((K,), rel=1e-12)
    if found:
        assert found.delay_margin == pytest.approx((math.pi / 2 - turn) / K, rel=1e-9)
        assert found.phase_margin == pytest.approx(90 - math.degrees(turn), rel=1e-9)


@given(st.floats(1.1, 50.0), st.floats(0.05, 5.0))
@settings(max_examples=25, deadline=None)
def test_the_margin_of_a_first_order_lag_is_its_closed_form(K, tau):
    """|L| = 1 at w = sqrt(K^2 - 1)/tau, with the phase -arctan(w tau)."""
    w = math.sqrt(K * K - 1) / tau
    margin = (math.pi - math.atan(w * tau)) / w
    L = ct.tf([K], [tau, 1.0])
    assert lg.stability_check(L).delay_margin == pytest.approx(margin, rel=1e-9)
    for share in (0.999, 1.001):
        assert bool(lg.stability_check(lg.delayed(L, share * margin))) == (share < 1)


@given(st.floats(0.5, 20.0), st.floats(0.05, 2.0), st.floats(0.01, 0.95), st.floats(0.01, 0.95))
@settings(max_examples=25, deadline=None)
def test_the_margin_falls_by_as_much_as_the_dead_time_grows(kp, kd, one, other):
    L = lg.position_L(P, kp=kp, kd=kd)
    whole = lg.stability_check(L).delay_margin
    first, later = sorted((one, other))
    margins = [lg.stability_check(lg.delayed(L, x * whole)).delay_margin for x in (first, later)]
    assert margins == pytest.approx([(1 - x) * whole for x in (first, later)], rel=1e-6)


@pytest.mark.parametrize("T", [0.01, 0.1, 0.3, 0.6])
def test_poles_are_counted_as_a_pade_form_of_order_12_has_them(T):
    L = ct.tf([5.0, 20.0], [1.0, 1.0, 9.0])
    top, bottom = ct.pade(T, 12)
    near = ct.feedback(L * ct.tf(top, bottom)).poles()
    found = lg.stability_check(lg.delayed(L, T))
    assert found.closed_poles == (near.real > 0).sum()


def test_an_unstable_plant_is_encircled_once_for_each_of_its_poles():
    """2/(s - 1): stable up to a dead time of arccos(1/2)... = (pi/3)/sqrt(3)."""
    L = ct.tf([2.0], [1.0, -1.0])
    margin = (math.pi / 3) / math.sqrt(3)
    found = lg.stability_check(L)
    assert found and found.delay_margin == pytest.approx(margin, rel=1e-9)
    assert (found.encirclements, found.open_poles, found.closed_poles) == (1, 1, 0)
    late = lg.stability_check(lg.delayed(L, 1.01 * margin))
    assert not late and (late.encirclements, late.closed_poles) == (-1, 2)


def test_all_crossovers_count():
    """A resonance lifts |L| above 1 again: a crossover beyond the first one decides."""
    lift = 1 + ct.tf([60.0, 0.0], [1.0, 2.0, 1e4])
    found = lg.stability_check(ct.tf([10.0], [1.0, 0.0]) * lift)
    w = np.array(found.crossovers)
    L = 10 / (1j * w) * (1 + 60j * w / (1e4 - w**2 + 2j * w))
    assert found and len(w) == 3 and np.abs(L) == pytest.approx(np.ones(3), rel=1e-9)
    margins = (np.angle(-L) % (2 * np.pi)) / w
    assert found.delay_margin == pytest.approx(margins.min(), rel=1e-9)
    assert np.argmin(margins) > 0


def test_a_loop_below_1_stands_any_dead_time():
    found = lg.stability_check(lg.delayed(ct.tf([0.5], [1.0, 1.0]), 3.0))
    assert found and found.delay_margin == found.phase_margin == math.inf


def test_a_direct_path_of_1_or_more_stands_none():
    L = ct.tf([2.0, 1.0], [1.0, 3.0])
    found = lg.stability_check(L)
    assert found and found.delay_margin == 0.0
    late = lg.stability_check(lg.delayed(L, 1e-6))
    assert not late and late.closed_poles == math.inf and "infinitely many" in late.reason
    assert lg.stability_check(lg.delayed(ct.tf([0.5, 1.0], [1.0, 3.0]), 10.0))


def test_a_mode_that_cancels_is_not_forgotten():
    L = lg.delayed(ct.tf([1.0], [1.0, -2.0]), 0.1) * ct.tf([1.0, -2.0], [1.0, 3.0])
    found = lg.stability_check(L)
    assert not found and "s = +2" in found.reason


def test_two_dead_times_are_counted_too():
    """A Smith predictor: the loop is that without dead time, whatever the dead time."""
    G, C = ct.tf([1.0], [1.0, 0.5]), ct.tf([8.0, 40.0], [1.0, 0.0])
    inner = lg.delayed(C, 0.0).feedback(G - lg.delayed(G, 0.4))
    found = lg.stability_check(inner * lg.delayed(G, 0.4))
    assert found and 0 < found.delay_margin < 0.4
    assert not lg.stability_check(lg.delayed(C * G, 0.4))


def test_the_verdict_is_plain_data():
    found = lg.stability_check(lg.velocity_L(P, kp=1.6, ki=0.16, dead_time=1e-3)).to_dict()
    assert found["holds"] is True and found["crossovers"] == pytest.approx([727.27], rel=1e-4)
    assert found["delay_margin"] == pytest.approx(1.16e-3, rel=1e-2)


def test_wrong_loops_are_named():
    with pytest.raises(InputError, match="is for a measured response"):
        lg.stability_check(ct.tf([1.0], [1.0, 0.5], 0.1), open_poles=1)
    with pytest.raises(InputError, match="open_poles must be .* 0.5"):
        lg.stability_check(ct.frd(ct.tf([1.0], [1.0, 0.5]), [0.1, 1.0]), open_poles=0.5)
    with pytest.raises(InputError, match="no solution"):
        lg.stability_check(ct.tf([-1.0], [1.0]))
    with pytest.raises(InputError, match="dead_time"):
        lg.velocity_L(P, kp=1.0, dead_time=-1e-3)


def test_simulation_decides_as_the_criterion():
    """A cascade on either side of its delay margin, by the method of steps."""
    p = lg.Model.of(J=0.0022, friction="viscous", Fv=0.018)

    def grows(late):
        loop = lg.cascade_loop(p, kv=20.0, kp=1.6, ki=16.0, delay=late)
        run = lg.simulate(loop, np.linspace(0.0, 0.4, 401), {"r": 0.01})
        w = np.abs(run.outputs[1])
        return w[-50:].max() > w[50:100].max()

    loop = lg.cascade_loop(p, kv=20.0, kp=1.6, ki=16.0, delay=1e-3)
    L = lg.linearize(loop, input="r", output="w").open_loop
    late = 1e-3 + lg.stability_check(L).delay_margin
    assert not grows(0.97 * late) and grows(1.03 * late)

"""Repetitive learning: both forms against their law, and the error from period to period."""

import control as ct
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import lugrectl as lg
from lugrectl.blocks.block import members

from ..cases.observed import STEP, P, longer, rms, signals_by, sine

few = st.floats(-1.0, 1.0)


def by_period(blocks, periods, plant=P, noise=0.0):
    """RMS of theta - r in rad for each period of 0.1 sin 2 pi t, and the largest |u|."""
    t = np.arange(0.0, periods + STEP / 2, STEP)
    rows = sine(t)
    if noise:
        rows["dw"] = noise * np.random.default_rng(0).normal(size=len(t))
    done = lg.simulate([lg.plant(plant), *blocks], t, rows)
    e = (signals_by(done, "theta") - rows["r"])[: periods * 1000].reshape(periods, 1000)
    return np.sqrt(np.mean(e**2, axis=1)), np.abs(signals_by(done, "u")).max()


# A memory of one period.


@given(few, few, st.lists(st.floats(-2.0, 2.0), min_size=6, max_size=6))
def test_memory_is_the_law_with_a_delay_of_one_period(s, ar, x):
    made = lg.repetitive_memory(P, 0.5, 0.1, K=0.3, gamma=0.2, limit=1.0)
    assert made.nstates == 6 and made.dt == 0.1
    v = np.clip(x[1], -1.0, 1.0) - 0.2 * s  # of 5 samples ago
    assert made.output(0.0, x, [s, ar]) == pytest.approx(P.J * ar - 0.3 * s + v)
    assert made.dynamics(0.0, x, [s, ar]) == pytest.approx([*x[1:], v])
    mean = lg.repetitive_memory(P, 0.5, 0.1, K=0.3, gamma=0.2, limit=1.0, smooth=True)
    old = np.dot([0.25, 0.5, 0.25], np.clip(x[:3], -1.0, 1.0))
    assert mean.dynamics(0.0, x, [s, ar])[-1] == pytest.approx(old - 0.2 * s)


def test_memory_repeats_what_it_has_learnt():
    """An s of one period is remembered, without any further error, for ever."""
    made = lg.repetitive_memory(P, 0.5, 0.1, K=0.0, gamma=0.2)
    s = np.zeros(20)
    s[:5] = [1.0, -0.5, 0.25, 0.0, 2.0]
    t = 0.1 * np.arange(20)
    u = ct.input_output_response(made, t, np.array([s, 0.0 * s]), np.zeros(6)).outputs
    assert np.squeeze(u) == pytest.approx(np.tile(-0.2 * s[:5], 4))


@longer
def test_memory_learns_friction_that_no_law_describes():
    """1.2e-2 in period 5, 4.1e-3 in 10, 1.1e-3 in 20; without learning 70 mrad."""
    errors, _ = by_period([lg.sliding_error(), lg.repetitive_memory(P)], 20)
    assert errors[[4, 9, 19]] == pytest.approx([1.2e-2, 4.1e-3, 1.1e-3], rel=0.05)
    none, _ = by_period([lg.sliding_error(), lg.slotine_li(P)], 4)
    assert none[-1] == pytest.approx(0.070, rel=0.02)


@longer
def test_memory_is_smoothed_where_w_is_noisy():
    """0.01 rad/s of noise on w: less torque with the average over three samples."""
    sensor = ct.nlsys(
        None, lambda t, x, u, p: u[0] + u[1], inputs=["w", "dw"], outputs=["w_m"], name="noise"
    )
    error = lg.sliding_error(inputs=["theta", "w_m", "r", "dr", "ddr"])
    found = [
        by_period([sensor, error, lg.repetitive_memory(P, gamma=0.15, smooth=smooth)], 8, P, 0.01)
        for smooth in (False, True)
    ]
    assert found[1][1] < found[0][1] and found[1][0][-1] < 1.05 * found[0][0][-1]
    assert found[1][0][-1] < 5e-3


# Harmonics.


@given(st.lists(few, min_size=7, max_size=7), few, few, st.floats(0.0, 9.0))
def test_harmonics_are_a_fourier_series_in_rotating_coordinates(x, s, ar, t):
    """xj = cj cos(j om t) + dj sin(j om t) with dcj/dt = -gamma s cos, ddj/dt = -gamma s sin."""
    made, om = lg.repetitive_control(P, 2.0, K=0.3, gamma=1.5, harmonics=3), np.pi
    rates = made.dynamics(0.0, x, [s, ar])
    assert made.output(0.0, x, [s, ar]) == pytest.approx(P.J * ar - 0.3 * s + sum(x[:4]))
    assert rates[0] == pytest.approx(-1.5 * s)
    for j in (1, 2, 3):
        co, si = np.cos(j * om * t), np.sin(j * om * t)
        c, d = x[j] * co - x[3 + j] * si, x[j] * si + x[3 + j] * co
        dc, dd = -1.5 * s * co, -1.5 * s * si
        dx = dc * co + dd * si + j * om * (d * co - c * si)
        dy = -dc * si + dd * co - j * om * (c * co + d * si)
        assert (rates[j], rates[3 + j]) == pytest.approx((dx, dy), abs=1e-9)


@longer
def test_harmonics_that_are_left_out_remain_in_the_error():
    """At the end 1.7 mrad with 5 harmonics."""
    errors, _ = by_period([lg.sliding_error(), lg.repetitive_control(P, harmonics=5)], 20)
    assert errors[-1] == pytest.approx(1.7e-3, rel=0.05)


def test_harmonics_have_a_sampled_form():
    """What it has learnt turns on exactly by j om dt from sample to sample."""
    dt, x0 = 0.01, [0.1, 0.2, -0.3, 0.4, 0.5]
    made = lg.sampled(lg.repetitive_control(P, 1.0, harmonics=2), dt)
    t = dt * np.arange(30)
    start = [*x0, *[0.0] * (made.nstates - 5)]
    u = np.squeeze(ct.input_output_response(made, t, np.zeros((2, 30)), start).outputs)
    turned = (x0[1] * np.cos(2 * np.pi * t) + x0[3] * np.sin(2 * np.pi * t)) + (
        x0[2] * np.cos(4 * np.pi * t) + x0[4] * np.sin(4 * np.pi * t)
    )
    assert u == pytest.approx(x0[0] + turned, abs=1e-9)
    assert rms(u) > 0.1


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: lg.repetitive_control(P, period=0.0), "period"),
        (lambda: lg.repetitive_control(P, harmonics=2.5), "harmonics = 2.5"),
        (lambda: lg.repetitive_control(P, harmonics=0), "harmonics = 0"),
        (lambda: lg.repetitive_memory(P, dt=0.0), "dt, the sample time,"),
        (lambda: lg.repetitive_memory(P, period=1e9, dt=1e-6), r"1e\+15 samples of 1e-06 s"),
        (lambda: lg.repetitive_memory(P, gamma=-1.0), "repetitive_memory.gamma"),
        (lambda: lg.repetitive_memory(P, limit=0.0), "limit"),
        (lambda: lg.repetitive_memory(P, smooth=3), "smooth"),
        (lambda: lg.repetitive_memory(P, inputs=["s"]), "inputs"),
        (lambda: lg.repetitive_memory(lg.Model.of(P).with_values({"J": None})), "needs J"),
    ],
)
def test_wrong_usage_is_one_sentence(call, said):
    with pytest.raises(lg.InputError, match=said) as raised:
        call()
    assert "\n" not in str(raised.value) and str(raised.value).endswith(".")


def test_the_listed_law_is_that_of_the_memory():
    """u of a sample, with v of one period ago."""
    law = lg.controllers()["repetitive_memory"]
    assert law.inputs == ("s", "ar", "v_late") and "v(t - period)" in law.equation
    block = lg.repetitive_memory(P, period=0.02, dt=1e-3, K=0.2, gamma=0.3, limit=0.5)
    listed = members("controller")["repetitive_memory"]
    x = np.linspace(-1.0, 1.0, block.nstates)
    for s, ar in ((0.3, 2.0), (-0.1, 0.0)):
        u, v = listed(s, ar, x[1], J=P.J, K=0.2, gamma=0.3, limit=0.5)
        assert block.output(0.0, x, [s, ar]) == pytest.approx([u])
        assert block.dynamics(0.0, x, [s, ar]) == pytest.approx([*x[1:], v])

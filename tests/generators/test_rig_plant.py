"""The simulator's equations against closed forms and an independent integrator."""

from __future__ import annotations

import importlib.util
import sys
from dataclasses import replace

import numpy as np
import pytest

from ..drives import plant
from ..drives.machines import GRAVITY_LOAD, MACHINES, NO_LOAD
from ..drives.plant import SPEED_LOOP
from ..drives.reference import lugre_reference, open_loop, wave
from ..drives.run import Setup, drive_row, machine_row, replay, simulate, tune

SERVO = MACHINES["servo"]
STIFF = replace(SERVO, sigma0=20 * SERVO.sigma0, sigma1=2.0)  # hardly creeps before it slips
SLIPPERY = replace(SERVO, Fc=1e-9, Fs=1e-9, Fv=0.0)


@pytest.mark.parametrize("name", ["servo", "axis", "turret"])
def test_lugre_agrees_with_radau(name):
    m, rate = MACHINES[name], 200.0
    _, torque = wave(m, 0.8, rate)
    theta, w = lugre_reference(m, torque, rate)
    ours = simulate(open_loop(m, torque, rate), {}).signals
    assert np.max(np.abs(w)) > 5 * m.vs
    np.testing.assert_allclose(ours["w_true"], w, atol=1e-3 * np.max(np.abs(w)))
    np.testing.assert_allclose(ours["theta_true"], theta, atol=1e-3 * np.max(np.abs(theta)))


def test_error_falls_with_the_square_of_the_step():
    _, torque = wave(SERVO, 0.5, 200.0)
    finest = simulate(open_loop(SERVO, torque, 200.0, step=1.25e-6), {}).signals["w_true"]
    misses = [
        np.max(
            np.abs(simulate(open_loop(SERVO, torque, 200.0, step=h), {}).signals["w_true"] - finest)
        )
        for h in (80e-6, 20e-6)
    ]
    assert misses[0] / misses[1] > 8.0


def test_torque_effects_agree_with_radau():
    m, rate = SERVO, 200.0
    _, torque = wave(m, 0.8, rate)
    table = {
        "gravity": (0.1, 0.4),
        "torque_ripple": (0.05, 7.0, -1.0),
        "quadratic_drag": (1e-3,),
        "return_spring": (0.05, 0.3),
        "periodic_disturbance": (0.04, 6.0, 0.5),
        "sublinear_viscous": (0.02, 0.4),
        "speed_hump": (0.03, 4.0, 1.5),
        "constant_torque": (0.02,),
    }

    def extra(t, th, w):
        still = 0.1 * np.sin(th + 0.4) + 0.05 * np.sin(7 * th - 1.0) + 0.05 * (th - 0.3) + 0.02
        drag = 1e-3 * w * abs(w) + 0.02 * np.sign(w) * abs(w) ** 0.4
        drag += 0.03 * np.sign(w) * np.exp(-(((abs(w) - 4.0) / 1.5) ** 2))
        return still + drag + 0.04 * np.sin(2 * np.pi * 6.0 * t + 0.5)

    theta, w = lugre_reference(m, torque, rate, extra)
    ours = simulate(open_loop(m, torque, rate), table).signals
    np.testing.assert_allclose(ours["w_true"], w, atol=2e-3 * np.max(np.abs(w)))
    np.testing.assert_allclose(ours["theta_true"], theta, atol=2e-3 * np.max(np.abs(theta)))


def test_viscous_decay():
    m = replace(SLIPPERY, Fv=0.01)
    torque = np.where(np.arange(500) < 50, 0.2, 0.0)
    w = simulate(open_loop(m, torque), {}).signals["w_true"][50:]
    t = np.arange(len(w)) * 1e-3
    np.testing.assert_allclose(w, w[0] * np.exp(-m.Fv / m.J * t), rtol=1e-5)


def test_breaks_away_at_the_stiction():
    torque = 1.2 * STIFF.Fs * np.linspace(0.0, 1.0, 20000)
    w = simulate(open_loop(STIFF, torque), {}).signals["w_true"]
    broken = torque[np.argmax(w > 3.0 * STIFF.vs)]
    assert broken == pytest.approx(STIFF.Fs, rel=0.01)


def test_presliding_follows_the_bristles():
    """Slow torque below break-away: theta = -(Fs/sigma0) ln(1 - u/Fs)."""
    torque = 0.7 * SERVO.Fs * np.linspace(0.0, 1.0, 6000)
    theta = simulate(open_loop(SERVO, torque), {}).signals["theta_true"]
    expected = -SERVO.Fs / SERVO.sigma0 * np.log1p(-torque / SERVO.Fs)
    np.testing.assert_allclose(theta[2000:], expected[2000:], rtol=0.01)


def test_slides_at_the_static_speed():
    u = 0.4
    w = simulate(open_loop(SERVO, np.full(2000, u)), {}).signals["w_true"][-1]
    assert w == pytest.approx((u - SERVO.Fc) / SERVO.Fv, rel=1e-4)


def test_energy_and_momentum_balance():
    m = replace(MACHINES["joint"], load=(GRAVITY_LOAD, 1.5, 0.3))
    _, torque = wave(m, 3.0, 1000.0)
    s = simulate(open_loop(m, torque, theta0=0.7), {}).signals
    drive = np.concatenate([[0.0], np.cumsum(s["u"][:-1] * np.diff(s["theta_true"]))])
    height = 1.5 * (np.cos(0.7 + 0.3) - np.cos(s["theta_true"] + 0.3))
    kinetic = 0.5 * m.J * s["w_true"] ** 2
    scale = np.max(np.abs(drive))
    np.testing.assert_allclose(drive, kinetic + height + s["work"], atol=1e-5 * scale)
    assert s["work"][-1] > 0.1 * scale
    weight = 1.5 * np.sin(s["theta_true"] + 0.3)
    push = s["u"] - s["friction"] - 0.5 * (weight + np.roll(weight, -1))
    np.testing.assert_allclose(
        m.J * np.diff(s["w_true"]), push[:-1] * 1e-3, atol=2e-4 * 1e-3 * np.max(np.abs(push))
    )


def test_torque_is_held_from_its_row_on():
    rng = np.random.default_rng(1)
    torque = rng.normal(0.0, 0.1, 300)
    s = simulate(open_loop(SLIPPERY, torque, 500.0), {}).signals
    np.testing.assert_allclose(np.diff(s["w_true"]), torque[:-1] / SLIPPERY.J / 500.0, atol=1e-6)
    assert np.array_equal(s["u"], torque)


def test_delay_is_not_a_multiple_of_the_sample():
    torque = np.where(np.arange(40) >= 10, 0.1, 0.0)
    s = simulate(open_loop(SLIPPERY, torque), {"input_delay": (2.4e-3,)}).signals
    gain = np.diff(s["w_true"]) * SLIPPERY.J / 0.1 / 1e-3
    np.testing.assert_allclose(gain[11:15], [0.0, 0.6, 1.0, 1.0], atol=1e-6)
    assert np.max(np.abs(gain[:12])) < 1e-6


def test_actuator_lag_dead_zone_saturation_and_droop():
    def speed_up(table, u=0.2, n=400):
        w = simulate(open_loop(SLIPPERY, np.full(n, u)), table).signals["w_true"]
        return np.diff(w) * SLIPPERY.J / 1e-3

    t = np.arange(399) * 1e-3
    mean = 1.0 - 0.02 / 1e-3 * (np.exp(-t / 0.02) - np.exp(-(t + 1e-3) / 0.02))
    np.testing.assert_allclose(speed_up({"actuator_lag": (0.02,)}), 0.2 * mean, atol=1e-6)
    np.testing.assert_allclose(speed_up({"actuator_dead_zone": (0.05,)}), 0.15, atol=1e-6)
    np.testing.assert_allclose(speed_up({"actuator_dead_zone": (0.05,)}, -0.2), -0.15, atol=1e-6)
    np.testing.assert_allclose(speed_up({"actuator_saturation": (0.12,)}), 0.12, atol=1e-6)
    np.testing.assert_allclose(speed_up({"torque_droop": (0.5,)}, -0.2), -0.18, atol=1e-6)


def sliding_friction(table, u, machine=SERVO, n=3000):
    s = simulate(open_loop(machine, np.full(n, u)), table).signals
    return s["w_true"], s["friction"] - machine.Fv * s["w_true"]


def test_friction_levels():
    level = SERVO.Fc
    for sign in (1.0, -1.0):
        _, f = sliding_friction({"coulomb_asymmetry": (0.3,)}, 0.6 * sign)
        assert f[-1] == pytest.approx(sign * level * (1 + 0.3 * sign), rel=1e-3)
        w, f = sliding_friction({"viscous_asymmetry": (0.3,)}, 0.6 * sign)
        extra = sign * level + 0.3 * sign * SERVO.Fv * w[-1]
        assert f[-1] == pytest.approx(extra, rel=1e-3)
    _, f = sliding_friction({"friction_step": (0.4, 1.5)}, 0.6)
    assert f[[1400, -1]] == pytest.approx([level, 1.4 * level], rel=1e-3)
    w, f = sliding_friction({"thermal_drift": (-0.4, 0.7)}, 0.6)
    heat = 1 - 0.4 * (1 - np.exp(-np.array([1.0, 2.9]) / 0.7))
    expected = level * heat + SERVO.Fv * (heat - 1) * w[[1000, 2900]]
    assert f[[1000, 2900]] == pytest.approx(expected, abs=2e-4)


def test_friction_depends_on_position_and_load():
    s = simulate(
        open_loop(SERVO, np.full(3000, 0.45)), {"position_dependent_friction": (0.3, 3.0, 1.0)}
    )
    g = 1 + 0.3 * np.sin(3 * s.signals["theta_true"] + 1.0)
    f = s.signals["friction"] - SERVO.Fv * s.signals["w_true"]
    np.testing.assert_allclose(f[500:], SERVO.Fc * g[500:], atol=0.02)
    heavy = replace(SERVO, load=(GRAVITY_LOAD, 0.2, 0.5))
    s = simulate(open_loop(heavy, np.full(3000, 0.7)), {"load_dependent_friction": (0.3,)}).signals
    level = SERVO.Fc + 0.3 * np.abs(0.2 * np.sin(s["theta_true"] + 0.5))
    f = s["friction"] - SERVO.Fv * s["w_true"]
    np.testing.assert_allclose(f[500:], level[500:], atol=0.01)


def test_rest_raises_the_break_away():
    ramp = np.linspace(0.0, 1.5 * STIFF.Fs, 20000)
    for wait in (0, 20000):
        torque = np.concatenate([np.zeros(wait), ramp])
        w = simulate(open_loop(STIFF, torque), {"dwell_stiction": (0.3, 15.0)}).signals["w_true"]
        at = int(np.argmax(np.abs(w) > 3.0 * STIFF.vs))
        rested = 1 - np.exp(-at * 1e-3 / 15.0)
        assert torque[at] == pytest.approx(STIFF.Fs * (1 + 0.3 * rested), rel=0.01)
        assert (rested > 0.85) == (wait > 0)


def test_stop_bumps_and_pulses_push_where_and_when_they_should():
    t = np.arange(2000) * 1e-3
    torque = 0.1 * np.sin(2 * np.pi * t)
    bumps = (0.05, 0.1, 2 * np.pi, 2.0, 1.0, -2.0, 1.0, -0.5)
    pulses = (0.05, 0.2, 2.0, 0.4, 1.3, 1.0, -0.7)
    burst = (0.04, 0.5, 0.3, 8.0)
    s = simulate(open_loop(SLIPPERY, torque), {"hard_stop": (3.0, 0.5, 1.0)}).signals
    th = s["theta_true"]
    np.testing.assert_allclose(s["effect"], 0.5 * np.maximum(0, th - 3.0), atol=0.02)
    assert np.max(th) > 3.2
    s = simulate(open_loop(SLIPPERY, torque), {"torque_bumps": bumps}).signals
    gaps = [np.angle(np.exp(1j * (s["theta_true"] - c))) for c in (1.0, -2.0)]
    shape = np.exp(-((gaps[0] / 0.1) ** 2)) - 0.5 * np.exp(-((gaps[1] / 0.1) ** 2))
    np.testing.assert_allclose(s["effect"], 0.05 * shape, atol=5e-3)
    assert np.max(np.abs(shape)) > 0.5
    s = simulate(open_loop(SLIPPERY, torque), {"contact_pulses": pulses}).signals
    middle = t + 5e-4
    shape = sum(
        a * np.sin(np.pi * np.clip((middle - at) / 0.2, 0, 1))
        for at, a in ((0.4, 1.0), (1.3, -0.7))
    )
    np.testing.assert_allclose(s["effect"], 0.05 * shape, atol=5e-4)
    s = simulate(open_loop(SLIPPERY, torque), {"decaying_burst": burst}).signals
    age = np.maximum(0.0, middle - 0.5)
    ring = 0.04 * np.exp(-age / 0.3) * np.sin(2 * np.pi * 8.0 * age)
    np.testing.assert_allclose(s["effect"], ring, atol=2e-4)


def test_inertia_step_and_inertia_of_the_pose():
    torque = np.full(1000, 0.01)
    w = simulate(open_loop(SLIPPERY, torque), {"inertia_step": (0.5, 0.5)}).signals["w_true"]
    rate = np.diff(w) * SLIPPERY.J / 0.01 / 1e-3
    assert rate[[100, 900]] == pytest.approx([1.0, 1.0 / 1.5], rel=1e-4)
    s = simulate(open_loop(SLIPPERY, torque), {"pose_dependent_inertia": (0.4, 2.0, 0.3)}).signals
    inertia = SLIPPERY.J * (1 + 0.4 * np.cos(2 * s["theta_true"] + 0.3))
    energy = 0.5 * inertia * s["w_true"] ** 2
    np.testing.assert_allclose(energy, 0.01 * s["theta_true"], atol=1e-4 * np.max(energy))


def test_elastic_coupling_swings_at_its_resonance():
    j, jl, k = SLIPPERY.J, 0.5 * SLIPPERY.J, 4.0
    torque = np.where(np.arange(4000) < 5, 0.5, 0.0)
    s = simulate(open_loop(SLIPPERY, torque), {"elastic_coupling": (jl, k, 0.0)}).signals
    momentum = j * s["w_true"] + jl * s["w_load"]
    np.testing.assert_allclose(momentum[6:], 0.5 * 5e-3, rtol=1e-4)
    twist = s["theta_true"] - s["th_load"]
    crossings = np.flatnonzero((twist[:-1] < 0) & (twist[1:] >= 0))
    period = np.mean(np.diff(crossings)) * 1e-3
    assert 2 * np.pi / period == pytest.approx(np.sqrt(k * (1 / j + 1 / jl)), rel=2e-3)
    assert np.max(np.abs(twist[-500:])) == pytest.approx(np.max(np.abs(twist[:500])), rel=1e-2)


def test_backlash_leaves_the_load_alone_until_the_gap_is_closed():
    table = {"backlash": (SLIPPERY.J, 0.2, 500.0, 2.0)}
    s = simulate(open_loop(SLIPPERY, np.full(2000, 0.02)), table).signals
    inside = s["theta_true"] < 0.1
    np.testing.assert_allclose(s["th_load"][inside], 0.0, atol=1e-9)
    together = np.diff(s["w_true"])[-200:] * 2 * SLIPPERY.J / 0.02 / 1e-3
    assert np.mean(together) == pytest.approx(1.0, rel=0.01)
    assert s["theta_true"][-1] - s["th_load"][-1] == pytest.approx(0.1, abs=1e-3)


def test_sensor_effects_act_on_what_is_measured():
    _, torque = wave(SERVO, 2.0, 1000.0)
    plain = simulate(open_loop(SERVO, torque), {}).signals
    s = simulate(open_loop(SERVO, torque), {"velocity_sensor_lag": (0.01,)}).signals
    assert np.array_equal(s["w_true"], plain["w_true"])
    rate = np.gradient(s["w"], 1e-3)
    np.testing.assert_allclose(
        0.01 * rate + s["w"], s["w_true"], atol=0.02 * np.max(np.abs(s["w_true"]))
    )
    s = simulate(open_loop(SERVO, torque), {"encoder_eccentricity": (0.1, 0.6)}).signals
    th, w = s["theta_true"], s["w_true"]
    np.testing.assert_allclose(s["theta"], th + 0.1 * np.sin(th + 0.6), atol=1e-12)
    np.testing.assert_allclose(s["w"], w * (1 + 0.1 * np.cos(th + 0.6)), atol=1e-12)


def test_torque_constant_ripples_with_position():
    torque = np.full(1500, 0.02)
    table = {"torque_constant_ripple": (0.3, 4.0, 0.7)}
    s = simulate(open_loop(SLIPPERY, torque), table).signals
    th = s["theta_true"]
    work = 0.02 * (th - 0.3 / 4.0 * (np.cos(4 * th + 0.7) - np.cos(0.7)))
    assert np.ptp(th) > 2 * np.pi
    energy = 0.5 * SLIPPERY.J * s["w_true"] ** 2
    np.testing.assert_allclose(energy, work, atol=1e-4 * np.max(work))


def test_cable_drags_behind_and_forgets_what_is_far_back():
    torque = 0.1 * np.sin(2 * np.pi * np.arange(4000) * 1e-3)
    s = simulate(open_loop(SLIPPERY, torque), {"dragged_cable": (0.02, 0.4)}).signals
    th = s["theta_true"]
    turns = np.flatnonzero(np.diff(np.sign(s["w_true"]))) + 1
    a, b = turns[1], turns[2]  # one stroke, from a full stretch the other way
    assert abs(th[b] - th[a]) > 0.8
    gone = np.abs(th[a:b] - th[a])
    way = np.sign(th[b] - th[a])
    stretch = np.array([np.minimum(-d + gone, d) / d for d in (0.1, 0.2, 0.3, 0.4)])
    np.testing.assert_allclose(s["effect"][a:b], 0.02 * way * stretch.mean(0), atol=5e-4)


def test_run_again_from_its_own_states():
    m, rate = MACHINES["wrist"], 500.0
    _, torque = wave(m, 2.0, rate)
    table = {"elastic_coupling": (0.01, 30.0, 0.02), "input_delay": (3.1e-3,)}
    done = simulate(replace(open_loop(m, torque, rate), jitter=0.05), table)
    restart = np.zeros(len(torque), dtype=bool)
    restart[[300, 700]] = True
    theta, w = replay(done, torque, restart)
    np.testing.assert_allclose(theta, done.signals["theta_true"], atol=1e-12)
    np.testing.assert_allclose(w, done.signals["w_true"], atol=1e-12)
    _, w = replay(done, torque + 0.1 * m.Fc, restart)
    off = np.abs(w - done.signals["w_true"])
    assert np.max(off[[0, 300, 700]]) == 0.0 and np.max(off[:300]) > 1e-3


def test_samples_come_when_their_stamps_say():
    torque = np.full(400, 0.1)
    done = simulate(replace(open_loop(SLIPPERY, torque), jitter=0.1), {})
    period = np.diff(done.t)
    assert 0.15e-3 < np.max(np.abs(period - 1e-3)) < 0.2e-3
    np.testing.assert_allclose(done.signals["w_true"], 0.1 / SLIPPERY.J * done.t, rtol=1e-6)


def test_a_load_is_held_from_the_start():
    m = replace(SERVO, load=(GRAVITY_LOAD, 0.3, 0.0))
    gains = tune(m, SPEED_LOOP, 1000.0, np.random.default_rng(0), False, False)
    idle = np.zeros((3, 500))
    drive = drive_row(m, gains, 0.0, 1.2)
    setup = Setup(m, SPEED_LOOP, idle, np.zeros((1, 500)), 1000.0, 0.0, 1.2, drive)
    s = simulate(setup, {}).signals
    np.testing.assert_allclose(s["theta_true"], 1.2, atol=1e-6)
    np.testing.assert_allclose(s["u"], 0.3 * np.sin(1.2), rtol=1e-6)


def test_plain_python_computes_the_same(monkeypatch):
    package = plant.__name__.rpartition(".")[0]
    monkeypatch.setitem(sys.modules, "numba", None)
    monkeypatch.delitem(sys.modules, f"{package}.shapes")
    spec = importlib.util.spec_from_file_location(f"{package}.plain_plant", plant.__file__)
    assert spec is not None and spec.loader is not None
    plain = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(plain)
    m = replace(MACHINES["wrist"], load=(NO_LOAD, 0.0, 0.0))
    _, torque = wave(m, 0.2, 500.0)
    setup = open_loop(m, torque, 500.0)
    on = np.ones(len(plant.EFFECTS), dtype=bool)
    rows = np.full((len(plant.EFFECTS), plant.WIDTH), 0.05)
    rows[[plant.BUMPS, plant.PULSES], :4] = [0.05, 0.3, 1.0, 1.0]
    args = machine_row(m), setup.drive, on, rows, setup.refs, setup.noise, setup.stamps, 100, 0.1
    for ours, theirs in zip(plain.run(*args), plant.run(*args), strict=True):
        np.testing.assert_allclose(ours, theirs, rtol=1e-6, atol=1e-9)

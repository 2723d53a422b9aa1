"""The second generator of messy logs: what it promises of its records and of its physics."""

from __future__ import annotations

import numpy as np
import pytest

from tests.messy.case import EFFECTS
from tests.messy.second import KINDS, alike, draw, effects, kernel, simulate
from tests.messy.second.machine import Machine

pytest.importorskip("numba")  # without it the records come, a hundred times slower

FEW = (
    ("effect", 2),
    ("effect", 9),
    ("effect", 15),
    ("none", 1),
    ("unknown", 2),
    ("sound", 0),
    ("sound", 1),
)


@pytest.fixture(scope="module")
def cases():
    return {key: draw(key[1], key[0]) for key in FEW}


def drive(friction: float = 1e-9, viscous: float = 0.0, **more: float) -> Machine:
    """A bare inertia of 0.01 kg m2 with Coulomb and viscous friction, nothing else."""
    p = {"J": 0.01, "Fc": friction, "Fs": friction, "Fv": viscous, "vs": 0.1, "delta": 2.0}
    p |= {
        "power": 1.0,
        "relax": 1.0,
        "sigma1": 0.0,
        "umax": 1e9,
        "grav": 0.0,
        "grav_phase": 0.0,
        **more,
    }
    return Machine(
        "bare", "static", p, np.array([1e3 * friction]), np.ones(1), 10, 100, 10, 1e4, 1000.0, 4
    )


def torque(u: np.ndarray) -> np.ndarray:
    ref = np.zeros((4, u.size))
    ref[3] = u
    return ref


@pytest.mark.parametrize("kind, seed", [("effect", 2), ("sound", 1)])
def test_the_same_seed_gives_the_same_record(cases, kind, seed):
    again = draw(seed, kind)
    for name, column in cases[kind, seed].record.items():
        assert np.array_equal(column, again.record[name])
    assert again.model == cases[kind, seed].model and again.values == cases[kind, seed].values


@pytest.mark.parametrize("key", FEW)
def test_records_are_finite_and_complete(cases, key):
    record = cases[key].record
    assert {"t", "u"} < set(record) and set(record) & {"theta", "w"}
    assert {x.shape for x in record.values()} == {record["t"].shape}
    assert all(np.isfinite(x).all() for x in record.values())
    assert np.all(np.diff(record["t"]) > 0) and 9 < record["t"][-1] < 46
    assert 95 < 1 / np.median(np.diff(record["t"])) < 2100


def test_effects_stay_within_3_and_25_percent_of_friction(cases):
    for (kind, seed), case in cases.items():
        share = case.hidden / case.friction
        if kind in ("effect", "unknown"):
            assert 0.03 <= share <= 0.25, (kind, seed)
        else:
            assert share == 0.0 and case.effect == "none"


def test_the_kind_decides_what_is_to_be_named(cases):
    for (kind, seed), case in cases.items():
        if kind == "effect":
            assert case.effect == EFFECTS[seed % 20]
            assert case.effect not in case.background | case.alike
            assert any(x.startswith(case.effect + ".") for x in case.values)
        if kind == "unknown":
            assert case.effect not in EFFECTS and case.signals
        if kind == "sound":
            assert not case.background & set(EFFECTS)


def test_declared_values_are_10_to_20_percent_off(cases):
    for case in cases.values():
        off = case.model["plant"]["J"] / case.values["J"] - 1
        assert 0.1 <= abs(off) <= 0.2
        assert not {x["name"] for x in case.model["effects"]} & {case.effect}


def test_an_unknown_kind_is_refused():
    with pytest.raises(ValueError, match="kind must be one of"):
        draw(0, "other")
    assert len(KINDS) == 4


def test_constant_torque_against_viscous_friction_follows_the_exponential():
    m = drive(viscous=0.02)
    out = simulate(m, torque(np.full(2000, 0.1)), np.zeros(2000))
    t = np.arange(2000) / m.fs
    assert np.allclose(out[:, kernel.W], 5.0 * (1 - np.exp(-2.0 * t)), atol=1e-6)
    theta = 5.0 * (t - (1 - np.exp(-2.0 * t)) / 2.0)
    assert np.allclose(out[:, kernel.TH], theta, atol=1e-6)


def test_a_coasting_drive_loses_speed_evenly_and_stops():
    m = drive(friction=0.05)
    out = simulate(m, torque(np.zeros(3000)), np.zeros(3000), w0=10.0)
    t = np.arange(3000) / m.fs
    before = (t > 0.01) & (t < 1.9)
    assert np.allclose(out[before, kernel.W], 10.0 - 5.0 * t[before], atol=0.02)
    assert np.abs(out[t > 2.2, kernel.W]).max() < 0.1


def test_gravity_alone_swings_with_its_period():
    m = drive(grav=0.04)  # small swing about 0: omega = sqrt(A / J) = 2
    m.P["grav_phase"] = 0.0
    out = simulate(m, torque(np.zeros(8000)), np.zeros(8000), w0=0.02)
    t = np.arange(8000) / m.fs
    assert np.allclose(out[:, kernel.TH], 0.01 * np.sin(2.0 * t), atol=1e-5)


@pytest.mark.parametrize(
    "name, e, steady",
    [
        ("input_delay", (0.005,), 0.005),
        ("actuator_lag", (0.005,), 0.005),
        ("actuator_dead_zone", (0.1,), 0.1),
    ],
)
def test_an_actuator_that_is_late_or_dead_costs_the_speed_that_it_should(name, e, steady):
    u = np.full(1000, 1.0)
    parts = [
        simulate(drive(), torque(u), np.zeros(1000), c, e) for c in (-1, effects.code_of(name))
    ]
    lost = parts[0][-1, kernel.W] - parts[1][-1, kernel.W]
    whole = steady * 100 * (0.999 if name == "actuator_dead_zone" else 1.0)  # u / J = 100 rad/s2
    assert lost == pytest.approx(whole, rel=0.03)


@pytest.mark.parametrize("code", range(-1, 24))
def test_the_torques_add_up_to_the_acceleration(code):
    numbers = {
        14: (0.008, 12.0, 0.03), 15: (0.008, 0.05, 12.0, 0.03),
        9: (0.004,), 10: (0.004,), 13: (2.0, 0.3, 1.0),
        20: (0.1, -1.0, 1.0, 0.3), 21: (0.1, 3.0, 1.0, 0.1), 22: (0.1, 0.0, 0.5, 0.1),
    }  # fmt: skip
    e = numbers.get(code, (0.05, 2.0, 0.3))
    m = drive(
        friction=0.2,
        viscous=0.01,
        rip=0.01,
        rip_n=5.0,
        rip_phase=0.0,
        offset=0.01,
        kt=0.01,
        kt_n=3.0,
    )
    t = np.arange(3000) / m.fs
    ref = torque(0.6 * np.sin(5 * t))
    out = simulate(m, ref, np.full(3000, 0.1), code, e)
    driven = out[:, kernel.UCMD] - out[:, kernel.F0] - out[:, kernel.RE] - out[:, kernel.BG]
    driven -= 0.0 if code == 23 else 0.1  # the outside torque counts as the effect there
    assert np.allclose(driven, 0.01 * out[:, kernel.ACC], atol=1e-9)
    assert (effects.rms(out[:, kernel.RE]) > 1e-3) == (
        code not in (-1, 8)
    )  # 8: there is no load here


@pytest.mark.parametrize("swing, confused", [(0.2, True), (2.0, False)])
def test_gravity_is_taken_for_a_spring_over_a_small_angle_only(swing, confused):
    m = drive(friction=0.2, viscous=0.01, kpp=20.0, kv=0.5, vff=1.0, lp=1.0, fs=1000.0, unb=0.0)
    m.P.update(rip=0.002, rip_n=7.0, rip_phase=0.0)
    t = np.arange(12000) / m.fs
    ref = np.zeros((4, t.size))
    ref[0], ref[1] = swing * np.sin(2 * t), swing * 2 * np.cos(2 * t)
    out = simulate(m, ref, 0.0 * t, effects.code_of("gravity"), (0.2, 0.0))
    names, _ = alike.alike(alike.scene(m, out), "gravity", 1e-5, 0.0)
    assert ("return_spring" in names) == confused
    assert "friction_step" not in names

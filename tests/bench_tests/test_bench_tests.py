"""Each standard test is recognised and answered within its interval; what is none gets no line."""

from __future__ import annotations

import json

import numpy as np
import pytest

import lugrectl as lg
from lugrectl.report import plain_text

from ..drives.bench import Drive, held, kept, ramps, speed_loop, stale

PUSHED = [0.5, 0.0, -0.5, 0.0, 0.35, -0.35, 0.0]


def free(k, theta, w):
    """No torque."""
    return 0.0


def only(log, model=None):
    """The one bench test of a log."""
    (test,) = lg.balance(log, model or {}).bench_tests
    return test


def kinds(log):
    return [test.kind for test in lg.balance(log).bench_tests]


def check(test, truth: dict, within=0.03) -> None:
    for name, right in truth.items():
        found = test.values[name]
        assert found.may_be(right) and abs(found.value / right - 1) < within, name


# ---- coast-down: friction for each unit of inertia ----------------------------------


COASTING = Drive(Fs=0.15)
PER = {"Fc/J": COASTING.Fc / COASTING.J, "Fv/J": COASTING.Fv / COASTING.J}


@pytest.mark.slow
def test_a_coast_gives_friction_with_and_without_inertia():
    logs = [kept(COASTING.run(free, 900, v=v), "theta") for v in (40.0, -25.0)]
    check(only(logs), PER)
    check(only(logs, {"J": COASTING.J}), PER | {"Fc": COASTING.Fc, "Fv": COASTING.Fv})


def test_a_coast_is_seen_by_a_speed_alone_that_is_noisy_or_stale():
    log, rng = COASTING.run(free, 900, v=40.0), np.random.default_rng(1)
    noisy = {**kept(log), "w": log["w"] + rng.normal(0, 0.05, len(log["w"]))}
    for one in (noisy, {**kept(log), "w": stale(log)}):
        check(only(one), PER)


@pytest.mark.parametrize("drive", [Drive(Fs=0.25, vs=1.0), Drive(Fs=0.15, gravity=0.04)])
def test_friction_that_falls_and_a_load_that_hangs_down_are_not_taken_for_coulomb(drive):
    check(only(kept(drive.run(free, 900, v=40.0), "theta")), PER)


@pytest.mark.parametrize("rate", [-0.3, 1.0])
def test_what_does_not_brake_is_no_coast(rate):
    """A speed that falls as exp(-t), or more steeply than friction can: no value is found."""
    t = 2e-3 * np.arange(1500)
    w = 30 * np.exp(-t) if rate > 0 else 30 * np.cos(np.minimum(t, 1.5))
    tests = lg.balance({"t": t, "u": 0 * t, "w": w}).bench_tests
    assert not any(test.values["Fc/J"].value > 1.0 for test in tests)


# ---- steps and pulses: inertia beside friction --------------------------------------


@pytest.fixture(scope="module")
def steps():
    return Drive().run(held(PUSHED, 150), 3000)


@pytest.mark.slow
@pytest.mark.parametrize("seen", ["theta", "w", "stale"])
def test_steps_give_inertia_and_friction(steps, seen):
    made = kept(steps, seen) if seen != "stale" else {**kept(steps), "w": stale(steps)}
    tests = {test.kind: test for test in lg.balance(made).bench_tests}
    check(tests["steps_and_pulses"], {k: getattr(Drive(), k) for k in ("J", "Fc", "Fv")})


@pytest.mark.parametrize("late", [False, True])
def test_a_torque_that_is_noisy_or_late_is_counted(steps, late):
    u = steps["u"] + np.random.default_rng(2).normal(0, 0.01, 3000)
    u = np.roll(steps["u"], -2) if late else u  # logged 4 ms before it acts
    tests = {test.kind: test for test in lg.balance(kept(steps | {"u": u}, "theta")).bench_tests}
    assert abs(tests["steps_and_pulses"].values["J"].value / Drive().J - 1) < 0.03


# ---- free swing: length, damping and dry friction -----------------------------------


@pytest.mark.parametrize("channel", ["theta", "w"])
def test_the_whole_swing_is_fitted(channel):
    arm = Drive(J=0.02, Fc=0.004, Fs=0.005, Fv=0.002, gravity=0.5)
    test = only(kept(arm.run(free, 5000, x=1.1), channel))
    assert test.kind == "free_swing"
    right = {"length": 9.81 * arm.J / arm.gravity, "gravity/J": arm.gravity / arm.J}
    check(test, right | {"Fc/J": arm.Fc / arm.J, "Fv/J": arm.Fv / arm.J})


# ---- slow scan: half the difference is friction, half the sum cogging ---------------


def scan(turns: float, V: float = 1.5) -> dict:
    drive = Drive(cogging=0.04)
    rows = int(turns * 2 * np.pi / V / drive.dt)
    way = np.r_[np.full(rows, V), np.zeros(150), np.full(rows, -V), np.zeros(150)]
    return kept(drive.run(speed_loop(way, drive.J), len(way)), "theta")


@pytest.mark.slow
def test_a_scan_gives_friction_and_the_harmonics_of_the_turn():
    test = only(scan(1.3))
    assert test.kind == "slow_scan" and not kinds(scan(0.6))  # less than a turn
    Fc = Drive().Fc + Drive().Fv * 1.5
    check(test, {"Fc": Fc, "cogging.7": 0.04})
    theta, cogging, friction = np.array(test.table.rows).T
    assert np.ptp(theta) > 6.0
    assert np.corrcoef(cogging, np.sin(7 * theta))[0, 1] > 0.99
    assert friction == pytest.approx(Fc, rel=0.05)


# ---- staircase: the friction curve --------------------------------------------------


STEPPED = Drive(vs=0.5, counts=65536)


def stairs(slowest: float) -> dict:
    levels = np.geomspace(slowest, 20.0, 8)
    reference = np.repeat(np.r_[levels, -levels], 350)
    return kept(STEPPED.run(speed_loop(reference, STEPPED.J), len(reference)), "theta")


def test_the_friction_curve():
    test = only(stairs(0.2))
    assert test.kind == "staircase" and len(test.table.rows) == 16
    check(test, {k: getattr(STEPPED, k) for k in ("Fc", "Fv", "Fs", "vs")}, within=0.05)


def test_fast_plateaus_say_nothing_of_static_friction():
    test = only(stairs(2.5))
    assert set(test.values) == {"Fc", "Fv"} and "slow and steady enough for Fs" in test.text
    assert test.values["Fc"].value == pytest.approx(STEPPED.Fc, rel=0.03)


def test_short_plateaus_of_a_slow_log_are_plateaus():
    """At 10 Hz a settled plateau of 2 s has five rows or so."""
    levels = np.repeat(np.r_[1.0:9.0, -1.0:-9.0:-1.0], 20)
    noise = np.random.default_rng(3).normal(0, 1e-3, (2, len(levels)))
    u = np.sign(levels) * STEPPED.Fc + STEPPED.Fv * levels + noise[0]
    test = only({"t": np.arange(len(levels)) / 10, "u": u, "w": levels + noise[1]})
    assert test.kind == "staircase"
    check(test, {"Fc": STEPPED.Fc}, within=0.02)


def test_in_one_direction_friction_and_a_constant_torque_are_one_number():
    levels = np.repeat(np.r_[1.0:9.0], 400)
    w = np.convolve(np.r_[np.zeros(80), levels], np.ones(80) / 80, "valid")[: len(levels)]
    u = STEPPED.J * np.gradient(w, 2e-3) + STEPPED.Fc + STEPPED.Fv * w + 0.1
    test = only({"t": 2e-3 * np.arange(len(w)), "u": u, "w": w})
    assert "Fc" not in test.values and " Fc + constant_torque " in test.text
    both = test.values["Fc + constant_torque"].value
    assert both == pytest.approx(STEPPED.Fc + 0.1, rel=0.01)


# ---- breakaway: the torque at which the axis runs away, not that of the first count --


@pytest.mark.slow
@pytest.mark.parametrize("counts", [4096, 65536])
def test_static_friction_both_ways(counts):
    drive = Drive(counts=counts)
    test = only(kept(drive.run(ramps(0.2, 0.06, 200, drive.dt), 7000), "theta"))
    assert test.kind == "breakaway_ramps"
    check(test, {"Fs_forward": drive.Fs, "Fs_backward": drive.Fs})
    assert {row[1] for row in test.table.rows} == {"forward", "backward"}
    assert np.all(np.abs([row[0] for row in test.table.rows]) < 0.2)


# ---- what is no bench test, and what is said of one ---------------------------------


def follows(drive: Drive):
    t = drive.dt * np.arange(5000)
    w = 2.0 * np.sin(2 * np.pi * 0.3 * t) + np.sin(2 * np.pi * 0.83 * t + 1)
    return speed_loop(w, drive.J)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("torque", "rows", "kind"),
    [
        (follows(Drive()), 5000, ""),
        (lambda k, theta, w: 0.4 * np.sin(2 * np.pi * 0.2 * k * Drive().dt), 4000, ""),
        (lambda k, theta, w: 0.5 * np.sin(0.02 * k) * np.exp(-k / 1500), 4000, "free_swing"),
        (lambda k, theta, w: 0.4 * (2 * np.sin(0.01 * k) - w), 3000, "steps_and_pulses"),
    ],
    ids=["an ordinary log", "a slow sine", "a driven oscillation", "a loop that follows"],
)
def test_what_is_no_bench_test_gets_no_line(torque, rows, kind):
    plain = lg.balance(kept(Drive().run(torque, rows), "theta"))
    found = [test.kind for test in plain.bench_tests]
    assert kind not in found if kind else found == []
    assert kind or "bench_tests" not in plain.summary()


def test_the_line_is_the_first_of_the_plain_answer_and_is_in_json():
    plain = lg.balance(kept(Drive().run(held([0.5, 0.0, -0.5, 0.0], 150), 2400), "theta"))
    assert "coast-downs: Fc/J" in plain_text(plain).splitlines()[1]
    made = json.loads(plain.to_json())["bench_tests"]
    assert [test["kind"] for test in made] == ["coast_down", "steps_and_pulses"]
    assert set(made[1]["values"]) == {"J", "Fc", "Fv"}
    assert all(low < high for low, high in (v["ci95"] for v in made[1]["values"].values()))


@pytest.mark.parametrize("seed", range(6))
def test_no_log_stops_it(seed):
    rng = np.random.default_rng(seed)
    n = int(rng.integers(5, 400))
    signals = [rng.normal(size=n), np.zeros(n), np.cumsum(rng.normal(size=n)), 1e9 * np.ones(n)]
    u, x = (signals[i].copy() for i in rng.integers(0, 4, 2))
    x[rng.integers(0, n, 3)] = np.nan
    lg.balance({"t": 1e-3 * np.arange(n), "u": u, ("theta", "w")[seed % 2]: x})

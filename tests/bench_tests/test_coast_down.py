"""Without torque the fall of the speed gives friction over inertia, and friction with J."""

from __future__ import annotations

import numpy as np
import pytest

import lugrectl as lg

from ..drives.bench import Drive, kept, stale

DRIVE = Drive(Fs=0.15)
PER = {"Fc/J": DRIVE.Fc / DRIVE.J, "Fv/J": DRIVE.Fv / DRIVE.J}


def coast(v: float, rows: int = 900) -> dict:
    return DRIVE.run(lambda k, theta, w: 0.0, rows, v=v)


def check(test, truth: dict) -> None:
    for name, right in truth.items():
        found = test.values[name]
        assert found.may_be(right) and abs(found.value / right - 1) < 0.03, name


def test_friction_with_and_without_inertia():
    logs = [kept(coast(v), "theta") for v in (40.0, -25.0)]
    (test,) = lg.balance(logs).bench_tests
    check(test, PER)
    (test,) = lg.balance(logs, {"J": DRIVE.J}).bench_tests
    check(test, PER | {"Fc": DRIVE.Fc, "Fv": DRIVE.Fv})


def test_a_speed_alone_that_is_noisy_or_stale():
    log, rng = coast(40.0), np.random.default_rng(1)
    noisy = {**kept(log), "w": log["w"] + rng.normal(0, 0.05, len(log["w"]))}
    for one in (noisy, {**kept(log), "w": stale(log)}):
        (test,) = lg.balance(one).bench_tests
        check(test, PER)


def test_friction_that_falls_with_speed_is_not_taken_for_coulomb():
    drive = Drive(Fs=0.25, vs=1.0)
    log = drive.run(lambda k, theta, w: 0.0, 900, v=40.0)
    (test,) = lg.balance(kept(log, "theta")).bench_tests
    check(test, PER)


def test_a_load_that_hangs_down_is_not_taken_for_friction():
    drive = Drive(Fs=0.15, gravity=0.04)
    log = drive.run(lambda k, theta, w: 0.0, 900, v=40.0)
    (test,) = lg.balance(kept(log, "theta")).bench_tests
    check(test, PER)


@pytest.mark.parametrize("rate", [-0.3, 1.0])
def test_what_does_not_brake_is_no_coast(rate):
    """A speed that falls as exp(-t), or more steeply than friction can: no value is found."""
    t = 2e-3 * np.arange(1500)
    w = 30 * np.exp(-t) if rate > 0 else 30 * np.cos(np.minimum(t, 1.5))
    tests = lg.balance({"t": t, "u": 0 * t, "w": w}).bench_tests
    assert not any(test.values["Fc/J"].value > 1.0 for test in tests)

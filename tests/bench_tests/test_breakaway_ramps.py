"""Fs is the torque at which the axis runs away, not that of the first count nor a later one."""

from __future__ import annotations

import numpy as np
import pytest

import lugrectl as lg

from ..drives.bench import Drive, kept


def ramps(rate: float, travel: float, pause: int, dt: float):
    """The torque rises until the axis has moved so far, is 0 for a while, then rises back."""
    now = {"row": 0, "from": 0.0, "side": 1.0, "off": False}

    def torque(k: int, theta: float, w: float) -> float:
        if not now["off"] and abs(theta - now["from"]) > travel:
            now.update(off=True, row=k)
        if now["off"] and k - now["row"] > pause:
            now.update({"off": False, "row": k, "from": theta, "side": -now["side"]})
        return 0.0 if now["off"] else now["side"] * rate * (k - now["row"]) * dt

    return torque


@pytest.mark.parametrize("counts", [4096, 65536])
def test_static_friction_both_ways(counts):
    drive = Drive(counts=counts)
    log = drive.run(ramps(0.2, 0.06, 200, drive.dt), 7000)
    (test,) = lg.balance(kept(log, "theta")).bench_tests
    assert test.kind == "breakaway_ramps"
    for way in ("Fs_forward", "Fs_backward"):
        found = test.values[way]
        assert found.may_be(drive.Fs) and abs(found.value / drive.Fs - 1) < 0.03
    assert {row[1] for row in test.table.rows} == {"forward", "backward"}
    assert np.all(np.abs([row[0] for row in test.table.rows]) < 0.2)


def test_a_slow_sine_is_no_ramp():
    drive = Drive()
    log = drive.run(lambda k, theta, w: 0.4 * np.sin(2 * np.pi * 0.2 * k * drive.dt), 4000)
    assert not lg.balance(kept(log, "theta")).bench_tests

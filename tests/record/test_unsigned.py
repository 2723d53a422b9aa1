"""Registers that hold signed numbers as unsigned ones, and torques that say nothing of a drive."""

import numpy as np

from lugrectl.record import read_log
from lugrectl.record.columns.raw_numbers import signed


def test_an_unsigned_register_is_read_with_its_sign():
    true = np.array([0.0, 5.0, -1.0, -300.0, 12.0, np.nan])
    made, said = signed("u", np.where(true < 0, true + 65536, true))
    np.testing.assert_array_equal(made, true)
    assert "16 bit" in said[0] and "32767" in said[0]


def test_large_numbers_of_one_sign_and_angles_stay_as_they_are():
    rows = np.array([60000.0, 60010.0, 60020.0])
    for role, x in (("u", rows), ("theta", np.append(rows, 3.0)), ("u", rows - 0.5)):
        made, said = signed(role, x)
        assert made is x and not said


def test_a_log_says_that_its_torque_was_unsigned():
    t = np.arange(200) * 0.01
    u = np.round(300 * np.sin(7 * t)) % 65536
    log = read_log({"t": t, "theta": np.sin(7 * t), "u": u}, scale={"u": 0.01})
    assert np.nanmin(log.channels["u"]) < -2.9 and np.nanmax(log.channels["u"]) < 3.1
    assert any("unsigned" in message for message in log.messages)

"""The rough balance that shows where a torque was not read."""

from __future__ import annotations

import numpy as np

from lugrectl.record import read_log
from lugrectl.record.samples import needed_torque
from lugrectl.record.samples.needed_torque import needed
from lugrectl.record.samples.usable import usable

DT, ROWS, START = 3.3e-3, 200, 49


def one_way():
    """A wheel that starts and goes on in one direction; its speed has noise."""
    t = DT * np.arange(ROWS)
    u = np.where(t < DT * START, 0.0, 60.0 + 25.0 * np.sin(9.0 * (t - DT * START)))
    w = np.zeros(ROWS)
    for k in range(ROWS - 1):
        drive = u[k] - 0.95 * w[k] - (32.0 if w[k] > 0 or u[k] > 32.0 else u[k])
        w[k + 1] = max(w[k] + drive / 0.16 * DT, 0.0)
    noise = 0.3 * np.random.default_rng(1).standard_normal(ROWS)
    return {"t": t, "u": u, "w": w + noise * (w > 0)}


def test_a_drive_that_never_turns_back_needs_about_the_torque_that_was_recorded():
    """In one direction Coulomb friction and a constant are one: a start does not separate them."""
    log = one_way()
    unknown = (np.arange(ROWS) >= START) & (np.arange(ROWS) < START + 14)
    fit = needed(usable(read_log(log)), unknown)
    assert fit is not None
    missing = np.abs(fit.missing(log["u"]))
    assert np.nanmax(missing) < np.ptp(log["u"])
    assert np.nanmax(missing[fit.moving]) < 0.1 * np.ptp(log["u"])


def test_stretches_of_a_long_log_choose_the_width_that_the_whole_log_chooses(monkeypatch):
    t = 1e-3 * np.arange(60_000)
    w = 8.0 * np.sin(3.0 * t) + 5.0 * np.sin(7.7 * t)
    u = 0.02 * np.gradient(w, t) + 0.3 * np.sign(w) + 0.01 * w
    random = np.random.default_rng(0)
    log = {"t": t, "u": u, "w": w + 0.05 * random.standard_normal(len(t))}
    log = usable(read_log(log))
    whole = needed(log)
    monkeypatch.setattr(needed_torque, "_ENOUGH", 10_000)
    some = needed(log)
    assert some.width == whole.width > 4
    np.testing.assert_array_equal(some.torque, whole.torque)

"""Rows are left out only where the motion contradicts them: rests, peaks and reversals stay."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

import lugrectl as lg
from lugrectl.record import read_log
from lugrectl.record.samples.needed_torque import needed
from lugrectl.record.samples.usable import usable

from ..drives.bench import draw

DIFFERENCE = {"rate": 1000.0, "speed": "difference", "window": 10}


@cache
def plain(kind, seed, **sensing):
    """The plain answer of a drawn bench test, and what was said of rows left out."""
    drawn = draw(seed, kind, **sensing)
    found = lg.balance([dict(run) for run in (drawn.record, *drawn.more)])
    return drawn, found, [s for s in (*found.reading, *found.notes) if "left out" in s]


@pytest.mark.parametrize("seed", [3, 6])
def test_rests_without_torque_and_peaks_at_breakaway_stay(seed):
    """The balance knows ramps and coasts of some rows only: it extrapolates to the others."""
    _, _, said = plain("breakaway_ramps", seed)
    assert not [s for s in said if s.startswith("u ")]


def test_the_torque_of_a_reversal_stays_and_shows_the_inertia():
    drawn, found, said = plain("slow_scan", 5, **DIFFERENCE)
    assert not [s for s in said if s.startswith("u ")]
    J = found.parameters.get("J") or found.uncertain.get("J")
    assert J is None or J.may_be(drawn.model["plant"]["J"])


def test_a_lag_of_w_is_told_by_changes_of_speed():
    """A difference over 10 ms, at a constant speed but for two reversals: late by half of that."""
    _, found, _ = plain("slow_scan", 5, **DIFFERENCE)
    assert found.parameters["w_lag"].value == pytest.approx(4.5e-3, abs=1e-3)


def test_a_speed_that_keeps_its_last_value_is_left_out_to_the_end_of_the_log():
    """Pulses and coasts of J 0.005, Fc 0.4, Fv 0.01; below 2 rad/s the speed is not renewed."""
    t, dt = 4e-3 * np.arange(6000), 4e-3
    u = np.select([t % 8 < 2, (t % 8 >= 4) & (t % 8 < 6)], [0.55, -0.58], 0.0)
    w = np.zeros(len(t))
    for k in range(len(t) - 1):
        v, fine = w[k], dt / 40
        for _ in range(40):
            rests = v == 0 and abs(u[k]) < 0.4
            a = 0.0 if rests else (u[k] - 0.4 * np.sign(v or u[k]) - 0.01 * v) / 0.005
            v = 0.0 if v * (v + fine * a) < 0 else v + fine * a
        w[k + 1] = v
    kept = w.copy()
    for k in range(1, len(t)):
        kept[k] = w[k] if abs(w[k]) > 2 else kept[k - 1]
    found = lg.balance({"t": t, "u": u, "w": np.round(kept, 5)})
    for key, value in (("J", 0.005), ("Fc", 0.4), ("Fv", 0.01)):
        assert found.parameters[key].value == pytest.approx(value, rel=0.02)


def test_a_drive_that_never_turns_back_needs_about_the_torque_that_was_recorded():
    """In one direction Coulomb friction and a constant are one: a start does not separate them."""
    dt, start, rows = 3.3e-3, 49, np.arange(200)
    u = np.where(rows < start, 0.0, 60.0 + 25.0 * np.sin(9.0 * dt * (rows - start)))
    w = np.zeros(200)
    for k in range(199):
        drive = u[k] - 0.95 * w[k] - (32.0 if w[k] > 0 or u[k] > 32.0 else u[k])
        w[k + 1] = max(w[k] + drive / 0.16 * dt, 0.0)
    w += 0.3 * np.random.default_rng(1).standard_normal(200) * (w > 0)
    log = read_log({"t": dt * rows, "u": u, "w": w})
    fit = needed(usable(log), (rows >= start) & (rows < start + 14))
    missing = np.abs(fit.missing(u))
    assert np.nanmax(missing) < np.ptp(u) and np.nanmax(missing[fit.moving]) < 0.1 * np.ptp(u)

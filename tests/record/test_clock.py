"""Stamps are data: wrapped timers, wild stamps, restarts, jitter, lost rows and bursts."""

from __future__ import annotations

import numpy as np
import pytest

from lugrectl.record import read_log, read_record, stretches

from ..cases.damaged_drive import columns, seen, sound


@pytest.mark.slow
@pytest.mark.parametrize("row", [2, 700, 3001, 5998])
@pytest.mark.parametrize("value", [0.0, -5.0, 1e6, np.nan, 1e300])
def test_one_row_without_a_true_time_is_left_out(row, value):
    log = columns("u", "theta")
    log["t"][row] = value
    found, said = seen(log)
    (sentence,) = said
    assert sentence.startswith("t ") and "left out" in sentence
    assert not 0 <= value < 1e30 or f"row {row}" in sentence
    assert len(found) == 1 and found[0].ok.all() and len(found[0].t) >= 5999
    at = np.rint(found[0].t * 500).astype(int)
    np.testing.assert_allclose(found[0].theta, sound()["theta"][at], atol=2e-2)
    assert read_record(log).gaps == ()


@pytest.mark.parametrize("unit, bits", [("us", 32), ("us", 16), ("ms", 16), ("ms", 8), ("us", 24)])
def test_a_timer_that_wraps_is_unwrapped(unit, bits):
    log = columns("u", "theta")
    scale, period = {"us": 1e6, "ms": 1e3}[unit], 2.0**bits
    ticks = np.round(log["t"] * scale + period - 3e-3 * scale)
    log["t"] = ticks % period
    wraps = int((np.diff(log["t"]) < 0).sum())
    found, said = seen(log, units={"t": unit})
    (sentence,) = said
    assert f"t wraps by {period / scale:.10g} s" in sentence and "unwrapped" in sentence
    assert wraps == 1 or f"{wraps - 1} times more" in sentence
    assert len(found) == 1 and len(found[0].t) == 6000 and found[0].dt == pytest.approx(2e-3)


@pytest.mark.parametrize("cut", [2000, 3500])
@pytest.mark.parametrize("roles", [("u", "theta"), ("u", "w")])
def test_a_clock_that_starts_again_begins_another_run(cut, roles):
    log, other = columns(*roles), columns(*roles, seed=2)
    log = {k: np.r_[log[k][:cut], other[k][: 5000 - cut]] for k in log}
    found, said = seen(log)
    assert any(f"Time starts again at row {cut}" in s for s in said)
    assert [len(s.t) for s in found] == [cut, 5000 - cut]
    record = read_record(log)
    assert record.gaps == (cut,) and (np.diff(record.t) > 0).all()


@pytest.mark.parametrize("roles", [("u", "theta"), ("u", "w")])
def test_even_samples_that_were_stamped_late_keep_an_even_clock(roles):
    rng = np.random.default_rng(8)
    log = columns(*roles, counts=1_000_000)
    if "w" in roles:
        log["w"] = np.gradient(sound(counts=1_000_000)["theta"], 2e-3)
    log["t"] = np.maximum.accumulate(log["t"] + rng.exponential(8e-4, 6000)) + 1e-7 * log["t"]
    found, said = seen(log)
    assert any("even clock was used" in s for s in said)
    s = found[0]
    assert np.std(s.t - (s.t[0] + s.dt * np.arange(len(s.t)))) < 1e-9
    true = log[roles[1]][: len(s.t)]
    off = getattr(s, roles[1]) - true
    assert np.std(off) < 0.03 * np.std(true)


def test_stamps_rounded_to_more_than_a_row_are_an_even_grid():
    log = columns("u", "theta")
    log["t"] = np.floor(log["t"] / 0.01) * 0.01
    found, said = seen(log)
    assert len(said) == 1 and "rounded" in said[0]
    assert found[0].dt == pytest.approx(2e-3, rel=1e-4) and len(found[0].t) > 5990


def test_lost_rows_with_exact_stamps_keep_the_stamps():
    kept = np.sort(np.random.default_rng(1).choice(6000, 5400, replace=False))
    log = {role: x[kept] for role, x in columns("u", "theta").items()}
    found, _ = seen(log)
    for s in found:
        assert s.dt == pytest.approx(2e-3)
        np.testing.assert_allclose(s.t * 500, np.rint(s.t * 500), atol=1e-6)
        at = np.rint(s.t * 500).astype(int)
        held = np.isin(at, kept)
        np.testing.assert_allclose(s.theta[held], sound()["theta"][at[held]])
        beside = np.isin(at - 1, kept) & np.isin(at + 1, kept)
        inner = slice(2, -2)
        assert s.ok[inner][(held | beside)[inner]].all()
        long_lost = ~held & ~np.isin(at - 1, kept) & ~np.isin(at + 1, kept)
        assert not s.ok[inner][long_lost[inner]].any()


def test_what_is_said_of_several_logs_names_the_log():
    bad = columns("u", "theta")
    bad["u"][77] = 9.0
    _, said = stretches([read_log(columns("u", "theta")), read_log(bad)])
    assert said == ["the dict of arrays: u at row 77 is 9 N m, far off its neighbours: left out."]


def test_pieces_of_a_dozen_rows_are_kept():
    log = columns("u", "theta", rate=1000.0)
    log["u"][[*range(300, 310), *range(322, 340)]] = np.nan
    record = read_record(log)
    assert [s.stop - s.start for s in record.segments()] == [300, 12, 5660]


def test_a_log_that_is_newest_first_is_read_from_its_end():
    """As historians export it; its other faults are named at their own rows."""
    log = columns("u", "theta")
    known = read_record(log)
    turned = read_record({k: x[::-1] for k, x in log.items()})
    for role in ("t", "u", "theta"):
        np.testing.assert_allclose(getattr(turned, role), getattr(known, role), atol=1e-12)
    (said,) = turned.messages
    assert "from the last to the first" in said


def test_rows_lost_one_by_one_are_no_rounded_stamps():
    t = 1e-3 * np.arange(4000)
    kept = np.arange(4000) % 7 != 3
    log = {"t": t, "u": np.sin(9.0 * t), "theta": np.sin(5.0 * t) + 0.2 * np.sin(23.0 * t)}
    found = read_record({k: x[kept] for k, x in log.items()})
    assert not any("rounded" in m for m in found.messages)
    assert found.dt == pytest.approx(1e-3)


# ---- a logger that writes in bursts -------------------------------------------------


def bursts():
    """Rows of about 2 ms, with a pause of about 12 ms after every eighth."""
    rng = np.random.default_rng(0)
    steps = np.where(np.arange(400) % 8, 2, 12) + rng.integers(0, 2, 400)
    t = 1e-3 * np.cumsum(steps)
    return {"t": t, "u": np.cos(6.0 * t), "w": np.sin(6.0 * t)}


def test_a_pause_of_a_logger_is_no_loss():
    (found,), _ = stretches([read_log(bursts())])
    assert found.ok.all()
    assert np.abs(found.w - np.sin(6.0 * found.t)).max() < 1e-3


def test_the_step_of_an_encoder_is_that_of_the_rows_as_recorded():
    """Between uneven stamps a position lies on no count any more; its rounding is noise still."""
    t = np.cumsum(np.random.default_rng(1).uniform(6e-4, 1.4e-3, 3000))
    count = 2 * np.pi / 4096
    log = {"t": t, "u": np.cos(t), "theta": count * np.round(3.0 * np.sin(2.0 * t) / count)}
    (found,), _ = stretches([read_log(log)])
    assert found.count == pytest.approx(count)
    assert np.std(found.theta - count * np.round(found.theta / count)) > 0.1 * count

"""Positions without jumps: angles and counters of any period, pasted runs; runs made alike."""

import pickle

import numpy as np
import pytest

from lugrectl.diagnosis.asked import Asked
from lugrectl.record import Record, pooled, read_log, read_record

from ..cases.damaged_drive import columns, seen


def same_motion(found, true, atol=1e-6):
    for s in found:
        at = np.rint(s.t * 500).astype(int)
        off = s.theta - true[at]
        np.testing.assert_allclose(off, off[0], atol=atol)


@pytest.mark.parametrize("bits, count", [(16, 2 * np.pi / 10_000), (12, 0.0015), (8, 0.004)])
@pytest.mark.parametrize("motion", ["rotary", "linear"])
@pytest.mark.parametrize("signed", [False, True])
def test_a_counter_that_wraps_is_unwrapped(bits, count, motion, signed):
    """A turn has 10 000 counts, the register 2**bits: its period is no turn."""
    log, period = columns("u", "theta"), 2.0**bits
    counts = np.round((log["theta"] * 4 + 7 * log["t"]) / count) + 0.4 * period
    true = counts * count
    log["theta"] = (counts + signed * period / 2) % period - signed * period / 2
    wraps = int((np.abs(np.diff(log["theta"])) > period / 2).sum())
    found, said = seen(log, scale={"theta": count}, motion=motion)
    assert wraps > 0 and len(found) == 1 and found[0].ok.all()
    times = "once" if wraps == 1 else f"{wraps} times"
    assert f"theta jumps by {period * count:.6g} {times}: unwrapped." in said
    same_motion(found, true)


@pytest.mark.parametrize("period", [2 * np.pi, 4 * np.pi, 7.3])
def test_an_angle_of_any_period_is_unwrapped(period):
    log = columns("u", "theta")
    true = log["theta"] * 3 + 5 * log["t"]
    log["theta"] = true % period
    found, said = seen(log)
    assert len(said) == 1 and "unwrapped" in said[0] and len(found) == 1
    same_motion(found, true)


def test_a_record_keeps_the_log_that_it_was_read_from():
    log = columns("u", "theta")
    log["u"][50] = 9.0
    record = read_record(log)
    assert record.log.channels["u"][50] == 9.0 and record.u[50] < 1.0
    again = pickle.loads(pickle.dumps(record))
    assert again.log.channels["u"][50] == 9.0 and again.log.where(50) == "row 50"
    assert "log" not in repr(record)


def test_a_record_that_was_changed_after_reading_is_its_own_log():
    from dataclasses import replace

    record = read_record(columns("u", "theta"))
    louder = replace(record, u=1.1 * record.u)
    np.testing.assert_array_equal(louder.log.channels["u"], louder.u)
    assert record.with_messages("One.").log is record.log


def test_lines_of_a_file_survive_a_pickle(tmp_path):
    text = "t,u,theta\n" + "".join(f"{k / 100},{k % 7},{k / 9}\n" for k in range(400))
    lines = text.splitlines()
    for at in (7, 90, 91, 300):
        lines.insert(at, "# remark")
    (tmp_path / "a.csv").write_text("\n".join(lines))
    log = read_log(tmp_path / "a.csv")
    again = pickle.loads(pickle.dumps(log))
    assert [again.where(k) for k in range(400)] == [log.where(k) for k in range(400)]
    assert log.where(0) == "line 2" and log.where(399) == "line 405"


# ---- runs made alike ----------------------------------------------------------------


def run(rate, roles=("u", "theta"), seed=1):
    log = columns(*roles, seed=seed)
    t = np.arange(0, 11.9, 1 / rate)
    made = {role: np.interp(t, log["t"], x) for role, x in log.items() if role != "t"}
    return Record(t, dt=1 / rate, source=f"{rate:g} Hz", **made)


def test_a_channel_that_one_run_lacks_is_left_out_of_all_and_said_once():
    made = pooled([run(500.0, ("u", "w", "theta")), run(500.0), run(500.0, ("u", "w", "theta"))])
    assert all(r.w is None and r.theta is not None for r in made)
    assert [m for r in made for m in r.messages] == ["500 Hz has no w: it is left out in all runs."]


def test_a_folder_stands_for_the_runs_in_it(tmp_path):
    for k in (10, 2, 1):
        np.savez(tmp_path / f"run{k}.npz", **columns("u", "theta", seed=1))
    (tmp_path / "model.toml").write_text("")
    records = Asked.of(tmp_path, {}).records()
    assert [r.source for r in records] == ["run1.npz", "run2.npz", "run10.npz"]

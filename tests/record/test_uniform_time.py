"""Uniform time: what is filled, merged, resampled or cut, and what is refused."""

import re

import numpy as np
import pytest

import lugrectl as lg
from lugrectl.core.errors import Refused
from lugrectl.record import (
    Record,
    consistent,
    long_enough_to_judge,
    read_record,
    refuse_open_time,
)

from ..cases.logs import cell, csv, machine, refused


def test_fewer_than_a_dozen_rows_show_no_motion(tmp_path):
    refused(Refused, csv(tmp_path, keep=slice(11)), "too short", "run.csv", "11 rows")


@pytest.mark.parametrize("keep", [slice(1000, 1199), slice(0, 900)])
def test_a_short_record_is_read_but_not_judged(tmp_path, keep):
    record = read_record(csv(tmp_path, keep=keep))
    assert record.samples == keep.stop - keep.start and record.messages == ()
    with pytest.raises(Refused, match="too short to judge models by simulation"):
        long_enough_to_judge(record)
    assert long_enough_to_judge(read_record(csv(tmp_path))) is None


def test_a_row_out_of_order_is_left_out(tmp_path):
    def swap(lines):
        lines[400], lines[401] = lines[401], lines[400]
        return lines

    record = read_record(csv(tmp_path, change=swap))
    assert record.samples == 3000 and record.dropped == 1 and record.gaps == ()
    assert any("line 402" in m and "left out" in m for m in record.messages)
    commented = csv(tmp_path, change=lambda x: [*swap(x)[:9], "# remark", *x[9:]])
    assert any("line 403" in m for m in read_record(commented).messages)


def test_wrong_time_unit(tmp_path):
    fast = read_record(csv(tmp_path, "t [ms],u,w,theta"))
    log = {role: x for role, x in machine().items() if role != "theta"}  # it would be asked for
    np.savez(tmp_path / "a.npz", **(log | {"t": 1e3 * log["t"]}))
    slow = read_record(tmp_path / "a.npz")
    for record, rate in ((fast, "1e+06 Hz"), (slow, "1 Hz")):
        assert any(f"rate of {rate}" in m and 'units="t=ms"' in m for m in record.messages)
        with pytest.raises(Refused, match=f'{re.escape(rate)}.*units="t=ms"'):
            long_enough_to_judge(record)
    assert read_record(tmp_path / "a.npz", units="t=ms").rate == 1000.0


@pytest.mark.parametrize("mark", ["", "nan", "NaN", "N/A", "inf"])
def test_isolated_missing_samples_are_filled(tmp_path, mark):
    def holes(lines):
        for line in (100, 101, 102, 2000):
            lines = cell(line, 1, mark)(lines)
        return cell(900, 3, mark)(lines)

    log, record = machine(), read_record(csv(tmp_path, change=holes))
    assert record.samples == 3000 and record.dropped == 5
    assert np.all(record.u[98:101] == record.u[97])  # held
    assert record.theta is not None
    assert record.theta[898] == pytest.approx((log["theta"][897] + log["theta"][899]) / 2)
    assert any(m.startswith("u has no number in 4 rows") for m in record.messages)


@pytest.mark.parametrize("column", [0, 1, 2, 3])
def test_a_record_is_cut_where_numbers_are_missing_for_longer(tmp_path, column):
    def hole(lines):
        for line in range(500, 510):
            lines = cell(line, column, "nan")(lines)
        return lines

    record = read_record(csv(tmp_path, change=hole))
    role = ("t", "u", "w", "theta")[column]
    assert record.gaps == (498,) and record.samples == 2990
    assert any(m.startswith(role) and "10 rows" in m for m in record.messages)
    assert column == 0 or any("first at line 500" in m for m in record.messages)


def test_missing_optional_channel_is_left_out(tmp_path):
    log = machine()
    load = np.where(np.arange(3000) < 50, np.nan, 0.1)
    heat = np.where(np.arange(3000) % 100, np.nan, 20.0 + log["t"])
    np.savez(tmp_path / "a.npz", **log, d=load, temperature=heat)
    record = read_record(tmp_path / "a.npz")
    assert record.d is None and any(m.startswith("d has too many") for m in record.messages)
    assert record.temperature is not None
    np.testing.assert_allclose(record.temperature[:2900], 20 + log["t"][:2900], atol=1e-9)
    assert record.dropped == 0


def test_doubled_stamps_are_merged(tmp_path):
    twice = np.sort(np.r_[np.arange(3000), [10, 10, 700]])
    record = read_record(csv(tmp_path, keep=twice))
    assert record.samples == 3000 and record.dropped == 3
    assert any("is repeated in 3 rows" in m for m in record.messages)
    np.testing.assert_allclose(record.w, machine()["w"], rtol=1e-8)


def test_few_lost_rows_are_filled_and_counted(tmp_path):
    keep = np.setdiff1d(np.arange(3000), [50, 51, 1200])
    log, record = machine(), read_record(csv(tmp_path, keep=keep))
    assert record.samples == 3000 and record.dropped == 3 and record.gaps == ()
    np.testing.assert_allclose(record.t, log["t"], atol=1e-9)
    assert record.u[50] == record.u[51] == record.u[49]
    np.testing.assert_allclose(record.theta, log["theta"], atol=1e-5)  # no straight lines


def test_longer_losses_are_gaps(tmp_path):
    keep = np.setdiff1d(np.arange(3000), np.r_[1200:1260, 1265:1305, 2500:2507])
    log, record = machine(), read_record(csv(tmp_path, keep=keep))
    assert record.gaps == (1200, 1200 + 2500 - 1305)
    for part in record.segments():
        np.testing.assert_allclose(np.diff(record.t[part]), 1e-3, rtol=1e-6)
    found = np.searchsorted(log["t"] + 5e-4, record.t)
    np.testing.assert_allclose(record.u, log["u"][found], rtol=1e-8)
    said = next(m for m in record.messages if "2 gaps" in m)
    assert said.startswith("About 112 samples are lost in 2 gaps, the first at t = 1.199 s;")
    assert record.dropped == 5  # the stretch 1260..1264 is too short to be of use


def test_jitter_is_resampled_without_delay(tmp_path):
    """Held torque keeps its time integral; motion is read off where it was measured."""
    rng = np.random.default_rng(3)
    t = np.arange(3000) * 1e-3
    stamps = t + 1e-3 * rng.uniform(-0.04, 0.04, len(t))
    stamps[0] = 0.0
    values = {"u": np.sin(9 * stamps), "w": 7 * np.cos(7 * stamps), "theta": np.sin(7 * stamps)}
    np.savez(tmp_path / "a.npz", t=stamps, **values)
    record = read_record(tmp_path / "a.npz")
    assert any("jitters" in m for m in record.messages) and record.gaps == ()
    np.testing.assert_allclose(np.diff(record.t), record.dt, rtol=1e-6)
    np.testing.assert_allclose(record.theta, np.sin(7 * record.t), atol=1e-9)
    held = np.sum(values["u"][:-1] * np.diff(stamps))
    assert np.sum(record.u[:-1]) * record.dt == pytest.approx(held, abs=2e-3 * 1e-3)
    late = np.mean((record.u - np.sin(9 * record.t)) * np.cos(9 * record.t)) / np.mean(
        9 * np.cos(9 * record.t) ** 2
    )
    assert abs(late) < 2e-6  # seconds; taking the previous value would be 20 times that


def _jittered(n=4000, dt=1e-3):
    rng = np.random.default_rng(6)
    return dt * np.arange(n) + np.r_[0.0, dt * rng.uniform(-0.06, 0.06, n - 1)]


@pytest.mark.parametrize("lost", [True, False], ids=["lost", "jittered"])
def test_interpolated_samples_keep_the_sensors_resolution(tmp_path, lost):
    """A drive that rests, on an encoder: between its counts a spline has any value."""
    t, q = (np.arange(4000) * 1e-3 if lost else _jittered()), 1e-3
    theta = np.round(np.clip(2 * np.sin(3 * t) - 1.5, 0.0, None) / q) * q
    kept = np.ones(4000, dtype=bool)
    kept[50::150] = not lost
    values = {"t": t, "u": np.sin(9 * t), "theta": theta}
    np.savez(tmp_path / "a.npz", **{k: v[kept] for k, v in values.items()})
    record = read_record(tmp_path / "a.npz")
    assert record.resolution["theta"] == pytest.approx(q)


@pytest.mark.parametrize("how", ["jittered", "lost", "repeated", "backwards", "even"])
def test_a_record_of_arrays_is_brought_to_uniform_time_like_a_file(how):
    t = _jittered() if how == "jittered" else np.arange(4000) * 1e-3
    kept = np.insert(np.arange(4000), 77, [77] if how == "repeated" else [])
    kept = np.delete(kept, slice(100, 110) if how == "lost" else slice(0))
    t = t[kept]
    t[300:] -= 0.2 * (how == "backwards")
    log = {"t": t, "u": np.sin(9 * t), "theta": np.sin(7 * t)}
    made, read = consistent(Record(**log)), read_record(log)
    for role, values in read.channels().items():
        np.testing.assert_allclose(made.channels()[role], values, atol=1e-12)
    assert made.dt == pytest.approx(read.dt, rel=1e-9)
    assert (made.gaps, made.dropped) == (read.gaps, read.dropped)
    assert consistent(made).channels()["u"] is made.u
    if how == "backwards":
        assert made.gaps == (300,) and (np.diff(made.t) > 0).all()
        assert any("starts again at row 300" in m for m in made.messages)


def test_stamps_in_single_precision_are_a_grid(tmp_path):
    log = machine()
    np.savez(tmp_path / "a.npz", **(log | {"t": (20 + log["t"]).astype(np.float32)}))
    record = read_record(tmp_path / "a.npz")
    assert record.messages == ()
    np.testing.assert_array_equal(record.u, log["u"])


def test_a_rate_that_no_drive_has_is_not_judged_without_a_unit_of_time():
    """Without w beside theta the rate is all that shows it; a stated unit is believed."""
    slow = {role: x for role, x in machine().items() if role != "w"}
    slow["t"] = 1e3 * slow["t"]
    refused = lg.diagnose(slow, {"J": 0.002})
    assert refused.verdict == "refused"
    assert re.search('t has no unit.*1 Hz.*give units="t=ms", or units="t=s"', refused.reason)
    stated = [
        read_record(slow, **how) for how in ({"units": "t=s"}, {"units": "t=ms"}, {"rate": 1})
    ]
    for record in (*stated, Record(**{role: np.asarray(x) for role, x in slow.items()})):
        refuse_open_time(record.source, record.log.labels, record.dt)

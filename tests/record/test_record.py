"""The Record, its columns and units, and real data where it is at hand."""

import numpy as np
import pytest
import scipy.io

from lugrectl.core.errors import InputError
from lugrectl.record import Record, parse_pairs, read_record
from lugrectl.record.columns.names import parse_unit

from ..cases.logs import DATA, csv, machine, measured, refused

# ---- the Record ---------------------------------------------------------------------


def test_reads_what_was_written(tmp_path):
    log = machine()
    record = read_record(csv(tmp_path, "t [s],u [N m],w [rad/s],theta [rad]"))
    for role, values in log.items():
        np.testing.assert_allclose(getattr(record, role), values, rtol=1e-8, atol=1e-12)
        assert getattr(record, role).dtype == np.float64
    assert record.messages == () and record.gaps == () and record.source == "run.csv"
    assert record.motion == "rotary" and record.dt == 1e-3 and record.r is None
    assert record.summary() == {"samples": 3000, "rate": 1000.0, "duration": 3.0, "dropped": 0}
    assert type(record.summary()["samples"]) is int


def test_record_slices_keep_gaps_in_place():
    t = np.r_[np.arange(10), 50 + np.arange(10), 90 + np.arange(5)] * 0.1
    record = Record(t, u=t, w=t, gaps=(10, 20))
    assert record.dt == pytest.approx(0.1)
    assert record.segments() == [slice(0, 10), slice(10, 20), slice(20, 25)]
    part = record.slice(5, 22)
    assert part.gaps == (5, 15) and part.samples == 17 and record.slice(10, 20).gaps == ()
    np.testing.assert_array_equal(part.u, t[5:22])
    said = record.with_messages("One.", "Two.").with_messages("Two.", "3.").messages
    assert said == ("One.", "Two.", "3.")
    with pytest.raises(AttributeError):
        record.dt = 1.0  # type: ignore[misc]


@pytest.mark.parametrize(
    "wrong",
    [
        {"w": np.zeros(4)},
        {"w": np.r_[np.zeros(4), np.nan]},
        {"w": None},
        {"motion": "sideways"},
        {"dt": -1.0, "t": np.zeros(5)},
    ],
)
def test_record_refuses_arrays_that_are_no_record(wrong):
    good = {"t": np.arange(5.0), "u": np.zeros(5), "w": np.zeros(5)}
    assert Record(**good).samples == 5
    with pytest.raises(InputError):
        Record(**(good | wrong))


# ---- columns, units, scale ----------------------------------------------------------


def test_pairs_of_the_command_line():
    assert parse_pairs("t=time, u=torque", "columns") == {"t": "time", "u": "torque"}
    assert parse_pairs("u=Torque, actual [N m],t=Time", "columns") == {
        "u": "Torque, actual [N m]",
        "t": "Time",
    }
    assert parse_pairs("u=a,w=", "columns") == {"u": "a", "w": ""}
    for text in ("35.15", "=x", "", "u=a,u=b", "thet=x"):
        with pytest.raises(InputError) as caught:
            parse_pairs(text, "columns")
        assert "columns: " in str(caught.value)
    with pytest.raises(InputError, match="did you mean 'theta'"):
        parse_pairs("thet=x", "units")


SI = {  # written down again on purpose: factor to SI of what a user may write
    "ms": 1e-3, "µs": 1e-6, "sec": 1.0, "deg": 0.017453292519943295, "°": 0.017453292519943295,
    "rev": 6.283185307179586, "rpm": 0.10471975511965977, "RPM": 0.10471975511965977,
    "deg/s": 0.017453292519943295, "Nm": 1.0, "N*m": 1.0, "N.m": 1.0, "N·m": 1.0,
    "mNm": 1e-3, "mm": 1e-3, "µm": 1e-6, "mm/s": 1e-3, "N": 1.0, "1/min": 0.10471975511965977,
}  # fmt: skip


@pytest.mark.parametrize("text", SI)
def test_unit_spellings(text):
    unit = parse_unit(text)
    assert unit is not None and unit.factor == pytest.approx(SI[text], rel=1e-12)


# ---- real files ---------------------------------------------------------------------


@measured
@pytest.mark.parametrize("number", range(1, 9))
def test_bench_records_come_in_untouched(number):
    path = DATA / "bench" / f"{number:02d}" / "record.csv"
    raw = np.loadtxt(path, delimiter=",", skiprows=1)
    record = read_record(path)
    assert record.messages == () and record.dropped == 0 and record.rate == 1000.0
    for column, role in enumerate(("t", "u", "theta", "w")):
        np.testing.assert_allclose(getattr(record, role), raw[:, column], atol=1e-12)


@measured
def test_emps_record():
    path = DATA / "emps" / "DATA_EMPS.mat"
    refused(InputError, path, "by its name u is in V", 'scale="u=')
    record = read_record(path, columns="theta=qm,u=vir", units="theta=m", scale="u=35.15")
    raw = scipy.io.loadmat(path)
    assert record.motion == "linear" and record.rate == 1000.0 and record.samples == 24841
    assert record.w is None and record.dropped == 0
    np.testing.assert_array_equal(record.u, 35.15 * raw["vir"].ravel())
    np.testing.assert_array_equal(record.theta, raw["qm"].ravel())
    assert record.messages == ()


@measured
@pytest.mark.parametrize("name", ["start_stop/200.csv", "steady_state/0.096kg/n120.csv"])
def test_screw_drive_exports(name):
    path = DATA / "screw-drive" / name
    refused(InputError, path, "%", 'scale="u=')
    record = read_record(path, scale={"u": 9.84e-5})
    assert record.samples == 500 and record.w is not None and record.dropped == 0
    rpm = np.loadtxt(
        path, delimiter=";", skiprows=path.read_text().split("ms;rpm")[0].count("\n") + 1
    )
    np.testing.assert_allclose(record.w * 30 / np.pi, rpm[:, 1], atol=1e-9)
    assert record.dt == pytest.approx(1e-3 * np.diff(rpm[:, 0]).mean(), rel=1e-9)

"""Reading logs: files written here by hand, every bad input, and real data where it is at hand."""

import functools
import os
import re
import time
from pathlib import Path

import numpy as np
import pytest
import scipy.io
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from lugrectl.errors import InputError, Refused
from lugrectl.readers import read_table
from lugrectl.record import Record, parse_pairs, read_record
from lugrectl.units import UNITS, parse_unit

DATA = Path(os.environ.get("LUGRECTL_DATA", Path(__file__).parents[2] / "shared" / "data"))
measured = pytest.mark.skipif(not DATA.is_dir(), reason=f"no measured data at {DATA}")


@functools.cache
def machine(n=3000, dt=1e-3, J=2e-3, Fc=0.2, Fv=0.02, seed=1):
    """A mass with Coulomb and viscous friction, by explicit Euler; torque held over dt."""
    rng = np.random.default_rng(seed)
    t = np.arange(n) * dt
    u = 0.6 * np.sin(2 * np.pi * 0.7 * t) + 0.3 * np.sin(2 * np.pi * 2.3 * t + 1.0)
    u += 0.1 * np.sin(2 * np.pi * 7.1 * t)
    w, theta = np.zeros(n), np.zeros(n)
    speed = angle = 0.0
    for k in range(n):
        w[k], theta[k] = speed, angle
        for _ in range(10):
            speed += dt / 10 / J * (u[k] - Fc * np.tanh(speed / 0.05) - Fv * speed)
            angle += dt / 10 * speed
    w += 1e-3 * rng.standard_normal(n)
    return {"t": t, "u": u, "w": w, "theta": np.round(theta / 1e-5) * 1e-5}


def rows(columns, delimiter=",", form="{:.9g}"):
    return "".join(
        delimiter.join(form.format(v) for v in row) + "\n" for row in zip(*columns, strict=True)
    )


def write(path, text, encoding="utf-8"):
    path.write_bytes(text.encode(encoding))
    return path


def csv(tmp_path, head="t,u,w,theta", change=None, keep=None, name="run.csv"):
    """Write the machine's log; ``change`` maps lines of text to lines, ``keep`` selects rows."""
    log = machine()
    keep = slice(None) if keep is None else keep
    lines = [head, *rows([log[r][keep] for r in ("t", "u", "w", "theta")]).splitlines()]
    return write(tmp_path / name, "\n".join(change(lines) if change else lines) + "\n")


def cell(line, column, text):
    """Return a change that puts text into one cell of line ``line`` (from 1)."""

    def change(lines):
        cells = lines[line - 1].split(",")
        cells[column] = text
        lines[line - 1] = ",".join(cells)
        return lines

    return change


def refused(kind, path, *words, **options):
    with pytest.raises(kind) as caught:
        read_record(path, **options)
    sentence = str(caught.value)
    for word in words:
        assert word in sentence, sentence
    assert "\n" not in sentence and sentence.endswith(".")
    assert caught.value.exit_code == (2 if kind is InputError else 3)
    return sentence


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
    assert part.gaps == (5, 15) and part.samples == 17
    np.testing.assert_array_equal(part.u, t[5:22])
    assert record.slice(10, 20).gaps == ()
    assert record.with_messages("One.", "Two.").with_messages("3.").messages == (
        "One.",
        "Two.",
        "3.",
    )
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


# ---- text files ---------------------------------------------------------------------


@pytest.mark.parametrize("delimiter", [",", ";", "\t"])
@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "latin-1"])
def test_delimiters_and_encodings(tmp_path, delimiter, encoding):
    log = machine()
    head = delimiter.join(["t [s]", "u [N·m]", "theta [rad]"])
    body = rows([log["t"], log["u"], log["theta"]], delimiter)
    path = write(tmp_path / "a.txt", f"{head}\r\n" + body + "\n\n", encoding)
    record = read_record(path)
    assert record.w is None and record.theta is not None
    np.testing.assert_allclose(record.theta, log["theta"], atol=1e-12)


@pytest.mark.parametrize("delimiter", [";", "\t"])
def test_decimal_commas_are_read_and_said(tmp_path, delimiter):
    log = machine()
    body = rows([log["t"], log["u"], log["theta"]], delimiter).replace(".", ",")
    record = read_record(
        write(tmp_path / "a.csv", delimiter.join(["t", "u", "theta"]) + "\n" + body)
    )
    np.testing.assert_allclose(record.u, log["u"], rtol=1e-8)
    assert any("Decimal commas" in m for m in record.messages)


def test_decimal_commas_between_commas_are_not_guessed(tmp_path):
    log = machine()
    body = rows([log["t"], log["u"], log["theta"]], ",", "{:.6f}").replace(".", ",")
    refused(InputError, write(tmp_path / "a.csv", "t,u,theta\n" + body), "decimal commas", "line 2")


def test_points_and_commas_together_are_not_guessed(tmp_path):
    log = machine()
    lines = rows([log["t"], log["u"], log["theta"]], ";", "{:.6f}").splitlines()
    lines[50:] = [line.replace(".", ",") for line in lines[50:]]
    path = write(tmp_path / "a.csv", "t;u;theta\n" + "\n".join(lines))
    refused(InputError, path, "line 52", "decimal")


def test_recorder_export_with_preamble_and_units_line(tmp_path):
    log = machine()
    head = (
        "Date:;2020-07-08 21:54:05\nIndex:;0x30D3;0x30D2;0x0000;0x0000\nMax. samples:;500\n"
        "Scale:;0;True;100.000;0.500;-400.500;399.500\n"
        "# remark\n"
        ";Velocity actual value averaged;Torque actual value averaged\nms;rpm;%\n"
    )
    body = rows([1e3 * log["t"], log["w"] * 30 / np.pi, log["u"] / 0.01], ";")
    path = write(tmp_path / "a.csv", head + body)
    refused(InputError, path, "%", "--scale u=")
    record = read_record(path, scale={"u": 0.01})
    np.testing.assert_allclose(record.t, log["t"], atol=1e-12)
    np.testing.assert_allclose(record.w, log["w"], rtol=1e-7, atol=1e-9)
    np.testing.assert_allclose(record.u, log["u"], rtol=1e-7)
    assert any("usual names" in m and "Torque actual" in m for m in record.messages)
    assert any("0.01 times" in m for m in record.messages)


def test_comments_blank_lines_quotes_and_unused_text(tmp_path):
    log = machine()
    lines = rows([log["t"], log["u"], log["theta"]]).splitlines()
    lines = [f'"{i}",{line},ok' for i, line in enumerate(lines)]
    lines.insert(100, "# operator left the room")
    lines.insert(200, "")
    path = write(tmp_path / "a.csv", "n,t (s),u (N m),theta (rad),state\n" + "\n".join(lines))
    record = read_record(path)
    np.testing.assert_allclose(record.u, log["u"], rtol=1e-8)


def test_header_in_a_comment(tmp_path):
    log = machine()
    path = tmp_path / "a.csv"
    table = np.column_stack([log["t"], log["u"], log["w"]])
    np.savetxt(path, table, delimiter=",", header="saved by hand\nt [s],u [mN m],w [rad/s]")
    np.testing.assert_allclose(read_record(path).u, 1e-3 * log["u"], rtol=1e-12)


def test_a_last_line_cut_off_is_left_out(tmp_path):
    path = csv(tmp_path, change=lambda lines: [*lines[:-1], "2.999,0.1"])
    record = read_record(path)
    assert record.samples == 2999 and any("cut off" in m for m in record.messages)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (cell(2, 1, "abc"), ["line 2", "'u'", "'abc'"]),
        (cell(1500, 3, "1.2.3"), ["line 1500", "'theta'"]),
        (cell(3001, 2, "12_3"), ["line 3001", "'w'"]),
        (lambda x: [*x[:700], "1,2,3,4,5", *x[700:]], ["line 701", "5 cells", "4 columns"]),
        (lambda x: x[1:], ["no header", "line 1"]),
        (lambda x: x[:1], ["no"]),
        (lambda x: [line.split(",")[1] for line in x], ["one column"]),
        (lambda x: ["t,u,u,theta", *x[1:]], ["u could be any"]),
        (lambda x: ["t,u", *x[1:]], ["4 cells", "2 columns"]),
        (lambda x: ["hello", "world"], ["not a table"]),
    ],
)
def test_broken_text_is_named(tmp_path, change, words):
    refused(InputError, csv(tmp_path, change=change), "run.csv", *words)


def test_files_that_are_none(tmp_path):
    refused(InputError, tmp_path / "absent.csv", "no such file")
    refused(InputError, tmp_path, "directory")
    refused(InputError, write(tmp_path / "e.csv", ""), "empty")
    refused(InputError, write(tmp_path / "f.csv", "\n \n\n"), "empty")
    refused(InputError, write(tmp_path / "g.csv", "# only a remark\n"), "empty")
    junk = tmp_path / "junk.csv"
    junk.write_bytes(bytes(range(256)) * 8)
    refused(InputError, junk, "neither text")
    for name, start in (("a.mat", b"MATLAB 5.0 MAT-file"), ("b.npz", b"PK\x03\x04")):
        (tmp_path / name).write_bytes(start + b"\x01\x02 broken" * 40)
        refused(InputError, tmp_path / name, "not a readable")


def test_long_logs_load_at_speed(tmp_path):
    log, reps = machine(), 100
    t = np.arange(3000 * reps) * 1e-3
    one = rows([log["u"], log["theta"]]).splitlines() * reps
    text = "t,u,theta\n" + "\n".join(f"{a:.3f},{b}" for a, b in zip(t, one, strict=True))
    path = write(tmp_path / "big.csv", text)
    start = time.perf_counter()
    table = read_table(path)
    columns, _ = table.load([0, 1, 2])
    assert len(columns) == 3 and len(columns[0]) == 300_000
    assert time.perf_counter() - start < 3.0  # a million rows in 10 s on a slow machine


# ---- MAT and NPZ --------------------------------------------------------------------


def test_mat_columns_scalars_and_structs(tmp_path):
    log = machine()
    path = tmp_path / "a.mat"
    scipy.io.savemat(path, {k: v[:, None] for k, v in log.items()} | {"kp": 3.0, "name": "x"})
    np.testing.assert_array_equal(read_record(path).u, log["u"])
    scipy.io.savemat(path, {"log": {"t": log["t"], "torque": log["u"], "pos": log["theta"]}})
    record = read_record(path, columns="t=log.t,u=log.torque,theta=log.pos")
    np.testing.assert_array_equal(record.theta, log["theta"])
    scipy.io.savemat(path, {"t": log["t"], "u": log["u"][:-1], "w": log["w"]})
    refused(InputError, path, "differ in length", "u 2999")
    scipy.io.savemat(path, {"a": 1.0, "b": "text"})
    refused(InputError, path, "at least two")


def test_npz(tmp_path):
    log = machine()
    np.savez(tmp_path / "a.npz", **log)
    np.testing.assert_array_equal(read_record(tmp_path / "a.npz").w, log["w"])


@pytest.mark.parametrize(
    ("name", "start", "module"),
    [("a.mat", b"MATLAB 7.3 MAT-file", "h5py"), ("a.parquet", b"PAR1", "pyarrow.parquet")],
)
def test_extra_formats_name_their_extra(tmp_path, monkeypatch, name, start, module):
    monkeypatch.setitem(__import__("sys").modules, module, None)
    (tmp_path / name).write_bytes(start + b" " * 600)
    refused(InputError, tmp_path / name, 'pip install "lugrectl[files]"', name)


# ---- columns, units, scale ----------------------------------------------------------


def test_pairs_of_the_command_line():
    assert parse_pairs("t=time, u=torque", "columns") == {"t": "time", "u": "torque"}
    assert parse_pairs("u=Torque, actual [N m],t=Time", "columns") == {
        "u": "Torque, actual [N m]",
        "t": "Time",
    }
    for text in ("35.15", "u=", "=x", "", "u=a,u=b", "thet=x"):
        with pytest.raises(InputError) as caught:
            parse_pairs(text, "columns")
        assert "--columns" in str(caught.value)
    with pytest.raises(InputError, match="did you mean 'theta'"):
        parse_pairs("thet=x", "units")


@given(
    st.dictionaries(
        st.sampled_from(["t", "u", "w", "theta", "d"]),
        st.text("abcxyz [].-/()", min_size=1).map(str.strip).filter(bool),
        min_size=1,
    )
)
def test_pairs_round_trip(pairs):
    assert parse_pairs(",".join(f"{k}={v}" for k, v in pairs.items()), "columns") == pairs


def test_usual_names_only_when_one_fits(tmp_path):
    record = read_record(csv(tmp_path, "Time [s],Motor torque [N m],speed,pos"))
    assert record.theta is not None and record.w is not None
    refused(InputError, csv(tmp_path, "t,torque,speed_demand,position error"), "no column for w")
    refused(InputError, csv(tmp_path, "t,torque,motor torque,pos"), "no", columns="u=x")
    sentence = refused(InputError, csv(tmp_path, "t,u,angle,position"), "theta could be any")
    assert "--columns theta=" in sentence
    kept = read_record(csv(tmp_path, "t,u,w,x"), columns="theta=x")
    assert kept.theta is not None
    left = read_record(csv(tmp_path, "t,u,speed,velocity"), columns="theta=velocity")
    assert left.w is not None


def test_an_own_name_goes_before_a_usual_one(tmp_path):
    record = read_record(csv(tmp_path, "t,u,torque,theta"))
    np.testing.assert_allclose(record.u, machine()["u"], rtol=1e-8)


def test_missing_and_misspelt_columns(tmp_path):
    path = csv(tmp_path, "t,trque,w,theta")
    refused(InputError, path, "'trque'", "'theta'", "did you mean 'trque'", "--columns u=NAME")
    refused(InputError, path, "'torqe'", "did you mean 'trque'", columns={"u": "torqe"})
    refused(InputError, path, "more than one role", columns="u=w,w=w")
    refused(InputError, csv(tmp_path, "a,u,w,theta"), "column for t", "--rate")
    refused(InputError, path, "no role 'torque'", columns={"torque": "trque"})
    refused(InputError, csv(tmp_path), "names d", scale="d=2")


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"units": "theta=degre"}, ["'degre'", "did you mean 'deg'", "rev"]),
        ({"units": "theta=rpm"}, ["theta cannot be in rpm", "rad"]),
        ({"units": "u=furlong"}, ["'furlong'", "N m", "mN m"]),
        ({"units": "u=A"}, ["A", "--scale u="]),
        ({"units": "u=%"}, ["%", "--scale u="]),
        ({"units": "theta=mm,w=rad/s"}, ["mm", "rad/s", "linear"]),
        ({"units": "theta=rad", "motion": "linear"}, ["rad", "linear"]),
        ({"motion": "oblique"}, ["oblique"]),
        ({"scale": "u=big"}, ["'big'"]),
        ({"scale": {"u": 0.0}}, ["0"]),
        ({"rate": -5.0}, ["rate"]),
    ],
)
def test_wrong_options(tmp_path, options, words):
    refused(InputError, csv(tmp_path), *words, **options)


def test_unknown_unit_in_the_header_names_its_column(tmp_path):
    path = csv(tmp_path, "t,u [furlong],w,theta")
    refused(InputError, path, "run.csv", "'u'", "'furlong'")
    assert read_record(path, units={"u": "N m"}).samples == 3000


def test_current_by_its_usual_name_needs_a_scale(tmp_path):
    refused(InputError, csv(tmp_path, "t,current,w,theta"), "is in A", "--scale u=")
    record = read_record(csv(tmp_path, "t,current,w,theta"), scale="u=0.5")
    np.testing.assert_allclose(record.u, 0.5 * machine()["u"], rtol=1e-8)


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


@pytest.mark.parametrize("text", ["", "MN m", "nm", "kg", "m/s2", "Rad s"])
def test_units_not_understood(text):
    assert parse_unit(text) is None


@settings(
    max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(data=st.data())
def test_units_and_names_come_back(tmp_path, data):
    """Whatever units and names the columns carry, the SI values are those of the machine."""
    log = machine(1200)
    motion = data.draw(st.sampled_from(["rotary", "linear"]))
    quantities = {"t": "time", "u": "torque", "w": "velocity", "theta": "position"}
    order = data.draw(st.permutations(list(quantities)))
    names = data.draw(
        st.lists(
            st.from_regex(r"[A-Z][a-z]{0,5}", fullmatch=True), min_size=4, max_size=4, unique=True
        )
    )
    units = {
        role: data.draw(
            st.sampled_from(
                [u for u in UNITS.values() if u.quantity == q and u.motion in (None, motion)]
            )
        )
        for role, q in quantities.items()
    }
    arrays = {
        f"{name} [{units[role].name}]": log[role] / units[role].factor
        for role, name in zip(order, names, strict=True)
    }
    np.savez(tmp_path / "a.npz", **arrays)
    record = read_record(tmp_path / "a.npz", columns=dict(zip(order, names, strict=True)))
    assert record.motion == motion and record.messages == ()
    for role in order:
        np.testing.assert_allclose(getattr(record, role), log[role], rtol=1e-9, atol=1e-12)


def test_a_doubtful_range_without_unit_is_said(tmp_path):
    log = machine()
    fast = {"t": log["t"], "u": log["u"], "w": 60 * log["w"]}
    np.savez(tmp_path / "a.npz", **fast)
    assert any("w has no unit" in m for m in read_record(tmp_path / "a.npz").messages)
    assert read_record(tmp_path / "a.npz", units="w=rad/s").messages == ()
    counts = {"t": log["t"], "u": log["u"], "theta": np.round(log["theta"] / 1e-3)}
    np.savez(tmp_path / "a.npz", **counts)
    assert any("whole numbers" in m for m in read_record(tmp_path / "a.npz").messages)


# ---- time ---------------------------------------------------------------------------


def test_rate_instead_of_time(tmp_path):
    path = csv(tmp_path, "n,u,w,theta")
    record = read_record(path, rate=1000)
    np.testing.assert_allclose(record.t, machine()["t"], atol=1e-12)
    assert record.messages == ()
    both = read_record(csv(tmp_path), rate=900)
    assert both.rate == 1000.0 and any("900" in m for m in both.messages)
    assert read_record(csv(tmp_path), rate=1000.5).messages == ()


def test_time_starts_where_it_starts(tmp_path):
    record = read_record(csv(tmp_path, keep=slice(500, None)))
    assert record.t[0] == 0.5 and record.samples == 2500


@pytest.mark.parametrize("keep", [slice(3), slice(199), slice(0, 900)])
def test_too_short(tmp_path, keep):
    refused(Refused, csv(tmp_path, keep=keep), "too short", "run.csv")


def test_time_backwards(tmp_path):
    def swap(lines):
        lines[400], lines[401] = lines[401], lines[400]
        return lines

    refused(Refused, csv(tmp_path, change=swap), "backwards", "line 402")
    commented = csv(tmp_path, change=lambda x: [*swap(x)[:9], "# remark", *x[9:]])
    refused(Refused, commented, "line 403")


def test_wrong_time_unit(tmp_path):
    path = csv(tmp_path, "t [ms],u,w,theta")
    refused(Refused, path, "1e+06 Hz", "--units t=")
    log = machine()
    np.savez(tmp_path / "a.npz", **(log | {"t": 1e3 * log["t"]}))
    refused(Refused, tmp_path / "a.npz", "1 Hz", "--units t=ms")
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
    assert any(m.startswith("u is missing in 4 samples") for m in record.messages)


@pytest.mark.parametrize("column", [0, 1, 2, 3])
def test_runs_of_nan_are_refused(tmp_path, column):
    def hole(lines):
        for line in range(500, 510):
            lines = cell(line, column, "nan")(lines)
        return lines

    role = ("t", "u", "w", "theta")[column]
    refused(Refused, csv(tmp_path, change=hole), role, "10 samples", "line 500")


def test_many_scattered_nan_are_refused(tmp_path):
    def holes(lines):
        for line in range(5, 3000, 50):
            lines = cell(line, 1, "")(lines)
        return lines

    refused(Refused, csv(tmp_path, change=holes), "u", "60 samples")


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
    assert any("repeats itself in 3 rows" in m for m in record.messages)
    np.testing.assert_allclose(record.w, machine()["w"], rtol=1e-8)


def test_few_lost_rows_are_filled_and_counted(tmp_path):
    keep = np.setdiff1d(np.arange(3000), [50, 51, 1200])
    log, record = machine(), read_record(csv(tmp_path, keep=keep))
    assert record.samples == 3000 and record.dropped == 3 and record.gaps == ()
    np.testing.assert_allclose(record.t, log["t"], atol=1e-9)
    assert record.u[50] == record.u[51] == record.u[49]
    np.testing.assert_allclose(record.theta, log["theta"], atol=2e-4)


def test_longer_losses_are_gaps(tmp_path):
    keep = np.setdiff1d(np.arange(3000), np.r_[1200:1260, 1265:1305, 2500:2507])
    log, record = machine(), read_record(csv(tmp_path, keep=keep))
    assert record.gaps == (1200, 1200 + 2500 - 1305)
    for part in record.segments():
        np.testing.assert_allclose(np.diff(record.t[part]), 1e-3, rtol=1e-6)
    found = np.searchsorted(log["t"] + 5e-4, record.t)
    np.testing.assert_allclose(record.u, log["u"][found], rtol=1e-8)
    assert any("2 gaps" in m for m in record.messages)
    assert record.dropped == 5  # the stretch 1260..1264 is too short to be of use


def test_too_many_lost_rows_are_refused(tmp_path):
    lost = np.random.default_rng(5).choice(np.arange(10, 2990, 4), 75, replace=False)
    keep = np.setdiff1d(np.arange(3000), lost)
    refused(Refused, csv(tmp_path, keep=keep), "75 of 3000")
    scraps = np.flatnonzero(np.arange(3000) % 200 < 150)
    refused(Refused, csv(tmp_path, keep=scraps), "too short", "between lost samples")


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
    np.testing.assert_allclose(record.theta, np.sin(7 * record.t), atol=1e-5)
    held = np.sum(values["u"][:-1] * np.diff(stamps))
    assert np.sum(record.u[:-1]) * record.dt == pytest.approx(held, abs=2e-3 * 1e-3)
    late = np.mean((record.u - np.sin(9 * record.t)) * np.cos(9 * record.t)) / np.mean(
        9 * np.cos(9 * record.t) ** 2
    )
    assert abs(late) < 2e-6  # seconds; taking the previous value would be 20 times that


def test_stamps_rounded_too_coarsely(tmp_path):
    t = np.arange(3000) * 1.3e-3
    values = {"u": np.sin(9 * t), "w": 7 * np.cos(7 * t), "theta": np.sin(7 * t)}
    np.savez(tmp_path / "a.npz", t=np.round(t, 3), **values)
    record = read_record(tmp_path / "a.npz")
    assert record.dt == pytest.approx(1.3e-3, rel=1e-4) and record.dropped == 0
    assert any("rounded" in m for m in record.messages)
    np.testing.assert_array_equal(record.u, values["u"])


def test_irregular_beyond_repair(tmp_path):
    rng = np.random.default_rng(4)
    log = machine()
    t = np.cumsum(rng.exponential(1e-3, 3000))
    np.savez(tmp_path / "a.npz", **(log | {"t": t}))
    refused(Refused, tmp_path / "a.npz", "irregular", "sample")


def test_stamps_in_single_precision_are_a_grid(tmp_path):
    log = machine()
    np.savez(tmp_path / "a.npz", **(log | {"t": (20 + log["t"]).astype(np.float32)}))
    record = read_record(tmp_path / "a.npz")
    assert record.messages == ()
    np.testing.assert_array_equal(record.u, log["u"])


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
    refused(InputError, path, "V", "--scale u=")
    record = read_record(path, columns="theta=qm,u=vir", units="theta=m", scale="u=35.15")
    raw = scipy.io.loadmat(path)
    assert record.motion == "linear" and record.rate == 1000.0 and record.samples == 24841
    assert record.w is None and record.dropped == 0
    np.testing.assert_array_equal(record.u, 35.15 * raw["vir"].ravel())
    np.testing.assert_array_equal(record.theta, raw["qm"].ravel())
    assert all(re.match("u is 35.15 times", m) for m in record.messages)


@measured
@pytest.mark.parametrize("name", ["start_stop/200.csv", "steady_state/0.096kg/n120.csv"])
def test_screw_drive_exports(name):
    path = DATA / "screw-drive" / name
    refused(InputError, path, "%", "--scale u=")
    record = read_record(path, scale={"u": 9.84e-5})
    assert record.samples == 500 and record.w is not None and record.dropped == 0
    rpm = np.loadtxt(
        path, delimiter=";", skiprows=path.read_text().split("ms;rpm")[0].count("\n") + 1
    )
    np.testing.assert_allclose(record.w * 30 / np.pi, rpm[:, 1], atol=1e-9)
    assert record.dt == pytest.approx(1e-3 * np.diff(rpm[:, 0]).mean(), rel=1e-9)

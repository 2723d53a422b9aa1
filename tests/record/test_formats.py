"""Logs as programs and drives write them: what is read, and what the one sentence names."""

import io
import json

import numpy as np
import pytest
import scipy.io

from lugrectl.core.errors import InputError, Refused
from lugrectl.record import long_enough_to_judge, read_record

from ..cases.logs import machine, refused, rows, undamaged, write  # noqa: F401  fixture

LOG = {k: v[:1500] for k, v in machine().items()}
T, U, W, THETA = (LOG[k] for k in ("t", "u", "w", "theta"))
TURN = 2 * np.pi


def same(record, atol=1e-9, u=U, theta=THETA):
    np.testing.assert_allclose(record.u, u, atol=atol)
    np.testing.assert_allclose(record.theta, theta, atol=atol)
    assert record.rate == pytest.approx(1000.0, rel=1e-6)
    return record


def table(head, *columns, delimiter=",", before="", after=""):
    body = rows(columns, delimiter)
    if after:
        body = body.replace("\n", after + "\n")
    return before + head + "\n" + body


# ---- names, units, paths ------------------------------------------------------------


MS = np.rint(1e3 * T).astype(int) + 600
LVM = (
    "LabVIEW Measurement\t\nSeparator\tTab\n***End_of_Header***\t\n\t\nChannels\t2\t\t\n"
    "Samples\t9\t9\t\nY_Unit_Label\tmN m\tdeg\t\nX0\t0\t0\t\nDelta_X\t0.001\t0.001\t\n"
    "***End_of_Header***\t\t\t\n"
)
SCOPE = (
    "Name;Project\nFile;x.svdx\n\nName;ActPos;Name;ActTorque\nSymbolName;A.P;SymbolName;A.T\n"
    "Data-Type;REAL64;Data-Type;REAL64\nSampleTime[ms];1;SampleTime[ms];1\n"
)
TUT = (T, U, THETA)
TTU = (T, THETA, U)
LAYOUTS = [  # header, columns, and options of the table
    # units wherever they stand
    ("time_us,speed_rad_s,torque_Nm,pos_rev", (1e6 * T, W, U, THETA / TURN), {}),
    ("t_ms,velRpm,torque_mNm,angle_deg",
     (1e3 * T, 30 / np.pi * W, 1e3 * U, np.degrees(THETA)), {}),
    ("time / s,speed / rpm,u / N cm,theta / deg", (T, 30 / np.pi * W, 100 * U, np.degrees(THETA)),
     {}),
    ("t (sec),omega (deg/s),torque (Nm),position (turns)",
     (T, np.degrees(W), U, THETA / TURN), {}),
    ("Timestamp [ns],Velocity [rps],Torque [ozf in],Angle [mrad]",
     (1e9 * T, W / TURN, U / 0.00706155183333, 1e3 * THETA), {}),
    ('"time, ms","angle, deg","torque, mN m"', (1e3 * T, np.degrees(THETA), 1e3 * U), {}),
    ("t,u,theta_m", TUT, {}),  # measured, no length
    # paths of topics, by their last word
    ("__time,/joint_states/knee/position,/joint_states/knee/effort", TTU, {}),
    ("%time,field.position0,field.effort0", TTU, {}),
    ("timestamp,position[0],effort[0]", TTU, {}),
    ("time,/enc/angle/data,/drive/torque/data", TTU, {}),
    ("Time,Axis 2.ActPos,Axis 2.ActTorque", TTU, {}),
    ("header.stamp.secs,header.stamp.nsecs,u,theta",
     (1700 + MS // 1000, MS % 1000 * 10**6, U, THETA), {}),
    # blanks, pipes, comments, delimiters at the end
    *((mark + between.join(["t", "theta", "u"]), TTU, {"delimiter": between})
      for between in (" ", "   ", " | ") for mark in ("", "# ", "% ", "// ")),
    ("%[ms],[N m],[turns]", (1e3 * T, U, THETA / TURN),
     {"before": "%Date:,today\r\n%stamp,torque,position\r\n", "after": ";"}),
    ("t [s]  u [N m]  theta [rad]", TUT, {"delimiter": "  "}),
    ("t;u;theta", TUT, {"delimiter": ";", "after": ";"}),
    ("t;u;theta", TUT, {"delimiter": ";", "after": "; "}),
    # preambles of measuring programs
    ("X_Value\ttorque\tposition\tComment", (T, 1e3 * U, np.degrees(THETA)),
     {"delimiter": "\t", "before": LVM, "after": "\t"}),
    ("Unit;deg;Unit;N m", (1e3 * T, np.degrees(THETA), 1e3 * T, U),
     {"delimiter": ";", "before": SCOPE}),
    *(("t,u,theta", TUT, {"encoding": code})
      for code in ("utf-16-le", "utf-16-be", "utf-8-sig", "utf-16")),
    ("t [s],u [N·m],theta [rad]", TUT, {"encoding": "latin-1"}),
    ("t [s]\tu [N·m]\ttheta [rad]", TUT, {"encoding": "utf-16", "delimiter": "\t"}),
]  # fmt: skip


@pytest.mark.parametrize(("head", "columns", "how"), LAYOUTS)
def test_every_usual_layout_of_a_text_is_read(tmp_path, head, columns, how):
    encoding = how.get("encoding", "utf-8")
    made = table(head, *columns, **{k: v for k, v in how.items() if k != "encoding"})
    assert same(read_record(write(tmp_path / "a.csv", made, encoding)), 1e-6).motion == "rotary"


def test_columns_are_taken_by_number_and_one_that_is_there_twice_once(tmp_path):
    path = write(tmp_path / "a.txt", rows([THETA, T, U], " "))
    same(read_record(path, columns="t=2,u=3,theta=1"))
    path = write(tmp_path / "a.csv", table("t,theta,u,u", T, THETA, U, U))
    assert any("same values" in m for m in same(read_record(path)).messages)
    same(
        read_record(write(tmp_path / "b.csv", table("t,theta,u,u", T, THETA, U, W)), columns="u=3")
    )


# ---- time ---------------------------------------------------------------------------


def clock(seconds):
    day = seconds % 86400
    return f"{int(day // 3600):02d}:{int(day // 60 % 60):02d}:{day % 60:06.3f}"


@pytest.mark.parametrize(
    ("before", "after"),
    [
        (lambda s: "", ""),
        (lambda s: "2023-12-31 " if s < 86400 else "2024-01-01 ", "Z"),
        (lambda s: "28.02.2023 " if s < 86400 else "01.03.2023 ", ""),
    ],
)
def test_dates_and_times_of_day_run_over_midnight(tmp_path, before, after):
    stamps = [before(s) + clock(s) + after for s in np.round(T + 86399.2, 3)]
    body = "".join(f"{a};{b:.9g};{c:.9g}\n" for a, b, c in zip(stamps, U, THETA, strict=True))
    assert same(read_record(write(tmp_path / "a.csv", "time;u;theta\n" + body))).t[0] == 0.0


def test_an_unnamed_column_of_stamps_is_t(tmp_path):
    body = "".join(
        f"2024-05-05T10:00:{s:09.6f},{b:.9g},{c:.9g}\n" for s, b, c in zip(T, U, THETA, strict=True)
    )
    same(read_record(write(tmp_path / "a.csv", ",u,theta\n" + body)))


@pytest.mark.parametrize("per", [10**9, 10**6, 10**3])
def test_seconds_since_1970_are_known_by_their_size(tmp_path, per):
    whole = 1_650_000_000 * per + np.rint(T * per).astype(np.int64)
    body = "".join(f"{a},{b:.9g},{c:.9g}\n" for a, b, c in zip(whole, U, THETA, strict=True))
    record = same(read_record(write(tmp_path / "a.csv", "timestamp,u,theta\n" + body)))
    assert per == 10**9 or any("since 1970" in m for m in record.messages)


def test_an_empty_cell_among_nanoseconds_since_1970_is_a_row_without_a_time(tmp_path):
    stamps = [str(1_650_000_000 * 10**9 + round(1e9 * t)) for t in T]
    stamps[700] = ""
    body = "".join(f"{a},{b:.9g},{c:.9g}\n" for a, b, c in zip(stamps, U, THETA, strict=True))
    record = read_record(write(tmp_path / "a.csv", "timestamp,u,theta\n" + body))
    assert any("t is missing in 1 row" in m for m in record.messages)
    np.testing.assert_allclose(np.delete(record.theta, 700), np.delete(THETA, 700), atol=1e-8)


@pytest.mark.parametrize("head", ["t", "timestamp"])
@pytest.mark.parametrize("made", [dict, lambda d: {k: list(v) for k, v in d.items()}])
def test_so_they_are_in_memory(head, made):
    ms = 1_764_322_498_123 + np.rint(1e3 * T).astype(np.int64)
    record = same(read_record(made({head: ms, "u": U, "theta": THETA})))
    assert f"'{head}' holds ms since 1970 (its unit is not stated)." in record.messages


def test_a_rate_that_may_be_the_step_in_ms_is_asked_about(tmp_path):
    path = write(tmp_path / "a.csv", table("u,theta", U, THETA))
    (said,) = read_record(path, rate=2.5).messages
    assert said == "rate gives 2.5 samples per second; if 2.5 is the step in ms, give rate=400."
    with pytest.raises(Refused, match="rate gives 2.5 samples per second, at which"):
        long_enough_to_judge(read_record(path, rate=2.5))
    (slow,) = read_record(write(tmp_path / "b.csv", table("t,u,theta", 400 * T, U, THETA))).messages
    assert slow.startswith("t gives a sampling rate of 2.5 Hz: if t is not")


def test_rows_of_two_topics_are_merged_on_those_of_the_motion(tmp_path):
    lines = [
        f"{t:.6g},{u:.9g}," if k % 2 else f"{t:.6g},,{x:.9g}"
        for k, (t, u, x) in enumerate(zip(T, U, THETA, strict=True))
    ]
    path = write(tmp_path / "a.csv", "__time,/m/torque,/e/angle\n" + "\n".join(lines) + "\n")
    record = read_record(path)
    assert record.samples == 750 and record.rate == pytest.approx(500.0)
    np.testing.assert_allclose(record.theta, THETA[::2], atol=1e-8)
    np.testing.assert_allclose(record.u[1:-1], U[2:-2:2], atol=0.01)
    assert any("different rows" in m for m in record.messages)


# ---- text ---------------------------------------------------------------------------


def test_thousands_fortran_and_absent_values(tmp_path):
    body = "".join(
        f"{1000 * t + 7000:,.0f};{1000 * u:,.6f};{x:.9E}\n".replace("E", "D")
        for t, u, x in zip(T, U, THETA, strict=True)
    )
    path = write(tmp_path / "a.csv", "t [ms];u [mN m];theta [rad]\n" + body)
    assert any("thousands" in m for m in same(read_record(path), atol=1e-7).messages)
    lines = table("t,u,theta", T, U, THETA).splitlines()
    lines[701] = lines[701].split(",")[0] + ",#N/A," + lines[701].split(",")[2]
    record = read_record(write(tmp_path / "b.csv", "\n".join(lines)))
    np.testing.assert_allclose(np.delete(record.u, 700), np.delete(U, 700), atol=1e-8)


def test_standard_input_is_read(monkeypatch):
    data = table("t\tu\ttheta", T, U, THETA, delimiter="\t").encode()
    monkeypatch.setattr("sys.stdin", io.TextIOWrapper(io.BytesIO(data)))
    record = same(read_record("-"))
    assert record.source == "stdin" and record.file is not None and record.file.name == "stdin"


# ---- nested -------------------------------------------------------------------------


@pytest.mark.usefixtures("undamaged")
def test_columns_of_a_matrix_in_a_struct_are_named_by_number(tmp_path):
    path = tmp_path / "a.mat"
    for x in (np.vstack([THETA, W, U]), np.column_stack([THETA, W, U])):
        scipy.io.savemat(path, {"rec": {"in": {"x": x}, "clk": T}}, do_compression=True)
        refused(InputError, path, "'rec.in.x[1]'", "'rec.clk'", 'columns="')
        columns = "t=rec.clk,theta=rec.in.x[1],u=rec.in.x[3]"
        same(read_record(path, columns=columns), atol=0)


@pytest.mark.usefixtures("undamaged")
def test_simulink_exports(tmp_path):
    path, tall = tmp_path / "a.mat", {"values": np.column_stack([THETA, U])}
    scipy.io.savemat(path, {"out": {"time": T, "signals": tall | {"label": "angle, torque"}}})
    same(read_record(path), atol=0)
    each = np.array(
        [{"values": THETA[:, None], "label": "theta"}, {"values": U[:, None], "label": "u"}],
        dtype=object,
    )
    scipy.io.savemat(path, {"Scope": {"time": T[:, None], "signals": each}})
    same(read_record(path), atol=0)
    series = {"torque": {"Time": T, "Data": U}, "position": {"Time": T, "Data": THETA}}
    scipy.io.savemat(path, {"logs": series})
    same(read_record(path), atol=0)


@pytest.mark.parametrize("orient", ["list", "split", "records", "columns"])
def test_json_of_every_orientation(tmp_path, orient):
    pandas = pytest.importorskip("pandas")
    frame = pandas.DataFrame({"theta": THETA, "u": U, "time": T})
    if orient == "list":
        text = json.dumps({"meta": {"kp": 3.0}, "log": frame.to_dict("list")})
    else:
        text = frame.to_json(orient=orient, double_precision=12)
    same(read_record(write(tmp_path / "a.json", text)), atol=1e-9)
    lines = "\n".join(json.dumps(row) for row in frame.to_dict("records"))
    same(read_record(write(tmp_path / "b.json", lines)), atol=1e-9)


def test_numpy_matrices_and_structured_arrays(tmp_path):
    np.save(tmp_path / "a.npy", np.column_stack([U, THETA, T]))
    refused(InputError, tmp_path / "a.npy", 'columns="')
    same(read_record(tmp_path / "a.npy", columns="u=1,theta=2,t=3"), atol=0)
    np.savez(tmp_path / "b.npz", run=np.rec.fromarrays([U, T, THETA], names="torque,t,angle"))
    same(read_record(tmp_path / "b.npz"), atol=0)


def test_excel_is_read(tmp_path):
    openpyxl = pytest.importorskip("openpyxl")
    book = openpyxl.Workbook()
    for row in [["t [s]", "u [N m]", "theta [rad]"], *zip(T, U, THETA, strict=True)]:
        book.active.append([x if isinstance(x, str) else float(x) for x in row])
    book.save(tmp_path / "a.xlsx")
    same(read_record(tmp_path / "a.xlsx"))

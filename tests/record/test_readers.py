"""Text, MAT and NPZ files: every layout that is understood, every one that is named and refused."""

import sys
import time
from functools import cache
from importlib.metadata import EntryPoint
from types import SimpleNamespace

import numpy as np
import pytest
import scipy.io

from lugrectl.core.errors import InputError
from lugrectl.record import read_log, read_record
from lugrectl.record.as_record import files_of
from lugrectl.record.files import readers
from lugrectl.record.files.readers import read_table

from ..cases.logs import csv, machine, refused, rows, undamaged, write  # noqa: F401  fixture

# ---- text files ---------------------------------------------------------------------


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
    refused(InputError, path, "%", 'scale="u=')
    record = read_record(path, scale={"u": 0.01})
    np.testing.assert_allclose(record.t, log["t"], atol=1e-12)
    np.testing.assert_allclose(record.w, log["w"], rtol=1e-7, atol=1e-9)
    np.testing.assert_allclose(record.u, log["u"], rtol=1e-7)
    assert any("usual names" in m and "Torque actual" in m for m in record.messages)


def test_a_usual_name_without_a_unit_is_noted_with_the_one_that_it_is_taken_in(tmp_path):
    (said,) = read_log(csv(tmp_path, "t,torque,vel,q")).messages
    assert said.endswith("u = 'torque' in N m, w = 'vel' in rad/s, theta = 'q' in rad.")
    (said,) = read_log(csv(tmp_path, "t,torque [N m],vel,q"), units="w=rad/s").messages
    assert said.endswith("u = 'torque', w = 'vel', theta = 'q' in rad.")
    found = read_log(csv(tmp_path, "t,torque,vel,q"), scale="u=2.0", motion="linear")
    said = found.messages[0]
    assert said.endswith("u = 'torque', w = 'vel' in m/s, theta = 'q' in m.")


def test_comments_blank_lines_quotes_and_unused_text(tmp_path):
    log = machine()
    lines = rows([log["t"], log["u"], log["theta"]]).splitlines()
    lines = [f'"{i}",{line},ok' for i, line in enumerate(lines)]
    lines.insert(100, "# operator left the room")
    lines.insert(200, "")
    path = write(tmp_path / "a.csv", "n,t (s),u (N m),theta (rad),state\n" + "\n".join(lines))
    record = read_record(path)
    np.testing.assert_allclose(record.u, log["u"], rtol=1e-8)


def test_a_last_line_cut_off_is_left_out(tmp_path):
    path = csv(tmp_path, change=lambda lines: [*lines[:-1], "2.999,0.1"])
    record = read_record(path)
    assert record.samples == 2999 and any("cut off" in m for m in record.messages)


def test_files_that_are_none(tmp_path):
    refused(InputError, tmp_path / "absent.csv", "no such file")
    refused(InputError, tmp_path, "directory")
    (tmp_path / "junk.csv").write_bytes(bytes(range(256)) * 8)
    refused(InputError, tmp_path / "junk.csv", "neither text")
    for name, start in (("a.mat", b"MATLAB 5.0 MAT-file"), ("b.npz", b"PK\x03\x04")):
        (tmp_path / name).write_bytes(start + b"\x01\x02 broken" * 40)
        refused(InputError, tmp_path / name, "not a readable")


def test_long_logs_load_at_speed(tmp_path):
    log, reps = machine(), 30
    t = np.arange(3000 * reps) * 1e-3
    one = rows([log["u"], log["theta"]]).splitlines() * reps
    text = "t,u,theta\n" + "\n".join(f"{a:.3f},{b}" for a, b in zip(t, one, strict=True))
    path = write(tmp_path / "big.csv", text)
    start = time.process_time()
    table = read_table(path)
    columns, _ = table.load([0, 1, 2])
    assert len(columns) == 3 and len(columns[0]) == 90_000
    assert time.process_time() - start < 0.9  # a million rows in 10 s on a slow machine


# ---- MAT and NPZ --------------------------------------------------------------------


@pytest.mark.usefixtures("undamaged")
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


@pytest.mark.parametrize(
    ("name", "start", "module"),
    [("a.mat", b"MATLAB 7.3 MAT-file", "h5py"), ("a.parquet", b"PAR1", "pyarrow.parquet")],
)
def test_extra_formats_name_their_extra(tmp_path, monkeypatch, name, start, module):
    monkeypatch.setitem(__import__("sys").modules, module, None)
    (tmp_path / name).write_bytes(start + b" " * 600)
    refused(InputError, tmp_path / name, 'pip install "lugrectl[files]"', name)


# ---- readers of other packages ----------------------------------------------------------


@pytest.fixture
def other_package(monkeypatch):
    """A package that reads files with the ending mf4."""
    made = dict(machine())
    made["w [rpm]"] = made.pop("w") * 30 / np.pi
    package = SimpleNamespace(read=lambda path: made)
    monkeypatch.setitem(sys.modules, "other_package", package)
    entry = EntryPoint("mf4", "other_package:read", "lugrectl.readers")
    monkeypatch.setattr(readers, "entry_points", lambda group: [entry])
    monkeypatch.setattr(readers, "_installed", cache(readers._installed.__wrapped__))
    return package


def test_a_file_of_another_package_is_a_log_like_the_others(tmp_path, other_package):
    path = write(tmp_path / "a.MF4", "no text of numbers")
    record = read_record(path)
    np.testing.assert_array_equal(record.u, machine()["u"])
    np.testing.assert_allclose(record.w, machine()["w"])
    assert files_of(tmp_path) == [path]


def test_its_errors_are_one_sentence(tmp_path, other_package):
    path = write(tmp_path / "a.mf4", "x")
    for answer in (1.5, {"t": [1.0]}):
        other_package.read = lambda path, answer=answer: answer
        refused(InputError, path, "a.mf4")
    other_package.read = None
    refused(InputError, path, "a.mf4 is not a readable MF4 file")

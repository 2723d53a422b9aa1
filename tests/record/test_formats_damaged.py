"""Damaged files and files that are no log: one sentence, whatever a library does."""

import numpy as np
import pytest
import scipy.io

from lugrectl.core.errors import InputError
from lugrectl.record import read_record
from lugrectl.record.as_record import passed_over, record_files
from lugrectl.record.files import readers

from ..cases.logs import csv, machine, refused, write

LOG = {k: v[:1200] for k, v in machine().items()}


def test_a_damaged_mat_file_is_read_or_named(tmp_path):
    path = tmp_path / "a.mat"
    scipy.io.savemat(path, LOG)
    whole = path.read_bytes()
    for cut, said in ((len(whole) // 2, "a.mat is not a readable MAT file"), (140, "a.mat")):
        path.write_bytes(whole[:cut])
        refused(InputError, path, said)


def test_damaged_hdf5_and_parquet_files_get_our_sentence(tmp_path):
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "a.h5", "w") as file:
        for name, values in LOG.items():
            file[f"run/{name}"] = values
    np.testing.assert_array_equal(read_record(tmp_path / "a.h5").u, LOG["u"])
    data = bytearray((tmp_path / "a.h5").read_bytes())
    data[600:1200] = b"\xa5" * 600
    (tmp_path / "b.h5").write_bytes(data)
    refused(InputError, tmp_path / "b.h5", "b.h5 is not a readable HDF5 file")
    (tmp_path / "c.parquet").write_bytes(b"PAR1" + bytes(range(256)) * 3 + b"PAR1")
    refused(InputError, tmp_path / "c.parquet", "c.parquet is not a readable Parquet file")


def test_a_library_that_dies_leaves_a_sentence(tmp_path, monkeypatch):
    killer = write(tmp_path / "killer.py", "import os\nos.abort()\n")
    monkeypatch.setattr(readers.child_process, "__file__", str(killer))
    (tmp_path / "a.h5").write_bytes(b"\x89HDF\r\n\x1a\n" + b"\0" * 600)
    pytest.importorskip("h5py")
    refused(InputError, tmp_path / "a.h5", "not a readable HDF5 file", "ended with code")


@pytest.mark.parametrize(
    ("name", "data", "word"),
    [
        ("a.csv", b"\x89PNG\r\n\x1a\n" + b"\0" * 50, "neither text nor"),
        ("a.bag", b"SQLite format 3\0", "ROS 2 bag"),
        ("a.npy", b"\x93NUMPY\x01\x00" + b"\xff" * 40, "not a readable NPY"),
        ("a.json", b'{"t": [0, 1, 2', "not a readable JSON"),
        ("a.csv.gz", b"\x1f\x8b\x08" + b"\0" * 30, "unpack it"),
        ("a.xls", b"\xd0\xcf\x11\xe0" + b"\0" * 40, ".xlsx"),
    ],
)
def test_files_that_hold_no_log_are_named(tmp_path, name, data, word):
    (tmp_path / name).write_bytes(data)
    refused(InputError, tmp_path / name, word)


def test_a_folder_gives_every_kind_of_log_and_lists_the_rest(tmp_path):
    csv(tmp_path, name="one.csv")
    (tmp_path / "two.h5").write_bytes(b"\x89HDF\r\n\x1a\n")
    write(tmp_path / "three.txt", "0 1 2\n1 2 3\n" * 20)
    write(tmp_path / "notes.txt", "The drive was warm.\n")
    write(tmp_path / "model.toml", "name = 'x'\n")
    assert [p.name for p in record_files([tmp_path])] == ["one.csv", "three.txt", "two.h5"]
    assert [p.name for p in passed_over([tmp_path])] == ["model.toml", "notes.txt"]


# ---- angles without a unit ----------------------------------------------------------


def swing(scale, steps=None, seconds=6.0, amplitude=8.0):
    """A log whose angle has this many units in a turn, rounded to an encoder's steps."""
    t = np.arange(int(500 * seconds)) / 500
    turns = amplitude * (np.sin(2.1 * t) + 0.4 * np.sin(5.3 * t)) / (2 * np.pi)
    u = np.gradient(np.gradient(2 * np.pi * turns, t), t) * 1e-3 + 0.1 * np.sign(np.gradient(turns))
    turns = np.round(turns * steps) / steps if steps else turns
    return {"t": t, "u": u, "theta": scale * turns}


@pytest.mark.parametrize(
    ("scale", "steps", "unit"),
    [
        (360, 4096, "deg"),
        (360, 10000, "deg"),
        (360, 7200, "deg"),
        (1, 16384, "rev"),
        (1, 2**17, "rev"),
        (1, 20000, "rev"),
        (1, 4000, "rev"),
    ],
)
def test_an_angle_without_unit_is_asked_about(scale, steps, unit):
    log = swing(scale, steps)
    with pytest.raises(InputError, match=f'units="theta={unit}"'):
        read_record(log)
    with pytest.raises(InputError, match=f'units="theta={unit},w={unit}/s"'):
        read_record(log | {"w": np.gradient(log["theta"], log["t"])})
    good = read_record(log, units={"theta": unit})
    assert good.theta is not None
    np.testing.assert_allclose(good.theta, 2 * np.pi / scale * log["theta"], atol=1e-12)


def test_two_units_that_fit_by_their_ratio_are_asked_about():
    log = swing(360)
    log["w"] = np.gradient(log["theta"], log["t"]) / 6
    with pytest.raises(InputError, match='units="theta=deg,w=rpm"'):
        read_record(log)


@pytest.mark.parametrize("steps", [None, 4096, 8192 * 7, 20000, 12345])
@pytest.mark.parametrize("digits", [3, 4, 6])
def test_an_angle_in_rad_is_never_asked_about(steps, digits):
    log = swing(2 * np.pi, steps)
    log["theta"] = np.round(log["theta"], digits)
    assert read_record(log).samples == 3000

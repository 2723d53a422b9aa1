"""Malformed files are one sentence of ours, or numbers that their text says: tests/fuzz."""

import numpy as np
import pytest

import lugrectl as lg

from ..fuzz.checks import wrong_with

SLOW = [pytest.param(range(n, n + 250), marks=pytest.mark.slow) for n in range(0, 2000, 250)]


@pytest.mark.parametrize("numbers", [range(14), *SLOW])  # two in a hundred take half a second
def test_a_malformed_file_is_one_sentence_or_read_as_it_says(tmp_path, numbers):
    pytest.importorskip("h5py")
    pytest.importorskip("pyarrow")
    wrong = []
    for number in numbers:
        kind, ways, said = wrong_with(number, tmp_path)
        wrong += [{"case": number, "kind": kind, "ways": ways, "wrong": said}] if said else []
    assert wrong == []


# ---- one of each kind that was found ------------------------------------------------


def rows(n=60):
    t = np.arange(n) * 2e-3
    return t, 0.3 * np.sin(20 * t), np.cos(17 * t)


def test_a_time_of_day_among_seconds_is_one_sentence(tmp_path):
    t, u, w = rows()
    lines = [f"{a:.4f},{b:.5f},{c:.5f}" for a, b, c in zip(t, u, w, strict=True)]
    lines[-2] = lines[-2].replace("0.1160", "12:34:56")
    path = tmp_path / "a.csv"
    path.write_text("t,u,w\n" + "\n".join(lines) + "\n")
    with pytest.raises(lg.InputError, match="a.csv.*12:34:56"):
        lg.read_record(path)


def test_a_signalling_nan_is_a_missing_sample(tmp_path):
    t, u, w = rows()
    u[7] = np.frombuffer(b"\x01\0\0\0\0\0\xf0\x7f")[0]
    np.savez(tmp_path / "a.npz", t=t, u=u, w=w)
    assert lg.read_record(tmp_path / "a.npz").samples > 0


def test_what_a_library_says_of_a_damaged_file_is_short_and_printable(tmp_path):
    np.savez(tmp_path / "a.npz", t=np.arange(99.0), u=np.arange(99.0))
    data = bytearray((tmp_path / "a.npz").read_bytes())
    data[26] = 200  # the length of a name
    (tmp_path / "a.npz").write_bytes(data)
    with pytest.raises(lg.InputError, match="a.npz is not a readable NPZ file") as said:
        lg.read_record(tmp_path / "a.npz")
    assert len(str(said.value)) < 250 and str(said.value).isprintable()


def test_a_library_that_hangs_is_ended(tmp_path, monkeypatch):
    from lugrectl.record.files import readers

    (tmp_path / "hang.py").write_text("import time\ntime.sleep(60)\n")
    (tmp_path / "a.parquet").write_bytes(b"PAR1" + b"\0" * 100)
    monkeypatch.setattr(readers.child_process, "__file__", str(tmp_path / "hang.py"))
    monkeypatch.setattr(readers, "_LONGEST", 0.3)
    pytest.importorskip("pyarrow")
    with pytest.raises(lg.InputError, match="a.parquet .* did not end within 0 s"):
        lg.read_record(tmp_path / "a.parquet")

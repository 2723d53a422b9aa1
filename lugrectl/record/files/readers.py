"""Tables of named columns from text, JSON, MAT, NPY, NPZ, HDF5, Parquet and Excel files."""

from __future__ import annotations

import gzip
import importlib.util
import json
import os
import pickle
import re
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np

from ...core.errors import InputError
from ...core.validation import like_it
from ..columns.table import Table, array_table
from . import child_process
from .mat_file import Opaque, read_mat
from .nested import columns_of
from .text import lines_table, read_text

# Endings of the files that can be read; in a folder, files of others are passed over.
SUFFIXES = (".csv .tsv .txt .dat .lvm .json .mat .npy .npz .h5 .hdf5 .parquet .xlsx").split()
MODEL = ".toml"
# Beginnings of files that are no log.
_OTHERS = (
    (b"\x89PNG", "an image"), (b"\xff\xd8\xff", "an image"), (b"GIF8", "an image"),
    (b"BM", "an image"), (b"II*\0", "an image"), (b"%PDF", "a PDF document"),
    (b"\xd0\xcf\x11\xe0", "an old Excel or Word file; save it as .xlsx or CSV"),
    (b"SQLite format 3", "a database, as a ROS 2 bag is; export its topics as CSV"),
    (b"7z\xbc\xaf", "an archive; unpack it first"),
    (b"Rar!", "an archive; unpack it first"), (b"\x7fELF", "a program"),
    (b"\x89MCAP", "an MCAP file; export its topics as CSV, for instance with PlotJuggler"),
)  # fmt: skip
_LONG = 160  # characters of what a library says that a sentence repeats
_LONGEST, _SLOWEST = 18.0, 4e6  # s, and bytes/s beyond, that a library may take for a file
_EXTRA = 'install it with pip install "lugrectl[files]"'


def read_table(path: str | Path) -> Table:
    """Open a file of columns; its first bytes, not its name, decide its format."""
    path = Path(path)
    try:
        if path.is_dir():
            raise InputError(f"{path} is a directory; name the file with the record.")
        if not path.exists():
            raise InputError(f"{path}: no such file{like_it(path)}.")
        with path.open("rb") as file:
            head = file.read(512)
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror or error}.") from None
    if not head.strip():
        raise InputError(f"{path.name} is empty.")
    if path.suffix.lower() == MODEL:
        raise InputError(f"{path.name} is a model file, not a log: give it as the model.")
    for start, what in _OTHERS:
        if head.startswith(start) and (start != b"BM" or b"\0" in head):
            raise InputError(f"{path.name} is no log that can be read: it is {what}.")
    for start, reader in _READERS:
        if head.startswith(start):
            return reader(path)
    if path.suffix.lower() == ".mat":
        return _read_mat(path)
    is_json = head.lstrip(b"\xef\xbb\xbf \t\r\n")[:1] in (b"{", b"[")
    return _read_json(path) if is_json else read_text(path)


def read_stdin() -> tuple[Table, bytes]:
    """The table on standard input, and its bytes."""
    data = sys.stdin.buffer.read()
    return _of_bytes("stdin", data), data


def _of_bytes(name: str, data: bytes) -> Table:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / name
        path.write_bytes(data)
        return read_table(path)


@contextmanager
def _readable(path: Path, kind: str) -> Iterator[None]:
    """One sentence where a library fails on a damaged file: libraries raise many kinds."""
    try:
        yield
    except InputError:
        raise
    except Exception as error:
        raise _damaged(path, kind, error) from None


def _damaged(path: Path, kind: str, error: Any) -> InputError:
    return InputError(f"{path.name} is not a readable {kind} file: {_why(error)}.")


def _read_gzip(path: Path) -> Table:
    with _readable(path, "gzip"):
        data = gzip.decompress(path.read_bytes())
    return _of_bytes(path.name.removesuffix(".gz"), data)


# ---- arrays by name -----------------------------------------------------------------


def _read_mat(path: Path) -> Table:
    with _readable(path, "MAT"):
        content = read_mat(path.read_bytes())
    hidden = [name for name, value in content.items() if isinstance(value, Opaque)]
    hint = "" if not hidden else (
        f"'{hidden[0]}' is an object such as a timeseries or a table, which only MATLAB can "
        f"read: save its numbers, for instance x = {hidden[0]}.Data; save('x.mat', 'x')."
    )  # fmt: skip
    return _array_table(path, content, hint)


def _read_npy(path: Path) -> Table:
    with _readable(path, "NPY"):
        return _array_table(path, np.load(path, allow_pickle=False))


def _read_zip(path: Path) -> Table:
    with _readable(path, "NPZ"):
        with zipfile.ZipFile(path) as archive:
            names = archive.namelist()
        if "[Content_Types].xml" in names:
            return _read_sheet(path)
        if not any(name.endswith(".npy") for name in names):
            raise InputError(
                f"{path.name} is an archive of files; unpack it and name the log in it."
            )
        with np.load(path, allow_pickle=False) as arrays:
            return _array_table(path, {name: arrays[name] for name in arrays.files})


def _read_json(path: Path) -> Table:
    data = path.read_bytes()
    try:
        content = json.loads(data.decode("utf-8-sig"))
    except (ValueError, RecursionError) as whole:
        try:  # one document in each line
            content = [json.loads(line) for line in data.splitlines() if line.strip()]
        except (ValueError, RecursionError):
            if path.suffix.lower() in (".json", ".jsonl", ".ndjson"):
                raise InputError(f"{path.name} is not readable JSON: {_why(whole)}.") from None
            return read_text(path)
    return _array_table(path, content)


def _read_hdf(path: Path) -> Table:
    what = f"{path.name} is a MATLAB v7.3 (HDF5) file"
    _needed("h5py", what, "save it in MATLAB with the option '-v7'")
    return _array_table(path, _by_child("hdf", path, "HDF5"))


def _read_parquet(path: Path) -> Table:
    _needed("pyarrow.parquet", f"{path.name} is a Parquet file", "save it as CSV")
    return _array_table(path, _by_child("parquet", path, "Parquet"))


def _read_sheet(path: Path) -> Table:
    """The first sheet that holds a table, read as the lines of a text."""
    _needed("openpyxl", f"{path.name} is an Excel file", "save it as CSV")
    import openpyxl  # pyright: ignore[reportMissingImports, reportMissingModuleSource]

    def cell(value: Any) -> str:
        return "" if value is None else str(value).replace("\t", " ").replace("\n", " ")

    with _readable(path, "Excel"):
        book = openpyxl.load_workbook(path, read_only=True, data_only=True)
        sheets = [
            ["\t".join(map(cell, row)) for row in sheet.iter_rows(values_only=True)]
            for sheet in book.worksheets
        ]
        book.close()
    problem = InputError(f"{path.name} holds no sheet.")
    for lines in sheets:
        try:
            return lines_table(path.name, lines)
        except InputError as error:
            problem = error
    raise problem


def _why(error: Any) -> str:
    """What a library says of a damaged file, in a short clause without the bytes that it quotes."""
    text = "".join(c if c.isprintable() else " " for c in str(error))
    text = " ".join(re.sub(r"(\\\\x[0-9a-f]{2})+", " ", text).split()) or type(error).__name__
    return (text if len(text) <= _LONG else f"{text[: _LONG - 4]} ...").rstrip(".")


def _needed(module: str, what: str, instead: str) -> None:
    """InputError that names the extra if a library is not installed."""
    hidden = module in sys.modules and sys.modules[module] is None
    if hidden or importlib.util.find_spec(module.split(".")[0]) is None:
        raise InputError(f"{what}, which needs {module.split('.')[0]}: {_EXTRA}, or {instead}.")


def _by_child(how: str, path: Path, kind: str) -> Any:
    """What the library reads in a process of its own, which a damaged file may bring down."""
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(p for p in sys.path if p)}
    command = [sys.executable, "-P", child_process.__file__, how, str(path.resolve())]
    longest = _LONGEST + path.stat().st_size / _SLOWEST
    good, answer = False, f"the library that reads it did not end within {longest:.0f} s"
    with suppress(subprocess.TimeoutExpired):
        done = subprocess.run(command, capture_output=True, env=environment, timeout=longest)
        answer = f"the library that reads it ended with code {done.returncode}"
        with suppress(Exception):  # it ended before it could answer
            good, answer = pickle.loads(done.stdout)
    if not good:
        raise _damaged(path, kind, answer)
    return answer


def _array_table(path: Path, content: Any, hint: str = "") -> Table:
    columns = columns_of(content)
    if len(columns) < 2:
        found = ", ".join(name for name, *_ in columns) or "none"
        raise InputError(
            f"{path.name} needs at least two one-dimensional numeric arrays of equal length "
            f"(found: {found}).{' ' * bool(hint)}{hint}"
        )
    headed = not all(name.isdecimal() for name, *_ in columns)
    if not headed:
        columns = [(name, "", unit, values) for name, _, unit, values in columns]
    return array_table(path.name, columns, hint, headed)


_READERS: tuple[tuple[bytes, Callable[[Path], Table]], ...] = (
    (b"\x1f\x8b", _read_gzip),
    (b"MATLAB 7.3", _read_hdf),
    (b"\x89HDF", _read_hdf),
    (b"MATLAB 5.0", _read_mat),
    (b"\x93NUMPY", _read_npy),
    (b"PK\x03\x04", _read_zip),
    (b"PAR1", _read_parquet),
)

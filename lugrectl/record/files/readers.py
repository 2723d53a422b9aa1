"""Tables of named columns from text, JSON, MAT, NPY, NPZ, HDF5, Parquet and Excel files."""

from __future__ import annotations

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
from contextlib import suppress
from functools import cache, partial
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from typing import Any

import numpy as np

from ...core.errors import InputError
from ...core.validation import like_it
from ..columns.table import Table, array_table, heads_of, seconds_of
from . import child_process
from .text import is_stamp, read_text, seconds, text_table

# Endings of the files that are read here; in a folder, files of others are passed over.
_SUFFIXES = (".csv .tsv .txt .dat .lvm .json .mat .npy .npz .h5 .hdf5 .parquet .xlsx").split()
MODEL = ".toml"
# Beginnings of files that others may take for a log, and what to do.
_OTHERS = {
    b"\xd0\xcf\x11\xe0": "an old Excel file; save it as .xlsx or CSV",
    b"SQLite format 3": "a database, as a ROS 2 bag is; export its topics as CSV",
    b"\x1f\x8b": "a gzip archive; unpack it",
    b"\x89MCAP": "an MCAP file; export its topics as CSV, for instance with PlotJuggler",
}
_LONG = 160  # characters of what a library says that a sentence repeats
_LONGEST, _SLOWEST = 18.0, 4e6  # s, and bytes/s beyond, that a library may take for a file
_MOST = 200  # columns of one matrix
_DEPTH = 12  # of nested content
_SHORT = 0.01  # of the longest column; shorter ones are parameters, no samples
Flat = Iterator[tuple[str, str, np.ndarray]]  # path, label, values


@cache
def _installed() -> dict[str, EntryPoint]:
    """The readers of other packages, by the ending of their files."""
    return {f".{one.name.lower()}": one for one in entry_points(group="lugrectl.readers")}


def suffixes() -> tuple[str, ...]:
    """The endings of the files that can be read."""
    return *_SUFFIXES, *_installed()


def read_table(path: str | Path) -> Table:
    """Open a file of columns; its first bytes, not its name, decide its format, unless another
    package reads files with its ending."""
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
    kind, read = _reader(path, head)
    try:  # libraries raise many kinds of errors on a damaged file
        return read(path)
    except InputError:
        raise
    except Exception as error:
        raise InputError(f"{path.name} is not a readable {kind} file: {_why(error)}.") from None


def _reader(path: Path, head: bytes) -> tuple[str, Callable[[Path], Table]]:
    """The name of the format, and what reads it."""
    ending = path.suffix.lower()
    if ending in _installed():
        return ending[1:].upper(), partial(_by_another, _installed()[ending])
    for start, what in _OTHERS.items():
        if head.startswith(start):
            raise InputError(f"{path.name} is no log that can be read: it is {what}.")
    for start, kind, read in _READERS:
        if head.startswith(start):
            return kind, read
    is_json = head.lstrip(b"\xef\xbb\xbf \t\r\n")[:1] in (b"{", b"[")
    return ("MAT", _mat) if ending == ".mat" else ("JSON", _json if is_json else read_text)


def _by_another(reader: EntryPoint, path: Path) -> Table:
    """The columns that ``reader`` of another package gives for a path, as a mapping or a table."""
    return nested_table(path.name, dict(reader.load()(path)))


def read_stdin() -> tuple[Table, bytes]:
    """The table on standard input, and its bytes."""
    data = sys.stdin.buffer.read()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "stdin")
        path.write_bytes(data)
        return read_table(path), data


def _why(error: Any) -> str:
    """What a library says of a damaged file, in a short clause without the bytes that it quotes."""
    text = "".join(c if c.isprintable() else " " for c in str(error))
    text = " ".join(re.sub(r"(\\\\x[0-9a-f]{2})+", " ", text).split()) or type(error).__name__
    return (text if len(text) <= _LONG else f"{text[: _LONG - 4]} ...").rstrip(".")


# ---- formats ------------------------------------------------------------------------


def _mat(path: Path) -> Table:
    content, hidden = _by_child("mat", path)
    hint = "" if not hidden else (
        f"'{hidden[0]}' is an object such as a timeseries or a table, which only MATLAB can "
        f"read: save its numbers, for instance x = {hidden[0]}.Data; save('x.mat', 'x')."
    )  # fmt: skip
    return nested_table(path.name, content, hint)


def _npy(path: Path) -> Table:
    return nested_table(path.name, np.load(path, allow_pickle=False))


def _zip(path: Path) -> Table:
    with zipfile.ZipFile(path) as archive:
        names = archive.namelist()
    if "[Content_Types].xml" in names:
        return _sheet(path)
    if not any(name.endswith(".npy") for name in names):
        raise InputError(f"{path.name} is an archive of files; unpack it and name the log in it.")
    with np.load(path, allow_pickle=False) as arrays:
        return nested_table(path.name, {name: arrays[name] for name in arrays.files})


def _json(path: Path) -> Table:
    data = path.read_bytes()
    try:
        content = json.loads(data.decode("utf-8-sig"))
    except (ValueError, RecursionError):
        try:  # one document in each line
            content = [json.loads(line) for line in data.splitlines() if line.strip()]
        except (ValueError, RecursionError):
            if path.suffix.lower() in (".json", ".jsonl", ".ndjson"):
                raise
            return read_text(path)
    return nested_table(path.name, content)


def _hdf(path: Path) -> Table:
    what = f"{path.name} is a MATLAB v7.3 (HDF5) file"
    _needed("h5py", what, "save it in MATLAB with the option '-v7'")
    return nested_table(path.name, _by_child("hdf", path))


def _parquet(path: Path) -> Table:
    _needed("pyarrow.parquet", f"{path.name} is a Parquet file", "save it as CSV")
    return nested_table(path.name, _by_child("parquet", path))


def _sheet(path: Path) -> Table:
    """The first sheet that holds a table, read as the lines of a text."""
    _needed("openpyxl", f"{path.name} is an Excel file", "save it as CSV")
    import openpyxl

    def cell(value: Any) -> str:
        return "" if value is None else str(value).replace("\t", " ").replace("\n", " ")

    book = openpyxl.load_workbook(path, read_only=True, data_only=True)
    sheets = [
        ["\t".join(map(cell, row)) for row in sheet.iter_rows(values_only=True)]
        for sheet in book.worksheets
    ]
    book.close()
    problem = InputError(f"{path.name} holds no sheet.")
    for lines in sheets:
        try:
            return text_table(path.name, "\n".join(lines))
        except InputError as error:
            problem = error
    raise problem


def _needed(module: str, what: str, instead: str) -> None:
    """InputError that names the extra if a library is not installed."""
    hidden = module in sys.modules and sys.modules[module] is None
    name = module.split(".")[0]
    if hidden or importlib.util.find_spec(name) is None:
        extra = 'install it with pip install "lugrectl[files]"'
        raise InputError(f"{what}, which needs {name}: {extra}, or {instead}.")


def _by_child(how: str, path: Path) -> Any:
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
        raise ValueError(answer)
    return answer


_READERS: tuple[tuple[bytes, str, Callable[[Path], Table]], ...] = (
    (b"MATLAB 7.3", "HDF5", _hdf),
    (b"\x89HDF", "HDF5", _hdf),
    (b"MATLAB 5.0", "MAT", _mat),
    (b"\x93NUMPY", "NPY", _npy),
    (b"PK\x03\x04", "NPZ", _zip),
    (b"PAR1", "Parquet", _parquet),
)


# ---- columns out of nested content --------------------------------------------------


def nested_table(source: str, content: Any, hint: str = "") -> Table:
    """The columns of structs, dicts, lists of dicts, matrices and structured arrays: ``rec.x[2]``
    is column 2 of the matrix x in rec."""
    found = list(_flat("", content, "", _DEPTH))
    longest = max((len(values) for *_, values in found), default=0)
    found = [one for one in found if len(one[-1]) > max(1, _SHORT * longest)]
    heads = heads_of([path for path, *_ in found])
    if len(found) < 2:
        listed = ", ".join(name for name, *_ in heads) or "none"
        raise InputError(
            f"{source} needs at least two one-dimensional numeric arrays of equal length "
            f"(found: {listed}). {hint}".rstrip()
        )
    values: list[Any] = [x for *_, x in found]
    for i, (own, (_, label, x)) in enumerate(zip(heads, found, strict=True)):
        ((_, plain, unit),) = heads_of([label or own[0]])
        dated = x.dtype.kind in "US"
        heads[i] = own[0], plain if label else own[1], "s" if dated else own[2] or unit
        values[i] = seconds(list(x)) if dated else x
    if all(name.isdecimal() for name, *_ in heads):
        heads = [(name, "", unit) for name, _, unit in heads]
    return array_table(source, heads, values, hint)


def _plain(value: Any) -> Any:
    """The same content as a dict of columns, a list or an array, however it is arranged."""
    kind = getattr(value, "dtype", None)
    if kind is not None and kind.names:
        return {name: value[name] for name in kind.names}
    if kind is not None and kind.kind in "OU":
        value = list(np.ravel(value))
    if isinstance(value, dict):
        columns, data = value.get("columns"), value.get("data")
        if isinstance(columns, list) and isinstance(data, list):  # pandas, orient="split"
            rows = [row for row in data if isinstance(row, list) and len(row) == len(columns)]
            return {name: [row[i] for row in rows] for i, name in enumerate(columns)}
        if len(value) > 20 and all(str(key).isdecimal() for key in value):  # orient="columns"
            value = list(value.values())
    if isinstance(value, (list, tuple)) and len(value) >= 20 and isinstance(value[0], dict):
        rows = [item if isinstance(item, dict) else {} for item in value]
        return {key: [row.get(key) for row in rows] for key in rows[0]}
    return value


def _flat(name: str, value: Any, label: str, depth: int) -> Flat:
    """(name, label, values) of each column below a value."""
    value = _plain(value)
    if depth == 0 or value is None:
        return
    if isinstance(value, dict):
        own = value.get("label", value.get("Name", ""))
        for key, inner in value.items():
            if not str(key).startswith("__"):
                named = own if isinstance(own, str) and str(key) in ("values", "Data") else ""
                below = f"{name}.{key}" if name else str(key)
                yield from _flat(below, inner, named, depth - 1)
    elif not isinstance(value, (list, tuple)):
        yield from _of_array(name, np.asarray(value), label)
    elif any(isinstance(item, (str, bytes)) for item in value):
        cells = ["" if item is None else item for item in value]
        if all(isinstance(item, str) for item in cells):
            if sum(map(is_stamp, cells)) > len(cells) / 2:
                yield name, label or "time", np.array(cells)
    else:
        try:
            made = np.array([np.nan if item is None else item for item in value])
        except (ValueError, TypeError):  # of unequal lengths: arrays of their own
            made = np.empty(0, dtype=object)
        if made.dtype != object:
            yield from _of_array(name, made, label)
        elif len(value) < 20:
            for i, item in enumerate(value):
                yield from _flat(f"{name}[{i + 1}]", item, "", depth - 1)


def _of_array(name: str, array: np.ndarray, label: str) -> Flat:
    if array.dtype.kind == "M":
        array, label = seconds_of(array.ravel()), label or "time"
    array = np.squeeze(array)
    if array.dtype.kind not in "fiub":
        return
    if array.ndim == 1:
        yield name, label, array
    if array.ndim != 2 or min(array.shape) > _MOST or max(array.shape) < 20:
        return
    if array.shape[0] < array.shape[1]:
        array = array.T
    labels = [part.strip() for part in label.split(",")]
    for i in range(array.shape[1]):
        named = labels[i] if len(labels) == array.shape[1] else ""
        yield (f"{name}[{i + 1}]" if name else str(i + 1)), named, array[:, i]

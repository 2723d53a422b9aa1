"""Tables of named columns from CSV, MAT, NPZ, HDF5 and Parquet files."""

from __future__ import annotations

import zipfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import scipy.io

from ..errors import InputError
from .textfile import Table, read_text, split_unit

_EXTRA = 'install it with pip install "lugrectl[files]"'


def read_table(path: str | Path) -> Table:
    """Open a file of columns; its first bytes, not its name, decide its format.

    Raises InputError if the file is missing, a directory, empty or of an unknown format.
    """
    path = Path(path)
    try:
        if path.is_dir():
            raise InputError(f"{path} is a directory; name the file with the record.")
        if not path.exists():
            raise InputError(f"{path}: no such file.")
        with path.open("rb") as file:
            head = file.read(512)
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror or error}.") from None
    if not head.strip():
        raise InputError(f"{path.name} is empty.")
    return _reader(path, head)(path)


def _reader(path: Path, head: bytes) -> Callable[[Path], Table]:
    if head.startswith(b"MATLAB 7.3") or head.startswith(b"\x89HDF"):
        return _read_hdf
    if head.startswith(b"MATLAB 5.0") or path.suffix.lower() == ".mat":
        return _read_mat
    if head.startswith(b"PK\x03\x04"):
        return _read_npz
    if head.startswith(b"PAR1"):
        return _read_parquet
    return read_text


# ---- arrays by name -----------------------------------------------------------------


def _read_mat(path: Path) -> Table:
    try:
        content = scipy.io.loadmat(path, simplify_cells=True)
    except Exception as error:  # scipy raises many kinds on a damaged file
        raise InputError(f"{path.name} is not a readable MAT file: {error}.") from None
    return _array_table(path, {k: v for k, v in content.items() if not k.startswith("__")})


def _read_npz(path: Path) -> Table:
    try:
        with zipfile.ZipFile(path) as archive:
            if "[Content_Types].xml" in archive.namelist():
                raise InputError(f"{path.name} is a spreadsheet; save it as CSV.")
        with np.load(path, allow_pickle=False) as archive:
            return _array_table(path, {name: archive[name] for name in archive.files})
    except InputError:
        raise
    except Exception as error:  # numpy and zipfile raise many kinds on a damaged file
        raise InputError(f"{path.name} is not a readable NPZ file: {error}.") from None


def _read_hdf(path: Path) -> Table:
    try:
        import h5py  # pyright: ignore[reportMissingImports]
    except ImportError:
        raise InputError(
            f"{path.name} is a MATLAB v7.3 (HDF5) file, which needs h5py: {_EXTRA}, "
            "or save it in MATLAB with the option '-v7'."
        ) from None
    arrays: dict[str, np.ndarray] = {}

    def keep(name: str, item: Any) -> None:
        if isinstance(item, h5py.Dataset) and "#refs#" not in name:
            arrays[name.replace("/", ".")] = np.asarray(item[()])

    try:
        with h5py.File(path, "r") as file:
            file.visititems(keep)
    except OSError as error:
        raise InputError(f"{path.name} is not a readable HDF5 file: {error}.") from None
    return _array_table(path, arrays)


def _read_parquet(path: Path) -> Table:
    try:
        import pyarrow.parquet as parquet  # pyright: ignore[reportMissingImports]
    except ImportError:
        raise InputError(
            f"{path.name} is a Parquet file, which needs pyarrow: {_EXTRA}, or save it as CSV."
        ) from None
    try:
        table = parquet.read_table(path)
    except Exception as error:  # pyarrow raises many kinds on a damaged file
        raise InputError(f"{path.name} is not a readable Parquet file: {error}.") from None
    columns = zip(table.column_names, table.columns, strict=True)
    return _array_table(path, {name: column.to_numpy() for name, column in columns})


def _flat(content: dict[str, Any], prefix: str = "") -> dict[str, np.ndarray]:
    """Return the 1-D numeric arrays of nested dicts, by dotted name; scalars are left out."""
    found: dict[str, np.ndarray] = {}
    for name, value in content.items():
        if isinstance(value, dict):
            found |= _flat(value, f"{prefix}{name}.")
            continue
        array = np.asarray(None if isinstance(value, list) else value)
        if array.dtype.kind in "fiub" and array.size > 1 and max(array.shape) == array.size:
            found[prefix + str(name)] = array.ravel()
    return found


def _array_table(path: Path, content: dict[str, Any]) -> Table:
    arrays = _flat(content)
    if len(arrays) < 2:
        found = ", ".join(arrays) or "none"
        raise InputError(
            f"{path.name} needs at least two one-dimensional numeric arrays of equal length "
            f"(found: {found})."
        )
    heads = [split_unit(name) for name in arrays]

    def load(indices: Sequence[int]) -> tuple[list[np.ndarray], list[str]]:
        chosen = [list(arrays.items())[i] for i in indices]
        if len({values.size for _, values in chosen}) > 1:
            sizes = ", ".join(f"{name} {values.size}" for name, values in chosen)
            raise InputError(f"{path.name}: the columns differ in length ({sizes}).")
        return [np.asarray(values, dtype=np.float64) for _, values in chosen], []

    names, units = zip(*heads, strict=True)
    return Table(path.name, names, units, load, lambda row: f"sample {row + 1}")

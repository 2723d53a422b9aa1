"""Small valid files of each format, and ways to spoil them."""

from __future__ import annotations

import io
import re
from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import scipy.io

from ..cases.logs import driven, rubbing

CYCLE = "csv csv toml csv mat npz toml csv hdf parquet".split()
SUFFIX = {"hdf": ".h5"}
DT, SAMPLES = 2e-3, 400
Rng = np.random.Generator
Columns = dict[str, np.ndarray]


@cache
def motion() -> Columns:
    """A short log of a drive with friction."""
    t = np.arange(SAMPLES) * DT
    u = 0.5 * np.sin(2 * np.pi * 3 * t) + 0.3 * np.sin(2 * np.pi * 7.3 * t + 1.0)
    w, theta = driven(u, DT, rubbing(2e-3, 0.15, 0.02, 0.05), 20)
    return {"t": np.round(t, 6), "u": np.round(u, 6), "w": np.round(w, 5), "theta": theta.round(6)}


MODEL = """name = "bench"
motion = "rotary"

[plant]
J = 0.0022

[friction]
model = "lugre"
sigma0 = 260.0
Fc = {value = 0.285, fixed = true}
Fs = {min = 0.1, max = 0.5}
Fv = {value = 0.018, std = 0.002}

[[effects]]
name = "gravity"
amplitude = 0.2
phase = 0.0
"""


def whole(kind: str, rng: Rng, folder: Path) -> bytes:
    """The bytes of a valid file, of odd content now and then."""
    if kind == "toml":
        return MODEL.encode()
    columns = dict(motion())
    if rng.random() < 0.3:
        name = str(rng.choice(list(columns)))
        x = columns[name]
        odd = [np.full(SAMPLES, np.nan), np.full(SAMPLES, 1e308), x.astype("f2"), x > 0, x + 0j]
        odd += [np.where(rng.random(SAMPLES) < 0.2, np.inf, x), np.full(SAMPLES, 2**63, "u8")]
        columns[name] = odd[rng.integers(len(odd))]
    if kind == "csv":
        heads = ["t,u,w,theta", "t [s],u [N m],w [rad/s],theta [rad]", "time;torque;speed"]
        rows = zip(*(map(str, x.tolist()) for x in columns.values()), strict=True)
        return "\n".join([str(rng.choice(heads)), *map(",".join, rows), ""]).encode()
    if kind in ("hdf", "parquet"):
        return _by_library(kind, motion(), folder)
    out = io.BytesIO()
    if kind == "npz":
        np.savez_compressed(out, **columns)
    else:
        nested = {"log": columns} if rng.random() < 0.3 else columns
        scipy.io.savemat(out, nested, do_compression=bool(rng.random() < 0.5))
    return out.getvalue()


def _by_library(kind: str, columns: Columns, folder: Path) -> bytes:
    import h5py
    import pyarrow
    import pyarrow.parquet

    path = folder / "whole"
    if kind == "parquet":
        pyarrow.parquet.write_table(pyarrow.table(columns), path)
    else:
        with h5py.File(path, "w") as file:
            for name, values in columns.items():
                file[f"run/{name}"] = values
    return path.read_bytes()


# ---- ways to spoil bytes of any kind ------------------------------------------------


def cut(data: bytes, rng: Rng) -> bytes:
    return data[: int(rng.integers(0, len(data) + 1))]


def flip(data: bytes, rng: Rng) -> bytes:
    out = bytearray(data)
    most = int(rng.choice([300, len(out)]))  # the header alone, or all
    for at in rng.integers(0, min(most, len(out)), int(rng.integers(1, 30))) if out else ():
        out[at] = int(rng.integers(256))
    return bytes(out)


def put_in(data: bytes, rng: Rng) -> bytes:
    """Something else in place of a piece."""
    a, b = sorted(rng.integers(0, len(data) + 1, 2).tolist())
    many = int(rng.integers(0, 2000))
    other = [b"", b"\0" * many, rng.bytes(many), data]
    return data[:a] + other[rng.integers(len(other))] + data[b:]


# ---- of text ------------------------------------------------------------------------

CELLS = ["1e400", "-1e308", "1" + "0" * 400, "0x1p3", "1e", "--3", "NaN", "inf", "-", "1_000",
         "٣", "1.2.3", "true", "#N/A", "", " ", "1e-400", "12:34:56", "2024-02-30", "½", "1,5",
         '"x"', "[]", "{}", "{a = 1}", "[[[[]]]]", "{value = nan}", "{min = 2, max = 1}", '"\\0"',
         "{std = -1}", "07:32:00", "[plant]", "[[plant]]", "[x", "plant.J", "u,u,u,u",
         "t [furlong],u [N m],w [rad/s]", "T,U,W,Theta,x" * 40, "[" * 3000, "1," * 30000,
         ]  # fmt: skip
MARKS = [",", ";", "\t", " ", "|", ".", "'", "_", '"', "#", "%", "//", "\r", "\n", "\0", "\ufeff"]


def strange(text: str, rng: Rng) -> str:
    """Cells, keys and values that are no usual ones."""
    pieces = re.split(r"([,\n=])", text)
    for at in rng.integers(0, len(pieces), int(rng.integers(1, 40))):
        if pieces[at] not in (",", "\n", "="):
            pieces[at] = str(rng.choice(CELLS))
    return "".join(pieces)


def marked(text: str, rng: Rng) -> str:
    """One mark in place of another: decimal commas, groups, quotes, other ends of lines."""
    for _ in range(int(rng.integers(1, 3))):
        text = text.replace(str(rng.choice([",", ".", "\n", "="])), str(rng.choice(MARKS)))
    return text


def arranged(text: str, rng: Rng) -> str:
    """Lines in another order, lost, twice or behind a mark."""
    lines = text.split("\n")
    order = rng.permutation(len(lines)) if rng.random() < 0.5 else np.arange(len(lines))
    kept = order[: int(rng.choice([2, 20, len(order)]))]
    mark = str(rng.choice(["", *MARKS]))
    return "\n".join(mark * int(rng.random() < 0.2) + lines[i] for i in [*kept, *kept[:3]])


def encoded(data: bytes, rng: Rng) -> bytes:
    codec = str(rng.choice(["utf-16", "utf-16-le", "utf-32", "utf-7", "cp500", "utf-8-sig"]))
    return data.decode("utf-8", "replace").encode(codec, "replace")


def _of_text(way: Callable[[str, Rng], str]) -> Callable[[bytes, Rng], bytes]:
    def spoil(data: bytes, rng: Rng) -> bytes:
        text = data.decode("utf-8", "surrogateescape")
        return way(text, rng).encode("utf-8", "surrogateescape")

    spoil.__name__ = way.__name__
    return spoil


ANY = [cut, flip, put_in]
TEXT = [*map(_of_text, (strange, marked, arranged)), encoded]


def case(number: int, folder: Path) -> tuple[Path, str, list[str]]:
    """The file of a case, written; its format; the names of what was done to it."""
    rng = np.random.default_rng([49, number])
    kind = CYCLE[number % len(CYCLE)]
    data = whole(kind, rng, folder)
    ways = [*TEXT, *TEXT, *ANY] if kind in ("csv", "toml") else ANY
    chosen = [ways[i] for i in rng.integers(0, len(ways), 1 + int(rng.random() < 0.3))]
    for way in chosen:
        data = way(data, rng)
    path = folder / f"case{number}{SUFFIX.get(kind, '.' + kind)}"
    path.write_bytes(data)
    return path, kind, [way.__name__ for way in chosen]

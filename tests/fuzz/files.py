"""Small valid files of each format, and ways to spoil them."""

from __future__ import annotations

import io
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import scipy.io

from ..cases.logs import driven, rubbing

CYCLE = "csv csv toml csv mat npz toml csv hdf parquet".split()
SUFFIX = {"csv": ".csv", "toml": ".toml", "mat": ".mat", "npz": ".npz", "hdf": ".h5"}
SUFFIX |= {"parquet": ".parquet"}
DT, SAMPLES = 2e-3, 400
Rng = np.random.Generator


@cache
def motion() -> dict[str, np.ndarray]:
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
sigma1 = 0.6
Fc = {value = 0.285, fixed = true}
Fs = {min = 0.1, max = 0.5}
Fv = {value = 0.018, std = 0.002}

[[effects]]
name = "gravity"
amplitude = 0.2
phase = 0.0

[[effects]]
name = "torque_ripple"
harmonic = 12
"""


def whole(kind: str, rng: Rng, folder: Path) -> bytes:
    """The bytes of a valid file."""
    if kind == "toml":
        return MODEL.encode()
    columns = _odd(motion(), rng) if rng.random() < 0.3 else dict(motion())
    return {"csv": _csv, "mat": _mat, "npz": _npz, "hdf": _hdf, "parquet": _parquet}[kind](
        columns, rng, folder
    )


def _odd(columns: dict[str, Any], rng: Rng) -> dict[str, Any]:
    """Columns that no log has: of another kind, length, shape, or with values at the limits."""
    made = dict(columns)
    name = str(rng.choice(list(made)))
    n = len(made[name])
    values = [
        np.full(n, np.nan),
        np.full(n, 1e308),
        made[name].astype("f2"),
        made[name][: int(rng.integers(0, n))],
        np.tile(made[name], (2, 1)),
        np.empty((0,)),
        np.array(["a"] * n),
        np.array(3.0),
        made[name] + 0j,
        made[name] > 0,
        np.where(rng.random(n) < 0.2, np.inf, made[name]),
        np.full(n, 2**63, "u8"),
        made[name].astype(">f4"),
        made[name].astype("M8[ns]"),
    ]
    made[name] = values[rng.integers(len(values))]
    return made


def _csv(columns: dict[str, Any], rng: Rng, folder: Path) -> bytes:
    columns = {k: np.ravel(v) for k, v in columns.items()}
    n = max(len(v) for v in columns.values())
    head = rng.choice(["t,u,w,theta", "t [s],u [N m],w [rad/s],theta [rad]", "time;torque;speed"])
    cells = [[_cell(v[i]) if i < len(v) else "" for v in columns.values()] for i in range(n)]
    lines = [str(head), *(",".join(row) for row in cells)]
    return ("\n".join(lines) + "\n").encode()


def _cell(value: Any) -> str:
    return repr(value.item()) if isinstance(value, np.generic) else str(value)


def _mat(columns: dict[str, Any], rng: Rng, folder: Path) -> bytes:
    content = {"log": columns} if rng.random() < 0.3 else columns
    content = {k: v for k, v in content.items() if getattr(v, "dtype", None) != np.dtype("M8[ns]")}
    out = io.BytesIO()
    scipy.io.savemat(out, content, do_compression=bool(rng.random() < 0.5))
    return out.getvalue()


def _npz(columns: dict[str, Any], rng: Rng, folder: Path) -> bytes:
    out = io.BytesIO()
    (np.savez if rng.random() < 0.5 else np.savez_compressed)(out, **columns)
    return out.getvalue()


def _hdf(columns: dict[str, Any], rng: Rng, folder: Path) -> bytes:
    import h5py

    path = folder / "whole.h5"
    with h5py.File(path, "w") as file:
        for name, values in columns.items():
            if values.dtype.kind not in "UM":
                file[f"run/{name}" if rng.random() < 0.3 else name] = values
    return path.read_bytes()


def _parquet(columns: dict[str, Any], rng: Rng, folder: Path) -> bytes:
    import pyarrow as pa
    import pyarrow.parquet as pq

    n = len(motion()["t"])
    kept = {k: v for k, v in columns.items() if v.ndim == 1 and len(v) == n and v.dtype.kind != "c"}
    kept = {k: v.astype(v.dtype.newbyteorder("=")) for k, v in kept.items()}
    if rng.random() < 0.2:
        kept["nested"] = [{"a": float(i)} for i in range(n)]  # pyright: ignore[reportArgumentType]
    out = io.BytesIO()
    pq.write_table(pa.table(kept), out)
    return out.getvalue()


# ---- ways to spoil bytes of any kind ------------------------------------------------


def cut(data: bytes, rng: Rng) -> bytes:
    return data[: int(rng.integers(0, len(data) + 1))]


def flip(data: bytes, rng: Rng) -> bytes:
    out = bytearray(data)
    for at in rng.integers(0, len(out), int(rng.integers(1, 30))) if out else ():
        out[at] = int(rng.integers(256))
    return bytes(out)


def flip_head(data: bytes, rng: Rng) -> bytes:
    return flip(data[:300], rng) + data[300:]


def drop(data: bytes, rng: Rng) -> bytes:
    a, b = sorted(rng.integers(0, len(data) + 1, 2).tolist())
    return data[:a] + data[b:]


def twice(data: bytes, rng: Rng) -> bytes:
    return data + data


def zeros(data: bytes, rng: Rng) -> bytes:
    at = int(rng.integers(0, len(data) + 1))
    return data[:at] + b"\0" * int(rng.integers(1, 2000)) + data[at:]


def noise(data: bytes, rng: Rng) -> bytes:
    return rng.bytes(int(rng.integers(0, 3000)))


ANY: list[Callable[[bytes, Rng], bytes]] = [cut, flip, flip_head, drop, twice, zeros, noise]


def untouched(data: bytes, rng: Rng) -> bytes:
    return data


# ---- of text ------------------------------------------------------------------------


def _lines(change: Callable[[list[str], Rng], list[str]]) -> Callable[[bytes, Rng], bytes]:
    def spoil(data: bytes, rng: Rng) -> bytes:
        text = data.decode("utf-8", "surrogateescape")
        return "\n".join(change(text.split("\n"), rng)).encode("utf-8", "surrogateescape")

    spoil.__name__ = change.__name__
    return spoil


def swapped(lines: list[str], rng: Rng) -> list[str]:
    order = rng.permutation(4)
    return [
        ",".join(row[i] for i in order) if len(row := line.split(",")) == 4 else line
        for line in lines
    ]


def quoted(lines: list[str], rng: Rng) -> list[str]:
    """Some cells in quotes, some quotes not closed."""
    mark = str(rng.choice(['"', "'", '""', "`"]))
    open_ = rng.random() < 0.3

    def one(cell: str) -> str:
        return cell if rng.random() < 0.5 else mark + cell + ("" if open_ else mark)

    return [",".join(map(one, line.split(","))) for line in lines]


def comma(lines: list[str], rng: Rng) -> list[str]:
    """Decimal commas, with another separator or with the same."""
    between = str(rng.choice([";", "\t", " ", ",", "|"]))
    return [between.join(c.replace(".", ",") for c in line.split(",")) for line in lines]


def grouped(lines: list[str], rng: Rng) -> list[str]:
    """Groups of thousands."""
    mark = str(rng.choice([",", ".", "'", " ", "_"]))

    def one(cell: str) -> str:
        try:
            value = float(cell) * 1e4
        except ValueError:
            return cell
        text = f"{value:,.2f}"
        return text.translate({44: mark, 46: "," if mark == "." else "."})

    return [";".join(map(one, line.split(","))) for line in lines]


def mixed(lines: list[str], rng: Rng) -> list[str]:
    return [line.replace(",", str(rng.choice([",", ";", "\t", " , ", " "]))) for line in lines]


def ragged(lines: list[str], rng: Rng) -> list[str]:
    return [line + ",9" * int(rng.integers(0, 3)) if rng.random() < 0.3 else line for line in lines]


HUGE = ["1e400", "-1e308", "1" + "0" * 400, "0x1p3", "1e", "--3", "NaN", "inf", "-", "1_000",
        "٣", "1.2.3", "true", "#N/A", "", " ", "1e-400", "12:34:56", "2024-02-30", "½",
        "1,5"]  # fmt: skip


def strange(lines: list[str], rng: Rng) -> list[str]:
    """Cells that are no usual numbers."""
    made = list(lines)
    for at in rng.integers(0, len(made), int(rng.integers(1, 40))):
        cells = made[at].split(",")
        cells[int(rng.integers(len(cells)))] = str(rng.choice(HUGE))
        made[at] = ",".join(cells)
    return made


def headed_twice(lines: list[str], rng: Rng) -> list[str]:
    """A header again, one of equal names, or none."""
    heads = ["u,u,u,u", "t,t,w,w", "", "t,u,w,theta\nt,u,w,theta", ",,,", "t,u\0,w,theta"]
    heads += [
        "\ufefft,u,w,theta",
        "t [furlong],u [N m],w [rad/s],theta [deg]",
        "T,U,W,Theta,x" * 40,
    ]
    return [str(rng.choice(heads)), *lines[1:]]


def headed_inside(lines: list[str], rng: Rng) -> list[str]:
    at = int(rng.integers(1, len(lines) + 1))
    return [*lines[:at], lines[0], *lines[at:]]


def commented(lines: list[str], rng: Rng) -> list[str]:
    mark = str(rng.choice(["#", "%", "//", ";"]))
    return [mark + line if rng.random() < 0.2 else line for line in lines]


def long_line(lines: list[str], rng: Rng) -> list[str]:
    return [*lines, ",".join(["1"] * int(rng.integers(1000, 60000)))]


def shuffled(lines: list[str], rng: Rng) -> list[str]:
    return [lines[i] for i in rng.permutation(len(lines))]


def empty_table(lines: list[str], rng: Rng) -> list[str]:
    return lines[: int(rng.integers(0, 4))]


def encoded(data: bytes, rng: Rng) -> bytes:
    codec = str(rng.choice(["utf-16", "utf-16-le", "utf-32", "utf-7", "cp500", "utf-8-sig"]))
    return data.decode("utf-8", "replace").encode(codec, "replace")


def returns(data: bytes, rng: Rng) -> bytes:
    return data.replace(b"\n", [b"\r", b"\r\n", b"\n\r", b"\n\n", b"\x0b", b""][rng.integers(6)])


TEXT = [*map(_lines, (swapped, quoted, comma, grouped, mixed, ragged, strange, headed_twice,
                      headed_inside, commented, long_line, shuffled, empty_table)),
        encoded, returns]  # fmt: skip

# ---- of model files -----------------------------------------------------------------

VALUES = ["3", "-1", "0", "1e400", "inf", "nan", "true", '"x"', "[]", "[1, 2]", "{}", "{a = 1}",
          "1" + "0" * 400, "2024-01-01", "[[[[]]]]", "{value = {value = 1}}", '"\\u0000"', "0x1F",
          "{min = 2, max = 1}", "{value = 1, fixed = 3}", "{std = -1}", "''", "1_0", '"""a\n"""',
          "{value = nan}", "07:32:00", "[{}]", "{min = -inf}", "-0.0", "1e-320"]  # fmt: skip
KEYS = ["J", "plant", "friction", "effects", "name", "motion", "model", "Fc", '"a b"', '""',
        "blocks", "gravity", "amplitude", "vs", "sigma0", "friction.model", "plant.J",
        '"\\u0000"']  # fmt: skip


def other_value(lines: list[str], rng: Rng) -> list[str]:
    at = rng.choice([i for i, line in enumerate(lines) if "=" in line])
    key = lines[at].split("=")[0]
    return [*lines[:at], f"{key}= {rng.choice(VALUES)}", *lines[at + 1 :]]


def other_key(lines: list[str], rng: Rng) -> list[str]:
    at = rng.choice([i for i, line in enumerate(lines) if "=" in line])
    value = lines[at].split("=", 1)[1]
    return [*lines[:at], f"{rng.choice(KEYS)} ={value}", *lines[at + 1 :]]


def more(lines: list[str], rng: Rng) -> list[str]:
    at = int(rng.integers(0, len(lines) + 1))
    return [*lines[:at], f"{rng.choice(KEYS)} = {rng.choice(VALUES)}", *lines[at:]]


def other_table(lines: list[str], rng: Rng) -> list[str]:
    heads = [
        "[plant]",
        "[[plant]]",
        "[effects]",
        "[[effects]]",
        "[friction.x]",
        "[a.b]",
        "[x",
        "[]",
    ]
    heads += ['["plant"]', "[[effects.x]]", "[friction]"]
    at = rng.choice([i for i, line in enumerate(lines) if line.startswith("[")])
    return [*lines[:at], str(rng.choice(heads)), *lines[at + 1 :]]


def deep(lines: list[str], rng: Rng) -> list[str]:
    many = int(rng.integers(10, 4000))
    return [
        *lines,
        f"deep = {'[' * many}{']' * many}" if rng.random() < 0.5 else "a." * many + "b = 1",
    ]


TOML = [*map(_lines, (other_value, other_value, other_key, more, other_table, deep, shuffled,
                      quoted, empty_table)), encoded, returns]  # fmt: skip


def case(number: int, folder: Path) -> tuple[Path, str, list[str]]:
    """The file of a case, written; its format; the names of what was done to it."""
    rng = np.random.default_rng([49, number])
    kind = CYCLE[number % len(CYCLE)]
    data = whole(kind, rng, folder)
    own = {"csv": TEXT, "toml": TOML}.get(kind, [])
    ways = [*own, *own, *ANY] if own else [*ANY, untouched]
    chosen = [ways[i] for i in rng.integers(0, len(ways), 1 + int(rng.random() < 0.3))]
    for way in chosen:
        try:
            data = way(data, rng)
        except (ValueError, UnicodeError):  # a second way finds nothing left to spoil
            continue
    path = folder / f"case{number}{SUFFIX[kind]}"
    path.write_bytes(data)
    return path, kind, [way.__name__ for way in chosen]

"""MAT files of version 5 to 7, read with every length checked: no damage ends the process."""

from __future__ import annotations

import math
import struct
import zlib
from collections.abc import Iterator
from typing import Any

import numpy as np

_TYPES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8"} | {
    12: "i8", 13: "u8", 16: "u1", 17: "u2", 18: "u4"}  # fmt: skip
_MATRIX, _COMPRESSED = 14, 15
_CELL, _STRUCT, _CHAR, _OPAQUE = 1, 2, 4, 17
_DEPTH = 30


class Damaged(ValueError):
    """The bytes are no MAT file; the text says what is wrong."""


class Opaque:
    """An object that only MATLAB can read, such as a timeseries or a table."""


def read_mat(data: bytes) -> dict[str, Any]:
    """Variables by name: arrays, dicts of structs, lists of cells; Damaged."""
    if data[126:128] not in (b"IM", b"MI"):
        raise Damaged("it is not of version 5 to 7; save it in MATLAB with the option '-v7'")
    try:
        return _variables(data)
    except (struct.error, zlib.error, IndexError, ValueError, OverflowError, MemoryError,
            RecursionError) as error:  # fmt: skip
        raise Damaged(str(error) or type(error).__name__) from None


def _variables(data: bytes) -> dict[str, Any]:
    order = "<" if data[126:128] == b"IM" else ">"
    found = {}
    for kind, payload in _elements(data[128:], order):
        if kind == _COMPRESSED:
            inner = zlib.decompress(payload)
            kind, payload = next(_elements(inner, order), (0, b""))
        if kind != _MATRIX:
            raise Damaged(f"an element of type {kind} where a variable belongs")
        name, value = _matrix(payload, order, _DEPTH)
        if name and not name.startswith("__"):
            found[name] = value
    return found


def _elements(data: bytes, order: str) -> Iterator[tuple[int, bytes]]:
    at = 0
    while at + 8 <= len(data):
        kind, size = struct.unpack_from(order + "II", data, at)
        start, padded = at + 8, True
        if kind >> 16:  # a small element, in the tag itself
            size, kind, start, padded = kind >> 16, kind & 0xFFFF, at + 4, False
            if size > 4:
                raise Damaged("an element is longer than its place")
        if start + size > len(data):
            raise Damaged("an element is longer than the file")
        yield kind, data[start : start + size]
        at = (start + size if kind == _COMPRESSED else start + -(-size // 8) * 8) if padded else (
            at + 8)  # fmt: skip


def _matrix(data: bytes, order: str, depth: int) -> tuple[str, Any]:
    """The name and the content of a variable, or of a field or a cell of one."""
    if not data:
        return "", np.empty(0)
    if depth == 0:
        raise Damaged("structs lie too deep")
    parts = list(_elements(data, order))
    (flags,) = struct.unpack_from(order + "I", parts[0][1])
    kind = flags & 0xFF
    if kind == _OPAQUE:
        return _text(parts[1][1]), Opaque()
    dims = [int(n) for n in _numbers(parts[1], order)]
    name, rest, many = _text(parts[2][1]), parts[3:], math.prod(dims)
    if min(dims, default=0) < 0:
        raise Damaged("a dimension below 0")
    if kind == _CELL:
        return name, _inner(rest[:many], order, depth)
    if kind == _STRUCT:
        return name, _structs(rest, many, order, depth)
    if kind == _CHAR:
        return name, _numbers(rest[0], order).astype("u4").tobytes().decode("utf-32-le", "replace")
    if not 6 <= kind <= 15:  # sparse, a function
        return name, None
    values = _numbers(rest[0], order) if rest else np.empty(0)
    if values.size != many:
        raise Damaged(f"{name} has {values.size} numbers in place of {many}")
    return name, None if flags & 0x800 else values.reshape(dims, order="F")


def _inner(parts: list[tuple[int, bytes]], order: str, depth: int) -> list[Any]:
    for kind, _ in parts:
        if kind != _MATRIX:
            raise Damaged(f"an element of type {kind} where a matrix belongs")
    return [_matrix(payload, order, depth - 1)[1] for _, payload in parts]


def _structs(rest: list[tuple[int, bytes]], many: int, order: str, depth: int) -> Any:
    (length,) = struct.unpack_from(order + "i", rest[0][1])
    names = rest[1][1]
    if length <= 0:
        raise Damaged("a struct without names")
    fields = [_text(names[i : i + length]) for i in range(0, len(names), length)]
    values = _inner(rest[2:], order, depth)
    if len(values) != many * len(fields):
        raise Damaged("a struct that is not complete")
    rows = (values[k : k + len(fields)] for k in range(0, len(values), len(fields)))
    made = [dict(zip(fields, row, strict=True)) for row in rows]
    return made[0] if many == 1 else made


def _numbers(part: tuple[int, bytes], order: str) -> np.ndarray:
    kind, data = part
    if kind not in _TYPES:
        raise Damaged(f"numbers of an unknown type, {kind}")
    return np.frombuffer(data, dtype=order + _TYPES[kind]).astype(_TYPES[kind])


def _text(data: bytes) -> str:
    return data.split(b"\0")[0].decode("latin-1")

"""A user's own rows: a TOML file beside the logs.

[[row]]
name = "axis 3, warm"
files = ["warm1.csv", "warm2.csv"]      # relative to the data folder
model = {motion = "rotary"}             # tables as in a model file
columns = {u = "torque"}                # and units, scale, rate as read_record takes them
left = 0.08                             # share of RMS torque that a fit by hand leaves
values = {J = [1.2, 1.5], "gravity.amplitude" = [3.4, 3.7]}
needed = ["J"]                          # values that a right answer gives

[[row.right]]                           # one or several ways of being right
verdicts = ["found", "ambiguous"]
names = [["gravity"]]                   # from each list one is named
beside = ["velocity_sensor_lag"]        # may be named as well
depends_on = []
absent = []                             # values that cannot be known
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from .row import VERDICTS, Row, Source, Value, Way

_ROW = {"name", "group", "files", "model", "columns", "units", "scale", "rate", "left", "known"}
_ROW |= {"values", "needed", "right"}
_WAY = {"verdicts", "names", "beside", "depends_on", "absent"}


def rows_of(path: Path) -> list[Row]:
    """The rows of a file; SystemExit with one sentence where it cannot be understood."""
    try:
        data = tomllib.loads(path.read_text())
    except (OSError, tomllib.TOMLDecodeError) as error:
        raise SystemExit(f"--rows: {path} cannot be read: {error}.") from None
    entries = data.get("row")
    if not isinstance(entries, list) or not entries:
        raise SystemExit(f"--rows: {path} holds no [[row]].")
    return [_row(entry, f"{path}, row {i}") for i, entry in enumerate(entries, 1)]


def _row(entry: Mapping[str, Any], where: str) -> Row:
    _known(entry, _ROW, where)
    for key in ("name", "files", "right"):
        if not entry.get(key):
            raise SystemExit(f"{where}: {key} is missing.")
    options = {k: entry[k] for k in ("columns", "units", "scale", "rate") if k in entry}
    values = [
        Value(tuple(k.split(" or ")), *map(float, ends), needed=k in entry.get("needed", ()))
        for k, ends in entry.get("values", {}).items()
    ]
    return Row(
        entry["name"],
        entry.get("group", "own"),
        tuple(Source(file, options) for file in entry["files"]),
        entry.get("model", {"motion": "rotary"}),
        tuple(_way(one, where) for one in entry["right"]),
        tuple(values),
        entry.get("left"),
        entry.get("known", ""),
    )


def _way(entry: Mapping[str, Any], where: str) -> Way:
    _known(entry, _WAY, f"{where}, right")
    verdicts = frozenset(entry.get("verdicts", ()))
    if not verdicts or not verdicts <= set(VERDICTS):
        raise SystemExit(f"{where}, right: verdicts must be some of {', '.join(VERDICTS)}.")
    return Way(
        verdicts,
        tuple(frozenset(group) for group in entry.get("names", ())),
        frozenset(entry.get("beside", ())),
        frozenset(entry.get("depends_on", ())),
        absent=tuple(entry.get("absent", ())),
    )


def _known(entry: Mapping[str, Any], names: set[str], where: str) -> None:
    for key in entry:
        if key not in names:
            raise SystemExit(
                f"{where}: there is no key '{key}'; keys are {', '.join(sorted(names))}."
            )

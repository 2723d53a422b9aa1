"""A fleet as text, as an HTML page, as CSV, and as files."""

from __future__ import annotations

import csv
import io
import itertools
import os
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from ..core.display import NONE, Grid, number
from . import FILES, check_folder, write, written
from .page import Page, Section
from .wording import readable

INDEX: tuple[str, ...] = ("index.html", "summary.csv")
ERRORS = ("declared", "refitted", "augmented", "noise_floor")
_HEAD = ("log", "verdict", "declared", "refitted", "augmented", "noise", "unit", "s")
_ALIGN = "llrrrrlr"
_NOTE = (
    "RMS of measured minus simulated on held-out samples, for the declared model, the refitted "
    "one and the augmented one; noise is that of the sensor; s is the computing time."
)


def headline(fleet: Any) -> tuple[str, str]:
    n, left = len(fleet.outcomes), len(fleet.unfinished)
    counts = ", ".join(f"{many} {verdict}" for verdict, many in fleet.counts.items() if many)
    title = f"{n} log{'s' * (n != 1)}: {counts}" if n else "no log finished"
    against = f" against {fleet.model.name}" if fleet.model else ""
    meaning = f"Each log was diagnosed separately{against}."
    if left:
        meaning += f" Interrupted: {left} of {n + left} not diagnosed."
    return title, meaning


def details(row: Mapping[str, Any]) -> list[str]:
    """What was found in a log with its values, or why there is no answer."""
    said = [_effect(effect) for effect in row["effects"]]
    if row["verdict"] == "unexplained" and row["depends_on"]:
        said.append(f"{'the residual ' * bool(said)}depends on {', '.join(row['depends_on'])}")
    if row["message"] and row["verdict"] not in ("ambiguous", "unexplained"):
        said.append(row["message"])
    return said


def _effect(effect: Mapping[str, Any]) -> str:
    units = {k: "" if unit == "1" else f" {unit}" for k, unit in effect["units"].items()}
    values = ", ".join(f"{k} {number(v, 3)}{units[k]}" for k, v in effect["values"].items())
    others = " or ".join(effect["alternatives"])
    return f"{effect['name']}: {values}" + (f" (or {others})" if others else "")


def _cells(row: Mapping[str, Any], name: str) -> tuple[str, ...]:
    values = [row[k] for k in ERRORS]
    factor, unit = readable(values, row["unit"] or "")
    shown = [number(v if v is None else v * factor, 3) for v in values]
    return name, row["verdict"], *shown, unit or NONE, number(row["seconds"], 2)


def _shown(files: Sequence[str]) -> list[str]:
    """File names without the folder that they have in common."""
    try:
        common = os.path.commonpath([os.path.dirname(file) for file in files])
    except ValueError:  # absolute and relative names, or two drives
        return list(files)
    return [os.path.relpath(file, common) if common else file for file in files]


def page(fleet: Any, links: Mapping[str, str] | None = None) -> Page:
    names = _shown([row["file"] for row in fleet.rows])
    rows = list(zip(fleet.rows, names, strict=True))
    found = [f"- {name}: {'; '.join(said)}" for row, name in rows if (said := details(row))]
    table = Grid(_HEAD, _ALIGN, tuple(_cells(row, name) for row, name in rows))
    parts = [Section("Logs", (), table, _NOTE)] if rows else []
    parts += [Section("What was found", tuple(found))] if found else []
    left = tuple(f"- {file}" for file in fleet.unfinished)
    parts += [Section("Not diagnosed", left)] if left else []
    known = links or {}
    targets = {name: known[row["file"]] for row, name in rows if row["file"] in known}
    return Page(*headline(fleet), parts, links=targets)


def table_csv(fleet: Any, links: Mapping[str, str] | None = None) -> str:
    """One line per log, in SI units and full precision, for a spreadsheet."""
    errors = ("signal", "unit", *ERRORS)
    out = io.StringIO()
    table = csv.writer(out, lineterminator="\n")
    table.writerow(["file", "verdict", "effects", *errors, "seconds", "message", "report"])
    for row in fleet.rows:
        effects = "; ".join(_effect(effect) for effect in row["effects"])
        values = [row[k] for k in (*errors, "seconds", "message")]
        table.writerow(
            [row["file"], row["verdict"], effects, *values, (links or {}).get(row["file"], "")]
        )
    return out.getvalue()


def folder_names(files: Iterable[str]) -> list[str]:
    """A folder name for each log, its own in any case of letters."""
    used, names = {name.casefold() for name in INDEX}, []
    for file in files:
        stem = Path(file).stem.strip(" .") or "log"
        tries = itertools.chain([stem], (f"{stem}-{n}" for n in itertools.count(2)))
        names.append(next(name for name in tries if name.casefold() not in used))
        used.add(names[-1].casefold())
    return names


def write_all(fleet: Any, folder: str | Path) -> list[Path]:
    """Write the reports that were kept, index.html and summary.csv; the paths of these two."""
    check_folder(folder)
    links, kept = {}, fleet.diagnoses
    for (file, d), name in zip(kept.items(), folder_names(kept), strict=True):
        write(d, Path(folder) / name)
        links[file] = f"{name}/{FILES[0]}"
    return write_index(fleet, folder, links)


def write_index(fleet: Any, folder: str | Path, links: Mapping[str, str]) -> list[Path]:
    made = (page(fleet, links).html(), table_csv(fleet, links))
    return written(dict(zip(INDEX, made, strict=True)), Path(folder), "table")

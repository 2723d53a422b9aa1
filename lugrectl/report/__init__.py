"""Reports of a diagnosis: text for a terminal, HTML for Jupyter and as a page, files."""

from __future__ import annotations

import os
import textwrap
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from ..core.display import grid_text as _grid_text
from ..core.errors import InputError
from ..core.validation import shown
from .atomic import nearest, write_all_or_say
from .page import fragment, html
from .section import Section
from .wording import headline, sections, toml_of

__all__ = ["check_folder", "fragment", "html", "plain_text", "text", "write"]

WIDTH = 80
FILES: tuple[str, ...] = ("report.html", "report.json", "model.toml")


def text(d: Any) -> str:
    """The report in 80 columns: verdict, effects, error before and after, parameters, notes.

    ``d`` is a Diagnosis, or any result with ``estimates``, ``error``, ``model``, ``messages``.
    """
    title, meaning = headline(d)
    parts = [f"{title}\n{_wrapped(meaning, '  ')}", *map(_section_text, sections(d))]
    return "\n\n".join(parts) + "\n"


def plain_text(balance: Any) -> str:
    """The plain torque balance alone, with what was noticed, in 80 columns."""
    d = SimpleNamespace(plain=balance, messages=balance.reading)
    return "\n\n".join(_section_text(part) for part in sections(d)) + "\n"


def _section_text(part: Section) -> str:
    lines = [part.title]
    lines += [_wrapped(line, "  ", "    " if line[:2] == "- " else "  ") for line in part.lines]
    if part.grid:
        lines += _grid_text(part.grid)
    if part.footnote:
        lines.append(_wrapped(part.footnote, "  "))
    return "\n".join(lines)


def _wrapped(line: str, indent: str, later: str | None = None) -> str:
    return textwrap.fill(
        line,
        WIDTH,
        initial_indent=indent,
        subsequent_indent=indent if later is None else later,
        break_on_hyphens=False,
    )


def content(d: Any, folder: Path) -> dict[str, str]:
    """The files of a report in a folder as text, by name; model.toml where there is a model."""
    made = {FILES[0]: html(d, folder), FILES[1]: d.to_json() + "\n"}
    model = getattr(d, "model", None)
    return made if model is None else made | {FILES[2]: toml_of(d, folder)}


def write(d: Any, folder: str | Path) -> list[Path]:
    """Write report.html, report.json and model.toml into a folder, all of them or none.

    The folder is created if it is missing; other files in it are not changed. Returns the paths.
    A refusal has no model, and so no model.toml. Raises InputError when the folder cannot be
    written.
    """
    folder = _path(folder)
    return write_all_or_say(content(d, folder), folder, "report")


def check_folder(folder: str | Path) -> None:
    """Raise InputError if a report cannot be written into the folder."""
    base = nearest(_path(folder).absolute())
    if not base.is_dir():
        raise InputError(f"{folder}: {base} is not a folder; choose another path.")
    if not os.access(base, os.W_OK | os.X_OK):
        raise InputError(f"{folder}: no permission to write there; choose another folder.")


def _path(folder: Any) -> Path:
    if not isinstance(folder, (str, os.PathLike)):
        raise InputError(f"the folder must be a path, not {shown(folder)}.")
    return Path(folder)

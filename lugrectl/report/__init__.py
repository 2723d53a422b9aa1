"""Reports of a diagnosis: text for a terminal, HTML for Jupyter and as a page, files."""

from __future__ import annotations

import os
from collections.abc import Iterator
from html import escape
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from ..core.errors import InputError
from ..core.validation import shown
from ..core.writing import nearest, write_together
from .page import Figure, Page, Section, beside
from .wording import headline, sections, toml_of

__all__ = ["check_folder", "fragment", "html", "plain_text", "text", "write"]

FILES: tuple[str, ...] = ("report.html", "report.json", "model.toml")


def text(d: Any) -> str:
    """The report of a Diagnosis or an Identification in 80 columns."""
    return Page(*headline(d), sections(d)).text()


def plain_text(balance: Any) -> str:
    """The plain torque balance alone, with what was noticed, in 80 columns."""
    d = SimpleNamespace(plain=balance, messages=(*balance.against, *balance.reading))
    return "\n\n".join(part.text() for part in sections(d)) + "\n"


def fragment(d: Any) -> str:
    """The report as an HTML fragment with its own style and inline plots, for Jupyter."""
    return _page(d, _model_file(d, None)).fragment()


def html(d: Any, folder: Path | None = None) -> str:
    """The report as one self-contained page, with the model file as it stands in the folder."""
    more, known = _model_file(d, folder), getattr(d, "provenance", None)
    if known is not None:
        said = [f"lugrectl {known.version}, {known.date}", known.command]
        said += [f"{file.name}: SHA-256 {file.sha256}" for file in known.files]
        more.append(Section("Provenance", tuple(said)))
    return _page(d, more).html()


def _page(d: Any, more: list[Section | str]) -> Page:
    title, meaning = headline(d)
    return Page(title, meaning, [*_parts(d), *more], kind=title.split(":")[0])


def _parts(d: Any) -> Iterator[Section | Figure | str]:
    """The first section, the plots, the others, and the log."""
    from . import diagnosis_plots

    said, balance = sections(d), getattr(d, "plain", None)
    yield from (*said[:1], *diagnosis_plots.figures(d), *said[1:])
    if log := diagnosis_plots.log_figures(balance) if balance is not None else []:
        yield beside(log)


def _model_file(d: Any, folder: Path | None) -> list[Section | str]:
    if getattr(d, "model", None) is None:
        return []
    return [f"<h2>Model file</h2>\n<pre>{escape(toml_of(d, folder))}</pre>"]


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
    folder = _folder(folder)
    return written(content(d, folder), folder, "report")


def written(content: dict[str, str], folder: Path, what: str) -> list[Path]:
    """The paths of files written together; InputError says that ``what`` cannot be written."""
    complaint = f"the {what} cannot be written there ({{}}); choose another folder."
    return write_together(content, folder, complaint)


def check_folder(folder: str | Path) -> None:
    """Raise InputError if a report cannot be written into the folder."""
    base = nearest(_folder(folder).absolute())
    if not base.is_dir():
        raise InputError(f"{folder}: {base} is not a folder; choose another path.")
    if not os.access(base, os.W_OK | os.X_OK):
        raise InputError(f"{folder}: no permission to write there; choose another folder.")


def _folder(given: Any) -> Path:
    if not isinstance(given, (str, os.PathLike)):
        raise InputError(f"the folder must be a path, not {shown(given)}.")
    return Path(given)

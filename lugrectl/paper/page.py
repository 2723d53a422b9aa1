"""The reproduction as text, as an HTML page, and as files."""

from __future__ import annotations

import html as markup
from collections.abc import Iterator
from pathlib import Path

from .. import report
from ..report import page as look
from ..report.atomic import write_all_or_say
from ..report.wording import Section
from .figures import drawings
from .results import Reproduction
from .wording import closing, figure_section, headline, opening, study_section

FILES: tuple[str, ...] = ("reproduce.html", "reproduce.json")
_STYLE = """
.lugrectl td { vertical-align: top; }
.lugrectl .prose td { white-space: normal; }
"""
_CAPTIONS = {
    "paper": "Grey: reference. The dashed line (without friction) and the line with the proposed "
    "observer coincide.",
    "sweep": "The table above as a figure, logarithmic. Names as in its columns.",
    "envelope": "A straight line is growth or decay at a constant rate.",
}


def text(r: Reproduction) -> str:
    """The reproduction in about 80 columns."""
    title, meaning = headline(r)
    parts = [f"{title}\n{report._wrapped(meaning, '  ')}"]
    parts += [_as_text(part) for _, part in _sections(r)]
    return "\n\n".join(parts) + "\n"


def _as_text(part: Section) -> str:
    """A section; if the cells are sentences, each row becomes a paragraph."""
    if part.grid is None or "prose" not in _kind(part):
        return report._section_text(part)
    order = (0, 2, 1) if part.grid.head[0] == "paper" else (0, 1, 2)
    rows = [[row[i].rstrip(".") for i in order] for row in part.grid.rows]
    lines = tuple(f"- {said} ({status}): {why}." for said, status, why in rows)
    return report._section_text(Section(part.title, lines))


def _kind(part: Section) -> str:
    return "prose" if part.grid and part.grid.head[0] in ("paper", "label") else ""


def _sections(r: Reproduction) -> Iterator[tuple[str, Section]]:
    """Key of the figure that belongs to a section, or '', and the section."""
    for part in opening(r):
        yield "", part
    for figure in r.figures:
        yield f"paper-{figure.key}", figure_section(figure)
    for o in r.outcomes:
        yield o.study.key, study_section(o)
    for part in closing():
        yield "", part


def fragment(r: Reproduction) -> str:
    """The reproduction as an HTML fragment with its own style and inline plots, for Jupyter."""
    return f"<style>{look._STYLE}{_STYLE}</style>\n{_body(r)}"


def html(r: Reproduction) -> str:
    """The reproduction as one self-contained page: inline style and plots, nothing to fetch."""
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        "<title>lugrectl: the paper recomputed</title>\n"
        f"<style>{look._STYLE}{look._PAGE_STYLE}{_STYLE}</style>\n</head>\n"
        f"<body>\n{_body(r)}\n</body>\n</html>\n"
    )


def _body(r: Reproduction) -> str:
    title, meaning = headline(r)
    first = f"<h1>{markup.escape(title)}</h1>\n<p>{markup.escape(meaning)}</p>"
    parts = [f'<div class="verdict refused">\n{first}\n</div>']
    svg = drawings(r)
    for key, part in _sections(r):
        parts.append(_shown(part))
        if key in svg:
            caption = markup.escape(_caption(r, key))
            parts.append(f"<figure>\n{svg[key]}\n<figcaption>{caption}</figcaption>\n</figure>")
    return '<div class="lugrectl">\n' + "\n".join(parts) + "\n</div>"


def _shown(part: Section) -> str:
    made = look._section_html(part)
    return f'<div class="prose">{made}</div>' if _kind(part) else made


def _caption(r: Reproduction, key: str) -> str:
    o = r.outcome(key)
    if o is None:
        return _CAPTIONS["paper"]
    if o.study.drawn is None:
        return _CAPTIONS["sweep"]
    drawn = o.study.drawn
    case = f"{drawn.signal} in the case '{o.study.cases[drawn.case].label}', names as in the table."
    return f"{case} {_CAPTIONS['envelope']}" if o.study.loop == "position" else case


def write(r: Reproduction, folder: str | Path) -> list[Path]:
    """Write reproduce.html and reproduce.json into a folder, both or none.

    Raises InputError when the folder cannot be written.
    """
    report.check_folder(folder)
    folder = Path(folder)
    content = dict(zip(FILES, (html(r), r.to_json() + "\n"), strict=True))
    return write_all_or_say(content, folder, "page")

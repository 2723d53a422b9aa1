"""The one page of a result: sections and figures, as text, in Jupyter and as a file of its own."""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from html import escape
from typing import Any
from urllib.parse import quote

from ..core.display import Grid, grid_html, grid_text
from .canvas import SIZE, inline_svg

WIDTH = 80
_STYLE = """
.lugrectl { font: 16px/1.5 system-ui, "Segoe UI", Roboto, "Helvetica Neue", Arial, sans-serif;
  color: #1c2430; background: #fff; max-width: 46rem; overflow-wrap: break-word; }
.lugrectl h1 { font-size: 1.5rem; line-height: 1.25; margin: 0 0 .4rem; }
.lugrectl h2 { font-size: 1.05rem; margin: 1.8rem 0 .4rem; padding-bottom: .15rem;
  border-bottom: 1px solid #d9dee5; }
.lugrectl p { margin: .4rem 0; }
.lugrectl .verdict { padding: .8rem 1rem; border-left: .35rem solid #5b6675;
  background: #f4f6f8; }
.lugrectl .found { border-color: #1f6fb4; }
.lugrectl .adequate { border-color: #2f7d4f; }
.lugrectl .ambiguous, .lugrectl .unexplained { border-color: #c47f17; }
.lugrectl .refused { border-color: #b03a2e; }
.lugrectl .table { overflow-x: auto; }
.lugrectl table { border-collapse: collapse; font-size: .92rem; margin: .5rem 0;
  font-variant-numeric: tabular-nums; }
.lugrectl th, .lugrectl td { padding: .25rem .9rem .25rem 0; border-bottom: 1px solid #e6eaef;
  text-align: left; white-space: nowrap; background: none; }
.lugrectl th { font-weight: 600; color: #4a5563; }
.lugrectl .r { text-align: right; }
.lugrectl figure { margin: 1rem 0; break-inside: avoid; }
.lugrectl .small, .lugrectl figcaption { font-size: .88rem; color: #4a5563; }
.lugrectl svg { display: block; width: 100%; height: auto; max-width: 44rem; }
.lugrectl .log { display: grid; grid-template-columns: repeat(auto-fit, minmax(19rem, 1fr));
  column-gap: 1rem; }
.lugrectl pre { font-size: .85rem; line-height: 1.4; background: #f4f6f8; padding: .8rem 1rem;
  overflow-x: auto; }
"""
_ALONE = """
:root { color-scheme: light; }
body { margin: 0; padding: 1.5rem 1rem 3rem; background: #fff; }
.lugrectl { margin: 0 auto; }
"""


def wrapped(line: str, indent: str, later: str | None = None) -> str:
    """A paragraph of a text; ``later``: what its lines after the first begin with."""
    later = indent if later is None else later
    return textwrap.fill(
        line, WIDTH, initial_indent=indent, subsequent_indent=later, break_on_hyphens=False
    )


@dataclass(frozen=True)
class Section:
    """A titled part of a report: paragraphs, a table, a footnote."""

    title: str
    lines: tuple[str, ...] = ()
    grid: Grid | None = None
    footnote: str = ""

    def text(self) -> str:
        parts = [wrapped(line, "  ", "    " if line[:2] == "- " else "  ") for line in self.lines]
        parts += grid_text(self.grid) if self.grid else []
        parts += [wrapped(self.footnote, "  ")] if self.footnote else []
        return "\n".join([self.title, *parts])

    def html(self) -> str:
        parts = [f"<h2>{escape(self.title)}</h2>"]
        parts += [f"<p>{escape(line.removeprefix('- '))}</p>" for line in self.lines]
        parts += [grid_html(self.grid)] if self.grid else []
        parts += [f'<p class="small">{escape(self.footnote)}</p>'] if self.footnote else []
        return "\n".join(parts)


@dataclass(frozen=True)
class Figure:
    """A plot with its caption, drawn where a page needs it."""

    name: str
    caption: str
    draw: Callable[..., Any]
    size: tuple[float, float] = SIZE

    def html(self) -> str:
        svg = inline_svg(self.draw, self.name, self.size)
        return f"<figure>\n{svg}\n<figcaption>{escape(self.caption)}</figcaption>\n</figure>"


def beside(figures: Sequence[Figure]) -> str:
    """Figures side by side where there is room, as a block of HTML."""
    made = "\n".join(figure.html() for figure in figures)
    return f'<div class="log">\n{made}\n</div>'


@dataclass(frozen=True)
class Page:
    """A title, what it means, and the parts below."""

    title: str
    meaning: str
    parts: Sequence[Section | Figure | str]  # a text is HTML, which only pages have
    kind: str = ""  # colours the title
    links: Mapping[str, str] = field(default_factory=dict)  # of cells of tables, by their text

    def text(self) -> str:
        sections = [part.text() for part in self.parts if isinstance(part, Section)]
        return "\n\n".join([f"{self.title}\n{wrapped(self.meaning, '  ')}", *sections]) + "\n"

    def fragment(self) -> str:
        return f"<style>{_STYLE}</style>\n{self._body()}"

    def html(self) -> str:
        return (
            '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
            '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
            f"<title>lugrectl: {escape(self.title)}</title>\n"
            f"<style>{_STYLE}{_ALONE}</style>\n</head>\n<body>\n{self._body()}\n</body>\n</html>\n"
        )

    def _body(self) -> str:
        kind = f"verdict {escape(self.kind)}".strip()
        first = f"<h1>{escape(self.title)}</h1>\n<p>{escape(self.meaning)}</p>"
        rest = (part if isinstance(part, str) else part.html() for part in self.parts)
        made = "\n".join([f'<div class="{kind}">\n{first}\n</div>', *rest])
        for cell, target in self.links.items():
            linked = f'><a href="{quote(target)}">{escape(cell)}</a></td>'
            made = made.replace(f">{escape(cell)}</td>", linked, 1)
        return f'<div class="lugrectl">\n{made}\n</div>'

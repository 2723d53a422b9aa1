"""The HTML report: a fragment for Jupyter and a self-contained page."""

from __future__ import annotations

import html as markup
from pathlib import Path
from typing import Any

from ..core.display import grid_html as _grid_html
from .comparison_section import BUDGET
from .section import Section
from .wording import headline, sections, toml_of

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
.lugrectl .equation { font-family: ui-monospace, Menlo, Consolas, "DejaVu Sans Mono", monospace; }
.lugrectl .table { overflow-x: auto; background:
    linear-gradient(to right, #fff 40%, transparent) left / 3rem 100% no-repeat local,
    linear-gradient(to left, #fff 40%, transparent) right / 3rem 100% no-repeat local,
    linear-gradient(to right, #b8c1cc, transparent) left / .9rem 100% no-repeat scroll,
    linear-gradient(to left, #b8c1cc, transparent) right / .9rem 100% no-repeat scroll; }
.lugrectl table { border-collapse: collapse; font-size: .92rem; margin: .5rem 0;
  font-variant-numeric: tabular-nums; }
.lugrectl th, .lugrectl td { padding: .25rem .9rem .25rem 0; border-bottom: 1px solid #e6eaef;
  text-align: left; white-space: nowrap; background: none; }
.lugrectl th { font-weight: 600; color: #4a5563; }
.lugrectl .r { text-align: right; }
.lugrectl .small { font-size: .88rem; color: #4a5563; }
.lugrectl figure { margin: 1rem 0; break-inside: avoid; }
.lugrectl figcaption { font-size: .88rem; color: #4a5563; margin-top: .2rem; }
.lugrectl svg { display: block; width: 100%; height: auto; max-width: 44rem; }
.lugrectl .log { display: grid; grid-template-columns: repeat(auto-fit, minmax(19rem, 1fr));
  column-gap: 1rem; }
.lugrectl pre { font-size: .85rem; line-height: 1.4; background: #f4f6f8; padding: .8rem 1rem;
  overflow-x: auto; }
"""
_PAGE_STYLE = """
@media (max-width: 36rem) {
  .lugrectl { font-size: 15px; }
  .lugrectl table { font-size: .8rem; }
  .lugrectl th, .lugrectl td { padding-right: .55rem; }
  .lugrectl td:first-child { white-space: normal; min-width: 5rem; }
}
:root { color-scheme: light; }
body { margin: 0; padding: 1.5rem 1rem 3rem; background: #fff; }
.lugrectl { margin: 0 auto; }
@media print {
  body { padding: 0; }
  .lugrectl { max-width: none; font-size: 11pt; }
  .lugrectl h2 { break-after: avoid; }
  .lugrectl table, .lugrectl pre { break-inside: avoid; }
  .lugrectl .table, .lugrectl pre { overflow: visible; }
  .lugrectl .verdict { -webkit-print-color-adjust: exact; print-color-adjust: exact; }
}
@page { margin: 18mm; }
"""


def fragment(d: Any) -> str:
    """The report as an HTML fragment with its own style and inline plots, for Jupyter."""
    return f"<style>{_STYLE}</style>\n{_body(d)}"


def html(d: Any, folder: Path | None = None) -> str:
    """The report as one self-contained page: inline style and plots, nothing to fetch.

    Its model file is that of the folder.
    """
    title = markup.escape(f"lugrectl: {headline(d)[0]}")
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{title}</title>\n<style>{_STYLE}{_PAGE_STYLE}</style>\n</head>\n"
        f"<body>\n{_body(d, _provenance_html(d), folder)}\n</body>\n</html>\n"
    )


def _body(d: Any, end: str = "", folder: Path | None = None) -> str:
    title, meaning = headline(d)
    kind = markup.escape(title.split(":")[0])
    first = f"<h1>{markup.escape(title)}</h1>\n<p>{markup.escape(meaning)}</p>"
    parts, log = [f'<div class="verdict {kind}">\n{first}\n</div>'], [_log(d)]
    figures = _figures(d)
    budget = figures.pop("budget", "")
    made = sections(d)
    if not made or made[0].title != BUDGET:
        parts, log = parts + log, []
    for part in made:
        parts.append(_section_html(part))
        if part.title == BUDGET:
            parts += [budget, *log]
        if part.title == "Error before and after":
            parts, figures = parts + [*figures.values()], {}
    parts += [*figures.values(), _model_html(d, folder), end]
    return '<div class="lugrectl">\n' + "\n".join(p for p in parts if p) + "\n</div>"


def _section_html(part: Section) -> str:
    lines = [f"<h2>{markup.escape(part.title)}</h2>"]
    for line in part.lines:
        style = ' class="equation"' if part.formula else ""
        lines.append(f"<p{style}>{markup.escape(line.removeprefix('- '))}</p>")
    if part.grid:
        lines.append(_grid_html(part.grid))
    if part.footnote:
        lines.append(f'<p class="small">{markup.escape(part.footnote)}</p>')
    return "\n".join(lines)


def _figures(d: Any) -> dict[str, str]:
    """The figures by name, in their order."""
    from .diagnosis_plots import available, drawings

    made = [_figure(caption, svg) for caption, svg in drawings(d)]
    return dict(zip(available(d), made, strict=True))


def _figure(caption: str, svg: str) -> str:
    return f"<figure>\n{svg}\n<figcaption>{markup.escape(caption)}</figcaption>\n</figure>"


def _log(d: Any) -> str:
    """The log as it was read and the plain balance, side by side where there is room."""
    from .log_plot import drawings

    balance = getattr(d, "plain", None)
    if balance is None or not balance.stretches:
        return ""
    made = "\n".join(_figure(*one) for one in drawings(balance))
    return f'<div class="log">\n{made}\n</div>'


def _model_html(d: Any, folder: Path | None) -> str:
    if getattr(d, "model", None) is None:
        return ""
    return f"<h2>Model file</h2>\n<pre>{markup.escape(toml_of(d, folder))}</pre>"


def _provenance_html(d: Any) -> str:
    """What the report was computed by and from, in small print."""
    known = getattr(d, "provenance", None)
    if known is None:
        return ""
    said = [f"lugrectl {known.version}, {known.date}", known.command]
    said += [f"{file.name}: SHA-256 {file.sha256}" for file in known.files]
    lines = "\n".join(f'<p class="small">{markup.escape(line)}</p>' for line in said)
    return f"<h2>Provenance</h2>\n{lines}"

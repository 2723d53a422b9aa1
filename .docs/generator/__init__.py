"""Pages of the reference, written from the code: ``write(folder)``; without Sphinx."""

from __future__ import annotations

from pathlib import Path

from . import architecture, commands, entries, files, python, signatures, verdicts

NOTEBOOKS = ("tour", "method", "observers", "paper", "benchmark")
ROOT = Path(__file__).parents[2]


def pages() -> dict[str, str]:
    """Path below the folder of generated pages, without ``.rst``: the page's text."""
    made: dict[str, str] = {}
    for part in (entries, python, commands, files, verdicts, architecture):
        made |= part.pages()
    return made


def write(folder: Path) -> None:
    """Write all pages and pictures, and copy the notebooks; only what has changed is written."""
    made = {folder / f"{name}.rst": text for name, text in pages().items()}
    for old in {*folder.rglob("*.rst")} - made.keys():
        old.unlink()
    for path, text in made.items():
        _put(path, text.encode())
    for name, picture in signatures.pictures(folder):
        _put(folder / f"{name}.png", picture)
    for name in NOTEBOOKS:
        source = ROOT / "notebooks" / f"{name}.ipynb"
        _put(folder / "notebooks" / source.name, source.read_bytes())


def _put(path: Path, content: bytes) -> None:
    """Sphinx reads again what is newer, so an equal file stays as it is."""
    path.parent.mkdir(parents=True, exist_ok=True)
    if not path.exists() or path.read_bytes() != content:
        path.write_bytes(content)

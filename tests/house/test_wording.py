"""Plain English: words that readers stumble over stay out of code, README and notebooks."""

from __future__ import annotations

import ast
import io
import json
import re
import tokenize
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[2]
WORDS = (
    r"hang|hangs|hung|foretell\w*|foretold|foresee\w*|foresaw|foreseen|mend\w*|told|untold|"
    r"lack|lacks|lacked|lacking|sought|gone\s+by|worth\s+a\s+word|worth\s+naming|strangers?"
)
BANNED = re.compile(rf"\b(?:{WORDS})\b", re.IGNORECASE)
SHOWN = ("text/plain", "text/html", "text/markdown")


def python_texts(source: str) -> Iterator[str]:
    """Comments and strings of a module, docstrings and parts of f-strings included."""
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type == tokenize.COMMENT:
            yield token.string
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield node.value


def notebook_texts(notebook: dict[str, Any]) -> Iterator[str]:
    """Markdown cells and outputs."""
    for cell in notebook["cells"]:
        if cell["cell_type"] == "markdown":
            yield "".join(cell["source"])
        for output in cell.get("outputs", ()):
            yield "".join(output.get("text", ""))
            yield from ("".join(output.get("data", {}).get(kind, "")) for kind in SHOWN)


def texts(path: Path) -> Iterator[str]:
    source = path.read_text(encoding="utf-8")
    if path.suffix == ".py":
        return python_texts(source) if BANNED.search(source) else iter(())
    return notebook_texts(json.loads(source)) if path.suffix == ".ipynb" else iter([source])


@pytest.mark.parametrize(
    "pattern", ["lugrectl/**/*.py", "README.md", "notebooks/*.ipynb"], ids=lambda p: p
)
def test_banned_words_stay_out(pattern):
    files = sorted(ROOT.glob(pattern))
    assert files
    found = [(path, BANNED.findall(text)) for path in files for text in texts(path)]
    assert not [(str(path), words) for path, words in found if words]

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

Text = tuple[int, str]  # line, what stands there


def python_texts(source: str) -> Iterator[Text]:
    """Comments and strings of a module, docstrings and parts of f-strings included."""
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type == tokenize.COMMENT:
            yield token.start[0], token.string
    lines = source.splitlines()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield _line(lines, node), node.value


def _line(lines: list[str], node: ast.Constant) -> int:
    """The line of a string on which its first banned word stands, else its first line."""
    found = BANNED.search(str(node.value))
    word = found.group().split()[0] if found else ""
    span = range(node.lineno, (node.end_lineno or node.lineno) + 1)
    return next((n for n in span if word in lines[n - 1]), node.lineno)


def notebook_texts(notebook: dict[str, Any]) -> Iterator[Text]:
    """Lines of markdown cells and outputs, with the number of the cell in place of the line."""
    for number, cell in enumerate(notebook["cells"], 1):
        parts = [cell["source"]] if cell["cell_type"] == "markdown" else []
        for output in cell.get("outputs", ()):
            data = output.get("data", {})
            parts += [output.get("text", ""), *(data.get(kind, "") for kind in SHOWN)]
        yield from ((number, "".join(part)) for part in parts)


def texts(path: Path) -> Iterator[Text]:
    source = path.read_text(encoding="utf-8")
    if path.suffix == ".py":
        return python_texts(source)
    if path.suffix == ".ipynb":
        return notebook_texts(json.loads(source))
    return iter(enumerate(source.splitlines(), 1))


def banned(path: Path) -> list[str]:
    """``file:line: word`` for each text of a file with a banned word."""
    name = path.relative_to(ROOT) if path.is_relative_to(ROOT) else path.name
    found = sorted((line, text) for line, text in texts(path) if BANNED.search(text))
    return [f"{name}:{line}: {', '.join(BANNED.findall(text))}" for line, text in found]


@pytest.mark.parametrize(
    "pattern", ["lugrectl/**/*.py", "README.md", "notebooks/*.ipynb"], ids=lambda p: p
)
def test_banned_words_stay_out(pattern):
    files = sorted(ROOT.glob(pattern))
    assert files
    found = [entry for path in files for entry in banned(path)]
    assert not found, "\n" + "\n".join(found)


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ('"""All is well.\n\nThe residual hangs on theta.\n"""\n', 3),
        ("x = 1\ny = 2  # Untold values\n", 2),
        ('def f(a):\n    return f"{a}: the model LACKS {a}"\n', 2),
        ('x = (\n    "good "\n    "mended"\n)\n', 3),
    ],
)
def test_a_banned_word_is_named_with_its_line(tmp_path, text, line):
    path = tmp_path / "module.py"
    path.write_text(text)
    assert [entry.rsplit(":", 1)[0] for entry in banned(path)] == [f"module.py:{line}"]


def test_names_and_other_words_are_let_through(tmp_path):
    path = tmp_path / "module.py"
    path.write_text('told = hangs_on = "hanging black commended slack"  # recommend, chung\n')
    assert banned(path) == []


def test_markdown_and_outputs_of_a_notebook_are_read(tmp_path):
    output = {"data": {"text/plain": ["it hung"], "image/png": "told"}}
    code = {"cell_type": "code", "source": ["# told"], "outputs": [output]}
    markdown = {"cell_type": "markdown", "source": ["What the model ", "lacks"]}
    path = tmp_path / "tour.ipynb"
    path.write_text(json.dumps({"cells": [markdown, code]}))
    assert banned(path) == ["tour.ipynb:1: lacks", "tour.ipynb:2: hung"]

"""Every public name says what it is in numpydoc form, with an example that runs."""

from __future__ import annotations

import doctest
import inspect
import re
from typing import Any

import control as ct
import numpy as np
import pytest

import lugrectl as lg

SECTIONS = (  # in the order of numpydoc
    "Parameters",
    "Attributes",
    "Returns",
    "Yields",
    "Raises",
    "Notes",
    "References",
    "Examples",
)
NAMES = [name for name in lg.__all__ if callable(getattr(lg, name))]
SKIPPED = 5  # lines of examples that are shown but not run, at most
FLAGS = doctest.NORMALIZE_WHITESPACE | doctest.ELLIPSIS


@pytest.mark.parametrize("name", NAMES)
def test_a_public_name_has_a_docstring_in_numpydoc_form_and_an_example_that_runs(
    name, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    doc = inspect.getdoc(getattr(lg, name)) or ""
    found = faults(getattr(lg, name), doc) + failures(name, doc)
    assert not found, "\n".join([f"lugrectl.{name}:", *found])


def test_few_lines_of_examples_are_not_run():
    docs = [inspect.getdoc(getattr(lg, name)) or "" for name in NAMES]
    assert sum(doc.count("doctest: +SKIP") for doc in docs) <= SKIPPED


def faults(thing: Any, doc: str) -> list[str]:
    """What a docstring does not have of numpydoc's form."""
    first, *rest = doc.splitlines()
    parts = sections(doc)
    said = documented(parts.get("Parameters", ""))
    if inspect.isclass(thing):
        said |= documented(parts.get("Attributes", ""))
    found = [] if first.endswith(".") else ["the summary does not end with a full stop"]
    found += ["the summary is not one line"] if rest and rest[0] else []
    found += [f"{k} is no section" for k in parts if k not in SECTIONS]
    found += _misplaced([k for k in parts if k in SECTIONS])
    found += [f"{k} is empty" for k, text in parts.items() if not text.strip()]
    found += [f"{k} is not underlined" for k in SECTIONS if f"\n\n{k}\n" in doc and k not in parts]
    found += [f"{k} is not in Parameters" for k in arguments(thing) if k not in said]
    found += (
        ["Returns is missing"] if _returns(thing) and not {"Returns", "Yields"} & {*parts} else []
    )
    runs = re.search(r"^>>> ", parts.get("Examples", ""), re.M)
    return found + ([] if runs else ["Examples has no line to run"])


def sections(doc: str) -> dict[str, str]:
    """The underlined sections of a docstring, in order."""
    heads = list(re.finditer(r"^(\w[\w ]*)\n(-+)$", doc, re.M))
    heads = [h for h in heads if len(h[1]) == len(h[2])]
    ends = [*(h.start() for h in heads), len(doc)][1:]
    return {h[1]: doc[h.end() : end] for h, end in zip(heads, ends, strict=False)}


def documented(section: str) -> set[str]:
    """The names of a section: those of ``name, inputs, outputs : str``, without stars."""
    heads = [line.split(" : ")[0] for line in section.splitlines() if line and line[0] != " "]
    return {name.strip("* ") for head in heads for name in head.split(",")}


def arguments(thing: Any) -> list[str]:
    """The parameters of a function, or of a class that the package lets one build."""
    if inspect.isclass(thing) and not inspect.isfunction(thing.__init__):
        return []
    return [*inspect.signature(thing).parameters]


def failures(name: str, doc: str) -> list[str]:
    """What doctest prints about the lines of an example that give something else."""
    out: list[str] = []
    names = {"__name__": "example", "lg": lg, "np": np, "ct": ct}
    test = doctest.DocTestParser().get_doctest(doc, names, name, None, None)
    doctest.DocTestRunner(verbose=False, optionflags=FLAGS).run(test, out=out.append)
    return out


def _misplaced(names: list[str]) -> list[str]:
    places = [SECTIONS.index(name) for name in names]
    return [
        f"{SECTIONS[b]} is out of order" for a, b in zip(places, places[1:], strict=False) if b < a
    ]


def _returns(thing: Any) -> bool:
    """Whether a function gives back something."""
    return inspect.isfunction(thing) and inspect.signature(thing).return_annotation not in (
        "None",
        None,
    )

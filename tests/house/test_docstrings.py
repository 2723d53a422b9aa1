"""Every public name says what it is in numpydoc form, with an example that runs."""

from __future__ import annotations

import doctest
import inspect
import re

import control as ct
import numpy as np
import pytest

import lugrectl as lg

from . import stub

NAMES = [name for name in lg.__all__ if callable(getattr(lg, name))]
# order and names of the sections, summary, a description of each parameter and of what is
# returned, examples
WANTED = {"GL06", "GL07", "GL08", "SS01", "SS02", "SS03", "SS06", "PR01", "RT01", "EX01"}
SKIPPED = 5  # lines of examples that are shown but not run, at most
FLAGS = doctest.NORMALIZE_WHITESPACE | doctest.ELLIPSIS
DEAR = (  # seconds each
    *("Assurance", "HuntingChance", "ObserverComparison", "Recommendation", "StickSlip", "assure"),
    *("balance", "compare_laws", "diagnose", "frequency_response", "hunting_chance"),
    *("hunting_map", "identify", "limit_cycles", "recommend_observer", "tune"),
)


@pytest.mark.parametrize("name", NAMES)
def test_a_public_name_has_a_docstring_in_numpydoc_form(name):
    validate = pytest.importorskip("numpydoc.validate").validate
    wanted = set(WANTED)
    if inspect.isclass(getattr(lg, name)):  # of results the attributes are described
        wanted -= {"PR01"}
    if "Yields\n" in getattr(lg, name).__doc__:
        wanted -= {"RT01"}
    found = [said for code, said in validate(f"lugrectl.{name}")["errors"] if code in wanted]
    # what is gathered is described under its name without stars
    assert not [said for said in found if not re.match(r"Parameters \{'\*\*\w+'\} not", said)]


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(n, marks=[pytest.mark.slow, pytest.mark.sample] if n in DEAR else [])
        for n in NAMES
    ],
)
def test_its_example_runs(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    names, out = {"__name__": "example", "lg": lg, "np": np, "ct": ct}, []
    doc = inspect.getdoc(getattr(lg, name)) or ""
    test = doctest.DocTestParser().get_doctest(doc, names, name, None, None)
    doctest.DocTestRunner(verbose=False, optionflags=FLAGS).run(test, out=out.append)
    assert test.examples and not out, "\n".join(out)


def test_few_lines_of_examples_are_not_run():
    docs = [inspect.getdoc(getattr(lg, name)) or "" for name in NAMES]
    assert sum(doc.count("doctest: +SKIP") for doc in docs) <= SKIPPED


def test_the_stub_for_editors_is_what_would_be_written():
    """Else: python -m tests.house.stub."""
    pytest.importorskip("ruff")
    assert stub.STUB.read_text() == stub.stub()

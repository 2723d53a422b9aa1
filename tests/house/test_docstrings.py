"""Every public function has an example in its docstring, and it runs."""

import doctest
import inspect

import control as ct
import numpy as np
import pytest

import lugrectl as lg
from lugrectl.blocks.block import REGISTRY

SHOWN = [n for n in lg.__all__ if inspect.isroutine(getattr(lg, n))]
SHOWN += ["Certificate", "Design", "Model", "ObserverDesign", "P", "Parameters", "Record", "Sweep"]
FLAGS = doctest.NORMALIZE_WHITESPACE | doctest.ELLIPSIS
SLOW = 12  # functions whose example is shown only, because it needs files or many seconds


def examples(name):
    return doctest.DocTestParser().get_examples(inspect.getdoc(getattr(lg, name)) or "", name)


@pytest.mark.parametrize("name", SHOWN)
def test_the_example_of_a_public_name_runs(name, tmp_path, monkeypatch):
    assert examples(name)
    monkeypatch.chdir(tmp_path)
    before, said = dict(REGISTRY), []
    names = {"lg": lg, "np": np, "ct": ct, "__name__": "__main__"}
    test = doctest.DocTest(examples(name), names, name, None, 0, None)
    try:
        result = doctest.DocTestRunner(optionflags=FLAGS).run(test, out=said.append)
    finally:
        REGISTRY.clear()
        REGISTRY.update(before)
    assert result.failed == 0, "".join(said)


def test_few_examples_are_shown_only():
    skip = doctest.OPTIONFLAGS_BY_NAME["SKIP"]
    shown = [n for n in SHOWN if all(e.options.get(skip) for e in examples(n))]
    assert len(shown) <= SLOW, shown

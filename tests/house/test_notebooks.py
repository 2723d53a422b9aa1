"""The notebooks are stored as they ran, and run again from top to bottom."""

import re
from pathlib import Path

import pytest

from .. import notebooks

nbclient = pytest.importorskip("nbclient")
nbformat = pytest.importorskip("nbformat")
README = Path(__file__).parents[2] / "README.md"
PAGES = ["benchmark", "commissioning", "method", "observers", "paper", "tour"]
LONG = ["benchmark", "commissioning", "method", "observers"]  # not in the sample
each = pytest.mark.parametrize("path", notebooks.paths(), ids=lambda p: p.stem)


def code(path):
    return [c for c in nbformat.read(path, as_version=4).cells if c.cell_type == "code"]


def test_there_are_six_pages_and_readme_links_to_each():
    assert [p.stem for p in notebooks.paths()] == PAGES
    text = README.read_text()
    assert [name for name in PAGES if f"notebooks/{name}.ipynb" not in text] == []


@each
def test_a_page_is_stored_as_it_ran_and_small_to_be_read(path):
    """All cells in order, without an error; it names folders as lugrectl/engine/tracer.py."""
    cells = code(path)
    assert [c.execution_count for c in cells] == list(range(1, len(cells) + 1))
    outputs = [output for c in cells for output in c.outputs]
    assert outputs and not [o for o in outputs if o.output_type == "error"]
    assert not [o for o in outputs if o.get("name") == "stderr"]
    assert path.stat().st_size < notebooks.LARGEST
    first = nbformat.read(path, as_version=4).cells[0]
    assert first.cell_type == "markdown" and first.source.startswith("# ")
    assert not [c.source for c in cells if c.source.lstrip().startswith("assert")]
    named = re.findall(r"`(lugrectl(?:/[a-z_]+)+)", path.read_text())
    assert [name for name in named if not (README.parent / name).exists()] == []


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize(
    "path",
    [
        pytest.param(path, id=path.stem, marks=[] if path.stem in LONG else pytest.mark.sample)
        for path in notebooks.paths()
    ],
)
@pytest.mark.slow
@pytest.mark.timeout(1800)
def test_a_page_runs_again_with_its_figures(path):
    """As it is stored: the same figures, but for the times that were measured."""
    ran = notebooks.executed(path)
    cells = [c for c in ran.cells if c.cell_type == "code"]
    assert [c.execution_count for c in cells] == list(range(1, len(cells) + 1))
    stored, found = (notebooks.figures(c) for c in (nbformat.read(path, as_version=4), ran))
    assert [len(part) for part in found] == [len(part) for part in stored]
    for cell, (before, now) in enumerate(zip(stored, found, strict=True)):
        assert now == pytest.approx(before, rel=0.05, abs=1e-9), f"code cell {cell + 1}"


def test_what_differs_from_run_to_run_is_not_stored():
    bar = nbformat.v4.new_output("display_data", {notebooks.WIDGET: {"model_id": "3f"}})
    text = nbformat.v4.new_output("stream", name="stdout", text="1.5")
    cell = nbformat.v4.new_code_cell("1", outputs=[bar, text], execution_count=1)
    cell.metadata = {"execution": {"iopub.execute_input": "2026-11-26"}}
    made = notebooks.plain(nbformat.v4.new_notebook(cells=[cell]))
    assert made.cells[0].metadata == {} and made.cells[0].id == "cell-0"
    assert made.cells[0].outputs == [text] and notebooks.figures(made) == [[1.5]]

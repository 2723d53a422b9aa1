"""The reference has a page for everything, and builds without a warning."""

import json
import re
import subprocess
import sys
from importlib import resources, util
from pathlib import Path

import numpy as np
import pytest

import lugrectl as lg
from lugrectl.cli.options import parser
from lugrectl.diagnosis.result import VERDICTS

DOCS = Path(__file__).parents[2] / ".docs"
LISTS = ("effects", "laws", "observers", "controllers")


@pytest.fixture(scope="module")
def generator():
    sys.path.insert(0, str(DOCS))
    try:
        import generator
    finally:
        sys.path.remove(str(DOCS))
    return generator


@pytest.fixture(scope="module")
def pages(generator):
    return generator.pages()


@pytest.mark.parametrize("folder", LISTS)
def test_every_registry_entry_has_a_page_with_its_text(pages, folder):
    for entry in getattr(lg, folder)():
        page = pages[f"{folder}/{entry.name}"]
        assert re.sub(r"^   ", "", page, flags=re.M).count(str(entry)) == 1, entry.name
        assert f".. image:: {entry.name}.png" in page
        assert [k for k in entry.parameters if f"``{k}``" not in page] == []
        assert f"   {entry.name}\n" in pages[f"{folder}/index"] + "\n"
        confused = getattr(entry, "confused_with", ())
        assert [n for n in confused if f"<effect-{n}>" not in page] == []


def test_every_public_name_is_on_exactly_one_page_under_a_topic(pages, generator):
    text = "\n".join(v for k, v in pages.items() if k.startswith("python/"))
    found = re.findall(r"^\.\. (?:autofunction|autoclass|py:data):: (\w+)$", text, re.M)
    assert sorted(found) == sorted(lg.__all__)
    assert [name for name in lg.__all__ if generator.python.topic(name) == "others"] == []


def test_each_part_of_the_face_is_in_its_section(pages):
    """Rooms, commands with their options, and keys of the report."""
    rooms = [p.parent.name for p in Path(lg.__file__).parent.glob("*/__init__.py")]
    assert [r for r in rooms if f"   * - ``{r}``\n" not in pages["architecture"]] == []
    (commands,) = (a for a in parser()._actions if a.dest == "command")
    for name, command in commands.choices.items():
        section = pages["command"].split(f".. _command-{name}:")[1].split(".. _command-")[0]
        options = [o for a in command._actions for o in a.option_strings if a.dest != "help"]
        assert [o for o in options if f"``{o}" not in section] == [], name
    schema = resources.files("lugrectl") / "report" / "report.schema.json"
    for name, one in json.loads(schema.read_text(encoding="utf-8"))["$defs"].items():
        section = pages["files/report"].split(f".. _report-{name}:")[1].split(".. _report-")[0]
        assert [k for k in one.get("properties", ()) if f"``{k}``" not in section] == [], name


def test_every_verdict_has_a_page_with_what_readme_says(pages, generator):
    said = generator.verdicts.rows()
    assert sorted(said) == sorted(VERDICTS)
    for name, (meaning, _) in said.items():
        assert f"**Meaning:** {meaning}." in pages[f"verdicts/{name}"]


def test_the_model_file_page_names_every_law_and_effect(pages):
    page = pages["files/model"]
    assert [e.name for e in lg.effects() if f"<effect-{e.name}>" not in page] == []
    assert [e.name for e in lg.laws() if f"<friction-{e.name}>" not in page] == []


def test_the_table_of_other_tools_names_only_what_there_is():
    text = (DOCS / "coming_from.md").read_text("utf-8")
    names = re.findall(r"\b(?:lg|lugrectl)\.(\w+)", text)
    assert len(names) > 20 and set(names) <= set(lg.__all__)
    assert all(name in lg.effects() for name in re.findall(r'lg\.effect\("(\w+)"', text))
    assert all(name in lg.laws() for name in re.findall(r'lg\.friction\("(\w+)"', text))


def test_a_signature_is_the_torque_of_the_equation(generator):
    m = generator.motions.motion("travel")
    values = {"amplitude": 0.1, "phase": 0.5}
    torque = generator.signatures.residual(lg.effects()["gravity"], m, values)
    assert torque == pytest.approx(0.1 * np.sin(m.theta + 0.5), abs=1e-9)


@pytest.mark.slow
def test_the_reference_builds_without_a_warning(tmp_path):
    """As Read the Docs does at each commit."""
    missing = [m for m in ("sphinx", "numpydoc", "myst_nb") if util.find_spec(m) is None]
    if missing:
        pytest.skip(f"{', '.join(missing)} not installed: pip install lugrectl[docs]")
    command = [sys.executable, "-m", "sphinx", "-q", "-W", "--keep-going", "-E"]
    command += ["-d", tmp_path / "trees", DOCS, tmp_path / "html"]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "html" / "generated" / "effects" / "torque_ripple.html").exists()

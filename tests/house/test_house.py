"""The rules of the house: one-way imports, the top level, lint, types, what may be imported."""

from __future__ import annotations

import ast
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import lugrectl
from lugrectl.core.views import view

from . import size
from .size import FACE, PACKAGE, ROOT, arrows, room, walked

FLOORS = {  # of each folder, from the ground up: a room imports from lower floors only
    ".": [
        {"core"},
        {"blocks", "engine", "record"},
        {"linear", "loops", "estimates", "simulation"},
        {"design", "hunting", "torque_balance"},
        {"bench", "report"},
        {"commissioning", "diagnosis", "paper"},
        {"cli"},
    ],
}
SHOWING = {"report", "paper", "cli", "__main__"}  # rooms that draw and print
ARROWS = 59  # between the rooms of the package, at most


@pytest.mark.parametrize("folder", FLOORS)
def test_imports_run_one_way(folder):
    floor = {name: i for i, names in enumerate(FLOORS[folder]) for name in names}
    for one, other in arrows(folder):
        assert floor[other] < floor[one], f"{one} imports {other}, which is not below it"


def test_rooms_are_few_and_known_and_hide_no_public_name():
    """``lg.NAME`` must stay the function, whichever module of that name is loaded first."""
    rooms = {room(path) for path in PACKAGE.rglob("*.py")}
    assert rooms - FACE <= set.union(*FLOORS["."])
    assert len(FLOORS["."]) <= 8 and len(arrows(".")) <= ARROWS
    assert not rooms & set(lugrectl._HOME)


def test_computing_neither_draws_nor_prints():
    for path in PACKAGE.rglob("*.py"):
        if room(path) in SHOWING:
            continue
        calls = [n.func for n in walked(path) if isinstance(n, ast.Call)]
        assert "print" not in [f.id for f in calls if isinstance(f, ast.Name)], path
        assert "matplotlib" not in path.read_text(), path


def test_top_level_holds_what_it_should():
    if not (ROOT / ".git").exists():
        pytest.skip("not a git checkout")
    listed = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True)
    tops = {line.split("/")[0] for line in listed.stdout.splitlines()}
    extra = {t for t in tops if not t.startswith(".")}
    assert extra <= {"pyproject.toml", "lugrectl", "tests", "notebooks", "README.md", "LICENSE"}


def test_tests_stand_alone():
    """No test file imports another, nor a private name of the package."""
    for path in (ROOT / "tests").rglob("test_*.py"):
        for node in walked(path):
            if isinstance(node, ast.ImportFrom):
                module = (node.module or "").split(".")
                names = [alias.name for alias in node.names]
                assert not [n for n in (module[-1], *names) if n.startswith("test_")], path
                ours = module[0] == "lugrectl"
                assert not (ours and [n for n in names if n.startswith("_")]), path


def test_functions_are_short():
    assert not [name for name, node in size.functions() if size.body(node) > size.LONG]


def test_what_a_result_shows_itself_with_exists():
    for path in PACKAGE.rglob("*.py"):
        for call in walked(path):
            if isinstance(call, ast.Call) and getattr(call.func, "id", "") == "view":
                assert callable(view(*[ast.literal_eval(a) for a in call.args])), path


@pytest.mark.parametrize("arguments", [["check"], ["format", "--check"]])
def test_ruff(arguments):
    if shutil.which("ruff") is None and not (Path(sys.executable).parent / "ruff").exists():
        pytest.skip("ruff is not installed")
    command = [sys.executable, "-m", "ruff", *arguments, "lugrectl", "tests", "notebooks"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.slow
@pytest.mark.sample
def test_types():
    pytest.importorskip("pyrefly")
    command = [sys.executable, "-m", "pyrefly", "check"]
    command += ["--python-interpreter-path", sys.executable]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout

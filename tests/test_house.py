"""The rules of the house: one-way imports, the top level, lint, types, what may be imported."""

from __future__ import annotations

import ast
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "lugrectl"
STOREYS = [
    {"blas", "errors", "deadline", "checks", "display", "outputs", "progress", "provenance", "spec"}
    | {
        "arguments",
        "declaring",
        "jobs",
        "functions",
        "pickling",
        "control_pickling",
        "unit_names",
        "stated",
    },
    {"blocks", "model", "model_file", "catalogue", "door"},
    {"cascade", "loops", "engine", "linear", "record", "design", "sampling"},
    {"simulation", "results", "joint", "mixed", "blocklist", "wiring", "bristles", "ensemble"},
    {"identification"},
    {"tracing"},
    {"steady"},
    {"friction_map", "traces"},
    {"diagnosis", "fleet", "workers", "compensating", "comparing"},
    {"report"},
    {"reproduce"},
    {"cli", "__main__", "demo"},
]
TRACING = [
    {"noise", "windows", "applicable"},
    {"data"},
    {"shapes", "runs", "repeated", "series", "split", "tabulate"},
    {"predictor"},
    {"coordinates", "likelihood", "evaluate"},
    {"moments", "slopes", "beliefs"},
    {"fit"},
    {"far", "held_out", "optima", "discrepancy"},
    {"start", "dated"},
    {"job"},
]
SELECTION = [
    {"numbers", "result", "driven", "late"},
    {"motion", "regression"},
    {"rows", "law", "score", "rests"},
    {"declared"},
    {"base"},
    {"settling", "events"},
    {"contender", "effects"},
    {
        "springs",
        "unknown",
        "values",
        "levelled",
        "eccentric",
        "laws_as_rows",
        "late_speed",
        "dwelling",
        "contradiction",
    },
    {"search", "own_law"},
    {"table"},
    {"rounds", "budget", "bars"},
    {"verdict"},
    {"face"},
    {"completing"},
]
ROOMS = {".": STOREYS, "tracing": TRACING, "identification/selection": SELECTION}
COMPUTING = set.union(*STOREYS[:9])


def room(path: Path) -> str:
    return path.relative_to(PACKAGE).parts[0].removesuffix(".py")


def imports(path: Path, inside: Path) -> set[tuple[str, bool]]:
    """What a file imports of a folder's members, and whether only inside a function."""
    tree = ast.parse(path.read_text())
    depth = len(path.relative_to(inside).parts)
    top = {id(node) for node in tree.body}
    found = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.level == depth:
            names = [node.module] if node.module else [alias.name for alias in node.names]
            found |= {(name.split(".")[0], id(node) not in top) for name in names}
    return found


@pytest.mark.parametrize("room, storeys", ROOMS.items(), ids=ROOMS)
def test_imports_run_one_way(room, storeys):
    folder = PACKAGE / room
    level = {name: i for i, names in enumerate(storeys) for name in names}
    for path in folder.rglob("*.py"):
        own = path.relative_to(folder).parts[0].removesuffix(".py")
        if own == "__init__":
            continue
        assert own in level, f"{path.name} has no place in the house"
        for other, deferred in imports(path, folder):
            upward = level[other] > level[own]
            assert not upward or deferred, f"{path.name} imports {other}, which is above it"


def test_computing_neither_draws_nor_prints():
    for path in PACKAGE.rglob("*.py"):
        if room(path) not in COMPUTING:
            continue
        tree = ast.parse(path.read_text())
        calls = [n.func for n in ast.walk(tree) if isinstance(n, ast.Call)]
        assert "print" not in [f.id for f in calls if isinstance(f, ast.Name)], path
        assert "matplotlib" not in path.read_text(), path


def test_top_level_holds_what_it_should():
    if not (ROOT / ".git").exists():
        pytest.skip("not a git checkout")
    listed = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True)
    tops = {line.split("/")[0] for line in listed.stdout.splitlines()}
    extra = {t for t in tops if not t.startswith(".")}
    assert extra <= {"pyproject.toml", "lugrectl", "tests", "notebooks", "README.md", "LICENSE"}


def test_rooms_are_not_crowded():
    for path in [*PACKAGE.rglob("*.py"), *(ROOT / "tests").rglob("*.py")]:
        assert len(path.read_text().splitlines()) <= 400, path


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
    pytest.importorskip("basedpyright")
    command = [sys.executable, "-m", "basedpyright", "--pythonpath", sys.executable]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout


def test_quick_commands_load_nothing_heavy():
    code = (
        "import sys, lugrectl.cli as c; c.main(['--version']); "
        "sys.exit(any(m in sys.modules for m in ('control', 'matplotlib', 'numba', 'scipy')))"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0 and "lugrectl" in done.stdout


def test_no_public_name_is_hidden_by_a_module():
    """``lg.NAME`` must stay the function, whichever module of that name is loaded first."""
    import lugrectl

    rooms = {room(path) for path in PACKAGE.rglob("*.py")}
    assert not rooms & set(lugrectl._HOME)

"""How large the house is: ``python -m tests.house.size`` prints lines, rooms, arrows, arguments."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import lugrectl as lg

ROOT = Path(__file__).parents[2]
PACKAGE = ROOT / "lugrectl"
FACE = {"__init__", "__main__", "results"}  # files beside the rooms
MANY, LONG = 6, 40  # arguments of a function; lines of its body
DATA = {".py", ".txt", ".json", ".toml", ".c", ".csv", ".md"}


@cache
def walked(path: Path) -> tuple[ast.AST, ...]:
    """The nodes of a file."""
    return tuple(ast.walk(ast.parse(path.read_text())))


def room(path: Path) -> str:
    return path.relative_to(PACKAGE).parts[0].removesuffix(".py")


@cache
def arrows(folder: str) -> set[tuple[str, str]]:
    """Which room of a folder imports which; the public face imports all."""
    found, base = set(), PACKAGE / folder
    for path in base.rglob("*.py"):
        own = path.relative_to(base).parts[0].removesuffix(".py")
        for node in walked(path):
            if isinstance(node, ast.ImportFrom) and node.level:
                module = path.parents[node.level - 1].joinpath(*(node.module or "").split("."))
                names = [module] if node.module else [module / a.name for a in node.names]
                inside = [n.relative_to(base) for n in names if base in n.parents]
                found |= {(own, n.parts[0]) for n in inside}
    return {(a, b) for a, b in found if a != b and not FACE & {a, b}}


def lines(folder: Path, kinds: set[str]) -> int:
    """All lines of the files of these kinds, blank ones too."""
    paths = [p for p in folder.rglob("*") if p.suffix in kinds and p.is_file()]
    return sum(len(p.read_text(errors="replace").splitlines()) for p in paths)


def functions() -> Iterator[tuple[str, ast.FunctionDef]]:
    """Every function of the package, with the path and name to find it by."""
    for path in sorted(PACKAGE.rglob("*.py")):
        for node in walked(path):
            if isinstance(node, ast.FunctionDef):
                yield f"{path.relative_to(PACKAGE)}:{node.name}", node


def arguments(node: ast.FunctionDef) -> int:
    """How many arguments a function takes, itself apart."""
    names = [a.arg for a in (*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs)]
    return len([n for n in names if n not in ("self", "cls")])


def body(node: ast.FunctionDef) -> int:
    """Lines of a function without its docstring."""
    inner = node.body[1:] if ast.get_docstring(node) else node.body
    return inner[-1].end_lineno - inner[0].lineno + 1 if inner else 0  # type: ignore[operator]


def table() -> dict[str, int]:
    """What is counted, and its figure."""
    own = [node for _, node in functions() if node.name not in lg.__all__]
    return {
        "lines of the package": lines(PACKAGE, {".py"}),
        "lines of the tests, data too": lines(ROOT / "tests", DATA),
        "files of the package": len([*PACKAGE.rglob("*.py")]),
        "rooms": len({room(p) for p in PACKAGE.glob("*/**/*.py")}),
        "arrows between rooms": len(arrows(".")),
        f"inner functions with more than {MANY} arguments": sum(arguments(n) > MANY for n in own),
        f"bodies over {LONG} lines": sum(body(n) > LONG for _, n in functions()),
    }


if __name__ == "__main__":
    for name, figure in table().items():
        print(f"{figure:>8,}  {name}")

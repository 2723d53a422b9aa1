"""The public face as lines of text: names, signatures, results, options, help, keys of JSON.

``python -m tests.house.face`` writes ``face.txt``, which ``test_face`` holds the package to.
"""

from __future__ import annotations

import argparse
import contextlib
import dataclasses
import inspect
import io
import json
import tempfile
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any
from unittest import mock

import lugrectl as lg
from lugrectl.cli import main
from lugrectl.cli.options import parser

FILE = Path(__file__).with_name("face.txt")
JOBS = {  # name -> command line; DIR is a folder with a short record
    "demo": "demo --json --out DIR",
    "identify": "identify DIR/short.csv --model DEMO/model.toml --json",
    "check spr": "check spr --json",
    "check l2": "check l2 --json",
    "check bandwidth": "check bandwidth --json",
    "check stability": "check stability --json",
    "check passivity": "check passivity --json",
    "hunt": "hunt --model DEMO/model.toml --kp 2 --ki 5 --kd 0.05 --json",
    "no model": "identify nowhere.csv --model nowhere.toml",
    "no command": "nothing",
    "not built": "export",
}
SHORT = 3000  # lines of the record of the demo
NAMED = "parameters values effects gains stick_slip controller".split()  # keys are names of things


def lines() -> list[str]:
    """All lines; those of one kind begin alike."""
    return [*_names(), *_results(), *_registries(), *_commands(), *_documents()]


def _names() -> Iterator[str]:
    for name in lg.__all__:
        made = name in lg.results.__all__  # nobody but the package calls it
        yield f"lg.{name}{'' if made else _signature(getattr(lg, name))}"


def _signature(thing: Any) -> str:
    if inspect.isclass(thing) and issubclass(thing, Exception):
        return f": {thing.__base__.__name__}"
    if not callable(thing):
        return f": {type(thing).__name__}"
    shown = [
        p.replace(annotation=inspect.Parameter.empty)
        for p in inspect.signature(thing).parameters.values()
    ]
    return str(inspect.Signature(shown))


def _results() -> Iterator[str]:
    """The public attributes of each result."""
    for name in lg.results.__all__:
        cls = getattr(lg.results, name)
        fields = {f.name for f in dataclasses.fields(cls)} if dataclasses.is_dataclass(cls) else ()
        public = {n for n in dir(cls) if not n.startswith("_")} | set(fields)
        own = (n + _method(cls, n) for n in sorted(public) if not n.startswith("_"))
        yield f"results.{name}: {' '.join(own)}"


def _method(cls: type, name: str) -> str:
    thing = getattr(cls, name, None)
    return "()" if inspect.isroutine(thing) else ""


def _registries() -> Iterator[str]:
    for kind in ("laws", "effects", "observers", "controllers"):
        for entry in getattr(lg, kind)():
            units = " ".join(f"{k} [{v.unit}]" for k, v in entry.parameters.items())
            yield f"{kind}: {entry.name}: {units}"


def _commands() -> Iterator[str]:
    """Each option with its help."""
    for action in parser()._actions:
        choices: Any = action.choices if isinstance(action.choices, dict) else {}
        for name, command in choices.items():
            yield f"command {name}: {' '.join((command.description or '').split())}"
            for one in command._actions:
                yield f"command {name} {_option(one)}"


def _option(one: argparse.Action) -> str:
    said = "|".join(one.option_strings) or one.dest
    form = one.metavar or (one.choices and "|".join(map(str, one.choices))) or ""
    return f"{said} {form} nargs={one.nargs}: {one.help}"


def _documents() -> Iterator[str]:
    """Exit code of each job, and the keys and types of the document that it prints."""
    for name in JOBS:
        code, document, _ = done(name)
        yield f"exit {name}: {code}"
        if document is not None:
            yield from (f"json {name} {key}" for key in sorted(_keys(document)))


@cache
def done(name: str) -> tuple[int, Any, dict[str, int]]:
    """Exit code and document of a job, and the sizes of its files."""
    demo, line = Path(lg.__file__).parent / "demo", JOBS[name]
    with tempfile.TemporaryDirectory() as folder, contextlib.ExitStack() as stack:
        rows = (demo / "record.csv").read_text().splitlines()[:SHORT]
        (Path(folder) / "short.csv").write_text("\n".join(rows))
        out = stack.enter_context(contextlib.redirect_stdout(io.StringIO()))
        stack.enter_context(contextlib.redirect_stderr(io.StringIO()))
        # pictures of a diagnosis are seen in test_readme
        stack.enter_context(mock.patch("lugrectl.report.page.inline_svg", lambda *_: "<svg/>"))
        code = main(line.replace("DEMO", str(demo)).replace("DIR", folder).split())
        made = {p.name: p.stat().st_size for p in Path(folder).iterdir()}
    return code, json.loads(out.getvalue()) if "--json" in line else None, made


def _keys(value: Any, path: str = "") -> set[str]:
    if isinstance(value, dict):
        inner = {"NAME" if path.rsplit(".", 1)[-1] in NAMED else k: v for k, v in value.items()}
        return set().union(*(_keys(v, f"{path}.{k}".strip(".")) for k, v in inner.items()))
    if isinstance(value, list):
        return set().union({f"{path}[]"}, *(_keys(v, f"{path}[]") for v in value))
    kind = {int: "number", float: "number", str: "text", type(None): "null"}.get(type(value))
    return {f"{path}: {kind or type(value).__name__}"}


if __name__ == "__main__":
    FILE.write_text("\n".join(lines()) + "\n")

"""``python -m tests.house.stub`` writes lugrectl/__init__.pyi: the public names for editors, those
factories that are made of a block's function with their signatures."""

from __future__ import annotations

import inspect
import math
import subprocess
import sys
from typing import Any

import lugrectl as lg

from .size import PACKAGE

STUB = PACKAGE / "__init__.pyi"
HEAD = '''"""The public names; python -m tests.house.stub writes this file."""
from collections.abc import Sequence
import control as ct
from . import results as results
from .blocks.observers import Gain
{}
__version__: str
__all__: list[str]
{}'''
NAMES = "Sequence[str] | None"
TYPES = {"p": "Parameters | Model", "name": "str", "inputs": NAMES, "outputs": NAMES}


def is_built(name: str, value: Any) -> bool:
    made = lg._HOME[name].startswith("blocks.") and hasattr(value, "__wrapped__")
    return made and "names" not in inspect.signature(value.__wrapped__).parameters


def written(name: str, value: Any) -> str:
    parts = []
    for key, p in inspect.signature(value).parameters.items():
        default = "..." if p.default == math.inf else repr(p.default)
        star = "**" if p.kind is p.VAR_KEYWORD else "*, " if key == "name" else ""
        end = f" = {default}" if p.default is not p.empty else ""
        parts.append(f"{star}{key}: {TYPES.get(key, 'Gain')}{end}")
    head = f"def {name}({', '.join(parts)}) -> ct.NonlinearIOSystem:"
    return f'{head}\n    """{value.__doc__.splitlines()[0]}"""\n'


def stub() -> str:
    values = {name: getattr(lg, name) for name in sorted(lg._HOME)}
    built = {name: value for name, value in values.items() if is_built(name, value)}
    found = [f"from .{lg._HOME[k]} import {k} as {k}" for k in values if k not in built]
    text = HEAD.format("\n".join(found), "\n".join(written(*row) for row in built.items()))
    for action in (["check", "--fix", "-q", "--select", "I"], ["format"]):
        command = [sys.executable, "-m", "ruff", *action, "--stdin-filename", str(STUB), "-"]
        text = subprocess.run(command, input=text, capture_output=True, text=True).stdout
    return text


if __name__ == "__main__":
    STUB.write_text(stub())

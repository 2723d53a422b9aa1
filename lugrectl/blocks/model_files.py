"""The text of a model file: TOML in and out."""

from __future__ import annotations

import os
import re
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ..core.errors import InputError
from ..core.validation import like_it


def read_toml(path: Path) -> dict[str, Any]:
    """Read the tables of a model file; InputError for a file that is none."""
    try:
        return tomllib.loads(path.read_text(encoding="utf-8-sig"))
    except FileNotFoundError:
        raise InputError(f"{path}: no such model file{like_it(path)}.") from None
    except IsADirectoryError:
        raise InputError(f"{path} is a folder: name a model file, such as my.toml.") from None
    except (OSError, UnicodeDecodeError) as error:
        said = f"{path}: cannot be read as a text file in UTF-8 ({error})."
        raise InputError(f"{said}{_needed(path)}") from None
    except (ValueError, RecursionError) as error:  # more than what TOMLDecodeError covers
        # a decimal comma, which TOML does not know
        number = r"^\s*(\w+\s*=\s*-?\d+),(\d+)\s*(#.*)?$"
        found = re.search(number, path.read_text("utf-8"), re.M)
        cure = f"; write {found[1]}.{found[2]} with a decimal point" if found else ""
        raise InputError(f"{path}: not a TOML file: {error}{cure}.{_needed(path)}") from None


def _needed(path: Path) -> str:
    """What a file is that is no model by its name."""
    if path.suffix.lower() == ".toml":
        return ""
    return " A model is needed here: lugrectl model > my.toml writes one to start from."


def rows(values: Mapping[str, Any], notes: Mapping[str, str]) -> list[str]:
    """Write the rows of a table, each with what is noted of its key as a comment."""
    said = {k: "  # " + "".join(c for c in s if c.isprintable()) for k, s in notes.items()}
    keys = {k: k if re.fullmatch(r"[A-Za-z0-9_-]+", k) else quoted(k) for k in values}
    return [f"{keys[k]} = {_written(v)}{said.get(k, '')}" for k, v in values.items()]


def _written(value: Any) -> str:
    """A number, a list of numbers, or the table of one of which more is stated."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int):
        return str(value)
    if isinstance(value, list):
        return "[" + ", ".join(map(_written, value)) + "]"
    if not isinstance(value, Mapping):
        return repr(float(value))
    return "{" + ", ".join(f"{k} = {_written(v)}" for k, v in value.items() if v is not None) + "}"


def quoted(text: str) -> str:
    """A TOML string; InputError for half of a surrogate pair, which no TOML file can hold."""
    if half := re.search("[\ud800-\udfff]", text):
        raise InputError(
            f"the name {ascii(text)} holds half of a surrogate pair, {ascii(half[0])}, which no "
            "TOML file can hold: give it another name."
        )
    escaped = text.replace("\\", "\\\\").replace('"', '\\"')
    return '"' + re.sub(r"[\x00-\x1f\x7f]", lambda c: f"\\u{ord(c[0]):04x}", escaped) + '"'


def seen_from(folder: Path | None, file: str) -> str:
    """Write the path of a file as seen from a folder, if there is one."""
    if folder is None:
        return file
    try:
        return Path(os.path.relpath(file, folder.resolve())).as_posix()
    except ValueError:  # on another drive of Windows
        return file

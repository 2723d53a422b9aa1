"""Model files: a declared model as TOML."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ..core.errors import InputError
from ..core.provenance import SourceFile
from ..core.validation import as_path, like_it
from .model import Model, model_from_dict


def read_model(path: str | Path) -> Model:
    """Read a model file in TOML; ``lugrectl model`` prints a commented one.

    Raises
    ------
    InputError
        When the file is missing, is not TOML, or holds an unknown key or a wrong value.
    """
    path = as_path(path, "the model file")
    try:
        data = tomllib.loads(path.read_text(encoding="utf-8-sig"))
    except FileNotFoundError:
        raise InputError(f"{path}: no such model file{like_it(path)}.") from None
    except IsADirectoryError:
        raise InputError(f"{path} is a folder: name a model file, such as my.toml.") from None
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: cannot be read as a text file in UTF-8 ({error}).") from None
    except (ValueError, RecursionError) as error:  # more than what TOMLDecodeError covers
        raise InputError(f"{path}: not a TOML file: {error}{_decimal_comma(path)}.") from None
    model = model_from_dict(data, str(path))
    object.__setattr__(model, "file", SourceFile.of(path))
    return model


def _decimal_comma(path: Path) -> str:
    """What to do where a number has a decimal comma, which TOML does not know."""
    found = re.search(r"^\s*(\w+\s*=\s*-?\d+),(\d+)\s*(#.*)?$", path.read_text("utf-8"), re.M)
    return f"; write {found[1]}.{found[2]} with a decimal point" if found else ""


def write_model(model: Model, path: str | Path) -> None:
    """Write a model as the TOML file that :func:`read_model` reads.

    Raises
    ------
    InputError
        When the file cannot be written, or the model holds what a file cannot: a value that is
        no number or outside its bounds, half of a surrogate pair in its name.
    """
    from .as_model import as_model

    model, path = as_model(model), as_path(path, "path")
    text = model_toml(model)
    model_from_dict(tomllib.loads(text), f"model {model.name}")
    try:
        path.write_bytes(text.encode())
    except OSError as error:
        raise InputError(f"{path} cannot be written: {error.strerror or error}.") from None


def model_toml(model: Model) -> str:
    """The model file's text, with the unit of each value as a comment."""
    data, lines = model.to_dict(stated=True), []
    lines += [f"name = {_quoted(data['name'])}", f'motion = "{data["motion"]}"', "", "[plant]"]
    lines += _rows(data["plant"], "", model)
    lines += ["", "[friction]", f"model = {_quoted(data['friction'].pop('model'))}"]
    lines += _rows(data["friction"], "", model)
    for part, entry in zip(model.effects, data["effects"], strict=True):
        lines += ["", "[[effects]]", f"name = {_quoted(entry.pop('name'))}"]
        lines += _rows(entry, f"{part.key}.", model)
    return "\n".join(lines) + "\n"


def _rows(values: Mapping[str, Any], prefix: str, model: Model) -> list[str]:
    own = {k: model.unit(prefix + k) for k in values if prefix + k in model.declarations()}
    units = {k: "  # " + "".join(c for c in u if c.isprintable()) for k, u in own.items()}
    return [f"{_key(k)} = {_written(v)}{units.get(k, '')}" for k, v in values.items()]


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


def _key(name: str) -> str:
    return name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else _quoted(name)


def _quoted(text: str) -> str:
    """A TOML string; quotes, backslashes and control characters are escaped.

    InputError for half of a surrogate pair, which no TOML file can hold.
    """
    if half := re.search("[\ud800-\udfff]", text):
        raise InputError(
            f"the name {ascii(text)} holds half of a surrogate pair, {ascii(half[0])}, which no "
            "TOML file can hold: give it another name."
        )
    escaped = text.replace("\\", "\\\\").replace('"', '\\"')
    return '"' + re.sub(r"[\x00-\x1f\x7f]", lambda c: f"\\u{ord(c[0]):04x}", escaped) + '"'

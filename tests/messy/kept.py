"""Cases drawn once are kept in a folder."""

from __future__ import annotations

import importlib
import json
import tempfile
from pathlib import Path

import numpy as np

from .case import Case

GENERATORS = ("first", "second")


def case_of(seed: int, kind: str, generator: str = "first", cache: str | None = None) -> Case:
    """The case, from the folder ``cache`` where it was kept there."""
    path = Path(cache) / f"{generator}-{kind}-{seed}.npz" if cache else None
    if path is not None and path.exists():
        return load(path)
    case = importlib.import_module(f"tests.messy.{generator}").draw(seed, kind)
    if path is not None:
        path.parent.mkdir(parents=True, exist_ok=True)
        save(case, path)
    return case


def save(case: Case, path: Path) -> None:
    """Write a case as NPZ, whole or not at all."""
    said = {k: getattr(case, k) for k in ("seed", "kind", "model", "effect", "values")}
    said |= {"hidden": case.hidden, "friction": case.friction, "about": case.about}
    said |= {k: sorted(getattr(case, k)) for k in ("background", "alike")}
    said["signals"] = [sorted(s) for s in case.signals]
    with tempfile.NamedTemporaryFile(dir=path.parent, suffix=".part", delete=False) as file:
        np.savez_compressed(file, said=np.array(json.dumps(said, default=_plain)), **case.record)  # pyright: ignore
    Path(file.name).replace(path)


def _plain(value: object) -> object:
    """A number as such; what else a generator says about a case as text."""
    return value.item() if isinstance(value, np.generic) else str(value)


def load(path: Path) -> Case:
    """Read what :func:`save` wrote."""
    with np.load(path) as data:
        said = json.loads(str(data["said"]))
        record = {k: data[k] for k in data.files if k != "said"}
    said["signals"] = tuple(frozenset(s) for s in said["signals"])
    for name in ("background", "alike"):
        said[name] = frozenset(said[name])
    return Case(record=record, **said)

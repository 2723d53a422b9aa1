"""The model file: what the user declares, every value a little wrong, never the hidden effect."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .effects import CATALOGUE
from .machines import CONSTANT_LOAD, GRAVITY_LOAD, Machine

FRICTION = {
    "lugre": ("sigma0", "sigma1", "Fc", "Fs", "Fv", "vs"),
    "stribeck": ("Fc", "Fs", "Fv", "vs"),
    "coulomb": ("Fc", "Fv"),
}


def _wrong(rng: np.random.Generator, error: float) -> float:
    return float(rng.uniform(1.0 - error, 1.0 + error))


def model_tree(
    m: Machine, names: Sequence[str], rng: np.random.Generator, error: float, omit: Sequence[str]
) -> dict:
    """Nested like the file; each value times a factor of its own, Fs drawn above Fc."""
    kinds = {CATALOGUE[n].declared for n in names if n in CATALOGUE} - {"lugre"}
    kind = kinds.pop() if kinds else "lugre"
    inertia = m.J * _wrong(rng, error)
    values = {key: getattr(m, key) * _wrong(rng, error) for key in FRICTION["lugre"]}
    while values["Fs"] <= values["Fc"]:
        values["Fs"] = m.Fs * _wrong(rng, error)
    friction = {key: values[key] for key in FRICTION[kind] if key not in omit}
    tree = {
        "name": f"{m.name} {m.motion}",
        "motion": m.motion,
        "plant": {} if "J" in omit else {"J": inertia},
        "friction": {"model": kind, **friction},
    }
    load, size, phase = m.load
    if load == GRAVITY_LOAD:
        phase = float(np.clip(phase * _wrong(rng, error), -3.14, 3.14))
        entry = {"name": "gravity", "amplitude": size * _wrong(rng, error), "phase": phase}
        tree["effects"] = [entry]
    elif load == CONSTANT_LOAD:
        tree["effects"] = [{"name": "constant_torque", "torque": size * _wrong(rng, error)}]
    return tree


def _lines(values: dict) -> list[str]:
    return [
        f'{key} = "{value}"' if isinstance(value, str) else f"{key} = {value!r}"
        for key, value in values.items()
    ]


def model_text(tree: dict) -> str:
    """The tree as TOML."""
    lines = _lines({key: tree[key] for key in ("name", "motion")})
    for table in ("plant", "friction"):
        lines += ["", f"[{table}]", *_lines(tree[table])]
    for entry in tree.get("effects", []):
        lines += ["", "[[effects]]", *_lines(entry)]
    return "\n".join(lines) + "\n"

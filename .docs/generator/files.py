"""The files: the model file from the registry, report.json from its schema."""

from __future__ import annotations

import json
from collections.abc import Mapping
from importlib import resources
from typing import Any

import lugrectl as lg
from lugrectl.blocks.block import members
from lugrectl.blocks.model import KEYS, Stated

from .entries import bounds, label, number
from .rst import code, filled, listed, literal, prose, table, title

TOP = ("name", "motion", "blocks", "plant", "friction", "effects")


def pages() -> dict[str, str]:
    """The page of the model file and that of report.json."""
    return {"files/model": _model(), "files/report": _report()}


def _text(*path: str) -> str:
    return resources.files("lugrectl").joinpath(*path).read_text(encoding="utf-8")


def _model() -> str:
    J = members("observer")["proposed_observer"].parameters["J"]
    plant = [(code("J"), J.unit, bounds(J), number(J.value))]
    head = ("name", "unit", "bounds", "default of a block")
    return filled(
        "model_file",
        title=title("Model file"),
        template=literal(_text("demo", "template.toml"), "toml"),
        top=listed(map(code, TOP)),
        plant=table(head, plant),
        laws=_entries(lg.laws()),
        effects=_entries(lg.effects()),
        stated=listed(map(code, KEYS)),
        words=prose(" ".join((Stated.__doc__ or "").split())),
    )


def _entries(own: lg.catalogue.Catalogue) -> str:
    rows = [
        (f":ref:`{e.name} <{label(e)}>`", listed(_labelled(k, p) for k, p in e.parameters.items()))
        for e in own
    ]
    return table(("name", "parameters"), rows, "30 70")


def _labelled(key: str, p: lg.P) -> str:
    return code(key) if p.unit == "1" else code(f"{key} [{p.unit}]")


def _report() -> str:
    schema = json.loads(_text("report", "report.schema.json"))
    known = schema["$defs"]
    sections = [_section(name, one, known) for name, one in known.items()]
    return filled(
        "report",
        title=title("report.json"),
        about=prose(schema["description"]),
        sections="\n\n".join(sections),
    )


def _section(name: str, one: Mapping[str, Any], known: Mapping[str, Any]) -> str:
    parts = [f".. _report-{name}:", title(name, "-")]
    parts += [prose(_sentence(one["description"]))] if "description" in one else []
    if "properties" not in one:
        return "\n\n".join([*parts, f"Type: {kind(one)}."])
    needed = one.get("required", ())
    rows = [
        (code(k), kind(v), "yes" if k in needed else "no", prose(_meaning(v, known)))
        for k, v in one["properties"].items()
    ]
    head = ("key", "type", "always there", "meaning")
    return "\n\n".join([*parts, table(head, rows, "20 30 10 40")])


def _meaning(one: Mapping[str, Any], known: Mapping[str, Any]) -> str:
    """What a schema says of itself, or the one that it refers to."""
    if "description" in one or not ({"$ref", "anyOf"} & set(one)):
        return one.get("description", "")
    refs = [one, *one.get("anyOf", ())]
    names = [r["$ref"].rpartition("/")[2] for r in refs if "$ref" in r]
    return known[names[0]].get("description", "") if names else ""


def _sentence(text: str) -> str:
    return text if not text else f"{text[0].upper()}{text[1:].rstrip('.')}."


def kind(one: Mapping[str, Any]) -> str:
    """The type that a schema describes, in words."""
    if "$ref" in one:
        name = one["$ref"].rpartition("/")[2]
        return f":ref:`{name} <report-{name}>`"
    for choice in ("anyOf", "oneOf"):
        if choice in one:
            return " or ".join(map(kind, one[choice]))
    if "const" in one:
        return code(json.dumps(one["const"]))
    if "enum" in one:
        return " or ".join(code(json.dumps(v)) for v in one["enum"])
    made = one.get("type", "any value")
    return " or ".join(_single(t, one) for t in ([made] if isinstance(made, str) else made))


def _single(name: str, one: Mapping[str, Any]) -> str:
    if name == "array" and isinstance(one.get("items"), Mapping):
        many = one.get("minItems")
        count = f"{many} " if many is not None and many == one.get("maxItems") else ""
        return f"array of {count}{kind(one['items'])}"
    if name == "object":
        inner = one.get("additionalProperties")
        if isinstance(inner, Mapping):
            return f"object of {kind(inner)}"
        if "properties" in one:
            keys = (f"{code(k)}: {kind(v)}" for k, v in one["properties"].items())
            return f"object ({', '.join(keys)})"
    return name

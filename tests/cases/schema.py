"""report.json and its schema."""

from __future__ import annotations

import json
from importlib import resources

import pytest

jsonschema = pytest.importorskip("jsonschema")

SCHEMA = json.loads(
    (resources.files("lugrectl") / "report" / "report.schema.json").read_text(encoding="utf-8")
)
VALID = jsonschema.Draft202012Validator(SCHEMA)


def document(d):
    return json.loads(d.to_json())


def closed(schema):
    """The schema with every object whose keys are listed closed to other keys."""
    if isinstance(schema, list):
        return [closed(x) for x in schema]
    if not isinstance(schema, dict):
        return schema
    made = {k: closed(v) for k, v in schema.items()}
    listed = "properties" in made and made.get("type") == "object" and "required" in made
    return {"additionalProperties": False, **made} if listed else made

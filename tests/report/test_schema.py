"""report.json is what its schema says, and the schema says enough to be worth something."""

import copy
import json
import math
from dataclasses import replace

import numpy as np
import pytest

from lugrectl.cli import main
from lugrectl.core.provenance import SourceFile, provenance
from lugrectl.diagnosis.result import VERDICTS

from ..cases.made_up import bare
from ..cases.schema import SCHEMA, VALID, closed, document
from ..cases.shown_results import friction_map, identification, table

jsonschema = pytest.importorskip("jsonschema")


def stamped():
    return provenance("lugrectl.diagnose", [SourceFile.of_bytes("run.csv", b"t,u,w")])


def diagnosis(verdict="found", **changes):
    return document(replace(bare(verdict), provenance=stamped(), **changes))


def identified():
    made = identification()
    error = {k: v for k, v in made.error.items() if k != "augmented"}
    return replace(made, error=error, messages=("a note.",), provenance=stamped())


def changed(d, *path, to):
    """A copy of a document with one value put in, or taken out with KeyError as value."""
    made = copy.deepcopy(d)
    at = made
    for key in path[:-1]:
        at = at[key]
    if to is KeyError:
        del at[path[-1]]
    else:
        at[path[-1]] = to
    return made


def test_the_schema_is_a_schema():
    jsonschema.Draft202012Validator.check_schema(SCHEMA)
    assert SCHEMA["$schema"].endswith("2020-12/schema")


@pytest.mark.parametrize("verdict", VERDICTS)
def test_every_verdict_fits(verdict):
    VALID.validate(diagnosis(verdict))
    VALID.validate(document(bare(verdict)))  # put together by hand: no provenance


def test_an_identification_fits():
    VALID.validate(document(identified()))
    with pytest.raises(jsonschema.ValidationError):
        VALID.validate(changed(document(identified()), "parameters", to=KeyError))


def test_table_map_and_compensation_fit():
    pair = np.array([[0.1] * 3, [0.2] * 3])
    for made in (table(), replace(table(), signals=("theta", "w"), values=pair, error=pair)):
        VALID.validate(diagnosis("unexplained", table=made))
    VALID.validate(diagnosis(map=friction_map()))


def test_no_key_of_a_report_is_missing_from_the_schema():
    """Add a new key to lugrectl/report/report.schema.json as well."""
    strict = jsonschema.Draft202012Validator(closed(SCHEMA))
    for verdict in VERDICTS:
        strict.validate(diagnosis(verdict, table=table(), map=friction_map()))
    strict.validate(document(identified()))


def test_more_keys_are_allowed():
    VALID.validate(diagnosis() | {"something_new": 1})
    with pytest.raises(jsonschema.ValidationError):
        VALID.validate(diagnosis() | {"detectable": [{"name": "torque_ripple"}]})


WRONG = [
    (("verdict",), "maybe"),
    (("schema",), 2),
    (("effects",), KeyError),
    (("effects",), []),  # found, but nothing
    (("effects", 0, "alternatives", 0), {"name": "gravity"}),
    (("effects", 0, "parameters", "amplitude", "ci95"), [0.1]),
    (("effects", 0, "parameters", "amplitude", "unit"), None),
    (("depends_on",), "theta"),
    (("error",), "0.1"),
    (("error", "refitted"), "0.1"),
    (("error", "signal"), "x"),
    (("free_error", "in_sample"), 1.0),
    (("torque_error", "unit"), KeyError),
    (("model", "friction"), {"sigma0": 1.0}),
    (("record", "samples"), 12.5),
    (("messages",), "a note"),
    (("reason",), "too short"),  # but it was found
    (("provenance",), KeyError),
    (("provenance", "files", 0, "sha256"), "abc"),
]


@pytest.mark.parametrize(("path", "value"), WRONG, ids=[".".join(map(str, p)) for p, _ in WRONG])
def test_what_is_wrong_does_not_fit(path, value):
    with pytest.raises(jsonschema.ValidationError):
        VALID.validate(changed(diagnosis(), *path, to=value))


@pytest.mark.parametrize(
    ("verdict", "key", "value"),
    [
        ("refused", "reason", None),
        ("ambiguous", "experiment", None),
        ("adequate", "effects", [diagnosis()["effects"][0]]),
    ],
)
def test_keys_that_a_verdict_needs(verdict, key, value):
    VALID.validate(diagnosis(verdict))
    with pytest.raises(jsonschema.ValidationError):
        VALID.validate(changed(diagnosis(verdict), key, to=value))


def test_a_number_that_is_none_is_null():
    made = diagnosis(error=bare().error | {"noise_floor": math.nan})
    assert made["error"]["noise_floor"] is None
    VALID.validate(made)


def test_the_schema_can_be_printed(capsys):
    assert main(["schema"]) == 0
    assert json.loads(capsys.readouterr().out) == SCHEMA

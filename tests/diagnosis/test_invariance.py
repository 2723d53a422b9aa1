"""What the comparison says does not depend on how a drive is described, and grows with effects."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from lugrectl import diagnose
from lugrectl.blocks.model import model_from_dict
from lugrectl.diagnosis.result import Diagnosis
from lugrectl.record import Record
from tests.drives import sample

from ..cases.common import record_of

CASES = {  # hidden effect and seed of short records
    "viscous_asymmetry": 182004,
    "quadratic_drag": 182005,
    "none": 183003,
}
SHORT = {"viscous_asymmetry": {"duration": 20.0}, "quadratic_drag": {}, "none": {"duration": 6.0}}
ODD = {("viscous_asymmetry", "ratio")}  # parameters that change their sign with the axis
SCALED = {("quadratic_drag", "coefficient")}  # those that grow with torque
TORQUES = ("sigma0", "sigma1", "Fc", "Fs", "Fv")


def said(record: Record, model: dict) -> Diagnosis:
    return diagnose(record, model_from_dict(model, "test"))


@cache
def case_of(name: str):
    return sample([name] if name != "none" else name, CASES[name], **SHORT[name])


@cache
def plain(name: str) -> Diagnosis:
    return said(record_of(case_of(name)), case_of(name).model)


def gain(found: Diagnosis, name: str) -> float:
    return next((row.elpd for row in found.comparison.rows if row.model == name), 0.0)


def agrees(found: Diagnosis, name: str, sign: float = 1.0, torque: float = 1.0) -> None:
    """The same verdict, names and values, and gains as far as rounding lets them be the same."""
    before = plain(name)
    assert found.verdict == before.verdict == ("adequate" if name == "none" else "found")
    assert [e.name for e in found.effects] == [e.name for e in before.effects]
    for mine, other in zip(found.effects, before.effects, strict=True):
        assert gain(found, mine.name) == pytest.approx(gain(before, other.name), rel=0.05)
        for key, value in other.parameters.items():
            factor = sign if (name, key) in ODD else torque if (name, key) in SCALED else 1.0
            assert mine.parameters[key].value == pytest.approx(factor * value.value, rel=0.02)


each_case = pytest.mark.parametrize("name", CASES)


@pytest.mark.cases
@each_case
def test_the_direction_that_counts_as_positive_changes_nothing(name):
    record = record_of(case_of(name))
    mirrored = {
        k: -getattr(record, k) for k in ("u", "w", "theta") if getattr(record, k) is not None
    }
    agrees(said(replace(record, **mirrored), case_of(name).model), name, sign=-1.0)


@pytest.mark.cases
@each_case
def test_the_origin_of_time_and_of_the_angle_changes_nothing(name):
    record = record_of(case_of(name))
    moved = {} if record.theta is None else {"theta": record.theta + 0.7}
    agrees(said(replace(record, t=record.t + 500.0, **moved), case_of(name).model), name)


@pytest.mark.cases
@each_case
def test_a_larger_drive_of_the_same_kind_has_the_same_answer(name):
    """All torques and the inertia 1000 times larger: the equations are the same."""
    factor = 1000.0
    model = {k: dict(v) if isinstance(v, dict) else v for k, v in case_of(name).model.items()}
    model["plant"]["J"] *= factor
    for key in {*TORQUES} & {*model["friction"]}:
        model["friction"][key] *= factor
    record = record_of(case_of(name))
    agrees(said(replace(record, u=factor * record.u), model), name, torque=factor)


@pytest.mark.slow
@pytest.mark.sample
def test_false_alarms_are_rare():
    """Of ten drives from which nothing is missing at most one is called anything else."""
    cases = [sample("none", seed, duration=6.0) for seed in range(183000, 183010)]
    verdicts = [said(record_of(case), case.model).verdict for case in cases]
    assert sum(v != "adequate" for v in verdicts) <= 1, verdicts


@pytest.mark.slow
def test_more_of_an_effect_is_more_certain():
    gains, verdicts = [], []
    for strength in (0.003, 0.03, 0.3):
        case = sample(["quadratic_drag"], CASES["quadratic_drag"], strength=strength)
        found = said(record_of(case), case.model)
        gains.append(gain(found, "quadratic_drag"))
        verdicts.append(found.verdict)
    assert np.all(np.diff(gains) > 0.0)
    assert verdicts[-1] == "found" and "adequate" not in verdicts[verdicts.index("found") :]

"""The way a drive is described and a log is written changes nothing of an answer."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import lugrectl as lg
from lugrectl.blocks.model import model_from_dict
from tests.drives import make, sample

from ..cases.common import record_of, verdict
from ..cases.oil import log, read

CASES = {  # hidden effect and seed of short records
    "viscous_asymmetry": (182004, {"duration": 20.0}),
    "quadratic_drag": (182005, {}),
    "none": (183003, {"duration": 6.0}),
}
TORQUES = ("sigma0", "sigma1", "Fc", "Fs", "Fv")


@cache
def case_of(name: str):
    seed, options = CASES[name]
    return sample([name] if name != "none" else name, seed, **options)


@cache
def plain(name: str) -> lg.Diagnosis:
    return verdict(case_of(name))[0]


def gain(found: lg.Diagnosis, name: str) -> float:
    return next((row.elpd for row in found.comparison.rows if row.model == name), 0.0)


def agrees(found: lg.Diagnosis, name: str, factor: float = 1.0) -> None:
    """The same verdict, names and values, and gains as far as rounding lets them be the same."""
    before = plain(name)
    assert found.verdict == before.verdict == ("adequate" if name == "none" else "found")
    assert [e.name for e in found.effects] == [e.name for e in before.effects]
    for mine, other in zip(found.effects, before.effects, strict=True):
        assert gain(found, mine.name) == pytest.approx(gain(before, other.name), rel=0.05)
        for key, value in other.parameters.items():
            assert mine.parameters[key].value == pytest.approx(factor * value.value, rel=0.02)


@pytest.mark.cases
@pytest.mark.parametrize("name", CASES)
def test_direction_origin_and_size_change_nothing(name):
    """Turned round, later, at another zero of theta, and 1000 times larger: the same equations."""
    record, size = record_of(case_of(name)), 1000.0
    model = {k: dict(v) if isinstance(v, dict) else v for k, v in case_of(name).model.items()}
    model["plant"]["J"] *= size
    for key in {*TORQUES} & {*model["friction"]}:
        model["friction"][key] *= size
    changed = {"t": record.t + 500.0, "u": -size * record.u}
    changed |= {} if record.w is None else {"w": -record.w}
    changed |= {} if record.theta is None else {"theta": 0.7 - record.theta}
    found = lg.diagnose(replace(record, **changed), model_from_dict(model, "larger"))
    agrees(found, name, {"viscous_asymmetry": -1.0, "quadratic_drag": size}.get(name, 1.0))


@pytest.mark.slow
def test_more_of_an_effect_is_more_certain():
    seed, gains, verdicts = CASES["quadratic_drag"][0], [], []
    for strength in (0.003, 0.03, 0.3):
        found, _ = verdict(sample(["quadratic_drag"], seed, strength=strength))
        gains.append(gain(found, "quadratic_drag"))
        verdicts.append(found.verdict)
    assert np.all(np.diff(gains) > 0.0)
    assert verdicts[-1] == "found" and "adequate" not in verdicts[verdicts.index("found") :]


POWERS = {  # of torque and of length
    "J": (1, -1), "Fc": (1, 0), "Fs": (1, 0), "Fv": (1, -1), "vs": (0, 1), "sigma0": (1, -1),
    "sigma1": (1, -1), "u": (1, 0), "theta": (0, 1), "w": (0, 1), "amplitude": (1, 0),
    "harmonic": (0, -1),
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize(
    "torque, length",
    [
        (1e-5, 1.0),
        (1e5, 1e3),
        pytest.param(1.0, 1e-3, marks=pytest.mark.sample),
        pytest.param(1.0, -1.0, marks=pytest.mark.sample),
        pytest.param(1.0, 3e-4, marks=pytest.mark.sample),  # a travel of 0.1 mm
    ],
)
def test_a_ripple_is_found_in_any_units(torque, length):
    case = make("torque_ripple", machine="axis", excitation="rich", seed=2, rate=500.0,
                duration=20.0)  # fmt: skip

    def changed(values, sign=1.0):
        scale = {k: torque**a * abs(length) ** b * sign for k, (a, b) in POWERS.items()}
        return {k: v * scale[k] if k in scale else v for k, v in values.items()}

    model = case.model | {k: changed(case.model[k]) for k in ("plant", "friction")}
    columns = changed(case.columns, np.sign(length))
    result, names = verdict(replace(case, columns=columns, model=model))
    assert names == ["torque_ripple"]
    for name in ("amplitude", "harmonic"):
        true = changed(case.truth["parameters"])[name]
        assert result.effects[0].parameters[name].value == pytest.approx(true, rel=0.02)


DEGREES = {"t": "t [ms]", "u": "u [mN m]", "w": "w [deg/s]", "theta": "theta [deg]"}
FACTOR = {"t": 1e3, "u": 1e3, "w": 180.0 / np.pi, "theta": 180.0 / np.pi}
CHANGES = {
    "units": lambda log: {DEGREES[k]: x * FACTOR[k] for k, x in log.items()},
    "order": lambda log: {k: log[k] for k in ("theta", "w", "u", "t")},
    "origin": lambda log: log | {"t": log["t"] + 1e6},
    "signs": lambda log: log | {k: -log[k] for k in ("u", "w", "theta")},
    "tenth digit": lambda log: {k: x if k == "t" else x * (1.0 + 1e-10) for k, x in log.items()},
}


@pytest.mark.cases
@pytest.mark.parametrize("what", CHANGES)
def test_the_way_a_log_is_written_changes_nothing(tmp_path, what):
    model = lg.Model.of(friction="viscous", J=2.1e-3)
    usual, other = (
        lg.identify(read(tmp_path, columns), model) for columns in (log(), CHANGES[what](log()))
    )
    for key in ("J", "Fv"):
        width = np.ptp(usual.estimates[key].ci95)
        assert other.estimates[key].value == pytest.approx(
            usual.estimates[key].value, abs=0.02 * width
        )
        assert np.ptp(other.estimates[key].ci95) == pytest.approx(width, rel=0.02)
    assert other.error["refitted"] == pytest.approx(usual.error["refitted"], rel=1e-3)

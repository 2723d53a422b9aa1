"""A load behind a spring, excited through its resonance: the plain balance counts it as inertia."""

import pytest

import lugrectl as lg

from ..commissioning.drives import draw, log


@pytest.mark.slow
@pytest.mark.parametrize("seed", [pytest.param(9030, marks=pytest.mark.sample), 9015])
def test_a_load_behind_a_spring_is_no_gap(seed):
    """Jogs and a multisine; with the whole inertia held, a gap explained more."""
    drive = draw(seed)
    record = {k: v for k, v in log(drive, 20.0).items() if k != "r"}
    found = lg.diagnose(record, lg.Model.of(friction="lugre"))
    assert found.verdict == "found" and found.effects[0].name == "elastic_coupling"
    assert "backlash" not in [effect.name for effect in found.effects]
    own = found.effects[0].parameters
    assert own["load_inertia"].value == pytest.approx(drive.masses[1], rel=0.03)
    assert own["stiffness"].value == pytest.approx(drive.springs[0], rel=0.03)

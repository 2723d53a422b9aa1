"""The way a drive is described and a log is written changes nothing of an answer."""

from __future__ import annotations

import pytest

import lugrectl as lg

from ..cases import small_answers
from ..cases.small_answers import ripple

J, Fc, Fv = 0.002, 0.12, 0.02
CHANGED = {  # factors of torque and of length, and whether an effect is hidden
    "turned round, 1000 times larger": (-1e3, -1.0, True),
    "nothing is missing": (-1e3, -1.0, False),
    "a hair of torque": (1e-5, 1.0, True),
    "tenths of a millimetre": (1.0, 3e-5, True),
}


@pytest.mark.slow
@pytest.mark.cases
@pytest.mark.parametrize("what", CHANGED)
def test_direction_origin_and_size_change_nothing(what):
    """Later, at another zero of theta, and in other units: the same equations."""
    torque, length, hidden = CHANGED[what]
    seen, scale = small_answers.log(load=ripple if hidden else None), abs(torque)
    theta = length * (0.7 + seen["theta"])
    log = {"t": seen["t"] + 500.0, "u": torque * seen["u"], "theta": theta}
    values = {"J": scale * J / abs(length), "Fc": scale * Fc, "Fv": scale * Fv / abs(length)}
    found = lg.diagnose(log, lg.Model.of(motion="linear", friction="coulomb", **values))
    assert found.verdict == ("found" if hidden else "adequate")
    assert found.model.J == pytest.approx(values["J"], rel=0.02)
    assert [e.name for e in found.effects] == ["torque_ripple"] * hidden
    if hidden:
        own = found.effects[0].parameters
        assert own["amplitude"].value == pytest.approx(0.08 * scale, rel=0.02)
        assert own["harmonic"].value == pytest.approx(7.0 / abs(length), rel=0.02)

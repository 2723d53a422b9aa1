"""The way a drive is described and a log is written changes nothing of an answer."""

from __future__ import annotations

import numpy as np
import pytest

import lugrectl as lg

from ..cases import small_answers
from ..cases.oil import log, read
from ..cases.small_answers import ripple

J, Fc, Fv = 0.002, 0.12, 0.02
CHANGED = {  # factors of torque and of length, and whether an effect is hidden
    "turned round, 1000 times larger": (-1e3, -1.0, True),
    "nothing is missing": (-1e3, -1.0, False),
    "a hair of torque": (1e-5, 1.0, True),
    "tenths of a millimetre": (1.0, 3e-5, True),
}


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

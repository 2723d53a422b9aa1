"""Drawn records that were once called something else: how many of them are right.

They were looked at while the comparison was made, so they show no rate of a new record. The
numbers that may be wrong are those that were when this was written.
"""

from __future__ import annotations

import pytest

from lugrectl import diagnose

from ..cases.common import model_of, record_of
from ..scores.rig import Task

pytestmark = pytest.mark.slow


def drawn(names: str, seed: int, hard: bool = False, form: str = "", strength: str = "normal"):
    """The record of the hidden effects (space between them)."""
    return Task("", tuple(names.split()), strength, seed, hard=hard, form=form)


MISSED_NAMED, MISSED_UNNAMED = 14, 3  # of 33 and of 4 are called something else, not more
A_DIFFERENCE, DIFFERENTIATED, SMOOTHED = "a difference alone", "w differentiated", "w smoothed"
LATE = "u half a sample late"
SOUND = [
    drawn("", 128402, hard=True, form=DIFFERENTIATED),  # steps of an encoder
    drawn("", 128009),  # little torque
    drawn("", 125008),  # rests of a position alone
    drawn("", 138076, hard=True, form=SMOOTHED),  # jitter of the stamps
    drawn("", 139226, hard=True, form=SMOOTHED),  # jitter of the stamps
    drawn("", 136237, hard=True, form=A_DIFFERENCE),  # jitter of the stamps
    drawn("", 138024, hard=True, form=A_DIFFERENCE),  # dropped samples
    drawn("", 137364, hard=True, form=LATE),  # coarse encoder
    drawn("", 138118),  # creep over the counts of an encoder
    drawn("", 136239, hard=True),  # samples filled by a spline
    drawn("", 147025),  # a small part of a turn
    drawn("", 148103, form=LATE),  # a torque between two samples
]
NAMED = [
    drawn("dwell_stiction", 125003),  # a start at rest, beyond Fs
    drawn("dwell_stiction", 127400, hard=True),  # no values of friction
    drawn("dwell_stiction", 128000),  # creep at half vs
    drawn("dwell_stiction", 132000),  # one window with a break-away
    drawn("dwell_stiction", 150000, hard=True),  # lost samples before a rest
    drawn("dwell_stiction", 148100, form=A_DIFFERENCE, strength="weak"),  # a speed of counts alone
    drawn("coulomb_asymmetry", 128400, form=A_DIFFERENCE),  # one direction at first
    drawn("hard_stop", 132000),  # touched in the first quarter of a second only
    drawn("hard_stop", 134000, strength="weak"),  # met once
    drawn("hard_stop", 149000, hard=True, form=SMOOTHED),  # a smoothed speed of a fast log
    drawn("position_dependent_friction", 133000),  # a plant that one window identifies
    drawn("inertia_step", 133000),  # a linear step beyond what an inertia may lose
    drawn("inertia_step", 139000, strength="weak"),  # between two windows
    drawn("encoder_eccentricity", 132001),  # a loop that answers to it
    drawn("encoder_eccentricity", 134000, strength="weak"),  # an encoder beside its axis
    drawn("stribeck", 132001),  # bristles besides
    drawn("quadratic_drag", 134000, form=A_DIFFERENCE, strength="weak"),  # another zero of theta
    drawn("quadratic_drag", 135600, hard=True, form=A_DIFFERENCE),  # a difference without noise
    drawn("backlash", 134000, strength="weak"),  # a load that bounces between its stops
    drawn("backlash", 139000, strength="weak"),  # a load that bounces in its gap
    drawn("backlash", 135100),  # a load that bounces in its gap
    drawn("backlash", 150000),  # no delay besides
    drawn("velocity_sensor_lag", 145000, hard=True),  # values left open
    drawn("friction_step", 156000),  # held-out samples that only date it
    drawn("viscous_asymmetry stribeck", 133020),  # neither is certain alone
    drawn("thermal_drift pose_dependent_inertia", 134004, hard=True, form=DIFFERENTIATED),  # creep
    drawn("thermal_drift hard_stop", 134203),  # a stop at the very end
    drawn("quadratic_drag thermal_drift", 135003, strength="weak"),  # soon over
    drawn("thermal_drift encoder_eccentricity", 135006, form=LATE, strength="weak"),  # late
    drawn("hard_stop friction_step", 135600, hard=True),  # 10 kHz, by position
    drawn("constant_torque viscous_asymmetry", 139129, form=LATE),  # half of two
    drawn("position_dependent_friction load_dependent_friction", 139000),  # both
    drawn("thermal_drift actuator_lag", 139133, hard=True, form=DIFFERENTIATED),  # a lag too
]
UNNAMED = {  # the signals on which the torque depends
    drawn("wandering_friction", 146001): ("t", "w"),
    drawn("speed_hump", 158004): ("w",),
    drawn("field_weakening", 157000): ("u", "w"),
    drawn("governor", 157000): ("a", "w"),
}
BESIDES = {"stribeck": ["presliding"]}  # bristles: not declared, though not called hidden


def called(task: Task):
    case = task.case()
    return diagnose(record_of(case), model_of(case))


def test_nothing_is_missing():
    assert not [task.key for task in SOUND if called(task).verdict != "adequate"]


def test_what_is_hidden_is_named():
    missed = []
    for task in NAMED:
        found, hidden = called(task), [*task.names, *BESIDES.get(" ".join(task.names), ())]
        if (found.verdict, sorted(e.name for e in found.effects)) != ("found", sorted(hidden)):
            missed.append(task.key)
    assert len(missed) <= MISSED_NAMED, missed


def test_what_has_no_name_is_unexplained_over_its_signals():
    found = {task: called(task) for task in UNNAMED}
    right = [(c.verdict, c.depends_on) == ("unexplained", UNNAMED[t]) for t, c in found.items()]
    assert right.count(False) <= MISSED_UNNAMED

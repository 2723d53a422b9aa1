"""What is fitted on, what is held out, and what is said of a record that is too short."""

import numpy as np
import pytest

from lugrectl.core.errors import Refused
from lugrectl.identification.dataset.dataset import prepare
from lugrectl.identification.dataset.folds import BLOCK, GAP, split
from lugrectl.identification.dataset.windows import in_motion, windows
from lugrectl.record import Record

DT = 0.005


def runs(*seconds):
    made = []
    for length in seconds:
        t = np.arange(0.0, length, DT)
        noise = np.random.default_rng(len(t)).normal(0.0, 1e-4, len(t))
        made.append(Record(t=t, u=np.sin(3.0 * t), theta=np.sin(3.0 * t) + noise, motion="rotary"))
    return prepare(made)


def counted(windows):
    return {int(i) for row in windows.counted for i in row}


def test_whole_short_runs_are_held_out():
    data = runs(*[1.9] * 12)
    parts = split(data, 1.0)
    assert len(parts.test.start) == 6 and len(parts.train.start) >= 6
    assert not counted(parts.train) & counted(parts.test)
    fitted = {int(data.run[i]) for i in counted(parts.train)}
    assert fitted == {0, 2, 4, 6, 8, 10}


def test_longer_runs_are_cut_into_blocks_and_runs_without_a_horizon_are_left_out():
    length = round((BLOCK + GAP) / DT)
    long, tiny = runs(8 * length * DT), runs(8 * length * DT, 1.0)
    starts = split(long, 1.0).test.start
    assert np.all(starts // length % 2 == 1)
    np.testing.assert_array_equal(split(tiny, 1.0).test.start, starts)


def test_a_few_seconds_are_too_short():
    with pytest.raises(Refused, match="too short"):
        split(runs(1.9), 1.0)


def swinging(seconds, rate):
    t = np.arange(round(seconds * rate)) / rate
    return prepare([Record(t, u=np.sin(t), theta=np.sin(t - 0.3))])


@pytest.mark.parametrize(
    ("seconds", "rate", "words"),
    [
        (2.0, 200.0, ("The record is too short", "Record at least 18 s of motion")),
        (300.0, 10.0, ("At 10 Hz", "Record 18 s without loss at 100 Hz or more")),
    ],
)
def test_a_record_without_two_parts_is_told_what_it_lacks(seconds, rate, words):
    with pytest.raises(Refused) as said:
        split(swinging(seconds, rate), 1.0)
    assert words[0] in str(said.value) and words[1] in said.value.experiment


def test_a_record_with_both_parts_is_split():
    parts = split(swinging(30.0, 200.0), 1.0)
    assert len(parts.train.start) >= 4 and len(parts.test.start)


def test_a_standstill_is_not_fitted_on():
    """The noise of the torque there is another one, and nothing moves."""
    t = np.arange(0.0, 20.0, DT)
    w = np.where(t < 10.0, 0.0, np.cos(t))
    noise = np.random.default_rng(0).normal(0.0, 1e-4, len(t))
    theta = np.where(t < 10.0, 0.0, np.sin(t) - np.sin(10.0)) + noise
    data = prepare([Record(t=t, u=w, theta=theta, motion="rotary")])
    at = counted(split(data, 1.0).train)
    assert at and min(at) * DT > 8.5


def test_a_drive_that_never_moves_keeps_its_windows():
    where = windows([(0, 100)], 10, 20)
    assert len(in_motion(where, np.zeros(100)).start) == len(where.start) == 4

"""What is noise and what is not, told without any model of an effect."""

import numpy as np
import pytest

from lugrectl import diagnose
from lugrectl.tracing.structure import ROW, repeated, uneven
from tests.rig import sample

from .cases import model_of, record_of

RNG = np.random.default_rng(8)
WHITE = RNG.normal(size=(12, 400, 2))
ALL = np.ones(12, bool)


def louder(windows, by):
    return np.where(np.isin(np.arange(12), windows)[:, None, None], by * WHITE, WHITE)


def test_windows_that_surprise_much_more_than_others_are_uneven():
    assert not uneven(WHITE, ALL)
    assert uneven(louder([2, 7, 9], 6.0), ALL)
    assert not uneven(louder([2, 7, 9], 2.0), ALL)


def test_a_sensor_that_stands_on_one_count_tells_no_noise():
    resting = [0, 4, 5]
    still = louder(resting, 0.01)
    told = ~np.isin(np.arange(12), resting)
    assert uneven(still, ALL) and not uneven(still, told)
    assert uneven(louder([2, 7, 9], 6.0), told)
    assert not uneven(still, ~ALL)


@pytest.mark.slow
def test_rests_of_a_position_alone_are_no_missing_effect():
    case = sample("none", 125008)  # a spindle that stops and goes
    assert diagnose(record_of(case), model_of(case)).verdict == "adequate"


def test_innovations_that_stay_alike_tell_less():
    assert repeated(WHITE) == pytest.approx(1.0, abs=0.1)
    assert repeated(np.repeat(WHITE, ROW, axis=1)) == pytest.approx(ROW, rel=0.1)
    assert repeated(np.diff(WHITE, axis=1)) == 1.0
    assert repeated(WHITE * np.array([1.0, 0.0])) == pytest.approx(1.0, abs=0.1)

"""Where effects are searched for: only where the length of a record can show them."""

from types import SimpleNamespace

import numpy as np
import pytest

from lugrectl.identification.candidates.residual_spectrum import LOWEST, PERIODS, lowest
from lugrectl.identification.candidates.search_ranges import HEAT, durations


def lasting(seconds):
    """A log of so many seconds."""
    return SimpleNamespace(t=np.array([0.0, seconds]))


def test_no_drive_warms_up_within_half_a_second():
    assert not len(durations(lasting(0.5)))
    assert durations(lasting(2.0)).min() >= HEAT


def test_a_long_record_is_asked_for_all_its_time_constants():
    tried = durations(lasting(200.0))
    assert len(tried) == 12 and tried[[0, -1]] == pytest.approx([4.0, 600.0])


@pytest.mark.parametrize("seconds", [0.5, 5.0])
def test_a_wave_that_has_not_come_back_is_not_periodic(seconds):
    base = SimpleNamespace(record=SimpleNamespace(motion=lasting(seconds)))
    assert lowest(base) * seconds == pytest.approx(PERIODS)


def test_the_lowest_frequency_of_a_long_record_is_that_of_all():
    assert lowest(SimpleNamespace(record=SimpleNamespace(motion=lasting(60.0)))) == LOWEST

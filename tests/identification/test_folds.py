"""What is held out of a record, and what is said of one that is too short for that."""

import numpy as np
import pytest

from lugrectl.core.errors import Refused
from lugrectl.identification.dataset.dataset import prepare
from lugrectl.identification.dataset.folds import split
from lugrectl.record import Record


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

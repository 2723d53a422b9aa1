"""The usable rows of a log are found once, and nobody's changes reach the others."""

import pickle
from importlib import import_module

import numpy as np
import pytest

from lugrectl.record import log, record_of, stretches

usable = import_module("lugrectl.record.uniform_time")
T = np.arange(3000) * 1e-3
SPEED = 5 * np.sin(9 * T) + 2 * np.sin(23 * T)


@pytest.fixture
def found(monkeypatch):
    calls = []
    own = usable._found
    monkeypatch.setattr(usable, "_found", lambda rows: calls.append(rows) or own(rows))
    return calls


def rows():
    u = 0.2 * np.sign(SPEED) + 0.01 * SPEED
    return log.log_of_arrays("record", {"t": T, "u": u, "w": SPEED.copy()}, "rotary")


def test_the_plain_answer_and_the_finer_fit_share_the_usable_rows(found):
    made = rows()
    record = record_of(made)
    stretches([made])
    stretches([record.log])
    assert len(found) == 1


def test_a_pickle_holds_the_rows_once():
    made = rows()
    usable.usable(made)
    again = pickle.loads(pickle.dumps(made))
    assert made.kept and not again.kept and np.array_equal(again.channels["w"], SPEED)


def test_a_log_that_was_changed_is_looked_at_again(found):
    made = rows()
    usable.usable(made)
    made.channels["w"][1500] = 1e31
    assert np.isnan(usable.usable(made).channels["w"][1500])
    assert len(found) == 2

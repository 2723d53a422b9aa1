"""The second rig keeps to the physics, and a seed gives the same log again."""

import numpy as np
import pytest

from . import questions
from .rig import leftover, simulate


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 3])
def test_the_torque_balance_of_a_plain_motion_holds(seed):
    _, made, _ = questions.asked(seed, "sound")
    rest, level, moving = leftover(made.rig, made.motion, made.plain)
    assert moving > 0.1
    assert np.sqrt(np.mean(rest**2)) < 0.003 * level


def test_finer_steps_change_little():
    _, made, _ = questions.asked(3, "sound")
    fine = simulate(made.rig, made.refs, made.seed, finer=4)
    assert np.sqrt(np.mean((fine["w"] - made.motion["w"]) ** 2)) < 0.02 * np.std(made.motion["w"])


@pytest.mark.parametrize("kind", questions.KINDS)
def test_a_seed_gives_the_same_question_each_time(kind):
    one = questions.draw(1, kind)
    questions.asked.cache_clear()
    two = questions.draw(1, kind)
    assert (one.model, one.values, one.effect) == (two.model, two.values, two.effect)
    assert set(one.record) <= {"t", "u", "theta", "w"} and "u" in one.record and len(one.record) > 2
    for name, column in one.record.items():
        np.testing.assert_array_equal(column, two.record[name])
        assert np.isfinite(column).all() and len(column) == len(one.record["t"])


def test_a_clear_effect_is_named_with_values_and_seen():
    name, made, visible = questions.asked(1, "effect")
    assert name in questions.EFFECTS and made.values and 0.03 <= made.size <= 0.45
    assert visible > questions.SEEN

"""The second rig keeps to the physics, and a seed gives the same log again."""

from functools import cache

import numpy as np
import pytest

from tests.held_out import draw, draw_effect
from tests.held_out.drawing import _draw as draw_with_motion
from tests.held_out.motion_facts import leftover, nominal, simulate


@cache
def plain(seed):
    return draw_with_motion(seed, "plain")


@pytest.mark.parametrize("seed", [0, 3])
def test_the_torque_balance_of_a_plain_motion_holds(seed):
    _, truth, rig, o, _ = plain(seed)
    rest, level, moving = leftover(rig, o, nominal(rig))
    assert moving > 0.1
    assert np.sqrt(np.mean(rest**2)) < 0.003 * level
    assert truth["left_over"] < 0.003


def test_finer_steps_change_little():
    _, _, rig, o, (refs, noise) = plain(3)
    fine = simulate(rig, refs, noise, finer=4)
    assert np.sqrt(np.mean((fine["w"] - o["w"]) ** 2)) < 0.02 * np.std(o["w"])


@pytest.mark.parametrize("make", [draw, lambda seed: draw(seed, "real"), draw_effect])
def test_draws_are_reproducible(make):
    (a, truth), (b, again) = make(4), make(4)
    assert repr(truth) == repr(again)
    assert set(a) <= {"t", "u", "theta", "w"} and "u" in a and len(a) >= 3
    for name in a:
        np.testing.assert_array_equal(a[name], b[name])
        assert np.all(np.isfinite(a[name])) and a[name].size == a["t"].size


def test_a_clear_effect_is_named_with_values():
    effect = draw_effect(5)[1]["effect"]
    assert effect["name"] and effect["values"] and 0.03 <= effect["share"] <= 0.45

"""Standstill as a condition of what compensation to dare."""

import numpy as np
import pytest
from scipy import stats

import lugrectl as lg
from lugrectl.bench.chance import Outcomes, enough_at_rest, hunting_at_most
from lugrectl.bench.member_runs import HUNTS, RESTS, UNDECIDED, at_rest

FEW = {"confidence": 0.5, "hunts": 0.55, "members": 5, "frequency": 2.0}
DRIVE = {
    "J": 0.0037,
    "Fc": 0.2,
    "Fs": 0.22,
    "Fv": 0.027,
    "vs": 0.033,
    "sigma0": 190.0,
    "sigma1": 0.6,
}


@pytest.fixture(scope="module")
def fit():
    """A report of a drive with bristles, known to 1 %, and an encoder of 2^14 counts."""
    values = np.array(list(DRIVE.values()))
    known = {"names": list(DRIVE), "values": values, "matrix": np.diag((0.01 * values) ** 2)}
    model = lg.Model.of(**DRIVE).to_dict()
    drawn = known | {"positive": [True] * len(values), "weight": 1.0, "model": model}
    seen = {"rate": 1000.0, "resolution": 2.0 * np.pi / 2**14, "torque": 0.001, "speed": 4.7}
    return {"members": [drawn], "drive": seen}


@pytest.fixture(scope="module")
def found(fit):
    return lg.assure(fit, observers=["natural", "extended_state"], **FEW)


def test_a_compensation_that_swings_at_rest_is_not_chosen_though_it_tracks_better(found):
    tried = {(one.observer, one.scale): one for one in found.tried}
    swings, own = tried["natural", 1.0], tried[found.observer, found.scale]
    assert swings.upper < 0.5 * own.upper and swings.hunts == 1.0
    assert own.hunts == 0.0 and found.hunts.ci95[1] <= 0.55
    assert found.swing <= found.still == pytest.approx(4.0 * np.pi / 2**14)
    assert found.bound < 0.1 * found.none


def test_both_figures_at_rest_stand_beside_those_without(found):
    said = found.to_dict()
    shares = said["none_hunts"]["shares"]
    assert sum(shares.values()) == pytest.approx(1.0) and said["none_swing"] > 0.0
    assert "swing at rest below" in repr(found) and not found.messages


def test_where_no_choice_rests_one_that_swings_no_farther_is_said_to_be_that(fit):
    strict = lg.assure(fit, observers="natural", still=1e-12, **FEW | {"members": 2})
    assert strict.hunts.rests < 1.0
    assert "than without compensation" in strict.messages[-1]


def test_an_unstable_loop_is_said_at_once(fit):
    with pytest.raises(lg.Refused, match="unstable by itself"):
        lg.assure(fit, kp=1.0, ki=50.0, kd=1e-3)
    with pytest.raises(lg.Refused, match="unstable by itself"):
        lg.assure(fit, loop="velocity", kp=0.3, ki=1.0, dead_time=0.05)


def test_few_drives_say_what_they_cannot_show(fit):
    own = {"observers": "extended_state", "members": 3, "frequency": 2.0}
    (said,) = lg.assure(fit, **own).messages
    assert said == (
        "3 drives cannot show that at most 5 % of the drives hunt: if none of them does, up to "
        "71 % may; members=72 can."
    )


def test_so_many_may_hunt_that_a_larger_share_would_rarely_show_so_few():
    for n, k in ((71, -1), (72, 0), (109, 0), (110, 1), (500, 15)):
        assert hunting_at_most(n, 0.05) == k
        assert k < 0 or stats.binom.cdf(k, n, 0.05) <= 0.025 < stats.binom.cdf(k + 1, n, 0.05)
    assert enough_at_rest(0.05) == 72


def test_three_shares():
    made = Outcomes.of([HUNTS, RESTS, UNDECIDED, RESTS])
    assert (made.value, made.rests, made.unsure) == (0.25, 0.5, 0.25)
    assert made.words().endswith("4 members); undecided 25 %")


t = np.linspace(0.0, 30.0, 3001)
SWING = 3.0 * np.sin(2.0 * np.pi * t)


@pytest.mark.parametrize(
    ("theta", "u", "fate"),
    [
        (0.1 * SWING, np.ones_like(t), RESTS),
        (SWING, SWING, HUNTS),
        (0.1 * SWING, SWING, RESTS),
        (0.0 * t, t, UNDECIDED),
        (0.1 * SWING, 0.1 * t + np.sign(SWING), UNDECIDED),
        (np.exp(-t), np.exp(-t), RESTS),
        (SWING * np.exp(-0.1 * t), SWING, UNDECIDED),
        (np.where(t > 28.0, 3.0, 0.0), t, UNDECIDED),
    ],
)
def test_what_the_end_of_a_run_says(theta, u, fate):
    assert at_rest(theta, u, 30.0, 1.0, False).fate == fate


def test_a_swing_that_shrinks_slowly_has_not_come_to_rest_where_nothing_longer_follows():
    decays = SWING * np.exp(-0.02 * t)
    assert at_rest(decays, SWING, 30.0, 1.0, False).fate == UNDECIDED
    assert at_rest(decays, SWING, 30.0, 1.0, True).fate == HUNTS

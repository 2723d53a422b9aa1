"""How much compensation to dare, against drives of our own."""

import json
import warnings
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from scipy import stats

import lugrectl as lg
from lugrectl.bench.assure import Chance, band, bound, enough, few

from . import drives

MEMBERS = 26  # the fewest of which one may hunt where a fifth of all drives may
ALL = (0.85, 0.9, 0.95, 0.975, 1.0, 1.025, 1.05, 1.1)  # shares, for a drive that is known


def declared(truth, random):
    """What is known of a drive beside its log: presliding and Stribeck's curve, more or less."""
    values = {k: truth[k] * np.exp(s * random.normal()) for k, s in SPREAD.items()}
    return lg.Model.of(**{k: {"value": v, "std": SPREAD[k] * v} for k, v in values.items()})


SPREAD = {"sigma0": 0.3, "sigma1": 0.4, "vs": 0.4, "Fs": 0.1}


@pytest.fixture(scope="module")
def fit():
    """A drive with Coulomb friction, from a short log with noise."""
    random, t = np.random.default_rng(1), 1e-3 * np.arange(6000)
    w = 3.0 * np.sin(np.pi * t) + 0.5 * np.sin(8.0 * t)
    u = 0.002 * np.gradient(w, t) + 0.3 * np.tanh(w / 1e-3) + 0.02 * w
    u, w = (x + 0.01 * random.normal(size=6000) for x in (u, w))
    return lg.identify({"t": t, "u": u, "w": w}, lg.Model.of(friction="coulomb"))


@pytest.fixture(scope="module")
def found(fit):
    return lg.assure(fit, 0.8, loop="velocity", seed=3, hunts=0.2)


def test_it_helps_and_says_on_how_many_drives(found):
    assert found.observer == "extended_state" and 0.8 <= found.scale <= 1.2
    assert found.band[0] <= found.error <= found.bound <= found.band[1] < 0.5 * found.none
    assert (found.worse.count, found.worse.members, found.members) == (0, MEMBERS, MEMBERS)
    assert found.hunts.members == MEMBERS and found.controller["ki"] > 0.0


@pytest.mark.slow
def test_too_few_members_have_no_bound_and_a_report_and_an_executor_say_the_same(fit, tmp_path):
    own = {"loop": "velocity", "members": 4, "observers": "extended_state"}
    few = lg.assure(fit, **own)
    assert np.isinf(few.bound) and json.loads(few.to_json())["bound"] is None
    fit.save(tmp_path)
    with ThreadPoolExecutor(2) as pool:
        again = lg.assure(tmp_path / "report.json", executor=pool, **own)
    assert again.to_dict() == few.to_dict()


def test_it_refuses_what_the_log_does_not_determine():
    t = 1e-3 * np.arange(4000)
    w = 3.0 * np.sin(np.pi * t)
    u = 0.002 * np.gradient(w, t) + 0.3 * np.tanh(w / 1e-3) + 0.02 * w
    random = np.random.default_rng(0)
    fit = lg.identify({"t": t, "u": u + 0.05 * random.normal(size=4000), "w": w}, lg.Model.of())
    with pytest.raises(lg.Refused, match="does not determine .*sigma1.* = {value"):
        lg.assure(fit)


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"loop": "speed"}, "unknown loop"),
        ({"confidence": 1.5}, "confidence"),
        ({"observers": "natural"}, "must know sigma0"),
        ({"frequency": 900.0}, "another frequency"),
        ({"dead_time": -1.0}, "negative"),
        ({"hunts": 1.5}, "hunts is 1.5"),
        ({"still": -1.0}, "still"),
    ],
)
def test_a_wrong_argument_has_one_sentence(fit, wrong, said):
    with pytest.raises(lg.InputError, match=said):
        lg.assure(fit, **wrong)


def test_the_chance_of_hunting_is_that_of_its_members(fit):
    found = lg.hunting_chance(fit, members=2, kp=2.0, ki=5.0, kd=0.1)
    assert found and found.chance.ci95 == pytest.approx((0.0, 0.8419), abs=1e-4)
    loose = lg.hunting_chance(fit, members=2, kp=2.0, ki=500.0, kd=0.1)
    assert not loose and loose.chance.count == 2


def true_figures(n, seed, seconds, counts, dt, noise):
    """Of n drives with logs, by the route that a user takes: whether the band holds the true
    error, that error, the one without compensation, and the least for a drive that is known; of
    tracking alone, whatever it does at rest."""
    random = np.random.default_rng(seed)
    truth = drives.drawn(n, random)
    t, u, theta = drives.logged(truth, dt, seconds, random, counts, noise)
    rows = []
    for i in range(n):
        one = {k: getattr(truth[i], k) for k in drives.NAMES}
        kind = ("velocity", "position")[i % 2]
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            known = declared(one, random)
            fit = lg.identify({"t": t, "u": u[:, i], "theta": theta[:, i]}, known)
            found = lg.assure(fit, loop=kind, observers="natural", hunts=1.0, seed=i)
        own = fit.model.known() | found.controller
        given = (kind, found.drive["speed"], dt, counts)

        def error(believed, share, one=truth[i], given=given):
            kind, *rest = given
            return float(drives.missed(one, believed, kind, share, *rest))

        best = min(error(one | found.controller, share) for share in ALL)
        error_of = error(own, found.scale), error(own, 0.0), best
        rows.append([found.band[0] <= error_of[0] <= found.band[1], *error_of])
    return np.array(rows).T


@pytest.mark.slow
def test_the_band_and_the_gain_hold_on_a_few_drives_that_nothing_has_seen():
    inside, error, none, best = true_figures(2, 17, 6.0, 2**13, 1e-3, 0.01)
    assert inside.all() and np.all(error < none)
    assert np.mean((none - error) / (none - best)) > 0.85


@pytest.mark.slow
def test_the_band_holds_as_often_as_it_says_and_the_gain_is_nearly_that_of_a_known_drive():
    kinds = ((12.0, 2**16, 1e-3, 0.005), (6.0, 2**13, 1e-3, 0.01), (10.0, 2**14, 2e-3, 0.01))
    every = [true_figures(20, 40 + i, *kind) for i, kind in enumerate(kinds)]
    inside, error, none, best = np.concatenate(every, axis=1)
    assert 0.9 <= inside.mean() <= 0.98
    assert np.mean(error > none) <= 0.05
    assert np.mean((none - error) / (none - best)) >= 0.85


# ---- standstill is a condition --------------------------------------------------------


FEW = {"confidence": 0.5, "hunts": 0.55, "members": 5, "frequency": 2.0}
DRIVE = dict(zip(drives.NAMES, (0.0037, 0.2, 0.22, 0.027, 0.033, 190.0, 0.6), strict=True))


@pytest.fixture(scope="module")
def bristles():
    """A report of a drive with bristles, known to 1 %, and an encoder of 2^14 counts."""
    values = np.array(list(DRIVE.values()))
    known = {"names": list(DRIVE), "values": values, "matrix": np.diag((0.01 * values) ** 2)}
    model = lg.Model.of(**DRIVE).to_dict()
    drawn = known | {"positive": [True] * len(values), "weight": 1.0, "model": model}
    seen = {"rate": 1000.0, "resolution": 2.0 * np.pi / 2**14, "torque": 0.001, "speed": 4.7}
    return {"members": [drawn], "drive": seen}


@pytest.fixture(scope="module")
def resting(bristles):
    return lg.assure(bristles, observers=["natural", "extended_state"], **FEW)


@pytest.mark.slow
def test_a_compensation_that_swings_at_rest_is_not_chosen_though_it_tracks_better(resting):
    tried = {(one.observer, one.scale): one for one in resting.tried}
    swings, own = tried["natural", 1.0], tried[resting.observer, resting.scale]
    assert swings.upper < 0.5 * own.upper and swings.hunts == 1.0
    assert own.hunts == 0.0 and resting.hunts.ci95[1] <= 0.55
    assert resting.swing <= resting.still == pytest.approx(4.0 * np.pi / 2**14)
    assert resting.bound < 0.1 * resting.none


@pytest.mark.slow
def test_where_no_choice_rests_one_that_swings_no_farther_is_said_to_be_that(bristles):
    strict = lg.assure(bristles, observers="natural", still=1e-12, **FEW | {"members": 2})
    assert strict.hunts.rests < 1.0
    assert "than without compensation" in strict.messages[-1]


@pytest.mark.slow
def test_an_unstable_loop_is_said_at_once(bristles):
    with pytest.raises(lg.Refused, match="unstable by itself"):
        lg.assure(bristles, kp=1.0, ki=50.0, kd=1e-3)
    with pytest.raises(lg.Refused, match="unstable by itself"):
        lg.assure(bristles, loop="velocity", kp=0.3, ki=1.0, dead_time=0.05)


@pytest.mark.slow
def test_few_drives_say_what_they_cannot_show(bristles):
    own = {"observers": "extended_state", "members": 3, "frequency": 2.0}
    (said,) = lg.assure(bristles, **own).messages
    assert said == (
        "3 drives cannot show that at most 5 % of the drives hunt: if none of them does, up to "
        "71 % may; members=72 can."
    )


def test_so_many_may_hunt_that_a_larger_share_would_rarely_show_so_few():
    for n, k in ((71, -1), (72, 0), (109, 0), (110, 1), (500, 15)):
        assert few(n, 0.05) == k
        assert stats.binomtest(k + 1, n).proportion_ci(0.95, "exact").high > 0.05
    assert enough(0.05, 0) == 72


# ---- probabilities from a number of members --------------------------------------------


def test_the_interval_is_that_of_clopper_and_pearson():
    assert Chance(0, 93).ci95 == pytest.approx((0.0, 0.03889), abs=1e-5)
    assert Chance(5, 100).ci95 == pytest.approx((0.01643, 0.11283), abs=1e-4)
    assert Chance(7, 7).ci95[1] == 1.0


@pytest.mark.slow
@pytest.mark.parametrize("confidence", [0.8, 0.95])
def test_a_bound_holds_as_often_as_it_says(confidence):
    x = np.random.default_rng(0).random((4000, enough(1.0 - confidence, 1, 0.05)))
    held = np.array([bound(row, confidence) for row in x]) >= confidence
    assert 0.94 < held.mean() < 0.97


def test_a_band_holds_a_new_member():
    x = np.random.default_rng(0).normal(size=(4000, 94))
    ends = np.array([band(row[1:]) for row in x])
    inside = np.mean((x[:, 0] >= ends[:, 0]) & (x[:, 0] <= ends[:, 1]))
    assert inside == pytest.approx(0.95, abs=0.008)

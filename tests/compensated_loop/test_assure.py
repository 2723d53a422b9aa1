"""How much compensation to dare, against drives of our own."""

import json
import warnings
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import lugrectl as lg

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
    log = {
        "t": t,
        "u": u + 0.01 * random.normal(size=6000),
        "w": w + 0.01 * random.normal(size=6000),
    }
    return lg.identify(log, lg.Model.of(friction="coulomb"))


@pytest.fixture(scope="module")
def found(fit):
    return lg.assure(fit, 0.8, loop="velocity", seed=3, hunts=0.2)


def test_it_helps_and_says_on_how_many_drives(found):
    assert found.observer == "extended_state" and 0.8 <= found.scale <= 1.2
    assert found.band[0] <= found.error <= found.bound <= found.band[1] < 0.5 * found.none
    assert (found.worse.count, found.worse.members, found.members) == (0, MEMBERS, MEMBERS)
    assert found.hunts.members == MEMBERS and found.controller["ki"] > 0.0


def test_its_figures_are_those_of_members_that_no_choice_has_seen(found):
    errors = found.errors["assured"]
    chosen = next(
        one for one in found.tried if (one.observer, one.scale) == (found.observer, found.scale)
    )
    assert found.error == np.median(errors) and chosen.median != found.error
    better = [one for one in found.tried if one.upper < chosen.upper]
    assert chosen.hunts == 0.0 and all(one.hunts is not None for one in better)


def test_the_report_holds_all_that_is_needed(fit, found, tmp_path):
    fit.save(tmp_path)
    again = lg.assure(tmp_path / "report.json", 0.8, loop="velocity", seed=3, hunts=0.2)
    assert again.to_dict() == found.to_dict()


def test_an_executor_gives_the_same(fit, found):
    with ThreadPoolExecutor(2) as pool:
        again = lg.assure(fit, 0.8, loop="velocity", seed=3, hunts=0.2, executor=pool)
    assert np.array_equal(again.errors["assured"], found.errors["assured"])


def test_too_few_members_have_no_bound(fit):
    few = lg.assure(fit, loop="velocity", members=4)
    assert np.isinf(few.bound) and json.loads(few.to_json())["bound"] is None


@pytest.mark.slow
@pytest.mark.sample
def test_a_late_and_coarse_loop_misses_more(fit):
    own = {"members": 2, "observers": "extended_state", "hunts": 1.0}  # whatever it does at rest
    fine = lg.assure(fit, counts=2**20, **own)
    coarse = lg.assure(fit, counts=200, dead_time=5e-3, **own)
    assert coarse.error > 2.0 * fine.error


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
@pytest.mark.sample
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

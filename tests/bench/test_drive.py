"""The compensation on drives like the recorded one, which are not exactly the model."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest

import lugrectl as lg
from lugrectl.bench.compensate import Drives, Spread
from lugrectl.estimates.covariance import Joint
from lugrectl.report import text

from ..cases.made_up import diagnosis as diagnosed
from ..cases.schema import SCHEMA, VALID, closed, document, jsonschema

MODEL = lg.Model.of(J=0.0022, friction="viscous", Fv=0.0005)
FULL = MODEL.with_effect("gravity", {"amplitude": 0.3, "phase": 0.3})
COUNT = 2 * np.pi / 8192
NAMES = ("J", "Fv", "gravity.amplitude")


def record(rate=1000.0, speed_noise=0.01, seconds=3.0):
    rng, t = np.random.default_rng(0), np.arange(0.0, seconds, 1.0 / rate)
    theta, w = -0.64 * np.cos(1.57 * t), np.sin(1.57 * t)
    return lg.Record(
        t=t,
        u=0.02 * np.sign(w) + rng.normal(0.0, 0.004, len(t)),
        theta=COUNT * np.round(theta / COUNT),
        w=w + rng.normal(0.0, speed_noise, len(t)),
    )


def joint(share):
    values = np.array([FULL.values()[name] for name in NAMES])
    return Joint(NAMES, values, np.diag((share * values) ** 2), np.full(3, True))


def compensated(share=0.05, draws=6, **options):
    own = {"declared": MODEL, "observer": None, "record": record(), "covariance": joint(share)}
    return lg.compensate(FULL, draws=draws, **own | options)


@pytest.fixture(scope="module")
def made():
    return compensated()


def test_the_errors_of_the_exact_model_stay_and_those_of_a_drive_stand_beside(made):
    assert made.after < 0.1 * made.before  # drive and belief are one model
    after, low, high = made.drive.of("after")
    assert 10 * made.after < low <= after <= high
    assert made.drive.best == "after"
    assert not [m for m in made.messages if "like the recorded one" in m]


def test_sample_time_encoder_counts_and_noise_are_those_of_the_record(made):
    drive = made.drive
    assert drive.rate == pytest.approx(1000.0)
    assert drive.resolution == pytest.approx(COUNT)
    assert drive.noise["w"] == pytest.approx(0.01, rel=0.1)
    assert drive.noise["u"] == pytest.approx(0.004, rel=0.1)
    assert drive.drawn == NAMES and len(drive.errors["after"]) == 6


def test_the_same_seed_gives_the_same_drives_and_another_one_others(made):
    again, other = compensated(), compensated(seed=1)
    for key, errors in made.drive.errors.items():
        assert np.array_equal(errors, again.drive.errors[key])
        assert not np.array_equal(errors, other.drive.errors[key])


def test_the_spread_grows_with_the_covariance(made):
    sharp, wide = compensated(0.001), compensated(0.3)
    sizes = [c.drive.of("after")[2] - c.drive.of("after")[1] for c in (sharp, made, wide)]
    assert sizes[0] < sizes[1] < sizes[2]


def test_without_a_covariance_the_drive_has_the_estimate_and_without_a_record_there_is_none():
    c = lg.compensate(FULL, declared=MODEL, observer=None, record=record())
    assert c.drive.drawn == () and len(c.drive.errors["after"]) == 1
    assert lg.compensate(MODEL, observer=None).drive is None


def test_a_compensation_that_makes_tracking_worse_says_so_and_advises_to_leave_it_off():
    """The drive's gravity acts the other way round: the compensation doubles it."""
    other = Joint(("gravity.phase",), np.array([0.3 - np.pi]), np.eye(1) * 1e-4, np.array([False]))
    c = compensated(covariance=other)
    (none, *_), (after, *_) = (c.drive.of(key) for key in ("none", "after"))
    assert after > 1.5 * none and c.drive.best != "after"
    (said,) = [m for m in c.messages if m.startswith("On a drive like the recorded one")]
    assert said == (
        "On a drive like the recorded one the compensation makes tracking worse: median error "
        f"{after:.3g} rad/s with it, {none:.3g} rad/s without; leave it off."
    )
    assert c.after < c.none  # in simulation of the exact model it helps


def test_a_loop_that_diverges_on_some_drives_is_counted_and_has_an_infinite_end():
    errors = {"none": np.ones(5), "before": np.ones(5), "after": np.array([1, 1, 1, 1, np.inf])}
    spread = Spread(1000.0, {"theta": 0.0, "w": math.nan, "u": 0.0}, 0.0, (), 0, errors)
    assert spread.of("after") == (1.0, 1.0, math.inf)
    said = spread.summary()
    assert said["after"]["diverged"] == 1 and said["recommended"] == "none"
    most = replace(spread, errors=errors | {"after": np.full(5, np.inf)})
    assert "unstable with it" in most.advice("rad")[0]


def test_drawn_parameters_stay_inside_their_bounds():
    drives = Drives(joint(3.0), 50, 0).of(FULL)
    assert all(one.J > 0 and one.values()["gravity.amplitude"] >= 0 for one in drives)
    assert len({one.J for one in drives}) == 50
    assert drives[0].values() == Drives(joint(3.0), 50, 0).of(FULL)[0].values()


def test_wrong_arguments_are_one_sentence():
    with pytest.raises(lg.InputError, match="covariance must be that of a diagnosis"):
        lg.compensate(MODEL, covariance=np.eye(2))
    with pytest.raises(lg.InputError, match="draws must be a whole number"):
        lg.compensate(MODEL, draws=0)


def test_the_report_and_its_schema_carry_the_spread(made):
    d = replace(diagnosed(), compensation=made)
    said = text(d)
    assert "on drives, median" in said and "10 to 90 %" in said
    assert max(map(len, said.splitlines())) <= 80
    whole = document(d)
    VALID.validate(whole)
    jsonschema.Draft202012Validator(closed(SCHEMA)).validate(whole)
    drive = whole["compensation"]["drive"]
    assert drive["draws"] == 6 and drive["none"]["low"] <= drive["none"]["median"]
    json.dumps(whole, allow_nan=False)
    assert "on a drive, after" in repr(made)

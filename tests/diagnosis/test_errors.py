"""Errors by simulation on held-out samples, residuals and values, on logs that are known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import lugrectl as lg

TRUE = lg.Model.of(lg.table1())
ARM = lg.Model.of(lg.table1(), effects={"name": "gravity", "amplitude": 0.1, "phase": 0.3})
NOISE = 1e-3


def log(model=TRUE, seconds=20.0, rate=500.0, seed=0, noise=NOISE, channels=("w",)):
    """A simulated log under a held torque of six sines, and more sensors than it records."""
    random = np.random.default_rng(seed)
    t = np.arange(round(seconds * rate)) / rate
    f, a, phase = random.uniform((0.1, 0.05, 0.0), (3.0, 0.25, 6.0), (6, 3)).T[..., None]
    u = np.sum(a * np.sin(2.0 * np.pi * f * t + phase), axis=0)
    y = lg.simulate(lg.plant(model), t, [u, 0.0 * u], hold=True).outputs
    w = y[1] + noise * random.standard_normal(len(t))
    theta = y[0] + 1e-3 * noise * random.standard_normal(len(t))
    given = {"w": w, "theta": theta}
    return lg.Record(t, u, **{k: given[k] for k in channels})


@pytest.fixture(scope="module")
def record():
    return log()


@pytest.fixture(scope="module")
def plain():
    return lg.diagnose(log(rate=1000.0), TRUE)


@pytest.fixture(scope="module")
def swung():
    return lg.diagnose(log(ARM), TRUE)


@pytest.mark.slow
def test_the_error_of_the_right_model_is_the_noise(plain):
    assert plain.verdict == "adequate"
    for found in (plain.error, plain.free_error):
        assert found["augmented"] == pytest.approx(NOISE, rel=0.05)
    assert plain.error["noise_floor"] == pytest.approx(NOISE, rel=0.05)
    assert plain.error["declared"] == pytest.approx(NOISE, rel=0.05)
    assert plain.residuals.white and plain.residuals.independent


@pytest.mark.slow
def test_a_missing_effect_is_an_error(swung):
    assert [e.name for e in swung.effects] == ["gravity"]
    for found in (swung.error, swung.free_error, swung.torque_error):
        assert found["augmented"] < 0.1 * found["refitted"]
    assert swung.torque_error["refitted"] == pytest.approx(0.1 / 2**0.5, rel=0.4)


def test_the_error_is_that_of_the_traces(plain):
    error, traces = plain.error, plain.traces
    assert error["signal"] == "w" and error["unit"] == "rad/s" and error["horizon"] == 1.0
    assert plain.free_error["in_sample"] is True
    assert traces.held_out.sum() == error["samples"]
    assert np.array_equal(np.isfinite(traces.simulated["augmented"]), traces.held_out)
    own = (traces.measured - traces.simulated["augmented"])[traces.held_out]
    assert np.sqrt(np.mean(own**2)) == pytest.approx(error["augmented"])
    inside = np.isfinite(traces.signals["w"])
    assert inside.mean() > 0.9
    assert np.std((traces.signals["w"] - traces.measured)[inside]) < 2 * NOISE


def test_held_out_blocks_are_long(plain):
    edges = np.flatnonzero(np.diff(np.r_[0, plain.traces.held_out.astype(int), 0]))
    lengths = np.diff(edges)[::2]
    assert len(lengths) > 1 and np.all(lengths >= 2.0 * 1000)


@pytest.mark.slow
def test_the_last_half_is_held_out(record):
    found = lg.diagnose(record, TRUE, holdout="last")
    assert found.free_error["in_sample"] is False
    held_out = np.flatnonzero(found.traces.held_out)
    assert held_out[0] > 5_000 and np.all(np.diff(held_out) == 1)
    assert found.free_error["augmented"] == pytest.approx(NOISE, rel=0.1)


@pytest.mark.slow
@pytest.mark.sample
def test_a_record_is_held_out_whatever_its_rate_and_channels(record):
    other = log(rate=250.0, seed=2, channels=("w", "theta"))
    found = lg.diagnose(record, TRUE, holdout=other)
    assert not found.traces.held_out[: record.samples].any()
    assert found.error["augmented"] == pytest.approx(NOISE, rel=0.2)


@pytest.mark.slow
def test_no_fit_sees_a_record_that_is_held_out(record):
    other = log(seed=1, seconds=10.0)
    wrong = replace(other, w=other.w + 0.05, log=None)
    before, after = (lg.identify(record, TRUE, holdout=held) for held in (other, wrong))
    assert after.error["refitted"] > 5.0 * before.error["refitted"]
    assert after.model.values() == pytest.approx(before.model.values(), rel=1e-9)


@pytest.mark.slow
@pytest.mark.sample
def test_a_position_in_coarse_counts():
    record = log(channels=("theta",), noise=0.0)
    count = 2.0 * np.pi / 4096
    coarse = replace(record, theta=count * np.round(record.theta / count), log=None)
    found = lg.diagnose(coarse, TRUE)
    assert (found.error["signal"], found.error["unit"]) == ("theta", "rad")
    assert found.residuals.signal == "theta"
    assert found.error["augmented"] < 1.1 * count / 12**0.5


@pytest.mark.slow
def test_the_bristles_of_the_drive_are_found():
    wrong = {"sigma0": 800.0, "sigma1": 0.2, "Fs": 0.4, "vs": 0.03, "J": 0.00221, "Fc": 0.287}
    found = lg.identify(log(seconds=30.0), TRUE.with_values(wrong))
    for key, true in TRUE.known().items():
        own = found.estimates[key]
        assert abs(own.value - true) < 1.8 * np.ptp(own.ci95), key  # seven values: 3.5 sigma
    assert np.ptp(found.estimates["sigma0"].ci95) < 0.04 * 260.0


@pytest.mark.slow
def test_runs_are_of_one_kind(record):
    linear = replace(log(seed=1, seconds=4.0), motion="linear", log=None)
    with pytest.raises(lg.InputError, match="one drive"):
        lg.diagnose([record, linear], TRUE)

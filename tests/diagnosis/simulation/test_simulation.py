"""Errors by simulation, residuals and a last polish, on logs of which everything is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import lugrectl as lg
from lugrectl.diagnosis.simulation import records as simulated
from lugrectl.diagnosis.simulation.drive import fitted
from lugrectl.diagnosis.simulation.judge import errors, residuals, torque_noise
from lugrectl.diagnosis.simulation.polishing import polish

TRUE = lg.Model.of(lg.table1())
ARM = lg.Model.of(lg.table1(), effects={"name": "gravity", "amplitude": 0.1, "phase": 0.3})


def log(
    model=TRUE, seconds=20.0, rate=1000.0, seed=0, noise=1e-3, channels=("w",), shift=0.0, fast=3.0
):
    """A simulated log under a held torque of six sines, and more sensors than it records."""
    random = np.random.default_rng(seed)
    t = np.arange(round(seconds * rate)) / rate
    f, a, phase = random.uniform((0.1, 0.05, 0.0), (fast, 0.25, 6.0), (6, 3)).T[..., None]
    u = np.sum(a * np.sin(2.0 * np.pi * f * t + phase), axis=0)
    y = lg.simulate(lg.plant(model), t, [u, 0.0 * u], hold=True).outputs
    w = y[1] + noise * random.standard_normal(len(t))
    theta = y[0] + 1e-3 * noise * random.standard_normal(len(t))
    given = {"w": w, "theta": theta}
    return lg.Record(t, u + shift, **{k: given[k] for k in channels})


@pytest.fixture(scope="module")
def record():
    return log()


def prepared(records, model, *how, **more):
    """Of one record, or of a list."""
    given = [records] if isinstance(records, lg.Record) else records
    return simulated.prepared(given, model, *how, **more)


def changed(record, where, by):
    """The record with another speed at some samples."""
    w = record.w.copy()
    w[where] += by
    return replace(record, w=w, log=None)


def test_the_true_model_has_no_error():
    ready = prepared(log(noise=0.0), TRUE, None, 1.0)
    made = errors(ready, {"declared": TRUE, "refitted": TRUE, "augmented": TRUE})
    assert made.error["augmented"] < 1e-3 * made.error["noise_floor"] + 1e-4
    assert made.free_error["augmented"] < 1e-3
    assert made.torque_error["augmented"] < 1e-4
    assert made.error["fit"]["augmented"] > 99.9
    assert made.messages == ()


def test_the_error_of_the_true_model_is_the_noise(record):
    ready = prepared(record, TRUE, None, 1.0)
    made = errors(ready, {"declared": None, "refitted": TRUE, "augmented": TRUE})
    assert made.error["augmented"] == pytest.approx(1e-3, rel=0.05)
    assert made.free_error["augmented"] == pytest.approx(1e-3, rel=0.05)
    assert made.error["noise_floor"] == pytest.approx(1e-3, rel=0.05)
    assert made.error["declared"] is None and made.error["fit"]["declared"] is None
    assert residuals(ready, TRUE).white and residuals(ready, TRUE).independent


def test_a_missing_effect_is_an_error():
    ready = prepared(log(ARM), TRUE, None, 1.0)
    made = errors(ready, {"declared": TRUE, "refitted": TRUE, "augmented": ARM})
    for found in (made.error, made.free_error, made.torque_error):
        assert found["augmented"] < 0.1 * found["refitted"]
    assert made.torque_error["refitted"] == pytest.approx(0.1 / 2**0.5, rel=0.4)
    assert torque_noise(ready, ARM) < 0.1 * torque_noise(ready, TRUE)
    assert not residuals(ready, TRUE).white


def test_what_errors_return_is_what_the_document_holds(record):
    made = errors(prepared(record, TRUE, None, 0.5), {"refitted": TRUE, "augmented": TRUE})
    assert made.error["signal"] == "w" and made.error["unit"] == "rad/s"
    assert made.error["horizon"] == 0.5 and made.error["samples"] % 500 == 0
    assert made.free_error["in_sample"] is True
    traces = made.traces
    assert traces.held_out.sum() == made.error["samples"]
    held_out = np.isfinite(traces.simulated["augmented"])
    assert np.array_equal(held_out, traces.held_out)
    own = (traces.measured - traces.simulated["augmented"])[held_out]
    assert np.sqrt(np.mean(own**2)) == pytest.approx(made.error["augmented"])
    inside = np.isfinite(traces.signals["w"])
    assert inside.mean() > 0.9
    assert np.std((traces.signals["w"] - traces.measured)[inside]) < 2e-3


def test_held_out_blocks_are_long_and_behind_gaps(record):
    ready = prepared(record, TRUE, None, 1.0)
    train = np.concatenate([w.counted.ravel() for w in ready.train])
    for _, start, end in ready.held_out:
        assert end - start > 1.99
        off = np.maximum(start - record.t[train], record.t[train] - end)
        assert off.min() > 0.24
    longer = prepared(record, TRUE, None, 1.0, memory=3.5)
    assert min(end - start for _, start, end in longer.held_out) > 3.99


def test_no_fit_sees_what_is_held_out(record):
    ready = prepared(record, TRUE, None, 1.0)
    other = record
    for _, start, end in ready.held_out:
        other = changed(other, (record.t >= start) & (record.t <= end), 0.05)
    start = TRUE.with_values({"sigma0": 350.0})
    free = ["J", "Fc", "Fv", "sigma0"]
    before = polish(ready, start, free).values
    after = polish(prepared(other, TRUE, None, 1.0), start, free).values
    assert [after[k] for k in free] == pytest.approx([before[k] for k in free], rel=1e-6)


def test_a_restart_sees_no_later_sample(record):
    ready = prepared(record, TRUE, None, 1.0)
    fit, run, where = fitted(ready, TRUE), ready.runs[0], ready.test[0]
    last = where.at(np.array([len(where.start) - 1]))
    later, earlier = run.y.copy(), run.y.copy()
    later[last.start[0] :] += 1.0
    earlier[last.start[0] - 1] += 1.0
    made = [
        fit.drive.simulate(fit.values, 10.0 * fit.jump, replace(run, y=y), last)
        for y in (run.y, later, earlier)
    ]
    assert np.array_equal(made[0], made[1])
    assert not np.allclose(made[0], made[2], atol=1e-4)


def test_the_last_half_is_held_out(record):
    ready = prepared(record, TRUE, "last", 1.0)
    assert not ready.in_sample
    assert ready.held_out == ((0, pytest.approx(10.25), pytest.approx(19.999)),)
    made = errors(ready, {"refitted": TRUE, "augmented": TRUE})
    assert made.free_error["in_sample"] is False
    assert made.free_error["augmented"] == pytest.approx(1e-3, rel=0.1)


def test_a_record_is_held_out(record):
    ready = prepared(record, TRUE, log(seed=1), 1.0)
    assert len(ready.runs) == 2
    assert {run for run, _, _ in ready.held_out} == {1}
    made = errors(ready, {"refitted": TRUE, "augmented": TRUE})
    assert made.error["augmented"] == pytest.approx(1e-3, rel=0.1)
    assert not made.traces.held_out[: record.samples].any()


def test_runs_keep_their_rates_and_channels(record):
    slow = log(rate=250.0, seed=2, channels=("theta",))
    ready = prepared([record, slow], TRUE, None, 1.0)
    assert [run.dt for run in ready.runs] == pytest.approx([1e-3, 4e-3])
    made = errors(ready, {"refitted": TRUE, "augmented": TRUE})
    assert made.error["augmented"] == pytest.approx(1e-3, rel=0.1)
    assert len(made.traces.t) == sum(len(run.t) for run in ready.runs)
    assert polish(ready, TRUE, ["J", "Fc", "Fv"]).gained
    assert len(residuals(ready, TRUE).lags) > 10


def test_theta_alone():
    ready = prepared(log(channels=("theta",)), TRUE, None, 1.0)
    made = errors(ready, {"refitted": TRUE, "augmented": TRUE})
    assert made.error["signal"] == "theta" and made.error["unit"] == "rad"
    assert made.error["augmented"] < 2.0 * made.error["noise_floor"]
    assert residuals(ready, TRUE).signal == "theta"


def test_a_coarse_encoder():
    record = log(channels=("theta",), noise=0.0)
    count = 2.0 * np.pi / 4096
    coarse = replace(record, theta=count * np.round(record.theta / count), log=None)
    made = errors(prepared(coarse, TRUE, None, 1.0), {"augmented": TRUE})
    assert made.error["augmented"] < 1.1 * count / 12**0.5


def test_a_speed_that_lags():
    lag = lg.Model.of(TRUE, effects={"name": "velocity_sensor_lag", "time_constant": 0.02})
    record = log(noise=0.0)
    w = lg.simulate(lg.sensor(lag), record.t, [record.w, 0.0 * record.w]).outputs[0]
    w = w + 1e-3 * np.random.default_rng(0).standard_normal(len(w))
    ready = prepared(replace(record, w=w, log=None), TRUE, None, 1.0)
    made = errors(ready, {"refitted": TRUE, "augmented": lag})
    assert made.error["augmented"] == pytest.approx(1e-3, rel=0.05)
    assert made.error["refitted"] > 20e-3


def test_a_speed_that_repeats_theta_is_no_sensor():
    record = log(channels=("theta",))
    w = np.gradient(record.theta, record.dt)
    made = prepared(replace(record, w=w, log=None), TRUE, None, 1.0)
    assert np.isnan(made.runs[0].noise[1]) and made.channel == 1


@pytest.mark.parametrize("delay", [0.0035, -0.0035])
def test_a_torque_written_down_late_or_early(record, delay):
    ready = prepared(record, TRUE, None, 1.0)
    wrong = ready.as_it_acts({}, -delay)
    right = wrong.as_it_acts({}, delay)
    made = [errors(one, {"augmented": TRUE}).error["augmented"] for one in (ready, wrong, right)]
    assert made[1] > 10.0 * made[0]
    assert made[2] < 0.2 * made[1]


def test_an_offset_of_a_run_is_taken_off(record):
    ready = prepared([record, log(seed=1, shift=0.02)], TRUE, None, 1.0)
    known = ready.as_it_acts({1: 0.02})
    assert errors(known, {"augmented": TRUE}).error["augmented"] == pytest.approx(1e-3, rel=0.1)
    assert errors(ready, {"augmented": TRUE}).error["augmented"] > 5e-3


@pytest.mark.slow
@pytest.mark.sample
def test_a_delay_in_the_model_acts_on_the_torque():
    late = lg.Model.of(TRUE, effects={"name": "input_delay", "delay": 0.005})
    ready = prepared(log(late), TRUE, None, 1.0)
    made = errors(ready, {"refitted": TRUE, "augmented": late})
    assert made.error["augmented"] == pytest.approx(1e-3, rel=0.1)
    assert made.error["refitted"] > 5e-3


def test_a_simulation_that_diverges_has_no_error(record, monkeypatch):
    ready = prepared(record, TRUE, None, 1.0)

    def diverged(values, jump, run, where):
        return np.full((len(where.start), where.length, 2), np.inf)

    monkeypatch.setattr(fitted(ready, TRUE).drive, "simulate", diverged)
    made = errors(ready, {"augmented": TRUE})
    assert made.error["augmented"] is None and made.error["fit"]["augmented"] is None
    assert "the augmented model diverges" in made.messages[0].lower()


def test_a_long_record_is_judged_on_evenly_spread_windows(record, monkeypatch):
    monkeypatch.setattr("lugrectl.diagnosis.simulation.records.MOST", 4000)
    ready = prepared(record, TRUE, None, 1.0)
    assert sum(w.counted.size for w in ready.test) == 4000
    made = errors(ready, {"augmented": TRUE})
    assert made.error["samples"] == 4000
    assert made.error["augmented"] == pytest.approx(1e-3, rel=0.1)


def test_what_is_too_short_is_refused():
    with pytest.raises(lg.Refused, match="too short"):
        prepared(log(seconds=4.0), TRUE, None, 1.0)
    with pytest.raises(lg.Refused, match="too short"):
        prepared(log(seconds=0.5), TRUE, None, 1.0)
    with pytest.raises(lg.Refused):
        prepared(log(seconds=30.0), TRUE, None, 20.0)


def test_runs_are_of_one_kind(record):
    with pytest.raises(lg.InputError, match="one drive"):
        prepared([record, replace(log(seed=1), motion="linear", log=None)], TRUE, None, 1.0)


def test_errors_need_all_values(record):
    ready = prepared(record, TRUE, None, 1.0)
    with pytest.raises(lg.InputError, match="sigma0"):
        errors(ready, {"augmented": lg.Model.of(J=0.002)})


WRONG = {"sigma0": 800.0, "sigma1": 0.2, "Fs": 0.4, "vs": 0.03, "J": 0.00221, "Fc": 0.287}


@pytest.mark.slow
@pytest.mark.sample
@pytest.mark.parametrize("channel", ["w", "theta"])
def test_a_polish_finds_the_values_of_the_bristles(channel):
    ready = prepared(log(seconds=30.0, channels=(channel,)), TRUE, None, 1.0)
    made = polish(ready, TRUE.with_values(WRONG), list(TRUE.known()))
    assert made.gained and made.gain > 2.0 * made.error
    std = dict(zip(made.joint.names, np.sqrt(np.diag(made.joint.matrix)), strict=True))
    assert {"J", "Fc", "Fv", "sigma0", "sigma1", "Fs", "vs"} == set(std)
    true = TRUE.known()
    off = {k: abs(made.values[k] - true[k]) / std[k] for k in std}
    assert max(off.values()) < 3.5 and np.median(list(off.values())) < 2.0, off
    assert std["sigma0"] < 0.01 * true["sigma0"] and std["Fs"] < 0.1 * true["Fs"]


def test_a_polish_that_changes_nothing_confirms_the_values(record):
    made = polish(prepared(record, TRUE, None, 1.0), TRUE, ["sigma0", "sigma1"])
    assert made.gained and set(made.joint.names) == {"sigma0", "sigma1"}
    assert made.values["sigma0"] == pytest.approx(260.0, rel=1e-2)


def test_a_polish_of_what_the_record_does_not_show():
    viscous = lg.Model.of(J=0.0022, friction="viscous", Fv=0.05)
    model = lg.Model.of(viscous, effects={"name": "actuator_saturation", "limit": 100.0})
    made = polish(prepared(log(viscous), model, None, 1.0), model, ["actuator_saturation.limit"])
    assert made.joint.names == ()


def test_statements_hold_in_a_polish(record):
    ready = prepared(record, TRUE, None, 1.0)
    held = TRUE.with_values({"sigma0": 300.0}).fix("sigma0")
    assert polish(ready, held, ["sigma0", "J"]).values["sigma0"] == 300.0
    bounded = lg.Model.of(TRUE, sigma0={"value": 300.0, "min": 290.0, "max": 400.0})
    assert polish(ready, bounded, ["sigma0"]).values["sigma0"] >= 290.0
    sure = lg.Model.of(TRUE, J={"value": 0.0022, "std": 1e-9})
    made = polish(prepared(record, sure, None, 1.0), sure, ["J", "Fc"])
    assert made.values["J"] == pytest.approx(0.0022, abs=4e-9)


def test_what_is_known_beforehand_is_a_prior(record):
    ready = prepared(record, TRUE, None, 1.0)
    whole = polish(ready, TRUE, ["J", "Fc", "Fv"])
    known = replace(whole.joint, matrix=1e-6 * whole.joint.matrix)
    start = TRUE.with_values({"J": 0.0022 * 1.0001})
    made = polish(ready, start, ["J", "Fc", "Fv"], known)
    assert made.values["J"] == pytest.approx(0.0022 * 1.0001, rel=1e-6)


@pytest.mark.slow
@pytest.mark.sample
def test_a_load_behind_a_spring_at_coarse_counts():
    spring = {"load_inertia": 1e-3, "stiffness": 8.0, "damping": 0.01}
    true = lg.Model.of(TRUE, effects={"name": "elastic_coupling", **spring})
    record = log(true, seconds=30.0, channels=("theta",), noise=0.0, fast=30.0)
    count = 2.0 * np.pi / 8192
    record = replace(record, theta=count * np.round(record.theta / count), log=None)
    keys = [f"elastic_coupling.{k}" for k in spring]
    start = true.with_values({keys[0]: 1.1e-3, keys[1]: 7.0, keys[2]: 0.02})
    made = polish(prepared(record, true, None, 1.0), start, ["J", "Fc", "Fv", *keys])
    std = dict(zip(made.joint.names, np.sqrt(np.diag(made.joint.matrix)), strict=True))
    for key in keys[:2]:
        assert abs(made.values[key] - true.known()[key]) < 4.0 * std[key]
        assert std[key] < 0.05 * true.known()[key]

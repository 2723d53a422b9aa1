"""Splitting, fitting and judging, on records from a simulator that shares nothing with it."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lugrectl import Refused, diagnose, identify
from lugrectl.blocks.model import Model, model_from_dict
from lugrectl.diagnosis.result import VERDICTS
from lugrectl.identification.dataset.dataset import prepare
from lugrectl.identification.dataset.folds import GAP, split
from lugrectl.identification.likelihood.initial_values import Start, turned
from lugrectl.identification.likelihood.likelihood import (
    WORST,
    compared,
    loglik,
    whitened,
    whitened_by_parts,
)
from lugrectl.identification.likelihood.maximise import fit
from lugrectl.identification.likelihood.parameters import Coordinate, coordinates, free_keys
from lugrectl.identification.likelihood.predictor import Predictor
from lugrectl.record import Record
from tests.blind.plan import Task
from tests.blind.work import case_of
from tests.rig import make

from ..cases.common import begun, model_of, record_of


@pytest.fixture(scope="module")
def plain():
    return make("none", machine="servo", excitation="rich", seed=101, duration=20.0)


@pytest.fixture(scope="module")
def job(plain):
    return begun(record_of(plain), model_of(plain))


@given(st.floats(9.0, 60.0), st.sampled_from([100.0, 333.0, 1000.0]), st.floats(0.3, 3.0))
def test_no_sample_fits_and_judges(duration, rate, horizon):
    n = int(duration * rate)
    t = np.arange(n) / rate
    data = prepare([Record(t=t, u=np.sin(t), w=np.cos(3 * t), dt=1 / rate)])
    try:
        parts = split(data, horizon)
    except Refused:
        assert duration < 4 * (max(2.0, horizon) + GAP) + 4.0
        return
    seen, held = set(parts.train.counted.ravel()), set(parts.test.counted.ravel())
    assert not seen & held
    between = min(abs(a - b) for a in (min(seen), max(seen)) for b in held)
    assert between >= round(GAP * rate)
    blocks = np.split(np.sort(list(held)), np.flatnonzero(np.diff(np.sort(list(held))) > 1) + 1)
    assert min(len(b) for b in blocks) >= 0.99 * min(2.0, duration / 4) * rate - 2


def test_refit_recovers_the_machine(plain, job):
    true = plain.truth["plant"]
    for key, tolerance in {"J": 1e-3, "Fc": 2e-3, "Fv": 5e-3, "sigma0": 0.02}.items():
        assert job.base.values[key] == pytest.approx(true[key], rel=tolerance)
    low, high = job.base.intervals()["Fc"]
    assert low < job.base.values["Fc"] < high


def test_innovations_of_the_right_model_are_white(job):
    e = job.base.innovations
    for channel in range(2):
        x = e[..., channel]
        new = job.data.weight[job.base.where.counted][..., channel] == 1.0
        assert np.var(x[new]) == pytest.approx(1.0, abs=0.25)
        for lag in (1, 2, 5, 20):
            assert abs(np.mean(x[:, lag:] * x[:, :-lag])) < 0.06


def test_likelihood_is_highest_at_the_fit(job):
    base = job.base
    top = np.sum(base.innovations**2)
    for key in ("J", "Fc", "Fv", "sigma0"):
        for factor in (0.98, 1.02):
            moved = base.values | {key: base.values[key] * factor}
            white = whitened(base.predictor, [moved], base.where, base.noise)
            assert np.sum(white**2) > top


@pytest.mark.parametrize(
    "seed, hard, form",
    [(138405, True, ""), (139449, False, "w differentiated")],
)
@pytest.mark.slow
@pytest.mark.sample
def test_no_loud_observer_hides_the_true_values(seed, hard, form):
    """One that follows a counter at rest; one that makes up for bristles twice too soft."""
    case = case_of(Task("none", (), "normal", seed, hard=hard, form=form))
    base = begun(record_of(case), model_of(case)).base
    for key in ("J", "sigma0", "Fc", "Fs", "Fv", "vs"):
        true = case.truth["plant"][key]
        assert base.values[key] == pytest.approx(true, rel=0.06), key
    friction = base.predictor.friction(base.values)[base.where.counted]
    assert base.torque_noise < 0.02 * np.sqrt(np.mean(friction**2))


def test_a_prediction_that_is_no_number_is_as_wrong_as_can_be(job):
    nan = np.nan
    assert list(compared(np.array([1.0, nan, 1.0]), np.array([0.5, 2.0, nan]))) == [0.5, 0, WORST]
    base = job.base
    stop = {"position": -230.0, "stiffness": 1e138, "side": 1.0}
    predictor = Predictor(base.predictor.model.with_effect("hard_stop", stop), job.data)
    values = base.values | {f"hard_stop.{k}": v for k, v in stop.items()}
    with np.errstate(over="ignore"):
        white = whitened(predictor, [values], base.where, base.noise)
        found = loglik(predictor, white[0], base.noise, values, base.where)
    assert np.all(found < base.loglik)


def test_missing_values_are_identified(plain):
    tree = plain.model | {"plant": {}, "friction": {"model": "lugre"}}
    found = identify(record_of(plain), model_from_dict(tree, "case"))
    for key in ("J", "Fc", "Fv"):
        true = plain.truth["plant"][key]
        assert found.estimates[key].value == pytest.approx(true, rel=0.01)
    for key in ("Fs", "vs"):  # which this record hardly tells apart
        low, high = found.estimates[key].ci95
        assert low < plain.truth["plant"][key] < high
    assert found.error["declared"] is None
    assert found.error["refitted"] < 4 * found.error["noise_floor"]


@pytest.mark.slow
@pytest.mark.sample
def test_intervals_cover_over_repeated_noise():
    """Twelve records of one machine: 95 % intervals of J and Fc miss at most three in 24."""
    missed = 0
    for seed in range(12):
        case = make("none", machine="servo", excitation="rich", seed=500, duration=12.0,
                    torque_noise=5e-4)  # fmt: skip
        rng = np.random.default_rng(seed)
        c = case.columns
        record = Record(
            t=c["t"], u=c["u"] + 5e-4 * rng.normal(size=len(c["t"])), theta=c["theta"],
            w=c["w"] + 2e-3 * rng.normal(size=len(c["t"])), dt=1e-3,
        )  # fmt: skip
        model = model_of(case)
        data = prepare([record])
        predictor = Predictor(model, data)
        where = split(data, 1.0).train
        fitted = fit(predictor, model.known(), free_keys(predictor), where, data.noise)
        for key in ("J", "Fc"):
            low, high = fitted.intervals()[key]
            missed += not low < case.truth["plant"][key] < high
    assert missed <= 3


def test_diagnosis_has_the_whole_answer(plain):
    result = diagnose(record_of(plain), model_of(plain), holdout="last")
    answer = result.summary()
    assert answer["verdict"] in VERDICTS and answer["schema"] == 1
    assert answer["free_error"]["in_sample"] is False
    assert answer["error"]["refitted"] == answer["error"]["augmented"]
    assert answer["error"]["declared"] > answer["error"]["refitted"]
    assert answer["experiment"] is None and answer["effects"] == []


@pytest.mark.slow
def test_a_separate_run_can_be_held_out():
    runs = [
        make("none", machine="servo", excitation=excitation, seed=7, duration=10.0)
        for excitation in ("rich", "multisine")
    ]
    result = diagnose(record_of(runs[0]), model_of(runs[0]), holdout=record_of(runs[1]))
    assert result.error["samples"] <= len(runs[1].columns["t"])
    assert not result.free_error["in_sample"]
    assert result.error["refitted"] < 0.1 * result.error["declared"]


def test_a_short_record_at_a_low_rate_is_answered():
    """A quarter of a second would be fewer samples than a model of the noise needs."""
    case = make("none", machine="servo", excitation="moves", seed=1, rate=50.0, duration=6.0)
    assert diagnose(record_of(case), model_of(case)).verdict == "adequate"


def test_a_record_too_short_for_a_simulation_is_compared_all_the_same(plain):
    found = diagnose(record_of(plain).slice(3000, 6000), model_of(plain))
    assert found.verdict == "adequate" and found.error is None
    assert "too short to fit the model" in " ".join(found.messages)


def test_a_strength_stays_one_that_the_engine_can_take(plain):
    """A linear step led to a stop of 1e136 N/m, in which a simulation lost itself for minutes."""
    made = model_of(plain).with_effect("hard_stop", {"position": 1.0, "stiffness": 0.0})
    predictor = Predictor(made, prepare([record_of(plain)]))
    (stop,) = coordinates(predictor, ["hard_stop.stiffness"], predictor.model.values())
    torque, travel = np.std(record_of(plain).u), np.ptp(predictor.data.log.theta)
    assert stop.kind == "linear"
    assert stop.back(1e136, {}) == pytest.approx(1e8 * torque / travel, rel=1e-6)
    assert stop.back(1e7 * torque / travel, {}) == 1e7 * torque / travel


def test_a_phase_that_was_declared_wrong_is_turned(plain):
    record, model = record_of(plain), model_of(plain)
    pushed = replace(record, u=record.u + 0.1 * np.sin(record.theta + 0.4))
    model = model.with_effect("gravity", {"amplitude": 0.1, "phase": 0.4})
    base = begun(pushed, model).base

    def phase_of(phase):
        start = Start(base.values | {"gravity.phase": phase}, base.noise, 0.0)
        return turned(base.predictor, base.where, start).values["gravity.phase"]

    assert phase_of(0.4) == 0.4
    assert abs(phase_of(2.3) - 0.4) < 0.8


@given(st.floats(-20.0, 20.0))
def test_a_phase_stays_an_angle(x):
    phase = Coordinate("gravity.phase", "angle", -np.pi, np.pi, 1e-4).back(x, {})
    assert -np.pi < phase <= np.pi + 1e-12
    assert np.cos(phase) == pytest.approx(np.cos(x), abs=1e-9)
    assert np.sin(phase) == pytest.approx(np.sin(x), abs=1e-9)


def test_the_last_block_takes_what_is_left_of_a_run():
    t = np.arange(10_000) * 1e-3  # four blocks of 2.25 s and one second more
    data = prepare([Record(t=t, u=np.sin(t), w=np.cos(3 * t), dt=1e-3)])
    parts = split(data, 1.0)
    assert parts.test.counted.max() > 9_700 > parts.train.counted.max()


def test_parts_of_a_call_give_what_the_whole_gives(job, monkeypatch):
    sets = [job.base.values | {"J": job.base.values["J"] * f} for f in (0.9, 1.0, 1.1, 1.2, 1.3)]
    base = job.base
    whole = whitened_by_parts(base.predictor, sets, base.where, base.noise)
    monkeypatch.setattr(
        "lugrectl.identification.likelihood.likelihood.LARGEST", 2 * base.where.counted.size
    )
    parts = whitened_by_parts(base.predictor, sets, base.where, base.noise)
    assert np.array_equal(parts, whole)


def test_a_standstill_before_the_motion_changes_no_value(plain):
    """12 s at rest before 20 s of motion."""
    moving, J = record_of(plain), model_of(plain).J
    model, dt = Model.of(J=J, friction="lugre"), moving.dt
    rest, chance = round(12.0 / dt), np.random.default_rng(0)
    noise = {k: prepare([moving]).noise for k in ("theta", "w")}
    still = {"u": np.zeros(rest)}
    for k in ("theta", "w"):
        if getattr(moving, k) is not None:
            own = getattr(noise[k], k)
            still[k] = getattr(moving, k)[0] * (k == "theta") + own * chance.standard_normal(rest)
    both = {k: np.concatenate([x, getattr(moving, k)]) for k, x in still.items()}
    longer = Record(t=dt * np.arange(len(both["u"])), motion=moving.motion, **both)
    alone, after = (identify(r, model).model.values() for r in (moving, longer))
    for key in ("J", "Fc", "Fv", "sigma0"):
        assert after[key] == pytest.approx(alone[key], rel=0.1), key

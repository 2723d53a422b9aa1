"""A speed that is only the position, differentiated, is no second sensor."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import butter, filtfilt, lfilter

from lugrectl import diagnose
from lugrectl.identification.dataset.dataset import prepare
from lugrectl.identification.dataset.derived_speed import (
    DIFFERENCED,
    REPEATED,
    are_coherent,
    filtered,
    on_theta_alone,
    repeats,
)
from tests.blind.plan import Task
from tests.blind.work import case_of
from tests.rig import make, sample

from ..cases.common import model_of, record_of

SMOOTHED = "w smoothed"


@pytest.fixture(scope="module")
def case():
    return make("none", machine="joint", excitation="stopgo", seed=4107, rate=500.0, duration=20.0)


@pytest.fixture(scope="module")
def record(case):
    return record_of(case)


def counted(record):
    """The position on a coarse encoder, and its plain difference."""
    count = np.ptp(record.theta) * 1e-5
    theta = np.round(record.theta / count) * count
    return theta, np.diff(theta, prepend=theta[0]) / record.dt


def forward_and_back(w, dt):
    return filtfilt(*butter(2, 80.0 * dt), w)


def behind(w, dt):
    return lfilter(*butter(1, 40.0 * dt), w)


def differentiated(record, smooth):
    theta, w = counted(record)
    return replace(record, theta=theta, w=smooth(w, record.dt))


@pytest.mark.parametrize("smooth", [lambda w, dt: w, forward_and_back])
def test_a_differentiated_position_is_fitted_alone(record, smooth):
    repeated = differentiated(record, smooth)
    data = prepare([repeated])
    alone, said = on_theta_alone([repeated], data)
    assert said == REPEATED
    assert np.isnan(alone.noise.w) and np.all(np.isnan(alone.y[:, 1]))
    assert alone.signal == "w" and np.array_equal(alone.measured, repeated.w)
    assert alone.floor == data.noise.w


def test_a_smoothed_difference_is_one_in_a_fast_log_too():
    """From sample to sample it shows nothing there but rounding."""
    task = Task("effect", ("input_delay",), "weak", 135000)
    two, repeated = (prepare([record_of(case_of(replace(task, form=f)))]) for f in ("", SMOOTHED))
    assert repeated.dt == 2e-4
    assert repeats(repeated) and not repeats(two)


def test_a_second_sensor_is_kept(record):
    data = prepare([record])
    assert not repeats(data) and on_theta_alone([record], data) is None
    assert not repeats(prepare([replace(record, w=None)]))


def test_a_swinging_coupling_makes_no_repetition_of_two_sensors():
    """Its fast motion alone makes them coherent where there is hardly any as a rule."""
    data = prepare([record_of(sample("elastic_coupling", 126500))])
    assert all(are_coherent(data.y[a:b]) for a, b in data.runs)
    assert not repeats(data)


@pytest.mark.parametrize("central", [False, True])
def test_differences_alone_are_summed(record, central):
    theta, w = counted(record)
    w = np.gradient(theta, record.dt) if central else w
    only = replace(record, theta=None, w=w)
    alone, said = on_theta_alone([only], prepare([only]))
    assert said == DIFFERENCED and np.array_equal(alone.measured, w)
    assert np.allclose(np.diff(alone.y[:, 0]), record.dt * w[1:], atol=1e-9)
    sensed = replace(record, theta=None)
    assert on_theta_alone([sensed], prepare([sensed])) is None


def test_a_filtered_speed_alone_has_no_white_noise(record):
    sensed = replace(record, theta=None)
    smooth = replace(sensed, w=forward_and_back(counted(record)[1], record.dt))
    assert filtered(prepare([smooth])) and not filtered(prepare([sensed]))
    assert on_theta_alone([smooth], prepare([smooth])) is None


@pytest.mark.slow
def test_the_noise_of_a_filtered_speed_is_no_missing_effect(case, record):
    w = forward_and_back(counted(record)[1], record.dt)
    assert diagnose(replace(record, theta=None, w=w), model_of(case)).verdict == "adequate"


@pytest.mark.slow
@pytest.mark.sample
def test_a_late_speed_that_repeats_theta_is_no_effect_and_its_lag_is_said(case, record):
    """It is the logger's filter, not a sensor of the drive."""
    late = differentiated(record, behind)
    lag = 1e3 / (2.0 * np.pi * 20.0) + 0.5e3 * record.dt  # ms: a difference is half a sample late
    result = diagnose(late, model_of(case))
    assert result.verdict == "adequate" and REPEATED in result.messages
    (said,) = [m for m in result.messages if m.startswith("w lags theta by")]
    assert float(said.split("by ")[1].split(" ms")[0]) == pytest.approx(lag, rel=0.05)


@pytest.mark.slow
def test_the_noise_of_an_encoder_is_no_missing_effect(case, record):
    repeated = differentiated(record, lambda w, dt: w)
    result = diagnose(repeated, model_of(case))
    assert result.verdict == "adequate" and REPEATED in result.messages
    assert result.error["signal"] == "w"
    assert result.error["refitted"] < 0.5 * result.error["declared"]

"""A speed that is only the position, differentiated, is no second sensor."""

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import butter, filtfilt, lfilter

from lugrectl import diagnose
from tests.drives import make

from ..cases.common import model_of, record_of


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
    assert result.verdict == "adequate"
    (said,) = [m for m in result.messages if re.match(r"w is \S+ ms behind", m)]
    assert float(said.split()[2]) == pytest.approx(lag, rel=0.05)


@pytest.mark.slow
def test_the_noise_of_an_encoder_is_no_missing_effect(case, record):
    repeated = differentiated(record, lambda w, dt: w)
    result = diagnose(repeated, model_of(case))
    assert result.verdict == "adequate"
    assert result.error["signal"] == "w"
    assert result.error["refitted"] < 0.5 * result.error["declared"]

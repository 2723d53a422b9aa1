"""A torque whose record is noisier than what moved the drive."""

from dataclasses import replace

import numpy as np
import pytest

from lugrectl import diagnose
from lugrectl.tracing.calm import calmed, denoised
from lugrectl.tracing.job import another_torque, begin, on_torque
from tests.rig import make, sample

from .test_tracing import model_of, quiet, record_of


def noisy(record, size, seed=0):
    u = record.u + size * np.random.default_rng(seed).normal(size=record.samples)
    return replace(record, u=u)


def test_noise_goes_and_steps_stay():
    n = 4000
    clean = np.where(np.arange(n) % 500 < 250, 1.0, -1.0) + 0.3 * np.sin(np.arange(n) / 80.0)
    u = clean + 0.1 * np.random.default_rng(1).normal(size=n)
    runs = [(0, 1500), (1500, n)]
    out = denoised(u, runs, 4)
    assert np.std(out - clean) < 0.4 * np.std(u - clean)
    step = np.arange(250, n, 250)[:, None] + np.array([-1, 0])
    assert np.max(np.abs(out - clean)[step]) < 0.5
    assert np.allclose(denoised(u + 3.0, runs, 4), out + 3.0)
    assert np.array_equal(denoised(u, [(0, 1500)], 4)[1500:], u[1500:])


def test_a_sound_drive_keeps_its_inertia_under_noise_of_the_recorded_torque():
    """Errors in a regressor make its factor too small, 1/J: by half and more in this record."""
    case = sample("none", 130002, rate=500.0, duration=30.0)
    truth = case.truth["plant"]
    record = noisy(record_of(case), 0.05 * truth["Fc"], 130002)
    job = begin(record, model_of(case), None, 1.0, quiet)
    assert job.data.smoothed
    assert job.base.values["J"] == pytest.approx(truth["J"], rel=0.1)
    assert job.base.values["Fc"] == pytest.approx(truth["Fc"], rel=0.03)


def test_noise_that_moved_the_drive_stays_in_the_torque():
    case = make("none", machine="servo", excitation="rich", seed=4103, rate=500.0, duration=20.0)
    assert not begin(record_of(case), model_of(case), None, 1.0, quiet).data.smoothed


@pytest.mark.slow
def test_it_is_said():
    case = make("none", machine="servo", excitation="rich", seed=4104, rate=500.0, duration=20.0)
    size = 0.05 * case.truth["plant"]["Fc"]
    result = diagnose(noisy(record_of(case), size), model_of(case))
    assert result.verdict == "adequate" and any("u is noisy" in m for m in result.messages)


def test_a_torque_smoothed_in_vain_is_taken_as_it_was_recorded():
    """Smoothing may help a model that lacks a fast ripple; where nothing lacks it does harm."""
    case = make("none", machine="servo", excitation="rich", seed=4105, rate=500.0, duration=20.0)
    job = begin(record_of(case), model_of(case), None, 1.0, quiet)
    smooth = job.data.with_torque(denoised(job.data.u, job.data.runs, 6))
    there = on_torque(job, smooth, quiet)
    assert there.data.smoothed and there.recorded is job.data
    back = another_torque(there.base, False, there.recorded)
    assert back is job.data
    again = on_torque(there, back, quiet)
    assert again.recorded is None and not again.data.smoothed
    assert calmed(again.base) is None


def test_a_ripple_is_no_noise():
    case = sample("torque_ripple", 119303, rate=1000.0, duration=15.0)
    assert not begin(record_of(case), model_of(case), None, 1.0, quiet).data.smoothed

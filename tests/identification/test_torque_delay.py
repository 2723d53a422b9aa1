"""A torque that is logged a fraction of a sample late is moved, one that is later is refused."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import butter, lfilter

from lugrectl import diagnose
from lugrectl.core.errors import Refused
from lugrectl.diagnosis.study import as_recorded
from lugrectl.identification.likelihood.torque_delay import ahead, dated
from tests.rig import exported, make, sample

from ..cases.common import begun, model_of, quiet, record_of, verdict


@pytest.fixture(scope="module")
def case():
    return make("none", machine="servo", excitation="rich", seed=4108, rate=500.0, duration=20.0)


@pytest.fixture(scope="module")
def record(case):
    return record_of(case)


def before(u, samples):
    """The torque of so many samples ago: what a log holds that is late."""
    at = np.arange(len(u))
    return np.interp(at - samples, at, u)


def started(record, case):
    return begun(record, model_of(case))


def test_moving_ahead_undoes_being_late(record, case):
    data = started(record, case).data
    late = replace(data, u=before(data.u, 1.0))
    (a, b), back = data.runs[0], ahead(late, 1.0)
    assert np.allclose(back.u[a : b - 1], data.u[a : b - 1])
    assert back.ahead == pytest.approx(data.dt) and np.array_equal(back.log.u, back.u)


def test_a_move_between_samples_keeps_the_swings(record, case):
    """Of a tone, what the line takes off, and what a logged mean of two had taken off before."""
    data = started(record, case).data
    (a, b), w = data.runs[0], 2.0 * np.pi * 20.0
    tone = np.sin(w * (data.t - data.t[a]))
    later, inner = np.sin(w * (data.t - data.t[a] + 0.5 * data.dt)), slice(a + 3, b - 3)

    def missed(u, sharp, truth):
        return np.max(np.abs(ahead(replace(data, u=u), 0.5, sharp).u - truth)[inner])

    assert missed(tone, 0.125, later) < 0.1 * missed(tone, 0.0, later)
    mean = before(tone, 0.5)
    assert missed(mean, 0.25, tone) < 0.1 * missed(mean, 0.0, tone)


@pytest.mark.parametrize("samples", [0.0, 0.2, 0.5, 1.0])
@pytest.mark.slow
def test_what_a_log_holds_of_the_torque_is_found(record, case, samples):
    job = started(replace(record, u=before(record.u, samples)), case)
    assert job.data.ahead / job.data.dt == pytest.approx(samples, abs=0.05)
    assert job.base.values["J"] == pytest.approx(case.truth["plant"]["J"], rel=0.01)


@pytest.mark.slow
def test_half_a_sample_is_no_missing_effect(record, case):
    result = diagnose(replace(record, u=before(record.u, 0.5)), model_of(case))
    assert result.verdict == "adequate" and any("lags the motion" in m for m in result.messages)
    assert result.error["refitted"] < 0.02 * result.error["declared"]  # not moved: 0.09


@pytest.mark.parametrize("late", [
    lambda u, dt: before(u, 3.0),
    lambda u, dt: lfilter(*butter(1, 2.0 * 50.0 * dt), u),
], ids=["shifted", "filtered"])  # fmt: skip
def test_a_later_torque_is_refused(record, case, late):
    with pytest.raises(Refused, match="skewed in time|lags the motion"):
        started(replace(record, u=late(record.u, record.dt)), case)


def test_a_torque_that_was_shifted_can_be_used_as_it_was_recorded(record, case):
    job = started(replace(record, u=before(record.u, 0.5)), case)
    assert job.data.ahead > 0.0 and job.base.predictor.data is job.data
    back = as_recorded(job, quiet)
    assert back.data is job.recorded and back.recorded is None and back.data.ahead == 0.0
    assert back.base.total < job.base.total


def test_an_effect_is_no_lateness():
    case = make(
        "elastic_coupling", machine="joint", excitation="rich", seed=4109, rate=500.0, duration=20.0
    )
    assert dated(started(record_of(case), case).base) is None


@pytest.mark.slow
def test_a_torque_moved_too_far_is_moved_back():
    """Without its bristles the drive seemed a sample late, where half a sample is right."""
    case = exported(sample("presliding", 129200), "u half a sample late")
    result, names = verdict(case)
    assert names == ["presliding"]
    assert any("1 ms late" in message for message in result.messages)

"""Sensor noise without a model, the observer's gain, and the smoothed motion."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lugrectl.identification.dataset.dataset import prepare
from lugrectl.identification.dataset.kalman import Noise, observer_gain, smooth
from lugrectl.record import Record
from lugrectl.record.signal_noise import repeating, sensor_noise

DT = 1e-3
T = np.arange(0, 8, DT)


def motion():
    theta = np.sin(2 * np.pi * 0.7 * T) + 0.1 * np.sin(2 * np.pi * 5.0 * T)
    w = 2 * np.pi * (0.7 * np.cos(2 * np.pi * 0.7 * T) + 0.5 * np.cos(2 * np.pi * 5.0 * T))
    return theta, w


@given(st.floats(1e-4, 1e-1), st.integers(0, 2**31))
def test_noise_is_told_from_motion(sigma, seed):
    _, w = motion()
    noisy = w + sigma * np.random.default_rng(seed).normal(size=len(w))
    assert sensor_noise(noisy) == pytest.approx(sigma, rel=0.1)


def test_a_coarse_signal_is_never_better_than_its_resolution():
    theta, _ = motion()
    step = 0.01
    assert sensor_noise(np.round(theta / step) * step) >= 0.99 * step / np.sqrt(12)


def test_samples_between_two_counts_are_one():
    ramp, rest = np.repeat(np.arange(50.0), 8), np.zeros(5000)
    assert repeating(np.concatenate([rest, ramp])) == 8.0
    theta, w = motion()
    assert repeating(theta) == repeating(w) == repeating(rest) == 1.0
    step = 40 * 1e-3 * np.median(np.abs(w))  # some forty samples
    assert 20 < repeating(np.round(theta / step) * step) < 80


def test_what_a_standing_counter_says_again_counts_once():
    step, speed = 1e-3, np.select([T < 3.0, T < 6.0], [0.0, 0.4], 7.3)  # counts to a sample
    theta = np.round(np.cumsum(speed)) * step
    weight = prepare([Record(T, np.cos(T), theta=theta)]).weight
    assert np.sum(weight[T < 3.0, 0]) == pytest.approx(1.0, abs=0.01)
    assert np.sum(weight[(T >= 3.0) & (T < 6.0), 0]) == pytest.approx(1200, abs=3)
    assert np.all(weight[T > 6.0, 0] == 1.0) and np.all(weight[:, 1] == 1.0)
    noisy = np.cumsum(speed) + 2.0 * np.random.default_rng(0).normal(size=len(T))
    hidden = prepare([Record(T, np.cos(T), theta=np.round(noisy) * step)])
    assert np.mean(hidden.weight) > 0.9


def test_a_coarse_counter_counts_as_its_noise_allows():
    theta = np.repeat(np.arange(len(T) // 8), 8) * 1e-3
    data = prepare([Record(T, np.cos(T), theta=theta)])
    assert np.all(data.weight == 1.0)
    assert data.noise.theta == pytest.approx(np.sqrt(8.0) * data.own[0])


def test_the_steps_of_a_coarse_encoder_are_no_accelerations():
    theta = 0.5 * np.sin(2 * np.pi * 0.3 * T)
    step = 1.5e-3
    record = Record(T, np.cos(T), theta=np.round(theta / step) * step)
    data = prepare([record])
    assert data.floor == pytest.approx(step / np.sqrt(12), rel=0.2)
    assert data.noise.theta > 1.3 * data.floor
    true = -((2 * np.pi * 0.3) ** 2) * theta
    assert np.corrcoef(data.log.a, true)[0, 1] > 0.8
    assert np.std(data.log.a) == pytest.approx(np.std(true), rel=0.3)


@pytest.mark.parametrize("seen", [(1e-6, 2e-3), (1e-6, np.nan), (np.nan, 2e-3)])
def test_gain_is_that_of_the_covariance_run_to_its_end(seen):
    noise = Noise(30.0, *seen)
    gain, S = observer_gain(DT, noise)
    on = noise.channels()
    A, push = np.array([[1, DT], [0, 1]]), noise.jump * np.array([DT**2 / 2, DT])
    R = np.diag(np.array(seen)[on] ** 2)
    H, P = np.eye(2)[on], np.diag([1e-12 if on[0] else 0.0, 1e-6])
    for _ in range(4000):
        innovation = H @ P @ H.T + R
        K = P @ H.T @ np.linalg.inv(innovation)
        if not on[0]:
            K[0] = 0.0
        P = A @ (np.eye(2) - K @ H) @ P @ A.T + np.outer(push, push)
        if not on[0]:
            P[0], P[:, 0] = 0.0, 0.0
    assert np.allclose(gain[:, on], K, rtol=1e-5, atol=1e-9)
    assert np.allclose(S[np.ix_(on, on)], innovation, rtol=1e-5)
    assert np.all(gain[:, ~on] == 0.0)


@pytest.mark.parametrize("channels", ["both", "theta", "w"])
def test_smoothing_brings_both_signals_nearer_the_truth(channels):
    theta, w = motion()
    rng = np.random.default_rng(3)
    noise = {"both": (2e-5, 0.02), "theta": (2e-5, np.nan), "w": (np.nan, 0.02)}[channels]
    y = np.column_stack([theta + noise[0] * rng.normal(size=len(T)),
                         w + noise[1] * rng.normal(size=len(T))])  # fmt: skip
    state = smooth(y, DT, Noise(10.0, *noise))
    middle = slice(200, -200)
    rough = np.diff(y[:, 0]) / DT - w[:-1] if channels == "theta" else y[:, 1] - w
    assert np.std((state[:, 1] - w)[middle]) < 0.6 * np.std(rough[middle])
    if channels != "w":
        assert np.std((state[:, 0] - theta)[middle]) < 2.2e-5

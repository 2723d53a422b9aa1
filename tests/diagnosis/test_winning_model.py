"""One set of values: of a fit by simulation where the log is clean, else of the comparison."""

import math

import numpy as np
import pytest

import lugrectl as lg

J, FV, VS = 0.012, 0.03, 0.05  # kg m2, N m s/rad, rad/s


def drive(forward=0.31, backward=0.19, spring=0.0, rest=0.0, seconds=10.0, noise=0.0, seed=0):
    """A PI loop at 250 Hz on a drive at 10 kHz; Coulomb friction of each direction and Stribeck."""
    rng, fine, dt = np.random.default_rng(seed), 40, 4e-3
    h, theta, w, integral, log = dt / fine, 0.0, 0.0, 0.0, []
    for i in range(int(seconds / dt)):
        t = i * dt
        goal = 3.0 * math.sin(1.9 * t + seed) + 2.0 * math.sin(0.83 * t) + 0.8 * math.sin(4.7 * t)
        error = goal - w
        integral += dt * error
        u = 0.4 * error + 2.0 * integral
        log.append((t, u, theta, w))
        torque = u + noise * float(rng.standard_normal())
        for _ in range(fine):
            level = (forward if w > 0 else backward) * (1.0 + 0.25 * math.exp(-((w / VS) ** 2)))
            drives = torque - FV * w - spring * (theta - rest)
            if abs(w) < 2e-3 and abs(drives) < level:
                w = 0.0
                continue
            side = math.copysign(1.0, w or drives)
            new = w + h / J * (drives - side * level)
            w = 0.0 if w * new < 0 else new
            theta += h * w
    count = 2 * np.pi / 65_536
    t, u, theta, w = np.array(log).T
    w = w + 0.002 * rng.standard_normal(len(t))
    return {"t": t, "u": u, "theta": np.round(theta / count) * count, "w": w}


MODEL = {"J": 0.0125, "friction": "stribeck", "Fc": 0.26, "Fs": 0.3, "Fv": 0.028, "vs": 0.06}


def model():
    return lg.Model.of(**MODEL)


@pytest.fixture(scope="module")
def noisy():
    """Torque of another source in every sample, 4 % of friction: no simulation is valid."""
    return lg.identify(drive(0.25, 0.25, noise=0.01, seed=1), model())


@pytest.mark.slow
def test_estimates_and_model_have_the_same_values(noisy):
    for key in ("J", "Fc", "Fv"):
        assert noisy.estimates[key].value == noisy.model.values()[key]


def test_their_intervals_hold_the_truth(noisy):
    known = {"J": J, "Fc": 0.25, "Fv": FV}
    assert all(noisy.estimates[k].may_be(v) for k, v in known.items())
    assert np.diff(noisy.estimates["J"].ci95) < 0.1 * J


def test_the_joint_distribution_is_that_of_the_intervals(noisy):
    i = noisy.joint.names.index("J")
    low, high = noisy.estimates["J"].ci95
    assert 2 * 1.96 * np.sqrt(noisy.joint.matrix[i, i]) == pytest.approx(high - low)
    drawn = noisy.sample(2000, seed=0)["J"]
    assert np.std(drawn) == pytest.approx((high - low) / 3.92, rel=0.1)

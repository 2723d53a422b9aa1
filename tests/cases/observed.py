"""Shared by the tests of observers and controllers: the three scenarios in which they compete."""

from dataclasses import replace

import control as ct
import numpy as np
import pytest

import lugrectl as lg

P = lg.table1()
STEP = 1e-3


def longer(test):
    """A scenario of 10 or 15 s: left out unless asked for; of these, continuous integration runs
    a third."""
    return pytest.mark.slow(pytest.mark.scenario(test))


def believing(factor, **others):
    """Table 1 with both friction levels scaled, as the observer believes it."""
    return replace(P, Fc=factor * P.Fc, Fs=factor * P.Fs, **others)


def relaxation(w, p=P):
    """a(w) = sigma0 |w|/h(w) in 1/s."""
    return p.sigma0 * abs(w) / (p.Fc + (p.Fs - p.Fc) * np.exp(-((w / p.vs) ** 2)))


def rms(x):
    return float(np.sqrt(np.mean(np.square(x))))


def signals(system, response):
    """Outputs by name."""
    return dict(zip(system.output_labels, np.atleast_2d(response.outputs), strict=True))


def velocity_error(observer, believed=P, plant=P, **options):
    """RMS of e in rad/s over 1 to 5 s: the paper's loop follows 0.1 sin 2 pi t from rest."""
    loop = lg.velocity_loop(plant, observer, observer_parameters=believed, **options)
    t = np.arange(0.0, 5.0 + STEP / 2, STEP)
    out = signals(loop, lg.simulate(loop, t, {"r": 0.1 * np.sin(2 * np.pi * t)}))
    return rms(out["e"][t >= 1.0])


def sine(t, size=0.1, rate=2 * np.pi):
    """r, dr, ddr of size sin(rate t)."""
    r = size * np.sin(rate * t)
    return {"r": r, "dr": size * rate * np.cos(rate * t), "ddr": -(rate**2) * r}


def follower(estimate, kp=15.0, kd=1.2, plant=P):
    """u = -kp e - kd de/dt + J ddr + Fhat around any observer block."""
    return ct.interconnect(
        [
            lg.plant(plant),
            estimate,
            lg.error("position"),
            lg.error("velocity", name="slip", inputs=["dr", "w"], outputs=["de"]),
            lg.pid(kp, 0.0, kd, inputs=["e", "de"]),
            lg.feedforward(plant, "position"),
            lg.compensation(),
        ],
        inputs=["r", "dr", "ddr"],
        outputs=["theta", "w", "F", "Fhat", "u", "e"],
        params={},
        check_unused=False,
    )


def position_error(system, last=10.0, since=5.0, **start):
    """RMS of theta - r in rad from ``since`` to ``last``; r = 0.1 sin 2 pi t, the drive at rest."""
    t = np.arange(0.0, last + STEP / 2, STEP)
    x0 = np.zeros(system.nstates)
    for state, value in start.items():
        x0[system.state_labels.index(state)] = value
    out = signals(system, lg.simulate(system, t, sine(t), x0))
    return rms((out["theta"] - sine(t)["r"])[t >= since])


def cycle(observer, factor, **options):
    """Peak-to-peak theta in rad over 10 to 15 s after a step of 0.1 rad, friction overestimated."""
    loop = lg.position_loop(
        P, observer, kp=15.0, ki=30.0, kd=0.3, observer_parameters=believing(factor), **options
    )
    t = np.arange(0.0, 15.0 + STEP / 2, STEP)
    theta = signals(loop, lg.simulate(loop, t, {"r": np.full_like(t, 0.1)}))["theta"][t >= 10.0]
    return float(np.ptp(theta))


def signals_by(response, name):
    """One output of a response by name."""
    return np.atleast_2d(response.outputs)[response.output_labels.index(name)]

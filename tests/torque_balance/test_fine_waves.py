"""Waves over theta that are finer than the windows in which the balance averages."""

import numpy as np
import pytest

import lugrectl as lg

MODEL = {"J": 0.002, "Fc": 0.4, "Fv": 0.01}
ORDER = 24


def said_of(amplitude: float, speed: float = 20.0, noise: float = 5e-3) -> lg.Diagnosis:
    t = np.arange(0, 12, 1e-3)
    a, b = 2 * np.pi * 0.4, 2 * np.pi * 0.93
    theta = speed / a * np.sin(a * t) + 4 / b * np.sin(b * t)
    w = speed * np.cos(a * t) + 4 * np.cos(b * t)
    u = MODEL["J"] * np.gradient(w, t) + MODEL["Fc"] * np.tanh(100 * w) + MODEL["Fv"] * w
    u = u + amplitude * np.sin(ORDER * theta + 0.3)
    rng = np.random.default_rng(5)
    log = {"t": t, "u": u + 2e-3 * rng.standard_normal(len(t)), "theta": theta}
    log["theta"] = theta + noise * rng.standard_normal(len(t))
    return lg.diagnose(log, lg.Model.of(friction="coulomb", **MODEL))


@pytest.mark.slow
def test_what_windows_hide_is_said_where_nothing_is_found():
    d = said_of(0.06)
    ripple = {one.name: one for one in d.comparison.detectable}["torque_ripple"]
    assert d.verdict == "adequate" and ripple.finest < ORDER
    words = f"more than {ripple.finest:.0f} periods per turn may stay hidden"
    assert words in " ".join(str(d).split())


@pytest.mark.slow
def test_the_share_of_a_wave_counts_what_windows_take_of_it():
    share = next(s for s in said_of(0.06, 8.0, 1e-4).comparison.budget if s.term == "torque_ripple")
    assert share.rms == pytest.approx(0.06 / np.sqrt(2), rel=0.03)

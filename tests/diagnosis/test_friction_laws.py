"""Parts of friction that the declared law lacks."""

from __future__ import annotations

import numpy as np

from lugrectl import diagnose

T = np.arange(0.0, 12.0, 2e-3)


def record(curve=0.0):
    """A motion of two sines with J = 0.01, Coulomb and viscous friction, as a drive logs it."""
    rng = np.random.default_rng(3)
    w = 3 * np.sin(2 * np.pi * 0.7 * T) + 2 * np.sin(2 * np.pi * 1.9 * T + 1)
    a = np.gradient(w, T)
    theta = np.cumsum(w) * 2e-3
    friction = (0.3 + curve * np.exp(-((w / 0.6) ** 2))) * np.tanh(w / 1e-3) + 0.02 * w
    noisy = w + 1e-3 * rng.standard_normal(len(T))
    counts = np.round(theta / 1e-5) * 1e-5
    return {"t": T, "u": 0.01 * a + friction, "theta": counts, "w": noisy}


def named(log, law, **values):
    model = {"plant": {"J": 0.01}, "friction": {"model": law, "Fc": 0.3, "Fv": 0.02, **values}}
    found = diagnose(log, model)
    return found.verdict, [e.name for e in found.effects]


def test_a_stribeck_curve_is_named_where_the_declared_law_has_none():
    assert named(record(curve=0.15), "coulomb") == ("found", ["stribeck"])


def test_a_stribeck_curve_is_a_value_where_the_declared_law_has_one():
    assert named(record(curve=0.15), "stribeck", Fs=0.4, vs=0.5) == ("adequate", [])

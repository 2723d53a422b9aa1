"""Torque that is there seldom is no outlier: a drive that is pushed is not called adequate."""

import numpy as np
import pytest

import lugrectl as lg

DT, N = 2e-3, 10_000
T = DT * np.arange(N)
W = 3.0 * np.sin(2.0 * T) + 2.0 * np.sin(5.3 * T)
A = 6.0 * np.cos(2.0 * T) + 10.6 * np.cos(5.3 * T)
PLAIN = 0.01 * A + 0.2 * np.sign(W) + 0.02 * W
MODEL = lg.Model.of(friction="coulomb", J=0.01)


def diagnosed(extra):
    u = PLAIN + extra + 1e-3 * np.random.default_rng(0).standard_normal(N)
    return lg.diagnose({"t": T, "u": u, "w": W}, MODEL)


def pushes(instants, length):
    return 0.5 * np.any([(start < T) & (start + length > T) for start in instants], axis=0)


@pytest.mark.parametrize(
    ("instants", "length"),
    [((3.1, 8.2, 14.3), 0.2), (np.arange(0.7, 20.0, 1.3), 0.03)],
    ids=["three contacts", "short ones again and again"],
)
def test_pushes_stay_unexplained_and_are_said(instants, length):
    found = diagnosed(pushes(instants, length))
    assert found.verdict == "unexplained"
    assert any("of friction stays, and nothing explains it" in m for m in found.messages)


def test_two_bad_samples_are_none():
    extra = np.zeros(N)
    extra[[2500, 7300]] = 1.0
    assert diagnosed(extra).verdict == "adequate"
    assert diagnosed(0.0).verdict == "adequate"

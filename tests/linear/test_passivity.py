"""LuGre friction gives energy back exactly where its condition says so."""

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import lugrectl as lg
from lugrectl.blocks.friction import lugre
from lugrectl.core.errors import InputError

P = lg.table1()


def changed(**values):
    return dataclasses.replace(P, **values)


def moved(p, speeds, lengths, steps=400):
    """Energy taken by the friction, and stored in it, along stretches of constant speed."""
    z, taken = 0.0, [0.0]
    stored = [0.0]
    own = {k: getattr(p, k) for k in ("sigma0", "sigma1", "Fc", "Fs", "Fv", "vs")}
    for w, x in zip(speeds, lengths, strict=True):
        dt = abs(x / w) / steps
        h = p.Fc + (p.Fs - p.Fc) * math.exp(-((w / p.vs) ** 2))
        end = math.copysign(h / p.sigma0, w)
        left = math.exp(-p.sigma0 * abs(w) * dt / h)
        for _ in range(steps):
            nodes = end + (z - end) * left ** np.array([0.0, 0.5, 1.0])
            F = np.array([lugre.function(w, zi, **own)[0] for zi in nodes])
            z = float(nodes[-1])
            taken.append(taken[-1] + w * dt * float(F @ [1, 4, 1]) / 6)  # Simpson
            stored.append(0.5 * p.sigma0 * z * z)
    return np.array(taken), np.array(stored)


def bent_then_thrown(p, speed, times):
    """Bristles bent by slow motion, then a jump of the speed over part of their deflection."""
    slow, x = 0.02 * p.vs, p.Fs / p.sigma0
    return moved(p, [slow, speed] * times, [8 * x, 0.3 * p.Fc / p.sigma0] * times, steps=60)


def test_table_1_fails_the_condition_and_says_by_how_much():
    found = lg.passivity_check(P)
    assert not found and found.least_Fv == pytest.approx(0.6 * 0.05 / 0.285)
    assert found.margin == pytest.approx(0.018 - 0.6 * 0.05 / 0.285)
    assert found.largest_sigma1 == pytest.approx(0.018 * 0.285 / 0.05)
    assert lg.passivity_check(changed(Fv=found.least_Fv * (1 + 1e-12)))
    assert lg.passivity_check(changed(sigma1=found.largest_sigma1 * (1 - 1e-12)))
    assert "4.51" in found.meaning and found.to_dict()["holds"] is False


def test_a_motion_draws_ever_more_energy_where_the_condition_fails():
    """Faster jumps give back more than bending costs, each time again."""
    taken, stored = bent_then_thrown(P, 2000.0, 4)
    ends = taken[:: 2 * 60]
    assert np.all(np.diff(ends) < -0.01) and np.min(taken + stored) < -0.05
    assert np.min(taken - stored) < 0


@given(
    st.floats(0.0, 2.0, allow_subnormal=False),  # a margin below 1e-308 has no sign of its own
    st.floats(0.1, 1.0),
    st.floats(1.0, 3.0),
    st.floats(0.0, 0.2),
)
@settings(max_examples=50, deadline=None)
def test_the_speed_is_where_the_energy_balance_changes_its_sign(sigma1, Fc, ratio, Fv):
    p = changed(sigma1=sigma1, Fc=Fc, Fs=ratio * Fc, Fv=Fv)
    found = lg.passivity_check(p)

    def least(w):
        h = p.Fc + (p.Fs - p.Fc) * math.exp(-((w / p.vs) ** 2))
        q = np.linspace(0.0, p.Fs / h, 2001)
        return np.min(h * q**2 / w + Fv + sigma1 * (1 - q))

    assert bool(found) == (found.margin >= 0) == math.isinf(found.speed)
    if found.margin < -1e-6:
        assert least(0.99 * found.speed) > 0 and least(1.01 * found.speed) < 1e-6


def test_a_wrong_model_is_named():
    with pytest.raises(InputError, match="needs sigma1"):
        lg.passivity_check(lg.Model.of(J=0.002, friction="coulomb"))
    with pytest.raises(InputError, match="Fs >= Fc"):
        lg.passivity_check(changed(Fs=0.2))

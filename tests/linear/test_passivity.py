"""LuGre friction gives energy back exactly where its condition says so."""

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import lugrectl as lg
from lugrectl.core.errors import InputError

P = lg.table1()


def changed(**values):
    return dataclasses.replace(P, **values)


def test_table_1_fails_the_condition_and_says_by_how_much():
    found = lg.passivity_check(P)
    assert not found and found.least_Fv == pytest.approx(0.6 * 0.05 / 0.285)
    assert found.margin == pytest.approx(0.018 - 0.6 * 0.05 / 0.285)
    assert found.largest_sigma1 == pytest.approx(0.018 * 0.285 / 0.05)
    assert lg.passivity_check(changed(Fv=found.least_Fv * (1 + 1e-12)))
    assert lg.passivity_check(changed(sigma1=found.largest_sigma1 * (1 - 1e-12)))
    assert "4.51" in found.meaning and found.to_dict()["holds"] is False


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

"""Sums of p(s) exp(-sT) are a ring with exact coefficients, and floats only evaluate them."""

from fractions import Fraction as Q

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lugrectl.linear.exact import Quasi

POINTS = np.array([0.3j, 2.0j, 0.4 - 1.1j])
terms = st.tuples(st.sampled_from([Q(0), Q(1, 4), Q(1), Q(3, 2)]), st.lists(st.integers(-5, 5)))
quasis = st.lists(terms, min_size=1, max_size=4).map(
    lambda found: Quasi.of((late, trimmed(p)) for late, p in found)
)


def trimmed(p):
    return tuple(np.trim_zeros(p, "b"))


@given(quasis, quasis)
@settings(max_examples=50)
def test_sums_and_products_are_those_of_the_values(a, b):
    assert np.allclose((a + b).at(POINTS), a.at(POINTS) + b.at(POINTS), rtol=1e-12, atol=1e-9)
    assert np.allclose((a * b).at(POINTS), a.at(POINTS) * b.at(POINTS), rtol=1e-12, atol=1e-9)


@given(quasis)
@settings(max_examples=50)
def test_mirror_derivative_and_bound_are_those_of_the_function(q):
    assert np.allclose(q.mirror().at(POINTS), q.at(-POINTS), rtol=1e-12, atol=1e-12)
    step = 1e-5
    slope = (q.at(POINTS + step) - q.at(POINTS - step)) / (2 * step)
    assert np.allclose(q.derivative().at(POINTS), slope, rtol=1e-6, atol=1e-5)
    w = np.linspace(0.0, 3.0, 100)
    assert (np.abs(q.at(1j * w)) <= q.bound(np.array(3.0)) * (1 + 1e-12) + 1e-12).all()


def test_the_order_at_0_is_exact():
    """s^2 - (1 - exp(-s))^2 = s^3 - ..."""
    lag = Quasi.of([(0, (1,)), (1, (-1,))])
    q = Quasi.of([(0, (0, 0, 1))]) + (lag * lag).scaled(-1)
    assert q.order() == 3 and q.taylor(3) == 1


def test_a_shift_moves_the_zeros():
    q = Quasi.of([(0, (0, 1)), (Q(1, 2), (3,))])
    assert q.shifted(0.7).at(POINTS) == pytest.approx(q.at(POINTS - 0.7))

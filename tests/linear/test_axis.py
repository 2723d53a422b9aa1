"""On the imaginary axis no change of sign is missed, and zeros right of it are counted."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lugrectl.core.errors import InputError
from lugrectl.linear.axis import signs, zeros
from lugrectl.linear.exact import Quasi


@given(st.lists(st.floats(-3, 3).filter(lambda x: abs(x) > 0.05), min_size=1, max_size=4))
@settings(max_examples=40)
def test_without_influence_of_the_dead_time_the_count_is_that_of_the_roots(roots):
    """p(s) (s + 1 + exp(-s)/2): the second factor has no zero right of the axis."""
    p = tuple(np.polynomial.polynomial.polyfromroots(roots))
    q = Quasi.of([(0, p)]) * Quasi.of([(0, (1, 1)), (1, (0.5,))])
    assert zeros(q) == (sum(r > 0 for r in roots), 0, None)


def test_zeros_at_0_are_counted_apart():
    """s (s - 1 + exp(-s)) = s^3/2 - ..., with no zero right of the axis."""
    q = Quasi.of([(0, (0, 1))]) * Quasi.of([(0, (-1, 1)), (1, (1,))])
    assert zeros(q) == (0, 3, None)


def test_a_dead_time_on_the_highest_power_is_stable_below_1_only():
    assert zeros(Quasi.of([(0, (1, 1)), (1, (0, 0.9))])).right == 0
    assert zeros(Quasi.of([(0, (1, 1)), (1, (0, 1.1))])).right == math.inf
    assert zeros(Quasi.of([(0, (1, 1)), (1, (0, 0, 0.1))])).right == math.inf
    with pytest.raises(InputError, match="several dead times"):
        zeros(Quasi.of([(0, (1, 1)), (1, (0, 0.7)), (1.5, (0, 0.7))]))


def even(*terms):
    """Half the sum of q(s) and q(-s)."""
    q = Quasi.of(terms)
    return q + q.mirror()


@given(
    st.lists(st.floats(0.1, 30.0), min_size=1, max_size=5),
    st.floats(0.01, 1.0),
    st.floats(0.05, 0.9),
)
@settings(max_examples=25, deadline=None)
def test_all_changes_of_sign_are_found(places, T, share):
    """Prod (w^2 - a^2) (1 + share cos(wT)) has the changes of the first factor."""
    product = Quasi.of([(0, (1,))])
    for a in places:
        product = product * Quasi.of([(0, (-(a**2), 0, -1))])
    found = signs(product * even((0, (0.5,)), (T, (share / 2,))))
    once = sorted(places)
    apart = all(b > a * (1 + 1e-4) for a, b in zip(once, once[1:], strict=False))
    if apart:
        assert found.changes == pytest.approx(once, rel=1e-9)
    assert found.first == (-1) ** len(places) and found.complete


def test_a_touch_is_no_change():
    """(1 - w^2)^2 (1 + 0.4 cos w), and without the dead time exactly."""
    touching = Quasi.of([(0, (1, 0, 1))])  # 1 - w^2
    found = signs(touching * touching * even((0, (0.5,)), (1, (0.2,))))
    assert found.changes == () and found.touches == pytest.approx([1.0], rel=1e-6)
    exact = signs(touching * touching)
    assert exact == (1, (), (1.0,), True)


def test_two_changes_close_together_are_not_missed():
    one, other = (Quasi.of([(0, (a**2, 0, 1))]) for a in (7.0, 7.0001))
    found = signs(one * other * even((0, (0.5,)), (1, (0.2,))))
    assert found.changes == pytest.approx((7.0, 7.0001), rel=1e-8)


def test_a_sign_that_never_settles_is_followed_to_its_first_changes():
    found = signs(even((0.5, (0, 0, 1))))
    assert not found.complete and found.changes[0] == pytest.approx(math.pi)
    with pytest.raises(InputError, match="undecided"):
        signs(even((0, (1,)), (1, (1,))))


def test_a_response_that_turns_too_often_is_refused():
    with pytest.raises(InputError, match="unit of the dead time"):
        signs(even((0, (1e16, 0, -1)), (1.0, (0, 0, 0.4))))

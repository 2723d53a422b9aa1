"""How far a value is searched is not how well it is known."""

import numpy as np
import pytest

from lugrectl.identification.likelihood.parameters import Coordinate

VS = Coordinate("vs", "log", 0.004, 0.4, 5e-4, least=1e-12)
DELTA = Coordinate("delta", "log", 0.2, 4.0, 5e-4, least=0.1, most=4.0)


def test_an_end_of_an_interval_lies_where_the_width_says_beyond_the_search():
    low, high = VS.ends({"vs": 0.2}, np.log(10.0))
    assert (low, high) == pytest.approx((0.02, 2.0))


def test_a_value_has_no_interval_if_all_that_was_searched_is_as_likely():
    assert VS.ends({"vs": 0.04}, np.log(11.0)) is None


def test_what_a_block_says_of_its_parameter_bounds_the_interval():
    assert DELTA.ends({"delta": 2.0}, 5.0) == pytest.approx((0.1, 4.0))

"""The weights of models that explain a record alike."""

import numpy as np
import pytest

from lugrectl.identification.selection.stacking import stacked


def test_weights_are_those_of_the_mixture_that_made_the_blocks():
    random = np.random.default_rng(0)
    first = random.random(4000) < 0.3
    x = np.where(first, 2.0, -2.0) + random.normal(size=4000)
    own = stacked([-0.5 * (x - 2.0) ** 2, -0.5 * (x + 2.0) ** 2])
    assert own == pytest.approx([0.3, 0.7], abs=0.02)


def test_equal_models_share_and_a_worse_one_has_nothing():
    d = np.random.default_rng(1).normal(size=50)
    assert stacked([d, d]) == pytest.approx([0.5, 0.5])
    assert stacked([d, d - 3.0])[1] < 1e-6
    assert stacked([d]) == [1.0]

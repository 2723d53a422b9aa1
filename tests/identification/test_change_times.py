"""Where an instant in time is placed."""

import numpy as np
import pytest

from lugrectl.blocks.model import model_from_dict
from lugrectl.identification.dataset.dataset import prepare
from lugrectl.identification.dataset.folds import split
from lugrectl.identification.dataset.windows import windows
from lugrectl.identification.likelihood.change_times import between, place
from lugrectl.identification.likelihood.likelihood import whitened
from lugrectl.identification.likelihood.predictor import Predictor

from ..cases.common import record_of
from ..rig import make


@pytest.fixture(scope="module")
def stepped():
    """The true model with a step of friction, its values, and the data's noise."""
    case = make("friction_step", machine="servo", excitation="rich", seed=3, duration=16.0)
    plant = case.truth["plant"]
    friction = {"model": "lugre", **{k: v for k, v in plant.items() if k != "J"}}
    true = model_from_dict({"plant": {"J": plant["J"]}, "friction": friction}, "truth")
    model = true.with_effect("friction_step", case.truth["parameters"])
    data = prepare([record_of(case)])
    return Predictor(model, data), model.known(), split(data, 1.0).train, case.truth["parameters"]


def test_the_windows_elsewhere_do_not_matter(stepped):
    predictor, values, where, truth = stepped
    key, noise = "friction_step.time", predictor.data.noise
    center, (low, high) = place(predictor, values, key, where, noise)
    assert low - 0.02 < truth["time"] < high + 0.02
    sides = np.array([low - 0.02, low + 1e-3, center, high - 1e-3, high + 0.02])
    sets = [values | {key: float(time)} for time in sides]
    white = whitened(predictor, sets, where, noise)
    before, *inside, after = -0.5 * np.sum(white**2, axis=(1, 2, 3))
    assert max(inside) - min(inside) < 1.92 < max(inside) - max(before, after)


def test_windows_around_an_instant():
    where, t = windows([(0, 400)], 20, 60), np.arange(400) * 0.01
    assert len(where.start) == 6
    assert np.array_equal(between(where, t, 0.9, 0.9).start, [60])
    assert np.array_equal(between(where, t, 0.7, 1.3).start, [0, 60, 120])
    assert not len(between(where, t, 3.99, 3.99).start)

"""Where a moment in time is placed."""

import numpy as np
import pytest

from lugrectl.tracing.job import begin
from lugrectl.tracing.likelihood import whitened
from lugrectl.tracing.moments import _between, place
from lugrectl.tracing.score import Score
from lugrectl.tracing.screening import screen
from lugrectl.tracing.windows import windows

from .rig import make
from .test_tracing import model_of, quiet, record_of


@pytest.fixture(scope="module")
def stepped():
    """A model with a step of friction that was only just found, and the key of its moment."""
    case = make("friction_step", machine="servo", excitation="rich", seed=3, duration=16.0)
    base = begin(record_of(case), model_of(case), None, 1.0, quiet).base
    (trial,) = screen(Score(base), ["friction_step"])
    return trial.fitted, trial.values, f"{trial.key}.time"


def test_the_windows_elsewhere_do_not_matter(stepped):
    fitted, values, key = stepped
    center, (low, high) = place(fitted.predictor, values, key, fitted.where, fitted.noise)
    sides = np.array([low - 0.02, low + 1e-3, center, high - 1e-3, high + 0.02])
    sets = [values | {key: float(time)} for time in sides]
    white = whitened(fitted.predictor, sets, fitted.where, fitted.noise)
    before, *inside, after = -0.5 * np.sum(white**2, axis=(1, 2, 3))
    assert max(inside) - min(inside) < 1.92 < max(inside) - max(before, after)


def test_windows_around_a_moment():
    where, t = windows([(0, 400)], 20, 60), np.arange(400) * 0.01
    assert len(where.start) == 6
    assert np.array_equal(_between(where, t, 0.9, 0.9).start, [60])
    assert np.array_equal(_between(where, t, 0.7, 1.3).start, [0, 60, 120])
    assert not len(_between(where, t, 3.99, 3.99).start)

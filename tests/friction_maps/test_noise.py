"""The noise of a map: what scatters from run to run is in it, without any model."""

import numpy as np
import pytest

import lugrectl as lg
from lugrectl.friction_maps.noise import noise_of

SPEEDS = np.linspace(2.0, 40.0, 12)
BOTH = np.concatenate([-SPEEDS, SPEEDS])
SCATTER = 4e-3


def curve(w):
    return 0.1 * np.sign(w) + 2e-3 * w


def runs(scatter):
    """Runs of 2 s whose friction differs from run to run."""
    rng, t = np.random.default_rng(3), np.arange(0.0, 2.0, 4e-3)
    made = []
    for w, off in zip(BOTH, rng.normal(0.0, scatter, len(BOTH)), strict=True):
        u = curve(w) + off + rng.normal(0.0, 1e-3, len(t))
        made.append({"t": t, "u": u, "w": w + rng.normal(0.0, 0.01, len(t))})
    return made


def test_the_noise_of_points_on_a_line_is_theirs():
    rng = np.random.default_rng(0)
    found = [noise_of(BOTH, curve(BOTH) + rng.normal(0.0, SCATTER, len(BOTH))) for _ in range(50)]
    assert np.sqrt(np.mean(np.square(found))) == pytest.approx(SCATTER, rel=0.1)
    assert noise_of(BOTH, curve(BOTH)) == pytest.approx(0.0, abs=1e-12)


def test_speeds_that_repeat_count_as_well():
    w = np.repeat([1.0, 2.0], 6)
    u = np.random.default_rng(1).normal(0.0, 1.0, len(w))
    assert 0.4 < noise_of(w, u) < 1.6


def test_two_points_a_way_tell_no_noise():
    assert noise_of(np.array([-2.0, -1.0, 1.0, 2.0]), np.zeros(4)) is None


@pytest.mark.parametrize("scatter", [0.0, SCATTER])
def test_the_error_table_of_a_map_has_the_scatter_of_the_runs(scatter):
    error = lg.diagnose(runs(scatter), lg.Model.of(friction="coulomb", Fc=0.1, Fv=2e-3)).error
    assert error["noise_floor"] <= 1.01 * max(error["augmented"], 1e-4)
    assert error["noise_floor"] == pytest.approx(max(scatter, 5e-5), rel=0.5)

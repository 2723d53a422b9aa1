"""The noise of a map: what scatters from run to run is in it."""

import numpy as np
import pytest

import lugrectl as lg

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


@pytest.mark.parametrize("scatter", [0.0, SCATTER])
def test_the_error_table_of_a_map_has_the_scatter_of_the_runs(scatter):
    error = lg.diagnose(runs(scatter), lg.Model.of(friction="coulomb", Fc=0.1, Fv=2e-3)).error
    assert error["noise_floor"] <= 1.01 * max(error["augmented"], 1e-4)
    assert error["noise_floor"] == pytest.approx(max(scatter, 1.2e-4), rel=0.5)

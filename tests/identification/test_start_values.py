"""Start values for the plant are those of the whole friction curve, however it was shared out."""

from types import SimpleNamespace

import numpy as np
import pytest

from lugrectl.identification.candidates.base_model import LEVELS
from lugrectl.identification.candidates.friction_terms import NAMES, Law
from lugrectl.identification.candidates.start_values import levels_of

W = np.concatenate([-np.geomspace(5.0, 1e-3, 200), np.geomspace(1e-3, 5.0, 200)])
VS, X0 = 0.2, 1e-3


def base(**coefficients):
    """A base with these coefficients of the shapes of friction."""
    shapes, b = np.zeros((len(W), len(NAMES))), np.zeros(LEVELS.stop)
    shapes[:, NAMES.index("Fc")] = np.sign(W)
    shapes[:, NAMES.index("dip")] = np.sign(W) * np.exp(-((W / VS) ** 2))
    shapes[:, NAMES.index("Fv")] = W
    shapes[:, NAMES.index("dip 5")] = np.sign(W) * (1.0 - 0.2 * np.abs(W))
    shapes[:, NAMES.index("grease")] = np.sign(W) + W
    for name, value in coefficients.items():
        b[LEVELS.start + NAMES.index(name)] = value
    made = SimpleNamespace(b=b)
    return SimpleNamespace(law=Law(X0, VS, shapes), made=made, levels=None, J=0.01)


@pytest.mark.parametrize("moved", [0.0, 0.05])
def test_levels_do_not_depend_on_which_shape_has_the_torque(moved):
    """Grease and a long Stribeck tail share torque with the Coulomb and the viscous level."""
    own = {"Fc": 0.3 - 2 * moved, "dip": 0.1, "Fv": 0.02 - 0.8 * moved}
    found = levels_of(base(**own, **{"dip 5": moved, "grease": moved, "sigma1": 2e-3}))
    known = {"J": 0.01, "Fc": 0.3, "Fs": 0.4, "Fv": 0.02, "vs": VS}
    known |= {"sigma0": 0.3 / X0, "sigma1": 2e-3 / X0}
    assert found == pytest.approx(known)


def test_friction_without_a_stribeck_curve_gives_no_static_level():
    found = levels_of(base(Fc=0.3, Fv=0.02))
    assert found.get("Fs", 0.3) == pytest.approx(0.3)

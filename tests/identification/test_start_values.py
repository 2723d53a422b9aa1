"""Start values for the plant are those of the whole friction curve, however it was shared out."""

from types import SimpleNamespace

import numpy as np
import pytest

from lugrectl.identification.candidates.friction_terms import NAMES, Law
from lugrectl.identification.candidates.start_values import levels_of

W = np.concatenate([-np.geomspace(5.0, 1e-3, 200), np.geomspace(1e-3, 5.0, 200)])
VS, X0 = 0.2, 1e-3


def base(coulomb, viscous):
    shapes = np.zeros((len(W), len(NAMES)))
    shapes[:, NAMES.index("Fc")] = np.sign(W)
    shapes[:, NAMES.index("dip")] = np.sign(W) * np.exp(-((W / VS) ** 2))
    shapes[:, NAMES.index("Fv")] = W
    return SimpleNamespace(law=Law(X0, VS, shapes), coulomb=coulomb, viscous=viscous, J=0.01)


@pytest.mark.parametrize("moved", [0.0, 0.05])
def test_levels_do_not_depend_on_which_shape_has_the_torque(moved):
    """Grease and a long Stribeck tail share torque with the Coulomb and the viscous level."""
    level = 0.3 + 0.1 * np.exp(-((W / VS) ** 2))
    other = moved * np.sign(W) * np.sqrt(np.abs(W))
    found = levels_of(base(np.sign(W) * level - other, 0.02 * W + other))
    known = {"J": 0.01, "Fc": 0.3, "Fs": 0.4, "Fv": 0.02, "vs": VS, "sigma0": 0.3 / X0}
    assert found == pytest.approx(known)


def test_friction_without_a_stribeck_curve_gives_no_static_level():
    found = levels_of(base(0.3 * np.sign(W), 0.02 * W))
    assert found.get("Fs", 0.3) == pytest.approx(0.3)

"""A load behind a gap, with friction of its own."""

from __future__ import annotations

import numpy as np
import pytest

from lugrectl import diagnose
from lugrectl.blocks.model import Model

DT = 1e-3


def with_a_load(u: np.ndarray, gap: float, JL: float, FL: float) -> tuple[np.ndarray, np.ndarray]:
    """theta and w of a drive with a load that has dry friction, behind a gap: plain Euler."""
    J, Fc, k, c, parts = 0.002, 0.12, 60.0, 0.12, 20
    h, x, out = DT / parts, np.zeros(4), []
    for torque in u.tolist():
        out.append(x[:2].copy())
        for _ in range(parts):
            theta, w, at, v = x.tolist()
            beyond = abs(theta - at) - 0.5 * gap
            r = np.sign(theta - at) * k * beyond + c * (w - v) if beyond > 0 else 0.0
            dw = _slid(w, torque - r - 0.01 * w, Fc, J, h)
            dv = _slid(v, r, FL, JL, h)
            x = np.array([theta + h * dw, dw, at + h * dv, dv])
    return np.array(out).T


def _slid(w: float, force: float, level: float, J: float, h: float) -> float:
    """The next speed under dry friction, which may stop a mass but not turn it."""
    free = w + h * force / J
    return np.sign(free) * max(abs(free) - h * level / J, 0.0)


def test_a_load_with_friction_of_its_own_behind_a_gap_is_found() -> None:
    """Without its friction in the search, the load would fly on where this one stays."""
    t = np.arange(9000) * DT
    u = 0.32 * np.sin(2 * np.pi * 0.9 * t) + 0.14 * np.sin(2 * np.pi * 2.3 * t + 1.0)
    theta, _ = with_a_load(u, 0.05, 0.0015, 0.04)
    theta = np.round(theta / 1e-4) * 1e-4
    model = Model.of(J=0.002, friction="coulomb", Fc=0.12, Fv=0.01)
    found = diagnose({"t": t, "u": u, "theta": theta}, model)
    assert found.verdict == "found" and found.effects[0].name == "backlash"
    values = {k: e.value for k, e in found.effects[0].parameters.items()}
    assert values["gap"] == pytest.approx(0.05, rel=0.1)
    assert values["load_inertia"] == pytest.approx(0.0015, rel=0.15)
    assert values["load_friction"] == pytest.approx(0.04, rel=0.2)

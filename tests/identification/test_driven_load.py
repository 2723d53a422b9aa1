"""Loads behind springs and gaps along a given motion."""

from __future__ import annotations

import numpy as np
import pytest

from lugrectl.blocks.block import members
from lugrectl.blocks.model import Model
from lugrectl.diagnosis.question import Asked
from lugrectl.engine.runtime.c_compiler import has_compiler, has_wide
from lugrectl.identification.candidates import driven_load
from lugrectl.identification.candidates.driven_load import of_unit_load, torques
from lugrectl.identification.selection import compare

DT = 1e-3
T = np.arange(3000) * DT
LOOPS = ["numpy", *["c"] * has_compiler(), *["even"] * (has_compiler() and has_wide())]


def block(name: str):
    return members("effect")[name]


@pytest.mark.parametrize("made_by", LOOPS)
def test_a_spring_under_a_sinusoid_follows_its_frequency_response(
    made_by: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(driven_load, "_made_by", lambda: made_by)
    omega, own, damping = 2 * np.pi * 5.0, 2 * np.pi * 14.0, 0.2
    found = torques(block("elastic_coupling"), np.sin(omega * T), DT, [of_unit_load(14.0, damping)])
    s = 1j * omega
    response = s**2 * (own**2 + 2 * damping * own * s) / (s**2 + 2 * damping * own * s + own**2)
    want = np.imag(response * np.exp(s * (T + 0.5 * DT)))  # a mean over the sample
    late = slice(1500, -1)  # what the start left has died away
    error = np.sqrt(np.mean((found[late, 0] - want[late]) ** 2) / np.mean(want[late] ** 2))
    assert error < 0.01


@pytest.mark.parametrize("name", ["elastic_coupling", "backlash"])
def test_all_loops_compute_the_same_loads(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    gap = (0.01,) if name == "backlash" else ()
    sets = [of_unit_load(f, 0.3, *gap) for f in (60.0, 8.0, 20.0, 35.0)]
    path, made = np.sin(2 * np.pi * 1.5 * T[:600]) + 0.1 * np.sin(2 * np.pi * 7 * T[:600]), []
    for made_by in LOOPS:
        monkeypatch.setattr(driven_load, "_made_by", lambda made_by=made_by: made_by)
        alone = [torques(block(name), path, DT, [one]) for one in sets]
        made.append(np.concatenate(alone, axis=1))
    for other in made[1:]:
        np.testing.assert_allclose(other, made[0], rtol=1e-6, atol=1e-8 * np.abs(made[0]).max())


@pytest.mark.skipif(not has_compiler(), reason="no C compiler")
def test_loads_at_once_are_those_one_by_one_in_any_order() -> None:
    sets = [of_unit_load(f, 0.3, 0.02) for f in (300.0, 8.0, 140.0, 20.0, 45.0)]
    path, own = np.sin(2 * np.pi * 1.5 * T), block("backlash")
    together = torques(own, path, DT, sets)
    for i, one in enumerate(sets):
        np.testing.assert_array_equal(together[:, i], torques(own, path, DT, [one])[:, 0])


@pytest.mark.skipif(not (has_compiler() and has_wide()), reason="no loop over several loads")
def test_several_loads_at_once_round_as_one_by_one(monkeypatch: pytest.MonkeyPatch) -> None:
    """A load that bounces in its gap is chaotic: another rounding would be another load."""
    sets = [of_unit_load(45.0, 0.03, gap) for gap in np.geomspace(1e-3, 0.5, 12)]
    path, made = np.sin(2 * np.pi * 3 * T), []
    for made_by in ("c", "even"):
        monkeypatch.setattr(driven_load, "_made_by", lambda made_by=made_by: made_by)
        made.append(torques(block("backlash"), path, DT, sets))
    np.testing.assert_array_equal(*made)


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
    asked = Asked.of({"t": t, "u": u, "theta": theta}, model)
    found = compare(asked.plain.stretches, model, asked.plain)
    assert found.verdict == "found" and found.effects[0].name == "backlash"
    values = found.effects[0].values
    assert values["gap"] == pytest.approx(0.05, rel=0.1)
    assert values["load_inertia"] == pytest.approx(0.0015, rel=0.15)
    assert values["load_friction"] == pytest.approx(0.04, rel=0.2)

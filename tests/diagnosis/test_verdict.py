"""What the table of explanations says of records whose truth is known."""

import numpy as np
import pytest

from lugrectl import diagnose

J, FC, FV, VS, DT = 1e-3, 0.1, 0.002, 0.05, 2e-3
MODEL = f"""
motion = "rotary"
[plant]
J = {J}
[friction]
model = "stribeck"
Fc = {FC}
Fs = {1.05 * FC}
Fv = {FV}
vs = {VS}
"""


@pytest.fixture(scope="module")
def motion():
    """Fast and slow turns to and fro, 16 s at 500 Hz."""
    t = np.arange(0.0, 16.0, DT)
    waves = [(0.31, 14.0, 0.4), (0.9, 3.0, 1.3), (2.3, 0.8, 2.2), (4.7, 0.15, 0.1)]
    theta, w, a = np.zeros((3, len(t)))
    for hertz, size, phase in waves:
        k = 2 * np.pi * hertz
        theta += size * np.sin(k * t + phase)
        w += size * k * np.cos(k * t + phase)
        a -= size * k**2 * np.sin(k * t + phase)
    return t, theta, w, a


def judged(tmp_path, motion, more, counts=20_000, **channels):
    """The comparison of a drive that has ``more`` torque than its model."""
    t, theta, w, a = motion
    rng = np.random.default_rng(3)
    u = J * a + FC * np.tanh(w / 0.02) + FV * w + more + 2e-3 * FC * rng.standard_normal(len(t))
    count = 2 * np.pi / counts
    path = tmp_path / "model.toml"
    path.write_text(MODEL)
    log = {"t": t, "u": u, "theta": np.floor(theta / count) * count, **channels}
    return diagnose(log, path)


def names(found):
    return [effect.name for effect in found.effects]


def test_an_offset_that_matters_is_named_beside_its_own_small_part_in_the_base(tmp_path, motion):
    found = judged(tmp_path, motion, np.full(len(motion[0]), 0.05 * FC))
    causes = {*names(found), *(a.name for e in found.effects for a in e.alternatives)}
    assert "constant_torque" in causes <= {"constant_torque", "coulomb_asymmetry"}
    shares = {one.term: one.share for one in found.comparison.budget}
    assert shares[found.effects[0].name] == pytest.approx(0.05, rel=0.4)


def test_an_inertia_far_above_the_declared_one_is_said(tmp_path, motion):
    found = judged(tmp_path, motion, 0.6 * J * motion[3])
    assert found.verdict == "ambiguous" and found.model.J == pytest.approx(1.6 * J, rel=0.01)
    assert "that of drive and load together" in " ".join(found.messages)


def test_it_may_be_a_load_on_a_coupling_where_the_record_shows_no_resonance(tmp_path, motion):
    found = judged(tmp_path, motion, 0.6 * J * motion[3], counts=500)
    assert found.verdict == "ambiguous"
    assert {*names(found), *(a.name for e in found.effects for a in e.alternatives)} == {
        "elastic_coupling",
        "backlash",
    }
    assert "that of drive and load together" in " ".join(found.messages)


def push(t, *at):
    """A torque for a moment at some instants."""
    return 1.5 * FC * sum(np.exp(-(((t - x) / 0.05) ** 2)) for x in at)


def test_a_torque_at_one_instant_decides_nothing(tmp_path, motion):
    found = judged(tmp_path, motion, push(motion[0], 7.3))
    assert found.verdict == "adequate"


@pytest.mark.slow
@pytest.mark.sample
def test_a_load_that_is_measured_is_not_missing(tmp_path, motion):
    t = motion[0]
    load = 0.5 * FC * np.sin(2 * np.pi * 0.11 * t)
    assert judged(tmp_path, motion, load, d=load).verdict == "adequate"
    assert judged(tmp_path, motion, load).verdict != "adequate"

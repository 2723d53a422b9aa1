"""What is named on motions of a few sines, and what is not."""

import math

import numpy as np
import pytest

import lugrectl as lg

COULOMB = lg.Model.of(friction="coulomb")


def sines(t, parts):
    """theta, w, a (N,) of the sum of A sin(2 pi f t + phase) over parts (A, f, phase)."""
    theta, w, a = np.zeros((3, len(t)))
    for A, f, phase in parts:
        at, omega = 2 * np.pi * f * t + phase, 2 * np.pi * f
        theta, w = theta + A * np.sin(at), w + A * omega * np.cos(at)
        a = a - A * omega**2 * np.sin(at)
    return theta, w, a


def names(found):
    return [effect.name for effect in found.effects]


def causes(found):
    return {*names(found), *(a.name for e in found.effects for a in e.alternatives)}


@pytest.mark.slow
@pytest.mark.cases
@pytest.mark.parametrize("half", [0.026, 0.0])
def test_a_dead_zone_which_looks_like_more_inertia_and_a_late_torque(half):
    """A screw: what its motion needs, and half of the zone more."""
    J, Fc, rng, t = 3.4e-4, 0.13, np.random.default_rng(0), np.arange(0.0, 8.0, 1e-3)
    theta, w, a = sines(t, ((6.0, 1.9, 0.0), (9.0, 0.7, 1.0), (16.0, 0.31, 2.0)))
    torque = J * a + Fc * np.sign(w) + 6.5e-4 * w
    u = torque + half * np.sign(torque) + 1e-4 * rng.standard_normal(len(t))
    log = {"t": t, "u": u, "theta": theta + 2e-4 * rng.standard_normal(len(t))}
    found = lg.diagnose(log, COULOMB)
    if not half:
        assert found.verdict == "adequate"
        return
    assert names(found) == ["actuator_dead_zone"]
    own, values = found.effects[0].parameters["half_width"], found.model.values()
    assert own.may_be(half) and np.diff(own.ci95) < 0.15 * half
    assert values["J"] == pytest.approx(J, rel=0.01) and values["Fc"] == pytest.approx(Fc, rel=0.01)
    assert not any("column lags" in message for message in found.messages)


@pytest.mark.slow
def test_torque_that_is_there_seldom_is_no_outlier():
    """A drive that is pushed is not called adequate."""
    t = 2e-3 * np.arange(6_000)
    w = 3.0 * np.sin(2.0 * t) + 2.0 * np.sin(5.3 * t)
    a = 6.0 * np.cos(2.0 * t) + 10.6 * np.cos(5.3 * t)
    u = (
        0.01 * a
        + 0.2 * np.sign(w)
        + 0.02 * w
        + 1e-3 * np.random.default_rng(0).standard_normal(len(t))
    )
    for start in (3.1, 8.2):
        u = u + 0.5 * ((start < t) & (t < start + 0.2))
    found = lg.diagnose({"t": t, "u": u, "w": w}, lg.Model.of(friction="coulomb", J=0.01))
    assert found.verdict == "unexplained"
    assert any("of friction stays, and nothing explains it" in m for m in found.messages)


@pytest.fixture(scope="module")
def cogged():
    """A speed loop on a drive that sticks, with cogging and an offset: the commonest pair."""
    rng, dt, fine = np.random.default_rng(4), 1e-3, 20
    theta, w, rows, h = 0.0, 0.0, [], dt / fine
    for t in (dt * np.arange(10_000)).tolist():
        goal = 6.0 * math.sin(1.3 * t) + 3.0 * math.sin(3.7 * t + 1.0)
        u = 0.1 * (goal - w) + 0.1 * math.tanh(3.0 * goal)
        rows.append((t, u, theta))
        for _ in range(fine):
            load = 0.05 * math.sin(12 * theta + 0.4) + 0.06
            pushed = w + h / 0.002 * (u - 0.02 * w - load)
            w = math.copysign(max(abs(pushed) - h * 0.12 / 0.002, 0.0), pushed)
            theta += h * w
    t, u, theta = np.array(rows).T
    count = 2 * np.pi / 40_000
    u = u + rng.normal(0.0, 1e-3, len(u))
    return lg.diagnose(
        {"t": t, "u": u, "theta": count * np.round(theta / count)},
        lg.Model.of(J=0.002, friction="coulomb"),
    )


@pytest.mark.slow
@pytest.mark.sample
def test_cogging_and_an_offset_are_both_named_and_nothing_else(cogged):
    """Only rows near rest tell the offset from an asymmetry of friction."""
    assert cogged.verdict in ("found", "ambiguous")
    own = names(cogged)
    assert "torque_ripple" in own and len(own) == 2
    assert "constant_torque" in causes(cogged)
    assert causes(cogged) <= {*own, "constant_torque", "coulomb_asymmetry"}


@pytest.mark.slow
@pytest.mark.sample
def test_their_values_are_right(cogged):
    values = {e.name: e.parameters for e in cogged.effects}
    assert values["torque_ripple"]["harmonic"].value == 12
    assert values["torque_ripple"]["amplitude"].value == pytest.approx(0.05, rel=0.05)
    if "constant_torque" in values:
        offset = values["constant_torque"]["torque"].value
    else:  # of Fc, to one side
        offset = values["coulomb_asymmetry"]["ratio"].value * cogged.estimates["Fc"].value
    assert offset == pytest.approx(0.06, rel=0.05)


# A stribeck drive over fast and slow turns to and fro.

J, FC, FV, DT = 1e-3, 0.1, 0.002, 2e-3
STRIBECK = lg.Model.of(
    J=J, friction={"model": "stribeck", "Fc": FC, "Fs": 1.05 * FC, "Fv": FV, "vs": 0.05}
)
T = np.arange(0.0, 16.0, DT)
THETA, W, A = sines(T, ((14.0, 0.31, 0.4), (3.0, 0.9, 1.3), (0.8, 2.3, 2.2), (0.15, 4.7, 0.1)))


def judged(more, counts=20_000, **channels):
    """The answer on the drive with ``more`` torque than its model."""
    rng = np.random.default_rng(3)
    u = J * A + FC * np.tanh(W / 0.02) + FV * W + more + 2e-3 * FC * rng.standard_normal(len(T))
    count = 2 * np.pi / counts
    log = {"t": T, "u": u, "theta": np.floor(THETA / count) * count, **channels}
    return lg.diagnose(log, STRIBECK)


@pytest.mark.slow
def test_an_offset_that_matters_is_named_beside_its_own_small_part_in_the_base():
    found = judged(0.05 * FC)
    assert "constant_torque" in causes(found) <= {"constant_torque", "coulomb_asymmetry"}
    shares = {one.term: one.share for one in found.comparison.budget}
    assert shares[found.effects[0].name] == pytest.approx(0.05, rel=0.4)


@pytest.mark.slow
@pytest.mark.cases
@pytest.mark.parametrize("counts", [500, 20_000])
def test_an_inertia_far_above_the_declared_one_is_said(counts):
    """Where the record shows no resonance it may be a load on a coupling."""
    found = judged(0.6 * J * A, counts)
    assert found.verdict == "ambiguous"
    assert "that of drive and load together" in " ".join(found.messages)
    if counts == 500:
        assert causes(found) == {"elastic_coupling", "backlash"}
    else:
        assert found.model.J == pytest.approx(1.6 * J, rel=0.01)


@pytest.mark.slow
def test_a_torque_at_one_instant_decides_nothing():
    assert judged(1.5 * FC * np.exp(-(((T - 7.3) / 0.05) ** 2))).verdict == "adequate"

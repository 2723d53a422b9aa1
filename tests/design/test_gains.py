"""Gain design, certificates and excitation."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import eigh

import lugrectl as lg
from lugrectl.blocks.block import members
from lugrectl.design import certify, design_gains, excitation
from lugrectl.design.certificate import error_matrices
from lugrectl.design.gains import RULES, common_rate, decay, position_corners

from ..cases.error_systems import h, matrices

P = lg.table1()
PAPER_GAINS = (-10.24, 22.0)
powers = st.floats(-3, 3)


def paper_design():
    beta = 2 * (P.sigma1 * 1e4 + P.sigma0) / (P.J * 10.24)
    return design_gains(P, "constant", C=1.0, alpha=1e4, beta=beta)


def test_the_papers_gains():
    """alpha = 1e4 1/s and beta/C = 5.56e5; 91.3 1/s by its V, 95.3 1/s by the best one."""
    design = paper_design()
    assert (design.K1, design.K2) == (pytest.approx(-10.24), pytest.approx(22.0))
    own = design.certificate
    assert own.alpha == pytest.approx(1e4) and own.beta == pytest.approx(5.56e5, rel=1e-3)
    assert own.rate == pytest.approx(91.32, abs=0.01)
    best = certify(P, *PAPER_GAINS)
    assert best.rate == pytest.approx(95.309, abs=1e-3)
    assert best.rate == pytest.approx(-best.pole_at_rest, rel=1e-9)
    poles = np.linalg.eigvals(matrices(P, 0.0, *PAPER_GAINS))
    assert poles.max() == pytest.approx(best.pole_at_rest, rel=1e-9)


def test_matrices_are_those_of_the_observer_block():
    """M0 + a M1 against the difference of drive and observer, and e_f against the blocks."""
    M0, M1 = error_matrices(P, *PAPER_GAINS)
    plant, made = lg.plant(P), lg.proposed_observer(P, *PAPER_GAINS)
    for w in (0.0, 0.004, -0.3):
        for ez, ew in [(1e-4, 0.0), (0.0, 0.01), (-2e-4, 0.02)]:
            _, dw, dz = plant.dynamics(0, [0, w, 1e-3], [0.2, 0])
            inner = made.dynamics(0, [1e-3 - ez, w - ew], [w, 0.2])
            expected = (M0 + P.sigma0 * abs(w) / h(P, w) * M1) @ [ez, ew]
            assert np.array([dz, dw]) - inner == pytest.approx(expected, rel=1e-9, abs=1e-9)


def test_certificate_matrices_and_rate():
    cert = certify(P, *PAPER_GAINS)
    M0, M1 = error_matrices(P, *PAPER_GAINS)
    assert cert.Q0 == pytest.approx(-(cert.P @ M0 + M0.T @ cert.P))
    assert cert.Q1 == pytest.approx(-(cert.P @ M1 + M1.T @ cert.P), abs=1e-6)
    for a in (0.0, 3.0, 1e3, 1e6):
        least = eigh(cert.Q0 + a * cert.Q1, cert.P, eigvals_only=True)[0] / 2
        assert cert.rate_at(a) == pytest.approx(least, rel=1e-6)
    assert np.all(np.diff(cert.rate_at(np.logspace(-2, 6, 50))) >= 0)
    assert cert.rate_at(0.0) == cert.rate


@settings(max_examples=10)
@given(powers, powers, powers, powers)
def test_no_other_V_does_better(j, k1, k2, corner):
    """Random quadratic forms, with B = 2 C sigma1/J and without, at rest and at ever higher
    speeds."""
    p = replace(P, J=2e-3 * 10**j, sigma1=0.6 * 10 ** (corner / 3))
    K1, K2 = -10 * 10**k1, p.J * 1e3 * 10 ** (k2 / 2)
    cert = certify(p, K1, K2)
    random = np.random.default_rng(0)
    q = p.sigma1 / p.J
    off = random.choice([-1, 1], 1500) * random.uniform(0.05, 1, 1500)
    near = q * (1 + np.concatenate([np.zeros(500), off]))
    size = near**2 + cert.beta / 2 * 10.0 ** random.normal(0, 1, 2000)
    V = np.stack([np.stack([size, near], -1), np.stack([near, np.ones(2000)], -1)], -2)
    root = np.linalg.inv(np.linalg.cholesky(V))
    worst = np.full(2000, np.inf)
    for a in (0.0, *(p.sigma0 / p.sigma1 * np.logspace(-1, 17, 10))):
        M = matrices(p, a, K1, K2)
        Q = root @ -(V @ M + M.T @ V) @ root.swapaxes(-1, -2)
        worst = np.minimum(worst, np.linalg.eigvalsh(Q)[:, 0] / 2)
    assert cert.rate > 0
    assert worst.max() <= cert.rate * (1 + 3e-3)
    assert cert.rate <= -cert.pole_at_rest * (1 + 1e-9)


@pytest.mark.parametrize(
    "K1, K2, words",
    [
        (1.0, 22.0, "unstable pole"),
        (1.0, -22.0, "unstable pole"),
        (0.0, 22.0, "K1 = 0"),
        (-10.0, -1.0, "K2 = -1 < 0"),
    ],
)
def test_gains_without_a_certificate(K1, K2, words):
    cert = certify(P, K1, K2)
    assert not cert and cert.rate is None and cert.P is None and words in cert.conditions[0]
    fast = np.linspace(0, 1e5, 2001)
    worst = np.linalg.eigvals(matrices(P, fast, K1, K2)).real.max()
    assert worst > 0 or (K1 == 0.0 and worst == pytest.approx(0, abs=1e-6))
    with pytest.raises(lg.InputError, match="no certificate"):
        cert.V(1e-3, 0.0)
    json.dumps(cert.summary(), allow_nan=False)


def test_defaults_put_the_poles_where_they_say():
    corner = P.sigma0 / P.sigma1
    design = design_gains(P)
    poles = np.sort(np.linalg.eigvals(matrices(P, 0.0, design.K1, design.K2)))
    assert poles == pytest.approx([-2 * corner, -corner])
    assert design.certificate.rate == pytest.approx(corner / (1 + np.sqrt(1.25) + 0.5))
    varying = design_gains(P, "time-varying")
    M = matrices(P, 0.0, varying.K1(0.0), varying.K2(0.0))
    assert np.trace(M) == pytest.approx(-2 * corner) and np.linalg.det(M) == pytest.approx(
        corner**2
    )
    assert varying.certificate.pole_at_rest == pytest.approx(-corner, rel=1e-6)


@settings(max_examples=30)
@given(st.lists(st.floats(-1, 1), min_size=3, max_size=12), st.floats(0.05, 1.0))
def test_least_travel_is_that_of_every_window(samples, share):
    """beta against windows at 2000 starts: never above one, and reached by one."""
    t, w = np.arange(len(samples)) * 0.1, np.array(samples)
    T = share * t[-1]
    found = excitation(w, t, T)
    fine = np.linspace(0, t[-1], 40001)
    speed = np.abs(np.interp(fine, t, w))
    travel = np.concatenate([[0], np.cumsum((speed[1:] + speed[:-1]) / 2 * np.diff(fine))])
    starts = np.linspace(0, t[-1] - T, 2000)
    each = np.interp(starts + T, fine, travel) - np.interp(starts, fine, travel)
    assert found.beta <= each.min() + 1e-7
    assert found.beta >= each.min() - 2 * t[-1] / 2000
    between = float(np.max(np.abs(np.diff(w)))) / 0.1 * fine[1]  # a zero between two instants
    assert found.slowest == pytest.approx(speed.min(), abs=between + 1e-9)
    assert excitation(3 * w, t, T).beta == pytest.approx(3 * found.beta, abs=1e-12)


# Gains of every observer by its rule, and what is claimed for them.


SHORT = [k.removesuffix("_observer") for k in RULES]


def test_every_observer_has_a_rule_or_is_the_proposed_one():
    known = {k for k in members("observer") if not members("observer")[k].home.startswith("tests")}
    assert known - {*RULES} == {"no_observer", "proposed_observer"}


@pytest.mark.parametrize("name", [*SHORT[::5], "proposed"])
def test_a_loop_takes_the_gains_of_a_design(name):
    design = lg.design_gains(P, observer=name)
    assert design.observer == name and design.certificate
    loop = lg.velocity_loop(P, name, **design.gains)
    assert loop.ninputs >= 1
    for key, value in design.gains.items():
        block = next(b for b in loop.syslist if b.name == f"{name}_observer")
        assert block.params[f"{name}_observer.{key}"] == value


@pytest.mark.parametrize(("rate", "claimed"), [(200.0, 123.0), (2000.0, 1660.0)])
def test_the_friction_state_has_at_least_the_known_decay(rate, claimed):
    """Up to 0.65 rad/s; found by hand with one parameter of V, here with three."""
    design = lg.design_gains(P, observer="friction_state", bandwidth=rate, M=0.65)
    assert claimed <= design.certificate.rate < 1.02 * claimed
    assert design.certificate.pole_at_rest == -rate


@pytest.mark.slow
@pytest.mark.parametrize(("most", "claimed"), [(0.1, 445.0), (1.0, 338.0)])
def test_the_position_observer_has_the_known_gains_and_decay(most, claimed):
    design = lg.design_gains(P, observer="position_lugre", pole=1000.0, M=most)
    gains = [design.gains[k] for k in ("l1", "l2", "l3")]
    assert gains == pytest.approx([2719.1, 2.1180e6, -5742.4], rel=2e-4)
    assert design.certificate.rate == pytest.approx(claimed, rel=5e-3)


@pytest.mark.slow
def test_a_common_function_decays_at_every_corner():
    _, corners = position_corners(P, 1000.0, 0.5)
    rate, V = common_rate(corners)
    assert decay(V, corners) == pytest.approx(rate, rel=1e-6)
    assert np.linalg.eigvalsh(V)[0] > 0.0
    assert common_rate([np.eye(2), -np.eye(2)]) is None


def test_a_sample_time_limits_the_rates():
    for name, key in (("extended_state", "bandwidth"), ("friction_state", "bandwidth")):
        assert lg.design_gains(P, observer=name, dt=5e-3).gains[key] == pytest.approx(100.0)
    assert lg.design_gains(P, observer="disturbance", dt=2e-3).gains["tau"] == 4e-3


def test_the_rate_of_a_coulomb_observer_is_the_one_that_was_asked_for():
    drive = {"J": 0.5, "friction": "coulomb", "Fc": 1.0, "Fv": 0.1}
    for name in ("position_coulomb", "general_coulomb"):
        made = lg.design_gains(drive, observer=name, rate=20.0)
        assert made.gains["k"] == pytest.approx(10.0)


def test_the_normal_force_observer_is_certified_with_a_positive_real_loop_only():
    assert lg.design_gains(P, observer="normal_force", kp=15.0, kd=1.2).certificate
    low = lg.design_gains(P, observer="normal_force", kp=15.0, kd=0.5).certificate
    assert not low and "not PR" in low.conditions[0]


def test_a_design_has_the_forms_of_every_result():
    design = lg.design_gains(P, observer="disturbance", tau=0.02)
    assert repr(design).splitlines()[0] == "Design: disturbance observer"
    made = design.to_dict()
    assert made["gains"] == {"tau": 0.02} and made["certificate"]["rate"] == pytest.approx(50.0)
    assert '"valid"' in design.to_json()
    with pytest.raises(lg.InputError, match="not a function of e_z and e_w"):
        design.certificate.V(1.0, 0.0)

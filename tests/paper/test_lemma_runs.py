"""The source paper's lemmas and remarks, run: simulated errors against what each one promises."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import lugrectl as lg
from lugrectl.design import certify, design_gains, excitation, natural_decay

from ..cases.error_systems import (
    beside,
    errors_at,
    h,
    matrices,
    open_system,
    propagator,
    simulated,
    values_of,
)

P = lg.table1()
T4 = np.linspace(0.0, 0.4, 801)
TORQUES = {
    "steps": np.repeat(np.random.default_rng(1).uniform(-0.5, 0.5, 9), 89),
    "below break-away": 0.1 * np.sin(9 * T4),
}
START = [0.0, 0.0, 0.0, -8e-4, 0.05]  # theta, w, z, zhat, what


def natural_error(w, t, p=P):
    """e_z(t)/e_z(0) as the difference of two natural observers on one velocity."""
    made = lg.natural_observer(p)
    runs = [lg.simulate(made, t, w, [z0], rtol=1e-10).states[0] for z0 in (1e-3, -1e-3)]
    return (runs[0] - runs[1]) / 2e-3


def test_proof2_eq():
    t = np.linspace(0, 0.1, 401)
    w = 0.02 * np.sin(30 * t) + 0.004 * np.cos(171 * t)
    assert natural_decay(P, w, t) == pytest.approx(natural_error(w, t), abs=2e-7)
    flat = replace(P, Fs=P.Fc)
    exact = np.exp(-P.sigma0 / P.Fc * 0.003 * (1 - np.cos(30 * t)) / 30)
    assert natural_decay(flat, 0.003 * np.sin(30 * t), t) == pytest.approx(exact, rel=1e-6)


def test_lemma1():
    """|w| >= alpha: |e_z| <= exp(-sigma0 alpha t/C2) |e_z(0)|."""
    t = np.linspace(0, 0.2, 201)
    w = 0.01 + 0.004 * (1 + np.sin(50 * t)) * np.exp(-t)
    found = excitation(w, t)
    rate = found.rate(P)
    assert found.slowest >= 0.01 and rate >= P.sigma0 * 0.01 / max(P.Fc, P.Fs)
    error = natural_error(w, t)
    assert np.all(error <= np.exp(-P.sigma0 * found.slowest / P.Fs * t) + 1e-8)
    stuck = excitation(np.where(t < 0.1, w, 0.0), t, T=0.05)
    assert not stuck and stuck.rate(P) == 0.0


def test_lemma2():
    """lemma2_eq with the T and beta found, on a w that passes through 0."""
    t = np.linspace(0, 0.8, 321)
    w = 0.004 * np.sin(2 * np.pi * 4.1 * t) * (1.2 + np.cos(15 * t))
    error = natural_error(w, t)
    for T in (None, 0.1, 0.3):
        found = excitation(w, t, T)
        travel = np.concatenate([[0], np.cumsum((abs(w[1:]) + abs(w[:-1])) / 2 * np.diff(t))])
        ends = np.interp(t + found.T, t, travel)[t + found.T <= t[-1]]
        assert found.beta <= np.min(ends - travel[: len(ends)]) + 1e-9
        rate, start = found.rate(P), P.sigma0 * found.beta / max(P.Fc, P.Fs)
        assert rate > 0
        assert np.all(error <= np.exp(start - rate * t) + 1e-8)


@pytest.mark.parametrize("f", [0.7, 5.0])
def test_remark1(f):
    """w = sin(2 pi f t): T = 1/(2f), beta = 1/(pi f); lemma2 does not imply lemma1."""
    t = np.linspace(0, 3.3 / f, 20001)
    w = np.sin(2 * np.pi * f * t)
    assert excitation(w, t, T=1 / (2 * f)).beta == pytest.approx(1 / (np.pi * f), rel=1e-6)
    found = excitation(w, t)
    assert found.T == pytest.approx(1 / (2 * f), rel=2e-3)
    assert found.beta == pytest.approx(1 / (np.pi * f), rel=2e-3)
    assert found.slowest == 0.0


def test_remark2():
    """w in L1: the natural observer's error ends above exp(-sigma0/C1 int |w|), not at 0."""
    t = np.linspace(0, 30, 6001)
    w = 1e-3 * np.exp(-t)
    factor = natural_decay(P, w, t)
    assert np.all(factor >= np.exp(-P.sigma0 / min(P.Fc, P.Fs) * 1e-3))
    assert factor[-1] > 0.3 and factor[-1] == pytest.approx(factor[3000], rel=1e-6)
    assert natural_error(w, t)[-1] == pytest.approx(factor[-1], rel=1e-5)
    a = P.sigma0 * w / h(P, w)
    steps = propagator(matrices(P, a, -10.24, 22.0), np.diff(t, append=31.0))
    shrink = np.abs(errors_at(steps, [1.0, 0.0])[:, 1]).max(axis=1)
    assert np.log(shrink).sum() < -90 * 30  # the proposed observer forgets on the same motion


def test_lemma3():
    """Bounded w: |e_f| <= sigma0 (1 + sigma1 M/C1) |e_z|, so e_f decays as e_z does."""
    keys = values_of(P, "natural_observer")
    u = 0.5 * np.sin(25 * T4)
    found = simulated(open_system("natural"), T4, u, [0, 0, 0, -8e-4], params=keys)
    top = np.abs(found["w"]).max()
    bound = P.sigma0 * (1 + P.sigma1 * top / min(P.Fc, P.Fs))
    assert top > 0.1
    assert np.all(np.abs(found["ef"]) <= bound * np.abs(found["ez"]) + 1e-9)
    rate = excitation(found["w"], T4, T=0.2).rate(P)
    start = np.exp(rate * 0.2)
    assert rate > 10
    assert np.all(np.abs(found["ef"]) <= bound * start * 8e-4 * np.exp(-rate * T4) + 1e-6)


def test_remark3():
    """A wrong zhat(0) is a disturbance that dies: the loop ends on the frictionless one."""
    t = np.linspace(0, 1.0, 1001)
    r = 0.5 * np.sin(8 * t)
    loop = lg.velocity_loop(P, "natural", ki=0.0)
    at = loop.state_labels.index("natural_observer_zhat")
    x0 = np.zeros(loop.nstates)
    exact = lg.simulate(loop, t, r, x0, rtol=1e-8).outputs
    x0[at] = 1e-3
    wrong = lg.simulate(loop, t, r, x0, rtol=1e-8).outputs
    row = loop.output_labels.index("w")
    miss = np.abs(wrong[row] - exact[row])
    assert miss.max() > 1e-2 and miss[500:].max() < 1e-3 * miss.max()


def held_speeds(count, seed, top=1.0):
    """Random held velocities, many at rest, and how long each is held."""
    random = np.random.default_rng(seed)
    w = top * random.choice([-1, 1], count) * 10.0 ** random.uniform(-5, 0, count)
    w[random.random(count) < 0.3] = 0.0
    return w, 10.0 ** random.uniform(-5, -2, count)


def test_lemma4():
    """V never grows, decays by min(a, alpha/J); at the rate that the excitation promises."""
    design = design_gains(P, "time-varying", alpha=1.2)
    w, tau = held_speeds(400, 2, top=50.0)
    a = P.sigma0 * np.abs(w) / h(P, w)
    steps = propagator(matrices(P, a, design.K1(w), design.K2(w)), tau)
    path, V = errors_at(steps, [1.0, 0.0]), design.certificate.V
    kept = V(*path[:, 1].T) / V(*path[:, 0].T)
    least = np.minimum(a, 1.2 / P.J)
    assert design.certificate.rate_at(a) == pytest.approx(least, rel=1e-9)
    assert np.all(kept <= np.exp(-2 * least * tau) * (1 + 1e-9))
    assert np.all(np.log(kept[w == 0]) < 0) and design.certificate.rate is None

    t = np.arange(4000) * 2.5e-4
    w = 0.5 * np.sin(2 * np.pi * 3 * t)
    a = P.sigma0 * np.abs(w) / h(P, w)
    found = excitation(w, t)
    rate = found.rate(P, alpha=1.2)
    path = errors_at(propagator(matrices(P, a, design.K1(w), design.K2(w)), 2.5e-4), [1.0, 0.0])
    logs = np.cumsum(np.log(V(*path[:, 1].T) / V(*path[:, 0].T)))
    assert rate > 50 and np.all(logs <= 2 * rate * (found.T - t) + 1e-6)


def test_lemma5():
    """|w| <= M: V never grows and e_z, e_w die out, at rest too; beyond M, V may grow."""
    M = 0.8
    design = design_gains(P, "bounded", M=M)
    cert = design.certificate
    K1_top = design.K1(np.array([M]))[0]
    assert design.K2 >= cert.alpha + P.sigma1 * K1_top
    w, tau = held_speeds(600, 4, top=M)
    a = P.sigma0 * np.abs(w) / h(P, w)
    path = errors_at(propagator(matrices(P, a, design.K1(w), design.K2), tau), [1.0, 0.3])
    kept = cert.V(*path[:, 1].T) / cert.V(*path[:, 0].T)
    assert np.all(kept <= np.exp(-2 * cert.rate_at(a) * tau) * (1 + 1e-9))
    assert np.log(kept).sum() < -50 and cert.rate is None
    resting = w == 0
    assert np.log(kept[resting]).sum() < -5
    K1 = design.K1(2 * M)
    grows = matrices(P, P.sigma0 * 2 * M / h(P, 2 * M), K1, design.K2)[1, 1]
    assert (design.K2 - P.sigma1 * design.K1(M)) / P.J >= cert.alpha / P.J * (1 - 1e-12)
    assert -grows < cert.alpha / P.J  # K3 below alpha/J


@pytest.mark.parametrize("name", TORQUES)
def test_remark4(name):
    """lemma5's gains under several torques, as long as |w| stays below M."""
    design = design_gains(P, "bounded", M=6.0)
    system = beside(P, lg.proposed_observer(P, **design.gains))
    found = simulated(system, T4, TORQUES[name], START)
    V = design.certificate.V(found["ez"], found["ew"])
    assert np.abs(found["w"]).max() <= 6.0
    assert np.all(np.diff(V) <= 1e-6 * V[0]) and V[-1] < 1e-3 * V[0]


@pytest.mark.parametrize("name", TORQUES)
def test_lemma6(name):
    """Exponential for every w and u: V(t) <= V(0) exp(-2 rate t), by either certificate."""
    beta = 2 * (P.sigma1 * 1e4 + P.sigma0) / (P.J * 10.24)
    printed = design_gains(P, "constant", alpha=1e4, beta=beta)
    for cert in (printed.certificate, certify(P, printed.K1, printed.K2)):
        keys = values_of(P, "proposed_observer", K1=printed.K1, K2=printed.K2)
        found = simulated(open_system(), T4, TORQUES[name], START, params=keys)
        V = cert.V(found["ez"], found["ew"])
        assert np.all(V <= V[0] * (np.exp(-2 * cert.rate * T4) * (1 + 1e-4) + 1e-9))
        most_ez, most_ew = cert.bound(8e-4, -0.05)
        fall = np.exp(-cert.rate * T4) + 1e-4
        assert np.all(np.abs(found["ez"]) <= most_ez * fall)
        assert np.all(np.abs(found["ew"]) <= most_ew * fall)

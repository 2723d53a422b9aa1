"""Sampled blocks against the continuous ones, closed forms and known stability limits.

Table 1 at 1 kHz unless told otherwise.
"""

import control as ct
import mpmath
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import lugrectl as lg
from lugrectl.blocks.observers import (
    disturbance_observer,
    extended_state_observer,
    friedland_park_observer,
)
from lugrectl.simulation.response import simulate
from lugrectl.simulation.sampled_block import advance, ramp_response, sampled

from ..cases.observed import believing
from ..cases.own import static
from ..cases.sampled import DT, P, inputs_of, step_response

SPEEDS = [0.0, 1e-6, 0.01, 1.0, 100.0]
entries = st.floats(-1.0, 1.0)
sizes = st.sampled_from([1e-9, 1e-4, 0.1, 1.0, 10.0])
OBSERVERS = [
    pytest.param(lg.natural_observer(P), [1e-3], id="natural"),
    pytest.param(lg.existing_observer(P), [1e-3], id="existing"),
    pytest.param(lg.proposed_observer(P), [1e-3, 0.1], id="proposed"),
    pytest.param(friedland_park_observer(P), [0.2], id="friedland_park"),
    pytest.param(disturbance_observer(P), [0.0], id="disturbance"),
    pytest.param(extended_state_observer(P), [0.0, 0.0], id="extended_state"),
]


def h(w):
    return P.Fc + (P.Fs - P.Fc) * np.exp(-((w / P.vs) ** 2))


def transition(observer, w):
    """The matrix by which the states of two samples at constant w hang together."""

    def rates(x, v):
        return observer.updfcn(0.0, x, v, observer.params)

    v, n = inputs_of(observer, w=w, u=0.1, e=0.0), observer.nstates
    still = advance(rates, np.zeros(n), v, v, DT)
    return np.column_stack([advance(rates, unit, v, v, DT) - still for unit in np.eye(n)])


# The closed form.


@settings(max_examples=20)
@given(st.lists(entries, min_size=8, max_size=8), sizes, sizes, st.integers(0, 3))
def test_ramp_response_solves_its_equation(numbers, size, other, kind):
    """x(1) of dx/ds = B x + p + q s by a Taylor matrix exponential with 40 digits."""
    a, b, c, d = numbers[:4]
    B = np.array([[a, b], [c, d]]) * size
    if kind == 1:
        B = np.array([[a, b], [-b, a]]) * size  # a pair of complex eigenvalues
    if kind == 2:
        B = np.array([[a * size, other], [0.0, a * size]])  # a double one
    if kind == 3:
        B = np.array([[-abs(a) * size, 0.0], [b, -100.0]])  # stiff
    p, q = np.array(numbers[4:6]), np.array(numbers[6:])
    whole = np.zeros((4, 4))
    whole[:2, :2], whole[:2, 2], whole[:2, 3], whole[2, 3] = B, q, p, 1.0
    with mpmath.workdps(40):
        exact = np.array((mpmath.expm(mpmath.matrix(whole), method="taylor")[:2, 3]).tolist())
    exact = exact.astype(float).ravel()
    scale = np.abs(exact).max() + np.abs(p).max() + np.abs(q).max()
    np.testing.assert_allclose(ramp_response(B, p, q), exact, rtol=0, atol=1e-11 * scale + 1e-40)


def test_larger_systems_go_through_scipy():
    """Two blocks side by side, as one of four states."""
    rng = np.random.default_rng(1)
    one, two = rng.normal(size=(2, 2, 2))
    p, q = rng.normal(size=(2, 4))
    whole = np.block([[one, np.zeros((2, 2))], [np.zeros((2, 2)), two]])
    apart = [ramp_response(B, p[k], q[k]) for B, k in ((one, slice(2)), (two, slice(2, 4)))]
    assert ramp_response(whole, p, q) == pytest.approx(np.concatenate(apart), rel=1e-10)


# Constant speed.


@pytest.mark.parametrize(("observer", "x0"), OBSERVERS)
@pytest.mark.parametrize("w", SPEEDS)
def test_stable_at_any_constant_speed(observer, x0, w):
    """Eigenvalues are exp(dt pole) of the continuous block, none outside the unit circle."""
    v = inputs_of(observer, w=w, u=0.1, e=0.0)
    poles = np.linalg.eigvals(ct.linearize(observer, np.zeros(observer.nstates), v).A)
    found = np.linalg.eigvals(transition(observer, w))
    assert np.abs(found).max() <= 1.0 + 1e-12
    # a double pole (extended state) is known to the root of the rounding error only
    assert np.sort(found.real) == pytest.approx(np.sort(np.exp(DT * poles).real), abs=1e-5)


@pytest.mark.parametrize("w", [-100.0, -0.3, 0.004, 2.0, 100.0])
def test_natural_observer_follows_the_closed_form(w):
    """z = h sign(w)/sigma0 + (z0 - h sign(w)/sigma0) exp(-sigma0 |w| t/h) at every sample."""
    observer = sampled(lg.natural_observer(P), DT)
    z = step_response(observer, np.full((1, 60), w), [1e-3], 60)[1]
    end, a = np.sign(w) * h(w) / P.sigma0, P.sigma0 * abs(w) / h(w)
    assert z == pytest.approx(end + (1e-3 - end) * np.exp(-a * DT * np.arange(60)), abs=1e-12)


@pytest.mark.parametrize("w", [0.0, 0.05, 3.0, 100.0])
def test_proposed_observer_is_exact_with_held_torque(w):
    """Against the continuous observer, u held and different in every step."""
    t = DT * np.arange(40)
    u = np.random.default_rng(2).normal(size=40)
    rows = np.array([np.full(40, w), u])
    exact = simulate(lg.proposed_observer(P), t, rows, [1e-3, w + 0.1], hold=True, rtol=1e-10)
    found = step_response(sampled(lg.proposed_observer(P), DT), rows, [1e-3, w + 0.1], 40)
    np.testing.assert_allclose(found, exact.outputs, rtol=2e-6, atol=2e-7)


# A speed that changes.


@settings(max_examples=25)
@given(
    st.lists(st.floats(-1.0, 1.0), min_size=5, max_size=30),
    st.sampled_from([1e-3, 0.02, 1.0, 30.0, 1e3]),
    st.sampled_from([1e-5, 1e-3, 0.1]),
)
def test_bristles_stay_within_their_bound(shares, top, dt):
    observer, w = sampled(lg.natural_observer(P), dt), top * np.array(shares)
    z = step_response(observer, w[None], [0.0], len(w))[1]
    assert np.abs(z).max() <= P.Fs / P.sigma0 * (1 + 1e-9)


# The block.


def test_the_first_sample_takes_the_states_as_they_are():
    observer = lg.proposed_observer(P)
    first = sampled(observer, DT).output(0.0, [1e-3, 0.2, 0, 0, 0], [0.4, 0.1])
    assert first == pytest.approx(observer.output(0.0, [1e-3, 0.2], [0.4, 0.1]), rel=1e-14)


def test_sampled_pi_integrates_by_trapezoids():
    e = np.array([0.0, 1.0, 3.0, -2.0])
    u = step_response(sampled(lg.pi(0.0, 1.0), 0.1), e[None], [0.0], 4)[0]
    assert u == pytest.approx(-0.1 * np.array([0.0, 0.5, 2.5, 3.0]))


def test_held_inputs_can_be_named():
    e = np.array([[0.0, 1.0, 3.0, -2.0]])
    u = step_response(sampled(lg.pi(0.0, 1.0), 0.1, held=["e"]), e, [0.0], 4)[0]
    assert u == pytest.approx(-0.1 * np.array([0.0, 0.0, 1.0, 4.0]))


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: sampled(lg.pi(), DT, substep=0.0), "substep"),
        (lambda: sampled(lg.pi(), DT, substep=1e-12), "substep = 1e-12 s is less than"),
        (lambda: sampled(lg.natural_observer(P), 0.0), "sample time"),
        (lambda: sampled(lg.natural_observer(P), float("nan")), "sample time"),
        (lambda: sampled(sampled(lg.pi(), DT), DT), "discrete already"),
        (lambda: sampled(lg.compensation(), DT), "no states"),
        (lambda: sampled(lg.pi(), DT, held=["u"]), "no input u"),
    ],
)
def test_what_cannot_be_sampled_is_said(call, said):
    with pytest.raises(lg.InputError, match=said):
        call()


# Every observer and controller at a sample rate, exact or in substeps.


LOW = believing(0.8)
MOTION = ("theta", "w", "e", "s", "r", "dr", "ddr", "ar")


def motion(t):
    """A turn to and fro at 1 rad/s, and errors that change slowly, in the order of MOTION."""
    w, a = np.sin(2 * np.pi * t), 2 * np.pi * np.cos(2 * np.pi * t)
    theta, e = (1 - np.cos(2 * np.pi * t)) / (2 * np.pi), 0.3 * np.sin(7 * t)
    return np.array([theta, w, e, e, theta, w, a, a])


def along(block, seconds=0.1):
    """The outputs in continuous time and at 1 kHz, along the motion; the torque is held."""
    t = DT * np.arange(round(seconds / DT) + 1)
    known = dict(zip(MOTION, motion(t), strict=True))
    F = simulate(lg.friction("lugre"), t, known["w"]).outputs
    known["u"] = F + P.J * known["ddr"]
    source = static(lambda t, x, u, p: motion(t), [], list(MOTION), "motion")
    held, rows = [k for k in ("u",) if k in block.input_labels], list(block.output_labels)
    wired = ct.interconnect(
        [source, block], inputs=held, outputs=rows, params={}, check_unused=False
    )
    x0 = np.zeros(block.nstates)
    options = {"hold": True, "rtol": 1e-8, "squeeze": False}
    exact = simulate(wired, t, known["u"] if held else None, x0, **options)
    given = np.array([known[k] for k in block.input_labels])
    found = step_response(sampled(block, DT), given, x0, len(t))
    return np.atleast_2d(found), np.atleast_2d(exact.outputs)


BLOCKS = {  # block, and its error at 1 kHz, relative to the largest value of each output
    "adaptive": (lambda: lg.adaptive_observer(LOW), 1e-5),
    "position LuGre": (lambda: lg.position_lugre_observer(LOW), 5e-4),
    "friction state": (lambda: lg.friction_state_observer(LOW), 5e-4),
    "repetitive": (lambda: lg.repetitive_control(P), 1e-5),
}


@pytest.mark.slow
@pytest.mark.parametrize(("make", "error"), BLOCKS.values(), ids=BLOCKS)
def test_a_block_at_1_khz_is_the_continuous_one(make, error):
    found, exact = along(make())
    size = np.maximum(np.abs(exact).max(axis=1, keepdims=True), 1e-3)
    assert np.abs(exact).max() > 0.01
    assert np.max(np.abs(found - exact) / size) < error

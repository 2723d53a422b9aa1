"""Any python-control system is taken where it has a meaning: transfer functions, discrete systems,
measured responses, friction laws in a describing function."""

from __future__ import annotations

import pickle

import control as ct
import numpy as np
import pytest

import lugrectl as lg

T = np.linspace(0, 1, 101)
LAG = ct.tf([2], [0.5, 1])


def measured(system, low=-2, high=3, points=400):
    return ct.frd(system, np.logspace(low, high, points))


@pytest.mark.parametrize(
    "system",
    [LAG, ct.ss(LAG), ct.zpk([], [-2.0], 4.0), ct.tf([2], [0.5, 1], name="lag")],
    ids=["tf", "ss", "zpk", "named"],
)
def test_a_linear_system_is_simulated_and_sampled(system):
    right = 2 * (1 - np.exp(-2 * T))
    assert lg.simulate(system, T, 1.0).outputs == pytest.approx(right, abs=1e-5)
    sampled = lg.simulate(lg.sampled(system, T[1]), T, 1.0).outputs
    assert sampled == pytest.approx(right, abs=1e-9)


@pytest.mark.parametrize("dt", [0.01, True])
def test_a_discrete_system_is_simulated_as_it_is(dt):
    system = ct.tf([1], [1, -0.5], dt)
    t = np.arange(6) * (1.0 if dt is True else dt)
    right = ct.forced_response(system, t, 1 + 0 * t).outputs
    assert lg.simulate(system, t, 1.0).outputs == pytest.approx(right)


def test_a_measured_response_cannot_be_simulated():
    with pytest.raises(lg.InputError, match="frequency response, which has no states"):
        lg.simulate(measured(LAG), T, 1.0)


@pytest.mark.parametrize(
    "system", [LAG, ct.tf([1, 9], [1, 2, 9]), ct.tf([100], [1, 2, 100])], ids=str
)
def test_the_bandwidth_of_a_measured_response_is_that_of_its_system(system):
    assert lg.bandwidth(measured(system)) == pytest.approx(lg.bandwidth(system), rel=2e-3)
    found, right = (lg.bandwidth_check(T) for T in (measured(system), system))
    assert found.crossings == pytest.approx(right.crossings, rel=2e-3)
    assert "400 measured frequencies from 0.01 to 1000 rad/s" in found.reason
    assert found


def test_realness_of_a_measured_response_holds_for_its_frequencies():
    system = ct.tf([1, 10], [1, 2, 0.5])  # Re T < 0 above some frequency
    right = lg.spr_check(system)
    assert not right
    below = lg.spr_check(measured(system, -2, np.log10(0.9 * right.band_edge)))
    assert below and below.classification == "SPR"
    assert "outside them" in below.reason and "measured frequencies" in below.reason
    across = lg.spr_check(measured(system))
    assert not across and across.classification == "not PR"
    assert across.band_edge == pytest.approx(right.band_edge, rel=2e-2)
    assert "Re T(jw) < 0 for" in across.reason


@pytest.mark.parametrize("check", [lg.spr_check, lg.l2_check, lg.bandwidth_check])
@pytest.mark.parametrize(
    "response, words",
    [
        (lambda: ct.frd([[[1, 1]], [[1, 1]]], [1.0, 2.0]), "2 outputs"),
        (lambda: ct.frd([1.0], [1.0]), "1 frequencies; at least 2"),
        (lambda: ct.frd([1.0, np.nan], [1.0, 2.0]), "finite"),
    ],
)
def test_a_response_that_cannot_be_judged_is_one_sentence(check, response, words):
    with pytest.raises(lg.InputError, match=words):
        check(response())


LAWS = [law.name for law in lg.laws()]


@pytest.mark.parametrize("name", LAWS)
def test_every_law_without_states_has_a_describing_function(name):
    law = lg.friction(name)
    for one in (law, pickle.loads(pickle.dumps(law)), law.copy(name="other")):
        if law.nstates:
            with pytest.raises(TypeError, match="only supported for static"):
                ct.describing_function(one, [0.5, 1.0])
        else:
            found = ct.describing_function(one, [0.5, 1.0], num_points=200)
            angle = np.linspace(0, 2 * np.pi, 200, endpoint=False)
            wanted = [
                np.mean([float(np.squeeze(law(a * x))) * 2 * x / a for x in np.sin(angle)])
                for a in (0.5, 1.0)
            ]
            assert found == pytest.approx(np.array(wanted), rel=1e-9)

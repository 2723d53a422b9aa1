"""Models of many states: the verdicts of exact arithmetic, in any coordinates, in little time."""

from __future__ import annotations

import re
import time

import control as ct
import numpy as np
import pytest

import lugrectl as lg
from lugrectl.linear.system import Signs, realness
from lugrectl.linear.systems import ExactSystem

from ..cases.structures import structure


@pytest.mark.parametrize("turned", [False, True])
def test_the_verdict_on_many_states_is_that_of_exact_arithmetic(turned):
    T = structure(4, turned=turned)
    found, exact = lg.spr_check(T), realness(ExactSystem.of(structure(4)))
    assert found.classification == exact.kind == "SPR"
    assert found.margin == pytest.approx(exact.margin, rel=1e-5)
    assert "floating point" in found.reason


@pytest.mark.parametrize("modes", [3, 10])
@pytest.mark.parametrize("seed", [0, 1])
def test_other_coordinates_are_no_other_verdict(modes, seed):
    """Without feedthrough T(0) = 0: PR, and never "not PR" by rounding."""
    kinds = [
        lg.spr_check(structure(modes, 0.0, turned=turned, seed=seed)).classification
        for turned in (False, True)
    ]
    assert kinds == ["PR", "PR"]
    with_more = [structure(modes, 0.01, turned=turned, seed=seed) for turned in (False, True)]
    found = [lg.spr_check(T) for T in with_more]
    assert [one.classification for one in found] == ["SPR", "SPR"]
    assert found[0].margin == pytest.approx(found[1].margin, rel=1e-4)


@pytest.mark.parametrize("turned", [False, True])
def test_a_negative_real_part_is_found_with_its_band(turned):
    T = structure(5, -0.005, turned=turned)
    found = lg.spr_check(T)
    assert (found.classification, found.band_edge) == ("not PR", 0.0)
    low, high = 0.0, float(re.findall(r"[\d.]+", found.reason.split(" < w < ")[1])[0])
    assert T(1j * 0.99 * high).real < 0 < T(1j * 1.01 * high).real and low == 0.0


@pytest.mark.parametrize("modes", [4, 15])
def test_the_bandwidth_of_many_states_is_that_of_python_control(modes):
    T = structure(modes, 0.0, displacement=True)
    assert lg.bandwidth(T) == pytest.approx(ct.bandwidth(T), rel=1e-9)
    small = structure(3, 0.0, displacement=True)
    pair = small.A, small.B, small.C, small.D
    wide = ct.ss(*pair)
    exact = lg.bandwidth_check(wide).crossings  # 6 states: exact
    grown = ct.append(wide, ct.ss([[-7.0]], [[1.0]], [[1.0]], [[0.0]]))
    hidden = ct.ss(grown.A, grown.B[:, :1], grown.C[:1], grown.D[:1, :1])
    assert lg.bandwidth_check(hidden).crossings == pytest.approx(exact, rel=1e-9)


def test_time_grows_no_faster_than_the_third_power():
    T = structure(15)
    begin = time.process_time()
    assert lg.spr_check(T)
    assert lg.bandwidth(structure(15, 0.0, displacement=True)) > 0
    assert lg.bandwidth_check(structure(15)).bandwidth > 0
    unstable = structure(8, 0.0, displacement=True)
    unstable.A[1, 1] = 0.02
    assert not lg.bandwidth_check(unstable)
    assert time.process_time() - begin < 10.0  # it took 256 s


def test_an_unstable_mode_that_cancels_is_named_at_any_order():
    T = structure(4, turned=False)
    A = np.zeros((9, 9))
    A[:8, :8], A[8, 8] = T.A, 0.5
    B, C = np.vstack([T.B, [[0.0]]]), np.hstack([T.C, [[1.0]]])
    found = lg.spr_check(ct.ss(A, B, C, T.D))
    assert found and "s = +0.5 1/s" in found.reason


def port_hamiltonian(seed: int) -> ct.StateSpace:
    """7 to 9 states with a disturbed output; every other one in units that differ by 1e6."""
    random = np.random.default_rng(seed)
    n = int(random.integers(7, 10))
    S, R = random.normal(size=(2, n, n))
    A, B = S - S.T - 0.1 * R @ R.T, random.normal(size=(n, 1))
    C = B.T * (1 + 1.2 * random.normal(size=(1, n)))
    units = 10 ** random.uniform(-3, 3, n) if seed % 2 else np.ones(n)
    D = random.choice([0.0, 0.02, 0.3])
    return ct.ss(A * np.outer(units, 1 / units), B * units[:, None], C / units, D)


@pytest.mark.parametrize("seed", [0, 1])
def test_edges_and_bandwidths_are_those_of_exact_arithmetic(seed):
    T = port_hamiltonian(seed)
    found, width, system = lg.spr_check(T), lg.bandwidth_check(T), ExactSystem.of(T)
    exact = realness(system)
    assert found.classification == exact.kind
    assert found.band_edge == pytest.approx(exact.edge, rel=1e-6)
    exact = lg.bandwidth_check([p[::-1] for p in system.ratio])
    assert width.crossings == pytest.approx(exact.crossings, rel=1e-6)


@pytest.mark.parametrize("seed", [0])
def test_edges_of_sampled_models_are_those_of_exact_arithmetic(seed):
    T = ct.sample_system(port_hamiltonian(seed), 0.2, "bilinear")
    found, exact = lg.spr_check(T), realness(ExactSystem.of(T))
    assert found.classification == exact.kind
    assert found.band_edge == pytest.approx(exact.edge, rel=1e-6)


def test_an_edge_that_rounding_blurs_is_a_range():
    """x (x - 1) with a rounding of 1e-4 crosses 0 somewhere near 1, surely not far from it."""
    made = Signs.of(lambda x: (x * (x - 1), 1e-4), [0.0, 0.5, 1.0, 2.0])
    (edge,) = made.edges
    assert edge.at == pytest.approx(1.0) and not edge.sharp
    assert 0.9995 < edge.low < 1 - 1e-4 < 1 + 1e-4 < edge.high < 1.0005
    assert edge.first == edge.low and f"between {edge.low:.9g} and" in str(edge)

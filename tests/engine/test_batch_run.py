"""Many runs side by side, against SciPy, closed forms and plain loops; the cache of their code."""

from __future__ import annotations

import warnings

import control as ct
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import lugrectl as lg
from lugrectl.core.errors import InputError
from lugrectl.engine import Lanes

from ..cases.own import moving
from ..cases.systems import DT, full_model, torque


def runs(system, backend: str, count: int = 3, samples: int = 100, **options):
    lanes = Lanes(system, backend=backend)
    random = np.random.default_rng(5)
    p = lanes.defaults * random.uniform(0.9, 1.1, (count, len(lanes.defaults)))
    x0 = 1e-3 * random.standard_normal((count, len(lanes.states)))
    u = torque(samples)[:, : len(lanes.inputs)]
    start = np.arange(count) * 10
    return lanes.run(x0, start, samples - 10 * count, u, p, dt=DT, **options)


@pytest.mark.parametrize("backend", ["c", "numba"], indirect=True)
def test_all_backends_give_the_same_numbers(backend: str) -> None:
    make = lag_block if backend == "numba" else lambda: lg.plant(full_model())
    compiled, plain = runs(make(), backend), runs(make(), "python")
    for a, b in zip(compiled, plain, strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-10, atol=1e-12)


def held_radau(system, u: np.ndarray, x0: np.ndarray) -> np.ndarray:
    """States at the samples, integrated interval by interval."""
    system._update_params(None)
    states = [np.asarray(x0, dtype=float)]
    for k, held in enumerate(u[:-1]):
        part = solve_ivp(
            lambda t, x, held=held: system._rhs(t, x, held),
            (k * DT, (k + 1) * DT),
            states[-1],
            method="Radau",
            rtol=1e-7,
            atol=1e-12,
        )
        states.append(part.y[:, -1])
    return np.array(states)


STIFF = lg.Parameters(J=1.0, sigma0=1e5, sigma1=316.0, Fc=1.0, Fs=1.5, Fv=0.4, vs=1e-3)


def test_stiff_lanes_against_radau() -> None:
    plant, u = lg.plant(STIFF), torque(60, 3.0)
    lanes = Lanes(plant, outputs=["theta", "w"])
    y, _ = lanes.run(np.zeros((1, 3)), [0], 60, u, lanes.defaults[None], dt=DT)
    exact = held_radau(plant, u, np.zeros(3))[:, :2]
    assert np.max(np.abs(y[0] - exact) / np.max(np.abs(exact), axis=0)) < 2e-5


def lag_block() -> ct.NonlinearIOSystem:
    """dx/dt = a (u - x): a step of length h is x + (1 - e^(-a h)) (u - x)."""
    return moving(lambda t, x, u, p: p["a"] * (u[0] - x[0]), "x", "lag", a=40.0)


def test_correction_is_made_before_the_interval(backend: str) -> None:
    """A plain loop with the closed form of each interval; nan leaves the state alone."""
    random = np.random.default_rng(2)
    u, y = random.standard_normal((30, 1)), random.standard_normal((30, 1))
    y[7:9] = np.nan
    lanes = Lanes(lag_block(), backend=backend)
    rates, starts, gain = np.array([40.0, 90.0]), [0, 5], np.array([[[0.2]], [[0.5]]])
    got, end = lanes.run(
        np.ones((2, 1)), starts, 20, u, rates[:, None], dt=DT, y=y, gain=gain, substeps=4
    )
    for lane in range(2):
        x = 1.0
        for j in range(20):
            k = starts[lane] + j
            assert got[lane, j, 0] == pytest.approx(x, abs=1e-8)
            x += 0.0 if np.isnan(y[k, 0]) else gain[lane, 0, 0] * (y[k, 0] - x)
            x += (1 - np.exp(-rates[lane] * DT)) * (u[k, 0] - x)
        assert end[lane, 0] == pytest.approx(x, abs=1e-8)


def test_each_lane_has_its_own_inputs(backend: str) -> None:
    u = np.random.default_rng(4).standard_normal((2, 10, 1))
    lanes = Lanes(lag_block(), backend=backend)
    p = np.full((2, 1), 40.0)
    got, _ = lanes.run(np.zeros((2, 1)), [0, 3], 7, u, p, dt=DT, series=[1, 0])
    for lane, (own, start) in enumerate([(1, 0), (0, 3)]):
        x = 0.0
        for j in range(7):
            assert got[lane, j, 0] == pytest.approx(x, abs=1e-9)
            x += (1 - np.exp(-40.0 * DT)) * (u[own, start + j, 0] - x)


def test_a_step_in_time_counts_by_its_share(backend: str) -> None:
    """dx/dt = 1 from t0 on: the integral is exact for any t0 in the step."""
    block = moving(
        lambda t, x, u, p: np.where(t >= p["t0"], 1.0, 0.0) + 0.0 * x[0], "x", "late", 0, t0=0.0
    )
    lanes = Lanes(block, backend=backend)
    late = np.array([0.0, 0.0031, 0.00425, 0.005, 1.0])
    _, end = lanes.run(np.zeros((5, 1)), 0, 10, np.zeros((10, 0)), late[:, None], dt=DT)
    np.testing.assert_allclose(end[:, 0], np.maximum(0.01 - late, 0.0), atol=1e-15)


def test_one_lane_that_blows_up_leaves_the_others_alone(backend: str) -> None:
    block = moving(lambda t, x, u, p: p["a"] * x[0] ** 3 + u[0], "x", "cubic", a=-1.0)
    lanes = Lanes(block, backend=backend)
    p = np.array([[-1.0], [1e6], [-1.0]])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        y, end = lanes.run(np.ones((3, 1)), 0, 50, np.zeros((50, 1)), p, dt=DT)
    assert not np.isfinite(end[1, 0])
    np.testing.assert_allclose(
        y[[0, 2], :, 0], (1 / np.sqrt(1 + 2 * DT * np.arange(50)),) * 2, rtol=1e-6
    )


def test_wrong_shapes_are_said() -> None:
    lanes = Lanes(lg.plant(lg.table1()), backend="python")
    p, u = lanes.defaults[None], np.zeros((10, 2))
    for x0, given in ((np.zeros((1, 2)), u), (np.zeros((1, 3)), u[:, :1])):
        with pytest.raises(InputError, match="a column for each state, parameter and input"):
            lanes.run(x0, 0, 5, given, p, dt=DT)
    for start, series in ((6, 0), (0, 1)):
        with pytest.raises(InputError, match="leaves the record"):
            lanes.run(np.zeros((1, 3)), start, 5, u, p, dt=DT, series=series)
    with pytest.raises(InputError, match="y needs the samples of u"):
        lanes.run(np.zeros((1, 3)), 0, 5, u, p, dt=DT, y=np.zeros((4, 3)), gain=np.zeros((3, 3)))
    with pytest.raises(InputError, match="no output 'q'"):
        Lanes(lg.plant(lg.table1()), outputs=["q"])

"""Derivatives of runs from the graph, against closed forms and differences of accurate runs."""

from __future__ import annotations

import control as ct
import numpy as np
import pytest

from lugrectl.blocks.model import model_from_dict
from lugrectl.blocks.plant import assemble
from lugrectl.core.errors import InputError
from lugrectl.engine.runtime.batch_run import Lanes
from lugrectl.engine.runtime.sensitivity_run import Tangent

DT = 1e-3
LAWS = {"coulomb": {}, "stribeck": {"Fs": 0.335, "vs": 0.01}}
LAWS["lugre"] = LAWS["stribeck"] | {"sigma0": 260.0, "sigma1": 0.6}
MASS = ("elastic_coupling", {"load_inertia": 0.002, "stiffness": 20.0, "damping": 0.02})
LIMITED = [
    ("actuator_saturation", {"limit": 0.55}),
    ("input_delay", {"delay": 0.003}),
    ("actuator_lag", {"time_constant": 0.002}),
]
CASES = {
    "lugre": ("lugre", []),
    "stribeck": ("stribeck", []),
    "coulomb": ("coulomb", []),
    "two masses": ("lugre", [MASS]),
    "actuator": ("stribeck", LIMITED),
}


def lag(backend: str | None, rate: float = 40.0) -> Lanes:
    """dx/dt = a (u - x): a step of length h is x + (1 - e^(-a h)) (u - x)."""
    block = ct.nlsys(
        lambda t, x, u, p: p["a"] * (u[0] - x[0]),
        None,
        inputs="u",
        outputs="x",
        states="x",
        params={"a": rate},
        name="lag",
    )
    return Lanes(block, backend=backend)


@pytest.mark.parametrize(("rate", "close"), [(40.0, 1e-6), (12790.0, 2e-2)])
def test_lag_has_its_closed_form(backend: str, rate: float, close: float) -> None:
    """Correction, missing samples, start and input that depend on a column; slow and stiff."""
    random = np.random.default_rng(2)
    u, y, push = random.standard_normal((3, 40, 1))
    y[7:9] = np.nan
    columns = ["a", "start", "push"]
    lanes = lag(backend, rate)
    dx0 = np.zeros((2, 1, 3))
    dx0[:, 0, 1] = 1.0
    made = Tangent(lanes).run(
        np.ones((2, 1)),
        [0, 5],
        30,
        u,
        np.full((2, 1), rate),
        columns,
        dt=DT,
        y=y,
        gain=np.array([[0.2]]),
        dx0=dx0,
        du={("u", "push"): push.T},
    )
    decay, slow = np.exp(-rate * DT), rate < 100.0
    for lane, start in enumerate([0, 5]):
        x, S = 1.0, np.array([0.0, 1.0, 0.0])
        truth = []
        for k in range(start, start + 30):
            truth.append(S)
            if np.isfinite(y[k, 0]):
                x, S = x + 0.2 * (y[k, 0] - x), 0.8 * S
            S = decay * S + [DT * decay * (u[k, 0] - x), 0.0, (1.0 - decay) * push[k, 0]]
            x = decay * x + (1.0 - decay) * u[k, 0]
        error = np.max(np.abs(made.dy[lane, :, 0] - truth), axis=0)
        # B is held over a substep h: then (1 - e^-z)^2 / z^2 stands for e^-z, z = a h
        largest = np.max(np.abs(np.array(truth)[:, 0]))
        assert error[0] < (1.02 * (rate * DT / 2) ** 2 / 12 * largest if slow else 1e-2 * DT)
        assert np.max(error[1:]) < close
        np.testing.assert_allclose(made.dx[lane, 0, 1:], S[1:], atol=close)


def test_derivative_by_the_instant_of_a_step(backend: str) -> None:
    block = ct.nlsys(
        lambda t, x, u, p: np.where(t >= p["t0"], 1.0, 0.0) + 0.0 * x[0],
        None,
        inputs="u",
        outputs="x",
        states="x",
        params={"t0": 0.0},
        name="ramp",
    )
    made = Tangent(Lanes(block, backend=backend)).run(
        np.zeros((1, 1)), [0], 20, np.zeros((20, 1)), np.array([[0.00437]]), dt=DT
    )
    assert made.dx[0, 0, 0] == pytest.approx(-1.0, abs=1e-9)


class Rig:
    """A drive, its disturbed record in windows, and what a run of them needs."""

    def __init__(self, name: str, dt: float, corrected: bool, backend: str | None = None) -> None:
        law, effects = CASES[name]
        friction = {"model": law, "Fc": 0.285, "Fv": 0.018} | LAWS[law]
        model = model_from_dict({"plant": {"J": 0.0022}, "friction": friction}, "test")
        for effect, values in effects:
            model = model.with_effect(effect, values)
        plant = assemble(model, sensed=True)
        system = plant.system(**model.known())  # pyright: ignore[reportArgumentType]
        self.lanes = Lanes(system, outputs=["theta_m", "w_m"], backend=backend)
        self.length, self.dt = int(1.0 / dt), dt
        self.u, t = np.zeros((3 * self.length, 2)), np.arange(3 * self.length) * dt
        self.u[:, 0] = np.sin(5.6 * t) + 0.4 * np.sin(19.5 * t + 1.0) + 0.2 * np.sin(52.0 * t)
        self.u[:, 0] *= np.sin(1.4 * t) > -0.6  # it comes to rest
        self.start, self.p = self.length * np.arange(3), np.tile(self.lanes.defaults, (3, 1))
        random = np.random.default_rng(1)
        other = self.lanes.defaults * (1.0 + 0.05 * random.standard_normal(self.p.shape[1]))
        y, _ = self.lanes.run([[0.0] * len(plant.states)], [0], len(t), self.u, [other], dt=dt)
        self.x0 = np.array([self.reached(k, other, len(plant.states)) for k in self.start])
        self.options: dict = {"substeps": max(1, round(dt / 2e-3))}
        if corrected:
            noise = random.standard_normal((len(t), 2)) * [1e-5, 1e-2]
            gain = np.zeros((len(plant.states), 2))
            gain[:2] = [[0.3, 0.0], [0.02 / dt, 0.15]]
            self.options |= {"y": y[0, :, :2] + noise, "gain": gain}
        self.columns = [k for k in self.lanes.parameters if not k.endswith("eps")]

    def reached(self, k: int, p: np.ndarray, states: int) -> np.ndarray:
        """The states at sample k of a run from rest."""
        return self.lanes.run([[0.0] * states], [0], int(k), self.u, [p], dt=self.dt)[1][0]

    def slopes(self, **options) -> np.ndarray:
        tangent = Tangent(self.lanes)
        run = (self.x0, self.start, self.length, self.u, self.p, self.columns)
        return tangent.run(*run, dt=self.dt, **self.options | options).dy

    def differences(self, part: float) -> np.ndarray:
        """Central, of runs with short steps and a tight tolerance."""
        own = [self.lanes.parameters.index(k) for k in self.columns]
        h = part * np.abs(self.lanes.defaults[own])
        p = np.repeat(self.lanes.defaults[None], 2 * len(h), axis=0)
        p[np.arange(len(h)), own] += h
        p[len(h) + np.arange(len(h)), own] -= h
        many, options = len(p), dict(self.options)
        options["substeps"] *= 8
        y, _ = self.lanes.run(
            np.tile(self.x0, (many, 1)),
            np.tile(self.start, many),
            self.length,
            self.u,
            np.repeat(p, 3, axis=0),
            dt=self.dt,
            rtol=1e-9,
            **options,
        )
        y = y[..., :2].reshape(2, len(h), 3, self.length, 2)
        return np.moveaxis(y[0] - y[1], 0, -1) / (2.0 * h)


def errors(made: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """RMS error of each output and column, relative to its largest derivative."""
    rms = np.sqrt(np.mean((made - truth) ** 2, axis=(0, 1)))
    return rms / np.max(np.abs(truth), axis=(0, 1))


def reliable(rig: Rig) -> tuple[np.ndarray, np.ndarray]:
    """Differences of two steps, and where these agree."""
    rough, fine = rig.differences(1e-4), rig.differences(2e-5)
    return fine, errors(rough, fine) < 2e-3


@pytest.mark.cases
@pytest.mark.parametrize("dt", [5e-3, 5e-4])
@pytest.mark.parametrize("name", CASES)
def test_corrected_runs_against_differences(name: str, dt: float) -> None:
    """At 200 Hz and 2 kHz, in stick and in slip."""
    pytest.importorskip("numba")
    rig = Rig(name, dt, corrected=True)
    truth, sure = reliable(rig)
    assert np.mean(sure) > 0.7
    assert np.max(errors(rig.slopes(rtol=1e-7), truth)[sure]) < 5e-3


@pytest.mark.parametrize("name", CASES)
def test_free_runs_against_differences(name: str) -> None:
    """What acts only within vs of rest (vs, Fs) as well."""
    pytest.importorskip("numba")
    rig = Rig(name, DT, corrected=False)
    truth, sure = reliable(rig)
    assert np.sum(sure) > 0.5 * sure.size
    assert np.max(errors(rig.slopes(rtol=1e-7), truth)[sure]) < 5e-3


@pytest.mark.parametrize("name", ["coulomb", "lugre"])
def test_coarse_steps_still_tell_the_direction(name: str) -> None:
    """At the tolerance of fits."""
    pytest.importorskip("numba")
    rig = Rig(name, 5e-3, corrected=True)
    truth, sure = reliable(rig)
    assert np.max(errors(rig.slopes(rtol=1e-5), truth)[sure]) < 0.1


@pytest.mark.parametrize(
    "name",
    ["stribeck", pytest.param("two masses", marks=[pytest.mark.slow, pytest.mark.sample])],
)
def test_both_backends_give_the_same_slopes(name: str) -> None:
    pytest.importorskip("numba")
    made = [Rig(name, 5e-3, corrected=True, backend=b).slopes() for b in ("numba", "numpy")]
    scale = np.max(np.abs(made[0]), axis=(0, 1))
    assert np.max(np.abs(made[0] - made[1]) / scale) < 1e-5


def test_the_run_is_that_of_the_lanes() -> None:
    rig = Rig("lugre", 2e-3, corrected=False, backend="numpy")
    run = (rig.x0, rig.start, 50, rig.u, rig.p)
    made = Tangent(rig.lanes).run(*run, ["plant.J"], dt=rig.dt, substeps=2, rtol=1e-9)
    y, x = rig.lanes.run(*run, dt=rig.dt, substeps=2, rtol=1e-9)
    np.testing.assert_allclose(made.y, y, atol=1e-12)
    np.testing.assert_allclose(made.x, x, atol=1e-12)


def test_unknown_inputs_are_named() -> None:
    tangent = Tangent(lag("numpy"))
    with pytest.raises(InputError, match="du names .'v', 'a'.; the inputs are u"):
        u = np.zeros((3, 1))
        tangent.run([[0.0]], [0], 3, u, [[40.0]], dt=DT, du={("v", "a"): u.T})


def test_a_lane_that_blows_up_says_nothing_about_the_others(backend: str) -> None:
    """dx/dt = a x^2 from 1: x = 1 / (1 - a t), dx/da = t x^2; from 1000 it is infinite at 1 ms."""
    block = ct.nlsys(
        lambda t, x, u, p: p["a"] * x[0] * np.abs(x[0]) + 0.0 * u[0],
        None,
        inputs="u",
        outputs="x",
        states="x",
        params={"a": 1.0},
        name="runaway",
    )
    tangent = Tangent(Lanes(block, backend=backend))
    made = tangent.run(
        np.array([[1.0], [1e3]]), [0, 0], 100, np.zeros((100, 1)), np.ones((2, 1)), dt=DT
    )
    assert made.dx[0, 0, 0] == pytest.approx(0.1 / 0.9**2, rel=1e-3)
    assert not np.isfinite(made.x[1, 0]) or abs(made.x[1, 0]) > 1e6

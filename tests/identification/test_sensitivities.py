"""How innovations change with the free values: the graph against differences of fine runs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from lugrectl.blocks.model import model_from_dict
from lugrectl.identification.dataset.dataset import prepare
from lugrectl.identification.dataset.run_effects import alike
from lugrectl.identification.dataset.windows import windows
from lugrectl.identification.likelihood import likelihood as own
from lugrectl.identification.likelihood import maximise as fitting
from lugrectl.identification.likelihood.likelihood import tune, whitened
from lugrectl.identification.likelihood.parameters import coordinates
from lugrectl.identification.likelihood.predictor import Predictor
from lugrectl.record import Record

COULOMB = {"model": "coulomb", "Fc": 0.3, "Fv": 0.02}
LUGRE = {
    "model": "lugre", "sigma0": 260.0, "sigma1": 0.6, "Fc": 0.285, "Fs": 0.335, "Fv": 0.018,
    "vs": 0.01,
}  # fmt: skip
GRAVITY = ("gravity", {"amplitude": 0.05, "phase": 0.3})
TURNED = ("torque_ripple", {"amplitude": 0.05, "harmonic": 3.0, "phase": np.pi - 1e-6})
MASS = ("elastic_coupling", {"load_inertia": 0.002, "stiffness": 20.0, "damping": 0.02})
DEAD = ("actuator_dead_zone", {"half_width": 0.005})
SLOW = ("velocity_sensor_lag", {"time_constant": 0.004})
CASES = {
    "lugre": ("rotary", LUGRE, []),
    "coulomb linear": ("linear", COULOMB, []),
    "effect inside": ("rotary", LUGRE, [TURNED, MASS]),
    "effect outside": ("rotary", LUGRE, [DEAD]),
    "runs that differ": ("rotary", LUGRE, [GRAVITY]),
    "sensor with a state": ("rotary", LUGRE, [SLOW]),
}


def rig(name: str):
    """A predictor on a record of a drive that it is a few per cent away from."""
    motion, friction, effects = CASES[name]
    tree = {"motion": motion, "plant": {"J": 0.0022}, "friction": friction}
    model = model_from_dict(tree, "test")
    for effect, values in effects:
        model = model.with_effect(effect, values)
    dt = 2e-3
    t = np.arange(3000) * dt
    u = 0.5 * np.sin(5.6 * t) + 0.3 * np.sin(19.5 * t + 1.0) + 0.2 * np.sin(52.0 * t)
    block = Predictor(model, prepare([Record(t=t, u=u, w=np.sin(5 * t), theta=-np.cos(5 * t),
                                             dt=dt, motion=motion)]))  # fmt: skip
    lanes, values = block.lanes, model.known()
    p = [[values[k] for k in block.keys]]
    series = np.column_stack([u, *[0.0 * u] * (len(lanes.inputs) - 1)])
    y, _ = lanes.run([[0.0] * len(lanes.states)], [0], len(t), series, p, dt=dt)
    noise = np.random.default_rng(4).standard_normal((2, len(t))) * [[1e-5], [1e-3]]
    theta, w = y[0].T + noise
    record = Record(t=t, u=u, w=w, theta=theta, dt=dt, motion=motion)
    data = prepare([record])
    if name == "runs that differ":
        data = prepare([record.slice(0, 1500), record.slice(1500, 3000)])
        data = replace(data, differing=(1,)).aligned({1: 0.2}, 1.0)
    predictor = Predictor(model, data)
    away = {k: v * 1.03 if "." not in k and k != "Fs" else v for k, v in values.items()}
    away |= alike(data)
    return predictor, away, windows([(0, 1500), (1500, 3000)], 100, 300)


def free(predictor: Predictor) -> list[str]:
    declared = predictor.declarations()
    return [k for k, p in declared.items() if p.fitted and k.split(".")[-1] != "harmonic"]


def resolved(predictor: Predictor) -> Predictor:
    """The same with runs of a tight tolerance: differences of others are noise."""
    fine = predictor.like(predictor.model)
    run = fine.lanes.run

    class Fine:
        def __getattr__(self, name):
            return getattr(predictor.lanes, name)

        def run(self, *given, **options):
            return run(*given, **options | {"rtol": 1e-9})

    fine.lanes = Fine()
    return fine


def compared(name: str) -> dict[str, float]:
    """RMS error of each coordinate's slope, relative."""
    predictor, values, where = rig(name)
    coords = coordinates(predictor, free(predictor), values)
    noise, _ = tune(predictor, values, where, predictor.data.noise)
    r, made = own.slopes(predictor, values, coords, where, noise)
    few = [replace(c, step=0.1 * c.step) for c in coords]
    sets = [values, *own.stepped(few, values)]
    white = whitened(resolved(predictor), sets, where, noise)
    truth = [(white[0] - w) / c.step for w, c in zip(white[1:], few, strict=True)]
    missed = [np.linalg.norm(a - b) / np.linalg.norm(b) for a, b in zip(made, truth, strict=True)]
    assert np.linalg.norm(r - white[0]) < 0.02 * np.linalg.norm(r)
    return dict(zip([c.key for c in coords], missed, strict=True))


@pytest.mark.parametrize("name", CASES)
def test_graph_and_differences_agree(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Tied, inside (a phase at half a turn), outside, of one run only, and on sensors."""
    pytest.importorskip("numba")
    monkeypatch.setattr(own, "RTOL", 1e-8)
    missed = compared(name)
    assert max(missed.values()) < 0.03, missed


def test_without_the_graph_all_is_differenced() -> None:
    predictor, values, where = rig("effect outside")
    coords = coordinates(predictor, ["J", "Fc", "Fs", "actuator_dead_zone.half_width"], values)
    noise = predictor.data.noise
    r, made = own.slopes(predictor, values, coords, where, noise, graph=False)
    white = whitened(predictor, [values, *own.stepped(coords, values)], where, noise)
    np.testing.assert_array_equal(r, white[0])
    for c, A, w in zip(coords, made, white[1:], strict=True):
        np.testing.assert_array_equal(A, (r - w) / c.step)


def test_a_value_held_by_its_bound_has_no_slope() -> None:
    pytest.importorskip("numba")
    predictor, values, where = rig("lugre")
    bound = replace(coordinates(predictor, ["Fv"], values)[0], high=values["Fv"])
    _, made = own.slopes(predictor, values, [bound], where, predictor.data.noise)
    assert not np.any(made)


@pytest.mark.parametrize("loud", [1.0, 30.0])
def test_the_jackknife_is_that_of_least_squares_without_each_window(loud):
    """One window tells most, and disagrees with the others."""
    rng = np.random.default_rng(3)
    A, r = rng.normal(size=(7, 40, 3)), rng.normal(size=(7, 40))
    A[2] *= loud
    r[2] += A[2] @ [0.3, -0.2, 0.1]

    def optimum(kept):
        return np.linalg.lstsq(A[kept].reshape(-1, 3), r[kept].ravel(), rcond=None)[0]

    every = np.arange(7)
    whole = optimum(every)
    left = r - A @ whole
    parts, scores = A.transpose(0, 2, 1) @ A, np.einsum("wnp,wn->wp", A, left)
    moved = np.array([optimum(every != i) - whole for i in every])
    assert fitting.jackknife(parts, scores) == pytest.approx(6 / 7 * np.sum(moved**2, axis=0))


@pytest.mark.parametrize("size", [1e-12, 1e-3, 1.0])
@pytest.mark.parametrize("others", [0.0, 1e-20, 1e-9])
def test_what_one_window_tells_alone_is_unsure_and_leaves_the_rest_as_it_was(size, others):
    """Two values, of which it tells one combination; the other windows next to nothing."""
    rng = np.random.default_rng(4)
    A, r = rng.normal(size=(7, 40, 5)), rng.normal(size=(7, 40))
    A[..., 4] = A[..., 3] * (1.0 + 1e-9 * A[..., 4])
    A[..., 3:] *= size * np.where(np.arange(7) == 2, 1.0, others)[:, None, None]
    parts, scores = A.transpose(0, 2, 1) @ A, np.einsum("wnp,wn->wp", A, r)
    whole = fitting.jackknife(parts, scores)
    few = fitting.jackknife(parts[:, :3, :3], scores[:, :3])
    assert np.all(whole[3:] > 1e50)
    assert np.all((0.2 * few < whole[:3]) & (whole[:3] < 5.0 * few))
    believed = np.diag([0.0, 0.0, 0.0, 4.0, 4.0])
    assert np.all(fitting.jackknife(parts, scores, believed)[3:] < 1e4)

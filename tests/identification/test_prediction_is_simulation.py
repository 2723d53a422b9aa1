"""A prediction with the true values is the exact motion: stops and reversals within a sample.

The exact motion comes from an integration of its own: small steps of Runge and Kutta's method, with
each stop found by bisection.
"""

from __future__ import annotations

from dataclasses import replace
from math import copysign, exp

import numpy as np
import pytest

import lugrectl as lg
from lugrectl.blocks.model import model_from_dict
from lugrectl.blocks.plant import assemble
from lugrectl.engine.runtime.batch_run import Lanes
from lugrectl.engine.runtime.sensitivity_run import Tangent
from lugrectl.identification.dataset.dataset import prepare
from lugrectl.identification.dataset.windows import Windows
from lugrectl.identification.likelihood.likelihood import tune
from lugrectl.identification.likelihood.predictor import Predictor
from lugrectl.identification.likelihood.simulation_error import restarted
from lugrectl.record import Record

LAWS = {
    "coulomb": {"J": 0.004, "Fc": 0.12, "Fv": 0.006},
    "stribeck": {"J": 0.004, "Fc": 0.12, "Fs": 0.17, "vs": 0.3, "Fv": 0.006},
    "lugre": {
        "J": 0.0022, "sigma0": 260.0, "sigma1": 0.6, "Fc": 0.285, "Fs": 0.335, "vs": 0.01,
        "Fv": 0.018,
    },
}  # fmt: skip
SECONDS = 1.6


def pulses(t):
    """Push, brake, rest; once forward, once back."""
    way, at = np.where((t // 0.4) % 2 == 0, 1.0, -1.0), t % 0.4
    return 3.3 * way * np.select([at < 0.1, at < 0.2], [1.0, -1.0], 0.0)


def levels(t, values, each):
    return np.array(values)[(t // each).astype(int) % len(values)]


SHAPES = {
    "pulses": pulses,
    "steps with zeros": lambda t: levels(t, [2.5, 0, -2.5, 0, 1.7, 0, -1.7, 0], 0.2),
    "coast-down": lambda t: np.where(t < 0.4, 4.0, 0.0),
    "slow scan": lambda t: 1.6 * np.sin(2.0 * np.pi * 0.7 * t),
    "staircase": lambda t: levels(t, [0.6, 1.2, 1.8, 1.2, 0.6, 0, -0.6, -1.2, -1.8, -1.2], 0.1),
    "ramps": lambda t: 2.2 * (2.0 * np.abs(2.0 * ((1.3 * t + 0.25) % 1.0) - 1.0) - 1.0),
    "sine": lambda t: 2.5 * np.sin(2.0 * np.pi * 3.0 * t),
    "chirp": lambda t: 3.0 * np.sin(2.0 * np.pi * (t + 4.0 * t * t)),
}


def drive(law, u, dt):
    """theta, w at the samples of a drive at rest at first, with u held between samples."""
    p = LAWS[law]
    rates, advance, fine = (
        (_bristles, _runge_kutta, 5e-5) if law == "lugre" else (_dry, _stop, 2e-4)
    )
    n, state, out = max(1, round(dt / fine)), (0.0, 0.0, 0.0), []
    for torque in u.tolist():
        out.append(state[:2])
        for _ in range(n):
            state = advance(rates, p, torque, state, dt / n)
    return np.array(out)


def _level(p, w):
    return p["Fc"] + (p.get("Fs", p["Fc"]) - p["Fc"]) * exp(-((w / p.get("vs", 1.0)) ** 2))


def _bristles(p, torque, w, z, way):
    dz = w - p["sigma0"] * abs(w) / _level(p, w) * z
    return (torque - p["sigma0"] * z - p["sigma1"] * dz - p["Fv"] * w) / p["J"], dz


def _dry(p, torque, w, z, way):
    return (torque - way * _level(p, w) - p["Fv"] * w) / p["J"], 0.0


def _runge_kutta(rates, p, torque, state, h, way=0.0):
    x, w, z = state
    a1, b1 = rates(p, torque, w, z, way)
    w2 = w + 0.5 * h * a1
    a2, b2 = rates(p, torque, w2, z + 0.5 * h * b1, way)
    w3 = w + 0.5 * h * a2
    a3, b3 = rates(p, torque, w3, z + 0.5 * h * b2, way)
    w4 = w + h * a3
    a4, b4 = rates(p, torque, w4, z + h * b3, way)
    x, w = x + h / 6.0 * (w + 2.0 * (w2 + w3) + w4), w + h / 6.0 * (a1 + 2.0 * (a2 + a3) + a4)
    return x, w, z + h / 6.0 * (b1 + 2.0 * (b2 + b3) + b4)


def _stop(rates, p, torque, state, h):
    """A step of dry friction: to its end, or to a stop, where it reverses or stays."""
    while h > 0.0 and (state[1] or abs(torque) > _level(p, 0.0)):
        way = copysign(1.0, state[1] or torque)
        end = _runge_kutta(rates, p, torque, state, h, way)
        if end[1] * way >= 0.0:
            return end
        low, high = 0.0, h
        for _ in range(50):
            middle = 0.5 * (low + high)
            moves = _runge_kutta(rates, p, torque, state, middle, way)[1] * way > 0.0
            low, high = (middle, high) if moves else (low, middle)
        state = (_runge_kutta(rates, p, torque, state, low, way)[0], 0.0, 0.0)
        h -= low
    return state


def model_of(law, **more):
    values = {**LAWS[law], **more}
    plant = {"J": values.pop("J")}
    tree = {"name": "drive", "plant": plant, "friction": {"model": law, **values}}
    return model_from_dict(tree, "here")


def predictor_on(model, t, u, motion):
    """The predictor on a log of this motion with a little noise, which the data's filters need."""
    noise = np.random.default_rng(0).normal(size=motion.shape) * [1e-6, 1e-5]
    theta, w = (motion + noise).T
    return Predictor(model, prepare([Record(t=t, u=u, theta=theta, w=w)]))


def exact(law, shape, rate):
    t = np.arange(round(SECONDS * rate)) / rate
    u = SHAPES[shape](t) * LAWS[law].get("Fs", LAWS[law]["Fc"])
    return t, u, drive(law, u, 1.0 / rate)


_ENGINES = {}


def simulated(law, t, u, motion):
    """The prediction from rest, without correction by the log."""
    block = predictor_on(model_of(law), t, u, motion)
    block.lanes = _ENGINES.setdefault(law, block.lanes)
    rest = np.zeros((1, len(block.lanes.states)))
    whole = Windows(np.array([0]), 0, len(t))
    y, _ = block.run([block.model.known()], whole, block.data.noise, corrected=False, x0=rest)
    return y[0, 0]


@pytest.mark.cases
@pytest.mark.parametrize("rate", [100, 500, 1000])
@pytest.mark.parametrize("law", LAWS)
def test_the_prediction_with_true_values_is_the_exact_motion(law, rate):
    for shape in SHAPES:
        t, u, motion = exact(law, shape, rate)
        error = np.abs(simulated(law, t, u, motion) - motion).max(axis=0)
        assert error[0] < 1e-5, f"{shape}: theta is off by {error[0]:.2g} rad"
        assert error[1] < 3e-4, f"{shape}: w is off by {error[1]:.2g} rad/s"


@pytest.mark.parametrize("law", LAWS)
def test_the_prediction_is_what_simulate_returns(law):
    t, u, motion = exact(law, "pulses", 500)
    result = lg.simulate(lg.plant(model_of(law)), t, [u, 0.0 * u], hold=True)
    own = np.asarray(result.states)[:2].T
    error = np.abs(simulated(law, t, u, motion) - own).max(axis=0)
    assert error[0] < 1e-4 and error[1] < 5e-4  # simulate creeps at up to 1e-4 rad/s where it rests


def test_the_error_of_the_true_model_after_sharp_reversals_is_the_encoders_rounding():
    t = np.arange(6000) * 1e-3
    u = pulses(t) * LAWS["coulomb"]["Fc"]
    motion = drive("coulomb", u, 1e-3)
    count = 2.0 * np.pi / 16384
    data = prepare([Record(t=t, u=u, theta=np.floor(motion[:, 0] / count) * count)])
    block = Predictor(model_of("coulomb"), data)
    where = Windows(np.arange(0, 4500, 700), 250, 1000)
    noise, _ = tune(block, block.model.known(), where, data.noise)
    simulation = restarted(block, block.model.known(), noise, where)
    error = data.y[where.counted][..., 0] - simulation
    assert np.sqrt(np.mean(error**2)) < count


@pytest.mark.parametrize("law", ["coulomb", "stribeck"])
def test_the_correction_by_the_log_leaves_an_exact_prediction_alone(law):
    """Windows start on the move, at a reversal and at rest."""
    t, u, motion = exact(law, "pulses", 1000)
    block = predictor_on(model_of(law), t, u, motion)
    where = Windows(np.arange(0, 1300, 37), 100, 150)
    y, _ = block.run([block.model.known()], where, block.data.noise)
    error = np.abs(y[0] - motion[where.counted]).max(axis=(0, 1))
    assert error[0] < 3e-5 and error[1] < 3e-3


def lanes_of(law, backend=None):
    system = assemble(model_of(law), levels=("torque", "J"), sensed=True).system()
    return Lanes(system, backend=backend, outputs=["theta_m", "w_m"])


def inputs_of(lanes, u):
    return np.column_stack([u, np.zeros((len(u), len(lanes.inputs) - 1))])


def values_of(lanes, law):
    own = LAWS[law] | {"eps": 1e-4}
    return np.array([own[name.split(".")[1]] for name in lanes.parameters])


@pytest.mark.parametrize("law", ["coulomb", "stribeck"])
def test_one_lane_many_lanes_and_numpy_stop_at_the_same_places(law):
    t, u, motion = exact(law, "pulses", 500)
    for backend, count in ((None, 1), (None, 9), ("numpy", 2)):
        lanes = lanes_of(law, backend)
        p = np.tile(values_of(lanes, law), (count, 1))
        start = np.zeros((count, 2))
        y, _ = lanes.run(start, np.zeros(count, int), len(t), inputs_of(lanes, u), p, dt=2e-3)
        assert np.abs(y - motion).max() < 1e-4


def test_derivatives_pass_through_stops_and_reversals():
    t, u, _ = exact("coulomb", "pulses", 500)
    lanes = lanes_of("coulomb")
    p, series = values_of(lanes, "coulomb")[None], inputs_of(lanes, u)
    where = np.zeros((1, 2)), np.zeros(1, int), len(t), series
    slope = Tangent(lanes).run(*where, p, dt=2e-3).dy
    for i, name in enumerate(lanes.parameters):
        if name == "plant.eps":
            continue
        step = np.zeros_like(p)
        step[0, i] = 1e-5 * p[0, i]
        ahead, back = (lanes.run(*where, q, dt=2e-3, rtol=1e-9)[0] for q in (p + step, p - step))
        difference = (ahead - back) / (2.0 * step[0, i])
        size = np.abs(difference).max(axis=(0, 1))
        assert np.all(np.abs(slope[..., i] - difference).max(axis=(0, 1)) < 1e-4 * size), name


def test_a_declared_width_of_the_sign_stays_as_wide_as_it_is():
    t = np.arange(500) * 1e-3
    model = model_of("coulomb", eps=0.5)
    own = lg.simulate(lg.plant(model), t, [0.05 + 0.0 * t, 0.0 * t], hold=True)
    motion = np.asarray(own.states)[:2].T
    block = predictor_on(model, t, 0.05 + 0.0 * t, motion)
    whole, rest = Windows(np.array([0]), 0, len(t)), np.zeros((1, 2))
    y, _ = block.run([model.known()], whole, block.data.noise, corrected=False, x0=rest)
    assert motion[-1, 1] > 0.1
    assert np.abs(y[0, 0] - motion).max() < 1e-4


def test_a_rest_leaves_the_state_where_the_model_stopped_within_half_a_count():
    """One rounded position, repeated through a rest, is one measurement of it."""
    t = np.arange(2000) * 1e-3
    u = pulses(t) * LAWS["coulomb"]["Fc"]
    motion, count = drive("coulomb", u, 1e-3), 2.0 * np.pi / 4096
    data = prepare([Record(t=t, u=u, theta=np.round(motion[:, 0] / count) * count)])
    block = Predictor(model_of("coulomb"), data)
    noise = replace(data.noise, jump=0.1)
    whole = Windows(np.array([0]), 0, len(t))
    y, _ = block.run([block.model.known()], whole, noise, x0=np.zeros((1, 2)))
    resting = np.flatnonzero((motion[1:] == motion[:-1]).all(axis=1))
    error = np.abs(y[0, 0, resting, 0] - motion[resting, 0])
    assert len(resting) > 300 and error.max() < 0.2 * count

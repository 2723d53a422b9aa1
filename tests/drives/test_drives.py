"""The compiled drive against the package and itself; records as strong as asked, and repeatable."""

from __future__ import annotations

import ast
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import lugrectl as lg

from . import CATALOGUE, STRANGERS, draw, make
from .effects import Context, find
from .machines import GRAVITY_LOAD, MACHINES
from .record import stream
from .run import FINE, open_loop, programmed, simulate, wave

pytestmark = pytest.mark.usefixtures("interpreted")  # compiling takes longer than these runs
SERVO = MACHINES["servo"]
HANGING = replace(SERVO, load=(GRAVITY_LOAD, 0.15, 0.4))
EFFECTS = {  # values of the catalogue's parameters, as much as one sees
    "constant_torque": (0.06,),
    "gravity": (0.15, 0.4),
    "torque_ripple": (0.08, 7.0, -1.0),
    "position_dependent_friction": (0.4, 3.0, 1.0),
    "coulomb_asymmetry": (0.3,),
    "viscous_asymmetry": (-0.6,),
    "quadratic_drag": (2e-3,),
    "thermal_drift": (-0.4, 0.2),
    "load_dependent_friction": (0.6,),
    "dwell_stiction": (0.8, 0.05),
    "input_delay": (7.3e-3,),
    "actuator_lag": (8e-3,),
    "actuator_saturation": (0.5,),
    "actuator_dead_zone": (0.08,),
    "return_spring": (0.3, 0.2),
    "hard_stop": (0.3, 3.0, 1.0),
    "elastic_coupling": (1.5e-3, 5.0, 4e-3),
    "backlash": (1.5e-3, 0.05, 20.0, 0.05),
    "inertia_step": (0.8, 0.223),
    "friction_step": (0.5, 0.223),
    "periodic_disturbance": (0.08, 6.0, 0.5),
    "velocity_sensor_lag": (6e-3,),
    "encoder_eccentricity": (0.1, 0.6),
    "torque_constant_ripple": (0.3, 4.0, 0.7),
    "sublinear_viscous": (0.05, 0.4),
    "pose_dependent_inertia": (0.4, 2.0, 0.3),
}


FINER = 20  # samples of the package for one of the record, for the sensors


def ours(machine, torque, rate, effects):
    """theta, w and both as measured, of the compiled drive."""
    s = simulate(open_loop(machine, torque, rate), {n: EFFECTS[n] for n in effects}).signals
    return [s[k] for k in ("theta_true", "w_true", "theta", "w")]


def theirs(m, torque, rate, effects):
    """The same of the package, whose equations were written apart from these."""
    named = [
        {"name": n, **dict(zip(CATALOGUE[n].parameters, EFFECTS[n], strict=True))} for n in effects
    ]
    if m.load[0]:
        named.append({"name": "gravity", "amplitude": m.load[1], "phase": m.load[2]})
    own = {k: getattr(m, k) for k in ("sigma0", "sigma1", "Fc", "Fs", "Fv", "vs")}
    law = lg.laws()["stribeck" if m.static else "lugre"]
    friction = {"model": law.name} | {k: v for k, v in own.items() if k in law.parameters}
    model = lg.Model.of(J=m.J, friction=friction, effects=named)
    t, u = np.arange(len(torque) * FINER) / (rate * FINER), np.repeat(torque, FINER)
    moved = lg.simulate(lg.plant(model), t, {"u": u}, hold=True).outputs
    motion = {k: moved[k] for k in ("theta", "w")}
    seen = lg.simulate(lg.sensor(model), t, motion).outputs
    return [x[::FINER] for x in (*motion.values(), seen["theta_m"], seen["w_m"])]


def agree(machine, effects=(), share=1e-4):
    rate = 100.0
    _, torque = wave(machine, 0.5, rate)
    expected = theirs(machine, torque, rate, effects)
    assert np.max(np.abs(expected[1])) > 5 * machine.vs
    for a, b in zip(ours(machine, torque, rate, effects), expected, strict=True):
        np.testing.assert_allclose(a, b, atol=share * np.max(np.abs(b)))


def test_the_whole_catalogue_is_compared():
    assert set(CATALOGUE) - set(EFFECTS) == {"stribeck", "presliding"}  # those are the friction


@pytest.mark.parametrize("name", EFFECTS)
def test_each_effect_agrees_with_the_package(name):
    agree(HANGING if name == "load_dependent_friction" else SERVO, [name])


@pytest.mark.parametrize(
    "machine, effects, share",
    [
        (MACHINES["axis"], [], 1e-4),
        (MACHINES["turret"], [], 1e-4),
        (HANGING, ["torque_ripple", "quadratic_drag", "input_delay", "hard_stop"], 1e-4),
        (replace(HANGING, vs=0.5, static=True), [], 3e-4),
    ],
)
def test_other_machines_agree(machine, effects, share):
    agree(machine, effects, share)


def test_the_torque_that_the_declared_structure_lacks():
    """Along the measured motion: of a torque itself, of friction and drive what they change."""
    t, torque = wave(SERVO, 2.0, 1000.0)
    right = {
        "gravity": lambda s: 0.15 * np.sin(s["theta_true"] + 0.4),
        "periodic_disturbance": lambda s: 0.08 * np.sin(12 * np.pi * t + 0.5),
        "actuator_dead_zone": lambda s: np.clip(s["u"], -0.08, 0.08),
    }
    for name, at in right.items():
        s = simulate(open_loop(SERVO, torque), {name: EFFECTS[name]}).signals
        np.testing.assert_allclose(s["effect"], at(s), atol=5e-3)


def test_a_program_sees_the_motion_and_chooses_the_torque():
    m = replace(SERVO, static=True, Fs=0.3, Fc=0.3, vs=0.1)

    def let_go():
        speed = 0.0
        while speed < 20.0:
            _, speed = yield 1.0
        while speed > 0.0:
            _, speed = yield 0.0

    _, theta, w = programmed(m, let_go(), 1e-3)
    k, c, top = m.Fv / m.J, m.Fc / m.J, int(np.argmax(w))
    age = 1e-3 * np.arange(len(w) - top)
    right = np.maximum((w[top] + c / k) * np.exp(-k * age) - c / k, 0.0)
    np.testing.assert_allclose(w[top:], right, atol=1e-3)


@pytest.mark.parametrize("folder", ["drives", "held_out"])
def test_the_simulators_share_nothing_with_the_package(folder):
    for path in (Path(__file__).parents[1] / folder).glob("[!t]*.py"):  # not the tests
        for node in ast.walk(ast.parse(path.read_text())):
            names = [a.name for a in node.names] if isinstance(node, ast.Import) else []
            names += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            assert not any(name.startswith("lugrectl") for name in names), path


EVERY = [*CATALOGUE, *STRANGERS]
SHORT: dict = {"duration": 5.0, "rate": 500.0}


@pytest.mark.slow
@pytest.mark.parametrize("name", [n for n in EVERY if find(n).declared == "lugre"])
def test_neutral_at_nothing_and_alive_at_its_size(name):
    """The same record without the effect, and with the effect at size nothing."""
    m = MACHINES["wrist"]
    if find(name).only == "load":
        m = replace(m, load=(GRAVITY_LOAD, 0.4, 0.2))
    t, torque = wave(m, 2.0, 500.0)
    setup = open_loop(m, torque, 500.0)
    base = simulate(setup, {})
    motion = [base.signals[k] for k in ("u", "theta_true", "w_true")]
    context = Context(m, t, *motion, base.friction_rms, 0.2, 500.0, FINE)
    size = find(name).recipe(context, stream(3, name))
    limits = {"actuator_saturation": 1e9, "hard_stop": -0.01}
    neutral = simulate(setup, {name: size.build(limits.get(name, 0.0))})
    for key in ("w", "theta", "u"):
        np.testing.assert_allclose(neutral.signals[key], base.signals[key], atol=1e-9)
    assert neutral.effect_rms < 1e-9
    assert simulate(setup, {name: size.build(size.start)}).effect_rms > 0.005 * base.friction_rms


@pytest.mark.parametrize(  # of each power with which a torque grows
    "name", ["gravity", "presliding", "hard_stop", "actuator_saturation"]
)
def test_strength(name):
    what = find(name)
    case = make(name, "wrist", what.excitations[0], seed=1, **SHORT)
    entry = case.truth["effects"][0]
    ratio = case.truth["effect_rms"] / case.truth["friction_rms"]
    assert entry["limited"] == (abs(np.log(ratio / 0.2)) > np.log(1.15))
    if not entry["limited"]:
        assert ratio == pytest.approx(0.2, rel=0.15)
    assert 0.05 < ratio < 0.3
    assert set(case.truth["parameters"]) == set(what.parameters)
    declared = [e["name"] for e in case.model.get("effects", [])]
    assert name not in declared and case.model["friction"]["model"] == what.declared


def test_same_seed_same_record():
    def signals(**options):
        return make("coulomb_asymmetry", seed=options.pop("seed", 3), **SHORT, **options)

    first, again, other = signals(), signals(), signals(seed=4)
    assert first.truth == again.truth and first.model == again.model
    for key in first.columns:
        assert np.array_equal(first.columns[key], again.columns[key])
        assert key == "t" or not np.array_equal(first.columns[key], other.columns[key])
    bare = make("none", seed=3, **SHORT)
    assert bare.truth["plant"] == first.truth["plant"] and bare.model == first.model


def test_sensors_quantise_and_add_noise():
    case = make(seed=2, quantum=1e-3, w_noise=0.05, torque_noise=0.01, **SHORT)
    steps = case.columns["theta"] / 1e-3
    np.testing.assert_allclose(steps, np.round(steps), atol=1e-6)
    off = case.columns["theta"] - case.hidden.signals["theta_true"]
    assert np.max(np.abs(off)) <= 0.5e-3 + 1e-12
    noise = case.columns["w"] - case.hidden.signals["w_true"]
    assert np.std(noise) == pytest.approx(0.05, rel=0.05)
    assert abs(np.mean(noise)) < 0.005
    recorded = case.columns["u"] - case.hidden.signals["u"]
    assert np.std(recorded) == pytest.approx(0.01, rel=0.05)


def test_every_draw_suits_its_effect():
    for name in EVERY:
        for seed in range(20):
            what = draw(name, seed)
            m = MACHINES[what["machine"]]
            assert what["excitation"] in find(name).excitations
            assert m.rotary or find(name).only not in ("rotary", "load")
            assert not (what["position_only"] and find(name).only == "tacho")

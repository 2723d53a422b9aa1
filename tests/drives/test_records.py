"""Records of the simulator: neutral at nothing, as strong as asked, the same for the same seed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from .. import drives as rig
from ..drives.effects import Context, find
from ..drives.logger import CHANNELS, stream
from ..drives.machines import GRAVITY_LOAD, MACHINES
from ..drives.run import FINE, open_loop, simulate, wave
from ..drives.sample import EXPORTS, LATE

EVERY = [*rig.CATALOGUE, *rig.STRANGERS]
SHORT: dict = {"duration": 5.0, "rate": 500.0}


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
    limits = {"actuator_saturation": 1e9, "voltage_limit": 1e9, "hard_stop": -0.01}
    neutral = simulate(setup, {name: size.build(limits.get(name, 0.0))})
    for key in ("w", "theta", "u"):
        np.testing.assert_allclose(neutral.signals[key], base.signals[key], atol=1e-9)
    assert neutral.effect_rms < 1e-9
    assert simulate(setup, {name: size.build(size.start)}).effect_rms > 0.005 * base.friction_rms


@pytest.mark.parametrize(  # of each power with which a torque grows
    "name", ["gravity", "presliding", "hard_stop", "actuator_saturation", "voltage_limit"]
)
def test_strength(name):
    what = find(name)
    case = rig.make(name, "wrist", what.excitations[0], seed=1, **SHORT)
    entry = case.truth["effects"][0]
    ratio = case.truth["effect_rms"] / case.truth["friction_rms"]
    assert entry["limited"] == (abs(np.log(ratio / 0.2)) > np.log(1.15))
    if not entry["limited"]:
        assert ratio == pytest.approx(0.2, rel=0.15)
    assert 0.05 < ratio < 0.3
    assert set(case.truth["parameters"]) == set(what.parameters)
    declared = [e["name"] for e in case.model.get("effects", [])]
    assert name not in declared and case.model["friction"]["model"] == what.declared


def test_two_effects_at_once():
    case = rig.make(["torque_ripple", "quadratic_drag"], "joint", seed=4, **SHORT)
    assert set(case.truth["parameters"]) == {"torque_ripple", "quadratic_drag"}
    alone = [entry["effect_rms"] for entry in case.truth["effects"]]
    assert max(alone) < case.truth["effect_rms"] < 1.3 * sum(alone)


def test_simpler_friction_is_declared_where_friction_is_hidden():
    preslides = rig.make("presliding", "joint", "moves", seed=1, **SHORT)
    assert set(preslides.model["friction"]) == {"model", "Fc", "Fs", "Fv", "vs"}
    assert preslides.truth["plant"]["sigma0"] == preslides.truth["parameters"]["sigma0"]
    grips = rig.make("stribeck", "joint", "sparse", seed=1, **SHORT)
    assert set(grips.model["friction"]) == {"model", "Fc", "Fv"}
    assert grips.truth["plant"]["Fs"] == grips.truth["parameters"]["Fs"]


def test_nothing_hidden_leaves_nothing():
    case = rig.make(seed=5, **SHORT)
    assert case.truth["effect"] == "none" and case.truth["effects"] == []
    assert case.truth["effect_rms"] < 1e-12 * case.truth["friction_rms"]


def test_same_seed_same_record():
    def signals(**options):
        return rig.make("coulomb_asymmetry", seed=options.pop("seed", 3), **SHORT, **options)

    first, again, other = signals(), signals(), signals(seed=4)
    assert first.truth == again.truth and first.model == again.model
    for key in first.columns:
        assert np.array_equal(first.columns[key], again.columns[key])
        assert key == "t" or not np.array_equal(first.columns[key], other.columns[key])
    bare = rig.make("none", seed=3, **SHORT)
    assert bare.truth["plant"] == first.truth["plant"] and bare.model == first.model


def test_sensors_quantise_and_add_noise():
    case = rig.make(seed=2, quantum=1e-3, w_noise=0.05, torque_noise=0.01, **SHORT)
    steps = case.columns["theta"] / 1e-3
    np.testing.assert_allclose(steps, np.round(steps), atol=1e-6)
    off = case.columns["theta"] - case.hidden.signals["theta_true"]
    assert np.max(np.abs(off)) <= 0.5e-3 + 1e-12
    noise = case.columns["w"] - case.hidden.signals["w_true"]
    assert np.std(noise) == pytest.approx(0.05, rel=0.05)
    assert abs(np.mean(noise)) < 0.005
    recorded = case.columns["u"] - case.hidden.signals["u"]
    assert np.std(recorded) == pytest.approx(0.01, rel=0.05)


def test_what_cannot_be_hidden_is_refused():
    cases: list[tuple[str, str, dict]] = [
        ("encoder_eccentricity", "axis", {}),
        ("load_dependent_friction", "stage", {}),
        ("velocity_sensor_lag", "servo", {"position_only": True}),
        ("no_such_effect", "servo", {}),
        ("none", "no_such_machine", {}),
        ("none", "servo", {"excitation": "no_such_excitation"}),
    ]
    for effect, machine, options in cases:
        with pytest.raises(ValueError):
            rig.make(effect, machine, duration=1.0, **options)


def test_lost_samples_and_stamps_that_jitter():
    whole = rig.make(seed=6, **SHORT)
    case = rig.make(seed=6, dropped=0.01, **SHORT)
    n, kept = len(whole.columns["t"]), len(case.columns["t"])
    assert 0.01 * n + 6 <= n - kept <= 0.01 * n + 40
    at = np.searchsorted(whole.columns["t"], case.columns["t"])
    for name, values in case.columns.items():
        assert np.array_equal(values, whole.columns[name][at])
    steps = np.diff(rig.make(seed=6, jitter=0.06, **SHORT).columns["t"]) * SHORT["rate"]
    assert np.mean(steps) == pytest.approx(1.0) and 0.08 < np.max(np.abs(steps - 1.0)) <= 0.12


def test_channels_beside_the_usual_ones():
    def columns(effect, **options):
        case = rig.make(effect, "joint", "moves", seed=3, channels=CHANNELS, **SHORT, **options)
        return case, case.columns

    case, c = columns("thermal_drift", load=True)
    ratio, tau = case.truth["parameters"].values()
    rise = c["temperature"] - c["temperature"][0]
    assert np.corrcoef(rise, -np.expm1(-c["t"] / tau))[0, 1] > 0.99
    size, phase = case.truth["load"][1:]
    np.testing.assert_allclose(c["d"], size * np.sin(c["theta"] + phase), atol=0.02 * size)
    assert "effects" not in case.model
    np.testing.assert_allclose(c["theta_load"], c["theta"], atol=1e-9)
    assert np.max(np.abs(c["r"] - c["theta"])) < 0.2 * np.ptp(c["theta"])
    case, c = columns("elastic_coupling", load=False)
    assert "d" not in c
    np.testing.assert_allclose(
        c["theta_load"], case.hidden.signals["th_load"], atol=0.51 * case.truth["quantum"]
    )


def test_further_runs_are_of_the_same_machine():
    case = rig.make("torque_ripple", "servo", seed=8, load=False, runs=3, **SHORT)
    assert len(case.more) == 2
    for other in case.more:
        brings = other.truth["nuisance"]
        assert other.hidden.table == case.hidden.table
        assert not np.allclose(other.columns["theta"], case.columns["theta"], atol=0.1)
        assert other.hidden.machine.J == case.hidden.machine.J
        friction = other.hidden.machine.Fc / case.hidden.machine.Fc
        assert friction == pytest.approx(brings["friction"]) and 0.95 <= friction <= 1.05
        off = other.columns["u"] - other.hidden.signals["u"]
        np.testing.assert_allclose(off, brings["offset"], atol=1e-12)
        zero = other.columns["theta"] - other.hidden.signals["theta"]
        np.testing.assert_allclose(zero, brings["zero"], atol=1e-12)
    alone = rig.make("torque_ripple", "servo", seed=8, load=False, **SHORT)
    assert np.array_equal(alone.columns["u"], case.columns["u"])
    same = rig.make("none", "servo", seed=8, runs=2, nuisances=(), **SHORT).more[0]
    assert set(same.truth["nuisance"].values()) == {0.0, 1.0}


def test_every_draw_suits_its_effect():
    for name in EVERY:
        for seed in range(20):
            what = rig.draw(name, seed)
            m = MACHINES[what["machine"]]
            assert what["excitation"] in find(name).excitations
            assert m.rotary or find(name).only not in ("rotary", "load")
            assert not (what["position_only"] and find(name).only == "tacho")


def test_other_logs_hold_the_same_drive():
    case = rig.make("gravity", "servo", "rich", seed=3, **SHORT)
    dt, was = 1.0 / 500.0, case.columns
    count = np.ptp(was["theta"]) / 1e5
    for form in EXPORTS:
        now = rig.exported(case, form)
        assert now.truth["hard"] == form and len(now.columns["t"]) == len(was["t"])
        if "theta" in now.columns:
            assert np.max(np.abs(now.columns["theta"] - was["theta"])) <= 0.5 * count + 1e-12
    w = rig.exported(case, "a difference alone").columns["w"]
    summed = np.cumsum(w) * dt + was["theta"][0]
    assert np.max(np.abs(summed - was["theta"])) <= 1.5 * count
    for form, samples in zip(LATE, (0.5, 1.0), strict=True):
        u = rig.exported(case, form).columns["u"]
        at = np.arange(len(u))
        assert np.allclose(u[1:], np.interp(at - samples, at, was["u"])[1:])


def test_a_stop_that_another_effect_keeps_the_drive_from_is_a_problem():
    fit = rig.sample("hard_stop", 126500)
    assert rig.problems(fit) == []
    far = fit.truth["effects"][0] | {"parameters": {"position": 1e3, "stiffness": 1.0, "side": 1.0}}
    assert "never touched" in rig.problems(replace(fit, truth=fit.truth | {"effects": [far]}))[0]

"""Records of the simulator: neutral at nothing, as strong as asked, the same for the same seed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from .. import drives as rig
from ..drives.effects import Context, find
from ..drives.machines import GRAVITY_LOAD, MACHINES
from ..drives.record import stream
from ..drives.run import FINE, open_loop, simulate, wave

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


def test_every_draw_suits_its_effect():
    for name in EVERY:
        for seed in range(20):
            what = rig.draw(name, seed)
            m = MACHINES[what["machine"]]
            assert what["excitation"] in find(name).excitations
            assert m.rotary or find(name).only not in ("rotary", "load")
            assert not (what["position_only"] and find(name).only == "tacho")

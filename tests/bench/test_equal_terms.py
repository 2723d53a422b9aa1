"""Every observer at equal terms: the same loops, the same feedback, the same wrong belief."""

import numpy as np
import pytest

import lugrectl as lg
from lugrectl.blocks.block import members

from ..cases.observed import STEP, P, believing, cycle, longer, rms, signals, velocity_error

NAMES = [k.removesuffix("_observer") for k in members("observer") if k != "no_observer"]


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("make", [lg.velocity_loop, lg.position_loop])
def test_every_observer_stands_in_the_ready_loops(make, name):
    """In a position loop one that acts on s needs dr as well."""
    for smooth in (False, True):
        loop = make(P, name, prefilter=smooth, feedforward=True, load=True)
        assert loop.syslist[1].name == f"{name}_observer"
        assert loop.output_labels == ["theta", "w", "F", "Fhat", "u", "e"]
        assert np.isfinite(
            loop.dynamics(0.0, np.full(loop.nstates, 1e-3), [0.1] * loop.ninputs)
        ).all()
    inputs = make(P, name).input_labels
    with_s = make is lg.position_loop and "s" in members("observer")[f"{name}_observer"].inputs
    assert inputs == (["r", "dr"] if with_s else ["r"])


AFFINE = [
    lg.friction_state_observer(P),
    lg.normal_force_observer(P),
    lg.lyapunov_observer(P),
    lg.general_coulomb_observer(P),
    lg.adaptive_slotine_li(),
    lg.dual_observer_control(P),
    lg.backstepping_smc(P),
    lg.repetitive_control(P),
]


@pytest.mark.parametrize("made", AFFINE, ids=[made.name for made in AFFINE])
def test_blocks_have_a_sampled_form(made):
    """With held inputs it is the continuous block at the samples."""
    t, inputs = STEP * np.arange(40), [0.02, 0.3, 0.1][: made.ninputs]
    held = lg.sampled(made, STEP)
    rows = np.repeat(np.array(inputs)[:, None], len(t), axis=1)
    one = lg.simulate(held, t, rows).outputs
    two = lg.simulate(made, t, rows, method="LSODA", rtol=1e-9).outputs
    np.testing.assert_allclose(one, two, rtol=1e-5, atol=1e-7)


@longer
@pytest.mark.parametrize("name", NAMES)
def test_every_observer_compensates(name):
    """The velocity loop of compensate, friction 20 % low "before" and exact "after"."""
    found = lg.compensate(P, declared=believing(0.8), observer=name, kp=0.5, ki=2.0)
    assert found.after < 0.35 * found.none
    assert not found.messages or found.after <= 1.05 * found.before


@longer
def test_a_position_observer_starts_where_the_drive_stands():
    t = np.arange(0.0, 2.0, 1e-3)
    r = 0.5 * np.sin(2.0 * t) ** 2
    for name in ("position_coulomb", "position_lugre"):
        near, far = (
            lg.compensate(P, loop="position", observer=name, reference=(t, r + at)).runs["after"]
            for at in (0.0, 3.0)
        )
        assert far.y - 3.0 == pytest.approx(near.y, abs=1e-5)


@longer
@pytest.mark.parametrize(
    ("k", "existing", "natural"), [(0.35, 0.0165, 0.0049), (5.0, 0.0030, 0.00039)]
)
def test_the_existing_observer_is_feedback(k, existing, natural):
    """It adds k (sigma1 s + sigma0)/(s + a) on -e; the natural one with this as PI is better."""
    low = believing(0.8)
    assert velocity_error("existing", low, k=k) == pytest.approx(existing, abs=1e-4)
    equal = {"kp": 1.6 + P.sigma1 * k, "ki": 0.16 + P.sigma0 * k}
    assert velocity_error("natural", low, **equal) == pytest.approx(natural, rel=0.02)


@longer
@pytest.mark.parametrize(
    ("name", "k", "error", "digit"),
    [
        ("temperature", "own", 0.0062, 1e-4),
        ("temperature", 50.0, 0.0040, 1e-4),
        ("proposed", "own", 0.0133, 1e-4),
    ],
)
def test_a_constant_load_counts_as_friction(name, k, error, digit):
    """0.05 N m, with the level 20 % low."""
    loop = lg.velocity_loop(P, name, k=k, observer_parameters=believing(0.8), load=True)
    t = np.arange(0.0, 5.0 + STEP / 2, STEP)
    rows = {"r": 0.1 * np.sin(2 * np.pi * t), "d": 0.05}
    e = signals(loop, lg.simulate(loop, t, rows))["e"][t >= 1.0]
    assert rms(e) == pytest.approx(error, abs=digit)


@longer
@pytest.mark.parametrize(
    ("name", "swing"),
    [
        ("normal_force", 0.0),
        ("lyapunov", 0.0),
        ("adaptive", 0.0),
        ("general_coulomb", 0.44e-3),
    ],
)
def test_limit_cycles_of_the_others_with_friction_overestimated(name, swing):
    """The natural observer: 8 mrad."""
    assert cycle(name, 1.2) == pytest.approx(swing, abs=1e-5 if swing else 1e-11)

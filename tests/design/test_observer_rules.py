"""Gains of every observer by its rule, and what is claimed for them."""

import control as ct
import numpy as np
import pytest

import lugrectl as lg
from lugrectl.blocks.block import members
from lugrectl.design.gains import RULES, common_rate, decay, position_corners

from ..cases.observed import P

SHORT = [k.removesuffix("_observer") for k in RULES]


def test_every_observer_has_a_rule_or_is_the_proposed_one():
    known = {k for k in members("observer") if not members("observer")[k].home.startswith("tests")}
    assert known - {*RULES} == {"no_observer", "proposed_observer"}


@pytest.mark.parametrize("name", [*SHORT, "proposed"])
def test_a_loop_takes_the_gains_of_a_design(name):
    design = lg.design_gains(P, observer=name)
    assert design.observer == name and design.certificate
    loop = lg.velocity_loop(P, name, **design.gains)
    assert loop.ninputs >= 1
    for key, value in design.gains.items():
        block = next(b for b in loop.syslist if b.name == f"{name}_observer")
        assert block.params[f"{name}_observer.{key}"] == value


@pytest.mark.parametrize(("rate", "claimed"), [(200.0, 123.0), (500.0, 358.0), (2000.0, 1660.0)])
def test_the_friction_state_has_at_least_the_known_decay(rate, claimed):
    """Up to 0.65 rad/s; found by hand with one parameter of V, here with three."""
    design = lg.design_gains(P, observer="friction_state", bandwidth=rate, M=0.65)
    assert claimed <= design.certificate.rate < 1.02 * claimed
    assert design.certificate.pole_at_rest == -rate


@pytest.mark.parametrize(("most", "claimed"), [(0.1, 445.0), (0.5, 414.0), (1.0, 338.0)])
def test_the_position_observer_has_the_known_gains_and_decay(most, claimed):
    design = lg.design_gains(P, observer="position_lugre", pole=1000.0, M=most)
    gains = [design.gains[k] for k in ("l1", "l2", "l3")]
    assert gains == pytest.approx([2719.1, 2.1180e6, -5742.4], rel=2e-4)
    assert design.certificate.rate == pytest.approx(claimed, rel=5e-3)


def test_slow_poles_of_the_position_observer_are_certified_at_rest_only():
    made = lg.design_gains(P, observer="position_lugre", pole=300.0).certificate
    assert not made and made.rate is None
    assert made.valid == "linearised at rest only"
    assert "choose a faster pole" in made.conditions[-1]


def test_the_poles_at_rest_are_those_of_the_linearised_block():
    design = lg.design_gains(P, observer="position_lugre", pole=800.0)
    block = lg.position_lugre_observer(P, **design.gains)
    A = ct.linearize(block, np.zeros(3), np.zeros(2)).A
    assert np.linalg.eigvals(A).real == pytest.approx(-800.0 * np.ones(3), rel=1e-3)


def test_a_common_function_decays_at_every_corner():
    _, corners = position_corners(P, 1000.0, 0.5)
    rate, V = common_rate(corners)
    assert decay(V, corners) == pytest.approx(rate, rel=1e-6)
    assert np.linalg.eigvalsh(V)[0] > 0.0
    assert common_rate([np.eye(2), -np.eye(2)]) is None


def test_the_claimed_decay_holds_along_a_motion():
    """Two friction-state observers on one drive: their difference follows the error system."""
    design = lg.design_gains(P, observer="friction_state", M=0.4)
    block = lg.friction_state_observer(P, **design.gains)
    t = 1e-4 * np.arange(300)
    given = np.array([0.3 * np.sin(60 * t), 0.2 + 0.0 * t])
    one, other = (lg.simulate(block, t, given, x0).states for x0 in ([0, 0], [0.1, 0.2]))
    p = design.gains["bandwidth"]
    size = np.hypot(P.J * p * (one - other)[0], (one - other)[1])
    bound = 6.0 * size[0] * np.exp(-design.certificate.rate * t)
    assert size[-1] < 1e-3 * size[0] and np.all(size <= bound)


def test_a_sample_time_limits_the_rates():
    for name, key in (("extended_state", "bandwidth"), ("friction_state", "bandwidth")):
        assert lg.design_gains(P, observer=name, dt=5e-3).gains[key] == pytest.approx(100.0)
    assert lg.design_gains(P, observer="disturbance", dt=2e-3).gains["tau"] == 4e-3


def test_the_rate_of_a_coulomb_observer_is_the_one_that_was_asked_for():
    drive = {"J": 0.5, "friction": "coulomb", "Fc": 1.0, "Fv": 0.1}
    for name in ("position_coulomb", "general_coulomb"):
        made = lg.design_gains(drive, observer=name, rate=20.0)
        assert made.gains["k"] == pytest.approx(10.0)


def test_the_normal_force_observer_is_certified_with_a_positive_real_loop_only():
    assert lg.design_gains(P, observer="normal_force", kp=15.0, kd=1.2).certificate
    low = lg.design_gains(P, observer="normal_force", kp=15.0, kd=0.5).certificate
    assert not low and "not PR" in low.conditions[0]


def test_a_design_has_the_forms_of_every_result():
    design = lg.design_gains(P, observer="disturbance", tau=0.02)
    assert repr(design).splitlines()[0] == "Design: disturbance observer"
    made = design.to_dict()
    assert made["gains"] == {"tau": 0.02} and made["certificate"]["rate"] == pytest.approx(50.0)
    assert '"valid"' in design.to_json()
    with pytest.raises(lg.InputError, match="not a function of e_z and e_w"):
        design.certificate.V(1.0, 0.0)

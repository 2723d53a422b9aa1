"""Controllers of T(s), and the least change that makes T strictly positive real."""

import math
from dataclasses import replace
from types import SimpleNamespace

import control as ct
import numpy as np
import pytest

from lugrectl.blocks.model import table1
from lugrectl.core.errors import InputError
from lugrectl.linear import (
    position_loop_tf,
    position_T,
    spr_check,
    spr_repair,
    velocity_loop_tf,
    velocity_T,
)

P = table1()
LOOPS = {"position": position_T, "velocity": velocity_T}


# --- controllers -------------------------------------------------------------------------

s = ct.tf("s")
FORMS = [
    ({"kp": 15}, 15 + 0 * s, 0 * s),
    ({"kp": 15, "ki": 1.5}, 15 + 1.5 / s, 0 * s),
    ({"kp": 15, "kd": 0.4}, 15 + 0 * s, 0.4 * s),
    ({"kp": 15, "ki": 1.5, "tau": 0.1, "kd": 0.4}, 15 + 1.5 / (0.1 * s + 1), 0.4 * s),
    ({"kp": 15, "ki": 1.5, "leak": 3.0, "kd": 0.4}, 15 + 1.5 / (s + 3), 0.4 * s),
    (
        {"kp": 15, "ki": 1.5, "kd": 0.4, "derivative_filter": 0.02},
        15 + 1.5 / s,
        0.4 * s / (0.02 * s + 1),
    ),
    ({"controller": (s + 20) / (s + 2)}, (s + 20) / (s + 2), 0 * s),
    (
        {"kp": 2, "ki": 1.5, "controller": ct.tf2ss((s + 20) / (s**2 + 2 * s))},
        2 + 1.5 / s + (s + 20) / (s**2 + 2 * s),
        0 * s,
    ),
]


@pytest.mark.parametrize(("gains", "on_error", "derivative"), FORMS)
def test_every_controller_by_feedback(gains, on_error, derivative):
    for order, of_error, of_reference in (
        (2, position_T, position_loop_tf),
        (1, velocity_T, velocity_loop_tf),
    ):
        for w in (0.1j, 3j, 80j, 900j):
            E, D = on_error(w), derivative(w)
            den = P.J * w**order + D + E
            assert of_error(P, **gains)(w) == pytest.approx((0.6 * w + 260) / den, rel=1e-9)
            assert of_reference(P, **gains)(w) == pytest.approx(E / den, rel=1e-9)


def test_a_shared_integrator_is_counted_once():
    T = velocity_loop_tf(P, kp=1.0, ki=2.0, controller=([3.0], [1, 0]))
    np.testing.assert_allclose(T.poles(), velocity_loop_tf(P, kp=1.0, ki=5.0).poles())


@pytest.mark.parametrize(
    ("gains", "word"),
    [
        ({"ki": 1, "tau": 1.0, "leak": 1.0}, "tau and leak"),
        ({"ki": 1, "leak": -1.0}, "leak is -1"),
        ({"kd": 1, "derivative_filter": -1.0}, "derivative_filter is -1"),
        ({"controller": ct.tf([1], [1, 0.5], 0.01)}, "C is discrete-time"),
        ({"controller": ([1], [0])}, r"denominator of C\(s\)"),
        ({"controller": 3.0}, "C is 3.0"),
        ({"kp": 1e308, "ki": 1e308, "leak": 1e308}, "1e308"),
        ({"kp": 1, "ki": 1, "tau": -1}, "tau is -1 s"),
        ({"kp": math.nan}, "kp"),
    ],
)
def test_controllers_that_cannot_be_understood(gains, word):
    with pytest.raises(InputError, match=word):
        position_T(P, **gains)


def test_a_loop_needs_a_denominator():
    with pytest.raises(InputError, match="no denominator"):
        velocity_T(SimpleNamespace(J=0.0, sigma0=260.0, sigma1=0.6))


def test_prefilter_by_its_pole():
    T, bare = (position_loop_tf(P, kp=15, kd=0.3, prefilter=a) for a in (5.0, False))
    assert T(3j) == pytest.approx(bare(3j) * 5 / (3j + 5))
    with pytest.raises(InputError, match="prefilter"):
        velocity_loop_tf(P, kp=1, prefilter=-1.0)


# --- repairs -----------------------------------------------------------------------------


def holds_at_its_limits(loop, p, gains):
    """The repaired T is SPR; a little below any limit it is not, a little above it is."""
    T = LOOPS[loop](p, **gains)
    repair = spr_repair(T)
    if repair is None:
        return None
    assert not spr_check(T) and spr_check(T).repair == repair.sentence
    assert spr_check(LOOPS[loop](p, **gains | repair.gains)), repair
    bare, so_far = dict(gains), {}
    if "leak" in repair.gains and "kd" in repair.gains:
        bare["ki"] = 0  # Kd is for the controller without the integral
    for name, value in repair.gains.items():
        so_far[name] = value
        if name == "leak":
            bare = dict(gains)
        for factor in (1 - 1e-9, 1 + 1e-9):
            limit = repair.limits.get(name, 0.0)
            if limit:
                assert value > limit
                near = LOOPS[loop](p, **bare | so_far | {name: limit * factor})
                assert bool(spr_check(near)) == (factor > 1), (repair, name, factor)
    return repair


def test_least_kd_of_a_pd_controller():
    for kd in (0.0, 0.5, 0.953):
        repair = holds_at_its_limits("position", P, {"kp": 15, "kd": kd})
        assert repair.limits["kd"] == pytest.approx(260 * 0.0022 / 0.6, rel=1e-13)
        assert repair.gains == {"kd": 0.9534} and "0.953333" in repair.sentence


@pytest.mark.parametrize(("ki", "kd"), [(1e4, 2.0)])
def test_least_leak_of_a_velocity_pi(ki, kd):
    """P = a x^2 + (leak^2 a - q) x + leak sigma0 (Ki + Kp leak), q = sigma1 Ki - sigma0 Kp."""
    kp, a = 1.5, 0.6 * (P.J + kd)
    q = 0.6 * ki - 260 * kp
    roots = np.roots([a**2, 0, -2 * a * (q + 2 * 260 * kp), -4 * a * 260 * ki, q**2])
    least = roots.real[(abs(roots.imag) < 1e-9 * abs(roots)) & (roots.real > 0)].min()
    repair = holds_at_its_limits("velocity", P, {"kp": kp, "ki": ki, "kd": kd})
    assert repair.limits["leak"] == pytest.approx(least, rel=1e-9)


def test_any_leak_does_where_pure_integral_action_is_positive_real():
    for loop, kd in (("velocity", 0.0), ("position", 0.955)):
        gains = {"kp": 15, "ki": 1.55, "kd": kd}
        repair = spr_repair(LOOPS[loop](P, **gains))
        assert repair.limits == {"leak": 0.0}
        for leak in (1e-12, 1e-3, repair.gains["leak"], 1e3):
            assert spr_check(LOOPS[loop](P, **gains, leak=leak))


def test_repairs_in_several_steps():
    paper = holds_at_its_limits("position", P, {"kp": 15, "ki": 1.55})
    assert list(paper.gains) == ["kd", "leak"]
    gains = {"kp": 15, "ki": 1.55, "kd": 0.5, "derivative_filter": 1e-3}
    filtered = holds_at_its_limits("position", P, gains)
    assert filtered.gains["derivative_filter"] is None and "no filter" in filtered.sentence
    only = spr_repair(position_T(P, kp=15, kd=2, derivative_filter=1e-3))
    assert only.gains == {"derivative_filter": None} and not only.limits
    lead = {"controller": ([1, 20], [0.01, 1])}
    assert "kd" in holds_at_its_limits("position", P, lead).gains
    assert "kp" in holds_at_its_limits("velocity", P, {"kp": 0.01, "ki": 1e4, "tau": 1.0}).gains
    assert "kp" in holds_at_its_limits("position", P, {"kd": 2}).gains


@pytest.mark.parametrize(
    "T",
    [
        position_T(P, kp=15, kd=0.955),  # nothing to repair
        velocity_T(P, kp=1.6),
        position_T(P, kp=-15, kd=0.955, ki=1.0),
        position_T(P, controller=([1, 20], [1, 0])),  # its integrator is the user's
        position_T(replace(P, sigma1=0.0), kp=15, kd=0.955),
        ct.tf([1], [1, 2, 1]),
        2 * position_T(P, kp=15),  # no longer a loop's T
        ([1], [1, 2, 1]),
    ],
)
def test_no_repair(T):
    assert spr_repair(T) is None and spr_check(T).repair is None

"""Any registered block as columns along a motion: what holds for each, and closed forms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import lugrectl as lg
from lugrectl.blocks.block import REGISTRY, members
from lugrectl.blocks.friction import along as bristle
from lugrectl.blocks.friction import strokes
from lugrectl.torque_balance.columns import (
    Along,
    bend,
    changed_input,
    columns,
    lanes,
    linear,
    needs_inertia,
    nonlinear,
    refused,
    searched,
    slope,
    slopes,
    to_coefficients,
    to_values,
    torque,
)

DT, N = 1e-3, 4000
SAMPLES = slice(0, N)
EFFECTS, LAWS = sorted(members("effect")), sorted(members("friction"))
VALUES = {  # of parameters whose defaults say little along this motion
    "constant_torque": {"torque": -0.1},
    "return_spring": {"stiffness": 0.3, "rest": 0.4},
    "hard_stop": {"stiffness": 5.0, "position": 1.1},
    "coulomb_asymmetry": {"ratio": -0.2},
    "thermal_drift": {"ratio": -0.3, "time_constant": 1.5},
    "friction_step": {"ratio": 0.3, "time": 2.2},
    "inertia_step": {"ratio": 0.3, "time": 1.3},
    "dwell_stiction": {"ratio": 0.4, "time_constant": 0.1},
    "stribeck": {"Fs": 0.5, "vs": 0.8},
    "presliding": {"sigma0": 40.0, "sigma1": 0.1},
    "input_delay": {"delay": 0.0123},
    "actuator_lag": {"time_constant": 0.02},
    "actuator_saturation": {"limit": 0.8},
    "actuator_dead_zone": {"half_width": 0.1},
    "elastic_coupling": {"load_inertia": 0.004, "stiffness": 12.0, "damping": 0.05},
    "backlash": {"load_inertia": 0.004, "stiffness": 40.0, "damping": 0.2, "gap": 0.02},
    "velocity_sensor_lag": {"time_constant": 0.01},
}
# what jumps or strikes has slopes only in the mean
KINKED = {"elastoplastic", "leuven"}  # a stroke ends within few samples
JUMPS = {"time", "gap", "position", "limit", "half_width", "delay"}


def log_of(theta, w, a, u, pieces=((SAMPLES, DT),), d=None) -> Along:
    z = bristle(*strokes(w * DT), 5e-3)
    up, down = (bristle(*strokes(w * DT), 5e-3, e) for e in (1e-4, -1e-4))
    d = np.zeros(len(w)) if d is None else d
    return Along(
        t=DT * np.arange(len(w)),
        theta=theta,
        w=w,
        acceleration=a,
        path=theta - theta[0],
        pieces=pieces,
        u=u,
        z=z,
        follows=(up - down) / 2e-4,
        coulomb=0.3 * z,
        level=np.full(len(w), 0.3),
        viscous=0.02 * w,
        load=0.2 * np.sin(theta) + d,
        J=0.01,
        values={"J": 0.01, "Fc": 0.3, "Fs": 0.35, "Fv": 0.02, "vs": 0.1},
        d=d,
    )


def motion(pieces=((SAMPLES, DT),), shift=0.0) -> Along:
    """To and fro, with rests, over more than a turn."""
    t = DT * np.arange(N)
    pace = np.clip(8.0 * np.abs(t % 1.0 - 0.5) - 0.4, 0.0, 1.0)  # rests of 0.1 s
    x = 2 * np.pi * np.cumsum(pace * DT)
    theta = 2.0 * np.sin(0.7 * x) + 0.4 * np.sin(2.3 * x + 1.0) + 0.02 * np.sin(9.0 * x) + shift
    w, a = slope(theta, DT), bend(theta, DT)
    return log_of(theta, w, a, 0.01 * a + 0.3 * np.sign(w) + 0.02 * w, pieces)


def values_of(block) -> dict[str, float]:
    usual = {"amplitude": 0.3, "ratio": 0.2, "coefficient": 0.1, "phase": 0.7, "frequency": 3.3}
    usual |= {"sigma0": 30.0, "sigma1": 0.2, "vs": 0.5} if block.kind == "friction" else {}
    own = {k: usual.get(k, p.value) for k, p in block.own.items()}
    return own | VALUES.get(block.name, {})


def both(made) -> np.ndarray:
    """The wide and the narrow part side by side."""
    parts = [x for x in (made.wide, made.narrow) if x is not None]
    return np.concatenate(parts) if parts else np.zeros((0, len(made)))


@pytest.fixture(params=EFFECTS)
def effect(request):
    return REGISTRY["effect", request.param]


@pytest.fixture(params=[*EFFECTS, *(f"law {name}" for name in LAWS)])
def block(request):
    kind, name = "effect", request.param
    if name.startswith("law "):
        kind, name = "friction", name.removeprefix("law ")
    return REGISTRY[kind, name]


def test_each_is_served_and_finite(block):
    log, values = motion(), values_of(block)
    assert refused(block) == ""
    made = columns(block, values, log)
    assert len(made) == max(1, len(linear(block)))
    assert np.all(np.isfinite(both(made))) and np.any(both(made))
    assert np.all(made.low <= made.high) and both(made).shape[1] == len(made)
    assert both(made).shape[0] in (N, 2 * N)


def test_columns_and_coefficients_make_the_torque(block):
    log, values = motion(), values_of(block)
    made, b = columns(block, values, log), to_coefficients(block, values, log)
    whole = both(torque(block, values, log))[:, 0]
    size = np.abs(whole).max()
    assert np.all(made.low <= b) and np.all(b <= made.high)
    np.testing.assert_allclose(both(made) @ b, whole, atol=2e-6 * size)
    back = to_values(block, b, values, log)
    assert back == pytest.approx(values)


def test_twice_the_coefficients_are_twice_the_torque(effect):
    log, values = motion(), values_of(effect)
    if not linear(effect):
        pytest.skip("not linear in its strength")
    twice = to_values(effect, 2 * to_coefficients(effect, values, log), values, log)
    one, two = (both(torque(effect, v, log)) for v in (values, twice))
    np.testing.assert_allclose(two, 2 * one, atol=1e-5 * np.abs(one).max())


def test_nothing_is_left_at_the_neutral_value(effect):
    log, neutral = motion(), effect.own[effect.gain].neutral
    values = values_of(effect) | {effect.gain: neutral}
    assert np.abs(both(torque(effect, values, log))).max(initial=0.0) < 1e-12


def test_pieces_know_nothing_of_one_another(block):
    half = N // 2 - 300
    two = ((slice(0, half), DT), (slice(half, N), DT))
    log, values = motion(two), values_of(block)
    moved = {k: getattr(log, k).copy() for k in ("theta", "w", "u", "path", "load")}
    for x in moved.values():
        x[half:] = 0.3 * x[half:] + 0.7
    one, other = (both(torque(block, values, each)) for each in (log, replace(log, **moved)))
    for first in range(0, len(one), N):
        np.testing.assert_array_equal(one[first : first + half], other[first : first + half])
    alone = replace(motion(((slice(0, half), DT),)), **{
        k: getattr(log, k)[:half] for k in (
            "t", "theta", "w", "acceleration", "path", "u", "z", "follows", "coulomb", "level",
            "viscous", "load", "d",
        )
    })  # fmt: skip
    by_itself = both(torque(block, values, alone))
    np.testing.assert_allclose(by_itself[:half], one[:half], atol=1e-9 * np.abs(one).max())


def test_slopes_are_small_differences(block):
    log, values = motion(), values_of(block)
    values |= {"gap": 0.0} if "gap" in values else {}  # in a gap a load is chaotic
    keys = [k for k in nonlinear(block) if k not in JUMPS]
    made = both(slopes(block, values, log, keys))
    for i, k in enumerate(keys):
        h = 2e-3 * abs(values[k])
        less, more = (both(torque(block, values | {k: values[k] + s}, log)) for s in (-h, h))
        exact = (more - less)[:, 0] / (2 * h)
        miss, size = np.linalg.norm(smooth(made[:, i] - exact)), np.linalg.norm(smooth(exact))
        assert miss < (0.2 if block.name in KINKED else 0.03) * size + 1e-9, k


def test_several_sets_at_once_are_one_after_the_other(block):
    log, values = motion(), values_of(block)
    key = next(iter(searched(block)), None)
    sets = [values, values if key is None else values | {key: 1.01 * values[key]}]
    if block.kind == "effect" and block.own.get("side"):
        sets[1] = values | {"side": -1.0}
    at_once = both(lanes(block, sets, log))
    each = np.concatenate([both(columns(block, v, log)) for v in sets], axis=1)
    np.testing.assert_allclose(at_once, each, rtol=1e-6, atol=1e-9 * np.abs(each).max())


def test_what_hangs_on_the_inertia():
    named = {name for name in EFFECTS if needs_inertia(REGISTRY["effect", name])}
    assert named == {
        "backlash", "elastic_coupling", "encoder_eccentricity", "inertia_step",
        "pose_dependent_inertia", "velocity_sensor_lag",
    }  # fmt: skip


def test_a_rest_is_found_far_from_the_middle():
    log, spring = motion(shift=40.0), REGISTRY["effect", "return_spring"]
    values = {"stiffness": 0.3, "rest": 39.0}
    made = columns(spring, values, log)
    assert made.wide is not None
    b, *_ = np.linalg.lstsq(made.wide, 0.3 * (log.theta - 39.0))
    assert to_values(spring, b, {}, log) == pytest.approx(values)


def test_a_change_of_one_level_leaves_the_other():
    """Fc and Fs move the friction together as both alone."""
    log = motion()

    def of(acts):
        @lg.block("effect", out="level", acts=acts, name="level_" + acts.replace(" ", ""))
        def change(theta, ratio=lg.P(0.0, "1", neutral=0.0)):
            return ratio * np.sin(theta)

        made = columns(change, {}, log).wide
        assert made is not None
        return made[:, 0]

    np.testing.assert_allclose(of("Fc") + of("Fs"), of("Fc Fs"), atol=1e-12)
    np.testing.assert_allclose(of("Fc Fs"), log.coulomb * np.sin(log.theta), atol=1e-12)


def test_an_asymmetry_follows_the_bristle():
    log = motion()
    made = columns(REGISTRY["effect", "coulomb_asymmetry"], {}, log).wide
    assert made is not None
    np.testing.assert_allclose(made[:, 0], log.follows * log.level, atol=1e-12)


def test_an_abrupt_torque_builds_up():
    @lg.block("effect", out="d", acts="torque", abrupt=True)
    def one_sided_seal(w, Fc=lg.P(0.0, "N m", neutral=0.0)):
        """d = Fc (1 + sign(w))."""
        return Fc * (1.0 + np.sign(w))

    log = motion()
    made = columns(one_sided_seal, {}, log).wide
    assert made is not None
    np.testing.assert_allclose(made[:, 0], 1.0 + log.z, atol=1e-12)


# What simulations say


def simulated(effects=(), friction=None, amplitude=1.2, friction_values=None):
    """A drive under a smooth torque: its motion, and what of the torque J a and F leave."""
    law = {"model": "viscous", "Fv": 0.02} if friction is None else friction
    model = lg.Model.of(J=0.01, friction=law, effects=list(effects))
    t = DT * np.arange(N)
    u = amplitude * (np.sin(2 * np.pi * 1.3 * t) + 0.4 * np.sin(2 * np.pi * 3.1 * t + 1.0))
    made = lg.simulate(lg.plant(model), t, {"u": u})
    theta, w, F = (made.outputs[i] for i in range(3))
    a = slope(w, DT)
    return replace(log_of(theta, w, a, u), values=model.values()), u - 0.01 * a - F, F


def smooth(x, width=20):
    k = (1 - (np.arange(-width, width + 1) / (width + 1)) ** 2) ** 3
    return np.convolve(x, k / k.sum(), "valid")


@pytest.mark.parametrize("name", ["elastic_coupling", "backlash"])
def test_a_load_moves_as_in_a_simulation(name):
    values = VALUES[name] | ({"stiffness": 40.0, "damping": 0.3} if name == "backlash" else {})
    log, left, _ = simulated([{"name": name, **values}])
    made = torque(REGISTRY["effect", name], values, log).narrow
    assert made is not None
    miss = smooth(made[:, 0] - left)[200:-200]
    assert np.std(miss) < 0.01 * np.std(smooth(left)[200:-200])


@pytest.mark.parametrize("name", ["pose_dependent_inertia", "hard_stop", "quadratic_drag"])
def test_an_effect_is_what_a_simulation_lacks(name):
    block = REGISTRY["effect", name]
    values = values_of(block)
    log, left, _ = simulated([{"name": name, **values}])
    made = torque(block, values, log)
    sides = [x[:, 0] for x in (made.wide, made.narrow) if x is not None]
    miss = smooth(sum(sides) - left)[100:-100]
    assert np.std(miss) < 2e-3 * np.std(smooth(left)[100:-100])


def test_an_eccentric_encoder_adds_what_its_position_bends():
    values = {"amplitude": 0.02, "phase": 0.7}
    true = motion()
    theta = true.theta + 0.02 * np.sin(true.theta + 0.7)
    log = log_of(theta, slope(theta, DT), bend(theta, DT), true.u)
    made = torque(REGISTRY["effect", "encoder_eccentricity"], values, log).narrow
    assert made is not None
    want = 0.01 * (true.acceleration - log.acceleration)
    assert np.std(made[:, 0] - want) < 0.1 * np.std(want)


@pytest.mark.parametrize("name", [k for k in LAWS if REGISTRY["friction", k].states])
def test_a_law_gives_the_friction_of_a_simulation(name):
    law = REGISTRY["friction", name]
    values = values_of(law) | {"sigma0": 100.0}
    given = {k: v for k, v in values.items() if not law.parameters[k].usual}
    log, _, F = simulated(friction={"model": name, **given})
    made = torque(law, values, log).wide
    assert made is not None
    miss = smooth(made[:, 0] - F)[100:-100]
    assert np.std(miss) < 0.01 * np.std(F)
    assert np.abs(made).max() < 1.2 * np.abs(F).max()


def test_presliding_gives_what_bristles_add():
    """With Stribeck friction it is LuGre; F itself jumps between two samples."""
    values = {"sigma0": 40.0, "sigma1": 0.1}
    plain = {"model": "stribeck", "Fc": 0.3, "Fs": 0.35, "vs": 0.1, "Fv": 0.02}
    log, left, _ = simulated([{"name": "presliding", **values}], friction=plain)
    made = torque(REGISTRY["effect", "presliding"], values, log).wide
    assert made is not None
    miss = smooth(made[:, 0] - left)[100:-100]
    assert np.std(miss) < 0.1 * np.std(smooth(left)[100:-100])


def test_a_longer_rest_makes_a_larger_peak():
    log = motion()
    block = REGISTRY["effect", "dwell_stiction"]
    w = np.where((log.t > 1.0) & (log.t < 1.2), 0.0, 1.0)
    w[(log.t > 2.0) & (log.t < 2.4)] = 0.0
    still = replace(log, w=w, theta=np.cumsum(w) * DT, z=np.ones(N))
    made = columns(block, {"time_constant": 0.2}, still).wide
    assert made is not None
    short, long = (made[np.searchsorted(log.t, end) - 5, 0] for end in (1.2, 2.4))
    static = 0.35
    assert short == pytest.approx(static * (1 - np.exp(-0.2 / 0.2)), rel=0.02)
    assert long == pytest.approx(static * (1 - np.exp(-0.4 / 0.2)), rel=0.02)
    assert abs(made[np.searchsorted(log.t, 1.4), 0]) < 1e-6


def test_the_exact_form_of_a_held_input_is_used():
    log = motion()
    late = changed_input(REGISTRY["effect", "input_delay"], {"delay": 0.003}, log)
    np.testing.assert_allclose(late[3:], log.u[:-3], atol=1e-9)
    lag = REGISTRY["effect", "actuator_lag"]
    slow = changed_input(lag, {"time_constant": 0.02}, log)
    by_states = changed_input(replace(lag, exact=None), {"time_constant": 0.02}, log)
    np.testing.assert_allclose(by_states, slow, atol=1e-6)


def test_a_late_speed_is_an_error_of_its_integral():
    """Where the speed alone was recorded: J times the change of the error."""
    log = motion()
    smooth_w = np.sin(6.0 * log.t)
    log = replace(log, w=smooth_w, path=-np.cos(6.0 * log.t) / 6.0)
    made = torque(REGISTRY["effect", "velocity_sensor_lag"], {"time_constant": 0.01}, log).narrow
    assert made is not None
    want = 0.01 * 0.01 * -36.0 * np.sin(6.0 * log.t)  # J tau d2w/dt2
    np.testing.assert_allclose(made[200:-10, 0], want[200:-10], atol=0.1 * np.abs(want).max())


# Blocks of the user


def test_own_effect_with_states_of_odd_names():
    """Two filters in a row and a state with the name of a bristle: tau as of each."""

    @lg.block("effect", out="d", states="z w_load lagged", start="0 w w", acts="torque")
    def trailing_brush(
        w, z, w_load, lagged, drag=lg.P(0.0, "N m s/rad", neutral=0.0), tau=lg.P(0.05, "s", 1e-4)
    ):
        """d = drag lagged."""
        return drag * lagged, w - z, (w - w_load) / tau, (w_load - lagged) / tau

    log = motion()
    w = 1.0 + np.sin(5.0 * log.t)
    log = replace(log, w=w, theta=log.t + (1.0 - np.cos(5.0 * log.t)) / 5.0)
    assert refused(trailing_brush) == "" and linear(trailing_brush) == ("drag",)
    assert nonlinear(trailing_brush) == ("tau",)
    made = columns(trailing_brush, {"tau": 0.02}, log).wide
    assert made is not None
    gain = 1.0 / (1.0 + 5.0j * 0.02) ** 2
    want = 1.0 + np.imag(gain * np.exp(5.0j * log.t))
    np.testing.assert_allclose(made[400:, 0], want[400:], atol=1e-4)


def test_own_effect_with_two_parameters_to_search():
    @lg.block("effect", out="d", acts="torque")
    def bump(
        theta,
        height=lg.P(0.0, "N m", neutral=0.0),
        centre=lg.P(0.5, "rad"),
        width=lg.P(0.2, "rad", 1e-3),
    ):
        """d = height exp(-((theta - centre)/width)^2)."""
        return height * np.exp(-(((theta - centre) / width) ** 2))

    log, values = motion(), {"height": 0.2, "centre": 0.3, "width": 0.4}
    assert linear(bump) == ("height",) and nonlinear(bump) == ("centre", "width")
    made = slopes(bump, values, log, nonlinear(bump)).wide
    assert made is not None
    x = (log.theta - 0.3) / 0.4
    want = 0.2 * np.exp(-(x**2))[:, None] * np.stack([2 * x / 0.4, 2 * x**2 / 0.4], axis=1)
    np.testing.assert_allclose(made, want, atol=2e-3)


def test_own_law_with_a_state_z():
    @lg.block("friction", out="F", states="z")
    def soft_seal(w, z, k=lg.P(50.0, "N m/rad", 1e-6), Fc=lg.P(0.2, "N m", 1e-6)):
        """F = k z, dz/dt = w - k |w| z / Fc."""
        return k * z, w - k * np.abs(w) * z / Fc

    log, values = motion(), {"k": 40.0, "Fc": 0.2}
    assert refused(soft_seal) == "" and nonlinear(soft_seal) == ("k", "Fc")
    made = torque(soft_seal, values, log).wide
    assert made is not None
    want = 0.2 * bristle(*strokes(np.diff(log.theta, prepend=log.theta[0])), 0.2 / 40.0)
    smoothly = replace(log, w=slope(log.theta, DT))
    made = torque(soft_seal, values, smoothly).wide
    assert made is not None
    assert np.std(smooth(made[:, 0] - want)) < 2e-3


def test_own_effect_that_is_not_linear_in_its_strength():
    @lg.block("effect", out="d", acts="torque")
    def latch(theta, depth=lg.P(0.0, "N m", neutral=0.0), most=lg.P(0.1, "N m", 0.0)):
        """d = clip(depth theta, -most, most)."""
        return np.clip(depth * theta, -most, most)

    @lg.block("effect", out="d", acts="torque")
    def sharp_latch(theta, sharpness=lg.P(0.0, "1/rad", neutral=0.0)):
        """d = 0.1 tanh(sharpness theta)."""
        return 0.1 * np.tanh(sharpness * theta)

    log = motion()
    assert linear(latch) == ("depth",)  # with the limit that is scaled with it
    assert linear(sharp_latch) == () and nonlinear(sharp_latch) == ("sharpness",)
    made = columns(sharp_latch, {"sharpness": 2.0}, log)
    assert made.wide is not None and made.low == made.high == 1.0
    np.testing.assert_allclose(made.wide[:, 0], 0.1 * np.tanh(2.0 * log.theta))


def test_what_cannot_be_served_is_said():
    @lg.block("effect", out="level", acts="sigma0")
    def softening(t, ratio=lg.P(0.0, "1", neutral=0.0)):
        return ratio * t

    @lg.block("effect", out="d", states="x", acts="torque")
    def branching(w, x, gain=lg.P(0.0, "N m", neutral=0.0)):
        return gain * x, (w if w > 0 else -w) - x

    assert refused(softening) == ("softening acts on sigma0, which is no torque along a motion")
    assert "cannot be compiled" in refused(branching)
    assert "is a controller" in refused(next(iter(members("controller").values())))
    assert refused(REGISTRY["effect", "gravity"]) == ""

"""Signals at one instant: which wirings are loops, and which loops have an answer."""

import control as ct
import numpy as np
import pytest

import lugrectl as lg
from lugrectl.core.errors import Diverged
from lugrectl.engine import AlgebraicLoop
from lugrectl.simulation.response import simulate

from ..cases.own import moving, static, user_block

T = np.arange(0, 0.3, 1e-3)


def last(response, label):
    return float(response.outputs[list(response.output_labels).index(label), -1])


def two_channels():
    """dy/dt = (y + r) - y = r: p passes at once, y follows b through a state."""
    through = static(lambda t, x, u, params: u[0], ["a"], "p", "i1")
    lag = user_block(
        lambda t, x, u, params: [u[0] - x[0]],
        lambda t, x, u, params: [x[0]],
        ["b"],
        ["y"],
        ["x"],
        "i2",
    )
    inner = ct.interconnect([through, lag], inputs=["a", "b"], outputs=["p", "y"], name="inner")
    pass_on = static(lambda t, x, u, params: u[0], ["p"], "b", "g")
    add = static(lambda t, x, u, params: u[0] + u[1], ["y", "r"], "a", "h")
    return [inner, pass_on, add]


def switched():
    """Feed-through only where |x| is beyond 1e9."""
    limited = user_block(
        lambda t, x, u, params: [-x[0] + u[0]],
        lambda t, x, u, params: [np.where(np.abs(x[0]) > 1e9, u[0], x[0])],
        ["v"],
        ["y"],
        ["x"],
        "limited",
    )
    return [limited, static(lambda t, x, u, params: u[1] - u[0], ["y", "r"], "v", "cmp")]


def gained(k):
    feed = static(lambda t, x, u, params: params["k"] * u[0] + u[1], ["y", "r"], "v", "k", k=k)
    return [feed, static(lambda t, x, u, params: 2 * u[0], ["v"], "y", "gain")]


def lags():
    C = ct.ss(ct.tf([1, 2], [1, 1]), name="C", inputs=["e"], outputs=["v"])
    G = ct.ss(ct.tf([0.5, 3], [1, 1]), name="G", inputs=["v"], outputs=["y"])
    return [C, G, ct.summing_junction(["r", "-y"], "e", name="S")]


def closed_lags():
    return ct.feedback(ct.tf([1, 2], [1, 1]) * ct.tf([0.5, 3], [1, 1]))


# Wirings without a loop, and loops with one answer.


def test_two_channels_of_one_block_are_no_loop_in_whatever_order():
    inner, pass_on, add = two_channels()
    for blocks in ([inner, pass_on, add], [add, pass_on, inner], [pass_on, inner, add]):
        assert last(simulate(blocks, T, {"r": 1.0}), "y") == pytest.approx(0.299, abs=1e-9)


def test_a_feedthrough_that_is_switched_off_is_no_loop():
    system = ct.interconnect(switched(), inputs=["r"], outputs=["y"])
    theirs = ct.input_output_response(system, T, np.ones_like(T), solve_ivp_method="LSODA")
    y = last(simulate(switched(), T, {"r": 1.0}), "y")
    assert y == pytest.approx(theirs.outputs[-1], rel=1e-4)
    assert y == pytest.approx(0.5 * (1 - np.exp(-2 * T[-1])), rel=1e-5)


@pytest.mark.parametrize("k", [0.3, -4.0])
def test_a_loop_of_gains_is_solved(k):
    """y = 2 (k y + r): y = 2 r/(1 - 2 k), also with a gain of the call."""
    assert last(simulate(gained(k), T, {"r": 1.0}), "y") == pytest.approx(2 / (1 - 2 * k))
    again = simulate(gained(0.1), T, {"r": 1.0}, params={"k": k})
    assert last(again, "y") == pytest.approx(2 / (1 - 2 * k))


@pytest.mark.parametrize("method", ["LSODA", "rosenbrock"])
@pytest.mark.parametrize("hold", [False, True])
def test_every_solver_takes_a_loop_that_has_an_answer(method, hold):
    t = T[:30]
    r = np.sin(40 * t)
    found = simulate(lags(), t, r, method=method, hold=hold)
    closed = ct.ss(closed_lags())
    theirs = ct.forced_response(ct.sample_system(closed, 1e-3) if hold else closed, t, r).outputs
    y = found.outputs[list(found.output_labels).index("y")]
    assert y == pytest.approx(theirs, abs=3e-5)


@pytest.mark.filterwarnings("ignore:block slow:RuntimeWarning")
def test_a_loop_beside_a_block_that_cannot_be_traced():
    slow = moving(
        lambda t, x, u, params: [u[0] - x[0] if u[0] > -1e3 else 0.0], ["late"], "slow", ["y"]
    )
    t = T[:20]
    found = last(simulate([*lags(), slow], t, {"r": 1.0}), "y")
    theirs = ct.forced_response(closed_lags(), t, np.ones_like(t)).outputs[-1]
    assert found == pytest.approx(theirs, rel=1e-5)


@pytest.mark.parametrize("samples", [50, 3000])
def test_sampled_loops_are_solved_too(samples):
    """A discrete system on its own, called or traced: q+ = 0.5 q + v, v = r - 0.5 (v + q)."""
    lag = user_block(
        lambda t, x, u, params: [0.5 * x[0] + u[0]],
        lambda t, x, u, params: [0.5 * (u[0] + x[0])],
        ["v"],
        ["y"],
        ["q"],
        "lag",
        dt=0.1,
    )
    minus = static(lambda t, x, u, params: u[1] - u[0], ["y", "r"], ["v"], "m", dt=0.1)
    system = ct.interconnect([lag, minus], inputs=["r"], outputs=["v"])
    v = simulate(system, 0.1 * np.arange(samples), 1.0).outputs
    q, expected = 0.0, []
    for _ in range(samples):
        expected.append((1 - 0.5 * q) / 1.5)
        q = 0.5 * q + expected[-1]
    assert v == pytest.approx(np.array(expected))


@pytest.mark.parametrize("traced", [True, False])
def test_two_channels_between_sampled_and_continuous_blocks(traced):
    """w = u1 at once, u1 = w2 at once, w2 through a state: a chain through one block twice."""
    two = user_block(
        lambda t, x, u, params: [u[1]],
        lambda t, x, u, params: [u[0], x[0]],
        ["a", "b"],
        ["p", "q"],
        ["x"],
        "two",
    )
    back = static(lambda t, x, u, params: u[0], ["q"], "a", "back")

    def drive(t, x, u, params):
        return np.array([1.0 - u[0] if traced or u[0] > -1e9 else 0.0])

    held = static(drive, ["p"], ["b"], "held", dt=0.1)
    response = simulate([held, back, two], 0.1 * np.arange(4))
    q = response.outputs[list(response.output_labels).index("q")]
    assert q == pytest.approx(1 - 0.9 ** np.arange(4))


# Loops without one answer.


@pytest.mark.parametrize(
    "blocks",
    [
        gained(0.5),  # y = y + 2 r
        [
            static(lambda t, x, u, params: np.tanh(u[0]) + u[1], ["y", "r"], "v", "k"),
            static(lambda t, x, u, params: 2 * u[0], ["v"], "y", "gain"),
        ],
        [
            static(lambda t, x, u, params: u[0] * u[1], ["y", "r"], "v", "k"),
            static(lambda t, x, u, params: u[0] * u[0], ["v"], "y", "gain"),
        ],
    ],
)
def test_a_loop_that_is_not_linear_or_has_no_answer_is_refused(blocks):
    with pytest.raises(lg.InputError, match="algebraic loop through k, gain;"):
        simulate(blocks, T, {"r": 1.0})


def test_a_gain_of_the_call_that_leaves_no_answer_is_refused():
    simulate(gained(0.1), T, {"r": 1.0})
    with pytest.raises(lg.InputError, match="algebraic loop through k, gain;"):
        simulate(gained(0.1), T, {"r": 1.0}, params={"k": 0.5})


# A loop through a clip, and an if that chatters.


TIMES = np.linspace(0, 1, 41)


def clip(t, x, u, params):
    return np.clip(u[0], -1.0, 1.0)


def branch(t, x, u, params):
    return 1.0 if u[0] > 1.0 else -1.0 if u[0] < -1.0 else u[0]


def loop(law, gain):
    """b = law(r - gain b), through a lag."""
    return [
        static(law, ["a"], ["b"], "law"),
        static(lambda t, x, u, p: u[0] - gain * u[1], ["r", "b"], ["a"], "sum"),
        user_block(lambda t, x, u, p: u - x, None, ["b"], ["y"], 1, "lag"),
    ]


@pytest.mark.parametrize("law", [clip, branch, lambda t, x, u, p: u[0] ** 3])
@pytest.mark.filterwarnings("ignore:.*branch:RuntimeWarning")
def test_a_loop_through_a_clip_is_refused(law):
    with pytest.raises(AlgebraicLoop, match="through law, sum; .* by linear"):
        lg.simulate(loop(law, -1.5), TIMES, {"r": TIMES})


@pytest.mark.parametrize("method, hold", [(None, False), ("LSODA", True)])
@pytest.mark.filterwarnings("ignore:block relay:RuntimeWarning")
def test_an_if_that_chatters_ends_with_a_sentence(method, hold):
    relay = user_block(
        lambda t, x, u, p: [-1.0 if x[0] > u[0] else 1.0], None, ["u"], ["x"], 1, "relay"
    )
    with pytest.raises(Diverged, match=r"relay: a comparison .* near t = 0\.5"):
        lg.simulate(relay, TIMES, 0 * TIMES, [0.5], method=method, hold=hold)
    lg.simulate(relay, TIMES, 0 * TIMES + 9.0, [0.5], method=method, hold=hold)  # never reaches it


# Errors name the block at fault, traced or not.


def _log_of_a_fall(branch):
    """x falls from 1 to 0 in one second; its logarithm is scaled by a block behind."""
    first = user_block(lambda t, x, u, p: -1.0 + 0 * x, None, 0, ["x"], 1, "fall")
    curve = static(
        lambda t, x, u, p: np.sqrt(u[0]) if not branch or u[0] < 9 else 0.0, ["x"], ["y"], "curve"
    )
    gain = static(lambda t, x, u, p: 2 * u[0], ["y"], ["v"], "gain")
    return ct.interconnect([first, curve, gain], outputs=["v"], inputs=False, name="chain")


@pytest.mark.parametrize("branch", [False, True])
@pytest.mark.filterwarnings("ignore:block curve:RuntimeWarning")
def test_the_block_that_makes_a_nan_is_named(branch):
    """Not the ones behind it, and not as the algebraic loop that python-control reports."""
    with pytest.raises(Diverged, match=r"chain: output y of block curve is nan at t = 1[.\d]* s"):
        simulate(_log_of_a_fall(branch), np.linspace(0, 2, 17), x0=1.0)


@pytest.mark.parametrize("as_list", [False, True])
def test_a_block_need_not_be_finite_where_all_its_inputs_are_zero(as_list):
    """python-control's first pass gives zeros to blocks that the system never gives them."""

    blocks = [
        static(lambda t, x, u, p: u[0] * u[1], ["duty", "V"], ["v"], "inverter"),
        static(lambda t, x, u, p: u[0] / u[1], ["u", "V"], ["duty"], "share"),
        static(lambda t, x, u, p: 24.0 - 2.0 * np.sin(t), 0, ["V"], "supply"),
        user_block(lambda t, x, u, p: u, None, ["v"], ["y"], 1, "sum", dt=0),
    ]
    system = blocks if as_list else ct.interconnect(blocks, inputs=["u"], outputs=["y"])
    t = np.linspace(0, 2, 41)
    found = simulate(system, t, {"u": np.ones(41)} if as_list else np.ones(41))
    y = np.atleast_2d(found.outputs)[list(found.output_labels).index("y")]
    np.testing.assert_allclose(y, t, atol=1e-6)

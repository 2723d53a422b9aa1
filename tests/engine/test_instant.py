"""Signals at one instant: which wirings are loops, and which loops have an answer."""

import control as ct
import numpy as np
import pytest

import lugrectl as lg
from lugrectl.engine.expression.affine import affine, solve
from lugrectl.engine.expression.graph import Graph, evaluate
from lugrectl.simulation.response import simulate

from ..cases.own import user_block

T = np.arange(0, 0.3, 1e-3)


def static(name, inputs, output, function, **params):
    return user_block(None, function, inputs, [output], None, name, **params)


def last(response, label):
    return float(response.outputs[list(response.output_labels).index(label), -1])


def two_channels():
    """dy/dt = (y + r) - y = r: p passes at once, y follows b through a state."""
    through = static("i1", ["a"], "p", lambda t, x, u, params: u[0])
    lag = user_block(
        lambda t, x, u, params: [u[0] - x[0]],
        lambda t, x, u, params: [x[0]],
        ["b"],
        ["y"],
        ["x"],
        "i2",
    )
    inner = ct.interconnect([through, lag], inputs=["a", "b"], outputs=["p", "y"], name="inner")
    pass_on = static("g", ["p"], "b", lambda t, x, u, params: u[0])
    add = static("h", ["y", "r"], "a", lambda t, x, u, params: u[0] + u[1])
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
    return [limited, static("cmp", ["y", "r"], "v", lambda t, x, u, params: u[1] - u[0])]


def gained(k):
    feed = static("k", ["y", "r"], "v", lambda t, x, u, params: params["k"] * u[0] + u[1], k=k)
    return [feed, static("gain", ["v"], "y", lambda t, x, u, params: 2 * u[0])]


def lags():
    C = ct.ss(ct.tf([1, 2], [1, 1]), name="C", inputs=["e"], outputs=["v"])
    G = ct.ss(ct.tf([0.5, 3], [1, 1]), name="G", inputs=["v"], outputs=["y"])
    return [C, G, ct.summing_junction(["r", "-y"], "e", name="S")]


def closed_lags():
    return ct.feedback(ct.tf([1, 2], [1, 1]) * ct.tf([0.5, 3], [1, 1]))


# Wirings without a loop, and loops with one answer.


def test_two_channels_of_one_block_are_no_loop():
    response = simulate(two_channels(), T, {"r": 1.0})
    assert last(response, "y") == pytest.approx(0.299, abs=1e-9)


def test_the_order_of_blocks_does_not_matter():
    inner, pass_on, add = two_channels()
    for blocks in ([add, pass_on, inner], [pass_on, inner, add]):
        assert last(simulate(blocks, T, {"r": 1.0}), "y") == pytest.approx(0.299, abs=1e-9)


def test_a_feedthrough_that_is_switched_off_is_no_loop():
    system = ct.interconnect(switched(), inputs=["r"], outputs=["y"])
    theirs = ct.input_output_response(system, T, np.ones_like(T), solve_ivp_method="LSODA")
    y = last(simulate(switched(), T, {"r": 1.0}), "y")
    assert y == pytest.approx(theirs.outputs[-1], rel=1e-4)
    assert y == pytest.approx(0.5 * (1 - np.exp(-2 * T[-1])), rel=1e-5)


def test_a_feedthrough_that_is_switched_on_is_solved():
    """y = r - y there: y = r/2."""
    system = ct.interconnect(switched(), inputs=["r"], outputs=["y"])
    response = simulate(system, [0.0, 1e-6], 1.0, [2e9])
    assert response.outputs == pytest.approx([0.5, 0.5])


@pytest.mark.parametrize("k", [0.0, 0.3, -4.0])
def test_a_loop_of_gains_is_solved(k):
    """y = 2 (k y + r): y = 2 r/(1 - 2 k), also with a gain of the call."""
    assert last(simulate(gained(k), T, {"r": 1.0}), "y") == pytest.approx(2 / (1 - 2 * k))
    again = simulate(gained(0.1), T, {"r": 1.0}, params={"k": k})
    assert last(again, "y") == pytest.approx(2 / (1 - 2 * k))


def test_a_linear_loop_with_feedthrough_is_that_of_its_closed_form():
    theirs = ct.forced_response(closed_lags(), T, np.ones_like(T))
    y = last(simulate(lags(), T, {"r": 1.0}), "y")
    assert y == pytest.approx(theirs.outputs[-1], rel=1e-6)
    assert y == pytest.approx(0.624149, abs=1e-6)


@pytest.mark.parametrize("method", ["LSODA", "rosenbrock"])
@pytest.mark.parametrize("hold", [False, True])
def test_every_solver_takes_a_loop_that_has_an_answer(method, hold):
    t = T[:60]
    r = np.sin(20 * t)
    found = simulate(lags(), t, r, method=method, hold=hold)
    closed = ct.ss(closed_lags())
    theirs = ct.forced_response(ct.sample_system(closed, 1e-3) if hold else closed, t, r).outputs
    y = found.outputs[list(found.output_labels).index("y")]
    assert y == pytest.approx(theirs, abs=3e-5)


@pytest.mark.filterwarnings("ignore:block slow:RuntimeWarning")
def test_a_loop_beside_a_block_that_cannot_be_traced():
    slow = user_block(
        lambda t, x, u, params: [u[0] - x[0] if u[0] > -1e3 else 0.0],
        None,
        ["y"],
        ["late"],
        ["late"],
        "slow",
    )
    t = T[:40]
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
    minus = user_block(
        None, lambda t, x, u, params: u[1] - u[0], ["y", "r"], ["v"], None, "m", dt=0.1
    )
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
    back = static("back", ["q"], "a", lambda t, x, u, params: u[0])

    def drive(t, x, u, params):
        return np.array([1.0 - u[0] if traced or u[0] > -1e9 else 0.0])

    held = user_block(None, drive, ["p"], ["b"], None, "held", dt=0.1)
    response = simulate([held, back, two], 0.1 * np.arange(4))
    q = response.outputs[list(response.output_labels).index("q")]
    assert q == pytest.approx(1 - 0.9 ** np.arange(4))


# Loops without one answer.


@pytest.mark.parametrize(
    "blocks",
    [
        gained(0.5),  # y = y + 2 r
        [
            static("k", ["y", "r"], "v", lambda t, x, u, params: np.tanh(u[0]) + u[1]),
            static("gain", ["v"], "y", lambda t, x, u, params: 2 * u[0]),
        ],
        [
            static("k", ["y", "r"], "v", lambda t, x, u, params: u[0] * u[1]),
            static("gain", ["v"], "y", lambda t, x, u, params: u[0] * u[0]),
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


def test_a_value_that_exists_at_large_signals_only_is_no_fault(recwarn):
    """log(v - 100): nothing to compare at usual sizes, so larger ones are tried."""
    block = user_block(
        lambda t, x, u, params: [-np.log(u[0] - 100.0) * x[0]],
        lambda t, x, u, params: [x[0]],
        ["v"],
        ["x"],
        ["x"],
        "narrow",
    )
    response = simulate(block, [0.0, 0.5, 1.0], 100.0 + np.e, 1.0)
    assert response.outputs == pytest.approx(np.exp([0.0, -0.5, -1.0]), rel=1e-5)
    assert not recwarn.list


# Affine expressions.


def test_forms_hold_the_slopes_and_the_offset():
    graph = Graph()
    x, y, v = (graph.symbol(k) for k in "xyv")
    root = np.where(v > 0, 3 * x - y * np.sin(v), (x + 1) / v) - (2 - y)
    (form,) = affine([root], [x, y])
    assert form is not None
    for value in (0.4, -2.0):
        a, b, c = evaluate([form.slopes[x.index], form.slopes[y.index], form.offset], {"v": value})
        (whole,) = evaluate([root], {"x": 7.0, "y": -5.0, "v": value})
        assert a * 7.0 - b * 5.0 + c == pytest.approx(whole)


def test_a_symbol_that_cancels_is_in_no_form():
    graph = Graph()
    x, v = graph.symbol("x"), graph.symbol("v")
    (form,) = affine([np.sin(np.where(v > 0, x, x) - x + v) * v], [x])
    assert form is not None and not form.slopes
    (value,) = evaluate([form.offset], {"v": 2.0})  # x is not needed
    assert value == pytest.approx(2 * np.sin(2.0))


@pytest.mark.parametrize(
    "build",
    [
        lambda x, v: x * x,
        lambda x, v: v / x,
        lambda x, v: np.abs(x),
        lambda x, v: np.clip(x, -1, 1),
        lambda x, v: np.where(x > 1e9, x, 0.0),
        lambda x, v: v * x**3,
        lambda x, v: np.sign(x),
    ],
)
def test_what_is_not_affine_everywhere_has_no_form(build):
    graph = Graph()
    x, v = graph.symbol("x"), graph.symbol("v")
    assert affine([build(x, v)], [x]) == [None]
    assert affine([build(x, v)], [v])[0] is not None or build(x, v).op == "divide"


def test_linear_equations_are_solved_whatever_their_order():
    random = np.random.default_rng(3)
    matrix, offset = random.normal(size=(4, 4)), random.normal(size=4)
    matrix[0, 0] = matrix[2, 2] = 0.0
    graph = Graph()
    symbols = [graph.symbol(f"s{k}") for k in range(4)]
    rows = zip(offset, matrix.tolist(), strict=True)
    roots = [graph.total([b, *map(np.multiply, row, symbols)]) for b, row in rows]
    forms = affine(roots, symbols)
    solved = solve(symbols, forms, lambda divisor: True)
    assert evaluate(solved, {}) == pytest.approx(np.linalg.solve(np.eye(4) - matrix, offset))

"""A table over a signal as a block, and the table that an unexplained residual becomes."""

import json
from dataclasses import replace

import control as ct
import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from matplotlib.figure import Figure
from scipy.signal import lfilter

import lugrectl as lg
from lugrectl.core.errors import InputError
from lugrectl.identification.dataset.dataset import Log
from lugrectl.identification.unknown_torque.table import tabulate

DT = 1e-3
NOISE = 0.02

# --- the block ---------------------------------------------------------------------------


def value(block, x, t=0.0, params=None):
    return float(block.output(t, [], np.atleast_1d(x), params=params)[0])


@given(
    st.lists(st.floats(-1.0, 1.0), min_size=2, max_size=12),
    st.floats(-3.0, 15.0),
    st.floats(0.1, 2.0),
)
def test_a_table_is_the_line_through_its_points(values, x, step):
    points = step * np.arange(len(values))
    block = lg.tabulated("theta", points, values)
    bends = np.abs(np.diff(np.r_[values[0], values, values[-1]], 2)).max()
    # corners are rounded over 2 % of the step; each adds at most width^2/(4 distance) elsewhere
    assert value(block, x) == pytest.approx(np.interp(x, points, values), abs=0.03 * bends + 1e-12)


@given(st.floats(-20.0, 20.0), st.integers(-3, 3))
@example(np.pi, -1)  # the place where an angle is wrapped
def test_a_periodic_table_repeats_every_turn(x, turns):
    points = np.array([-2.5, -1.0, 0.2, 1.5, 3.0])
    values = np.array([0.3, -0.2, 0.1, 0.4, -0.1])
    block = lg.tabulated("theta", points, values, periodic=True)
    assert value(block, x) == pytest.approx(value(block, x + 2 * np.pi * turns), abs=1e-9)
    expected = np.interp(x, points, values, period=2 * np.pi)
    assert value(block, x) == pytest.approx(expected, abs=0.02)


def test_two_rows_are_the_two_directions():
    block = lg.tabulated("theta", [0.0, 1.0, 2.0], [[0.1, 0.2, 0.2], [-0.3, -0.1, 0.0]])
    assert block.input_labels == ["theta", "w"]
    forward, back = (value(block, [0.5, w]) for w in (0.1, -0.1))
    assert forward == pytest.approx(0.15, abs=0.003) and back == pytest.approx(-0.2, abs=0.005)
    assert value(block, [0.5, 0.0]) == pytest.approx(0.5 * (forward + back))


def test_a_table_over_time_has_no_input_and_a_scale_switches_it_off():
    block = lg.tabulated("t", [0.0, 2.0], [0.0, 1.0], name="late")
    assert not block.input_labels and block.output_labels == ["d"]
    assert value(block, [], t=1.0) == pytest.approx(0.5, abs=1e-3)
    assert value(block, [], t=1.0, params={"late.scale": 0.0}) == 0.0


@pytest.mark.parametrize(
    "arguments, periodic",
    [
        (("z", [0, 1], [0, 1]), False),
        (("theta", [0, 0], [0, 1]), False),
        (("theta", [0], [1]), False),
        (("theta", [0, 1], [0, 1, 2]), False),
        (("theta", [0, 1], [0, np.nan]), False),
        (("w", [0, 1], [[0, 1], [0, 1]]), False),
        (("w", [0, 1], [0, 1]), True),
        (("theta", [0, 7], [0, 1]), True),
    ],
)
def test_what_is_no_table_is_said(arguments, periodic):
    with pytest.raises(InputError, match="table"):
        lg.tabulated(*arguments, periodic=periodic)


def test_the_engine_traces_a_table_as_python_control_evaluates_it():
    points = np.linspace(-1.5, 1.5, 7)
    values = np.array([0.05 * np.sin(3 * points), -0.03 + 0.02 * points])
    block = lg.tabulated("theta", points, values)
    loop = ct.interconnect(
        [lg.plant(lg.table1()), block],
        inputs=["u"],
        outputs=["theta", "w", "d"],
        params={},
        check_unused=False,
    )
    t = np.linspace(0.0, 1.0, 201)
    u = 0.6 * np.sin(6.0 * t)
    fast = lg.simulate(loop, t, u)
    options = {"rtol": 1e-8, "atol": 1e-10}
    slow = ct.input_output_response(loop, t, u, solve_ivp_method="LSODA", solve_ivp_kwargs=options)
    assert np.ptp(slow.outputs[0]) > 1.0
    for a, b in zip(fast.outputs, slow.outputs, strict=True):
        differ = np.abs(a - b)[1:]  # at first it rests, held by friction, which tanh(0) is not
        assert np.max(differ) < 2e-3 * np.ptp(b)


# --- the table of a residual -------------------------------------------------------------


def bumps(x):
    """Two narrow bumps, once per turn."""
    near = [np.mod(x - c + np.pi, 2 * np.pi) - np.pi for c in (1.0, -1.7)]
    return 0.05 * np.exp(-((near[0] / 0.3) ** 2)) - 0.04 * np.exp(-((near[1] / 0.4) ** 2))


def hump(w):
    return 0.04 * np.sign(w) * np.exp(-(((np.abs(w) - 2.0) / 0.5) ** 2))


def log_of(seed=0, seconds=60):
    t = np.arange(round(seconds / DT)) * DT
    w = 4.0 * np.cos(0.7 * t) + 1.5 * np.sin(2.1 * t + seed)
    runs = ((0, len(t)),)
    u = 0.3 * np.sign(w)
    return Log(t, np.cumsum(w) * DT, w, np.gradient(w, DT), u, 0.0 * t, DT, "rotary", runs)


def tabled(function, signals, seed=0, draws=0):
    """Windows of one second of a function under coloured noise, and their table."""
    log = log_of(seed)
    a = 0.95
    white = np.random.default_rng(seed).normal(size=len(log.t))
    noise = NOISE * lfilter([np.sqrt(1 - a * a)], [1.0, -a], white)
    counted = np.arange(len(log.t)).reshape(-1, 1000)
    torque = (function(log) + noise)[counted]
    return tabulate(torque, log, counted, signals, seed=draws), torque


CASES = {
    ("theta",): (lambda log: bumps(log.theta), lambda x, way: bumps(x)),
    ("theta", "w"): (
        lambda log: np.sign(log.w) * bumps(log.theta),
        lambda x, way: way * bumps(x),
    ),
    ("w",): (lambda log: hump(log.w), lambda x, way: hump(x)),
    ("t",): (
        lambda log: 0.04 * np.exp(-(((log.t - 20.0) / 5.0) ** 2)),
        lambda x, way: 0.04 * np.exp(-(((x - 20.0) / 5.0) ** 2)),
    ),
}


LONG = [s if len(s) == 1 else pytest.param(s, marks=pytest.mark.slow) for s in CASES]


@pytest.mark.cases
@pytest.mark.parametrize("signals", LONG, ids=" ".join)
def test_a_known_function_is_recovered_within_its_band(signals):
    function, truth = CASES[signals]
    inside = []
    for seed in range(5):
        made, _ = tabled(function, signals, seed)
        rows, errors = np.atleast_2d(made.values), np.atleast_2d(made.error)
        true = np.array([truth(made.points, way) for way in (1, -1)[: len(rows)]])
        inside += list((np.abs(rows - true) < 1.96 * errors).ravel())
        assert np.sqrt(np.mean((rows - true) ** 2)) < 0.4 * np.sqrt(np.mean(true**2))
    assert 0.85 < np.mean(inside) <= 1.0


def test_the_share_is_that_of_the_power_and_covers_it():
    made, torque = tabled(CASES["theta",][0], ("theta",))
    cells = torque.reshape(len(torque), -1, 10).mean(2)
    log = log_of()
    true = np.sum(bumps(log.theta).reshape(-1, 10).mean(1) ** 2) / np.sum(cells**2)
    low, high = made.share95
    assert low < true < high and low < made.share < high
    assert high - low < 0.25 and made.periodic
    assert made.rms == pytest.approx(np.sqrt(np.mean(bumps(log.theta) ** 2)), rel=0.2)


def test_where_nothing_is_left_the_share_is_none():
    made, _ = tabled(lambda log: 0.0 * log.t, ("theta",))
    assert -0.05 < made.share < 0.02 and made.share95[0] < 0.02
    assert np.max(np.abs(made.values)) < 5.0 * NOISE


def test_resampling_is_seeded():
    first, again = (tabled(CASES["w",][0], ("w",))[0] for _ in range(2))
    other, _ = tabled(CASES["w",][0], ("w",), draws=1)
    assert np.array_equal(first.error, again.error)
    assert np.array_equal(first.values, other.values)
    assert not np.array_equal(first.error, other.error)


@pytest.mark.parametrize("signals", [(), ("a",), ("w", "theta"), ("u", "w")])
def test_other_signals_make_no_table(signals):
    assert tabled(lambda log: 0.0 * log.t, signals)[0] is None


def test_a_fading_torque_constant_is_a_table_for_each_direction():
    made, _ = tabled(lambda log: 3.0 * log.u * log.t / log.t[-1], ("t", "u"))
    assert made is not None and made.signals == ("t", "w") and made.share > 0.8


def test_a_table_seen_at_one_place_only_is_no_crash():
    """A drive that rests but for one move: a straight line through the rest is open."""
    log = log_of()
    moved = np.where(log.t > 59.0, 1.0, 1e-9)
    still = replace(log, theta=moved * (log.t - 59.0), motion="linear")
    counted = np.arange(len(log.t)).reshape(-1, 1000)
    noise = NOISE * np.random.default_rng(0).normal(size=counted.shape)
    made = tabulate(noise, still, counted, ("theta",))
    assert made is not None and np.all(np.isfinite(made.error))
    assert np.abs(made.values[0]) < NOISE  # where it was


def test_too_few_windows_make_no_table():
    log = log_of(seconds=4)
    counted = np.arange(4000).reshape(-1, 1000)
    assert tabulate(np.zeros((4, 1000)), log, counted, ("theta",)) is None


def test_the_block_of_a_table_reproduces_the_torque_in_a_closed_loop():
    made, _ = tabled(CASES["theta",][0], ("theta",))
    loop = ct.interconnect(
        [lg.velocity_loop(lg.table1(), "natural", load=True), made.block()],
        inputs=["r"],
        outputs=["theta", "d"],
        params={},
        check_unused=False,
    )
    t = np.linspace(0.0, 4.0, 801)
    theta, d = lg.simulate(loop, t, np.full(len(t), 2.0)).outputs
    assert np.ptp(theta) > 6.0
    assert np.sqrt(np.mean((d - bumps(theta)) ** 2)) < 0.3 * np.sqrt(np.mean(bumps(theta) ** 2))


def test_a_table_says_what_it_is_and_can_be_drawn():
    made, _ = tabled(CASES["theta", "w"][0], ("theta", "w"))
    said = made.summary()
    json.dumps(said, allow_nan=False)
    over = "theta and the direction of w"
    assert said["name"] == f"unexplained residual over {over} (table, no physics)"
    assert np.shape(said["values"]) == np.shape(said["standard_error"]) == (2, len(said["points"]))
    ax = made.plot(Figure().subplots())
    assert len(ax.lines) == 2 and ax.get_ylabel() == "torque [N m]"

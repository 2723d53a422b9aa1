"""sweep() against simulate() and closed forms, and what becomes of members that fail."""

from __future__ import annotations

import json
import math
import tracemalloc
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from multiprocessing import get_context

import control as ct
import numpy as np
import pytest

import lugrectl as lg
from lugrectl.core.errors import InputError
from lugrectl.engine import adaptive_run
from lugrectl.engine.tracer import Net, traced_net
from lugrectl.simulation.sweep import parameter_columns

from ..cases.ensembles import T, growth, lag, last, noise, ramp, step_response
from ..cases.own import static, user_block
from ..cases.systems import velocity_loop
from ..conftest import there

pytestmark = pytest.mark.usefixtures("interpreted")

GAINS, TAUS = np.linspace(0.5, 2, 7), np.linspace(0.05, 0.5, 7)
TABLE = {"lag.gain": GAINS, "lag.tau": TAUS}


def test_step_responses_of_a_lag() -> None:
    s = lg.sweep(lag(), T, 1.0, TABLE, states=True)
    assert np.allclose(s["y"], step_response(GAINS, TAUS), atol=1e-5)
    assert s.y is not None and s.y.shape == (7, 2, len(T)) and s.done.all() and not s.failed
    assert np.array_equal(s["double"], 2 * s["y"]) and np.array_equal(s["x"], s["y"])


def test_members_are_what_simulate_gives_one_by_one() -> None:
    loop, t = velocity_loop(lg.plant(lg.table1())), np.arange(0, 0.1, 1e-3)
    r, rng = np.sin(2 * np.pi * 10 * t), np.random.default_rng(0)
    rows = [{"plant.Fc": rng.uniform(0.2, 0.3), "pi.kp": rng.uniform(1, 2)} for _ in range(4)]
    x0 = np.zeros((4, 4))
    x0[:, 2] = rng.uniform(0, 1e-3, 4)
    s = lg.sweep(loop, t, r, rows, x0=x0, outputs=["u", "w"], hold=True)
    for i, row in enumerate(rows):
        alone = lg.simulate(loop, t, r, x0[i], params=row, hold=True)
        both = [alone.outputs[alone.output_labels.index(k)] for k in ("u", "w")]
        assert np.array_equal(s.y[i], both)


def test_compiled_on_threads_as_in_plain_python(monkeypatch: pytest.MonkeyPatch) -> None:
    made_by = there("c")
    plain = lg.sweep(lag(), T, 1.0, TABLE)
    monkeypatch.setattr(adaptive_run, "compiler", lambda: made_by)
    for jobs, chunk in ((2, 2), (1, None), (3, 1)):
        fast = lg.sweep(lag(), T, 1.0, TABLE, jobs=jobs, chunk=chunk)
        assert np.allclose(fast.y, plain.y, rtol=1e-12, atol=1e-15)


def test_a_worker_leaves_the_code_that_threads_share_as_it_is() -> None:
    shared = adaptive_run.Engine(traced_net(Net.of(lag())), "c").portable()
    first, before = shared.loaded(), dict(vars(shared))
    first._runs["c"] = "in use"
    assert shared.loaded() is not first and first._runs == {"c": "in use"}
    assert vars(shared) == before


def test_every_form_of_a_table_says_the_same() -> None:
    pandas = pytest.importorskip("pandas")
    whole = {"Fc": np.array([1.0, 2.0, 0.5]), "pi.kp": np.array([3.0, 4.0, 5.0])}
    records = np.zeros(3, dtype=[(k, float) for k in whole])
    for k, v in whole.items():
        records[k] = v
    rows = [{k: v[i] for k, v in whole.items()} for i in range(3)]
    frame = pandas.DataFrame(whole)
    for form in (whole, rows, records, frame, frame.astype(object)):
        found = parameter_columns(form)
        assert list(found) == list(whole)
        assert all(np.array_equal(found[k], whole[k]) for k in whole)


@pytest.mark.parametrize(
    "params, message",
    [
        ({"a": [1, 2], "b": [1, 2, 3]}, "differ in length: a 2, b 3"),
        ([{"a": 1}, {"b": 1}], "members 0 and 1"),
        ([], "empty list"),
        ({"a": ["x"]}, "column 'a' holds a value that is not a number"),
        ({"a": [1j]}, "not a number"),
        ({"a": [[1, 2]]}, r"shape \(1, 2\)"),
        (np.zeros(3), "without names"),
        ("a=1", "params is a str"),
        ({"lag.gain": []}, "no members"),
        ({"lag.gian": [1.0]}, "no block reads the parameter 'lag.gian'"),
    ],
)
def test_tables_that_cannot_be_understood(params, message) -> None:
    with pytest.raises(InputError, match=message):
        lg.sweep(lag(), T, 1.0, params)


@pytest.mark.parametrize("key", ["plant.Fc", "plant.J", "plant.sigma1", "natural_observer.vs"])
def test_bounds_are_checked_as_simulate_checks_them(key) -> None:
    loop = lg.velocity_loop(lg.table1(), "natural")
    with pytest.raises(InputError) as one:
        lg.simulate(loop, T, 0.1, params={key: -0.01})
    with pytest.raises(InputError) as many:
        lg.sweep(loop, T, 0.1, {key: [0.01, -0.01, 0.02]})
    assert str(one.value) == str(many.value) and key in str(one.value)


@pytest.mark.parametrize(
    "options, message",
    [
        ({"x0": np.zeros((3, 1))}, "params 7, x0 3"),
        ({"x0": np.zeros((7, 2))}, r"needs \(members, 1\)"),
        ({"x0": [1, 2]}, "x0 has 2"),
        ({"seeds": 7}, "give inputs as a function"),
        ({"inputs": noise, "seeds": 3}, "params 7, seeds 3"),
        ({"inputs": noise, "seeds": ["x"]}, "whole numbers"),
        ({"outputs": ["v"]}, "no output 'v'; it has y, double"),
        ({"states": ["v"]}, "no state 'v'; it has x"),
        ({"jobs": 0}, "jobs must be a whole number"),
        ({"chunk": 1.5}, "chunk must be a whole number"),
        ({"inputs": [np.nan] * len(T)}, "input u is nan"),
    ],
)
def test_wrong_usage(options, message) -> None:
    given = {"inputs": 1.0, "params": TABLE} | options
    with pytest.raises(InputError, match=message):
        lg.sweep(lag(), T, given.pop("inputs"), given.pop("params"), **given)


def test_members_that_fail_are_reported_and_the_rest_are_right() -> None:
    start = np.array([[0.5], [2.0], [-1.0], [np.nan], [0.25]])
    with pytest.warns(RuntimeWarning, match="2 of 5 members failed; member 1: growth: .* t = 0.5"):
        s = lg.sweep(growth(), T, x0=start, states=True)
    assert set(s.failed) == {1, 3} and "x0" in s.failed[3] and s.done.all()
    assert s.ok.tolist() == [True, False, True, False, True]
    assert np.isnan(s.y[[1, 3]]).all() and np.isnan(s.x[[1, 3]]).all()
    good = start[s.ok]
    assert np.allclose(s["x"][s.ok], good / (1 - good * T), rtol=1e-5)


def test_a_parameter_that_is_nan_and_inputs_that_raise() -> None:
    with pytest.warns(RuntimeWarning, match="2 of 5"):
        s = lg.sweep(lag(), T, ramp, {"lag.gain": [1, np.nan, 1, 1, 1]})
    assert s.failed == {
        1: "parameter lag.gain is nan.",
        3: "inputs: LookupError: no file for three",
    }
    alone = lg.simulate(lag(), T, 4 * T).outputs[0]
    assert np.array_equal(s["y"][4], alone)


def test_random_inputs_hang_on_the_seed_alone() -> None:
    whole = lg.sweep(lag(), T, noise, seeds=7)
    for chunk in (1, 3, 100):
        assert np.array_equal(lg.sweep(lag(), T, noise, seeds=7, chunk=chunk).y, whole.y)
    assert len(np.unique(whole["y"][:, -1])) == 7
    own = lg.sweep(lag(), T, noise, seeds=[5, 9, 5])
    drawn = np.random.default_rng(np.random.SeedSequence(9)).standard_normal(len(T))
    assert np.array_equal(own["y"][1], lg.simulate(lag(), T, drawn).outputs[0])
    assert np.array_equal(own.y[0], own.y[2])
    parts = np.random.SeedSequence(0).spawn(7)
    assert np.array_equal(lg.sweep(lag(), T, noise, seeds=parts).y, whole.y)


def test_an_interrupt_keeps_what_is_done() -> None:
    def impatient(fraction: float, words: str) -> None:
        if words.startswith("3 of"):
            raise KeyboardInterrupt

    def until_three(member: int) -> float:
        if member == 3:
            raise KeyboardInterrupt
        return 1.0

    with pytest.warns(RuntimeWarning, match="interrupted: 3 of 7 members are done"):
        s = lg.sweep(lag(), T, until_three, TABLE, states=True)
    assert s.done.tolist() == [True] * 3 + [False] * 4
    assert np.allclose(s["y"][:3], step_response(GAINS, TAUS)[:3], atol=1e-5)
    assert np.isnan(s.y[3:]).all() and np.isnan(s.x[3:]).all() and not s.failed
    with pytest.warns(RuntimeWarning, match="interrupted"):
        assert lg.sweep(lag(), T, 1.0, TABLE, progress=impatient).done.sum() == 3


def test_progress_and_reduce() -> None:
    told: list[tuple[float, str]] = []
    s = lg.sweep(lag(), T, 1.0, TABLE, reduce=last, chunk=3, progress=lambda *a: told.append(a))
    assert told == [(3 / 7, "3 of 7 members"), (6 / 7, "6 of 7 members"), (1.0, "7 of 7 members")]
    assert s.y is None and s.reduced is not None and s.reduced.shape == (7, 2)
    assert np.allclose(s.reduced[:, 0], step_response(GAINS, TAUS)[:, -1], atol=1e-5)
    with pytest.warns(RuntimeWarning, match="reduce: ZeroDivisionError"):
        none = lg.sweep(lag(), T, 1.0, TABLE, reduce=lambda t, y: 1 / 0)
    assert len(none.failed) == 7 and np.isnan(none.reduced).all()


def gain() -> ct.NonlinearIOSystem:
    """y = a u: nothing to step."""
    return static(lambda t, x, u, p: p["a"] * u[0], 1, ["y"], "s", a=1.0)


def test_a_stream_holds_a_chunk_only() -> None:
    """Memory of the streamed sweep, against that of the results it went through."""
    block, t, many = gain(), np.linspace(0, 1, 200), {"a": np.linspace(1, 2, 300)}
    list(lg.sweep_chunks(block, t, t, {"a": 1.0}))  # what is traced and loaded once
    tracemalloc.start()
    try:
        seen, whole = 0, 0
        for part in lg.sweep_chunks(block, t, t, many, chunk=10):
            assert np.array_equal(part["y"], many["a"][part.members][:, None] * t)
            seen, whole = seen + len(part), whole + part["y"].nbytes
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert seen == 300 and peak < 0.3 * whole


def test_a_system_that_cannot_be_traced_goes_one_by_one() -> None:
    branching = user_block(
        lambda t, x, u, p: -p["k"] * x[0] if x[0] > 0.1 else -0.1 * p["k"],
        lambda t, x, u, p: [x[0], -x[0]],
        0,
        ["y", "minus"],
        1,
        "branching",
        k=1.0,
    )
    rates = np.array([1.0, 2.0])
    with pytest.warns(RuntimeWarning, match="branching.*one by one") as said:
        s = lg.sweep(branching, T, None, {"k": rates}, x0=1.0, outputs=["minus"])
    assert len(said) == 1
    assert np.allclose(s["minus"], -np.exp(-rates[:, None] * T), rtol=1e-3)


def test_a_parameter_that_decides_which_equations_there_are() -> None:
    staged = user_block(
        lambda t, x, u, p: -x[0] if int(p["order"]) == 1 else -2 * x[0],
        None,
        0,
        1,
        ["x"],
        "staged",
        order=1,
    )
    one = lg.sweep(staged, T, None, {"order": [2, 2]}, x0=1.0, states=True)
    assert np.allclose(one["x"], np.exp(-2 * T), rtol=1e-5)
    with pytest.warns(RuntimeWarning, match="order"):
        both = lg.sweep(staged, T, None, {"order": [1, 2]}, x0=1.0, states=True)
    assert np.allclose(both["x"], np.exp(-np.array([[1], [2]]) * T), rtol=1e-5)


def test_a_key_without_default_and_a_first_member_out_of_range() -> None:
    bare = user_block(lambda t, x, u, p: -p["rate"] * x[0], None, 0, 1, ["x"], "bare")
    s = lg.sweep(bare, T, None, {"rate": [1.0, 3.0]}, x0=1.0, states=True)
    assert np.allclose(s["x"], np.exp(-np.array([[1], [3]]) * T), rtol=1e-5)
    with pytest.warns(RuntimeWarning, match="1 of 2 members failed; member 0"):
        s = lg.sweep(lag(), T, 1.0, {"lag.tau": [0.0, 0.1]})
    assert np.allclose(s["y"][1], step_response([1.0], [0.1])[0], atol=1e-5)


def test_lists_of_blocks() -> None:
    p, t, kp = lg.table1(), 1e-3 * np.arange(50), np.array([1.0, 2.0])
    for sample in (lambda block: block, lambda block: lg.sampled(block, 1e-3)):
        blocks = [lg.plant(p), lg.error(), sample(lg.pi(1.6, 0.16))]
        inputs = {"r": np.sin(50 * t)}
        s = lg.sweep(blocks, t, inputs, {"pi.kp": kp}, outputs=["w"], states=["plant_w"])
        for i in range(2):
            alone = lg.simulate(blocks, t, inputs, params={"pi.kp": kp[i]})
            assert np.array_equal(s["w"][i], alone.outputs[alone.output_labels.index("w")])
        assert np.array_equal(s["w"], s["plant_w"])


def test_a_relay_that_does_not_settle_is_said() -> None:
    relay = user_block(
        lambda t, x, u, p: np.array([x[1], -p["a"] * (np.sign(x[0]) + 0.5 * np.sign(x[1]))]),
        None,
        0,
        2,
        ["x", "v"],
        "relay",
        a=1.0,
    )
    with pytest.warns(RuntimeWarning, match="relay: in 2 members a sign"):
        s = lg.sweep(relay, T, None, {"a": [1.0, 2.0]}, x0=[1e-6, 0.0])
    assert set(s.coarse) == {0, 1} and s.ok.all()
    assert all(not math.isnan(time) for time in s.coarse.values())


def test_results_speak() -> None:
    with pytest.warns(RuntimeWarning, match="1 of 7"):
        s = lg.sweep(lag(), T, ramp, TABLE, outputs=["y"], states=["x"])
    said = s.summary()
    assert (said["members"], said["succeeded"], said["failed"]) == (7, 6, 1)
    assert json.loads(json.dumps(said))["parameters"]["lag.tau"] == [0.05, 0.5]
    assert "6 of 7" in str(s) and "no file for three" in s._repr_html_() and len(s) == 7
    with pytest.raises(InputError, match="no signal 'double'; it holds y, x"):
        s["double"]
    axes = s.plot()
    middle = axes.lines[0].get_ydata()
    assert np.allclose(middle, np.median(s["y"][s.ok], axis=0)) and axes.get_ylabel() == "y"
    bare = lg.sweep(lag(), T, 1.0, TABLE, reduce=last)
    with pytest.raises(InputError, match="no outputs to plot"):
        bare.plot()


def test_to_pandas_and_xarray() -> None:
    pytest.importorskip("pandas")
    s = lg.sweep(lag(), T, 1.0, TABLE, states=True)
    frame = s.to_pandas()
    assert np.array_equal(frame.loc[3, "y"].to_numpy(), s["y"][3])
    assert list(frame.columns) == ["y", "double", "x"] and frame.index.names == ["member", "t"]
    short = lg.sweep(lag(), T, 1.0, TABLE, reduce=last).to_pandas()
    assert np.array_equal(short["lag.tau"], TAUS) and np.array_equal(
        short["reduced0"], s.y[:, 0, -1]
    )
    pytest.importorskip("xarray")
    data = s.to_xarray()
    assert data["y"].dims == ("member", "t") and np.array_equal(data["lag.gain"], GAINS)
    assert float(data["double"].sel(member=2, t=T[-1])) == s["double"][2, -1]


# Sweeps that other processes and a cluster carry: the same numbers, nothing lost.


@pytest.fixture(scope="module")
def pool() -> Iterator[ProcessPoolExecutor]:
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as made:
        yield made


@pytest.mark.slow
def test_processes_of_the_users(pool: ProcessPoolExecutor) -> None:
    here = lg.sweep(lag(), T, 1.0, TABLE, states=True)
    there = lg.sweep(lag(), T, 1.0, TABLE, states=True, executor=pool, chunk=2)
    assert np.array_equal(here.y, there.y) and np.array_equal(here.x, there.x)
    assert np.allclose(there["y"], step_response(GAINS, TAUS), atol=1e-5)
    short = lg.sweep(lag(), T, 1.0, TABLE, reduce=last, executor=pool, chunk=3)
    assert np.array_equal(short.reduced, here.y[:, :, -1])


def test_random_inputs_do_not_depend_on_who_works(pool: ProcessPoolExecutor) -> None:
    here = lg.sweep(lag(), T, noise, seeds=9)
    assert np.array_equal(lg.sweep(lag(), T, noise, seeds=9, executor=pool, chunk=4).y, here.y)
    with ThreadPoolExecutor(3) as threads:
        assert np.array_equal(lg.sweep(lag(), T, noise, seeds=9, executor=threads).y, here.y)


def test_failures_come_home(pool: ProcessPoolExecutor) -> None:
    with pytest.warns(RuntimeWarning, match="1 of 7 members failed; member 3: inputs: Lookup"):
        s = lg.sweep(lag(), T, ramp, TABLE, executor=pool, chunk=3)
    assert set(s.failed) == {3} and np.isfinite(s.y[s.ok]).all() and s.ok.sum() == 6


def test_functions_that_cannot_be_sent_are_said(pool: ProcessPoolExecutor) -> None:
    match = "7 of 7 members failed; member 0: .*pickle"
    with pytest.warns(RuntimeWarning, match=match):
        s = lg.sweep(lag(), T, lambda i: 1.0, TABLE, executor=pool)
    assert np.isnan(s.y).all()
    with pytest.warns(RuntimeWarning, match=match):
        lg.sweep(lag(), T, 1.0, TABLE, executor=pool, reduce=lambda t, y: 0)

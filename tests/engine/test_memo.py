"""A value that a block reads from outside changes between two calls: the new one counts."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from typing import Any

import control as ct
import numpy as np
import pytest

import lugrectl as lg

from ..cases.own import moving

pytestmark = pytest.mark.usefixtures("interpreted")

T = np.linspace(0.0, 1.0, 11)
U = 3.0 * np.cos(4.0 * T)


def lag(limit: Any, name: str = "lag", dt: Any = None) -> ct.NonlinearIOSystem:
    """dx/dt = clip(u) - x; ``limit`` is called for the limit."""
    return moving(
        lambda t, x, u, p: np.clip(u[0], -limit(), limit()) - (0.5 if dt else 1.0) * x,
        "y",
        name,
        **{"dt": dt} if dt else {},
    )


def own(system: Any, u: Any = U) -> np.ndarray:
    """python-control's answer."""
    options: dict[str, Any] = {}
    if not system.isdtime(strict=True):
        options = {"solve_ivp_kwargs": {"rtol": 1e-8, "atol": 1e-10}, "solve_ivp_method": "LSODA"}
    return np.atleast_2d(ct.input_output_response(system, T, u, **options).outputs)


def ours(system: Any, u: Any = U, **options: Any) -> np.ndarray:
    return np.atleast_2d(lg.simulate(system, T, u, **options).outputs)


def called(function: Any) -> Any:
    return moving(function, "y", "called")


def by_dictionary() -> Any:
    """As by a list, a global or a closure: what a function reads is not looked at."""
    values = {"limit": 1.0}
    return lag(lambda: values["limit"]), lambda: values.update(limit=2.0)


def by_parameters() -> Any:
    system = lg.pi(1.6, 0.16)
    return system, lambda: system.params.update({"pi.kp": 3.0})


def by_gain_of_an_observer() -> Any:
    gains = [-10.0]
    made = lg.proposed_observer(lg.table1(), K1=lambda w: gains[0] + 0.0 * w)
    names = ["Fhat", "zhat", "what"]
    system = ct.interconnect([made], inputs=["u"], outputs=names, check_unused=False, params={})
    return system, lambda: gains.__setitem__(0, -1.0)


def by_a_block_inside() -> Any:
    values = [1.0]
    smooth = ct.ss([[-3.0]], [[3.0]], [[1.0]], [[0.0]], inputs="r", outputs="u", name="smooth")
    system = ct.interconnect([smooth, lag(lambda: values[0])], inputs="r", outputs="y")
    return system, lambda: values.__setitem__(0, 2.0)


def in_discrete_time() -> Any:
    values = [1.0]
    return lag(lambda: values[0], dt=0.1), lambda: values.__setitem__(0, 2.0)


def by_a_sampled_block() -> Any:
    values = [1.0]
    return lg.sampled(lag(lambda: values[0]), 0.1), lambda: values.__setitem__(0, 2.0)


WAYS = {
    "dictionary": by_dictionary,
    "parameters": by_parameters,
    "gain of an observer": by_gain_of_an_observer,
    "a block inside": by_a_block_inside,
    "discrete time": in_discrete_time,
    "sampled block": by_a_sampled_block,
}


@pytest.mark.parametrize("way", WAYS.values(), ids=WAYS)
def test_the_new_value_counts(way, monkeypatch):
    system, change = way()
    before = ours(system)
    np.testing.assert_allclose(before, own(system), atol=2e-5, rtol=1e-4)
    change()
    now = own(system)
    assert np.max(np.abs(now - before)) > 0.01  # the case can fail
    np.testing.assert_allclose(ours(system), now, atol=2e-5, rtol=1e-4)


def test_what_acts_only_far_from_the_origin_counts():
    """A value that is not seen at small states and inputs."""
    values = {"threshold": 50.0}
    brake = called(
        lambda t, x, u, p: u[0] - np.where(np.abs(x) > values["threshold"], 30.0 * x, 0.0)
    )
    ours(brake, 90.0)
    values["threshold"] = 10.0
    stopped = ours(brake, 90.0)
    np.testing.assert_allclose(stopped[0, -1], 10.0, rtol=1e-4)


def test_a_branch_that_a_new_value_opens_is_followed_or_said():
    """What can no longer be traced is left to LSODA, as in a first call."""
    values = {"branch": False}

    def rate(t, x, u, p):
        return -x if values["branch"] and t > 0.45 else u[0] - x

    system = called(rate)
    ours(system)
    values["branch"] = True
    with pytest.warns(RuntimeWarning, match="block called"):
        found = ours(system)
    np.testing.assert_allclose(found, own(system), atol=1e-3)


def test_a_parameter_that_becomes_a_list_is_read_again():
    system = moving(lambda t, x, u, p: p["table"][0] * u[0] - x, "y", "listed", table=[1.0])
    for system.params["table"][0] in (1.0, 2.0):
        np.testing.assert_allclose(ours(system), own(system), atol=1e-4)


@pytest.mark.parametrize("run", [lg.sweep, lambda *given: next(lg.sweep_chunks(*given, chunk=2))])
def test_a_sweep_sees_a_new_value(run):
    values = [1.0]
    system = lag(lambda: values[0])
    system.params["unused"] = 0.0
    for values[0] in (1.0, 2.0):
        found = run(system, T, U, {"unused": [0.0, 1.0]})
        np.testing.assert_allclose(found["y"], np.repeat(own(system), 2, axis=0), atol=1e-4)


def test_blocks_of_the_package_are_not_traced_again(monkeypatch):
    """Nothing that they read can change: the second call costs no trace."""
    loop = lg.velocity_loop(lg.table1(), "proposed")
    lg.simulate(loop, T, 0.1)
    for name in ("memo.traced_net", "memo.single"):
        monkeypatch.setattr(f"lugrectl.engine.{name}", None)
    lg.simulate(loop, T, 0.2)


def test_threads_do_not_see_each_other_s_parameters():
    system = moving(lambda t, x, u, p: -p["rate"] * x, "y", "decay", rate=1.0)
    rates = np.tile([0.5, 1.0, 2.0, 4.0], 10)

    def end(rate: float) -> float:
        return lg.simulate(system, T, 0.0, 1.0, params={"rate": rate}).outputs[-1]

    with ThreadPoolExecutor(4) as pool:
        ends = list(pool.map(end, rates.tolist()))
    np.testing.assert_allclose(ends, np.exp(-rates), rtol=1e-4)

"""A simulation that is slow because of one function says so, with the block and what to use."""

import time
import warnings

import control as ct
import numpy as np
import pytest

import lugrectl as lg
from lugrectl.engine.runtime import endings

from ..cases.own import static

PLANT = lg.plant(lg.table1())
T = np.arange(0.0, 0.02, 1e-3)


def odd(**options):
    def out(t, x, u, params):
        time.sleep(2e-3)
        return [u[0] + np.spacing(u[0])]

    return static(out, ["v"], ["u"], "odd", **options)


def loop():
    return ct.interconnect([odd(), PLANT], inputs=["v"], outputs=["w"], check_unused=False)


SYSTEMS = {
    "sampled": lambda: [odd(dt=1e-3), PLANT],
    "list": lambda: [odd(), PLANT],
    "loop": loop,
}


@pytest.mark.parametrize("system", SYSTEMS.values(), ids=SYSTEMS)
def test_a_slow_simulation_names_the_block_the_function_and_what_to_do(monkeypatch, system):
    monkeypatch.setattr(endings, "AFTER", 0.02)
    with warnings.catch_warnings(record=True) as seen:
        warnings.simplefilter("always")
        lg.simulate(system(), T, {"v": 0.1} if isinstance(system(), list) else 0.1)
    (said,) = [str(w.message) for w in seen if "takes long" in str(w.message)]
    assert "block odd" in said and "test_slow_functions.py line" in said
    assert "np.spacing of a signal" in said and "\n" not in said


def test_a_quick_simulation_says_nothing_of_it():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        lg.simulate([odd(dt=1e-3), PLANT], T[:5], {"v": 0.1})


def test_errors_of_warnings_do_not_break_the_timer(monkeypatch):
    monkeypatch.setattr(endings, "AFTER", 0.01)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert lg.simulate([odd(dt=1e-3), PLANT], T, {"v": 0.1}).t[-1] == T[-1]


def test_of_another_function_it_says_what_compiles():
    def out(t, x, u, params):
        return [np.spacing(u[0])]

    block = static(out, ["v"], ["u"], "odd")
    with pytest.warns(RuntimeWarning, match=r"np.spacing of a signal .* write it with arithmetic"):
        lg.simulate([block, PLANT], T, {"v": 0.1})

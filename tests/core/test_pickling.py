"""Blocks, loops and models go through pickle and work on the other side, or say why not."""

from __future__ import annotations

import copy
import pickle
from functools import partial
from typing import Any

import control as ct
import numpy as np
import pytest

import lugrectl as lg
from lugrectl.bench.compensate import effects_torque
from lugrectl.blocks.block import REGISTRY, Block, P, members
from lugrectl.blocks.declaration import block
from lugrectl.core.errors import InputError
from lugrectl.core.pickling import NotPicklable

TABLE = lg.table1()
DT = 1e-3


def model() -> lg.Model:
    effects = {
        "gravity": {"amplitude": 0.1, "phase": 0.4},
        "input_delay": {"delay": 0.003},
        "friction_step": {"ratio": 0.3, "time": 0.1},
        "velocity_sensor_lag": {},
    }
    made = lg.Model.of(TABLE)
    for name, values in effects.items():
        made = made.with_effect(name, values)
    return made.with_values({k: 0.01 for k, v in made.values().items() if v is None})


def gain(w: Any) -> Any:
    return -5.0 - np.tanh(w * w)


class Schedule:
    """A gain as an object."""

    def __init__(self, level: float) -> None:
        self.level = level

    def __call__(self, w: Any) -> Any:
        return self.level + 0.0 * w


def rate(t: Any, x: Any, u: Any, params: Any) -> Any:
    return u[0] - x


def wired() -> Any:
    """Blocks and a summing junction of python-control."""
    error = ct.summing_junction(["w", "-r"], "e", name="error")
    blocks = [lg.plant(TABLE), lg.pi(1.6, 0.16), error]
    return ct.interconnect(blocks, inputs="r", outputs=["w", "u"], check_unused=False, name="own")


def nested() -> Any:
    outer = ct.nlsys(rate, None, inputs="v", outputs="r", states=1, name="lag")
    return ct.interconnect([wired(), outer], inputs="v", outputs="w", check_unused=False)


MADE: dict[str, Any] = {
    "plant": lambda: lg.plant(TABLE),
    "plant with effects": lambda: lg.plant(model()),
    "sensor": lambda: lg.sensor(model()),
    "torque of the effects": lambda: effects_torque(model()),
    "pid of an integral with tau": lambda: lg.pid(tau=0.1),
    "error": lambda: lg.error("position"),
    "prefilter": lambda: lg.prefilter(kind="position"),
    "observer with functions": lambda: lg.proposed_observer(TABLE, K1=gain, K2=Schedule(20.0)),
    "observer with np.tanh": lambda: lg.proposed_observer(TABLE, K1=np.tanh),
    "repetitive control of 3 harmonics": lambda: lg.repetitive_control(TABLE, harmonics=3),
    "loop of a named controller": lambda: lg.position_loop(TABLE, controller="backstepping_smc"),
    "table": lambda: lg.tabulated("theta", [0.0, 1.0, 3.0], [0.1, 0.2, 0.1], periodic=True),
    "table of two directions": lambda: lg.tabulated("theta", [0.0, 1.0], [[1.0, 2.0], [3.0, 1.0]]),
    "table over time": lambda: lg.tabulated("t", [0.0, 1.0], [0.1, 0.2]),
    "sampled pi": lambda: lg.sampled(lg.pi(), DT),
    "sampled observer": lambda: lg.sampled(lg.proposed_observer(TABLE), DT),
    "velocity loop": lambda: lg.velocity_loop(TABLE, "proposed", prefilter=True, feedforward=True),
    "position loop": lambda: lg.position_loop(TABLE, "existing", kd=0.2, load=True),
    "loop with a gain of one's own": lambda: lg.velocity_loop(TABLE, "proposed", K1=gain),
    "wired blocks": wired,
    "nested loops": nested,
    "state space": lambda: ct.ss([[-1.0]], [[2.0]], [[1.0]], [[0.0]]),
    "linear loop": lambda: ct.interconnect(
        [ct.ss(-1, 1, 1, 0, inputs="u", outputs="y", name="one")], inputs="u", outputs="y"
    ),
}
PARTS = {k: getattr(lg, k) for k in (*lg.observers().names[1:], *lg.controllers().names)}
FREE = (
    "error",
    "pi",
    "pid",
    "compensation",
    "prefilter",
    "limiter",
    "sliding_error",
    "adaptive_slotine_li",
    "smith_velocity",
)  # need no parameters
MORE = {"proportional": (0.5,), "notch": (40.0,), "repetitive_memory": (TABLE, 0.02)}


def part(name: str) -> Any:
    """An observer or a controller of the catalogue."""
    return PARTS[name](*(() if name in FREE else MORE.get(name, (TABLE,))))


MADE |= {name: partial(part, name) for name in PARTS}
MADE |= {f"law {k}": lambda k=k: lg.friction(k) for k in members("friction")}
MADE |= {f"effect {k}": lambda k=k: lg.effect(k) for k in members("effect")}


def answer(system: Any, seed: int = 0) -> np.ndarray:
    """Rates and outputs of a system at a random point, by its own functions."""
    random = np.random.default_rng(seed)
    x = random.standard_normal(system.nstates)
    u = random.standard_normal(system.ninputs)
    system._update_params({})
    return np.concatenate([system._rhs(0.3, x, u), system._out(0.3, x, u)])


@pytest.mark.parametrize("what", MADE)
@pytest.mark.parametrize("way", ["pickle", "deepcopy", "cloudpickle"])
def test_every_block_and_loop_comes_back_as_it_was(what, way):
    if way == "cloudpickle":
        dumps = pytest.importorskip("cloudpickle").dumps
    else:
        dumps = pickle.dumps
    system = MADE[what]()
    again = copy.deepcopy(system) if way == "deepcopy" else pickle.loads(dumps(system))
    assert type(again) is type(system) and again.name == system.name
    assert again.input_labels == system.input_labels
    assert again.state_labels == system.state_labels
    assert again.params == system.params
    np.testing.assert_array_equal(answer(again), answer(system))


def test_the_copy_of_a_loop_shares_nothing_with_it():
    loop = lg.velocity_loop(TABLE)
    again = pickle.loads(pickle.dumps(loop))
    before = answer(again)
    loop.syslist[0].params["plant.Fv"] = 9.0
    assert np.any(answer(loop) != before)
    np.testing.assert_array_equal(answer(again), before)
    rates = again.updfcn(0.0, np.ones(again.nstates), np.zeros(1), {})
    np.testing.assert_array_equal(rates, again._rhs(0.0, np.ones(again.nstates), np.zeros(1)))


def test_a_registered_block_comes_back_as_itself():
    for made in REGISTRY.values():
        assert pickle.loads(pickle.dumps(made)) is made
        assert copy.deepcopy(made) is made


def drag(w, c=P(0.1, "N m s/rad", neutral=0.0)):
    """d = c w."""
    return c * w


@pytest.fixture
def cell_block():
    """An effect as a notebook cell declares it."""
    function = drag
    function.__module__ = "__main__"
    yield block("effect", name="cell_drag", out="d", acts="torque")(function)
    REGISTRY.pop(("effect", "cell_drag"), None)
    function.__module__ = __name__


def test_a_block_of_a_notebook_goes_by_its_name(cell_block):
    whole = lg.Model.of(TABLE).with_effect("cell_drag", {"c": 0.2})
    system = lg.plant(whole)
    again = pickle.loads(pickle.dumps((cell_block, whole, system)))
    assert again[0] is cell_block and again[1] == whole
    np.testing.assert_array_equal(answer(again[2]), answer(system))


def test_a_block_that_is_not_declared_there_is_named(cell_block):
    packed = pickle.dumps(lg.effect("cell_drag"))
    del REGISTRY["effect", "cell_drag"]
    with pytest.raises(InputError, match="'cell_drag' is not declared in this session: run the n"):
        pickle.loads(packed)


def with_lambda() -> Any:
    return ct.nlsys(
        lambda t, x, u, p: u[0] - x, None, inputs="u", outputs="y", states=1, name="own"
    )


def with_inner_function() -> Any:
    def inner(w: Any) -> Any:
        return -1.0 + 0.0 * w

    return lg.velocity_loop(TABLE, "proposed", K1=inner)


CANNOT = {
    "lambda as K1": (
        lambda: lg.proposed_observer(TABLE, K1=lambda w: -1.0),
        "proposed_observer.K1 is .*lambda>, which cannot be pickled: define",
    ),
    "inner function as K1": (with_inner_function, "K1 is .*inner, .* at the top level"),
    "lambda in ct.nlsys": (with_lambda, "update function of the block own is "),
    "the same, sampled": (lambda: lg.sampled(with_lambda(), 0.1), "of the block own is "),
    "the same, wired": (
        lambda: ct.interconnect([with_lambda()], inputs="u", outputs="y"),
        "of the block own is ",
    ),
    "python-control's closure": (
        lambda: ct.nlsys(ct.ss(-1, 1, 1, 0), name="turned"),
        "of the block turned is nlsys",
    ),
    "a bare block": (
        lambda: Block("bare", "effect", lambda w: w, ("w",), ("d",), (), {}),
        "the function of the block bare is ",
    ),
}


@pytest.mark.parametrize("what", CANNOT)
def test_what_cannot_pickle_says_which_block_and_what_to_do(what):
    make, sentence = CANNOT[what]
    with pytest.raises(NotPicklable, match=sentence) as caught:
        pickle.dumps(make())
    assert isinstance(caught.value, InputError) and isinstance(caught.value, pickle.PicklingError)
    assert str(caught.value).count("\n") == 0


@pytest.mark.parametrize("what", CANNOT)
def test_what_cannot_pickle_is_copied_all_the_same(what):
    """And goes through cloudpickle, which carries the functions themselves."""
    made = CANNOT[what][0]()
    copies = [copy.deepcopy(made), copy.copy(made)]
    try:
        import cloudpickle
    except ImportError:
        pass
    else:
        copies.append(pickle.loads(cloudpickle.dumps(made)))
    if not isinstance(made, Block):
        for other in copies:
            np.testing.assert_array_equal(answer(other), answer(made))
    assert all(other.name == made.name for other in copies)

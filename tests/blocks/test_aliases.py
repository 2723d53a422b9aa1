"""Where a name is taken, the block itself is, too; a system is refused in one sentence."""

import re

import control as ct
import numpy as np
import pytest

import lugrectl as lg
from lugrectl.blocks.declaration import name_of

P = lg.table1()
T = 4e-3 * np.arange(3000)
W = np.sin(np.pi * T) + 0.5 * np.sin(8.0 * T)
NOISE = 0.002 * np.random.default_rng(0).standard_normal(len(T))
LOG = {"t": T, "w": W, "u": 0.002 * np.gradient(W, T) + 0.3 * np.tanh(W / 1e-3) + 0.02 * W + NOISE}


@pytest.fixture
def drag():
    @lg.block("effect", out="d", acts="torque")
    def cubic_drag(w, c=lg.P(0.0, "N m s3/rad3", 0, neutral=0)):
        """d = c w^3."""
        return c * w**3

    return cubic_drag


def test_a_model_takes_the_law_and_effects_themselves(smooth, drag):
    model = lg.Model.of(J=0.002, friction=smooth, effects=[drag, "gravity"])
    assert model.friction.block is smooth
    assert [part.block.name for part in model.effects] == ["cubic_drag", "gravity"]
    assert lg.Model.of(effects=drag).effects[0].block is drag
    assert lg.Model.of({"friction": smooth}).friction.block is smooth
    assert lg.Model.of({"J": 0.002, "friction": smooth}).friction.block is smooth
    assert lg.Model.of().with_effect(drag, {"c": 0.1}).known() == {"cubic_drag.c": 0.1}


def test_factories_and_lists_take_the_block_itself(smooth, drag, momentum):
    assert lg.friction(smooth, Fc=0.2).params == {"smooth_coulomb.Fc": 0.2,
                                                  "smooth_coulomb.Fv": 0.02}  # fmt: skip
    assert lg.effect(drag, c=0.1).params == {"cubic_drag.c": 0.1}
    for listed, made in ((lg.laws, smooth), (lg.effects, drag), (lg.observers, momentum)):
        assert made in listed() and listed()[made].name == made.name
    assert drag not in lg.laws()


def test_an_observer_is_a_block_a_factory_or_a_name(momentum):
    loop = lg.velocity_loop(P, momentum, L=20.0)
    assert "momentum_of_test" in [part.name for part in loop.syslist]
    natural = lg.velocity_loop(P, lg.natural_observer)
    assert "natural_observer" in [part.name for part in natural.syslist]
    made = lg.design_gains(P, observer=lg.natural_observer)
    assert made.observer == "natural"
    with pytest.raises(lg.InputError, match="no design rule for momentum_of_test"):
        lg.design_gains(P, observer=momentum)
    with pytest.raises(lg.InputError, match="no argument of the loop with momentum_of_test"):
        lg.velocity_loop(P, momentum, K1=-1.0)


def test_a_system_has_values_that_a_name_has_not(drag):
    own = ct.ss([[-50.0]], [[1.0]], [[1.0]], 0, inputs=["w"], outputs=["Fhat"], name="mine")
    for kind, call in {
        "friction law": lambda: lg.Model.of(friction=lg.friction("coulomb", Fc=0.2)),
        "effect": lambda: lg.Model.of().with_effect(lg.effect(drag, c=0.1)),
        "observer": lambda: lg.velocity_loop(P, own),
    }.items():
        with pytest.raises(
            lg.InputError, match=f"system: give the name of the {kind} in its place"
        ):
            call()


def test_a_block_without_its_signals_says_how_it_becomes_a_system(momentum):
    made = re.escape("momentum_of_test.system(J=0.003) makes a python-control system of it.")
    with pytest.raises(lg.InputError, match=f"called with its signals, w, u, x; {made}$"):
        momentum(J=0.003)
    with pytest.raises(lg.InputError, match=re.escape("a block must be a python-control system")):
        lg.simulate([lg.plant(P), momentum], T)
    assert momentum.system(J=0.003).params["momentum_of_test.J"] == 0.003
    assert momentum(w=1.0, u=2.0, x=3.0) == momentum(1.0, 2.0, 3.0)


def test_a_block_of_another_kind_is_refused(drag):
    with pytest.raises(lg.InputError, match="cubic_drag is declared as effect, not as friction"):
        lg.Model.of(friction=drag)
    assert name_of("effect", lg.plant) is lg.plant  # no factory of an effect
    with pytest.raises(lg.InputError, match="no effect named the function table1"):
        lg.effect(lg.table1)


@pytest.mark.slow
def test_a_law_of_ones_own_is_simulated_with_its_defaults_where_the_model_has_no_values(smooth):
    drive = lg.plant(lg.Model.of(J=0.002, friction=smooth, Fv=0.05))
    assert drive.params["plant.Fc"] == 0.3 and drive.params["plant.Fv"] == 0.05
    with pytest.raises(lg.InputError, match="Fc, Fv have no values; identify them first"):
        lg.plant(lg.Model.of(J=0.002, friction="coulomb"))  # its defaults are another drive's
    model = lg.Model.of(J=0.002, friction=smooth)
    assert model.known() == {"J": 0.002}
    found = lg.identify({**LOG, "u": 0.5 * LOG["u"]}, lg.Model.of(friction=smooth))
    assert found.model.values()["Fc"] == pytest.approx(0.15, rel=0.05)
    assert found.error["declared"] is None and found.model.friction.block is smooth

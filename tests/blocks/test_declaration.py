"""A block is checked where it is declared: one sentence that names the block and what is wrong."""

from __future__ import annotations

import importlib
import inspect
import math
import sys

import numpy as np
import pytest

import lugrectl as lg
from lugrectl.blocks import declaration
from lugrectl.blocks.block import REGISTRY

C = lg.P(0.0, "N m s/rad", 0.0, neutral=0.0)


def effect(function, **options):
    return lg.block("effect", **{"out": "d", "acts": "torque", "name": "mine", **options})(function)


def plain(w, c=0.1):
    return c * w


def several(*signals, c=C):
    return c * signals[0]


def lost(w, c=C):
    c * w  # noqa: B018


def none(w, c=lg.P(0.1, "N m s/rad", 0.0)):
    return c * w


def offset(w, c=C):
    return c * w + 0.2


def clipped(u, limit=lg.P(math.inf, "N m", 0.0, neutral=math.inf)):
    return 0.9 * np.clip(u, -limit, limit)


def lagging(u, x, T=lg.P(0.0, "s", 0.0, neutral=0.0)):
    return x


def beyond(k, low=0.0, high=2.0, **more):
    return lambda w, c=C, k=lg.P(k, "1", low, high, **more): c * k * w


def aside(w, c=lg.P(2.0, "N m", 1.0, 3.0, neutral=0.0)):
    return c * w


WRONG = {
    "acts": (lambda: effect(lambda w, c=C: c * w, acts="torqe"), "'torqe'.*mean 'torque'"),
    "level": (lambda: effect(lambda w, c=C: c * w, acts="+Fcc"), r"'\+Fcc'.*mean 'Fc'"),
    "kind": (lambda: lg.block("efect", out="d")(lambda w: w), "'efect'; did you mean 'effect'"),
    "surplus": (lambda: effect(lambda w, c=C: (c * w, w, w)), "returns 3 values, but 1 are"),
    "too few": (lambda: effect(lagging, acts="input", states="x"), "2 are declared.*rate of x"),
    "no return": (lambda: effect(lost), "the output d is None"),
    "number": (lambda: effect(plain), r"default of c is 0\.1.*c=P\(0\.1, unit\)"),
    "stars": (lambda: effect(several), r"takes \*signals"),
    "no neutral value": (lambda: effect(none), "no neutral value"),
    "not neutral": (lambda: effect(offset), r"with c = 0.*d is 0\.2 instead of 0"),
    "not neutral, u": (lambda: effect(clipped, acts="input", out="u"), "change nothing, but u"),
    "signal": (lambda: effect(lambda omega, c=C: c * omega), "reads omega, a signal that no drive"),
    "near signal": (lambda: effect(lambda thta, c=C: c * thta), "did you mean 'theta'"),
    "raises": (lambda: effect(lambda w, c=C: c * w["x"]), "cannot be run"),
    "default": (lambda: effect(beyond(5.0)), "default of k is 5, outside its bounds of 0 to 2\\."),
    "no number": (lambda: effect(beyond(math.nan)), "default of k is nan, outside its bounds"),
    "bounds": (lambda: effect(beyond(1.0, 2.0, 1.0)), "outside its bounds of 2 to 1"),
    "neutral": (lambda: effect(aside), "neutral value of c is 0, outside .* of 1 to 3 N m"),
    "choices": (lambda: effect(beyond(1.0, choices=(0.0, 2.0))), "is 1, none of its choices 0, 2"),
    "out": (lambda: effect(lambda w, c=C: c * w, out=""), "out names no output"),
    "start": (lambda: effect(lagging, acts="input", states="x", start="v"), "start names 'v'"),
    "sensor": (lambda: effect(lambda w, c=C: c * w, acts="sensor"), "outputs must be w_m theta_m"),
    "acts of a law": (
        lambda: lg.block("friction", out="F", acts="torque")(lambda w, c=C: c * w),
        "acts belongs to effects",
    ),
}


@pytest.mark.parametrize("declare, words", WRONG.values(), ids=WRONG)
def test_a_wrong_declaration_is_one_sentence(declare, words):
    with pytest.raises(lg.InputError, match=words) as refused:
        declare()
    assert "\n" not in str(refused.value)


def test_every_block_of_the_package_passes_the_same_checks():
    blocks = [*REGISTRY.values(), *map(REGISTRY.__getitem__, ["gravity"])]
    laws = [k for (kind, _), b in REGISTRY.items() if kind == "friction" for k in b.parameters]
    assert len(blocks) > 50
    for made in blocks:
        if made.home.startswith("lugrectl."):
            declaration.check(made, laws)


def test_a_helper_may_stand_below_the_block():
    made = effect(lambda w, c=C: _not_yet(c * w))  # noqa: F821
    assert made.name == "mine"


def test_an_effect_that_acts_on_nothing_stands_alone_only():
    effect(lambda w, c=C: c * w, acts="")
    assert lg.effect("mine", c=2.0).ninputs == 1
    with pytest.raises(lg.InputError, match="mine acts on nothing inside a drive"):
        lg.plant(lg.Model.of(lg.table1()).with_effect("mine", {"c": 2.0}))


MODULE = '''import lugrectl as lg

@lg.block("effect", out="d", acts="torque")
def cubic_of_mine(w, coefficient=lg.P(0.0, "N m s3/rad3", 0.0, neutral=0.0)):
    """r_e = c w^{power}."""
    return coefficient * w**{power}
'''


def test_a_module_with_a_block_may_be_loaded_again(tmp_path, monkeypatch):
    path = tmp_path / "effects_of_mine.py"
    path.write_text(MODULE.replace("{power}", "3"))
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    module = importlib.import_module("effects_of_mine")
    assert lg.effects()["cubic_of_mine"].equation == "r_e = c w^3"
    path.write_text(MODULE.replace("{power}", "05"[-1:]))
    importlib.invalidate_caches()
    importlib.reload(module)
    assert lg.effects()["cubic_of_mine"].equation == "r_e = c w^5"
    assert module.cubic_of_mine(2.0, coefficient=1.0) == (32.0,)


def test_another_function_does_not_take_the_name():
    effect(lambda w, c=C: c * w, name="taken")

    def other(w, c=C):
        return c * w

    with pytest.raises(lg.InputError, match="'taken' exists"):
        effect(other, name="taken")


def test_a_block_has_the_docstring_and_signature_of_its_function():
    def documented(w, c=C):
        """r_e = c w."""
        return c * w

    made = effect(documented)
    assert made.__doc__ == "r_e = c w."
    assert made.__wrapped__ is documented
    assert [*inspect.signature(made).parameters] == ["w", "c"]
    assert REGISTRY["effect", "gravity"].__doc__.startswith("r_e")


def test_names_may_be_lists():
    def law(w, z, k=lg.P(1.0, "N m/rad", 0.0)):
        """F = k z, dz/dt = w."""
        return k * z, w

    made = [
        lg.block("friction", out="F", states="z", name="as_text")(law),
        lg.block("friction", out=["F"], states=["z"], name="as_lists")(law),
    ]
    try:
        assert made[0].outputs == made[1].outputs == ("F",)
        assert made[0].states == made[1].states == ("z",)
    finally:
        for block in made:
            REGISTRY.pop(("friction", block.name))
    with pytest.raises(lg.InputError, match="states must be a name or a list of names"):
        lg.block("friction", out="F", states=3)  # pyright: ignore[reportArgumentType]

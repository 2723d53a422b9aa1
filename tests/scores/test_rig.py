"""Records of the rig: how they are planned, counted and diagnosed, on lines written by hand."""

from __future__ import annotations

import numpy as np
import pytest

from ..cases.blind_results import effect, hidden, line, ripple
from ..drives import MACHINES, make
from . import counts, rig


@pytest.mark.parametrize(
    "worth, names, verdict, found",
    [
        (1.0, ["gravity"], "found", [effect("gravity")]),
        (0.0, ["gravity"], "found", [effect("return_spring")]),
        (0.0, ["gravity"], "found", [effect("gravity"), effect("gravity")]),
        (0.0, ["gravity"], "unexplained", [effect("gravity")]),
        (0.5, ["gravity"], "ambiguous", [effect("x", ties=["y", "gravity"])]),
        (0.0, ["gravity"], "ambiguous", [effect("x", ties=["y", "z", "gravity"])]),
        (0.0, ["gravity"], "ambiguous", [effect("gravity"), effect("x", ties=["y"])]),
        (1.0, ["a", "b"], "found", [effect("b"), effect("a")]),
        (0.0, ["a", "b"], "found", [effect("a"), effect("a")]),
        (0.5, ["a", "b"], "ambiguous", [effect("b", ties=["c"]), effect("a", ties=["b"])]),
        (0.0, ["a", "b"], "ambiguous", [effect("c", ties=["a", "b"]), effect("d")]),
    ],
)
def test_credit(worth, names, verdict, found):
    assert counts.credit(line(names, verdict, *found)) == worth


@pytest.mark.parametrize(
    "verdict, signals, right",
    [
        ("unexplained", ["theta", "w"], True),
        ("unexplained", ["w", "theta"], False),
        ("found", ["theta"], False),
    ],
)
def test_an_unknown_effect_needs_the_right_signal_first(verdict, signals, right):
    one = line(["torque_bumps"], verdict, depends_on=signals, kind="stranger")
    assert counts.is_right(one) == right


def test_parameter_errors_and_cover():
    good, far = ripple(0.041, [0.039, 0.042]), ripple(0.05, [0.049, 0.051], harmonic=14.0)
    by_name = {p.name: p for p in counts.parameters(good)}
    assert by_name["amplitude"].error == pytest.approx(0.025) and by_name["amplitude"].covered
    across = (2 * np.pi - 6.2) / np.pi  # from 3.1 to -3.1 the short way
    assert by_name["phase"].error == pytest.approx(across) and by_name["phase"].covered
    assert by_name["harmonic"].counted and by_name["harmonic"].error == 0.0
    by_name = {p.name: p for p in counts.parameters(far)}
    assert not by_name["amplitude"].covered and by_name["harmonic"].error == 1.0
    spring = line(["return_spring"], "found", effect("return_spring", {"rest": (1.0, None)}),
                  told=[hidden("return_spring", rest=0.5)])  # fmt: skip
    (rest,) = counts.parameters(spring)
    assert rest.error == pytest.approx(0.05) and rest.covered is None


def test_the_floor_is_the_noise_of_the_sensor():
    case = make("gravity", "servo", seed=3, load=False, duration=5.0, rate=500.0)
    assert rig.floor(case, {"signal": "w"}) == pytest.approx(MACHINES["servo"].w_noise, rel=0.05)


@pytest.mark.slow
def test_a_small_run(tmp_path, capsys):
    asked = ["--effects", "torque_ripple,none", "--strength", "normal", "--seeds", "90000",
             "--out", str(tmp_path)]  # fmt: skip
    assert rig.main(asked) == 0
    lines = rig.read(tmp_path / "results.jsonl")
    assert [counts.verdict(x) for x in lines] and not any("crash" in x for x in lines)
    (named,) = (x for x in lines if x["names"])
    assert named["answer"]["error"]["augmented"] > 0.9 * named["floor"]
    assert "torque_ripple" in capsys.readouterr().out
    with (tmp_path / "results.jsonl").open("a") as file:
        file.write('{"key": "torn')
    assert rig.main(asked) == 0
    assert "0 to do" in capsys.readouterr().err
    assert rig.main(["--summary", str(tmp_path / "results.jsonl")]) == 0
    assert "torque_ripple" in capsys.readouterr().out

"""Records and questions: how they are planned, counted and diagnosed; what an answer is worth."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ..cases.blind_results import effect, hidden, line, ripple
from ..drives import MACHINES, make
from . import counts, drawn, rig
from .judges import of_document
from .question import LAW, Answer, Question, coverage, false_names, points, values


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


QUESTION = Question(
    seed=0,
    kind="effect",
    record={},
    model={},
    effect="backlash",
    values={"J": 1.0, "backlash.gap": 0.1},
    background=LAW | {"torque_ripple", "gravity"},
    alike=frozenset({"elastic_coupling"}),
)
SOUND = replace(QUESTION, kind="none", effect="none")
UNKNOWN = replace(
    QUESTION, kind="unknown", effect="rough_patch", signals=(frozenset({"theta", "w"}),)
)


@pytest.mark.parametrize(
    "question, worth, verdict, effects, alternatives",
    [
        (QUESTION, 1.0, "found", "backlash", ""),
        (QUESTION, 1.0, "found", "backlash torque_ripple stribeck", ""),
        (QUESTION, 0.0, "found", "backlash torque_ripple stribeck gravity", ""),
        (QUESTION, 0.0, "found", "backlash input_delay", ""),
        (QUESTION, 0.0, "found", "torque_ripple backlash", ""),
        (QUESTION, 1.0, "ambiguous", "elastic_coupling", "backlash"),
        (QUESTION, 0.5, "ambiguous", "backlash", "input_delay elastic_coupling"),
        (QUESTION, 0.0, "ambiguous", "backlash", "input_delay elastic_coupling gravity"),
        (QUESTION, 0.0, "ambiguous", "input_delay", "elastic_coupling"),
        (QUESTION, 0.5, "unexplained", "gravity backlash", ""),
        (QUESTION, 0.0, "unexplained", "", ""),
        (QUESTION, 0.0, "adequate", "", ""),
        (SOUND, 1.0, "adequate", "", ""),
        (SOUND, 1.0, "found", "torque_ripple gravity", ""),
        (SOUND, 0.0, "found", "torque_ripple backlash", ""),
        (SOUND, 0.0, "unexplained", "", ""),
        (SOUND, 0.0, "refused", "", ""),
    ],
)
def test_an_answer_is_worth(question, worth, verdict, effects, alternatives):
    answer = Answer(verdict, tuple(effects.split()), tuple(alternatives.split()))
    assert points(question, answer) == worth


def test_an_unknown_effect_wants_the_signals_it_depends_on():
    right = Answer("unexplained", depends_on=("w", "theta"))
    assert points(UNKNOWN, right) == 1.0
    assert points(UNKNOWN, replace(right, depends_on=("w",))) == 0.0
    assert points(UNKNOWN, replace(right, effects=("backlash",))) == 0.0
    assert points(UNKNOWN, replace(right, verdict="found")) == 0.0


def test_values_are_held_against_the_truth():
    said = {"J": (1.05, 0.9, 1.1), "backlash.gap": (0.25, 0.2, 0.3), "Fc": (0.5, 0, 1)}
    held = values(QUESTION, Answer("found", parameters=said))
    assert {k: v and v["inside"] for k, v in held.items()} == {"J": True, "backlash.gap": False}
    assert held["J"]["error"] == pytest.approx(5.0) and held["J"]["half"] == pytest.approx(10.0)
    known = coverage([held, {"J": None}])["J"]
    assert (known["known"], known["given"], known["inside"]) == (2, 1, 1.0)
    assert false_names(QUESTION, Answer("found", ("input_delay",))) == {"input_delay"}


def test_a_report_becomes_an_answer():
    entry = {"value": 1.0, "ci95": [0.5, 1.5]}
    others = [{"name": "elastic_coupling", "score": 0.0}]
    report = {
        "verdict": "ambiguous",
        "effects": [{"name": "backlash", "parameters": {"gap": entry}, "alternatives": others}],
        "depends_on": None,
        "reason": None,
        "parameters": {},
        "plain": {"parameters": {"J": entry, "Fc": {"value": 1.0, "ci95": None}},
                  "combinations": []},
    }  # fmt: skip
    given = of_document(report)
    assert (given.effects, given.alternatives) == (("backlash",), ("elastic_coupling",))
    assert given.parameters["J"] == given.parameters["backlash.gap"] == (1.0, 0.5, 1.5)


def shrug(logs, model) -> Answer:
    """A judge that finds nothing."""
    ((log, options),) = logs
    assert {"t", "u"} < log.keys() and not options and model["plant"]
    return Answer("adequate", parameters={"J": (5.0, 0.0, 1e4)})


def test_the_bench_counts_points_and_coverage_and_keeps_them(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(drawn, "RESULTS", tmp_path)
    asked = ["--generator", "held_out", "--kind", "none", "--seeds", "2:4"]
    assert drawn.main([*asked, "--judge", f"{__name__}:shrug", "--keep", "abc"]) == 0
    said = capsys.readouterr().out
    assert "adequate" in said and "points" in said
    kept = (tmp_path / "messy.json").read_text()
    assert '"points": 1.0' in kept and '"coverage_plain": 1.0' in kept and "none/held_out/" in kept


def test_a_friction_map_is_drawn_and_its_answer_scored():
    row = drawn.judged(18, "effect", "steady", "lugrectl")
    assert row.question.effect == "constant_torque" and row.points > 0.0
    assert values(row.question, row.answer)["constant_torque.torque"]["inside"]

"""Messy drives: what is drawn, and what an answer is worth."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.messy import EFFECTS, Answer, Case, draw
from tests.messy.bench import judged, keep, pairs, summary
from tests.messy.judges import of_report, toml
from tests.messy.kept import load, save
from tests.messy.score import covered, false_names, points

pytest.importorskip("numba")  # without it a drive takes a minute


@pytest.fixture(scope="module")
def drawn():
    seeds = (0, 1, 3, 9, 12, 18)
    return [draw(seed, "effect") for seed in seeds]


@pytest.mark.parametrize("seed, kind", [(3, "effect"), (2, "none"), (1, "unknown"), (5, "sound")])
def test_a_seed_gives_the_same_case_each_time(seed, kind):
    one, two = draw(seed, kind), draw(seed, kind)
    assert one.record.keys() == two.record.keys()
    for name, values in one.record.items():
        np.testing.assert_array_equal(values, two.record[name])
    assert (one.model, one.values, one.alike) == (two.model, two.values, two.alike)


def test_seeds_go_through_the_effects_in_turn(drawn):
    assert [case.effect for case in drawn] == [EFFECTS[case.seed % 20] for case in drawn]


def test_records_are_finite_and_equally_long(drawn):
    for case in drawn:
        lengths = {len(values) for values in case.record.values()}
        assert len(lengths) == 1
        assert all(np.isfinite(values).all() for values in case.record.values())
        assert 11.5 < np.ptp(case.record["t"]) < 40.5
        assert {"t", "u", "theta"} <= case.record.keys()


def test_an_effect_is_3_to_25_percent_of_friction(drawn):
    for case in drawn:
        most = 0.5 if case.effect == "input_delay" else 0.25
        assert 0.03 <= case.hidden / case.friction <= most, case.effect


def test_the_stated_torque_is_that_of_the_true_parameters(drawn):
    constant, gravity, periodic = drawn[0], drawn[1], drawn[5]
    assert constant.hidden == pytest.approx(abs(constant.values["constant_torque.torque"]))
    theta, phase = gravity.record["theta"], gravity.values["gravity.phase"]
    shape = np.sqrt(np.mean(np.sin(theta + phase) ** 2))
    assert gravity.hidden == pytest.approx(gravity.values["gravity.amplitude"] * shape, rel=0.02)
    amplitude = periodic.values["periodic_disturbance.amplitude"]
    assert periodic.hidden == pytest.approx(amplitude / np.sqrt(2), rel=0.05)


def test_a_step_happens_in_the_middle_half():
    for seed in (16, 17):
        case = draw(seed, "effect")
        time = case.values[f"{case.effect}.time"]
        assert 0.25 <= time / case.record["t"][-1] <= 0.75


def test_a_sound_drive_hides_nothing():
    for seed in range(1, 11):
        case = draw(seed, "sound")
        assert (case.effect, case.hidden) == ("none", 0.0)


def test_a_declared_value_is_10_to_20_percent_off(drawn):
    for case in drawn:
        off = abs(case.model["plant"]["J"] / case.values["J"] - 1)
        assert 0.0999 < off < 0.2001


def test_a_direction_dependent_torque_is_like_a_constant_one(drawn):
    assert drawn[0].effect == "constant_torque"
    assert "coulomb_asymmetry" in drawn[0].alike


def test_a_kept_case_is_the_one_that_was_drawn(drawn, tmp_path):
    save(drawn[0], tmp_path / "case.npz")
    back = load(tmp_path / "case.npz")
    assert (back.effect, back.alike, back.values) == (
        drawn[0].effect,
        drawn[0].alike,
        drawn[0].values,
    )
    np.testing.assert_array_equal(back.record["u"], drawn[0].record["u"])


def test_the_declared_tables_are_a_model_file(drawn, tmp_path):
    import lugrectl as lg

    for case in drawn:
        path = tmp_path / f"{case.seed}.toml"
        path.write_text(toml(case.model))
        assert lg.read_model(path).to_dict(stated=True)["plant"]["J"] == case.model["plant"]["J"]


CASE = Case(
    seed=0,
    kind="effect",
    record={},
    model={},
    effect="backlash",
    values={"J": 1.0, "backlash.gap": 0.1},
    background=frozenset({"torque_ripple", "gravity", "stribeck"}),
    alike=frozenset({"elastic_coupling"}),
)
SOUND = replace(CASE, kind="none", effect="none")
UNKNOWN = replace(CASE, kind="unknown", effect="rough_patch", signals=(frozenset({"theta", "w"}),))


@pytest.mark.parametrize(
    "worth, verdict, effects, alternatives",
    [
        (1.0, "found", ["backlash"], []),
        (1.0, "found", ["backlash", "torque_ripple", "stribeck"], []),
        (0.0, "found", ["backlash", "torque_ripple", "stribeck", "gravity"], []),
        (0.0, "found", ["backlash", "input_delay"], []),
        (0.0, "found", ["torque_ripple", "backlash"], []),
        (0.0, "found", ["elastic_coupling"], []),
        (1.0, "ambiguous", ["elastic_coupling"], ["backlash"]),
        (0.5, "ambiguous", ["backlash"], ["input_delay", "elastic_coupling"]),
        (0.0, "ambiguous", ["backlash"], ["input_delay", "elastic_coupling", "gravity"]),
        (0.0, "ambiguous", ["input_delay"], ["elastic_coupling"]),
        (0.5, "unexplained", ["gravity", "backlash"], []),
        (0.0, "unexplained", [], []),
        (0.0, "adequate", [], []),
        (0.0, "refused", [], []),
    ],
)
def test_an_answer_to_one_effect_is_worth(worth, verdict, effects, alternatives):
    assert points(CASE, Answer(verdict, tuple(effects), tuple(alternatives))) == worth


@pytest.mark.parametrize(
    "worth, verdict, effects",
    [
        (1.0, "adequate", []),
        (1.0, "found", ["torque_ripple", "gravity"]),
        (0.0, "found", ["torque_ripple", "backlash"]),
        (0.0, "unexplained", []),
        (0.0, "refused", []),
    ],
)
def test_an_answer_to_a_sound_drive_is_worth(worth, verdict, effects):
    for case in (SOUND, replace(SOUND, kind="sound")):
        assert points(case, Answer(verdict, tuple(effects))) == worth


def test_an_unknown_effect_wants_the_signals_it_depends_on():
    right = Answer("unexplained", depends_on=frozenset({"theta", "w"}))
    assert points(UNKNOWN, right) == 1.0
    assert points(UNKNOWN, replace(right, depends_on=frozenset({"w"}))) == 0.0
    assert points(UNKNOWN, replace(right, effects=("backlash",))) == 0.0
    assert points(UNKNOWN, replace(right, verdict="found")) == 0.0


def test_false_names_are_those_outside_truth_and_background():
    assert false_names(CASE, Answer("found", ("backlash", "gravity"))) == frozenset()
    assert false_names(CASE, Answer("found", ("input_delay",))) == {"input_delay"}
    assert false_names(CASE, Answer("adequate")) == frozenset()


def test_intervals_are_held_against_the_truth():
    given = Answer("found", intervals={"J": (0.9, 1.1), "backlash.gap": (0.2, 0.3), "Fc": (0, 1)})
    assert covered(CASE, given) == {"J": True, "backlash.gap": False}


def test_a_report_becomes_an_answer():
    entry = {"value": 1.0, "ci95": [0.5, 1.5]}
    report = {
        "verdict": "ambiguous",
        "effects": [
            {
                "name": "backlash",
                "parameters": {"gap": entry},
                "alternatives": [{"name": "elastic_coupling", "score": 0.0}],
            }
        ],
        "depends_on": None,
        "plain": {"parameters": {"J": entry, "Fc": {"value": 1.0, "ci95": None}}},
    }
    given = of_report(report, 1.0)
    assert (given.effects, given.alternatives) == (("backlash",), ("elastic_coupling",))
    assert given.intervals == {"J": (0.5, 1.5), "backlash.gap": (0.5, 1.5)}


def shrug(case: Case) -> Answer:
    """A judge that finds nothing."""
    return Answer("adequate", intervals={"J": (0.0, 10.0)})


def test_the_bench_counts_points_and_coverage_and_keeps_them(tmp_path):
    what = {"generator": "first", "judge": f"{__name__}:shrug", "prototype": None, "cache": None}
    found = [judged(seed, "none", **what) for seed in (0, 1)]
    said = summary(found)
    assert (said["points"], said["false_names"], said["coverage_plain"]) == (1.0, 0, 1.0)
    assert "none" in next(pairs(said)) and "adequate" in found[0].line
    keep(tmp_path / "kept.json", "a", said)
    keep(tmp_path / "kept.json", "b", said)
    assert (tmp_path / "kept.json").read_text().count("coverage_plain") == 2


def test_a_judge_that_fails_is_an_error_of_its_record():
    row = judged(0, "none", "first", "builtins:len", None, None)
    assert row.answer.verdict.startswith("error") and row.points == 0.0

"""The blind benchmark's own counting, on results written by hand; one small real run."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest

from ..blind import __main__ as bench
from ..blind import kept, limits, page, plan, score, trees, work
from ..cases.blind_results import effect, hidden, line, ripple
from ..drives import CATALOGUE, STRANGERS, make
from ..drives.sample import EXPORTS, LATE


@pytest.mark.parametrize(
    "worth, names, verdict, found",
    [
        (1.0, ["gravity"], "found", [effect("gravity")]),
        (0.0, ["gravity"], "found", [effect("return_spring")]),
        (0.0, ["gravity"], "found", [effect("gravity"), effect("gravity")]),
        (0.0, ["gravity"], "adequate", []),
        (0.0, ["gravity"], "unexplained", [effect("gravity")]),
        (0.5, ["gravity"], "ambiguous", [effect("gravity", ties=["x"])]),
        (0.5, ["gravity"], "ambiguous", [effect("x", ties=["y", "gravity"])]),
        (0.0, ["gravity"], "ambiguous", [effect("x", ties=["y", "z", "gravity"])]),
        (0.0, ["gravity"], "ambiguous", [effect("gravity"), effect("x", ties=["y"])]),
        (1.0, ["a", "b"], "found", [effect("b"), effect("a")]),
        (0.0, ["a", "b"], "found", [effect("a"), effect("b"), effect("c")]),
        (0.0, ["a", "b"], "found", [effect("a"), effect("a")]),
        (0.5, ["a", "b"], "ambiguous", [effect("b", ties=["c"]), effect("a", ties=["b"])]),
        (0.0, ["a", "b"], "ambiguous", [effect("c", ties=["a", "b"]), effect("d")]),
    ],
)
def test_credit(worth, names, verdict, found):
    assert score.credit(line(names, verdict, *found)) == worth


def test_both_may_stand_beside_another():
    three = line(["a", "b"], "found", effect("a"), effect("b"), effect("c"))
    assert score.both(three)
    assert not score.both(line(["a", "b"], "found", effect("a")))
    assert not score.both(line(["a", "b"], "unexplained", effect("a"), effect("b")))


def test_strangers_need_the_right_signal():
    def told(verdict, *signals):
        return score.signals(line(["torque_bumps"], verdict, depends_on=signals, kind="stranger"))

    assert told("unexplained", "theta") == (True, True)
    assert told("unexplained", "theta", "w") == (True, False)
    assert told("unexplained", "w", "theta") == (False, False)
    assert told("unexplained") == (False, False)
    assert told("found", "theta") == (False, False)


def test_parameter_errors_and_cover():
    good, far = ripple(0.041, [0.039, 0.042]), ripple(0.05, [0.049, 0.051], harmonic=14.0)
    by_name = {p.name: p for p in score.parameters(good)}
    assert by_name["amplitude"].error == pytest.approx(0.025) and by_name["amplitude"].covered
    across = (2 * np.pi - 6.2) / np.pi  # from 3.1 to -3.1 the short way
    assert by_name["phase"].error == pytest.approx(across) and by_name["phase"].covered
    assert by_name["harmonic"].counted and by_name["harmonic"].error == 0.0
    by_name = {p.name: p for p in score.parameters(far)}
    assert not by_name["amplitude"].covered and by_name["harmonic"].error == 1.0
    assert score.parameters(line(["torque_ripple"], "found", effect("gravity"))) == []
    spring = line(["return_spring"], "found", effect("return_spring", {"rest": (1.0, None)}),
                  told=[hidden("return_spring", rest=0.5)])  # fmt: skip
    (rest,) = score.parameters(spring)
    assert rest.error == pytest.approx(0.05) and rest.covered is None


def test_figures():
    lines = [
        ripple(0.041, [0.039, 0.042]),
        ripple(0.05, [0.049, 0.051], harmonic=14.0),
        line(["gravity"], "ambiguous", effect("gravity", ties=["x"])),
        line(["gravity"], "adequate", told=[hidden("gravity") | {"visible": 0.01}]),
        line([], "adequate", kind="none"),
        line([], "found", effect("gravity"), kind="none"),
        line([], "refused", kind="none"),
        line(["a", "b"], "found", effect("a"), effect("b"), effect("c"), kind="pair"),
        line(["torque_bumps"], "unexplained", depends_on=["theta", "t"], kind="stranger"),
        line(["gravity"], "adequate", problems=["hardly moves"]),
        line(["gravity"], "found", effect("gravity"), strength="weak"),
    ]
    made = page.figures(lines)
    assert made["named right, normal strength"] == "62.5 % of 4"
    assert made["named right, weak strength"] == "100.0 % of 1"
    assert made["named right, normal strength, where a refit hides it"] == "0.0 % of 1"
    assert made["two effects, exactly those named"] == "0.0 % of 1"
    assert made["two effects, both among the named"] == "100.0 % of 1"
    assert made["nothing missing, called adequate"].startswith("33.3 % of 3; 1 false alarms")
    assert made["outside the catalogue, unexplained with the right signal first"] == "100.0 % of 1"
    assert made["outside the catalogue, unexplained and no wrong signal"] == "0.0 % of 1"
    assert made["95 % intervals that cover"] == "75.0 % of 4, 0 without an interval"
    assert made["harmonics and sides exact"] == "50.0 % of 2"
    assert made["held-out error over the true model's, median"] == "1.1 (2 records)"
    assert made["held-out error over the simulator's from the true state, median"].startswith("2.2")
    assert made["below boosted trees"] == "100.0 % of 2"
    table = score.confusion(lines)
    assert table["gravity"]["adequate"] == 2 and table["gravity"]["gravity|x"] == 1
    told, block = page.text(lines), page.markdown(lines)
    assert "1 unfit" in told and "refused: short" in told and "unexplained(theta t) 1" in told
    assert "2030-02-03" in block and block.count("\n|") == len(made) + 2


def test_a_crash_is_counted_and_said():
    dead = {k: v for k, v in line(["gravity"], "found").items() if k not in ("answer", "truth")}
    lines = [dead | {"crash": "Traceback\nZeroDivisionError: oh"}]
    assert page.figures(lines)["named right, normal strength"] == "0.0 % of 1"
    assert "ZeroDivisionError: oh" in page.text(lines)
    assert page.text([]) and "never" in page.markdown([])


def test_upper_limit_of_a_rate():
    assert score.at_most(0, 200) == pytest.approx(1.0 - 0.05 ** (1 / 200))
    assert score.at_most(3, 3) == 1.0


def test_plan():
    args = bench.parser().parse_args(["--effects", "all,none", "--seeds", "5:7"])
    made = bench.planned(args)
    one = [t for t in made if t.kind == "effect"]
    assert len(one) == 2 * 2 * len(CATALOGUE) and len(made) - len(one) == 4
    assert len({t.key for t in made}) == len(made)
    every = len(STRANGERS)
    made = bench.planned(bench.parser().parse_args(["--unknown", str(every), "--pairs", "9"]))
    assert [t.kind for t in made] == ["stranger"] * every + ["pair"] * 9
    assert {t.names[0] for t in made[:every]} == set(STRANGERS)
    assert all(plan.together(*t.names) for t in made[every:])
    assert not plan.together("gravity", "dwell_stiction")  # one wants motion, the other rests
    assert not plan.together("elastic_coupling", "backlash")
    hard = plan.tasks(["gravity"], ["normal"], range(200), 0, 0, 0, hard=0.3)
    assert 30 < sum(t.hard for t in hard) < 90


def test_a_share_is_planned_as_other_logs_hold_it():
    def formed(*names):
        return plan.tasks([*names], ["normal"], range(200), 0, 0, 0, exported=0.5)

    forms = [t.form for t in formed("gravity", "none")]
    assert 150 < sum(map(bool, forms)) < 250 and set(forms) - {""} == set(EXPORTS)
    assert {t.form for t in formed("input_delay")} == set(EXPORTS) - set(LATE) | {""}
    assert not any(t.form for t in formed("velocity_sensor_lag"))


def test_results_are_read_again(tmp_path):
    path = tmp_path / "results.jsonl"
    rows = [{"key": "a", "n": 1}, {"key": "b"}, {"key": "a", "n": 2}]
    path.write_text("\n".join(map(json.dumps, rows)) + '\n{"key": "c", "tor')
    assert bench.read(path) == [{"key": "a", "n": 2}, {"key": "b"}]
    assert bench.read(tmp_path / "none") == []


def _dies(task, of):
    import os

    if task.seed == of:
        os._exit(1)
    return {"key": task.key}


@pytest.mark.slow
def test_a_process_that_dies_costs_its_own_record():
    todo = [plan.Task("none", (), "normal", seed) for seed in range(4)]
    done = {x["key"]: "crash" in x for x in bench.run(todo, partial(_dies, of=2), 2)}
    assert done == {t.key: t.seed == 2 for t in todo}


@pytest.fixture(scope="module")
def case():
    return make("gravity", "servo", seed=3, load=False, duration=10.0, rate=500.0)


def test_floor_is_the_sensor_noise_where_the_torque_is_known(case):
    t = case.columns["t"]
    held_out = (t % 4.0 >= 2.0) & (t < 8.0)
    found = SimpleNamespace(traces=SimpleNamespace(held_out=held_out),
                            error={"signal": "w", "horizon": 1.0})  # fmt: skip
    record = SimpleNamespace(t=t, samples=len(t))
    starts = limits.restarts(t, held_out, 1.0)
    np.testing.assert_allclose(starts, [2.0, 3.0, 6.0, 7.0])
    noise = case.columns["w"] - case.hidden.signals["w_true"]
    expected = np.sqrt(np.mean(noise[held_out] ** 2))
    assert limits.floor(case, [record], found) == pytest.approx(expected, rel=1e-9)


def test_the_true_model(case):
    from lugrectl.blocks.model import model_from_dict

    model = model_from_dict(limits.true_model(case), "truth")
    truth = case.truth
    assert model.known()["gravity.amplitude"] == truth["parameters"]["amplitude"]
    assert model.known()["sigma0"] == truth["plant"]["sigma0"]
    assert limits.true_model(make("torque_droop", "servo", seed=1, duration=5.0)) is None
    grips = limits.true_model(make("stribeck", "joint", "sparse", seed=1, duration=5.0))
    assert grips and grips["friction"]["model"] == "lugre" and not any(
        e["name"] == "stribeck" for e in grips["effects"]
    )  # fmt: skip


@pytest.mark.slow
def test_trees_learn_the_torque_that_is_missing():
    pytest.importorskip("sklearn")
    case = make("coulomb_asymmetry", "servo", seed=3, load=False, duration=10.0, rate=500.0)
    s, t = case.hidden.signals, case.columns["t"]
    dt = t[1] - t[0]

    def middle(x):
        return 0.5 * (x + np.append(x[1:], x[-1]))

    log = {"t": t + dt / 2, "theta": middle(s["theta_true"]), "w": middle(s["w_true"]),
           "u": s["u"], "a": np.gradient(s["w_true"], dt)}  # fmt: skip
    held_out = t % 4.0 >= 2.0
    traces = SimpleNamespace(signals=log, residual={"refitted": s["effect"]}, held_out=held_out,
                             measured=case.columns["w"])  # fmt: skip
    found = SimpleNamespace(traces=traces, error={"signal": "w", "horizon": 1.0})
    plant = case.truth["plant"]
    refitted = {"plant": plant, "friction": {k: v for k, v in plant.items() if k != "J"}}
    record = SimpleNamespace(t=t, samples=len(t), dt=dt)
    made = trees.trees_error(found, refitted, [record])
    assert made["trees"] < 0.1 * made["bare"]
    assert made["bare"] > 0.05 * np.std(s["w_true"])


@pytest.mark.slow
def test_a_small_run(tmp_path, capsys):
    asked = ["--effects", "torque_ripple,none", "--strength", "normal", "--seeds", "90000",
             "--short", "--out", str(tmp_path)]  # fmt: skip
    assert bench.main(asked) == 0
    lines = bench.read(tmp_path / "results.jsonl")
    assert [score.verdict(x) for x in lines] and not any("crash" in x for x in lines)
    (named,) = (x for x in lines if x["names"])
    assert named["answer"]["error"]["augmented"] > 0.9 * named["floor"]
    assert "torque_ripple" in capsys.readouterr().out
    assert bench.main(asked) == 0
    assert "0 to do" in capsys.readouterr().err
    assert bench.main(["--summary", str(tmp_path / "results.jsonl"), "--markdown"]) == 0
    assert capsys.readouterr().out.startswith("Blind benchmark of ")


def test_files_of_a_record(tmp_path, case):
    paths, model = work.write(case, tmp_path)
    with np.load(paths[0]) as stored:
        assert set(stored.files) == {"t", "u", "theta", "w"}
    assert "[friction]" in model.read_text()


def test_a_record_that_was_kept_is_read_back_as_it_was(tmp_path):
    t = np.arange(0.0, 1.0, 1e-2)
    task = plan.Task("none", (), "normal", 1)
    made = kept.Kept({"t": t, "w": np.sin(t)}, {"plant": {"J": 1.0}}, {"effects": []})
    kept.save(replace(made, more=(made,)), kept.place(task, tmp_path), task.key)
    again = kept.kept(task, tmp_path)
    assert again.model == made.model and len(again.more) == 1
    assert np.array_equal(again.columns["w"], made.columns["w"])

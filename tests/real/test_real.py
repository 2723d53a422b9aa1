"""The bench of measured logs: its rows, its rules, and one quick row through the balance."""

import os
from pathlib import Path

import pytest

import lugrectl as lg
from lugrectl.blocks.block import members
from lugrectl.record import read_log

from ..real.row import VERDICTS, Row, Source, score, value, way, wrong_values
from ..real.rows import all_rows
from ..scores.judges import values_of
from ..scores.question import Answer
from .ask import ask

DATA = Path(os.environ.get("LUGRECTL_DATA", Path(__file__).parents[3] / "shared" / "data"))
measured = pytest.mark.skipif(not DATA.is_dir(), reason=f"no measured data at {DATA}")
LATER = {"torque_proportional_friction"}  # names that the contract reserves
PENDULUM = Row(
    "pendulum",
    "own",
    (Source("run.csv"),),
    {"motion": "rotary"},
    (way("found ambiguous", "gravity constant_torque", beside="input_delay"), way("refused")),
    (value("J", 0.16, 0.19, needed=True), value("u_delay or input_delay.delay", 0.008, 0.014)),
    left=0.12,
)
KNOWN = {"J": (0.17, None, None)}


def judged(*args, **more):
    return score(PENDULUM, Answer(*args, **{"parameters": KNOWN, **more}))


def test_the_table_has_its_31_rows_each_with_a_name_of_its_own():
    rows = all_rows()
    assert sum(row.group == "table" for row in rows) == 31
    assert len({row.name for row in rows}) == len(rows)
    assert {row.group for row in rows} == {"table", "map", "format"}


def test_every_row_asks_for_verdicts_and_effects_that_there_are():
    known = set(members("effect")) | LATER
    for row in all_rows():
        assert row.right and row.sources, row.name
        for one in row.right:
            named = one.beside.union(*one.names)
            assert one.verdicts <= set(VERDICTS) and named <= known, (row.name, named - known)
        assert all(v.low <= v.high for v in row.values), row.name


@measured
def test_every_file_of_the_rows_is_there():
    assert not [f for row in all_rows() for f in row.missing(DATA)]


@pytest.mark.parametrize(
    "answer, named, words",
    [
        (Answer("adequate", parameters=KNOWN), False, "is not named"),
        (Answer("found", ("gravity", "backlash"), parameters=KNOWN), False, "backlash is wrong"),
        (Answer("ambiguous", ("gravity",), tuple("abc"), parameters=KNOWN), False, "3 causes"),
        (Answer("found", ("gravity",)), True, "J is not given"),
        (Answer("found", ("gravity",), parameters={"J": (0.2, None, None)}), True, "J 0.2, not"),
        (Answer("found", ("gravity",), parameters=KNOWN, left=0.131), True, "13.1 % left"),
        (Answer("timeout", reason="300 s"), False, "300 s"),
    ],
)
def test_what_is_wrong_is_said(answer, named, words):
    made = score(PENDULUM, answer)
    assert (made.named, made.right) == (named, False)
    assert words in "; ".join(made.why)


def test_a_judge_that_fails_or_hangs_costs_its_own_row_only():
    row = all_rows()[0]
    failed = ask(row, Path(), "time:sleep")
    assert failed.verdict == "crash" and "TypeError" in failed.reason
    assert ask(row, Path(), "time:sleep", limit=0.001).verdict == "timeout"


@measured
def test_the_balance_knows_the_inertia_of_a_small_motor_in_one_direction():
    row = next(row for row in all_rows() if row.name == "un prbs_open")
    source = row.sources[0]
    found = lg.balance(read_log(DATA / source.file, **source.options), dict(row.model))
    known = values_of({"plain": found.summary(), "parameters": {}, "effects": []})
    answer = Answer("found", parameters=known)
    J = [v for v in row.values if v.names == ("J",)]
    assert "J" in answer.parameters and not wrong_values(J, answer)

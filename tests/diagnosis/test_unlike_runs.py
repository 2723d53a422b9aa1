"""One run of several that contradicts the others is named; the answer is that of the others."""

import numpy as np
import pytest

import lugrectl as lg

from ..cases.balance_drive import FC, J, recorded

MODEL = lg.Model.of(friction="coulomb")
NAMES = ["one.csv", "two.csv", "three.csv"]


@pytest.fixture(scope="module")
def runs():
    return [recorded(6.0, seed=seed) for seed in range(3)]


def scaled(run, u=1.0, theta=1.0, t=1.0):
    return {"t": t * run["t"], "u": u * run["u"], "theta": theta * run["theta"]}


def written(folder, runs):
    for name, run in zip(NAMES, runs, strict=False):
        head = "t [s],u [N m],theta [rad]"
        np.savetxt(folder / name, np.c_[*run.values()], "%.9g", ",", header=head, comments="")
    return [folder / name for name in NAMES[: len(runs)]]


def balanced(folder, runs):
    return lg.balance(written(folder, runs), MODEL)


def test_runs_of_one_drive_agree(runs):
    found = lg.balance(runs, MODEL)
    assert not found.unlike and not found.notes


@pytest.mark.parametrize(
    "factors, said",
    [
        ({"u": -1.0}, 'u has the opposite sign of the other runs: give scale="u=-1"'),
        ({"u": 1e3}, 'u is 1000 times that of the other runs: give units="u=mN m"'),
        ({"theta": 180 / np.pi}, "theta is 57.3 times that of the other runs"),
        ({"theta": 0.5 / np.pi}, 'give units="theta=turn"'),
        ({"t": 1e3}, 'give units="t=ms"'),
    ],
)
def test_another_unit_or_sign_is_named(runs, factors, said, tmp_path):
    found = balanced(tmp_path, [runs[0], scaled(runs[1], **factors), runs[2]])
    (sentence,) = found.unlike
    assert sentence.startswith("two.csv: ") and said in sentence
    assert found.parameters["J"].may_be(J)


def test_of_two_runs_the_impossible_one_is_named(runs, tmp_path):
    found = balanced(tmp_path, [scaled(runs[0], u=-1.0), runs[1]])
    (sentence,) = found.unlike
    assert sentence.startswith("one.csv: ") and "sign of two.csv" in sentence


def test_more_friction_is_a_note_and_no_reason_to_leave_a_run_out(runs, tmp_path):
    way = np.sign(np.gradient(runs[2]["theta"]))  # half as much friction again
    more = runs[2] | {"u": runs[2]["u"] + 0.5 * FC * way}
    found = balanced(tmp_path, [*runs[:2], more])
    (note,) = (n for n in found.notes if "more friction" in n)
    assert not found.unlike and note.startswith("three.csv: ")


def test_a_diagnosis_is_refused_with_the_name_of_the_run(runs, tmp_path):
    d = lg.diagnose(written(tmp_path, [runs[0], scaled(runs[1], u=-1.0), runs[2]]), MODEL)
    assert d.verdict == "refused"
    assert d.reason == (
        'two.csv: u has the opposite sign of the other runs: give scale="u=-1" for it, or leave '
        "it out."
    )
    low, high = d.plain.parameters["J"].ci95
    assert low <= J <= high

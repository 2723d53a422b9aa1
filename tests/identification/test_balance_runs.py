"""One run of several that contradicts the others is named; the answer is that of the others."""

from dataclasses import replace

import numpy as np
import pytest

import lugrectl as lg
from lugrectl.identification.balance import unlike

from ..cases.balance_drive import FC, J, recorded

MODEL = lg.Model.of(friction="coulomb")
NAMES = ["one.csv", "two.csv", "three.csv"]


@pytest.fixture(scope="module")
def runs():
    return [recorded(6.0, seed=seed, run=seed) for seed in range(3)]


def scaled(run, u=1.0, theta=1.0, t=1.0):
    return replace(run, u=u * run.u, theta=theta * run.theta, t=t * run.t, dt=t * run.dt)


def test_runs_of_one_drive_agree(runs):
    found = unlike(runs, MODEL, NAMES)
    assert not found.said and not found.notes and not found.left_out


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
def test_another_unit_or_sign_is_named(runs, factors, said):
    found = unlike([runs[0], scaled(runs[1], **factors), runs[2]], MODEL, NAMES)
    (sentence,) = found.said
    assert sentence.startswith("two.csv: ") and said in sentence
    assert found.left_out == {1}


def test_of_two_runs_the_impossible_one_is_named(runs):
    found = unlike([scaled(runs[0], u=-1.0), runs[1]], MODEL, NAMES)
    assert found.left_out == {0} and "sign of two.csv" in found.said[0]


def test_more_friction_is_a_note_and_no_reason_to_leave_a_run_out(runs):
    way = np.sign(np.gradient(runs[2].theta))  # half as much friction again
    more = replace(runs[2], u=runs[2].u + 0.5 * FC * way)
    found = unlike([*runs[:2], more], MODEL, NAMES)
    assert not found.left_out and len(found.notes) == 1
    assert found.notes[0].startswith("three.csv: ") and "more friction" in found.notes[0]


def test_a_diagnosis_is_refused_with_the_name_of_the_run(runs, tmp_path):
    paths = []
    for run, sign in zip(runs, (1, -1, 1), strict=True):
        paths.append(tmp_path / NAMES[run.run])
        rows = np.c_[run.t, sign * run.u, run.theta]
        np.savetxt(paths[-1], rows, "%.9g", ",", header="t,u [N m],theta [rad]", comments="")
    d = lg.diagnose(paths, MODEL)
    assert d.verdict == "refused"
    assert d.reason == (
        'two.csv: u has the opposite sign of the other runs: give scale="u=-1" for it, or leave '
        "it out."
    )
    low, high = d.plain.parameters["J"].ci95
    assert low <= J <= high

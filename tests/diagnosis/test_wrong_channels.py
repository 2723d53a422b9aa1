"""A channel of the wrong sign, in another unit or in another's column: said, with the option."""

import numpy as np
import pytest

import lugrectl as lg
from lugrectl.report import text

from ..cases.balance_drive import FC, FV, J, noisy, recorded
from ..cases.logs import machine

MODEL = lg.Model.of(friction="coulomb")
SWAPPED = "u and {} seem to be swapped: the other way round the balance leaves 0."
NAMES = ["one.csv", "two.csv", "three.csv"]


@pytest.fixture(scope="module")
def turned():
    log = noisy(5.0)
    return log | {"u": -log["u"]}


def test_a_refusal_names_the_option_and_claims_no_change(turned):
    no = lg.diagnose(turned, lg.Model.of(J=J, Fc=FC, Fv=FV))
    assert no.verdict == "refused" and 'wrong sign: give scale="u=-1"' in no.reason
    assert "was changed" not in " ".join(no.messages)
    assert "other sign" in text(no)  # whose values the plain answer has


def test_a_fit_is_refused_too_and_the_plain_answer_is_that_of_the_other_sign(turned):
    with pytest.raises(lg.Refused, match='wrong sign.*scale="u=-1"') as no:
        lg.identify(turned, MODEL)
    assert no.value.plain.parameters["J"].value == pytest.approx(J, rel=0.01)


def exchanged(**columns):
    """The machine's log, its channels in columns of these names."""
    made = machine(n=6000)
    return {"t": made["t"]} | {role: made[name] for role, name in columns.items()}


def test_torque_and_angle_exchanged_are_said_to_be():
    known = {"J": 0.002, "friction": "coulomb", "Fc": 0.2, "Fv": 0.02}
    found = lg.diagnose(exchanged(u="theta", theta="u", w="w"), known)
    assert found.verdict == "refused" and found.reason.startswith(SWAPPED.format("theta"))
    assert 'columns="u=NAME,theta=NAME"' in found.reason
    assert not any("u has the wrong sign" in m for m in found.messages)


@pytest.mark.slow
def test_torque_and_speed_exchanged_are_said_to_be_before_all_else():
    found = lg.balance(exchanged(u="w", w="u"), MODEL)
    assert found.said[0].startswith(SWAPPED.format("w"))


# One run of several that contradicts the others; the answer is that of the others.


@pytest.fixture(scope="module")
def runs():
    return [recorded(4.0, seed=seed) for seed in range(3)]


def scaled(run, u=1.0, theta=1.0, t=1.0):
    return {"t": t * run["t"], "u": u * run["u"], "theta": theta * run["theta"]}


@pytest.fixture
def written(tmp_path):
    def of(*runs):
        for name, run in zip(NAMES, runs, strict=False):
            head = "t [s],u [N m],theta [rad]"
            np.savetxt(tmp_path / name, np.c_[*run.values()], "%.9g", ",", header=head, comments="")
        return [tmp_path / name for name in NAMES[: len(runs)]]

    return of


def test_runs_of_one_drive_agree(runs):
    found = lg.balance(runs[:2], MODEL)
    assert not found.unlike and not found.notes


@pytest.mark.slow
def test_an_offset_of_the_torque_of_one_run_is_no_missing_effect(runs):
    found = lg.diagnose([runs[0], runs[1] | {"u": runs[1]["u"] + 0.02}], MODEL)
    assert found.verdict == "adequate"


@pytest.mark.cases
@pytest.mark.parametrize(
    "factors, said",
    [
        ({"u": -1.0}, 'u has the opposite sign of the other runs: give scale="u=-1"'),
        ({"theta": 180 / np.pi}, "theta is 57.3 times that of the other runs"),
        ({"t": 1e3}, 'give units="t=ms"'),
    ],
)
def test_another_unit_or_sign_is_named(runs, factors, said, written):
    found = lg.balance(written(runs[0], scaled(runs[1], **factors), runs[2]), MODEL)
    (sentence,) = found.unlike
    assert sentence.startswith("two.csv: ") and said in sentence
    assert found.parameters["J"].may_be(J)


def test_of_two_runs_the_impossible_one_is_named(runs, written):
    found = lg.balance(written(scaled(runs[0], u=-1.0), runs[1]), MODEL)
    (sentence,) = found.unlike
    assert sentence.startswith("one.csv: ") and "sign of two.csv" in sentence


@pytest.mark.slow
@pytest.mark.cases
@pytest.mark.parametrize("unit, size", [("theta=deg", 180 / np.pi), ("w=rpm", 30 / np.pi)])
def test_an_angle_or_speed_in_another_unit_than_the_declared_values_is_said(unit, size):
    channel = unit.split("=")[0]
    log = exchanged(u="u", **{channel: channel})
    right = {"J": 0.002, "friction": "coulomb", "Fc": 0.2, "Fv": 0.02}
    no = lg.diagnose(log | {channel: size * log[channel]}, right)
    assert no.verdict == "refused" and f'give units="{unit}"' in no.reason
    assert lg.diagnose(log, right).verdict != "refused"

"""An answer from a short record says that it is short, and how long to record next."""

import numpy as np
import pytest

from lugrectl import Model, diagnose
from lugrectl.core.errors import Refused
from lugrectl.diagnosis.notes import refusal
from lugrectl.estimates.balance import Balance
from lugrectl.report import text

from ..cases.balance_drive import simulate, torque

DT = 1e-3


def log(seconds):
    """A drive with a load that its model does not contain: columns of a log."""
    u = torque(seconds, DT, seed=3)
    theta, _ = simulate(u, DT, load=lambda theta, w: 0.06 * np.sin(6.0 * theta))
    noise = np.random.default_rng(0).normal(0.0, 1e-4, len(u))
    return {"t": DT * np.arange(len(u)), "u": u, "theta": theta + noise}


@pytest.fixture(scope="module")
def one_second():
    return diagnose(log(1.0), Model.of(J=0.002, Fc=0.2, Fv=0.02))


def test_a_second_long_record_says_how_long_it_is_and_how_much_was_compared(one_second):
    notes = " ".join(one_second.messages)
    assert "The record is short: 1 s, in which" in notes and "independent stretches" in notes


def test_a_short_record_says_how_long_to_record_next(one_second):
    assert one_second.experiment is not None
    assert one_second.experiment.startswith("Record 18 s or more of such motion first")


@pytest.mark.parametrize(
    ("seed", "size", "channel"),
    [(1, 0.3, "theta"), (5, 0.6, "w")],
)
def test_half_a_second_names_nothing_where_nothing_is_missing(seed, size, channel):
    u = torque(0.5, DT, seed, size)
    theta, w = simulate(u, DT)
    noise = np.random.default_rng(seed).normal(0.0, 0.02, len(u))
    motion = {"theta": np.floor(theta / 3e-4) * 3e-4, "w": w + noise}[channel]
    log = {"t": DT * np.arange(len(u)), "u": u, channel: motion}
    found = diagnose(log, Model.of(J=0.004, Fc=0.11, Fv=0.0065))
    assert found.verdict in ("adequate", "refused") and not found.effects
    assert found.reason or "The record is short" in " ".join(found.messages)


def test_a_note_of_the_plain_balance_is_printed_once():
    plain = Balance(notes=("Fc is taken as declared.",), reading=("t is even.",))
    no = refusal(Refused("The drive hardly slides."), Model.of(J=0.002), [], plain)
    assert "Fc is taken as declared." in no.messages
    assert text(no).count("Fc is taken as declared.") == text(no).count("t is even.") == 1

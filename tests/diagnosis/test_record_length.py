"""An answer from a short record says that it is short, and how long to record next."""

import numpy as np
import pytest

from lugrectl import Model, diagnose

from ..cases.balance_drive import noisy, simulate, torque

DT = 1e-3


@pytest.fixture(scope="module")
def one_second():
    """With a load that the model does not contain."""
    log = noisy(1.0, DT, lambda theta, w: 0.06 * np.sin(6.0 * theta))
    return diagnose(log, Model.of(J=0.002, Fc=0.2, Fv=0.02))


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

"""Torque and motion in each other's columns: said where only the exchange makes a drive of them."""

import pytest

import lugrectl as lg

from ..cases.logs import machine

MODEL = {"J": 0.002, "friction": "coulomb", "Fc": 0.2, "Fv": 0.02}
SAYS = "u and {} seem to be swapped: the other way round the balance leaves 0."


def log(**columns):
    """The machine's log, its channels in columns of these names."""
    made = machine(n=6000)
    return {"t": made["t"]} | {role: made[name] for role, name in columns.items()}


def plain(given):
    return lg.balance(given, lg.Model.of(friction="coulomb"))


@pytest.mark.parametrize("beside", [{}, {"w": "w"}])
def test_torque_and_angle_exchanged_are_said_to_be(beside):
    found = lg.diagnose(log(u="theta", theta="u", **beside), MODEL)
    assert found.verdict == "refused" and found.reason.startswith(SAYS.format("theta"))
    assert 'columns="u=NAME,theta=NAME"' in found.reason
    assert not any("u has the wrong sign" in m for m in found.messages)


@pytest.mark.cases
@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("roles", [("theta",), ("w",), ("theta", "w")])
def test_a_torque_of_either_sign_in_its_own_column_is_not(sign, roles):
    given = log(u="u", **{role: role for role in roles})
    found = plain(given | {"u": sign * given["u"]})
    assert not any("swapped" in said for said in found.said)
    assert bool(found.refused) == (sign < 0)


def test_torque_and_speed_exchanged_are_said_to_be_before_all_else():
    found = plain(log(u="w", w="u"))
    assert found.said[0].startswith(SAYS.format("w"))

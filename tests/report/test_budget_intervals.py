"""The budget: its intervals, its noise, and what its shares are of."""

from dataclasses import replace

import pytest

from lugrectl import Model, diagnose
from lugrectl.core.display import number
from lugrectl.report.wording import budget

from ..cases.balance_drive import FC, noisy
from ..cases.made_up import diagnosis


@pytest.fixture(scope="module")
def compared():
    return diagnose(noisy(6.0), Model.of(J=0.004, Fc=FC, Fv=0.006)).comparison


def test_a_narrow_interval_has_the_digits_that_tell_its_ends_apart():
    found = diagnosis().comparison
    narrow = replace(found.budget[0], ci95=(0.75811, 0.75842))
    said = budget(diagnosis(comparison=replace(found, budget=(narrow, *found.budget[1:]))))
    assert said.grid.rows[0][said.grid.head.index("95 % interval")] == "75.811 to 75.842 %"


def test_intervals_stay_where_the_model_explains_the_torque(compared):
    terms = {s.term: s for s in compared.budget}
    assert all(terms[k].ci95 is not None for k in ("inertia", "coulomb", "viscous"))
    assert terms["noise"].rms <= terms["left"].rms
    assert "no intervals" not in budget(diagnosis(comparison=compared)).footnote


def test_what_the_shares_are_of_is_said_and_what_stays_beside_an_unknown_torque():
    found = diagnosis().comparison
    said = budget(diagnosis(comparison=found))
    whole = found.budget[0].rms / found.budget[0].share
    assert f"Shares are of {number(whole, 3)} N m, the RMS friction torque of" in said.footnote
    assert "not explained" in [row[0] for row in said.grid.rows]
    more = replace(found, budget=(replace(found.budget[0], term="unknown torque"), *found.budget))
    names = [row[0] for row in budget(diagnosis(comparison=more)).grid.rows]
    assert "the rest" in names and "not explained" not in names


def test_coulomb_and_viscous_are_those_of_the_curve_not_of_its_shapes(compared):
    """Of the many shapes of friction several share the torque; the plain level is one number."""
    terms = {s.term: s for s in compared.budget}
    assert terms["coulomb"].rms == pytest.approx(FC, rel=0.02)

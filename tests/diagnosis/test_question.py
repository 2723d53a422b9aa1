"""What a function of a log takes: the log in any form, and how it is to be read."""

import numpy as np
import pytest

import lugrectl as lg

from ..cases import small_answers
from ..cases.small_answers import FC, J

READING = {
    "columns": {"t": "stamp", "u": "moment", "theta": "place"},
    "units": {"t": "ms", "theta": "deg"},
    "scale": {"u": 0.5},
}


def table(offset=0.0):
    """A drive in a table with names, units and a factor of its own."""
    made = small_answers.log()
    place = np.rad2deg(made["theta"] + offset)
    return {"stamp": 1e3 * made["t"], "moment": 2.0 * made["u"], "place": place}


def coulomb():
    return lg.Model.of(friction="coulomb")


def test_identify_reads_a_table_as_read_record_does():
    found = lg.identify(table(), coulomb(), **READING)
    assert found.model.J == pytest.approx(J, rel=0.02)
    other = lg.identify(lg.read_record(table(), **READING), coulomb())
    assert found.model.J == pytest.approx(other.model.J, rel=1e-6)


@pytest.mark.slow
def test_diagnose_reads_runs_and_what_is_held_out_alike():
    found = lg.diagnose([table()], coulomb(), holdout=table(offset=1.0), **READING)
    assert found.verdict == "adequate"
    assert found.error["unit"] == "rad" and found.error["augmented"] < 1e-2
    assert found.model.values()["Fc"] == pytest.approx(FC, rel=0.02)


def test_the_balance_takes_a_rate_in_place_of_stamps():
    log = {k: x for k, x in table().items() if k != "stamp"}
    how = {"columns": "u=moment,theta=place", "units": "theta=deg", "scale": "u=0.5"}
    found = lg.balance(log, rate=200.0, **how)
    assert found.parameters["J"].value == pytest.approx(J, rel=0.02)


@pytest.mark.parametrize("work", [lg.diagnose, lg.identify, lg.balance, lg.compare_laws])
def test_a_record_is_read_already(work):
    record = lg.read_record(table(), **READING)
    with pytest.raises(lg.InputError, match="units is for a log that is still to be read"):
        work(record, coulomb(), units="t=ms")
    with pytest.raises(lg.InputError, match="columns must be a dict by role"):
        work(table(), coulomb(), columns=["moment"])

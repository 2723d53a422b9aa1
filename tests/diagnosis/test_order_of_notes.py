"""What casts doubt on the whole answer is the first note, in text, HTML and JSON alike."""

import numpy as np
import pytest

import lugrectl as lg
from lugrectl.diagnosis.identify import ONLY_PLAIN
from lugrectl.diagnosis.never_worse import FAILED
from lugrectl.diagnosis.old_diagnose import NO_FIT, WORSE
from lugrectl.diagnosis.order_of_notes import GRAVE, grave_first
from lugrectl.diagnosis.other_law import LACKS, OWN
from lugrectl.report import text, write

from ..cases.logs import machine, rows
from ..cases.logs import write as file

USUAL = "Columns were identified by usual names: u = 'torque' in N m."


def log(tmp_path, head):
    """The machine's log with theta in deg."""
    made = machine()
    columns = [made["t"], made["u"], np.rad2deg(made["theta"]), made["w"]]
    return file(tmp_path / "run.csv", f"{head}\n{rows(columns)}")


@pytest.fixture(scope="module")
def overridden(tmp_path_factory):
    path = log(tmp_path_factory.mktemp("deg"), "t [s],torque [N m],theta [deg],w [rad/s]")
    return lg.identify(path, {"J": 2e-3, "friction": "coulomb"}, units="theta=rad")


def test_a_unit_that_contradicts_header_and_data_comes_first(overridden):
    first, second, *others = overridden.messages
    assert first.startswith('The header says theta [deg]; units="theta=rad" was used')
    assert second.startswith("theta is stated in rad but in fact in deg")
    assert any("usual names" in m for m in others)
    assert overridden.summary()["messages"] == list(overridden.messages)


def test_text_and_page_have_the_same_order(overridden, tmp_path):
    write(overridden, tmp_path)
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    for shown in (" ".join(text(overridden).split()), " ".join(page.split())):
        places = [shown.index(f"{start}") for start in ("The header says", "theta is stated in rad",
                                                        "Columns were identified")]  # fmt: skip
        assert places == sorted(places)


@pytest.mark.parametrize("log", ["", "run.csv: ", "a b: c.csv: "])
@pytest.mark.parametrize(
    "grave",
    [FAILED.format(9.0, 2.0), OWN.format("half"), LACKS.format("own", "viscous", 0.3, "N m", 7.0),
     NO_FIT.format("."), ONLY_PLAIN.format("."),
     WORSE.format(2.0, 1.0, "rad")],
)  # fmt: skip
def test_a_fit_that_failed_comes_before_what_was_read(grave, log):
    said = [USUAL, "The record moves declared values.", f"{log}{grave}"]
    assert grave_first(said) == (said[2], said[0], said[1])


def test_others_keep_their_order_and_the_gravest_is_first():
    failed, header = FAILED.format(9.0, 2.0), "The header says w [rpm]; it was not used."
    assert grave_first(["b", failed, "a", header]) == (header, failed, "b", "a")
    assert len(GRAVE) == len(set(GRAVE))

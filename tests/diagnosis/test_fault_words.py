"""What is noticed in a log is said once, truly, and names what was left out."""

import json

import numpy as np
import pytest

from lugrectl import InputError, Refused, identify, read_record
from lugrectl.cli import main
from lugrectl.record.files.text import with_remark

from ..cases.faulty_logs import columns, late, put, with_w, write


@pytest.mark.parametrize(
    "change",
    [late(9), with_w(lambda w: np.r_[w[:1].repeat(4), w[:-4]]), put("theta", 900, 1e30)],
)
def test_no_sentence_of_the_json_comes_twice(tmp_path, capsys, change):
    path = write(tmp_path, change(columns()))
    (tmp_path / "m.toml").write_text('name = "drive"\n[plant]\n[friction]\nmodel = "coulomb"\n')
    main(["identify", str(path), "--model", str(tmp_path / "m.toml"), "--json"])
    messages = json.loads(capsys.readouterr().out)["messages"]
    assert len(set(messages)) == len(messages)
    assert sum("behind dtheta/dt" in m or "lags theta" in m for m in messages) <= 1
    assert not any("steps of the sensor" in m for m in messages)


def test_a_log_that_shows_its_sensors_only_is_refused():
    """Noise in place of the torque: how late the speed is says nothing of the drive."""
    log = columns("w")
    log["u"] = 0.3 * np.random.default_rng(1).standard_normal(len(log["t"]))
    with pytest.raises(Refused) as no:
        identify(log, {})
    assert no.value.plain is not None and "J" not in no.value.plain.parameters


@pytest.mark.parametrize("cell", ["-1200,,was -8.9", "3.5 (typed)", "0; see note", "1e3 error"])
def test_a_number_with_words_beside_it_was_typed_over(cell):
    assert with_remark(cell)


@pytest.mark.parametrize("cell", ["abc", "1.2.3", "12_3", "3.5", "1,000", "2024-03-09"])
def test_other_cells_were_not(cell):
    assert not with_remark(cell)


def test_other_text_in_a_cell_is_an_error(tmp_path):
    log = columns()
    path = write(tmp_path, log | {"u": ["12_3", *(f"{x:.9g}" for x in log["u"][1:])]})
    with pytest.raises(InputError, match="line 2, column 'u': '12_3' is not a number"):
        read_record(path)


def test_a_few_rows_that_rise_are_not_called_noise():
    rows = np.arange(13.0)
    with pytest.raises(Refused) as no:
        identify({"t": 0.02 * rows, "u": 0.2 + 0.1 * rows, "w": 0.06 + 0.9 * rows}, {})
    assert "noise" not in str(no.value)

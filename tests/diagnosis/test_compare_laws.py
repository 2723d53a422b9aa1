"""Friction laws compared on a log: the chosen one, what stays beside it, and the command."""

import io
import json
from contextlib import redirect_stdout

import numpy as np
import pytest

import lugrectl as lg
from lugrectl.cli import main
from lugrectl.diagnosis import compare_laws as laws

from ..cases import small_answers

ask = lg.compare_laws
LAWS = ["viscous", "coulomb", "stribeck"]


@pytest.fixture(scope="module")
def plain_drive():
    return small_answers.log()


@pytest.fixture(scope="module")
def answered(plain_drive, tmp_path_factory):
    """The document and the report of the command, and the comparison that it made."""
    folder, said, made = tmp_path_factory.mktemp("laws"), io.StringIO(), []
    table, head = np.column_stack(list(plain_drive.values())), ",".join(plain_drive)
    np.savetxt(folder / "run.csv", table, delimiter=",", header=head, comments="")
    (folder / "my.toml").write_text('[friction]\nmodel = "viscous"\n')
    asked = ["identify", str(folder / "run.csv"), "--model", str(folder / "my.toml"), "--json"]
    with pytest.MonkeyPatch.context() as patch, redirect_stdout(said):
        patch.setattr(laws, "law_names", lambda given: LAWS)
        patch.setattr(laws, "compare_laws", lambda *a, **k: made.append(ask(*a, **k)) or made[0])
        assert main([*asked, "--law", "auto", "--out", str(folder / "out")]) == 0
    return json.loads(said.getvalue()), (folder / "out" / "report.html").read_text(), made[0]


@pytest.fixture
def compared(answered):
    return answered[2]


@pytest.mark.slow
def test_the_simplest_law_that_predicts_as_well_is_chosen(compared):
    assert compared.chosen == "coulomb"
    assert compared["viscous"].elpd < -100.0 and compared["viscous"].se > 1.0
    assert compared["coulomb"].elpd == 0.0
    assert compared.model.friction.block.name == "coulomb"


@pytest.mark.slow
@pytest.mark.sample
def test_a_dip_that_the_record_shows_is_kept():
    dip = small_answers.log(
        16.0, 2e-3, load=lambda theta, w: 0.1 * np.sign(w) * np.exp(-((w / 0.8) ** 2))
    )
    found = lg.compare_laws(dip, {}, ["coulomb", "stribeck"])
    assert found.chosen == "stribeck"
    assert found["coulomb"].elpd < -1000.0


def test_the_comparison_hands_itself_out(compared):
    assert compared.names[0] in compared
    document = json.loads(compared.to_json())
    assert document["chosen"] == "coulomb"
    assert {row["name"]: row["elpd"] for row in document["laws"]}["coulomb"] == 0.0
    assert "coulomb" in repr(compared) and "predicts better by" in compared._repr_html_()
    assert list(compared.to_frame().index) == list(compared.names)


def test_laws_that_do_not_exist_are_one_sentence(plain_drive, compared):
    with pytest.raises(lg.InputError, match="laws: there is no friction law named 'lugree'"):
        lg.compare_laws(plain_drive, {}, "lugree")
    with pytest.raises(lg.InputError, match="'dahl' was not compared"):
        compared["dahl"]


def test_a_law_that_takes_too_long_is_left_out(plain_drive):
    with pytest.raises(lg.Refused, match="stopped after 0.001 s"):
        lg.compare_laws(plain_drive, {}, ["coulomb"], time_limit=1e-3)


def test_the_command_chooses_a_law_and_says_so(answered):
    found, report, _ = answered
    assert found["laws"]["chosen"] == found["model"]["friction"]["model"] == "coulomb"
    assert "Friction laws" in report


def test_python_takes_a_law_too(plain_drive):
    found = lg.identify(plain_drive, {"friction": "lugre"}, law="coulomb")
    assert found.model.friction.block.name == "coulomb" and found.laws is None
    with pytest.raises(lg.InputError, match="did you mean 'coulomb'"):
        lg.identify(plain_drive, {}, law="coulom")


def test_many_drives_need_a_law_by_name(tmp_path, capsys):
    (tmp_path / "my.toml").write_text('[friction]\nmodel = "lugre"\n')
    asked = ["diagnose", str(tmp_path), "--each", "--model", str(tmp_path / "my.toml")]
    assert main([*asked, "--law", "auto"]) == 2
    assert "--law auto" in capsys.readouterr().err

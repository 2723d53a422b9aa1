"""Friction laws compared on a log: the chosen one, what stays beside it, and the command."""

import json

import numpy as np
import pytest

import lugrectl as lg
from lugrectl.cli import main

from ..cases import small_answers

LAWS = ["viscous", "coulomb", "stribeck"]


@pytest.fixture(scope="module")
def plain_drive():
    return small_answers.log(speed=True)


@pytest.fixture(scope="module")
def compared(plain_drive):
    return lg.compare_laws(plain_drive, {}, LAWS)


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


def test_laws_that_do_not_exist_are_one_sentence(plain_drive):
    with pytest.raises(lg.InputError, match="laws: there is no friction law named 'lugree'"):
        lg.compare_laws(plain_drive, {}, "lugree")
    with pytest.raises(lg.InputError, match="'dahl' was not compared"):
        lg.compare_laws(plain_drive, {}, "coulomb")["dahl"]


def test_a_law_that_takes_too_long_is_left_out(plain_drive):
    with pytest.raises(lg.Refused, match="stopped after 0.001 s"):
        lg.compare_laws(plain_drive, {}, ["coulomb"], time_limit=1e-3)


def test_the_command_chooses_a_law_and_says_so(plain_drive, tmp_path, capsys, monkeypatch):
    from lugrectl.diagnosis import compare_laws as laws

    monkeypatch.setattr(laws, "law_names", lambda given: LAWS[:2])
    table = np.column_stack(list(plain_drive.values()))
    np.savetxt(
        tmp_path / "run.csv", table, delimiter=",", header=",".join(plain_drive), comments=""
    )
    (tmp_path / "my.toml").write_text('[friction]\nmodel = "lugre"\n')
    asked = ["identify", str(tmp_path / "run.csv"), "--model", str(tmp_path / "my.toml")]
    assert main([*asked, "--law", "auto", "--out", str(tmp_path / "out"), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["laws"]["chosen"] == found["model"]["friction"]["model"] == "coulomb"
    assert "Friction laws" in (tmp_path / "out" / "report.html").read_text()


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

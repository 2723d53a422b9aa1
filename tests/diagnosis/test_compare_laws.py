"""Friction laws compared on a log: the chosen one, what stays beside it, and the command."""

import json

import numpy as np
import pytest

import lugrectl as lg
from lugrectl.cli import main

LAWS = ["viscous", "coulomb", "stribeck", "lugre"]


def log(dip, seconds=16.0, dt=2e-3, seed=1):
    """Torque and motion of a drive with Coulomb friction and a Stribeck dip of ``dip`` N m."""
    rng = np.random.default_rng(seed)
    t, inner = np.arange(0.0, seconds, dt), 20
    w, theta, rows = 0.0, 0.0, []
    for now in t:
        goal = 1.2 * np.sin(2 * np.pi * 0.4 * now) + 0.5 * np.sin(2 * np.pi * 0.13 * now)
        u = 0.3 * (goal - w) + 0.25 * np.tanh(5.0 * goal)
        rows.append((now, u, w, theta))
        for _ in range(inner):
            level = 0.2 + dip * np.exp(-((w / 0.25) ** 2))
            pushed = w + dt / inner * (u - 0.03 * w) / 0.004
            w = np.sign(pushed) * max(abs(pushed) - dt / inner * level / 0.004, 0.0)
            theta += dt / inner * w
    t, u, w, theta = np.array(rows).T
    return {"t": t, "u": u, "w": w + 1e-3 * rng.standard_normal(len(t)), "theta": theta}


@pytest.fixture(scope="module")
def plain_drive():
    return log(dip=0.0, seconds=8.0)


@pytest.fixture(scope="module")
def compared(plain_drive):
    return lg.compare_laws(plain_drive, {}, LAWS)


def test_the_simplest_law_that_predicts_as_well_is_chosen(compared):
    assert compared.chosen == "coulomb"
    assert compared["viscous"].elpd < -100.0 and compared["viscous"].se > 1.0
    assert compared["coulomb"].elpd == 0.0
    assert compared.model.friction.block.name == "coulomb"


def test_a_dip_that_the_record_shows_is_kept():
    found = lg.compare_laws(log(dip=0.1), {}, ["coulomb", "stribeck"])
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
    with pytest.raises(lg.InputError, match="unknown friction law 'lugree'"):
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
    np.savetxt(tmp_path / "run.csv", table, delimiter=",", header="t,u,w,theta", comments="")
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

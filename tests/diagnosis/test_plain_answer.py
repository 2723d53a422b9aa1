"""The plain answer stands beside every other one, and where there is no other."""

import json

import numpy as np
import pytest

import lugrectl as lg
from lugrectl.cli import main
from lugrectl.core.errors import Refused

from ..cases.small_answers import FC
from ..cases.small_answers import log as moved

DT = 5e-3


@pytest.fixture
def one_way(tmp_path, monkeypatch):
    """A folder with a log in one direction, and a model file that knows nothing."""
    monkeypatch.chdir(tmp_path)
    log = moved(6.0, DT, mean=14.0)
    np.savetxt("run.csv", np.c_[*log.values()], "%.9g", ",", header="t,u,theta [rad]", comments="")
    (tmp_path / "my.toml").write_text('[friction]\nmodel = "coulomb"\n')
    return tmp_path


@pytest.mark.cases
@pytest.mark.parametrize("command", ["identify", "diagnose"])
def test_no_value_is_an_answer_while_the_unit_of_t_is_open(one_way, capsys, command):
    """An inertia that is a million times too large is no answer, however certain it is."""
    log = moved(8.0, DT)
    rows = np.c_[1e3 * log["t"], log["u"], log["theta"]]
    np.savetxt("ms.csv", rows, "%.9g", ",", header="t,u,theta [rad]", comments="")
    asked = [command, "ms.csv", "--model", "my.toml", "--json"]
    assert main(asked) == 3
    document = json.loads(capsys.readouterr().out)
    assert document["verdict"] == "refused" and "--units t=ms" in document["reason"]
    if command == "identify":
        assert main([*asked, "--units", "t=ms"]) == 0


@pytest.mark.parametrize("work", [lg.identify, lg.compare_laws, lg.balance])
def test_python_asks_for_the_unit_of_t(work):
    """With the values that it would have, an inertia that is far too large."""
    log = moved(8.0, DT)
    log["t"] = 1e3 * log["t"]
    words = 't has no unit.*0.2 Hz, at which no drive writes a log.*give units="t=ms"'
    with pytest.raises(lg.Refused, match=words) as no:
        work(log, {"friction": "coulomb"})
    assert work is lg.compare_laws or no.value.plain.parameters["J"].value > 100.0


def test_the_fit_stops_itself_and_what_was_compared_stands():
    log = moved(8.0, DT)
    d = lg.diagnose(log, lg.Model.of(friction="coulomb"), time_limit=1e-3)
    assert d.verdict == "adequate" and d.error is None
    said = " ".join(d.messages)
    assert "Give it more time with time_limit, " in said
    low, high = d.plain.parameters["Fc"].ci95
    assert low <= FC <= high


@pytest.mark.slow
def test_the_log_is_drawn(one_way, capsys):
    assert main(["plot", "run.csv", "--out", "log.pdf"]) == 0
    said = capsys.readouterr()
    assert "Plain torque balance" in said.out and "picture: log.pdf" in said.err
    assert (one_way / "log.pdf").stat().st_size > 5000
    assert not list(one_way.glob(".*"))


@pytest.mark.parametrize("out, word", [("log.gif", ".png"), ("none/log.png", "no folder none")])
def test_a_picture_that_cannot_be_written_is_one_sentence(one_way, capsys, out, word):
    assert main(["plot", "run.csv", "--out", out]) == 2
    said = capsys.readouterr()
    assert said.out == "" and word in said.err and len(said.err.splitlines()) == 1


def ramps(dt=4e-3, fine=20):
    """The torque rises until the axis has moved 0.05 rad, and is switched off for 1 s; each way."""
    theta = w = u = wait = 0.0
    side, from_here, rows = 1.0, 0.0, []
    for k in range(8_000):
        u = 0.0 if wait > 0 else u + side * 0.1 * dt
        if wait <= 0 and abs(theta - from_here) > 0.05:
            u, wait, side = 0.0, 1.0, -side
        elif wait > 0:
            wait -= dt
            from_here = theta
        rows.append((k * dt, u, theta))
        for _ in range(fine):
            level = 0.2 + 0.135 * np.exp(-((w / 0.05) ** 2))
            if abs(w) < 1e-3 and abs(u) < level:
                w = 0.0
                continue
            w += dt / fine * (u - level * np.tanh(w / 1e-3) - 0.02 * w) / 2.2e-3
            theta += dt / fine * w
    t, u, theta = np.array(rows).T
    count = 2 * np.pi / 65536
    return {"t": t, "u": u, "theta": np.round(theta / count) * count}


def test_identify_is_refused_where_no_value_is_certain():
    """A breakaway test tells when the axis starts, and nothing of how it moves."""
    with pytest.raises(Refused, match="no value of the model is certain") as caught:
        lg.identify(ramps(), lg.Model.of(friction="stribeck"))
    assert "J" in caught.value.plain.uncertain and "inertia" in caught.value.experiment

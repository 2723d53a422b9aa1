"""``lugrectl reproduce``: its figures against closed forms, its rankings, its page."""

from __future__ import annotations

import json

import control as ct
import numpy as np
import pytest

import lugrectl as lg
from lugrectl.cli import main
from lugrectl.paper import reproduce, runs, studies
from lugrectl.paper.runs import milli

from ..cases.html_page import Page

P = lg.table1()
SOME = ("velocity", "friction-level", "standstill")


@pytest.fixture(scope="module")
def some():
    """What most tests read."""
    return reproduce(only=SOME)


def level(some, label):
    """RMS error of the velocity loop by compensation, observer's Fc and Fs off."""
    return next(r.rms for r in some.outcome("friction-level").rows if r.case.label == label)


def width(some, loop, label, kind="-3dB"):
    return next(w for w in some.widths if (w.loop, w.label, w.level) == (loop, label, kind))


def test_the_position_pi_is_called_unstable_with_its_poles(some):
    found = width(some, "position", "paper's PI")
    assert not found.stable and found.hertz == pytest.approx(20.4, abs=0.05)
    expected = np.roots([P.J, 0.0, 15.0, 1.55])
    assert np.sort_complex(found.poles) == pytest.approx(np.sort_complex(expected))
    assert found.poles[0].real == pytest.approx(1 / 19.35, rel=1e-3)
    assert width(some, "position", "paper's PI, Fv left in").stable


@pytest.mark.parametrize("label", ["PID", "PD"])
def test_the_stable_controllers_have_the_same_crossing(some, label):
    w, g = width(some, "position", label), width(some, "position", label).gains
    T = ct.tf([g["kp"], g["ki"]], [P.J, g["kd"], g["kp"], g["ki"]])
    crossing = 2 * np.pi * width(some, "position", "paper's PI").hertz
    assert abs(T(1j * crossing)) == pytest.approx(10 ** (-3 / 20), rel=1e-9)
    assert w.stable and max(T.poles().real) <= 1e-9
    assert w.hertz * 2 * np.pi == pytest.approx(crossing)


# --- simulations -------------------------------------------------------------------------


def test_exact_compensation_is_the_frictionless_loop(some):
    free, without, proposed = some.figure("velocity").responses.values()
    assert proposed == pytest.approx(free, abs=1e-6)
    assert max(abs(without - free)) > 0.05
    loop = ct.tf([1.6, 0.16], [P.J, 1.6, 0.16])
    error = abs(loop(2j * np.pi) - 1) * 0.1 / np.sqrt(2)  # of whole periods, at rest
    assert list(some.figure("velocity").errors.values())[2] == pytest.approx(error, rel=2e-3)


@pytest.mark.parametrize("off", ["-30 %", "exact", "+40 %"])
def test_the_ranking_depends_on_the_gain(some, off):
    """Velocity loop, no feed-forward, 0.1 rad/s at 1 Hz; k = 0.35, K1 = -10.24, K2 = 22."""
    e = level(some, off)
    assert off == "exact" or e["proposed"] < e["k 0.35"] < e["natural"] < e["none"]
    assert e["k 20"] < e["k 5"] < e["proposed"]


def test_held_at_rest_only_the_proposed_observer_corrects(some):
    rows = {(r.case.label, r.measure.signal): r.rms for r in some.outcome("standstill").rows}
    moves, misses = rows["held", "w"], rows["held", "F - Fhat"]
    for name in ("natural", "k 0.35", "k 20"):
        assert moves[name] == 0.0 and misses[name] == pytest.approx(P.sigma0 * 1e-3)
    assert misses["proposed"] < 1e-6 and moves["proposed"] > 0.05


def test_the_position_pi_grows_as_its_poles_say():
    found = runs.growth(P)
    assert found.predicted == pytest.approx(1 / max(np.roots([P.J, 0, 15.0, 1.55]).real))
    assert found.simulated == pytest.approx(found.predicted, rel=1e-3)


def test_a_loop_that_runs_away_is_said_so(monkeypatch):
    def fail(*_, **__):
        raise lg.Diverged("w grows")

    monkeypatch.setattr(lg, "simulate", fail)
    initial = next(s for s in studies.VELOCITY_STUDIES if s.key == "initial")
    outcome = runs.run(P, initial, lambda what: None)
    assert milli(outcome.rows[0].rms["none"]) == "diverges" and outcome.traces == {}


# --- text, page, files -------------------------------------------------------------------


def test_the_text_says_it_plainly_and_names_gains(some):
    said = str(some)
    assert "unstable" in said.splitlines()[0]
    flat = " ".join(said.split())
    assert "+0.05167 +- 82.57j" in flat and "19.4 s" in flat
    assert max(map(len, said.splitlines())) <= 80
    assert "K1 = -10.24, K2 = 22" in flat and "k = 0.35" in flat and "k = 20" in flat


def test_files_are_written_both_or_none(some, tmp_path):
    html, document = some.save(tmp_path / "new" / "deep")
    assert json.loads(document.read_text(), parse_constant=pytest.fail) == some.summary()
    assert {p.name for p in html.parent.iterdir()} == {"reproduce.html", "reproduce.json"}
    (tmp_path / "taken").write_text("mine")
    with pytest.raises(lg.InputError, match="choose another"):
        some.save(tmp_path / "taken")
    shown = Page(html.read_text())
    assert not {"script", "link"} & {*shown.tags} and "http" not in html.read_text()
    assert shown.tags.count("figure") == len(some.figures) + len(some.outcomes)
    ids = [value for key, value in shown.attributes if key == "id"]
    assert len(ids) == len(set(ids)) and "unstable" in "".join(shown.said)


def test_unknown_studies_are_named():
    with pytest.raises(lg.InputError, match="friction-level"):
        reproduce(only=["friction"])


@pytest.mark.parametrize("out", [False, True])
def test_the_command(some, capsys, monkeypatch, tmp_path, out):
    monkeypatch.setattr("lugrectl.paper.reproduce", lambda progress: some)
    monkeypatch.setattr(runs.Page, "html", lambda page: "<html>")
    monkeypatch.chdir(tmp_path)
    assert main(["reproduce", *(["--out", "made"] if out else [])]) == 0
    shown = capsys.readouterr().out
    assert shown.startswith("The position PI of the paper is unstable")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["made"] * out
    assert main(["reproduce", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["schema"] == 1


def test_a_folder_that_cannot_be_written_is_noticed_before_the_work(capsys, monkeypatch, tmp_path):
    (tmp_path / "file").write_text("")
    monkeypatch.setattr("lugrectl.paper.reproduce", lambda progress: pytest.fail("ran"))
    assert main(["reproduce", "--out", str(tmp_path / "file")]) == 2
    assert "not a folder" in capsys.readouterr().err

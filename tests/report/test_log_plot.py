"""The drawing of a log: the same for a record, the plain answer and ``lugrectl plot``."""

import json

import matplotlib.pyplot as plt
import numpy as np
import pytest

import lugrectl as lg
from lugrectl.cli import main
from lugrectl.cli.commands import NO_SCREEN
from lugrectl.cli.output import has_screen

from ..cases.logs import csv, machine


def titles(axes):
    return [ax.get_title(loc="left") or ax.get_title() for ax in axes]


def lines(axes):
    return [(ax.get_xlabel(), ax.get_ylabel()) for ax in axes if ax.get_xlabel()]


def test_a_record_shows_itself_as_the_plain_answer_does():
    record = lg.read_record(machine())
    axes, expected = record.plot(), lg.balance(record).plot()
    assert titles(axes) == titles(expected) and lines(axes) == lines(expected)
    assert titles(axes)[:3] == ["Torque as recorded", "Speed as recorded", "Angle as recorded"]
    assert lines(axes)[:2] == [("t [s]", "u [N m]"), ("t [s]", "w [rad/s]")]


@pytest.mark.slow
def test_a_cogging_shows_over_the_angle_and_runs_are_parted():
    """0.06 N m, three times in a turn."""
    t = np.arange(0, 20, 2e-3)
    theta, w, a = (
        sum(x * f**k * np.sin(f * t + k * np.pi / 2) for x, f in ((9.0, 0.7), (1.5, 4.3)))
        for k in range(3)
    )
    u = 0.002 * a + 0.3 * np.sign(w) + 0.02 * w + 0.06 * np.sin(3 * theta)
    found = lg.balance([{"t": t, "u": u, "theta": theta}, {"t": t, "u": -u, "theta": -theta}])
    part = found.residual.along(found.stretches[0])
    assert np.corrcoef(part["left"], np.sin(3 * part["theta"]))[0, 1] > 0.8
    axes = found.plot()
    over = {ax.get_xlabel(): ax for ax in axes if ax.get_ylabel().startswith("residual")}
    assert {*over} == {"t [s]", "w [rad/s]", "theta modulo one turn [rad]"}
    assert any(line.get_linestyle() == "--" for line in over["t [s]"].get_lines())
    friction = next(ax for ax in axes if ax.get_ylabel().startswith("friction"))
    laws = [line.get_ydata() for line in friction.get_lines() if len(line.get_xdata()) == 2]
    assert sorted(np.sign(law[0]) for law in laws) == [-1.0, 1.0]


@pytest.mark.slow
def test_the_command_draws_the_same(tmp_path, monkeypatch):
    path, seen = csv(tmp_path, keep=slice(0, 900)), []
    monkeypatch.setattr(plt, "close", lambda figure: seen.append(titles(figure.axes)))
    assert main(["plot", str(path), "--out", str(tmp_path / "a.png")]) == 0
    assert titles(lg.read_record(path).plot()) == seen[0]


@pytest.fixture
def backend():
    """Matplotlib with the backend for files, and as before after the test."""
    before = plt.get_backend()
    plt.switch_backend("agg")
    yield plt.switch_backend
    plt.switch_backend(before)


@pytest.mark.usefixtures("backend")
def test_that_there_is_no_screen_is_said_before_the_work(tmp_path, monkeypatch, capsys):
    said = []

    def work(*_):
        said.append(capsys.readouterr().err)
        raise lg.InputError("enough.")

    monkeypatch.setattr("lugrectl.diagnosis.asked.plain_answer", work)
    assert main(["plot", str(csv(tmp_path))]) == 2
    assert said == [f"lugrectl: {NO_SCREEN}.\n"]


@pytest.mark.usefixtures("backend")
def test_without_a_screen_the_numbers_are_printed_and_nothing_is_drawn(
    tmp_path, monkeypatch, capsys
):
    monkeypatch.setattr(lg.results.Balance, "plot", None)
    assert main(["plot", str(csv(tmp_path)), "--json"]) == 0
    out, err = capsys.readouterr()
    assert json.loads(out)["parameters"] and err == f"lugrectl: {NO_SCREEN}.\n"


def test_a_backend_that_opens_windows_is_a_screen(backend):
    assert not has_screen()
    pytest.importorskip("tornado")
    backend("webagg")
    assert has_screen()


def test_a_linear_record_has_its_units():
    axes = lg.read_record(machine(), motion="linear").plot()
    assert lines(axes)[:3] == [("t [s]", "u [N]"), ("t [s]", "w [m/s]"), ("t [s]", "theta [m]")]


def test_a_record_that_was_cut_shows_what_is_left():
    cut = lg.read_record(machine()).slice(500, 1500)
    low, high = cut.plot()[0].get_xlim()
    assert 0.4 < low < 0.51 and 1.49 < high < 1.6

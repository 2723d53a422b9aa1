"""The drawing of a log: the same for a record, the plain answer and ``lugrectl plot``."""

import matplotlib.pyplot as plt

import lugrectl as lg
from lugrectl.cli import main

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


def test_the_command_draws_the_same(tmp_path, monkeypatch):
    path, seen = csv(tmp_path), []
    monkeypatch.setattr(plt, "close", lambda figure: seen.append(titles(figure.axes)))
    assert main(["plot", str(path), "--out", str(tmp_path / "a.png")]) == 0
    assert titles(lg.read_record(path).plot()) == seen[0]


def test_a_linear_record_has_its_units():
    axes = lg.read_record(machine(), motion="linear").plot()
    assert lines(axes)[:3] == [("t [s]", "u [N]"), ("t [s]", "w [m/s]"), ("t [s]", "theta [m]")]


def test_a_record_that_was_cut_shows_what_is_left():
    cut = lg.read_record(machine()).slice(500, 1500)
    low, high = cut.plot()[0].get_xlim()
    assert 0.4 < low < 0.51 and 1.49 < high < 1.6

"""What is asked of the user, in words that can be typed; usual and misspelt ways to say it."""

from __future__ import annotations

import numpy as np
import pytest

import lugrectl as lg
from lugrectl.cli import main
from lugrectl.record import read_log, read_record

from ..cases.logs import cell, csv, refused

T = np.arange(0, 10, 2e-3)
W = np.sin(2 * T) + 0.5 * np.sin(7 * T)
THETA = np.cumsum(W) * 2e-3
U = 0.3 * np.sign(W) + 0.02 * W + 0.002 * np.gradient(W, T)
COUNTS = np.round(1e3 * THETA)

# a header or a log, options, words of the sentence, and options that do (None: not asked here)
ASKED = [
    # a role without a column, or with several
    ("t,torque,speed_demand,position error", {}, ["no column for w"], None),
    ("t,u,angle,position", {}, ["theta could be any", 'columns="theta='], {"columns": "theta=4"}),
    ("t,torque,motor torque,pos", {"columns": "u=x"}, ["Column 'x' for u is not in"], None),
    ("t,u,u,theta", {}, ["u could be any", "'u' (column 2)", "'u' (column 3)"], {"columns": "u=2"}),
    ("a,u,w,theta", {}, ["column for t", "rate=HZ"], {"rate": 1000}),
    ("t,trque,w,theta", {"columns": {"u": "torqe"}}, ["'torqe'", "did you mean 'trque'"], None),
    ("t,u,w,theta", {"columns": "u=w,w=w"}, ["more than one role"], None),
    ("t,u,w,theta", {"scale": "d=2"}, ["names d"], None),
    ("t,u,w,theta", {"rate": 0.001}, ["rate is in Hz", "give rate=1000"], {"rate": 1000}),
    ("t,u,w,theta", {"rate": 1000, "columns": "t=t"}, ["exclude each other"], None),
    # misspelt names and roles
    ("t,u,a2,thetta", {}, ['for instance columns="theta=thetta".'],
     {"columns": "theta=thetta"}),
    ("t,torqe,w,theta", {}, ['for instance columns="u=torqe".'], None),
    ("t,u,veloctiy,a", {}, ['for instance columns="w=veloctiy".'],
     {"columns": "w=veloctiy"}),
    ("t,trq val,w,theta", {}, ['for instance columns="u=trq val".'],
     {"columns": "u=trq val"}),
    ("tme,u,w,theta", {}, ['columns="t=tme", or give rate=HZ.'], None),
    ("t,u,p,qq", {}, [': name them, for instance columns="theta=p".'], {"columns": "theta=qq"}),
    ("t,u,w,theta", {"columns": "thta=theta"}, ["no role 'thta' (did you mean 'theta'?)"], None),
    ("t,u,w,theta", {"columns": "theta=thta"}, ["(did you mean 'theta'?); its columns are"], None),
    ("t,u,w,theta", {"scale": "torque=2"}, ["no role 'torque' (torque is 'u')"], None),
    ("t,u,w,theta", {"units": "speed=rpm"}, ["no role 'speed' (speed is 'w')"], None),
    # units
    ("t,u,w,theta", {"units": "theta=degre"}, ["'degre'", "did you mean 'deg'", "rev"], None),
    ("t,u,w,theta", {"units": "theta=rpm"}, ["theta cannot be in rpm", "rad"], None),
    ("t,u,w,theta", {"units": "u=%"}, ["%", 'scale="u='], None),
    ("t,u,w,theta", {"units": "theta=mm,w=rad/s"}, ["mm", "rad/s", "linear"], None),
    ("t,u,w,theta", {"units": "theta=rad", "motion": "linear"}, ["rad", "linear"], None),
    ("t,u,w,theta", {"motion": "oblique"}, ["oblique"], None),
    ("t,u [furlong],w,theta", {}, ["run.csv", "'u'", "'furlong'", "N m", "mN m"],
     {"units": {"u": "N m"}}),
    ("t,iq,vel,q", {}, ["column 'iq': by its name u is in A", 'or units="u=N m" if it is'],
     {"units": "u=N m"}),
    ("t,motor_current_mA,w,theta", {}, ['scale="u=FACTOR"'], {"scale": {"u": 1.0}}),
    ("t,u [counts],w,theta", {}, ['scale="u=FACTOR"'], {"scale": {"u": 1.0}}),
    ({"t": T, "u": U, "w [eRPM]": 7 * 30 / np.pi * W}, {},
     ["pole pairs", 'scale="w=FACTOR"', "pi/30/7"], {"scale": "w=pi/30/7"}),
    ({"t": T, "current [A]": U, "theta [counts]": COUNTS}, {},  # all at once
     ['scale="u=FACTOR"', 'scale="theta=FACTOR"'], {"scale": "u=0.5,theta=1e-3"}),
    ({"t": T, "iq": U, "position": COUNTS}, {},  # names and numbers say so
     ["u is in A", "theta has no unit and holds whole"], {"scale": "u=0.5,theta=1e-3"}),
    # numbers
    ("t,u,w,theta", {"rate": -5.0}, ["rate"], None),
    *(("t,u,w,theta", {"scale": {"theta": text}}, ["scale", "not a number other than 0"], None)
      for text in ("big", "pie", "2pi/0", "", "1/", "0/3", "nan", "2**3", 0.0)),
]  # fmt: skip


@pytest.mark.parametrize(("given", "options", "words", "cure"), ASKED)
def test_what_is_not_clear_is_asked_for_with_what_to_type(tmp_path, given, options, words, cure):
    given = csv(tmp_path, given) if isinstance(given, str) else given
    refused(lg.InputError, given, *words, **options)
    assert cure is None or read_record(given, **cure).samples > 2900


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (cell(2, 1, "abc"), ["line 2", "'u'", "'abc'"]),
        (cell(1500, 3, "1.2.3"), ["line 1500", "'theta'"]),
        (cell(3001, 2, "12_3"), ["line 3001", "'w'"]),
        (lambda x: [*x[:700], "1,2,3,4,5", *x[700:]], ["line 701", "5 cells", "4 columns"]),
        (lambda x: x[1:], ["no column for t", 'columns="t=1,u=2,theta=3"']),
        (lambda x: x[:1], ["no"]),
        (lambda x: [line.split(",")[1] for line in x], ["one column"]),
        (lambda x: ["t,u", *x[1:]], ["4 cells", "names 2"]),
        (lambda x: ["hello", "world"], ["not a table"]),
        (lambda x: [], ["empty"]),
        (lambda x: [" ", ""], ["empty"]),
        (lambda x: ["# only a remark"], ["empty"]),
    ],
)
def test_broken_text_is_named(tmp_path, change, words):
    refused(lg.InputError, csv(tmp_path, change=change), "run.csv", *words)


@pytest.mark.parametrize(
    ("text", "value"),
    [("2pi/16384", 2 * np.pi / 16384), ("2*pi/16384", 2 * np.pi / 16384), ("-1/7", -1 / 7),
     ("1e-3", 1e-3), (0.5, 0.5)],
)  # fmt: skip
def test_a_scale_may_be_a_quotient(text, value):
    found = lg.read_record({"t": T, "u": U, "theta": THETA}, scale={"theta": text})
    assert found.theta is not None
    assert np.ptp(found.theta) == pytest.approx(abs(value) * np.ptp(THETA))


@pytest.mark.parametrize("columns", ["w=", {"w": ""}])
def test_a_role_may_have_no_column(columns):
    log = {"t": T, "u": U, "theta": THETA, "speed": W}
    assert lg.read_record(log).w is not None
    assert lg.read_record(log, columns=columns).w is None


@pytest.mark.parametrize("names", [("F", "x", "v"), ("F [N]", "x [m]", "v [m/s]")])
def test_force_and_distance_are_those_of_a_linear_axis(names):
    found = lg.read_record(dict(zip(("t", *names), (T, U, THETA, W), strict=True)))
    assert found.motion == "linear"
    for role, values in (("u", U), ("theta", THETA), ("w", W)):
        np.testing.assert_allclose(getattr(found, role), values)


def test_a_motor_speed_beside_the_angle_of_the_joint_is_called_so():
    record = lg.read_record({"t": T, "u": U, "theta": THETA, "w": 100 * W})
    said = " ".join(record.messages)
    assert "gear of 100" in repr(record)  # not the number of messages
    assert "gear of 100" in said and 'scale="w=0.01"' in said and 'scale="theta=100"' in said


def test_one_value_in_a_row_is_said(tmp_path):
    rows = [f"{t:.4f},{name},{x}" for t in T[:50] for name, x in (("torque", 0.1), ("theta", t))]
    (tmp_path / "long.csv").write_text("time,field,value\n" + "\n".join(rows))
    words = "one value in a row, and 'field' .*torque, theta.*pivot"
    with pytest.raises(lg.InputError, match=words):
        lg.read_record(tmp_path / "long.csv")


def test_a_misspelt_file_is_named(tmp_path):
    path = csv(tmp_path, name="bench-run.csv")
    with pytest.raises(lg.InputError, match=r"no such file \(did you mean .*bench-run.csv\?\)"):
        lg.read_record(path.with_name("bench-run.cvs"))
    (tmp_path / "servo.toml").write_text("[plant]\n")
    with pytest.raises(lg.InputError, match=r"no such model file \(did you mean .*servo.toml\?\)"):
        lg.diagnose(path, tmp_path / "sevro.toml")
    with pytest.raises(lg.InputError, match=r"no such file\.$"):
        lg.read_record(tmp_path / "other.dat")


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("diagnos run.csv", "there is no command 'diagnos' (did you mean diagnose?)"),
        (
            "diagnose run.csv --modle my.toml",
            "there is no option '--modle' (did you mean --model?)",
        ),
        ("diagnose run.csv", "required: --model (lugrectl model > my.toml writes one"),
    ],
)
def test_a_misspelt_command_or_option_is_named(capsys, line, said):
    assert main(line.split()) == 2
    assert said in capsys.readouterr().err


@pytest.mark.parametrize("offset", [0, 60000])
def test_a_log_says_that_its_torque_was_unsigned(offset):
    """A two's complement has values on both sides of an empty middle; others stay as they are."""
    t = np.arange(200) * 0.01
    u = (np.round(300 * np.sin(7 * t)) + offset) % 65536
    log = read_log({"t": t, "theta": np.sin(7 * t), "u": u}, scale={"u": 0.01})
    said = [m for m in log.messages if "unsigned number of 16 bit" in m and "32767" in m]
    assert len(said) == (offset == 0)
    np.testing.assert_allclose(log.channels["u"], 0.01 * (u - 65536 * (u > 32767) * (offset == 0)))

"""What is asked of the user, in words that can be typed; usual and misspelt ways to say it."""

from __future__ import annotations

import numpy as np
import pytest

import lugrectl as lg
from lugrectl.cli import main
from lugrectl.record import read_log

from ..cases.logs import csv

T = np.arange(0, 10, 2e-3)
W = np.sin(2 * T) + 0.5 * np.sin(7 * T)
THETA = np.cumsum(W) * 2e-3
U = 0.3 * np.sign(W) + 0.02 * W + 0.002 * np.gradient(W, T)


def test_all_that_must_be_asked_of_units_is_asked_at_once():
    log = {"t": T, "current [A]": U, "theta [counts]": np.round(1e3 * THETA)}
    with pytest.raises(lg.InputError) as asked:
        lg.read_record(log)
    assert 'scale="u=FACTOR"' in str(asked.value) and 'scale="theta=FACTOR"' in str(asked.value)
    log = {"t": T, "iq": U, "position": np.round(1e3 * THETA)}  # names and numbers say so
    with pytest.raises(lg.InputError, match=r"u is in A.* theta has no unit and holds whole"):
        lg.read_record(log)


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("2pi/16384", 2 * np.pi / 16384),
        ("2*pi/16384", 2 * np.pi / 16384),
        ("-1/7", -1 / 7),
        ("1e-3", 1e-3),
        (0.5, 0.5),
    ],
)
def test_a_scale_may_be_a_quotient(text, value):
    found = lg.read_record({"t": T, "u": U, "theta": THETA}, scale={"theta": text})
    assert found.theta is not None
    assert np.ptp(found.theta) == pytest.approx(abs(value) * np.ptp(THETA))


@pytest.mark.parametrize("text", ["pie", "2pi/0", "", "1/", "0/3", "nan", "2**3"])
def test_other_scales_are_refused(text):
    with pytest.raises(lg.InputError, match="scale"):
        lg.read_record({"t": T, "u": U, "theta": THETA}, scale={"theta": text})


@pytest.mark.parametrize("columns", ["w=", {"w": ""}])
def test_a_role_may_have_no_column(columns):
    log = {"t": T, "u": U, "theta": THETA, "speed": W}
    assert lg.read_record(log).w is not None
    assert lg.read_record(log, columns=columns).w is None


def test_electrical_revolutions_ask_for_the_pole_pairs():
    log = {"t": T, "u": U, "w [eRPM]": 7 * 30 / np.pi * W}
    with pytest.raises(lg.InputError, match='pole pairs.*units="w=rpm".*scale="w=1/PAIRS"'):
        lg.read_record(log)
    found = lg.read_record(log, units="w=rpm", scale="w=1/7")
    np.testing.assert_allclose(found.channels()["w"], W, rtol=1e-9)


@pytest.mark.parametrize("names", [("F", "x", "v"), ("F [N]", "x [m]", "v [m/s]")])
def test_force_and_distance_are_those_of_a_linear_axis(names):
    found = lg.read_record(dict(zip(("t", *names), (T, U, THETA, W), strict=True)))
    assert found.motion == "linear"
    for role, values in (("u", U), ("theta", THETA), ("w", W)):
        np.testing.assert_allclose(getattr(found, role), values)


def test_a_motor_speed_beside_the_angle_of_the_joint_is_called_so():
    said = " ".join(lg.read_record({"t": T, "u": U, "theta": THETA, "w": 100 * W}).messages)
    record = lg.read_record({"t": T, "u": U, "theta": THETA, "w": 100 * W})
    assert "gear of 100" in repr(record)  # not the number of messages
    assert "gear of 100" in said and 'scale="w=0.01"' in said and 'scale="theta=100"' in said


def test_one_value_in_a_row_is_said(tmp_path):
    rows = [f"{t:.4f},{name},{x}" for t in T[:50] for name, x in (("torque", 0.1), ("theta", t))]
    (tmp_path / "long.csv").write_text("time,field,value\n" + "\n".join(rows))
    with pytest.raises(
        lg.InputError, match="one value in a row, and 'field' .*torque, theta.*pivot"
    ):
        lg.read_record(tmp_path / "long.csv")


# ---- misspelt names -----------------------------------------------------------------


@pytest.mark.parametrize(
    ("head", "end"),
    [
        ("t,u,a2,thetta", "If 'thetta' is theta, rename it, or give columns=\"theta=thetta\"."),
        ("t,torqe,w,theta", "If 'torqe' is u, rename it, or give columns=\"u=torqe\"."),
        ("t,u,veloctiy,a", "If 'veloctiy' is w, rename it, or give columns=\"w=veloctiy\"."),
        ("t,trq val,w,theta", "If 'trq val' is u, rename it, or give columns=\"u=trq val\"."),
        ("tme,u,w,theta", "If 'tme' is t, rename it, or give columns=\"t=tme\", or give rate=HZ."),
        ("t,u,p,qq", ': name the column with columns="theta=NAME".'),
    ],
)
def test_a_misspelt_column_is_named_with_the_option_to_type(tmp_path, head, end):
    with pytest.raises(lg.InputError) as no:
        lg.read_record(csv(tmp_path, head))
    assert str(no.value).endswith(end) and "did you mean" not in str(no.value)


def test_a_column_that_has_a_role_is_not_offered_for_another(tmp_path):
    with pytest.raises(lg.InputError) as no:
        lg.read_record(csv(tmp_path, "t,u,thet a,tau"), columns="u=u,t=tau")
    assert "'tau' is" not in str(no.value)


@pytest.mark.parametrize(
    ("option", "given", "hint"),
    [
        ("columns", "thta=theta", "no role 'thta' (did you mean 'theta'?)"),
        ("columns", "theta=thta", "(did you mean 'theta'?); its columns are"),
        ("scale", "torque=2", "no role 'torque' (torque is 'u')"),
        ("units", "speed=rpm", "no role 'speed' (speed is 'w')"),
    ],
)
def test_a_misspelt_role_is_named(tmp_path, option, given, hint):
    with pytest.raises(lg.InputError) as no:
        lg.read_record(csv(tmp_path), **{option: given})
    assert hint in str(no.value)


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
        ("diagnose run.csv --modle my.toml", "there is no option --modle (did you mean --model?)"),
        ("diagnose run.csv", "required: --model (lugrectl model > my.toml writes one"),
    ],
)
def test_a_misspelt_command_or_option_is_named(capsys, line, said):
    assert main(line.split()) == 2
    assert said in capsys.readouterr().err


def test_a_current_with_a_german_name_is_known(tmp_path):
    path = tmp_path / "run.csv"
    read = csv(tmp_path, "Zeit [s],Strom [A],Geschwindigkeit,Winkel", name="run.csv")
    assert read == path and lg.read_record(path, scale="u=0.35").w is not None


# ---- registers without a sign -------------------------------------------------------


@pytest.mark.parametrize("offset", [0, 60000])
def test_a_log_says_that_its_torque_was_unsigned(offset):
    """A two's complement has values on both sides of an empty middle; others stay as they are."""
    t = np.arange(200) * 0.01
    u = (np.round(300 * np.sin(7 * t)) + offset) % 65536
    log = read_log({"t": t, "theta": np.sin(7 * t), "u": u}, scale={"u": 0.01})
    said = [m for m in log.messages if "unsigned number of 16 bit" in m and "32767" in m]
    assert len(said) == (offset == 0)
    np.testing.assert_allclose(log.channels["u"], 0.01 * (u - 65536 * (u > 32767) * (offset == 0)))

"""What is asked of the user: all at once, in words that can be typed; and usual ways to say it."""

import numpy as np
import pytest

import lugrectl as lg

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

"""The units of w, theta and t against each other, before anything is computed from a log."""

import numpy as np
import pytest

from lugrectl.core.errors import InputError
from lugrectl.record import read_log, read_record, stretches

from ..cases.logs import machine

DEG = np.pi / 180


def log(head="t,u,w,theta", **factors):
    """The machine's log under other names, each channel times its factor."""
    columns = machine()
    return {
        name: columns[name.split(" ")[0]] * factors.get(name[0], 1.0) for name in head.split(",")
    }


@pytest.mark.parametrize("head", ["t,u,w,theta", "t,u,w [rad/s],theta"])
def test_a_mistaken_unit_is_converted_in_the_log_itself(head):
    """The plain balance, the plot and the fit read the rows of the log."""
    made = read_log(log(head) | {"theta": machine()["theta"] / DEG})
    np.testing.assert_allclose(made.channels["theta"], machine()["theta"], atol=1e-12)
    assert made.labels["theta"] == "deg"
    (piece,), _ = stretches([made])
    np.testing.assert_allclose(piece.theta, machine()["theta"], atol=1e-12)
    assert sum("theta is taken in rad but in fact in deg" in m for m in made.messages) == 1
    assert read_record(made).messages == made.messages


@pytest.mark.parametrize("unit, factor", [("ms", 1e3), ("us", 1e6)])
def test_a_time_without_unit_is_asked_for_where_w_and_theta_show_it(unit, factor):
    with pytest.raises(InputError, match=rf't has no unit .* give units="t={unit}", or'):
        read_log(log() | {"t": machine()["t"] * factor})
    stated = read_log(log("u,w,theta") | {f"t [{unit}]": machine()["t"] * factor})
    np.testing.assert_allclose(stated.t, machine()["t"], atol=1e-12)
    assert stated.messages == ()


def test_stated_units_of_w_and_theta_leave_the_time_alone_to_be_wrong():
    """0.1 ms read as s is a rate of 10 Hz, which a log may have."""
    head = "t,u,w [rad/s],theta [rad]"
    with pytest.raises(InputError, match='give units="t=ms"'):
        read_log(log(head) | {"t": 0.1 * np.arange(3000.0), "w [rad/s]": 10 * machine()["w"]})


def test_a_speed_in_thousandths_is_no_wrong_time():
    """At a rate that logs have, w in mm/s beside theta in m is more likely."""
    made = read_log(log(w=1e3), motion="linear")
    assert made.labels["w"] == "mm/s" and made.labels["t"] is None

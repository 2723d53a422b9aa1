"""Controllers, feed-forward and prefilter against their transfer functions."""

import control as ct
import pytest
from hypothesis import given
from hypothesis import strategies as st

import lugrectl as lg
from lugrectl.blocks.controllers import compensation, error, feedforward, pi, pid, prefilter

from ..cases.transfer import s, same

P = lg.table1()
gains = st.floats(0.0, 100.0)
signals = st.floats(-10.0, 10.0)


def test_pi_is_minus_its_transfer_function():
    same(pi(1.6, 0.16), -(1.6 + 0.16 / s))


@pytest.mark.parametrize("tau", [None, 0, 0.0])
def test_pid_without_tau_integrates(tau):
    same(pid(15.0, 1.55, 0.3, tau), -(15.0 + 1.55 / s), input=0)


@pytest.mark.parametrize("tau", [1e-3, 0.2, 30.0])
def test_pid_with_tau_filters_the_integral(tau):
    same(pid(15.0, 1.55, 0.3, tau), -(15.0 + 1.55 / (tau * s + 1)), input=0)


@pytest.mark.parametrize("tau", [None, 0.2])
def test_derivative_action_is_on_the_velocity(tau):
    same(pid(15.0, 1.55, 0.3, tau), ct.tf(-0.3, 1), input=1)


@given(gains, gains)
def test_pi_is_pid_without_the_rest(kp, ki):
    x, e = [0.7], -0.4
    assert pi(kp, ki).output(0, x, [e]) == pid(kp, ki).output(0, x, [e, 2.0])
    assert pi(kp, ki).dynamics(0, x, [e]) == pid(kp, ki).dynamics(0, x, [e, 2.0])


@given(st.floats(1e-3, 10.0), gains, st.floats(0.0, 5.0))
def test_positive_error_gives_negative_torque_that_grows(e, kp, ki):
    block = pid(kp + 0.1, ki + 0.1)
    assert block.output(0, [0.0], [e, 0.0]) < 0
    assert block.dynamics(0, [0.0], [e, 0.0]) < 0  # and u = ... + ki q
    assert block.output(0, [-1.0], [0.0, 0.0]) < 0


@given(signals, signals)
def test_error_is_measured_minus_reference(r, y):
    for kind, name in (("velocity", "w"), ("position", "theta")):
        block = error(kind)
        assert block.input_labels == ["r", name] and block.output_labels == ["e"]
        assert block.output(0, [], [r, y]) == y - r


def test_compensation_passes_the_estimate():
    same(compensation(), ct.tf(1, 1))
    assert compensation().output_labels == ["u"]


@pytest.mark.parametrize(("kind", "name"), [("velocity", "dr"), ("position", "ddr")])
def test_feedforward_is_inertia_times_acceleration(kind, name):
    for of in (P, lg.Model.of(P)):
        block = feedforward(of, kind)
        assert block.input_labels == [name]
        same(block, ct.tf(P.J, 1))


@pytest.mark.parametrize("pole", [2.0, 0.3, 50.0])
def test_prefilter_is_its_transfer_function(pole):
    same(prefilter(pole), pole / (s + pole))
    assert prefilter().params == {"prefilter.pole": 2.0}
    assert (prefilter().input_labels, prefilter().output_labels) == (["r_cmd"], ["r"])


def test_prefilter_puts_out_the_derivative_of_its_reference():
    block = prefilter(3.0, "velocity")
    assert block.output_labels == ["r", "dr"]
    same(block, 3 / (s + 3), output=0)
    same(block, 3 * s / (s + 3), output=1)


def test_prefilter_passes_the_second_derivative():
    block = prefilter(3.0, "position")
    assert (block.input_labels, block.output_labels) == (["r_cmd", "ddr_cmd"], ["r", "ddr"])
    same(block, 3 / (s + 3), output=0, input=0)
    same(block, 3 / (s + 3), output=1, input=1)
    same(block, ct.tf(0, 1), output=1, input=0)


@given(signals, signals, signals)
def test_prefilters_share_one_filter(r_cmd, r, ddr):
    (plain,) = prefilter().dynamics(0, [r], [r_cmd])
    assert prefilter(kind="velocity").dynamics(0, [r], [r_cmd]) == plain
    assert prefilter(kind="velocity").output(0, [r], [r_cmd])[1] == plain
    assert prefilter(kind="position").dynamics(0, [r, ddr], [r_cmd, 0.0])[0] == plain


def test_names_and_signals_can_be_changed():
    block = pid(1.0, 0.0, name="outer", inputs=["e_theta", "w"], outputs="w_ref")
    assert (block.name, block.input_labels) == ("outer", ["e_theta", "w"])
    assert block.output_labels == ["w_ref"]
    assert set(block.params) == {"outer.kp", "outer.ki", "outer.kd", "outer.tau"}


@pytest.mark.parametrize(
    "call",
    [
        lambda: error("torque"),
        lambda: feedforward(P, "torque"),
        lambda: feedforward(lg.Model.of(P).with_values({"J": None})),
        lambda: prefilter(kind="torque"),
        lambda: prefilter(0.0),
        lambda: pid(tau=-1.0),
        lambda: pi(kp="much"),
        lambda: pid(inputs=["e"]),
    ],
)
def test_wrong_usage_is_one_sentence(call):
    with pytest.raises(lg.InputError) as raised:
        call()
    assert "\n" not in str(raised.value) and str(raised.value).endswith(".")

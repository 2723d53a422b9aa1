"""A drive whose torque acts late: predictors with friction against the delay and wrong levels."""

import control as ct
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import lugrectl as lg

from ..cases.observed import STEP, P, believing, longer, rms, signals_by

few = st.floats(-2.0, 2.0)


def late(samples, source, target):
    """A dead time of whole samples."""
    return ct.nlsys(
        lambda t, x, u, p: np.append(np.asarray(x, dtype=float)[1:], u[0]),
        lambda t, x, u, p: np.array([u[0], x[0]]),
        inputs=[source],
        outputs=[f"{source}_now", target],
        states=samples,
        dt=STEP,
        name=f"{source}_line",
    )


def error_behind(blocks, samples, drive=P):
    """RMS of w(t) - r(t - h) in rad/s over 3 to 6 s, r = sin 2 pi t rad/s, torque h late."""
    t = np.arange(0.0, 6.0 + STEP / 2, STEP)
    moved = lg.plant(drive, inputs=["u_late", "d"])
    read = {signal for block in blocks for signal in block.input_labels}
    lines = [late(samples, k, f"{k}_late") for k in ("u", "wp") if f"{k}_late" in read or k == "u"]
    given = {"r": np.sin(2 * np.pi * t), "dr": 2 * np.pi * np.cos(2 * np.pi * t)}
    given = {k: v for k, v in given.items() if k in read}
    done = lg.simulate([moved, *blocks, *lines], t, given)
    wanted = np.sin(2 * np.pi * (t - samples * STEP))
    return rms((signals_by(done, "w") - wanted)[t >= 3.0])


def with_a_model(believed):
    """The predictor is a second plant."""
    predictor = lg.plant(
        believed, name="predictor", inputs=["u_now", "none"], outputs=["theta_p", "wp", "Fp"]
    )
    control = [lg.error(inputs=["r", "ws"]), lg.pi(1.6, 0.0), lg.compensation(inputs=["Fp"])]
    return [predictor, lg.smith_velocity(), *control]


def without_a_model(kp=1.6, k=0.02):
    """Coulomb friction is found from the torque that acts."""
    found = lg.friedland_park_observer(P, k, 1.0, inputs=["w", "u_late"], outputs=["Fh", "ahat"])
    predictor = lg.coulomb_predictor(P, inputs=["u_now", "ahat"])
    control = [lg.error(inputs=["r", "ws"]), lg.pi(kp, 0.0), lg.coulomb_compensation(P)]
    return [found, predictor, lg.smith_velocity(), *control]


@given(few, few, few, st.floats(0.0, 1.0), st.floats(0.0, 1.0))
def test_the_open_predictor_converges_for_every_delay(w, wp, u, a, ahat):
    """J e de/dt <= -Fv e^2 + |a - ahat| |e|, e = w(t + h) - wp(t), on Coulomb friction."""
    (dwp,) = lg.coulomb_predictor(P).dynamics(0.0, [wp], [u, ahat])
    dw = (u - a * np.tanh(w / 1e-4) - P.Fv * w) / P.J
    e = w - wp
    assert P.J * e * (dw - dwp) <= -P.Fv * e**2 + abs(a - ahat) * abs(e) + 1e-9


@given(few, few, few, st.floats(0.0, 1.0))
def test_the_parts_of_a_smith_loop(w, wp, before, ahat):
    assert lg.smith_velocity().output(0.0, [], [w, wp, before]) == wp + (w - before)
    made = lg.coulomb_compensation(P)
    assert made.output(0.0, [], [w, ahat]) == ahat * np.tanh(w / 1e-4) + P.Fv * w


@longer
@pytest.mark.parametrize(
    ("samples", "factor", "error"),
    [
        (5, 1.0, 0.0068),
        (10, 1.0, 0.0068),
        (5, 0.8, 0.129),
        (10, 0.8, 0.200),
        (5, 1.2, 0.239),
        (10, 1.2, 0.386),
    ],
)
def test_a_plant_as_predictor_knows_friction_ahead_of_time(samples, factor, error):
    """0.707 without compensation, 0.19 and 0.27 with an observer that ignores 5 and 10 ms."""
    digit = 1e-4 if error < 0.01 else 1e-3
    assert error_behind(with_a_model(believing(factor)), samples) == pytest.approx(error, abs=digit)


@longer
@pytest.mark.parametrize(
    ("samples", "kp", "error"),
    [(5, 1.6, 0.0405), (10, 1.6, 0.0676), (5, 0.3, 0.058), (10, 0.3, 0.088)],
)
def test_coulomb_friction_is_found_behind_a_delay(samples, kp, error):
    """Within 10 %: the figures are those of another discretisation."""
    assert error_behind(without_a_model(kp), samples) == pytest.approx(error, rel=0.1)


def two_state(factor=1.0):
    """Table 1 with a friction level that follows the speed late and an elastic zone."""
    levels = {"Fc": factor * P.Fc, "Fs": factor * P.Fs}
    same = {k: getattr(P, k) for k in ("J", "sigma0", "sigma1", "Fv", "vs")}
    return lg.Model.of(friction="two_state", **same, **levels)


def test_a_two_state_drive_is_its_own_predictor_without_a_delay():
    """Friction of two states inside the predictor and inside the drive is the same."""
    blocks = [lg.plant(two_state(), inputs=["u", "d"]), lg.smith_velocity()]
    blocks += [lg.plant(two_state(), name="twin", inputs=["u", "d"], outputs=["th", "wp", "Fp"])]
    t = np.arange(0.0, 0.1, STEP)
    given = {"u": 0.5 * np.sin(30 * t), "d": 0.0 * t, "wp_late": 0.0 * t}
    done = lg.simulate(blocks, t, given)
    w = signals_by(done, "w")
    assert np.ptp(w) > 0.1
    assert signals_by(done, "ws") == pytest.approx(2 * w, abs=1e-9)
    assert signals_by(done, "Fp") == pytest.approx(signals_by(done, "F"), abs=1e-9)


@longer
@pytest.mark.parametrize(("factor", "error"), [(1.0, 0.0069), (0.8, 0.201)])
def test_a_plant_as_predictor_knows_the_friction_of_two_states(factor, error):
    digit = 1e-4 if error < 0.01 else 1e-3
    blocks = with_a_model(two_state(factor))
    assert error_behind(blocks, 10, two_state()) == pytest.approx(error, abs=digit)


@longer
@pytest.mark.parametrize(("samples", "error"), [(5, 0.049), (10, 0.073)])
def test_coulomb_friction_is_found_where_the_level_lags(samples, error):
    assert error_behind(without_a_model(), samples, two_state()) == pytest.approx(error, rel=0.1)


@longer
def test_friction_along_the_reference_needs_no_predictor():
    """u = kp (r - w) + J dr + F, the law of two states along r."""
    known = {k: v for k, v in two_state().friction.values.items()}
    law = lg.friction("two_state", inputs=["r"], outputs=["Fhat"], **known)
    blocks = [lg.error(), lg.pi(0.1, 0.0), lg.feedforward(P), law, lg.compensation()]
    assert error_behind(blocks, 10, two_state()) == pytest.approx(0.0339, abs=1e-3)

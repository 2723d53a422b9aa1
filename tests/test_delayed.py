"""A drive whose torque acts late: predictors with friction against the delay and wrong levels."""

import control as ct
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import lugrectl as lg

from .observed import STEP, P, believing, longer, rms, signals_by

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


def error_behind(blocks, samples):
    """RMS of w(t) - r(t - h) in rad/s over 3 to 6 s, r = sin 2 pi t rad/s, torque h late."""
    t = np.arange(0.0, 6.0 + STEP / 2, STEP)
    drive = lg.plant(P, inputs=["u_late", "d"])
    lines = [late(samples, "u", "u_late"), late(samples, "wp", "wp_late")]
    done = lg.simulate([drive, *blocks, *lines], t, {"r": np.sin(2 * np.pi * t)})
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

"""Effects and laws of one's own are searched for and fitted like those of the package."""

import math

import numpy as np
import pytest

import lugrectl as lg

from ..cases.balance_drive import FC, FV, J, recorded, torque

MODEL = lg.Model.of(J=1.03 * J, friction="coulomb", Fc=0.9 * FC, Fv=1.1 * FV)
GAIN = lg.P(0.0, "N m", 0.0, neutral=0.0)
PI = math.pi


def notches(theta, w):
    """Detents that no sine is."""
    return 0.03 * math.tanh(4 * math.sin(5 * theta + 0.8))


def detent_of(**more):
    phase = lg.P(0.0, "rad", -PI, PI, **more)

    def detent(theta, amplitude=GAIN, phase=phase):
        """r_e = A tanh(4 sin(5 theta + phi))."""
        return amplitude * np.tanh(4 * np.sin(5 * theta + phase))

    lg.block("effect", out="d", acts="torque", confused="torque_ripple")(detent)


@pytest.mark.slow
@pytest.mark.cases
@pytest.mark.parametrize(
    "more", [{"span": (0.0, PI / 2), "angle": True}, {}], ids=["span", "plain"]
)
def test_an_own_effect_is_found_whether_or_not_its_span_is_true(more):
    detent_of(**more)
    seen = [recorded(8.0, load=notches)]
    found = lg.diagnose(seen, MODEL)
    assert (found.verdict, [e.name for e in found.effects]) == ("found", ["detent"])
    values = {k: e.value for k, e in found.effects[0].parameters.items()}
    assert values["amplitude"] == pytest.approx(0.03, rel=0.1)
    assert values["phase"] == pytest.approx(0.8, abs=0.1)


@pytest.mark.slow
def test_effects_that_the_comparison_cannot_search_do_no_harm():
    @lg.block("effect", out="u", acts="input", states="x")
    def own_lag(u, x, T=lg.P(0.0, "s", 0.0, neutral=0.0)):
        return x, (u - x) / (T + 1e-6)

    @lg.block("effect", out="d", acts="torque", states="x")
    def memory(w, x, c=GAIN, rate=lg.P(3.0, "1/s", 0.1)):
        return c * x, rate * (w - x)

    @lg.block("effect", out="d", acts="torque")
    def own_stop(theta, k=GAIN, stop=lg.P(0.0, "rad", passed=True)):
        return k * np.maximum(theta - stop, 0.0)

    @lg.block("effect", out="d", acts="torque")
    def beat(theta, w, c=GAIN, frequency=lg.P(1.0, "Hz", 0.01, 10.0)):
        return c * np.sin(frequency * theta) * np.sign(w)

    model = lg.Model.of(MODEL, effects={"name": "own_lag", "T": 0.0})
    assert lg.diagnose([recorded(5.0)], model).verdict in ("adequate", "refused")


@pytest.mark.slow
def test_a_law_with_a_parameter_that_the_file_leaves_out_is_fitted():
    @lg.block("friction", out="F")
    def free_stribeck(
        w,
        Fc=lg.P(0.2, "N m", 0.0),
        Fs=lg.P(0.3, "N m", 0.0),
        Fv=lg.P(0.01, "N m s/rad", 0.0),
        vs=lg.P(0.05, "rad/s", 1e-12),
        delta=lg.P(2.0, "1", 0.1, 4.0),
        eps=lg.P(1e-3, "rad/s", 1e-12, fitted=False),
    ):
        """F = (Fc + (Fs - Fc) exp(-|w/vs|^delta)) sign(w) + Fv w."""
        return (Fc + (Fs - Fc) * np.exp(-(np.abs(w / vs) ** delta))) * np.tanh(w / eps) + Fv * w

    true = dict(Fc=0.15, Fs=0.3, Fv=0.01, vs=1.0, delta=1.0)
    t = np.arange(0.0, 8.0, 4e-3)
    u = torque(8.0, 4e-3, size=0.9)[: len(t)]
    drive = lg.plant(lg.Model.of(J=0.004, friction="free_stribeck", **true))
    theta = lg.simulate(drive, t, {"u": u}, hold=True).outputs["theta"]
    theta = theta + np.random.default_rng(1).normal(0, 1e-4, len(t))
    found = lg.identify({"t": t, "u": u, "theta": theta}, lg.Model.of(friction="free_stribeck"))
    delta = next(row for row in found.parameters if row.name == "delta")
    assert delta.low < 1.0 < delta.high and delta.value == pytest.approx(1.0, rel=0.2)


def test_a_state_of_an_own_law_is_no_bristle_for_its_name():
    @lg.block("friction", out="F", states="z")
    def late_coulomb(
        w,
        z,
        Fc=lg.P(0.3, "N m", 0.0),
        Fv=lg.P(0.02, "N m s/rad", 0.0),
        tau=lg.P(0.02, "s", 1e-3),
    ):
        """F = z + Fv w, dz/dt = (Fc tanh(w/0.02) - z)/tau."""
        return z + Fv * w, (Fc * np.tanh(w / 0.02) - z) / tau

    true = dict(J=0.004, Fc=0.2, Fv=0.01, tau=0.03)
    t = np.arange(0.0, 5.0, 4e-3)
    u = torque(5.0, 4e-3, size=0.9)
    drive = lg.plant(lg.Model.of(friction="late_coulomb", **true))
    theta = lg.simulate(drive, t, {"u": u}, hold=True).outputs["theta"]
    theta = theta + np.random.default_rng(1).normal(0, 1e-4, len(t))
    found = lg.identify({"t": t, "u": u, "theta": theta}, lg.Model.of(friction="late_coulomb"))
    assert found.model.values() == pytest.approx(true, rel=0.05)


@pytest.mark.slow
def test_an_own_effect_that_cannot_be_compared_is_said():
    def brake(w, torque=GAIN):
        """d = torque above 5 rad/s, written with a branch."""
        return torque if w > 5.0 else 0.0

    lg.block("effect", out="d", acts="torque")(brake)
    found = lg.diagnose(recorded(8.0), MODEL)
    (said,) = (m for m in found.messages if "brake" in m)
    assert "brake cannot be evaluated" in said and "it was not compared" in said
    assert said.endswith("np.where in place of if.")

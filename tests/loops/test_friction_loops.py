"""Ready-made loops against closed forms, the paper's figures and each other."""

import itertools

import control as ct
import numpy as np
import pytest

import lugrectl as lg
from lugrectl import position_loop, velocity_loop
from lugrectl.blocks.block import REGISTRY
from lugrectl.blocks.declaration import block
from lugrectl.blocks.model import model_from_dict

from ..cases.drives import states
from ..cases.observed import P, rms, signals_by
from ..cases.wired import LOW, OMEGA, OUTPUTS, H, T, at, outputs, s, simulate, transfer


def test_without_observer_the_estimate_is_zero_and_friction_acts():
    t = np.arange(0, 0.1001, 1e-3)
    resp = simulate(velocity_loop(P), t, np.full_like(t, 0.05))
    assert not signals_by(resp, "Fhat").any()
    assert signals_by(resp, "F")[-1] == pytest.approx(0.08, abs=0.02)  # kp r held by the bristles
    assert abs(signals_by(resp, "w")[-1]) < 0.01


@pytest.mark.parametrize("observer", ["natural", "existing", "proposed"])
@pytest.mark.parametrize("make", [velocity_loop, position_loop])
def test_loops_with_exact_compensation_are_linear_at_rest(make, observer):
    """The existing observer too, when k = 0."""
    closed = T if make is velocity_loop else (15 + 1.55 / s) / (P.J * s**2 + 15 + 1.55 / s)
    found = transfer(make(P, observer, k=0.0), "w" if make is velocity_loop else "theta")
    assert found == pytest.approx(at(closed), rel=1e-4)


@pytest.mark.parametrize(("smooth", "reference"), [(False, ct.tf(1, 1)), (True, H)])
def test_feedforward_makes_the_loops_follow_their_reference(smooth, reference):
    loop = velocity_loop(P, "proposed", prefilter=smooth, feedforward=True)
    found = transfer(loop, "w")
    if not smooth:
        found = found + 1j * OMEGA * transfer(loop, "w", "dr")
    assert found == pytest.approx(at(reference), rel=1e-4)
    loop = position_loop(P, "proposed", prefilter=smooth, feedforward=True)
    found = transfer(loop, "theta") + (1j * OMEGA) ** 2 * transfer(loop, "theta", "ddr")
    assert found == pytest.approx(at(reference), rel=1e-4)


@pytest.mark.parametrize("observer", [None, "natural", "existing", "proposed"])
@pytest.mark.parametrize(("make", "rate"), [(velocity_loop, "dr"), (position_loop, "ddr")])
def test_signals_of_every_ready_loop(make, rate, observer):
    """None hangs in the air: only the observer's states may stay unread, and nothing but d without
    a source."""
    for smooth, ahead, load in itertools.product((False, True), repeat=3):
        loop = make(P, observer, prefilter=smooth, feedforward=ahead, load=load)
        derived = smooth and make is velocity_loop
        assert loop.input_labels == ["r"] + [rate] * (ahead and not derived) + ["d"] * load
        assert loop.output_labels == OUTPUTS and loop.name == make.__name__
        assert loop.state_labels[:3] == ["plant_theta", "plant_w", "plant_z"]
        inputs, unread = loop.check_unused_signals(print_warning=False)
        names = {loop.syslist[i].output_labels[j] for i, j in unread}
        assert names <= {"zhat", "what"}
        assert {loop.syslist[i].input_labels[j] for i, j in inputs} == (set() if load else {"d"})


# Parameters stay where they belong.


def levels(z, w):
    """F of the LuGre law for any Fc, Fs, Fv."""

    def F(Fc, Fs=P.Fs, Fv=P.Fv):
        h = Fc + (Fs - Fc) * np.exp(-((w / P.vs) ** 2))
        return P.sigma0 * z + P.sigma1 * (w - P.sigma0 * abs(w) / h * z) + Fv * w

    return F


def test_plant_and_observer_keep_their_own_values():
    z, w = 1e-3, 0.3
    F = levels(z, w)
    loop = velocity_loop(P, "natural", observer_parameters=LOW)
    x = states(loop, plant_w=w, plant_z=z, natural_observer_zhat=z)
    out = outputs(loop, x, 0.0)
    assert out["F"] == pytest.approx(F(P.Fc)) and out["Fhat"] == pytest.approx(F(LOW.Fc, LOW.Fs))
    out = outputs(loop, x, 0.0, {"plant.Fc": 0.5})
    assert out["F"] == pytest.approx(F(0.5)) and out["Fhat"] == pytest.approx(F(LOW.Fc, LOW.Fs))
    out = outputs(loop, x, 0.0, {"natural_observer.Fc": 0.5})
    assert out["F"] == pytest.approx(F(P.Fc)) and out["Fhat"] == pytest.approx(F(0.5, LOW.Fs))
    again = outputs(loop, x, 0.0)
    assert again["F"] == pytest.approx(F(P.Fc))


def test_two_ready_loops_in_one_system_do_not_share_values():
    axes = [velocity_loop(q, "natural", name=n) for q, n in ((P, "one"), (LOW, "two"))]
    both = ct.interconnect(
        axes,
        connections=False,
        inplist=["one.r", "two.r"],
        outlist=["one.F", "two.F"],
        inputs=["r1", "r2"],
        outputs=["F1", "F2"],
    )
    x = np.tile([0.0, 0.3, 1e-3, 1e-3, 0.0], 2)
    out = outputs(both, x, [0.0, 0.0])
    assert out["F1"] == pytest.approx(levels(1e-3, 0.3)(P.Fc))
    assert out["F2"] == pytest.approx(levels(1e-3, 0.3)(LOW.Fc, LOW.Fs))


def test_gains_can_be_changed_at_simulation_time():
    loop = velocity_loop(P, "proposed")
    x = np.zeros(loop.nstates)
    assert outputs(loop, x, 1.0)["u"] == pytest.approx(1.6)
    assert outputs(loop, x, 1.0, {"pi.kp": 5.0})["u"] == pytest.approx(5.0)
    loop = position_loop(P, "existing", k=2.0, observer_parameters=LOW)
    names = [sub.name for sub in loop.syslist]
    assert names == ["plant", "existing_observer", "pid", "error", "compensation"]
    assert loop.syslist[1].params["existing_observer.k"] == 2.0


# Models and other observers.


def test_a_whole_model_stands_in_for_the_plant():
    model = lg.Model.of(P).with_effect("gravity", {"amplitude": 0.2, "phase": 0.4})
    loop = position_loop(model, "natural")
    x = states(loop, plant_theta=0.3)
    pull = 0.2 * np.sin(0.7)
    assert loop.dynamics(0, x, [0.3])[1] == pytest.approx(-pull / P.J)
    assert loop.dynamics(0, x, [0.3], params={"plant.gravity.amplitude": 0.0})[1] == 0.0


def test_a_model_without_lugre_friction_needs_observer_parameters():
    text = {"plant": {"J": P.J}, "friction": {"model": "coulomb", "Fc": 0.285, "Fv": 0.018}}
    model = model_from_dict(text, "here")
    assert velocity_loop(model).output_labels == OUTPUTS
    with pytest.raises(lg.InputError, match="natural_observer needs sigma0"):
        velocity_loop(model, "natural")
    loop = velocity_loop(model, "natural", observer_parameters=P)
    assert transfer(loop, "Fhat").shape == OMEGA.shape


@pytest.fixture
def registered():
    """Observers that a user registers."""

    @block("observer", out="Fhat")
    def coulomb_guess(w, Fc=REGISTRY["friction", "lugre"].parameters["Fc"]):
        """Fhat = Fc tanh(w)."""
        return Fc * np.tanh(w)

    @block("observer", out="Fhat")
    def needs_current(current):
        """Fhat = i."""
        return current

    @block("observer", out="zhat", states="zhat")
    def no_torque(w, zhat):
        """dzhat/dt = w."""
        return w


def test_any_registered_observer_can_be_named(registered):
    loop = velocity_loop(P, "coulomb_guess", observer_parameters=LOW)
    out = outputs(loop, states(loop, plant_w=0.5), 0.5)
    assert out["Fhat"] == pytest.approx(LOW.Fc * np.tanh(0.5))
    assert out["u"] == pytest.approx(out["Fhat"])
    with pytest.raises(lg.InputError, match="needs_current needs current"):
        velocity_loop(P, "needs_current")
    with pytest.raises(lg.InputError, match="no output Fhat"):
        velocity_loop(P, "no_torque")


UNKNOWN = lg.Model.of(P).with_values({"Fc": None})


@pytest.mark.parametrize(
    ("given", "options", "said"),
    [
        (P, {"observer": "kalman"}, "'kalman'.*natural, existing, proposed"),
        (UNKNOWN, {}, "Fc"),
        (P, {"observer": "natural", "observer_parameters": UNKNOWN}, "Fc"),
        (P, {"kp": None}, "kp"),
    ],
)
@pytest.mark.parametrize("make", [velocity_loop, position_loop])
def test_wrong_usage_is_one_sentence(make, given, options, said):
    with pytest.raises(lg.InputError, match=said):
        make(given, **options)


# The loops of a drive with a dead time, by name, have the figures of their parts.


def behind(system, delay, **options):
    """RMS of w(t) - r(t - h) in rad/s over 2 to 4 s, r = sin 2 pi t rad/s."""
    loop = lg.late_loop(P, system, delay, **options)
    t = np.arange(0.0, 4.0005, 1e-3)
    given = {"r": np.sin(2 * np.pi * t), "dr": 2 * np.pi * np.cos(2 * np.pi * t)}
    given = {k: v for k, v in given.items() if k in loop.input_labels}
    w = lg.simulate(loop, t, given).outputs["w"]
    return rms((w - np.sin(2 * np.pi * (t - delay)))[t >= 2.0])


def test_the_friction_is_known_ahead_of_time():
    assert behind("predicted", 10e-3) == pytest.approx(0.0068, abs=1e-3)


def test_wrong_names_and_delays_are_one_sentence():
    with pytest.raises(lg.InputError, match="known: friedland_park, predicted, reference"):
        lg.late_loop(P, "smith", 5e-3)
    with pytest.raises(lg.InputError, match="cannot be negative"):
        lg.late_loop(P, "predicted", -5e-3)

"""A factory or a function that is called wrongly says so in one sentence."""

import re
from dataclasses import replace

import numpy as np
import pytest

import lugrectl as lg
from lugrectl.blocks.observers import observer

P = lg.table1()
PLAIN = lg.Model.of(J=1e-3, friction="coulomb", Fc=0.1, Fv=0.01)
WITHOUT_J = lg.Model.of(P).with_values({"J": None})
CALLS = [
    (lambda: observer("nonsense", P), "no observer named 'nonsense'; known: natural"),
    (lambda: observer("natural", P, K1=3.0), "natural_observer has no parameter 'K1'"),
    (lambda: lg.natural_observer(P, outputs=["Fhat"]), "outputs"),
    (lambda: lg.natural_observer(PLAIN), "natural_observer needs sigma0, sigma1, Fs, vs"),
    (lambda: lg.proposed_observer(P, K1=float("nan")), "proposed_observer.K1"),
    (lambda: lg.proposed_observer(WITHOUT_J), "proposed_observer needs J"),
    (lambda: lg.error("torque"), "unknown kind 'torque'; known: velocity, position"),
    (lambda: lg.feedforward(WITHOUT_J), "feedforward.J"),
    (lambda: lg.prefilter(kind="torque"), "unknown kind 'torque'; known: None, velocity"),
    (lambda: lg.pi(kp="much"), "pi.kp must be a number"),
    (lambda: lg.pi(limit=-1.0), "limit = -1 lies outside"),
    (lambda: lg.pi(limit="much"), "limit must be a number"),
    (lambda: lg.pi(0.0, 1.0, limit=1.0), "give tracking in s"),
    (lambda: lg.pi(tracking=0.0), "tracking = 0 must be above 0 s"),
    (lambda: lg.notch(0.0), "frequency = 0 must be above 0 Hz"),
    (lambda: lg.notch(10.0, depth=2.0), "depth"),
    (lambda: lg.dead_time(-1.0), "delay is -1 s, but a dead time cannot be negative"),
    (lambda: lg.dead_time(1.0, 1e-5), "10000 samples"),
    (lambda: lg.dead_time(0.1, -1.0), "dt must be a positive number"),
    (lambda: lg.repetitive_control(P, period=0.0), "period"),
    (lambda: lg.repetitive_control(P, harmonics=2.5), "harmonics = 2.5"),
    (lambda: lg.repetitive_memory(P, dt=0.0), "dt, the sample time,"),
    (lambda: lg.repetitive_memory(P, period=1e9, dt=1e-6), "1e+15 samples of 1e-06 s"),
    (lambda: lg.repetitive_memory(P, smooth=3), "smooth"),
    (lambda: lg.tabulated("z", [0, 1], [0, 1]), "no table over 'z'"),
    (lambda: lg.tabulated("theta", [0, 0], [0, 1]), "table: points must be at least two incr"),
    (lambda: lg.tabulated("theta", [0, 1], [0, 1, 2]), "table: values have the shape (1, 3)"),
    (lambda: lg.tabulated("theta", [0, 1], [0, np.nan]), "table: values must be finite"),
    (lambda: lg.tabulated("w", [0, 1], [[0, 1], [0, 1]]), "table over w covers both directions"),
    (lambda: lg.tabulated("w", [0, 1], [0, 1], periodic=True), "a periodic table must be over"),
    (lambda: lg.tabulated("theta", [0, 7], [0, 1], periodic=True), "a periodic table must be"),
    # gains of the proposed observer
    (lambda: lg.design_gains(P, "best"), "time-varying, bounded, constant"),
    (lambda: lg.design_gains(P, A=1.0), "no choice 'A'"),
    (lambda: lg.design_gains(P, alpha=-1.0), "alpha must be a positive number"),
    (lambda: lg.design_gains(P, "bounded"), "needs M"),
    (lambda: lg.design_gains(replace(P, sigma1=0.0)), "needs sigma1 > 0"),
    (lambda: lg.design_gains(replace(P, sigma1=0.0), "time-varying"), "give A"),
    (lambda: lg.design_gains(replace(P, Fc=0.0)), "Fc = 0"),
    (lambda: lg.certify(lg.Model.of(P).with_values({"Fs": None}), -1, 1), "needs Fs"),
    (lambda: lg.certify(P, np.abs, 1.0), "K1 must be a number"),
    (lambda: lg.certify(P, -1.0, float("nan")), "K2 must be finite"),
    (lambda: lg.excitation([1.0], [0.0]), "one length"),
    (lambda: lg.excitation([1.0, np.nan], [0.0, 1.0]), "finite"),
    (lambda: lg.excitation([1.0, 1.0, 1.0], [0.0, 1.0, 0.5]), "after 1 s comes 0.5 s"),
    (lambda: lg.excitation([1.0, 1.0], [0.0, 1.0], T=2.0), "longer than the log"),
    (lambda: lg.natural_decay(P, [1.0, 2.0], [0.0, 0.0]), "t must increase"),
    # gains of the others, by rule
    (lambda: lg.design_gains(P, observer="no"), "there is no design rule for no_observer"),
    (lambda: lg.design_gains(P, observer="natrual"), "did you mean 'natural'?"),
    (lambda: lg.design_gains(P, observer="disturbance", ta=1), "did you mean 'tau'?"),
    (lambda: lg.design_gains(P, observer="natural", k=1), "no choice 'k'; it has none."),
    (lambda: lg.design_gains(P, "bounded", observer="natural"), "the proposed observer only"),
    (
        lambda: lg.design_gains(lg.Model.of(J=1.0), observer="natural"),
        "needs sigma0, Fc, Fs, vs of the drive",
    ),
    (
        lambda: lg.design_gains(replace(P, sigma1=0.0), observer="existing"),
        "sigma1 = 0: the design rule of existing_observer needs sigma1 > 0",
    ),
    (
        lambda: lg.velocity_loop(P, "natural", bandwidth=3),
        "bandwidth is no argument of the loop",
    ),
    (lambda: lg.velocity_loop(P, "natural", prefiltr=True), "did you mean 'prefilter'?"),
    (lambda: lg.design_gains(P, "constnt"), "did you mean 'constant'?"),
    (
        lambda: lg.velocity_loop(P, "disturbance", gains={"tau": 1}, tau=2),
        "tau is given twice",
    ),
    # the cascade
    (lambda: lg.cascade_loop(P, feedback="load"), "has no load of its own"),
    (lambda: lg.cascade_loop(P, feedback="second"), "'motor' or 'load'"),
    (lambda: lg.cascade_loop(P, tracking=0.1), "tracking belongs to a limit"),
    (lambda: lg.cascade_loop(P, notch="deep"), "notch must be a frequency"),
    # observers side by side
    (lambda: lg.compare_observers(P, "propsed"), "did you mean 'proposed'?"),
    (lambda: lg.compare_observers(P, 3), "must be a name or a list of names, not 3"),
    (lambda: lg.compare_observers(P, []), "must be a name or a list of names"),
    (lambda: lg.compare_observers(P, "natural", scenarios=["speed"]), "no scenario 'speed'"),
    (lambda: lg.compare_observers(P, "natural", scenarios="delays"), "did you mean 'delay'?"),
    (lambda: lg.compare_observers(P, "natural", scenarios=[]), "scenarios is an empty list"),
    (lambda: lg.compare_observers(P, "natural", rates=[]), "rates is an empty list"),
    (lambda: lg.compare_observers(P, "natural", rates=0), "rates must be a positive number"),
    (lambda: lg.compare_observers(P, ["natural"], wrong=-1), "wrong"),
    (lambda: lg.compare_observers(P, ["natural"], off=1.0), "off is 1; give a share below 1"),
    (lambda: lg.compare_observers(P, ["natural"], resolution=-1), "resolution is -1; give"),
    (lambda: lg.compare_observers(lg.Model.of(J=1.0)), "needs sigma0"),
    # the observer for a drive
    (lambda: lg.recommend_observer(P), "rate is missing"),
    (lambda: lg.recommend_observer(P, {"rat": 1000}), "did you mean 'rate'?"),
    (lambda: lg.recommend_observer(P, 1000), "record must be a path"),
    (lambda: lg.recommend_observer(P, rate=-1), "rate must be a positive number of Hz"),
    (lambda: lg.recommend_observer(P, rate=1e3, noise=-1), "noise must be 0 or positive"),
    (lambda: lg.recommend_observer(P, rate=1e3, measured="speed"), "measured must be"),
    (lambda: lg.recommend_observer(P, rate=1e3, uncertainty=1.5), "uncertainty is 1.5"),
    (lambda: lg.recommend_observer(P, rate=1e3, uncertainty={"sigma": 0.1}), "did you mean"),
    (lambda: lg.recommend_observer(P, rate=1e3, gains={"natural": 1}), "gains must be a dict"),
    (
        lambda: lg.recommend_observer(P, rate=1e3, gains={"disturbance": {"ta": 1}}),
        "disturbance_observer has no parameter 'ta'",
    ),
    (lambda: lg.recommend_observer(P, rate=1e3, certified=1), "certified must be True"),
    (lambda: lg.recommend_observer(lg.Model.of(J=1.0), rate=1e3), "identify them first"),
    (lambda: lg.recommend_observer(3, rate=1e3), "p must be a Model"),
]
LOOPS = [
    ({"controller": "sliding"}, "unknown controller 'sliding'; known: pi"),
    ({"controller": "pi_limited"}, "unknown controller 'pi_limited'"),
    ({"controller": "prefilter"}, "prefilter needs r_cmd"),
    ({"controller": "feedforward"}, "feedforward needs a"),
    ({"controller": "sliding_error"}, "has the output u"),
    ({"controller": "slotine_li", "kp": 3.0}, "kp is a gain of pi"),
    ({"controller": "slotine_li", "feedforward": True}, "contains J times the acceleration"),
    ({"controller": "slotine_li", "controller_gains": {"Kd": 1.0}}, "no parameter 'Kd'"),
    ({"controller": "slotine_li", "controller_gains": 3.0}, "controller_gains must be a dict"),
    ({"controller_gains": {"kp": 1.0}}, "pi has its own"),
]


def refused(call, words):
    with pytest.raises(lg.InputError, match=re.escape(words)) as raised:
        call()
    assert "\n" not in str(raised.value) and str(raised.value)[-1] in ".?"


@pytest.mark.parametrize(("call", "words"), CALLS)
def test_a_wrong_value_is_one_sentence(call, words):
    refused(call, words)


@pytest.mark.parametrize(("options", "words"), LOOPS)
def test_a_wrong_controller_of_a_loop_is_one_sentence(options, words):
    refused(lambda: lg.velocity_loop(P, "natural", **options), words)


def test_wrong_arguments_are_named_as_python_does():
    with pytest.raises(TypeError, match=r"natural_observer\(\) missing a required argument: 'p'"):
        lg.natural_observer()
    with pytest.raises(TypeError, match=r"pi\(\) got an unexpected keyword argument 'kq'"):
        lg.pi(kq=3.0)


LOG = {"t": 1e-3 * np.arange(50), "u": np.ones(50), "w": np.ones(50)}
SWAPPED = {
    lg.compare_observers: ["natural"],
    lg.recommend_observer: LOG,
    lg.velocity_loop: "proposed",
    lg.cascade_loop: "disturbance",
    lg.design_gains: "constant",
}


@pytest.mark.parametrize(("work", "first"), SWAPPED.items())
@pytest.mark.parametrize("model", [P, lg.Model.of(P)])
def test_swapped_arguments_are_one_sentence(work, first, model):
    words = "p must be" if not isinstance(first, str) else "no such"
    refused(lambda: work(first, model), "unknown method" if first == "constant" else words)


def test_a_log_is_no_model():
    refused(lambda: lg.plant(LOG), "not a dict of samples: that is a log")
    refused(lambda: lg.l2_check(22.0, 22.0), "22.0 has no J: give Parameters")

"""The loops of a drive with a dead time, by name, have the figures of their parts."""

import numpy as np
import pytest

import lugrectl as lg

from ..cases.observed import P, believing, longer, rms


def behind(system, delay, **options):
    """RMS of w(t) - r(t - h) in rad/s over 3 to 6 s, r = sin 2 pi t rad/s."""
    loop = lg.late_loop(P, system, delay, **options)
    t = np.arange(0.0, 6.0005, 1e-3)
    given = {"r": np.sin(2 * np.pi * t), "dr": 2 * np.pi * np.cos(2 * np.pi * t)}
    given = {k: v for k, v in given.items() if k in loop.input_labels}
    w = lg.simulate(loop, t, given).outputs["w"]
    return rms((w - np.sin(2 * np.pi * (t - delay)))[t >= 3.0])


@pytest.mark.parametrize("delay", [5e-3, 10e-3])
def test_the_friction_is_known_ahead_of_time(delay):
    assert behind("predicted", delay) == pytest.approx(0.0068, abs=1e-3)


@longer
@pytest.mark.parametrize(
    ("system", "delay", "options", "error"),
    [
        ("predicted", 5e-3, {"believed": believing(0.8)}, 0.129),
        ("predicted", 10e-3, {"believed": believing(1.2)}, 0.386),
        ("friedland_park", 5e-3, {}, 0.0405),
        ("friedland_park", 10e-3, {}, 0.0676),
        ("friedland_park", 10e-3, {"kp": 0.3}, 0.088),
        ("reference", 5e-3, {"kp": 0.1}, 0.0163),
        ("reference", 10e-3, {"kp": 0.1}, 0.0333),
    ],
)
def test_each_system_has_the_error_of_the_survey(system, delay, options, error):
    """Within 15 %: those figures are sampled at 1 kHz, this loop is continuous."""
    assert behind(system, delay, **options) == pytest.approx(error, rel=0.15)


def test_the_dead_time_must_be_known_to_about_a_crossover():
    """kp dh/J of 1.5 is stable, 2.9 is not."""
    assert behind("predicted", 10e-3, believed_delay=8e-3) < 0.01
    with pytest.raises(lg.Diverged):
        behind("predicted", 10e-3, believed_delay=6e-3)


def test_wrong_names_and_delays_are_one_sentence():
    with pytest.raises(lg.InputError, match="known: friedland_park, predicted, reference"):
        lg.late_loop(P, "smith", 5e-3)
    with pytest.raises(lg.InputError, match="cannot be negative"):
        lg.late_loop(P, "predicted", -5e-3)

"""Compensation that is held for a sample: what the hold alone costs at quick reversals."""

import numpy as np
import pytest

import lugrectl as lg

TABLE1 = lg.table1()


def tracking(dt, *compensation):
    """The largest speed error at 300 rad/s and 5 Hz."""
    t = np.arange(0.0, 0.6 + dt / 2, dt)
    r = 300.0 * np.sin(10.0 * np.pi * t)
    drive = [lg.error(), lg.sampled(lg.pi(1.6, 0.16), dt), *compensation]
    run = lg.simulate_sampled(lg.plant(TABLE1), drive, t, {"r": r})
    w = np.asarray(run.outputs)[run.output_labels.index("w")]
    return np.abs(w - r)[t >= 0.3].max()


@pytest.mark.parametrize("made", [lg.natural_observer, lg.proposed_observer])
def test_a_sampled_observer_loses_what_the_held_friction_itself_loses(made):
    """At 1 kHz the true friction, held, tracks no better than none; at 2 kHz both are better."""
    for dt, helps in ((1e-3, False), (0.5e-3, True)):
        none, ideal = tracking(dt), tracking(dt, lg.compensation(inputs=["F"]))
        seen = tracking(dt, lg.sampled(made(TABLE1), dt), lg.compensation())
        assert seen == pytest.approx(ideal, abs=0.05)
        assert (ideal < none - 0.1, seen < none - 0.1) == (helps, helps)

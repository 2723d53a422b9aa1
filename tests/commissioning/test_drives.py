"""Drives drawn at random: the response with friction taken out against the exact one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import lugrectl as lg

from . import drives

pytest.importorskip("numba")
RANGES = {"1-10 Hz": (1.0, 10.0), "10-50 Hz": (10.0, 50.0), "above 50 Hz": (50.0, np.inf)}
LIMITS = {"1-10 Hz": (0.04, 0.25), "10-50 Hz": (0.15, 0.8), "above 50 Hz": (0.12, 0.7)}
QUICK = [
    [303],
    pytest.param([3, 6], marks=pytest.mark.sample),
]  # a motor that sticks; bristles and a load
SLOW = range(100, 120)


def decibel(frd, drive):
    return np.abs(20 * np.log10(np.abs(np.ravel(frd.frdata) / drive.response(frd.omega))))


def errors(found, drive):
    """|dB| without and with friction taken out, by range."""
    f, both = found.frequency / (2 * np.pi), [decibel(x, drive) for x in (found.raw, found.frd)]
    return {k: [e[(f >= a) & (f < b)] for e in both] for k, (a, b) in RANGES.items()}


def pooled(found, name, which):
    """Median and 90 % of the errors in dB."""
    every = [errors(result, drive)[name][which] for drive, result in found]
    return np.quantile(np.concatenate(every), [0.5, 0.9])


def modes_inside(found):
    """Whether the interval of each mode found holds the true one, of drives with two masses."""
    inside = []
    for drive, result in found:
        if len(drive.masses) == 2:
            true = dict(zip(("antiresonance", "resonance"), drive.mode(), strict=True))
            inside += [m.ci95[0] <= true[m.kind] <= m.ci95[1] for m in result.modes]
    return inside


@pytest.fixture(scope="module", params=QUICK, ids=str)
def quick(request):
    """Of the last of several no reference was recorded."""
    first, *more = request.param
    without = [(drives.draw(n), drives.answered(n, 20.0, ("t", "u", "theta"))) for n in more]
    return [(drives.draw(first), drives.answered(first)), *without]


@pytest.mark.slow
@pytest.mark.parametrize("quick", QUICK[1:], indirect=True, ids=str)
def test_friction_taken_out_leaves_the_linear_response(quick):
    for name, limit in LIMITS.items():
        raw, taken = pooled(quick, name, 0), pooled(quick, name, 1)
        assert (taken <= limit).all() and (taken <= 0.7 * raw).all(), (name, raw, taken)


@pytest.mark.cases
def test_bands_and_intervals_hold_the_truth(quick):
    inside = []
    for drive, found in quick:
        true, sure = np.abs(drive.response(found.frequency)), found.certain
        inside += list(((found.low <= true) & (true <= found.high))[sure])
    assert np.mean(inside) > 0.93
    assert np.mean(modes_inside(quick)) >= 0.9


@pytest.mark.cases
def test_a_log_of_quick_moves_is_trusted_where_the_coherence_is_high(quick):
    for drive, found in quick:
        nothing = (found.coherence < 0.95) | found.governed
        assert (np.isnan(found.low) == nothing).all() and (np.isnan(found.high) == nothing).all()
        assert found.inertia == pytest.approx(drive.inertia, rel=0.01)  # of the whole axis
        assert found.trusted and found.governed.mean() < 0.1
    assert any(np.isnan(found.low).any() for _, found in quick)
    assert any("the band holds" in found.messages[0] for _, found in quick)


def creeping(Fc, Fs):
    """The log of a multisine alone, with such shares of the largest torque as friction."""
    drive = drives.draw(12)
    drive = replace(drive, Fc=Fc * drive.most, Fs=Fs * drive.most)
    return lg.frequency_response(drives.log(drive, 6.0, moving=False), lg.Model.of())


def test_a_log_in_which_friction_covers_all_is_refused():
    with pytest.raises(lg.Refused, match="at no frequency .* as friction governs") as no:
        creeping(0.12, 0.15)
    assert "record 30 s of quick moves" in str(no.value) and "multisine" in no.value.experiment


@pytest.mark.slow
def test_friction_that_governs_a_log_is_warned_of():
    found = creeping(0.04, 0.05)
    assert not found.trusted and found.correction > 2
    assert found.governed.any() and np.isnan(found.high[found.governed]).all()
    assert "no band holds" in found.messages[0] and "quick moves" in found.messages[-1]


@pytest.mark.slow
def test_the_other_effects_of_the_model_are_taken_out():
    drive = drives.draw(12)
    log = drives.log(drive, 12.0)
    size = 0.5 * drive.Fc
    # cogging of the logged torque: the same motion would have needed that much more
    force = 2 * np.pi * np.fft.rfftfreq(len(log["t"]), 1 / drive.rate)
    ahead = np.exp(1j * force / drive.rate) * (1 + 1j * force * drive.lag)
    cogging = size * np.sin(7 * (log["theta"] + 0.5 * np.diff(log["theta"], append=0.0)))
    cogging[-1] = 0.0
    log["u"] = log["u"] + np.fft.irfft(np.fft.rfft(cogging) * ahead, len(cogging))
    ripple = {"name": "torque_ripple", "harmonic": 7, "phase": 0.0, "amplitude": size}
    without = lg.frequency_response(log, lg.Model.of())
    found = lg.frequency_response(log, lg.Model.of(effects=[ripple]))
    low = found.frequency < 2 * np.pi * 50
    left, taken = (np.median(decibel(x.frd, drive)[low]) for x in (without, found))
    assert taken < 0.5 * left and taken < 0.1


@pytest.mark.slow
def test_twenty_more_drives():
    found = [(drives.draw(n), drives.answered(n, 30.0)) for n in SLOW]
    for name, (median, most) in LIMITS.items():
        taken = pooled(found, name, 1)
        assert taken[0] <= 1.3 * median and taken[1] <= 2 * most, (name, taken)
    assert np.mean(modes_inside(found)) >= 0.85

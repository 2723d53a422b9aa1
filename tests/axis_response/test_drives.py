"""Drives drawn at random: the response with friction taken out against the exact one."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

import lugrectl as lg

from . import drives

RANGES = {"1-10 Hz": (1.0, 10.0), "10-50 Hz": (10.0, 50.0), "above 50 Hz": (50.0, np.inf)}
QUICK, SLOW = range(8), range(100, 120)


def errors(found, drive):
    """|dB| without and with friction taken out, by range."""
    f, true = found.frequency / (2 * np.pi), drive.response(found.frequency)
    both = [
        np.abs(20 * np.log10(np.abs(np.ravel(x.frdata) / true))) for x in (found.raw, found.frd)
    ]
    return {k: [e[(f >= a) & (f < b)] for e in both] for k, (a, b) in RANGES.items()}


def answers(seeds, friction=True, **options):
    for seed in seeds:
        drive = drives.draw(seed, friction)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield drive, lg.frequency_response(drives.log(drive, **options), lg.Model.of())


def pooled(every, name, which):
    """Median and 90 % of the errors in dB."""
    return np.quantile(np.concatenate([e[name][which] for e in every]), [0.5, 0.9])


@pytest.fixture(scope="module")
def quick():
    return list(answers(QUICK))


def check(found, limits):
    every = [errors(result, drive) for drive, result in found]
    for name, limit in limits.items():
        raw, taken = pooled(every, name, 0), pooled(every, name, 1)
        assert (taken <= limit).all(), (name, taken)
        assert (taken <= raw).all(), (name, raw, taken)
    assert pooled(every, "1-10 Hz", 1)[0] < 0.2 * pooled(every, "1-10 Hz", 0)[0]


def test_friction_taken_out_leaves_the_linear_response(quick):
    check(quick, {"1-10 Hz": (0.08, 0.8), "10-50 Hz": (0.15, 1.2), "above 50 Hz": (0.15, 0.7)})


def test_most_of_the_bands_hold_the_true_response(quick):
    inside = []
    for drive, found in quick:
        true = np.abs(drive.response(found.frequency))[found.certain]
        inside += list((found.low[found.certain] <= true) & (true <= found.high[found.certain]))
    assert np.mean(inside) > 0.9


def test_nothing_is_certain_where_the_coherence_is_low(quick):
    for _, found in quick:
        assert (np.isnan(found.low) == (found.coherence < 0.95)).all()
    assert any(np.isnan(found.low).any() for _, found in quick)

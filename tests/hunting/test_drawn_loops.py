"""Drawn loops against a simulation of its own: 200 from 50 starts each, a few always."""

from dataclasses import replace

import numpy as np
import pytest

import lugrectl as lg

from . import brute_force as brute
from .drawn_loops import drawn


def compare(seed, count=50):
    """Presence, and the size and period of what the other simulation reaches.

    Counts make hunting irregular: there the mean of the starts is compared, within its scatter.
    """
    loop = drawn(seed)
    found = lg.limit_cycles(loop.model, **loop.options)
    fates, sizes, periods = loop.starts(count)
    stable, hunts = [c for c in found.cycles if c.stable], fates == brute.HUNTS
    assert bool(stable) == hunts.any(), seed
    near = [min(stable, key=lambda c: abs(np.log(c.amplitude / s))) for s in sizes[hunts]]
    for cycle in {id(c): c for c in near}.values():
        own = np.array([c is cycle for c in near])
        loose = 1.0 if loop.sampling else 0.0
        for value, seen in ((cycle.amplitude, sizes), (cycle.period, periods)):
            seen = seen[hunts][own]
            assert np.median(seen) == pytest.approx(
                value, rel=max(0.01, loose * np.ptp(seen) / value)
            )
    if not loop.sampling:  # every stable cycle is reached, and no other
        assert len({id(c) for c in near}) == len(stable)


@pytest.mark.cases
@pytest.mark.parametrize("seed", [2, 12, 13])
def test_a_drawn_loop_agrees_with_another_simulation(seed):
    compare(seed, 20)


@pytest.mark.slow
@pytest.mark.parametrize("first", range(0, 200, 20))
def test_200_drawn_loops_agree_with_another_simulation(first):
    for seed in range(first, first + 20):
        compare(seed)


def with_bristles(seed, bend):
    """A drawn loop with LuGre friction; ``bend`` of its bristles at breakaway in units."""
    loop = drawn(seed)
    sigma0 = loop.own["Fs"] / (bend * loop.unit)
    more = {"sigma0": sigma0, "sigma1": np.sqrt(sigma0 * loop.own["J"])}
    law = {k: loop.own[k] for k in ("J", "Fc", "Fs", "vs", "Fv")}
    gains = {k: loop.own[k] for k in ("kp", "ki", "kd")}
    return lg.Model.of(friction="lugre", **law, **more), gains, loop.own | more


@pytest.mark.slow
def test_bristles_in_a_drawn_loop_agree_with_another_simulation():
    model, gains, own = with_bristles(61, 3e-3)
    small, large = lg.limit_cycles(model, **gains).cycles
    assert large.stable and not small.stable and small.multipliers[0] > 1.0 > large.multipliers[0]
    size = brute.with_bristles(**own, e=large.amplitude, turns=12, step=1e-3)
    assert size == pytest.approx(large.amplitude, rel=2e-3)


def compare_map(seed, share):
    """A map over ki and the friction against the other simulation at each of its points."""
    loop = drawn(seed)
    gains = {k: loop.own[k] for k in ("kp", "ki", "kd")}
    ends = {"ki": (0.1 * gains["ki"], gains["ki"])}
    more = {"friction": (0.6, 1.8), "compensation": share, "points": 3}
    found = lg.hunting_map(loop.model, ends, **gains, **more)
    for (i, j), region in np.ndenumerate(found.region):
        ki, true = (float(v[k]) for v, k in zip(found.values, (i, j), strict=True))
        law = {k: true * loop.own[k] for k in ("Fc", "Fs", "Fv")}
        own = replace(loop, own=loop.own | law | {"ki": ki})
        fates, _, _ = own.starts(50, share=share / true, vd=loop.own["vs"])
        persists = np.isin(fates, (brute.HUNTS, brute.GROWS)).any()
        assert persists == (region > 0), (seed, share, ki, true, region, np.bincount(fates))


@pytest.mark.slow
def test_a_map_over_wrongly_believed_friction_agrees_with_another_simulation():
    compare_map(61, 0.3)

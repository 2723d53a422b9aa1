"""A sampled controller and observer on the continuous drive; opt-in: pytest -m slow -s."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import lugrectl as lg
from lugrectl.engine import TraceError
from lugrectl.engine.runtime import memo, sampled_run

from ..conftest import there
from .timing import milliseconds

pytestmark = pytest.mark.slow
DT, P = 1e-3, lg.table1()


def blocks():
    low = replace(P, sigma0=0.9 * P.sigma0, Fc=0.9 * P.Fc, Fs=0.9 * P.Fs)
    parts = [lg.pi(1.6, 0.16), lg.proposed_observer(low)]
    return [lg.plant(P), lg.error(), lg.compensation(), *(lg.sampled(b, DT) for b in parts)]


@pytest.mark.parametrize(("way", "target"), [("c", 100.0), ("numba", 100.0), ("python", 1000.0)])
def test_ten_seconds_at_1_khz(way, target, monkeypatch, record_property):
    """Against the same net whose sampled blocks are called at their ticks."""
    made_by = None if way == "python" else there(way)
    monkeypatch.setattr(sampled_run, "compiler", lambda: made_by)
    monkeypatch.setattr(memo, "_traced", {})
    net, t = blocks(), DT * np.arange(10_001)
    r = {"r": np.sin(2 * np.pi * t)}
    fast = lg.simulate(net, t, r)
    spent = milliseconds(lambda: lg.simulate(net, t, r), 7)
    monkeypatch.setattr("lugrectl.simulation.net_run.compiled", _cannot)
    slow = lg.simulate(net, t[:1001], {"r": r["r"][:1001]})
    ratio = 10 * milliseconds(lambda: lg.simulate(net, t[:1001], {"r": r["r"][:1001]}), 1) / spent
    np.testing.assert_allclose(fast.outputs[:, :1001], slow.outputs, rtol=1e-6, atol=1e-9)
    record_property("ms", spent)
    print(f"\n{way}: {spent:.1f} ms, {ratio:.0f} times as fast as calling the sampled blocks")
    assert spent <= target


def _cannot(*_):
    raise TraceError("not asked for")

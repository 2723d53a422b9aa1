"""Rebuilding z from a million samples; opt-in: pytest -m slow -s tests/benchmarks."""

from __future__ import annotations

import numpy as np
import pytest

import lugrectl as lg
from lugrectl.simulation import bristle_deflection

from .timing import milliseconds

pytestmark = pytest.mark.slow
N, DT, P = 1_000_000, 1e-3, lg.table1()
SPEED = np.sin(np.linspace(0.0, 600.0, N))


def plain_loop(w: np.ndarray) -> float:
    """What one writes first: a Python loop on floats, coefficients by NumPy."""
    h = P.Fc + (P.Fs - P.Fc) * np.exp(-((w / P.vs) ** 2))
    a = np.maximum(P.sigma0 * np.abs(w) / h, 1e-290)
    share = -np.expm1(-a * DT)
    z = 0.0
    for part, push in zip(share.tolist(), (share * w / a).tolist(), strict=True):
        z += push - part * z
    return z


@pytest.mark.parametrize(("way", "target"), [("numba", 8.0), ("c", 10.0), (None, 40.0)])
def test_deflection_of_a_million_samples(way, target, monkeypatch, record_property):
    if way == "numba":
        pytest.importorskip("numba")
    monkeypatch.setattr(bristle_deflection, "compiler", lambda: way)
    spent = milliseconds(lambda: lg.deflection(SPEED, DT, P), 25)
    ratio = milliseconds(lambda: plain_loop(SPEED), 3) / spent
    record_property("ms", spent)
    print(f"\n{way}: {spent:.1f} ms for {N} samples, {ratio:.0f} times a Python loop")
    assert spent <= target

"""Lanes side by side against the same lanes one after another, in one process.

Opt-in: pytest -m slow -s tests/benchmarks.
"""

from __future__ import annotations

import numpy as np
import pytest

from lugrectl.engine import Lanes
from lugrectl.engine.runtime import batch_run
from lugrectl.engine.runtime.c_compiler import has_wide

from ..cases.systems import DT, torque
from ..cases.wide import WIDE, plant
from .timing import milliseconds

pytestmark = pytest.mark.slow


@pytest.mark.skipif(not has_wide(), reason="this machine computes one at a time")
@pytest.mark.parametrize("effect", WIDE)
def test_several_at_once_are_quicker(effect, monkeypatch):
    """A loop that the compiler could not turn into several at once would be no quicker."""
    made = Lanes(plant("lugre", effect), backend="c")
    p = np.tile(made.defaults, (64, 1))
    x0 = 1e-3 * np.random.default_rng(1).standard_normal((64, len(made.states)))
    u = torque(1000)[:, : len(made.inputs)]

    def spent(least: int) -> float:
        monkeypatch.setattr(batch_run, "LEAST_WIDE", least)
        return milliseconds(lambda: made.run(x0, np.zeros(64, int), 1000, u, p, dt=DT), 5)

    ratio = spent(1000) / spent(1)
    print(f"\n{effect}: {ratio:.1f} times as quick")
    assert ratio > 1.1

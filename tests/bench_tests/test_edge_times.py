"""A speed by the time between edges gives the angle back, also over rests and at even speed."""

from __future__ import annotations

import numpy as np

from lugrectl.bench_tests.edge_times import angle_of

from ..drives.bench import Drive, held, stale


def test_the_angle_to_a_count():
    log = Drive(counts=2000).run(held([0.4, 0.0, -0.5, 0.0, 0.22, 0.0], 200), 2400)
    x, count = angle_of(log["t"], stale(log))
    assert abs(count / (2 * np.pi / 2000) - 1) < 1e-6
    assert np.abs(x - (log["theta"] - log["theta"][0])).max() < 1.5 * count


def test_a_speed_of_another_kind_has_no_edges():
    t = 2e-3 * np.arange(3000)
    w = np.sin(3 * t)
    assert angle_of(t, w) is None
    assert angle_of(t, np.round(w, 2)) is None
    assert angle_of(t, np.where(np.abs(w) < 0.5, 0.5, w)) is None

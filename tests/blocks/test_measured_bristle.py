"""The bristle along a measured motion."""

import numpy as np

from lugrectl.blocks.measured_bristle import along, strokes


def test_a_drive_that_never_moves_has_a_bristle_at_rest():
    assert np.array_equal(along(*strokes(np.zeros(50)), 0.01), np.zeros(50))


def test_between_reversals_it_relaxes_over_the_path():
    dx = np.concatenate([np.full(400, 1e-3), np.zeros(5), np.full(400, -1e-3)])
    z = along(*strokes(dx), 0.05)
    turned = z[404]
    np.testing.assert_allclose(z[:400], 1.0 - np.exp(-np.arange(1, 401) * 0.02))
    np.testing.assert_allclose(z[405:], -1.0 + (1.0 + turned) * np.exp(-np.arange(1, 401) * 0.02))

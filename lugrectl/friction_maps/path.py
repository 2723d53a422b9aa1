"""The angles that a run at a steady speed passes, along which a torque of the angle is averaged.

A run of part of a turn does not average gravity out. Its mean torque is that of friction and that
of the angles which it happened to pass, ``u = F(w) + mean r(theta)``, and its parts differ by what
depends on the angle alone.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

CELLS = 8  # parts of a run
STEP = 0.02  # rad between nodes: of a period of a ripple of 12 per turn, a 26th
NODES = 16, 512  # of a run, at least and at most


@dataclass(frozen=True)
class Path:
    """Angle ``theta`` and torque ``u`` at nodes along a run, (nodes,).

    ``rows`` (CELLS, nodes) take from a torque there its mean over the run, and by how much its
    parts differ (orthonormal, so that white noise of the parts is white noise of these rows).
    """

    theta: np.ndarray
    u: np.ndarray
    rows: np.ndarray
    whole_turns: bool

    @classmethod
    def of(cls, theta: np.ndarray, u: np.ndarray, columns: np.ndarray) -> Path:
        """The path of a run; ``columns`` are the mean, and a ripple fitted beside it."""
        few, most = NODES
        many = int(min(max(np.ptp(theta) / STEP, few), most, len(u)))
        ends = np.arange(many) * len(u) // many
        size = np.diff(np.append(ends, len(u)))
        table = np.add.reduceat(np.column_stack([theta, u, columns]), ends) / size[:, None]
        rows = _rows(table[:, 2:])
        return cls(table[:, 0], table[:, 1], rows, columns.shape[1] > 1)


def _rows(columns: np.ndarray) -> np.ndarray:
    inverse, many = np.linalg.pinv(columns), len(columns)
    ends = np.arange(CELLS) * many // CELLS
    cells = np.add.reduceat(np.eye(many) - columns @ inverse, ends)
    cells /= np.diff(np.append(ends, many))[:, None]
    apart = np.linalg.svd(np.ones((1, CELLS)))[2][1:]
    return np.vstack([inverse[:1], apart @ cells])

"""A solver that a comparison inside a block's function holds at one time."""

from __future__ import annotations

import numpy as np

from ...core.errors import Diverged

STEPS = 5000
TURNS = 0.1  # of the steps: a smooth oscillation takes at least ten to turn back
LITTLE = 0.01  # of the whole time


class Chatter:
    """An event function for ``solve_ivp`` that never occurs: it sees every step.

    Raises
    ------
    Diverged
        Where a state turns back again and again while the time hardly moves.
    """

    terminal = False

    def __init__(self, name: str, seconds: float) -> None:
        self.name, self.seconds = name, seconds
        self.steps, self.begun = 0, -np.inf
        self.last = self.move = self.turns = np.zeros(0)

    def __call__(self, t: float, x: np.ndarray) -> float:
        if not self.steps:
            self.begun, self.last, self.move, self.turns = t, x.copy(), 0.0 * x, 0.0 * x
        move = x - self.last
        self.turns = self.turns + (move * self.move < 0.0)
        self.steps, self.last, self.move = self.steps + 1, x.copy(), move
        if self.steps > STEPS:
            self.steps = 0
            if t - self.begun < LITTLE * self.seconds and self.turns.max() > TURNS * STEPS:
                raise Diverged(
                    f"{self.name}: a comparison (an if) in a block switches without end near "
                    f"t = {t:.6g} s: write np.where for it, or np.tanh(x/eps) for a sign."
                )
        return 1.0

"""What the speed figures stand on: the accuracy at which they are taken, on stiff systems too."""

from __future__ import annotations

from math import exp

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import lugrectl as lg

from ..benchmarks import item


@pytest.mark.parametrize("way", ["c"], indirect=True)
def test_the_work_item_is_right_to_1e_6(way: str) -> None:
    """Against Runge-Kutta on equations written by hand; its first two periods."""
    ours = lg.simulate(item.loop(), item.t[:2001], item.r[:2001], item.x0)
    assert item.worst(ours.states, item.exact(samples=2001)) < 1e-6


TEXTBOOK = lg.Parameters(J=1.0, sigma0=1e5, sigma1=316.0, Fc=1.0, Fs=1.5, Fv=0.4, vs=1e-3)
CORNERS = [(0.0, 0.0), (0.5, 260.0), (1.0, 40.0), (1.5, -300.0), (2.0, -100.0)]


def _textbook(t: np.ndarray, corners: list[tuple[float, float]]) -> np.ndarray:
    """theta, w, z by Radau at 1e-11, restarted at the corners of the torque and where w = 0."""
    p, now, side = TEXTBOOK, [0.0, 0.0, 0.0], 1.0
    times, torque = zip(*corners, strict=True)

    def rates(s, x, side):
        level = p.Fc + (p.Fs - p.Fc) * exp(-min((x[1] / p.vs) ** 2, 700.0))
        dz = x[1] - p.sigma0 * side * x[1] * x[2] / level
        F = p.sigma0 * x[2] + p.sigma1 * dz + p.Fv * x[1]
        return [x[1], (np.interp(s, times, torque) - F) / p.J, dz]

    def turn(s, x, side):
        return x[1] if s > start + 1e-9 else side

    turn.terminal = True
    pieces, start = [], times[0]
    for end in times[1:]:
        while start < end:
            part = solve_ivp(
                rates, (start, end), now, "Radau", args=(side,), events=turn, dense_output=True,
                rtol=1e-11, atol=1e-15,
            )  # fmt: skip
            inside = t[(t >= start) & (t <= part.t[-1]) & (t < end)]
            pieces.append(part.sol(inside))
            start, now = part.t[-1], part.y[:, -1]
            side = -side if part.status == 1 else side
    return np.column_stack([*pieces, now])


@pytest.mark.slow
def test_textbook_lugre_to_100_rad_s_needs_no_tuning() -> None:
    """sigma0 |w| / h = 1e7 1/s at full speed, through zero speed and back."""
    t = np.linspace(0, 2, 2001)
    u = np.interp(t, *zip(*CORNERS, strict=True))
    exact = _textbook(t, CORNERS)
    ours = lg.simulate(lg.plant(TEXTBOOK), t, [u, 0.0]).states
    assert np.max(exact[1]) > 100 and np.min(exact[1]) < 0
    assert item.worst(ours, exact) < 5e-6

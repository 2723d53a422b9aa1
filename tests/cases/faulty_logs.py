"""A sound log, and faults put into it."""

from __future__ import annotations

import functools

import numpy as np

from .balance_drive import simulate, torque

DT, COUNT = 2e-3, 2 * np.pi / 65536


def columns(*more, seconds=9.0, seed=4):
    """Copies of the channels t, u and theta, and of those in ``more``."""
    made = dict(zip(("t", "u", "theta", "w"), recorded(seconds, seed), strict=True))
    return {k: x.copy() for k, x in made.items() if k in ("t", "u", "theta", *more)}


def write(folder, log, name="log.csv", between=","):
    """A text file of the columns; numbers with 9 digits, everything else as it is."""
    lines = [between.join(log)]
    for row in zip(*log.values(), strict=True):
        lines.append(between.join(x if isinstance(x, str) else f"{x:.9g}" for x in row))
    path = folder / name
    path.write_text("\n".join(lines) + "\n")
    return path


def put(role, row, value):
    def change(log):
        log[role][row] = value
        return log

    return change


def with_w(change):
    """A log with w in it, changed."""

    def made(log):
        log["w"] = change(recorded()[3].copy())
        return log

    return made


def late(rows):
    def change(log):
        log["u"] = np.r_[np.full(rows, log["u"][0]), log["u"][:-rows]]
        return log

    return change


@functools.cache
def recorded(seconds=9.0, seed=4):
    """t, u, theta and w of the drive, and nothing wrong with them."""
    u = np.round(torque(seconds, DT, seed), 6)
    theta, w = simulate(u, DT)
    return np.arange(len(u)) * DT, u, np.floor(theta / COUNT) * COUNT, w

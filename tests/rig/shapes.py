"""What strangers do over place and time, and how the rig's functions are compiled."""

from __future__ import annotations

import math

try:
    from numba import njit
except ImportError:  # plain Python then: the same lines, slower

    def njit(**_options):
        return lambda function: function


compiled = njit(cache=True, error_model="numpy", forceinline=True)


@compiled
def bumps(theta, row):
    """row: height, width, period (0: none), count, then centres and signed shapes."""
    total = 0.0
    count = int(row[3])
    for i in range(count):
        gap = theta - row[4 + i]
        if row[2] > 0.0:
            gap -= row[2] * math.floor(gap / row[2] + 0.5)
        total += row[4 + count + i] * math.exp(-((gap / row[1]) ** 2))
    return row[0] * total


@compiled
def pulses(t, row):
    """row: height, length, count, then times and signed shapes; half-sine contacts."""
    total = 0.0
    count = int(row[2])
    for i in range(count):
        phase = (t - row[3 + i]) / row[1]
        if 0.0 < phase < 1.0:
            total += row[3 + count + i] * math.sin(math.pi * phase)
    return row[0] * total


@compiled
def stroke(t, row):
    """row: height, frequency, part of the period; one push per stroke of a pump."""
    phase = (t * row[1] - math.floor(t * row[1])) / row[2]
    return row[0] * math.sin(math.pi * phase) if phase < 1.0 else 0.0


@compiled
def patch(theta, row):
    """row: rise, centre, half of its width, period (0: none). Rough over a part of the travel."""
    gap = theta - row[1]
    if row[3] > 0.0:
        gap -= row[3] * math.floor(gap / row[3] + 0.5)
    return 1.0 + row[0] / (1.0 + (gap / row[2]) ** 8)


@compiled
def wandering(t, row):
    """row: size, then frequency and phase of four slow sines."""
    total = 0.0
    for i in range(4):
        total += math.sin(2.0 * math.pi * row[1 + 2 * i] * t + row[2 + 2 * i])
    return 1.0 + row[0] * total / 2.0


@compiled
def within(t, row):
    """row: what is lost, length, count, then times: the loss at this time."""
    for i in range(int(row[2])):
        if 0.0 < t - row[3 + i] < row[1]:
            return row[0]
    return 0.0

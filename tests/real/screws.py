"""Screw and worm drives at steady speeds: maps of torque over speed, friction by direction.

The fits by hand are of mean torque over mean speed, the first row of every file left out. The
ranges of Fv reach from the slope of a straight line to that over the fastest runs, which a curve
that bends at low speed has.
"""

from __future__ import annotations

from .row import Row, Source, value, way

# the authors' signs are the opposite of the recorder's; 100 % of torque is 9.84 mN m
OPTIONS = {
    "columns": {"t": "1", "w": "2", "u": "3"},
    "units": {"t": "ms", "w": "rpm"},
    "scale": {"w": -1.0, "u": -9.84e-5},
}
FIRST = "screw-drive/steady_state/0.096kg"
THIRD = "real/screw-drive-3/steady_state"
_TENS = [2, *range(10, 101, 10), *range(120, 201, 20)]
FIRST_RUNS = [f"{FIRST}/{side}{n}.csv" for side in ("", "n") for n in _TENS]
_ONE_WAY = "1 2 6 10 17 25 40 60 80 100 140 180"
_OTHER_WAY = "n1 n4 n8 n13 n20 n30 n50 n70 n90 n120 n160 n200"
THIRD_RUNS = [f"{THIRD}/{n}.csv" for n in f"{_ONE_WAY} {_OTHER_WAY}".split()]
BY_DIRECTION = (
    way(
        "found ambiguous unexplained",
        "constant_torque coulomb_asymmetry",
        beside="viscous_asymmetry stribeck",
        absent=("J",),
    ),
)


def sources(files: list[str]) -> tuple[Source, ...]:
    return tuple(Source(file, OPTIONS) for file in files)


MAPS = (
    Row(
        "screw drive 1",
        "map",
        sources(FIRST_RUNS),
        {"motion": "rotary"},
        BY_DIRECTION,
        (value("Fv", 2.0e-5, 5.3e-5), value("constant_torque", -4.3e-4, -2.9e-4)),
        left=0.041,
        known="friction differs by direction, no J; by hand Fv 2.3e-5, Fc 2.9e-3, offset -0.36e-3",
    ),
    Row(
        "screw drive 3",
        "map",
        sources(THIRD_RUNS),
        {"motion": "rotary"},
        BY_DIRECTION,
        (value("Fv", 0.6e-5, 2.2e-5), value("constant_torque", -5.8e-4, -3.8e-4)),
        left=0.063,
        known="friction and its low-speed bend differ by direction, no J; Fv 1.16e-5, "
        "Fc 1.39e-3, offset -0.48e-3",
    ),
)

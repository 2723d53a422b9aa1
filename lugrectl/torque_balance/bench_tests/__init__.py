"""Standard bench tests in the logs of one drive, recognised by their motion and torque, and
answered as such."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from functools import partial

import numpy as np

from ...blocks.model import Model
from ...estimates.bench_test import BenchTest
from ...record import Log
from .breakaway_ramps import breakaway_ramps
from .free_swing import free_swing
from .motion import Motion, motions
from .pushes_and_coasts import coast_down, steps_and_pulses
from .slow_scan import slow_scan
from .staircase import staircase

KNOWN = 0.25  # of a value, by which one value of a test must be known
INSTEAD = {  # of a test, others that its own rows look like
    "slow_scan": ("staircase",),  # where its speed is coarse
    "breakaway_ramps": ("coast_down",),  # from the low speed at which a ramp ends
    "staircase": ("steps_and_pulses",),  # of its loop in saturation
}


def bench_tests(logs: Sequence[Log], model: Model) -> tuple[BenchTest, ...]:
    """Every standard test in the logs of one drive; none where there is none."""
    found, made = list[Motion](), list[BenchTest]()
    with np.errstate(all="ignore"):
        with suppress(np.linalg.LinAlgError):
            found = [one for log in logs for one in motions(log)]
        J, motion = model.known().get("J"), model.motion
        kinds = [
            partial(breakaway_ramps, found, motion),
            partial(slow_scan, found, J, motion),
            partial(coast_down, found, J, motion),
            partial(free_swing, found, motion),
            partial(steps_and_pulses, found, motion),
            partial(staircase, found, motion),
        ]
        for kind in kinds if found else ():
            with suppress(np.linalg.LinAlgError):  # the numbers of a log have no solution
                test = kind()
                made += [test] if test is not None and _answers(test) else []
    other = {kind for test in made for kind in INSTEAD.get(test.kind, ())}
    return tuple(test for test in made if test.kind not in other)


def _answers(test: BenchTest) -> bool:
    """Whether a value is known by more than its size, as where the log is such a test."""
    sizes = [(abs(e.value), e.ci95) for k, e in test.values.items() if k != "Fs_scatter"]
    return any(ends and ends[1] - ends[0] < 2 * KNOWN * size for size, ends in sizes)

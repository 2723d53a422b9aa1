"""The bench tests in the logs of one drive."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..blocks.model import Model
from ..estimates.bench_test import BenchTest
from ..record import Log
from .coast_down import coast_down
from .motion import motions

MOST_ROWS = 400_000


def bench_tests(logs: Sequence[Log], model: Model) -> tuple[BenchTest, ...]:
    """Every standard test in the logs, in the order of its name; none where there is none."""
    with np.errstate(all="ignore"):
        found = [one for log in logs for one in motions(log)]
        if not found:
            return ()
        made = [coast_down(found, model.known().get("J"), model.motion)]
    return tuple(test for test in made if test is not None)

"""What the first simulation of a process costs: compiling, from the cache, and without numba.

Opt-in: pytest -m slow -s tests/benchmarks.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow

CODE = """
import json, sys, time
if {blocked}:
    sys.modules["numba"] = None
marks = [time.process_time()]
import lugrectl as lg, control, numpy, scipy.integrate
marks.append(time.process_time())
if not {blocked}:
    import numba
marks.append(time.process_time())
from tests.benchmarks import item
loop = item.loop()
marks.append(time.process_time())
for _ in range(2):
    lg.simulate(loop, item.t, item.r, item.x0)
    marks.append(time.process_time())
print(json.dumps([b - a for a, b in zip(marks, marks[1:])]))
"""
PARTS = ("import lugrectl", "import numba", "build the loop", "first run", "second run")


def start(cache: Path, *, blocked: bool = False) -> dict[str, float]:
    """Seconds of processor time of each part of a new process."""
    env = dict(os.environ, LUGRECTL_CACHE=str(cache))
    done = subprocess.run(
        [sys.executable, "-c", CODE.format(blocked=blocked)],
        cwd=Path(__file__).parents[2],
        env=env,
        capture_output=True,
        text=True,
        check=True,
    )
    return dict(zip(PARTS, json.loads(done.stdout), strict=True))


def test_cold_cached_and_without_numba(tmp_path: Path) -> None:
    """The compiled code of one process serves the next."""
    pytest.importorskip("numba")
    cold = start(tmp_path)
    cached = [start(tmp_path) for _ in range(2)]
    plain = start(tmp_path, blocked=True)
    best = {part: min(one[part] for one in cached) for part in PARTS}
    print(f"\n{'seconds':18}{'cold':>10}{'cached':>10}{'no numba':>10}")
    for part in PARTS:
        print(f"{part:18}{cold[part]:10.3f}{best[part]:10.3f}{plain[part]:10.3f}")
    assert best["first run"] < 0.5 * cold["first run"]
    assert plain["first run"] < cold["first run"]

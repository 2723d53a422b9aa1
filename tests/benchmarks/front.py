"""``python -m tests.benchmarks.front``: measure README's times into notebooks/results/speed.json.

Nothing else should run on the machine meanwhile. It takes two or three minutes.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from datetime import UTC, datetime
from pathlib import Path
from statistics import median
from typing import Any

import control as ct
import numpy as np

import lugrectl as lg
from lugrectl.blocks.model import model_from_dict
from lugrectl.engine.backend import threads

from ..drives import make
from ..drives.record import Case
from . import item

ROOT = Path(__file__).parents[2]
OUT = ROOT / "notebooks" / "results" / "speed.json"
MEMBERS = 1000
# machine, effect and seed of records like those of a test bench
RECORDS: dict[str, tuple[tuple[str, str, int], ...]] = {
    "nothing missing": (("servo", "none", 170), ("wrist", "none", 171), ("joint", "none", 172)),
    "one effect": (
        ("servo", "torque_ripple", 173),
        ("wrist", "coulomb_asymmetry", 174),
        ("joint", "input_delay", 175),
    ),
}


def timed(run: Callable[[], Any], clock: Callable[[], float] = time.perf_counter) -> float:
    start = clock()
    run()
    return clock() - start


def simulation(times: int = 200) -> dict[str, float]:
    """The work item warm against python-control with LSODA at the same tolerance; s of one core."""
    loop = item.loop()

    def ours() -> Any:
        return lg.simulate(loop, item.t, item.r, item.x0)

    def theirs() -> Any:
        return ct.input_output_response(
            loop, item.t, item.r, item.x0, solve_ivp_method="LSODA",
            solve_ivp_kwargs={"rtol": 1e-6, "atol": 1e-9},
        )  # fmt: skip

    ours(), ours()
    taken = median(timed(ours, time.process_time) for _ in range(times))
    slow = timed(theirs, time.process_time)
    return {"simulate_ms": 1e3 * taken, "lsoda_s": slow, "times_faster": slow / taken}


def sweep(members: int = MEMBERS) -> dict[str, float]:
    """Parameter sets of the work item, on all processors; s."""
    rng, p = np.random.default_rng(0), item.plant
    sets = {
        "plant.sigma0": p.sigma0 * rng.uniform(0.8, 1.2, members),
        "plant.Fc": p.Fc * rng.uniform(0.9, 1.0, members),
        "plant.Fs": p.Fs * rng.uniform(1.0, 1.1, members),
        "pi.kp": item.KP * rng.uniform(0.8, 1.2, members),
    }
    loop = item.loop()

    def many() -> Any:
        return lg.sweep(loop, item.t, item.r, sets, x0=item.x0, outputs=["w"])

    many()
    return {"members": members, "sweep_s": min(timed(many) for _ in range(3))}


def diagnoses(duration: float = 30.0) -> dict[str, dict[str, Any]]:
    """Seconds of the clock for each record, and what it was called; compilation included where
    the compiled code is not kept yet."""
    made: dict[str, dict[str, Any]] = {}
    for kind, records in RECORDS.items():
        made[kind] = {"records": [], "seconds": []}
        for machine, effect, seed in records:
            case = make(effect, machine=machine, seed=seed, duration=duration)
            start = time.perf_counter()
            called = diagnosed(case)
            made[kind]["seconds"].append(time.perf_counter() - start)
            hidden = "nothing" if effect == "none" else effect
            made[kind]["records"].append(f"{hidden} on {machine}: {called}")
    return made


def diagnosed(case: Case) -> str:
    c, motion = case.columns, case.model["motion"]
    found = lg.diagnose(lg.Record(**c, motion=motion), model_from_dict(case.model, "drawn"))
    return " ".join([found.verdict, *(e.name for e in found.effects)])


def processor() -> str:
    """The processor's name, where the system says it."""
    info = Path("/proc/cpuinfo")
    lines = info.read_text().splitlines() if info.exists() else []
    names = [line.split(":")[1].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or platform.machine()


def commit() -> str:
    command = ["git", "rev-parse", "--short", "HEAD"]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True).stdout.strip()


def main(argv: Sequence[str] | None = None) -> int:
    p = argparse.ArgumentParser(prog="python -m tests.benchmarks.front", description=__doc__)
    p.add_argument("--out", type=Path, default=OUT)
    args = p.parse_args(argv)
    if os.getloadavg()[0] > 0.5:
        print("other work runs on this machine: the times will be too long", file=sys.stderr)
    head = {
        "date": datetime.now(UTC).date().isoformat(),
        "commit": commit(),
        "cores": min(threads(), os.cpu_count() or 1),
        "processor": processor(),
    }
    made = head | simulation() | sweep() | {"diagnose": diagnoses()}
    args.out.write_text(json.dumps(made, indent=1) + "\n")
    print(args.out.read_text())
    return 0


if __name__ == "__main__":
    sys.exit(main())

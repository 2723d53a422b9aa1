"""python-control's own tests, each of its simulations repeated by ``lg.simulate``."""

from __future__ import annotations

import importlib.util
import json
import os
import re
import subprocess
import sys
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

import lugrectl as lg

# where simulate does not answer, it says one of these
WHY_NOT = {
    "give its inputs=, outputs= and states=": "a system whose sizes are not declared",
    "grows without bound": "an unstable system, beyond 1e15",
    "no block reads the parameter": "a parameter that changes nothing",
    "states, x0 has": "a start that is too short, which python-control fills with zeros",
    "times of evaluation": "evaluation_times: simulate has one list of times",
    "python-control's simulation failed": "solve_ivp fails at the tolerance of the comparison",
}
LEAST = 140  # calls that must agree, or the suite has not run


@pytest.mark.slow
@pytest.mark.skipif(
    importlib.util.find_spec("control.tests") is None, reason="control.tests is not installed"
)
def test_what_python_control_s_suite_simulates_is_simulated_alike(tmp_path):
    """Within 1e-5 of its answer at a tight tolerance, or one sentence says why not."""
    lines = tmp_path / "repeated.jsonl"
    where = str(Path(__file__).parents[2])
    environment = os.environ | {"LUGRECTL_REPEATED": str(lines), "MPLBACKEND": "agg"}
    environment["PYTHONPATH"] = os.pathsep.join([where, os.environ.get("PYTHONPATH", "")])
    options = "-q -p tests.cases.repeating -p no:cacheprovider --continue-on-collection-errors"
    command = [sys.executable, "-m", "pytest", *options.split(), "-c", os.devnull]
    command += ["--rootdir", str(tmp_path), "--pyargs", *_that_simulate()]
    subprocess.run(command, cwd=tmp_path, env=environment, timeout=3000, capture_output=True)
    calls = [json.loads(line) for line in lines.read_text().splitlines()]
    counts = Counter(call["kind"] for call in calls)
    print(dict(counts))
    assert counts["agrees"] >= LEAST
    wrong = [call for call in calls if call["kind"] == "differs"]
    wrong += [call for call in calls if call["kind"] in ("refused", "skipped") and not _said(call)]
    assert not wrong, "\n".join(f"{call['test']}: {call['why']}" for call in wrong)


def _that_simulate() -> list[str]:
    """The modules of the suite that call what is repeated; the others take an hour more."""
    spec = importlib.util.find_spec("control.tests")
    assert spec is not None and spec.submodule_search_locations
    files = sorted(Path(spec.submodule_search_locations[0]).glob("*_test.py"))
    return [f"control.tests.{f.stem}" for f in files if "input_output_response" in f.read_text()]


def _said(call):
    return any(re.search(re.escape(sentence), call["why"]) for sentence in WHY_NOT)


def test_initial_states_come_in_the_parts_that_python_control_takes():
    """A vector and a matrix, row by row; a last 0 stands for all that follow."""
    import control as ct

    system = ct.rss(6, 2, 1, strictly_proper=True)
    system.name = "six"
    t, covariance = np.linspace(0, 1, 5), np.array([[3.0, 1.0], [2.0, 4.0]])
    parts = lg.simulate(system, t, 0.0, [[1.0, 2.0], covariance])
    flat = lg.simulate(system, t, 0.0, [1.0, 2.0, 3.0, 1.0, 2.0, 4.0])
    np.testing.assert_array_equal(parts.states, flat.states)
    short = lg.simulate(system, t, 0.0, [np.array([1.0, 2.0]), 0])
    np.testing.assert_array_equal(short.states[:, 0], [1, 2, 0, 0, 0, 0])
    with pytest.raises(lg.InputError, match="has 6 states, x0 has 3"):
        lg.simulate(system, t, 0.0, [np.array([1.0, 2.0]), 1])

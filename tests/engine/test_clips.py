"""Loops through clips, and an if that chatters."""

import numpy as np
import pytest

import lugrectl as lg
from lugrectl.core.errors import Diverged
from lugrectl.engine import AlgebraicLoop

from ..cases.own import static, user_block

T = np.linspace(0, 1, 41)
R = 3 * np.sin(6 * T)


def clip(t, x, u, params):
    return np.clip(u[0], -1.0, 1.0)


def branch(t, x, u, params):
    return 1.0 if u[0] > 1.0 else -1.0 if u[0] < -1.0 else u[0]


def loop(law, gain):
    """b = law(r - gain b), through a lag."""
    return [
        static(law, ["a"], ["b"], "law"),
        static(lambda t, x, u, p: u[0] - gain * u[1], ["r", "b"], ["a"], "sum"),
        user_block(lambda t, x, u, p: u - x, None, ["b"], ["y"], 1, "lag"),
    ]


@pytest.mark.parametrize("law", [clip, branch])
@pytest.mark.parametrize("gain", [0.5, -0.5, 3.0])
@pytest.mark.filterwarnings("ignore:.*branch:RuntimeWarning")
def test_a_loop_through_a_clip_is_solved(law, gain):
    """Traced, and by calling the blocks where they branch."""
    found = lg.simulate(loop(law, gain), T, {"r": R})
    b = found.outputs[list(found.output_labels).index("b")]
    np.testing.assert_allclose(b, np.clip(R / (1 + gain), -1, 1), atol=1e-12)


@pytest.mark.parametrize("law", [clip, branch, lambda t, x, u, p: u[0] ** 3])
@pytest.mark.filterwarnings("ignore:.*branch:RuntimeWarning")
def test_more_than_one_solution_is_refused(law):
    with pytest.raises(AlgebraicLoop, match=r"through law, sum.*\(piecewise\) linear"):
        lg.simulate(loop(law, -1.5), T, {"r": R})


def test_absolute_values_and_two_unknowns_at_once():
    """a = r - |b|/2, b = max(a, 0)/3 + min(a, r): the same at each instant as by iteration."""
    blocks = [
        static(lambda t, x, u, p: u[0] - 0.5 * np.abs(u[1]), ["r", "b"], ["a"], "one"),
        static(
            lambda t, x, u, p: np.maximum(u[1], 0) / 3 + np.minimum(u[1], u[0]),
            ["r", "a"],
            ["b"],
            "two",
        ),
        loop(clip, 1)[2],
    ]
    found = lg.simulate(blocks, T, {"r": R})
    a, b = (found.outputs[list(found.output_labels).index(k)] for k in "ab")
    for _ in range(200):
        a = 0.5 * a + 0.5 * (R - 0.5 * np.abs(np.maximum(a, 0) / 3 + np.minimum(a, R)))
    np.testing.assert_allclose(b, np.maximum(a, 0) / 3 + np.minimum(a, R), atol=1e-9)


@pytest.mark.parametrize(
    "method, hold", [(None, False), (None, True), ("RK45", False), ("LSODA", True)]
)
@pytest.mark.filterwarnings("ignore:block relay:RuntimeWarning")
def test_an_if_that_chatters_ends_with_a_sentence(method, hold):
    relay = user_block(
        lambda t, x, u, p: [-1.0 if x[0] > u[0] else 1.0], None, ["u"], ["x"], 1, "relay"
    )
    with pytest.raises(Diverged, match=r"relay: a comparison .* near t = 0\.5"):
        lg.simulate(relay, T, 0 * T, [0.5], method=method, hold=hold)
    lg.simulate(relay, T, 0 * T + 9.0, [0.5], method=method, hold=hold)  # never reaches it

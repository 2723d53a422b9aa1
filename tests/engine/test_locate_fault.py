"""Errors of simulate() name the block at fault, traced or not."""

from __future__ import annotations

import control as ct
import numpy as np
import pytest

from lugrectl.core.errors import Diverged
from lugrectl.simulation.response import simulate

from ..cases.own import static, user_block

pytestmark = pytest.mark.usefixtures("interpreted")


def _log_of_a_fall(branch: bool) -> ct.NonlinearIOSystem:
    """x falls from 1 to 0 in one second; its logarithm is scaled by a block behind."""
    first = user_block(lambda t, x, u, p: -1.0 + 0 * x, None, 0, ["x"], 1, "fall")
    curve = static(
        lambda t, x, u, p: np.sqrt(u[0]) if not branch or u[0] < 9 else 0.0, ["x"], ["y"], "curve"
    )
    gain = static(lambda t, x, u, p: 2 * u[0], ["y"], ["v"], "gain")
    return ct.interconnect([first, curve, gain], outputs=["v"], inputs=False, name="chain")


@pytest.mark.parametrize("branch", [False, True])
@pytest.mark.filterwarnings("ignore:block curve:RuntimeWarning")
def test_the_block_that_makes_a_nan_is_named(branch: bool) -> None:
    """Not the ones behind it, and not as the algebraic loop that python-control reports."""
    with pytest.raises(Diverged, match=r"chain: output y of block curve is nan at t = 1[.\d]* s"):
        simulate(_log_of_a_fall(branch), np.linspace(0, 2, 17), x0=1.0)


@pytest.mark.parametrize("as_list", [False, True])
def test_a_block_need_not_be_finite_where_all_its_inputs_are_zero(as_list: bool) -> None:
    """python-control's first pass gives zeros to blocks that the system never gives them."""

    blocks = [
        static(lambda t, x, u, p: u[0] * u[1], ["duty", "V"], ["v"], "inverter"),
        static(lambda t, x, u, p: u[0] / u[1], ["u", "V"], ["duty"], "share"),
        static(lambda t, x, u, p: 24.0 - 2.0 * np.sin(t), 0, ["V"], "supply"),
        user_block(lambda t, x, u, p: u, None, ["v"], ["y"], 1, "sum", dt=0),
    ]
    system = blocks if as_list else ct.interconnect(blocks, inputs=["u"], outputs=["y"])
    t = np.linspace(0, 2, 41)
    found = simulate(system, t, {"u": np.ones(41)} if as_list else np.ones(41))
    y = np.atleast_2d(found.outputs)[list(found.output_labels).index("y")]
    np.testing.assert_allclose(y, t, atol=1e-6)

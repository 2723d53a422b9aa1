"""What simulate() returns is used as python-control's own responses are."""

from __future__ import annotations

import control as ct
import numpy as np
import pytest

import lugrectl as lg
from lugrectl.simulation.response import simulate

from ..cases.systems import velocity_loop

pytestmark = pytest.mark.usefixtures("interpreted")

TIGHT = {"rtol": 1e-9, "atol": 1e-13}


@pytest.mark.parametrize("squeeze", [None, True, False])
@pytest.mark.parametrize("name", ["siso", "loop"])
def test_the_response_is_used_as_python_controls(name: str, squeeze: bool | None) -> None:
    """Values, unpacking, indexing, keywords of a call, pandas and plot."""
    lag = ct.ss([[-1.0]], [[1.0]], [[2.0]], [[0.0]], name="lag", inputs="u", outputs="y")
    system = lag if name == "siso" else velocity_loop(lg.plant(lg.table1()))
    t = np.arange(0, 0.008, 1e-3)
    given = np.sin(90 * t)
    ours = simulate(system, t, given, squeeze=squeeze)
    theirs = ct.input_output_response(
        system, t, given, squeeze=squeeze, solve_ivp_method="LSODA", solve_ivp_kwargs=TIGHT
    )
    _same(ours, theirs)
    _same(ours(squeeze=False, transpose=True), theirs(squeeze=False, transpose=True))
    (t1, y1), (t2, y2) = ours, theirs
    np.testing.assert_array_equal(t1, t2)
    assert y1.shape == y2.shape and len(ours(return_x=True)) == 3
    assert ours(return_x=True)[2].shape == theirs(return_x=True)[2].shape
    labels = ("output_labels", "input_labels", "state_labels", "sysname", "title")
    for key in ("ntraces", "issiso", *labels):
        assert getattr(ours, key) == getattr(theirs, key)
    label = system.output_labels[0]
    if name == "loop" or squeeze is False:
        np.testing.assert_array_equal(ours.outputs[label], ours.outputs[0])
    for one, other in zip(_lines(ours), _lines(theirs), strict=True):
        assert one.shape == other.shape
    given[:] = 7.0
    assert np.max(ours.inputs) <= 1.0


def _same(ours, theirs) -> None:
    for key in ("time", "outputs", "states", "inputs"):
        one, other = np.asarray(getattr(ours, key)), np.asarray(getattr(theirs, key))
        assert one.shape == other.shape
        np.testing.assert_allclose(one, other, rtol=0, atol=1e-5 * np.max(np.abs(other)))


def _lines(response) -> list[np.ndarray]:
    """What plot() draws."""
    plt = pytest.importorskip("matplotlib.pyplot")
    plt.switch_backend("Agg")
    drawn = response.plot()
    found = [line.get_xydata() for ax in np.ravel(drawn.axes) for line in ax.get_lines()]
    plt.close("all")
    return found


def test_the_response_as_a_table() -> None:
    pytest.importorskip("pandas")
    loop, t = velocity_loop(lg.plant(lg.table1())), np.arange(0, 0.02, 1e-3)
    ours = simulate(loop, t, np.sin(90 * t)).to_pandas()
    theirs = ct.input_output_response(loop, t, np.sin(90 * t)).to_pandas()
    assert list(ours.columns) == list(theirs.columns) and ours.shape == theirs.shape
    np.testing.assert_array_equal(ours["time"], t)

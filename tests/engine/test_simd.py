"""Several lanes computed at once, against the same lanes one after another."""

from __future__ import annotations

import numpy as np
import pytest

from lugrectl.engine import Lanes, batch_run
from lugrectl.engine.backend import has_wide
from lugrectl.engine.fixed_step import is_wide

from ..cases.own import moving
from ..cases.systems import DT, torque
from ..cases.wide import FRICTION, WIDE, plant


@pytest.fixture(autouse=True)
def wide() -> None:
    """Asked for when a test runs: it compiles."""
    if not has_wide():
        pytest.skip("this machine computes one at a time")


def ran(system, count: int, wide: bool, monkeypatch, samples: int = 60, blow_up: bool = False):
    monkeypatch.setattr(batch_run, "LEAST_WIDE", 1 if wide else count + 1)
    made = Lanes(system, backend="c")
    assert is_wide(made.program)
    random = np.random.default_rng(7)
    p = made.defaults * random.uniform(0.8, 1.2, (count, len(made.defaults)))
    if blow_up:
        p[2] = np.nan
    x0 = 1e-2 * random.standard_normal((count, len(made.states)))
    u = torque(samples + count)[:, : len(made.inputs)]
    y = 1e-2 * random.standard_normal((samples + count, len(made.outputs)))
    y[::7] = np.nan
    own = np.eye(len(made.states), len(made.outputs)) * (np.arange(len(made.outputs)) < 2)
    gain = own * random.uniform(0.02, 0.1, (count, 1, 1))
    return made.run(x0, np.arange(count), samples, u, p, dt=DT, y=y, gain=gain, substeps=3)


@pytest.mark.cases
@pytest.mark.parametrize("law", FRICTION)
@pytest.mark.parametrize("effect", WIDE)
def test_the_same_numbers_as_one_after_another(law, effect, monkeypatch) -> None:
    system = plant(law, effect)
    several, single = (ran(system, 21, wide, monkeypatch) for wide in (True, False))
    for a, b in zip(several, single, strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-9, atol=1e-9 * np.max(np.abs(b)))


@pytest.mark.parametrize("count", [1, 9])
def test_any_number_of_lanes(count, monkeypatch) -> None:
    several, single = (ran(plant("lugre"), count, wide, monkeypatch) for wide in (True, False))
    for a, b in zip(several, single, strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-9, atol=1e-12)


def test_what_no_library_has_for_several_is_run_one_by_one() -> None:
    slow = moving(lambda t, x, u, params: -np.arctan(x) + u, 1, inputs=1)
    made = Lanes(slow, backend="c")
    assert not is_wide(made.program) and made._wide is None

"""On which signals an unknown torque hangs: torques that were not recorded, put into a log."""

from dataclasses import replace

import numpy as np
import pytest

from lugrectl.tracing.hanging import dependences, depends_on
from lugrectl.tracing.job import begin
from lugrectl.tracing.proof import friction_size
from lugrectl.tracing.screening import lightened
from lugrectl.tracing.shapes import pulses, shapes
from tests.rig import make

from .test_tracing import model_of, quiet, record_of

SIZE = 0.03  # N m, a tenth of the drive's Coulomb friction


def whole_drive():
    return make("none", machine="servo", excitation="rich", seed=4101, rate=500.0, duration=20.0)


@pytest.fixture(scope="module")
def plain():
    return whole_drive()


def bump(t, theta, w):
    return SIZE * np.exp(-(((np.mod(theta, 2.0 * np.pi) - 2.0) / 0.2) ** 2))


def hump(t, theta, w):
    middle = 0.5 * np.max(np.abs(w))
    return SIZE * np.sign(w) * np.exp(-(((np.abs(w) - middle) / (0.2 * middle)) ** 2))


def slider(t, theta, w):
    """A spring dragged along that slips at its strength."""
    reach, x, made = 0.003 * np.ptp(theta), theta[0], []
    for place in theta:
        x = np.clip(x, place - reach, place + reach)
        made.append(SIZE * (place - x) / reach)
    return np.array(made)


def knocks(t, theta, w):
    times = np.array([2.3, 5.1, 6.4, 9.8, 13.7, 17.2])
    signs = np.array([1.0, -1.0, -1.0, 1.0, -1.0, 1.0])
    return 2.0 * SIZE * np.sum(signs * (np.abs(t[:, None] - times) < 0.12), axis=1)


def refitted(plain, torque):
    """The declared model refitted where this torque on the resisting side went unrecorded."""
    record = record_of(plain)
    unknown = torque(record.t, record.theta, record.w)
    return begin(replace(record, u=record.u + unknown), model_of(plain), None, 1.0, quiet).base


@pytest.mark.parametrize(
    "torque, signals",
    [(bump, ("theta",)), (hump, ("w",)), (slider, ("theta", "w")), (knocks, ())],
)
def test_the_signals_that_an_unknown_torque_hangs_on(plain, torque, signals):
    assert depends_on(refitted(plain, torque)) == signals


def test_nothing_hangs_on_anything_where_nothing_is_missing(plain):
    assert depends_on(refitted(plain, lambda t, theta, w: 0.0 * t)) == ()


def test_a_torque_not_worth_a_name_is_none(plain):
    """However sure: noise is small enough to tell three thousandths of friction."""
    record, friction = record_of(plain), friction_size(refitted(plain, bump))
    small = 0.003 * friction / np.std(bump(record.t, record.theta, record.w))
    assert depends_on(refitted(plain, lambda *log: small * bump(*log))) == ()


def test_functions_add_up_to_one_and_are_made_where_asked(plain):
    log = lightened(refitted(plain, bump)).predictor.data.log
    rows = np.arange(100, 4000)
    made = shapes(log, rows, np.arange(50, 3000), log.a[rows])
    assert {shape.signals for shape in made} >= {("theta",), ("w",), ("u",), ("a",), ("t",)}
    assert [len(shape.signals) for shape in made] == sorted(len(s.signals) for s in made)
    for shape in made:
        assert shape.B.shape[0] == len(rows) and np.all(np.isfinite(shape.B))
        if np.all(shape.B >= 0.0):
            assert np.allclose(shape.B.sum(axis=1), 1.0)
    assert sum(bool(np.any(shape.B < 0.0)) for shape in made) == 4  # times w, u or a
    assert np.allclose(pulses(500, 2e-3).sum(axis=1), 1.0)


def test_the_function_of_the_right_signal_explains_most(plain):
    found = dependences(lightened(refitted(plain, hump)))
    best = max(found, key=lambda d: d.share)
    assert best.signals == ("w",) and best.share > 0.9 and best.t > 4.0
    assert all(d.share < 0.5 for d in found if "w" not in d.signals)

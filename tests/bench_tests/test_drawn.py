"""The generator against closed forms: nothing of the package is asked here."""

import ast
from pathlib import Path

import numpy as np
import pytest

from .drawn import KINDS, draw, hold, own_fit
from .machine import Machine, simulate
from .sensors import difference, stale


def coasting_machine(**more) -> Machine:
    return Machine(**{"J": 1e-3, "Fc": 0.02, "Fs": 0.02, "Fv": 4e-4, "vs": 0.1} | more)


def test_a_coast_down_has_the_exact_speed_and_instant_of_rest():
    m, dt, w0 = coasting_machine(), 1e-3, 50.0
    _, theta, w = simulate(m, hold(0.0, 2000), dt, w=w0)
    t, k, c = dt * np.arange(len(w)), m.Fv / m.J, m.Fc / m.J
    rest = np.log1p(k * w0 / c) / k
    exact = np.where(t < rest, (w0 + c / k) * np.exp(-k * t) - c / k, 0.0)
    np.testing.assert_allclose(w, exact, atol=1e-8)
    assert theta[-1] == pytest.approx((w0 - c * rest) / k, rel=1e-9)


def test_the_axis_holds_until_the_torque_exceeds_Fs_and_then_falls_to_Fc():
    m, dt = coasting_machine(Fs=0.03, Fv=0.0, vs=1e-3), 1e-3
    u, _, w = simulate(m, iter_program(np.arange(50) * 1e-3 + 2e-5), dt)
    first = np.flatnonzero(w)[0]
    assert u[first - 1] > m.Fs >= u[first - 2]
    assert np.diff(w)[first + 1] / dt == pytest.approx((u[first + 1] - m.Fc) / m.J, rel=1e-3)


def iter_program(torques):
    for u in torques:
        yield float(u)


def test_a_swing_loses_the_work_of_friction_from_turn_to_turn():
    A, Fc = 1.0, 0.03
    m = Machine(J=0.05, Fc=Fc, Fs=Fc, Fv=0.0, vs=0.1, waves=((1.0, A, 0.0),))
    _, theta, w = simulate(m, hold(0.0, 60000), 1e-3, theta=1.2)
    turns = theta[np.flatnonzero(np.diff(np.sign(w)))]
    turns = np.concatenate([[1.2], turns[np.abs(turns) > Fc / A]])
    lost = A * (np.cos(turns[1:]) - np.cos(turns[:-1]))
    np.testing.assert_allclose(lost, Fc * np.abs(np.diff(turns)), rtol=2e-4)
    assert w[-1] == 0.0 and A * abs(np.sin(theta[-1])) <= Fc


def test_smaller_steps_change_nothing():
    m = coasting_machine(Fs=0.03, waves=((6.0, 0.004, 0.3),))
    torques = np.repeat([0.06, 0.0, -0.06, 0.0], 300)
    _, coarse, _ = simulate(m, iter_program(torques), 1e-3)
    _, fine, _ = simulate(m, iter_program(np.repeat(torques, 10)), 1e-4)
    np.testing.assert_allclose(coarse, fine[::10], atol=2e-5)


def test_a_stale_speed_waits_for_edges_and_a_difference_looks_back():
    theta = 0.1 * np.array([0, 0, 1, 1, 1, 2, 2, 2, 4, 4, 4])
    waiting = stale(theta, 10.0)
    np.testing.assert_allclose(waiting, [0] * 5 + [1 / 3] * 3 + [2 / 3] * 3)
    looking = difference(theta, 2, 10.0)
    np.testing.assert_allclose(looking[-3:], [1.0, 1.0, 0.0])


@pytest.mark.parametrize("kind", KINDS)
def test_each_record_is_answered_by_its_own_fit_and_drawn_alike_again(kind):
    drawn, again = draw(kind, 5), draw(kind, 5)
    for run, same in zip(drawn.runs, again.runs, strict=True):
        assert all(np.array_equal(run[name], same[name]) for name in run)
        assert {"t", "u", "theta"} <= set(run) and len({len(x) for x in run.values()}) == 1
    found = own_fit(drawn)
    assert drawn.truth
    assert all(found[name] == pytest.approx(v, rel=0.03) for name, v in drawn.truth.items())


def test_a_third_has_a_poor_speed_and_all_drives_come():
    some = [draw("steps_and_pulses", seed) for seed in range(1, 10)]
    poor = [d for d in some if d.sensors.speed in ("stale", "missing")]
    assert len(poor) == 3 and {d.size for d in some} == {"small", "medium", "large"}
    assert all(("w" in d.columns) == (d.sensors.speed != "missing") for d in some)


def test_the_generator_shares_nothing_with_the_package():
    for file in ("drawn", "machine", "own_fit", "sensors"):
        tree = ast.parse((Path(__file__).parent / f"{file}.py").read_text(encoding="utf-8"))
        imports = {n.module for n in ast.walk(tree) if isinstance(n, ast.ImportFrom)}
        names = {a.name for n in ast.walk(tree) if isinstance(n, ast.Import) for a in n.names}
        assert not any("lugrectl" in str(name) for name in imports | names)

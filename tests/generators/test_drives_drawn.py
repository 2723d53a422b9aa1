"""The drawn drives keep their promises: physics, truth, and the same log for the same seed."""

import ast
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

pytest.importorskip("numba")

from tests.drives_drawn import DAMAGES, damage, dips, draw, drawn
from tests.drives_drawn.score import compare, table
from tests.drives_drawn.simulate import Loop, Machine, simulate

SEEDS = [("clean", 3), ("messy", 4), ("dip", 8)]
LUGRE = Machine("lugre", J=0.002, Fc=0.2, Fv=0.01, Fs=0.3, vs=0.2, stiffness=60.0, damping=0.3)


def held(speeds, seconds=1.0, dt=1e-3, machine=LUGRE):
    """A machine whose controller holds each of the speeds for so many seconds."""
    w = np.repeat(speeds, int(seconds / dt))
    kp = 60.0 * machine.J
    loop = Loop("speed", w, w * 0, w * 0, kp, kp * 20.0 * dt)
    return simulate(machine, loop, len(w), dt)


@pytest.mark.parametrize("kind, seed", SEEDS)
def test_momentum_and_energy_balance_in_every_row(kind, seed):
    drive, motion, _ = drawn(seed, kind)
    torque, friction, load = motion.impulses[1:].T
    gained = drive.machine.J * np.diff(motion.w)
    size = drive.machine.J * drive.top
    assert abs(gained - torque + friction + load).max() < 1e-9 * size
    torque, friction, load = motion.work[1:].T
    gained = drive.machine.J * np.diff(motion.w**2) / 2
    assert abs(gained - torque + friction + load).max() < 1e-9 * size * drive.top


@pytest.mark.parametrize("kind, seed", SEEDS)
def test_the_motion_does_not_depend_on_the_step(kind, seed):
    drive, motion, _ = drawn(seed, kind)
    finer = drive.run(step=1e-5)
    assert np.sqrt(np.mean((finer.w - motion.w) ** 2)) < 1e-4 * drive.top
    assert np.std(finer.command - motion.command) < 1e-3 * np.std(motion.command)


def test_the_motion_is_that_of_an_independent_integration():
    dt, rows = 1e-3, 800
    torque = 0.5 * np.sin(2 * np.pi * 3 * np.arange(rows) * dt)
    motion = simulate(LUGRE, Loop("torque", torque * 0, torque * 0, torque), rows, dt, 100)

    def rates(t, x):
        theta, w, z = x
        g = 0.2 + 0.1 * np.exp(-((w / 0.2) ** 2))
        dz = w - 60.0 * abs(w) / g * z
        slope = max(1 - 60.0 * z * np.sign(w) / g, 0) * np.exp(-((w / 0.2) ** 2))
        friction = 60.0 * z + 0.3 * slope * w + 0.01 * w
        return [w, (torque[min(int(t / dt + 1e-9), rows - 1)] - friction) / 0.002, dz]

    how = {"t_eval": motion.t, "max_step": dt / 2, "rtol": 1e-7, "atol": 1e-10}
    other = solve_ivp(rates, (0, motion.t[-1]), [0, 0, 0], method="LSODA", **how)
    assert abs(other.y[1] - motion.w).max() < 2e-3 * abs(motion.w).max()
    assert abs(motion.w).max() > 5.0


@pytest.mark.parametrize("law", ["lugre", "maxwell"])
def test_steady_speeds_lie_on_the_friction_curve(law):
    speeds = np.array([3.0, 8.0, -2.0, -9.0])
    motion = held(speeds, machine=replace(LUGRE, law=law, constant=0.05, asymmetry=0.01))
    ends = motion.command.reshape(4, -1)[:, -50:].mean(axis=1)
    coulomb = np.sign(speeds) * 0.2 * (1 + 0.005 * np.sign(speeds))
    assert ends == pytest.approx(coulomb + 0.01 * speeds + 0.05, rel=1e-4)


def test_slow_speeds_lie_in_the_dip():
    motion = held([10.0, 1.0], machine=replace(LUGRE, vs=2.0))
    at = motion.command.reshape(2, -1)[:, -50:].mean(axis=1)
    assert at[1] == pytest.approx(0.2 + 0.1 * np.exp(-0.25) + 0.01, rel=1e-3)


@pytest.mark.parametrize("kind, seed", SEEDS)
def test_a_seed_is_one_log_and_one_truth(kind, seed):
    (log, truth), (again, same) = draw(seed, kind), draw(seed, kind)
    assert truth == same and list(log) == list(again)
    assert all(np.array_equal(log[k], again[k]) for k in log)
    other, _ = draw(seed + 1, kind)
    assert len(other["t"]) != len(log["t"]) or not np.array_equal(other["u"], log["u"])


def test_logs_are_what_was_promised():
    for seed in range(3):
        for kind in ("clean", "messy"):
            log, truth = draw(seed, kind)
            assert {"t", "u"} < set(log) and {"theta", "w"} & set(log)
            assert 19.9 < log["t"][-1] < 40.1 and 200 <= 1 / log["t"][1] <= 1001
            assert all(np.isfinite(v).all() and len(v) == len(log["t"]) for v in log.values())
            assert ("Fc" in truth) == (truth["about"]["machine"]["power"] == 1.0)


def test_least_squares_on_the_true_motion_give_the_true_inertia():
    drive, motion, _ = drawn(3, "clean")
    rows = [np.diff(motion.w), motion.impulses[1:, 1] + motion.impulses[1:, 2]]
    J, share = np.linalg.lstsq(np.column_stack(rows), motion.impulses[1:, 0], rcond=None)[0]
    assert J == pytest.approx(drive.machine.J, rel=1e-9) and share == pytest.approx(1.0)


def test_dips_cover_what_they_should():
    truths = [truth for _, truth in dips(5)]
    ratio = np.array([t["Fs"] / t["Fc"] for t in truths])
    speed = np.array([t["vs"] / t["about"]["top"] for t in truths])
    assert ratio.min() > 1.05 and ratio.max() < 2.0 and np.ptp(ratio) > 0.5
    assert speed.max() / speed.min() > 10.0


@pytest.mark.parametrize("kind", DAMAGES)
def test_a_damage_changes_a_copy(kind):
    t = np.arange(4000) / 200
    rng = np.random.default_rng(1)
    log = {"t": t, "u": rng.normal(size=4000), "theta": 9 * np.sin(t), "w": 9 * np.cos(t)}
    before = {k: v.copy() for k, v in log.items()}
    hurt, again = damage(log, kind, 5), damage(log, kind, 5)
    assert all(np.array_equal(log[k], before[k]) for k in log)
    assert all(np.array_equal(hurt[k], again[k], equal_nan=True) for k in log)
    assert len({len(v) for v in hurt.values()}) == 1
    assert not all(np.array_equal(hurt[k], log[k]) for k in log)


def test_the_table_counts_what_is_inside():
    truth = {"J": 2.0, "Fc": 1.0, "about": {}}
    rows = [
        {
            "seed": 1,
            "cpu": 0.1,
            "crash": None,
            "values": compare({"J": (v, v - 0.1, v + 0.1)}, truth),
        }
        for v in (2.05, 2.2)
    ]
    assert [r["values"]["J"]["inside"] for r in rows] == [True, False]
    line = next(x for x in table(rows).splitlines() if x.startswith("J"))
    assert line.split()[1:4] == ["2", "2", "50.0%"]


def test_nothing_of_the_generator_uses_the_package():
    for path in (Path(__file__).parents[1] / "drives_drawn").glob("*.py"):
        if path.name == "answers.py":  # it asks the package for the answer
            continue
        for node in ast.walk(ast.parse(path.read_text())):
            names = [a.name for a in node.names] if isinstance(node, ast.Import) else []
            names += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            assert not any(name.startswith("lugrectl") for name in names), path

"""Drives drawn by seed: a machine of any size, a task, sensors; the log, and the truth of it.

Sizes follow from four numbers: J, the speed ``top`` (rad/s), the pace of the task (Hz), and
friction in shares of J top 2 pi pace, the torque that turns the machine round at that pace.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass

import numpy as np

from . import references
from .sensors import Sensors, log
from .simulate import Loop, Machine, Motion, simulate

KINDS = ("clean", "messy", "dip", "eccentric")  # the last: messy, an encoder ten times worse
RATES = (200.0, 250.0, 333.0, 500.0, 800.0, 1000.0)
STEP = 3e-5  # s, at most, of the integration


@dataclass
class Drive:
    """All that was drawn."""

    machine: Machine
    loop: Loop
    sensors: Sensors
    rows: int
    dt: float  # s
    updates: int  # of the controller, in a row
    delay: float  # s, from the command to the torque
    task: str
    top: float  # rad/s
    closed: float  # rad/s, bandwidth of the speed loop

    def run(self, step: float = STEP) -> Motion:
        steps = int(np.ceil(self.dt / step))
        how = (self.rows, self.dt, steps, self.updates, self.delay, self.sensors.lag)
        return simulate(self.machine, self.loop, *how)


def draw(seed: int, kind: str = "clean") -> tuple[dict, dict]:
    """A log {t, u, theta and/or w} and its truth, the same for the same seed and kind.

    The truth has J, Fc (mean over time and both directions), Fv, constant_torque, and the amplitude
    and phase of gravity, G sin(theta + phase), where they exist: a machine with grease has no Fc
    and Fv, one that is only out of balance has no gravity. ``delay`` (s) is from the log of the
    torque to the torque, the hold included (positive: the torque acts later), ``u_delay`` the same
    beyond half a row. ``about`` holds everything that was drawn, as plain values.
    """
    drive, motion, rng = drawn(seed, kind)
    return log(motion, drive.sensors, rng), truth(drive, motion, kind)


def drawn(seed: int, kind: str = "clean"):
    """The drive of a seed, its motion, and the generator of the noise of its log."""
    like = "messy" if kind == "eccentric" else kind
    for attempt in range(20):
        rng = np.random.default_rng([seed, KINDS.index(like), attempt])
        drive = _drive(rng, like, seed)
        drive.sensors.eccentricity *= 10.0 if kind == "eccentric" else 1.0
        motion = drive.run()
        if _moves(motion, drive.top):
            return drive, motion, rng
    raise RuntimeError(f"seed {seed} of kind {kind}: no drive of 20 moves to both sides")


def truth(drive: Drive, motion: Motion, kind: str = "clean") -> dict:
    """What a right answer of the log of this drive says."""
    m = drive.machine
    level = 1.0 + m.warming * np.mean(np.exp(-motion.t / m.warms_in))
    out = {"J": m.J}
    if m.power == 1.0:
        out |= {"Fc": m.Fc * level, "Fv": m.Fv}
    out["constant_torque"] = m.constant + 0.5 * m.Fc * level * m.asymmetry
    if abs(m.gravity) > 0.1 * m.Fc and drive.sensors.counts:  # less is an imperfection
        out |= {"gravity.amplitude": m.gravity, "gravity.phase": m.phase}
    held = -0.5 * drive.dt if drive.sensors.averaged else 0.5 * drive.dt / drive.updates
    seen = 0.0 if drive.sensors.counts else drive.sensors.lag  # the motion itself comes late
    out["delay"] = drive.delay + held + seen
    out["u_delay"] = out["delay"] - 0.5 * drive.dt
    if kind == "dip":
        out |= {"Fs": m.Fs, "vs": m.vs, "bend": m.bend}
        out["rows_in_dip"] = int(np.sum((abs(motion.w) > 0.2 * m.vs) & (abs(motion.w) < 2 * m.vs)))
    plain = {k: v for k, v in asdict(drive).items() if k != "loop"}
    return out | {"about": plain | {"loop": drive.loop.kind}}


def dips(count: int = 60, first: int = 0) -> list[tuple[dict, dict]]:
    """Drives whose friction dips: Fs / Fc from 1.05 to 2, vs over two decades, evenly spread.

    A test set for start values: the truth has Fs and vs beside the rest, and ``rows_in_dip``, how
    many rows of the log are at 0.2 to 2 vs. Their tasks are slow at times.
    """
    return [draw(seed, "dip") for seed in range(first, first + count)]


def _moves(motion, top):
    w = motion.w
    sides = min(np.mean(w > 0.1 * top), np.mean(w < -0.1 * top))
    return bool(np.isfinite(w).all() and sides > 0.1 and abs(w).max() < 20 * top)


def _between(rng, low, high):
    """Evenly spread in the logarithm."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def _drive(rng, kind, seed):
    dt = 1.0 / rng.choice(RATES)
    rows = int(rng.uniform(20.0, 40.0) / dt) + 1
    J = _between(rng, 2e-5, 2e-2)
    top = _between(rng, 4.0, 80.0) * (J / 6e-4) ** -0.2
    pace = _between(rng, 0.25, 1.5)
    turning = J * top * 2 * np.pi * pace
    machine = _machine(rng, J, top, pace, turning)
    tasks = references.REFERENCES + (("torque",) if kind != "dip" else ())
    task = str(rng.choice(tasks))
    sensors = _sensors(rng, kind, dt, top)
    if task == "torque" or not sensors.counts:
        machine.gravity = 0.0
    if kind == "messy":
        _mess(rng, machine, sensors)
    if kind == "dip":
        _dip(machine, seed, top)
    updates, delay = int(rng.choice([1, 1, 2, 4])), 0.0
    if kind != "messy" and not sensors.averaged:
        updates = 1  # single values of a faster torque hide part of it: that is no clean log
    closed = 2 * np.pi * min(rng.uniform(3.0, 12.0), 0.04 * updates / dt)
    if kind == "messy" and rng.random() < 0.4:
        delay = min(rng.uniform(0.3, 2.0) * dt, 0.25 / closed)
    t = np.arange(rows * updates + 1) * (dt / updates)
    slow = references.slower_at_times(t, pace) if kind == "dip" else 1.0
    loop = _loop(rng, task, t, machine, top, pace, turning, closed, slow)
    return Drive(machine, loop, sensors, rows, dt, updates, delay, task, top, closed)


def _machine(rng, J, top, pace, turning):
    """Sound mechanics; what kind of friction, how much, and how stiff at rest."""
    Fc = turning * _between(rng, 0.2, 1.5)
    law = str(rng.choice(["lugre", "maxwell", "stribeck", "stribeck"]))
    grease = rng.random() < 0.15
    power = 0.8 if grease else 1.0
    Fv = Fc * _between(rng, 0.1, 1.0) / top**power
    give = top / (2 * np.pi * pace) * _between(rng, 3e-4, 4e-3)  # rad, before it slides
    if law == "stribeck":
        give *= 0.2
    stiffness = max(Fc / give, 1e-12)
    stiffness = min(stiffness, J * (2 * np.pi * 300.0) ** 2)
    damping = rng.uniform(0.3, 1.0) * 2 * np.sqrt(stiffness * J)
    m = Machine("maxwell" if law == "maxwell" else "lugre", J, Fc, Fv, power, Fc)
    m.stiffness, m.damping = stiffness, damping
    m.vs = top * _between(rng, 2e-3, 3e-2 if law == "lugre" else 1e-1)
    if law != "maxwell":
        m.Fs = Fc * rng.uniform(1.0, 1.3 if law == "lugre" else 1.6)
        m.bend = float(rng.choice([1.0, 2.0])) if law == "stribeck" else 2.0
    if rng.random() < 0.5:
        m.constant = Fc * rng.uniform(-0.4, 0.4)
    if rng.random() < 0.3:
        m.gravity, m.phase = Fc * rng.uniform(0.3, 2.0), rng.uniform(-np.pi, np.pi)
    return m


def _sensors(rng, kind, dt, top):
    if kind != "messy":
        speed = str(rng.choice(["filtered", "none"]))
        counts = int(_between(rng, 5e4, 1e6))
        lag, noise = _between(rng, 1e-4, 1e-3), top * _between(rng, 1e-5, 1e-4)
    else:
        speed = str(rng.choice(["filtered", "filtered", "ticks", "none"]))
        counts = int(_between(rng, 2e3, 1e6))
        lag, noise = _between(rng, 2e-4, 5e-3), top * _between(rng, 1e-4, 3e-3)
    if speed == "filtered" and rng.random() < 0.15:
        counts, lag = 0, min(lag, 5e-4)
    u_noise = float(rng.choice([0.0, 0.001, 0.003, 0.01]))
    return Sensors(counts, speed, lag, noise, bool(rng.random() < 0.4), u_noise)


def _mess(rng, machine, sensors):
    """A per cent, at most, of each thing that real machines have; of a radian a per mille."""
    size = 0.01 * rng.uniform(0.3, 1.0, 5)
    machine.cogging, machine.teeth = size[0] * machine.Fc, float(rng.integers(3, 25))
    if not machine.gravity:
        machine.gravity, machine.phase = size[1] * machine.Fc, rng.uniform(-np.pi, np.pi)
    machine.asymmetry = size[2] * rng.choice([-1.0, 1.0])
    machine.warming, machine.warms_in = size[3], rng.uniform(5.0, 30.0)
    sensors.eccentricity, sensors.turned = 0.1 * size[4], rng.uniform(0, 2 * np.pi)


def _dip(machine, seed, top):
    """Fs / Fc and vs of this seed on an even lattice, and what would blur them left out."""
    machine.law, machine.bend = "lugre", 1.0 + seed % 2
    machine.power = 1.0
    machine.Fs = machine.Fc * (1.05 + 0.95 * ((0.5 + seed * 0.754877666) % 1))
    machine.vs = top * 10 ** (-2.5 + 2.0 * ((0.5 + seed * 0.569840291) % 1))


def _loop(rng, task, t, machine, top, pace, turning, closed, slow):
    limit = 4.0 * (turning + machine.Fc + machine.gravity) + abs(machine.constant)
    still = np.zeros(len(t))
    if task == "torque":
        size = machine.Fc * rng.uniform(1.3, 2.0) + turning * rng.uniform(0.5, 1.0)
        u = machine.constant + references.torque(t, size, 2 * pace, rng)
        return Loop("torque", still, still, u)
    w = slow * references.speed(task, t, top, pace, rng)
    theta = np.cumsum(w) * (t[1] - t[0])
    kp = machine.J * closed
    kind = str(rng.choice(["speed", "position"]))
    return Loop(kind, w, theta, still, kp, kp * closed * 0.2 * t[1], 0.2 * closed, limit)

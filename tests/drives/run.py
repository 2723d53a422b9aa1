"""One run of a machine on its drive: tuning, table of effects, call of the compiled core."""

from __future__ import annotations

import math
from collections.abc import Generator
from dataclasses import dataclass, field

import numpy as np

from .machines import CONSTANT_LOAD, GRAVITY_LOAD, Machine
from .plant import (
    ACC,
    CODE,
    EFFECTS,
    OPEN_LOOP,
    OUT,
    STATES,
    TH,
    THL,
    WIDTH,
    WL,
    W,
    Z,
    advance,
    run,
)

Program = Generator[float, tuple[float, float], None]
Table = dict[str, tuple[float, ...]]  # effect name -> row of the effect table
FINE = 20e-6  # s
STIFF = 0.1  # sigma0 FINE^2 / J of bristles that stand for a static friction law: 2.5 kHz
SEEN = {"theta_true": TH, "w_true": W, "z": Z, "th_load": THL, "w_load": WL, "a_true": ACC}


@dataclass(frozen=True)
class Setup:
    """Everything of a record but the hidden effect."""

    machine: Machine
    loop: int
    refs: np.ndarray
    noise: np.ndarray
    rate: float
    quantum: float
    theta0: float
    drive: np.ndarray = field(repr=False)
    step: float = FINE
    jitter: float = 0.0  # of the sampling period, either way

    @property
    def stamps(self) -> np.ndarray:
        """Times of the samples, and the end of the last one."""
        k = np.arange(self.refs.shape[1] + 1)
        if not self.jitter:
            return k / self.rate
        off = np.random.default_rng(k[-1]).uniform(-self.jitter, self.jitter, len(k))
        off[[0, -1]] = 0.0
        return (k + off) / self.rate

    @property
    def fine_steps(self) -> int:
        return int(np.ceil(1.0 / (self.rate * self.step) - 1e-9))


@dataclass(frozen=True)
class Run:
    """Signals per sample (`plant.OUT` and `SEEN`) and RMS of friction and effect torque."""

    t: np.ndarray
    signals: dict[str, np.ndarray]
    friction_rms: float
    effect_rms: float
    setup: Setup = field(repr=False)
    machine: Machine = field(repr=False)
    table: Table = field(repr=False)


def machine_row(m: Machine) -> np.ndarray:
    twin = m.Fs if m.Fs_twin < 0.0 else m.Fs_twin
    values = (m.J, m.sigma0, m.sigma1, m.Fc, m.Fs, m.Fv, m.vs, *m.load, twin, m.twin_static)
    return np.array([*values, m.static], dtype=float)


def holding_torque(m: Machine, theta: float) -> float:
    kind, size, phase = m.load
    if kind == GRAVITY_LOAD:
        return size * float(np.sin(theta + phase))
    return size if kind == CONSTANT_LOAD else 0.0


def tune(m: Machine, loop: int, rate: float, rng, late: bool, no_tacho: bool) -> tuple[float, ...]:
    """Gains from the inertia: crossover of the speed loop in rad/s, well below the rate."""
    top = min(rng.uniform(50.0, 110.0), 0.2 * rate)
    if late or no_tacho:
        top = min(rng.uniform(30.0, 50.0), 0.12 * rate)
    kp = m.J * top
    ki = kp * top * rng.uniform(0.12, 0.3)
    kpp = top * rng.uniform(0.15, 0.3)
    hold = 0.0 if loop == OPEN_LOOP else 1.0
    smoothing = 1.0 - np.exp(-6.0 * top / rate)
    limits = m.torque_peak, m.integral_peak
    return float(loop), kp, ki, kpp, *limits, hold, smoothing, float(no_tacho)


def drive_row(m: Machine, gains: tuple[float, ...], quantum: float, theta0: float) -> np.ndarray:
    row = np.array([*gains, quantum])
    row[6] *= holding_torque(m, theta0)
    return row


def _effects(table: Table) -> tuple[np.ndarray, np.ndarray]:
    on = np.zeros(len(EFFECTS), dtype=bool)
    rows = np.zeros((len(EFFECTS), WIDTH))
    for name, values in table.items():
        on[CODE[name]] = True
        rows[CODE[name], : len(values)] = values
    return on, rows


def simulate(setup: Setup, table: Table, machine: Machine | None = None) -> Run:
    """Run the record with the effects of the table; `machine` replaces the set-up's."""
    machine = machine or setup.machine
    out, states, friction, effect = run(
        machine_row(machine),
        setup.drive,
        *_effects(table),
        setup.refs,
        setup.noise,
        setup.stamps,
        setup.fine_steps,
        setup.theta0,
    )
    signals = dict(zip(OUT, out, strict=True)) | {k: states[i] for k, i in SEEN.items()}
    rms = float(np.sqrt(friction)), float(np.sqrt(effect))
    return Run(setup.stamps[:-1], signals, *rms, setup, machine, table)


def programmed(machine: Machine, program: Program, dt: float, start=(0.0, 0.0), table=None):
    """(u, theta, w) at the samples, of torques that a program chooses as it sees the motion.

    It yields the torque of a sample, is sent (theta, w) at its end, and ends the run.
    """
    m, (on, rows), n = machine_row(machine), _effects(table or {}), math.ceil(dt / FINE)
    x, seen = np.zeros(STATES), []
    x[TH], x[W] = start
    x[THL], x[WL] = start
    u = next(program)
    while True:
        seen.append((u, x[TH], x[W]))
        advance(x, len(seen) * dt - dt, u, dt, n, m, on, rows)
        try:
            u = program.send((x[TH], x[W]))
        except StopIteration:
            return np.array(seen).T


def open_loop(machine: Machine, torque, rate=1000.0, theta0=0.0, step=FINE) -> Setup:
    """Set-up that applies this torque, without noise or quantisation."""
    refs = np.zeros((3, len(torque)))
    refs[2] = torque
    gains = tune(machine, OPEN_LOOP, rate, np.random.default_rng(0), False, False)
    drive = drive_row(machine, gains, 0.0, theta0)
    noise = np.zeros((1, len(torque)))
    return Setup(machine, OPEN_LOOP, refs, noise, rate, 0.0, theta0, drive, step)


def wave(m: Machine, seconds: float, rate: float, peak: float = 2.5):
    """Times and torques that break away, reverse, stick and creep."""
    t = np.arange(int(seconds * rate)) / rate
    return t, peak * m.Fs * np.sin(2 * np.pi * t / seconds * 1.7) * np.abs(np.cos(9.0 * t))

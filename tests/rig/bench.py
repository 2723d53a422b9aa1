"""One run of a machine on its drive: tuning, table of effects, call of the compiled core."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from .machines import CONSTANT_LOAD, GRAVITY_LOAD, Machine
from .plant import CODE, EFFECTS, OPEN_LOOP, OUT, WIDTH, run

Table = dict[str, tuple[float, ...]]  # effect name -> row of the effect table
FINE = 20e-6


@dataclass(frozen=True)
class Run:
    """Signals per sample (see `plant.OUT`) and RMS of friction and effect torque."""

    t: np.ndarray
    signals: dict[str, np.ndarray]
    friction_rms: float
    effect_rms: float


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

    @property
    def fine_steps(self) -> int:
        return int(np.ceil(1.0 / (self.rate * self.step) - 1e-9))


def machine_row(m: Machine) -> np.ndarray:
    twin = m.Fs if m.Fs_twin < 0.0 else m.Fs_twin
    values = (m.J, m.sigma0, m.sigma1, m.Fc, m.Fs, m.Fv, m.vs, *m.load, twin, m.twin_static)
    return np.array(values, dtype=float)


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


def simulate(setup: Setup, table: Table, machine: Machine | None = None) -> Run:
    """Run the record with the effects of the table; `machine` replaces the set-up's."""
    on = np.zeros(len(EFFECTS), dtype=bool)
    rows = np.zeros((len(EFFECTS), WIDTH))
    for name, values in table.items():
        on[CODE[name]] = True
        rows[CODE[name], : len(values)] = values
    period = 1.0 / setup.rate
    out, friction, effect = run(
        machine_row(machine or setup.machine),
        setup.drive,
        on,
        rows,
        setup.refs,
        setup.noise,
        period,
        setup.fine_steps,
        setup.theta0,
    )
    t = np.arange(out.shape[1]) * period
    signals: dict[str, np.ndarray] = dict(zip(OUT, out, strict=True))
    return Run(t, signals, float(np.sqrt(friction)), float(np.sqrt(effect)))

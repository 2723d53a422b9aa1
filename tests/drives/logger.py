"""What the logger writes of a run: sensors, lost samples, and what differs in further runs."""

from __future__ import annotations

import zlib
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from .machines import GRAVITY_LOAD, NO_LOAD, Machine
from .plant import OPEN_LOOP, POSITION_LOOP
from .run import Run, Table, holding_torque

Columns = dict[str, np.ndarray]
AMBIENT, WARMING = 24.0, 18.0  # degrees


def stream(seed: int, purpose: str) -> np.random.Generator:
    return np.random.default_rng([seed, zlib.crc32(purpose.encode())])


def _temperature(run: Run, rng: np.random.Generator) -> np.ndarray:
    """Follows the warming of the friction; a machine without one warms a little all the same."""
    size, tau = WARMING, run.t[-1] * float(rng.uniform(0.2, 0.6))
    if "thermal_drift" in run.table:
        tau = run.table["thermal_drift"][1]
    else:
        size *= 0.2
    warm = AMBIENT + size * (1.0 - np.exp(-run.t / tau))
    return np.round(warm + rng.normal(0.0, 0.03, len(warm)), 1)


def _load(run: Run, rng: np.random.Generator) -> np.ndarray:
    m = run.machine
    torque = np.array([holding_torque(m, angle) for angle in run.signals["theta_true"]])
    return torque + rng.normal(0.0, 0.003 * m.load_peak, len(torque))


def _second_encoder(run: Run, rng: np.random.Generator) -> np.ndarray:
    behind = {"elastic_coupling", "backlash"} & set(run.table)
    theta = run.signals["th_load" if behind else "theta_true"]
    q = run.setup.quantum
    return q * np.floor(theta / q + 0.5) if q > 0.0 else theta.copy()


def _reference(run: Run, rng: np.random.Generator) -> np.ndarray:
    speed, place, _ = run.setup.refs
    return run.signals["theta"][0] + place if run.setup.loop == POSITION_LOOP else speed.copy()


CHANNELS: dict[str, Callable[[Run, np.random.Generator], np.ndarray]] = {
    "temperature": _temperature,
    "d": _load,
    "theta_load": _second_encoder,
    "r": _reference,
}


def carries(channel: str, machine: Machine, loop: int) -> bool:
    """Whether this machine has something to show on the channel."""
    if channel == "d":
        return machine.load[0] != NO_LOAD
    return channel != "r" or loop != OPEN_LOOP


def lose(columns: Columns, share: float, rng: np.random.Generator) -> Columns:
    """Without this share of the samples, lost singly, and without one longer stretch."""
    n = len(columns["t"])
    keep = np.ones(n, dtype=bool)
    keep[rng.choice(np.arange(3, n - 3), int(share * n), replace=False)] = False
    start = int(rng.uniform(0.3, 0.7) * n)
    keep[start : start + int(rng.integers(6, 40))] = False
    return {name: values[keep] for name, values in columns.items()}


@dataclass(frozen=True)
class Logger:
    """What is recorded, and how well."""

    position_only: bool = False
    torque_noise: float = 0.0
    channels: tuple[str, ...] = ()
    dropped: float = 0.0

    def columns(self, run: Run, seed: int, again: str = "") -> Columns:
        """The columns of a run; `again` tells the noise of further runs apart."""
        s, n = run.signals, len(run.t)
        noise = self.torque_noise * stream(seed, "torque" + again).normal(size=n)
        columns = {"t": run.t, "u": s["u"] + noise, "theta": s["theta"]}
        if not self.position_only:
            columns["w"] = s["w"]
        for name in self.channels:
            columns[name] = CHANNELS[name](run, stream(seed, f"channel {name}{again}"))
        if not self.dropped:
            return columns
        return lose(columns, self.dropped, stream(seed, "dropped" + again))


NUISANCES = ("offset", "phase", "temperature")
ABSOLUTE = {  # effects whose position counts from a fixed place
    *("gravity", "return_spring", "hard_stop", "encoder_eccentricity"),
    *("pose_dependent_inertia", "torque_bumps"),
}


@dataclass(frozen=True)
class Nuisance:
    """Offset of the recorded torque, of the encoder's zero, factor on the friction."""

    offset: float = 0.0
    zero: float = 0.0
    friction: float = 1.0
    turn: float = 0.0  # of a disturbance in time, rad


def nuisance(m: Machine, table: Table, kinds: tuple[str, ...], rng) -> Nuisance:
    """What another run of this machine brings with it."""
    offset, zero = rng.normal(0.0, 0.03) * m.Fc, rng.uniform(-np.pi, np.pi)
    friction, turn = rng.uniform(0.95, 1.05), rng.uniform(-np.pi, np.pi)
    fixed = ABSOLUTE & set(table) or m.load[0] == GRAVITY_LOAD or not m.rotary
    return Nuisance(
        float(offset) if "offset" in kinds else 0.0,
        float(zero) if "phase" in kinds and not fixed else 0.0,
        float(friction) if "temperature" in kinds else 1.0,
        float(turn) if "phase" in kinds else 0.0,
    )


def warmed(m: Machine, factor: float) -> Machine:
    twin = m.Fs_twin * factor if m.Fs_twin >= 0.0 else m.Fs_twin
    return replace(m, Fc=m.Fc * factor, Fs=m.Fs * factor, Fv=m.Fv * factor, Fs_twin=twin)


def turned(table: Table, turn: float) -> Table:
    """Disturbances in time are at another phase in each run."""
    if "periodic_disturbance" not in table:
        return table
    amplitude, frequency, phase = table["periodic_disturbance"]
    phase = float(np.pi - (np.pi - phase - turn) % (2.0 * np.pi))
    return table | {"periodic_disturbance": (amplitude, frequency, phase)}

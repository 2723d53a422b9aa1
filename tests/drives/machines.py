"""Machines of several sizes; each seed gives another specimen of a size."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

NO_LOAD, GRAVITY_LOAD, CONSTANT_LOAD = 0, 1, 2


@dataclass(frozen=True)
class Machine:
    """True parameters (SI), top speed of its references, sensors, and the load it declares."""

    name: str
    motion: str
    J: float
    sigma0: float
    sigma1: float
    Fc: float
    Fs: float
    Fv: float
    vs: float
    w_max: float
    w_noise: float
    quanta: tuple[float, ...]
    load: tuple[int, float, float] = (NO_LOAD, 0.0, 0.0)
    Fs_twin: float = -1.0  # stiction of the declared structure; -1: the same as the truth
    twin_static: bool = False  # the declared structure is a static map
    static: bool = False  # a set-valued law instead of bristles

    @property
    def rotary(self) -> bool:
        return self.motion == "rotary"

    @property
    def load_peak(self) -> float:
        return abs(self.load[1])

    @property
    def torque_peak(self) -> float:
        """Torque limit of the drive: never reached by a well-behaved record."""
        return 6.0 * (2.0 * self.Fs + self.Fv * self.w_max + self.load_peak)

    @property
    def integral_peak(self) -> float:
        """Limit of the drive's integrator."""
        return 1.3 * (1.5 * self.Fs + self.Fv * self.w_max + self.load_peak)


def _turn(*bits: int) -> tuple[float, ...]:
    return tuple(2.0 * np.pi / 2**b for b in bits)


PARAMETERS = ("J", "sigma0", "sigma1", "Fc", "Fs", "Fv", "vs")
Values = tuple[float, ...]  # in the order of PARAMETERS


def _rotary(name: str, values: Values, w_max: float, w_noise: float, quanta: Values) -> Machine:
    known = dict(zip(PARAMETERS, values, strict=True))
    return Machine(name, "rotary", **known, w_max=w_max, w_noise=w_noise, quanta=quanta)


def _linear(name: str, values: Values, w_max: float, w_noise: float, quanta: Values) -> Machine:
    return replace(_rotary(name, values, w_max, w_noise, quanta), motion="linear")


_ALL = (
    _rotary("servo", (2.2e-3, 260, 0.6, 0.285, 0.335, 0.018, 0.01), 12, 2e-3, _turn(16, 18, 20)),
    _rotary("wrist", (0.02, 1500, 3.0, 0.9, 1.3, 0.12, 0.08), 8, 2e-3, _turn(14, 17, 20)),
    _rotary("joint", (0.13, 5500, 20, 2.2, 2.9, 0.9, 0.03), 5, 1e-3, _turn(16, 18, 20)),
    _rotary("large", (0.9, 7e4, 250, 9.5, 11.7, 6.0, 0.018), 3.5, 3e-4, _turn(18, 20)),
    _rotary("turret", (12, 2.5e5, 900, 40, 50, 50, 0.01), 2.5, 2e-4, _turn(18, 20)),
    _rotary("spindle", (5e-4, 40, 0.03, 0.02, 0.026, 2e-4, 0.3), 150, 0.03, _turn(14, 16)),
    _linear("axis", (75, 1e6, 2500, 20, 26, 150, 0.005), 0.4, 2e-4, (1e-6, 5e-7, 1e-7)),
    _linear("stage", (4, 2e5, 300, 3.0, 3.7, 12, 0.004), 0.6, 3e-4, (1e-6, 2e-7)),
)
MACHINES = {machine.name: machine for machine in _ALL}


def specimen(name: str, rng: np.random.Generator, spread: float = 0.2) -> Machine:
    """A machine of this size with every parameter up to `spread` off; Fs stays above Fc."""
    base = MACHINES[name]
    scale = dict(zip("J sigma0 sigma1 Fc Fv vs".split(), rng.uniform(-1, 1, 6), strict=True))
    new = {key: getattr(base, key) * float(1.0 + spread * s) for key, s in scale.items()}
    excess = (base.Fs / base.Fc - 1.0) * float(rng.uniform(1.0 - spread, 1.0 + 2.0 * spread))
    return replace(base, **new, Fs=new["Fc"] * (1.0 + excess))


def with_load(machine: Machine, rng: np.random.Generator, largest: float = 1.3) -> Machine:
    """Hang a load on it: gravity on a rotary machine, a weight on a linear one."""
    size = machine.Fc * largest * float(rng.uniform(0.4, 1.0))
    phase = rng.choice([0.0, rng.uniform(-0.9, 0.9) * np.pi])
    if machine.rotary:
        return replace(machine, load=(GRAVITY_LOAD, size, float(phase)))
    return replace(machine, load=(CONSTANT_LOAD, size, 0.0))

"""Effects and background: numbers that give a wanted share of friction torque."""

from __future__ import annotations

import numpy as np
from numpy.random import Generator

from ..case import EFFECTS
from . import kernel as k
from .machine import Machine, log_uniform

UNKNOWN = ("detent", "speed_hump", "rubbing_spot", "bursts")  # kernel codes 20-23
DEPENDS = (
    (frozenset({"theta"}),),
    (frozenset({"w"}),),
    (frozenset({"theta", "w"}), frozenset({"theta"})),
    (frozenset({"t"}),),
)
PARAMETERS = {
    "constant_torque": ("torque",),
    "gravity": ("amplitude", "phase"),
    "torque_ripple": ("amplitude", "harmonic", "phase"),
    "position_dependent_friction": ("ratio", "harmonic", "phase"),
    "coulomb_asymmetry": ("ratio",),
    "viscous_asymmetry": ("ratio",),
    "quadratic_drag": ("coefficient",),
    "thermal_drift": ("ratio", "time_constant"),
    "load_dependent_friction": ("coefficient",),
    "input_delay": ("delay",),
    "actuator_lag": ("time_constant",),
    "actuator_dead_zone": ("half_width",),
    "return_spring": ("stiffness", "rest"),
    "hard_stop": ("stiffness", "position", "side"),
    "elastic_coupling": ("load_inertia", "stiffness", "damping"),
    "backlash": ("load_inertia", "gap", "stiffness", "damping"),
    "inertia_step": ("ratio", "time"),
    "friction_step": ("ratio", "time"),
    "periodic_disturbance": ("amplitude", "frequency", "phase"),
    "torque_constant_ripple": ("ratio", "harmonic", "phase"),
}
SIGNED = ("constant_torque", "coulomb_asymmetry", "viscous_asymmetry", "thermal_drift",
          "inertia_step", "friction_step")  # fmt: skip
FIXED = ("input_delay", "actuator_lag", "elastic_coupling", "backlash")  # drawn, not scaled
LIVELY = FIXED + ("actuator_dead_zone", "inertia_step")


def rms(x: np.ndarray) -> float:
    """Root of the mean square."""
    return float(np.sqrt(np.mean(np.square(x))))


def harmonic(rng: Generator, out: np.ndarray, f_log: float, low: int, high: int) -> float | None:
    """A number of cycles per turn that the motion travels over and the log can see."""
    th, speed = out[:, k.TH], np.quantile(np.abs(out[:, k.W]), 0.9)
    most = min(high, 0.2 * f_log * 2 * np.pi / speed)
    least = max(low, 1.5 * 2 * np.pi / np.ptp(th))
    if most < least:
        return None
    return float(np.clip(round(log_uniform(rng, least, most)), np.ceil(least), None))


def background(rng: Generator, m: Machine, out: np.ndarray, f_log: float, but: str) -> set[str]:
    """Put five small imperfections into the machine, 0.3-1.2 % of RMS friction each."""
    level, names = rms(out[:, k.F0]), set()

    def share() -> float:
        return level * rng.uniform(0.003, 0.012)

    def put(name: str, **values: float) -> None:
        if name != but:
            m.P.update(values)
            names.add(name)

    def phase() -> float:
        return float(rng.uniform(-np.pi, np.pi))

    rip = harmonic(rng, out, 1.5 * f_log, 2, 96) or 6.0
    put("torque_ripple", rip=np.sqrt(2) * share(), rip_n=rip, rip_phase=phase())
    if rng.random() < 0.5 and not m.P["grav"]:
        put("gravity", unb=np.sqrt(2) * share(), unb_phase=phase())
    else:
        put("constant_torque", offset=share() * rng.choice([-1, 1]))
    sign = rng.choice([-1, 1])
    put("coulomb_asymmetry", asym=share() / rms(out[:, k.FB]) * sign)
    tau = rng.uniform(4.0, 25.0)
    grown = 1 - np.exp(-np.arange(len(out)) / m.fs / tau)
    put("thermal_drift", warm=-share() / rms(out[:, k.F0] * grown), warm_tau=tau)
    ktn = harmonic(rng, out, 1.5 * f_log, 1, 48) or 6.0
    kt = share() / rms(out[:, k.UAPP]) * np.sqrt(2)
    put("torque_constant_ripple", kt=kt, kt_n=ktn, kt_phase=phase())
    return names


def _time(rng: Generator, n: int, fs: float) -> float:
    return float(rng.uniform(0.25, 0.75) * n / fs)


def others(rng: Generator, name: str, m: Machine, out: np.ndarray, f_log: float) -> list | None:
    """The numbers after the first; None where this motion cannot show the effect."""
    th, w, n = out[:, k.TH], out[:, k.W], len(out)
    phase = float(rng.uniform(-np.pi, np.pi))
    span, mid = np.ptp(th), 0.5 * (th.max() + th.min())
    if name == "gravity":
        return [phase]
    if name in ("torque_ripple", "position_dependent_friction", "torque_constant_ripple"):
        most = {"torque_ripple": 60, "position_dependent_friction": 12}.get(name, 36)
        low = 2 if name == "torque_ripple" else 1
        cycles = harmonic(rng, out, f_log, low, most)
        return None if cycles is None else [cycles, phase]
    if name == "thermal_drift":
        return [float(rng.uniform(0.15, 0.8) * n / m.fs)]
    if name == "return_spring":
        return [float(mid + span * rng.uniform(-0.3, 0.3))]
    if name == "hard_stop":
        side = float(rng.choice([-1.0, 1.0]))
        return [float(np.quantile(th * side, rng.uniform(0.75, 0.93)) * side), side]
    if name in ("inertia_step", "friction_step"):
        return [_time(rng, n, m.fs)]
    if name == "periodic_disturbance":
        return [log_uniform(rng, 0.4, min(15.0, f_log / 8)), phase]
    if name == "detent":
        return [float(mid - 0.2 * span), float(mid + span * rng.uniform(0.05, 0.25)), 0.07 * span]
    if name == "speed_hump":
        top = float(np.quantile(np.abs(w), 0.97))
        centre = top * rng.uniform(0.3, 0.6)
        return [centre, centre * rng.uniform(0.15, 0.3), 0.02 * top]
    if name == "rubbing_spot":
        return [
            float(mid + span * rng.uniform(-0.25, 0.25)),
            span * rng.uniform(0.04, 0.1),
            0.01 * m.wmax,
        ]
    return []


def drawn(rng: Generator, name: str, m: Machine, out: np.ndarray, f_log: float) -> list[float]:
    """All numbers of an effect whose size follows from what it is."""
    if name in ("input_delay", "actuator_lag"):
        beyond = 0.5 * (1 / f_log - 1 / m.fs)  # the log holds u longer than the drive does
        return [float(rng.uniform(0.002, 0.008) + beyond)]
    load = m.P["J"] * rng.uniform(0.3, 1.5)
    w0 = 2 * np.pi * log_uniform(rng, 3.0, min(40.0, f_log / 8))
    damping = 2 * rng.uniform(0.03, 0.25) * load * w0
    if name == "elastic_coupling":
        return [load, load * w0**2, damping]
    w0 = 2 * np.pi * log_uniform(rng, 12.0, min(60.0, f_log / 6))
    gap = np.ptp(out[:, k.TH]) * log_uniform(rng, 0.003, 0.12)
    return [load, gap, load * w0**2, 2 * rng.uniform(0.05, 0.3) * load * w0]


def unit(name: str, e: list, m: Machine, out: np.ndarray, load: np.ndarray) -> float:
    """RMS torque at a first number of 1, along the motion without the effect."""
    th, w, fb = out[:, k.TH], out[:, k.W], out[:, k.FB]
    t = np.arange(len(out)) / m.fs
    if name == "viscous_asymmetry":
        return rms(out[:, k.F0] - fb)
    if name == "thermal_drift":
        return rms(out[:, k.F0] * (1 - np.exp(-t / e[0])))
    if name == "inertia_step":
        return rms(m.P["J"] * out[:, k.ACC] * (t >= e[0]))
    if name == "friction_step":
        return rms(fb * (t >= e[0]))
    shapes = {
        "gravity": lambda: np.sin(th + e[0]),
        "torque_ripple": lambda: np.full(1, 0.7),
        "position_dependent_friction": lambda: 0.7 * fb,
        "coulomb_asymmetry": lambda: fb,
        "quadratic_drag": lambda: w * w,
        "load_dependent_friction": lambda: load,
        "return_spring": lambda: th - e[0],
        "hard_stop": lambda: np.maximum(0.0, (th - e[0]) * e[1]),
        "periodic_disturbance": lambda: np.full(1, 0.7),
        "torque_constant_ripple": lambda: 0.7 * out[:, k.UCMD],
        "detent": lambda: np.exp(-(((th - e[0]) / e[2]) ** 2)),
        "speed_hump": lambda: np.exp(-(((np.abs(w) - e[0]) / e[1]) ** 2)),
        "rubbing_spot": lambda: np.exp(-(((th - e[0]) / e[1]) ** 2)),
        "bursts": lambda: np.full(1, 0.6),
    }
    return rms(shapes[name]()) if name in shapes else 1.0


def code_of(name: str) -> int:
    """The kernel's number of an effect; -1 for none."""
    if name in EFFECTS:
        return EFFECTS.index(name)
    return 20 + UNKNOWN.index(name) if name in UNKNOWN else -1


def bursts(rng: Generator, n: int, fs: float) -> np.ndarray:
    """Irregular pulses of either sign over time (n,), of size 1."""
    x, at = np.zeros(n), int(rng.uniform(0.5, 2.0) * fs)
    while at < n:
        size = int(log_uniform(rng, 0.15, 2.0) * fs)
        x[at : at + size] = rng.uniform(0.6, 1.2) * rng.choice([-1, 1])
        at += size + int(log_uniform(rng, 0.2, 2.5) * fs)
    return x


def coloured(rng: Generator, n: int, fs: float) -> tuple[np.ndarray, float]:
    """Autoregressive noise (n,) of RMS 1 and its memory, s."""
    from scipy.signal import lfilter

    memory = log_uniform(rng, 0.004, 2.0)
    a = np.exp(-1.0 / (fs * memory))
    x = lfilter([1.0], [1.0, -a], rng.standard_normal(n + int(5 * memory * fs)))[-n:]
    if rng.random() < 0.4:  # a second root: no corner of white noise on top
        b = np.exp(-1.0 / (fs * memory * rng.uniform(0.1, 0.5)))
        x = lfilter([1.0], [1.0, -b], x)
    return x / rms(x), memory

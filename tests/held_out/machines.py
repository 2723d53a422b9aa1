"""Machines as one meets them: friction level, speed, time to coast down, travel, sensor."""

from dataclasses import dataclass, field

import numpy as np

from .loop import CONTROL_TYPE, DIFFERENCE, EDGES, SENSOR_TYPE, TACHO, record
from .plant import plant


@dataclass
class Machine:
    """The ranges of one kind of machine; coast is the time J wmax / Fc."""

    Fc: tuple[float, float]
    wmax: tuple[float, float]
    coast: tuple[float, float]
    viscous: tuple[float, float]  # of Fc, at wmax
    travel: tuple[float, float]  # half of it; infinite when it may turn on
    lines: tuple[int, ...]
    rates: tuple[int, ...]
    gravity: float = 0.0  # how often
    models: tuple[str, ...] = ("coulomb", "lugre", "dahl")


INF = (np.inf, np.inf)
MACHINES = {
    "micro servo": Machine(
        (0.004, 0.04),
        (4, 10),
        (0.03, 0.3),
        (0.3, 1.5),
        (1.0, 2.4),
        (1024, 4096),
        (50, 100, 200),
        0.4,
    ),
    "harmonic-drive joint": Machine(
        (2, 15),
        (1.5, 4),
        (0.05, 0.5),
        (0.5, 2),
        (1.2, 3.0),
        (100_000, 524_288),
        (250, 500, 1000),
        0.5,
    ),
    "direct-drive motor": Machine(
        (0.02, 0.4),
        (8, 40),
        (0.3, 3),
        (0.1, 1),
        INF,
        (20_000, 262_144, 1_000_000),
        (1000, 2000, 4000),
        0.3,
    ),
    "belt axis": Machine(
        (0.04, 0.4), (50, 200), (0.1, 0.8), (0.2, 1), (20, 80), (2000, 10_000), (200, 500, 1000)
    ),
    "industrial arm": Machine(
        (20, 150),
        (1.0, 2.5),
        (0.1, 0.8),
        (0.4, 1.6),
        (0.8, 2.5),
        (200_000, 1_000_000),
        (100, 250, 500),
        0.7,
    ),
    "worm gear": Machine(
        (0.1, 1), (40, 150), (0.03, 0.3), (0.2, 1), INF, (500, 1024, 4096), (100, 250, 1000)
    ),
    "linear axis": Machine(
        (0.1, 0.8),
        (60, 250),
        (0.08, 0.6),
        (0.2, 1.2),
        (40, 150),
        (4000, 20_000, 131_072),
        (500, 1000, 2000),
        0.0,
    ),
    "bench motor": Machine(
        (0.005, 0.05),
        (30, 250),
        (0.2, 2),
        (0.1, 1.5),
        INF,
        (500, 1000, 2000, 8192),
        (100, 500, 1000),
        0.2,
    ),
}


@dataclass
class Rig:
    """One machine with everything that was drawn for it."""

    name: str
    model: str
    wmax: float
    travel: float
    fs: int
    every: int  # periods of the controller per logged row
    seconds: float
    values: dict = field(default_factory=dict)  # of the plant
    sensor: dict = field(default_factory=dict)
    control: dict = field(default_factory=dict)
    lines: int = 0
    load_seed: int = 0

    @property
    def Tc(self) -> float:
        """The period of the controller."""
        return 1.0 / (self.fs * self.every)

    def records(self):
        """What the loop takes: plant, sensor and controller."""
        return (
            plant(**self.values)[0],
            record(SENSOR_TYPE, **self.sensor)[0],
            record(CONTROL_TYPE, **self.control)[0],
        )


def between(rng, low: float, high: float) -> float:
    """A number between two, evenly in its logarithm."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def draw_machine(rng, kind: str) -> Rig:
    """A machine, its friction and its rates."""
    name = str(rng.choice(list(MACHINES)))
    a = MACHINES[name]
    Fc, wmax = between(rng, *a.Fc), between(rng, *a.wmax)
    J = Fc * between(rng, *a.coast) / wmax
    travel = float(rng.uniform(*a.travel)) if np.isfinite(a.travel[0]) else np.inf
    fs = int(rng.choice(a.rates))
    every = 1
    while fs * every < rng.choice([500, 1000, 2000]):
        every += 1
    seconds = min(between(rng, 10, 60), 120_000 / (fs * every))
    rig = Rig(name, "coulomb", wmax, travel, fs, every, max(round(seconds, 1), 10.0))
    rig.values = {"J": J, "Fc": Fc, "Fv": Fc * between(rng, *a.viscous) / wmax}
    rig.lines = int(rng.choice(a.lines))
    if rng.random() < a.gravity:
        size = rng.uniform(0.1, 1.5) if np.isfinite(travel) else rng.uniform(0.1, 0.5)
        rig.values |= {"grav": Fc * size, "grav_ph": float(rng.uniform(-np.pi, np.pi))}
    if rng.random() < 0.5:
        rig.values["const"] = Fc * float(rng.uniform(-0.4, 0.4))
    rig.values["theta0"] = 0.0 if rng.random() < 0.6 or travel < 1e3 else float(rng.uniform(-3, 3))
    draw_friction(rng, rig, str(rng.choice(a.models)), kind)
    return rig


def draw_friction(rng, rig: Rig, model: str, kind: str) -> None:
    """Its law: set-valued Coulomb, Dahl or LuGre; real ones may have a Stribeck peak."""
    v, Fc = rig.values, rig.values["Fc"]
    if kind != "plain" and rng.random() < 0.5 and model != "dahl":
        v["Fs"] = Fc * float(rng.uniform(1.02, 1.3))
        v["vs"] = rig.wmax * between(rng, 0.002, 0.03)
        model = "stribeck" if model == "coulomb" else model
    rig.model = model
    if model in ("lugre", "dahl"):
        reach = rig.wmax if not np.isfinite(rig.travel) else min(rig.travel, rig.wmax)
        s0 = Fc / (reach * between(rng, 1e-5, 1e-3))
        s0 = min(s0, v["J"] * (0.15 * 25_000) ** 2)  # what steps of 40 us resolve well
        zeta = rng.uniform(0.2, 1.0) if model == "lugre" else 0.0
        v |= {"bristles": 1, "s0": s0, "s1": 2 * zeta * np.sqrt(s0 * v["J"])}


def draw_sensor(rng, rig: Rig) -> None:
    """Encoder lines, and how the firmware gets its speed."""
    q = 2 * np.pi / (4 * rig.lines if rig.lines < 100_000 else rig.lines)
    kind = int(rng.choice([DIFFERENCE, EDGES, TACHO], p=[0.5, 0.25, 0.25]))
    rig.sensor = {"q": q, "kind": kind}
    if kind == DIFFERENCE:
        rig.sensor["tau"] = rig.Tc * between(rng, 1, 8)
    elif kind == EDGES:
        rig.sensor |= {"tau": rng.choice([0, 1]) * rig.Tc, "edge_min": 0.002 * rig.wmax}
    else:
        rig.sensor |= {
            "tau": between(rng, 0.3e-3, 3e-3),
            "w_noise": rig.wmax * between(rng, 3e-4, 4e-3),
        }
    if rng.random() < 0.3:
        rig.sensor["w_q"] = rig.wmax * between(rng, 1e-5, 1e-3)
    if rng.random() < 0.2:
        rig.sensor["th_noise"] = q * rng.uniform(0.3, 1.5)


def draw_control(rng, rig: Rig) -> None:
    """Gains that the period, the sensor and the delays allow."""
    v, s, Tc = rig.values, rig.sensor, rig.Tc
    late = 1.5 * Tc + s.get("tau", 0.0) + v.get("delay", 0.0) + v.get("lag", 0.0)
    band = between(rng, 0.1, 0.35) / late
    step = s["q"] / max(s.get("tau", 0.0), Tc) if s["kind"] != TACHO else s["w_noise"]
    band = min(band, 0.3 * v["Fc"] / (v["J"] * step), 400.0)
    band = max(band, 3 * v["Fc"] / (v["J"] * rig.wmax) if rng.random() < 0.5 else 4.0)
    band = min(band, 0.5 / late)
    kv = v["J"] * band
    peak = v["Fc"] * rng.uniform(3, 10) + v["Fv"] * rig.wmax + v.get("grav", 0.0)
    rig.control = {
        "kv": kv,
        "ki": kv * band / between(rng, 4, 12),
        "kp": band / between(rng, 4, 10),
        "wmax": 1.5 * rig.wmax,
        "umax": peak,
        "u_q": peak / 2 ** int(rng.integers(9, 15)) if rng.random() < 0.4 else 0.0,
    }


def draw_delay(rng, rig: Rig) -> None:
    """How long a torque command takes to act, up to a few periods."""
    if rng.random() < 0.6:
        rig.values["delay"] = float(rng.choice([0.5, 1.0, 1.0, 2.0, rng.uniform(0, 3)])) * rig.Tc


def substeps(rig: Rig) -> int:
    """Steps per period, fine enough for bristles, couplings and stops."""
    v = rig.values
    fast = [2 / rig.Tc]
    fast.append(np.sqrt(v.get("s0", 0.0) / v["J"]))
    fast.append(v.get("s1", 0.0) / v["J"] / 2)
    if v.get("JL", 0.0) > 0:
        fast.append(np.sqrt(v["kc"] * (1 / v["J"] + 1 / v["JL"])))
    fast.append(np.sqrt(v.get("stop_k", 0.0) / v["J"]))
    return int(max(4, np.ceil(rig.Tc * max(fast) / 0.15), np.ceil(rig.Tc / 2.5e-4)))

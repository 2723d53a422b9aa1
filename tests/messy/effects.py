"""The twenty effects and four outside the catalogue: their sizes, and the torque each one hides."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from .machine import Machine, log_uniform
from .plant import RATE

UNKNOWN = {  # sets of signals that are a right answer
    "bumps_in_theta": (frozenset({"theta"}),),
    "rough_patch": (frozenset({"theta", "w"}), frozenset({"theta"})),
    "speed_hump": (frozenset({"w"}),),
    "slow_load": (frozenset({"t"}),),
}
MAIN = {  # the parameter that carries the strength
    "constant_torque": "torque",
    "gravity": "amplitude",
    "torque_ripple": "amplitude",
    "position_dependent_friction": "ratio",
    "coulomb_asymmetry": "ratio",
    "viscous_asymmetry": "ratio",
    "quadratic_drag": "coefficient",
    "thermal_drift": "ratio",
    "load_dependent_friction": "coefficient",
    "actuator_dead_zone": "half_width",
    "return_spring": "stiffness",
    "hard_stop": "stiffness",
    "inertia_step": "ratio",
    "friction_step": "ratio",
    "periodic_disturbance": "amplitude",
    "torque_constant_ripple": "ratio",
    "bumps_in_theta": "scale",
    "rough_patch": "scale",
    "speed_hump": "scale",
    "slow_load": "scale",
}


@dataclass
class Inputs:
    """What the plant is given beside the reference, by time and by row."""

    level: np.ndarray
    warm: np.ndarray
    torque: np.ndarray
    inertia: np.ndarray
    rows: list[tuple[float, float, float, float]] = field(default_factory=list)
    load: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    drive: list[float] = field(default_factory=lambda: [0.0, 0.0, 0.0, 0.0, 1.0, 0.0])

    @classmethod
    def neutral(cls, n: int, inertia: float) -> Inputs:
        """Nothing but the machine."""
        return cls(np.ones(n), np.ones(n), np.zeros(n), np.full(n, inertia))


def harmonic(g: np.random.Generator, theta: np.ndarray, m: Machine, low: int = 2) -> int:
    """A whole order that passes several periods and that the log's rate can show."""
    travel = max(float(np.ptp(theta)), 1e-9)
    least = max(low, int(np.ceil(2.5 * 2 * np.pi / travel)))
    most = int(min(60, max(least, 2 * np.pi * min(RATE / m.every / 8, 40) / m.top)))
    return int(round(log_uniform(g, least, max(most, least) + 0.4)))


def plan(name: str, m: Machine, g: np.random.Generator, motion, fric: float, share: float) -> dict:
    """Parameters of ``name`` whose torque along ``motion`` is ``share`` of ``fric``, about."""
    theta, w, a = motion
    t = np.arange(len(theta)) / RATE
    goal, sign, phase = share * fric, float(g.choice([-1, 1])), g.uniform(-3.1, 3.1)
    coulomb, middle = fric / m.Fc, g.uniform(0.3, 0.7) * t[-1]

    def rms(x):
        return max(float(np.sqrt(np.mean(x**2))), 1e-12)

    match name:
        case "constant_torque":
            return {"torque": sign * goal}
        case "gravity":
            return {"amplitude": goal / rms(np.sin(theta + phase)), "phase": phase}
        case "torque_ripple":
            order = harmonic(g, theta, m)
            return {"amplitude": 1.41 * goal, "harmonic": order, "phase": phase}
        case "position_dependent_friction":
            order = harmonic(g, theta, m, 1)
            return {"ratio": 1.41 * share * coulomb, "harmonic": order, "phase": phase}
        case "coulomb_asymmetry":
            return {"ratio": sign * share * coulomb}
        case "viscous_asymmetry":
            return {"ratio": sign * goal / (m.Fv * rms(w))}
        case "quadratic_drag":
            return {"coefficient": goal / rms(w * w)}
        case "thermal_drift":
            tau = g.uniform(0.15, 0.5) * t[-1]
            return {"ratio": sign * share / rms(1 - np.exp(-t / tau)), "time_constant": tau}
        case "load_dependent_friction":
            return {"coefficient": goal / (m.gravity * rms(np.sin(theta)))}
        case "input_delay":
            return {"delay": g.uniform(2e-3, 8e-3)}
        case "actuator_lag":
            return {"time_constant": g.uniform(2e-3, 8e-3) + 0.5 * m.every / RATE}
        case "actuator_dead_zone":
            return {"half_width": goal}
        case "return_spring":
            rest = float(np.mean(theta) + g.uniform(-0.3, 0.3) * np.ptp(theta))
            return {"stiffness": goal / rms(theta - rest), "rest": rest}
        case "hard_stop":
            place = float(np.quantile(sign * theta, g.uniform(0.8, 0.93)))
            deep = rms(np.maximum(sign * theta - place, 0))
            return {"position": sign * place, "stiffness": 1.5 * goal / deep, "side": sign}
        case "elastic_coupling" | "backlash":
            return _two_mass(name, m, g)
        case "inertia_step":
            return {"ratio": sign * goal / (m.J * rms(a * (t > middle))), "time": middle}
        case "friction_step":
            return {"ratio": sign * share * coulomb * 1.41, "time": middle}
        case "periodic_disturbance":
            hertz = log_uniform(g, 0.3, min(20.0, RATE / m.every / 12))
            return {"amplitude": 1.41 * goal, "frequency": hertz, "phase": phase}
        case "torque_constant_ripple":
            u = m.J * a + m.Fc * np.sign(w) + m.Fv * w
            order = harmonic(g, theta, m, 1)
            return {"ratio": 1.41 * goal / rms(u), "harmonic": order, "phase": phase}
    return _outside(name, m, g, theta, w, t, goal)


def _two_mass(name: str, m: Machine, g: np.random.Generator) -> dict:
    load = m.J * g.uniform(0.3, 1.5)
    own = 2 * np.pi * log_uniform(g, 4.0, min(30.0, RATE / m.every / 10))
    if name == "backlash":
        own *= 1.5
    stiffness = own**2 * m.J * load / (m.J + load)
    loss = g.uniform(0.1, 0.35) if name == "backlash" else g.uniform(0.02, 0.08)
    damping = 2 * loss * own * m.J * load / (m.J + load)
    out = {"load_inertia": load, "stiffness": stiffness, "damping": damping}
    if name == "backlash":
        out["gap"] = log_uniform(g, 0.005, 0.06) * max(1.0, m.top**2 / m.pull)
    return out


def _outside(name, m: Machine, g, theta, w, t, goal: float) -> dict:
    """Effects that the catalogue does not hold."""
    low, high = np.quantile(theta, [0.05, 0.95])
    number = int(g.integers(2, 5)) if name == "bumps_in_theta" else int(g.integers(1, 3))
    places = np.sort(g.uniform(low, high, number))
    width = (high - low) * g.uniform(0.03, 0.1)
    if name == "bumps_in_theta":
        shape = sum(np.exp(-(((theta - p) / width) ** 2)) for p in places)
        signs = list(g.choice([-1.0, 1.0], number))
        return {"scale": goal / _rms(shape), "places": places, "width": width, "signs": signs}
    if name == "rough_patch":
        shape = sum(np.exp(-(((theta - p) / (2 * width)) ** 4)) for p in places)
        return {"scale": goal / m.Fc / _rms(shape), "places": places, "width": 2 * width}
    if name == "speed_hump":
        middle = np.quantile(np.abs(w), g.uniform(0.5, 0.75))
        wide = middle * g.uniform(0.2, 0.4)
        shape = np.exp(-(((np.abs(w) - middle) / wide) ** 2))
        return {"scale": goal / _rms(shape), "speed": middle, "width": wide}
    slow = g.standard_normal((2, 40))
    hertz = np.arange(1, 41) / t[-1]
    gain = (hertz < g.uniform(0.3, 0.8)) * hertz**-0.3
    wave = sum(
        k * (p * np.sin(2 * np.pi * f * t) + q * np.cos(2 * np.pi * f * t))
        for k, p, q, f in zip(gain, slow[0], slow[1], hertz, strict=True)
        if k > 0
    )
    return {"scale": goal, "wave": wave / _rms(wave)}


def _rms(x) -> float:
    return max(float(np.sqrt(np.mean(np.square(x)))), 1e-12)


def apply(name: str, p: dict, m: Machine, into: Inputs) -> None:
    """Put the effect into what the plant is given."""
    t = np.arange(len(into.level)) / RATE
    rows = into.rows
    match name:
        case "constant_torque":
            into.torque += p["torque"]
        case "gravity":
            rows.append((1, p["amplitude"], 1.0, p["phase"]))
        case "torque_ripple":
            rows.append((1, p["amplitude"], p["harmonic"], p["phase"]))
        case "position_dependent_friction":
            rows.append((2, p["ratio"], p["harmonic"], p["phase"]))
        case "coulomb_asymmetry":
            rows.append((3, p["ratio"], 0, 0))
        case "viscous_asymmetry":
            rows.append((4, p["ratio"] * m.Fv, 0, 0))
        case "quadratic_drag":
            rows.append((5, p["coefficient"], 0, 0))
        case "thermal_drift":
            grown = 1 + p["ratio"] * (1 - np.exp(-t / p["time_constant"]))
            into.level *= grown
            into.warm *= grown
        case "load_dependent_friction":
            rows.append((8, p["coefficient"], m.gravity, 0.0))
        case "input_delay":
            into.drive[0] += (p["delay"] + 0.5 * m.every / RATE) * RATE
        case "actuator_lag":
            into.drive[1] += p["time_constant"]
        case "actuator_dead_zone":
            into.drive[2] = p["half_width"]
        case "return_spring":
            rows.append((6, p["stiffness"], p["rest"], 0))
        case "hard_stop":
            rows.append((7, p["stiffness"], p["position"], p["side"]))
        case "elastic_coupling" | "backlash":
            into.load = (p["load_inertia"], p["stiffness"], p["damping"], p.get("gap", 0.0))
        case "inertia_step":
            into.inertia *= 1 + p["ratio"] * (t >= p["time"])
        case "friction_step":
            into.level *= 1 + p["ratio"] * (t >= p["time"])
        case "periodic_disturbance":
            wave = np.sin(2 * np.pi * p["frequency"] * t + p["phase"])
            into.torque += p["amplitude"] * wave
        case "torque_constant_ripple":
            into.drive[3:] = [p["ratio"], p["harmonic"], p["phase"]]
        case "bumps_in_theta":
            for place, sign in zip(p["places"], p["signs"], strict=True):
                rows.append((9, sign * p["scale"], place, p["width"]))
        case "rough_patch":
            rows.extend((10, p["scale"], place, p["width"]) for place in p["places"])
        case "speed_hump":
            rows.append((11, p["scale"], p["speed"], p["width"]))
        case "slow_load":
            into.torque += p["scale"] * p["wave"]


def hidden(name: str, p: dict, m: Machine, run: dict[str, np.ndarray]) -> np.ndarray:
    """The torque of the effect along the true motion, N m, at the control rate."""
    theta, w, a, f, t = (run[k] for k in ("theta", "w", "a", "bristle", "t"))
    s = np.tanh(w / (0.3 * m.vs))
    match name:
        case "constant_torque":
            return np.full_like(t, p["torque"])
        case "gravity" | "torque_ripple":
            return p["amplitude"] * np.sin(p.get("harmonic", 1) * theta + p["phase"])
        case "position_dependent_friction":
            return _part(f, p["ratio"] * np.sin(p["harmonic"] * theta + p["phase"]))
        case "coulomb_asymmetry":
            return _part(f, p["ratio"] * s)
        case "viscous_asymmetry":
            return p["ratio"] * m.Fv * np.abs(w)
        case "quadratic_drag":
            return p["coefficient"] * w * np.abs(w)
        case "thermal_drift":
            grown = p["ratio"] * (1 - np.exp(-t / p["time_constant"]))
            return _part(f + run["viscous"], grown)
        case "load_dependent_friction":
            return _part(f, p["coefficient"] * np.abs(m.gravity * np.sin(theta)) / m.Fc)
        case "return_spring":
            return p["stiffness"] * (theta - p["rest"])
        case "hard_stop":
            beyond = p["side"] * (theta - p["position"]) > 0
            return p["stiffness"] * (theta - p["position"]) * beyond
        case "elastic_coupling" | "backlash":
            return run["shaft"] - p["load_inertia"] * a
        case "inertia_step":
            return p["ratio"] * m.J * a * (t >= p["time"])
        case "friction_step":
            return _part(f, p["ratio"] * (t >= p["time"]))
        case "periodic_disturbance":
            return p["amplitude"] * np.sin(2 * np.pi * p["frequency"] * t + p["phase"])
        case "bumps_in_theta":
            pairs = zip(p["places"], p["signs"], strict=True)
            bumps = [g * np.exp(-(((theta - q) / p["width"]) ** 2)) for q, g in pairs]
            return p["scale"] * np.sum(bumps, 0)
        case "rough_patch":
            bumps = [np.exp(-(((theta - q) / p["width"]) ** 4)) for q in p["places"]]
            return _part(f, np.prod([1 + p["scale"] * b for b in bumps], 0) - 1)
        case "speed_hump":
            return p["scale"] * s * np.exp(-(((np.abs(w) - p["speed"]) / p["width"]) ** 2))
        case "slow_load":
            return p["scale"] * p["wave"]
        case "none":
            return np.zeros_like(t)
    if name == "actuator_dead_zone" or name == "torque_constant_ripple":
        return run["command"] - run["acting"]
    return held(m, run["command"]) - run["acting"]


def held(m: Machine, u: np.ndarray) -> np.ndarray:
    """The command as its log, held from sample to sample, gives it: half a sample late."""
    n = m.every // 2
    return np.concatenate([np.full(n, u[0]), u[:-n]])


def _part(torque: np.ndarray, grown: np.ndarray) -> np.ndarray:
    """The share of a torque that a factor ``1 + grown`` added."""
    return torque * grown / (1 + grown)

"""Machines, drives and sensors, drawn at random."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .plant import ELASTOPLASTIC, KARNOPP, LUGRE, MAXWELL, RATE

LAWS = {"lugre": LUGRE, "maxwell": MAXWELL, "elastoplastic": ELASTOPLASTIC, "karnopp": KARNOPP}
LATE = ("input_delay", "actuator_lag", "actuator_dead_zone")  # seen in the command only


@dataclass(frozen=True)
class Machine:
    """A motor with its friction, its drive and what is logged of it; SI units."""

    J: float
    Fc: float
    Fs: float
    Fv: float
    vs: float
    delta: float
    power: float
    sigma0: float
    sigma1: float
    law: str
    elements: int
    gravity: float
    top: float  # rad/s, highest speed
    pull: float  # rad/s2, acceleration of the moves
    counts: int
    w: str  # "tacho", "difference", "none"
    tacho: float  # rad/s
    smooth: float  # rad/s, filter of the encoder difference
    u: str  # "current", "command", "mean"
    current: tuple[float, float, float]  # noise, step [N m], lag [s]
    every: int  # control samples to one of the log
    stiffness: float  # rad/s, bandwidth of the velocity loop

    @property
    def few(self) -> str:
        """The machine in few words."""
        rate = RATE / self.every
        return (
            f"J {self.J:.2g} Fc {self.Fc:.2g} {self.law} {rate:g} Hz {self.counts} "
            f"w:{self.w} u:{self.u}"
        )


def log_uniform(g: np.random.Generator, low: float, high: float) -> float:
    """One number, its logarithm uniform."""
    return float(np.exp(g.uniform(np.log(low), np.log(high))))


def draw_machine(g: np.random.Generator, effect: str) -> Machine:
    """A machine on which ``effect`` may be seen."""
    j = log_uniform(g, 1e-5, 1.0)
    ratio = log_uniform(g, 6.0, 150.0)
    fc = j * ratio
    pull = ratio * log_uniform(g, 1.0, 5.0)
    top = pull * log_uniform(g, 0.12, 0.6)
    fs = fc * g.uniform(1.02, 1.5)
    power = 1.0 if effect == "viscous_asymmetry" else float(g.choice([1.0, 1.0, 0.85, 0.8]))
    share = g.uniform(0.6, 1.2) if effect == "viscous_asymmetry" else g.uniform(0.12, 0.9)
    presliding = log_uniform(g, 1e-4, 1.5e-3)
    s0 = fs / presliding
    counts = int(g.choice([2000, 4096, 8192, 10000, 20000, 65536, 100000]))
    w = str(g.choice(["tacho", "difference", "none"]))
    u = "command" if effect in LATE else str(g.choice(["current", "current", "command", "mean"]))
    every = int(g.choice([4, 4, 8, 10, 20] if u != "mean" else [4, 8]))
    law = str(g.choice(["lugre", "lugre", "maxwell", "elastoplastic", "karnopp"]))
    stiff = _bandwidth(g, effect, fc / j, 2 * np.pi / counts, w == "tacho")
    heavy = g.uniform(0.5, 1.1) if effect == "load_dependent_friction" else g.uniform(0.2, 0.9)
    declared = effect == "load_dependent_friction" or (effect != "gravity" and g.random() < 0.35)
    return Machine(
        J=j,
        Fc=fc,
        Fs=fs,
        Fv=fc * share / top**power,
        vs=top * log_uniform(g, 0.002, 0.02),
        delta=float(g.choice([1.0, 2.0])),
        power=power,
        sigma0=s0,
        sigma1=2 * g.uniform(0.15, 0.6) * np.sqrt(s0 * j),
        law=law,
        elements=int(g.integers(4, 11)),
        gravity=fc * heavy if declared else 0.0,
        top=top,
        pull=pull,
        counts=counts,
        w=w,
        tacho=top * log_uniform(g, 0.001, 0.004),
        smooth=max(4 * stiff, log_uniform(g, 150, 1000)),
        u=u,
        current=(
            fc * log_uniform(g, 0.004, 0.03),
            fc * log_uniform(g, 0.001, 0.01),
            g.uniform(3e-4, 1e-3),
        ),
        every=every,
        stiffness=stiff,
    )


def _bandwidth(g, effect: str, ratio: float, quantum: float, tacho: bool) -> float:
    """Bandwidth of the velocity loop that neither shouts at the encoder nor swings."""
    want = log_uniform(g, 25.0, 250.0)
    if not tacho:  # J stiff * quantum * 4 stiff stays below an eighth of friction
        want = min(want, float(np.sqrt(ratio / (32 * quantum))))
    if effect in ("input_delay", "actuator_lag", "elastic_coupling", "backlash"):
        want = min(want, log_uniform(g, 20.0, 45.0))
    return max(want, 12.0)


def elements(m: Machine, g: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Shares of the friction level and stiffnesses (sum 1) of the bristles."""
    if m.law != "maxwell":
        return np.ones(1), np.ones(1)
    share = g.dirichlet(np.full(m.elements, 4.0))
    stiff = share / np.linspace(0.3, 2.5, m.elements)
    return share, stiff / stiff.sum()


def declare(m: Machine, g: np.random.Generator) -> dict:
    """The declared model: the right structure, values 10 to 20 % off, some missing."""

    def off(value: float) -> float:
        return float(f"{value * (1 + g.choice([-1, 1]) * g.uniform(0.1, 0.2)):.6g}")

    bristles = m.law != "karnopp" and g.random() < 0.6
    friction = {"Fc": off(m.Fc), "Fs": off(m.Fs), "Fv": off(m.Fv * m.top ** (m.power - 1))}
    friction |= {"vs": off(m.vs)}
    if bristles:
        friction |= {"sigma0": off(m.sigma0), "sigma1": off(m.sigma1)}
    for name, odds in (("Fs", 0.2), ("vs", 0.2), ("sigma0", 0.3)):
        if g.random() < odds:
            friction.pop(name, None)
    if "sigma0" not in friction:
        friction.pop("sigma1", None)
    model = {
        "name": "messy",
        "motion": "rotary",
        "plant": {"J": off(m.J)},
        "friction": {"model": "lugre" if bristles else "stribeck", **friction},
    }
    if m.gravity > 0:
        entry = {"name": "gravity", "amplitude": off(m.gravity), "phase": 0.0}
        model["effects"] = [entry]
    return model

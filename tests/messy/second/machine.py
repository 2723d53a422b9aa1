"""Machines as people have them: what turns, what rubs, who commands it and how fast."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.random import Generator


@dataclass
class Machine:
    """One drive; SI units, ``P`` holds the kernel's numbers by name."""

    type: str
    friction: str  # "lugre", "slip", "static", "grease"
    P: dict[str, float]
    stiffness: np.ndarray
    share: np.ndarray
    wmax: float
    amax: float
    stroke: float
    counts: float
    fs: float
    nsub: int
    about: dict[str, float] = field(default_factory=dict)


def log_uniform(rng: Generator, low: float, high: float) -> float:
    """One draw, even over the decades."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


#        J [kg m2]     Fc/J [rad/s2]  wmax [rad/s]  stroke [rad]  counts       z at Fc [rad]
TYPES = {
    "direct": ((1e-4, 1e-1), (6, 120), (2, 25), (0.8, 30), (2e4, 2e5), (2e-4, 3e-3)),
    "geared": ((1e-6, 1e-3), (80, 1500), (20, 200), (8, 400), (2e3, 4e4), (5e-4, 8e-3)),
    "screw": ((1e-5, 1e-2), (60, 800), (8, 120), (8, 300), (4e3, 1e5), (5e-4, 6e-3)),
    "hobby": ((3e-5, 4e-3), (40, 250), (2, 7), (0.5, 1.4), (1e3, 1.6e4), (2e-3, 1.2e-2)),
}


def _friction(
    rng: Generator, fc: float, wmax: float, damping: float
) -> tuple[str, dict, np.ndarray]:
    """Law, its numbers and the shares of its bristles."""
    law = str(rng.choice(["lugre", "slip", "static", "grease"], p=[0.4, 0.2, 0.2, 0.2]))
    plain = law == "static" and rng.random() < 0.4
    p = {
        "Fc": fc,
        "Fs": fc if plain else fc * rng.uniform(1.05, 1.5),
        "Fv": fc * rng.uniform(0.12, 1.2) / wmax,
        "vs": wmax * log_uniform(rng, 0.004, 0.08),
        "delta": float(rng.choice([0.7, 1.0, 1.5, 2.0, 2.0])),
        "power": 1.0,
        "relax": 0.0 if law in ("slip", "static") else 1.0,
        "sigma1": damping,
    }
    p["w0"] = 0.1 * p["vs"]
    if law == "grease":
        p["power"] = rng.uniform(0.7, 0.9)
        p["Fv"] *= wmax ** (1.0 - p["power"])
    share = np.array([1.0])
    if law == "slip":
        share = rng.dirichlet(np.full(int(rng.integers(3, 7)), 4.0))
    return law, p, share


def machine(
    rng: Generator, lively: bool = False, slow_loop: float = 0.0, exact: bool = False
) -> Machine:
    """Draw one; ``lively``: torque of inertia above friction; ``slow_loop``: dead time to bear, s.

    ``exact``: a bare motor whose loop is no faster than a log.
    """
    name = str(rng.choice(list(TYPES), p=[0.5, 0.5, 0, 0] if exact else [0.3, 0.3, 0.2, 0.2]))
    inertia, decel, speed, stroke, counts, yielding = TYPES[name]
    j, ratio, wmax = (log_uniform(rng, *x) for x in (inertia, decel, speed))
    zc, fc = log_uniform(rng, *yielding), j * ratio
    amax = ratio * (rng.uniform(1.2, 4.0) if lively else log_uniform(rng, 0.4, 4.0))
    wmax = min(wmax, 0.7 * amax)
    s0 = fc / zc
    law, p, share = _friction(rng, fc, wmax, 2 * rng.uniform(0.1, 0.7) * np.sqrt(s0 * j))
    stiff = (
        s0 * share * np.sort(rng.uniform(0.4, 2.5, share.size))[::-1] if share.size > 1 else None
    )
    fs = float(rng.choice([1000, 2000] if exact else [1000, 2000, 4000, 8000]))
    m = Machine(name, law, p, np.array([s0]) if stiff is None else stiff, share, wmax, amax,
                0.0, log_uniform(rng, *counts), fs, 1)  # fmt: skip
    m.stroke = float(np.clip(wmax * rng.uniform(0.3, 1.6), *stroke))
    m.stroke = max(m.stroke, 1.2 * wmax**2 / amax) if name != "hobby" else m.stroke
    p["J"] = j
    wn = np.sqrt(m.stiffness.sum() / j)
    m.nsub = int(max(2 if fs > 2000 else 4, np.ceil(wn / fs / 0.08)))
    _loop(rng, m, slow_loop)
    return m


def spindle(m: Machine, seconds: float) -> None:
    """Ease all friction so that the drive coasts for about ``seconds``."""
    factor = m.wmax * m.P["J"] / m.P["Fc"] / seconds
    for name in ("Fc", "Fs", "Fv"):
        m.P[name] *= factor
    m.P["sigma1"] *= np.sqrt(factor)  # the same damping ratio at rest
    m.stiffness = m.stiffness * factor
    m.amax = max(m.amax * min(1.0, factor), 2.0 * m.P["Fs"] / m.P["J"])


def _loop(rng: Generator, m: Machine, dead: float) -> None:
    """Gains of the loop: bandwidth that the rate, the encoder and a dead time allow."""
    p = m.P
    q = 2 * np.pi / m.counts
    wv = 2 * np.pi * log_uniform(rng, 5, 50)
    wv = min(wv, m.fs / 14, 0.35 / (dead + 2 / m.fs))
    for _ in range(40):  # counting noise must not shake the drive
        lp = 1.0 - np.exp(-6.0 * wv / m.fs)
        if p["J"] * wv * q * m.fs * lp < 0.15 * p["Fc"]:
            break
        wv *= 0.9
    p.update(q=q, lp=lp, kv=p["J"] * wv, ki=0.0, kpp=0.0, vff=1.0)
    p.update(umax=1e9, Jff=0.0, Fff=0.0, wff=0.05 * m.wmax, Fvff=0.0, uq=0.0)
    m.about["bandwidth"] = wv


def steer(rng: Generator, m: Machine, mode: str) -> None:
    """Control structure: ``cascade``, ``pd``, ``velocity`` or ``open``."""
    p, wv = m.P, m.about["bandwidth"]
    viscous = p["Fv"] * m.wmax ** (p["power"] - 1.0)
    if mode == "cascade":
        p.update(kpp=wv / rng.uniform(4, 7), ki=p["kv"] * wv / rng.uniform(4, 10))
        p["vff"] = float(rng.choice([0.0, 1.0, 1.0]))
        p["Jff"] = p["J"] * float(rng.choice([0.0, 0.9]))
    elif mode == "pd":
        p.update(kpp=wv / rng.uniform(2, 4), Fff=0.9 * p["Fc"], Fvff=0.9 * viscous)
        p["Jff"] = p["J"] * float(rng.choice([0.0, 0.85, 1.1]))
    elif mode == "velocity":
        p.update(ki=p["kv"] * wv / rng.uniform(3, 8))
    else:
        p.update(kv=0.0, vff=0.0)
    most = p["J"] * m.amax * 2 + p["Fs"] * 2 + 1.5 * viscous * m.wmax + 1.5 * p.get("grav", 0.0)
    p["umax"] = most * rng.uniform(1.0, 1.6)
    p["uq"] = p["umax"] / float(rng.choice([2000, 8000, 32000]))

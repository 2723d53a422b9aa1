"""What the drive's log holds of the true motion, and what its owner declares."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.random import Generator
from scipy.signal import lfilter

from . import kernel as k
from .machine import Machine, log_uniform


def _low_pass(x: np.ndarray, tau: float, fs: float) -> np.ndarray:
    a = np.exp(-1.0 / (fs * tau))
    return lfilter([1 - a], [1, -a], x, zi=[a * x[0]])[0]


def _rows(rng: Generator, m: Machine, n: int, f_log: float) -> tuple[np.ndarray, np.ndarray, str]:
    """Ticks that are logged, their stamps [s], and how they come."""
    step = int(round(m.fs / f_log))
    rows = np.arange(0, n, step)
    if rng.random() < 0.6:
        return rows, rows / m.fs, "even"
    if step >= 4:  # the logging task comes late now and then
        late = np.minimum(
            rng.integers(0, step // 2, rows.size), rng.integers(0, step // 2 + 1, rows.size)
        )
        rows = np.minimum(rows + late, n - 1)
        return rows, np.round(rows / m.fs, 5), "late rows"
    noise = rng.uniform(-0.12, 0.12, rows.size) / f_log
    return rows, np.round(rows / m.fs + noise, 6), "jittered stamps"


def _current(rng: Generator, m: Machine, u: np.ndarray, filtered: bool, about: dict) -> np.ndarray:
    """Measured current as torque, one value per tick; noise comes with the rows."""
    if filtered and rng.random() < 0.5:
        about["u_low_pass"] = tau = log_uniform(rng, 2e-4, 1.2e-3)
        u = _low_pass(u, tau, m.fs)
    if filtered and rng.random() < 0.4:
        about["u_average"] = width = max(1, int(rng.uniform(0.5e-3, 3e-3) * m.fs))
        c = np.cumsum(np.concatenate([np.full(width, u[0]), u]))
        u = (c[width:] - c[:-width]) / width
    return u


def _speed(
    rng: Generator, m: Machine, out: np.ndarray, theta: np.ndarray, about: dict
) -> np.ndarray | None:
    """The speed column, one value per tick, or None."""
    kind = str(rng.choice(["absent", "tacho", "difference"], p=[0.4, 0.25, 0.35]))
    about["speed"] = kind
    if kind == "absent":
        return None
    if kind == "tacho":
        w = _low_pass(out[:, k.W], log_uniform(rng, 2e-4, 1.5e-3), m.fs)
        cycles = float(rng.choice([11, 22, 37]))
        w = w * (1 + rng.uniform(0.001, 0.006) * np.sin(cycles * out[:, k.TH]))
        return w + m.wmax * rng.uniform(0.0005, 0.004) * rng.standard_normal(w.size)
    raw = np.diff(theta, prepend=theta[0]) * m.fs
    return _low_pass(raw, log_uniform(rng, 1e-3, 8e-3), m.fs)


def record(
    rng: Generator, m: Machine, out: np.ndarray, f_log: float, actuator: bool, angle: bool
) -> tuple[dict, dict]:
    """The log as arrays, and what was done to it.

    ``actuator``: u must not be filtered; ``angle``: the position must be there.
    """
    about: dict[str, Any] = {"rate": f_log}
    rows, t, about["stamps"] = _rows(rng, m, len(out), f_log)
    q = 2 * np.pi / m.counts
    lines = m.counts / 4
    error = rng.uniform(0.05, 0.6) * q if rng.random() < 0.7 else 0.0
    theta = out[:, k.TH] + error * np.sin(lines * out[:, k.TH])
    theta = q * np.floor(theta / q)
    about["interpolation_error"] = error
    u, sigma = out[:, k.UCMD], 0.0
    about["torque"] = str(rng.choice(["command", "current"]))
    if about["torque"] == "current":
        u = _current(rng, m, u, not actuator, about)
        sigma = m.P["Fc"] * log_uniform(rng, 0.004, 0.04)
    u = u[rows] + sigma * rng.standard_normal(rows.size)
    if sigma:
        u = u + m.P["Fc"] * rng.uniform(-0.004, 0.004) * t / t[-1]
        grain = m.P["umax"] / float(rng.choice([256, 1024, 4096]))
        u = grain * np.round(u / grain)
    about["u_noise"] = sigma
    w = _speed(rng, m, out, theta, about)
    log = {"t": t, "u": u, "theta": theta[rows]}
    if w is not None:
        log["w"] = w[rows]
        if about["speed"] == "tacho" and rng.random() < 0.5 and not angle:
            del log["theta"]
    _outliers(rng, log, about)
    return log, about


def _outliers(rng: Generator, log: dict, about: dict) -> None:
    """A few wild values in one channel of a few records."""
    about["outliers"] = 0
    if rng.random() > 0.12:
        return
    name = str(rng.choice([x for x in log if x != "t"]))
    rows = rng.choice(log["t"].size - 20, int(rng.integers(1, 6)), replace=False) + 10
    log[name][rows] += (
        np.ptp(log[name]) * rng.uniform(0.4, 2.0, rows.size) * rng.choice([-1, 1], rows.size)
    )
    about.update(outliers=rows.size, outlier_channel=name, outlier_rows=rows)


def exact(m: Machine, out: np.ndarray, f_log: float) -> tuple[dict, dict]:
    """The log of ideal sensors."""
    rows = np.arange(0, len(out), int(round(m.fs / f_log)))
    log = {"t": rows / m.fs, "u": out[rows, k.UCMD], "theta": out[rows, k.TH], "w": out[rows, k.W]}
    return log, {
        "rate": f_log,
        "torque": "command",
        "speed": "exact",
        "stamps": "even",
        "u_noise": 0.0,
    }


def truth(m: Machine) -> dict[str, float]:
    """True values of the declared terms."""
    p = m.P
    keys = ["J", "Fc", "Fs"] if p["Fs"] > p["Fc"] else ["J", "Fc"]
    values = {x: p[x] for x in keys}
    if p["Fs"] > p["Fc"]:
        values["vs"] = p["vs"]
    if p["power"] == 1.0:
        values["Fv"] = p["Fv"]
    if m.friction == "lugre":
        values.update(sigma0=float(m.stiffness[0]), sigma1=p["sigma1"])
    if p["grav"]:
        values["gravity.amplitude"], values["gravity.phase"] = p["grav"], p["grav_phase"]
    return values


def declare(rng: Generator, m: Machine) -> dict[str, Any]:
    """The right structure with values 10-20 % off and a gap now and then."""
    p = m.P

    def off(x: float) -> float:
        return float(x * (1 + rng.choice([-1, 1]) * rng.uniform(0.1, 0.2)))

    plain = p["Fs"] == p["Fc"]
    name = "coulomb" if plain else "stribeck" if m.friction == "static" else "lugre"
    viscous = p["Fv"] * (0.6 * m.wmax) ** (p["power"] - 1.0)
    friction: dict[str, Any] = {"model": name, "Fc": off(p["Fc"]), "Fv": off(viscous)}
    if not plain:
        friction["Fs"] = max(off(p["Fs"]), 1.02 * friction["Fc"])
        friction["vs"] = off(p["vs"])
    if name == "lugre":
        friction["sigma0"], friction["sigma1"] = off(float(m.stiffness.sum())), off(p["sigma1"])
    for gap in ("Fs", "vs", "sigma0"):
        if rng.random() < 0.2:
            friction.pop(gap, None)
            if gap == "sigma0":
                friction.pop("sigma1", None)
    effects = []
    if p["grav"]:
        phase = np.angle(np.exp(1j * (p["grav_phase"] + rng.uniform(-0.1, 0.1))))
        effects = [{"name": "gravity", "amplitude": off(p["grav"]), "phase": float(phase)}]
    title = f"{m.type} drive"
    return {
        "name": title,
        "motion": "rotary",
        "plant": {"J": off(p["J"])},
        "friction": friction,
        "effects": effects,
    }

"""For tests of the simulator: open-loop set-ups and an independent integration of LuGre."""

from __future__ import annotations

import numpy as np
from scipy.integrate import solve_ivp

from .plant import OPEN_LOOP
from .run import FINE, Setup, drive_row, tune


def open_loop(machine, torque, rate=1000.0, theta0=0.0, step=FINE):
    """Set-up that applies this torque, without noise or quantisation."""
    refs = np.zeros((3, len(torque)))
    refs[2] = torque
    gains = tune(machine, OPEN_LOOP, rate, np.random.default_rng(0), False, False)
    drive = drive_row(machine, gains, 0.0, theta0)
    noise = np.zeros((1, len(torque)))
    return Setup(machine, OPEN_LOOP, refs, noise, rate, 0.0, theta0, drive, step)


def lugre_reference(m, torque, rate, extra=lambda t, th, w: 0.0):
    """Radau over each held sample; theta, w at the samples."""

    def slope(t, x, u):
        theta, w, z = x
        h = m.Fc + (m.Fs - m.Fc) * np.exp(-((w / m.vs) ** 2))
        dz = w - m.sigma0 * abs(w) / h * z
        force = m.sigma0 * z + m.sigma1 * dz + m.Fv * w
        return [w, (u - force - extra(t, theta, w)) / m.J, dz]

    x, rows = np.zeros(3), []
    scale = 1e-11 * np.array([1.0, 1.0, 1e-3])
    for k, u in enumerate(torque):
        rows.append(x[:2])
        span = (k / rate, (k + 1) / rate)
        x = solve_ivp(slope, span, x, "Radau", args=(u,), rtol=1e-8, atol=scale).y[:, -1]
    return np.array(rows).T


def wave(m, seconds, rate, peak=2.5):
    """Break away, reverse, stick, creep."""
    t = np.arange(int(seconds * rate)) / rate
    return t, peak * m.Fs * np.sin(2 * np.pi * t / seconds * 1.7) * np.abs(np.cos(9.0 * t))

"""Sampled loops about drawn drives: poles, sweeps, optima and friction in time.

Written beside the package: nothing of it is used.
"""

from __future__ import annotations

import control as ct
import numpy as np

from . import drives

ZETA = {"P-PI": (1.0, 1.15, 1.4, 1.8), "PID": (0.7, 0.8, 1.0, 1.4), "PI": (1.0,)}


def controller(gains, z, dt):
    """-u/theta of u = -(kp e + ki int e + kd w): trapezoids, and a difference."""
    kp, ki, kd = gains
    return kp + ki * dt / 2 * (z + 1) / (z - 1) + kd * (1 - 1 / z) / dt


def polynomials(one, dt):
    """Of the notch (frequency in Hz, damping, depth): bilinear, with the frequency kept."""
    f, damping, depth = one
    W = 2 * np.pi * f
    c, (square, cross, both) = W / np.tan(W * dt / 2), np.array([[1, -2, 1], [1, 0, -1], [1, 2, 1]])
    return [c**2 * square + 2 * d * W * c * cross + W**2 * both for d in (depth * damping, damping)]


def notch(one, z, dt):
    if one is None:
        return np.ones_like(z)
    num, den = polynomials(one, dt)
    return np.polyval(num, z) / np.polyval(den, z)


def frequencies(drive):
    """Dense, and denser about the modes."""
    end, ev = 0.9999 * np.pi * drive.rate, np.linalg.eigvals(drive.matrices()[0])
    light = [abs(x) * (1 + abs(x.real / x) * np.linspace(-12, 12, 301)) for x in ev if x.imag > 0]
    w = np.unique(np.concatenate([np.geomspace(0.05, end, 4000), *light]))
    return w[w < end]


def sensitivity(drive, gains, notched=None):
    """The peak of |1/(1 + L)| of the true drive."""
    w, dt = frequencies(drive), 1 / drive.rate
    z = np.exp(1j * w * dt)
    L = drive.response(w) / (1j * w) * controller(gains, z, dt) * notch(notched, z, dt)
    return 1 / np.abs(1 + L).min()


def stable(drive, gains, notched=None):
    """By the poles: the drive, a sample of delay, and the controller."""
    dt, (kp, ki, kd) = 1 / drive.rate, gains
    A, B = drive.matrices()
    a, b = drives.held(A, B[:, :1], dt)
    late = ct.ss([[0.0]], [[1.0]], [[1.0]], [[0.0]], dt)
    num, den = [kp + kd / dt, -kd / dt], [1, 0]
    if ki:
        num, den = (
            np.polyadd(np.convolve(num, [1, -1]), ki * dt / 2 * np.array([1, 1, 0])),
            [1, -1, 0],
        )
    L = ct.ss(a, b, np.eye(1, len(a)), 0, dt) * late * ct.ss(ct.tf(num, den, dt))
    if notched:
        L = L * ct.ss(ct.tf(*polynomials(notched, dt), dt))
    return np.abs(ct.feedback(L, 1).poles()).max() < 1


def optimum(drive, structure, Ms):
    """The bandwidth that known truth allows, by force: every shape, raised until |1 + L| < 1/Ms."""
    w, dt, J = frequencies(drive), 1 / drive.rate, drive.inertia
    G, z = drive.response(w) / (1j * w), np.exp(1j * w * dt)
    best = 0.0
    for mean in np.geomspace(0.05, 2.0, 22):
        for zeta in ZETA[structure]:
            c = 3.0
            while True:
                gains = _gains(structure, J, c, mean, zeta, dt)
                if np.abs(1 + G * controller(gains, z, dt)).min() < 1 / Ms:
                    break
                c *= 1.03
            gains = _gains(structure, J, c / 1.03, mean, zeta, dt)
            best = max(best, bandwidth(gains, J))
    return best


def _gains(structure, J, c, mean, zeta, dt):
    kp, m = J * c, mean * c
    if structure == "PID":
        return 2 * zeta * m * kp, kp * m**2, kp
    root = np.sqrt(zeta**2 - 1)
    kv, ki = (0.0, kp * m) if structure == "PI" else (m * (zeta - root), kp * m * (zeta + root))
    return kp * kv + ki, ki * kv, kp - ki * dt / 2


def width(drive, structure, gains, kv, notched=None):
    """-3 dB of theta/r, of a PI w/r, of the true drive; rad/s. ``gains`` are those of the PID."""
    w, dt, (kp, ki, kd) = frequencies(drive), 1 / drive.rate, gains
    w = w[w > 0]
    z = np.exp(1j * w * dt)
    L = drive.response(w) / (1j * w) * controller(gains, z, dt) * notch(notched, z, dt)
    slope, on_e = (1 - 1 / z) / dt, controller((kp, ki, 0), z, dt)
    on_r = {"PI": 1.0, "P-PI": kv / (kv + slope)}.get(structure, on_e / (on_e + kd * slope))
    return w[np.flatnonzero(np.abs(L / (1 + L) * on_r) < 10 ** (-3 / 20))[0]]


def bandwidth(gains, J):
    """The asymptote that the search makes as high as it can."""
    kp, ki, _ = gains
    return (ki / J) ** (1 / 3) if ki else (kp / J) ** 0.5

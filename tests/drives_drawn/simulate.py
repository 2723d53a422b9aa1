"""A drive on its controller, in fine steps: the physics of the drawn drives.

    J dw/dt = u(t - delay) - friction(w, z, t) - constant - G sin(theta + phase) - cogging

One step of length h is symmetric: half a step of the position and of the bristles, a step of the
speed that is implicit in all that is linear in the speed, and again half a step of the position.
The bristles of LuGre are integrated exactly for a given speed, those of Maxwell by their limits.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numba
import numpy as np

LAWS = ("lugre", "maxwell")
LOOPS = ("torque", "speed", "position")
ELEMENTS = 6  # of Maxwell-slip


@dataclass
class Machine:
    """SI units of a rotary drive. All torques are positive where the drive has to overcome them."""

    law: str
    J: float  # kg m2
    Fc: float  # N m
    Fv: float  # N m s, or N m (s/rad)^power
    power: float = 1.0  # of the viscous part: 0.8 is grease
    Fs: float = 0.0  # N m; Fc where there is no dip
    vs: float = 1.0  # rad/s
    bend: float = 2.0  # exponent of the dip
    stiffness: float = 0.0  # N m / rad, of the bristles
    damping: float = 0.0  # N m s / rad, of the bristles
    constant: float = 0.0  # N m
    gravity: float = 0.0  # N m
    phase: float = 0.0  # rad
    cogging: float = 0.0  # N m
    teeth: float = 12.0  # per radian of the position
    asymmetry: float = 0.0  # (Fc forward - Fc backward) / Fc
    warming: float = 0.0  # share by which Coulomb friction is higher at the start
    warms_in: float = 10.0  # s


@dataclass
class Loop:
    """What drives the machine: a reference, or a torque, at each instant of the controller."""

    kind: str  # of LOOPS
    w_ref: np.ndarray  # rad/s, at the instants of the controller
    theta_ref: np.ndarray  # rad
    torque: np.ndarray  # N m, beside the controller
    kp: float = 0.0  # N m s
    ki: float = 0.0  # N m
    kx: float = 0.0  # 1/s
    limit: float = np.inf  # N m


@dataclass
class Motion:
    """What happened, at the rows of the log; ``impulses`` are of the row that ends there."""

    t: np.ndarray
    theta: np.ndarray
    w: np.ndarray
    filtered: np.ndarray  # w behind a low-pass
    command: np.ndarray  # N m, as set at the row and held
    average: np.ndarray  # N m, mean of the command over the row that ends here
    impulses: np.ndarray  # (rows, 3) N m s: torque, friction, load
    work: np.ndarray  # (rows, 3) J
    machine: Machine = field(repr=False)


def simulate(machine, loop, rows, dt, per_row=50, updates=1, delay=0.0, lag=1e-3) -> Motion:
    """The motion at ``rows`` rows ``dt`` s apart, in ``per_row`` steps each.

    The controller acts ``updates`` times in a row and holds its torque, which acts ``delay`` s
    later, rounded to a step. ``lag`` (s) is that of the low-pass behind which w is logged.
    """
    per_row = int(np.ceil(per_row / updates)) * updates
    h = dt / per_row
    m = machine
    p = np.array(
        [m.J, m.Fc, m.Fv, m.power, max(m.Fs, m.Fc), m.vs, m.bend, m.stiffness, m.damping]
        + [m.constant, m.gravity, m.phase, m.cogging, m.teeth, m.asymmetry, m.warming, m.warms_in]
    )
    gains = np.array([loop.kp, loop.ki, loop.kx, loop.limit])
    out = np.zeros((rows, 11))
    references = (np.asarray(x, float) for x in (loop.w_ref, loop.theta_ref, loop.torque))
    late = int(round(delay / h))
    how = (LAWS.index(m.law), LOOPS.index(loop.kind), per_row, updates, late)
    _run(out, p, gains, *references, *how, h, np.exp(-h / lag))
    columns = [out[:, i].copy() for i in range(5)]
    return Motion(np.arange(rows) * dt, *columns, out[:, 5:8], out[:, 8:11], m)


@numba.njit(cache=True)
def _run(out, p, gains, w_ref, theta_ref, torque, law, kind, per_row, updates, late, h, keep):
    J = p[0]
    held = per_row // updates
    commands = np.zeros(len(out) * updates + 1)
    z = np.zeros(ELEMENTS)
    theta = w = filtered = integral = 0.0
    steps = (len(out) - 1) * per_row + 1
    sums = np.zeros(7)
    for i in range(steps):
        if i % held == 0:
            k = i // held
            u, integral = _control(k, theta, w, integral, gains, w_ref, theta_ref, torque, kind)
            commands[k] = u
        if i % per_row == 0:
            row = i // per_row
            out[row, 0], out[row, 1], out[row, 2] = theta, w, filtered
            out[row, 3] = commands[i // held]
            out[row, 4] = sums[6] / per_row if row else commands[0]
            out[row, 5:11] = sums[:6]
            sums[:] = 0.0
        u = commands[(i - late) // held] if i >= late else 0.0
        level = 1.0 + p[15] * np.exp(-i * h / p[16])
        theta += 0.5 * h * w
        _stretch(z, w, 0.5 * h, p, law, level)
        force, c = _friction(z, w, p, law, level)
        load = p[9] + p[10] * np.sin(theta + p[11]) + p[12] * np.sin(p[13] * theta)
        after = ((J - 0.5 * h * c) * w + h * (u - force - load)) / (J + 0.5 * h * c)
        mean = 0.5 * (w + after)
        friction = force + c * mean
        w = after
        _stretch(z, w, 0.5 * h, p, law, level)
        theta += 0.5 * h * w
        filtered = w + (filtered - w) * keep
        sums[0] += h * u
        sums[1] += h * friction
        sums[2] += h * load
        sums[3] += h * u * mean
        sums[4] += h * friction * mean
        sums[5] += h * load * mean
        sums[6] += commands[i // held]


@numba.njit(cache=True)
def _control(k, theta, w, integral, gains, w_ref, theta_ref, torque, kind):
    """The torque to hold, and the integral of the speed error (in N m)."""
    if kind == 0:
        return torque[k], 0.0
    goal = w_ref[k] + (gains[2] * (theta_ref[k] - theta) if kind == 2 else 0.0)
    u = gains[0] * (goal - w) + integral + torque[k]
    clipped = min(max(u, -gains[3]), gains[3])
    if u == clipped:
        integral += gains[1] * (goal - w)
    return clipped, integral


@numba.njit(cache=True)
def _limit(w, p, level):
    """Sliding friction without the viscous part at speed w."""
    side = 0.5 * p[14] if w > 0 else -0.5 * p[14]
    dip = 0.0
    if p[4] > p[1]:
        dip = (p[4] - p[1]) * np.exp(-((abs(w) / p[5]) ** p[6]))
    return (p[1] + dip) * level * (1.0 + side)


@numba.njit(cache=True)
def _stretch(z, w, h, p, law, level):
    """Bristles over h s at a speed of w: z[0] in rad (LuGre), or torques (Maxwell)."""
    g = _limit(w, p, level)
    if law == 0:
        if w == 0.0:
            return
        end = np.sign(w) * g / p[7]
        z[0] = end + (z[0] - end) * np.exp(-abs(w) * h * p[7] / g)
        return
    for i in range(ELEMENTS):
        share = 2.0 * (i + 1) / (ELEMENTS * (ELEMENTS + 1))
        most = share * g
        z[i] = min(max(z[i] + p[7] / ELEMENTS * w * h, -most), most)


@numba.njit(cache=True)
def _friction(z, w, p, law, level):
    """Friction is force + c w: what does not depend on w within the step, and the slope c."""
    viscous = p[2]
    if p[3] != 1.0:
        viscous = p[2] * max(abs(w), 1e-9) ** (p[3] - 1.0)
    if law == 1:
        return z.sum(), viscous + p[8] * np.exp(-((w / p[5]) ** 2))
    g = _limit(w, p, level)
    slip = 1.0 - p[7] * z[0] * np.sign(w) / g
    fade = np.exp(-((w / p[5]) ** 2))
    return p[7] * z[0], viscous + p[8] * fade * max(slip, 0.0)

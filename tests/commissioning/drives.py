"""Drives drawn at random, with one, two or three masses and friction, and their logs.

Written beside the package: nothing of it is used but what ``answered`` asks. The linear part
advances exactly from one sub-step to the next; friction acts as an impulse of each, Coulomb's with
true sticking.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from numba import njit
from scipy.linalg import expm

import lugrectl as lg

SUBSTEP = 5e-5


@dataclass(frozen=True)
class Drive:
    """SI units; ``share`` of the friction acts on the last mass; ``counts`` per turn."""

    rate: float
    masses: tuple[float, ...]
    springs: tuple[float, ...]
    dampers: tuple[float, ...]
    first: float  # rad/s, the antiresonance of two masses
    most: float  # N m, torque limit
    Fc: float
    Fs: float
    vs: float
    Fv: float
    share: float
    distance: float  # rad, presliding; 0: Coulomb friction that sticks
    damping: float  # of the bristle against its critical one
    counts: float
    lag: float  # s, current loop
    noise: float  # N m, of the logged torque
    ripple: float  # N m, noise that acts
    seed: int

    @property
    def inertia(self) -> float:
        return sum(self.masses)

    def matrices(self) -> tuple[np.ndarray, np.ndarray]:
        """States theta1 w1 theta2 w2 ... torque; inputs command, friction on each end."""
        n = len(self.masses)
        A, B = np.zeros((2 * n + 1, 2 * n + 1)), np.zeros((2 * n + 1, 3))
        for i in range(n):
            A[2 * i, 2 * i + 1] = 1.0
        for i, (k, c) in enumerate(zip(self.springs, self.dampers, strict=True)):
            row = np.zeros(2 * n + 1)
            row[[2 * i, 2 * i + 1, 2 * i + 2, 2 * i + 3]] = k, c, -k, -c
            A[2 * i + 1] -= row / self.masses[i]
            A[2 * i + 3] += row / self.masses[i + 1]
        A[1, 1] -= self.Fv * (1.0 - self.share) / self.masses[0]
        A[2 * n - 1, 2 * n - 1] -= self.Fv * self.share / self.masses[-1]
        A[1, -1], A[-1, -1], B[-1, 0] = 1.0 / self.masses[0], -1.0 / self.lag, 1.0 / self.lag
        B[1, 1], B[2 * n - 1, 2] = -1.0 / self.masses[0], -1.0 / self.masses[-1]
        return A, B

    def response(self, w: np.ndarray) -> np.ndarray:
        """The exact response from the held command, which acts a sample late, to d theta/dt."""
        A, B = self.matrices()
        dt = 1.0 / self.rate
        a, b = held(A, B[:, :1], dt)
        z = np.exp(1j * w * dt)
        made = [np.linalg.solve(x * np.eye(len(a)) - a, b[:, 0])[0] for x in z]
        return np.array(made) * 1j * w / z

    def mode(self) -> tuple[float, float]:
        """The first antiresonance and resonance, rad/s."""
        M, K = np.diag(self.masses), np.zeros((len(self.masses),) * 2)
        for i, k in enumerate(self.springs):
            K[i : i + 2, i : i + 2] += k * np.array([[1.0, -1.0], [-1.0, 1.0]])
        both = [np.linalg.eigvals(np.linalg.solve(M[i:, i:], K[i:, i:])) for i in (1, 0)]
        low = [np.sqrt(np.sort(x.real)[i]) for i, x in enumerate(both)]
        return float(low[0]), float(low[1])


def held(A: np.ndarray, B: np.ndarray, dt: float) -> tuple[np.ndarray, np.ndarray]:
    n, m = B.shape
    both = expm(np.block([[A, B], [np.zeros((m, n + m))]]) * dt)
    return both[:n, :n], both[:n, n:]


def draw(seed: int, friction: bool = True) -> Drive:
    """A servo drive: rigid in 15 %, two masses in 65 %, three in 20 %."""
    g = np.random.default_rng(seed)
    rate = 1000.0 if g.random() < 0.75 else 500.0
    n = int(g.choice([1, 2, 3], p=[0.15, 0.65, 0.2]))
    J, ratio, first = 10 ** g.uniform(-4, -2), np.exp(g.uniform(-0.9, 1.4)), g.uniform(2.5, 4.1)
    first = 2 * np.pi * np.exp(first)
    load = J * ratio / (1 + ratio)
    masses, springs = [J], []
    if n > 1:
        masses, springs = [J - load, load], [first**2 * load]
    if n > 2:
        s = g.uniform(0.4, 0.7)
        masses, springs = [J - load, load * s, load * (1 - s)], springs * 2
        springs[1] *= g.uniform(1.2, 3.0)
    zeta = g.uniform(0.01, 0.05)
    most = J * np.exp(g.uniform(np.log(300), np.log(2000)))
    Fc = g.uniform(0.03, 0.15) * most * friction
    return Drive(
        rate,
        tuple(masses),
        tuple(springs),
        tuple(k * 2 * zeta / first for k in springs),
        first,
        most,
        Fc,
        Fc * g.uniform(1.0, 1.5),
        g.uniform(0.5, 5.0),
        g.uniform(0.001, 0.01) * 0.09 * most,
        0.0 if n == 1 or g.random() < 0.5 else g.uniform(0.1, 0.5),
        10 ** g.uniform(-4, -2.7) if g.random() < 0.6 else 0.0,
        g.uniform(0.05, 0.25),
        2.0 ** g.integers(13, 21),
        g.uniform(2e-4, 8e-4),
        3e-3 * most,
        2e-3 * most,
        seed,
    )


@njit(cache=True)
def _run(a, b, n, sub, dt, ref, vel, push, kv, Ti, kp, top, q, Fc, Fs, vs, share, s0, s1, shake):
    N, m = len(ref), len(a)
    x, new = np.zeros(m), np.zeros(m)
    theta, u = np.zeros(N), np.zeros(N)
    z, part, force = np.zeros(2), np.array([1 - share, share]), np.zeros(2)
    total, before, last, h = 0.0, 0.0, 0.0, dt / sub
    for k in range(N):
        theta[k] = np.floor(x[0] / q) * q
        e = vel[k] + kp * (ref[k] - theta[k]) - (theta[k] - last) / dt
        last = theta[k]
        wanted = kv * e + total + push[k]
        u[k] = min(max(wanted, -top), top)
        if u[k] == wanted:  # no windup
            total += kv / Ti * dt * e
        acting = before + shake[k]
        before = u[k]
        for _ in range(sub):
            for i in range(m):
                new[i] = b[i, 0] * acting
                for j in range(m):
                    new[i] += a[i, j] * x[j]
            for side in range(2):
                row = 1 if side == 0 else 2 * n - 1
                level = part[side] * (Fc + (Fs - Fc) * np.exp(-((x[row] / vs) ** 2)))
                if level <= 0.0:
                    force[side] = 0.0
                elif s0 > 0.0:
                    v, stiff = 0.5 * (x[row] + new[row]), part[side] * s0
                    end = np.sign(v) * level / stiff
                    old = z[side]
                    z[side] = end + (old - end) * np.exp(-abs(v) * h * stiff / level)
                    rate = (z[side] - old) / h
                    force[side] = stiff * 0.5 * (z[side] + old) + part[side] * s1 * rate
                else:  # what stops the mass within the sub-step, up to the level
                    force[side] = min(max(-new[row] / b[row, 1 + side], -level), level)
            for i in range(m):
                x[i] = new[i] + b[i, 1] * force[0] + b[i, 2] * force[1]
    return theta, u


def multisine(g, n, rate, period, top):
    """Flat, random phases, RMS 1."""
    one = int(period * rate)
    X = np.zeros(one // 2 + 1, complex)
    X[1 : int(top * period)] = np.exp(2j * np.pi * g.random(int(top * period) - 1))
    x = np.fft.irfft(X, one)
    return np.tile(x / x.std(), n // one + 1)[:n]


def jogs(g, drive: Drive, n: int) -> np.ndarray:
    """Speeds of moves that mostly reverse, 0.25 to 0.8 s each, up to 60 rad/s."""
    dt, v, k, side = 1.0 / drive.rate, np.zeros(n), int(0.1 * drive.rate), 1.0
    steep = 0.35 * drive.most / drive.inertia
    while k < n - int(0.5 * drive.rate):
        top, length = g.uniform(0.15, 1.0) * min(60.0, 0.2 * steep), g.uniform(0.25, 0.8)
        side *= -1.0 if g.random() < 0.8 else 1.0
        t = np.arange(int(length * drive.rate)) * dt
        move = side * np.minimum(top, np.minimum(steep * t, steep * (length - t)))
        v[k : k + len(t)] = move[: n - k]
        k += len(t) + int(g.uniform(0.0, 0.3) * drive.rate)
    return v


def timid(drive: Drive) -> float:
    """The bandwidth of a P-PI loop, rad/s, of 8 Hz at most, with |1/(1 + L)| below 2."""
    w = np.geomspace(3.0, 0.98 * np.pi * drive.rate, 1500)
    P, wc = drive.response(w), min(2 * np.pi * 8, 0.3 * drive.first)
    while True:
        L = P * drive.inertia * wc * (1 + wc / 5 / (1j * w)) ** 2
        if np.abs(1 + L).min() > 0.5:
            return wc
        wc /= 1.25


def log(drive: Drive, seconds: float = 30.0, sine: float = 0.1, moving: bool = True, run: int = 0):
    """A log in closed loop: jogs and a multisine on the speed reference, whose torque would be
    ``sine`` of the limit. ``moving``: with the jogs."""
    g = np.random.default_rng([drive.seed, run])
    n, dt = int(seconds * drive.rate), 1.0 / drive.rate
    v = jogs(g, drive, n) * moving
    kv = drive.inertia * timid(drive)
    more = multisine(g, n, drive.rate, 4.0, 0.45 * drive.rate) * sine * drive.most / kv
    return played(drive, np.cumsum(v) * dt, v + more, g)


def played(drive: Drive, angle: np.ndarray, speed: np.ndarray, g: np.random.Generator):
    """The log of a timid P-PI loop with these references."""
    n, dt, wc = len(angle), 1.0 / drive.rate, timid(drive)
    A, B = drive.matrices()
    sub = round(dt / SUBSTEP)
    s0 = drive.Fc / drive.distance if drive.distance else 0.0
    theta, u = _run(
        *held(A, B, dt / sub),
        len(drive.masses),
        sub,
        dt,
        angle,
        speed,
        np.zeros(n),
        drive.inertia * wc,
        5 / wc,
        wc / 5,
        drive.most,
        2 * np.pi / drive.counts,
        drive.Fc,
        drive.Fs,
        drive.vs,
        drive.share,
        s0,
        drive.damping * np.sqrt(s0 * drive.inertia),
        g.normal(0.0, drive.ripple, n),
    )
    u = u + g.normal(0.0, drive.noise, n)
    return {"t": dt * np.arange(n), "u": u, "theta": theta, "r": speed}


@cache
def answered(seed: int, seconds: float = 16.0, columns=("t", "u", "theta", "r")):
    """The response of the log of a drive, with friction taken out."""
    made = log(draw(seed), seconds)
    return lg.frequency_response({k: made[k] for k in columns}, lg.Model.of())

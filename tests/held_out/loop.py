"""The sampled controller with its sensors, around the mechanics."""

import numpy as np
from numba import njit

from .plant import TH, THL, WL, T, U, W, actuate, drift, kick, warmth

SENSOR = "q kind tau w_noise th_noise ecc ecc_n ecc_ph edge_min w_q".split()
SENSOR_TYPE = np.dtype([(name, "f8") for name in SENSOR])
CONTROL = "kp kv ki wmax umax relay hyst relay_speed u_q".split()
CONTROL_TYPE = np.dtype([(name, "f8") for name in CONTROL])
# what a run gives, one row a period of the controller, at its beginning
COLUMNS = "theta w u cmd read w_read theta_load w_load friction field inner u_mean".split()
DIFFERENCE, EDGES, TACHO = 0, 1, 2


def record(dtype: np.dtype, /, **values: float) -> np.ndarray:
    """A record of settings: what is not given is zero."""
    r = np.zeros(1, dtype)
    for name, value in values.items():
        r[0][name] = value
    return r


@njit(cache=True)
def seen(s, th):
    """The angle that a sensor with an eccentric disc shows, before its steps."""
    return th + s.ecc * np.sin(s.ecc_n * th + s.ecc_ph) if s.ecc != 0.0 else th


@njit(cache=True)
def edge(s, e, th, t, h):
    """Remember when the last encoder edge passed; the time within the step is exact."""
    now = seen(s, th)
    n = np.floor(now / s.q)
    if n != e[0]:
        line = (n if n > e[0] else n + 1.0) * s.q
        e[1] = line
        e[2] = t - h * abs((now - line) / (now - e[3])) if now != e[3] else t
    e[0], e[3] = n, now


@njit(cache=True)
def speed(s, e, m, read, w, Tc, t, noise):
    """The speed as the firmware computes it; m holds its memory: angle, speed, edge."""
    if s.kind == 2:
        raw = w + noise * s.w_noise
    elif s.kind == 1:
        if e[2] > m[3]:  # a new edge since the last time
            raw = (e[1] - m[2]) / (e[2] - m[3])
            m[2], m[3], m[4] = e[1], e[2], raw
        else:  # no edge: it cannot be faster than one line in the time gone by
            most = s.q / max(t - m[3], 1e-9)
            raw = max(min(m[4], most), -most)
            if most < s.edge_min:
                raw = 0.0
    else:
        raw = (read - m[0]) / Tc
    m[0] = read
    m[1] += (raw - m[1]) * (1.0 - np.exp(-Tc / s.tau) if s.tau > 0 else 1.0)
    return np.round(m[1] / s.w_q) * s.w_q if s.w_q > 0 else m[1]


@njit(cache=True)
def control(c, k, m, r, vr, uff, on, read, w_read, Tc):
    """The torque command of a period; k holds the integral and the relay's side."""
    if not on:
        k[0] = 0.0
        return 0.0
    if c.relay > 0:
        e = r - (w_read if c.relay_speed > 0 else read)
        if e > c.hyst:
            k[1] = 1.0
        elif e < -c.hyst:
            k[1] = -1.0
        return uff + c.relay * k[1]
    want = vr + c.kp * (r - read)
    e = min(max(want, -c.wmax), c.wmax) - w_read
    u = uff + c.kv * e + k[0]
    if abs(u) < c.umax or u * e < 0:
        k[0] += c.ki * Tc * e
    u = min(max(u, -c.umax), c.umax)
    return np.round(u / c.u_q) * c.u_q if c.u_q > 0 else u


@njit(cache=True)
def run(p, s, c, refs, noise, load, Tc, m):
    """Run the drive for all periods, m steps each; the columns are COLUMNS."""
    n, h = refs.shape[0], Tc / m
    out = np.zeros((n, 12))
    x, sums, k = np.zeros(8), np.zeros(3), np.array([0.0, 1.0])
    x[TH] = x[THL] = p.theta0
    read = np.floor(seen(s, x[TH]) / s.q) * s.q
    e = np.array([np.floor(seen(s, x[TH]) / s.q), read, 0.0, seen(s, x[TH])])
    mem = np.array([read, 0.0, read, 0.0, 0.0])
    commands = np.zeros(n)
    for i in range(n):
        t = i * Tc
        read = np.floor((seen(s, x[TH]) + s.th_noise * noise[i, 0]) / s.q) * s.q
        w_read = speed(s, e, mem, read, x[W], Tc, t, noise[i, 1])
        u = control(c, k, mem, refs[i, 0], refs[i, 1], refs[i, 2], refs[i, 3], read, w_read, Tc)
        commands[i] = u
        row = out[i]
        row[0], row[1], row[3], row[4], row[5] = x[TH], x[W], u, read, w_read
        row[6], row[7] = x[THL], x[WL]
        warm = warmth(p, t)
        sums[:] = 0.0
        total = 0.0
        for j in range(m):
            x[T] = t + j * h
            back = int(np.floor((x[T] - p.delay) / Tc + 1e-9))
            actuate(p, x, commands[back] if back >= 0 else 0.0, h)
            if j == 0:
                row[2] = x[U]
            total += x[U]
            kick(p, x, 0.5 * h, load[i], warm, sums)
            drift(p, x, h, warm)
            x[T] += h
            kick(p, x, 0.5 * h, load[i], warm, sums)
            edge(s, e, x[TH], x[T], h)
        row[8], row[9], row[10] = sums[0] / Tc, sums[1] / Tc, sums[2] / Tc
        row[11] = total / m
    return out

"""A drive with friction under its sampled controller, in small steps, compiled.

    J dw/dt = u - friction(w) - const - grav sin(theta + grav_ph) - the rest

A step is half a kick (torques change the speed), a drift (speeds change angles and bristles) and
half a kick again: second order. Dry friction without bristles is a set-valued force: a kick that
it can stop leaves the speed at exactly zero. Bristles are advanced by the exact solution for
constant speed, however stiff they are.
"""

import numpy as np
from numba import njit

SETTINGS = """
J JL kc cc gap FL s0 s1 Fc Fs vs Fv asym_c asym_v quad pos_a pos_n pos_ph warm warm_tau load_mu
grav grav_ph const rip_a rip_n rip_ph cog_a cog_n cog_ph bump_a bump_at bump_width spring_k spring_0
stop_hi stop_k lag dead sat step_t step_J step_F step_const sin_a sin_f sin_ph cable_F cable_d
rand_a rand_f delay theta0 q tacho tau w_noise ecc ecc_n ecc_ph w_lag kp kv ki wmax umax u_q
""".split()
ABSENT = {"stop_hi": 1e9, "sat": 1e9, "step_t": 1e9, "vs": 1.0, "cable_d": 1.0, "warm_tau": 1.0}
ABSENT |= {"bump_width": 1.0, "wmax": 1e9}
# what a run gives, a row at the beginning of each period of the controller
COLUMNS = "theta w u cmd read w_read u_mean".split()
# the state: motor angle and speed, bristle, load angle and speed, cable, torque, time
TH, W, Z, THL, WL, ZC, U, T = range(8)


def settings(values: dict):
    """The record that `run` takes: what is not given is absent."""
    made = np.zeros(1, [(name, "f8") for name in SETTINGS])
    for name, value in {**ABSENT, **values}.items():
        made[0][name] = value
    return made[0]


@njit(cache=True)
def dry(p, x):
    """The dry friction's size at the state's speed, angle, time and load."""
    g = p.Fc
    if p.Fs > p.Fc:
        g += (p.Fs - p.Fc) * np.exp(-((x[W] / p.vs) ** 2))
    g *= 1.0 + p.asym_c * np.sign(x[W])
    g *= 1.0 + p.warm * np.exp(-x[T] / p.warm_tau)
    g *= 1.0 + p.pos_a * np.sin(p.pos_n * x[TH] + p.pos_ph)
    if x[T] >= p.step_t:
        g *= 1.0 + p.step_F
    return g + p.load_mu * abs(x[U])


@njit(cache=True)
def field(p, x, load):
    """Torques against the motor that depend on angle and time only."""
    th, t = x[TH], x[T]
    f = p.const + p.rand_a * load + p.spring_k * (th - p.spring_0) + p.cable_F * x[ZC] / p.cable_d
    f += p.rip_a * np.sin(p.rip_n * th + p.rip_ph) + p.cog_a * np.sin(p.cog_n * th + p.cog_ph)
    f += p.sin_a * np.sin(2 * np.pi * p.sin_f * t + p.sin_ph)
    f += p.stop_k * max(th - p.stop_hi, 0.0)
    if p.bump_a != 0.0:
        d = (th - p.bump_at + np.pi) % (2 * np.pi) - np.pi
        f += p.bump_a * np.exp(-0.5 * (d / p.bump_width) ** 2)
    if p.JL == 0.0:
        f += p.grav * np.sin(th + p.grav_ph)
    return f + p.step_const if t >= p.step_t else f


@njit(cache=True)
def coupling(p, x):
    """The torque that the motor hands to the load: none within the gap, and it never pulls."""
    if p.JL == 0.0:
        return 0.0
    d, dw = x[TH] - x[THL], x[W] - x[WL]
    if p.gap == 0.0:
        return p.kc * d + p.cc * dw
    if abs(d) < p.gap:
        return 0.0
    side = np.sign(d)
    return side * max(p.kc * (abs(d) - p.gap) + side * p.cc * dw, 0.0)


@njit(cache=True)
def shrink(v, by):
    """What dry friction leaves of a speed: it stops, it never turns."""
    return np.sign(v) * max(abs(v) - by, 0.0)


@njit(cache=True)
def kick(p, x, h, load):
    """The torques act for a time h at constant angles."""
    g, inner = dry(p, x), coupling(p, x)
    J = p.J * (1.0 + p.step_J) if x[T] >= p.step_t else p.J
    b = p.Fv * (1.0 + p.asym_v * np.sign(x[W])) * (1.0 + p.warm * np.exp(-x[T] / p.warm_tau))
    b += p.quad * abs(x[W])
    push = x[U] - field(p, x, load) - inner
    if p.s0 > 0:  # bristles, and their damping by the share of the speed that still bends them
        b += p.s1 * (1.0 - p.s0 * x[Z] * np.sign(x[W]) / g)
        push -= p.s0 * x[Z]
    a = 0.5 * h * b / J
    x[W] = (x[W] * (1.0 - a) + h / J * push) / (1.0 + a)
    if p.s0 == 0:
        x[W] = shrink(x[W], h * g / J)
    if p.JL > 0:
        f = inner - p.grav * np.sin(x[THL] + p.grav_ph)
        x[WL] = shrink(x[WL] + h * f / p.JL, h * p.FL / p.JL)


@njit(cache=True)
def drift(p, x, h):
    """The speeds act for a time h."""
    v, side = x[W], np.sign(x[W])
    if p.s0 > 0 and v != 0.0:
        end = side * dry(p, x) / p.s0
        x[Z] = end + (x[Z] - end) * np.exp(-h * v / end)
    if p.cable_F != 0.0 and v != 0.0:
        end = side * p.cable_d
        x[ZC] = end + (x[ZC] - end) * np.exp(-h * v / end)
    x[TH] += h * v
    x[THL] += h * x[WL]
    x[T] += h


@njit(cache=True)
def run(p, refs, noise, load, Tc, m):
    """All periods, m steps each. refs: position, speed, torque, whether the loop is closed."""
    n, h = len(refs), Tc / m
    out = np.zeros((n, 7))
    x, total = np.zeros(8), 0.0
    x[TH] = x[THL] = p.theta0
    old = np.floor(p.theta0 / p.q) * p.q
    slow = 0.0  # the speed as the firmware filters it
    share = 1.0 - np.exp(-Tc / p.tau)
    for i in range(n):
        read = np.floor((x[TH] + p.ecc * np.sin(p.ecc_n * x[TH] + p.ecc_ph)) / p.q) * p.q
        raw = x[W] + noise[i] * p.w_noise if p.tacho > 0 else (read - old) / Tc
        slow, old = slow + share * (raw - slow), read
        want = min(max(refs[i, 1] + p.kp * (refs[i, 0] - read), -p.wmax), p.wmax)
        u = refs[i, 2] + p.kv * (want - slow) + total
        if abs(u) < p.umax or u * (want - slow) < 0:
            total += p.ki * Tc * (want - slow)
        u = min(max(u, -p.umax), p.umax)
        if p.u_q > 0:
            u = np.round(u / p.u_q) * p.u_q
        if refs[i, 3] == 0:
            u = total = 0.0
        row = out[i]
        row[0], row[1], row[3], row[4], row[5] = x[TH], x[W], u, read, slow
        for j in range(m):
            x[T] = i * Tc + j * h
            back = int(np.floor((x[T] - p.delay) / Tc + 1e-9))
            told = shrink(out[back, 3], p.dead) if back >= 0 else 0.0
            told = min(max(told, -p.sat), p.sat)
            x[U] = told if p.lag == 0 else x[U] + (told - x[U]) * (1.0 - np.exp(-h / p.lag))
            if j == 0:
                row[2] = x[U]
            row[6] += x[U] / m
            kick(p, x, 0.5 * h, load[i])
            drift(p, x, h)
            kick(p, x, 0.5 * h, load[i])
    return out

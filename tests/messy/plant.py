"""The plant and its drive, integrated sample by sample.

The loop runs at 4 kHz, the plant with ``sub`` substeps in each sample. A bristle is advanced by the
exact solution at constant velocity, so that a stiff one needs no finer step.
"""

from __future__ import annotations

import numpy as np

try:
    from numba import njit
except ImportError:  # the same code, slower

    def njit(**_):
        return lambda function: function


LUGRE, MAXWELL, ELASTOPLASTIC, KARNOPP = range(4)
TORQUE, VELOCITY, POSITION = range(3)
RATE = 4000.0
ROOM = 64  # samples of command that a delay may hold back


@njit(cache=True)
def friction(v, z, h, level, law, fc, fs, vs, delta, s0, s1, shares, stiff):
    """Bristle torque over one substep of constant velocity; ``z`` is advanced in place."""
    g = level * (fc + (fs - fc) * np.exp(-((abs(v) / vs) ** delta)))
    if law == MAXWELL:
        total = 0.0
        for i in range(len(shares)):
            limit = shares[i] * g / (stiff[i] * s0)
            z[i] = min(max(z[i] + h * v, -limit), limit)
            total += stiff[i] * s0 * z[i]
        return total + s1 * v * np.exp(-((abs(v) / vs) ** 2))
    share = 1.0
    if law == ELASTOPLASTIC:
        top, low = g / s0, 0.6 * g / s0
        if z[0] * v < 0 or abs(z[0]) <= low:
            share = 0.0
        elif abs(z[0]) < top:
            share = 0.5 + 0.5 * np.sin(np.pi * (abs(z[0]) - 0.5 * (top + low)) / (top - low))
    rate = share * s0 * abs(v) / g
    if rate * h > 1e-9:
        keep = np.exp(-rate * h)
        new = keep * z[0] + (1.0 - keep) * v / rate
    else:
        new = z[0] + h * v
    slope = (new - z[0]) / h
    mean = 0.5 * (new + z[0])
    z[0] = new
    return s0 * mean + s1 * slope


@njit(cache=True)
def simulate(
    mode, ref, dref, ddref, gains, encoder, tacho, plant, law, shares, stiff, back, load, drive, sub
):
    """One run; rows of the result at the control rate: theta, w, u commanded, u acting, bristle
    and viscous friction, torque of the shaft, acceleration, velocity and position as measured.

    ``gains``: kp, ki, kx, feed-forward inertia, feed-forward friction, limit, filter, hold.
    ``plant``: J, Fc, Fs, vs, delta, sigma0, sigma1, Fv, power.
    ``encoder``: counts, size and (order, phase) of its ripple; ``tacho``: its noise, or huge.
    ``back``: by time the friction level, the viscous level, a resisting torque and the inertia,
    and the rows (kind, a, b, c) of the effects that depend on the motion.
    ``load``: inertia, stiffness, damping, gap; ``drive``: delay in samples, lag, dead zone, and
    ratio, order and phase of the ripple of the torque constant.
    """
    j, fc, fs, vs, delta, s0, s1, fv, power = plant
    kp, ki, kx, jff, fff, limit, smooth, hold = gains
    count, size, phase = encoder
    level_t, warm_t, torque_t, inertia_t, side = back
    ts = 1.0 / RATE
    h = ts / sub
    n = len(ref)
    out = np.zeros((10, n))
    z = np.zeros(len(shares))
    queue = np.zeros(ROOM)
    quantum = 2 * np.pi / count
    theta, w = 0.0, 0.0
    if mode != TORQUE:
        theta, w = ref[0], dref[0]
    angle, speed = theta, w  # of the load
    seen = np.floor((theta + size * np.sin(phase[0] * theta + phase[1])) / quantum) * quantum
    estimate, integral, acting, u = w, 0.0, 0.0, 0.0
    delay, lag, dead, ripple, order, shift = drive
    whole = int(delay)
    part = delay - whole
    for k in range(n):
        now = np.floor((theta + size * np.sin(phase[0] * theta + phase[1])) / quantum) * quantum
        estimate += smooth * ((now - seen) / ts - estimate)
        seen = now
        heard = estimate
        if tacho[k] < 1e30:
            heard = w + tacho[k]
        if k % int(hold) == 0:
            if mode == TORQUE:
                u = ref[k]
            else:
                e = dref[k] - heard
                if mode == POSITION:
                    e += kx * (ref[k] - now)
                u = kp * e + integral + jff * ddref[k] + fff * np.tanh(dref[k] / (3 * vs))
                if abs(u) < limit:
                    integral += ki * e * ts * hold
                u = min(max(u, -limit), limit)
        for i in range(ROOM - 1, 0, -1):
            queue[i] = queue[i - 1]
        queue[0] = u
        late = (1 - part) * queue[whole] + part * queue[whole + 1]
        out[0, k], out[1, k], out[2, k] = theta, w, u
        start = w
        total_f = 0.0
        total_s = 0.0
        total_u = 0.0
        total_v = 0.0
        inertia = inertia_t[k]
        for _ in range(sub):
            if lag > 0:
                acting += (1 - np.exp(-h / lag)) * (late - acting)
            else:
                acting = late
            ua = acting
            if dead > 0:
                ua = 0.0 if abs(acting) <= dead else acting - np.sign(acting) * dead
            ua *= 1 + ripple * np.sin(order * theta + shift)
            level = level_t[k]
            extra = torque_t[k]
            sgn = np.tanh(w / (0.3 * vs))
            for r in range(len(side)):
                kind, a, b, c = side[r]
                if kind == 1:
                    extra += a * np.sin(b * theta + c)
                elif kind == 2:
                    level *= 1 + a * np.sin(b * theta + c)
                elif kind == 3:
                    level *= 1 + a * sgn
                elif kind == 4:
                    extra += a * abs(w)
                elif kind == 5:
                    extra += a * w * abs(w)
                elif kind == 6:
                    extra += a * (theta - b)
                elif kind == 7 and c * (theta - b) > 0:
                    extra += a * (theta - b)
                elif kind == 8:  # friction that grows with a load b sin(theta + c)
                    level *= 1 + a * abs(b * np.sin(theta + c)) / fc
                elif kind == 9:  # a bump of torque over the position
                    extra += a * np.exp(-(((theta - b) / c) ** 2))
                elif kind == 10:  # a rough patch
                    level *= 1 + a * np.exp(-(((theta - b) / c) ** 4))
                elif kind == 11:  # friction higher at middle speed
                    extra += a * sgn * np.exp(-(((abs(w) - b) / c) ** 2))
            shaft = 0.0
            jl, k_s, d_s, gap = load
            if jl > 0:
                twist = theta - angle
                if gap > 0:
                    open_ = max(abs(twist) - 0.5 * gap, 0.0) * np.sign(twist)
                    if open_ != 0.0:
                        shaft = k_s * open_ + d_s * (w - speed)
                        if shaft * open_ < 0:
                            shaft = 0.0
                else:
                    shaft = k_s * twist + d_s * (w - speed)
                speed += h * shaft / jl
                angle += h * speed
            viscous = fv * w if power == 1.0 else fv * np.sign(w) * abs(w) ** power
            viscous *= warm_t[k]
            if law == KARNOPP:
                g = level * (fc + (fs - fc) * np.exp(-((abs(w) / vs) ** delta)))
                free = w + h / inertia * (ua - extra - shaft - viscous)
                if abs(free) <= h / inertia * g:
                    bristle = free * inertia / h
                    w = 0.0
                else:
                    bristle = np.sign(free) * g
                    w = free - h / inertia * bristle
            else:
                bristle = friction(w, z, h, level, law, fc, fs, vs, delta, s0, s1, shares, stiff)
                w += h / inertia * (ua - extra - shaft - viscous - bristle)
            theta += h * w
            total_f += bristle
            total_s += shaft
            total_u += ua
            total_v += viscous
        out[3, k], out[4, k], out[5, k] = total_u / sub, total_f / sub, total_v / sub
        out[6, k], out[7, k], out[8, k] = total_s / sub, (w - start) / ts, heard
        out[9, k] = seen
    return out

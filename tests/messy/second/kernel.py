"""Time stepping of a servo drive: loop, actuator, friction, load and one effect.

``J dw/dt = u - F - r_e``. Each step drifts half a step, kicks, and drifts again; the bristles
follow their exact exponential (or slide at their limit), so the step may be long beside them.
"""

from __future__ import annotations

import math

import numpy as np

try:
    from numba import njit
except ImportError:  # the same code runs without it, about a hundred times slower

    def njit(**_):
        return lambda f: f


NAMES = (
    "J Fc Fs Fv vs delta power w0 relax sigma1 grav grav_phase "
    "rip rip_n rip_phase unb unb_phase offset asym warm warm_tau kt kt_n kt_phase "
    "kpp kv ki lp umax q Jff Fff wff Fvff vff uq"
).split()
(
    J, FC, FS, FV, VS, DELTA, POWER, W0, RELAX, S1, GRAV, GPHI,
    RIP, RIPN, RIPPHI, UNB, UNBPHI, OFF, ASYM, WARM, WTAU, KT, KTN, KTPHI,
    KPP, KV, KI, LP, UMAX, Q, JFF, FFF, WFF, FVFF, VFF, UQ,
) = range(len(NAMES))  # fmt: skip

TH, W, UCMD, UAPP, F0, RE, BG, ACC, FB = range(9)  # columns of the result, one row per tick


@njit(cache=True)
def _sign(x):
    return 1.0 if x > 0.0 else (-1.0 if x < 0.0 else 0.0)


@njit(cache=True)
def _bump(P, w):
    """Sliding level ``g(w)``, N m."""
    if P[FS] == P[FC]:
        return P[FC]
    return P[FC] + (P[FS] - P[FC]) * math.exp(-(abs(w / P[VS]) ** P[DELTA]))


@njit(cache=True)
def _friction_scale(code, e, t, th, w):
    """Factors of the sliding level and of the viscous term."""
    g = 1.0
    v = 1.0
    if code == 3:
        g = 1.0 + e[0] * math.sin(e[1] * th + e[2])
    elif code == 4:
        g = 1.0 + e[0] * _sign(w)
    elif code == 5:
        v = 1.0 + e[0] * _sign(w)
    elif code == 7:
        g = 1.0 + e[0] * (1.0 - math.exp(-t / e[1]))
        v = g
    elif code == 17 and t >= e[1]:
        g = 1.0 + e[0]
    return g, v


@njit(cache=True)
def _added(code, e, t, th, w, d):
    """Torque on the resisting side of the effects that simply add one."""
    r = 0.0
    if code == 0:
        r = e[0]
    elif code == 1:
        r = e[0] * math.sin(th + e[1])
    elif code == 2:
        r = e[0] * math.sin(e[1] * th + e[2])
    elif code == 6:
        r = e[0] * w * abs(w)
    elif code == 12:
        r = e[0] * (th - e[1])
    elif code == 13:
        r = e[0] * e[2] * max(0.0, (th - e[1]) * e[2])
    elif code == 18:
        r = e[0] * math.sin(2.0 * math.pi * e[1] * t + e[2])
    elif code == 20:  # two opposite bumps over position
        r = e[0] * (math.exp(-(((th - e[1]) / e[3]) ** 2)) - math.exp(-(((th - e[2]) / e[3]) ** 2)))
    elif code == 21:  # a hump over speed
        r = e[0] * math.tanh(w / e[3]) * math.exp(-(((abs(w) - e[1]) / e[2]) ** 2))
    elif code == 22:  # rubbing at one place
        r = e[0] * math.tanh(w / e[3]) * math.exp(-(((th - e[1]) / e[2]) ** 2))
    elif code == 23:  # bursts in time
        r = e[0] * d
    return r


@njit(cache=True)
def _move(P, z, K, share, w, level, h):
    """Carry the bristles over ``h`` at constant speed."""
    for i in range(z.size):
        zmax = share[i] * level / K[i]
        if P[RELAX] > 0.5:
            zs = zmax * _sign(w)
            z[i] = zs + (z[i] - zs) * math.exp(-abs(w) * h / zmax)
        else:
            z[i] = min(zmax, max(-zmax, z[i] + w * h))


@njit(cache=True)
def _bristle(P, z, K, share, w, level):
    """Bristle torque with its damping, N m; elements that slip lose theirs at speed."""
    f = 0.0
    for i in range(z.size):
        zmax = share[i] * level / K[i]
        if P[RELAX] > 0.5:
            zdot = w - abs(w) * z[i] / zmax
        else:
            zdot = w / (1.0 + (w / P[VS]) ** 2) if abs(z[i]) < zmax else 0.0
        f += K[i] * z[i] + P[S1] * share[i] * zdot
    return f


@njit(cache=True)
def _contact(code, e, x, v):
    """Coupling torque: spring and damper, through a gap that can only push."""
    if code == 14:
        return e[1] * x + e[2] * v
    gap = 0.5 * e[1]
    if x > gap:
        return max(0.0, e[2] * (x - gap) + e[3] * v)
    if x < -gap:
        return min(0.0, e[2] * (x + gap) + e[3] * v)
    return 0.0


@njit(cache=True)
def _command(P, ref, k, thm, wm, integral, fs):
    """Held command of tick ``k`` and the new integral."""
    ev = P[KPP] * (ref[0, k] - thm) + P[VFF] * ref[1, k] - wm
    u = P[KV] * ev + integral + P[JFF] * ref[2, k] + P[FVFF] * ref[1, k] + ref[3, k]
    u += P[FFF] * math.tanh(ref[1, k] / P[WFF])
    if abs(u) < P[UMAX]:
        integral += P[KI] * ev / fs
    u = min(P[UMAX], max(-P[UMAX], u))
    if P[UQ] > 0.0:
        u = P[UQ] * math.floor(u / P[UQ] + 0.5)
    return u, integral


@njit(cache=True)
def _actuate(P, code, e, u, th):
    """Torque at the shaft of a (delayed, lagged) current, and the background's part of it."""
    if code == 11:
        u = _sign(u) * max(0.0, abs(u) - e[0])
    full = u
    if code == 19:
        full = u * (1.0 + e[0] * math.sin(e[1] * th + e[2]))
    ripple = u * P[KT] * math.sin(P[KTN] * th + P[KTPHI])
    return full + ripple, -ripple


@njit(cache=True)
def run(P, K, share, ref, dist, code, e, fs, nsub, w_start):
    """Simulate ``n`` ticks; ``ref`` (4, n): position, speed, acceleration, torque.

    ``dist`` (n,) is an outside torque [N m], the effect itself for code 23. Returns (n, 9).
    """
    n = ref.shape[1]
    h = 1.0 / (fs * nsub)
    out = np.zeros((n, 9))
    z = np.zeros(K.size)
    z0 = np.zeros(K.size)
    scales = code == 3 or code == 4 or code == 5 or code == 7 or code == 8 or code == 17
    coupled = code == 14 or code == 15
    th, w, thl, wl, lag = ref[0, 0], w_start, ref[0, 0], w_start, 0.0
    thm_old, wm, integral = th, w_start, 0.0
    delay = int(round(e[0] / h)) if code == 9 else 0
    pull = 1.0 - math.exp(-h / e[0]) if code == 10 else 1.0
    for k in range(n):
        thm = P[Q] * math.floor(th / P[Q]) if P[Q] > 0.0 else th
        wm += P[LP] * ((thm - thm_old) * fs - wm) if k > 0 else 0.0
        thm_old = thm
        out[k, UCMD], integral = _command(P, ref, k, thm, wm, integral, fs)
        out[k, TH], out[k, W] = th, w
        for j in range(nsub):
            t = (k * nsub + j + 0.5) * h
            past = k * nsub + j - delay
            u = out[past // nsub, UCMD] if past >= 0 else 0.0
            lag += pull * (u - lag)
            th += 0.5 * h * w
            warm = 1.0 + P[WARM] * (1.0 - math.exp(-t / P[WTAU]))
            base = _bump(P, w) * (1.0 + P[ASYM] * _sign(w)) * warm
            visc = P[FV] * warm
            if P[POWER] != 1.0:
                visc *= (abs(w) + P[W0]) ** (P[POWER] - 1.0)
            load = P[GRAV] * math.sin(th + P[GPHI])
            g, v = _friction_scale(code, e, t, th, w)
            level = base * g + (e[0] * abs(load) if code == 8 else 0.0)
            _move(P, z, K, share, w, level, 0.5 * h)
            fb = _bristle(P, z, K, share, w, level)
            fb0 = fb
            if scales:
                _move(P, z0, K, share, w, base, 0.5 * h)
                fb0 = _bristle(P, z0, K, share, w, base)
            bg = P[RIP] * math.sin(P[RIPN] * th + P[RIPPHI])
            bg += P[UNB] * math.sin(th + P[UNBPHI]) + P[OFF]
            ua, bgu = _actuate(P, code, e, lag, th)
            d = dist[k]
            r = _added(code, e, t, th, w, d)
            outside = 0.0 if code == 23 else d
            if coupled:
                thl += 0.5 * h * wl
                r = _contact(code, e, th - thl, w - wl)
                wl += h * r / e[0]
                thl += 0.5 * h * wl
            mass = P[J] * (1.0 + e[0]) if code == 16 and t >= e[1] else P[J]
            beta = 0.5 * h * visc * v / mass
            push = ua - fb - load - bg - outside - r
            w_new = (w * (1.0 - beta) + h * push / mass) / (1.0 + beta)
            if j == 0:
                wa = 0.5 * (w + w_new)
                acc = (w_new - w) / h
                out[k, UAPP], out[k, ACC], out[k, FB] = ua, acc, fb0
                out[k, F0] = fb0 + visc * wa
                out[k, RE] = r + (fb - fb0) + visc * (v - 1.0) * wa + (mass - P[J]) * acc
                if code == 9 or code == 10 or code == 11 or code == 19:
                    out[k, RE] += out[k, UCMD] - ua - bgu
                out[k, BG] = (
                    bg + bgu + fb0 * (1.0 - _bump(P, w) / base) + visc * wa * (1 - 1 / warm)
                )
            w = w_new
            th += 0.5 * h * w
            _move(P, z, K, share, w, level, 0.5 * h)
            if scales:
                _move(P, z0, K, share, w, base, 0.5 * h)
    return out

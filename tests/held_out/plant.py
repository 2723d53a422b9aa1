"""The mechanics of a drive with friction, integrated in small steps.

    J dw/dt = u - friction(w) - const - grav sin(theta + grav_ph) - the rest

A step is half a kick (torques change the speed), a drift (speeds change angles and
bristles) and half a kick again: second order. Dry friction without bristles is a
set-valued force: a kick that it can stop leaves the speed at exactly zero. Bristles
are advanced by the exact solution for constant speed, however stiff they are.
"""

import numpy as np
from numba import njit

PLANT = """
J JL kc cc gap FL FvL bristles s0 s1 Fc Fs vs Fv asym_c asym_v quad pos_a pos_n pos_ph
warm_c warm_v warm_tau load_mu grav grav_ph const rip_a rip_n rip_ph rip2_a rip2_n rip2_ph
bump_a bump_at bump_width spring_k spring_0 stop_lo stop_hi stop_k stop_c lag dead sat
step_t step_J step_F step_const sin_a sin_f sin_ph cable_F cable_d rand_a delay theta0
""".split()
PLANT_TYPE = np.dtype([(name, "f8") for name in PLANT])
# the state: motor angle and speed, bristle, load angle and speed, cable, torque, time
TH, W, Z, THL, WL, ZC, U, T = range(8)


def plant(**values: float) -> np.ndarray:
    """A drive: what is not given is absent."""
    p = np.zeros(1, PLANT_TYPE)
    given = {"stop_lo": -1e9, "stop_hi": 1e9, "sat": 1e9, "step_t": 1e9, "vs": 1.0, "cable_d": 1.0}
    for name, value in {**given, **values}.items():
        p[0][name] = value
    if p[0]["Fs"] < p[0]["Fc"]:
        p[0]["Fs"] = p[0]["Fc"]
    return p


@njit(cache=True)
def inertia(p, t):
    """The inertia on the motor's side at a time."""
    return p.J * (1.0 + p.step_J) if t >= p.step_t else p.J


@njit(cache=True)
def warmth(p, t):
    """How much of the cold start's extra friction is left, 1 to 0."""
    return np.exp(-t / p.warm_tau) if p.warm_tau > 0 else 0.0


@njit(cache=True)
def dry(p, x, warm):
    """The dry friction's size at the state's speed, angle, time and load."""
    v = x[W]
    g = p.Fc
    if p.Fs > p.Fc:
        g += (p.Fs - p.Fc) * np.exp(-((v / p.vs) ** 2))
    g *= 1.0 + p.warm_c * warm
    if p.asym_c != 0.0 and v != 0.0:
        g *= 1.0 + (p.asym_c if v > 0 else -p.asym_c)
    if p.pos_a != 0.0:
        g *= 1.0 + p.pos_a * np.sin(p.pos_n * x[TH] + p.pos_ph)
    if x[T] >= p.step_t:
        g *= 1.0 + p.step_F
    return g + p.load_mu * abs(x[U])


@njit(cache=True)
def damping(p, v, warm):
    """Viscous and quadratic drag, per speed."""
    b = p.Fv * (1.0 + p.warm_v * warm)
    if v != 0.0:
        b *= 1.0 + (p.asym_v if v > 0 else -p.asym_v)
    return b + p.quad * abs(v)


@njit(cache=True)
def field(p, x, load):
    """Torques against the motor that depend on angle and time only."""
    th = x[TH]
    f = p.const + p.rand_a * load
    if p.grav != 0.0 and p.JL == 0.0:
        f += p.grav * np.sin(th + p.grav_ph)
    if p.rip_a != 0.0:
        f += p.rip_a * np.sin(p.rip_n * th + p.rip_ph)
    if p.rip2_a != 0.0:
        f += p.rip2_a * np.sin(p.rip2_n * th + p.rip2_ph)
    if p.bump_a != 0.0:
        d = (th - p.bump_at + np.pi) % (2 * np.pi) - np.pi
        f += p.bump_a * np.exp(-0.5 * (d / p.bump_width) ** 2)
    f += p.spring_k * (th - p.spring_0)
    if p.sin_a != 0.0:
        f += p.sin_a * np.sin(2 * np.pi * p.sin_f * x[T] + p.sin_ph)
    if x[T] >= p.step_t:
        f += p.step_const
    return f + p.cable_F * x[ZC] / p.cable_d


@njit(cache=True)
def stop(p, x):
    """The torque of the end stops, which push and never pull."""
    if x[TH] > p.stop_hi:
        return max(p.stop_k * (x[TH] - p.stop_hi) + p.stop_c * x[W], 0.0)
    if x[TH] < p.stop_lo:
        return min(p.stop_k * (x[TH] - p.stop_lo) + p.stop_c * x[W], 0.0)
    return 0.0


@njit(cache=True)
def coupling(p, x):
    """The torque that the motor hands to the load."""
    if p.JL == 0.0:
        return 0.0
    d = x[TH] - x[THL]
    if p.gap > 0.0:
        if d > p.gap:
            return max(p.kc * (d - p.gap) + p.cc * (x[W] - x[WL]), 0.0)
        if d < -p.gap:
            return min(p.kc * (d + p.gap) + p.cc * (x[W] - x[WL]), 0.0)
        return 0.0
    return p.kc * d + p.cc * (x[W] - x[WL])


@njit(cache=True)
def shrink(v, by):
    """A speed after dry friction took an impulse from it: it stops, it never turns."""
    return v - by if v > by else (v + by if v < -by else 0.0)


@njit(cache=True)
def kick(p, x, h, load, warm, sums):
    """The torques act for a time h at constant angles."""
    v0, g, J = x[W], dry(p, x, warm), inertia(p, x[T])
    inner = coupling(p, x)
    out = field(p, x, load) + stop(p, x)
    b = damping(p, v0, warm)
    push = x[U] - out - inner
    if p.bristles > 0:
        # the bristles' own damping, by the share of the speed that still bends them
        kappa = 1.0 - p.s0 * x[Z] * np.sign(v0) / g
        b += p.s1 * kappa
        push -= p.s0 * x[Z]
    a = 0.5 * h * b / J
    v1 = (v0 * (1.0 - a) + h / J * push) / (1.0 + a)
    if p.bristles == 0:
        v1 = shrink(v1, h * g / J)
    x[W] = v1
    mean = 0.5 * (v0 + v1)
    sums[0] += h * (x[U] - out - inner) - J * (v1 - v0)  # the impulse of friction
    sums[1] += h * out
    sums[2] += h * inner
    if p.JL > 0:
        f = inner - p.FvL * x[WL]
        if p.grav != 0.0:
            f -= p.grav * np.sin(x[THL] + p.grav_ph)
        x[WL] = shrink(x[WL] + h * f / p.JL, h * p.FL / p.JL)
    return mean


@njit(cache=True)
def drift(p, x, h, warm):
    """The speeds act for a time h."""
    v = x[W]
    if p.bristles > 0 and v != 0.0:
        g = dry(p, x, warm)
        end = np.sign(v) * g / p.s0
        x[Z] = end + (x[Z] - end) * np.exp(-h * abs(v) * p.s0 / g)
    if p.cable_F != 0.0 and v != 0.0:
        end = np.sign(v) * p.cable_d
        x[ZC] = end + (x[ZC] - end) * np.exp(-h * abs(v) / p.cable_d)
    x[TH] += h * v
    x[THL] += h * x[WL]


@njit(cache=True)
def actuate(p, x, command, h):
    """The torque that the motor makes of a command: dead zone, saturation, lag."""
    u = shrink(command, p.dead)
    u = min(max(u, -p.sat), p.sat)
    if p.lag > 0:
        x[U] += (u - x[U]) * (1.0 - np.exp(-h / p.lag))
    else:
        x[U] = u

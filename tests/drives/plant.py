"""The drive in fine fixed steps: friction, hidden effects, sensors and a sampled controller.

All that is compiled stands in this file, since numba's disk cache only watches the file of the
function it compiled.  A row of the effect table holds the parameters in the order of the
catalogue; an effect whose flag is down is never evaluated.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

compiled = njit(cache=True, error_model="numpy", forceinline=True)
EFFECTS = (
    "constant_torque gravity torque_ripple position_dependent_friction coulomb_asymmetry "
    "viscous_asymmetry quadratic_drag thermal_drift load_dependent_friction dwell_stiction "
    "input_delay actuator_lag actuator_saturation actuator_dead_zone return_spring hard_stop "
    "elastic_coupling backlash inertia_step friction_step periodic_disturbance "
    "velocity_sensor_lag encoder_eccentricity "
    "torque_constant_ripple sublinear_viscous pose_dependent_inertia "
    "torque_bumps contact_pulses speed_hump dragged_cable "
    "rough_patch fading_gain cubic_drag pumping_load"
).split()
WIDTH = 24  # columns of the effect table
CODE = {name: row for row, name in enumerate(EFFECTS)}
CONSTANT, GRAVITY, RIPPLE, POSITION_FRICTION = range(0, 4)
COULOMB_ASYM, VISCOUS_ASYM, QUADRATIC, THERMAL, LOAD_FRICTION, DWELL = range(4, 10)
DELAY, ACT_LAG, SATURATION, DEAD_ZONE, SPRING, STOP = range(10, 16)
ELASTIC, BACKLASH, INERTIA_STEP, FRICTION_STEP, PERIODIC = range(16, 21)
SENSOR_LAG, ECCENTRIC = range(21, 23)
KT_RIPPLE, SUBLINEAR, POSE = range(23, 26)
BUMPS, PULSES, HUMP, CABLE, PATCH, FADING, CUBIC, PUMPING = range(26, 34)

# state: motor, bristle, bristle of the declared structure, load, torque, measured speed, time
# at rest, accelerations, then the springs of the cable
TH, W, Z, ZN, THL, WL, UA, WS, REST, ACC, ACCL, SLIDER = range(12)
SLIDERS = 4
STATES = SLIDER + SLIDERS
# machine
J, S0, S1, FC, FS, FV, VS, LOAD, LOAD_A, LOAD_PHI, FS_TWIN, STATIC_TWIN = range(12)
STATIC = 12  # a set-valued law instead of bristles
# drive
MODE, KP, KI, KPP, U_MAX, XI_MAX, U_INIT, LAG_WM, NO_TACHO, QUANTUM = range(10)
OPEN_LOOP, SPEED_LOOP, POSITION_LOOP = 0, 1, 2
# per sample: as recorded, then the torque of the effect (its mean over the sample)
OUT = ("u", "theta", "w", "effect")


@compiled
def bumps(theta, row):
    """row: height, width, period (0: none), count, then centres and signed shapes."""
    total = 0.0
    count = int(row[3])
    for i in range(count):
        gap = theta - row[4 + i]
        if row[2] > 0.0:
            gap -= row[2] * math.floor(gap / row[2] + 0.5)
        total += row[4 + count + i] * math.exp(-((gap / row[1]) ** 2))
    return row[0] * total


@compiled
def pulses(t, row):
    """row: height, length, count, then times and signed shapes; half-sine contacts."""
    total = 0.0
    count = int(row[2])
    for i in range(count):
        phase = (t - row[3 + i]) / row[1]
        if 0.0 < phase < 1.0:
            total += row[3 + count + i] * math.sin(math.pi * phase)
    return row[0] * total


@compiled
def stroke(t, row):
    """row: height, frequency, part of the period; one push per stroke of a pump."""
    phase = (t * row[1] - math.floor(t * row[1])) / row[2]
    return row[0] * math.sin(math.pi * phase) if phase < 1.0 else 0.0


@compiled
def patch(theta, row):
    """row: rise, centre, half of its width, period (0: none). Rough over a part of the travel."""
    gap = theta - row[1]
    if row[3] > 0.0:
        gap -= row[3] * math.floor(gap / row[3] + 0.5)
    return 1.0 + row[0] / (1.0 + (gap / row[2]) ** 8)


@compiled
def sign(x):
    if x == 0.0:
        return 0.0
    return 1.0 if x > 0.0 else -1.0


@compiled
def stribeck(w, fc, fs, vs):
    """h(w); beyond 6 vs the exponential is below rounding."""
    v = w / vs
    return fc + (fs - fc) * math.exp(-v * v) if abs(v) < 6.0 else fc


@compiled
def load_torque(theta, m):
    """The load the model file declares, on the resisting side."""
    if m[LOAD] == 1.0:
        return m[LOAD_A] * math.sin(theta + m[LOAD_PHI])
    if m[LOAD] == 2.0:
        return m[LOAD_A]
    return 0.0


@compiled
def dragged(x, w, h, row):
    """row: all limits together, longest stretch. Sliders behind springs (Maxwell-slip)."""
    total = 0.0
    for i in range(SLIDERS):
        longest = row[1] * (i + 1.0) / SLIDERS
        x[SLIDER + i] = min(max(x[SLIDER + i] + h * w, -longest), longest)
        total += x[SLIDER + i] / longest
    return row[0] * total / SLIDERS


@compiled
def resisting(t, theta, w, on, p):
    """r_e of every torque effect that is present."""
    r = 0.0
    if on[CONSTANT]:
        r += p[CONSTANT, 0]
    if on[GRAVITY]:
        r += p[GRAVITY, 0] * math.sin(theta + p[GRAVITY, 1])
    if on[RIPPLE]:
        r += p[RIPPLE, 0] * math.sin(p[RIPPLE, 1] * theta + p[RIPPLE, 2])
    if on[QUADRATIC]:
        r += p[QUADRATIC, 0] * w * abs(w)
    if on[SPRING]:
        r += p[SPRING, 0] * (theta - p[SPRING, 1])
    if on[STOP] and p[STOP, 2] * (theta - p[STOP, 0]) > 0.0:
        r += p[STOP, 1] * (theta - p[STOP, 0])
    if on[PERIODIC]:
        r += p[PERIODIC, 0] * math.sin(2.0 * math.pi * p[PERIODIC, 1] * t + p[PERIODIC, 2])
    if on[BUMPS]:
        r += bumps(theta, p[BUMPS])
    if on[SUBLINEAR]:
        r += p[SUBLINEAR, 0] * abs(w) ** p[SUBLINEAR, 1] * sign(w)
    if on[HUMP]:
        gap = (abs(w) - p[HUMP, 1]) / p[HUMP, 2]
        r += p[HUMP, 0] * math.exp(-gap * gap) * sign(w)
    if on[PULSES]:
        r += pulses(t, p[PULSES])
    if on[CUBIC]:
        r += p[CUBIC, 0] * w * w * w
    if on[PUMPING]:
        r += stroke(t, p[PUMPING])
    return r


@compiled
def friction_level(t, theta, w, rest, m, on, p):
    """h(w) with the hidden effects, and the viscous coefficient."""
    g, gv, fs = 1.0, 1.0, m[FS]
    if on[POSITION_FRICTION]:
        row = p[POSITION_FRICTION]
        g *= 1.0 + row[0] * math.sin(row[1] * theta + row[2])
    if on[COULOMB_ASYM]:
        g *= 1.0 + p[COULOMB_ASYM, 0] * sign(w)
    if on[VISCOUS_ASYM]:
        gv *= 1.0 + p[VISCOUS_ASYM, 0] * sign(w)
    if on[THERMAL]:
        heat = 1.0 + p[THERMAL, 0] * (1.0 - math.exp(-t / p[THERMAL, 1]))
        g, gv = g * heat, gv * heat
    if on[FRICTION_STEP] and t >= p[FRICTION_STEP, 1]:
        g *= 1.0 + p[FRICTION_STEP, 0]
    if on[PATCH]:
        g *= patch(theta, p[PATCH])
    if on[DWELL]:
        fs *= 1.0 + p[DWELL, 0] * (1.0 - math.exp(-rest / p[DWELL, 1]))
    level = g * stribeck(w, m[FC], fs, m[VS])
    if on[LOAD_FRICTION]:
        level += p[LOAD_FRICTION, 0] * abs(load_torque(theta, m))
    return level, gv * m[FV]


@compiled
def bristle(z, w, level, s0, h):
    """Exact over a step of held w: the new z, the mean of z and the mean of dz/dt."""
    a = s0 * abs(w) / level
    if a * h < 1e-5:
        new = z + h * (w - a * z)
        return new, 0.5 * (z + new), (new - z) / h
    decay = math.exp(-a * h)
    new = decay * z + (1.0 - decay) * w / a
    rate = (new - z) / h
    return new, (w - rate) / a, rate


@compiled
def rubbing(x, w, level, push, j, m, h):
    """Mean friction torque over a step, viscous part apart; ``push`` is all other torque.

    What is static takes any torque at rest: what stops the motion, up to the level.
    """
    if m[STATIC]:
        return min(max(push + j * x[W] / h, -level), level)
    x[Z], mean, rate = bristle(x[Z], w, level, m[S0], h)
    return m[S0] * mean + m[S1] * rate


@compiled
def declared_friction(x, w, friction, m, h):
    """Friction of the declared structure, true values, along the measured speed."""
    level = stribeck(w, m[FC], m[FS_TWIN], m[VS])
    if m[STATIC_TWIN] > 0.0:  # set-valued at rest: whatever the truth is
        return friction if abs(w) < 0.2 * m[VS] else level * sign(w) + m[FV] * w
    x[ZN], mean, rate = bristle(x[ZN], w, level, m[S0], h)
    return m[S0] * mean + m[S1] * rate + m[FV] * w


@compiled
def actuator(t, u, theta, w, x, h, on, p):
    """Mean torque at the motor over a fine step of (already delayed) command u."""
    gain = 1.0
    if on[FADING]:
        gain -= p[FADING, 0] * (1.0 - math.exp(-t / p[FADING, 1]))
    if on[KT_RIPPLE]:
        gain += p[KT_RIPPLE, 0] * math.sin(p[KT_RIPPLE, 1] * theta + p[KT_RIPPLE, 2])
    if on[DEAD_ZONE]:
        u = sign(u) * max(abs(u) - p[DEAD_ZONE, 0], 0.0)
    if on[SATURATION]:
        u = min(max(u, -p[SATURATION, 0]), p[SATURATION, 0])
    old = x[UA]
    x[UA] = u
    if not on[ACT_LAG] or p[ACT_LAG, 0] <= 0.0:
        return gain * u
    tau = p[ACT_LAG, 0]
    x[UA] = u + (old - u) * math.exp(-h / tau)
    return gain * (u + (old - x[UA]) * tau / h)


@compiled
def coupling(x, theta, w, h, on, p):
    """Torque of spring and damper on the motor, none inside the gap; moves the load."""
    if not (on[ELASTIC] or on[BACKLASH]):
        return 0.0
    inertia, gap, k, c = p[BACKLASH, 0], p[BACKLASH, 1], p[BACKLASH, 2], p[BACKLASH, 3]
    if on[ELASTIC]:
        inertia, gap, k, c = p[ELASTIC, 0], 0.0, p[ELASTIC, 1], p[ELASTIC, 2]
    if inertia <= 0.0:
        return 0.0
    wl = x[WL] + 0.5 * h * x[ACCL]
    twist = theta - x[THL] - 0.5 * h * x[WL]
    torque = 0.0
    if abs(twist) >= 0.5 * gap:
        torque = k * (twist - 0.5 * gap * sign(twist)) + c * (w - wl)
    x[ACCL] = torque / inertia
    x[THL] += h * (x[WL] + 0.5 * h * x[ACCL])
    x[WL] += h * x[ACCL]
    return torque


@compiled
def inertia(t, theta, w, m, on, p):
    """Inertia now, and the torque (1/2) J'(theta) w^2."""
    now, swing = m[J], 0.0
    if on[INERTIA_STEP] and t >= p[INERTIA_STEP, 1]:
        now *= 1.0 + p[INERTIA_STEP, 0]
    if on[POSE]:
        a, n, angle = p[POSE, 0], p[POSE, 1], p[POSE, 1] * theta + p[POSE, 2]
        swing = -0.5 * now * a * n * math.sin(angle) * w * w
        now *= 1.0 + a * math.cos(angle)
    return now, swing


@compiled
def sensed(theta, w, acc, x, on, p):
    """Position, speed and acceleration as the sensors see them, before noise."""
    if on[SENSOR_LAG] and p[SENSOR_LAG, 0] > 0.0:
        acc = (w - x[WS]) / p[SENSOR_LAG, 0]
        w = x[WS]
    if on[ECCENTRIC]:
        a, angle = p[ECCENTRIC, 0], theta + p[ECCENTRIC, 1]
        slope = 1.0 + a * math.cos(angle)
        acc = acc * slope - a * math.sin(angle) * w * w
        return theta + a * math.sin(angle), w * slope, acc
    return theta, w, acc


@compiled
def same_friction(m, on):
    """Whether the declared structure has the true friction at every moment."""
    for code in range(POSITION_FRICTION, DELAY):
        if on[code] and code != QUADRATIC:
            return False
    if on[FRICTION_STEP] or on[SENSOR_LAG] or on[ECCENTRIC]:
        return False
    if on[PATCH]:
        return False
    return m[FS_TWIN] == m[FS] and m[STATIC_TWIN] == 0.0 and m[STATIC] == 0.0


@compiled
def step(t, h, command, delayed, same, x, m, on, p):
    """One fine step. Returns friction of the declared structure and effect torque."""
    w = x[W] + 0.5 * h * x[ACC]
    theta = x[TH] + 0.5 * h * x[W]
    torque = actuator(t, delayed, theta, w, x, h, on, p)
    t += 0.5 * h
    level, fv = friction_level(t, theta, w, x[REST], m, on, p)
    x[REST] = x[REST] + h if abs(w) < 0.5 * m[VS] else 0.0  # presliding counts as rest
    j_now, swing = inertia(t, theta, w, m, on, p)
    load, against = load_torque(theta, m), resisting(t, theta, w, on, p)
    drag = dragged(x, w, h, p[CABLE]) if on[CABLE] else 0.0
    shaft = coupling(x, theta, w, h, on, p)
    push = torque - load - against - drag - fv * w - swing - shaft
    friction = rubbing(x, w, level, push, j_now, m, h) + fv * w
    x[ACC] = (torque - (friction + load + against + drag) - swing - shaft) / j_now
    half = math.exp(-0.5 * h / max(p[SENSOR_LAG, 0], 1e-9)) if on[SENSOR_LAG] else 1.0
    x[WS] = w + (x[WS] - w) * half
    th_m, w_m, acc_m = sensed(theta, w, x[ACC], x, on, p)
    x[WS] = w + (x[WS] - w) * half
    x[TH] += h * (x[W] + 0.5 * h * x[ACC])
    before, x[W] = x[W], x[W] + h * x[ACC]
    if m[STATIC] and abs(x[W]) < 1e-12 * abs(before):
        x[W] = 0.0  # stopped: the rest is rounding
    nominal = friction if same else declared_friction(x, w_m, friction, m, h)
    # what the declared structure cannot account for along the measured motion
    effect = command - m[J] * acc_m - nominal - load_torque(th_m, m)
    return nominal, effect


@compiled
def control(w_m, theta_m, rv, rp, feed, drive, xi, period):
    """Sampled PI on speed, P on position around it. Returns torque and integrator state."""
    if drive[MODE] == 0.0:
        return feed, xi
    if drive[MODE] == 2.0:
        rv = rv + drive[KPP] * (rp - theta_m)
    e = rv - w_m
    limit = drive[U_MAX]
    u = feed + drive[KP] * e + xi
    xi += drive[KI] * period * e
    xi = min(max(xi, -drive[XI_MAX]), drive[XI_MAX])
    return min(max(u, -limit), limit), xi


@compiled
def held(told, stamps, j, k, late, first):
    """Torque told at the time `late`, and the sample (from j on, at most k) that told it."""
    while j < k and stamps[j + 1] <= late:
        j += 1
    return (told[j] if late >= 0.0 else first), j


@compiled
def run(m, drive, on, p, refs, noise, stamps, n, theta0):
    """Whole record. refs (3, N): speed, position from the start, torque; noise (1, N) of w.

    Sample k lasts from stamps[k] to stamps[k + 1].  Returns an array (len(OUT), N), the states
    (STATES, N) at the samples, and the mean squares of friction (declared structure) and effect
    torque over all fine steps.
    """
    samples = refs.shape[1]
    out, states = np.zeros((4, samples)), np.zeros((STATES, samples))
    x = np.zeros(STATES)
    x[TH], x[THL], x[UA] = theta0, theta0, drive[U_INIT]
    late, j = (p[DELAY, 0] if on[DELAY] else 0.0), 0
    q, xi, same = drive[QUANTUM], drive[U_INIT], same_friction(m, on)
    start, theta_old, w_diff, sum_f, sum_e = theta0, theta0, 0.0, 0.0, 0.0
    for k in range(samples):
        period = stamps[k + 1] - stamps[k]
        h = period / n
        theta_m, w_m, _ = sensed(x[TH], x[W], x[ACC], x, on, p)
        if q > 0.0:
            theta_m = q * math.floor(theta_m / q + 0.5)
        if k == 0:  # the drive is switched on where it stands
            start, theta_old = theta_m, theta_m
        w_diff += drive[LAG_WM] * ((theta_m - theta_old) / period - w_diff)
        theta_old = theta_m
        out[1, k], out[2, k] = theta_m, w_m + noise[0, k]
        speed = w_diff if drive[NO_TACHO] > 0.0 else out[2, k]
        rp = start + refs[1, k]
        u, xi = control(speed, theta_m, refs[0, k], rp, refs[2, k], drive, xi, period)
        out[0, k] = u
        states[:, k] = x
        mean_e = 0.0
        for i in range(n):
            t = stamps[k] + i * h
            delayed, j = held(out[0], stamps, j, k, t + 0.5 * h - late, drive[U_INIT])
            f_nominal, e = step(t, h, u, delayed, same, x, m, on, p)
            mean_e += e
            sum_f += f_nominal * f_nominal
            sum_e += e * e
        out[3, k] = mean_e / n
    return out, states, sum_f / (samples * n), sum_e / (samples * n)


@compiled
def advance(x, t, u, period, n, m, on, p):
    """One sample of a torque that acts as it is told: the state is moved on in place."""
    for i in range(n):
        step(t + i * period / n, period / n, u, u, True, x, m, on, p)

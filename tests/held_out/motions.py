"""What the controller is told: references by position, by speed or by torque."""

import numpy as np

from .machines import Rig, between


def quintic(rng, n, Tc, ends, vmax, amax, dwell):
    """Moves with smooth acceleration from point to point, with rests between."""
    out, last = [], 0.0
    total = 0
    while total < n:
        to = ends()
        d = abs(to - last)
        T = max(1.875 * d / vmax, np.sqrt(5.7735 * d / amax), 4 * Tc)
        x = np.arange(1, int(T / Tc) + 1) / int(T / Tc)
        rest = np.full(int(rng.uniform(*dwell) / Tc), to)
        out += [last + (to - last) * x**3 * (10 - 15 * x + 6 * x * x), rest]
        total += x.size + rest.size
        last = to
    return np.concatenate(out)[:n]


def trapezes(rng, n, Tc, ends, vmax, amax, dwell):
    """Moves with constant acceleration, cruise and braking."""
    out, last, total = [], 0.0, 0
    while total < n:
        to = ends()
        d = abs(to - last)
        v = min(vmax, np.sqrt(d * amax))
        T, ta = d / v + v / amax, v / amax
        t = np.arange(1, max(int(T / Tc), 2) + 1) * Tc
        up = 0.5 * amax * np.minimum(t, ta) ** 2 + v * np.clip(t - ta, 0, T - 2 * ta)
        left = np.clip(t - (T - ta), 0, ta)
        s = up + v * left - 0.5 * amax * left**2
        rest = np.full(int(rng.uniform(*dwell) / Tc), to)
        out += [last + np.sign(to - last) * s, rest]
        total += t.size + rest.size
        last = to
    return np.concatenate(out)[:n]


def holds(rng, n, Tc, levels, low, high):
    """Levels held for random times."""
    out = np.zeros(n)
    i = 0
    while i < n:
        k = max(int(rng.uniform(low, high) / Tc), 1)
        out[i : i + k] = levels()
        i += k
    return out


def slew(x, Tc, rate, start=0.0):
    """A signal that follows another one at a limited rate."""
    out, y, step = np.empty(x.size), start, rate * Tc
    for i, to in enumerate(x.tolist()):
        y = y + step if to > y + step else (y - step if to < y - step else to)
        out[i] = y
    return out


def sines(rng, t, v, a, reach):
    """A sum of sines within a speed, an acceleration and a reach."""
    count = int(rng.integers(1, 5))
    f = np.sort(np.exp(rng.uniform(np.log(0.1), np.log(2.5), count)))
    x = sum(np.sin(2 * np.pi * fi * t) / fi ** rng.uniform(0.7, 1.5) for fi in f)
    x = x * np.minimum(t, 1.0)
    dx = np.gradient(x, t)
    peaks = (np.abs(x).max() / reach, np.abs(dx).max() / v, np.abs(np.gradient(dx, t)).max() / a)
    return x / max(peaks)


def by_position(rng, rig: Rig, t, v, a):
    """Position references, for machines with or without ends."""
    n, Tc = t.size, rig.Tc
    reach = min(rig.travel, rng.uniform(0.5, 2) * rig.wmax)
    kind = str(rng.choice(["moves", "trapezes", "sines", "replay", "slow scan", "chirp"]))
    if kind == "moves":
        x = quintic(rng, n, Tc, lambda: rng.uniform(-reach, reach), v, a, (0.1, 1.0))
    elif kind == "trapezes":
        side = [1.0]

        def ends():
            side[0] = -side[0]
            return side[0] * reach * rng.uniform(0.3, 1)

        x = trapezes(rng, n, Tc, ends, v, a, (0.1, 0.6))
    elif kind == "replay":
        x = quintic(rng, n, Tc, lambda: rng.uniform(-reach, reach), v, a, (0.0, 0.01))
    elif kind == "sines":
        x = sines(rng, t, v, a, reach)
    elif kind == "slow scan":
        slow = v * between(rng, 0.03, 0.3)
        span = min(reach, slow * t[-1] / rng.uniform(5, 12))
        sign = [1.0]

        def turn():
            sign[0] = -sign[0]
            return sign[0] * span

        x = trapezes(rng, n, Tc, turn, slow, a, (0.0, 0.3))
    else:
        f = 0.2 + (between(rng, 1, 4) - 0.2) * t / t[-1]
        phase = 2 * np.pi * np.cumsum(f) * Tc
        amp = np.minimum.reduce([np.full(n, reach), v / (2 * np.pi * f), a / (2 * np.pi * f) ** 2])
        x = amp * np.sin(phase) * np.minimum(t, 1.0)
    dx = np.gradient(x, Tc) * (1.0 if rng.random() < 0.7 else 0.0)
    return kind, x, dx


def by_speed(rng, rig: Rig, t, v, a):
    """Speed references, for machines that may turn on."""
    n, Tc = t.size, rig.Tc
    kind = str(rng.choice(["speed steps", "speed ramps", "speed sines", "coast-down"]))
    on = np.ones(n)
    if kind == "speed steps":
        w = slew(holds(rng, n, Tc, lambda: rng.uniform(-v, v), 0.4, 2.0), Tc, a)
    elif kind == "speed ramps":
        rate = min(a, v / rng.uniform(0.5, 3))
        side = [1.0]

        def top():
            side[0] = -side[0]
            return side[0] * v * rng.uniform(0.3, 1)

        w = slew(holds(rng, n, Tc, top, v / rate * 1.2, v / rate * 2.4), Tc, rate)
    elif kind == "speed sines":
        w = sines(rng, t, a, 100 * a, v)
    else:
        w, i = np.zeros(n), 0
        while i < n:
            run, free = int(rng.uniform(0.8, 2) / Tc), int(rng.uniform(0.5, 3) / Tc)
            w[i : i + run] = v * rng.uniform(0.4, 1) * rng.choice([-1, 1])
            on[i + run : i + run + free] = 0.0
            i += run + free
        w = slew(w, Tc, a)
    return kind, w, on


def by_torque(rng, rig: Rig, t, v):
    """Torque by hand, PRBS or a relay; the speed loop is open."""
    n, Tc, p, c = t.size, rig.Tc, rig.values, rig.control
    top = p["Fc"] + p["Fv"] * v + abs(p.get("const", 0.0)) + p.get("grav", 0.0)
    c["ki"] = 0.0
    kind = str(rng.choice(["torque steps", "PRBS", "relay on speed", "torque sines"]))
    if np.isfinite(rig.travel):
        kind = str(rng.choice(["relay on position", "PRBS held"]))
    ref, u = np.zeros(n), np.zeros(n)
    coast = p["J"] * rig.wmax / p["Fc"]
    if kind.startswith("relay"):
        c |= {
            "relay": min(top * rng.uniform(1.2, 2), c["umax"]),
            "relay_speed": float("speed" in kind),
        }
        reach = min(rig.travel, v * coast)
        c["hyst"] = (v if "speed" in kind else reach) * rng.uniform(0.05, 0.3)
        return kind, ref, u
    if kind == "PRBS held":
        c["kv"] *= 0.02
        c["kp"] = min(c["kp"], 1.0)
    else:
        c["kv"] = 0.0
    if kind == "torque sines":
        u = sines(rng, t, 1e3 * top, 1e6 * top, top * 1.2)
    elif kind == "torque steps":
        u = holds(
            rng, n, Tc, lambda: rng.choice([-1, 0, 1, 1, -1]) * rng.uniform(0.4, 1) * top, 0.3, 2.5
        )
    else:
        chip = max(coast * rng.uniform(0.1, 0.5), 3 * Tc)
        bits = rng.choice([-1.0, 1.0], int(t[-1] / chip) + 2)
        u = top * rng.uniform(1.0, 1.3) * bits[(t / chip).astype(int)]
    return kind, ref, u


def draw_motion(rng, rig: Rig):
    """References (position, speed, torque, on) of a motion, and its name."""
    n = int(rig.seconds / rig.Tc)
    t = np.arange(n) * rig.Tc
    p, c = rig.values, rig.control
    v = rig.wmax * rng.uniform(0.3, 1)
    spare = c["umax"] - p["Fc"] - p["Fv"] * v - p.get("grav", 0.0) - abs(p.get("const", 0.0))
    a = min(max(spare, 0.5 * p["Fc"]) * rng.uniform(0.15, 0.6) / p["J"], v / 0.02)
    refs = np.zeros((n, 4))
    refs[:, 3] = 1.0
    free = not np.isfinite(rig.travel)
    way = str(
        rng.choice(["position", "speed", "torque"], p=[0.3, 0.4, 0.3] if free else [0.8, 0, 0.2])
    )
    if way == "position":
        kind, refs[:, 0], refs[:, 1] = by_position(rng, rig, t, v, a)
        refs[:, 0] += p["theta0"]
    elif way == "speed":
        c["kp"] = 0.0
        kind, refs[:, 1], refs[:, 3] = by_speed(rng, rig, t, v, a)
    else:
        kind, refs[:, 0], refs[:, 2] = by_torque(rng, rig, t, v)
    return kind, refs

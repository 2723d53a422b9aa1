"""Hidden effects. Each takes the drive and what its plain motion is like, and gives a
function of strength: about the effect's share of the friction level, 0.03 to 0.4 for a
clear one. That function names the values to set in the plant, the sensor or the log."""

import numpy as np

from .machines import between


def turns(rng, rig, c, most=24):
    """A number of periods per turn that the motion passes several times and the log resolves."""
    low = max(1.0, 3 * 2 * np.pi / c["span"])
    high = max(min(most * max(low, 1.0), rig.fs / 6 * 2 * np.pi / c["w_rms"]), low)
    return float(round(between(rng, low, high)))


def phase(rng):
    """Any phase."""
    return float(rng.uniform(-np.pi, np.pi))


def ripple(rng, rig, c):
    n, ph = turns(rng, rig, c), phase(rng)
    return lambda s: {"rip_a": 1.41 * s * c["level"], "rip_n": n, "rip_ph": ph}


def cogging(rng, rig, c):
    n, ph = turns(rng, rig, c, 40), phase(rng)
    return lambda s: {"rip2_a": 1.41 * s * c["level"], "rip2_n": n, "rip2_ph": ph}


def unbalance(rng, rig, c):
    ph = phase(rng)
    return lambda s: {"rip_a": 1.41 * s * c["level"], "rip_n": 1.0, "rip_ph": ph}


def gravity(rng, rig, c):
    if rig.values.get("grav") or c["span"] < 1.0:
        return None
    ph = phase(rng)
    return lambda s: {"grav": 1.41 * s * c["level"], "grav_ph": ph}


def constant(rng, rig, c):
    if rig.values.get("const"):
        return None
    sign = rng.choice([-1.0, 1.0])
    return lambda s: {"const": sign * s * c["level"]}


def directed_coulomb(rng, rig, c):
    sign = rng.choice([-1.0, 1.0])
    return lambda s: {"asym_c": sign * min(s * c["level"] / rig.values["Fc"], 0.8)}


def directed_viscous(rng, rig, c):
    sign, size = rng.choice([-1.0, 1.0]), c["level"] / (rig.values["Fv"] * c["w_rms"])
    return lambda s: {"asym_v": sign * min(s * size, 0.9)}


def quadratic(rng, rig, c):
    return lambda s: {"quad": s * c["level"] / c["w_rms"] ** 2}


def friction_by_angle(rng, rig, c):
    n, ph = turns(rng, rig, c, 6), phase(rng)
    size = 1.41 * c["level"] / rig.values["Fc"]
    return lambda s: {"pos_a": min(s * size, 0.85), "pos_n": n, "pos_ph": ph}


def warming(rng, rig, c):
    tau, both = rig.seconds * between(rng, 0.15, 0.8), rng.random() < 0.5
    return lambda s: {"warm_c": 2 * s, "warm_v": 2 * s * both, "warm_tau": tau}


def input_delay(rng, rig, c):
    old = rig.values.get("delay", 0.0)
    return lambda s: {"delay": old + s * c["level"] / c["u_rate"]}


def actuator_lag(rng, rig, c):
    return lambda s: {"lag": s * c["level"] / c["u_rate"]}


def saturation(rng, rig, c):
    return lambda s: {"sat": c["u_peak"] / (1 + 3 * s)}


def dead_zone(rng, rig, c):
    return lambda s: {"dead": s * c["level"]}


def spring(rng, rig, c):
    if c["span"] > 400:
        return None
    mid = c["mid"] + c["span"] * rng.uniform(-0.3, 0.3)
    return lambda s: {"spring_k": s * c["level"] / (0.35 * c["span"]), "spring_0": mid}


def hard_stop(rng, rig, c):
    if c["span"] > 400:
        return None
    stiff, at = rig.values["J"] * (2 * np.pi * between(rng, 8, 40)) ** 2, c["mid"] + c["span"] / 2
    damp = 2 * rng.uniform(0.1, 0.6) * np.sqrt(stiff * rig.values["J"])
    return lambda s: {
        "stop_hi": at - min(2 * s * c["level"] / stiff, 0.4 * c["span"]),
        "stop_k": stiff,
        "stop_c": damp,
    }


def elastic(rng, rig, c):
    J, f, part = rig.values["J"], between(rng, 8, 20), rng.uniform(0.2, 0.7)
    zeta = rng.uniform(0.02, 0.1)

    def at(s):
        k = part * J * (2 * np.pi * f) ** 2 * 0.1 / s
        return {
            "J": J * (1 - part),
            "JL": J * part,
            "kc": k,
            "cc": 2 * zeta * np.sqrt(k * J * part),
        }

    return at


def resonance(rng, rig, c):
    J, f, zeta = rig.values["J"], between(rng, 3, 25), rng.uniform(0.01, 0.06)

    def at(s):
        part = min(0.5 * s, 0.4)
        k = part * J * (2 * np.pi * f) ** 2
        return {
            "J": J * (1 - part),
            "JL": J * part,
            "kc": k,
            "cc": 2 * zeta * np.sqrt(k * J * part),
        }

    return at


def backlash(rng, rig, c):
    J, Fc, part, dry = (
        rig.values["J"],
        rig.values["Fc"],
        rng.uniform(0.2, 0.7),
        rng.uniform(0.05, 0.3),
    )
    k = part * J * (2 * np.pi * between(rng, 30, 80)) ** 2
    cc = 2 * rng.uniform(0.1, 0.4) * np.sqrt(k * J * part)
    size = min(c["span"], 0.3 * c["w_rms"])

    def at(s):
        # a load with friction of its own: the sum is what the plain drive has
        out = {"J": J * (1 - part), "JL": J * part, "kc": k, "cc": cc, "gap": 0.2 * s * size}
        out |= {"Fc": Fc * (1 - dry), "FL": Fc * dry}
        if rig.values.get("Fs", 0.0) > Fc:
            out["Fs"] = rig.values["Fs"] - Fc * dry
        return out

    return at


def inertia_step(rng, rig, c):
    at, size = rig.seconds * rng.uniform(0.25, 0.75), c["level"] / (rig.values["J"] * c["a_rms"])
    return lambda s: {"step_t": at, "step_J": min(1.4 * s * size, 4.0)}


def friction_step(rng, rig, c):
    at, sign = rig.seconds * rng.uniform(0.25, 0.75), rng.choice([-1.0, 1.0])
    size = 1.4 * c["level"] / rig.values["Fc"]
    return lambda s: {"step_t": at, "step_F": sign * min(s * size, 0.8)}


def constant_step(rng, rig, c):
    at, sign = rig.seconds * rng.uniform(0.25, 0.75), rng.choice([-1.0, 1.0])
    return lambda s: {"step_t": at, "step_const": sign * 1.4 * s * c["level"]}


def sine_in_time(rng, rig, c):
    f, ph = between(rng, 0.3, min(12, rig.fs / 10)), phase(rng)
    return lambda s: {"sin_a": 1.41 * s * c["level"], "sin_f": f, "sin_ph": ph}


def speed_sensor_lag(rng, rig, c):
    return lambda s: {"w_lag": s * c["level"] / c["u_rate"]}


def eccentricity(rng, rig, c):
    if c["span"] < 2:
        return None
    n, ph = float(rng.integers(1, 3)), phase(rng)
    size = c["level"] / (rig.values["J"] * c["w_rms"] ** 2 + rig.values["Fv"] * c["w_rms"])
    return lambda s: {"ecc": min(1.41 * s * size / n**2, 0.06), "ecc_n": n, "ecc_ph": ph}


def bumps(rng, rig, c):
    at, width = c["mid"] + c["span"] * rng.uniform(-0.25, 0.25), between(rng, 0.05, 0.4)
    width, sign = min(width, 0.1 * c["span"]), rng.choice([-1.0, 1.0])
    at = float((at + np.pi) % (2 * np.pi) - np.pi)
    return lambda s: {"bump_a": sign * 3 * s * c["level"], "bump_at": at, "bump_width": width}


def random_load(rng, rig, c):
    rig.load_seed, f = int(rng.integers(1, 2**31)), between(rng, 0.2, 4)
    return lambda s: {"rand_a": s * c["level"], "rand_f": f}


def cable(rng, rig, c):
    d = c["span"] * between(rng, 0.03, 0.3)
    return lambda s: {"cable_F": 1.2 * s * c["level"], "cable_d": min(d, 20.0)}


def load_dependent(rng, rig, c):
    return lambda s: {"load_mu": min(s * c["level"] / c["u_abs"], 0.7)}


CLEAR = {
    "torque ripple": ripple,
    "gravity": gravity,
    "constant torque": constant,
    "direction-dependent Coulomb": directed_coulomb,
    "direction-dependent viscous": directed_viscous,
    "quadratic drag": quadratic,
    "position-dependent friction": friction_by_angle,
    "warming": warming,
    "input delay": input_delay,
    "actuator lag": actuator_lag,
    "saturation": saturation,
    "dead zone": dead_zone,
    "spring": spring,
    "hard stop": hard_stop,
    "elastic coupling": elastic,
    "backlash": backlash,
    "inertia step": inertia_step,
    "friction step": friction_step,
    "sinusoidal disturbance": sine_in_time,
    "velocity sensor lag": speed_sensor_lag,
    "encoder eccentricity": eccentricity,
}
OUTSIDE = {
    "torque bumps": bumps,
    "resonance": resonance,
    "random load": random_load,
    "hysteresis cable": cable,
    "load-dependent friction": load_dependent,
    "constant torque step": constant_step,
}
SMALL = {
    "cogging": cogging,
    "unbalance": unbalance,
    "belt ripple": ripple,
    "encoder eccentricity": eccentricity,
    "hysteresis cable": cable,
    "backlash": backlash,
    "load-dependent friction": load_dependent,
    "warming": warming,
    "direction-dependent Coulomb": directed_coulomb,
    "random load": random_load,
}

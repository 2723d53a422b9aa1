"""Logs of this simulator as questions.

``effect`` and ``unknown``: one clear effect beside small things. ``none``: small things only.
``sound``: not even those.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np

from ..scores.question import LAW, Question
from .rig import Rig, between, draw_motion, draw_rig, lagged, leftover, share, simulate

KINDS = ("effect", "unknown", "none", "sound")
EFFECTS = {  # of the catalogue: its parameters as they are called here
    "torque_ripple": {"amplitude": "rip_a", "harmonic": "rip_n"},
    "gravity": {"amplitude": "grav", "phase": "grav_ph"},
    "constant_torque": {"torque": "const"},
    "coulomb_asymmetry": {"ratio": "asym_c"},
    "viscous_asymmetry": {"ratio": "asym_v"},
    "quadratic_drag": {"coefficient": "quad"},
    "position_dependent_friction": {"ratio": "pos_a"},
    "thermal_drift": {"time_constant": "warm_tau"},
    "input_delay": {},
    "actuator_lag": {},
    "actuator_saturation": {"limit": "sat"},
    "actuator_dead_zone": {"half_width": "dead"},
    "return_spring": {"stiffness": "spring_k"},
    "hard_stop": {"position": "stop_hi"},
    "elastic_coupling": {"load_inertia": "JL", "stiffness": "kc"},
    "backlash": {"load_inertia": "JL"},
    "inertia_step": {"ratio": "step_J", "time": "step_t"},
    "friction_step": {"ratio": "step_F", "time": "step_t"},
    "periodic_disturbance": {"amplitude": "sin_a", "frequency": "sin_f"},
    "velocity_sensor_lag": {},
    "encoder_eccentricity": {},
}
UNKNOWN = {  # sets of signals that are a right answer
    "torque bumps": (frozenset({"theta"}),),
    "hysteresis cable": (frozenset({"theta", "w"}), frozenset({"w"}), frozenset({"theta"})),
    "random load": (frozenset({"t"}),),
    "constant torque step": (frozenset({"t"}),),
}
SMALL = (  # beside what is to be named
    *("cogging", "torque_ripple", "encoder_eccentricity", "hysteresis cable", "backlash"),
    *("torque_proportional_friction", "thermal_drift", "coulomb_asymmetry", "random load"),
)
SEEN = 0.025  # of friction: less of it cannot be seen
ALIKE = (  # what no log of such a drive tells apart
    {"constant_torque", "coulomb_asymmetry"},
    {"input_delay", "actuator_lag", "velocity_sensor_lag"},
    {"elastic_coupling", "backlash"},
)
COMMAND = ("input_delay", "actuator_lag", "actuator_saturation", "actuator_dead_zone")
NEEDS = {"velocity_sensor_lag": "w", "encoder_eccentricity": "theta"}  # else it is not in the log


def strengths(rng, rig: Rig, o: dict, level: float) -> dict[str, Callable[[float], dict]]:
    """Of each effect the values that make it about so large a share of the friction level.

    ``o`` is the motion without it, by which it is scaled.
    """
    v, Tc, theta, w, u = rig.values, rig.Tc, o["theta"], o["w"], o["u_mean"]
    low, high = np.quantile(theta, [0.01, 0.99])
    span, middle, fast = high - low, 0.5 * (low + high), float(np.sqrt(np.mean(w**2)))
    gap = max(1, int(0.002 / Tc))
    rate = np.sqrt(np.mean((u[gap:] - u[:-gap]) ** 2)) / (gap * Tc) + 1e-12
    jerk = np.sqrt(np.mean((np.diff(w) / Tc) ** 2)) + 1e-12
    least = max(1.0, 6 * np.pi / span)  # periods per turn that are passed several times, and seen
    n = round(between(rng, least, max(min(24 * least, rig.fs / 6 * 2 * np.pi / fast), least)))
    n_slow, ph, side = min(n, 6), rng.uniform(-np.pi, np.pi), rng.choice([-1.0, 1.0])
    at, part = rig.seconds * rng.uniform(0.25, 0.75), rng.uniform(0.2, 0.7)
    J, Fc, sine = v["J"], v["Fc"], 1.41 * level
    two = {"J": J * (1 - part), "JL": J * part}
    stiff, tight = (J * (2 * np.pi * between(rng, *hertz)) ** 2 for hertz in ((8, 40), (30, 80)))
    soft, damped = J * (2 * np.pi * between(rng, 8, 20)) ** 2, rng.uniform(0.02, 0.1)
    dry, frequency = rng.uniform(0.05, 0.3), between(rng, 0.3, min(12, rig.fs / 10))
    place = (middle + span * rng.uniform(-0.25, 0.25) + np.pi) % (2 * np.pi) - np.pi
    drag, tau = min(span * between(rng, 0.03, 0.3), 20.0), rig.seconds * between(rng, 0.15, 0.8)
    width, peak = min(between(rng, 0.05, 0.4), 0.1 * span), np.quantile(np.abs(o["cmd"]), 0.998)
    turned = level / (J * fast**2 + v["Fv"] * fast)

    def spring(s):
        k = part * soft * 0.1 / s
        return {**two, "kc": k, "cc": 2 * damped * np.sqrt(k * two["JL"])}

    def play(s):  # a load with friction of its own: the sum is what the plain drive has
        k, rest = part * tight, {"Fs": v["Fs"] - Fc * dry} if "Fs" in v else {}
        own = {"kc": k, "cc": 10 * damped * np.sqrt(k * two["JL"]), "Fc": Fc * (1 - dry)}
        return {**two, **own, **rest, "FL": Fc * dry, "gap": 0.2 * s * min(span, 0.3 * fast)}

    made = {
        "torque_ripple": lambda s: {"rip_a": s * sine, "rip_n": n, "rip_ph": ph},
        "cogging": lambda s: {"cog_a": s * sine, "cog_n": n + 4, "cog_ph": ph},
        "gravity": lambda s: {"grav": s * sine, "grav_ph": ph},
        "constant_torque": lambda s: {"const": side * s * level},
        "coulomb_asymmetry": lambda s: {"asym_c": side * min(s * level / Fc, 0.8)},
        "viscous_asymmetry": lambda s: {"asym_v": side * min(s * level / (v["Fv"] * fast), 0.9)},
        "quadratic_drag": lambda s: {"quad": s * level / fast**2},
        "position_dependent_friction": lambda s: {
            "pos_a": min(s * sine / Fc, 0.85), "pos_n": n_slow, "pos_ph": ph
        },
        "thermal_drift": lambda s: {"warm": 2 * s, "warm_tau": tau},
        "input_delay": lambda s: {"delay": v["delay"] + s * level / rate},
        "actuator_lag": lambda s: {"lag": s * level / rate},
        "actuator_saturation": lambda s: {"sat": peak / (1 + 3 * s)},
        "actuator_dead_zone": lambda s: {"dead": s * level},
        "return_spring": lambda s: {"spring_k": s * level / (0.35 * span), "spring_0": middle},
        "hard_stop": lambda s: {"stop_hi": high - min(2 * s * level / stiff, 0.4 * span),
                                "stop_k": stiff},
        "elastic_coupling": spring,
        "backlash": play,
        "inertia_step": lambda s: {"step_t": at, "step_J": min(s * sine / (J * jerk), 4.0)},
        "friction_step": lambda s: {"step_t": at, "step_F": side * min(s * sine / Fc, 0.8)},
        "periodic_disturbance": lambda s: {"sin_a": s * sine, "sin_f": frequency, "sin_ph": ph},
        "velocity_sensor_lag": lambda s: {"w_lag": s * level / rate},
        "encoder_eccentricity": lambda s: {
            "ecc": min(1.41 * s * turned, 0.06), "ecc_n": 1.0, "ecc_ph": ph
        },
        "torque bumps": lambda s: {
            "bump_a": side * 3 * s * level, "bump_at": place, "bump_width": width
        },
        "random load": lambda s: {"rand_a": s * level, "rand_f": frequency},
        "hysteresis cable": lambda s: {"cable_F": 1.2 * s * level, "cable_d": drag},
        "torque_proportional_friction": lambda s: {
            "load_mu": min(s * level / np.mean(np.abs(u)), 0.7)
        },
        "constant torque step": lambda s: {"step_t": at, "step_const": side * s * sine},
    }  # fmt: skip
    never = {"gravity"} if "grav" in v or span < 1 else set()
    never |= {"constant_torque"} if "const" in v else set()
    never |= {"return_spring", "hard_stop"} if span > 400 else set()
    never |= {"encoder_eccentricity"} if span < 2 else set()
    return {name: at for name, at in made.items() if name not in never}


@dataclass(frozen=True)
class Drawn:
    """A drive as it truly is, its motion, what is hidden in it, and how it is logged."""

    rig: Rig
    plain: dict
    refs: np.ndarray
    seed: int
    motion: dict
    level: float
    about: str
    values: dict  # of the clear effect, by the names of the settings
    size: float  # its rms torque, of the friction level
    small: tuple[str, ...]
    log: dict
    offset: float


def drawn(seed: int, kind: str, name: str = "none") -> Drawn:
    """A sound log with this effect: drawn until there is one."""
    rng = np.random.default_rng([seed, KINDS.index(kind), *name.encode()])
    while True:
        rig = draw_rig(rng, kind != "sound")
        about, refs, gains = draw_motion(rng, rig)
        rig, noise = rig.having(gains), int(rng.integers(2**31))
        plain, o = rig.plain, simulate(rig, refs, noise)
        if not np.isfinite(share(rig, o, plain)):
            continue
        level = leftover(rig, o, plain)[1]
        ways = strengths(rng, rig, o, level)
        if name != "none" and name not in ways:
            continue
        small = _small(rng, ways, set(ways[name](0.1)) if name in ways else set())
        quiet = rig.having(*small.values()) if kind != "sound" else rig
        o = simulate(quiet, refs, noise)
        before = share(quiet, o, plain)
        if not before < 0.03:
            continue
        hidden, size = {}, 0.0
        if name != "none":
            found = _strong(quiet, refs, noise, plain, ways[name], between(rng, 0.03, 0.4), before)
            if found is None:
                continue
            quiet, o, hidden, size = found
        log, offset = logged(rng, quiet, o, level, name, kind != "sound")
        said = f"{rig.name} {about} {rig.fs} Hz"
        names = tuple(small) if kind != "sound" else ()
        return Drawn(quiet, plain, refs, noise, o, level, said, hidden, size, names, log, offset)


def _small(rng, ways: dict, taken: set) -> dict:
    """Two to four small things, which leave the values of a clear effect alone."""
    made = {}
    for name in rng.permutation(SMALL)[: int(rng.integers(2, 5))]:
        given = ways[str(name)](between(rng, 0.002, 0.015)) if name in ways else {}
        if given and not taken & set(given):
            made[str(name)] = given
            taken = taken | set(given)
    return made


def _strong(rig: Rig, refs, noise, plain, way, wanted: float, before: float):
    """The rig with an effect of about the wanted share, its motion, the values and the share."""
    s = wanted
    for _ in range(4):
        given = way(s)
        new = rig.having(given)
        o = simulate(new, refs, noise)
        size = float(np.sqrt(max(share(new, o, plain) ** 2 - before**2, 1e-10)))
        if wanted / 1.4 < size < wanted * 1.4 and 0.03 < size < 0.45:
            return new, o, given, size
        s *= float(np.clip(wanted / size, 0.15, 6)) if np.isfinite(size) else 0.4
    return None


def logged(rng, rig: Rig, o: dict, level: float, name: str, real: bool) -> tuple[dict, float]:
    """What the logger writes, with its sensors' faults, and the offset of the torque."""
    rows, offset = np.arange(0, len(o["w"]), rig.every), 0.0
    kind = "command" if name in COMMAND else str(rng.choice(["command", "current", "mean"]))
    u = o["cmd"][rows]
    if kind != "command":
        total = np.concatenate([[0.0], np.cumsum(o["u_mean"])])
        mean = (total[rows] - total[np.maximum(rows - rig.every, 0)]) / rig.every
        u, moved = mean if kind == "mean" else o["u"][rows], int(rng.choice([0, 0, 1, 2]))
        u = np.concatenate([np.full(moved, u[0]), u[: len(u) - moved]])
        offset = level * rng.uniform(-0.03, 0.03) * rng.integers(2)
        u = u + offset + level * between(rng, 0.002, 0.06) * rng.standard_normal(len(u))
        step = rig.values["umax"] / 2 ** rng.integers(9, 14)
        u = np.round(u / step) * step
    log = {"t": rows * rig.Tc, "u": u}
    which = str(rng.choice(["theta", "w", "both"], p=[0.3, 0.15, 0.55]))
    which = which if NEEDS.get(name, which) == which else "both"
    if which != "w":  # a count names the middle of its step
        log["theta"] = o["read"][rows] + 0.5 * rig.values["q"]
    if which != "theta":
        log["w"] = lagged(o["w_read"], rig.values.get("w_lag", 0.0), rig.Tc)[rows]
    if real and rng.random() < 0.2:
        late = rng.uniform(0.005, 0.05) / rig.fs * rng.standard_normal(len(rows)).clip(-3, 3)
        log["t"] = log["t"] + late
    if real and rng.random() < 0.08:
        keep = rng.random(len(rows)) > rng.uniform(0.0005, 0.005)
        log = {key: column[keep] for key, column in log.items()}
    return log, float(offset)


@cache
def asked(seed: int, kind: str) -> tuple[str, Drawn, float]:
    """What is hidden in the log of a seed, the log, and how much of the effect shows in it."""
    names = {"effect": tuple(EFFECTS), "unknown": tuple(UNKNOWN)}.get(kind, ("none",))
    name = names[seed % len(names)]
    for attempt in range(20):
        made = drawn(seed + 100_000 * attempt, kind, name)
        visible = share(made.rig, made.motion, made.plain, refit=True)
        if name == "none" or visible > SEEN:
            break
    return name, made, visible


def draw(seed: int, kind: str) -> Question:
    """The question of a seed; the same one each time."""
    name, made, _ = asked(seed, kind)
    plain = made.plain
    values = {k: plain[k] for k in ("J", "Fc", "Fv")}
    if name == "none":
        values["constant_torque"] = plain["const"] + made.offset
        if plain["grav"] > 0.1 * plain["Fc"]:
            values |= {"gravity.amplitude": plain["grav"], "gravity.phase": plain["grav_ph"]}
    keys = EFFECTS.get(name, {})
    values |= {f"{name}.{k}": float(made.values[v]) for k, v in keys.items() if v in made.values}
    return Question(
        seed,
        kind,
        made.log,
        declared(np.random.default_rng([seed, 73]), plain, name),
        name,
        values,
        UNKNOWN.get(name, ()),
        frozenset(n.replace("cogging", "torque_ripple") for n in made.small) | LAW,
        made.size * made.level,
        made.level,
        frozenset().union(*(group for group in ALIKE if name in group)) - {name},
        made.about,
    )


def declared(rng, plain: dict, name: str) -> dict:
    """The right structure, values 10 to 20 % off."""

    def off(key: str) -> float:
        return float(plain[key] * (1 + rng.choice([-1, 1]) * rng.uniform(0.1, 0.2)))

    keys = ("Fc", "Fs", "Fv", "vs") if plain["Fs"] > plain["Fc"] else ("Fc", "Fv")
    friction: dict = {"model": "stribeck" if "Fs" in keys else "coulomb"}
    friction |= {key: off(key) for key in keys}
    if "Fs" in keys:
        friction["Fs"] = max(friction["Fs"], 1.02 * friction["Fc"])
    loads: list[dict] = []
    if plain["grav"] and name != "gravity":
        loads.append({"name": "gravity", "amplitude": off("grav"), "phase": plain["grav_ph"]})
    if plain["const"] and name != "constant_torque":
        loads.append({"name": "constant_torque", "torque": off("const")})
    model = {"name": "held out", "motion": "rotary", "plant": {"J": off("J")}}
    return model | {"friction": friction} | ({"effects": loads} if loads else {})

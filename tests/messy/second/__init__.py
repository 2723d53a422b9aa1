"""Simulated drive logs as machines give them; for reports only, independent of other generators.

``draw(seed, kind)`` with kind ``effect``, ``none``, ``unknown`` or ``sound``.
Phases and signs are those of the public contract; torque-constant ripple is a shaft torque
``u (1 + a sin(N theta + phi))`` where ``u`` is logged.
"""

from __future__ import annotations

import numpy as np
from numpy.random import Generator

from ..case import EFFECTS, Case
from . import alike as same
from . import effects as fx
from . import kernel as k
from . import motion, recorder
from .machine import Machine, machine, spindle, steer

KINDS = ("effect", "none", "unknown", "sound")
RATES = (100.0, 200.0, 250.0, 500.0, 1000.0, 2000.0)
RANGE = (0.03, 0.25)  # RMS torque of the effect over RMS friction torque
SEEN = 0.025  # of it, what the declared structure cannot absorb
POSITIONED = ("return_spring", "hard_stop", "load_dependent_friction", "gravity", "constant_torque",
              "detent", "rubbing_spot")  # fmt: skip
ACTUATOR = ("input_delay", "actuator_lag", "actuator_dead_zone", "torque_constant_ripple")
ANGLE = POSITIONED + ("torque_ripple", "position_dependent_friction", "torque_constant_ripple")
BESIDE = {  # what the declared law says only nearly, of each true one
    "grease": frozenset({"sublinear_viscous"}),
    "static": frozenset({"presliding"}),
    "slip": frozenset({"presliding"}),
}

__all__ = ["KINDS", "draw", "simulate"]


def draw(seed: int, kind: str) -> Case:
    """One record with its truth; the same seed and kind give the same record."""
    if kind not in KINDS:
        raise ValueError(f"kind must be one of {KINDS}, not {kind!r}")
    for attempt in range(400):
        rng = np.random.default_rng([seed, KINDS.index(kind), attempt])
        case = _sound(rng, seed) if kind == "sound" else _drawn(rng, seed, kind)
        if case is not None:
            case.about["attempts"] = attempt + 1
            return case
    raise RuntimeError(f"no sensible record for seed {seed}, kind {kind}")


def simulate(
    m: Machine, ref: np.ndarray, dist: np.ndarray, code: int = -1, e: tuple = (), w0: float = 0.0
) -> np.ndarray:
    """True signals at every tick, columns as in ``kernel``."""
    p = np.array([float(m.P.get(x, 0.0)) for x in k.NAMES])
    p[k.WTAU] = p[k.WTAU] or 1.0
    p[k.WFF] = p[k.WFF] or 1.0
    numbers = np.zeros(4)
    numbers[: len(e)] = e
    return k.run(p, m.stiffness, m.share, ref, dist, code, numbers, m.fs, m.nsub, w0)


def _rate(rng: Generator, m: Machine, least: float) -> float:
    """A log rate that divides the loop's and sees a few samples per turn."""
    least = max(least, 1.5 * m.wmax / 2 / np.pi * 4, 25 * m.amax / m.wmax / 2 / np.pi)
    fits = [f for f in RATES if f <= m.fs and m.fs % f == 0 and f >= min(least, 1000.0)]
    return float(rng.choice(fits)) if fits else 1000.0


def _mode(rng: Generator, m: Machine, name: str) -> str:
    """A control structure that suits machine and effect."""
    if m.type == "hobby" or m.P["grav"] or name in POSITIONED or m.type == "screw":
        return str(rng.choice(["cascade", "pd"], p=[0.3, 0.7] if m.type == "hobby" else [0.7, 0.3]))
    return str(rng.choice(["cascade", "pd", "velocity", "open"], p=[0.25, 0.15, 0.35, 0.25]))


def _motion(rng: Generator, mode: str, name: str) -> str:
    names = {"velocity": motion.SPEED, "open": motion.TORQUE}.get(mode, motion.BOUND)
    if name in fx.LIVELY or name in ("viscous_asymmetry", "quadratic_drag"):
        names = tuple(x for x in names if x not in ("scan", "staircase"))
    p = np.array([motion.OFTEN.get(x, 1.0) for x in names])
    return str(rng.choice(names, p=p / p.sum()))


def _sensible(m: Machine, out: np.ndarray, mode: str) -> bool:
    """The drive moves, is not pinned to its limit, and stays in reach."""
    w, u = np.abs(out[:, k.W]), np.abs(out[:, k.UCMD])
    if not np.isfinite(out).all() or w.max() > 4 * m.wmax:
        return False
    moving = np.mean(w > 0.02 * m.wmax)
    pinned = np.mean(u > 0.99 * m.P["umax"])
    bound = mode in ("cascade", "pd")
    return (
        moving > (0.12 if mode == "open" else 0.3)
        and pinned < 0.03
        and not (bound and np.ptp(out[:, k.TH]) > 3.5 * m.stroke)
    )


def _stage(rng: Generator, name: str) -> tuple | None:
    """Machine, references, motion without effect, log rate and mode."""
    slow = 0.01 if name in ("input_delay", "actuator_lag") else 0.0
    m = machine(rng, name in fx.LIVELY, slow)
    m.P["grav"] = m.P["grav_phase"] = 0.0
    if name == "load_dependent_friction" or (
        rng.random() < 0.25 and name not in ("gravity", "return_spring")
    ):
        m.P["grav"] = m.P["Fc"] * rng.uniform(0.3, 1.2)
        m.P["grav_phase"] = float(rng.uniform(-np.pi, np.pi))
    mode = _mode(rng, m, name)
    steer(rng, m, mode)
    moves = _motion(rng, mode, name)
    f_log = _rate(rng, m, 500.0 if slow or moves == "pulses" else 0.0)
    ref = motion.reference(rng, m, moves, rng.uniform(10, 45))
    out = simulate(m, ref, np.zeros(ref.shape[1]))
    if not _sensible(m, out, mode):
        return None
    return m, ref, out, f_log, mode, moves


def _with(
    rng: Generator, name: str, m: Machine, ref: np.ndarray, out: np.ndarray, f_log: float
) -> tuple | None:
    """Motion with the effect in the stated range, and its numbers."""
    n, code = ref.shape[1], fx.code_of(name)
    dist = fx.bursts(rng, n, m.fs) if name == "bursts" else np.zeros(n)
    if name in fx.FIXED:
        e = fx.drawn(rng, name, m, out, f_log)
        new = simulate(m, ref, dist, code, tuple(e))
        return new, e
    rest = fx.others(rng, name, m, out, f_log)
    if rest is None:
        return None
    load = m.P["grav"] * np.sin(out[:, k.TH] + m.P["grav_phase"])
    wanted = float(np.exp(rng.uniform(np.log(RANGE[0] * 1.1), np.log(RANGE[1] * 0.9))))
    sign = float(rng.choice([-1, 1])) if name in fx.SIGNED else 1.0
    size = wanted * fx.rms(out[:, k.F0]) / max(fx.unit(name, rest, m, out, load), 1e-12)
    for _ in range(4):
        if name in fx.SIGNED[1:] and size > 0.85:
            return None
        new = simulate(m, ref, dist, code, (sign * size, *rest))
        ratio = fx.rms(new[:, k.RE]) / fx.rms(new[:, k.F0]) / wanted
        if not np.isfinite(ratio) or ratio < 1e-3:
            return None
        if abs(np.log(ratio)) < 0.1:
            return new, [sign * size, *rest]
        size /= ratio
    return None


def _hidden(name: str, out: np.ndarray) -> float:
    """RMS torque of the effect; of a coupled load without the part of a rigid one."""
    r = out[:, k.RE]
    if name in ("elastic_coupling", "backlash"):
        a = np.gradient(out[:, k.W])
        r = r - a * (a @ r) / (a @ a)
    return fx.rms(r)


def _numbers(name: str, e: list[float], m: Machine, f_log: float) -> dict[str, float]:
    """True parameters under their public names."""
    if name in ("input_delay", "actuator_lag"):
        e = [e[0] - 0.5 * (1 / f_log - 1 / m.fs)]  # beyond the hold of the log
    return {f"{name}.{x}": float(v) for x, v in zip(fx.PARAMETERS.get(name, ()), e, strict=False)}


def _drawn(rng: Generator, seed: int, kind: str) -> Case | None:
    """A record with background, with or without an effect; None where it is silly."""
    name = {"effect": EFFECTS[seed % 20], "none": "none", "unknown": fx.UNKNOWN[seed % 4]}[kind]
    staged = _stage(rng, name)
    if staged is None:
        return None
    m, ref, out, f_log, mode, moves = staged
    background = fx.background(rng, m, out, f_log, name)
    e: list[float] = []
    if name == "none":
        out = simulate(m, ref, np.zeros(ref.shape[1]))
    else:
        found = _with(rng, name, m, ref, out, f_log)
        if found is None:
            return None
        out, e = found
    if not _sensible(m, out, mode):
        return None
    friction, hidden = fx.rms(out[:, k.F0]), 0.0 if name == "none" else _hidden(name, out)
    if name != "none" and not RANGE[0] <= hidden / friction <= RANGE[1]:
        return None
    log, about = recorder.record(
        rng, m, out, f_log, name in ACTUATOR, name in ANGLE or bool(m.P["grav"])
    )
    about |= {"machine": m.type, "law": m.friction, "mode": mode, "motion": moves, "m": m}
    names: frozenset[str] = frozenset()
    if name != "none":
        s = same.scene(m, out)
        about["seen"] = fx.rms(s.y) / friction
        if about["seen"] < SEEN:
            return None
        noise = same.noise_floor(m, f_log, about["u_noise"], log["t"][-1])
        names, about["leaves"] = same.alike(s, name, noise, same.hold_error(s, log))
        if kind == "unknown" and min(about["leaves"].values()) < 0.6 * fx.rms(s.y):
            return None
    background |= BESIDE.get(m.friction, frozenset())
    about["true"] = out
    values = recorder.truth(m) | _numbers(name, e, m, f_log)
    signals = fx.DEPENDS[seed % 4] if kind == "unknown" else ()
    return Case(seed, kind, log, recorder.declare(rng, m), name, values, signals,
                frozenset(background), hidden, friction, names - {name}, about)  # fmt: skip


def _sound(rng: Generator, seed: int) -> Case | None:
    """A sound drive: every other seed with a coloured disturbance, else an exact log."""
    m = machine(rng, exact=seed % 2 == 1)
    m.P["grav"] = m.P["grav_phase"] = 0.0
    made = _coloured(rng, m) if seed % 2 == 0 else _exact(rng, m)
    if made is None:
        return None
    log, about, out = made
    about |= {"machine": m.type, "law": m.friction, "m": m, "true": out}
    spared = BESIDE.get(m.friction, frozenset())
    return Case(seed, "sound", log, recorder.declare(rng, m), "none", recorder.truth(m), (),
                spared, 0.0, fx.rms(out[:, k.F0]), frozenset(), about)  # fmt: skip


def _coloured(rng: Generator, m: Machine) -> tuple | None:
    """A usual log under a random torque of 1-8 % of friction with some memory."""
    mode = _mode(rng, m, "none")
    steer(rng, m, mode)
    moves = _motion(rng, mode, "none")
    f_log = _rate(rng, m, 500.0 if moves == "pulses" else 0.0)
    ref = motion.reference(rng, m, moves, rng.uniform(10, 45))
    x, memory = fx.coloured(rng, ref.shape[1], m.fs)
    plain, size = simulate(m, ref, 0.0 * x), rng.uniform(0.01, 0.08)
    out = simulate(m, ref, x * size * fx.rms(plain[:, k.F0]))
    if not _sensible(m, out, mode):
        return None
    log, about = recorder.record(rng, m, out, f_log, False, False)
    return log, about | {"mode": mode, "motion": moves, "memory": memory, "disturbance": size}, out


def _exact(rng: Generator, m: Machine) -> tuple | None:
    """Ideal sensors at the rate of the loop: pulses, steps, a coast-down, slow scans."""
    moves = str(rng.choice(["pulses", "coast-down", "scan", "staircase"]))
    mode = "open" if moves in ("pulses", "coast-down") else str(rng.choice(["pd", "cascade"]))
    seconds, coast, w0 = rng.uniform(10, 45), 0.0, 0.0
    if moves == "coast-down":  # fast at first, no torque; pulses once it is slow
        coast = seconds * rng.uniform(0.2, 0.6)
        spindle(m, coast)
        w0 = float(m.wmax * rng.choice([-1, 1]))
    steer(rng, m, mode)
    m.P.update(q=0.0, uq=0.0)
    ref = motion.reference(rng, m, "pulses" if mode == "open" else moves, seconds)
    ref[3, : int(coast * m.fs)] = 0.0
    out = simulate(m, ref, np.zeros(ref.shape[1]), w0=w0)
    if not np.isfinite(out).all() or np.abs(out[:, k.W]).max() > 4 * m.wmax:
        return None
    log, about = recorder.exact(m, out, m.fs)
    return log, about | {"mode": mode, "motion": moves}, out

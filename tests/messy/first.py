"""The first generator: a machine, a motion, a background and one effect."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from scipy.ndimage import uniform_filter1d

from .alike import alike
from .case import EFFECTS, Case
from .effects import MAIN, UNKNOWN, Inputs, apply, harmonic, hidden, plan
from .log import record
from .machine import LATE, LAWS, Machine, declare, draw_machine, elements
from .moves import KINDS, reference
from .plant import POSITION, RATE, TORQUE, VELOCITY, simulate
from .score import LAW

BACKGROUND = LAW | {
    "torque_ripple",
    "gravity",
    "coulomb_asymmetry",
    "encoder_eccentricity",
    "thermal_drift",
}
CODES = {"effect": 1, "none": 2, "unknown": 3, "sound": 4}
LEAST, MOST = 0.03, 0.25  # RMS torque of the effect over that of friction
MOST_OF = {"backlash": 0.8, "elastic_coupling": 0.8, "input_delay": 0.5, "actuator_lag": 0.5}
ABSORBED = ("quadratic_drag", "thermal_drift", "actuator_dead_zone", "load_dependent_friction")
PLACES = ("hard_stop", "bumps_in_theta", "rough_patch")  # to be passed several times
SEEN = 0.03  # the least of it that the declared structure leaves unexplained


class Silly(Exception):
    """The drive does not move as a drive does, or the effect cannot be seen: draw again."""


@dataclass
class Drawn:
    """All that was drawn of one case, before its log."""

    machine: Machine
    name: str
    parameters: dict
    share: float
    motion: tuple[np.ndarray, np.ndarray, np.ndarray]
    mode: int
    quiet: dict = field(default_factory=dict)  # the background by its names
    warm: tuple[float, float] = (0.0, 1.0)
    disturbance: np.ndarray | None = None
    exact: bool = False  # the torque is held from sample to sample of the log


def draw(seed: int, kind: str) -> Case:
    """The case of ``seed``; the same one each time. ``kind``: effect, none, unknown, sound."""
    if kind == "sound" and seed % 2:
        from .sound import exact

        return exact(seed)
    for attempt in range(60):
        g = np.random.default_rng([seed, CODES[kind], attempt])
        try:
            return _attempt(seed, kind, g)
        except Silly:
            continue
    raise RuntimeError(f"no plausible {kind} case at seed {seed}")


def _attempt(seed: int, kind: str, g: np.random.Generator) -> Case:
    name = "none"
    if kind == "effect":
        name = EFFECTS[seed % len(EFFECTS)]
    elif kind == "unknown":
        name = list(UNKNOWN)[seed % len(UNKNOWN)]
    drawn = _drawn(name, g)
    if kind == "sound":
        drawn.disturbance = coloured(g, len(drawn.motion[0])) * g.uniform(0.01, 0.08)
    sizes = elements(drawn.machine, g)
    noise = int(g.integers(2**31))
    run = _scaled(drawn, sizes, noise)
    return _case(seed, kind, drawn, run, g)


def _drawn(name: str, g: np.random.Generator) -> Drawn:
    m = draw_machine(g, name)
    kind = str(g.choice(KINDS))
    quick = 2.0 if name in (*LATE, "elastic_coupling", "backlash") else 1.0
    motion = reference(m, g, kind, float(g.uniform(12, 40)), quick)
    fric = friction_rms(m, motion[1])
    least = 0.12 if name in ABSORBED else 0.04
    share = float(np.exp(g.uniform(np.log(least), np.log(0.22))))
    parameters = plan(name, m, g, motion, fric, share) if name != "none" else {}
    mode = POSITION if kind in ("moves", "multisine") or name == "hard_stop" else VELOCITY
    drawn = Drawn(m, name, parameters, share, motion, mode)
    _background(drawn, g, fric)
    return drawn


def friction_rms(m: Machine, w: np.ndarray) -> float:
    """RMS friction torque at the velocities ``w``, roughly."""
    return float(np.sqrt(np.mean((m.Fc * np.tanh(w / m.vs) + m.Fv * w) ** 2)))


def _background(drawn: Drawn, g: np.random.Generator, fric: float) -> None:
    """What every machine has: 0.4 to 1.2 % of friction each, and warming of 0.5 to 2 %."""
    m, (theta, w, _) = drawn.machine, drawn.motion
    one, two, three, four = g.uniform(0.004, 0.012, 4) * fric
    angles = g.uniform(-3.1, 3.1, 3)
    order = int(g.integers(1, 3))
    swing = float(np.sqrt(np.mean((order * w) ** 4))) * m.J / 1.41
    ripple = min(four / max(swing, 1e-12), 2e-3)
    drawn.quiet = {
        "torque_ripple": {
            "amplitude": 1.41 * one,
            "harmonic": harmonic(g, theta, m),
            "phase": angles[0],
        },
        "gravity": {"amplitude": 1.41 * two, "phase": angles[1]},
        "coulomb_asymmetry": {"ratio": float(g.choice([-1, 1])) * three / m.Fc},
    }
    drawn.quiet["encoder"] = (ripple, order, angles[2])
    drawn.warm = (float(g.choice([-1, -1, 1])) * g.uniform(0.005, 0.02), g.uniform(3, 20))


def _scaled(drawn: Drawn, sizes, noise: int) -> dict[str, np.ndarray]:
    """The run, its effect scaled until its torque is what was drawn, within a third."""
    main, most = MAIN.get(drawn.name), MOST_OF.get(drawn.name, MOST)
    for _ in range(4):
        _bounded(drawn)
        run = simulated(drawn, sizes, noise)
        if drawn.name == "none":
            return run
        share = _rms(hidden(drawn.name, drawn.parameters, drawn.machine, run)) / _friction(run)
        close = LEAST <= share <= most and abs(math.log(share / drawn.share)) < 0.3
        if close or (main is None and LEAST <= share <= most):
            return run
        if main is None:
            break
        drawn.parameters[main] *= min(max(drawn.share / max(share, 1e-9), 0.2), 5.0)
    raise Silly


def _bounded(drawn: Drawn) -> None:
    p = drawn.parameters
    if "ratio" in p and not -0.6 < p["ratio"] < 0.9:
        raise Silly
    if drawn.name == "rough_patch" and abs(p["scale"]) > 1.5:
        raise Silly


def simulated(drawn: Drawn, sizes, noise: int) -> dict[str, np.ndarray]:
    """One run of what was drawn, by name, at the control rate."""
    m, motion = drawn.machine, drawn.motion
    n = len(motion[0])
    into = Inputs.neutral(n, m.J)
    t = np.arange(n) / RATE
    grown = 1 + drawn.warm[0] * (1 - np.exp(-t / drawn.warm[1]))
    into.level *= grown
    into.warm *= grown
    for name in ("torque_ripple", "gravity", "coulomb_asymmetry"):
        if name in drawn.quiet:
            apply(name, drawn.quiet[name], m, into)
    if m.gravity > 0:
        into.rows.append((1, m.gravity, 1.0, 0.0))
    if drawn.name != "none":
        apply(drawn.name, drawn.parameters, m, into)
    if drawn.disturbance is not None:
        into.torque += drawn.disturbance * friction_rms(m, motion[1])
    return _run(drawn, into, sizes, noise)


def _run(drawn: Drawn, into: Inputs, sizes, noise: int) -> dict[str, np.ndarray]:
    m, motion = drawn.machine, drawn.motion
    n, g = len(motion[0]), np.random.default_rng(noise)
    ripple, order, angle = drawn.quiet.get("encoder", (0.0, 1, 0.0))
    tacho = m.tacho * g.standard_normal(n) if m.w == "tacho" else np.full(n, 1e31)
    inertia = m.J + into.load[0]
    stiff = m.stiffness
    if into.load[0] > 0:  # the loop stays below the resonance
        stiff = min(stiff, 0.6 * np.sqrt(into.load[1] / into.load[0]))
    gains = (
        inertia * stiff,
        inertia * stiff**2 / 6,
        stiff / 5,
        inertia,
        0.8 * m.Fc,
        6 * (m.Fc + m.J * m.pull),
        1 - np.exp(-m.smooth / RATE),
        float(m.every if drawn.exact else 1),
    )
    plant = (m.J, m.Fc, m.Fs, m.vs, m.delta, m.sigma0, m.sigma1, m.Fv, m.power)
    rows = np.array(into.rows or [(0, 0, 0, 0)], float)
    back = (into.level, into.warm, into.torque, into.inertia, rows)
    own = np.sqrt((m.sigma0 + into.load[1]) / m.J)
    sub = int(min(max(2, np.ceil(own / RATE / 0.15)), 16))
    load = tuple(map(float, into.load))
    encoder = (float(m.counts), ripple, np.array([order, angle]))
    out = simulate(
        drawn.mode,
        *motion,
        gains,
        encoder,
        tacho,
        plant,
        LAWS[m.law],
        *sizes,
        back,
        load,
        tuple(map(float, into.drive)),
        sub,
    )
    return named(out, drawn)


def named(out: np.ndarray, drawn: Drawn) -> dict[str, np.ndarray]:
    """The run's rows by name; Silly where the drive does not move as its reference does."""
    names = ("theta", "w", "command", "acting", "bristle", "viscous", "shaft", "a")
    run = dict(zip((*names, "heard", "seen"), out, strict=True))
    run["t"] = np.arange(out.shape[1]) / RATE
    w, aim = run["w"], drawn.motion[1]
    if not np.isfinite(out).all():
        raise Silly
    if drawn.mode == TORQUE:
        moves = np.mean(np.abs(w) > 0.02 * drawn.machine.top)
        if moves < 0.1 or np.max(np.abs(w)) > 10 * drawn.machine.top:
            raise Silly
    elif (
        _loud(run) > 0.25
        or _rms(w - aim) > 0.4 * _rms(aim)
        or np.max(np.abs(w)) > 2.5 * np.max(np.abs(aim))
    ):
        raise Silly
    return run


def _touches(torque: np.ndarray) -> int:
    """How often the drive comes to where the torque is."""
    beyond = np.abs(torque) > 0.1 * np.max(np.abs(torque))
    return int(np.sum(np.diff(beyond.astype(int)) > 0))


def _loud(run: dict[str, np.ndarray]) -> float:
    """RMS of the command above some 30 Hz over friction: with more, people lower the gains."""
    smooth = uniform_filter1d(run["command"], int(0.02 * RATE))
    return _rms(run["command"] - smooth) / _friction(run)


def _case(seed: int, kind: str, drawn: Drawn, run, g: np.random.Generator) -> Case:
    m = drawn.machine
    torque = hidden(drawn.name, drawn.parameters, m, run)
    background = set(BACKGROUND)
    if m.w == "difference":
        background.add("velocity_sensor_lag")
    values = {"J": m.J}
    if m.power == 1.0:
        grown = float(np.mean(1 + drawn.warm[0] * (1 - np.exp(-run["t"] / drawn.warm[1]))))
        values |= {"Fc": m.Fc * grown, "Fv": m.Fv * grown}
    if kind == "effect":
        values |= {f"{drawn.name}.{key}": float(v) for key, v in drawn.parameters.items()}
    if m.every > 4:  # a lag as a log of few samples shows it is a shorter one
        values.pop("actuator_lag.time_constant", None)
    model = declare(m, g)
    others, seen = frozenset(), 0.0
    if kind in ("effect", "unknown"):
        if drawn.name in PLACES and _touches(torque) < 5:
            raise Silly
        seen, others = alike(drawn, run, torque, SEEN * _friction(run))
        if seen < SEEN * _friction(run):
            raise Silly
    return Case(
        seed,
        kind,
        record(m, g, run),
        model,
        drawn.name,
        values,
        UNKNOWN.get(drawn.name, ()),
        frozenset(background),
        _rms(torque),
        _friction(run),
        others,
        {"machine": m.few, "law": m.law, "seen": seen / _friction(run)},
    )


def coloured(g: np.random.Generator, n: int) -> np.ndarray:
    """Noise of unit RMS below some 1 to 10 Hz."""
    from scipy.signal import lfilter

    keep = np.exp(-2 * np.pi * np.exp(g.uniform(0, np.log(10))) / RATE)
    x = lfilter([1], [1, -keep], g.standard_normal(n))
    return x / _rms(x)


def _friction(run) -> float:
    return _rms(run["bristle"] + run["viscous"])


def _rms(x) -> float:
    return float(np.sqrt(np.mean(np.square(x))))

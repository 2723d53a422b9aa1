"""Drives as machines are: one effect to name beside a background that is always there.

``draw(seed, kind)`` asks one question. ``effect``: one of twenty effects is hidden. ``unknown``:
one outside the catalogue. ``none``: nothing but the background. ``sound``: not even that.
``dip``: sound, slow at times, its Stribeck curve spread evenly over Fs/Fc and two decades of vs.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.signal import lfilter

from ..scores.points import LAW
from ..scores.question import EFFECTS, Question
from .alike import alike
from .effects import CATALOGUE, Context, find
from .hide import calibrate, visible
from .machines import GRAVITY_LOAD, Machine
from .moves import EXCITATIONS, MORE, TORQUES
from .plant import OPEN_LOOP, POSITION_LOOP
from .run import FINE, Run, Setup, drive_row, simulate

KINDS = ("effect", "none", "unknown", "sound", "dip")
RATE = 2000.0  # of the loop
BACKGROUND = LAW | {
    *("torque_ripple", "gravity", "coulomb_asymmetry", "encoder_eccentricity", "thermal_drift")
}
UNKNOWN = {  # sets of signals that are a right answer
    "torque_bumps": (frozenset({"theta"}),),
    "rough_patch": (frozenset({"theta", "w"}), frozenset({"theta"})),
    "speed_hump": (frozenset({"w"}),),
    "contact_pulses": (frozenset({"t"}),),
}
LATE = ("input_delay", "actuator_lag", "actuator_dead_zone")  # seen in the command only
TIMES = {"input_delay": "delay", "actuator_lag": "time_constant"}
ABSORBED = ("quadratic_drag", "thermal_drift", "actuator_dead_zone", "load_dependent_friction")
SOFT = ("input_delay", "actuator_lag", "elastic_coupling", "backlash")  # what a stiff loop shakes
LEAST, MOST = 0.03, 0.25  # RMS torque of the effect over that of friction
SEEN = 0.03  # the least of it that the declared structure leaves unexplained


@dataclass(frozen=True)
class Sensing:
    """What is logged of a drive, and how."""

    counts: int
    w: str  # "tacho", "difference", "none"
    smooth: float  # rad/s, filter of the encoder's difference
    u: str  # "current", "command", "mean"
    current: tuple[float, float, float]  # noise, step [N m], lag [s]
    every: int  # samples of the loop to one of the log
    stiffness: float  # rad/s, bandwidth of the speed loop


def between(g: np.random.Generator, low: float, high: float) -> float:
    """One number, its logarithm uniform."""
    return float(np.exp(g.uniform(np.log(low), np.log(high))))


def draw(seed: int, kind: str) -> Question:
    """The question of ``seed``; the same one each time."""
    name = "none"
    if kind in ("effect", "unknown"):
        names = EFFECTS if kind == "effect" else tuple(UNKNOWN)
        name = names[seed % len(names)]
    for attempt in range(80):
        g = np.random.default_rng([seed, KINDS.index(kind), attempt])
        made = _attempt(seed, kind, name, g)
        if made is not None:
            return made
    raise RuntimeError(f"no plausible {kind} at seed {seed}")


def _attempt(seed: int, kind: str, name: str, g: np.random.Generator) -> Question | None:
    m = machine(g, name)
    if kind == "dip":  # an even lattice
        Fs = m.Fc * (1.05 + 0.95 * ((0.5 + seed * 0.754877666) % 1))
        vs = m.w_max * 10 ** (-2.5 + 2.0 * ((0.5 + seed * 0.569840291) % 1))
        m = replace(m, law="lugre", delta=1.0 + seed % 2, power=1.0, Fs=Fs, vs=vs)
    s = sensing(g, m, name)
    setup = prepare(g, m, s, kind, name)
    base = simulate(setup, {})
    if not moves(base):
        return None
    hidden, alone = hide(g, base, s, name)
    quiet = background(g, base) if kind not in ("sound", "dip") else None
    table = hidden | ({"imperfections": quiet} if quiet else {})
    run = simulate(replace(setup, machine=m), table)
    if not moves(run):
        return None
    others: frozenset[str] = frozenset()
    if name != "none":
        share, seen = alone.effect_rms / alone.friction_rms, visible(alone) / alone.friction_rms
        most = 0.5 if name in TIMES else MOST
        if not LEAST <= share <= most or seen < SEEN:
            return None
        others = alike(alone, name, s.every, quiet)
    return Question(
        seed,
        kind,
        logged(g, run, s),
        declared(g, m),
        name,
        true_values(run, hidden, quiet, s),
        UNKNOWN.get(name, ()),
        BACKGROUND | ({"velocity_sensor_lag"} if s.w == "difference" else frozenset()),
        alone.effect_rms if name != "none" else 0.0,
        alone.friction_rms,
        others,
        {"machine": f"J {m.J:.2g} Fc {m.Fc:.2g} {m.law} {RATE / s.every:g} Hz w:{s.w} u:{s.u}"},
    )


def machine(g: np.random.Generator, name: str) -> Machine:
    """A machine of any size on which the effect may be seen."""
    J, ratio = between(g, 1e-5, 1.0), between(g, 6.0, 150.0)
    Fc, pull = J * ratio, ratio * between(g, 1.0, 5.0)
    top = pull * between(g, 0.12, 0.6)
    Fs = Fc * g.uniform(1.02, 1.5)
    lopsided = name == "viscous_asymmetry"
    power = 1.0 if lopsided else float(g.choice([1.0, 1.0, 0.85, 0.8]))
    share = g.uniform(0.6, 1.2) if lopsided else g.uniform(0.12, 0.9)
    sigma0 = Fs / between(g, 1e-4, 1.5e-3)
    heavy = name == "load_dependent_friction"
    load = (GRAVITY_LOAD, Fc * float(g.uniform(0.5, 1.1) if heavy else g.uniform(0.2, 0.9)), 0.0)
    if not heavy and (name == "gravity" or g.random() > 0.35):
        load = (0, 0.0, 0.0)
    return Machine(
        name="messy",
        motion="rotary",
        J=J,
        sigma0=sigma0,
        sigma1=2 * g.uniform(0.15, 0.6) * np.sqrt(sigma0 * J),
        Fc=Fc,
        Fs=Fs,
        Fv=Fc * share / top**power,
        vs=top * between(g, 0.002, 0.02),
        w_max=top,
        w_noise=top * between(g, 0.001, 0.004),
        quanta=(),
        load=load,
        law=str(g.choice(["lugre", "lugre", "maxwell", "elastoplastic", "static"])),
        delta=float(g.choice([1.0, 2.0])),
        power=power,
    )


def sensing(g: np.random.Generator, m: Machine, name: str) -> Sensing:
    """Sensors, and a bandwidth that neither shouts at the encoder nor swings."""
    counts = int(g.choice([2000, 4096, 8192, 10000, 20000, 65536, 100000]))
    w = str(g.choice(["tacho", "difference", "none"]))
    u = "command" if name in LATE else str(g.choice(["current", "current", "command", "mean"]))
    stiff = between(g, 25.0, 250.0)
    if w != "tacho":  # J stiff * quantum * 4 stiff stays below an eighth of friction
        stiff = min(stiff, float(np.sqrt(m.Fc / m.J * counts / (64 * np.pi))))
    if name in SOFT:
        stiff = min(stiff, between(g, 20.0, 45.0))
    current = m.Fc * between(g, 0.004, 0.03), m.Fc * between(g, 0.001, 0.01), g.uniform(3e-4, 1e-3)
    every = int(g.choice([2, 2, 4, 5, 10] if u != "mean" else [2, 4]))
    every = 2 if name in TIMES else every  # a log of few samples holds the torque for as long
    stiff = max(stiff, 12.0)
    return Sensing(counts, w, max(4 * stiff, between(g, 150, 1000)), u, current, every, stiff)


def prepare(g: np.random.Generator, m: Machine, s: Sensing, kind: str, name: str) -> Setup:
    """Reference and loop; a bristle drive, on which effects are sized alike for all laws."""
    t = np.arange(int(g.uniform(12, 40) * RATE)) / RATE
    kinds = ["rich", "moves", "multisine", *MORE, *(TORQUES if kind == "sound" else ())]
    loop, refs = (EXCITATIONS | MORE | TORQUES)[str(g.choice(kinds))](m, g, t)
    if kind == "dip":  # over decades of speed
        refs = refs * 10.0 ** (-1.5 * abs((t / 8.0) % 2.0 - 1.0))
    if name == "hard_stop" and loop != OPEN_LOOP:
        loop, refs[1] = POSITION_LOOP, np.cumsum(refs[0]) / RATE
    if loop != OPEN_LOOP:  # what a good drive feeds forward
        refs[2] = m.J * np.gradient(refs[0]) * RATE + 0.8 * m.Fc * np.tanh(refs[0] / (3 * m.vs))
    kp, limit = m.J * s.stiffness, 6 * (2 * m.Fc + m.Fv * m.w_max + m.load_peak)
    smooth, no_tacho = 1 - np.exp(-s.smooth / RATE), float(s.w != "tacho")
    gains = (float(loop), kp, kp * s.stiffness / 6, s.stiffness / 5, limit, limit, 0.0)
    quantum = 2 * np.pi / s.counts
    drive = drive_row(m, (*gains, smooth, no_tacho), quantum, 0.0)
    noise = m.w_noise * g.standard_normal((1, len(t)))
    alike_all = replace(m, law="lugre", power=1.0, Fv=m.Fv * m.w_max ** (m.power - 1))
    return Setup(alike_all, loop, refs, noise, RATE, quantum, 0.0, drive)


def moves(run: Run) -> bool:
    """Whether the drive moves both ways, as its reference asks, and is not at its limit."""
    w, m, ref = run.signals["w_true"], run.setup.machine, run.setup.refs[0]
    if not np.isfinite(w).all() or np.max(np.abs(w)) > 4 * m.w_max:
        return False
    if min(np.mean(w > 0.02 * m.w_max), np.mean(w < -0.02 * m.w_max)) < 0.05:
        return False
    loud = np.mean(np.abs(run.signals["u"]) > 0.99 * run.setup.drive[4]) > 0.01
    astray = run.setup.loop != OPEN_LOOP and rms(w - ref) > 0.6 * rms(ref)
    return not loud and not astray


def hide(g: np.random.Generator, base: Run, s: Sensing, name: str) -> tuple[dict, Run]:
    """The effect's row in the table, and the run with it alone."""
    if name == "none":
        return {}, base
    m, seen = base.setup.machine, base.signals
    share = between(g, 0.12 if name in ABSORBED else 0.04, 0.22)
    motion = base.t, seen["u"], seen["theta_true"], seen["w_true"]
    context = Context(m, *motion, base.friction_rms, share, RATE / s.every, FINE)
    size = find(name).recipe(context, g)
    x, alone = calibrate(base.setup, find(name), size, share)
    return {name: size.build(x)}, alone


def background(g: np.random.Generator, base: Run) -> tuple[float, ...]:
    """What every machine has: 0.4 to 1.2 % of friction each, and warming of 0.5 to 2 %."""
    m, level = base.setup.machine, base.friction_rms
    one, two, three, four = g.uniform(0.004, 0.012, 4) * level
    angles, order = g.uniform(-3.1, 3.1, 3), int(g.integers(1, 3))
    slow = 0.3 * np.pi * RATE / 10 / np.max(np.abs(base.signals["w_true"]))
    ripple = 1.41 * one, float(g.integers(2, max(3, min(60, int(slow))))), angles[0]
    asymmetry = float(g.choice([-1, 1])) * three / m.Fc
    warming = float(g.choice([-1, -1, 1])) * g.uniform(0.005, 0.02), g.uniform(3, 20)
    swing = m.J * rms((order * base.signals["w_true"]) ** 2) / 1.41
    encoder = min(four / max(swing, 1e-12), 2e-3), float(order), angles[2]
    return *ripple, 1.41 * two, angles[1], asymmetry, *warming, *encoder


def true_values(run: Run, hidden: dict, quiet: tuple | None, s: Sensing) -> dict[str, float]:
    """J, the friction on average, the loads, and the effect's parameters."""
    m, grown, side = run.machine, 1.0, 0.0
    if quiet:
        grown += quiet[6] * float(np.mean(1 - np.exp(-run.t / quiet[7])))
        side = quiet[5]
    values = {"J": m.J}
    if m.power == 1.0:
        values |= {"Fc": m.Fc * grown, "Fv": m.Fv * grown}
    if not hidden:
        values |= {"constant_torque": m.Fc * grown * side}
        values |= {"gravity.amplitude": m.load_peak, "gravity.phase": 0.0} if m.load[0] else {}
    for name, row in hidden.items():
        keys = CATALOGUE[name].parameters if name in CATALOGUE else ()
        values |= {f"{name}.{k}": float(v) for k, v in zip(keys, row, strict=False)}
    for name in TIMES.keys() & hidden.keys():  # beyond the hold of the log
        values[f"{name}.{TIMES[name]}"] -= 0.5 * (s.every - 1) / RATE
    return values


def declared(g: np.random.Generator, m: Machine) -> dict:
    """The declared model: the right structure, values 10 to 20 % off, some missing."""

    def off(value: float) -> float:
        return float(f"{value * (1 + g.choice([-1, 1]) * g.uniform(0.1, 0.2)):.6g}")

    bristles = m.law != "static" and g.random() < 0.6
    keys = ("Fc", "Fs", "vs", "sigma0", "sigma1") if bristles else ("Fc", "Fs", "vs")
    friction = {key: off(getattr(m, key)) for key in keys}
    friction["Fv"] = off(m.Fv * m.w_max ** (m.power - 1))
    for name, odds in (("Fs", 0.2), ("vs", 0.2), ("sigma0", 0.3)):
        if g.random() < odds:
            friction.pop(name, None)
    if "sigma0" not in friction:
        friction.pop("sigma1", None)
    model = {
        "name": "messy",
        "motion": "rotary",
        "plant": {"J": off(m.J)},
        "friction": {"model": "lugre" if bristles else "stribeck", **friction},
    }
    if m.load[0]:
        model["effects"] = [{"name": "gravity", "amplitude": off(m.load_peak), "phase": 0.0}]
    return model


def logged(g: np.random.Generator, run: Run, s: Sensing) -> dict[str, np.ndarray]:
    """``t``, ``u``, ``theta`` and, where the drive has one, ``w``: every k-th sample."""
    keep, dt = slice(s.every - 1, None, s.every), s.every / RATE
    out = {"t": run.t[keep] - run.t[s.every - 1], "u": torque(g, run, s)[keep]}
    out["theta"] = run.signals["theta"][keep].copy()
    if s.w == "tacho":
        out["w"] = run.signals["w"][keep].copy()
    if s.w == "difference":
        rate, share = np.diff(run.signals["theta"], prepend=0.0) * RATE, run.setup.drive[7]
        out["w"] = lfilter([share], [1, share - 1], rate)[keep]
    if g.random() < 0.15:  # stamps of a busy computer
        wander = np.clip(g.standard_normal(len(out["t"])), -3, 3)
        out["t"] = out["t"] + dt * g.uniform(0.03, 0.15) * wander
    if g.random() < 0.1:
        name = str(g.choice([k for k in out if k != "t"]))
        for i in g.integers(50, len(out["t"]) - 50, int(g.integers(1, 4))):
            out[name][i] += g.choice([-1, 1]) * g.uniform(2, 6) * np.ptp(out[name])
    return out


def torque(g: np.random.Generator, run: Run, s: Sensing) -> np.ndarray:
    """The logged torque at the rate of the loop."""
    u = run.signals["u"]
    if s.u == "command":
        return u.copy()
    if s.u == "mean":  # of the interval that ends at the stamp
        return lfilter(np.ones(s.every) / s.every, [1.0], u)
    noise, step, lag = s.current
    keep = np.exp(-1 / (RATE * lag))
    late = lfilter([1 - keep], [1, -keep], u)
    return np.round((late + noise * g.standard_normal(len(u))) / step) * step


def rms(x) -> float:
    return max(float(np.sqrt(np.mean(np.square(x)))), 1e-12)

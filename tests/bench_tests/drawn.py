"""Bench tests on simulated drives with a hidden truth, ten and more of each of six kinds.

``draw(kind, seed)`` gives the log of one test, as a drive would record it, what its model file
says, and the values that the test is made for. Nothing here uses the package: the physics is in
``machine``, the encoder and the registers in ``sensors``. ``own_fit`` answers a record on its own;
a record whose values even this fit misses by more than 3 % is drawn again, so that each one that
comes out can be answered. ``score`` asks the package. Seeds 1 to 10 are for development, seeds
101 to 110 are held out.

========================  ============================================================
``breakaway_ramps``       torque ramps until the axis moves: Fs_forward, Fs_backward (means over
                          the ramps), Fs_scatter (standard deviation about them, N m)
``slow_scan``             slow turns both ways: Fc (friction at that speed), cogging.N
``coast_down``            Fc/J, Fv/J; with a known J also Fc, Fv
``free_swing``            a released arm: length = 9.81 J / gravity, Fc/J, Fv/J
``steps_and_pulses``      J, Fc, Fv
``staircase``             steps of speed: Fc, Fv, Fs, vs
========================  ============================================================
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from math import sqrt

import numpy as np

from .machine import Machine, Program, simulate
from .own_fit import own_fit
from .sensors import Sensors

__all__ = ["KINDS", "Drawn", "draw", "own_fit"]

G = 9.81
ATTEMPTS = 40
SIZES = {  # ranges of J, Fc, the top speed and vs
    "small": ((0.6e-4, 2e-4), (0.012, 0.03), (100.0, 300.0), (0.3, 1.0)),
    "medium": ((2e-3, 5e-3), (0.15, 0.3), (20.0, 60.0), (0.1, 0.3)),
    "large": ((0.3, 0.8), (3.5, 7.0), (5.0, 15.0), (0.03, 0.1)),
}


@dataclass
class Drawn:
    """A record: its runs, what is asked of it, what its model file says."""

    kind: str
    seed: int
    runs: list[dict[str, np.ndarray]]
    truth: dict[str, float]
    known: dict
    machine: Machine
    sensors: Sensors
    size: str
    hints: dict = field(default_factory=dict)  # what was done when, for the own fit
    attempts: int = 1

    @property
    def columns(self) -> dict[str, np.ndarray]:
        return self.runs[0]

    def __str__(self) -> str:
        s = self.sensors
        u = "measured" if s.noise else "command"
        rows = sum(len(run["t"]) for run in self.runs)
        runs = f", {len(self.runs)} runs" if len(self.runs) > 1 else ""
        return (
            f"{self.kind} {self.seed}: {self.size}, {s.counts} counts, {s.rate:g} Hz, "
            f"w {s.speed}, u {u}, {rows} rows{runs}"
        )


@dataclass
class Bench:
    """What a kind draws from."""

    rng: np.random.Generator
    seed: int
    machine: Machine
    top: float  # rad/s
    sensors: Sensors

    def between(self, low: float, high: float) -> float:
        return float(self.rng.uniform(low, high))

    def chance(self, p: float) -> bool:
        return bool(self.rng.random() < p)

    def record(self, program: Program, theta: float = 0.0, w: float = 0.0) -> dict:
        """The log of a program of torque, as its register lets it through."""
        program, dt = through(program, self.sensors), 1 / self.sensors.rate
        motion = simulate(self.machine, program, dt, float(theta), float(w))
        return self.sensors.log(*motion, self.rng)

    def samples(self, seconds: float) -> int:
        return max(round(seconds * self.sensors.rate), 1)


def draw(kind: str, seed: int) -> Drawn:
    """The record of this kind and seed: the first attempt that can be answered."""
    for attempt in range(ATTEMPTS):
        drawn = one(kind, seed, attempt)
        found = own_fit(drawn)
        if all(abs(found[name] / value - 1) < 0.03 for name, value in drawn.truth.items()):
            return drawn
    raise ValueError(f"{kind} {seed}: no record in {ATTEMPTS} attempts can be answered")


def one(kind: str, seed: int, attempt: int) -> Drawn:
    """A record as it comes, answerable or not."""
    rng = np.random.default_rng([seed, KINDS.index(kind), attempt])
    size = list(SIZES)[(seed + seed // 3) % 3]
    J, Fc, top, vs = (float(np.exp(rng.uniform(*np.log(r)))) for r in SIZES[size])
    Fs, Fv = Fc * rng.uniform(1.15, 1.5), Fc / top * rng.uniform(0.4, 1.5)
    machine = Machine(J, Fc, float(Fs), float(Fv), vs)
    bench = Bench(rng, seed, machine, top, sensors(rng, seed, machine, top))
    runs, truth, known, hints = RECIPES[kind](bench)
    return Drawn(
        kind, seed, runs, truth, known, machine, bench.sensors, size, hints, attempts=attempt + 1
    )


def sensors(rng: np.random.Generator, seed: int, machine: Machine, top: float) -> Sensors:
    """A third of all seeds has a stale speed, or none."""
    poor = ("stale", "missing")[seed // 3 % 2]
    scale = 4 * machine.Fs + machine.Fv * top
    rate = float(rng.choice([250, 500, 1000, 2000]))
    return Sensors(
        rate=rate,
        counts=int(rng.choice([2000, 4096, 8192, 16384, 65536])),
        lsb=2 * scale / 2 ** int(rng.integers(12, 17)),
        noise=float(rng.choice([0.0, rng.uniform(0.002, 0.01) * machine.Fs])),
        speed=poor if seed % 3 == 0 else str(rng.choice(["clean", "difference"])),
        window=max(round(rng.uniform(0.004, 0.016) * rate), 1),
        speed_noise=float(rng.uniform(0.0005, 0.003) * top),
    )


def through(program: Program, sensors: Sensors) -> Program:
    """The program with its torque rounded to the register."""
    u = next(program)
    while True:
        state = yield sensors.rounded(u)
        try:
            u = program.send(state)
        except StopIteration:
            return


def hold(u: float, samples: int) -> Program:
    """A torque for so long."""
    for _ in range(samples):
        yield u


# breakaway ramps


def breakaway_ramps(bench: Bench):
    m, s = bench.machine, bench.sensors
    s.rate = min(s.rate, 1000.0)
    if bench.chance(0.5):
        m.backward = m.Fs * bench.between(0.85, 1.2)
        m.backward = max(m.backward, 1.1 * m.Fc)
    scatter = bench.between(0.02, 0.05) if bench.chance(0.5) else 0.0
    m.variation = bench.between(0.03, 0.06) if bench.chance(0.25) else 0.0
    events: list[tuple[int, float]] = []
    run = bench.record(ramps(bench, scatter, events))
    levels = {s: np.array([F for d, F in events if d == s]) for s in (1, -1)}
    truth = {"Fs_forward": float(levels[1].mean()), "Fs_backward": float(levels[-1].mean())}
    if scatter and not m.variation:
        about = sum(((F - F.mean()) ** 2).sum() for F in levels.values())
        truth["Fs_scatter"] = float(np.sqrt(about / (len(events) - 2)))
    known = {"plant": {"J": m.J}, "friction": {"model": "stribeck"}}
    return [run], truth, known, {"ramps": len(events)}


def ramps(bench: Bench, scatter: float, events: list) -> Program:
    """Pairs of ramps, each until the axis has moved a little; torque off; sometimes a push on."""
    m, count = bench.machine, bench.sensors.counts
    forward, backward = m.Fs, m.backward or m.Fs
    slope = m.Fs / bench.between(2.0, 5.0) / bench.sensors.rate
    limit = max(bench.between(0.02, 0.05), 8 * 2 * np.pi / count)
    pushed = bool(m.variation) or bench.chance(0.5)
    theta, w = yield 0.0
    for pair in range(int(bench.rng.integers(3, 6))):
        for s in (1, -1):
            m.Fs = max(forward * (1 + scatter * bench.rng.normal()), 1.03 * m.Fc)
            m.backward = max(backward * (1 + scatter * bench.rng.normal()), 1.03 * m.Fc)
            for _ in range(bench.samples(bench.between(0.8, 1.2))):
                theta, w = yield 0.0
            events.append((s, m.static(theta, s)))
            start, u = theta, 0.0
            while abs(theta - start) < limit:
                u += s * slope
                theta, w = yield u
        for _ in range(bench.samples(1.0)):
            theta, w = yield 0.0
        start = theta
        while pushed and pair < 2 and abs(theta - start) < 1.0:
            theta, w = yield 1.5 * max(m.Fs, m.backward)
    yield from hold(0.0, bench.samples(1.0))
    m.Fs, m.backward = forward, backward


# slow scan


def slow_scan(bench: Bench):
    m, s = bench.machine, bench.sensors
    s.rate = min(s.rate, 1000.0)
    speed = m.vs * bench.between(3.0, 4.5)
    harmonics = bench.rng.choice([2, 4, 6, 8, 12, 18, 24], int(bench.rng.integers(1, 4)), False)
    m.waves = tuple(
        (float(n), m.Fc * bench.between(0.04, 0.2), bench.between(-np.pi, np.pi))
        for n in sorted(harmonics)
    )
    turns = 1 if speed < 0.6 else int(bench.rng.integers(1, 4))
    n = bench.samples((2 * np.pi * turns + 0.1) / speed + 0.5)
    rest = np.zeros(bench.samples(0.5))
    reference = np.concatenate([rest, np.full(n, speed), rest, np.full(n, -speed), rest])
    run = bench.record(speed_loop(bench, reference))
    truth = {"Fc": m.friction(speed)} | {f"cogging.{N:g}": a for N, a, _ in m.waves}
    known = {"plant": {"J": m.J}, "friction": {"model": "coulomb"}}
    return [run], truth, known, {"reference": reference}


def bandwidth(bench: Bench) -> float:
    """Of the speed loop, rad/s."""
    return min(0.3 * bench.sensors.rate, 250.0)


def speed_loop(bench: Bench, reference: np.ndarray) -> Program:
    """A PI loop on the speed at the rate of the log."""
    m, dt, wb = bench.machine, 1 / bench.sensors.rate, bandwidth(bench)
    kp, ki, limit = m.J * wb, m.J * wb**2 / 5, 3.9 * m.Fs + m.Fv * bench.top
    w = integral = 0.0
    for r in reference:
        u = kp * (r - w) + integral
        if abs(u) < limit:
            integral += ki * dt * (r - w)
        _, w = yield float(np.clip(u, -limit, limit))


# coast-down


def coast_down(bench: Bench):
    m, s = bench.machine, bench.sensors
    s.noise *= bench.between(0.0, 0.5)
    directions = [1, -1] if bench.chance(0.6) else [1]
    plan = [d * bench.top * bench.between(0.6, 1.0) for d in directions * 2]
    if bench.chance(0.6):
        runs = [bench.record(coasts(bench, plan))]
    else:
        runs = [bench.record(coasting(bench), w=w) for w in plan]
        for run in runs:
            run["u"] = np.zeros_like(run["u"])
    truth = {"Fc/J": m.Fc / m.J, "Fv/J": m.Fv / m.J}
    known: dict = {"plant": {}, "friction": {"model": "coulomb"}}
    if bench.seed % 2:
        known["plant"]["J"] = m.J
        truth |= {"Fc": m.Fc, "Fv": m.Fv}
    return runs, truth, known, {}


def coasts(bench: Bench, plan: list[float]) -> Program:
    """Spun up by a torque and let go, for each of the speeds."""
    m = bench.machine
    for _ in range(bench.samples(0.3)):
        yield 0.0
    for top in plan:
        w, u = 0.0, np.sign(top) * (m.Fs * bench.between(2.0, 3.5) + m.Fv * abs(top))
        while abs(w) < abs(top):
            _, w = yield u
        yield from coasting(bench)


def coasting(bench: Bench) -> Program:
    """No torque until the axis rests, and a little longer."""
    w = 1.0
    while w != 0.0:
        _, w = yield 0.0
    yield from hold(0.0, bench.samples(bench.between(0.3, 0.6)))


# free swing


def free_swing(bench: Bench):
    """The drive's friction would hold an arm of its own inertia: this one is heavy."""
    m, s = bench.machine, bench.sensors
    s.rate = min(s.rate, 1000.0)
    m.J *= bench.between(3.0, 10.0)
    length = bench.between(0.15, 0.9)
    A, pace = m.J * G / length, sqrt(G / length)
    m.Fc = A * bench.between(0.01, 0.04)
    m.Fs = m.Fc * bench.between(1.0, 1.3)
    m.Fv = 2 * m.J * pace * bench.between(0.006, 0.03)
    m.vs = pace * bench.between(0.002, 0.008)
    s.speed_noise = pace * bench.between(0.0005, 0.003)
    zero = 0.0 if bench.chance(0.6) else bench.between(-np.pi / 2, np.pi / 2)
    m.waves = ((1.0, A, zero),)
    runs = []
    for side in [1, -1][: int(bench.rng.integers(1, 3))]:
        run = bench.record(coasting(bench), theta=side * bench.between(0.6, 1.6) - zero)
        held = bench.samples(bench.between(0.2, 0.6)) if bench.chance(0.3) else 0
        runs.append(by_hand(run, held))
        runs[-1]["u"] = np.zeros_like(runs[-1]["u"])
    truth = {"length": length, "Fc/J": m.Fc / m.J, "Fv/J": m.Fv / m.J}
    known = {
        "plant": {},
        "friction": {"model": "coulomb"},
        "effects": [{"name": "gravity"}],
    }
    return runs, truth, known, {}


def by_hand(run: dict, held: int) -> dict:
    """The run with the arm held at its first place for so many samples before."""
    dt = run["t"][1]
    longer = {k: np.concatenate([np.full(held, v[0]), v]) for k, v in run.items()}
    return longer | {"t": np.arange(len(longer["t"])) * dt}


# steps and pulses


def steps_and_pulses(bench: Bench):
    m = bench.machine
    pattern = pulses(bench) if bench.chance(0.5) else steps(bench)
    program = (u for torque, n in pattern for u in hold(torque, n))
    run = bench.record(program)
    truth = {"J": m.J, "Fc": m.Fc, "Fv": m.Fv}
    return [run], truth, {"plant": {}, "friction": {"model": "coulomb"}}, {}


def steps(bench: Bench) -> list[tuple[float, int]]:
    """u, 0, -u, 0, ..., of several sizes."""
    m, pattern = bench.machine, [(0.0, bench.samples(0.3))]
    for _ in range(int(bench.rng.integers(3, 6))):
        u, w = m.Fs * bench.between(1.8, 3.8), bench.top * bench.between(0.4, 0.9)
        push, off = bench.samples(reaching(m, w, u)), bench.samples(stopping(m, w, 0.0))
        off = round(off * bench.between(0.3, 1.5))
        pattern += [(u, push), (0.0, off), (-u, push), (0.0, off)]
    return pattern


def pulses(bench: Bench) -> list[tuple[float, int]]:
    """Push, brake, rest."""
    m, pattern = bench.machine, [(0.0, bench.samples(0.3))]
    for k in range(int(bench.rng.integers(5, 9))):
        s = 1 if k % 2 == 0 else -1
        u, w = m.Fs * bench.between(1.8, 3.8), bench.top * bench.between(0.4, 0.9)
        brake = m.Fs * bench.between(0.5, 2.5)
        pattern.append((s * u, bench.samples(reaching(m, w, u))))
        pattern.append((-s * brake, bench.samples(0.9 * stopping(m, w, brake))))
        pattern.append((0.0, bench.samples(bench.between(0.3, 0.8))))
    return pattern


def reaching(m: Machine, w: float, u: float) -> float:
    """About the time to this speed, s."""
    return m.J * w / max(u - m.Fc - m.Fv * w / 2, 0.2 * u)


def stopping(m: Machine, w: float, u: float) -> float:
    """About the time to rest, s."""
    return m.J * w / (u + m.Fc + m.Fv * w / 2)


# staircase


def staircase(bench: Bench):
    m = bench.machine
    m.vs = max(m.vs, 0.86 * (m.Fs - m.Fc) / (0.4 * m.J * bandwidth(bench)))
    low = m.vs * np.array([0.3, 0.5, 0.75, 1.0, 1.4, 2.0, 3.0])
    high = np.geomspace(4.5 * m.vs, bench.top, int(bench.rng.integers(4, 7)))
    up = np.concatenate([low, high])
    levels = np.concatenate([up, up[-2::-1]]) if bench.chance(0.5) else up
    levels = np.concatenate([levels, -levels])
    dwell = bench.samples(bench.between(0.5, 1.2) if len(levels) > 30 else bench.between(0.7, 2.0))
    reference, spans = slewed(levels, dwell, 3 * m.Fc / m.J / bench.sensors.rate)
    run = bench.record(speed_loop(bench, reference))
    truth = {"Fc": m.Fc, "Fv": m.Fv, "Fs": m.Fs, "vs": m.vs}
    known: dict = {"plant": {}, "friction": {"model": "stribeck"}}
    if bench.seed % 2:
        known["plant"]["J"] = m.J
    return [run], truth, known, {"spans": spans}


def slewed(levels: np.ndarray, dwell: int, slew: float):
    """The reference that goes from level to level, and where each level stands."""
    pieces, spans, at, now = [np.zeros(1)], [], 1, 0.0
    for level in [*levels, 0.0]:
        way = int(np.ceil(abs(level - now) / slew))
        pieces += [np.linspace(now, level, way + 1)[1:], np.full(dwell, level)]
        spans.append((at + way, at + way + dwell))
        at, now = at + way + dwell, level
    return np.concatenate(pieces), spans[:-1]


RECIPES: dict[str, Callable] = {
    "breakaway_ramps": breakaway_ramps,
    "slow_scan": slow_scan,
    "coast_down": coast_down,
    "free_swing": free_swing,
    "steps_and_pulses": steps_and_pulses,
    "staircase": staircase,
}
KINDS = tuple(RECIPES)

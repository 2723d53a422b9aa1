"""Bench tests on drives that stick: what is applied answers to what the axis does.

``draw(seed, kind)`` asks one of six:

========================  ============================================================
``breakaway_ramps``       torque ramps until the axis moves: Fs_forward, Fs_backward (means over
                          the ramps), Fs_scatter (standard deviation about them, N m)
``slow_scan``             slow turns both ways: Fc (friction at that speed), cogging.N
``coast_down``            Fc/J, Fv/J; with a known J also Fc, Fv
``free_swing``            a released arm: length = 9.81 J / gravity, Fc/J, Fv/J
``steps_and_pulses``      J, Fc, Fv
``staircase``             steps of speed: Fc, Fv, Fs, vs
========================  ============================================================

:class:`Drive` is one of these axes for a test of one's own.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from math import sqrt

import numpy as np

from ..scores.question import Question
from .machines import GRAVITY_LOAD, MACHINES, NO_LOAD, Machine
from .run import Program, programmed

Torque = Callable[[int, float, float], float]
Log = dict[str, np.ndarray]
G = 9.81
SIZES = {  # ranges of J, Fc, the top speed and vs
    "small": ((0.6e-4, 2e-4), (0.012, 0.03), (100.0, 300.0), (0.3, 1.0)),
    "medium": ((2e-3, 5e-3), (0.15, 0.3), (20.0, 60.0), (0.1, 0.3)),
    "large": ((0.3, 0.8), (3.5, 7.0), (5.0, 15.0), (0.03, 0.1)),
}


def sticking(**values: float) -> Machine:
    """A machine with static friction and these parameters."""
    return replace(MACHINES["servo"], law="static", **values)  # type: ignore[arg-type]


@dataclass(frozen=True)
class Drive:
    """An axis; its torque is a function of the row, the counted angle and the speed."""

    J: float = 0.003
    Fc: float = 0.15
    Fs: float = 0.2
    vs: float = 0.1
    Fv: float = 0.01
    gravity: float = 0.0
    cogging: float = 0.0
    harmonic: int = 7
    counts: int = 16384
    dt: float = 2e-3

    def run(self, torque: Torque, rows: int, x: float = 0.0, v: float = 0.0) -> Log:
        """A log of so many rows with t, u, theta and w; ``w`` is true, ``theta`` is counted."""
        load = (GRAVITY_LOAD if self.gravity else NO_LOAD, self.gravity, 0.0)
        m = sticking(J=self.J, Fc=self.Fc, Fs=self.Fs, vs=self.vs, Fv=self.Fv)
        table = {"torque_ripple": (self.cogging, self.harmonic, 0.0)}

        def program() -> Program:
            theta, w = x, v
            for k in range(rows):
                theta, w = yield torque(k, counted(theta, self.counts), w)

        motion = programmed(replace(m, load=load), program(), self.dt, (x, v), table)
        log = dict(zip(("u", "theta", "w"), motion, strict=True))
        log["theta"] = counted(log["theta"], self.counts)
        return {"t": np.arange(rows) * self.dt, **log}


def counted(theta, counts: int):
    """The angle as an encoder counts it."""
    return np.floor(theta / (2 * np.pi) * counts) * 2 * np.pi / counts


def kept(log: Log, *channels: str) -> Log:
    return {k: log[k] for k in ("t", "u", *channels)}


def stale(log: Log) -> np.ndarray:
    """The speed as counts over the time since the last edge, which keeps its value without one."""
    theta, dt = log["theta"], log["t"][1]
    edges = np.flatnonzero(np.diff(theta)) + 1
    values = np.diff(theta[np.r_[0, edges]]) / (np.diff(np.r_[0, edges]) * dt)
    last = np.searchsorted(edges, np.arange(len(theta)), side="right") - 1
    return np.where(last < 0, 0.0, values[np.maximum(last, 0)]) if len(edges) else 0 * theta


def held(levels: list[float], rows: int) -> Torque:
    """Levels of the torque, each for so many rows, again and again."""
    return lambda k, theta, w: levels[k // rows % len(levels)]


def speed_loop(reference: np.ndarray, J: float, pole: float = 60.0, dt: float = 2e-3) -> Torque:
    """A PI loop that follows a speed."""
    integral = [0.0]

    def torque(k: int, theta: float, w: float) -> float:
        off = reference[k] - w
        integral[0] += J * pole**2 * off * dt
        return 2 * J * pole * off + integral[0]

    return torque


@dataclass
class Bench:
    """The axis, and how it is recorded: a third of all seeds has a stale speed, or none."""

    rng: np.random.Generator
    seed: int
    m: Machine
    top: float  # rad/s
    rate: float = 1000.0
    speed: str = "clean"  # "difference", "stale", "missing"
    window: int = 10  # rows, of a difference

    def between(self, low: float, high: float) -> float:
        return float(self.rng.uniform(low, high))

    def rows(self, seconds: float) -> int:
        return max(round(seconds * self.rate), 1)

    def set(self, **values: float) -> None:
        self.m = replace(self.m, **values)  # type: ignore[arg-type]

    def motion(self, program: Program, start=(0.0, 0.0), table=None) -> np.ndarray:
        """u through its register, theta and w."""
        lsb = 2 * (4 * self.m.Fs + self.m.Fv * self.top) / 2**14
        return programmed(self.m, rounded(program, lsb), 1 / self.rate, start, table)

    def log(self, motion: np.ndarray, noise: float = 0.0) -> Log:
        """The columns as recorded."""
        u, theta, w = motion
        t, counts = np.arange(len(u)) / self.rate, [4096, 8192, 16384, 65536][self.seed % 4]
        log = {"t": t, "u": u + noise * self.rng.standard_normal(len(u))}
        log["theta"] = counted(theta, counts)
        if self.speed == "clean":
            log["w"] = w + 1e-3 * self.top * self.rng.standard_normal(len(w))
        elif self.speed == "difference":
            before = np.r_[np.full(self.window, log["theta"][0]), log["theta"][: -self.window]]
            log["w"] = (log["theta"] - before) * self.rate / self.window
        elif self.speed == "stale":
            log["w"] = stale(log)
        return log


def rounded(program: Program, lsb: float) -> Program:
    """The program as a register lets it through."""
    u = next(program)
    while True:
        state = yield round(u / lsb) * lsb
        try:
            u = program.send(state)
        except StopIteration:
            return


def draw(seed: int, kind: str, **sensing) -> Question:
    """The bench test of a seed; ``sensing`` replaces what is drawn of :class:`Bench`."""
    rng = np.random.default_rng([seed, list(KINDS).index(kind)])
    size = SIZES[list(SIZES)[(seed + seed // 3) % 3]]
    J, Fc, top, vs = (float(np.exp(rng.uniform(*np.log(r)))) for r in size)
    m = sticking(J=J, Fc=Fc, Fs=Fc * rng.uniform(1.15, 1.5), Fv=Fc / top * rng.uniform(0.4, 1.5))
    poor = ("stale", "missing")[seed // 3 % 2]
    speed = poor if seed % 3 == 0 else str(rng.choice(["clean", "difference"]))
    bench = Bench(rng, seed, replace(m, vs=vs), top, float(rng.choice([250, 500, 1000])), speed)
    bench.window = max(bench.rows(rng.uniform(0.004, 0.016)), 1)
    for name, value in sensing.items():
        setattr(bench, name, value)
    logs, values, model = KINDS[kind](bench)
    about = {"machine": f"J {J:.2g} Fc {Fc:.2g} {bench.rate:g} Hz w:{speed}"}
    first, *more = logs
    return Question(seed, kind, first, model, "none", values, more=tuple(more), about=about)


def breakaway_ramps(b: Bench):
    """Pairs of ramps, each until the axis has moved a little, then no torque; pushes on."""
    forward, backward = b.m.Fs, max(b.m.Fs * b.between(0.85, 1.2), 1.1 * b.m.Fc)
    scatter, slope = b.between(0.02, 0.05), forward / b.between(2.0, 5.0) / b.rate
    limit, state, parts = b.between(0.02, 0.05), (0.0, 0.0), []
    levels: dict[int, list[float]] = {1: [], -1: []}
    for _ in range(int(b.rng.integers(3, 6))):
        for side, Fs in ((1, forward), (-1, backward)):
            b.set(Fs=max(Fs * (1 + scatter * b.rng.normal()), 1.03 * b.m.Fc))
            levels[side].append(b.m.Fs)
            parts.append(b.motion(ramp(b, side * slope, limit, state[0]), state))
            state = tuple(parts[-1][1:, -1])
    run = b.log(np.concatenate(parts, axis=1))
    F, B = np.array(levels[1]), np.array(levels[-1])
    about = np.sum((F - F.mean()) ** 2) + np.sum((B - B.mean()) ** 2)
    values = {"Fs_forward": F.mean(), "Fs_backward": B.mean()}
    values["Fs_scatter"] = float(np.sqrt(about / (len(F) + len(B) - 2)))
    return [run], values, {"plant": {"J": b.m.J}, "friction": {"model": "stribeck"}}


def ramp(b: Bench, slope: float, limit: float, theta: float) -> Program:
    """A rest, the ramp, and the coast behind it."""
    yield from hold(0.0, b.rows(b.between(0.8, 1.2)))
    start, u = theta, 0.0
    while abs(theta - start) < limit:
        u += slope
        theta, _ = yield u
    yield from hold(0.0, b.rows(0.5))


def hold(u: float, rows: int) -> Program:
    for _ in range(rows):
        yield u


def slow_scan(b: Bench):
    speed, (one, two) = b.m.vs * b.between(3.0, 4.5), b.rng.choice([2, 4, 6, 8, 12, 18], 2, False)
    waves = [(b.m.Fc * b.between(0.04, 0.2), float(n), b.between(-3.1, 3.1)) for n in (one, two)]
    table = {"torque_ripple": waves[0], "imperfections": (*waves[1], 0, 0, 0, 0, 1, 0, 1, 0)}
    n = b.rows((2 * np.pi * (1 if speed < 0.6 else 2) + 0.1) / speed + 0.5)
    rest = np.zeros(b.rows(0.5))
    reference = np.concatenate([rest, np.full(n, speed), rest, np.full(n, -speed), rest])
    run = b.log(b.motion(followed(b, reference), table=table))
    values = {"Fc": sliding(b.m, speed)} | {f"cogging.{n:g}": a for a, n, _ in waves}
    return [run], values, {"plant": {"J": b.m.J}, "friction": {"model": "coulomb"}}


def sliding(m: Machine, w: float) -> float:
    """Friction at a speed."""
    return m.Fc + (m.Fs - m.Fc) * np.exp(-((w / m.vs) ** 2)) + m.Fv * w


def bandwidth(b: Bench) -> float:
    """Of the speed loop, rad/s."""
    return min(0.3 * b.rate, 250.0)


def followed(b: Bench, reference: np.ndarray) -> Program:
    """A PI loop on the speed at the rate of the log, within the torque."""
    wb, limit, w, integral = bandwidth(b), 3.9 * b.m.Fs + b.m.Fv * b.top, 0.0, 0.0
    for r in reference:
        u = b.m.J * wb * (r - w) + integral
        if abs(u) < limit:
            integral += b.m.J * wb**2 / 5 / b.rate * (r - w)
        _, w = yield float(np.clip(u, -limit, limit))


def coast_down(b: Bench):
    """Spun up by a torque and let go, or one run from each speed."""
    noise = b.m.Fs * b.between(0.0, 0.005)
    plan = [side * b.top * b.between(0.6, 1.0) for side in (1, -1, 1, -1)]
    if b.seed % 2:
        runs = [b.log(b.motion(spun(b, plan)), noise)]
    else:
        runs = [b.log(b.motion(coasting(b), (0.0, w))) for w in plan]
    values, model = {"Fc/J": b.m.Fc / b.m.J, "Fv/J": b.m.Fv / b.m.J}, {"J": b.m.J}
    if b.seed % 2:
        values |= {"Fc": b.m.Fc, "Fv": b.m.Fv}
    return runs, values, {"plant": model if b.seed % 2 else {}, "friction": {"model": "coulomb"}}


def spun(b: Bench, plan: list[float]) -> Program:
    for top in plan:
        w, u = 0.0, np.sign(top) * (b.m.Fs * b.between(2.0, 3.5) + b.m.Fv * abs(top))
        while abs(w) < abs(top):
            _, w = yield u
        yield from coasting(b)


def coasting(b: Bench) -> Program:
    """No torque until the axis rests, and a little longer."""
    w = 1.0
    while w != 0.0:
        _, w = yield 0.0
    yield from hold(0.0, b.rows(b.between(0.3, 0.6)))


def free_swing(b: Bench):
    """The drive's friction would hold an arm of its own inertia: this one is heavy."""
    J, length = b.m.J * b.between(3.0, 10.0), b.between(0.15, 0.9)
    A, pace = J * G / length, sqrt(G / length)
    Fc, Fv = A * b.between(0.01, 0.04), 2 * J * pace * b.between(0.006, 0.03)
    b.set(J=J, Fc=Fc, Fs=Fc * b.between(1.0, 1.3), Fv=Fv, vs=pace * b.between(0.002, 0.008))
    b.m, b.top = replace(b.m, load=(GRAVITY_LOAD, A, 0.0)), pace
    sides = [1, -1][: int(b.rng.integers(1, 3))]
    runs = [b.log(b.motion(coasting(b), (s * b.between(0.6, 1.6), 0.0))) for s in sides]
    values = {"length": length, "Fc/J": Fc / J, "Fv/J": Fv / J}
    effects = [{"name": "gravity"}]
    return runs, values, {"plant": {}, "friction": {"model": "coulomb"}, "effects": effects}


def steps_and_pulses(b: Bench):
    """Push, brake or none, rest, to either side."""
    return (
        [b.log(b.motion(pushes(b)))],
        {"J": b.m.J, "Fc": b.m.Fc, "Fv": b.m.Fv},
        {"plant": {}, "friction": {"model": "coulomb"}},
    )


def pushes(b: Bench) -> Iterator[float]:
    m, braked = b.m, b.seed % 2
    yield from hold(0.0, b.rows(0.3))
    for k in range(int(b.rng.integers(6, 9))):
        u, w = m.Fs * b.between(1.8, 3.8), b.top * b.between(0.4, 0.9)
        brake = m.Fs * b.between(0.5, 2.5) * braked
        push = m.J * w / max(u - m.Fc - m.Fv * w / 2, 0.2 * u)
        stop = 0.9 * m.J * w / (brake + m.Fc + m.Fv * w / 2)
        side = 1 if k % 2 == 0 else -1
        yield from hold(side * u, b.rows(push))
        yield from hold(-side * brake, b.rows(stop))
        yield from hold(0.0, b.rows(b.between(0.3, 0.8)))


def staircase(b: Bench):
    b.set(vs=max(b.m.vs, 0.86 * (b.m.Fs - b.m.Fc) / (0.4 * b.m.J * bandwidth(b))))
    low = b.m.vs * np.array([0.3, 0.5, 0.75, 1.0, 1.4, 2.0, 3.0])
    up = np.r_[low, np.geomspace(4.5 * b.m.vs, b.top, int(b.rng.integers(4, 7)))]
    dwell, slew = b.rows(b.between(0.7, 2.0)), 3 * b.m.Fc / b.m.J / b.rate
    pieces, now = [np.zeros(1)], 0.0
    for level in [*up, *-up, 0.0]:
        way = int(np.ceil(abs(level - now) / slew))
        pieces += [np.linspace(now, level, way + 1)[1:], np.full(dwell, level)]
        now = level
    run = b.log(b.motion(followed(b, np.concatenate(pieces))))
    values = {"Fc": b.m.Fc, "Fv": b.m.Fv, "Fs": b.m.Fs, "vs": b.m.vs}
    plant = {"J": b.m.J} if b.seed % 2 else {}
    return [run], values, {"plant": plant, "friction": {"model": "stribeck"}}


KINDS: dict[str, Callable] = {
    "breakaway_ramps": breakaway_ramps,
    "slow_scan": slow_scan,
    "coast_down": coast_down,
    "free_swing": free_swing,
    "steps_and_pulses": steps_and_pulses,
    "staircase": staircase,
}

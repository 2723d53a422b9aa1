"""Machines as one meets them: sensors, gains, motions; their runs, and how plain those are."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.signal import lfilter

from .drive import COLUMNS, run, settings

FREE = (0, 0)
MACHINES = {  # friction in N m, speed, time to coast down, half the travel, counts, rates of a log
    "servo": ((0.004, 0.04), (4, 10), (0.03, 0.3), (1, 2.4), (4096, 16384), (50, 100, 200)),
    "joint": ((2, 15), (1.5, 4), (0.05, 0.5), (1.2, 3), (1e5, 524288), (250, 500, 1000)),
    "direct": ((0.02, 0.4), (8, 40), (0.3, 3), FREE, (80000, 262144, 1e6), (1000, 2000, 4000)),
    "belt": ((0.04, 0.4), (50, 200), (0.1, 0.8), (20, 80), (8000, 40000), (200, 500, 1000)),
    "arm": ((20, 150), (1, 2.5), (0.1, 0.8), (0.8, 2.5), (2e5, 1e6), (100, 250, 500)),
    "worm": ((0.1, 1), (40, 150), (0.03, 0.3), FREE, (2000, 4096, 16384), (100, 250, 1000)),
    "axis": ((0.1, 0.8), (60, 250), (0.08, 0.6), (40, 150), (16000, 80000), (500, 1000, 2000)),
    "bench": ((0.005, 0.05), (30, 250), (0.2, 2), FREE, (2000, 4000, 32768), (100, 500, 1000)),
}
PLAIN = ("J", "Fc", "Fv", "Fs", "vs", "const", "grav", "grav_ph", "delay", "s0", "s1")
TURN = 2 * np.pi


@dataclass(frozen=True)
class Rig:
    """One machine with everything that was drawn for it; `values` are of `drive.SETTINGS`."""

    name: str
    wmax: float
    travel: float
    fs: int
    every: int  # periods of the controller per logged row
    seconds: float
    values: dict
    load_seed: int

    @property
    def Tc(self) -> float:
        """The period of the controller."""
        return 1.0 / (self.fs * self.every)

    @property
    def plain(self) -> dict:
        """The plain description of it, where nothing hidden is added."""
        return {name: float(self.values.get(name, 0.0)) for name in PLAIN}

    def having(self, *sets: dict) -> "Rig":
        """The rig with these values too."""
        return replace(
            self, values={k: v for given in (self.values, *sets) for k, v in given.items()}
        )


def between(rng, low: float, high: float) -> float:
    """A number between two, evenly in its logarithm."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def draw_rig(rng, real: bool) -> Rig:
    """A machine with its friction, sensor, delay and gains; a real one may have a Stribeck peak."""
    name = str(rng.choice(list(MACHINES)))
    friction, speed, coast, way, counts, rates = MACHINES[name]
    Fc, wmax = between(rng, *friction), between(rng, *speed)
    J, fs, travel = (
        Fc * between(rng, *coast) / wmax,
        int(rng.choice(rates)),
        float(rng.uniform(*way)) or np.inf,
    )
    every = int(np.ceil(rng.choice([500, 1000, 2000]) / fs))
    seconds = round(max(min(between(rng, 10, 60), 120_000 / (fs * every)), 10.0), 1)
    v = {"J": J, "Fc": Fc, "Fv": Fc * between(rng, 0.2, 1.4) / wmax, "q": TURN / rng.choice(counts)}
    if rng.random() < 0.35:
        v |= {"grav": Fc * rng.uniform(0.1, 1.0), "grav_ph": rng.uniform(-np.pi, np.pi)}
    if rng.random() < 0.5:
        v["const"] = Fc * rng.uniform(-0.4, 0.4)
    if real and rng.random() < 0.5:
        v |= {"Fs": Fc * rng.uniform(1.02, 1.3), "vs": wmax * between(rng, 0.002, 0.03)}
    if rng.random() < 0.5:  # bristles, which steps of 40 us resolve well
        s0 = Fc / (min(travel, wmax) * between(rng, 1e-5, 1e-3))
        s0 = min(s0, J * (0.15 * 25_000) ** 2)
        v |= {"s0": s0, "s1": 2 * rng.choice([0.0, rng.uniform(0.2, 1.0)]) * np.sqrt(s0 * J)}
    rig = Rig(name, wmax, travel, fs, every, seconds, v, int(rng.integers(1, 2**31)))
    return rig.having(_loop(rng, rig))


def _loop(rng, rig: Rig) -> dict:
    """Sensor and delay, and gains that these and the period allow."""
    v, Tc, tacho = rig.values, rig.Tc, float(rng.random() < 0.25)
    tau = between(rng, 0.3e-3, 3e-3) if tacho else Tc * between(rng, 1, 8)
    noise = rig.wmax * between(rng, 3e-4, 4e-3)
    delay = Tc * rng.choice([0.0, 0.0, 0.5, 1.0, 2.0, rng.uniform(0, 3)])
    late = 1.5 * Tc + tau + delay
    step = noise if tacho else v["q"] / max(tau, Tc)
    band = min(between(rng, 0.1, 0.35) / late, 0.3 * v["Fc"] / (v["J"] * step), 400.0)
    band = min(max(band, 4.0), 0.5 / late)
    kv, umax = v["J"] * band, v["Fc"] * rng.uniform(4, 10) + v["Fv"] * rig.wmax + v.get("grav", 0.0)
    made = {"tacho": tacho, "tau": tau, "w_noise": noise, "delay": delay, "kv": kv, "umax": umax}
    made |= {"ki": kv * band / between(rng, 4, 12), "kp": band / between(rng, 4, 10)}
    return made | {"wmax": 1.5 * rig.wmax, "u_q": umax / 2 ** rng.integers(9, 15)}


# --- what the controller is told ---------------------------------------------------------


def moves(rng, n, Tc, reach, v, a):
    """Positions: moves with smooth acceleration from point to point, with rests between."""
    parts, last = [], 0.0
    while sum(map(len, parts)) < n:
        to = rng.uniform(-reach, reach)
        d = abs(to - last)
        x = np.linspace(0, 1, max(int(max(1.875 * d / v, np.sqrt(5.7735 * d / a)) / Tc), 4))
        rest = np.full(int(rng.uniform(0.1, 1.0) / Tc), to)
        parts += [last + (to - last) * x**3 * (10 - 15 * x + 6 * x * x), rest]
        last = to
    return np.concatenate(parts)[:n]


def levels(rng, n, Tc, low, high, top):
    """Levels to either side, each held for a random time."""
    out, i = np.zeros(n), 0
    while i < n:
        k = max(int(rng.uniform(low, high) / Tc), 1)
        out[i : i + k] = top * rng.choice([-1, 1]) * rng.uniform(0.1, 1.0)
        i += k
    return out


def slew(x, step):
    """A signal that follows another one by steps of limited size."""
    out, y = np.empty(len(x)), 0.0
    for i, to in enumerate(x.tolist()):
        y += min(max(to - y, -step), step)
        out[i] = y
    return out


def sines(rng, t, v, a, reach):
    """A sum of sines within a reach, a speed and an acceleration."""
    f = np.exp(rng.uniform(np.log(0.1), np.log(2.5), int(rng.integers(1, 5))))
    x = sum(np.sin(TURN * fi * t) / fi ** rng.uniform(0.7, 1.5) for fi in f) * np.minimum(t, 1.0)
    dx = np.gradient(x, t)
    sizes = np.abs(x).max() / reach, np.abs(dx).max() / v, np.abs(np.gradient(dx, t)).max() / a
    return x / max(sizes)


def draw_motion(rng, rig: Rig):
    """References (position, speed, torque, whether the loop is closed), and the gains they need."""
    t = np.arange(int(rig.seconds / rig.Tc)) * rig.Tc
    n, Tc, p, v = len(t), rig.Tc, rig.values, rig.wmax * rng.uniform(0.3, 1)
    against = p["Fc"] + p["Fv"] * v + p.get("grav", 0.0) + abs(p.get("const", 0.0))
    a = max(p["umax"] - against, 0.5 * p["Fc"]) * rng.uniform(0.15, 0.6) / p["J"]
    a, refs = min(a, v / 0.02), np.zeros((n, 4))
    refs[:, 3] = 1.0
    reach = min(rig.travel, rng.uniform(0.5, 2) * rig.wmax)
    if np.isfinite(rig.travel) or rng.random() < 0.3:
        kind = str(rng.choice(["moves", "sines", "slow scan"]))
        slow = between(rng, 0.05, 0.3) if kind == "slow scan" else 1.0
        x = sines(rng, t, v, a, reach) if kind == "sines" else moves(rng, n, Tc, reach, slow * v, a)
        refs[:, 0], refs[:, 1] = x, np.gradient(x, Tc)
        return kind, refs, {}
    kind = str(rng.choice(["speeds", "coasts", "speed sines", "torques", "torque sines"]))
    if kind.startswith("torque"):
        top = (against - p["Fv"] * v) * rng.uniform(1.2, 1.6) + p["Fv"] * v
        wave = sines(rng, t, 1e3 * top, 1e6 * top, top)
        refs[:, 2] = wave if kind == "torque sines" else levels(rng, n, Tc, 0.3, 2.0, 1.3 * top)
        return kind, refs, {"kp": 0.0, "kv": 0.0, "ki": 0.0}
    held = levels(rng, n, Tc, 0.5, 2.0, v)
    refs[:, 1] = sines(rng, t, a, 100 * a, v) if kind == "speed sines" else slew(held, a * Tc)
    if kind == "coasts":
        refs[:, 3] = t % 4.0 < rng.uniform(1.0, 3.0)
    return kind, refs, {"kp": 0.0}


# --- a run, and what the plain description leaves over of it -----------------------------


def simulate(rig: Rig, refs, seed: int, finer: int = 1):
    """The run of a rig: its columns by name."""
    v, n = rig.values, len(refs)
    keep = np.exp(-TURN * v.get("rand_f", 1.0) * rig.Tc)
    white = np.random.default_rng(rig.load_seed).standard_normal(n)
    load = lfilter([np.sqrt(1 - keep**2)], [1, -keep], white)
    noise = np.random.default_rng(seed).standard_normal(n)
    spring = np.sqrt(v.get("kc", 0.0) * (1 / v["J"] + 1 / v["JL"])) if "JL" in v else 0.0
    fast = max(spring, np.sqrt(max(v.get("s0", 0.0), v.get("stop_k", 0.0)) / v["J"]))
    fast = max(fast, v.get("s1", 0.0) / v["J"] / 2)
    steps = int(max(4, np.ceil(rig.Tc * fast / 0.15), np.ceil(rig.Tc / 2.5e-4))) * finer
    out = run(settings(v), refs, noise, load, rig.Tc, steps)
    return dict(zip(COLUMNS, out.T, strict=True))


def lagged(x, tau: float, Tc: float):
    """A signal through a first-order lag."""
    keep = np.exp(-Tc / tau) if tau > 0 else 0.0
    return lfilter([1 - keep], [1, -keep], x, zi=[keep * x[0]])[0]


def leftover(rig: Rig, o: dict, plain: dict, refit: bool = False):
    """Torque that a plain description leaves over, where the drive slides; and the friction level.

    ``refit``: the description with other values, as they fit best.
    """
    v, Tc, angle = rig.values, rig.Tc, o["theta"]
    seen = 1 + v.get("ecc", 0.0) * v.get("ecc_n", 0.0) * np.cos(
        v.get("ecc_n", 0.0) * angle + v.get("ecc_ph", 0.0)
    )
    w = lagged(o["w"] * seen, v.get("w_lag", 0.0), Tc)
    dw, w0, mid = np.diff(w) / Tc, 0.5 * (w[1:] + w[:-1]), 0.5 * (angle[1:] + angle[:-1])
    whole, part = divmod(plain["delay"] / Tc, 1.0)
    told = np.concatenate([np.zeros(int(whole) + 1), o["cmd"]])[: len(w)]
    u = (1 - part) * told[1:] + part * told[:-1]
    dry = plain["Fc"] + 0 * w0
    if plain["Fs"] > plain["Fc"]:
        dry = dry + (plain["Fs"] - plain["Fc"]) * np.exp(-((w0 / plain["vs"]) ** 2))
    friction = dry * np.sign(w0) + plain["Fv"] * w0
    rest = u - plain["J"] * dw - friction - plain["const"]
    rest -= plain["grav"] * np.sin(mid + plain["grav_ph"])
    slides = (o["w"][:-1] * o["w"][1:] > 0) & (np.abs(o["w"][:-1]) > 1e-3 * rig.wmax)
    if plain["s0"] > 0:  # bristles need a way to bend
        start = np.maximum.accumulate(np.where(slides, 0, np.arange(len(slides))))
        slides &= np.abs(angle[:-1] - angle[start]) > 8 * plain["Fc"] / plain["s0"]
    slides[: int(3 * (whole + 1))] = False
    if not slides.any():
        return rest[:0], plain["Fc"], 0.0
    if refit:
        shapes = [dw, w0, np.sign(w0), dry * np.sign(w0)]
        shapes += [np.sin(mid), np.cos(mid)] if plain["grav"] else []
        shapes += [np.ones_like(w0)] if plain["const"] else []
        A = np.column_stack([x[slides] / (np.abs(x).max() + 1e-30) for x in shapes])
        rest[slides] -= A @ np.linalg.lstsq(A, rest[slides], rcond=None)[0]
    return rest[slides], float(np.mean(np.abs(friction[slides]))), float(slides.mean())


def share(rig: Rig, o: dict, plain: dict, refit: bool = False) -> float:
    """The rms torque left over, of the friction level; infinite where nobody would log."""
    rest, level, moving = leftover(rig, o, plain, refit)
    far = np.isfinite(rig.travel) and np.abs(o["theta"]).max() > 2 * rig.travel
    wild = not np.isfinite(o["w"]).all() or np.abs(o["w"]).max() > 3 * rig.wmax
    return np.inf if far or wild or moving < 0.1 else float(np.sqrt(np.mean(rest**2)) / level)

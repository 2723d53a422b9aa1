"""What a run was like, and how much of its torque the plain description leaves over."""

import numpy as np
from scipy.signal import lfilter

from .loop import COLUMNS, run
from .machines import Rig, substeps

COLUMN = {name: i for i, name in enumerate(COLUMNS)}


def simulate(rig: Rig, refs, seed: int, finer: int = 1):
    """The run of a rig: its columns by name."""
    n = refs.shape[0]
    rng = np.random.default_rng(seed)
    noise, load = rng.standard_normal((n, 2)), np.zeros(n)
    rest = {k: v for k, v in rig.values.items() if k not in ("rand_f", "w_lag")}
    if rig.values.get("rand_a"):
        white = np.random.default_rng(rig.load_seed).standard_normal(n)
        keep = np.exp(-2 * np.pi * rig.values["rand_f"] * rig.Tc)
        load = lfilter([np.sqrt(1 - keep**2)], [1, -keep], white)
    every = Rig.records(_with(rig, rest))
    out = run(*every, refs, noise, load, rig.Tc, substeps(rig) * finer)
    return {name: out[:, i] for name, i in COLUMN.items()}


def _with(rig: Rig, values: dict) -> Rig:
    """The rig with other values of the plant."""
    return Rig(**{**rig.__dict__, "values": values})


def nominal(rig: Rig) -> dict:
    """The plain description of a rig, before anything hidden is added."""
    names = ("J", "Fc", "Fv", "Fs", "vs", "const", "grav", "grav_ph", "delay", "s0", "s1")
    return {name: float(rig.values.get(name, 0.0)) for name in names}


def held(cmd, late: float, Tc: float):
    """The mean of a held command over each period, acting late by a time."""
    k, part = divmod(late / Tc, 1.0)
    x = np.concatenate([np.zeros(int(k) + 1), cmd])[: cmd.size + 1]
    return (1 - part) * x[1:] + part * x[:-1]


def as_seen(rig: Rig, o: dict):
    """The speed as the hidden effects of the sensor show it."""
    w, s = o["w"], rig.sensor
    if s.get("ecc"):
        w = w * (1 + s["ecc"] * s["ecc_n"] * np.cos(s["ecc_n"] * o["theta"] + s["ecc_ph"]))
    return lagged(w, rig.values.get("w_lag", 0.0), rig.Tc)


def lagged(x, tau: float, Tc: float):
    """A signal through a first-order lag."""
    if tau <= 0:
        return x
    keep = np.exp(-Tc / tau)
    return lfilter([1 - keep], [1, -keep], x, zi=[keep * x[0]])[0]


def leftover(rig: Rig, o: dict, nom: dict):
    """Torque that the plain description leaves over, where the drive slides; and the level."""
    w = as_seen(rig, o)
    dw, w0, th = np.diff(w) / rig.Tc, 0.5 * (w[1:] + w[:-1]), o["theta"][:-1]
    u = held(o["cmd"], nom["delay"], rig.Tc)[:-1]
    dry = nom["Fc"] + 0 * w0
    if nom["Fs"] > nom["Fc"]:
        dry = dry + (nom["Fs"] - nom["Fc"]) * np.exp(-((w0 / nom["vs"]) ** 2))
    friction = dry * np.sign(w0) + nom["Fv"] * w0
    mid = th + 0.5 * np.diff(o["theta"])
    rest = u - nom["J"] * dw - friction - nom["const"] - nom["grav"] * np.sin(mid + nom["grav_ph"])
    slides = (o["w"][:-1] * o["w"][1:] > 0) & (np.abs(o["w"][:-1]) > 1e-3 * rig.wmax)
    if nom["s0"] > 0:  # bristles need a way to bend
        start = np.maximum.accumulate(np.where(slides, 0, np.arange(slides.size)))
        slides &= np.abs(th - th[start]) > 8 * nom["Fc"] / nom["s0"]
    slides[: int(3 * (nom["delay"] / rig.Tc + 1))] = False
    level = float(np.mean(np.abs(friction[slides]))) if slides.any() else nom["Fc"]
    return rest[slides], level, float(slides.mean())


def facts(rig: Rig, o: dict, level: float) -> dict:
    """Sizes of a motion, which effects are scaled by."""
    w, u, th = o["w"], o["u_mean"], o["theta"]
    lo, hi = np.quantile(th, [0.01, 0.99])
    gap = max(1, int(0.002 / rig.Tc))
    rate = (u[gap:] - u[:-gap]) / (gap * rig.Tc)
    return {
        "level": level,
        "span": float(hi - lo),
        "mid": float(0.5 * (hi + lo)),
        "w_rms": float(np.sqrt(np.mean(w**2))),
        "a_rms": float(np.sqrt(np.mean((np.diff(w) / rig.Tc) ** 2))) + 1e-12,
        "u_rate": float(np.sqrt(np.mean(rate**2))) + 1e-12,
        "u_peak": float(np.quantile(np.abs(o["cmd"]), 0.998)),
        "u_abs": float(np.mean(np.abs(u))),
    }


def sound(rig: Rig, o: dict, moving: float) -> bool:
    """Whether a run is one that a sane engineer would log."""
    w, th = o["w"], o["theta"]
    if not np.all(np.isfinite(w)) or np.abs(w).max() > 3 * rig.wmax or moving < 0.1:
        return False
    return not np.isfinite(rig.travel) or np.abs(th).max() < 2 * rig.travel

"""Records drawn at random: with one difficulty where asked, in other forms; what is unfit."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace

import numpy as np
from scipy.signal import butter, filtfilt

from .effects import TURN, find
from .machines import MACHINES
from .moves import EXCITATIONS
from .record import Case, Columns, Names, make, names_of, stream


def sample(effect: Names, seed: int, tries: int = 5, hard: bool = False, **fixed) -> Case:
    """A drawn record, drawn again while it has problems; `fixed` overrides what is drawn.

    `hard` adds one difficulty, named in the truth under "hard".
    """
    kind, change = "", {}
    for again in range(tries):
        drawn = draw(effect, seed, again)
        if hard:
            names = names_of(effect)
            rng = stream(seed, f"hard {again} " + " ".join(names))
            kind, change = harden(names, drawn, rng)
        case = make(**{**drawn, **change, **fixed})
        case.truth["hard"] = kind
        if not problems(case):
            break
    return case


def draw(effect: Names, seed: int, again: int = 0) -> dict:
    """Arguments for `make` among those that the effect can live with."""
    names = names_of(effect)
    rng = stream(seed, f"draw {again} " + " ".join(names))
    found = [find(name) for name in names]
    only = {f.only for f in found}
    excitations = [e for e in EXCITATIONS if all(e in f.excitations for f in found)]
    excitations = excitations or ["rich"]
    machines = [m for m in MACHINES.values() if m.rotary or not only & {"rotary", "load"}]
    if "load" in only:
        machines = [m for m in machines if m.name != "spindle"]
    machine = machines[int(rng.integers(len(machines)))]
    rate = float(rng.choice([200, 500, 1000, 1000, 1000, 1000, 2000, 5000]))
    slow = machine.rotary and machine.w_max < 5.0  # needs time for a turn
    durations = [20, 30, 30, 30, 60] if slow else [10, 20, 30, 30, 60]
    duration = float(rng.choice(durations)) if rate < 3000.0 else float(durations[0])
    return {
        "effect": effect,
        "machine": machine.name,
        "excitation": str(rng.choice(excitations)),
        "seed": seed,
        "rate": rate,
        "duration": duration,
        "position_only": bool("tacho" not in only and rng.random() < 0.15),
        "torque_noise": 0.005 * machine.Fc if rng.random() < 0.25 else 0.0,
    }


LEFT_OUT = ("sigma0", "sigma1", "vs", "J", "Fv", "Fc", "Fs")
HARD: dict[str, Callable[[dict, bool, np.random.Generator], dict]] = {  # of a draw; rotary or not
    "coarse encoder": lambda drawn, rotary, rng: {"quantum": TURN / 4096 if rotary else 5e-6},
    "100 Hz": lambda drawn, rotary, rng: {"rate": 100.0, "duration": 60.0},
    "10 kHz": lambda drawn, rotary, rng: {"rate": 10000.0, "duration": 20.0 if rotary else 10.0},
    "jitter": lambda drawn, rotary, rng: {"jitter": 0.06},
    "dropped samples": lambda drawn, rotary, rng: {"dropped": 0.003},
    "30 % off": lambda drawn, rotary, rng: {"declared_error": 0.3},
    "values missing": lambda drawn, rotary, rng: {
        "omit": tuple(rng.choice(LEFT_OUT, 3, replace=False))
    },
    "position only": lambda drawn, rotary, rng: {"position_only": True},
    "several runs": lambda drawn, rotary, rng: {
        "runs": 3, "rate": min(drawn["rate"], 1000.0), "duration": 20.0
    },
}  # fmt: skip


def harden(names: list[str], drawn: dict, rng: np.random.Generator) -> tuple[str, dict]:
    """One difficulty that these effects allow, and what it changes of a draw."""
    found = [find(name) for name in names]
    never = {"position only"} if any(f.only == "tacho" for f in found) else set()
    never |= {"several runs"} if any("t" in f.depends_on for f in found) else set()
    kind = str(rng.choice([kind for kind in HARD if kind not in never]))
    return kind, HARD[kind](drawn, MACHINES[drawn["machine"]].rotary, rng)


def problems(case: Case) -> list[str]:
    """Everything that is wrong with a record; empty when it is fit for use."""
    m, s, truth = MACHINES[case.truth["machine"]], case.hidden.signals, case.truth
    w, u = s["w_true"], s["u"]
    found = [f"{k} is not finite" for k, x in case.columns.items() if not np.all(np.isfinite(x))]
    travel, slow = np.ptp(s["theta_true"]), truth["excitation"] in ("sparse", "stopgo")
    if m.rotary and not slow and travel < 2.0 * np.pi:
        found.append(f"travels only {travel:.2f} rad")
    ways = np.mean(w > m.vs), np.mean(w < -m.vs)
    if not sum(ways) > 0.15:
        found.append("hardly moves")
    if not min(ways) > 0.02 * sum(ways):  # such a record is to be refused, whatever it hides
        found.append("moves in one direction only")
    if not np.max(np.abs(w)) < 5.0 * m.w_max:
        found.append(f"runs away: {np.max(np.abs(w)):.3g}")
    if np.mean(np.abs(u) > 0.999 * case.hidden.setup.machine.torque_peak) > 0.003:
        found.append("torque sits at its limit")
    for entry in truth["effects"]:
        ratio = entry["effect_rms"] / entry["friction_rms"] / truth["strength"]
        if entry["limited"] and not 0.4 < ratio < 1.5:
            found.append(f"{entry['effect']} has {ratio:.2f} times its strength")
        if entry["effect"] == "hard_stop":  # another effect may change the motion
            place, side = entry["parameters"]["position"], entry["parameters"]["side"]
            if not np.any(side * (s["theta_true"] - place) > 0.0):
                found.append("hard_stop never touched")
    return found


COUNTS = 1e5  # of the encoder over the travel
CUTOFF = 40.0  # Hz, of a filtered speed
LATE = {"u half a sample late": 0.5, "u a sample late": 1.0}
FORMS = ("w differentiated", "w smoothed", "a difference alone", "a position alone", *LATE)


def forms(names: Iterable[str]) -> list[str]:
    """Exports that leave these effects what they are."""
    if any(find(name).only == "tacho" for name in names):
        return []
    late = any(find(name).late for name in names)
    return [form for form in FORMS if not (late and form in LATE)]


def exported(case: Case, form: str) -> Case:
    """The case with its theta, w and u in another form."""
    more = tuple(exported(run, form) for run in case.more)
    truth = case.truth | {"hard": case.truth.get("hard") or form}
    return replace(case, columns=_stored(case.columns, form), truth=truth, more=more)


def _stored(columns: Columns, form: str) -> Columns:
    u, theta, dt = columns["u"], columns["theta"], float(np.median(np.diff(columns["t"])))
    if form in LATE:
        before = np.concatenate([u[:1], u[:-1]])
        return columns | {"u": LATE[form] * before + (1.0 - LATE[form]) * u}
    count = np.ptp(theta) / COUNTS
    theta = np.round(theta / count) * count
    w = np.diff(theta, prepend=theta[0]) / dt
    if form == "w smoothed":
        w = filtfilt(*butter(2, min(0.9, 2.0 * CUTOFF * dt)), w)
    seen = {"a difference alone": {"w": w}, "a position alone": {"theta": theta}}
    kept = {k: v for k, v in columns.items() if k not in ("theta", "w")}
    return kept | seen.get(form, {"theta": theta, "w": w})

"""Records drawn at random: with one difficulty where asked, in other forms; what is unfit."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace

import numpy as np
from scipy.signal import butter, filtfilt

from .effects import TURN, find
from .logger import CHANNELS, Columns, stream
from .machines import MACHINES
from .moves import EXCITATIONS
from .record import Case, Names, make, names_of


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


Drawn = dict
Harden = Callable[[list[str], Drawn, np.random.Generator], Drawn | None]
LEFT_OUT = ("sigma0", "sigma1", "vs", "J", "Fv", "Fc", "Fs")


def _rotary(drawn: Drawn) -> bool:
    return MACHINES[drawn["machine"]].rotary


def _coarse(names, drawn, rng):
    return {"quantum": TURN / 4096 if _rotary(drawn) else 5e-6}


def _slow(names, drawn, rng):
    return {"rate": 100.0, "duration": 60.0}


def _fast(names, drawn, rng):
    return {"rate": 10000.0, "duration": 20.0 if _rotary(drawn) else 10.0}


def _missing(names, drawn, rng):
    return {"omit": tuple(rng.choice(LEFT_OUT, 3, replace=False))}


def _position(names, drawn, rng):
    return None if any(find(n).only == "tacho" for n in names) else {"position_only": True}


def _several(names, drawn, rng):
    timed = any("t" in find(n).depends_on for n in names)
    return None if timed else {"runs": 3, "rate": min(drawn["rate"], 1000.0), "duration": 20.0}


def _channels(names, drawn, rng):
    return {"channels": tuple(CHANNELS)}


HARD: dict[str, Harden] = {
    "coarse encoder": _coarse,
    "100 Hz": _slow,
    "10 kHz": _fast,
    "jitter": lambda names, drawn, rng: {"jitter": 0.06},
    "dropped samples": lambda names, drawn, rng: {"dropped": 0.003},
    "30 % off": lambda names, drawn, rng: {"declared_error": 0.3},
    "values missing": _missing,
    "position only": _position,
    "several runs": _several,
    "more channels": _channels,
}


def harden(names: list[str], drawn: Drawn, rng: np.random.Generator) -> tuple[str, Drawn]:
    """One difficulty that these effects allow, and what it changes of a draw."""
    for kind in rng.permutation(list(HARD)):
        change = HARD[kind](names, drawn, rng)
        if change is not None:
            return str(kind), change
    return "", {}


def problems(case: Case) -> list[str]:
    """Everything that is wrong with a record; empty when it is fit for use."""
    return [*_motion(case), *_drive(case), *_effect(case)]


def _motion(case: Case) -> list[str]:
    m, s = MACHINES[case.truth["machine"]], case.hidden.signals
    found = [f"{k} is not finite" for k, x in case.columns.items() if not np.all(np.isfinite(x))]
    slow = case.truth["excitation"] in ("sparse", "stopgo")
    if m.rotary and not slow and np.ptp(s["theta_true"]) < 2.0 * np.pi:
        found.append(f"travels only {np.ptp(s['theta_true']):.2f} rad")
    if not np.mean(np.abs(s["w_true"]) > m.vs) > 0.15:
        found.append("hardly moves")
    ways = np.mean(s["w_true"] > m.vs), np.mean(s["w_true"] < -m.vs)
    if not min(ways) > 0.02 * sum(ways):  # such a record is to be refused, whatever it hides
        found.append("moves in one direction only")
    if not np.max(np.abs(s["w_true"])) < 5.0 * m.w_max:
        found.append(f"runs away: {np.max(np.abs(s['w_true'])):.3g}")
    return found


def _drive(case: Case) -> list[str]:
    u = case.hidden.signals["u"]
    found = []
    if np.mean(np.abs(u) > 0.999 * case.truth["drive"]["limit"]) > 0.003:
        found.append("torque sits at its limit")
    if not np.std(u) > 0.0:
        found.append("torque is constant")
    return found


def _effect(case: Case) -> list[str]:
    found = []
    for entry in case.truth["effects"]:
        ratio = entry["effect_rms"] / entry["friction_rms"]
        if entry["limited"] and ratio < 0.4 * case.truth["strength"]:
            found.append(f"{entry['effect']} hardly visible: {ratio:.3f}")
        if entry["limited"] and ratio > 1.5 * case.truth["strength"]:
            found.append(f"{entry['effect']} too strong: {ratio:.3f}")
        if entry["effect"] == "hard_stop" and not _touched(case, **entry["parameters"]):
            found.append("hard_stop never touched")  # another effect may change the motion
    return found


def _touched(case: Case, position: float, side: float, **_more: float) -> bool:
    return bool(np.any(side * (case.hidden.signals["theta_true"] - position) > 0.0))


COUNTS = 1e5  # of the encoder over the travel
CUTOFF = 40.0  # Hz, of a filtered speed


def _counted(columns: Columns) -> tuple[np.ndarray, np.ndarray]:
    """The position on an encoder, and its difference."""
    count = np.ptp(columns["theta"]) / COUNTS
    theta = np.round(columns["theta"] / count) * count
    return theta, np.diff(theta, prepend=theta[0]) / _dt(columns)


def _dt(columns: Columns) -> float:
    return float(np.median(np.diff(columns["t"])))


def _difference(columns: Columns) -> Columns:
    theta, w = _counted(columns)
    return {"theta": theta, "w": w}


def _smoothed(columns: Columns) -> Columns:
    theta, w = _counted(columns)
    b, a = butter(2, min(0.9, 2.0 * CUTOFF * _dt(columns)))
    return {"theta": theta, "w": filtfilt(b, a, w)}


def _difference_alone(columns: Columns) -> Columns:
    return {"w": _counted(columns)[1]}


def _position_alone(columns: Columns) -> Columns:
    return {"theta": _counted(columns)[0]}


def _one_late(columns: Columns) -> Columns:
    u = columns["u"]
    return {**_sensed(columns), "u": np.concatenate([u[:1], u[:-1]])}


def _half_late(columns: Columns) -> Columns:
    late = _one_late(columns)
    return late | {"u": 0.5 * (late["u"] + columns["u"])}


def _sensed(columns: Columns) -> Columns:
    return {k: columns[k] for k in ("theta", "w") if k in columns}


LATE = ("u half a sample late", "u a sample late")
EXPORTS: dict[str, Callable[[Columns], Columns]] = {
    "w differentiated": _difference,
    "w smoothed": _smoothed,
    "a difference alone": _difference_alone,
    "a position alone": _position_alone,
    **dict(zip(LATE, (_half_late, _one_late), strict=True)),
}


def forms(names: Iterable[str]) -> list[str]:
    """Those that leave these effects what they are."""
    if any(find(name).only == "tacho" for name in names):
        return []
    late = any(find(name).late for name in names)
    return [form for form in EXPORTS if not (late and form in LATE)]


def exported(case: Case, form: str) -> Case:
    """The case with its theta, w and u in another form."""
    made = EXPORTS[form](case.columns)
    rest = {k: v for k, v in case.columns.items() if k not in ("theta", "w")}
    more = tuple(exported(run, form) for run in case.more)
    return replace(
        case,
        columns=rest | made,
        truth=case.truth | {"hard": case.truth.get("hard") or form},
        more=more,
    )

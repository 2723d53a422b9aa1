"""Records drawn at random from a seed: machine, excitation, rate, duration, sensors."""

from __future__ import annotations

from .checks import problems
from .columns import stream
from .excitation import EXCITATIONS
from .hard import harden
from .hiding import find
from .machines import MACHINES
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

"""Records as they come from the shop floor: one difficulty each."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from .columns import CHANNELS
from .hiding import TURN, find
from .machines import MACHINES

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

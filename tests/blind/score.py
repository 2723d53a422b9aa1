"""What a results file says: names, restraint, parameters, errors. Pure counting."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import permutations
from typing import Any

import numpy as np

Line = dict[str, Any]
ANGLES = {"phase"}
PLACES = {"rest", "position"}  # relative to the travel, their zero means nothing
MOST = 3  # names among which the truth may be


def usable(lines: Iterable[Line]) -> list[Line]:
    """Without records that the simulator itself calls unfit."""
    return [x for x in lines if not x.get("problems")]


def verdict(line: Line) -> str:
    return "crash" if "crash" in line else line["answer"]["verdict"]


def options(line: Line) -> list[set[str]]:
    """For each effect found, its name and what explains the record as well."""
    found = line.get("answer", {}).get("effects", [])
    return [{e["name"], *(a["name"] for a in e["alternatives"])} for e in found]


def credit(line: Line) -> float:
    """1 for exactly the right names, 1/2 where they are among at most three each, else 0."""
    truth = line["names"]
    if verdict(line) == "found":
        return float(sorted(truth) == sorted(e["name"] for e in line["answer"]["effects"]))
    listed = options(line)
    if verdict(line) != "ambiguous" or len(listed) != len(truth):
        return 0.0
    if any(len(names) > MOST for names in listed):
        return 0.0
    fits = (all(t in o for t, o in zip(p, listed, strict=True)) for p in permutations(truth))
    return 0.5 if any(fits) else 0.0


def both(line: Line) -> bool:
    """Whether all that is hidden is named, whatever else is."""
    named = [e["name"] for e in line.get("answer", {}).get("effects", [])]
    return verdict(line) in ("found", "ambiguous") and set(line["names"]) <= set(named)


def visible(line: Line) -> float:
    """What a refit of the declared model leaves of the effects, over friction; inf if unknown."""
    effects = (line.get("truth") or {}).get("effects", [])
    return min((e["visible"] for e in effects if "visible" in e), default=float("inf"))


def signals(line: Line) -> tuple[bool, bool]:
    """A stranger called unexplained: is the first signal named a true one; are all of them?"""
    if verdict(line) != "unexplained":
        return False, False
    true = {s for e in line["truth"]["effects"] for s in e["depends_on"]}
    named = line["answer"]["depends_on"] or []
    return bool(named) and named[0] in true, bool(named) and set(named) <= true


@dataclass(frozen=True)
class Parameter:
    """One parameter of an effect rightly named: error, and whether its interval covers it.

    ``error`` is relative; of a phase over pi, of a place over the travel, of a count 0 or 1.
    """

    effect: str
    name: str
    error: float
    covered: bool | None
    counted: bool


def parameters(line: Line) -> list[Parameter]:
    """Of all effects of a record that is called exactly right."""
    if credit(line) < 1.0 or not line["names"]:
        return []
    found = {e["name"]: e["parameters"] for e in line["answer"]["effects"]}
    made = []
    for effect in line["truth"]["effects"]:
        for name, true in effect["parameters"].items():
            given = found[effect["name"]].get(name)
            if given is None:
                continue
            counted = name == "side" or (name == "harmonic" and line["truth"]["motion"] == "rotary")
            off = _error(name, given["value"], true, line["truth"]["travel"], counted)
            inside = None if counted else _covers(name, given["ci95"], true)
            made.append(Parameter(effect["name"], name, off, inside, counted))
    return made


def _error(name: str, value: float, true: float, travel: float, counted: bool) -> float:
    if counted:
        return float(round(value) != round(true))
    off = value - true
    if name in ANGLES:
        return abs((off + np.pi) % (2.0 * np.pi) - np.pi) / np.pi
    return abs(off) / (travel if name in PLACES else abs(true))


def _covers(name: str, interval: Sequence[float] | None, true: float) -> bool | None:
    if interval is None or None in interval:
        return None
    turns = (-2.0 * np.pi, 0.0, 2.0 * np.pi) if name in ANGLES else (0.0,)
    return any(interval[0] <= true + turn <= interval[1] for turn in turns)


def median(values: Iterable[float | None]) -> float:
    """Of those that there are; nan of none."""
    known = [v for v in values if v is not None and np.isfinite(v)]
    return float(np.median(known)) if known else float("nan")


def ratio(line: Line, over: str) -> float | None:
    """Held-out error of the augmented model over "floor", "noise" or "refitted"."""
    error = line.get("answer", {}).get("error")
    if not error or not error.get("augmented"):
        return None
    below = {
        "floor": line.get("floor"),
        "noise": error.get("noise_floor"),
        "refitted": error.get("refitted"),
    }[over]
    return error["augmented"] / below if below else None

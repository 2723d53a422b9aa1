"""What the lines of :mod:`tests.scores.rig` say: names, signals, values, errors. Pure counting."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import permutations
from typing import Any

import numpy as np

from .question import MOST_CAUSES

Line = dict[str, Any]
PLACES = {"rest", "position"}  # relative to the travel, their zero means nothing


def usable(lines: Iterable[Line]) -> list[Line]:
    """Without records that the simulator itself calls unfit."""
    return [x for x in lines if not x.get("problems")]


def verdict(line: Line) -> str:
    return "crash" if "crash" in line else line["answer"]["verdict"]


def credit(line: Line) -> float:
    """1 for exactly the right names, 1/2 where they are among at most three each, else 0."""
    truth, found = line["names"], line.get("answer", {}).get("effects", [])
    if verdict(line) == "found":
        return float(sorted(truth) == sorted(e["name"] for e in found))
    listed = [{e["name"], *(a["name"] for a in e["alternatives"])} for e in found]
    if verdict(line) != "ambiguous" or len(listed) != len(truth):
        return 0.0
    if any(len(names) > MOST_CAUSES for names in listed):
        return 0.0
    fits = (all(t in o for t, o in zip(p, listed, strict=True)) for p in permutations(truth))
    return 0.5 if any(fits) else 0.0


def all_named(line: Line) -> bool:
    """Whether all that is hidden is named, whatever else is."""
    named = [e["name"] for e in line.get("answer", {}).get("effects", [])]
    return verdict(line) in ("found", "ambiguous") and set(line["names"]) <= set(named)


def is_right(line: Line) -> bool:
    """Whether a record was called what it is, with no wrong name; a stranger unexplained, with a
    signal that it depends on named first."""
    if line["kind"] != "stranger":
        return credit(line) == 1.0 if line["names"] else verdict(line) == "adequate"
    true = {s for e in line["truth"]["effects"] for s in e["depends_on"]}
    named = line.get("answer", {}).get("depends_on") or []
    return verdict(line) == "unexplained" and bool(named) and named[0] in true


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
    if name == "phase":
        return abs((off + np.pi) % (2.0 * np.pi) - np.pi) / np.pi
    return abs(off) / (travel if name in PLACES else abs(true))


def _covers(name: str, interval: Sequence[float] | None, true: float) -> bool | None:
    if interval is None or None in interval:
        return None
    turns = (-2.0 * np.pi, 0.0, 2.0 * np.pi) if name == "phase" else (0.0,)
    return any(interval[0] <= true + turn <= interval[1] for turn in turns)


def median(values: Iterable[float | None]) -> float:
    """Of those that there are; nan of none."""
    known = [v for v in values if v is not None and np.isfinite(v)]
    return float(np.median(known)) if known else float("nan")


def ratio(line: Line, over: str) -> float | None:
    """Held-out error of the augmented model over "floor", "noise_floor" or "refitted"."""
    error = line.get("answer", {}).get("error")
    if not error or not error.get("augmented"):
        return None
    below = line.get("floor") if over == "floor" else error.get(over)
    return error["augmented"] / below if below else None


# --- as text -----------------------------------------------------------------------------


def counted(part: int, total: int) -> str:
    """ "53 of 56"."""
    return f"{part} of {total}" if total else "no record"


def rows(lines: Sequence[Line]) -> list[tuple[str, str]]:
    """The six figures that say how often a diagnosis is right: what is counted, and the count.

    Effects named as one of at most three are added in words, and pairs without a name too many.
    """
    kept = usable(lines)
    made = []
    for what, strength in (("20 %", "normal"), ("8 %", "weak")):
        credits = [credit(x) for x in kept if (x["kind"], x["strength"]) == ("effect", strength)]
        weak, among = "weak " * (strength == "weak"), credits.count(0.5)
        said = counted(credits.count(1.0), len(credits)) + f", {among} more ambiguous" * bool(among)
        of = f"RMS {what} of friction" if not weak else what
        made.append((f"one {weak}effect, {of}, named exactly", said))
    pairs, none, strange = (
        [x for x in kept if x["kind"] == k] for k in ("pair", "none", "stranger")
    )
    both, right = sum(map(all_named, pairs)), sum(credit(x) == 1.0 for x in pairs)
    alone = f", {right} alone" * (right < both)
    adequate = sum(verdict(x) == "adequate" for x in none)
    so = sum(verdict(x) == "unexplained" for x in strange)
    first = f", the first signal right in {sum(map(is_right, strange))}" * bool(so)
    every = [p.covered for x in kept for p in parameters(x) if p.covered is not None]
    return made + [
        ("two effects, both named", counted(both, len(pairs)) + alone),
        ("nothing missing: `adequate`", counted(adequate, len(none))),
        ("unknown effect: `unexplained`", counted(so, len(strange)) + first),
        ("95 % intervals that cover the true value", counted(sum(every), len(every))),
    ]


def called(line: Line) -> str:
    """What a record was called, in words."""
    what = verdict(line)
    if what == "crash":
        return f"no answer ({line['crash'].strip().splitlines()[-1]})"
    if what == "refused":
        return f"refused: {line['answer']['reason']}"
    named = " and ".join(_named(e) for e in line["answer"]["effects"])
    if what != "unexplained":
        return named or what
    on = " and ".join(f"`{s}`" for s in line["answer"]["depends_on"] or [])
    beside = f", beside {named}" if named else ""
    return f"`unexplained`, depends on {on or 'nothing known'}{beside}"


def _named(effect: Line) -> str:
    others = " or ".join(f"`{a['name']}`" for a in effect["alternatives"])
    return f"`{effect['name']}`" + (f" (or {others})" if others else "")


def conditions(line: Line) -> str:
    """How a record was made, as far as that makes it harder."""
    truth = line.get("truth") or {}
    form = line["key"].split(str(line["seed"]), 1)[1].removeprefix(" hard").strip()
    rate = f"{truth['rate']:g} Hz" if "rate" in truth else ""
    length = f"{truth['duration']:g} s" if "duration" in truth else ""
    return ", ".join(filter(None, (rate, length, truth.get("hard"), form)))


def text(lines: Sequence[Line]) -> str:
    """The six figures, how long it took, and what the records were called."""
    kept = usable(lines)
    parts = [f"{len(lines)} records, {len(lines) - len(kept)} unfit and left out", ""]
    parts += [f"{what}: {value}" for what, value in rows(kept)]
    cpu = [x["cpu"] for x in kept if "cpu" in x]
    if cpu:
        parts.append(f"CPU time: {np.median(cpu):.1f} s median, {max(cpu):.1f} s worst")
    calls = Counter((x["kind"], x["strength"], " + ".join(x["names"]), called(x)) for x in kept)
    parts += [f"{' '.join(said)}: {n}" for said, n in sorted(calls.items())]
    return "\n".join(parts)

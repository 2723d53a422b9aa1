"""The six figures that say how often a diagnosis is right, as counts."""

from __future__ import annotations

from collections.abc import Sequence

from . import score
from .score import Line

NORMAL, WEAK = "normal", "weak"


def counted(part: int, total: int) -> str:
    """ "53 of 56"."""
    return f"{part} of {total}" if total else "no record"


def exact(lines: Sequence[Line]) -> str:
    """How many are named exactly; those named as one of at most three are added in words."""
    credits = [score.credit(x) for x in lines]
    among = sum(c == 0.5 for c in credits)
    more = f", {among} more ambiguous" if among else ""
    return counted(sum(c == 1.0 for c in credits), len(credits)) + more


def pairs(lines: Sequence[Line]) -> str:
    """How many have both effects named; how many of these without a name too many."""
    both, right = (sum(map(of, lines)) for of in (score.both, lambda x: score.credit(x) == 1.0))
    fewer = f", {right} alone" if right < both else ""
    return counted(both, len(lines)) + fewer


def adequate(lines: Sequence[Line]) -> str:
    return counted(sum(score.verdict(x) == "adequate" for x in lines), len(lines))


def unknown(lines: Sequence[Line]) -> str:
    """How many are called unexplained, and in how many the first signal named is right."""
    called = sum(score.verdict(x) == "unexplained" for x in lines)
    first = sum(score.signals(x)[0] for x in lines)
    return counted(called, len(lines)) + (f", the first signal right in {first}" if called else "")


def intervals(lines: Sequence[Line]) -> str:
    """How many of the intervals cover the true value, of effects that were named exactly."""
    every = [p.covered for x in lines for p in score.parameters(x) if not p.counted]
    known = [covered for covered in every if covered is not None]
    return counted(sum(known), len(known))


def is_right(line: Line) -> bool:
    """Whether a record was called what it is, with no wrong name."""
    if line["kind"] == "stranger":
        return score.signals(line)[0]
    return score.credit(line) == 1.0 if line["names"] else score.verdict(line) == "adequate"


def called(line: Line) -> str:
    """What a record was called, in words."""
    what = score.verdict(line)
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


def rows(lines: Sequence[Line]) -> list[tuple[str, str]]:
    """What is counted and the count, six times."""
    usable = score.usable(lines)

    def of(kind: str, strength: str = NORMAL) -> list[Line]:
        return [x for x in usable if (x["kind"], x["strength"]) == (kind, strength)]

    return [
        ("one effect, RMS 20 % of friction, named exactly", exact(of("effect"))),
        ("one weak effect, 8 %, named exactly", exact(of("effect", WEAK))),
        ("two effects, both named", pairs(of("pair"))),
        ("nothing missing: `adequate`", adequate(of("none"))),
        ("unknown effect: `unexplained`", unknown(of("stranger"))),
        ("95 % intervals that cover the true value", intervals(usable)),
    ]

"""Code for kinks and jumps within a run: the sides of steps, and where steps must end."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from ..expression.graph import Node, symbols_in
from .filippov import Sliding

HELPERS = """
@small
def side(a):
    return 1.0 if a > 0.0 else (-1.0 if a < 0.0 else a)


@small
def started(m, a, r):
    return m if abs(a) <= DEAD * r and a != 0.0 else side(a)


@small
def widest(r, a):  # not max, which Python and numba leave differently from nan
    return abs(a) if abs(a) > r else r


@small
def nearest(worst, far):
    return far if far < worst else worst


@small
def within(m, l):  # negative where a step ends on a side that it has not taken
    return m * l if m != 0.0 else -abs(l)


@small
def lands(m, l, a):
    return l == 0.0 and m != 0.0 and a != 0.0


@small
def distance(m, l, a, r):  # in widths of the dead band
    far = -2.0 if lands(m, l, a) else within(m, l) / (DEAD * r + 1e-300)
    return far if abs(far) > 1.0 or abs(a) > DEAD * r else 1e300


@small
def first_distance(m, a, r):  # of a function that has left the zero of an earlier event
    far = m * a / (DEAD * r + 1e-300)
    return far if far > 1.0 else 1e300


@small
def misled(m, l, a, r):
    return abs(a) <= DEAD * r and (within(m, l) < -DEAD * r or lands(m, l, a))


@small
def passed(m, l, r):
    return within(m, l) < -DEAD * r


@small
def turned(m, l, r):
    return side(l) if passed(m, l, r) or l == 0.0 or m * l != m * l else m
"""

REST = """

@small
def outside(part, step):  # how far the weight of a rest is from (0, 1)
    return DEAD + max(-part, part - 1.0) if step < 0.0 else inf


@small
def margin(part):
    return (0.5 - abs(part - 0.5)) / DEAD
"""


@dataclass(frozen=True, eq=False)
class Parts:
    """The parts of the code."""

    states: list[str]
    inputs: list[str]
    step: list[Node]
    leads: list[Node]
    jumps: list[bool]
    slides: Sliding


def start_sides(parts: Parts) -> list[str]:
    """The sides at the start of an interval, where inputs may have jumped."""
    lines = []
    for i, lead in enumerate(parts.leads):
        if i in parts.slides.parts and symbols_in([lead]) & {*parts.inputs}:
            lines += [f"on{i} = on{i} if abs(a{i}) <= DEAD * r{i} else 0.0"]
        lines += _unless_resting(parts, i, [f"m{i} = started(m{i}, a{i}, r{i})"])
    return lines


def nesting(leads: Sequence[Node]) -> int:
    """The longest chain of switching functions, each of which depends on the side of the next."""
    depths: dict[str, int] = {}
    for i, lead in enumerate(leads):
        inner = [depths[name] for name in symbols_in([lead]) if name in depths]
        depths[f"m{i}"] = 1 + max(inner, default=0)
    return max(depths.values(), default=1)


def _unless_resting(parts: Parts, i: int, lines: Sequence[str]) -> list[str]:
    """The lines, executed only if a switching function does not rest."""
    if i not in parts.slides.parts:
        return [*lines]
    return [f"if on{i} == 0.0:", *("    " + line for line in lines)]


def nearest_zero(parts: Parts, weights: Sequence[str]) -> list[str]:
    """The distance of the nearest switching function from zero, in widths of its dead band."""
    lines = ["worst = 1e300"]
    for i in range(len(parts.leads)):
        far = f"distance(m{i}, l{i}, a{i}, r{i})"
        lines += [f"r{i} = widest(r{i}, l{i})"]
        lines += _unless_resting(parts, i, [f"worst = nearest(worst, {far})"])
    if not parts.slides.parts:
        return lines
    lines += [f"if {' + '.join(f'on{i}' for i in parts.slides.parts)} > 0.0:"]
    lines += ["    " + line for line in weights]
    for i in parts.slides.parts:
        lines += [f"    if on{i} > 0.0:", f"        worst = nearest(worst, margin(end_part{i}))"]
    return lines


def nearest_before(parts: Parts) -> list[str]:
    """The same at the start of a step."""
    lines = []
    for i in range(len(parts.leads)):
        far = f"first_distance(m{i}, a{i}, r{i})"
        lines += _unless_resting(parts, i, [f"first = nearest(first, {far})"])
        if i in parts.slides.parts:
            lines += ["else:", f"    first = nearest(first, margin(part{i}))"]
    return lines


def turns(parts: Parts, *, at_start: bool) -> list[str]:
    """Changes sides that a trial step from zero has shown to be wrong, or that a step has left."""
    lines = []
    for i, jump in enumerate(parts.jumps):
        count = ["    events += 1"] + ["    relays += 1"] * jump
        if at_start:
            turn = [f"if misled(m{i}, l{i}, a{i}, r{i}):", f"    m{i} = side(l{i})", *count]
            lines += _unless_resting(parts, i, [*turn, "    flipped = True"])
        else:
            turn = [f"if passed(m{i}, l{i}, r{i}):", *count, f"m{i} = turned(m{i}, l{i}, r{i})"]
            lines += _unless_resting(parts, i, turn)
    return lines

"""A row of the bench: the logs of a drive, what is declared, and whether an answer is right."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ..scores.question import Answer, Estimate

VERDICTS = ("adequate", "found", "ambiguous", "unexplained", "refused")


@dataclass(frozen=True)
class Source:
    """A file below the data folder, and the options of ``read_record`` that it needs."""

    file: str
    options: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Value:
    """A range in which a value is right, SI; in the unit of u where u is a voltage.

    ``names`` mean the same quantity: the first that the answer gives inside the range will do.
    ``needed``: an answer without it is not right. ``covering``: the interval covers all of it.
    """

    names: tuple[str, ...]
    low: float
    high: float
    needed: bool = False
    covering: bool = False


@dataclass(frozen=True)
class Way:
    """One kind of right answer.

    ``names``: from each set one effect is named, as the likeliest or as an alternative.
    ``beside``: what may be named as well. ``depends_on``: signals of which at least one is named;
    empty: not judged. ``values``: ranges of this way alone. ``absent``: values that are not given.
    ``not_because``: texts that the reason of a refusal does not hold.
    """

    verdicts: frozenset[str]
    names: tuple[frozenset[str], ...] = ()
    beside: frozenset[str] = frozenset()
    depends_on: frozenset[str] = frozenset()
    values: tuple[Value, ...] = ()
    absent: tuple[str, ...] = ()
    not_because: tuple[str, ...] = ()


@dataclass(frozen=True)
class Row:
    """One or several runs of one drive, and what is known of it.

    ``group``: "table" (the rows of the comparison of measured logs), "map" (runs at steady speed),
    "format" (a log of the table in its second file format). ``right``: any of these ways.
    ``left``: share of RMS torque that the plain fit by hand leaves on these runs.
    """

    name: str
    group: str
    sources: tuple[Source, ...]
    model: Mapping[str, Any]
    right: tuple[Way, ...]
    values: tuple[Value, ...] = ()
    left: float | None = None
    known: str = ""

    def files(self, data: Path) -> list[Path]:
        return [data / source.file for source in self.sources]

    def missing(self, data: Path) -> list[str]:
        """The files that are not there."""
        return [source.file for source in self.sources if not (data / source.file).is_file()]


def value(names: str, low: float, high: float, **more: bool) -> Value:
    """``value("u_delay or input_delay.delay", 0.02, 0.03)``."""
    return Value(tuple(names.split(" or ")), low, high, **more)


def way(verdicts: str, *names: str, beside: str = "", depends_on: str = "", **more: Any) -> Way:
    """``way("found ambiguous", "gravity constant_torque")``: one of the two is named."""
    groups = tuple(frozenset(group.split()) for group in names)
    sets = (frozenset(text.split()) for text in (verdicts, beside, depends_on))
    said, extra, signals = sets
    return Way(said, groups, extra, signals, **more)


# ---- whether an answer is right: pure rules on a row and an answer -----------------------


MOST = 3  # causes that an ambiguous answer may list
MORE_LEFT = 0.01  # share of RMS torque that may be left beyond the fit by hand


@dataclass(frozen=True)
class Score:
    """``named``: verdict and names are right. ``right``: values and residual as well."""

    named: bool
    right: bool
    why: tuple[str, ...] = ()


def score(row: Row, answer: Answer) -> Score:
    """The score of an answer, with one phrase for each thing that is not right."""
    if answer.verdict in ("crash", "timeout"):
        return Score(False, False, (f"no answer: {answer.reason or answer.verdict}",))
    tried = [(*wrong_names(w, answer), *wrong_values(w.values, answer)) for w in row.right]
    names = () if () in tried else tried[0]  # the first way is the usual one
    values = wrong_values(row.values, answer) if answer.verdict != "refused" else ()
    more = (*values, *too_much_left(row, answer))
    return Score(not names, not names and not more, (*names, *more))


def wrong_names(one: Way, answer: Answer) -> tuple[str, ...]:
    """What of the verdict and the names does not fit this way."""
    said = (*answer.effects, *answer.alternatives)
    allowed = one.beside.union(*one.names)
    wrong = []
    if answer.verdict not in one.verdicts:
        wrong.append(f"verdict {answer.verdict}, not {' or '.join(sorted(one.verdicts))}")
    for group in one.names:
        if not group & set(said):
            wrong.append(f"{' or '.join(sorted(group))} is not named")
    wrong += [f"{name} is wrong" for name in answer.effects if name not in allowed]
    if len(answer.alternatives) >= MOST:
        wrong.append(f"more than {MOST} causes")
    if one.depends_on and not one.depends_on & set(answer.depends_on):
        wrong.append(f"does not depend on {' or '.join(sorted(one.depends_on))}")
    wrong += [f"{key} cannot be known" for key in one.absent if key in answer.parameters]
    wrong += [f"'{t}' is no reason" for t in one.not_because if t in answer.reason.lower()]
    return tuple(wrong)


def wrong_values(values: Iterable[Value], answer: Answer) -> tuple[str, ...]:
    """One phrase for each value outside its range, and for each that is needed and not given."""
    return tuple(phrase for v in values if (phrase := _wrong(v, answer)))


def _wrong(v: Value, answer: Answer) -> str:
    given = [(name, answer.parameters[name]) for name in v.names if name in answer.parameters]
    if not given:
        return f"{v.names[0]} is not given" if v.needed or v.covering else ""
    if any(_fits(v, estimate) for _, estimate in given):
        return ""
    name, (best, low, high) = given[0]
    ends = f" [{low:.4g}, {high:.4g}]" if low is not None and high is not None else ""
    return f"{name} {best:.4g}{ends}, not {v.low:.4g} to {v.high:.4g}"


def _fits(v: Value, estimate: Estimate) -> bool:
    """Whether the value lies in the range, or its interval reaches into it."""
    best, low, high = estimate
    if v.covering:
        return low is not None and high is not None and low <= v.low and v.high <= high
    if v.low <= best <= v.high:
        return True
    return low is not None and high is not None and low <= v.high and v.low <= high


def too_much_left(row: Row, answer: Answer) -> tuple[str, ...]:
    """Whether more is left than the fit by hand leaves, by more than a point."""
    if row.left is None or answer.left is None or answer.left <= row.left + MORE_LEFT:
        return ()
    return (f"{100 * answer.left:.1f} % left, by hand {100 * row.left:.1f} %",)


def total(scores: Sequence[Score]) -> dict[str, int]:
    """Counts over rows."""
    return {
        "rows": len(scores),
        "named": sum(s.named for s in scores),
        "right": sum(s.right for s in scores),
    }

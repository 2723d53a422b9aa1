"""The comparison in words and pictures: torque budget, table of models, limits of detection."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from ..blocks.block import unit_for
from ..core.display import Grid, between, number
from .page import Section

BUDGET = "Torque budget"
ROWS = 8  # models of the table that are shown
FEWEST_PARTS = 12  # independent stretches without which a budget has no intervals
OWN = ("inertia", "coulomb", "viscous", "offset and unbalance")
BIASED = (
    "There are no intervals: a large torque is not explained, and a part of it may count as one of "
    "the other terms."
)
FEW = "There are no intervals: the record has {} independent stretch{} only."
SHARES = (
    "Shares are of {} {}, the RMS friction torque of the refitted model. RMS values do not "
    "add up: terms act at the same time, with or against each other."
)
UNKNOWN = "unknown torque"
UNNAMED = ("left", "noise")


def budget(d: Any) -> Section | None:
    """Where the torque goes: each term, as RMS and as a share of friction."""
    found = _comparison(d)
    if found is None or not found.budget:
        return None
    unit = unit_for("N m", motion_of(d))
    rows = [
        (name, number(s.rms, 3), percent(s.share), _ends(s.ci95), ", ".join(s.signals))
        for name, s in zip(terms(found.budget), found.budget, strict=True)
    ]
    head = ("term", f"RMS [{unit}]", "of friction", "95 % interval", "depends on")
    footnote = SHARES.format(_whole(found.budget), unit)
    if all(s.ci95 is None for s in found.budget):
        many = found.stretches or FEWEST_PARTS
        why = FEW.format(many, "es" * (many > 1)) if many < FEWEST_PARTS else BIASED
        footnote = f"{footnote} {why}"
    return Section(BUDGET, (), Grid(head, "lrrrl", tuple(rows)), footnote)


def share_of(d: Any, name: str) -> str | None:
    """A term's torque as a share of friction, None where the budget has no such term."""
    found = _comparison(d)
    rows = () if found is None else zip(terms(found.budget), found.budget, strict=True)
    return next((percent(s.share) for term, s in rows if term == name), None)


def table(d: Any) -> Section | None:
    """The models that were compared, the best first."""
    found = _comparison(d)
    if found is None or not found.rows:
        return None
    first, *others = found.rows
    rows = [_row(row) for row in (first, *others[:ROWS])]
    head = ("model", "predicts better by", "+-", "torque", "parameters")
    lines = (
        "Each model predicts parts of the record that its fit has not seen. The gain is the "
        "logarithm of how much more probable it makes them than the declared model does.",
    )
    more = len(others) - ROWS
    footnote = f"{more} more models gain less." if more > 0 else ""
    return Section("Comparison", lines, Grid(head, "lrrrr", tuple(rows)), footnote)


def laws(d: Any) -> Section | None:
    """The friction laws that were compared, the best first."""
    found = getattr(d, "laws", None)
    if found is None:
        return None
    lines = (found.sentence, "Each law was fitted; the gain is of held-out samples.")
    reasons = " ".join(f"{row.name}: {row.reason}" for row in found if row.reason)
    return Section("Friction laws", lines, found.grid(), reasons)


def limits(d: Any) -> Section | None:
    """How small an effect this record would have shown; only where nothing is missing."""
    found = _comparison(d)
    if found is None or not found.detectable:
        return None
    shown = [limit for limit in found.detectable if limit.share > found.least]
    best = len(found.detectable) - len(shown)
    line = (
        f"{best or 'No'} effects would have been seen from {percent(found.least)} of friction on, "
        "with a probability of 80 %; smaller ones are not named."
    )
    rows = [(limit.name, _seen_from(limit.share)) for limit in shown]
    grid = Grid(("effect", "seen from"), "lr", tuple(rows)) if rows else None
    return Section("What this record would show", (line,), grid)


def limits_in_words(d: Any) -> str:
    """The limit below which most effects show, for the headline; "" if there is none."""
    found = _comparison(d)
    if found is None or not found.detectable:
        return ""
    most = sorted(limit.share for limit in found.detectable)[len(found.detectable) // 2]
    said = f" Most effects would have shown from {percent(most)} of friction on."
    return said if most < 1.0 else ""


def motion_of(d: Any) -> str:
    """ "rotary" or "linear"."""
    known = (getattr(d, name, None) for name in ("model", "declared", "record"))
    return next((x.motion for x in known if x is not None), "rotary")


def _comparison(d: Any) -> Any:
    return getattr(d, "comparison", None)


def _row(row: Any) -> tuple[str, ...]:
    if row.model == "declared":
        return ("declared", "0", "", "", str(row.parameters))
    return (row.model, f"{row.elpd:,.0f}", f"{row.se:,.0f}", percent(row.torque),
            str(row.parameters))  # fmt: skip


def kind(term: str) -> str:
    return "friction" if term in OWN else "rest" if term in UNNAMED else "effect"


def _seen_from(share: float) -> str:
    """A limit beyond all friction says that the record cannot show the effect."""
    return percent(share) if share < 1.0 else "not in this record"


def terms(parts: Sequence[Any]) -> list[str]:
    """The terms in words; what is left beside an unknown torque is the rest of the unexplained."""
    left = "the rest" if any(s.term == UNKNOWN for s in parts) else "not explained"
    words = {"left": left, "noise": "of it sensor noise"}
    return [words.get(term, term) for term in (str(s.term) for s in parts)]


def _whole(parts: Sequence[Any]) -> str:
    """The RMS torque of which the shares are, from the largest one."""
    first = max(parts, key=lambda s: s.rms)
    return number(first.rms / first.share, 3) if first.share > 0 else "0"


def percent(share: float) -> str:
    return f"{number(100.0 * share, 2)} %"


def _ends(ci95: Sequence[float] | None) -> str:
    if ci95 is None:
        return ""
    return f"{between([100.0 * x for x in ci95])} %"

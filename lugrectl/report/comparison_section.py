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
UNKNOWN = "unknown torque"
UNNAMED = ("left", "noise")


def budget(d: Any) -> Section | None:
    """Where the torque goes: each term, as RMS and as a share of friction."""
    found = _of(d)
    if found is None or not found.budget:
        return None
    unit, rows = unit_for("N m", motion_of(d)), []
    for name, s in zip(terms(found.budget), found.budget, strict=True):
        ends = "" if s.ci95 is None else f"{between([100.0 * x for x in s.ci95])} %"
        rows.append((name, number(s.rms, 3), percent(s.share), ends, ", ".join(s.signals)))
    head = ("term", f"RMS [{unit}]", "of friction", "95 % interval", "depends on")
    first = max(found.budget, key=lambda s: s.rms)
    whole = number(first.rms / first.share, 3) if first.share > 0 else "0"
    footnote = (
        f"Shares are of {whole} {unit}, the RMS friction torque of the refitted model. RMS values "
        "do not add up: terms act at the same time, with or against each other."
    )
    if all(s.ci95 is None for s in found.budget):
        many = found.stretches or FEWEST_PARTS
        why = FEW.format(many, "es" * (many > 1)) if many < FEWEST_PARTS else BIASED
        footnote = f"{footnote} {why}"
    return Section(BUDGET, (), Grid(head, "lrrrl", tuple(rows)), footnote)


def share_of(d: Any, name: str) -> str | None:
    """A term's torque as a share of friction, None where the budget has no such term."""
    parts = getattr(_of(d), "budget", ())
    rows = zip(terms(parts), parts, strict=True)
    return next((percent(s.share) for term, s in rows if term == name), None)


def table(d: Any) -> Section | None:
    """The models that were compared, the best first."""
    found = _of(d)
    if found is None or not found.rows:
        return None
    rows = [
        ("declared", "0", "", "", str(row.parameters))
        if row.model == "declared"
        else (
            row.model,
            f"{row.elpd:,.0f}",
            f"{row.se:,.0f}",
            percent(row.torque),
            str(row.parameters),
        )
        for row in found.rows[: ROWS + 1]
    ]
    head = ("model", "predicts better by", "+-", "torque", "parameters")
    lines = (
        "Each model predicts parts of the record that its fit has not seen. The gain is the "
        "logarithm of how much more probable it makes them than the declared model does.",
    )
    more = len(found.rows) - 1 - ROWS
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
    found = _of(d)
    if found is None or not found.detectable:
        return None
    shown = [limit for limit in found.detectable if limit.share > found.least]
    line = (
        f"{len(found.detectable) - len(shown) or 'No'} effects would have been seen from "
        f"{percent(found.least)} of friction on, with a probability of 80 %; smaller ones are not "
        "named."
    )
    rows = [(x.name, percent(x.share) if x.share < 1.0 else "not in this record") for x in shown]
    grid = Grid(("effect", "seen from"), "lr", tuple(rows)) if rows else None
    return Section("What this record would show", (line,), grid)


def limits_in_words(d: Any) -> str:
    """The limit below which most effects show, for the headline; "" if there is none."""
    shares = sorted(limit.share for limit in getattr(_of(d), "detectable", ()))
    most = shares[len(shares) // 2] if shares else 1.0
    said = f" Most effects would have shown from {percent(most)} of friction on."
    return said if most < 1.0 else ""


def motion_of(d: Any) -> str:
    """ "rotary" or "linear"."""
    known = (getattr(d, name, None) for name in ("model", "declared", "record"))
    return next((x.motion for x in known if x is not None), "rotary")


def _of(d: Any) -> Any:
    return getattr(d, "comparison", None)


def kind(term: str) -> str:
    return "friction" if term in OWN else "rest" if term in UNNAMED else "effect"


def terms(parts: Sequence[Any]) -> list[str]:
    """The terms in words; what is left beside an unknown torque is the rest of the unexplained."""
    left = "the rest" if any(s.term == UNKNOWN for s in parts) else "not explained"
    words = {"left": left, "noise": "of it sensor noise"}
    return [words.get(term, term) for term in (str(s.term) for s in parts)]


def percent(share: float) -> str:
    return f"{number(100.0 * share, 2)} %"

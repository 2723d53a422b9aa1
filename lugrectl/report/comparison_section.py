"""The comparison in words and pictures: torque budget, table of models, limits of detection."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from ..blocks.block import unit_for
from ..core.display import Grid, between, number
from .canvas import drawn
from .section import Section

if TYPE_CHECKING:
    from matplotlib.axes import Axes

BUDGET = "Torque budget"
ROWS = 8  # models of the table that are shown
FEWEST_PARTS = 12  # independent stretches without which a budget has no intervals
COLOURS = {"friction": "#5b6675", "effect": "#1f6fb4", "rest": "#b9c2cd"}
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
    unit = unit_for("N m", _motion(d))
    rows = [
        (name, number(s.rms, 3), _percent(s.share), _ends(s.ci95), ", ".join(s.signals))
        for name, s in zip(_terms(found.budget), found.budget, strict=True)
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
    rows = () if found is None else zip(_terms(found.budget), found.budget, strict=True)
    return next((_percent(s.share) for term, s in rows if term == name), None)


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
        f"{best or 'No'} effects would have been seen from {_percent(found.least)} of friction on, "
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
    said = f" Most effects would have shown from {_percent(most)} of friction on."
    return said if most < 1.0 else ""


@drawn
def bars(d: Any, ax: Axes) -> Axes:
    """The torque budget as bars."""
    found = _comparison(d)
    assert found is not None
    parts = found.budget[::-1]
    colours = [COLOURS[_kind(s.term)] for s in parts]
    shares = [100.0 * s.share for s in parts]
    ax.barh(range(len(parts)), shares, color=colours, height=0.7)
    for i, s in enumerate(parts):
        if s.ci95 is not None:
            ax.plot([100 * x for x in s.ci95], [i, i], color="#1c2430", lw=1.2)
        end = 100.0 * max((s.share, *(s.ci95 or ())))  # else the interval strikes it through
        ax.annotate(
            _percent(s.share), (end, i), xytext=(4, 0), textcoords="offset points",
            va="center", fontsize="small",
        )  # fmt: skip
    ax.set_yticks(range(len(parts)), _terms(parts))
    ax.grid(False, axis="y")
    ax.margins(x=0.15)
    ax.set_xlabel("RMS torque [% of friction]")
    ax.set_title(BUDGET)
    return ax


def _comparison(d: Any) -> Any:
    return getattr(d, "comparison", None)


def _motion(d: Any) -> str:
    known = (getattr(d, "model", None), getattr(d, "declared", None))
    return next((m.motion for m in known if m is not None), "rotary")


def _row(row: Any) -> tuple[str, ...]:
    if row.model == "declared":
        return ("declared", "0", "", "", str(row.parameters))
    return (row.model, f"{row.elpd:,.0f}", f"{row.se:,.0f}", _percent(row.torque),
            str(row.parameters))  # fmt: skip


def _kind(term: str) -> str:
    return "friction" if term in OWN else "rest" if term in UNNAMED else "effect"


def _seen_from(share: float) -> str:
    """A limit beyond all friction says that the record cannot show the effect."""
    return _percent(share) if share < 1.0 else "not in this record"


def _terms(parts: Sequence[Any]) -> list[str]:
    """The terms in words; what is left beside an unknown torque is the rest of the unexplained."""
    left = "the rest" if any(s.term == UNKNOWN for s in parts) else "not explained"
    words = {"left": left, "noise": "of it sensor noise"}
    return [words.get(term, term) for term in (str(s.term) for s in parts)]


def _whole(parts: Sequence[Any]) -> str:
    """The RMS torque of which the shares are, from the largest one."""
    first = max(parts, key=lambda s: s.rms)
    return number(first.rms / first.share, 3) if first.share > 0 else "0"


def _percent(share: float) -> str:
    return f"{number(100.0 * share, 2)} %"


def _ends(ci95: Sequence[float] | None) -> str:
    if ci95 is None:
        return ""
    return f"{between([100.0 * x for x in ci95])} %"

"""What a diagnosis says, in words and tables: the content that text and HTML reports share."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from ..blocks.block import members, unit_for
from ..blocks.model import model_toml
from ..core.display import NONE, Grid, between, number, with_interval
from ..core.numeric import Z95
from ..estimates.findings import AGAINST_HELD
from .page import Section

LISTED = 8  # runs with a line each; of more, the names
ERRORS = "Error before and after"

BUDGET = "Torque budget"
ROWS = 8  # models of the table that are shown
FEWEST_PARTS = 12  # independent stretches without which a budget has no intervals
OWN = ("inertia", "coulomb", "viscous", "offset and unbalance")
BIASED = (
    "There are no intervals: a large torque is not explained, and a part of it may count as one of "
    "the other terms."
)
FEW = "There are no intervals: the record has {} independent stretch{} only."
AMBIGUOUS = (
    "Something is missing from the model, but this record cannot decide what: {} or {} explain "
    "it equally well."
)
UNEXPLAINED = "{} is missing{}, and no effect in the catalogue explains it."
UNKNOWN = "unknown torque"
COMPENSATED = (
    "The drive is the augmented model. The compensation uses {} observer and the declared model "
    "(before) or the augmented model (after)."
)
UNNAMED = ("left", "noise")
_SMALL = {"rad", "m", "rad/s", "m/s", "N m", "N"}  # units that take a prefix


def toml_of(d: Any, folder: Path | None) -> str:
    """The text of the model file; comments say how well a value is known."""
    declared, estimates = d.model.declarations(), _get(d, "estimates", {})
    known = {k: _known(e, declared[k]) for k, e in estimates.items() if k in declared}
    return model_toml(d.model, folder, known)


def _known(e: Any, p: Any) -> str:
    if e.held or p.whole or p.choices:
        return ""
    if e.ci95 is None or not all(map(math.isfinite, e.ci95)):
        return "not determined" if not e.together else f"only {e.together}"
    return f"std {number((e.ci95[1] - e.ci95[0]) / (2.0 * Z95), 2)}"


def equation(name: str) -> str:
    known = members("effect").get(name)
    return known.equation.rstrip(".") if known else ""


def listed(names: Sequence[str]) -> str:
    """ "a", "a and b", "a, b and c"."""
    return " and ".join(filter(None, (", ".join(names[:-1]), *names[-1:])))


def headline(d: Any) -> tuple[str, str]:
    """The verdict with what it names, and one sentence that says what it means."""
    verdict, names = _get(d, "verdict"), listed([f.name for f in _get(d, "effects", ())])
    but = [m for m in _get(d, "messages", ()) if m.startswith(AGAINST_HELD)][:1]
    if verdict == "adequate":
        said = f"No missing effect was detected. {limits_in_words(d)}".rstrip()
        return "adequate", " But: ".join([said, *but])
    if verdict == "found":
        return f"found: {names}", _found(d)
    if verdict == "ambiguous":
        others = [c.name for f in _get(d, "effects", ()) for c in f.alternatives]
        alike = listed(list(dict.fromkeys(others))) or "others"
        return f"ambiguous: {names}?", AMBIGUOUS.format(names, alike)
    if verdict == "unexplained":
        some = f"{names} explain a part, but something more" if names else "Something"
        on = listed(_get(d, "depends_on", ()))
        which = f": the residual torque depends on {on}" if on else ""
        return "unexplained", " But: ".join([UNEXPLAINED.format(some, which), *but])
    if verdict == "refused":
        return "refused", _get(d, "reason") or "This record cannot answer the question."
    return "identified", "The declared model was fitted to the record; nothing was added."


def _found(d: Any) -> str:
    """What is missing, how large it is, and what it is worth on samples that no fit has seen."""
    effects = _get(d, "effects", ())
    what = "; ".join(_size(d, finding) for finding in effects)
    for error in (_get(d, "error", {}), _get(d, "torque_error", {})):
        before, after = error.get("refitted"), error.get("augmented")
        if before is not None and after is not None and after < before:
            factor, unit = readable((before, after), error["unit"])
            return (
                f"Missing from the model: {what}; with {'it' if len(effects) == 1 else 'them'} the "
                f"error of {error.get('signal', 'torque')} on held-out samples goes from "
                f"{number(factor * before, 3)} to {number(factor * after, 3)} {unit}."
            )
    return f"Missing from the model: {what}."


def _size(d: Any, finding: Any) -> str:
    """An effect with what says how large it is: torque_ripple, 10 per turn, 0.1 N m."""
    said = [finding.name]
    for key, e in finding.parameters.items():
        factor, unit = readable([e.value], e.unit)
        value = number(factor * e.value, 3)
        if key == "harmonic" and e.unit == "1/rev":
            said.insert(1, f"{e.value:.4g} per turn")
        elif key != "phase":
            said.append(f"{key.replace('_', ' ')} {value}{'' if unit == '1' else f' {unit}'}")
    parts = getattr(_get(d, "comparison"), "budget", ())
    rows = zip(terms(parts), parts, strict=True)
    share = next((percent(s.share) for term, s in rows if term == finding.name), None)
    return ", ".join(said if share is None else [*said, f"{share} of friction"])


_TITLES = {"found": "Missing effect", "unexplained": "Partial explanation"}


def sections(d: Any) -> list[Section]:
    """Everything below the headline, in reading order; parts without content are left out."""
    on, next_ = listed(_get(d, "depends_on", ())), _get(d, "experiment")
    parts = [budget(d)]
    parts += [_effect(d, finding) for finding in _get(d, "effects", ())]
    parts += [Section("Depends on", (f"The residual torque depends on {on}.",))] if on else []
    parts += [_table(d), limits(d)]
    if next_:
        parts.append(Section("What to record next", (_sentence(next_[0].upper() + next_[1:]),)))
    parts += [errors(d), compared(d), laws(d), _parameters(d)]
    parts += [plain(d), *bench_tables(d), _compensation(d), _record(d), _notes(d)]
    return [part for part in parts if part is not None]


def _effect(d: Any, finding: Any) -> Section:
    law, others = equation(finding.name), [c.name for c in finding.alternatives]
    others = [f"{name} ({equation(name)})" if equation(name) else name for name in others]
    same = "Explain it equally well" if _get(d, "verdict") == "ambiguous" else "Next best"
    footnote = f"{same}: {'; '.join(others)}." if others else ""
    rows = [(key, *with_interval(e), e.unit) for key, e in finding.parameters.items()]
    grid = Grid(("parameter", "value", "95 % interval", "unit"), "lrrl", tuple(rows))
    title = _TITLES.get(_get(d, "verdict"), "Best explanation")
    lines = (law,) if law else ()
    return Section(f"{title}: {finding.name}", lines, grid, footnote)


def _table(d: Any) -> Section | None:
    table = _get(d, "table")
    if table is None:
        return None
    said = f"{table.name}: not part of the model file; table.block() makes a block of it."
    return _as_shown("Residual torque as a table", table, (said,))


def _compensation(d: Any) -> Section | None:
    """Tracking error in simulation without compensation, before and after."""
    c = _get(d, "compensation")
    if c is None:
        return None
    lines = [f"{c.kind} loop. {COMPENSATED.format(f'the {c.observer}' if c.observer else 'no')}"]
    lines += [f"Not compensated: {name}; {why}." for name, why in c.left]
    return _as_shown("Compensation in simulation", c, (*lines, *map(_sentence, c.messages)))


def _as_shown(title: str, one: Any, lines: tuple[str, ...]) -> Section:
    """A result of its own in a report, with the rows that it shows itself with."""
    rows = [(row.name, row.text()) for row in one._rows() if row.name not in ("message", "more")]
    return Section(title, lines, Grid(("", ""), "ll", tuple(rows)))


def _sentence(text: str) -> str:
    return text if text.endswith((".", "!", "?")) else f"{text}."


SINGLE = (
    "The torque is that of single samples, and so is its noise. The budget has means over short "
    "windows, in which that noise is small."
)
FREE_RUN = (
    "Free run: simulated without restarts over the held-out part.",
    "* Simulated without restarts over the whole record. A part of it was fitted.",
)
ERROR_HEAD = ("RMS", "unit", "declared", "refitted", "augmented", "noise", "improved")
ON_MEANS = "Mean torque of the held-out runs minus the model's torque at their speed."
ON_SAMPLES = (
    "Measured minus simulated over {} held-out samples; the simulation is restarted every {:g} s. "
    "Improvement is relative to the refitted model."
)


def errors(d: Any) -> Section | None:
    error, free, torque = (_get(d, k) for k in ("error", "free_error", "torque_error"))
    means = bool(error) and error["signal"] == "u"  # of mean torques: nothing is simulated
    parts = [("torque" if means else f"{error['signal']}, restarted", error)] if error else []
    seen = bool(free) and bool(free.get("in_sample"))
    parts += [(f"{free['signal']}, free run{'*' * seen}", free)] if free and not means else []
    parts += [("torque", torque)] if torque and not means else []
    if not parts:
        return None
    grid = Grid(ERROR_HEAD, "llrrrrr", tuple(_error_row(d, *part) for part in parts))
    lines, notes = (ON_MEANS,) if means else (), []
    if error and not means:
        lines = (ON_SAMPLES.format(error["samples"], error["horizon"]),)
        shown = ("declared", "refitted", *(["augmented"] if _get(d, "effects", ()) else []))
        fit = {k: v for k, v in (error.get("fit") or {}).items() if k in shown and v is not None}
        # a share near 100 with the digits that tell it from 100
        digits = {k: 1 - math.floor(math.log10(max(100.0 - v, 1e-9))) for k, v in fit.items()}
        said = ", ".join(f"{k} {v:.{min(max(digits[k], 0), 4)}f} %" for k, v in fit.items())
        lines += (f"NRMSE fit of this motion: {said}.",) if said else ()
    notes += [FREE_RUN[seen]] if free and not means else []
    notes += [SINGLE] if torque and not means else []
    return Section(ERRORS, lines, grid, " ".join(notes))


def _error_row(d: Any, label: str, error: Mapping[str, Any]) -> tuple[str, ...]:
    """The errors, and how much smaller the augmented one is than the refitted one."""
    values = [error.get(k) for k in ("declared", "refitted", "augmented", "noise_floor")]
    factor, unit = readable(values, error["unit"])
    cells = [number(None if v is None else v * factor, 3) for v in values]
    _, before, after, _ = values
    better = NONE
    if before and after is not None and _get(d, "effects", ()) and math.isfinite(after / before):
        better = f"{100 * (1 - after / before):.0f} %"
    return label, unit, *cells, better


def readable(values: Iterable[float | None], unit: str) -> tuple[float, str]:
    """Factor and unit with a prefix (m, u) that bring small SI values near 1."""
    largest = max((abs(v) for v in values if v is not None and math.isfinite(v)), default=0.0)
    if unit not in _SMALL or largest >= 0.1 or largest == 0.0:
        return 1.0, unit
    return (1e3, f"m{unit}") if largest >= 1e-4 else (1e6, f"u{unit}")


def _parameters(d: Any) -> Section | None:
    shown = {f.name for f in _get(d, "effects", ())}
    declared = _get(d, "declared")
    before = declared.values() if declared else {}
    rows = [
        (key, number(before.get(key)), *with_interval(estimate), estimate.unit)
        for key, estimate in _get(d, "estimates", {}).items()
        if key.split(".")[0] not in shown
    ]
    if not rows:
        return None
    head = ("parameter", "declared", "fitted", "95 % interval", "unit")
    return Section("Fitted parameters", (), Grid(head, "lrrrl", tuple(rows)))


PLAIN = "Plain torque balance"


def plain(d: Any) -> Section | None:
    """The torque balance: what is certain alone, what is certain together, what is left."""
    balance = _get(d, "plain")
    if balance is None:
        return None
    rows = [(key, *with_interval(e), e.unit) for key, e in balance.parameters.items()]
    grid = Grid(("parameter", "value", "95 % interval", "unit"), "lrrl", tuple(rows))
    lines = [test.text for test in balance.bench_tests]
    if balance.left is not None:
        lines.append(f"It leaves {number(100.0 * balance.left, 2)} % of the RMS torque.")
    if _get(d, "verdict") == "unexplained":
        lines.append("What is missing from the model is missing here too, and biases these values.")
    elif not _get(d, "effects", ()):
        lines += [*map(_together, balance.combinations), *balance.why_not]
    lines += map(_sentence, _plain_notes(d))
    return Section(PLAIN, tuple(filter(None, lines)), grid if rows else None)


def bench_tables(d: Any) -> Iterator[Section]:
    for test in getattr(_get(d, "plain"), "bench_tests", ()):
        if test.table is not None:
            head, rows = test.table.columns, test.table.rows
            cells = (tuple(x if isinstance(x, str) else number(x) for x in row) for row in rows)
            title = f"Bench test: {test.kind.replace('_', ' ')}"
            yield Section(title, (), Grid(head, "r" * len(head), tuple(cells)))


def _plain_notes(d: Any) -> list[str]:
    """What the balance noticed, where nothing biases it and the headline has not said it."""
    balance = _get(d, "plain")
    if balance is None or _get(d, "effects", ()) or _get(d, "depends_on"):
        return []
    return [note for note in balance.notes if note != _get(d, "reason")]


def _together(one: Any) -> str:
    value, interval = with_interval(one)
    how = f" To separate them: {one.to_separate}." if one.to_separate else ""
    return f"Only together: {one.text} = {value} {one.unit} ({interval}).{how}"


def _record(d: Any) -> Section | None:
    first, model = _get(d, "record"), _get(d, "declared")
    runs = _get(d, "records", ()) or ((first,) if first is not None else ())
    names, lines = [record.source for record in runs], []
    if runs and _get(d, "map"):
        lines.append(f"{len(_get(d, 'map').w)} runs at steady speed: {listed(names)}.")
    elif runs:
        for name, record in zip(names[:LISTED], runs, strict=False):
            facts = record.summary()
            lines.append(
                f"{name}: {facts['samples']} samples at {facts['rate']:g} Hz, "
                f"{facts['duration']:g} s, {facts['dropped']} dropped."
            )
        more = names[LISTED:]
        lines += [f"{len(more)} more: {listed(more)}."] if more else []
    if model is not None:
        lines.append(f"Model: {model.name}, {model.motion}, {model.friction.block.name} friction.")
    return Section("Record and model", tuple(lines)) if lines else None


def _notes(d: Any) -> Section | None:
    above, first = {_get(d, "reason"), *_plain_notes(d)}, headline(d)[1]
    left = [m for m in _get(d, "messages", ()) if m not in above and m not in first]
    notes = tuple(f"- {_sentence(m)}" for m in left)
    return Section("Notes", notes) if notes else None


# ---- the comparison: torque budget, table of models, limits of detection ----------


def budget(d: Any) -> Section | None:
    """Where the torque goes: each term, as RMS and as a share of friction."""
    found = _get(d, "comparison")
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


def compared(d: Any) -> Section | None:
    found = _get(d, "comparison")
    if found is None or not found.rows:
        return None
    rows = []
    for row in found.rows[: ROWS + 1]:
        gain = (f"{row.elpd:,.0f}", f"{row.se:,.0f}", percent(row.torque))
        gain = ("0", "", "") if row.model == "declared" else gain
        rows.append((row.model, *gain, str(row.parameters)))
    head = ("model", "predicts better by", "+-", "torque", "parameters")
    lines = (
        "Each model predicts parts of the record that its fit has not seen. The gain is the "
        "logarithm of how much more probable it makes them than the declared model does.",
    )
    more = len(found.rows) - 1 - ROWS
    footnote = f"{more} more models gain less." if more > 0 else ""
    return Section("Comparison", lines, Grid(head, "lrrrr", tuple(rows)), footnote)


def laws(d: Any) -> Section | None:
    found = _get(d, "laws")
    if found is None:
        return None
    lines = (found.sentence, "Each law was fitted; the gain is of held-out samples.")
    reasons = " ".join(f"{row.name}: {row.reason}" for row in found if row.reason)
    return Section("Friction laws", lines, found.grid(), reasons)


def limits(d: Any) -> Section | None:
    """How small an effect this record would have shown; only where nothing is missing."""
    found = _get(d, "comparison")
    shown = [limit for limit in getattr(found, "detectable", ()) if limit.share > found.least]
    rows = [(x.name, percent(x.share) if x.share < 1.0 else "not in this record") for x in shown]
    grid = Grid(("effect", "seen from"), "lr", tuple(rows))
    return Section("What this record would show", (), grid) if rows else None


def limits_in_words(d: Any) -> str:
    """The limits below which most effects and waves over theta stay hidden; "" if none is known."""
    found = getattr(_get(d, "comparison"), "detectable", ())
    shares, finest = sorted(x.share for x in found), [x.finest for x in found if x.finest]
    most, said = shares[len(shares) // 2] if shares else 1.0, []
    if most < 1.0:
        said.append(f"Most effects would have shown from {percent(most)} of friction on.")
    if finest:
        per, rad = ("turn", 1.0) if motion_of(d) == "rotary" else ("m", 2.0 * math.pi)
        many = f"{min(finest) / rad:.0f} periods per {per}"
        said.append(f"Waves with more than {many} may stay hidden.")
    return " ".join(said)


def motion_of(d: Any) -> str:
    known = (getattr(d, name, None) for name in ("model", "declared", "record"))
    return next((x.motion for x in known if x is not None), "rotary")


def kind(term: str) -> str:
    return "friction" if term in OWN else "rest" if term in UNNAMED else "effect"


def terms(parts: Sequence[Any]) -> list[str]:
    """The terms in words; what is left beside an unknown torque is the rest of the unexplained."""
    left = "the rest" if any(s.term == UNKNOWN for s in parts) else "not explained"
    words = {"left": left, "noise": "of it sensor noise"}
    return [words.get(term, term) for term in (str(s.term) for s in parts)]


def percent(share: float) -> str:
    return f"{number(100.0 * share, 2)} %"


def _get(d: Any, name: str, default: Any = None) -> Any:
    """An attribute, or the default if it is absent or None (an identification has fewer)."""
    value = getattr(d, name, None)
    return default if value is None else value

"""What a diagnosis says, in words and tables: the content that text and HTML reports share."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ..display import NONE, Grid, number
from ..display import with_interval as _with_interval
from ..spec import members

_SMALL = {"rad": "rad", "m": "m", "rad/s": "rad/s", "m/s": "m/s", "N m": "N m", "N": "N"}


@dataclass(frozen=True)
class Section:
    """A titled part of a report: paragraphs, then a table, then a footnote."""

    title: str
    lines: tuple[str, ...] = ()
    grid: Grid | None = None
    footnote: str = ""
    formula: bool = False


def equation(name: str) -> str:
    """The equation of a registered block, without its full stop; empty when unknown."""
    known = members("effect").get(name)
    return known.equation.rstrip(".") if known else ""


def listed(names: Sequence[str]) -> str:
    """ "a", "a and b", "a, b and c"."""
    return " and ".join(filter(None, (", ".join(names[:-1]), *names[-1:])))


def headline(d: Any) -> tuple[str, str]:
    """The verdict with what it names, and one sentence that says what it means."""
    verdict, names = _get(d, "verdict"), listed([f.name for f in _get(d, "effects", ())])
    if verdict == "adequate":
        return "adequate", "The record proves nothing that the model lacks."
    if verdict == "found":
        return f"found: {names}", f"The model lacks {names}; the record proves it."
    if verdict == "ambiguous":
        return f"ambiguous: {names}?", (
            f"The record proves that something is missing, but not what: {names} {_verb(names)} it "
            "best, and others explain it as well."
        )
    if verdict == "unexplained":
        return "unexplained", _unexplained(", ".join(_get(d, "depends_on", ())), names)
    if verdict == "refused":
        return "refused", _get(d, "reason") or "The record cannot answer."
    return "identified", "The declared model was fitted to the record; nothing was added."


def _unexplained(on: str, names: str) -> str:
    more = (
        f"{names} {_verb(names)} a part, but more is missing" if names else "something is missing"
    )
    which = f", which hangs on {on}" if on else ""
    return f"The record proves it: {more}{which}. Nothing in the catalogue explains it."


def _verb(names: str) -> str:
    return "explain" if " and " in names else "explains"


_TITLES = {"found": "Missing", "unexplained": "Explains a part"}


def sections(d: Any) -> list[Section]:
    """Everything below the headline, in reading order; parts without content are left out."""
    parts = [_effect(d, finding) for finding in _get(d, "effects", ())]
    parts += [_depends(d), _table(d), _experiment(d), errors(d), _parameters(d)]
    parts += [_compensation(d), _record(d), _notes(d)]
    return [part for part in parts if part is not None]


def _effect(d: Any, finding: Any) -> Section:
    lines = [equation(finding.name)] if equation(finding.name) else []
    others = [_alternative(c.name) for c in finding.alternatives]
    footnote = ""
    if others:
        same = _get(d, "verdict") == "ambiguous"
        footnote = "Explain it as well: " if same else "Next best: "
        footnote += "; ".join(others) + "."
    rows = [
        (key, *_with_interval(estimate), estimate.unit)
        for key, estimate in finding.parameters.items()
    ]
    grid = Grid(("parameter", "value", "95 % interval", "unit"), "lrrl", tuple(rows))
    title = _TITLES.get(_get(d, "verdict"), "Best explanation")
    return Section(f"{title}: {finding.name}", tuple(lines), grid, footnote, formula=True)


def _alternative(name: str) -> str:
    return f"{name} ({equation(name)})" if equation(name) else name


def _depends(d: Any) -> Section | None:
    on = ", ".join(_get(d, "depends_on", ()))
    return Section("What it hangs on", (f"The residual torque hangs on {on}.",)) if on else None


def _table(d: Any) -> Section | None:
    """What a table of the unexplained torque is worth."""
    table = _get(d, "table")
    if table is None:
        return None
    low, high = (100.0 * share for share in table.share95)
    (factor, unit) = readable([table.rms], table.unit)
    lines = (
        f"{table.name[0].upper()}{table.name[1:]}: {table.values.size} values, "
        f"{number(table.rms * factor, 3)} {unit} RMS along the record.",
        f"It explains {100.0 * table.share:.0f} % of the residual torque's power on windows that "
        f"it was not fitted to (95 % interval {low:.0f} to {high:.0f} %).",
        "It is no part of the model file; table.block() puts it into a loop.",
    )
    return Section("Unexplained, as a table", lines)


def _compensation(d: Any) -> Section | None:
    """Tracking error in simulation without compensation, before and after."""
    c = _get(d, "compensation")
    if c is None:
        return None
    errors = (c.none, c.before, c.after)
    factor, unit = readable(errors, c.unit)
    row = (f"{c.kind} loop", unit, *(number(e * factor, 3) for e in errors))
    grid = Grid(("RMS tracking error", "unit", "none", "before", "after"), "llrrr", (row,))
    watcher = f"the {c.observer} observer" if c.observer else "no observer"
    lines = [
        f"Simulated on the augmented model: {watcher}, with what the declared model (before) and "
        "the augmented model (after) know.",
    ]
    if c.compensated:
        lines.append(f"Fed forward as a torque: {', '.join(c.compensated)}.")
    lines += [f"Not compensated: {name}; {why}." for name, why in c.left]
    lines += [_sentence(m) for m in c.messages]
    certificate = c.certificate
    footnote = ""
    if certificate is not None and certificate.rate:
        footnote = f"Observer errors decay at {number(certificate.rate, 3)} 1/s at least."
    return Section("Compensation, in simulation", tuple(lines), grid, footnote)


def _experiment(d: Any) -> Section | None:
    text = _get(d, "experiment")
    return (
        Section("What to record next", (_sentence(text[0].upper() + text[1:]),)) if text else None
    )


def _sentence(text: str) -> str:
    return text if text.endswith((".", "!", "?")) else f"{text}."


def errors(d: Any) -> Section | None:
    """The before/after table: declared, refitted, augmented, noise floor."""
    error, free, torque = (_get(d, k) for k in ("error", "free_error", "torque_error"))
    rows, footnote = [], ""
    if error and error["signal"] == "u":  # of mean torques: there is nothing to simulate
        rows.append(_error_row(d, "torque", error))
        free = torque = None
    elif error:
        rows.append(_error_row(d, f"{error['signal']}, restarted", error))
    if free:
        star = "*" if free.get("in_sample") else ""
        rows.append(_error_row(d, f"{free['signal']}, free run{star}", free))
        footnote = "Free run: without restarts, over the held-out part."
        if star:
            footnote = (
                "* Without restarts, over the whole record, of which the fit has seen a part."
            )
    if torque:
        rows.append(_error_row(d, "torque", torque))
    if not rows:
        return None
    head = ("RMS", "unit", "declared", "refitted", "augmented", "noise", "improved")
    grid = Grid(head, "llrrrrr", tuple(rows))
    return Section("Error before and after", _scope(error), grid, footnote)


def _scope(error: Mapping[str, Any] | None) -> tuple[str, ...]:
    if not error:
        return ()
    if error["signal"] == "u":
        what = "Mean torque of the runs held out, minus the model's at their speed"
    else:
        what = (
            f"Measured minus simulated over {error['samples']} held-out samples; the simulation "
            f"is restarted every {error['horizon']:g} s"
        )
    return (f"{what}. Improvement is counted against the refitted model.",)


def _error_row(d: Any, label: str, error: Mapping[str, Any]) -> tuple[str, ...]:
    keys = ("declared", "refitted", "augmented", "noise_floor")
    factor, unit = readable([error.get(k) for k in keys], error["unit"])
    cells = [number(_times(error.get(k), factor), 3) for k in keys]
    return label, unit, *cells, improvement(d, error)


def _times(value: float | None, factor: float) -> float | None:
    return None if value is None else value * factor


def improvement(d: Any, error: Mapping[str, Any]) -> str:
    """How much smaller the augmented error is than the refitted one; '-' if nothing was added."""
    before, after = error.get("refitted"), error.get("augmented")
    if not before or after is None or not _get(d, "effects", ()):
        return NONE
    return f"{100 * (1 - after / before):.0f} %" if math.isfinite(after / before) else NONE


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
        (key, number(before.get(key)), *_with_interval(estimate), estimate.unit)
        for key, estimate in _get(d, "estimates", {}).items()
        if key.split(".")[0] not in shown
    ]
    if not rows:
        return None
    head = ("parameter", "declared", "fitted", "95 % interval", "unit")
    return Section("Fitted parameters", (), Grid(head, "lrrrl", tuple(rows)))


def _record(d: Any) -> Section | None:
    record, model = _get(d, "record"), _get(d, "declared")
    lines = []
    if record is not None and _get(d, "map"):
        lines.append(f"{len(_get(d, 'map').w)} runs at steady speed, {record.source} among them.")
    elif record is not None:
        facts = record.summary()
        lines.append(
            f"{record.source}: {facts['samples']} samples at {facts['rate']:g} Hz, "
            f"{facts['duration']:g} s, {facts['dropped']} dropped."
        )
    if model is not None:
        lines.append(f"Model: {model.name}, {model.motion}, {model.friction.block.name} friction.")
    return Section("Record and model", tuple(lines)) if lines else None


def _notes(d: Any) -> Section | None:
    notes = tuple(f"- {_sentence(m)}" for m in _get(d, "messages", ()))
    return Section("Notes", notes) if notes else None


def _get(d: Any, name: str, default: Any = None) -> Any:
    """An attribute, or the default where it is absent or None (an identification has fewer)."""
    value = getattr(d, name, None)
    return default if value is None else value

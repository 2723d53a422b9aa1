"""What a diagnosis says, in words and tables: the content that text and HTML reports share."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from ..blocks.block import members
from ..blocks.model import model_toml
from ..core.display import NONE, Grid, between, number, to_interval, with_interval
from ..estimates.findings import AGAINST_HELD, Estimate
from . import comparison_section
from .page import Section

LISTED = 8  # runs with a line each; of more, the names
ERRORS = "Error before and after"
UNITS = {"theta": "rad", "w": "rad/s", "u": "N m", "t": "s"}  # of signals of a rotary drive
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
    return f"std {number((e.ci95[1] - e.ci95[0]) / 3.92, 2)}"


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
    but = [m for m in _get(d, "messages", ()) if m.startswith(AGAINST_HELD)][:1]
    if verdict == "adequate":
        said = f"No missing effect was detected.{comparison_section.limits_in_words(d)}"
        return "adequate", " But: ".join([said, *but])
    if verdict == "found":
        return f"found: {names}", _found(d)
    if verdict == "ambiguous":
        return f"ambiguous: {names}?", _ambiguous(_get(d, "effects", ()), names)
    if verdict == "unexplained":
        said = _unexplained(listed(_get(d, "depends_on", ())), names)
        return "unexplained", " But: ".join([said, *but])
    if verdict == "refused":
        return "refused", _get(d, "reason") or "This record cannot answer the question."
    return "identified", "The declared model was fitted to the record; nothing was added."


def _found(d: Any) -> str:
    """What is missing, how large it is, and what it is worth on samples that no fit has seen."""
    effects = _get(d, "effects", ())
    what = "; ".join(_size(d, finding) for finding in effects)
    them = "it" if len(effects) == 1 else "them"
    error = next(filter(_falls, (_get(d, "error"), _get(d, "torque_error"))), None)
    if error is None:
        return f"Missing from the model: {what}."
    ends = (error["refitted"], error["augmented"])
    factor, unit = readable(ends, error["unit"])
    before, after = (number(factor * x, 3) for x in ends)
    return (
        f"Missing from the model: {what}; with {them} the error of {error.get('signal', 'torque')} "
        f"on held-out samples goes from {before} to {after} {unit}."
    )


def _falls(error: Mapping[str, Any] | None) -> bool:
    """Whether an error is smaller with the effects than without."""
    if not error or error.get("augmented") is None or error.get("refitted") is None:
        return False
    return error["augmented"] < error["refitted"]


def _size(d: Any, finding: Any) -> str:
    """An effect with what says how large it is: torque_ripple, 10 per turn, 0.1 N m."""
    said = [finding.name]
    for key, e in finding.parameters.items():
        factor, unit = readable([e.value], e.unit)
        low, high = e.ci95 or (0.0, 0.0)
        value = to_interval(factor * e.value, factor * (high - low), 3)
        if key == "harmonic" and e.unit == "1/rev":
            said.insert(1, f"{e.value:.4g} per turn")
        elif key != "phase":
            said.append(f"{key.replace('_', ' ')} {value}{'' if unit == '1' else f' {unit}'}")
    share = comparison_section.share_of(d, finding.name)
    return ", ".join(said if share is None else [*said, f"{share} of friction"])


def _ambiguous(effects: Sequence[Any], names: str) -> str:
    start = "Something is missing from the model, but this record cannot decide what"
    ties = [(f.name, [c.name for c in f.alternatives]) for f in effects if f.alternatives]
    if len(effects) == len(ties) == 1:
        name, others = ties[0]
        return f"{start}: {listed([name, *others])} explain it equally well."
    same = [f"{listed(others)} {_verb(listed(others))} the same as {name}" for name, others in ties]
    same = same or ["others explain it equally well"]
    return f"{start}: {names} {_verb(names)} it best, but {listed(same)}."


def _unexplained(on: str, names: str) -> str:
    some = f"{names} {_verb(names)} a part, but something more is missing"
    which = f": the residual torque depends on {on}" if on else ""
    return (
        f"{some if names else 'Something is missing'}{which}, and no effect in the catalogue "
        "explains it."
    )


def _verb(names: str) -> str:
    return _plural(names, "explains", "explain")


def _plural(names: str, one: str, several: str) -> str:
    return several if " and " in names else one


_TITLES = {"found": "Missing effect", "unexplained": "Partial explanation"}


def sections(d: Any) -> list[Section]:
    """Everything below the headline, in reading order; parts without content are left out."""
    parts = [comparison_section.budget(d)]
    parts += [_effect(d, finding) for finding in _get(d, "effects", ())]
    parts += [_depends(d), _table(d), comparison_section.limits(d), _experiment(d), errors(d)]
    parts += [comparison_section.table(d), comparison_section.laws(d), _parameters(d), plain(d)]
    parts += bench_tables(d)
    parts += [_compensation(d), _record(d), _notes(d)]
    return [part for part in parts if part is not None]


def _effect(d: Any, finding: Any) -> Section:
    lines = [equation(finding.name)] if equation(finding.name) else []
    others = [_alternative(c.name) for c in finding.alternatives]
    footnote = ""
    if others:
        same = _get(d, "verdict") == "ambiguous"
        footnote = "Explain it equally well: " if same else "Next best: "
        footnote += "; ".join(others) + "."
    rows = [
        (key, *with_interval(estimate), estimate.unit)
        for key, estimate in finding.parameters.items()
    ]
    grid = Grid(("parameter", "value", "95 % interval", "unit"), "lrrl", tuple(rows))
    title = _TITLES.get(_get(d, "verdict"), "Best explanation")
    return Section(f"{title}: {finding.name}", tuple(lines), grid, footnote, formula=True)


def _alternative(name: str) -> str:
    return f"{name} ({equation(name)})" if equation(name) else name


def _depends(d: Any) -> Section | None:
    on = listed(_get(d, "depends_on", ()))
    return Section("Depends on", (f"The residual torque depends on {on}.",)) if on else None


def _table(d: Any) -> Section | None:
    """The table of the unexplained torque, and how well it predicts."""
    table = _get(d, "table")
    if table is None:
        return None
    (factor, unit) = readable([table.rms], table.unit)
    lines = (
        f"{table.name[0].upper()}{table.name[1:]}: {table.values.size} values, "
        f"{number(table.rms * factor, 3)} {unit} RMS along the record.",
        f"It explains {100.0 * table.share:.0f} % of the residual torque's power on windows that "
        f"it was not fitted to (95 % interval {between([100.0 * x for x in table.share95])} %).",
        "The table is not part of the model file. table.block() turns it into a block for a "
        "control loop.",
    )
    return Section("Residual torque as a table", lines)


def _compensation(d: Any) -> Section | None:
    """Tracking error in simulation without compensation, before and after."""
    c = _get(d, "compensation")
    if c is None:
        return None
    errors = (c.none, c.before, c.after)
    factor, unit = readable(errors, c.unit)
    rows = ((f"{c.kind} loop", unit, *(number(e * factor, 3) for e in errors)),)
    rows += _on_drives(c.drive, factor, unit) if c.drive else ()
    grid = Grid(("RMS tracking error", "unit", "none", "before", "after"), "llrrr", rows)
    watcher = f"the {c.observer} observer" if c.observer else "no observer"
    lines = [
        "Simulated with the augmented model as the drive. The compensation uses "
        f"{watcher} and the declared model (before) or the augmented model (after).",
    ]
    lines += [_drives(c.drive)] if c.drive else []
    if c.compensated:
        lines.append(f"Fed forward as a torque: {', '.join(c.compensated)}.")
    lines += [f"Not compensated: {name}; {why}." for name, why in c.left]
    lines += [_sentence(m) for m in c.messages]
    certificate = c.certificate
    footnote = ""
    if certificate is not None and certificate.rate:
        footnote = f"Observer errors decay at a rate of at least {number(certificate.rate, 3)} 1/s."
    return Section("Compensation in simulation", tuple(lines), grid, footnote)


def _on_drives(drive: Any, factor: float, unit: str) -> tuple[tuple[str, ...], ...]:
    """Rows with the median and the spread of the errors."""
    found = [[number(e * factor, 3) for e in drive.of(key)] for key in ("none", "before", "after")]
    many = len(drive.errors["none"])
    middle = ("on drives, median" if many > 1 else "on a drive", unit, *(m for m, _, _ in found))
    ends = ("10 to 90 %", "", *(f"{low}..{high}" for _, low, high in found))
    return (middle, ends) if many > 1 else (middle,)


def _drives(drive: Any) -> str:
    """What the drives of the spread are, in a sentence."""
    noise = drive.noise
    parts = [f"control sampled at {number(drive.rate, 4)} Hz"]
    parts += [f"encoder steps of {number(drive.resolution, 3)}"] if drive.resolution else []
    parts += [
        f"noise of {number(noise[key], 2)} in {name}"
        for key, name in (("theta", "position"), ("w", "speed"), ("u", "torque"))
        if noise[key] > 0
    ]
    many = len(drive.errors["none"])
    drawn = (
        f"parameters drawn {many} times from their joint covariance, while the compensation "
        "believes the estimate"
        if drive.drawn
        else "parameters as estimated"
    )
    return f"On drives like the recorded one (SI units): {', '.join(parts)}; {drawn}."


def _experiment(d: Any) -> Section | None:
    text = _get(d, "experiment")
    return (
        Section("What to record next", (_sentence(text[0].upper() + text[1:]),)) if text else None
    )


def _sentence(text: str) -> str:
    return text if text.endswith((".", "!", "?")) else f"{text}."


SINGLE = (
    "The torque is that of single samples, and so is its noise. The budget has means over short "
    "windows, in which that noise is small."
)


FIT = "NRMSE fit of this motion: {}."
RELATIVE = "Improvement is relative to the refitted model."


def errors(d: Any) -> Section | None:
    """The before/after table: declared, refitted, augmented, noise floor."""
    error, free, torque = (_get(d, k) for k in ("error", "free_error", "torque_error"))
    rows, footnote = [], ""
    if error and error["signal"] == "u":  # an error of mean torques: nothing is simulated
        rows.append(_error_row(d, "torque", error))
        free = torque = None
    elif error:
        rows.append(_error_row(d, f"{error['signal']}, restarted", error))
    if free:
        star = "*" if free.get("in_sample") else ""
        rows.append(_error_row(d, f"{free['signal']}, free run{star}", free))
        footnote = "Free run: simulated without restarts over the held-out part."
        if star:
            footnote = (
                "* Simulated without restarts over the whole record. A part of it was fitted."
            )
    if torque:
        rows.append(_error_row(d, "torque", torque))
        footnote = f"{footnote} {SINGLE}".strip()
    if not rows:
        return None
    head = ("RMS", "unit", "declared", "refitted", "augmented", "noise", "improved")
    grid = Grid(head, "llrrrrr", tuple(rows))
    lines = _scope(d, error)
    if all(row[head.index("augmented")] == number(None, 3) for row in rows):  # an identification
        return Section(ERRORS, lines, _fitted_only(grid), footnote)
    lines = (f"{lines[0]} {RELATIVE}", *lines[1:]) if lines else ()
    return Section(ERRORS, lines, grid, footnote)


def _fitted_only(grid: Grid) -> Grid:
    """The errors without those of a model to which something was added."""
    keep = [i for i, name in enumerate(grid.head) if name not in ("augmented", "improved")]
    head, *rows = (tuple(row[i] for i in keep) for row in (grid.head, *grid.rows))
    return Grid(head, "".join(grid.align[i] for i in keep), tuple(rows))


def _scope(d: Any, error: Mapping[str, Any] | None) -> tuple[str, ...]:
    if not error:
        return ()
    if error["signal"] == "u":
        what = "Mean torque of the held-out runs minus the model's torque at their speed"
    else:
        what = (
            f"Measured minus simulated over {error['samples']} held-out samples; the simulation "
            f"is restarted every {error['horizon']:g} s"
        )
    shown = ("declared", "refitted", *(["augmented"] if _get(d, "effects", ()) else []))
    fit = {k: v for k, v in (error.get("fit") or {}).items() if k in shown and v is not None}
    said = ", ".join(f"{k} {_percent(v)} %" for k, v in fit.items())
    return (f"{what}.", *([FIT.format(said)] if said else []))


def _percent(fit: float) -> str:
    """A share near 100 with the digits that tell it from 100."""
    return f"{fit:.{min(max(1 - math.floor(math.log10(max(100.0 - fit, 1e-9))), 0), 4)}f}"


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
    found = balance.summary()
    rows = []
    for key, one in found["parameters"].items():
        estimate = Estimate(one["value"], one["unit"], one["ci95"])
        rows.append((key, *with_interval(estimate), one["unit"]))
    grid = Grid(("parameter", "value", "95 % interval", "unit"), "lrrl", tuple(rows))
    lines = [*(test.text for test in balance.bench_tests), _left(found["left"])]
    if _get(d, "verdict") == "unexplained":
        lines.append("What is missing from the model is missing here too, and biases these values.")
    elif not _get(d, "effects", ()):
        lines += [*map(_together, found["combinations"]), *balance.why_not]
    lines += map(_sentence, _plain_notes(d))
    return Section(PLAIN, tuple(filter(None, lines)), grid if rows else None)


def bench_tables(d: Any) -> list[Section]:
    """The tables of the bench tests: friction over angle or speed, one row for each breakaway."""
    tests = getattr(_get(d, "plain"), "bench_tests", ())
    tables = [(test.kind.replace("_", " "), test.table) for test in tests if test.table is not None]
    return [
        Section(
            f"Bench test: {kind}", (), Grid(table.columns, "r" * len(table.columns), _cells(table))
        )
        for kind, table in tables
    ]


def _cells(table: Any) -> tuple[tuple[str, ...], ...]:
    return tuple(tuple(x if isinstance(x, str) else number(x) for x in row) for row in table.rows)


def _plain_notes(d: Any) -> list[str]:
    """What the balance noticed, where nothing is known to bias it; the headline may have said it.

    Where something is missing, it biases what the balance noticed as well.
    """
    balance = _get(d, "plain")
    if balance is None or _get(d, "effects", ()) or _get(d, "depends_on"):
        return []
    return [note for note in balance.notes if note != _get(d, "reason")]


def _left(share: float | None) -> str:
    if share is None:
        return ""
    return f"It leaves {number(100.0 * share, 2)} % of the RMS torque."


def _together(one: Mapping[str, Any]) -> str:
    value, interval = with_interval(Estimate(one["value"], one["unit"], one["ci95"]))
    how = f" To separate them: {one['to_separate']}." if one["to_separate"] else ""
    return f"Only together: {one['text']} = {value} {one['unit']} ({interval}).{how}"


def _record(d: Any) -> Section | None:
    first, model = _get(d, "record"), _get(d, "declared")
    runs = _get(d, "records", ()) or ((first,) if first is not None else ())
    lines = []
    if runs and _get(d, "map"):
        lines.append(f"{len(_get(d, 'map').w)} runs at steady speed: {_names(runs)}.")
    elif runs:
        lines += map(_run, runs[:LISTED])
        more = runs[LISTED:]
        lines += [f"{len(more)} more: {_names(more)}."] if more else []
    if model is not None:
        lines.append(f"Model: {model.name}, {model.motion}, {model.friction.block.name} friction.")
    return Section("Record and model", tuple(lines)) if lines else None


def _run(record: Any) -> str:
    facts = record.summary()
    return (
        f"{record.source}: {facts['samples']} samples at {facts['rate']:g} Hz, "
        f"{facts['duration']:g} s, {facts['dropped']} dropped."
    )


def _names(records: Sequence[Any]) -> str:
    return listed([record.source for record in records])


def _notes(d: Any) -> Section | None:
    above, first = {_get(d, "reason"), *_plain_notes(d)}, headline(d)[1]
    left = [m for m in _get(d, "messages", ()) if m not in above and m not in first]
    notes = tuple(f"- {_sentence(m)}" for m in left)
    return Section("Notes", notes) if notes else None


def _get(d: Any, name: str, default: Any = None) -> Any:
    """An attribute, or the default if it is absent or None (an identification has fewer)."""
    value = getattr(d, name, None)
    return default if value is None else value

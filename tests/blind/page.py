"""The results as text for a terminal."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from . import score
from .score import Line

KINDS = {"effect": "one effect", "pair": "two effects", "none": "nothing missing",
         "stranger": "outside the catalogue"}  # fmt: skip

FAINT = 0.02  # of the friction: less than that is left of an effect by a refit without it


def share(part: float, total: int) -> str:
    return f"{100.0 * part / total:.1f} % of {total}" if total else "no record"


def figures(lines: Sequence[Line]) -> dict[str, str]:
    """Every headline figure, by what it is."""
    lines = score.usable(lines)
    of = {kind: [x for x in lines if x["kind"] == kind] for kind in KINDS}
    made: dict[str, str] = {}
    for strength in dict.fromkeys(x["strength"] for x in of["effect"]):
        some = [x for x in of["effect"] if x["strength"] == strength]
        made[f"named right, {strength} strength"] = share(sum(map(score.credit, some)), len(some))
        hidden = [x for x in some if score.visible(x) < FAINT]
        if hidden:
            made[f"named right, {strength} strength, where a refit hides it"] = share(
                sum(map(score.credit, hidden)), len(hidden)
            )
    pairs, none, strange = of["pair"], of["none"], of["stranger"]
    if pairs:
        made["two effects, exactly those named"] = share(
            sum(score.credit(x) == 1.0 for x in pairs), len(pairs)
        )
        made["two effects, both among the named"] = share(sum(map(score.both, pairs)), len(pairs))
    if none:
        made["nothing missing, called adequate"] = _adequate(none)
    if strange:
        first, every = np.array([score.signals(x) for x in strange]).sum(0)
        made["outside the catalogue, unexplained with the right signal first"] = share(
            first, len(strange)
        )
        made["outside the catalogue, unexplained and no wrong signal"] = share(every, len(strange))
    return {**made, **_estimates(of["effect"] + pairs), **_errors(of["effect"] + pairs),
            **_effort(lines)}  # fmt: skip


def _adequate(none: Sequence[Line]) -> str:
    false = sum(score.verdict(x) in ("found", "ambiguous", "unexplained") for x in none)
    right = sum(score.verdict(x) == "adequate" for x in none)
    limit = 100.0 * score.at_most(false, len(none))
    return f"{share(right, len(none))}; {false} false alarms (95 %: at most {limit:.1f} %)"


def _estimates(lines: Sequence[Line]) -> dict[str, str]:
    every = [p for x in lines for p in score.parameters(x)]
    graded = [p for p in every if not p.counted]
    if not graded:
        return {}
    told = [p.covered for p in graded if p.covered is not None]
    made = {
        "parameter error, median": f"{100.0 * score.median(p.error for p in graded):.3g} %",
        "95 % intervals that cover": f"{share(sum(told), len(told))}, "
        f"{len(graded) - len(told)} without an interval",
    }
    counts = [p.error == 0.0 for p in every if p.counted]
    return made | ({"harmonics and sides exact": share(sum(counts), len(counts))} if counts else {})


def _errors(lines: Sequence[Line]) -> dict[str, str]:
    named = [x for x in lines if score.credit(x) == 1.0]
    made = {}
    for over, words in {
        "exact": "held-out error over the true model's, median",
        "floor": "held-out error over the simulator's from the true state, median",
        "noise": "held-out error over sensor noise, median",
        "refitted": "held-out error over the refitted model's, median",
    }.items():
        known = [r for x in named if (r := score.ratio(x, over)) is not None]
        if known:
            made[words] = f"{np.median(known):.3g} ({len(known)} records)"
    beaten = [r < 1.0 for x in named if (r := score.ratio(x, "trees")) is not None]
    if beaten:
        made["below boosted trees"] = share(sum(beaten), len(beaten))
    return made


def _effort(lines: Sequence[Line]) -> dict[str, str]:
    made = {}
    for key, words in {"cpu": "CPU", "wall": "wall"}.items():
        known = [x[key] for x in lines if key in x]
        if known:
            worst = f"95 % within {np.quantile(known, 0.95):.1f} s, worst {max(known):.1f} s"
            made[f"{words} time per record, median"] = f"{np.median(known):.1f} s, {worst}"
    return made


def text(lines: Sequence[Line]) -> str:
    """Everything, for a terminal."""
    kept = score.usable(lines)
    parts = [f"{len(lines)} records, {len(lines) - len(kept)} unfit and left out", ""]
    parts += [f"{what}: {value}" for what, value in figures(lines).items()]
    parts += ["", "what each was called"]
    for (kind, strength), some in _groups(kept).items():
        parts += [f"  {KINDS[kind]}, {strength}"]
        parts += [_row(truth, calls) for truth, calls in score.confusion(some).items()]
    parts += ["", *_by_effect(kept), *_by_difficulty(kept), *_failures(lines)]
    return "\n".join(parts)


def _groups(lines: Sequence[Line]) -> dict[tuple[str, str], list[Line]]:
    groups: dict[tuple[str, str], list[Line]] = {}
    for x in lines:
        groups.setdefault((x["kind"], x["strength"]), []).append(x)
    return groups


def _row(truth: str, calls) -> str:
    return f"    {truth}: " + ", ".join(f"{name} {n}" for name, n in calls.most_common())


def _by_effect(lines: Sequence[Line]) -> list[str]:
    """Named right, median error, coverage, error ratio and what is left visible, by effect."""
    groups: dict[str, list[Line]] = {}
    for x in lines:
        if x["kind"] == "effect":
            groups.setdefault(x["names"][0], []).append(x)
    rows = ["by effect: named right, parameter error, cover, over true model, visible share"]
    for name, some in groups.items():
        every = [p for x in some for p in score.parameters(x) if not p.counted]
        told = [p.covered for p in every if p.covered is not None]
        seen = score.median(map(score.visible, some))
        rows.append(
            f"    {name}: {sum(map(score.credit, some)):g}/{len(some)}, "
            f"{100.0 * score.median(p.error for p in every):.2g} %, {sum(told)}/{len(told)}, "
            f"{score.median(score.ratio(x, 'exact') for x in some):.3g}, {seen:.3f}"
        )
    return rows if groups else []


def _by_difficulty(lines: Sequence[Line]) -> list[str]:
    groups: dict[str, list[float]] = {}
    for x in lines:
        kind = (x.get("truth") or {}).get("hard")
        if kind and x["kind"] in ("effect", "none"):
            right = score.credit(x) if x["names"] else float(score.verdict(x) == "adequate")
            groups.setdefault(kind, []).append(right)
    rows = [f"    {kind}: {sum(r):g}/{len(r)}" for kind, r in sorted(groups.items())]
    return ["", "hard records called right", *rows] if rows else []


def _failures(lines: Sequence[Line]) -> list[str]:
    rows = []
    for x in lines:
        if "crash" in x:
            rows.append(f"    {x['key']}: crash: {x['crash'].strip().splitlines()[-1]}")
        elif x["answer"]["verdict"] == "refused":
            rows.append(f"    {x['key']}: refused: {x['answer']['reason']}")
    return ["", "no answer", *rows] if rows else []

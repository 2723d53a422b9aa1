"""The results as text for a terminal."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence

import numpy as np

from . import front, score
from .score import Line


def text(lines: Sequence[Line]) -> str:
    """The figures of README, how long it took, and what each record was called."""
    kept = score.usable(lines)
    parts = [f"{len(lines)} records, {len(lines) - len(kept)} unfit and left out", ""]
    parts += [f"{what}: {value}" for what, value in front.rows(kept)]
    cpu = [x["cpu"] for x in kept if "cpu" in x]
    if cpu:
        parts.append(f"CPU time: {np.median(cpu):.1f} s median, {max(cpu):.1f} s worst")
    for (kind, strength), some in _grouped(kept, lambda x: (x["kind"], x["strength"])).items():
        parts += ["", f"what each was called: {kind}, {strength}"]
        for truth, own in _grouped(some, lambda x: " + ".join(x["names"]) or "none").items():
            calls = Counter(map(front.called, own)).most_common()
            parts.append(f"    {truth}: " + ", ".join(f"{what} {n}" for what, n in calls))
    parts += ["", "by effect: named right, parameter error, cover, visible share"]
    one = [x for x in kept if x["kind"] == "effect"]
    parts += [_effect(*of) for of in _grouped(one, lambda x: x["names"][0]).items()]
    parts += ["", "hard records called right"]
    hard = [x for x in kept if (x.get("truth") or {}).get("hard")]
    for kind, some in sorted(_grouped(hard, lambda x: x["truth"]["hard"]).items()):
        parts.append(f"    {kind}: {front.counted(sum(map(front.is_right, some)), len(some))}")
    return "\n".join(parts)


def _grouped(lines: Sequence[Line], by: Callable) -> dict:
    groups: dict = {}
    for x in lines:
        groups.setdefault(by(x), []).append(x)
    return groups


def _effect(name: str, some: Sequence[Line]) -> str:
    every = [p for x in some for p in score.parameters(x) if not p.counted]
    known = [p.covered for p in every if p.covered is not None]
    return (
        f"    {name}: {sum(map(score.credit, some)):g}/{len(some)}, "
        f"{100.0 * score.median(p.error for p in every):.2g} %, {sum(known)}/{len(known)}, "
        f"{score.median(map(score.visible, some)):.3f}"
    )

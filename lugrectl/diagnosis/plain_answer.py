"""The plain answer: the torque balance of a log as it was recorded, beside every finer answer."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace

from ..bench_tests import bench_tests
from ..blocks.block import P
from ..blocks.model import Model
from ..estimates.findings import Estimate
from ..identification.balance import Balance, balance, unlike
from ..identification.balance.result import LEVELS, Combination
from ..identification.likelihood.initial_values import lifted
from ..record import Log, Stretch, stretches
from .held_values import against_stated
from .one_direction import LOAD, WAY, moves_one_way, of_runs, without_other_way
from .other_law import of_its_law
from .swapped_channels import swapped

TAKEN = "{} is taken as declared, {:.6g} {}: this log does not determine it alone."

OTHERS = "The plain answer is that of the other runs."


def plain_answer(logs: Sequence[Log], model: Model) -> Balance:
    """The balance of runs of one drive, with what was noticed when the logs were read.

    Values that the model holds are known. So is a declared value that the log does not determine
    alone: with Fc declared, one direction is enough for the rest. A run in another unit or sign
    than the others is left out.
    """
    parts, noticed = stretches(logs)
    runs = unlike(parts, model, [log.source for log in logs])
    parts = [part for part in parts if part.run not in runs.left_out]
    noticed = [*runs.said, *([OTHERS] if runs.said else []), *runs.notes, *noticed]
    fixed = {k: v for k, v in model.known().items() if k in model.held()}
    found = balance(parts, model, fixed)
    if said := swapped(parts, model, fixed, found):
        notes = [note for note in found.notes if note != found.refused]
        found = replace(found, notes=tuple(notes), refused=found.refused and said)
        noticed = [said, *noticed]
    against = against_stated(parts, model, found)
    if against is not None:
        found = against.free if against.hopeless else found
        found = replace(found, against=against.said, hopeless=against.hopeless)
    found = found if moves_one_way(parts) else without_other_way(found)
    together = _together(found, model, parts)
    declared = {k: v for k, v in model.known().items() if k in LEVELS}
    known = {k: v for k, v in declared.items() if _open(k, found) and _may_be(k, v, found)}
    taken: list[str] = []
    if known and not (found.refused or found.hopeless):
        held = balance(parts, model, fixed | known)
        if not (held.left or 0.0) > 1.0:  # it explains less than nothing: they contradict the log
            held = replace(held, against=found.against)
            found, taken = held, [TAKEN.format(k, v, model.unit(k)) for k, v in known.items()]
    return replace(
        found,
        notes=tuple(dict.fromkeys([*found.notes, *taken])),
        reading=tuple(dict.fromkeys([*_reading(logs), *noticed])),
        stretches=tuple(parts),
        motion=model.motion,
        unlike=runs.said,
        together=together,
        bench_tests=bench_tests(
            [log for i, log in enumerate(logs) if i not in runs.left_out], model
        ),
    )


def values_for(plain: Balance, model: Model) -> dict[str, Estimate]:
    """The values of the plain answer that a model has, and that a drive may have."""
    known = {k: e for k, e in plain.parameters.items() if of_its_law(model, k)}
    bounds = model.declarations()
    return {k: e for k, e in known.items() if _possible(k, e.value, bounds.get(k))}


def plainly(plain: Balance, model: Model) -> tuple[dict[str, Estimate], Model]:
    """The values of the plain answer, and the model with them; no Fs is below Fc."""
    known = values_for(plain, model)
    return known, lifted(model.with_values({k: e.value for k, e in known.items()}))


def _possible(key: str, value: float, bounds: P | None) -> bool:
    """Whether a drive may have this value, however wide its interval: no inertia is negative."""
    if key in LEVELS or bounds is None:
        return value > 0 if key == "J" else value >= 0 or key not in ("Fc", "Fv")
    return bounds.low <= value <= bounds.high


def _may_be(key: str, value: float, found: Balance) -> bool:
    """Whether a declared value is inside what a log says of it, if it says anything."""
    said = found.uncertain.get(key)
    return said is None or said.ci95 is None or said.may_be(value)


def _open(key: str, found: Balance) -> bool:
    """Whether a log shows a value together with others only."""
    sums = (_names(c.text) for c in found.combinations)
    alone = key in found.parameters
    return key in found.uncertain or not alone and any(key in names for names in sums)


def _together(found: Balance, model: Model, parts: Sequence[Stretch]) -> dict[str, Combination]:
    """The levels that a log in one direction shows only in a sum with a constant torque.

    A model that declares such a torque has both parts: its fit says itself what it cannot separate.
    """
    if any(part.block.name == LOAD for part in model.effects):
        return {}
    if not moves_one_way(parts):
        return {}
    one_way = [c for c in found.combinations if LOAD in _names(c.text) and WAY in c.to_separate]
    surest = reversed(one_way)  # the first one comes last, and stays
    alone = {k: c for c in surest for k in _names(c.text) if k in LEVELS and _open(k, found)}
    return alone or ({} if model.held() & {"Fc"} else of_runs(parts, found))


def _names(text: str) -> list[str]:
    """The parameters of a sum."""
    return re.findall(r"[A-Za-z_]\w*", text)


def _reading(logs: Sequence[Log]) -> list[str]:
    """How the logs were read; what is not so in all of them, with the name of the log."""
    common = set(logs[0].messages).intersection(*(log.messages for log in logs))
    return [m if m in common else f"{log.source}: {m}" for log in logs for m in log.messages]

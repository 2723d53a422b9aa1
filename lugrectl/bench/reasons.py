"""Reasons in plain English: why an observer is in its place, why another is not admissible."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from ..blocks.model import Model
from ..core.display import number
from ..design import Certificate
from .gains import lacking
from .recommendation import Candidate
from .trials import EXACT

HELPS = 0.98  # of the error without an observer: above it an observer does not help
ALIKE = 1.05  # ratio of errors below which two observers are equally good


def quantity(value: float, unit: str) -> str:
    """A value with its unit, in thousandths where it is small."""
    return f"{number(value, 3)} {unit}" if value >= 1.0 else f"{number(1e3 * value, 3)} m{unit}"


def reasons(
    row: Candidate, order: Sequence[Candidate], none: float, units: Mapping[str, str], level: float
) -> tuple[str, ...]:
    """Sentences on a candidate; the first compares it with the others."""
    place = [one.name for one in order].index(row.name)
    said = [
        _leading(row, order, none, units) if place == 0 else _behind(row, order[0], none, units)
    ]
    said.append(_needs(row))
    share = f", {number(100 * row.noise / level, 2)} % of the friction level" if level > 0.0 else ""
    if 0.0 < row.noise < float("inf"):
        said.append(f"The sensor causes {quantity(row.noise, units['u'])} RMS of torque{share}.")
    if row.load < float("inf"):
        said.append(f"With a load step its error is {quantity(row.load, units['e'])}.")
    else:
        said.append("With a load step the loop diverges.")
    said.append(certified(row.certificate))
    return tuple(said)


def _leading(
    row: Candidate, order: Sequence[Candidate], none: float, units: Mapping[str, str]
) -> str:
    text = f"Its error is at most {quantity(row.worst, units['e'])}{_with(row)}"
    text += f"; without an observer it is {quantity(none, units['e'])}"
    if len(order) > 1:
        second = order[1]
        text += f", with {second.name}, the next, up to {quantity(second.worst, units['e'])}"
        if row.worst > second.worst or second.worst <= ALIKE * row.worst:
            text += ", about the same; this one passes less noise to the torque"
    return text + "."


def _behind(row: Candidate, best: Candidate, none: float, units: Mapping[str, str]) -> str:
    times = row.worst / best.worst if best.worst > 0.0 else float("inf")
    text = f"Its error is up to {quantity(row.worst, units['e'])}{_with(row)}"
    text += f", {number(times, 3)} times that of {best.name}"
    if row.worst > none:
        text += " and larger than without an observer"
    if not row.complete:
        text += "; too large to try other wrong parameters"
    return text + "."


def _with(row: Candidate) -> str:
    if len(row.errors) == 1 or row.worst_case == EXACT:
        return " with exact parameters"
    return f" over {len(row.errors)} cases, largest with {row.worst_case}"


def _needs(row: Candidate) -> str:
    knows = ", ".join(row.knows) or "no parameter of the drive"
    return f"It reads {', '.join(row.reads)} and must know {knows}."


def certified(made: Certificate | None) -> str:
    """What the gains guarantee."""
    if made is None:
        return "Its gains are not from a design rule, so nothing is guaranteed."
    if not made.holds:
        return f"Its gains have no certificate ({made.valid or made.lemma})."
    where = made.valid or "for every motion"
    if made.rate is None:
        return f"Its certificate holds {where} if its parameters are right; it has no rate."
    rate = number(made.rate, 3)
    return f"Its certificate: errors decay with {rate} 1/s {where} if its parameters are right."


def unseen(inputs: Sequence[str], measured: Sequence[str]) -> str | None:
    """Why an observer cannot read what it needs; None if it can."""
    strange = [s for s in inputs if s not in ("theta", "w", "u", "e", "r", "s")]
    if strange:
        return f"it reads {', '.join(strange)}, which a ready-made loop does not have."
    missing = [s for s in ("theta", "w") if s in inputs and s not in measured]
    if "s" in inputs and "w" not in measured:
        missing = ["w"]
    if not missing:
        return None
    if missing == ["w"]:
        cure = "where the drive computes the speed from theta, give measured='theta w'"
    else:
        cure = "where the drive has a position, give measured='theta w'"
    return f"it reads {missing[0]}, and this drive measures only {measured[0]}; {cure}."


def unknown(name: str, model: Model) -> str | None:
    """Return why an observer cannot be given its parameters; None if it can."""
    if not (missing := lacking(name, model)):
        return None
    law = model.friction.block.name
    return f"it must know {', '.join(missing)}, which the model with {law} friction does not have."


def broken(
    errors: Mapping[str, float], none: float, unit: str, rate: float, compared: bool
) -> str | None:
    """Why an observer does not work at this rate; None if it does."""
    bad = [case for case, error in errors.items() if not error < float("inf")]
    if bad:
        return f"it cannot run at {rate:g} Hz here: the loop diverges with {bad[0]}."
    if compared and errors[EXACT] > HELPS * none:
        return (
            f"it does not help at {rate:g} Hz with this sensor: even with exact parameters the "
            f"error is {quantity(errors[EXACT], unit)}, without an observer {quantity(none, unit)}."
        )
    return None

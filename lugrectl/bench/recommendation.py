"""The answer of a recommendation: observers in order, those left out, reasons in plain English."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ..blocks.model import Model
from ..core.display import Row, Shown, number
from ..core.errors import InputError
from ..core.result import Result, library, plain
from ..core.views import view
from ..design import Certificate
from .gains import lacking

EXACT = "exact parameters"
HELPS = 0.98  # of the error without an observer: above it an observer does not help
ALIKE = 1.05  # ratio of errors below which two observers are equally good


@dataclass(frozen=True, repr=False)
class Candidate(Shown):
    """One admissible observer.

    ``worst``: the largest RMS error over all cases, in the unit of the recommendation, and
    ``worst_case``, which it is; ``errors`` has all by case. ``load``: the same with a load step
    and exact parameters. ``noise``: RMS torque in N m that the sensor causes. ``gains``: for
    ``velocity_loop(p, name, **gains)``; ``certificate``: what they guarantee, None where there is
    no rule. ``reads``: signals; ``knows``: parameters of the drive that it must know. ``complete``:
    whether every parameter was tried wrong, or the level of friction only.
    """

    name: str
    worst: float
    worst_case: str
    errors: Mapping[str, float]
    load: float
    noise: float
    gains: Mapping[str, Any]
    certificate: Certificate | None
    reads: tuple[str, ...]
    knows: tuple[str, ...]
    complete: bool
    reasons: tuple[str, ...] = ()

    def summary(self) -> dict[str, Any]:
        """Plain Python."""
        own = {k: getattr(self, k) for k in self.__dataclass_fields__}
        own["gains"] = {k: "a function of w" if callable(v) else v for k, v in self.gains.items()}
        own["certificate"] = self.certificate.summary() if self.certificate is not None else None
        return plain(own)

    def _title(self) -> str:
        return f"Candidate {self.name}"

    def _rows(self) -> Iterable[Row]:
        return [Row("" if i else "reasons", said) for i, said in enumerate(self.reasons)]


@dataclass(frozen=True, repr=False)
class Recommendation(Result):
    """The answer of :func:`lugrectl.recommend_observer`.

    Attributes
    ----------
    ranked : tuple of Candidate
        The best first, each with its errors, gains and reasons.
    refused : dict
        Names of those that are not admissible, each with the reason.
    none : float
        The RMS error without an observer in ``unit``.
    signal, unit : str
        What the errors are of.
    motion : "rotary" or "linear"
        That of the drive.
    drive : dict
        What was assumed about the drive.
    controller : dict
        Its gains.
    messages : tuple of str
        What was noticed.

    Examples
    --------
    A drive that measures its speed only, so that no observer may read the position:

    >>> advice = lg.recommend_observer(
    ...     lg.table1(), observers=["natural", "disturbance", "position_lugre"],
    ...     rate=1000.0, measured="w", speed_noise=1e-3,
    ... )
    >>> advice.names, list(advice.refused)
    (('disturbance', 'natural'), ['position_lugre'])
    """

    ranked: tuple[Candidate, ...]
    refused: Mapping[str, str]
    none: float
    signal: str
    unit: str
    motion: str
    drive: Mapping[str, Any]
    controller: Mapping[str, float]
    messages: tuple[str, ...] = ()

    @property
    def best(self) -> Candidate | None:
        """The candidate in the first place; None if no observer is admissible."""
        return self.ranked[0] if self.ranked else None

    @property
    def names(self) -> tuple[str, ...]:
        """The admissible observers in order."""
        return tuple(row.name for row in self.ranked)

    def __bool__(self) -> bool:
        return bool(self.ranked)

    def __len__(self) -> int:
        return len(self.ranked)

    def __getitem__(self, which: Any) -> Candidate:
        """A candidate by place or by name."""
        if not isinstance(which, str):
            return self.ranked[which]
        short = which.removesuffix("_observer")
        if short in self.names:
            return self.ranked[self.names.index(short)]
        if short in self.refused:
            raise InputError(f"{short} is not admissible: {self.refused[short]}")
        raise InputError(f"{which!r} was not considered; there is {', '.join(self.names)}.")

    def summary(self) -> dict[str, Any]:
        """Plain Python."""
        own = {k: getattr(self, k) for k in self.__dataclass_fields__ if k != "ranked"}
        best = self.best.name if self.best else None
        return plain({"best": best, "ranked": [row.summary() for row in self.ranked], **own})

    def to_frame(self) -> Any:
        """A DataFrame, a row for each observer in order, then those that are not admissible."""
        pandas = library("pandas")
        keys = ("name", "worst", "worst_case", "load", "noise")
        rows = [{"admissible": True, **{k: getattr(row, k) for k in keys},
                 "reason": " ".join(row.reasons)} for row in self.ranked]  # fmt: skip
        rows += [{"admissible": False, "name": k, "reason": v} for k, v in self.refused.items()]
        columns = [*keys[1:], "admissible", "reason"]
        return pandas.DataFrame(rows, columns=["name", *columns]).set_index("name")

    def _title(self) -> str:
        best = self.best.name if self.best else "none"
        return f"Recommended observer: {best}"

    def _rows(self) -> Iterable[Row]:
        rows = [
            Row(f"{i + 1}. {row.name}", " ".join(row.reasons)) for i, row in enumerate(self.ranked)
        ]
        for why in dict.fromkeys(self.refused.values()):
            names = ", ".join(k for k, other in self.refused.items() if other == why)
            rows.append(Row("not admissible", f"{names}: {why}"))
        drive = f"{self.drive['rate']:g} Hz, {', '.join(self.drive['measured'])} measured"
        rows.append(Row("drive", drive, "", f"(from {self.drive['source']})"))
        rows.append(Row("without", f"{number(self.none, 3)} {self.unit}", "", "RMS error"))
        return [*rows, *(Row("note", said) for said in self.messages)]

    def __repr__(self) -> str:
        """The first three, how many follow, and how many are not admissible."""
        lines = [self._title()]
        for i, row in enumerate(self.ranked[:3]):
            first = row.reasons[0]
            lines.append(f"  {i + 1}. {row.name}: {first[:1].lower()}{first[1:]}")
        more, out = self.names[3:], ", ".join(self.refused)
        lines += [f"  then {', '.join(more)}"] if more else []
        lines += [f"  not admissible: {out}"] if out else []
        return "\n".join(lines)

    def __str__(self) -> str:
        return super().__repr__()

    def plot(self, ax: Any = None) -> Any:
        """Draw the errors of the candidates, exact to worst, into ``ax`` or a new figure."""
        return view("loop_plots.recommendation")(self, ax)


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

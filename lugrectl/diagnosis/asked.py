"""What a user asks about: logs, a model, what is held out; read once, and answered plainly by the
torque balance. With what makes a log impossible as it was given, a sign, a column, the unit of a
run, a held value: each is seen by base rows of the log as it is, and as it would be without it.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from ..blocks.model import Model, as_model
from ..core.blas_threads import one_blas_thread
from ..core.display import with_interval
from ..core.errors import InputError, Refused
from ..core.option_names import option
from ..core.regression import TINY
from ..core.validation import is_file, positive, share, whole
from ..estimates.findings import AGAINST_HELD, LEVELS, Balance, BenchTest, Estimate
from ..record import Log, Record, Stretch, record_of, refuse_open_time, stretches
from ..record.as_record import as_holdout, as_logs
from ..record.files.readers import MODEL, suffixes
from ..torque_balance.bench_tests import bench_tests
from ..torque_balance.constants import ALPHA, BEYOND, FLOOR, KNOWN, LITTLE, MOSTLY, MUCH
from ..torque_balance.maps import is_map
from ..torque_balance.values import base_row, means_the_same, misfit
from ..torque_balance.verdict import Answer

LIMIT = 270.0  # s that the answer may take
SAME_UNITS = "Give all runs in one unit and sign, or leave out the run that differs."


@dataclass(frozen=True)
class Asked:
    """The logs of one drive, the declared model, and what is held out, as the user gave it."""

    logs: tuple[Log | Record, ...]
    model: Model
    held_out: Any = None
    reading: Mapping[str, Any] = field(default_factory=dict)  # options of read_record
    seen: list[Record] = field(default_factory=list)  # records read so far

    @classmethod
    def of(cls, record: Any, model: Any, holdout: Any = None, **reading: Any) -> Asked:
        """What is meant; InputError where an argument or a file cannot be understood."""
        refuse_swapped([record], model)
        made = as_model(model)
        return cls(as_logs(record, made.motion, **reading), made, holdout, reading)

    @property
    def _as_recorded(self) -> list[Log]:
        logs = [log.log if isinstance(log, Record) else log for log in self.logs]
        return [log for log in logs if log is not None]

    @cached_property
    def _read(self) -> tuple[list[Stretch], list[str]]:
        return stretches(self._as_recorded)

    @property
    def stretches(self) -> list[Stretch]:
        return self._read[0]

    @property
    def noticed(self) -> tuple[str, ...]:
        logs = self._as_recorded
        common = set(logs[0].messages).intersection(*(log.messages for log in logs))
        reading = [m if m in common else f"{log.source}: {m}" for log in logs for m in log.messages]
        return tuple(dict.fromkeys([*reading, *self._read[1]]))

    @cached_property
    def plain(self) -> Balance:
        """The base row of the table, with what makes the log impossible."""
        start = perf_counter()
        made = checked(self.stretches, self.model, [log.source for log in self.logs])
        return self.completed(made, perf_counter() - start)

    def doubts(self, answer: Balance | None = None) -> tuple[str, ...]:
        """What the log says against the model, asked of several runs and of held values, and where
        an ``answer`` is doubtful or far from what is declared; Refused where the log is impossible
        as it was given."""
        stated = any(s.fixed or s.bounded for s in self.model.stated.values())
        odd = answer is not None and (doubtful(answer) or far_off(answer, self.model))
        if not (stated or len(self.logs) > 1 or odd):
            return ()
        if self.plain.unlike:
            raise Refused(" ".join(self.plain.unlike), SAME_UNITS)
        if self.plain.hopeless:
            raise Refused(" ".join(self.plain.against))
        return self.plain.against

    def completed(self, plain: Balance, seconds: float) -> Balance:
        """A plain answer with bench tests and what was noticed when the logs were read."""
        return replace(plain, seconds=seconds, reading=self.noticed, bench_tests=self.bench_tests)

    @cached_property
    def bench_tests(self) -> tuple[BenchTest, ...]:
        return bench_tests(self._as_recorded, self.model)

    def records(self) -> list[Record]:
        """The logs on uniform time; Refused where one has no motion."""
        for log in self.logs[len(self.seen) :]:
            self.seen.append(record_of(log, alone=len(self.logs) == 1))
        return self.seen

    def holdout(self) -> str | Record | None:
        """None, "last" or a record of its own."""
        return as_holdout(self.held_out, self.seen, self.model.motion, **self.reading)

    def refuse_open_time(self) -> None:
        """Raise Refused where t has no unit, and no drive writes a log at that rate in s; of a run
        at a steady speed only the mean counts."""
        for part in () if is_map(self.stretches) else self.stretches:
            log = self.logs[part.run]
            refuse_open_time(log.source, getattr(log, "labels", {}), part.dt)


def plain_answer(logs: Sequence[Log], model: Model) -> Balance:
    return Asked(tuple(logs), model).plain


def settings(
    horizon: Any = 1.0,
    seed: Any = 0,
    least: Any = FLOOR,
    alpha: Any = ALPHA,
    time_limit: Any = LIMIT,
    **_: Any,
) -> tuple[float, float, float, float]:
    """horizon, least, alpha and time_limit; InputError for what cannot be meant."""
    whole(seed, "seed")
    horizon = positive(horizon, "horizon", "seconds")
    limit = positive(time_limit, "time_limit", "seconds")
    return horizon, share(least, "least"), share(alpha, "alpha"), limit


def refuse_swapped(logs: Iterable[Any], model: Any) -> None:
    """InputError where the model is the file of a log, and one of the logs that of a model."""
    if is_file(model) and Path(model).suffix.lower() in suffixes():
        for log in logs:
            if is_file(log) and Path(log).suffix.lower() == MODEL:
                raise InputError(f"{log} is a model and {model} is a log: swap them.")


@one_blas_thread()
def balance(
    record: Any,
    model: Any = None,
    *,
    columns: Mapping[str, str] | str | None = None,
    units: Mapping[str, str] | str | None = None,
    scale: Mapping[str, float] | str | None = None,
    rate: float | None = None,
) -> Balance:
    """The plain torque balance of a log, as it stands beside every diagnosis; in a second.

        u(t - T) = J dw/dt + Fc sign(w) + Fv w + constant + declared effects + residual

    in means over windows, by one robust regression: the first row of the table of
    :func:`lugrectl.diagnose`. An effect that is not declared biases the values beyond their
    intervals.

    Parameters
    ----------
    record : path, DataFrame, dict of arrays or Record, or a list of them
        The runs of one drive.
    model : Model, Parameters, dict or path
        The declared model: its effects are further terms, its held values are known. None:
        nothing is known.
    columns, units, scale, rate : optional
        How to read a log, as for :func:`lugrectl.read_record`.

    Returns
    -------
    Balance
        ``parameters`` with 95 % intervals, SI (J in kg m2, Fc in N m, Fv in N m s/rad, u_delay in
        s; on a linear axis kg, N, N s/m, s), the sums that are certain, the friction curve.

    Raises
    ------
    InputError
        When an argument cannot be meant, or a file cannot be read or understood.
    Refused
        When t has no unit, and no drive writes a log at that rate in s.

    Examples
    --------
    A made-up log of a drive with J = 0.002 kg m2, Fc = 0.3 N m and Fv = 0.02 N m s/rad:

    >>> t = 4e-3 * np.arange(3000)
    >>> w = np.sin(np.pi * t) + 0.5 * np.sin(8.0 * t)
    >>> u = 0.002 * np.gradient(w, t) + 0.3 * np.sign(w) + 0.02 * w
    >>> plain = lg.balance({"t": t, "u": u, "w": w})
    >>> round(plain.parameters["Fc"].value, 2), round(plain.parameters["Fv"].value, 2)
    (0.3, 0.02)
    """
    reading = {"columns": columns, "units": units, "scale": scale, "rate": rate}
    asked = Asked.of(record, {} if model is None else model, **reading)
    try:
        asked.refuse_open_time()
    except Refused as no:  # all rates and the inertia depend on it: no value is an answer
        no.plain = asked.plain
        raise
    return asked.plain


# ---- what makes a log impossible


BETTER = 0.7  # of what a log leaves as it is: what it must leave without its fault
SIGN = "u has the wrong sign: give {}. The plain answer is that of the other sign."
SWAPPED = (
    "u and {0} seem to be swapped: the other way round the balance leaves {1:.2g} % of the RMS "
    "torque with a possible inertia. Give {2}."
)
HELD = (
    "{0} is {1} {2:.6g}{3}, but this log says {4}{3} ({5}): correct the value or its unit, or let "
    "it be fitted."
)
WOULD_BE = "{} is held at {:.4g}, but would be {:.4g}"
UNFIT = (
    "The declared law '{}' does not fit this log, whatever its values. Declare another law, or "
    "compare them ({})."
)

MOST_RUNS = 20  # that are compared with one another
ALIKE = 1.03  # ratio of levels that agree
ABOUT, FARTHER = 2.0, 3.0  # ratio of levels that no unit explains; that one may explain
DEG, RPM = 180 / np.pi, 30 / np.pi
# what undoes it where a channel is so many times what it should be
TORQUE_AND_TIME = {"u=-1": -1.0, "u=mN m": 1e3, "t=ms": 1e3}
MOTIONS = {
    ("rotary", "theta"): {"theta=deg": DEG, "theta=57.29578": 1 / DEG,
                          "theta=turn": 0.5 / np.pi, "theta=0.1591549": 2 * np.pi},
    ("rotary", "w"): {"w=deg/s": DEG, "w=57.29578": 1 / DEG, "w=rpm": RPM, "w=9.549297": 1 / RPM},
    ("linear", "theta"): {"theta=mm": 1e3, "theta=1000": 1e-3},
    ("linear", "w"): {},
}  # fmt: skip
UNIT = (
    "{} is {:.4g} times what it is with the declared J and friction: give {}, or correct the model."
)
OPPOSITE = "{}: u has the opposite sign of {}: give {} for it, or leave it out."
TIMES_OTHERS = "{}: {} is {:.4g} times that of {}: give {} for it, or leave it out."
OTHERS = "The plain answer is that of the other runs."


def plain_row(parts: Sequence[Stretch], model: Model) -> Balance:
    """The base row; where it is refused, a balance that says why."""
    try:
        return base_row(parts, model)
    except Refused as no:
        said = f"{no} {no.experiment or ''}".rstrip()
        return Balance(refused=said, notes=(said,), motion=model.motion, stretches=tuple(parts))


def checked(parts: Sequence[Stretch], model: Model, names: Sequence[str]) -> Balance:
    """The base row, without runs in another unit, with what contradicts it; ``names`` of runs."""
    if is_map(parts):  # one run tells no levels, and none is known without the others
        return against_stated(parts, model, plain_row(parts, model))
    left_out = unlike(parts, model, names)
    parts = [part for part in parts if part.run not in left_out]
    found = plain_row(parts, model)
    notes = (*[OTHERS] * bool(left_out), *found.notes)
    found = replace(found, unlike=tuple(left_out.values()), notes=notes)
    if said := in_another_unit(parts, model, found):
        return replace(found, against=(said,), hopeless=True)
    if not parts or not doubtful(found):
        return against_stated(parts, model, found)
    others = {SIGN: [replace(part, u=-part.u) for part in parts]}
    role = "w" if parts[0].theta is None else "theta"  # a w beside theta may be left out: no sign
    if all(getattr(p, role) is not None for p in parts) and any(np.ptp(p.u) for p in parts):
        swapped: list[dict[str, Any]] = [{"u": getattr(p, role), role: p.u} for p in parts]
        others[SWAPPED] = [replace(p, **x) for p, x in zip(parts, swapped, strict=True)]
    made = {said: plain_row(other, model) for said, other in others.items()}
    made = {said: other for said, other in made.items() if _makes_a_drive(other, found)}
    if not made:
        return against_stated(parts, model, found)
    said, other = min(made.items(), key=lambda one: one[1].left or 0.0)
    if said == SIGN:
        said = SIGN.format(option("scale", "u=-1"))
        return replace(other, unlike=found.unlike, against=(said,), hopeless=True)
    given = option("columns", f"u=NAME,{role}=NAME")
    said = SWAPPED.format(role, 100.0 * (other.left or 0.0), given)
    return replace(found, refused=found.refused and said, against=(said,), hopeless=True)


def doubtful(found: Balance) -> bool:
    """Whether a balance is none of a drive: no inertia and much is left, or friction drives."""
    if found.refused or found.left is None:
        return True
    friction = [c.ci95 for c in found.combinations if "Fc" in c.parts]
    drives = any(ends is not None and ends[1] < 0 for ends in friction)
    return drives or "J" not in found.parameters and found.left > MUCH


def _makes_a_drive(other: Balance, found: Balance) -> bool:
    """Whether a log without its supposed fault is a drive, and explains more."""
    if other.refused or other.left is None or doubtful(other) and "J" not in other.parameters:
        return False
    return found.left is None or other.left < BETTER * found.left


# ---- values that are held or bounded


def against_stated(parts: Sequence[Stretch], model: Model, found: Balance) -> Balance:
    """The balance with a sentence for each held or bounded value that the log contradicts by far;
    where nothing can be answered with it, that of the log without what is stated."""
    keys = {k for k, s in model.stated.items() if s.fixed or s.bounded}
    keys = sorted(k for k in keys if not model.declarations()[k].angle)
    free = plain_row(parts, replace(model, stated={})) if keys else Balance()
    if free.refused or free.left is None or free.left > MOSTLY:
        return found  # nothing is stated, or the log itself is at fault
    said, most = [], 0.0
    for key in (k for k in keys if k in free.parameters):
        e, stated = free.parameters[key], model.stated[key]
        value = model.kept({key: e.value})[key]  # the nearest allowed one
        if value is None or e.ci95 is None or e.may_be(value):
            continue
        low, high = sorted((abs(value), abs(e.value)))
        if high <= BEYOND * low and value * e.value >= 0:  # a missing effect takes it so far
            continue
        left = plain_row(parts, replace(model, stated={key: stated})).left or 1.0
        if left > free.left + LITTLE:
            how = "held at" if stated.fixed else "at least" if value > e.value else "at most"
            unit = "" if model.unit(key) == "1" else f" {model.unit(key)}"
            said.append(HELD.format(key, how, value, unit, *with_interval(e)))
            most = max(most, left)
    if not said:
        return found
    return replace(free if most > MOSTLY else found, against=tuple(said), hopeless=most > MOSTLY)


def contradicted(parts: Sequence[Stretch], model: Model) -> list[str]:
    """A sentence for each held value that the same law, fitted to the log, does not have."""
    held = {k: model.known()[k] for k in sorted(model.held())}
    found = plain_row(parts, replace(model, stated={})).parameters if held else {}
    off = {k: x for k, x in held.items() if k in found and not found[k].may_be(x)}
    made = [WOULD_BE.format(k, x, found[k].value) for k, x in off.items()]
    return [f"{AGAINST_HELD}: {', '.join(made)}."] if made else []


# ---- a law that is not that of the drive


def unfit_law(made: Answer, shown: Model, least: float) -> str:
    """A sentence where the declared law, at the values shown, cannot be the drive's; or ""."""
    law = shown.friction.block
    may_lack = not ({"Fc", "Fv"} <= law.own.keys() and means_the_same(law))
    unfit = may_lack and misfit(made.last, shown) >= 2 * least
    return UNFIT.format(law.name, option("law", "auto")) if unfit else ""


# ---- a channel in another unit or sign: the log is fitted again without each such fault


# J, Fc and Fv, and their relative errors (2, 3); those that are unknown are nan
Levels = np.ndarray


def levels(found: Balance) -> Levels | None:
    """What of the levels a balance knows; None where it is none of a drive."""
    both: Mapping[str, Estimate] = {**found.uncertain, **found.parameters}
    if doubtful(found) or not {*LEVELS} <= both.keys():
        return None
    value = np.array([both[k].value for k in LEVELS])
    ends = np.array([both[k].ci95 or (-np.inf, np.inf) for k in LEVELS])
    error = np.diff(ends)[:, 0] / 2 / np.abs(value)
    return np.where(error < KNOWN, [value, error], np.nan)


def agree(one: Levels | None, other: Levels | None, least: int, times: float = ALIKE) -> bool:
    """Whether at least so many levels are known of both, and none differs by more than chance and
    this factor allow."""
    if one is None or other is None:
        return False
    ratio, error = one[0] / other[0], np.hypot(one[1], other[1])
    known = np.isfinite(ratio)
    off = np.abs(np.log(np.maximum(ratio[known], TINY)))
    return known.sum() >= least and bool(np.all(off < np.log(times) + error[known]))


def of_motion(parts: Sequence[Stretch], model: Model) -> Mapping[str, float]:
    return MOTIONS[model.motion, "w" if parts[0].theta is None else "theta"]


def fault(
    parts: Sequence[Stretch], model: Model, right: Levels, of: Mapping[str, float], times: float
) -> tuple[str, str, float]:
    """Which channel is how many times what makes the levels right, and what undoes it; or ""."""
    for undone, size in of.items():
        channel = undone.split("=")[0]
        if channel == "t":
            tried = [replace(p, dt=p.dt / size, t=p.t / size) for p in parts]
        else:
            tried = [replace(p, **{channel: getattr(p, channel) / size}) for p in parts]
        if agree(levels(plain_row(tried, model)), right, 2, times):
            return channel, option("scale" if undone[-1].isdigit() else "units", undone), size
    return "", "", 1.0


def unlike(parts: Sequence[Stretch], model: Model, names: Sequence[str]) -> dict[int, str]:
    """Runs that another unit or sign separates from the others, each with its sentence; ``names``
    are those of the runs."""
    runs = {run: [s for s in parts if s.run == run] for run in sorted({s.run for s in parts})}
    if not 2 <= len(runs) <= MOST_RUNS:
        return {}
    model, left_out = replace(model, J=None, stated={}), dict[int, str]()
    with np.errstate(all="ignore"):
        each = {run: levels(plain_row(own, model)) for run, own in runs.items()}
        votes = {run: sum(agree(x, y, 1) for y in each.values()) for run, x in each.items()}
        best = max(votes, key=votes.__getitem__)
        right, usual = each.pop(best), "the other runs" if votes[best] > 1 else names[best]
        for run, own in each.items():
            if right is None or agree(own, right, 1, ABOUT):  # no unit is so small a factor
                continue
            of = {**TORQUE_AND_TIME, **of_motion(runs[run], model)}
            channel, undo, size = fault(runs[run], model, right, of, ALIKE)
            if size == -1.0:
                left_out[run] = OPPOSITE.format(names[run], usual, undo)
            elif channel:
                left_out[run] = TIMES_OTHERS.format(names[run], channel, size, usual, undo)
    return left_out


def far_off(found: Balance, model: Model) -> bool:
    """Whether the log has an inertia so far from the declared one that a unit may be wrong."""
    declared, J = model.known().get("J"), {**found.uncertain, **found.parameters}.get("J")
    if not declared or J is None or J.ci95 is None:
        return False
    return J.ci95[0] > FARTHER * declared or 0 < J.ci95[1] < declared / FARTHER


def in_another_unit(parts: Sequence[Stretch], model: Model, found: Balance) -> str:
    """A sentence where one unit of the motion makes the declared J, Fc and Fv of those of the log;
    "" where none does. Another scale of u is no fault: shares of friction stay."""
    declared = np.array([model.known().get(k) or np.nan for k in LEVELS])
    if not far_off(found, model) or np.isnan(declared).any():
        return ""
    right, free = np.array([declared, 0 * declared]), replace(model, J=None, stated={})
    channel, undo, size = fault(parts, free, right, of_motion(parts, model), ABOUT)
    return UNIT.format(channel, size, undo) if channel else ""

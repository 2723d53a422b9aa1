"""A probability from a number of members, a bound that so many give; how likely a loop hunts."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import partial
from itertools import count as numbers
from pathlib import Path
from typing import Any

import numpy as np
from scipy import stats

from ..blocks.model import Model
from ..core.display import Row, Shown
from ..core.errors import InputError, Refused
from ..core.jobs import JobError, run_jobs
from ..core.progress import Wanted, reporter, shows_progress
from ..core.result import Result, plain
from ..core.validation import whole
from ..core.views import view
from ..estimates.fitted import Fitted
from ..estimates.members import Belief, Members, refuse_unknown
from ..hunting import limit_cycles
from ..record import Record
from .loop import sensing_of, speed_of

RESTS, UNDECIDED, HUNTS = 0.0, 1.0, 2.0
SURE = 0.95  # of a bound, and of the interval of a probability
FATES = {"hunts": HUNTS, "rests": RESTS, "undecided": UNDECIDED}


@dataclass(frozen=True, repr=False)
class Chance(Shown):
    """``count`` of ``members`` had a property: ``.value``, and ``.ci95`` by Clopper and Pearson."""

    count: int
    members: int

    @property
    def value(self) -> float:
        return self.count / self.members

    @property
    def ci95(self) -> tuple[float, float]:
        k, n, tail = self.count, self.members, (1.0 - SURE) / 2.0
        low = float(stats.beta.ppf(tail, k, n - k + 1)) if k else 0.0
        return low, float(stats.beta.ppf(1.0 - tail, k + 1, n - k)) if k < n else 1.0

    def summary(self) -> dict[str, Any]:
        """Plain Python."""
        return {"value": self.value, "ci95": list(self.ci95), "count": self.count,
                "members": self.members}  # fmt: skip

    def words(self) -> str:
        low, high = (100.0 * x for x in self.ci95)
        ends = f"95 % from {low:.2g} to {high:.2g} %, {self.members} members"
        return f"{100.0 * self.value:.3g} % ({ends})"

    def _title(self) -> str:
        return self.words()

    def _rows(self) -> Iterable[Row]:
        return ()


@dataclass(frozen=True, repr=False)
class Outcomes(Chance):
    """The chance of hunting, with the members of which nothing was decided: ``.value`` is the share
    that hunts, ``.rests`` and ``.unsure`` are the others."""

    undecided: int = 0

    @classmethod
    def of(cls, fates: Sequence[float] | np.ndarray) -> Outcomes:
        """From the fate of each member."""
        hunting, open_ = (int(np.sum(np.equal(fates, one))) for one in (HUNTS, UNDECIDED))
        return cls(hunting, len(fates), open_)

    @property
    def unsure(self) -> float:
        return self.undecided / self.members

    @property
    def rests(self) -> float:
        return 1.0 - self.value - self.unsure

    def summary(self) -> dict[str, Any]:
        """Plain Python, with the three shares."""
        shares = {"hunts": self.value, "rests": self.rests, "undecided": self.unsure}
        return super().summary() | {"shares": shares}

    def words(self) -> str:
        more = f"; undecided {100.0 * self.unsure:.3g} %" if self.undecided else ""
        return super().words() + more


def hunting_at_most(members: int, part: float) -> int:
    """How many may hunt so that the interval of the chance ends at ``part``; -1: too few."""
    if part == 1.0:
        return members
    counts = np.arange(members)
    ends = stats.beta.ppf(0.5 * (1.0 + SURE), counts + 1, members - counts)
    return int(np.searchsorted(ends, part, "right")) - 1


def spared(members: int, confidence: float) -> int:
    """The largest k with P(Bin(members, 1 - confidence) <= k) <= 1 - SURE; -1: too few members."""
    return int(np.searchsorted(
        stats.binom.cdf(np.arange(members + 1), members, 1.0 - confidence), 1.0 - SURE, "right"
    )) - 1  # fmt: skip


def enough(confidence: float, spare: int = 1) -> int:
    """The fewest members of which so many may lie beyond the bound."""
    return next(n for n in numbers(spare + 1) if spared(n, confidence) >= spare)


def enough_at_rest(part: float, spare: int = 0) -> int:
    """The fewest members that show that at most this part hunts, though so many of them do."""
    return next(n for n in numbers(1) if hunting_at_most(n, part) >= spare)


def bound(values: np.ndarray, confidence: float) -> float:
    """What a new member's value is below with ``confidence``, itself sure to 95 %."""
    k = spared(len(values), confidence)
    return float(np.sort(values)[-1 - k]) if k >= 0 else np.inf


def band(values: np.ndarray, level: float = SURE) -> tuple[float, float]:
    """The interval of a new member with this probability: below the k-th of n by k/(n + 1)."""
    ordered, last, tail = np.sort(values), len(values) - 1, 0.5 * (1.0 - level)
    low = max(tail * (last + 2) - 1.0, 0.0)
    return between(ordered, low), between(ordered, last - low)


def between(values: np.ndarray, place: float) -> float:
    """Return a quantile; infinite beside an infinite value."""
    low, high = values[math.floor(place)], values[math.ceil(place)]
    if not math.isfinite(high):
        return math.inf if place > math.floor(place) else float(low)
    return float(low + (place - math.floor(place)) * (high - low))


def believed(p: Any) -> tuple[tuple[Belief, ...], Mapping[str, Any]]:
    """The models with their distributions, and the drive as recorded, of a result or its report."""
    what = "p"
    if isinstance(p, (str, Path)):
        what = str(p)
        try:
            p = json.loads(Path(p).read_text(encoding="utf-8"))
        except OSError as error:
            raise InputError(f"{p}: cannot be read ({error.strerror or error}).") from None
        except ValueError as error:
            raise InputError(f"{p}: not a JSON document ({error}).") from None
    if isinstance(p, Fitted):
        beliefs = () if p.model is None else p.beliefs()
        seen = seen_in(p.record, p.torque_noise) if beliefs else {}
    elif isinstance(p, Mapping) and "members" in p and p.get("schema", 1) == 1:
        beliefs, seen = tuple(Belief.read(one) for one in p["members"]), p.get("drive") or {}
    else:
        raise InputError(
            f"{what} must be a result or the report.json of one, by this version of lugrectl."
        )
    if not beliefs:
        raise Refused("the record was refused, so that there is no model to compensate with.")
    for belief in beliefs:
        refuse_unknown(belief)
    return beliefs, seen


def seen_in(record: Record | None, torque: float | None) -> dict[str, Any]:
    """A drive as it was recorded, as under "drive" in the JSON document, SI.

    A noise of theta below that of its rounding is none: a log does not tell the two apart, and
    noise that is not there would hide what rounding does to a loop.
    """
    if record is None:
        return {}
    made = sensing_of(record)
    return {
        "rate": 1.0 / made.dt,
        "resolution": made.resolution,
        "noise": made.noise if made.noise > made.resolution / np.sqrt(12.0) else 0.0,
        "speed_noise": made.speed_noise,
        "torque": torque,
        "speed": speed_of(record),
    }


@dataclass(frozen=True, repr=False)
class HuntingChance(Result):
    """The answer of :func:`lugrectl.hunting_chance`; truthy if every member rests.

    Attributes
    ----------
    chance : Outcomes
        ``.value``, ``.ci95``, ``.count``, ``.members``, and the shares ``.rests`` and ``.unsure``.
    amplitudes, periods : tuple of float
        Of the largest cycle of each member that hunts, rad and s; nan where the loop diverges.
    unit : str
        Of the amplitudes.
    loop : dict
        Gains, rate, dead time and counts as given.

    Examples
    --------
    >>> t = 1e-2 * np.arange(400)
    >>> w = np.sin(np.pi * t) + 0.5 * np.sin(8.0 * t)
    >>> u = 0.002 * np.gradient(w, t) + 0.3 * np.tanh(w / 1e-3) + 0.02 * w
    >>> fit = lg.identify({"t": t, "u": u, "w": w}, lg.Model.of(friction="coulomb"))
    >>> lg.hunting_chance(fit, members=10, kp=2.0, ki=1.0, kd=0.1).chance
    0 % (95 % from 0 to 31 %, 10 members)
    """

    chance: Outcomes
    amplitudes: tuple[float, ...]
    periods: tuple[float, ...]
    unit: str
    loop: Mapping[str, Any]

    def __bool__(self) -> bool:
        return not (self.chance.count or self.chance.undecided)

    @property
    def outcome(self) -> str:
        """ "hunts" where a member does, else "undecided" where one is, else "rests"."""
        return "hunts" if self.chance.count else "rests" if self else "undecided"

    def summary(self) -> dict[str, Any]:
        """Plain Python, as ``lugrectl hunt --json`` prints it for a report."""
        made = {"schema": 1, "hunts": self.chance.count > 0, "chance": self.chance.summary()}
        return plain(made | {k: getattr(self, k) for k in ("amplitudes", "periods", "loop")})

    def plot(self, ax: Any = None) -> Any:
        """Draw amplitude over period of each member that hunts; returns the Axes."""
        return view("loop_plots.chance")(self, ax)

    def _title(self) -> str:
        return f"hunts: {self.chance.words()}"

    def _rows(self) -> Iterable[Row]:
        if any(np.isfinite(self.amplitudes)):
            yield Row("amplitude", float(np.nanmedian(self.amplitudes)), self.unit, "(median)")
            yield Row("period", float(np.nanmedian(self.periods)), "s", "(median)")


@shows_progress
def hunting_chance(
    p: Any,
    *,
    members: int = 40,
    seed: int = 0,
    executor: Executor | None = None,
    jobs: int = 1,
    progress: Wanted = None,
    **loop: Any,
) -> HuntingChance:
    """How likely a position loop hunts, over the joint covariance of what a log determined.

    Parameters
    ----------
    p : Diagnosis, Identification, dict or path
        A result, or its ``report.json``.
    members : int
        Number of drives that are drawn; the interval of the probability says what that many know.
    seed : int
        Of the drives.
    executor, jobs : Executor, int
        As in :func:`sweep`: where members are searched, and on how many processes.
    progress : callable, True, False or None
        ``progress(fraction, what)``, or whether to show a bar. None: in Jupyter only.
    loop
        Gains, rate, dead time and counts, as for :func:`limit_cycles`.

    Returns
    -------
    HuntingChance
        ``.chance`` with its 95 % interval, and the cycles that were found.

    Raises
    ------
    InputError
        As :func:`limit_cycles`, and for a file that is no report.
    Refused
        For a value that neither the log determines nor the model declares with a std.

    Notes
    -----
    k of N members have a cycle, or diverge; an undecided member neither hunts nor rests. The
    interval of the probability is that of Clopper and Pearson, The Use of Confidence or Fiducial
    Limits Illustrated in the Case of the Binomial,
    Biometrika 26(4), 1934. Each member is searched as :func:`limit_cycles` says, with its limits.

    Examples
    --------
    >>> t = 1e-2 * np.arange(400)
    >>> w = np.sin(np.pi * t) + 0.5 * np.sin(8.0 * t)
    >>> u = 0.002 * np.gradient(w, t) + 0.3 * np.tanh(w / 1e-3) + 0.02 * w
    >>> fit = lg.identify({"t": t, "u": u, "w": w}, lg.Model.of(friction="coulomb"))
    >>> found = lg.hunting_chance(fit, members=20, kp=2.0, ki=5.0, kd=0.1)
    >>> bool(found), found.chance.members
    (True, 20)
    """
    beliefs, _ = believed(p)
    drawn, report = Members(beliefs, whole(members, "members", least=1), seed), reporter(progress)
    work, rows = partial(_largest, loop), dict[int, tuple[float, float, float]]()
    for i, one in run_jobs(work, list(drawn), executor=executor, jobs=jobs):
        if isinstance(one, JobError):
            raise (InputError if one.exit_code == 2 else Refused)(one.sentence)
        rows[i] = one
        report(len(rows) / len(drawn), f"{len(rows)} of {len(drawn)} drives")
    fates = [rows[i][0] for i in range(len(drawn))]
    found = [rows[i] for i in range(len(drawn)) if rows[i][0] == HUNTS]
    return HuntingChance(
        Outcomes.of(fates),
        tuple(a for _, a, _ in found),
        tuple(T for _, _, T in found),
        "rad" if beliefs[0].model.motion == "rotary" else "m",
        {k: v for k, v in loop.items() if v is not None},
    )


def _largest(loop: Mapping[str, Any], model: Model) -> tuple[float, float, float]:
    """The fate of a drive, with amplitude and period of its largest cycle."""
    found = limit_cycles(model, **loop)
    last = found.cycles[-1] if found.cycles else None
    amplitude, period = (np.nan, np.nan) if last is None else (last.amplitude, last.period)
    return FATES[found.outcome], amplitude, period

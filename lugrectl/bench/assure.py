"""How much friction compensation to dare, and how likely a loop hunts, on drives that the log
leaves possible: probabilities from a number of members, and a bound that so many give.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field, replace
from functools import lru_cache, partial
from itertools import count as numbers
from pathlib import Path
from typing import Any

import numpy as np
from scipy import stats

from ..blocks.controllers import MEASURED
from ..blocks.model import Model
from ..blocks.observers import observer_block
from ..core.display import Row, Shown, noticed
from ..core.display import number as figure
from ..core.errors import InputError, Refused
from ..core.jobs import JobError, run_jobs
from ..core.numeric import rms
from ..core.progress import Progress, Wanted, part_of, reporter, shows_progress
from ..core.result import Fields, Result, plain
from ..core.validation import not_negative, positive, share, whole
from ..core.views import view
from ..estimates.fitted import Belief, Fitted, Members, refuse_unknown
from ..hunting.hunt import limit_cycles
from ..record import Record
from ..simulation.sampled_block import Sensing
from .compensate import (
    FASTEST,
    PERIODS,
    SETTLED,
    SampledLoop,
    Task,
    controller,
    designed,
    enough_samples,
    fastest,
    given_gains,
    quantiles,
    samples,
    sensing_of,
    sine,
    top_speed,
    unit_of,
    unknown,
)

RESTS, UNDECIDED, HUNTS = 0.0, 1.0, 2.0
FATES = {"hunts": HUNTS, "rests": RESTS, "undecided": UNDECIDED}
SURE = 0.95  # of a bound, and of the interval of a probability
TAIL = 0.5 * (1.0 - SURE)  # beyond either end of such an interval


@dataclass(frozen=True, repr=False)
class Chance(Shown):
    """``count`` of ``members`` had a property: ``.value``, and ``.ci95`` by Clopper and Pearson. Of
    hunting, ``undecided`` are the members of which nothing was decided; ``.rests`` and ``.unsure``
    are the other shares."""

    count: int
    members: int
    undecided: int | None = None

    @classmethod
    def of(cls, fates: Sequence[float] | np.ndarray) -> Chance:
        """That of hunting, from the fate of each member."""
        hunting, open_ = (int(np.sum(np.equal(fates, one))) for one in (HUNTS, UNDECIDED))
        return cls(hunting, len(fates), open_)

    @property
    def value(self) -> float:
        return self.count / self.members

    @property
    def unsure(self) -> float:
        return (self.undecided or 0) / self.members

    @property
    def rests(self) -> float:
        return 1.0 - self.value - self.unsure

    @property
    def ci95(self) -> tuple[float, float]:
        found = stats.binomtest(self.count, self.members).proportion_ci(SURE, "exact")
        return float(found.low), float(found.high)

    def summary(self) -> dict[str, Any]:
        """Plain Python; of hunting with the three shares."""
        own = {k: getattr(self, k) for k in ("value", "ci95", "count", "members")}
        shares = {"hunts": self.value, "rests": self.rests, "undecided": self.unsure}
        return plain(own if self.undecided is None else own | {"shares": shares})

    def words(self) -> str:
        low, high = (100.0 * x for x in self.ci95)
        more = f"; undecided {100.0 * self.unsure:.3g} %" if self.undecided else ""
        ends = f"95 % from {low:.2g} to {high:.2g} %, {self.members} members"
        return f"{100.0 * self.value:.3g} % ({ends}){more}"

    _title = words

    def _rows(self) -> Iterable[Row]:
        return ()


def few(members: int, part: float, tail: float = TAIL) -> int:
    """The largest k with P(Bin(members, part) <= k) <= tail; -1: too few members."""
    chances = stats.binom.cdf(np.arange(members + 1), members, part)
    return int(np.searchsorted(chances, tail, "right")) - 1


def enough(part: float, spare: int, tail: float = TAIL) -> int:
    """The fewest members that show by so few that this part of all have a property."""
    return next(n for n in numbers(1) if few(n, part, tail) >= spare)


def bound(values: np.ndarray, confidence: float) -> float:
    """What a new member's value is below with ``confidence``, itself sure to 95 %."""
    k = few(len(values), 1.0 - confidence, 1.0 - SURE)
    return float(np.sort(values)[-1 - k]) if k >= 0 else np.inf


def band(values: np.ndarray) -> tuple[float, float]:
    """The interval of a new member with 95 %: below the k-th of n by k/(n + 1)."""
    low, high = quantiles(values, (TAIL, 1.0 - TAIL), "weibull")
    return low, high


def believed(p: Any) -> tuple[tuple[Belief, ...], Mapping[str, Any]]:
    """The models with their distributions, and the drive as recorded, of a result or its report."""
    what = "p"
    if isinstance(p, (str, Path)):
        what = str(p)
        try:
            p = json.loads(Path(p).read_text(encoding="utf-8"))
        except (OSError, ValueError) as error:
            raise InputError(f"{p}: cannot be read as JSON ({error}).") from None
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
    """A drive as it was recorded, as under "drive" in the JSON document, SI. A noise of theta below
    that of its rounding is none: it would hide what rounding does to a loop."""
    if record is None:
        return {}
    made = sensing_of(record)
    return {
        "rate": 1.0 / made.dt,
        "resolution": made.resolution,
        "noise": made.noise if made.noise > made.resolution / np.sqrt(12.0) else 0.0,
        "speed_noise": made.speed_noise,
        "torque": torque,
        "speed": top_speed(record) or 1.0,
    }


@dataclass(frozen=True, repr=False)
class HuntingChance(Result):
    """The answer of :func:`lugrectl.hunting_chance`; truthy if every member rests.

    Attributes
    ----------
    chance : Chance
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

    chance: Chance
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
        made = {"schema": 1, "hunts": self.chance.count > 0}
        keys = ("chance", "amplitudes", "periods", "loop")
        return plain(made | {k: getattr(self, k) for k in keys})

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
    drawn = list(Members(beliefs, whole(members, "members", least=1), seed))
    run, report = Jobs(executor, jobs, 1), reporter(progress)
    found = run(partial(_largest, loop), report, drawn)
    fates, amplitudes, periods = found.T
    return HuntingChance(
        Chance.of(fates),
        tuple(amplitudes[fates == HUNTS].tolist()),
        tuple(periods[fates == HUNTS].tolist()),
        unit_of("position", beliefs[0].model),
        {k: v for k, v in loop.items() if v is not None},
    )


def _largest(loop: Mapping[str, Any], models: Sequence[Model]) -> np.ndarray:
    """The fate of each drive, with amplitude and period of its largest cycle."""
    rows = []
    for found in (limit_cycles(model, **loop) for model in models):
        ends = [(one.amplitude, one.period) for one in found.cycles[-1:]] or [(np.nan, np.nan)]
        rows.append((FATES[found.outcome], *ends[0]))
    return np.array(rows)


RESTING, BESIDE = RULES = ("rests", "swings no farther than without")
FIRST, MORE = 4, 5  # drives that are looked at first, and how many times as many then
OBSERVERS = ("natural", "friction_state", "extended_state")
SCALES = (0.4, 0.6, 0.7, 0.8, 0.9, 1.0, 1.1, 1.2)
QUICK = 20.0  # 1/s, pole of the usual controller, or a third of the crossover that sampling allows
UNSTABLE = (
    "the loop is unstable by itself: with these gains, rate and dead time a drive without dry "
    "friction swings ever more; give a lower bandwidth, or other gains."
)


@dataclass(frozen=True)
class Tried(Fields):
    """A compensation that was tried on the first members: the error that a share 1 - confidence of
    them exceeds, the median, the share of them that it makes worse, and the share that hunts of
    those that were looked at, None where a better choice stood before it."""

    observer: str
    scale: float
    upper: float
    median: float
    worse: float
    hunts: float | None = None


@dataclass(frozen=True, repr=False, eq=False)
class Assurance(Result):
    """The answer of :func:`lugrectl.assure`.

    Attributes
    ----------
    kind : "velocity" or "position"
        The loop.
    scale : float
        The share of the observer's estimate to compensate; 0: none is to be dared.
    observer, gains, controller : str or None, dict, dict
        The observer with its gains, and the gains of the controller.
    confidence : float
        Share of the drives for which ``bound`` holds.
    error, band : float, (float, float)
        RMS tracking error in ``unit``: the median of the drives, and the interval in which a drive
        lies with 95 %.
    bound : float
        What the error is below on the share ``confidence`` of drives, itself sure to 95 %; infinite
        where too few members were drawn, or some diverge.
    none, none_band : float, (float, float)
        Median and interval without compensation.
    hunts, none_hunts : Chance
        That a drive swings at rest by more than ``still``, with the compensation and without:
        ``.value``, ``.ci95``, ``.count``, ``.members``, and the shares ``.rests`` and ``.unsure``.
    swing, none_swing : float
        What the swing at rest is below, peak to peak in rad, as ``bound`` for the error.
    still : float
        The swing that is no hunting, peak to peak in rad.
    worse : Chance
        That the error is larger than without compensation.
    unit : str
        Of the errors.
    tried : tuple of Tried
        All that was compared, on other members.
    errors : dict of arrays
        Those of the members, "assured" and "none".
    drive : dict
        Rate, dead time, sensor and reference, SI.
    models : tuple of (str, float)
        What the members are drawn from, with the weights.
    messages : tuple of str
        What the choice does not show.

    Examples
    --------
    >>> t = 1e-2 * np.arange(800)
    >>> w = 3.0 * np.sin(np.pi * t) + 0.5 * np.sin(8.0 * t)
    >>> u = 0.002 * np.gradient(w, t) + 0.3 * np.tanh(w / 1e-3) + 0.02 * w
    >>> fit = lg.identify({"t": t, "u": u, "w": w}, lg.Model.of(friction="coulomb"))
    >>> found = lg.assure(fit, 0.8, loop="velocity", observers="extended_state", members=20)
    >>> found.observer, bool(found.bound < found.none)
    ('extended_state', True)
    """

    kind: str
    scale: float
    observer: str | None
    gains: Mapping[str, Any]
    controller: Mapping[str, float]
    confidence: float
    error: float
    band: tuple[float, float]
    bound: float
    none: float
    none_band: tuple[float, float]
    hunts: Chance
    none_hunts: Chance
    swing: float
    none_swing: float
    still: float
    worse: Chance
    unit: str
    tried: tuple[Tried, ...]
    errors: Mapping[str, np.ndarray]
    drive: Mapping[str, Any]
    models: tuple[tuple[str, float], ...]
    messages: tuple[str, ...] = ()

    @property
    def members(self) -> int:
        """The number of drives behind the figures."""
        return self.worse.members

    def summary(self) -> dict[str, Any]:
        """Plain Python, as ``lugrectl assure --json`` prints it."""
        own = {k: v for k, v in vars(self).items() if k != "errors"}
        own |= {"models": [{"model": name, "weight": weight} for name, weight in self.models]}
        return plain({"schema": 1, "members": self.members, **own})

    def plot(self, ax: Any = None) -> Any:
        """Draw the errors over the share of compensation, into ``ax`` or a new figure; returns the
        Axes."""
        return view("loop_plots.assurance")(self, ax)

    def _title(self) -> str:
        if self.observer is None:
            return "Assurance: dare no compensation"
        return (
            f"Assurance: compensate {self.scale:g} of what the {self.observer} observer estimates"
        )

    def _rows(self) -> Iterable[Row]:
        said = "(95 % of the drives from {} to {})"
        yield Row("tracking error", self.error, self.unit, said.format(*map(figure, self.band)))
        yield Row("without", self.none, self.unit, said.format(*map(figure, self.none_band)))
        share = f"on {100.0 * self.confidence:g} % of the drives, sure to 95 %"
        yield Row("error below", self.bound, self.unit, share)
        yield Row("worse than without", self.worse.words())
        yield Row("hunts at rest", self.hunts.words())
        yield Row("without", self.none_hunts.words())
        angle = self.unit.removesuffix("/s")
        swings = f"{figure(self.none_swing)} {angle} without; more than {figure(self.still)} hunts"
        yield Row("swing at rest below", self.swing, angle, f"{share}; {swings}")
        gains = {**self.controller, **{f"observer {k}": v for k, v in self.gains.items()}}
        yield from (Row(name, value) for name, value in gains.items())
        d = self.drive
        said = f"{figure(d['speed'])} {angle}/s at {d['frequency']:g} Hz"
        yield Row("reference", said, "", f"sampled at {d['rate']:g} Hz")
        yield from noticed(self.messages, "messages")


@shows_progress
def assure(
    p: Any,
    confidence: float = 0.95,
    *,
    loop: str = "position",
    kp: float | None = None,
    ki: float | None = None,
    kd: float | None = None,
    bandwidth: float | None = None,
    observers: str | Sequence[str] | None = None,
    gains: Mapping[str, Mapping[str, Any]] | None = None,
    rate: float | None = None,
    dead_time: float | None = None,
    counts: int | None = None,
    speed: float | None = None,
    frequency: float | None = None,
    members: int | None = None,
    seed: int = 0,
    executor: Executor | None = None,
    jobs: int = 1,
    progress: Wanted = None,
    hunts: float = 0.05,
    still: float | None = None,
) -> Assurance:
    """How much friction compensation to dare, with the tracking error that is then to be expected.

    u = C (r - y) + J a + c Fhat + d: controller, acceleration a of the reference, observer, and the
    torque d of the model's effects. c and the observer are those with which the tracking error that
    only a share 1 - confidence of all drives exceeds is least, of those that hunt at rest on at
    most a share ``hunts`` of them. The drives are drawn by :meth:`Diagnosis.sample`; the
    compensation believes the model.

    Parameters
    ----------
    p : Diagnosis, Identification, dict or path
        A result, or its ``report.json``, which holds all that is needed.
    confidence : float
        Share of the drives for which the bound of the error holds.
    loop : "position" or "velocity"
        PID on theta with D on the error of w, or PI on w.
    kp, ki, kd : float, optional
        As in :func:`lugrectl.compensate`. Without them all poles are at -bandwidth.
    bandwidth : float, optional
        In 1/s, for gains that are not given; default: 20, or less at a low rate.
    observers : str or list of str, optional
        Those that are tried; default: natural, friction_state and extended_state, as far as the
        friction law has what they need.
    gains : dict, optional
        Their gains by name, in place of those of :func:`design_gains`.
    rate, dead_time, counts : float, float, int, optional
        Of the controller in Hz, in s, and of the encoder in a turn (in a metre); default: as
        recorded, without dead time.
    speed, frequency : float, optional
        Amplitude in rad/s and frequency in Hz of the reference, a sine; default: 0.8 of the
        record's speed, 1 Hz.
    members : int, optional
        Number of drives; default: as few as give a bound with one drive beyond it, and let one
        hunt; 110 for 0.95 and 0.05.
    seed : int
        Of the drives and of the noise.
    executor, jobs : Executor, int
        As in :func:`sweep`: where members are simulated, and on how many processes.
    progress : callable, True, False or None
        ``progress(fraction, what)``, or whether to show a bar. None: in Jupyter only.
    hunts : float
        Share of the drives that may hunt at rest: the upper end of its 95 % interval. 1: whatever
        it does at rest.
    still : float, optional
        The swing at rest that is no hunting, peak to peak in rad; default: two counts, or where
        the position has no counts a thousandth of the reference's amplitude.

    Returns
    -------
    Assurance
        ``.scale``, ``.observer``, ``.gains``, ``.error`` with ``.band``, ``.bound``, ``.hunts`` and
        ``.swing``, ``.worse``, each with the number of drives behind it.

    Raises
    ------
    InputError
        For an argument that cannot be used, or a file that is no report.
    Refused
        For a value that neither the log determines nor the model declares with a std; the sentence
        names it. For a loop that is unstable without dry friction.

    Notes
    -----
    Standstill is a condition: after a sine that stops, and after a step of a tenth of it, a drive
    hunts that still swings by more than ``still`` from 40 kp/ki on, and rests where its torque is
    constant, or moves to and fro within that swing. A torque that moves one way will break away:
    where 320 kp/ki, or 100 000 samples, do not show how that ends the drive is undecided. A choice
    holds if those that hunt or are undecided are so few, on each half of the members, that the
    interval of Clopper and Pearson ends at ``hunts``; where none holds, if those of them are so few
    that swing farther than without compensation. 0 of n ends near 3.7/n: 0.05 takes 72 drives of
    which none hunts, or 110 of which one does. Fewer show less: then none of them may. ``messages``
    say which of this was needed.

    c and the observer are chosen on members of their own. The figures come from as many others,
    on which a choice was only asked whether it rests, so that they are binomial: with N drives of
    which k lie beyond it, a bound holds for the share ``confidence`` of all drives, itself sure to
    95 %, where P(Bin(N, 1 - confidence) <= k) <= 0.05; 93 drives and k = 1 for 0.95. That is the
    argument of Calafiore and Campi, The Scenario Approach to Robust Control Design, IEEE Trans.
    Automatic Control 51(5), 2006, for one bound. It is about drives like those that the covariance
    draws: what no model of the result has is not in it.

    Examples
    --------
    >>> t = 1e-2 * np.arange(800)
    >>> w = 3.0 * np.sin(np.pi * t) + 0.5 * np.sin(8.0 * t)
    >>> u = 0.002 * np.gradient(w, t) + 0.3 * np.tanh(w / 1e-3) + 0.02 * w
    >>> fit = lg.identify({"t": t, "u": u, "w": w}, lg.Model.of(friction="coulomb"))
    >>> found = lg.assure(fit, 0.8, loop="velocity", observers="extended_state", members=20)
    >>> found.worse.count, found.worse.members
    (0, 20)
    """
    beliefs, seen = believed(p)
    confidence, model = share(confidence, "confidence"), beliefs[0].model
    unit_of(loop, model)
    sensing = _sensing(seen, rate, dead_time, counts, model.motion)
    pole = min(QUICK, fastest(sensing) / 3.0)
    pole = pole if bandwidth is None else positive(bandwidth, "bandwidth", "1/s")
    own = controller({"kp": kp, "ki": ki, "kd": kd}, loop, pole, float(model.J or 0.0))
    top = seen.get("speed") if speed is None else positive(speed, "speed")
    f = 1.0 if frequency is None else positive(frequency, "frequency", "Hz")
    torque = float(seen.get("torque") or 0.0)
    setting = Setting(Task(model, loop, own), sensing, torque, float(top or 1.0), f)
    enough_samples(f, 1.0 / sensing.dt, "the reference")
    hunts, seed = 1.0 if hunts == 1.0 else share(hunts, "hunts"), whole(seed, "seed")
    least = max(enough(1.0 - confidence, 1, 1.0 - SURE), enough(hunts, 1))
    count = least if members is None else whole(members, "members", least=2)
    usual = 2.0 * sensing.resolution or SMALL * setting.travel
    still = usual if still is None else positive(still, "still", "rad")
    named = _observers(setting, observers, gains)
    if setting.grows():
        raise Refused(UNSTABLE)
    drawn = Members(beliefs, 2 * count, seed)
    pairs = list(zip(drawn, range(seed, seed + 2 * count), strict=True))
    run, report = Jobs(executor, whole(jobs, "jobs", 1)), reporter(progress)
    study = Study(run, (pairs[:count], pairs[count:]), setting, confidence, hunts, still)
    return study.answer(*study.chosen(named, report), report, beliefs)


def _sensing(
    seen: Mapping[str, Any], rate: Any, dead_time: Any, counts: Any, motion: str
) -> Sensing:
    rate = seen.get("rate") if rate is None else positive(rate, "rate", "Hz")
    if rate is None:
        raise InputError("rate is missing: the result has no record; give the drive's in Hz.")
    late = not_negative(dead_time or 0.0, "dead_time")
    step = seen.get("resolution") or 0.0
    if counts is not None:
        step = (2.0 * np.pi if motion == "rotary" else 1.0) / whole(counts, "counts", 1)
    return Sensing(1.0 / rate, seen.get("noise") or 0.0, step, seen.get("speed_noise"), late)


def _observers(setting: Setting, wanted: Any, gains: Any) -> dict[str, dict[str, Any]]:
    given = OBSERVERS if wanted is None else [wanted] if isinstance(wanted, str) else wanted
    own, found, model = given_gains(gains), {}, setting.task.model
    for name in (observer_block(k).name for k in given):
        why = unknown(name, model)
        if why is None:
            usual = designed(model, name, setting.sensing.dt, setting.speed)
            found[name] = own.get(name) or usual[0]
        elif wanted is not None:
            raise InputError(f"{name} cannot be tried: {why}")
    return found


CONSTANT = 1e-6  # of its range, by which the torque of a drive at rest still moves
SHRINKS = 0.9  # of its size a third before: a swing that does not persist
SETTLES = 0.5  # the same of a torque that approaches its end: what is left is less than this moved
BLOCKS = 8  # means of the torque
LINE = 4.0  # times their distance from it; eight random means reach that once in 600 times
SLOW = 1e-3  # of the range of the torque: so slow it takes a thousand such runs to break away
WAITS = (40, 320)  # kp/ki of the controller: a run at rest, longer where it is undecided
SHORTEST, LONGEST = 1_000, 100_000  # samples of it
NOISE = 1e-6  # of a motion at its start: it has decayed
STEP, SMALL = 0.1, 1e-3  # of the amplitude of the sine: a step, and a swing that is none
CHUNK = 16  # members in a job


def at_rest(
    theta: np.ndarray, u: np.ndarray, range_u: float, still: float, last: bool
) -> tuple[float, float]:
    """Return the fate of a run by its last thirds, for a swing above ``still``, and the swing;
    ``last``: no longer run comes. Undecided: the torque of a drive that sticks still moves."""
    third = len(theta) // 3
    thirds = slice(-2 * third, -third), slice(-third, None)
    (was, size), (moved, moves) = ([float(np.ptp(x[k])) for k in thirds] for x in (theta, u))
    if moves <= CONSTANT * range_u:
        return RESTS, size
    if min(size, was) > still and (last or size >= SHRINKS * was):
        return HUNTS, size
    # a torque moves one way along a line, by more than it lies about it, and not too slowly
    means = np.array([np.mean(part) for part in np.array_split(u[-2 * third :], BLOCKS)])
    place = np.arange(BLOCKS)
    line = np.polyval(np.polyfit(place, means, 1), place)
    least = max(LINE * np.max(np.abs(means - line)), SLOW * range_u)
    stays = abs(line[-1] - line[0]) <= least or moves <= SETTLES * moved
    if max(size, was) <= still and stays:
        return RESTS, size
    return UNDECIDED, max(size, was)


@dataclass(frozen=True)
class Choice:
    """A compensation: the observer, its gains, and the share of its estimate that is added."""

    observer: str | None = None
    gains: tuple[tuple[str, Any], ...] = ()
    scale: float = 0.0


NOTHING = Choice()
Pairs = Sequence[tuple[Model, int]]  # drives, each with the seed of its noise


@dataclass(frozen=True, eq=False)
class Setting:
    """What is equal for all members: controller, belief, sensor, a sine of the speed from rest."""

    task: Task
    sensing: Sensing
    torque: float
    speed: float
    frequency: float

    def samples(self, periods: float) -> int:
        return samples(periods, self.frequency, 1.0 / self.sensing.dt)

    def rows(self, periods: float) -> dict[str, np.ndarray]:
        t = self.sensing.dt * np.arange(self.samples(periods))
        return sine(t, self.speed, self.frequency).rows(self.task.kind)

    @property
    def travel(self) -> float:
        """Return the amplitude of the position in rad."""
        return self.speed / (2.0 * np.pi * self.frequency)

    def stopped(self, length: int) -> dict[str, np.ndarray]:
        """Return a period of the sine, then so many samples at its start."""
        return {k: np.r_[x, np.zeros(length)] for k, x in self.rows(1.0).items()}

    def stepped(self, length: int) -> dict[str, np.ndarray]:
        """Return the same after a step: of the position, or of the speed to 0."""
        made = {k: 0.0 * x for k, x in self.stopped(length).items()}
        if self.task.kind == "velocity":
            made["r"][:-length] = STEP * self.speed
        else:
            made["r"][1:] = STEP * self.travel
        return made

    def waits(self) -> list[int]:
        kp, ki = (self.task.controller[k] for k in ("kp", "ki"))
        unit = kp / ki if ki > 0.0 < kp else 0.25 / self.frequency
        most = min(LONGEST, math.ceil(WAITS[-1] * unit / self.sensing.dt))
        every = [max(SHORTEST, math.ceil(k * unit / self.sensing.dt)) for k in WAITS]
        return sorted({min(n, most) for n in every})

    def grows(self) -> bool:
        """Return whether the loop of a drive without dry friction swings ever more."""
        known, length = self.task.model.known(), self.waits()[0]
        free = Model.of(friction="viscous", J=known["J"], Fv=known.get("Fv", 0.0))
        quiet = replace(self, task=replace(self.task, model=free), sensing=self.sensing.quiet())
        y = loop_of(quiet, None, ()).run(self.stepped(length))[MEASURED[self.task.kind]]
        if not np.isfinite(y[-1]):
            return True
        first, before, now = (float(np.ptp(part)) for part in np.array_split(y[-length:], 3))
        return now > before and now > NOISE * first


@lru_cache(maxsize=8)
def loop_of(setting: Setting, observer: str | None, gains: tuple[Any, ...]) -> SampledLoop:
    task = setting.task
    control = task.control(None if observer is None else task.model, observer, dict(gains))
    return SampledLoop(task, setting.sensing, control, FASTEST * setting.speed)


def tracking(setting: Setting, choices: Sequence[Choice], members: Pairs) -> np.ndarray:
    """Return the RMS errors (members, choices) of members with several compensations."""
    rows, counted, columns = setting.rows(PERIODS), slice(setting.samples(SETTLED), None), []
    for choice in choices:
        loop = loop_of(setting, choice.observer, choice.gains)
        own: Any = {"torque": setting.torque, "params": {"compensation.scale": choice.scale}}
        runs = (loop.run(rows, m, seed=seed, **own) for m, seed in members)
        columns.append([rms(run["e"][counted]) for run in runs])
    return np.array(columns).T


def waiting(setting: Setting, choice: Choice, still: float, members: Pairs) -> np.ndarray:
    """Return fate and swing of each, without noise: the worse after a stop and after a step."""
    loop, lengths = loop_of(setting, choice.observer, choice.gains), setting.waits()
    sensing, scale = setting.sensing.still(), {"compensation.scale": choice.scale}

    def rest(model: Model, start: Any) -> tuple[float, float]:
        seen = UNDECIDED, math.inf
        for length in lengths:
            done = loop.run(start(length), model, sensing, params=scale)
            theta, u, last = done["theta"][-length:], done["u_fb"], length == lengths[-1]
            if not np.isfinite(theta[-1]):
                return HUNTS, math.inf
            seen = at_rest(theta, u[-length:], float(np.ptp(u)), still, last)
            if seen[0] != UNDECIDED:
                break
        return seen

    starts = setting.stopped, setting.stepped
    return np.array([max(rest(model, start) for start in starts) for model, _ in members])


@dataclass(frozen=True)
class Jobs:
    """Where members are simulated, and so many in one job."""

    executor: Executor | None
    number: int
    chunk: int = CHUNK

    def __call__(self, work: Any, report: Progress, members: Sequence[Any]) -> np.ndarray:
        """Return what comes of all members, in order."""
        chunks = [members[i : i + self.chunk] for i in range(0, len(members), self.chunk)]
        found: dict[int, np.ndarray] = {}
        for i, rows in run_jobs(work, chunks, executor=self.executor, jobs=self.number):
            if isinstance(rows, JobError):
                raise (InputError if rows.exit_code == 2 else Refused)(rows.sentence)
            found[i] = rows
            report(len(found) / len(chunks), "simulating drives")
        return np.vstack([found[i] for i in range(len(chunks))])


@dataclass(eq=False)
class Study:
    """Compensations that are tried on the first half of the members, and the best that holds at
    rest on both, with its errors on the last half."""

    run: Jobs
    halves: tuple[Pairs, Pairs]
    setting: Setting
    confidence: float
    hunts: float
    still: float
    tried: dict[Choice, Tried] = field(default_factory=dict)
    none: float = np.inf
    seen: dict[Any, np.ndarray] = field(default_factory=dict)

    def chosen(
        self, named: Mapping[str, Mapping[str, Any]], report: Progress
    ) -> tuple[Choice, str]:
        """Return the best choice that holds on both halves, by the first of the RULES with one."""
        for i, (name, gains) in enumerate(named.items()):
            part = part_of(report, 0.25 * i / len(named), 0.25 * (i + 1) / len(named))
            self._add([Choice(name, tuple(gains.items()), scale) for scale in SCALES], part)
        for rule in RULES:
            if (found := self._holding(rule, report)) is not NOTHING:
                return found, rule
        return NOTHING, BESIDE

    def _add(self, choices: Sequence[Choice], report: Progress) -> None:
        work = partial(tracking, self.setting, [NOTHING, *choices])
        none, *columns = self.run(work, report, self.halves[0]).T
        self.none = self._upper(none)
        for one, own in zip(choices, columns, strict=True):
            name, worse = (one.observer or "").removesuffix("_observer"), np.mean(own > none)
            row = (self._upper(own), float(np.median(own)), float(worse))
            self.tried[one] = Tried(name, one.scale, *row)

    def _upper(self, errors: np.ndarray) -> float:
        """Return the error that a share 1 - confidence of the members exceeds."""
        return float(np.quantile(errors, self.confidence, method="higher"))

    def better(self) -> list[Choice]:
        """Return the choices that track better than none on nearly all drives, the best first."""
        most, rows = 1.0 - self.confidence, self.tried
        able = [k for k, row in rows.items() if row.worse <= most and row.upper < self.none]
        return sorted(able, key=lambda k: rows[k].upper)

    def _holding(self, rule: str, report: Progress) -> Choice:
        for i, choice in enumerate(every := self.better()):
            place = (RULES.index(rule) + i / len(every)) / len(RULES)
            report(0.25 + 0.65 * place, "waiting for drives to rest")
            if all(self._holds(choice, rule, half) for half in range(2)):
                return choice
        return NOTHING

    def _holds(self, choice: Choice, rule: str, half: int) -> bool:
        """Return whether few enough members of a half fail by one of the RULES."""
        none = self.rests(NOTHING, half)[:, 1] if rule == BESIDE else np.zeros(0)

        def fails(rows: np.ndarray) -> np.ndarray:
            fate, swing = rows.T
            if rule == RESTING:
                return fate != RESTS
            return (fate != RESTS) & (swing > np.maximum(none[: len(rows)], self.still))

        return bool(fails(self.rests(choice, half, fails)).sum() <= self._most(half))

    def _most(self, half: int) -> int:
        many = len(self.halves[half])
        return many if self.hunts == 1.0 else max(few(many, self.hunts), 0)

    def rests(self, choice: Choice, half: int = 1, fails: Any = None) -> np.ndarray:
        """Return fate and swing of each member of a half; of the first ones once more of them
        fail than may."""
        pairs, rows = self.halves[half], self.seen.get((choice, half), np.zeros((0, 2)))
        while len(rows) < len(pairs) and (fails is None or fails(rows).sum() <= self._most(half)):
            more = pairs[len(rows) : max(FIRST, MORE * len(rows))]
            work = partial(waiting, self.setting, choice, self.still)
            rows = np.vstack([rows, self.run(work, reporter(False), more)])
            self.seen[choice, half] = rows
        return rows

    def answer(
        self, best: Choice, rule: str, report: Progress, beliefs: Sequence[Belief]
    ) -> Assurance:
        setting, confidence = self.setting, self.confidence
        work = partial(tracking, setting, list(dict.fromkeys([NOTHING, best])))
        errors = self.run(work, part_of(report, 0.9, 1.0), self.halves[1])
        none, own, task = errors[:, 0], errors[:, -1], setting.task
        fates, none_fates = self.rests(best), self.rests(NOTHING)
        hunted = {k[0]: float(np.mean(v[:, 0] == HUNTS)) for k, v in self.seen.items() if not k[1]}
        drive = {"rate": 1.0 / setting.sensing.dt, "dead_time": setting.sensing.delay}
        drive |= {k: getattr(setting.sensing, k) for k in ("resolution", "noise", "speed_noise")}
        drive |= {k: getattr(setting, k) for k in ("torque", "speed", "frequency")}
        return Assurance(
            kind=task.kind,
            scale=best.scale,
            observer=best.observer and best.observer.removesuffix("_observer"),
            gains=dict(best.gains),
            controller=dict(task.controller),
            confidence=confidence,
            error=float(np.median(own)),
            band=band(own),
            bound=bound(own, confidence),
            none=float(np.median(none)),
            none_band=band(none),
            hunts=Chance.of(fates[:, 0]),
            none_hunts=Chance.of(none_fates[:, 0]),
            swing=bound(fates[:, 1], confidence),
            none_swing=bound(none_fates[:, 1], confidence),
            still=self.still,
            worse=Chance(int(np.sum(own > none)), len(own)),
            unit=unit_of(task.kind, task.model),
            tried=tuple(replace(row, hunts=hunted.get(k)) for k, row in self.tried.items()),
            errors={"assured": own, "none": none},
            drive=drive,
            models=tuple((b.model.name, b.weight) for b in beliefs),
            messages=tuple(self._messages(best, rule)),
        )

    def _messages(self, best: Choice, rule: str) -> Iterable[str]:
        part, count = f"{100.0 * self.hunts:g} % of the drives", len(self.halves[1])
        if count < (least := enough(self.hunts, 0)):
            ends = 100.0 * Chance(0, count).ci95[1]
            yield (f"{count} drives cannot show that at most {part} hunt: if none of them "
                   f"does, up to {ends:.2g} % may; members={least} can.")  # fmt: skip
        if best is NOTHING and self.better():
            yield (f"compensations that track better swing at rest on more than {part}, and "
                   "farther than without compensation.")  # fmt: skip
        elif best is not NOTHING and rule == BESIDE:
            yield (f"every compensation hunts or is undecided on more than {part}; this one swings "
                   "no farther than without compensation.")  # fmt: skip
        if unsure := Chance.of(self.rests(best)[:, 0]).unsure:
            seconds = self.setting.waits()[-1] * self.setting.sensing.dt
            yield (f"on {100.0 * unsure:.3g} % of the drives the torque still moves after "
                   f"{seconds:.3g} s at rest: whether they hunt is not decided.")  # fmt: skip

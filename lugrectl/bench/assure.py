"""How much friction compensation to dare, on drives that the log leaves possible."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np

from ..blocks.observers import observer_block
from ..core.display import Row, noticed
from ..core.display import number as figure
from ..core.errors import InputError, Refused
from ..core.progress import Progress, Wanted, part_of, reporter, shows_progress
from ..core.result import Result, plain
from ..core.validation import number, positive, share, whole
from ..core.views import view
from ..estimates.members import Belief, Members
from ..simulation.encoder import Sensing
from . import member_runs
from .chance import Chance, Outcomes, band, bound, enough, enough_at_rest, hunting_at_most
from .gains import controller, designed, fastest, given_gains, lacking
from .loop import Task, enough_samples, kind_of, unit_of
from .member_runs import HUNTS, RESTS, Choice, Jobs, Pairs, Setting, believed, grows

NOTHING = Choice()
NEAR = (-0.1, -0.05, 0.05, 0.1)  # from the best of them, tried after it
RESTING, UNSURE, BESIDE = RULES = ("rests", "does not hunt", "swings no farther than without")
FIRST, MORE = 4, 5  # drives that are looked at first, and how many times as many then
OBSERVERS = ("natural", "friction_state", "extended_state")
SCALES = (0.4, 0.6, 0.8, 1.0, 1.2)
QUICK = 20.0  # 1/s, pole of the usual controller, or a third of the crossover that sampling allows
UNSTABLE = (
    "the loop is unstable by itself: with these gains, rate and dead time a drive without dry "
    "friction swings ever more; give a lower bandwidth, or other gains."
)


@dataclass(frozen=True)
class Tried:
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
    hunts, none_hunts : Outcomes
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
    hunts: Outcomes
    none_hunts: Outcomes
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
        keys = ("kind", "scale", "observer", "gains", "controller", "confidence", "error", "band",
                "bound", "none", "none_band", "unit", "drive", "members", "swing", "none_swing",
                "still", "messages")  # fmt: skip
        made: dict[str, Any] = {"schema": 1, **{k: getattr(self, k) for k in keys}}
        made |= {k: getattr(self, k).summary() for k in ("hunts", "none_hunts", "worse")}
        made["models"] = [{"model": name, "weight": w} for name, w in self.models]
        return plain(made | {"tried": [vars(one) for one in self.tried]})

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
        for name, value in gains.items():
            yield Row(name, value)
        d, speed = self.drive, f"{self.unit.removesuffix('/s')}/s"
        said = f"{figure(d['speed'])} {speed} at {d['frequency']:g} Hz"
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
    interval of Clopper and Pearson ends at ``hunts``; where none holds, if those that hunt are so
    few; where none does, those that swing farther than without compensation. 0 of n ends near
    3.7/n: 0.05 takes 72 drives of which none hunts, or 110 of which one does. Fewer show less: then
    none of them may. ``messages`` say which of this was needed.

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
    kind_of(loop)
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
    least = max(enough(confidence), enough_at_rest(hunts, spare=1))
    count = least if members is None else whole(members, "members", least=2)
    still = setting.usual_still() if still is None else positive(still, "still", "rad")
    named = _observers(setting, observers, gains)
    if grows(setting):
        raise Refused(UNSTABLE)
    drawn, report = Members(beliefs, 2 * count, seed), reporter(progress)
    pairs = list(zip(drawn, range(seed, seed + 2 * count), strict=True))
    run = Jobs(executor, whole(jobs, "jobs", 1))
    tries = Tries(run, pairs[:count], setting, confidence)
    for i, (name, gained) in enumerate(named.items()):
        part = part_of(report, 0.2 * i / len(named), 0.2 * (i + 1) / len(named))
        tries.add([Choice(name, gained, scale) for scale in SCALES], part)
    if better := tries.better():
        tries.near(better[0], part_of(report, 0.2, 0.25))
    halves = [
        Standstill(run, half, setting, still, hunts) for half in (pairs[:count], pairs[count:])
    ]
    best, rule = chosen(tries, halves, part_of(report, 0.25, 0.9))
    compared = [NOTHING] if best is NOTHING else [NOTHING, best]
    work = partial(member_runs.tracking, setting, compared)
    errors = run(work, part_of(report, 0.9, 1.0), pairs[count:])
    return _answer(tries, halves, (best, rule), errors, beliefs)


def _sensing(
    seen: Mapping[str, Any], rate: Any, dead_time: Any, counts: Any, motion: str
) -> Sensing:
    rate = seen.get("rate") if rate is None else positive(rate, "rate", "Hz")
    if rate is None:
        raise InputError("rate is missing: the result has no record; give the drive's in Hz.")
    late = number(dead_time or 0.0, "dead_time")
    if late < 0.0:
        raise InputError(f"dead_time = {late:g} is negative.")
    step = seen.get("resolution") or 0.0
    if counts is not None:
        step = (2.0 * np.pi if motion == "rotary" else 1.0) / whole(counts, "counts", 1)
    return Sensing(1.0 / rate, seen.get("noise") or 0.0, step, seen.get("speed_noise"), late)


def _observers(setting: Setting, wanted: Any, gains: Any) -> dict[str, dict[str, Any]]:
    """Return the observers that are tried, by full name, with their gains by the design rule."""
    given = OBSERVERS if wanted is None else [wanted] if isinstance(wanted, str) else wanted
    own, found, model = given_gains(gains), {}, setting.task.model
    dt, speed = setting.sensing.dt, setting.speed
    for name in (observer_block(k).name for k in given):
        if not (lacks := lacking(name, model)):
            found[name] = own.get(name) or designed(model, name, dt, speed)[0]
        elif wanted is not None:
            law = model.friction.block.name
            raise InputError(
                f"{name} must know {', '.join(lacks)}, which {law} friction does not have."
            )
    return found


def _answer(
    tries: Tries,
    halves: Sequence[Standstill],
    chosen: tuple[Choice, str],
    errors: np.ndarray,
    beliefs: Sequence[Belief],
) -> Assurance:
    """Return the result of a choice by one of the RULES; ``errors`` of members it has not seen."""
    (best, rule), confidence, (first, last) = chosen, tries.confidence, halves
    setting, tried = tries.setting, zip(tries.tried, tries.choices, strict=True)
    none, own, task, sensing = errors[:, 0], errors[:, -1], setting.task, setting.sensing
    swing, none_swing = (bound(last.rows(k)[:, 1], confidence) for k in (best, NOTHING))
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
        hunts=last.outcomes(best),
        none_hunts=last.outcomes(NOTHING),
        swing=swing,
        none_swing=none_swing,
        still=last.still,
        worse=Chance(int(np.sum(own > none)), len(own)),
        unit=unit_of(task.kind, task.model),
        tried=tuple(replace(one, hunts=first.share(choice)) for one, choice in tried),
        errors={"assured": own, "none": none},
        drive={
            "rate": 1.0 / sensing.dt,
            "dead_time": sensing.delay,
            **{k: getattr(sensing, k) for k in ("resolution", "noise", "speed_noise")},
            **{k: getattr(setting, k) for k in ("torque", "speed", "frequency")},
        },
        models=tuple((b.model.name, b.weight) for b in beliefs),
        messages=_messages(tries, last, best, rule),
    )


def _messages(tries: Tries, last: Standstill, best: Choice, rule: str) -> tuple[str, ...]:
    """Return what the choice does not show."""
    part, said, count = f"{100.0 * last.hunts:g} % of the drives", [], len(last.pairs)
    if count < (least := enough_at_rest(last.hunts)):
        ends = 100.0 * Outcomes(0, count).ci95[1]
        said.append(f"{count} drives cannot show that at most {part} hunt: if none of them "
                    f"does, up to {ends:.2g} % may; members={least} can.")  # fmt: skip
    if best is NOTHING and tries.better():
        said.append(f"compensations that track better swing at rest on more than {part}, and "
                    "farther than without compensation.")  # fmt: skip
    elif best is not NOTHING and rule == BESIDE:
        said.append(f"every compensation hunts on more than {part}; this one swings no farther "
                    "than without compensation.")  # fmt: skip
    if unsure := last.outcomes(best).unsure:
        seconds = last.setting.waits()[-1] * last.setting.sensing.dt
        said.append(f"on {100.0 * unsure:.3g} % of the drives the torque still moves after "
                    f"{seconds:.3g} s at rest: whether they hunt is not decided.")  # fmt: skip
    return tuple(said)


@dataclass(eq=False)
class Standstill:
    """What becomes of one half of the members at rest, with each choice; each is run once."""

    run: Jobs
    pairs: Pairs
    setting: Setting
    still: float
    hunts: float
    seen: dict[Any, np.ndarray] = field(default_factory=dict)

    @property
    def most(self) -> int:
        return max(hunting_at_most(len(self.pairs), self.hunts), 0)

    def rows(self, choice: Choice, fails: Any = None) -> np.ndarray:
        """Return a :class:`Rest` of each member, of the first ones once more than ``most`` fail."""
        key = choice.observer, choice.scale
        rows = self.seen.get(key, np.zeros((0, 2)))
        while len(rows) < len(self.pairs) and (fails is None or fails(rows).sum() <= self.most):
            more = self.pairs[len(rows) : max(FIRST, MORE * len(rows))]
            work = partial(member_runs.waiting, self.setting, choice, self.still)
            rows = self.seen[key] = np.vstack([rows, self.run(work, reporter(False), more)])
        return rows

    def holds(self, choice: Choice, rule: str) -> bool:
        """Return whether few enough members fail by one of the RULES."""
        none = self.rows(NOTHING)[:, 1] if rule == BESIDE else np.zeros(0)

        def fails(rows: np.ndarray) -> np.ndarray:
            fate, swing = rows.T
            if rule == BESIDE:
                return (fate != RESTS) & (swing > np.maximum(none[: len(rows)], self.still))
            return fate == HUNTS if rule == UNSURE else fate != RESTS

        return bool(fails(self.rows(choice, fails)).sum() <= self.most)

    def outcomes(self, choice: Choice) -> Outcomes:
        """Return the shares of all members."""
        return Outcomes.of(self.rows(choice)[:, 0])

    def share(self, choice: Choice) -> float | None:
        """Return the share that hunts of those that were looked at."""
        rows = self.seen.get((choice.observer, choice.scale))
        return None if rows is None else float(np.mean(rows[:, 0] == HUNTS))


@dataclass
class Tries:
    """Compensations on the first members, beside none."""

    run: Jobs
    pairs: Pairs
    setting: Setting
    confidence: float
    choices: list[Choice] = field(default_factory=list)
    tried: list[Tried] = field(default_factory=list)
    none: float = np.inf

    def add(self, choices: Sequence[Choice], report: Progress) -> None:
        """Try these, too, where they are new."""
        choices = [one for one in choices if one not in self.choices]
        work = partial(member_runs.tracking, self.setting, [NOTHING, *choices])
        errors = self.run(work, report, self.pairs)
        none, self.none = errors[:, 0], self._upper(errors[:, 0])
        self.choices += choices
        for choice, own in zip(choices, errors.T[1:], strict=True):
            name = (choice.observer or "").removesuffix("_observer")
            worse = float(np.mean(own > none))
            middle = float(np.median(own))
            self.tried.append(Tried(name, choice.scale, self._upper(own), middle, worse))

    def _upper(self, errors: np.ndarray) -> float:
        """Return the error that a share 1 - confidence of the members exceeds."""
        return float(np.quantile(errors, self.confidence, method="higher"))

    def near(self, best: Choice, report: Progress) -> None:
        """Try other shares of a choice."""
        self.add([replace(best, scale=round(best.scale + d, 2)) for d in NEAR], report)

    def better(self) -> list[Choice]:
        """Return the choices that track better than none on nearly all drives, the best first."""
        most, rows = 1.0 - self.confidence, zip(self.tried, self.choices, strict=True)
        able = [row for row in rows if row[0].worse <= most and row[0].upper < self.none]
        return [choice for _, choice in sorted(able, key=lambda row: row[0].upper)]


def chosen(tries: Tries, halves: Sequence[Standstill], report: Progress) -> tuple[Choice, str]:
    """Return the best choice that holds on both halves, by the first of the RULES with one."""

    def holding(rule: str) -> Choice:
        for i, choice in enumerate(every := tries.better()):
            part = (RULES.index(rule) + i / len(every)) / len(RULES)
            report(part, "waiting for drives to rest")
            if all(half.holds(choice, rule) for half in halves):
                return choice
        return NOTHING

    for rule in RULES:
        if (found := holding(rule)) is not NOTHING:
            tries.near(found, reporter(False))
            return holding(rule), rule
    return NOTHING, BESIDE

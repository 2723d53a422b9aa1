"""How much friction compensation to dare, on drives that the log leaves possible."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import replace
from typing import Any

import numpy as np

from ..blocks.aliases import name_of
from ..blocks.block import unit_for
from ..blocks.controllers import MEASURED
from ..blocks.model import Model, values_of
from ..blocks.observers import observer_block
from ..core.errors import InputError, Refused
from ..core.jobs import JobError, run_jobs
from ..core.progress import Progress, Wanted, part_of, reporter, shows_progress
from ..core.validation import number, positive, share, shown, whole
from ..design import design_gains
from ..design.observer_rules import RULES
from ..estimates.members import Belief, Members
from ..simulation.encoder import Sensing
from .assured import Assurance
from .believed import believed
from .chance import Chance, Outcomes, band, bound, enough, enough_at_rest
from .choosing import BESIDE, Standstill, Tries, chosen
from .gains import controller
from .loop import Task
from .member_runs import PERIODS, Choice, Setting, Work, grows

LUGRE = ("J", "sigma0", "sigma1", "Fc", "Fs", "Fv", "vs")
OBSERVERS = ("natural", "friction_state", "extended_state")
SCALES = (0.4, 0.6, 0.8, 1.0, 1.2)
LAG = 0.4  # rad that sampling and dead time take at three times the controller's pole
FEWEST, MOST = 20, 50_000  # samples of a run
CHUNK = 16  # members in a task
UNSTABLE = (
    "the loop is unstable by itself: with these gains, rate and dead time a drive without dry "
    "friction swings ever more; give a lower bandwidth, or other gains."
)


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
    >>> t = 1e-3 * np.arange(8000)
    >>> w = 3.0 * np.sin(np.pi * t) + 0.5 * np.sin(8.0 * t)
    >>> u = 0.002 * np.gradient(w, t) + 0.3 * np.tanh(w / 1e-3) + 0.02 * w
    >>> fit = lg.identify({"t": t, "u": u, "w": w}, lg.Model.of(friction="coulomb"))
    >>> found = lg.assure(fit, loop="velocity", observers="extended_state", members=60)
    >>> found.worse.count, found.worse.members
    (0, 60)
    """
    beliefs, seen = believed(p)
    confidence, model = share(confidence, "confidence"), beliefs[0].model
    if not isinstance(loop, str) or loop not in MEASURED:
        raise InputError(f"unknown loop {shown(loop)}; known: {', '.join(MEASURED)}.")
    asked = {"rate": rate, "dead_time": dead_time, "counts": counts}
    sensing, torque = _sensing(seen, asked, model.motion), float(seen.get("torque") or 0.0)
    pole = _pole(sensing) if bandwidth is None else positive(bandwidth, "bandwidth", "1/s")
    own = controller({"kp": kp, "ki": ki, "kd": kd}, loop, pole, float(model.J or 0.0))
    fast = seen.get("speed") if speed is None else positive(speed, "speed")
    setting = Setting(
        Task(model, None, loop, own),
        sensing,
        torque,
        float(fast or 1.0),
        1.0 if frequency is None else positive(frequency, "frequency", "Hz"),
    )
    if not FEWEST <= setting.samples(PERIODS) <= MOST:
        raise InputError(f"the reference takes {setting.samples(PERIODS)} samples, outside "
                         f"{FEWEST} to {MOST}: give another frequency.")  # fmt: skip
    hunts = 1.0 if hunts == 1.0 else share(hunts, "hunts")
    seed = whole(seed, "seed")
    least = max(enough(confidence), enough_at_rest(hunts, spare=1))
    count = least if members is None else whole(members, "members", least=2)
    still = setting.usual_still() if still is None else positive(still, "still", "rad")
    named = _observers(setting, observers, gains)
    if grows(setting):
        raise Refused(UNSTABLE)
    drawn, report = Members(beliefs, 2 * count, seed), reporter(progress)
    pairs = list(zip(drawn, range(seed, seed + 2 * count), strict=True))
    run = _Runs(executor, jobs)
    tries = Tries(run, pairs[:count], setting, confidence)
    for i, (name, own) in enumerate(named.items()):
        part = part_of(report, 0.2 * i / len(named), 0.2 * (i + 1) / len(named))
        tries.add([Choice(name, own, c) for c in SCALES], part)
    if better := tries.better():
        tries.near(better[0], part_of(report, 0.2, 0.25))
    halves = [Standstill(run, own, setting, still, hunts) for own in (pairs[:count], pairs[count:])]
    best, rule = chosen(tries, halves, part_of(report, 0.25, 0.9))
    compared = Work(setting, [None] if best is None else [None, best])
    errors = run(compared, part_of(report, 0.9, 1.0), pairs[count:])
    said = _said(count, hunts, tries, halves[1].outcomes(best).unsure, best, rule)
    return _answer(setting, best, tries, halves, errors, beliefs, said)


def _said(
    count: int, hunts: float, tries: Tries, unsure: float, best: Choice | None, rule: str
) -> tuple[str, ...]:
    """What the choice does not show."""
    part, made = f"{100.0 * hunts:g} % of the drives", []
    if count < (least := enough_at_rest(hunts)):
        ends = 100.0 * Outcomes(0, count).ci95[1]
        made.append(f"{count} drives cannot show that at most {part} hunt: if none of them does, "
                    f"up to {ends:.2g} % may; members={least} can.")  # fmt: skip
    if best is None and tries.better():
        made.append(f"compensations that track better swing at rest on more than {part}, and "
                    "farther than without compensation.")  # fmt: skip
    elif best is not None and rule == BESIDE:
        made.append(f"every compensation hunts on more than {part}; this one swings no farther "
                    "than without compensation.")  # fmt: skip
    if unsure:
        seconds = tries.setting.waits()[-1] * tries.setting.sensing.dt
        made.append(f"on {100.0 * unsure:.3g} % of the drives the torque still moves after "
                    f"{seconds:.3g} s at rest: whether they hunt is not decided.")  # fmt: skip
    return tuple(made)


def _sensing(seen: Mapping[str, Any], asked: Mapping[str, Any], motion: str) -> Sensing:
    rate = seen.get("rate") if asked["rate"] is None else positive(asked["rate"], "rate", "Hz")
    if rate is None:
        raise InputError("rate is missing: the result has no record; give the drive's in Hz.")
    late = number(asked["dead_time"] or 0.0, "dead_time")
    if late < 0.0:
        raise InputError(f"dead_time = {late:g} is negative.")
    step = seen.get("resolution") or 0.0
    if asked["counts"] is not None:
        step = (2.0 * np.pi if motion == "rotary" else 1.0) / whole(asked["counts"], "counts", 1)
    return Sensing(1.0 / rate, seen.get("noise") or 0.0, step, seen.get("speed_noise"), late)


def _pole(sensing: Sensing) -> float:
    """Of the usual controller in 1/s, as far as sampling and dead time allow it."""
    late = 0.5 * sensing.dt * (1.0 + (sensing.speed_noise is None)) + sensing.delay
    return min(20.0, LAG / late / 3.0)


def _observers(setting: Setting, wanted: Any, gains: Any) -> dict[str, dict[str, Any]]:
    """The observers that are tried, by full name, with their gains by the design rule."""
    given = OBSERVERS if wanted is None else [wanted] if isinstance(wanted, str) else wanted
    own = {observer_block(name_of("observer", k)).name: dict(v) for k, v in (gains or {}).items()}
    made, model = {}, setting.task.model
    for name in given:
        block = observer_block(name_of("observer", name))
        lacks = [k for k in LUGRE if k in block.parameters and model.values().get(k) is None]
        if lacks and wanted is not None:
            raise InputError(f"{block.name} must know {', '.join(lacks)}, which "
                             f"{model.friction.block.name} friction does not have.")  # fmt: skip
        if not lacks:
            made[block.name] = own.get(block.name) or _designed(setting, block.name)
    return made


def _designed(setting: Setting, name: str) -> dict[str, Any]:
    speed, choices = setting.speed, RULES[name].choices if name in RULES else {}
    usual: dict[str, Any] = {
        "dt": setting.sensing.dt,
        "M": 1.5 * speed,
        "speed": speed,
        "w0": 0.2 * speed,
    }
    wanted = {k: v for k, v in usual.items() if k in choices}
    return dict(design_gains(values_of(setting.task.model), observer=name, **wanted).gains)


class _Runs:
    """Members on an executor, in chunks; their errors in order."""

    def __init__(self, executor: Executor | None, jobs: int) -> None:
        self.executor, self.jobs = executor, whole(jobs, "jobs", 1)

    def __call__(
        self, work: Work, report: Progress, pairs: Sequence[tuple[Model, int]]
    ) -> np.ndarray:
        parts = [pairs[i : i + CHUNK] for i in range(0, len(pairs), CHUNK)]
        found: dict[int, np.ndarray] = {}
        for i, rows in run_jobs(work, parts, executor=self.executor, jobs=self.jobs):
            if isinstance(rows, JobError):
                raise Refused(f"members {i * CHUNK} and on: {rows.sentence}")
            found[i] = rows
            report(len(found) / len(parts), "simulating drives")
        return np.vstack([found[i] for i in range(len(parts))])


def _answer(
    setting: Setting,
    best: Choice | None,
    tries: Tries,
    halves: Sequence[Standstill],
    errors: np.ndarray,
    beliefs: Sequence[Belief],
    said: tuple[str, ...],
) -> Assurance:
    none, own, n = errors[:, 0], errors[:, -1], len(errors)
    model, kind, confidence = setting.task.model, setting.task.kind, tries.confidence
    first, last = halves
    swings = [bound(last.rows(one)[:, 1], confidence) for one in (best, None)]
    tried = zip(tries.tried, tries.choices, strict=True)
    return Assurance(
        kind=kind,
        scale=0.0 if best is None else best.scale,
        observer=None if best is None else best.observer.removesuffix("_observer"),
        gains={} if best is None else dict(best.gains),
        controller=dict(setting.task.controller),
        confidence=confidence,
        error=float(np.median(own)),
        band=band(own),
        bound=bound(own, confidence),
        none=float(np.median(none)),
        none_band=band(none),
        hunts=last.outcomes(best),
        none_hunts=last.outcomes(None),
        swing=swings[0],
        none_swing=swings[1],
        still=last.still,
        worse=Chance(int(np.sum(own > none)), n),
        unit=unit_for("rad/s" if kind == "velocity" else "rad", model.motion),
        tried=tuple(replace(one, hunts=first.share(choice)) for one, choice in tried),
        errors={"assured": own, "none": none},
        drive={
            "rate": 1.0 / setting.sensing.dt,
            "dead_time": setting.sensing.delay,
            "resolution": setting.sensing.resolution,
            "noise": setting.sensing.noise,
            "speed_noise": setting.sensing.speed_noise,
            "torque": setting.torque,
            "speed": setting.speed,
            "frequency": setting.frequency,
        },
        models=tuple((b.model.name, b.weight) for b in beliefs),
        messages=said,
    )

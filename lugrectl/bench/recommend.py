"""Which observer for this drive: all that it can run, simulated on it and put in order."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property, partial
from typing import Any

import numpy as np

from ..blocks.aliases import meant
from ..blocks.block import unit_for
from ..blocks.controllers import MEASURED
from ..blocks.model import Model, as_model
from ..blocks.observers import observer_block
from ..blocks.plant import plant
from ..core.display import Row, Shown
from ..core.display import number as figure
from ..core.errors import Diverged, InputError
from ..core.numeric import rms
from ..core.progress import Progress, Wanted, part_of, reporter, shows_progress
from ..core.result import Result, library, plain
from ..core.validation import flag, number, positive, real, share, shown
from ..core.views import view
from ..design import Certificate
from ..design.gains import RULES, SAMPLED
from ..estimates.fitted import Fitted
from ..loops.parts import crossing
from ..record import Record
from ..record.as_record import as_record, is_record
from ..simulation.encoder import Sensing
from .compare import by_reason, chosen_observers
from .gains import LUGRE, correction, designed, fastest, given_gains, unknown
from .loop import SETTLED, Terms, enough_samples, sensing_of, sine, top_speed, unit_of, wrong

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
        rows += [Row("not admissible", f"{k}: {why}") for why, k in by_reason(self.refused)]
        drive = f"{self.drive['rate']:g} Hz, {', '.join(self.drive['measured'])} measured"
        rows.append(Row("drive", drive, "", f"(from {self.drive['source']})"))
        rows.append(Row("without", f"{figure(self.none, 3)} {self.unit}", "", "RMS error"))
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
    return f"{figure(value, 3)} {unit}" if value >= 1.0 else f"{figure(1e3 * value, 3)} m{unit}"


def reasons(
    row: Candidate, order: Sequence[Candidate], none: float, units: Mapping[str, str], level: float
) -> tuple[str, ...]:
    """Sentences on a candidate; the first compares it with the others."""
    place = [one.name for one in order].index(row.name)
    most = f"{quantity(row.worst, units['e'])}{_with(row)}"
    if place == 0:
        text = f"Its error is at most {most}"
        text += f"; without an observer it is {quantity(none, units['e'])}"
        if len(order) > 1:
            second = order[1]
            text += f", with {second.name}, the next, up to {quantity(second.worst, units['e'])}"
            if row.worst > second.worst or second.worst <= ALIKE * row.worst:
                text += ", about the same; this one passes less noise to the torque"
    else:
        best = order[0]
        times = row.worst / best.worst if best.worst > 0.0 else float("inf")
        text = f"Its error is up to {most}, {figure(times, 3)} times that of {best.name}"
        if row.worst > none:
            text += " and larger than without an observer"
        if not row.complete:
            text += "; too large to try other wrong parameters"
    said = [text + "."]
    knows = ", ".join(row.knows) or "no parameter of the drive"
    said.append(f"It reads {', '.join(row.reads)} and must know {knows}.")
    share = f", {figure(100 * row.noise / level, 2)} % of the friction level" if level > 0.0 else ""
    if 0.0 < row.noise < float("inf"):
        said.append(f"The sensor causes {quantity(row.noise, units['u'])} RMS of torque{share}.")
    if row.load < float("inf"):
        said.append(f"With a load step its error is {quantity(row.load, units['e'])}.")
    else:
        said.append("With a load step the loop diverges.")
    said.append(certified(row.certificate))
    return tuple(said)


def _with(row: Candidate) -> str:
    if len(row.errors) == 1 or row.worst_case == EXACT:
        return " with exact parameters"
    return f" over {len(row.errors)} cases, largest with {row.worst_case}"


def certified(made: Certificate | None) -> str:
    """What the gains guarantee."""
    if made is None:
        return "Its gains are not from a design rule, so nothing is guaranteed."
    if not made.holds:
        return f"Its gains have no certificate ({made.valid or made.lemma})."
    where = made.valid or "for every motion"
    if made.rate is None:
        return f"Its certificate holds {where} if its parameters are right; it has no rate."
    rate = figure(made.rate, 3)
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


def broken(errors: Mapping[str, float], none: float, unit: str, rate: float) -> str | None:
    """Why an observer does not work at this rate; None if it does."""
    bad = [case for case, error in errors.items() if not error < float("inf")]
    if bad:
        return f"it cannot run at {rate:g} Hz here: the loop diverges with {bad[0]}."
    if errors[EXACT] > HELPS * none:
        return (
            f"it does not help at {rate:g} Hz with this sensor: even with exact parameters the "
            f"error is {quantity(errors[EXACT], unit)}, without an observer {quantity(none, unit)}."
        )
    return None


PERIOD = 4000  # samples in a period of the reference, at most
QUICK = 500.0  # rad/s, the highest crossover
LEVEL, OTHERS = [("Fc", "Fs")], [("J",), ("sigma0",), ("sigma1",), ("Fv",), ("vs",)]
GROWN = 100.0  # times the amplitude of the reference: a loop with such an error has diverged
NEAR = 1.5  # times the smallest error: beyond it an observer is not tried any further
FAR = 1e300  # below infinity: a loop that diverged is not tried any further
FASTER = 3.0  # times the controller's bandwidth: the rate of an observer that knows J alone
LITTLE = 0.9  # of the error without an observer: above it even the best one helps little
ON_ERROR = ("existing_observer", "lyapunov_observer")  # their rule takes the controller's gain
ALONE = ("disturbance_observer", "extended_state_observer")  # noise grows with their rate


@shows_progress
def recommend_observer(
    p: Any,
    record: Any = None,
    *,
    observers: str | Sequence[str] | None = None,
    rate: float | None = None,
    noise: float | None = None,
    resolution: float | None = None,
    speed_noise: float | None = None,
    delay: float | None = None,
    measured: str | Sequence[str] | None = None,
    uncertainty: float | Mapping[str, float] | None = None,
    speed: float | None = None,
    frequency: float | None = None,
    bandwidth: float | None = None,
    load: float | None = None,
    gains: Mapping[str, Mapping[str, Any]] | None = None,
    certified: bool = False,
    progress: Wanted = None,
) -> Recommendation:
    """The friction observer for a drive: those that it can run, simulated and put in order.

    Parameters
    ----------
    p : Model, Parameters, dict, path, Diagnosis or Identification
        The drive with all values; of a diagnosis its model, and its record if none is given.
    record : Record, path, DataFrame, dict of arrays, or dict of numbers, optional
        A log of the drive, from which the rate, the noise and the step of the encoder, the speed
        and what is measured are estimated; or these values by the names below. Values that are
        given as arguments go first.
    observers : str or list of str, optional
        The observers to consider; default: all of ``lugrectl.observers()``.
    rate : float
        Sample rate of the drive in Hz.
    noise, resolution : float
        RMS noise of the position and step of the encoder in rad; default 0.
    speed_noise : float, optional
        RMS noise of the speed in rad/s, for a drive with a speed of its own. Without it the
        speed is the difference of two positions.
    delay : float
        Dead time between the torque command and the motor in s; default 0.
    measured : str
        "theta", "w" or "theta w", which observers may read; without w the loop is one of position.
    uncertainty : float or dict
        By what share the parameters may be wrong, each way; default 0.2. A dict gives it by name,
        ``{"Fc": 0.3, "J": 0.05}``.
    speed, frequency : float, optional
        Amplitude in rad/s and frequency in Hz of the reference, a sine; default: well outside
        presliding and above vs, or 0.8 of the record's speed; 1 Hz, at rates above 4 kHz rate/4000.
    bandwidth : float, optional
        Crossover of the controller in rad/s; default: what sampling and dead time allow, at
        most 500.
    load : float, optional
        Load torque in N m that steps in during the run "with a load step"; default: a fifth of
        the friction level.
    gains : dict, optional
        Gains by observer in place of those of :func:`design_gains`,
        ``{"extended_state": {"bandwidth": 200}}``.
    certified : bool
        Whether only observers whose gains have a certificate are admissible.
    progress : callable, True, False or None
        ``progress(fraction, what)``, or whether to show a bar. None: in Jupyter only.

    Returns
    -------
    Recommendation
        ``.best``, ``.ranked`` with reasons, ``.refused`` with reasons. ``print`` shows all.

    Raises
    ------
    InputError
        For a model without a value, a missing rate, or an argument that cannot be used.

    Notes
    -----
    Every loop is that of :func:`compare_observers`, sampled: the encoder rounds, the observer and
    the controller run at the rate, the torque is held and acts after the dead time. All
    loops have the same linear feedback, and the feed-forward of the torque that accelerates J.
    The order is that of the largest RMS error over these cases: exact parameters, Fc and Fs wrong
    together, then J, sigma0, sigma1, Fv, vs wrong one at a time, each way. Observers that are
    more than 1.5 times worse than the best after the first three cases are not tried with the
    others. Of observers within 5 % of the best the one that passes least noise to the torque is
    first. The drive has the effects of the model; the observers do not know them.

    Examples
    --------
    Two observers for a drive at 1 kHz with an encoder of 20 bits:

    >>> advice = lg.recommend_observer(
    ...     lg.table1(), observers=["natural", "disturbance"],
    ...     rate=1000.0, resolution=2 * np.pi / 2**20,
    ... )
    >>> advice.best.name
    'disturbance'
    """
    said = {k: v for k, v in locals().items() if k in KEYS}
    if isinstance(p, Fitted):
        own = getattr(p, "model", None)
        if not isinstance(own, Model):
            raise InputError("p: this result holds no model; give a model with all values.")
        record, p = (p.record if record is None else record), own
    model = as_model(p, "p").with_defaults()
    plant(model)  # a missing value is named
    known = {k: float(v) for k, v in model.values().items() if k in LUGRE and v is not None}
    spec = completed(drive_spec(record, said, model.motion), known)
    kind = "velocity" if "w" in spec.measured else "position"
    terms = Terms(model, correction(known, spec.bandwidth), True, given_gains(gains), ahead=True)
    stand = Stand(terms, spec, kind, crossing(kind, known["J"], spec.bandwidth))
    wanted = [name for name in chosen_observers(observers) if name != "no_observer"]
    if not wanted:
        raise InputError("observers holds no observer: give at least one of lugrectl.observers().")
    able, refused = _admissible(stand, wanted, flag(certified, "certified"))
    terms = replace(terms, designed={name: gains for name, (gains, _) in able.items()})
    stand, report = replace(stand, terms=terms), reporter(progress)
    report(0.0, "simulating the loop without an observer")
    none = stand.error("no_observer", {})
    unit, rows = unit_of(kind, model), []
    for name, trial in _trials(stand, list(able), report).items():
        why = broken(trial.errors, none, unit, spec.rate)
        if why:
            refused[name] = why
        else:
            rows.append(_candidate(name, trial, stand, able[name][1]))
    rows.sort(key=lambda row: row.worst)
    alike = [row for row in rows if row.worst <= ALIKE * rows[0].worst]
    rows[: len(alike)] = sorted(alike, key=lambda row: row.noise)
    return _answer(rows, refused, none, stand)


Able = dict[str, tuple[dict[str, Any], Certificate | None]]  # gains and certificate by name


def _admissible(stand: Stand, names: Sequence[str], certified: bool) -> tuple[Able, dict[str, str]]:
    """Return the observers that can be tried, and reasons for those that cannot."""
    able: Able = {}
    refused: dict[str, str] = {}
    for name in names:
        why = unseen(observer_block(name).inputs, stand.spec.measured)
        if why := why or unknown(name, stand.terms.model):
            refused[name] = why
            continue
        try:
            own = _designed(stand, name)
        except InputError as error:
            refused[name] = f"its gains cannot be designed for this drive: {error}"
            continue
        if certified and not own[1]:
            refused[name] = "its gains have no certificate, and certified=True asks for one."
        else:
            able[name] = own
    return able, refused


def _designed(stand: Stand, name: str) -> tuple[dict[str, Any], Certificate | None]:
    """Return gains by the design rule, at the rate and the speed of the drive."""
    own, rule, spec = stand.terms.designed.get(name), RULES.get(name), stand.spec
    if own is not None or (rule is None and name != "proposed_observer"):
        return dict(own or {}), None
    dt = max(1.0 / spec.rate, SAMPLED / (FASTER * spec.bandwidth) if name in ALONE else 0.0)
    more = {"k": stand.terms.k, "kp": stand.gains["kp"]} if name in ON_ERROR else {}
    gains, made = designed(stand.terms.model, name, dt, spec.speed, **more)
    if name == "normal_force_observer" and stand.kind == "velocity":
        made = replace(made, holds=False, valid="its proof is about a position loop")
    return gains, made


def _trials(stand: Stand, names: Sequence[str], report: Progress) -> dict[str, Trial]:
    """Return all observers in the first cases, then the better ones in the others."""
    trials: dict[str, Trial] = {}
    for i, name in enumerate(names):
        part = part_of(report, 0.6 * i / len(names), 0.6 * (i + 1) / len(names))
        trials[name] = stand.first(name, part)
    best = np.inf
    for i, name in enumerate(sorted(trials, key=lambda k: trials[k].worst[1])):
        if not trials[name].worst[1] <= min(NEAR * best, FAR):
            break
        part = part_of(report, 0.6 + 0.4 * i / len(names), 0.6 + 0.4 * (i + 1) / len(names))
        stand.finish(name, trials[name], part)
        best = min(best, trials[name].worst[1])
    return trials


def _candidate(name: str, trial: Trial, stand: Stand, certificate: Certificate | None) -> Candidate:
    block, (case, worst) = observer_block(name), trial.worst
    return Candidate(
        name=name.removesuffix("_observer"),
        worst=worst,
        worst_case=case,
        errors=trial.errors,
        load=trial.load,
        noise=trial.noise,
        gains=stand.terms.own(name, stand.kind),
        certificate=certificate,
        reads=block.inputs,
        knows=tuple(k for k in LUGRE if k in block.parameters),
        complete=trial.complete,
    )


def _answer(
    rows: Sequence[Candidate], refused: Mapping[str, str], none: float, stand: Stand
) -> Recommendation:
    model, known = stand.terms.model, stand.terms.model.known()
    unit = unit_of(stand.kind, model)
    said = {"e": unit, "u": unit_for("N m", model.motion)}
    level = float(max(known.get("Fc", 0.0), known.get("Fs", 0.0)))
    explained = [replace(row, reasons=reasons(row, rows, none, said, level)) for row in rows]
    return Recommendation(
        ranked=tuple(explained),
        refused={k.removesuffix("_observer"): v for k, v in refused.items()},
        none=none,
        signal=MEASURED[stand.kind],
        unit=unit,
        motion=model.motion,
        drive=plain(asdict(stand.spec)),
        controller=dict(stand.gains),
        messages=_messages(stand, none, rows),
    )


def _messages(stand: Stand, none: float, rows: Sequence[Candidate]) -> tuple[str, ...]:
    said = []
    if not np.isfinite(none):
        said.append("The loop diverges without an observer too: give a lower bandwidth.")
    if stand.terms.model.effects:
        names = ", ".join(use.key for use in stand.terms.model.effects)
        said.append(f"The drive has {names}; the observers do not know of it.")
    spec = stand.spec
    if not (spec.noise or spec.resolution or spec.speed_noise):
        said.append("The sensor is taken as exact: give noise or resolution.")
    if rows and rows[0].worst > LITTLE * none:
        said.append("Even the best observer may help little with parameters as wrong as these.")
    if not rows:
        said.append("No observer is admissible on this drive; the reasons are in refused.")
    return tuple(said)


@dataclass
class Trial:
    """RMS errors by case, infinite where the loop diverges; ``noise``: torque in N m."""

    errors: dict[str, float] = field(default_factory=dict)
    load: float = np.inf
    noise: float = np.inf
    complete: bool = False

    @property
    def worst(self) -> tuple[str, float]:
        """The case with the largest error."""
        case = max(self.errors, key=lambda k: self.errors[k])
        return case, self.errors[case]


@dataclass(frozen=True)
class Stand:
    """The loop in which the observers are tried: a sine of the speed, from rest."""

    terms: Terms
    spec: DriveSpec
    kind: str
    gains: Mapping[str, float]

    @cached_property
    def t(self) -> np.ndarray:
        rate, f = self.spec.rate, self.spec.frequency
        what = f"a sine of {f:g} Hz at {rate:g} samples per second"
        return np.arange(enough_samples(f, rate, what)) / rate

    @cached_property
    def rows(self) -> dict[str, np.ndarray]:
        return sine(self.t, self.spec.speed, self.spec.frequency).rows(self.kind)

    def error(self, name: str, believed: Mapping[str, float], load: float = 0.0) -> float:
        """Return the RMS error with these parameters believed; infinite if the loop diverges."""
        try:
            return self._missed(self._run(name, believed, self.spec.sensing, load))
        except Diverged:
            return np.inf

    def noise(self, name: str) -> float:
        """Return the RMS torque that the sensor causes, its rounding included."""
        try:
            runs = (self.spec.sensing, self.spec.sensing.quiet())
            loud, quiet = (self._run(name, {}, sensing)["u"] for sensing in runs)
        except Diverged:
            return np.inf
        return self._counted(loud - quiet)

    def _counted(self, x: np.ndarray) -> float:
        return rms(x[self.t >= SETTLED / self.spec.frequency])

    def _missed(self, out: Mapping[str, np.ndarray]) -> float:
        return self._counted(out[MEASURED[self.kind]] - self.rows["r"])

    def _run(
        self, name: str, believed: Mapping[str, float], sensing: Sensing, load: float = 0.0
    ) -> dict[str, np.ndarray]:
        rows = self.rows | {"d": np.where(self.t >= 0.5 * self.t[-1], load, 0.0)}
        control = self.terms.control(name, self.kind, self.gains, believed)
        out = self.terms.run(control, self.kind, sensing, self.spec.speed, rows)
        with np.errstate(all="ignore"):
            if not self._missed(out) < GROWN * float(np.abs(self.rows["r"]).max()):
                raise Diverged(f"{name}: the error grows without bound.")
        return out

    def first(self, name: str, report: Progress) -> Trial:
        """Return exact parameters, the level of friction wrong, a load step, noise."""
        report(0.0, f"simulating {name}")
        trial = Trial({EXACT: self.error(name, {})})
        if np.isfinite(trial.errors[EXACT]):
            self._try(name, trial, LEVEL, report)
            trial.load, trial.noise = self.error(name, {}, self.spec.load), self.noise(name)
        return trial

    def finish(self, name: str, trial: Trial, report: Progress) -> None:
        """Try the other parameters, one at a time."""
        self._try(name, trial, OTHERS, report)
        trial.complete = True

    def _try(
        self, name: str, trial: Trial, groups: Sequence[Sequence[str]], report: Progress
    ) -> None:
        cases = wrong(name, self.terms.model.known(), groups, self.spec.uncertainty)
        for i, (case, believed) in enumerate(cases.items()):
            report((i + 1) / (len(cases) + 1), f"simulating {name}, {case}")
            trial.errors[case] = self.error(name, believed)


@dataclass(frozen=True)
class DriveSpec:
    """A drive's sensor and task in SI units; ``speed_noise`` None: w is the difference of theta."""

    rate: float
    noise: float
    resolution: float
    speed_noise: float | None
    delay: float
    measured: tuple[str, ...]
    speed: float
    frequency: float
    bandwidth: float
    load: float
    uncertainty: Mapping[str, float]
    source: str

    @property
    def sensing(self) -> Sensing:
        """The same for the simulation."""
        return Sensing(1.0 / self.rate, self.noise, self.resolution, self.speed_noise, self.delay)


KEYS = tuple(k for k in DriveSpec.__dataclass_fields__ if k != "source")


def completed(said: Mapping[str, Any], known: Mapping[str, float]) -> DriveSpec:
    """Return all values, those that are not said by the drive's parameters ``known``."""
    usual = {"noise": 0.0, "resolution": 0.0, "speed_noise": None, "delay": 0.0}
    usual |= {"measured": ("theta", "w"), "source": "the arguments"}
    spec = usual | dict(said)
    sensing = Sensing(1.0 / spec["rate"], speed_noise=spec["speed_noise"], delay=spec["delay"])
    level = max(known.get("Fc", 0.0), known.get("Fs", 0.0))
    f = spec.setdefault("frequency", max(1.0, spec["rate"] / PERIOD))
    presliding = level / known["sigma0"] if known.get("sigma0") else 0.0
    slow = max(10.0 * known.get("vs", 0.0), presliding * 20.0 * np.pi * f)
    spec.setdefault("speed", slow or 1.0)
    spec.setdefault("bandwidth", min(QUICK, fastest(sensing)))
    spec.setdefault("load", 0.2 * level)
    spec.setdefault("uncertainty", dict.fromkeys(LUGRE, 0.2))
    return DriveSpec(**spec)


def drive_spec(given: Any, own: Mapping[str, Any], motion: str) -> dict[str, Any]:
    """Return the values by name, before those of a dict of numbers or estimates from a record."""
    said = {k: v for k, v in own.items() if v is not None}
    lists = ("measured", "uncertainty")  # the values of a drive that are no numbers
    if isinstance(given, Mapping) and not any(
        np.ndim(v) > 0 and not isinstance(v, str) for k, v in given.items() if k not in lists
    ):
        strange = [k for k in given if k not in KEYS]
        if strange:
            hint = meant(strange[0], KEYS)
            raise InputError(f"record: a drive has no value {shown(strange[0])}; {hint}")
        return _checked({**given, **said})
    if given is None:
        return _checked(said)
    if not is_record(given):
        raise InputError(
            "record must be a record (a path, DataFrame, dict of arrays or Record) or a dict of "
            f"numbers such as {{'rate': 1000}}, not {shown(given)}."
        )
    seen = estimated(as_record(given, motion))
    return seen | _checked({"rate": seen["rate"]} | said)


def estimated(record: Record) -> dict[str, Any]:
    """Return rate, noise, step of the encoder and speed of a record."""
    seen, speed = sensing_of(record), top_speed(record)
    values = {k: getattr(seen, k) for k in ("noise", "resolution", "speed_noise")}
    values["measured"] = tuple(k for k in ("theta", "w") if getattr(record, k) is not None)
    values |= {"speed": speed} if speed else {}
    return values | {"rate": record.rate, "source": record.source}


def _checked(said: Mapping[str, Any]) -> dict[str, Any]:
    """Return the values by name, where all are of their kind."""
    if "rate" not in said:
        raise InputError(
            "rate is missing: give the drive's sample rate in Hz, rate=1000, or a record."
        )
    return {key: CHECKS[key](said[key], key) for key in KEYS if key in said}


def _not_negative(value: Any, key: str) -> float:
    if (checked := number(value, key)) < 0.0:
        raise InputError(f"{key} must be 0 or positive, not {shown(value)}.")
    return checked


def _measured(given: Any, _: str) -> tuple[str, ...]:
    words = given.replace(",", " ").split() if isinstance(given, str) else given
    if not isinstance(words, (list, tuple)) or not words or set(words) - {"theta", "w"}:
        raise InputError(f"measured must be 'theta', 'w' or 'theta w', not {shown(given)}.")
    return tuple(k for k in ("theta", "w") if k in words)


def _uncertain(given: Any, _: str) -> dict[str, float]:
    """Return by how much each parameter may be wrong, as a share."""
    if not isinstance(given, Mapping):
        if real(given) == 0.0:
            return dict.fromkeys(LUGRE, 0.0)
        return dict.fromkeys(LUGRE, share(given, "uncertainty"))
    for key in given:
        if key not in LUGRE:
            raise InputError(f"uncertainty: there is no {shown(key)}; {meant(key, LUGRE)}")
    sizes = {k: 0.0 if real(v) == 0.0 else share(v, f"uncertainty of {k}")
             for k, v in given.items()}  # fmt: skip
    return dict.fromkeys(LUGRE, 0.0) | sizes


CHECKS: dict[str, Callable[[Any, str], Any]] = {
    **dict.fromkeys(("rate", "frequency"), partial(positive, unit="Hz")),
    **dict.fromkeys(("speed", "bandwidth"), positive),
    **dict.fromkeys(("noise", "resolution", "speed_noise", "delay"), _not_negative),
    "load": number,
    "measured": _measured,
    "uncertainty": _uncertain,
}

"""Which observer for this drive: all that it can run, simulated on it and put in order."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any

import numpy as np

from ..blocks.aliases import meant
from ..blocks.block import unit_for
from ..blocks.controllers import MEASURED
from ..blocks.model import Model, as_model, model_first
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
from ..record.as_record import as_record, is_record
from ..simulation.encoder import Sensing
from .compare import by_reason, chosen_observers
from .loop import (
    LUGRE,
    SETTLED,
    Terms,
    correction,
    designed,
    enough_samples,
    fastest,
    given_gains,
    sensing_of,
    sine,
    top_speed,
    unit_of,
    unknown,
    wrong,
)

EXACT = "exact parameters"
HELPS = 0.98  # of the error without an observer: above it an observer does not help
ALIKE = 1.05  # ratio of errors below which two observers are equally good
PERIOD = 4000  # samples in a period of the reference, at most
QUICK = 500.0  # rad/s, the highest crossover
LEVEL, OTHERS = [("Fc", "Fs")], [("J",), ("sigma0",), ("sigma1",), ("Fv",), ("vs",)]
GROWN = 100.0  # times the amplitude of the reference: a loop with such an error has diverged
NEAR = 1.5  # times the smallest error: beyond it an observer is not tried any further
FASTER = 3.0  # times the controller's bandwidth: the rate of an observer that knows J alone
LITTLE = 0.9  # of the error without an observer: above it even the best one helps little
ON_ERROR = ("existing_observer", "lyapunov_observer")  # their rule takes the controller's gain
ALONE = ("disturbance_observer", "extended_state_observer")  # noise grows with their rate


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
    best, others = order[0], order[1:]
    text = f"Its error is at most {quantity(row.worst, units['e'])} ({row.worst_case}, the largest"
    text += f" of {len(row.errors)})"
    if row is best:
        text += f"; without an observer it is {quantity(none, units['e'])}"
        for one in others[:1]:
            text += f", with {one.name}, the next, up to {quantity(one.worst, units['e'])}"
    else:
        times = row.worst / best.worst if best.worst > 0.0 else float("inf")
        text += f", {figure(times, 3)} times that of {best.name}"
        text += " and larger than without an observer" * (row.worst > none)
        text += "; too large to try other wrong parameters" * (not row.complete)
    knows = ", ".join(row.knows) or "no parameter of the drive"
    said = [text + ".", f"It reads {', '.join(row.reads)} and must know {knows}."]
    if 0.0 < row.noise < float("inf"):
        part = f", {figure(100 * row.noise / level, 2)} % of the friction level" if level else ""
        said.append(f"The sensor causes {quantity(row.noise, units['u'])} RMS of torque{part}.")
    load = f"its error is {quantity(row.load, units['e'])}"
    said.append(f"With a load step {load if row.load < float('inf') else 'the loop diverges'}.")
    return (*said, certified(row.certificate))


def certified(made: Certificate | None) -> str:
    """What the gains guarantee."""
    if made is None:
        return "Its gains are not from a design rule, so nothing is guaranteed."
    if not made.holds:
        return f"Its gains have no certificate ({made.valid or made.lemma})."
    rate = "" if made.rate is None else f": errors decay with {figure(made.rate, 3)} 1/s"
    where = made.valid or "for every motion"
    return f"Its certificate holds {where} if its parameters are right{rate}."


def unseen(inputs: Sequence[str], measured: Sequence[str]) -> str | None:
    """Why an observer cannot read what it needs; None if it can."""
    known = {*measured, "u", "e", "r", *(["s"] if "w" in measured else [])}
    missing = next((k for k in inputs if k not in known), None)
    if missing is None:
        return None
    return (
        f"it reads {'w' if missing == 's' else missing}, and this drive measures only "
        f"{' and '.join(measured)}; give measured='theta w' where it has or computes both."
    )


def broken(row: Candidate, none: float, unit: str, rate: float) -> str | None:
    """Why an observer does not work at this rate; None if it does."""
    bad = [case for case, error in row.errors.items() if not error < float("inf")]
    if bad:
        return f"it cannot run at {rate:g} Hz here: the loop diverges with {bad[0]}."
    if row.errors[EXACT] > HELPS * none:
        return (
            f"it does not help at {rate:g} Hz with this sensor: even with exact parameters the "
            f"error is {quantity(row.errors[EXACT], unit)}, without an observer "
            f"{quantity(none, unit)}."
        )
    return None


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
    model_first(p, record, "record")
    said = {k: v for k, v in locals().items() if k in CHECKS and v is not None}
    if isinstance(p, Fitted):
        own = getattr(p, "model", None)
        if not isinstance(own, Model):
            raise InputError("p: this result holds no model; give a model with all values.")
        record, p = (p.record if record is None else record), own
    model = as_model(p, "p").with_defaults()
    plant(model)  # a missing value is named
    known = {k: float(v) for k, v in model.values().items() if k in LUGRE and v is not None}
    spec = drive_of(record, said, model.motion, known)
    kind = "velocity" if "w" in spec["measured"] else "position"
    terms = Terms(model, correction(known, spec["bandwidth"]), True, given_gains(gains), ahead=True)
    stand = Stand(terms, spec, kind, crossing(kind, known["J"], spec["bandwidth"]))
    wanted = [name for name in chosen_observers(observers) if name != "no_observer"]
    if not wanted:
        raise InputError("observers holds no observer: give at least one of lugrectl.observers().")
    able, refused = _admissible(stand, wanted, flag(certified, "certified"))
    terms = replace(terms, designed={name: gains for name, (gains, _) in able.items()})
    stand, report = replace(stand, terms=terms), reporter(progress)
    report(0.0, "simulating the loop without an observer")
    none, unit, rows = stand.error("no_observer", {}), unit_of(kind, model), []
    for row in _trials(stand, {name: made for name, (_, made) in able.items()}, report):
        if why := broken(row, none, unit, spec["rate"]):
            refused[row.name] = why
        else:
            rows.append(row)
    rows.sort(key=lambda row: row.worst)
    alike = [row for row in rows if row.worst <= ALIKE * rows[0].worst]
    rows[: len(alike)] = sorted(alike, key=lambda row: row.noise)
    return _answer(rows, refused, none, stand)


Able = dict[str, tuple[dict[str, Any], Certificate | None]]  # gains and certificate by name


def _admissible(stand: Stand, names: Sequence[str], certified: bool) -> tuple[Able, dict[str, str]]:
    """Return the observers that can be tried, and reasons for those that cannot, by short name."""
    able: Able = {}
    refused: dict[str, str] = {}
    for name in names:
        why = unseen(observer_block(name).inputs, stand.spec["measured"])
        why = why or unknown(name, stand.terms.model)
        own: tuple[dict[str, Any], Certificate | None] = {}, None
        try:
            own = own if why else _designed(stand, name)
        except InputError as error:
            why = f"its gains cannot be designed for this drive: {error}"
        if not why and certified and not own[1]:
            why = "its gains have no certificate, and certified=True asks for one."
        if why:
            refused[name.removesuffix("_observer")] = why
        else:
            able[name] = own
    return able, refused


def _designed(stand: Stand, name: str) -> tuple[dict[str, Any], Certificate | None]:
    """Return gains by the design rule, at the rate and the speed of the drive."""
    own, spec = stand.terms.designed.get(name), stand.spec
    if own is not None or (name not in RULES and name != "proposed_observer"):
        return dict(own or {}), None
    dt = max(1.0 / spec["rate"], SAMPLED / (FASTER * spec["bandwidth"]) if name in ALONE else 0.0)
    more = {"k": stand.terms.k, "kp": stand.gains["kp"]} if name in ON_ERROR else {}
    gains, made = designed(stand.terms.model, name, dt, spec["speed"], **more)
    if name == "normal_force_observer" and stand.kind == "velocity":
        made = replace(made, holds=False, valid="its proof is about a position loop")
    return gains, made


def _trials(
    stand: Stand, certificates: Mapping[str, Certificate | None], report: Progress
) -> list[Candidate]:
    """Return all observers in the first cases, then the better ones in the others."""
    n, first, made, best = len(certificates), [], [], np.inf
    for i, (name, certificate) in enumerate(certificates.items()):
        part = part_of(report, 0.6 * i / n, 0.6 * (i + 1) / n)
        first.append(stand.first(name, certificate, part))
    for i, row in enumerate(sorted(first, key=lambda row: row.worst)):
        if row.worst < np.inf and row.worst <= NEAR * best:
            part = part_of(report, 0.6 + 0.4 * i / n, 0.6 + 0.4 * (i + 1) / n)
            row = stand.tried(row, OTHERS, part, complete=True)
            best = min(best, row.worst)
        made.append(row)
    return made


def _answer(
    rows: Sequence[Candidate], refused: Mapping[str, str], none: float, stand: Stand
) -> Recommendation:
    model, known = stand.terms.model, stand.terms.model.known()
    unit = unit_of(stand.kind, model)
    said = {"e": unit, "u": unit_for("N m", model.motion)}
    level = float(max(known.get("Fc", 0.0), known.get("Fs", 0.0)))
    return Recommendation(
        ranked=tuple(replace(row, reasons=reasons(row, rows, none, said, level)) for row in rows),
        refused=refused,
        none=none,
        signal=MEASURED[stand.kind],
        unit=unit,
        motion=model.motion,
        drive=plain(stand.spec),
        controller=dict(stand.gains),
        messages=_messages(stand, none, rows),
    )


def _messages(stand: Stand, none: float, rows: Sequence[Candidate]) -> tuple[str, ...]:
    effects = ", ".join(use.key for use in stand.terms.model.effects)
    exact = not any(stand.spec[k] for k in ("noise", "resolution", "speed_noise"))
    weak = bool(rows) and rows[0].worst > LITTLE * none
    said = {
        "The loop diverges without an observer too: give a lower bandwidth.": not np.isfinite(none),
        f"The drive has {effects}; the observers do not know of it.": bool(effects),
        "The sensor is taken as exact: give noise or resolution.": exact,
        "Even the best observer may help little with parameters as wrong as these.": weak,
        "No observer is admissible on this drive; the reasons are in refused.": not rows,
    }
    return tuple(text for text, holds in said.items() if holds)


@dataclass(frozen=True)
class Stand:
    """The loop in which the observers are tried: a sine of the speed, from rest. ``spec``: the
    drive's sensor and task, SI."""

    terms: Terms
    spec: Mapping[str, Any]
    kind: str
    gains: Mapping[str, float]

    @cached_property
    def sensing(self) -> Sensing:
        rest = (self.spec[k] for k in ("noise", "resolution", "speed_noise", "delay"))
        return Sensing(1.0 / self.spec["rate"], *rest)

    @cached_property
    def t(self) -> np.ndarray:
        rate, f = self.spec["rate"], self.spec["frequency"]
        what = f"a sine of {f:g} Hz at {rate:g} samples per second"
        return np.arange(enough_samples(f, rate, what)) / rate

    @cached_property
    def rows(self) -> dict[str, np.ndarray]:
        return sine(self.t, self.spec["speed"], self.spec["frequency"]).rows(self.kind)

    def error(self, name: str, believed: Mapping[str, float], load: float = 0.0) -> float:
        """Return the RMS error with these parameters believed; infinite if the loop diverges."""
        try:
            return self._missed(self._run(name, believed, self.sensing, load))
        except Diverged:
            return np.inf

    def noise(self, name: str) -> float:
        """Return the RMS torque that the sensor causes, its rounding included."""
        try:
            runs = (self.sensing, self.sensing.quiet())
            loud, quiet = (self._run(name, {}, sensing)["u"] for sensing in runs)
        except Diverged:
            return np.inf
        return self._counted(loud - quiet)

    def _counted(self, x: np.ndarray) -> float:
        return rms(x[self.t >= SETTLED / self.spec["frequency"]])

    def _missed(self, out: Mapping[str, np.ndarray]) -> float:
        return self._counted(out[MEASURED[self.kind]] - self.rows["r"])

    def _run(
        self, name: str, believed: Mapping[str, float], sensing: Sensing, load: float = 0.0
    ) -> dict[str, np.ndarray]:
        rows = self.rows | {"d": np.where(self.t >= 0.5 * self.t[-1], load, 0.0)}
        control = self.terms.control(name, self.kind, self.gains, believed)
        out = self.terms.run(control, self.kind, sensing, self.spec["speed"], rows)
        with np.errstate(all="ignore"):
            if not self._missed(out) < GROWN * float(np.abs(self.rows["r"]).max()):
                raise Diverged(f"{name}: the error grows without bound.")
        return out

    def first(self, name: str, certificate: Certificate | None, report: Progress) -> Candidate:
        """Return what exact parameters, a wrong level of friction, a load step, and noise do."""
        report(0.0, f"simulating {name}")
        block, exact = observer_block(name), self.error(name, {})
        row = Candidate(
            name=name.removesuffix("_observer"),
            worst=exact,
            worst_case=EXACT,
            errors={EXACT: exact},
            load=np.inf,
            noise=np.inf,
            gains=self.terms.own(name, self.kind),
            certificate=certificate,
            reads=block.inputs,
            knows=tuple(k for k in LUGRE if k in block.parameters),
            complete=False,
        )
        if not np.isfinite(exact):
            return row
        more = {"load": self.error(name, {}, self.spec["load"]), "noise": self.noise(name)}
        return self.tried(row, LEVEL, report, **more)

    def tried(
        self, row: Candidate, groups: Sequence[Sequence[str]], report: Progress, **more: Any
    ) -> Candidate:
        """Return the same with groups of parameters wrong, too."""
        name, errors = observer_block(row.name).name, dict(row.errors)
        cases = wrong(name, self.terms.model.known(), groups, self.spec["uncertainty"])
        for i, (case, believed) in enumerate(cases.items()):
            report((i + 1) / (len(cases) + 1), f"simulating {name}, {case}")
            errors[case] = self.error(name, believed)
        case = max(errors, key=lambda k: errors[k])
        return replace(row, errors=errors, worst=errors[case], worst_case=case, **more)


def drive_of(
    record: Any, said: Mapping[str, Any], motion: str, known: Mapping[str, float]
) -> dict[str, Any]:
    """Return a drive's sensor and task: what is said goes before a dict of numbers or estimates
    from a record, and these before what suits the parameters ``known``."""
    seen: dict[str, Any] = {"source": "the arguments"}
    lists = ("measured", "uncertainty")  # the values of a drive that are no numbers
    if isinstance(record, Mapping) and not any(
        np.ndim(v) > 0 and not isinstance(v, str) for k, v in record.items() if k not in lists
    ):
        if strange := [k for k in record if k not in CHECKS]:
            hint = meant(strange[0], CHECKS)
            raise InputError(f"record: a drive has no value {shown(strange[0])}; {hint}")
        said = {**record, **said}
    elif record is not None:
        if not is_record(record):
            raise InputError(
                "record must be a record (a path, DataFrame, dict of arrays or Record) or a dict "
                f"of numbers such as {{'rate': 1000}}, not {shown(record)}."
            )
        log = as_record(record, motion)
        sensing, speed = sensing_of(log), top_speed(log)
        seen = {k: getattr(sensing, k) for k in ("noise", "resolution", "speed_noise")}
        seen["measured"] = tuple(k for k in ("theta", "w") if getattr(log, k) is not None)
        seen |= {"rate": log.rate, "source": log.source} | ({"speed": speed} if speed else {})
    spec = seen | {k: CHECKS[k](v, k) for k, v in said.items()}
    if "rate" not in spec:
        raise InputError(
            "rate is missing: give the drive's sample rate in Hz, rate=1000, or a record."
        )
    usual = _usual(spec, known)
    return {k: spec.get(k, usual.get(k)) for k in (*CHECKS, "source")}


def _usual(spec: Mapping[str, Any], known: Mapping[str, float]) -> dict[str, Any]:
    level = max(known.get("Fc", 0.0), known.get("Fs", 0.0))
    f = spec.get("frequency", max(1.0, spec["rate"] / PERIOD))
    presliding = level / known["sigma0"] if known.get("sigma0") else 0.0
    slow = max(10.0 * known.get("vs", 0.0), presliding * 20.0 * np.pi * f)
    late = {"speed_noise": spec.get("speed_noise"), "delay": spec.get("delay", 0.0)}
    return {
        "noise": 0.0,
        "resolution": 0.0,
        "delay": 0.0,
        "measured": ("theta", "w"),
        "frequency": f,
        "speed": slow or 1.0,
        "bandwidth": min(QUICK, fastest(Sensing(1.0 / spec["rate"], **late))),
        "load": 0.2 * level,
        "uncertainty": dict.fromkeys(LUGRE, 0.2),
    }


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
    "rate": partial(positive, unit="Hz"),
    **dict.fromkeys(("noise", "resolution", "speed_noise", "delay"), _not_negative),
    "measured": _measured,
    "speed": positive,
    "frequency": partial(positive, unit="Hz"),
    "bandwidth": positive,
    "load": number,
    "uncertainty": _uncertain,
}

"""Compensation before and after: designs, simulates and compares three loops."""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import control as ct
import numpy as np
from numpy.typing import ArrayLike

from ..blocks.aliases import name_of
from ..blocks.controllers import MEASURED
from ..blocks.model import Model, as_model
from ..blocks.observers import Gain, observer_block
from ..core.display import Row, Shown, noticed
from ..core.errors import Diverged, InputError
from ..core.numeric import rms
from ..core.progress import Progress, Wanted, reporter, shows_progress
from ..core.result import Result, library, plain
from ..core.validation import shown, whole
from ..core.views import view
from ..design import Certificate
from ..estimates.findings import Joint, Table
from ..loops.parts import OUTPUTS
from ..record import Record
from ..record.as_record import as_record
from ..record.signal_noise import sensor_noise
from ..simulation.response import simulate
from .assure import between
from .loop import (
    Course,
    SampledLoop,
    Task,
    controller,
    course,
    kind_of,
    observer_gains,
    sensing_of,
    sorted_out,
    unit_of,
)

ENDS = 10.0, 90.0  # percentiles of the spread
LOOPS = {
    "none": "without compensation",
    "before": "with the compensation of the declared model",
    "after": "with the compensation of the augmented model",
}
DRAWS = 20
LONGEST, MOST = 6.0, 40_000  # s of a run on a drive like the recorded one, and its samples
WORSE = 1.05  # ratio above which the error counts as larger


@dataclass(frozen=True, repr=False, eq=False)
class Run(Shown):
    """One simulated loop: reference, motion (both rad/s or rad) and torque u (N m) over t (s)."""

    t: np.ndarray
    r: np.ndarray
    y: np.ndarray
    u: np.ndarray


@dataclass(frozen=True, repr=False, eq=False)
class Spread(Shown):
    """RMS tracking error on drawn drives: the values of each loop, infinite where it diverged.

    ``rate`` in Hz; ``noise`` of position (rad), speed (rad/s, nan where the drive takes the
    difference of two positions) and torque (N m), and the encoder's ``resolution`` (rad).
    ``drawn``: the parameters that differ from draw to draw.
    """

    rate: float
    noise: Mapping[str, float]
    resolution: float
    drawn: tuple[str, ...]
    seed: int
    errors: Mapping[str, np.ndarray] = field(default_factory=dict)

    def of(self, key: str) -> tuple[float, float, float]:
        """Median and 10 and 90 % of a loop's error."""
        values = np.sort(self.errors[key])
        places = (len(values) - 1) * np.array([50.0, *ENDS]) / 100.0
        with np.errstate(invalid="ignore"):
            found = [between(values, place) for place in places]
        return found[0], found[1], found[2]

    @property
    def best(self) -> str:
        """The loop of the least median; without compensation where none is smaller."""
        return min(self.errors, key=lambda key: self.of(key)[0])

    def summary(self) -> dict[str, Any]:
        """Plain Python, as under "compensation" "drive" in the JSON document."""
        loops = {
            key: {**dict(zip(("median", "low", "high"), self.of(key), strict=True)),
                  "diverged": int(np.count_nonzero(~np.isfinite(values)))}
            for key, values in self.errors.items()
        }  # fmt: skip
        return {
            "rate": self.rate,
            "resolution": self.resolution,
            "noise": dict(self.noise),
            "drawn": list(self.drawn),
            "draws": len(next(iter(self.errors.values()))),
            "seed": self.seed,
            **loops,
            "recommended": self.best,
        }

    def rows(self, unit: str) -> list[Row]:
        words = "{:.3g} ({:.3g} to {:.3g}) {}"
        return [Row(f"on a drive, {k}", words.format(*self.of(k), unit)) for k in self.errors]

    def advice(self, unit: str) -> list[str]:
        """One sentence where a compensation makes tracking worse than none."""
        (none, *_), (after, *_) = self.of("none"), self.of("after")
        if after <= none:
            return []
        worse = f"{after:.3g} {unit}" if math.isfinite(after) else "unstable"
        return [
            "On a drive like the recorded one the compensation makes tracking worse: median error "
            f"{worse} with it, {none:.3g} {unit} without; leave it off."
        ]


@dataclass(frozen=True, repr=False, eq=False)
class Compensation(Result):
    """The answer of :func:`lugrectl.compensate`.

    Attributes
    ----------
    kind : "velocity" or "position"
        The loop.
    observer : str or None
        The observer in it.
    none, before, after : float
        RMS of motion minus reference in ``unit`` without compensation, with that of the declared,
        and with that of the augmented model; infinite if the loop diverges, which ``messages``
        then report.
    unit : str
        Of these errors.
    controller : dict
        Gains of the controller by name.
    gains : dict
        Those of the observer in the loops "before" and "after".
    certificate : Certificate or None
        What the gains guarantee "after"; None if there is no design.
    compensated : tuple of str
        Effects whose torque is fed forward.
    left : tuple of (str, str)
        Effects that are not, each with the reason.
    reference : dict
        Speed, frequency and duration of the reference.
    messages : tuple of str
        What was noticed.
    loop, runs : dict
        The closed loops and their simulations under "none", "before", "after" (no run for a loop
        that diverged).
    drive : Spread or None
        The same errors on a drive like the recorded one, which is not exactly the model; None
        without a record.

    Examples
    --------
    The tracking errors over time of a drive whose declared model does not contain a load:

    >>> load = {"name": "constant_torque", "torque": 0.05}
    >>> drive = lg.Model.of(lg.table1(), effects=load)
    >>> lg.compensate(drive, declared=lg.table1()).plot()  # doctest: +SKIP
    """

    kind: str
    observer: str | None
    none: float
    before: float
    after: float
    unit: str
    controller: Mapping[str, float]
    gains: Mapping[str, Mapping[str, Any]]
    certificate: Certificate | None
    compensated: tuple[str, ...]
    left: tuple[tuple[str, str], ...]
    reference: Mapping[str, float]
    messages: tuple[str, ...]
    loop: Mapping[str, ct.InterconnectedSystem]
    runs: Mapping[str, Run]
    drive: Spread | None = None

    def summary(self) -> dict[str, Any]:
        """Plain Python, as under "compensation" in the JSON document."""
        made = {"loop": self.kind, "observer": self.observer, "signal": MEASURED[self.kind]}
        made |= {k: getattr(self, k) for k in ("unit", *LOOPS, "controller")}
        made |= {
            "observer_gains": self.gains,
            "certificate": self.certificate.summary() if self.certificate else None,
            "compensated": self.compensated,
            "not_compensated": [{"name": n, "reason": why} for n, why in self.left],
            "reference": self.reference,
            "messages": self.messages,
            "drive": self.drive.summary() if self.drive else None,
        }
        return plain(made)

    def to_frame(self) -> Any:
        """A DataFrame of the simulated loops: a row for each loop and time t, columns r, y, u."""
        pandas = library("pandas")
        columns = {
            key: pandas.DataFrame({"r": run.r, "y": run.y, "u": run.u}, index=run.t)
            for key, run in self.runs.items()
        }
        none = pandas.DataFrame(columns=["r", "y", "u"])
        return pandas.concat(columns, names=["loop", "t"]) if columns else none

    def _title(self) -> str:
        watcher = f"{self.observer} observer" if self.observer else "no observer"
        return f"Compensation: {self.kind} loop, {watcher}"

    def _rows(self) -> Iterable[Row]:
        rate = self.certificate.rate if self.certificate else None
        left = ", ".join(name for name, _ in self.left)
        rows = [Row(f"RMS error, {k}", getattr(self, k), self.unit) for k in LOOPS]
        rows += [] if self.drive is None else self.drive.rows(self.unit)
        rows += [Row(k, v) for k, v in self.controller.items()]
        rows += [Row(k, v) for k, v in self.gains.get("after", {}).items()]
        rows += [Row("observer's rate", rate, "1/s")] if rate else []
        rows += [Row("fed forward", ", ".join(self.compensated))] if self.compensated else []
        rows += [Row("not compensated", left)] if left else []
        return [*rows, *noticed(self.messages, "messages")]

    def plot(self, ax: Any = None) -> Any:
        """Draw the tracking errors over time, into ``ax`` or a new figure; returns the Axes."""
        return view("loop_plots.tracking")(self, ax)


@shows_progress
def compensate(
    model: Any,
    *,
    declared: Any = None,
    loop: str = "velocity",
    kp: float | None = None,
    ki: float | None = None,
    kd: float | None = None,
    bandwidth: float = 20.0,
    observer: str | None = "proposed",
    K1: Gain | None = None,
    K2: Gain | None = None,
    gains: Mapping[str, Any] | None = None,
    reference: tuple[ArrayLike, ArrayLike] | None = None,
    record: Any = None,
    table: Table | None = None,
    covariance: Joint | None = None,
    draws: int = DRAWS,
    seed: int = 0,
    progress: Wanted = None,
) -> Compensation:
    """Tracking error with the compensation of the declared and of the augmented model.

    u = C (r - y) + J a + Fhat + d: controller, acceleration a of the reference, observer, and the
    torque d of the model's effects from the measured w, theta and t. The simulated drive is the
    augmented model with all its effects, sensors included. The compensation uses the declared
    model ("before") or the augmented one ("after").

    Parameters
    ----------
    model : Model, Parameters, dict or path
        The augmented model, ``diagnose(...).model``.
    declared : Model, Parameters, dict or path, optional
        Default: ``model`` without its effects. Values that it does not give are those of
        ``model``.
    loop : "velocity" or "position"
        PI on w, or PID on theta with D on the error of w.
    kp, ki, kd : float, optional
        Units as in :func:`lugrectl.velocity_loop` and :func:`lugrectl.position_loop`. If none is
        given all poles of the compensated loop are at -bandwidth; else those left out are 0.
    bandwidth : float
        In 1/s, for the gains that are left out.
    observer : str or None
        As in the ready-made loops; None to compensate the effects' torque only.
    K1, K2 : float or callable, optional
        Gains of the proposed observer, both or none. Default: ``design_gains(...)`` for each
        model, or -1 and 2 sqrt(J sigma0) if sigma1 is below a tenth of the latter.
    gains : dict, optional
        Other gains of the observer by name; those left out keep their defaults.
    reference : (t, r), optional
        Times in s and the reference in rad/s or rad; the drive starts at rest at its first
        value. Default: a sine of the speed inside the range of ``record``, or of 1 rad/s at
        0.25 Hz.
    record : Record, path, DataFrame or dict of arrays, optional
        For the default reference, and for the drive that ``drive`` of the result is about: its
        sample rate, encoder steps and noise of speed and torque.
    table : Table, optional
        An unexplained torque that also acts on the drive. It is compensated "after", unless it
        is a table over u.
    covariance : Joint, optional
        ``diagnose(...).covariance``: the drive's parameters are drawn from it, while the
        compensation believes ``model``. Needs ``record``.
    draws, seed : int
        Number of drawn drives, and the seed of parameters and noise.
    progress : callable, True, False or None
        ``progress(fraction, what)``, or whether to show a bar. None: in Jupyter only.

    Returns
    -------
    Compensation
        The errors without compensation, with the declared and with the augmented model, the loops
        and their simulations.

    Raises
    ------
    InputError
        For an unknown loop or observer, a gain out of bounds, a value that is missing from the
        model, or a friction law that the observer cannot copy.

    Notes
    -----
    Torque and level effects are compensated. The torque of a level effect is the friction law
    with it minus the law without it, each with its own bristle state, along the measured motion;
    feeding forward a step at w = 0 would shake a drive at rest. The input of the observer is u
    without d, because it does not model loads. Effects on the command, the sensors, the inertia
    or a second mass are not compensated. The error is that of the motion itself, not of the
    sensor signals.

    In ``none``, ``before`` and ``after`` the simulated drive is exactly the model and the control
    is continuous: they show what the structure of the compensation can reach. ``drive`` shows
    what a drive like the recorded one will see.

    Examples
    --------
    What it brings to feed forward the cogging torque that a diagnosis found. It simulates three
    loops, which takes some seconds:

    >>> cogging = {"name": "cogging", "amplitude": 0.05, "harmonic": 12, "phase": 0.0}
    >>> drive = lg.Model.of(lg.table1(), effects=cogging)
    >>> print(lg.compensate(drive, loop="position", bandwidth=30.0))  # doctest: +SKIP
    """
    model, observer = as_model(model), name_of("observer", observer)
    J = _checked(model, loop, kd, table, covariance)
    record = None if record is None else as_record(record, model.motion)
    before = _completed(declared, model)
    draws, seed = whole(draws, "draws", least=1), whole(seed, "seed")
    own = controller({"kp": kp, "ki": ki, "kd": kd}, loop, bandwidth, J)
    task, unit = Task(model, loop, own, table), unit_of(loop, model)
    timed = any(part.block.timed for part in (*model.effects, *before.effects))
    timed = timed or (table is not None and table.signals[0] == "t")
    way = course(reference, record, loop, bandwidth, timed)
    believed = {"before": before, "after": model}
    designs = {k: observer_gains(one, observer, K1, K2, gains) for k, one in believed.items()}
    controls = {"none": task.control(None)}
    controls |= {k: task.control(one, observer, designs[k].gains) for k, one in believed.items()}
    three, report = Three(task, way, controls, _start(observer, way)), reporter(progress)
    loops = {key: task.closed(blocks, key) for key, blocks in controls.items()}
    runs, errors, messages = three.simulated(loops, report)
    messages += _useless(errors)
    drive = None
    if record is not None:
        drive = three.spread(record, covariance, draws, seed, report)
        messages += drive.advice(unit)
    fed, left = sorted_out(model, table)
    return Compensation(
        kind=loop,
        observer=observer,
        **errors,
        unit=unit,
        controller=own,
        gains={key: design.plain for key, design in designs.items()},
        certificate=designs["after"].certificate,
        compensated=fed,
        left=left,
        reference=way.summary,
        messages=tuple(messages),
        loop=loops,
        runs=runs,
        drive=drive,
    )


def _checked(model: Model, loop: Any, kd: Any, table: Any, covariance: Any) -> float:
    if kind_of(loop) == "velocity" and kd is not None:
        raise InputError("a velocity loop has no kd; its gains are kp and ki.")
    for name, given, kind in (("table", table, Table), ("covariance", covariance, Joint)):
        if not (given is None or isinstance(given, kind)):
            raise InputError(
                f"{name} must be that of a diagnosis, result.{name}, not {shown(given)}."
            )
    if model.J is None:
        raise InputError(f"{model.name}: J has no value; identify it first.")
    return model.J


def _completed(declared: Any, model: Model) -> Model:
    """Return the declared model; values that it does not give are those of the augmented one."""
    if declared is None:
        return replace(model, effects=())
    own, known = as_model(declared, "declared"), model.known()
    return own.with_values({k: known.get(k) for k, v in own.values().items() if v is None})


def drawn(model: Model, joint: Joint | None, number: int, seed: int) -> list[Model]:
    """Return models with parameters from the joint distribution, each inside its bounds."""
    if joint is None or not joint.names:
        return [model] * (1 if joint is None else number)
    known, limits = model.known(), model.declarations()
    columns = {
        k: np.clip(np.where(np.isfinite(v), v, known[k]), limits[k].low, limits[k].high)
        for k, v in joint.sample(number, seed).items()
        if k in known and not limits[k].whole
    }
    return [model.with_values({k: float(v[i]) for k, v in columns.items()}) for i in range(number)]


def _start(observer: str | None, way: Course) -> dict[str, float]:
    """The states that begin at the position of the reference, those of the observer too."""
    states = ["plant_theta", "encoder_last"]
    if observer is not None:
        block = observer_block(observer)
        pairs = zip(block.states, block.start, strict=True)
        states += [f"{block.name}_{state}" for state, start in pairs if start == "theta"]
    return dict.fromkeys(states, float(way.theta[0]))


@dataclass(frozen=True, eq=False)
class Three:
    """Three loops that follow one reference, and where they start."""

    task: Task
    way: Course
    controls: Mapping[str, Sequence[Any]]
    start: Mapping[str, float]

    def simulated(
        self, loops: Mapping[str, Any], report: Progress
    ) -> tuple[dict[str, Run], dict[str, float], list[str]]:
        """Return each loop's run and error, and a message for each loop that does not work."""
        runs, errors, messages = {}, dict[str, float](), []
        rows, signal = self.way.rows(self.task.kind), MEASURED[self.task.kind]
        for i, (key, system) in enumerate(loops.items()):
            report(i / len(loops), f"simulating the loop {LOOPS[key]}")
            x0 = [self.start.get(state, 0.0) for state in system.state_labels]
            errors[key] = math.inf
            with warnings.catch_warnings(record=True) as said:
                warnings.simplefilter("always")
                try:
                    done = simulate(system, self.way.t, np.vstack(list(rows.values())), x0)
                except Diverged as error:
                    messages.append(
                        f"The loop {LOOPS[key]} is unstable; its simulation diverged ({error})"
                    )
                    continue
            signals: dict[str, Any] = dict(zip(OUTPUTS, done.outputs, strict=True))
            runs[key] = Run(self.way.t, rows["r"], signals[signal], signals["u"])
            errors[key] = rms(runs[key].y - rows["r"])
            messages += [f"The loop {LOOPS[key]}: {warning.message}" for warning in said]
            messages += _trouble(runs[key], LOOPS[key])
        return runs, errors, messages

    def spread(
        self, record: Record, joint: Joint | None, draws: int, seed: int, report: Progress
    ) -> Spread:
        """Return the tracking error of each loop on drives like the recorded one."""
        way, sensing, model = self.way, sensing_of(record), self.task.model
        models, names = drawn(model, joint, draws, seed), () if joint is None else joint.names
        torque = sensor_noise(record.u, record.resolution.get("u", 0.0))
        n = max(2, min(math.floor(min(way.t[-1], LONGEST) / sensing.dt), MOST))
        t, fastest = sensing.dt * np.arange(n + 1), float(np.max(np.abs(way.w)))
        rows = {k: np.interp(t, way.t, x) for k, x in way.rows(self.task.kind).items()}
        errors = {key: np.zeros(len(models)) for key in self.controls}
        for j, (key, blocks) in enumerate(self.controls.items()):
            loop = SampledLoop(self.task, sensing, blocks, fastest, self.start)
            for i, one in enumerate(models):  # the same noise for each loop
                part = (j + i / len(models)) / len(errors)
                report(part, "simulating drives like the recorded one")
                errors[key][i] = loop.error(rows, one, torque=torque, seed=seed + i)
        speed = math.nan if sensing.speed_noise is None else sensing.speed_noise
        noise = {"theta": sensing.noise, "w": speed, "u": torque}
        differ = tuple(k for k in names if k in model.values())
        return Spread(1.0 / sensing.dt, noise, sensing.resolution, differ, seed, errors)


def _useless(errors: Mapping[str, float]) -> list[str]:
    made = []
    if errors["after"] > WORSE * errors["before"]:
        made.append(f"The error is larger {LOOPS['after']} than {LOOPS['before']}.")
    for key in ("before", "after"):
        if errors["none"] < WORSE * errors[key] < math.inf:
            made.append(
                f"{LOOPS[key].capitalize()} the drive tracks no better than without compensation."
            )
    return made


def _trouble(run: Run, which: str) -> list[str]:
    """A message if a loop's error grows, or is as large as the reference's variation."""
    e, size = run.y - run.r, rms(run.r - run.r.mean())
    first, *_, last = (rms(part) for part in np.array_split(e, 4))
    if last > 2.0 * first and last > 0.5 * size:
        return [f"The loop {which} is unstable: its error grows."]
    if rms(e) > size:
        return [f"The loop {which} does not follow its reference."]
    return []

"""The loops of the bench, a drive and the blocks that control it, continuous or sampled; and the
compensation before and after: designs, simulates and compares three of them."""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import control as ct
import numpy as np
from numpy.typing import ArrayLike

from ..blocks import controllers
from ..blocks.block import Block
from ..blocks.controllers import dead_time
from ..blocks.declaration import name_of
from ..blocks.model import Model, as_model, values_of
from ..blocks.observers import Gain, observer_block
from ..blocks.plant import assemble, plant, sensor
from ..core.display import Row, Shown, noticed
from ..core.errors import Diverged, InputError
from ..core.numeric import rms
from ..core.progress import Progress, Wanted, reporter, shows_progress
from ..core.result import Result, library, picked, plain
from ..core.unit_names import si_unit
from ..core.validation import array, number, positive, shown, whole
from ..core.views import view
from ..design import Certificate, certify, design_gains
from ..design.gains import RULES
from ..estimates.findings import Joint, Table
from ..loops.friction_loops import MEASURED, OUTPUTS, Control, all_at, connected, mapped, read_of
from ..record import Record
from ..record.as_record import as_record
from ..record.signal_noise import sensor_noise, smallest_step
from ..simulation.response import COARSE, simulate, simulate_sampled
from ..simulation.sampled_block import Sensing, at_samples, encoder

SAMPLES = 4000
LONGEST = 30.0  # s of simulated time
SLOWEST = 10.0  # s, longest period of the default reference
PERIODS, SETTLED = 1.25, 0.25  # of a sine: simulated, and left out of the error
FEWEST, MOST = 20, 50_000  # samples of them
USUAL = 0.8  # of a record's speed
ENDLESS = 1e300  # stands for an infinite error


@dataclass(frozen=True, eq=False)
class Course:
    """Times, position, speed and acceleration of the reference, and a summary of it."""

    t: np.ndarray
    theta: np.ndarray
    w: np.ndarray
    a: np.ndarray
    summary: dict[str, float] = field(default_factory=dict)

    def rows(self, kind: str) -> dict[str, np.ndarray]:
        if kind == "velocity":
            return {"r": self.w, "dr": self.a}
        return {"r": self.theta, "dr": self.w, "ddr": self.a}


def sine(
    t: np.ndarray, speed: float, frequency: float, start: float = 0.0, phase: float = 0.0
) -> Course:
    """Return a sine of the speed (rad/s, Hz) that begins at a position and a phase."""
    turn = 2.0 * np.pi * frequency
    x = turn * t + phase
    theta = start + speed / turn * (np.cos(phase) - np.cos(x))
    return Course(t, theta, speed * np.sin(x), speed * turn * np.cos(x))


def samples(periods: float, frequency: float, rate: float) -> int:
    return round(periods / frequency * rate) + 1


def enough_samples(frequency: float, rate: float, what: str) -> int:
    """Return the number of samples of a run; InputError where they are too few or too many."""
    n = samples(PERIODS, frequency, rate)
    if not FEWEST <= n <= MOST:
        raise InputError(
            f"{what} takes {n} samples, outside {FEWEST} to {MOST}: give another frequency."
        )
    return n


def course(
    given: tuple[ArrayLike, ArrayLike] | None,
    record: Record | None,
    kind: str,
    bandwidth: float,
    timed: bool,
) -> Course:
    """Return the reference; ``timed``: as long as the record, for effects that depend on time."""
    if given is not None:
        return _given(given, kind)
    speed, travel, centre, duration = 1.0, 1.0 / (0.5 * np.pi), 0.0, 0.0
    if record is not None and (top := top_speed(record)):
        w, theta = record.w, record.theta
        theta = np.cumsum(0.0 if w is None else w) * record.dt if theta is None else theta
        low, high = float(np.nanmin(theta)), float(np.nanmax(theta))
        if high > low:
            speed, travel, centre = top, 0.4 * (high - low), 0.5 * (low + high)
            duration = record.samples * record.dt
    pulse = min(max(speed / travel, 2.0 * np.pi / SLOWEST), bandwidth / 5.0)
    travel = min(travel, speed / pulse)
    length = min(max(6.0 * np.pi / pulse, duration if timed else 0.0), LONGEST)
    frequency = pulse / (2.0 * np.pi)
    way = sine(np.linspace(0.0, length, SAMPLES + 1), travel * pulse, frequency, centre - travel)
    way.summary.update(peak_speed=travel * pulse, frequency=frequency, duration=length)
    return way


def _given(given: Any, kind: str) -> Course:
    if not isinstance(given, (list, tuple, np.ndarray)) or len(given) != 2:
        raise InputError(f"reference must be a pair of times and values, not {shown(given)}.")
    t, r = (array(x, f"reference: {what}") for x, what in zip(given, ("t", "r"), strict=True))
    if t.ndim != 1 or t.shape != r.shape or len(t) < 3 or not np.all(np.isfinite([t, r])):
        raise InputError("reference must be (t, r): at least 3 finite times and as many values.")
    if np.any(np.diff(t) <= 0.0):
        raise InputError("the times of the reference must increase.")
    first = np.gradient(r, t)
    moves = (np.zeros_like(r), r, first)
    if kind == "position":
        moves = r, first, np.gradient(first, t)
    summary = {"peak_speed": float(np.max(np.abs(moves[1]))), "duration": float(t[-1] - t[0])}
    return Course(t, *moves, summary)


def top_speed(record: Record) -> float:
    """Return what the speed exceeds in a twentieth of the time, less a margin; 0 without motion."""
    w, theta = record.w, record.theta
    if w is None and theta is not None:
        n = max(1, round(0.02 / record.dt))
        w = (theta[n:] - theta[:-n]) / (n * record.dt)
    return 0.0 if w is None or not len(w) else USUAL * float(np.nanquantile(np.abs(w), 0.95))


def sensing_of(record: Record) -> Sensing:
    """Rate, noise and step of the encoder, and the noise of a speed that was recorded."""
    noise, resolution, speed_noise = 0.0, 0.0, None
    if record.theta is not None:
        step = max(record.resolution.get("theta", 0.0), smallest_step(record.theta))
        size = sensor_noise(record.theta, step)
        if step < 0.1 * size:  # numbers that are much finer than the noise have no step
            noise = size
        else:
            noise, resolution = float(np.sqrt(max(size**2 - step**2 / 12.0, 0.0))), step
    if record.w is not None:
        speed_noise = sensor_noise(record.w, record.resolution.get("w", 0.0))
    return Sensing(1.0 / record.rate, noise, resolution, speed_noise)


_REASONS = {
    "input": "it acts between the command and the motor",
    "sensor": "it acts on the sensor signals only",
    "J": "it changes the inertia",
}


def _why_not(block: Block) -> str | None:
    """Why an effect's torque cannot be fed forward; None if it can."""
    if "load_inertia" in block.own:
        return "the second mass is not measured"
    return next((_REASONS[act] for act in _REASONS if act in block.acts), None)


def reasons(model: Model, table: Table | None) -> dict[str, str | None]:
    """Return for a model's effects and a table why they cannot be fed forward; None if they can."""
    made = {part.key: _why_not(part.block) for part in model.effects}
    if table is not None:
        on_u = table.signals[0] == "u"
        made[table.name] = "it depends on the torque itself" if on_u else None
    return made


def effects_torque(model: Model, *, name: str = "effects") -> ct.NonlinearIOSystem | None:
    """The torque of a model's effects from w_m and theta_m, None for none: -J dw/dt at u = 0."""
    parts = tuple(part for part in model.effects if _why_not(part.block) is None)
    if not parts:
        return None
    if all(part.block.acts == ("torque",) and not part.block.states for part in parts):
        own = {"J": model.J, "Fv": 0.0, "motion": model.motion}
        model = Model.of(friction="viscous", **own)  # with and without them: it cancels
    full, bare = replace(model, effects=parts), replace(model, effects=())
    made, known = _Resisting(assemble(full), assemble(bare)).block(), full.known()
    return made.system(
        name=name,
        inputs=["w_m", "theta_m"],
        outputs=["u"],
        **{k: known[k] for k in made.parameters},
    )


@dataclass(frozen=True)
class _Resisting:
    """What ``full`` resists at u = 0 beyond ``bare``."""

    full: Block
    bare: Block

    def __call__(self, t: Any, w: Any, theta: Any, *x: Any, **values: Any) -> tuple[Any, ...]:
        first = len(self.full.states) - 2
        _, _, dw, *rates = self.full(t, 0.0, 0.0, theta, w, *x[:first], **values)
        own = {k: values[k] for k in self.bare.parameters}
        alone, _, _, *others = self.bare(t, 0.0, 0.0, theta, w, *x[first:], **own)
        return -values["J"] * dw - alone, *rates, *others

    def block(self) -> Block:
        full, bare = self.full.states[2:], self.bare.states[2:]
        return Block(
            name="effects",
            kind="controller",
            function=self,
            inputs=("w", "theta"),
            outputs=("u",),
            states=(*full, *(f"{s}_bare" for s in bare)),
            parameters=self.full.parameters,
            timed=True,
        )


FASTEST = 1.5  # of the largest speed of the reference


@dataclass(frozen=True)
class Task:
    """What loops share: drive, kind, gains, a table on the drive."""

    model: Model
    kind: str
    controller: Mapping[str, float]
    table: Table | None = None

    def control(
        self, believed: Model | None, observer: str | None = None, gains: Any = None
    ) -> list[Any]:
        if believed is None:
            return Control(self.kind, self.controller).blocks(self.model)
        made = Control(self.kind, self.controller, observer, gains or {}).blocks(believed)
        if (torque := effects_torque(believed)) is not None:
            made.append(torque)
        table = self.table  # fed forward with the drive's own model only
        if believed is self.model and table is not None and table.signals[0] != "u":
            signals = [MEASURED[s] for s in table.signals if s != "t"]
            made.append(table.block(name="table_effect", inputs=signals, outputs=["u"]))
        return made

    def closed(self, control: Sequence[Any], name: str) -> ct.InterconnectedSystem:
        parts = [plant(self.model), sensor(self.model), *control, *self._acting()]
        return connected(parts, read_of(parts), OUTPUTS, name)

    def body(self, model: Model, command: str = "u") -> ct.InterconnectedSystem:
        """Return a drive, from the command and its noise n_u to what its sensors see."""
        noisy = ct.summing_junction([command, "n_u"], "u_act", name="torque")
        parts = [noisy, plant(model, inputs=["u_act", "d"]), *self._acting()]
        parts.append(sensor(model, outputs=["w_s", "theta_s"]))
        inputs, outputs = [command, "n_u", "d"], ["theta", "w", "theta_s", "w_s"]
        return connected(parts, inputs, outputs, "drive_body")

    def _acting(self) -> list[Any]:
        return [] if self.table is None else [self.table.block()]


def quantiles(values: Any, shares: Any, method: Any = "linear") -> list[float]:
    """Return quantiles of errors; one beside an infinite value is infinite."""
    found = np.quantile(np.minimum(values, ENDLESS), shares, method=method)
    return [float(x) if x < 1e-30 * ENDLESS else math.inf for x in found]


def unit_of(loop: Any, model: Model) -> str:
    """Return the unit of the errors of a loop; InputError for one that is not known."""
    known = controllers.MEASURED
    if not isinstance(loop, str) or loop not in known:
        raise InputError(f"unknown loop {shown(loop)}; known: {', '.join(known)}.")
    return si_unit(known[loop], model.motion)


class SampledLoop:
    """A loop in a sampled drive: its controller is built once, for many drives. ``start`` has the
    states that are not 0 at first, ``bodies`` the drives that were built before."""

    def __init__(
        self,
        task: Task,
        sensing: Sensing,
        control: Sequence[Any],
        fastest: float,
        start: Mapping[str, float] | None = None,
        bodies: dict[Any, Any] | None = None,
    ) -> None:
        self.task, self.sensing, self.start = task, sensing, start or {}
        self.late, self.bodies = sensing.delay > 0.0, {} if bodies is None else bodies
        late = dead_time(sensing.delay, sensing.dt, inputs=["u"], outputs=["u_late"])
        points = usual_points(task.model, fastest)
        self.blocks = [
            encoder(sensing, ("theta_s", "w_s")),
            *(at_samples(block, sensing.dt, points) for block in (*control, *[late] * self.late)),
        ]
        states = [f"{b.name}_{x}" for b in self.blocks if b.nstates for x in b.state_labels]
        self.placed = [self.start.get(state, 0.0) for state in states]

    def run(
        self,
        rows: Mapping[str, np.ndarray],
        model: Model | None = None,
        sensing: Sensing | None = None,
        torque: float = 0.0,
        seed: int = 0,
        params: Mapping[str, float] | None = None,
    ) -> dict[str, np.ndarray]:
        """Return a drive's signals by name, infinite where the loop diverges, and the error e of
        the motion itself; ``torque``: noise of u in N m."""
        model, sensing = model or self.task.model, sensing or self.sensing
        body, names = self._body(model)
        t = sensing.dt * np.arange(len(rows["r"]))
        noise = np.random.default_rng((seed, 1)).normal(0.0, torque, len(t))
        given = {**rows, **sensing.errors(len(t), seed), "n_u": noise}
        read = {k for block in (body, *self.blocks) for k in block.input_labels}
        known = {f"{part}.{k}": v for part in ("plant", "sensor") for k, v in model.known().items()}
        x0 = [self.start.get(state, 0.0) for state in body.state_labels]
        own: dict[str, Any] = {"drive_x0": self.placed, "rtol": COARSE}
        own["params"] = {k: v for k, v in known.items() if k in names} | dict(params or {})
        given = {k: x for k, x in given.items() if k in read}
        try:
            with warnings.catch_warnings(), np.errstate(all="ignore"):
                warnings.simplefilter("ignore")  # a loop that does not work is a result here
                done = simulate_sampled(body, self.blocks, t, given, x0, **own)
        except Diverged:
            return dict.fromkeys((*OUTPUTS, "u_fb"), np.full(len(t), np.inf))
        out = dict(zip(done.output_labels or (), np.asarray(done.outputs), strict=True))
        return out | {"e": out[controllers.MEASURED[self.task.kind]] - rows["r"]}

    def _body(self, model: Model) -> tuple[Any, set[str]]:
        key = (self.late, model.friction.block.name, *(p.key for p in model.effects))
        if key not in self.bodies:
            names = {*plant(model).params, *sensor(model).params}
            self.bodies[key] = self.task.body(model, "u_late" if self.late else "u"), names
        return self.bodies[key]


def usual_points(model: Model, fastest: float) -> list[dict[str, float]]:
    """Return usual inputs and states of an observer by name, at rest and in motion."""
    known = {k: v or 0.0 for k, v in model.values().items()}
    torque = max(known.get("Fs", 0.0), known.get("Fc", 0.0))
    z = torque / known["sigma0"] if known.get("sigma0") else 0.0
    sizes = dict.fromkeys(("u", "u_fb", "zeta", "f", "Fhat"), torque) | {"zhat": z, "z": z}
    return [
        sizes
        | dict.fromkeys(("w", "w_m", "what"), w)
        | {"xi": known["J"] * w + known.get("sigma1", 0.0) * z}
        for w in (0.0, 0.1 * fastest, fastest)
    ]


LIGHT = 0.1  # of critical damping; with less damping by sigma1 design_gains is not used
LAG = 0.4  # rad that sampling and dead time take at the crossover
LUGRE = ("J", "sigma0", "sigma1", "Fc", "Fs", "Fv", "vs")


def controller(
    given: Mapping[str, float | None], kind: str, rate: float, J: float
) -> dict[str, float]:
    """Return the given gains; if none is given, those with every pole at -rate."""
    names = ("kp", "ki") if kind == "velocity" else ("kp", "ki", "kd")
    if any(v is not None for v in given.values()):
        return {k: 0.0 if given[k] is None else number(given[k], k) for k in names}
    return all_at(kind, J, positive(rate, "bandwidth", "1/s"))


def fastest(sensing: Sensing) -> float:
    """Return the crossover in rad/s that sampling and dead time allow."""
    return LAG / (0.5 * sensing.dt * (1.0 + (sensing.speed_noise is None)) + sensing.delay)


def unknown(name: str, model: Model) -> str | None:
    needs, have = observer_block(name).parameters, model.values()
    missing = [k for k in LUGRE if k in needs and have.get(k) is None]
    law = model.friction.block.name
    if not missing:
        return None
    return f"it must know {', '.join(missing)}, which the model with {law} friction does not have."


def given_gains(gains: Any) -> dict[str, dict[str, Any]]:
    if gains is None:
        return {}
    if not isinstance(gains, Mapping) or not all(isinstance(v, Mapping) for v in gains.values()):
        raise InputError(f"gains must be a dict of dicts by observer, not {shown(gains)}.")
    checked = {observer_block(name).name: dict(own) for name, own in gains.items()}
    for name, own in checked.items():
        observer_block(name).check(own)
    return checked


def designed(
    model: Model, name: str, dt: float, speed: float, **more: float
) -> tuple[dict[str, Any], Certificate]:
    usual = {"dt": dt, "M": FASTEST * speed, "speed": speed, "w0": 0.2 * speed} | more
    choices = RULES[name].choices if name in RULES else {}
    own: dict[str, Any] = {k: v for k, v in usual.items() if k in choices}
    design = design_gains(values_of(model), observer=name, **own)
    return dict(design.gains), design.certificate


def observer_gains(
    believed: Model, name: str | None, K1: Gain | None, K2: Gain | None, gains: Any
) -> tuple[dict[str, Any], Certificate | None]:
    """Return the gains of an observer, K1 and K2 that are left out by design."""
    own = mapped(gains, "gains")
    if name is None or observer_block(name).name != "proposed_observer":
        own |= {k: K for k, K in (("K1", K1), ("K2", K2)) if K is not None}
        return own, None
    if (K1 is None) != (K2 is None):
        raise InputError("give both K1 and K2, or neither.")
    if why := unknown("proposed", believed):
        raise InputError(f"the {name} observer: {why} Choose observer='disturbance' or None.")
    known, numbers = believed.known(), not (callable(K1) or callable(K2))
    critical = 2.0 * math.sqrt(known["J"] * known["sigma0"])
    if K1 is not None:
        own |= {"K1": K1, "K2": K2}
    elif known["sigma1"] < LIGHT * critical:
        # with sigma1 = 0 the errors at rest have the polynomial s^2 + (K2/J) s - K1 sigma0/J:
        # this puts both poles at -sqrt(sigma0/J)
        own |= {"K1": -1.0, "K2": critical}
    else:
        own |= design_gains(believed).gains
    return own, certify(believed, own["K1"], own["K2"]) if numbers else None


def in_numbers(gains: Mapping[str, Any]) -> dict[str, Any]:
    return {k: "a function of w" if callable(v) else number(v, k) for k, v in gains.items()}


# ---- before and after


LOOPS = {
    "none": "without compensation",
    "before": "with the compensation of the declared model",
    "after": "with the compensation of the augmented model",
}
DRAWS = 20
BRIEF, MANY = 6.0, 40_000  # s of a run on a drive like the recorded one, and its samples
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
        middle, low, high = quantiles(self.errors[key], (0.5, 0.1, 0.9))
        return middle, low, high

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
        draws = {"draws": len(self.errors["none"]), "recommended": self.best}
        return picked(self, "rate resolution noise drawn seed") | draws | loops

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
        made = {"loop": self.kind, "signal": controllers.MEASURED[self.kind]}
        made |= picked(self, "observer unit none before after controller certificate compensated")
        left = [{"name": name, "reason": why} for name, why in self.left]
        made |= {"not_compensated": left, "observer_gains": plain(self.gains)}
        return made | picked(self, "reference messages drive")

    def to_frame(self) -> Any:
        """A DataFrame of the simulated loops: a row for each loop and time t, columns r, y, u."""
        pandas = library("pandas")
        made = {k: pandas.DataFrame(vars(run)).set_index("t") for k, run in self.runs.items()}
        none = pandas.DataFrame(columns=["r", "y", "u"])
        return pandas.concat(made, names=["loop", "t"]) if made else none

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
    controls |= {k: task.control(one, observer, designs[k][0]) for k, one in believed.items()}
    three, report = Three(task, way, controls, _start(observer, way)), reporter(progress)
    loops = {key: task.closed(blocks, key) for key, blocks in controls.items()}
    runs, messages = three.simulated(loops, report)
    errors = {k: rms(runs[k].y - runs[k].r) if k in runs else math.inf for k in LOOPS}
    messages += _seen(runs, errors)
    drive = None
    if record is not None:
        drive = three.spread(record, drawn(model, covariance, draws, seed), seed, report)
        messages += drive.advice(unit)
    why = reasons(model, table)
    return Compensation(
        kind=loop,
        observer=observer,
        **errors,
        unit=unit,
        controller=own,
        gains={k: in_numbers(used) for k, (used, _) in designs.items()},
        certificate=designs["after"][1],
        compensated=tuple(k for k, reason in why.items() if reason is None),
        left=tuple((k, reason) for k, reason in why.items() if reason is not None),
        reference=way.summary,
        messages=tuple(messages),
        loop=loops,
        runs=runs,
        drive=drive,
    )


def _checked(model: Model, loop: Any, kd: Any, table: Any, covariance: Any) -> float:
    unit_of(loop, model)
    if loop == "velocity" and kd is not None:
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


Drawn = tuple[list[Model], tuple[str, ...]]


def drawn(model: Model, joint: Joint | None, number: int, seed: int) -> Drawn:
    """Return models with parameters from the joint distribution, each inside its bounds, and the
    names of these."""
    if joint is None:
        return [model], ()
    known, limits = model.known(), model.declarations()
    columns = {
        k: np.clip(np.where(np.isfinite(v), v, known[k]), limits[k].low, limits[k].high)
        for k, v in joint.sample(number, seed).items()
        if k in known and not limits[k].whole
    }
    rows = ({k: float(v[i]) for k, v in columns.items()} for i in range(number))
    return [model.with_values(row) for row in rows], tuple(columns)


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
    ) -> tuple[dict[str, Run], list[str]]:
        """Return the run of each loop that does not diverge, and messages."""
        runs, messages = dict[str, Run](), list[str]()
        rows, signal = self.way.rows(self.task.kind), controllers.MEASURED[self.task.kind]
        for i, (key, system) in enumerate(loops.items()):
            report(i / len(loops), f"simulating the loop {LOOPS[key]}")
            x0 = [self.start.get(state, 0.0) for state in system.state_labels]
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
            messages += [f"The loop {LOOPS[key]}: {warning.message}" for warning in said]
        return runs, messages

    def spread(self, record: Record, drives: Drawn, seed: int, report: Progress) -> Spread:
        """Return the tracking error of each loop on drives like the recorded one."""
        way, sensing, (models, names) = self.way, sensing_of(record), drives
        torque = sensor_noise(record.u, record.resolution.get("u", 0.0))
        n = max(2, min(math.floor(min(way.t[-1], BRIEF) / sensing.dt), MANY))
        t, fastest = sensing.dt * np.arange(n + 1), float(np.max(np.abs(way.w)))
        rows = {k: np.interp(t, way.t, x) for k, x in way.rows(self.task.kind).items()}
        errors = {key: np.zeros(len(models)) for key in self.controls}
        for j, (key, blocks) in enumerate(self.controls.items()):
            loop = SampledLoop(self.task, sensing, blocks, fastest, self.start)
            for i, one in enumerate(models):  # the same noise for each loop
                part = (j + i / len(models)) / len(errors)
                report(part, "simulating drives like the recorded one")
                errors[key][i] = rms(loop.run(rows, one, torque=torque, seed=seed + i)["e"])
        speed = math.nan if sensing.speed_noise is None else sensing.speed_noise
        noise = {"theta": sensing.noise, "w": speed, "u": torque}
        return Spread(1.0 / sensing.dt, noise, sensing.resolution, names, seed, errors)


def _seen(runs: Mapping[str, Run], errors: Mapping[str, float]) -> Iterable[str]:
    """Say which loops do not follow their reference, and which compensation is of no use."""
    for key, run in runs.items():
        e, size = run.y - run.r, rms(run.r - run.r.mean())
        first, *_, last = (rms(part) for part in np.array_split(e, 4))
        if last > max(2.0 * first, 0.5 * size):
            yield f"The loop {LOOPS[key]} is unstable: its error grows."
        elif rms(e) > size:
            yield f"The loop {LOOPS[key]} does not follow its reference."
    if errors["after"] > WORSE * errors["before"]:
        yield f"The error is larger {LOOPS['after']} than {LOOPS['before']}."
    for key in ("before", "after"):
        if errors["none"] < WORSE * errors[key] < math.inf:
            said = LOOPS[key].capitalize()
            yield f"{said} the drive tracks no better than without compensation."

"""The loops of the bench: a drive and the blocks that control it, continuous or sampled."""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import control as ct
import numpy as np
from numpy.typing import ArrayLike

from ..blocks import controllers
from ..blocks.block import Block, unit_for
from ..blocks.controllers import dead_time
from ..blocks.model import Model, values_of
from ..blocks.observers import Gain, observer_block
from ..blocks.plant import assemble, plant, sensor
from ..core.errors import Diverged, InputError
from ..core.numeric import rms
from ..core.validation import array, number, positive, shown
from ..design import Certificate, certify, design_gains
from ..design.gains import RULES
from ..engine.adaptive_run import interpreted
from ..estimates.findings import Table
from ..loops.parts import MEASURED, OUTPUTS, Control, all_at, connected, read_of
from ..record import Record
from ..record.signal_noise import sensor_noise, smallest_step
from ..simulation.encoder import Sensing, encoder
from ..simulation.sampled_block import at_samples
from ..simulation.sampled_response import COARSE, simulate_sampled

SAMPLES = 4000
LONGEST = 30.0  # s of simulated time
SLOWEST = 10.0  # s, longest period of the default reference
PERIODS, SETTLED = 1.25, 0.25  # of a sine: simulated, and left out of the error
FEWEST, MOST = 20, 50_000  # samples of them
USUAL = 0.8  # of a record's speed


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
    speed, travel, centre, duration = _range(record)
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


def speed_of(record: Record) -> float:
    return _range(record)[0]


def top_speed(record: Record) -> float:
    """Return what the speed exceeds in a twentieth of the time, less a margin; 0 without motion."""
    w, theta = record.w, record.theta
    if w is None and theta is not None:
        n = max(1, round(0.02 / record.dt))
        w = (theta[n:] - theta[:-n]) / (n * record.dt)
    return 0.0 if w is None or not len(w) else USUAL * float(np.nanquantile(np.abs(w), 0.95))


def _range(record: Record | None) -> tuple[float, float, float, float]:
    """Return speed, half travel and centre, well inside the record's range, and its duration."""
    if record is not None:
        theta, speed = record.theta, top_speed(record)
        if theta is None:
            theta = np.cumsum(np.zeros(1) if record.w is None else record.w) * record.dt
        low, high = float(np.nanmin(theta)), float(np.nanmax(theta))
        if speed > 0.0 and high > low:
            return speed, 0.4 * (high - low), 0.5 * (low + high), record.samples * record.dt
    return 1.0, 1.0 / (0.5 * np.pi), 0.0, 0.0


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


_REASONS = (
    ("input", "it acts between the command and the motor"),
    ("sensor", "it acts on the sensor signals only"),
    ("J", "it changes the inertia"),
)


def _why_not(block: Block) -> str | None:
    """Why an effect's torque cannot be fed forward; None if it can."""
    if "load_inertia" in block.own:
        return "the second mass is not measured"
    return next((why for act, why in _REASONS if act in block.acts), None)


def sorted_out(
    model: Model, table: Table | None
) -> tuple[tuple[str, ...], tuple[tuple[str, str], ...]]:
    """Return what of a model's effects and a table is compensated, and what is not and why."""
    reasons = {part.key: _why_not(part.block) for part in model.effects}
    if table is not None:
        on_u = table.signals[0] == "u"
        reasons[table.name] = "it depends on the torque itself" if on_u else None
    fed = tuple(k for k, why in reasons.items() if why is None)
    return fed, tuple((k, why) for k, why in reasons.items() if why is not None)


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
TURNS = {"velocity": "rad/s", "position": "rad"}


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


def kind_of(loop: Any) -> str:
    if not isinstance(loop, str) or loop not in TURNS:
        raise InputError(f"unknown loop {shown(loop)}; known: {', '.join(TURNS)}.")
    return loop


def unit_of(kind: str, model: Model) -> str:
    return unit_for(TURNS[kind], model.motion)


class SampledLoop:
    """A loop in a sampled drive: its controller is built once, for many drives.

    ``fastest`` is the largest speed of the reference, ``start`` has the states that are not 0 at
    first, ``bodies`` the drives that were built before.
    """

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
        **params: float,
    ) -> dict[str, np.ndarray]:
        """Return a drive's signals by name; ``torque``: noise of u in N m. Raises Diverged."""
        model, sensing = model or self.task.model, sensing or self.sensing
        body, names = self._body(model)
        t = sensing.dt * np.arange(len(rows["r"]))
        noise = np.random.default_rng((seed, 1)).normal(0.0, torque, len(t))
        given = {**rows, **sensing.errors(len(t), seed), "n_u": noise}
        read = {k for block in (body, *self.blocks) for k in block.input_labels}
        known = {f"{part}.{k}": v for part in ("plant", "sensor") for k, v in model.known().items()}
        x0 = [self.start.get(state, 0.0) for state in body.state_labels]
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")  # a loop that does not work is a result here
            done = simulate_sampled(
                body,
                self.blocks,
                t,
                {k: x for k, x in given.items() if k in read},
                x0,
                drive_x0=self.placed,
                params={k: v for k, v in known.items() if k in names} | params,
                rtol=COARSE,
            )
        return dict(zip(done.output_labels or (), np.asarray(done.outputs), strict=True))

    def error(
        self, rows: Mapping[str, np.ndarray], model: Model, counted: Any = slice(None), **own: Any
    ) -> float:
        """Return the RMS tracking error of the motion itself; infinite where the loop diverges."""
        try:
            y = self.run(rows, model, **own)[controllers.MEASURED[self.task.kind]]
        except Diverged:
            return math.inf
        return rms((y - rows["r"])[counted])

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


LAM = 20.0  # 1/s, of the sliding error in a position loop


@dataclass(frozen=True)
class Terms:
    """What is equal for all observers, and how their own feedback is made up for.

    An observer that is corrected by k e is a controller k (sigma1 s + sigma0)/(s + a) as well,
    a = sigma0 |w|/h(w). The others get the same as kp + sigma1 k and ki + sigma0 k. ``designed``
    holds the gains of observers by name; k goes before a k in it. ``ahead``: the velocity loop
    has the feed-forward J dr; the position loop always has J ddr. ``bodies``: drives already built.
    """

    model: Model
    k: float
    equal: bool
    designed: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    ahead: bool = False
    bodies: dict[Any, Any] = field(default_factory=dict)

    def feedback(self, name: str, gains: Mapping[str, float]) -> dict[str, float]:
        known = self.model.known()
        if not self.equal or corrected(name) or "sigma0" not in known:
            return dict(gains)
        extra = {"kp": self.k * known.get("sigma1", 0.0), "ki": self.k * known["sigma0"]}
        return {g: v + extra.get(g, 0.0) for g, v in gains.items()}

    def own(self, name: str, kind: str) -> dict[str, Any]:
        """Return the gains of an observer; s contains 20 e of position, as its k allows for."""
        gains = dict(self.designed.get(name, {}))
        if not corrected(name):
            return gains
        on_s = "s" in observer_block(name).inputs and kind == "position"
        return gains | {"k": self.k / LAM if on_s else self.k}

    def control(
        self, name: str, kind: str, gains: Mapping[str, float], believed: Mapping[str, float]
    ) -> list[Any]:
        known = {k: v for k, v in believed.items() if k in observer_block(name).parameters}
        own, ahead = self.own(name, kind) | known, self.ahead or kind == "position"
        return Control(kind, self.feedback(name, gains), name, own, ahead).blocks(self.model)

    def closed(self, name: str, kind: str, gains: Mapping[str, float]) -> Any:
        parts = [
            plant(self.model, inputs=["u_late", "d"]),
            dead_time(0.0, inputs=["u"], outputs=["u_late"]),
            sensor(self.model, outputs=["w_s", "theta_s"]),
            ct.summing_junction(["theta_s", "n_theta"], "theta_m", name="encoder"),
            ct.summing_junction(["w_s", "n_w"], "w_m", name="speed"),
            *self.control(name, kind, gains, {}),
        ]
        inputs = [*read_of(parts), "n_theta", "n_w", "d"]
        return connected(parts, inputs, OUTPUTS, f"{observer_block(name).name}_{kind}_loop")

    def run(
        self,
        control: Sequence[Any],
        kind: str,
        sensing: Sensing,
        fastest: float,
        rows: Mapping[str, np.ndarray],
    ) -> dict[str, np.ndarray]:
        """Return the signals of a sampled drive by name. Raises Diverged."""
        task = Task(self.model, kind, {})
        loop = SampledLoop(task, sensing, control, FASTEST * fastest, bodies=self.bodies)
        with interpreted():  # each loop runs a few times only
            return loop.run(rows)


def corrected(name: str) -> bool:
    made = observer_block(name)
    return bool({"e", "s"} & {*made.inputs}) and "k" in made.parameters


def wrong(
    name: str, known: Mapping[str, float], groups: Sequence[Sequence[str]], off: Mapping[Any, float]
) -> dict[str, dict[str, float]]:
    """Return what an observer may believe: each group of its parameters wrong, each way."""
    needs, cases = observer_block(name).parameters, {}
    for group in groups:
        keys = [k for k in group if k in needs and known.get(k)]
        for way in (-1.0, 1.0) if any(off.get(k) for k in keys) else ():
            factors = {k: 1.0 + way * off.get(k, 0.0) for k in keys}
            largest = max(factors.values(), key=lambda factor: abs(factor - 1.0))
            cases[f"{', '.join(keys)} x{largest:g}"] = {k: f * known[k] for k, f in factors.items()}
    return cases


LIGHT = 0.1  # of critical damping; with less damping by sigma1 design_gains is not used
LAG = 0.4  # rad that sampling and dead time take at the crossover
LUGRE = ("J", "sigma0", "sigma1", "Fc", "Fs", "Fv", "vs")
K = 0.35  # of an observer that the tracking error corrects, where no bristles say how much


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


def correction(known: Mapping[str, Any], bandwidth: float) -> float:
    """Return k that adds as much integral as the PI of this crossover has."""
    if not known.get("sigma0"):
        return K
    k = known["J"] * bandwidth**2 / 20.0 / known["sigma0"]
    damping = known.get("sigma1") or 0.0
    return float(min(k, 0.5 * known["J"] * bandwidth / damping) if damping else k)


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
    usual = {"dt": dt, "M": 1.5 * speed, "speed": speed, "w0": 0.2 * speed} | more
    choices = RULES[name].choices if name in RULES else {}
    own: dict[str, Any] = {k: v for k, v in usual.items() if k in choices}
    design = design_gains(values_of(model), observer=name, **own)
    return dict(design.gains), design.certificate


class Chosen(NamedTuple):
    """Gains of an observer, the same as plain values, and the certificate."""

    gains: dict[str, Any]
    plain: dict[str, Any]
    certificate: Certificate | None


def observer_gains(
    believed: Model, name: str | None, K1: Gain | None, K2: Gain | None, gains: Any
) -> Chosen:
    """Return the gains of an observer; K1 and K2 that are left out by design."""
    if not (gains is None or isinstance(gains, Mapping)):
        raise InputError(f"gains must be a dict of numbers by name, not {shown(gains)}.")
    own = dict(gains or {})
    if name is None or observer_block(name).name != "proposed_observer":
        own |= {k: K for k, K in (("K1", K1), ("K2", K2)) if K is not None}
        return Chosen(own, _plain(own), None)
    if (K1 is None) != (K2 is None):
        raise InputError("give both K1 and K2, or neither.")
    numbers = not (callable(K1) or callable(K2))
    if numbers and "sigma1" not in believed.friction.values:
        raise InputError(
            f"the {name} observer copies LuGre friction, but {believed.name} has "
            f"'{believed.friction.block.name}' friction; choose observer='disturbance' or None."
        )
    known = believed.known()
    critical = 2.0 * math.sqrt(known.get("J", 0.0) * known.get("sigma0", 0.0))
    if K1 is not None:
        own |= {"K1": K1, "K2": K2}
    elif known.get("sigma1", math.inf) < LIGHT * critical:
        # with sigma1 = 0 the errors at rest have the polynomial s^2 + (K2/J) s - K1 sigma0/J:
        # this puts both poles at -sqrt(sigma0/J)
        own |= {"K1": -1.0, "K2": critical}
    else:
        own |= design_gains(believed).gains
    plain = _plain(own)
    return Chosen(own, plain, certify(believed, own["K1"], own["K2"]) if numbers else None)


def _plain(gains: Mapping[str, Any]) -> dict[str, Any]:
    return {k: "a function of w" if callable(v) else number(v, k) for k, v in gains.items()}

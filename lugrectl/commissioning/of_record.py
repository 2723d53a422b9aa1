"""From a log and a model to the frequency response of the axis, and the excitation to record.

Friction, response, mechanics, and once more with what they say. The excitation: jogs that reverse
keep the axis out of the presliding range and carry the low frequencies; a multisine on the speed
reference is a torque of the same size at all frequencies above the loop's bandwidth. Both are sized
by the torque that they cost a speed loop of gain kp on a rigid axis.
"""

from __future__ import annotations

import io
import warnings
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import control as ct
import numpy as np

from ..blocks.model import Model, Part, as_model
from ..blocks.plant import STAGES, leveled, stage
from ..core.display import Row, between, noticed, number
from ..core.errors import InputError, Refused
from ..core.provenance import Provenance, stamped
from ..core.result import Result, picked, plain
from ..core.unit_names import unit_for
from ..core.validation import positive, whole
from ..core.views import view
from ..record import pooled, record_of, refuse_dead
from ..record.as_record import as_logs
from .fits import (
    FEWEST,
    NARROW,
    Friction,
    Mechanics,
    Mode,
    Response,
    Run,
    Window,
    fit_friction,
    fit_mechanics,
    load_motion,
    local_response,
    problem_of,
    runs_of,
    windows,
)

LARGE = 2.0  # dB by which friction changes a response that it governs: no band holds there
WIDEST = 10.0 ** (LARGE / 20.0) - 1.0  # of P: the radius of a band of as many dB
CERTAIN = 0.95  # coherence below which nothing is certain
GOOD = "Friction changes the response below {:.3g} Hz by {:.1f} dB: the band holds."
BAD = (
    "Friction governs {} of {} points, {:.3g} to {:.3g} Hz: it changes the response by 2 dB or "
    "more there, and no band holds."
)
RECORD = (
    "Record 30 s of quick moves that mostly reverse, with a multisine on the speed reference whose "
    "torque is about twice the friction, and log the reference."
)
THIN = "Only {} of {} points are certain: elsewhere the log excites the axis too little."
UNSURE = (
    "{} of {} points of the response are not certain (coherence below 0.95, a band of more than 2 "
    "dB, or friction governs)."
)
FEW = 0.5  # of the points: with fewer certain ones that is said
UNIT = {"rotary": "(rad/s)/(N m)", "linear": "(m/s)/N"}  # of a response


class UncertainResponseWarning(UserWarning):
    """A response is used at points that are not certain."""


@dataclass(eq=False, repr=False)
class FrequencyResponse(Result, ct.FrequencyResponseData):
    """The frequency response from motor torque less friction to motor speed.

    A ``control.FrequencyResponseData`` of all points, at the log's sample time: of a loop with the
    controller C, ``lg.stability_check(C * response)``, which warns of points that are not certain.

    Attributes
    ----------
    frd, raw : control.FrequencyResponseData
        The response with friction taken out, and without; (rad/s)/(N m), or (m/s)/N, at the log's
        sample time: the torque is held over each sample, and a dead time is part of it.
    frequency, magnitude, phase : ndarray
        In rad/s, as above, and rad (``unwrapped`` along what is certain).
    low, high : ndarray
        The 95 % band of the magnitude; NaN where nothing is certain.
    coherence : ndarray
        The share of the speed's power about each frequency that the response explains; 0 where it
        may be that of the controller.
    correction : float
        By how many dB friction changes the response below 10 Hz, the median.
    governed : ndarray
        Whether friction changes the response about each frequency by 2 dB or more.
    trusted : bool
        Whether ``correction`` is below 2 dB, and any point certain.
    modes : tuple of Mode
        Antiresonances and resonances, ``frequency`` in rad/s, ``damping`` as a ratio, with 95 %
        intervals ``ci95`` and ``damping_ci95``.
    inertia : float or None
        In kg m2 or kg, of the whole axis; None where the log does not show it.
    inertia_ci95 : tuple of float or None
        Its 95 % interval.
    friction : dict
        Levels that were taken out, N m or N. Good for that; identify estimates them.
    reference : bool
        Whether a logged reference served as instrument.
    messages : tuple of str
        What was noticed, the verdict on friction first.
    mechanics : Mechanics or None
        The fitted model that inertia and modes are of; :func:`tune` reads it.
    gains : Tuning or None
        Of ``lugrectl bode --tune``.
    """

    frd: ct.FrequencyResponseData
    raw: ct.FrequencyResponseData
    unwrapped: np.ndarray
    low: np.ndarray
    high: np.ndarray
    coherence: np.ndarray
    correction: float
    governed: np.ndarray
    modes: tuple[Mode, ...] = ()
    inertia: float | None = None
    inertia_ci95: tuple[float, float] | None = None
    friction: Mapping[str, float] = field(default_factory=dict)
    reference: bool = False
    motion: str = "rotary"
    messages: tuple[str, ...] = ()
    mechanics: Mechanics | None = field(default=None, repr=False)
    gains: Any = None
    provenance: Provenance | None = field(default=None, repr=False)
    is_axis = True  # and no loop

    def __post_init__(self) -> None:
        ct.FrequencyResponseData.__init__(self, self.frd, sysname="axis")

    @property
    def frequency(self) -> np.ndarray:
        return self.omega

    @property
    def magnitude(self) -> np.ndarray:
        return np.abs(np.asarray(self.frdata)[0, 0])

    @property
    def phase(self) -> np.ndarray:
        return self.unwrapped

    def __str__(self) -> str:
        return repr(self)

    def __mul__(self, other: Any) -> Any:
        return self._used() * other

    def __rmul__(self, other: Any) -> Any:
        return other * self._used()

    def _used(self) -> ct.FrequencyResponseData:
        """All points, with a warning where some are not certain."""
        if unsure := int((~self.certain).sum()):
            said = UNSURE.format(unsure, len(self.omega))
            warnings.warn(said, UncertainResponseWarning, stacklevel=3)
        return self.frd

    @property
    def trusted(self) -> bool:
        return self.correction < LARGE and bool(self.certain.any())

    @property
    def certain(self) -> np.ndarray:
        """Where the coherence is at least 0.95, friction does not govern, and the band is within 2
        dB."""
        radius = self.high - self.magnitude
        return band_holds(self.coherence, self.governed, radius, self.magnitude)

    @property
    def raw_phase(self) -> np.ndarray:
        """The phase of ``raw`` in rad, within half a turn of ``phase``."""
        return self.phase + np.angle(np.ravel(self.raw.frdata) / np.ravel(self.frd.frdata))

    @property
    def unit(self) -> str:
        """Of the magnitude."""
        return UNIT[self.motion]

    def plot(self) -> Sequence[Any]:
        """Draw magnitude, phase and coherence, with the band; uncertain points are faint. With
        ``gains`` also Nyquist's curve and a step. Returns the Axes."""
        return view("loop_plots.bode")(self)

    def summary(self) -> dict[str, Any]:
        """Plain Python, as in the JSON document."""
        raw = np.asarray(self.raw.frdata)[0, 0]
        names = "frequency magnitude phase low high coherence correction governed trusted modes"
        names += " inertia inertia_ci95 friction reference gains messages provenance"
        both = {"magnitude": np.abs(raw), "phase": self.raw_phase}
        return {"schema": 1, **picked(self, names), "raw": plain(both)}

    def _title(self) -> str:
        sure, all_of = int(self.certain.sum()), len(self.frequency)
        f = self.frequency[[0, -1]] / (2.0 * np.pi)
        return f"Frequency response, {f[0]:.3g} to {f[1]:.4g} Hz: {sure} of {all_of} points certain"

    def _rows(self) -> Iterable[Row]:
        force, mass = (unit_for(unit, self.motion) for unit in ("N m", "kg m2"))
        sizes = {"Fc": self.friction.get("Fc"), "load's Fc": self.friction.get("load Fc")}
        levels = ", ".join(f"{k} {number(v, 3)}" for k, v in sizes.items() if v)
        inertia = f"({between(self.inertia_ci95)})" if self.inertia_ci95 else ""
        return [
            *([Row("inertia", number(self.inertia), mass, inertia)] if self.inertia else []),
            *(Row(mode.kind, *_shown(mode)) for mode in self.modes),
            *([Row("taken out", levels, force)] if levels else []),
            *noticed(self.messages, "messages"),
        ]


def band_holds(
    coherence: np.ndarray, governed: np.ndarray, radius: np.ndarray, size: np.ndarray
) -> np.ndarray:
    """Where a band of P holds, whose disc has this radius about a P of this size (n,)."""
    return (coherence >= CERTAIN) & ~governed & (radius <= WIDEST * size)


def unwrapped(w: np.ndarray, P: np.ndarray, sure: np.ndarray) -> np.ndarray:
    """The phase, unwrapped along what is certain; the rest is within half a turn of that."""
    angle = np.angle(P)
    line = np.interp(w, w[sure], np.unwrap(angle[sure]))
    return line + np.angle(np.exp(1j * (angle - line)))


def _shown(mode: Mode) -> tuple[str, str, str]:
    low, high = (x / (2.0 * np.pi) for x in mode.ci95)
    hertz = f"({mode.frequency / (2.0 * np.pi):.4g} Hz, {low:.4g} to {high:.4g})"
    return f"{mode.frequency:.4g}", "rad/s", f"{hertz}, damping {mode.damping:.2g}"


LINEAR = ("input_delay", "actuator_lag", "velocity_sensor_lag", "elastic_coupling")
LEFT = "{} is not taken out: it is no torque of position, speed and time with known values."
ACTS = {"torque", "input", "Fc", "Fs", "Fv", "+Fc", "+Fs"}


def known_effects(runs: Sequence[Run], model: Model) -> tuple[list[Run], list[str]]:
    """The runs with the effects of a model along the measured motion, and what stays in the
    response, in words; what is linear stays without a word. InputError for an open value."""
    parts, said, friction = [], [], model.friction.values
    for part in model.effects:
        shared = any(p.shared for p in part.block.parameters.values())
        acts = {*part.block.acts}
        if part.block.name in LINEAR:
            continue
        unknown = "+Fc" in acts and not friction.get("Fc")
        unknown |= "Fv" in acts and friction.get("Fv", 0.0) is None
        if part.block.states or shared or unknown or not acts <= ACTS or acts == {"Fs"}:
            said.append(LEFT.format(part.key))
            continue
        if missing := [k for k, v in part.values.items() if v is None]:
            raise InputError(
                f"{part.key}: {', '.join(missing)} must be known to take it out: identify it, "
                "and give the model with its value."
            )
        parts.append(part)
    parts.sort(key=lambda part: STAGES.index(stage(part.block)))
    return [_along(run, parts, friction) for run in runs], said


def _along(run: Run, parts: Sequence[Part], friction: Mapping[str, float | None]) -> Run:
    """A run with the torque that acts on it, the resisting torque, and the level of friction."""
    middle = np.append(0.5 * (run.theta[1:] + run.theta[:-1]), run.theta[-1])
    signals = {"t": run.t + 0.5 * run.dt, "theta": middle, "w": run.speed, "u": run.u}
    signals["load"], resisting, changes = run.load, run.load, list[tuple[str, Any]]()
    for part in parts:
        values = part.block(*(signals[name] for name in part.block.reads), **part.values)
        acts = dict(part.block.deeds(values))
        signals["u"] = np.broadcast_to(acts.pop("input", signals["u"]), run.u.shape)
        torque = acts.pop("torque", 0.0)
        resisting = resisting + torque
        signals["load"] = signals["load"] + torque * part.block.load
        changes += acts.items()
    level = {"Fc": friction.get("Fc") or 1.0, "Fv": friction.get("Fv") or 0.0}
    now = leveled(level, changes)
    resisting = resisting + (now["Fv"] - level["Fv"]) * run.speed
    return replace(run, u=signals["u"], load=resisting, scale=now["Fc"] / level["Fc"])


HIGHEST = 0.4  # of half the sampling rate
LOWEST = 30  # periods in the longest run
ROUNDS = 2  # with the mechanics that the round before showed
OCTAVE = 0.35  # of log frequency to either side: over it what friction does is a median
SURE = 0.01  # by which the mean log residual must fall for friction, and once more for the load's
ON_LOAD = 0.25  # of the friction: with so much on the load its motion is first computed
SLOW = 10.0  # Hz below which friction is looked for
NEAR, TENTH = 0.4, 0.1  # so near a mode's frequency so many points must be certain
VAGUE = 0.1  # of its value: a mode or an inertia less certain than that is not given
LEAST_RANGE = 0.5  # decades of frequency
NOWHERE = (
    "the response is certain at no frequency from {:.3g} to {:.3g} Hz, as friction governs, the "
    "log excites the axis too little, or something else moves it (the torque explains at most "
    "{:.0%} of the speed, about {:.3g} Hz, and it must be 95 %, with a band within 2 dB): record"
)
NONE = "No dry friction shows clearly in the log, or the axis never reverses: nothing is taken out."


@stamped("lugrectl.frequency_response")
def frequency_response(
    record: Any,
    model: Any,
    *,
    columns: Mapping[str, str] | str | None = None,
    units: Mapping[str, str] | str | None = None,
    scale: Mapping[str, float] | str | None = None,
    rate: float | None = None,
) -> FrequencyResponse:
    """The frequency response of an axis from an ordinary log, with friction taken out.

        U(k) = W(k)/P(k) + T(k) + a(k) F(k)

    U and W are the spectra of torque and motor speed, F that of friction along the measured
    motion, T transients. Friction is fitted together with 1/P, without a model of the mechanics;
    then P is estimated from torque less friction to speed.

    Parameters
    ----------
    record : path, DataFrame, dict of arrays or Record, or a list of them
        Runs of one axis, in open or closed loop, that reverse. A reference r, of position or
        speed, serves as instrument: noise in the loop does not bias the response then.
    model : Model, Parameters, dict or path
        The declared model. The level of friction is fitted; a law without dry friction
        ("viscous") takes none out. Its effects that are torques of position, speed and time, or
        change the level of friction with these or the load, are taken out with their values.
    columns, units, scale, rate : optional
        How to read a log, as for :func:`lugrectl.read_record`.

    Returns
    -------
    FrequencyResponse
        ``frd`` from torque (N m, or N) to speed (rad/s, or m/s), from 30 periods of the log to 0.4
        of half the sampling rate; ``low``, ``high``, ``coherence``, ``modes``, ``plot()``.

    Raises
    ------
    InputError
        When an argument cannot be meant, or a file cannot be read or understood.
    Refused
        When the log is too short, shows no motion, or makes the response certain nowhere.

    Notes
    -----
    Viscous friction is linear and stays in P, and so do dead time, current lag and the hold of the
    torque. The motion must be that of the motor: behind an elastic coupling a resonance comes
    without its antiresonance. Coherence does not show friction where the excitation is periodic;
    ``correction`` does, and where it is above 2 dB no band holds: these points are ``governed``,
    and the fitted mechanics, its modes and the gains of :func:`tune` follow from the others.

    Where nothing excites a closed loop, what friction and noise do through its controller C looks
    like P = -1/C. No point is certain where r explains too little of the torque (F statistic below
    10) or, without r, where P even with a delay of 3 samples has a negative real part, which the
    speed of the shaft that the torque drives cannot have. Near the crossover of the loop -1/C is as
    large as P: log r.

    References
    ----------
    R. Pintelon and J. Schoukens, System Identification: A Frequency Domain Approach, 2nd ed.,
    Wiley 2012, ch. 7 (local polynomials, instruments). D. Staiger and J. H. Stock, Instrumental
    variables regression with weak instruments, Econometrica 65 (1997) 557-586 (F of at least 10).

    Examples
    --------
    A rigid axis of 0.02 kg m2 with 0.3 N m of Coulomb friction, moved to and fro:

    >>> t, rng = 2e-3 * np.arange(8000), np.random.default_rng(0)
    >>> w = 10.0 * np.sin(20.0 * t) + np.convolve(rng.normal(0.0, 2.0, 8000), np.ones(5), "same")
    >>> u = 0.02 * np.gradient(w, t) + 0.3 * np.sign(w)
    >>> found = lg.frequency_response({"t": t, "u": u, "w": w}, lg.Model.of(friction="coulomb"))
    >>> found.trusted, round(found.friction["Fc"], 1)
    (True, 0.3)
    """
    made = as_model(model)
    logs = as_logs(record, made.motion, columns=columns, units=units, scale=scale, rate=rate)
    records = pooled([record_of(log, alone=len(logs) == 1) for log in logs])
    refuse_dead(records)
    steps = [one.dt for one in records]
    if max(steps) > 1.001 * min(steps):
        rates = ", ".join(f"{one.source} {one.rate:g} Hz" for one in records)
        raise InputError(f"runs of one sampling rate are averaged, but there is {rates}.")
    runs = runs_of(records)
    longest = max(runs, key=lambda run: len(run.u))
    low, high = LOWEST / (len(longest.u) * longest.dt), 0.5 * HIGHEST / longest.dt
    if high < low * 10**LEAST_RANGE:
        raise Refused(
            f"the longest stretch has {len(longest.u)} samples: its response would reach from "
            f"{low:.3g} to {high:.3g} Hz only; record longer or faster.",
            RECORD,
        )
    runs, left = known_effects(runs, made)
    reverses = any(len(run.strokes[1]) > 1 for run in runs)
    dry = "Fc" in made.friction.values
    found = _answer(runs, dry and reverses, made.motion)
    said = [*_verdict(found, dry), *left, *(text for one in records for text in one.messages)]
    return replace(found, messages=tuple(dict.fromkeys(said)))


def _verdict(found: FrequencyResponse, dry: bool) -> list[str]:
    """What friction does to the response, how much of it is certain, and what to record."""
    sure, bad, below = found.certain, found.governed, _slow(found.frequency) / (2.0 * np.pi)
    f, few = found.frequency[bad] / (2.0 * np.pi), sure.mean() < FEW
    made = [BAD.format(len(f), len(bad), f[0], f[-1])] if len(f) else []
    made += [GOOD.format(below, found.correction)] if found.friction and not len(f) else []
    made += [NONE] if dry and not found.friction else []
    made += [THIN.format(sure.sum(), len(sure))] if few else []
    return [*made, *([RECORD] if len(f) or few else [])]


def _slow(w: np.ndarray) -> float:
    return max(2.0 * np.pi * SLOW, 3.0 * float(w[0]))


def _answer(runs: Sequence[Run], dry: bool, motion: str) -> FrequencyResponse:
    """The whole chain; ``dry``: whether the model has friction that reverses with the motion."""
    dt = runs[0].dt
    longest = max(len(run.u) * run.dt for run in runs)
    ends = 2.0 * np.pi * LOWEST / longest, np.pi * HIGHEST / dt
    every = windows(runs, *ends, *NARROW)
    stage = _Stage(runs, every, np.array([one.centre for one in every]), Mechanics.unknown(dt))
    friction, taken = None, None
    for _ in range(1 + ROUNDS):
        if dry:
            friction = stage.friction(friction)
            taken = friction.spectra if friction.levels else None
        stage = stage.knowing(stage.response(taken))
    raw, r = stage.response(), stage.response(taken)
    governed, size = _governed(raw, r), np.abs(r.P)
    sure = band_holds(r.coherence, governed, r.radius, size)
    if not sure.any():
        f, best = r.w / (2.0 * np.pi), int(np.argmax(r.coherence))
        said = NOWHERE.format(f[0], f[-1], r.coherence[best], f[best]) + RECORD[len("Record") :]
        raise Refused(said, RECORD)
    mechanics = stage.mechanics if len(stage.mechanics.w) and sure.sum() >= FEWEST else None
    inertia, interval = (None, None) if mechanics is None else mechanics.inertia
    if interval is not None and not _narrow(interval):
        inertia, interval = None, None
    modes = () if mechanics is None else mechanics.modes()
    return FrequencyResponse(
        frd=ct.FrequencyResponseData(r.P, r.w, dt),
        raw=ct.FrequencyResponseData(raw.P, r.w, dt),
        unwrapped=unwrapped(r.w, r.P, r.coherence >= CERTAIN),
        low=np.where(sure, np.maximum(size - r.radius, 0.0), np.nan),
        high=np.where(sure, size + r.radius, np.nan),
        coherence=r.coherence,
        correction=float(np.median(_change(raw, r)[r.w < _slow(r.w)])),
        governed=governed,
        modes=tuple(mode for mode in modes if _seen(mode, r.w, sure)),
        inertia=inertia,
        inertia_ci95=interval,
        friction={} if friction is None else friction.levels,
        reference=runs[0].E is not None,
        motion=motion,
        mechanics=mechanics,
    )


def _seen(mode: Mode, w: np.ndarray, sure: np.ndarray) -> bool:
    """Whether its frequency is known, and some points about it are certain: in an antiresonance,
    where the axis hardly moves, few are."""
    near = np.abs(np.log(w / mode.frequency)) < NEAR
    return _narrow(mode.ci95) and bool(np.mean(sure[near]) >= TENTH)


def _narrow(ci95: tuple[float, float]) -> bool:
    return ci95[1] <= (1.0 + VAGUE) ** 2 * ci95[0]


def _change(raw: Response, taken: Response) -> np.ndarray:
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.abs(20.0 * np.log10(np.abs(raw.P / taken.P)))


def _governed(raw: Response, taken: Response) -> np.ndarray:
    """Where friction changes the response by too many dB (n,), by the median over an octave."""
    dB, x = _change(raw, taken), np.log(taken.w)
    ends = (np.searchsorted(x, x - OCTAVE), np.searchsorted(x, x + OCTAVE, "right"))
    return np.array([np.nanmedian(dB[a:b]) for a, b in zip(*ends, strict=True)]) >= LARGE


@dataclass(frozen=True, eq=False)
class _Stage:
    """Runs with their windows, and what is known of the mechanics so far."""

    runs: Sequence[Run]
    windows: Sequence[Window]
    w: np.ndarray
    mechanics: Mechanics

    def torques(self) -> list[np.ndarray]:
        """The spectra of the commands, less what the known torques cost."""
        advance = self.mechanics.advance
        return [run.U - run.spectrum(run.load) * advance(run.w) for run in self.runs]

    def moving(self) -> list[np.ndarray]:
        """The same with rests filled in."""
        pairs = zip(self.runs, self.torques(), strict=True)
        return [self.mechanics.filled(run, U) for run, U in pairs]

    def response(self, friction: Sequence[np.ndarray] | None = None) -> Response:
        V = self.torques()
        if friction is not None:
            V = [U - F for U, F in zip(self.moving(), friction, strict=True)]
        shapes = [self.mechanics.shape(run.w) for run in self.runs]
        return local_response(self.runs, self.windows, V, shapes, self.mechanics.shape(self.w))

    def knowing(self, found: Response) -> _Stage:
        """The same with the mechanics that a response shows where friction does not govern it."""
        raw = self.response()
        shown = replace(found, coherence=np.where(_governed(raw, found), 0.0, found.coherence))
        return replace(self, mechanics=fit_mechanics(shown, raw, self.runs[0].dt))

    def friction(self, before: Friction | None) -> Friction:
        """The friction of motor and of load, each where the residual falls clearly with it."""
        advance = [self.mechanics.advance(run.w) for run in self.runs]
        shapes = [self.mechanics.shape(run.w) for run in self.runs]
        problem = problem_of(self.runs, advance, shapes, self.moving())
        found = fit_friction(problem, before)
        none = problem.without(found)
        if found.cost > none.cost - SURE:
            found = none
        if before is None or not len(self.mechanics.pairs):
            return found
        level = before.levels.get("load Fc") or ON_LOAD * before.levels.get("Fc", 0.0)
        loads = [load_motion(run, self.mechanics, level, before.distance) for run in self.runs]
        both = fit_friction(replace(problem, loads=loads), before)
        return both if both.cost < found.cost - SURE else found


PERIOD = 4.0  # s, of the multisine
TOP_LINE = 0.45  # of the rate, of its lines
TIMES = 2.0  # Fc, the RMS torque of the multisine
SINE = 0.5  # of the speed, and of the torque that friction leaves: the multisine's peak at most
JOGS = 0.6  # of what then remains: a speed loop overshoots
LENGTHS, PAUSES = (0.25, 0.8), (0.0, 0.3)  # s
SLOWEST = 0.15  # of the top speed
STEEP = 0.2  # s of acceleration at most
REVERSALS = 0.8  # of all moves
BANDWIDTH = 10.0  # Hz, of the speed loop where its gain is not given
HOW = (
    "Give w to the speed loop as its reference; a position loop follows theta, and w is added to "
    "its output. Log torque, position and w."
)


@dataclass(frozen=True, eq=False, repr=False)
class ResponsePlan(Result):
    """The references to play: ``t`` in s, ``w`` of speed with the multisine, ``theta`` of position
    without it (rad/s and rad, or m/s and m); ``sine`` is the multisine's RMS torque (N m or N) in a
    speed loop of gain ``kp`` (N m s/rad or N s/m)."""

    t: np.ndarray
    w: np.ndarray
    theta: np.ndarray
    sine: float
    kp: float
    motion: str = "rotary"

    def to_csv(self) -> str:
        """The columns t, w and theta with a header."""
        angle, speed = (unit_for(unit, self.motion) for unit in ("rad", "rad/s"))
        made, head = io.StringIO(), f"t [s],w [{speed}],theta [{angle}]"
        rows = np.column_stack([self.t, self.w, self.theta])
        np.savetxt(made, rows, "%.9g", ",", header=head, comments="")
        return made.getvalue()

    def summary(self) -> dict[str, Any]:
        """Plain Python."""
        arrays = {"t": self.t, "w": self.w, "theta": self.theta}
        return {"schema": 1, **arrays, "sine": self.sine, "kp": self.kp}

    def _title(self) -> str:
        rate = (len(self.t) - 1) / (self.t[-1] - self.t[0])
        return f"Excitation for a frequency response: {len(self.t) / rate:.3g} s at {rate:.5g} Hz"

    def _rows(self) -> Iterable[Row]:
        names = ("rad/s", "rad", "N m", "N m s/rad")
        speed, angle, torque, gain = (unit_for(unit, self.motion) for unit in names)
        said = f"RMS, in a speed loop of gain {number(self.kp)} {gain}"
        return [
            Row("reference", number(float(np.abs(self.w).max())), speed, "at most"),
            Row("travel", number(float(np.ptp(self.theta))), angle),
            Row("multisine", number(self.sine), torque, said),
            *noticed([HOW], "HOW"),
        ]


def response_plan(
    model: Any,
    *,
    rate: float,
    w: float,
    u: float,
    theta: float | None = None,
    kp: float | None = None,
    seed: int = 0,
    duration: float = 30.0,
) -> ResponsePlan:
    """The excitation to record for :func:`frequency_response`: reversing jogs and a multisine.

    Parameters
    ----------
    model : Model, Parameters, dict or path
        With J and, where there is dry friction, Fc: rough values will do.
    rate : float
        Sampling rate of the references in Hz.
    w, u : float
        Largest speed in rad/s (or m/s) and torque in N m (or N).
    theta : float, optional
        Largest distance from the start in rad or m; default: none.
    kp : float, optional
        Proportional gain of the speed loop, N m s/rad or N s/m. Default: that of 10 Hz bandwidth.
    seed : int, optional
        Of lengths, speeds and phases.
    duration : float, optional
        In s, at least 10.

    Returns
    -------
    ResponsePlan
        ``t``, ``w`` and ``theta``; ``to_csv()``. The multisine's torque is twice Fc where the
        limits allow it.

    Raises
    ------
    InputError
        When an argument cannot be meant, J is not declared, or u does not exceed friction.

    Examples
    --------
    >>> plan = lg.response_plan(lg.table1(), rate=1000, w=20, u=1)
    >>> len(plan.t), round(plan.sine, 2), bool(abs(plan.w).max() <= 20)
    (30000, 0.11, True)
    """
    made = as_model(model)
    rate, w, u = positive(rate, "rate", "Hz"), positive(w, "w"), positive(u, "u")
    reach = np.inf if theta is None else positive(theta, "theta")
    g = np.random.default_rng(whole(seed, "seed"))
    values = made.values()
    J, Fc = values["J"], values.get("Fc", 0.0)
    if J is None or Fc is None:
        missing = "J" if J is None else "Fc"
        raise InputError(
            f"{missing} must be declared to size the excitation: a rough value will do."
        )
    if u <= Fc:
        raise InputError(f"u = {u:g} does not exceed Fc = {Fc:g}: the axis would not move.")
    kp = J * 2.0 * np.pi * BANDWIDTH if kp is None else positive(kp, "kp")
    n = round(max(positive(duration, "duration", "s"), 10.0) * rate)
    sine, peak = _multisine(g, n, rate, kp, J)
    top = float(np.abs(sine).max())
    most = min(TIMES * Fc if Fc else np.inf, SINE * (u - Fc) / peak, SINE * w / top)
    steep = JOGS * (u - Fc - most * peak) / J
    jogs = _jogs(g, n, rate, min(w - most * top, STEEP * steep), steep, reach)
    both, position = jogs + most * sine, np.cumsum(jogs) / rate
    return ResponsePlan(np.arange(n) / rate, both, position, most, kp, made.motion)


def _multisine(
    g: np.random.Generator, n: int, rate: float, kp: float, J: float
) -> tuple[np.ndarray, float]:
    """A speed reference (n,) that costs a torque of RMS 1, and the peak of that torque."""
    one = round(PERIOD * rate)
    lines = int(TOP_LINE * one)
    X = np.zeros(one // 2 + 1, complex)
    X[1 : lines + 1] = np.exp(2j * np.pi * g.random(lines))
    s = 2j * np.pi / PERIOD * np.arange(len(X))
    torque = np.fft.irfft(X * kp * s / (s + kp / J), one)
    size = torque.std()
    repeated = np.resize(np.fft.irfft(X, one) / size, n)
    return repeated, float(np.abs(torque).max() / size)


def _jogs(
    g: np.random.Generator, n: int, rate: float, top: float, steep: float, reach: float
) -> np.ndarray:
    """Speeds (n,) of moves that mostly reverse and stay within reach of the start."""
    v, k, side, x = np.zeros(n), 0, 1.0, 0.0
    while k < n:
        side *= -1.0 if g.random() < REVERSALS else 1.0
        t = np.arange(round(g.uniform(*LENGTHS) * rate)) / rate
        size = g.uniform(SLOWEST, 1.0) * top
        move = np.minimum(size, steep * np.minimum(t, t[-1] - t))
        far = float(move.sum()) / rate
        if abs(x + side * far) > reach:  # back, and not too far
            side = -float(np.sign(x) or side)
            move *= min(1.0, (reach + abs(x)) / far)
        v[k : k + len(t)] = side * move[: n - k]
        x += side * float(move.sum()) / rate
        k += len(t) + round(g.uniform(*PAUSES) * rate)
    return v

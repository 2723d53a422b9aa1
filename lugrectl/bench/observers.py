"""Friction observers on one bench: at equal terms side by side, and those that a drive can run in
order.
"""

from __future__ import annotations

import html as markup
import time
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import Any

import control as ct
import numpy as np

from ..blocks.block import members, unit_for
from ..blocks.controllers import MEASURED, dead_time
from ..blocks.declaration import listed, meant
from ..blocks.model import Model, Parameters, as_model
from ..blocks.observers import observer_block
from ..blocks.plant import plant, sensor
from ..core.display import Grid, Row, Shown, grid_html, grid_text
from ..core.display import number as figure
from ..core.errors import Diverged, InputError
from ..core.numeric import rms
from ..core.progress import Progress, Wanted, part_of, reporter, shows_progress
from ..core.result import ComparedRows, Fields, Result, library, plain
from ..core.validation import flag, holds_samples, names, number, positive, real, share, shown
from ..core.views import view
from ..design import Certificate
from ..design.gains import RULES, SAMPLED
from ..engine.adaptive_run import interpreted
from ..estimates.fitted import Fitted
from ..loops.friction_loops import LAM, OUTPUTS, Control, connected, crossing, read_of
from ..record.as_record import as_record
from ..simulation.response import simulate
from ..simulation.sampled_block import Sensing, rounded
from .compensate import (
    FASTEST,
    LUGRE,
    SETTLED,
    SampledLoop,
    Task,
    designed,
    enough_samples,
    fastest,
    given_gains,
    sensing_of,
    sine,
    top_speed,
    unit_of,
    unknown,
)

SCENARIOS = {  # heading, and the factor to its unit
    "velocity": ("e_w [mrad/s]", 1e3),
    "parameters": ("worst e_w [mrad/s]", 1e3),
    "position": ("e_theta [mrad]", 1e3),
    "cycle": ("cycle [mrad]", 1e3),
    "noise": ("noise in u [mN m]", 1e3),
    "delay": ("delay borne [ms]", 1e3),
    "load": ("load e_w [mrad/s]", 1e3),
    "rate": ("rate borne [Hz]", 1.0),
    "rounding": ("rounded e_w [mrad/s]", 1e3),
}
COLUMNS = {**SCENARIOS, "cost": ("cost [us]", 1e6)}
STEP = 1e-3  # s
OTHERS = [(k,) for k in ("J", "sigma0", "sigma1", "Fv", "vs")]  # believed wrong one at a time
GAINS: dict[str, dict[str, float]] = {
    "velocity": {"kp": 1.6, "ki": 0.16},
    "position": {"kp": 15.0, "ki": 0.0, "kd": 1.2},
    "cycle": {"kp": 15.0, "ki": 30.0, "kd": 0.3},
}
SIZE, TURN = 0.1, 2 * np.pi  # of the reference, and its frequency in rad/s
LATEST, HALVINGS = 0.01, 7  # dead times up to 10 ms, found to 0.08 ms
PATIENCE = 1.0  # s of computing for one run with a dead time
FINE = 2.0 * np.pi / 2**17  # rad, the step of an encoder of 17 bits, where none is given
TIMED = {"velocity", "noise", "delay", "rate"}  # with one of them the cost is known
RATES = (2000.0, 1000.0, 500.0, 250.0)  # Hz
Signals = dict[str, np.ndarray]


@dataclass(frozen=True)
class Compared(Fields):
    """One observer. A value is None where its scenario was not run, infinite where the loop
    diverges.

    ``velocity``, ``position``: RMS tracking error in rad/s and rad, friction believed wrong.
    ``parameters``: the largest such error in rad/s with one more parameter wrong; ``weakest``
    names that parameter and the factor.
    ``cycle``: peak-to-peak position in rad of the limit cycle at a set-point, friction
    overestimated. ``noise``: RMS of the torque in N m that an RMS noise of the encoder causes.
    ``delay``: largest dead time in s that the velocity loop bears. ``load``: RMS speed error in
    rad/s from a load step on. ``rate``: lowest sample rate in Hz that the loop bears; ``sampled``
    has the RMS speed error at each rate tried. ``rounding``: RMS speed error in rad/s with the
    rounding of an encoder in the loop. ``cost``: time of the
    simulation in s for each sample. ``feedback``: the gains of the controllers beside it.
    """

    name: str
    velocity: float | None
    parameters: float | None
    position: float | None
    cycle: float | None
    noise: float | None
    delay: float | None
    cost: float | None
    feedback: Mapping[str, float]
    weakest: str | None = None
    load: float | None = None
    rate: float | None = None
    rounding: float | None = None
    sampled: Mapping[str, float] = field(default_factory=dict)


class ObserverComparison(ComparedRows[Compared]):
    """The answer of :func:`lugrectl.compare_observers`: rows by place or by name.

    Parameters
    ----------
    rows : list of Compared
        One for each observer.
    terms : dict
        What was equal for all: levels of friction believed, gains, noise, rate.
    refused : dict
        By name why an observer was left out, in one sentence.

    Examples
    --------
    Two observers on an encoder of 20 bits, with the RMS speed error of one of them:

    >>> found = lg.compare_observers(
    ...     lg.table1(), ["natural", "disturbance"], scenarios="rounding",
    ...     resolution=2 * np.pi / 2**20,
    ... )
    >>> found.names
    ('natural', 'disturbance')
    >>> round(1e3 * found["natural"].rounding)  # mrad/s
    5
    """

    def __init__(
        self,
        rows: Iterable[Compared],
        terms: Mapping[str, Any],
        refused: Mapping[str, str] | None = None,
    ) -> None:
        self._rows = tuple(rows)
        self.terms = dict(terms)
        self.refused = dict(refused or {})

    def summary(self) -> dict[str, Any]:
        """Plain Python: the terms, a dictionary for each observer, and who was left out."""
        return plain({"terms": self.terms, "observers": self._rows, "refused": self.refused})

    def to_frame(self) -> Any:
        """A DataFrame in SI units with the names as index; InputError without pandas."""
        pandas = library("pandas")
        rows = [{k: getattr(row, k) for k in ("name", *COLUMNS)} for row in self]
        return pandas.DataFrame(rows).set_index("name")

    def _title(self) -> str:
        return f"{len(self)} observers at equal terms"

    def _grid(self) -> Grid:
        def cell(value: float | None, factor: float) -> str:
            if value == float("inf"):
                return "diverges"
            return figure(None if value is None else factor * value, 3)

        run = [k for k in COLUMNS if any(getattr(row, k) is not None for row in self)]
        head = ("observer", *(COLUMNS[k][0] for k in run))
        rows = [(row.name, *(cell(getattr(row, k), COLUMNS[k][1]) for k in run)) for row in self]
        return Grid(head, "l" + "r" * len(run), tuple(rows))

    def __repr__(self) -> str:
        return "\n".join([self._title(), *grid_text(self._grid()), *self._left_out()])

    __str__ = __repr__

    def _repr_html_(self) -> str:
        left = "".join(f"<p>{markup.escape(line)}</p>" for line in self._left_out())
        return grid_html(self._grid()) + left

    def _left_out(self) -> list[str]:
        return [f"{name} left out: {why}" for name, why in self.refused.items()]


@shows_progress
def compare_observers(
    p: Parameters | Model,
    observers: str | Sequence[str | None] | None = None,
    *,
    scenarios: str | Sequence[str] = tuple(SCENARIOS),
    wrong: float = 0.8,
    over: float = 1.2,
    off: float = 0.2,
    k: float = 0.35,
    equal: bool = True,
    noise: float = 1e-5,
    resolution: float = 0.0,
    load: float | None = None,
    rates: float | Sequence[float] = RATES,
    progress: Wanted = None,
) -> ObserverComparison:
    """Friction observers side by side on one drive, at equal linear feedback.

    Parameters
    ----------
    p : Parameters, Model, dict or path
        The drive. With another friction law than LuGre, one of your own too, observers that must
        know values which it does not have are left out: ``refused`` of the result says why.
    observers : str or list of str, optional
        Names as in ``lugrectl.observers()``, with or without ``_observer``; default: all. None in
        a list is the loop without an observer.
    scenarios : str or list of str
        Any of "velocity" (r = 0.1 sin 2 pi t rad/s, PI 1.6, 0.16; RMS of w - r over 1 to 5 s),
        "parameters" (the largest such error if one of J, sigma0, sigma1, Fv, vs is believed
        wrong as well, and which), "position" (r = 0.1 sin 2 pi t rad, PD 15, 1.2 and J ddr; RMS
        of theta - r over 5 to 10 s), "cycle" (PID 15, 30, 0.3, step of 0.1 rad;
        peak-to-peak theta over 10 to 15 s), "noise" (torque caused by noise of the encoder, in
        the velocity scenario), "delay"
        (the largest dead time between torque command and motor, up to 10 ms, with which the
        error of the velocity scenario grows by no more than the reference within 1 s; None if
        the loop switches too fast to be simulated), "load" (the speed error over 2 to 5 s, where a
        load torque steps in at 2 s and out at 3.5 s), "rate" (the lowest of ``rates`` at which the
        error stays as small as "delay" demands, with controller and observer sampled and the
        torque held; ``sampled`` of a row has the error at each rate) and "rounding" (the speed
        error at 1 kHz over 0.5 to 1.5 s where the speed is the difference of an encoder's rounded
        positions, inside the loop).
    wrong, over : float
        Fc and Fs as the observer believes them, as a factor: in all scenarios, and in "cycle".
    off : float
        How far the other parameters are wrong in "parameters", each way: 0.2 is 20 %.
    k : float
        Gain of the observers that are corrected by the tracking error.
    equal : bool
        Raise the gains of the controller beside all other observers by sigma1 k and sigma0 k,
        because the correction k e is a PI controller as well: zhat depends linearly on it.
    noise : float
        RMS noise of the encoder in rad at 1 kHz; the velocity is its difference.
    resolution : float
        Step of the encoder in rad, in "noise": its readings of the undisturbed motion, with
        noise, are rounded to it. 0 rounds nothing; 2 pi/4096 is 4096 steps a turn. Also the step
        in "rounding", where 0 stands for an encoder of 17 bits, 2 pi/131072.
    load : float, optional
        Load torque in N m in "load"; default: half of Fc, where the friction law has it.
    rates : float or list of float
        Sample rates in Hz in "rate".
    progress : callable, True, False or None
        ``progress(fraction, what)``, or whether to show a bar. None: in Jupyter only.

    Returns
    -------
    ObserverComparison
        A row for each observer; ``print`` shows a table, ``to_frame`` gives a DataFrame.

    Raises
    ------
    InputError
        For an unknown observer or scenario, a value that the drive does not have yet, no observer
        that this drive allows, or a number out of bounds.

    Notes
    -----
    The equivalent controller of the correction is k (sigma1 s + sigma0)/(s + a), a =
    sigma0 |w|/h(w): it leaks, where the controller of the others has a full integral. An observer
    on s = (w - dr) + 20 (theta - r) takes k/20 in the position loop, so that its integral action
    is the same; its action on theta and w is larger by sigma0 k/20 and sigma1 k/20. Velocity and
    position are exact except in "noise". The cost is the time of the simulation, not that of a
    drive's processor.

    The first comparison on a machine compiles two loops for each observer, some seconds for each;
    a later one takes about a second for each observer.

    Examples
    --------
    Which observer bears the rounding of an encoder of 20 bits, by the RMS speed error in rad/s:

    >>> found = lg.compare_observers(
    ...     lg.table1(), ["natural", "disturbance"], scenarios="rounding",
    ...     resolution=2 * np.pi / 2**20,
    ... )
    >>> all(row.rounding < 0.01 for row in found)
    True
    """
    model = as_model(p, "p").with_defaults()
    if missing := [k for k, v in model.values().items() if v is None]:
        raise InputError(
            f"p: a comparison of observers needs {', '.join(missing)} of the drive; give a model "
            "with all its values."
        )
    wanted, chosen = _chosen_scenarios(scenarios), chosen_observers(observers)
    why = {name: unknown(name, model) for name in chosen}
    if not (able := [name for name in chosen if why[name] is None]):
        raise InputError(f"{chosen[0]} cannot be compared: {why[chosen[0]]}")
    refused = {k.removesuffix("_observer"): v for k, v in why.items() if v is not None}
    terms = Terms(model, positive(k, "k", "1/s"), flag(equal, "equal"))
    tried: Any = rates if isinstance(rates, (list, tuple)) else [rates]
    if number(resolution, "resolution") < 0.0:
        raise InputError(f"resolution is {resolution:g}; give the step in rad, or 0 for none.")
    if not tried:
        raise InputError("rates is an empty list: give at least one sample rate in Hz.")
    said = {
        "wrong": positive(wrong, "wrong", "as a factor of friction"),
        "over": positive(over, "over", "as a factor of friction"),
        "off": share(off, "off"),
        "load": _load(load, model) if "load" in wanted else 0.0,
        "noise": positive(noise, "noise", "rad"),
        "resolution": float(resolution),
        "rates": [positive(rate, "rates", "Hz") for rate in tried],
        "rounding": float(resolution) or FINE,
        **{"step": STEP, "gains": GAINS, "k": terms.k, "equal": terms.equal, "model": model.name},
    }
    report, rows = reporter(progress), []
    for i, name in enumerate(able):
        part = part_of(report, i / len(able), (i + 1) / len(able))
        rows.append(Bench(terms, name, said).compared(wanted, part))
    return ObserverComparison(rows, said, refused)


def _load(given: float | None, model: Model) -> float:
    level = model.known().get("Fc")
    if given is None and level is None:
        raise InputError("load is missing: half of Fc is its default, which this friction lacks.")
    return number(0.5 * (level or 0.0) if given is None else given, "load")


def chosen_observers(wanted: Any) -> list[str]:
    """The full names of the observers that are meant, each once; None in a list for no observer."""
    if wanted is None:
        return [k for k in members("observer") if k != "no_observer"]
    given = listed("observer", wanted)
    if not isinstance(given, (list, tuple)) or not given:
        raise InputError(f"observers must be a name or a list of names, not {shown(wanted)}.")
    made = [observer_block("no_observer" if name is None else name).name for name in given]
    return list(dict.fromkeys(made))


def _chosen_scenarios(wanted: Any) -> set[str]:
    given = names(wanted, "scenarios")
    for strange in (s for s in given if s not in SCENARIOS):
        raise InputError(f"there is no scenario {shown(strange)}; {meant(strange, SCENARIOS)}")
    if not given:
        raise InputError(f"scenarios is an empty list: give some of {', '.join(SCENARIOS)}.")
    return set(given)


@dataclass(frozen=True)
class Terms:
    """What is equal for all observers: those that are not corrected by k e get what it is as a
    controller, kp + sigma1 k and ki + sigma0 k. ``designed`` holds the gains of observers by name.
    ``ahead``: the velocity loop has the feed-forward J dr, as the position loop has J ddr."""

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

    def control(self, name: str, kind: str, gains: Mapping[str, float]) -> list[Any]:
        own, ahead = self.own(name, kind), self.ahead or kind == "position"
        return Control(kind, self.feedback(name, gains), name, own, ahead).blocks(self.model)

    def sampled(
        self, name: str, kind: str, gains: Mapping[str, float], sensing: Sensing, speed: float
    ) -> SampledLoop:
        """Return the loop of an observer; ``speed``: the largest of the reference."""
        task, control = Task(self.model, kind, {}), self.control(name, kind, gains)
        return SampledLoop(task, sensing, control, FASTEST * speed, bodies=self.bodies)

    def closed(self, name: str, kind: str, gains: Mapping[str, float]) -> Any:
        parts = [
            plant(self.model, inputs=["u_late", "d"]),
            dead_time(0.0, inputs=["u"], outputs=["u_late"]),
            sensor(self.model, outputs=["w_s", "theta_s"]),
            ct.summing_junction(["theta_s", "n_theta"], "theta_m", name="encoder"),
            ct.summing_junction(["w_s", "n_w"], "w_m", name="speed"),
            *self.control(name, kind, gains),
        ]
        inputs = [*read_of(parts), "n_theta", "n_w", "d"]
        return connected(parts, inputs, OUTPUTS, f"{observer_block(name).name}_{kind}_loop")


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


K = 0.35  # of an observer that the tracking error corrects, where no bristles say how much


def correction(known: Mapping[str, Any], bandwidth: float) -> float:
    """Return k that adds as much integral as the PI of this crossover has."""
    if not known.get("sigma0"):
        return K
    k = known["J"] * bandwidth**2 / 20.0 / known["sigma0"]
    damping = known.get("sigma1") or 0.0
    return float(min(k, 0.5 * known["J"] * bandwidth / damping) if damping else k)


class Bench:
    """The loops of one observer: each is built when a scenario needs it. ``levels``: how wrong
    friction is believed, everywhere and in "cycle", and how wrong all else is, SI."""

    def __init__(self, terms: Terms, name: str, levels: Mapping[str, Any]) -> None:
        self.terms, self.name, self.levels = terms, name, levels
        self.loops: dict[str, Any] = {}
        self.more: dict[str, Any] = {}  # figures beside those of the scenarios
        self.last = np.zeros(0)  # the states at the end of the latest run

    def compared(self, wanted: set[str], report: Progress) -> Compared:
        """Return the figures of the wanted scenarios; ``report`` hears which one begins."""
        found: dict[str, Any] = dict.fromkeys((*SCENARIOS, "cost"))
        for i, scenario in enumerate(s for s in SCENARIOS if s in wanted):
            report(i / len(wanted), f"simulating {self.name}, scenario {scenario}")
            found[scenario] = getattr(self, scenario)()
        if wanted & TIMED:
            found["cost"] = self.disturbed[1]
        beside = {s: self.terms.feedback(self.name, gains) for s, gains in GAINS.items()}
        gains = {f"{s}.{g}": v for s, own in beside.items() for g, v in own.items()}
        short = self.name if self.name == "no_observer" else self.name.removesuffix("_observer")
        return Compared(name=short, feedback=gains, **found, **self.more)

    def believed(self, level: str = "wrong") -> dict[str, float]:
        """Return the parameters of the observer that are wrong."""
        known, needs = self.terms.model.known(), observer_block(self.name).parameters
        levels = [k for k in ("Fc", "Fs") if k in known and k in needs]
        return {f"{self.name}.{k}": self.levels[level] * known[k] for k in levels}

    def run(
        self,
        t: np.ndarray,
        rows: Mapping[str, Any],
        scenario: str = "velocity",
        x0: Any = None,
        params: Mapping[str, float] | None = None,
    ) -> Signals:
        """Return signals by name, infinite where the loop diverges."""
        kind = "velocity" if scenario == "velocity" else "position"
        if kind not in self.loops:
            self.loops[kind] = self.terms.closed(self.name, kind, GAINS[scenario])
        values = self.believed("over" if scenario == "cycle" else "wrong")
        block, gains = "pi" if kind == "velocity" else "pid", GAINS[scenario]
        values |= {f"{block}.{g}": v for g, v in self.terms.feedback(self.name, gains).items()}
        system = self.loops[kind]
        given = {k: rows.get(k, 0.0 * t) for k in system.input_labels}
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # a loop that does not work is a result here
                done = simulate(system, t, given, x0, params=values | dict(params or {}))
        except Diverged:
            return dict.fromkeys((*OUTPUTS, "e"), np.full(len(t), np.inf))
        self.last = np.asarray(done.states)[..., -1]
        out: Signals = dict(zip(OUTPUTS, np.asarray(done.outputs), strict=True))
        return out | {"e": out[MEASURED[kind]] - given["r"]}  # of the motion, not of its sensor

    @cached_property
    def clean(self) -> Signals:
        """The run of the velocity scenario."""
        t = _times(5.0)
        return self.run(t, _reference(t))

    @cached_property
    def disturbed(self) -> tuple[float | None, float | None]:
        """The torque that noise of the encoder causes, and the time that a sample takes."""
        t, random, clean = _times(5.0), np.random.default_rng(0), self.clean
        if not np.isfinite(clean["e"]).all():
            return None, None
        read = clean["theta"] + random.normal(0.0, self.levels["noise"], len(t))
        angle = rounded(read, self.levels["resolution"]) - clean["theta"]
        rows = {"n_theta": angle, "n_w": np.diff(angle, prepend=angle[0]) / STEP}
        begun = time.perf_counter()
        u = self.run(t, _reference(t) | rows)["u"]
        took = (time.perf_counter() - begun) / len(t)
        return rms((u - clean["u"])[t >= 1.0]), took

    def velocity(self) -> float:
        return rms(self.clean["e"][_times(5.0) >= 1.0])

    def parameters(self) -> float:
        """Return the largest speed error with one more parameter wrong: "J x0.8"."""
        off, t = dict.fromkeys(LUGRE, float(self.levels["off"])), _times(5.0)
        errors = dict[str, float]()
        for case, values in wrong(self.name, self.terms.model.known(), OTHERS, off).items():
            params = {f"{self.name}.{k}": v for k, v in values.items()}
            errors[case] = rms(self.run(t, _reference(t), params=params)["e"][t >= 1.0])
        if not errors:
            return self.velocity()
        self.more["weakest"] = max(errors, key=lambda which: errors[which])
        return max(errors.values())

    def position(self) -> float:
        t = _times(10.0)
        return rms(self.run(t, _reference(t, "position"), "position")["e"][t >= 5.0])

    def cycle(self) -> float:
        """Return the peak-to-peak position of the limit cycle at a set-point."""
        t = _times(15.0)
        theta = self.run(t, {"r": SIZE + 0.0 * t}, "cycle")["theta"][t >= 10.0]
        return float(np.ptp(theta)) if np.isfinite(theta).all() else np.inf

    def noise(self) -> float | None:
        return self.disturbed[0]

    def load(self) -> float:
        """Return the speed error from the step of a load torque on, which acts from 2 to 3.5 s."""
        t = _times(5.0)
        d = np.where((t >= 2.0) & (t < 3.5), self.levels["load"], 0.0)
        return rms(self.run(t, _reference(t) | {"d": d})["e"][t >= 2.0])

    @property
    def allowed(self) -> float:
        """The largest error that "delay" and "rate" allow."""
        return SIZE + float(np.abs(self.clean["e"]).max())

    def delay(self) -> float | None:
        """Return the largest dead time that keeps the error small; None: a run takes too long."""
        low, high = 0.0, LATEST
        for _ in range(HALVINGS if np.isfinite(self.allowed) else 0):
            middle = (low + high) / 2
            quiet = self._quiet(middle)
            if quiet is None:
                return None
            low, high = (middle, high) if quiet else (low, middle)
        return low

    def _quiet(self, delay: float) -> bool | None:
        """Return whether the error stays small for 1 s; in pieces, to stop early."""
        x0, end = None, time.thread_time() + PATIENCE
        for k in range(20):
            t = STEP * np.arange(50 * k, 50 * k + 51)
            e = self.run(t, _reference(t), x0=x0, params={"dead_time.delay": delay})["e"]
            if np.abs(e).max() > self.allowed:
                return False
            if time.thread_time() > end:
                return None
            x0 = self.last
        return True

    def rate(self) -> float:
        """Return the lowest rate at which and above which the error is as small as is allowed."""
        lowest, holds, errors = np.inf, True, self.more.setdefault("sampled", {})
        for rate in sorted(self.levels["rates"], reverse=True):
            t, e = self._at_samples(Sensing(1.0 / rate, speed_noise=0.0))
            errors[f"{rate:g}"] = rms(e[t >= 0.5])
            holds = holds and float(np.abs(e).max()) <= self.allowed
            lowest = rate if holds else lowest
        return lowest

    def rounding(self) -> float:
        t, e = self._at_samples(Sensing(STEP, resolution=self.levels["rounding"]))
        return rms(e[t >= 0.5])

    def _at_samples(self, sensing: Sensing) -> tuple[np.ndarray, np.ndarray]:
        """Return times and the speed error of a sampled drive."""
        t = _times(1.5, sensing.dt)
        loop = self.terms.sampled(self.name, "velocity", GAINS["velocity"], sensing, SIZE)
        with interpreted():  # each loop runs a few times only
            return t, loop.run(_reference(t), params=self.believed())["e"]


def _times(length: float, dt: float = STEP) -> np.ndarray:
    return dt * np.arange(round(length / dt) + 1)


def _reference(t: np.ndarray, kind: str = "velocity") -> Signals:
    """Return 0.1 sin 2 pi t and its derivatives: of the speed, or of the position."""
    if kind == "velocity":
        return sine(t, SIZE, 1.0).rows(kind)
    return sine(t, SIZE * TURN, 1.0, phase=0.5 * np.pi).rows(kind)


EXACT = "exact parameters"
HELPS = 0.98  # of the error without an observer: above it an observer does not help
ALIKE = 1.05  # ratio of errors below which two observers are equally good
PERIOD = 4000  # samples in a period of the reference, at most
QUICK = 500.0  # rad/s, the highest crossover
LEVEL = [("Fc", "Fs")]
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
        gains = {k: "a function of w" if callable(v) else v for k, v in self.gains.items()}
        return plain(vars(self) | {"gains": gains})


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
        return plain({"best": self.best and self.best.name, **vars(self)})

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
        return f"Recommended observer: {self.best.name if self.best else 'none'}"

    def _rows(self) -> Iterable[Row]:
        for i, row in enumerate(self.ranked):
            yield Row(f"{i + 1}. {row.name}", " ".join(row.reasons))
        for name, why in self.refused.items():
            yield Row("not admissible", f"{name}: {why}")
        drive = f"{self.drive['rate']:g} Hz, {', '.join(self.drive['measured'])} measured"
        yield Row("drive", drive, "", f"(from {self.drive['source']})")
        yield Row("without", f"{figure(self.none, 3)} {self.unit}", "", "RMS error")
        yield from (Row("note", said) for said in self.messages)

    def __repr__(self) -> str:
        """The first three, how many follow, and how many are not admissible."""
        lines = [self._title()]
        lines += [
            f"  {i + 1}. {row.name}: {row.reasons[0]}" for i, row in enumerate(self.ranked[:3])
        ]
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
    return f"{figure(value, 3)} {unit}" if value >= 1.0 else f"{figure(1e3 * value, 3)} m{unit}"


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
    wanted = [name for name in chosen_observers(observers) if name != "no_observer"]
    if not wanted:
        raise InputError("observers holds no observer: give at least one of lugrectl.observers().")
    trial = Trial(terms, spec, kind, crossing(kind, known["J"], spec["bandwidth"]))
    return trial.answer(wanted, flag(certified, "certified"), reporter(progress))


class Trial:
    """The loop in which the observers of a drive are tried: a sine of the speed, from rest.
    ``spec``: the drive's sensor and task, SI."""

    def __init__(
        self, terms: Terms, spec: Mapping[str, Any], kind: str, gains: Mapping[str, float]
    ) -> None:
        rate, f = spec["rate"], spec["frequency"]
        self.terms, self.spec, self.kind, self.gains = terms, spec, kind, gains
        what = f"a sine of {f:g} Hz at {rate:g} samples per second"
        self.t = np.arange(enough_samples(f, rate, what)) / rate
        self.rows = sine(self.t, spec["speed"], f).rows(kind)
        sensing = (spec[k] for k in ("noise", "resolution", "speed_noise", "delay"))
        self.sensing = Sensing(1.0 / rate, *sensing)
        self.model, self.unit = terms.model, unit_of(kind, terms.model)
        self.loops: dict[tuple[str, Sensing], SampledLoop] = {}
        self.refused: dict[str, str] = {}
        self.none = np.inf

    def answer(self, wanted: Sequence[str], sure: bool, report: Progress) -> Recommendation:
        """Return all observers in the first cases, then the better ones in the others."""
        report(0.0, "simulating the loop without an observer")
        self.none = self.error("no_observer", {})
        first: list[Candidate] = []
        for i, name in enumerate(wanted):
            report(0.6 * i / len(wanted), f"simulating {name}")
            if row := self.first(name, sure):
                first.append(row)
        rows, best = list[Candidate](), np.inf
        for i, row in enumerate(sorted(first, key=lambda row: row.worst)):
            if row.worst <= NEAR * best:
                part = part_of(report, 0.6 + 0.4 * i / len(first), 0.6 + 0.4 * (i + 1) / len(first))
                row = replace(self.tried(row, OTHERS, part), complete=True)
                best = min(best, row.worst)
            rows += [row] if self.bearable(row) else []
        rows.sort(key=lambda row: row.worst)
        alike = [row for row in rows if row.worst <= ALIKE * rows[0].worst]
        rows[: len(alike)] = sorted(alike, key=lambda row: row.noise)
        return Recommendation(
            ranked=tuple(replace(row, reasons=self.reasons(row, rows[0])) for row in rows),
            refused=self.refused,
            none=self.none,
            signal=MEASURED[self.kind],
            unit=self.unit,
            motion=self.model.motion,
            drive=plain(self.spec),
            controller=dict(self.gains),
            messages=tuple(self.messages(rows)),
        )

    def first(self, name: str, sure: bool) -> Candidate | None:
        """Return an observer with exact parameters, a load, noise and friction believed wrong; None
        for one that is refused."""
        block, short = observer_block(name), name.removesuffix("_observer")
        why = unseen(block.inputs, self.spec["measured"]) or unknown(name, self.model)
        own: dict[str, Any] = {}
        certificate = None
        try:
            own, certificate = (own, None) if why else self.designed(name)
        except InputError as error:
            why = f"its gains cannot be designed for this drive: {error}"
        if not why and sure and not certificate:
            why = "its gains have no certificate, and certified=True asks for one."
        if why:
            self.refused[short] = why
            return None
        self.terms = replace(self.terms, designed={**self.terms.designed, name: own})
        exact = self.error(name, {})
        row = Candidate(
            name=short,
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
        if not self.bearable(row):
            return None
        more = {"load": self.error(name, {}, self.spec["load"]), "noise": self.noise(name)}
        return self.tried(replace(row, **more), LEVEL, reporter(False))

    def designed(self, name: str) -> tuple[dict[str, Any], Certificate | None]:
        terms, spec = self.terms, self.spec
        own = terms.designed.get(name)
        if own is not None or (name not in RULES and name != "proposed_observer"):
            return dict(own or {}), None
        slow = SAMPLED / (FASTER * spec["bandwidth"]) if name in ALONE else 0.0
        more = {"k": terms.k, "kp": self.gains["kp"]} if name in ON_ERROR else {}
        gains, made = designed(self.model, name, max(self.sensing.dt, slow), spec["speed"], **more)
        if name == "normal_force_observer" and self.kind == "velocity":
            made = replace(made, holds=False, valid="its proof is about a position loop")
        return gains, made

    def tried(self, row: Candidate, groups: Sequence[Sequence[str]], report: Progress) -> Candidate:
        """Return the same with groups of parameters wrong, too."""
        name, errors = observer_block(row.name).name, dict(row.errors)
        cases = wrong(name, self.model.known(), groups, self.spec["uncertainty"])
        for i, (case, believed) in enumerate(cases.items()):
            report((i + 1) / (len(cases) + 1), f"simulating {name}, {case}")
            errors[case] = self.error(name, believed)
        case = max(errors, key=lambda k: errors[k])
        return replace(row, errors=errors, worst=errors[case], worst_case=case)

    def run(
        self, name: str, believed: Mapping[str, float], load: float = 0.0, sensing: Any = None
    ) -> tuple[float, np.ndarray]:
        """Return the RMS error, infinite if it grows without bound, and u, once it has settled."""
        rows = self.rows | {"d": np.where(self.t >= 0.5 * self.t[-1], load, 0.0)}
        key = name, sensing or self.sensing
        if key not in self.loops:
            more = self.kind, self.gains, key[1], self.spec["speed"]
            self.loops[key] = self.terms.sampled(name, *more)
        with interpreted():  # each loop runs a few times only
            params = {f"{name}.{k}": v for k, v in believed.items()}
            out = self.loops[key].run(rows, params=params)
        later = self.t >= SETTLED / self.spec["frequency"]
        with np.errstate(all="ignore"):
            error, most = rms(out["e"][later]), GROWN * float(np.abs(self.rows["r"]).max())
        return error if error < most else np.inf, out["u"][later]

    def error(self, name: str, believed: Mapping[str, float], load: float = 0.0) -> float:
        return self.run(name, believed, load)[0]

    def noise(self, name: str) -> float:
        """Return the RMS torque that the sensor causes, its rounding included."""
        (one, loud), (two, quiet) = (
            self.run(name, {}, sensing=s) for s in (None, self.sensing.quiet())
        )
        return rms(loud - quiet) if np.isfinite(one + two) else np.inf

    def bearable(self, row: Candidate) -> bool:
        """Return whether a loop works and its observer helps; it is refused where not."""
        bad = next((case for case, error in row.errors.items() if not np.isfinite(error)), None)
        exact, rate = row.errors[EXACT], self.spec["rate"]
        if bad:
            why = f"it cannot run at {rate:g} Hz here: the loop diverges with {bad}."
        elif exact > HELPS * self.none:
            why = (
                f"it does not help at {rate:g} Hz with this sensor: even with exact parameters the "
                f"error is {quantity(exact, self.unit)}, without an observer "
                f"{quantity(self.none, self.unit)}."
            )
        else:
            return True
        self.refused[row.name] = why
        return False

    def reasons(self, row: Candidate, best: Candidate) -> tuple[str, ...]:
        known, unit = self.model.known(), unit_for("N m", self.model.motion)
        level = max(known.get("Fc", 0.0), known.get("Fs", 0.0))
        worst, none = (quantity(x, self.unit) for x in (row.worst, self.none))
        other = f", that of {best.name} {quantity(best.worst, self.unit)}"
        few = "" if row.complete else "; too large to try other wrong parameters"
        part = f", {figure(100 * row.noise / level, 2)} % of the friction level" if level else ""
        load = f"its error is {quantity(row.load, self.unit)}"
        return (
            f"Its error is at most {worst} ({row.worst_case}, the largest of {len(row.errors)})"
            f"{other * (row is not best)}, without an observer {none}{few}.",
            f"It reads {', '.join(row.reads)} and must know "
            f"{', '.join(row.knows) or 'no parameter of the drive'}.",
            f"The sensor causes {quantity(row.noise, unit)} RMS of torque{part}.",
            f"With a load step {load if row.load < np.inf else 'the loop diverges'}.",
            guaranteed(row.certificate),
        )

    def messages(self, rows: Sequence[Candidate]) -> Iterable[str]:
        if not np.isfinite(self.none):
            yield "The loop diverges without an observer too: give a lower bandwidth."
        if self.model.effects:
            effects = ", ".join(use.key for use in self.model.effects)
            yield f"The drive has {effects}; the observers do not know of it."
        if not any(self.spec[k] for k in ("noise", "resolution", "speed_noise")):
            yield "The sensor is taken as exact: give noise or resolution."
        if rows and rows[0].worst > LITTLE * self.none:
            yield "Even the best observer may help little with parameters as wrong as these."
        if not rows:
            yield "No observer is admissible on this drive; the reasons are in refused."


def guaranteed(made: Certificate | None) -> str:
    if made is None:
        return "Its gains are not from a design rule, so nothing is guaranteed."
    if not made.holds:
        return f"Its gains have no certificate ({made.valid or made.lemma})."
    rate = "" if made.rate is None else f": errors decay with {figure(made.rate, 3)} 1/s"
    where = made.valid or "for every motion"
    return f"Its certificate holds {where} if its parameters are right{rate}."


def unseen(inputs: Sequence[str], measured: Sequence[str]) -> str | None:
    known = {*measured, "u", "e", "r", *(["s"] if "w" in measured else [])}
    missing = ["w" if k == "s" else k for k in inputs if k not in known]
    only = f", and this drive measures only {' and '.join(measured)}"
    return f"it reads {missing[0]}{only}: see measured." if missing else None


def drive_of(
    record: Any, said: Mapping[str, Any], motion: str, known: Mapping[str, float]
) -> dict[str, Any]:
    """Return a drive's sensor and task: what is said goes before a dict of numbers or estimates
    from a record, and these before what suits the parameters ``known``."""
    seen: dict[str, Any] = {"source": "the arguments"}
    if isinstance(record, Mapping) and not holds_samples(record):
        if strange := [k for k in record if k not in CHECKS]:
            hint = meant(strange[0], CHECKS)
            raise InputError(f"record: a drive has no value {shown(strange[0])}; {hint}")
        said = {**record, **said}
    elif record is not None:
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
    sizes: dict[str, Any] = dict(given if isinstance(given, Mapping) else {k: given for k in LUGRE})
    for key, size in sizes.items():
        if key not in LUGRE:
            raise InputError(f"uncertainty: there is no {shown(key)}; {meant(key, LUGRE)}")
        sizes[key] = 0.0 if real(size) == 0.0 else share(size, "uncertainty")
    return {k: sizes.get(k, 0.0) for k in LUGRE}


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

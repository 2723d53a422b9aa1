"""Observers at equal terms: the same drive, wrong belief, linear feedback, encoder and rate."""

from __future__ import annotations

import html as markup
import time
import warnings
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from ..blocks.aliases import listed, meant
from ..blocks.block import members
from ..blocks.controllers import MEASURED
from ..blocks.model import Model, Parameters, as_model, model_first
from ..blocks.observers import observer_block
from ..core.display import Grid, grid_html, grid_text
from ..core.display import number as figure
from ..core.errors import Diverged, InputError
from ..core.numeric import rms
from ..core.progress import Progress, Wanted, part_of, reporter, shows_progress
from ..core.result import ComparedRows, Fields, library, plain
from ..core.validation import flag, names, number, positive, share, shown
from ..loops.parts import OUTPUTS
from ..simulation.encoder import Sensing, rounded
from ..simulation.response import simulate
from .loop import Terms, sine, unknown, wrong

COLUMNS = {  # field: heading, factor to the unit of the heading
    "velocity": ("e_w [mrad/s]", 1e3),
    "parameters": ("worst e_w [mrad/s]", 1e3),
    "position": ("e_theta [mrad]", 1e3),
    "cycle": ("cycle [mrad]", 1e3),
    "noise": ("noise in u [mN m]", 1e3),
    "delay": ("delay borne [ms]", 1e3),
    "load": ("load e_w [mrad/s]", 1e3),
    "rate": ("rate borne [Hz]", 1.0),
    "rounding": ("rounded e_w [mrad/s]", 1e3),
    "cost": ("cost [us]", 1e6),
}
STEP = 1e-3  # s
SCENARIOS = (
    *("velocity", "parameters", "position", "cycle", "noise", "delay"),
    *("load", "rate", "rounding"),
)
OTHERS = ("J", "sigma0", "sigma1", "Fv", "vs")  # believed wrong in "parameters", one at a time
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

Signals = dict[str, np.ndarray]
RATES = (2000.0, 1000.0, 500.0, 250.0)  # Hz


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
        rows = [row.summary() for row in self]
        return {"terms": plain(self.terms), "observers": rows, "refused": dict(self.refused)}

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
        return [f"{names} left out: {why}" for why, names in by_reason(self.refused)]


def by_reason(refused: Mapping[str, str]) -> list[tuple[str, str]]:
    """Each reason once, with the observers that it is about."""
    reasons = dict.fromkeys(refused.values())
    return [(why, ", ".join(k for k, own in refused.items() if own == why)) for why in reasons]


@shows_progress
def compare_observers(
    p: Parameters | Model,
    observers: str | Sequence[str | None] | None = None,
    *,
    scenarios: str | Sequence[str] = SCENARIOS,
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
    model_first(p, observers, "observers")
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
    """Return the load torque in N m."""
    level = model.known().get("Fc")
    if given is None and level is None:
        law = model.friction.block.name
        raise InputError(
            f"load is missing: half of Fc is its default, which {law} friction does not have; give "
            "it in N m."
        )
    return 0.5 * float(level or 0.0) if given is None else number(given, "load")


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


class Bench:
    """The loops of one observer: each is built when a scenario needs it. ``levels``: how wrong
    friction is believed, everywhere and in "cycle", and how wrong all else is, SI."""

    def __init__(self, terms: Terms, name: str, levels: Mapping[str, Any]) -> None:
        self.terms, self.name, self.levels = terms, name, levels
        self.loops: dict[str, Any] = {}
        self.last = np.zeros(0)  # the states at the end of the latest run
        self.weakest: str | None = None
        self.sampled: dict[str, float] = {}

    def compared(self, wanted: set[str], report: Progress) -> Compared:
        """Return the figures of the wanted scenarios; ``report`` hears which one begins."""
        found: dict[str, float | None] = dict.fromkeys((*SCENARIOS, "cost"))
        for i, scenario in enumerate(s for s in SCENARIOS if s in wanted):
            report(i / len(wanted), f"simulating {self.name}, scenario {scenario}")
            found[scenario] = getattr(self, scenario)()
        if wanted & TIMED:
            found["cost"] = self.disturbed[1]
        beside = {s: self.terms.feedback(self.name, gains) for s, gains in GAINS.items()}
        gains = {f"{s}.{g}": v for s, own in beside.items() for g, v in own.items()}
        short = self.name if self.name == "no_observer" else self.name.removesuffix("_observer")
        more: dict[str, Any] = {"weakest": self.weakest, "sampled": self.sampled}
        return Compared(name=short, feedback=gains, **found, **more)

    def believed(self, factor: float) -> dict[str, float]:
        """Return the level of friction that the observer believes."""
        known, needs = self.terms.model.known(), observer_block(self.name).parameters
        return {k: factor * known[k] for k in ("Fc", "Fs") if k in known and k in needs}

    def run(
        self,
        scenario: str,
        t: np.ndarray,
        rows: Mapping[str, Any],
        factor: float | None = None,
        x0: Any = None,
        **params: float,
    ) -> Signals:
        """Return signals by name; friction is believed at ``factor`` of its value."""
        kind = "velocity" if scenario == "velocity" else "position"
        if kind not in self.loops:
            self.loops[kind] = self.terms.closed(self.name, kind, GAINS[scenario])
        made = observer_block(self.name).name
        factor = self.levels["wrong"] if factor is None else factor
        values = {f"{made}.{k}": v for k, v in self.believed(factor).items()}
        block, gains = "pi" if kind == "velocity" else "pid", GAINS[scenario]
        values |= {f"{block}.{g}": v for g, v in self.terms.feedback(self.name, gains).items()}
        system = self.loops[kind]
        given = {k: rows.get(k, 0.0 * t) for k in system.input_labels}
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # a loop that does not work is a result here
            done = simulate(system, t, given, x0, params=values | params)
        self.last = np.asarray(done.states)[..., -1]
        out: Signals = dict(zip(OUTPUTS, np.asarray(done.outputs), strict=True))
        return out | {"e": out[MEASURED[kind]] - given["r"]}  # of the motion, not of its sensor

    def _error(
        self, since: float, length: float = 5.0, kind: str = "velocity", d: Any = None, **own: float
    ) -> float:
        """Return the RMS error from a time on; infinite where the loop diverges."""
        t = _times(length)
        rows = _reference(t, kind) | ({} if d is None else {"d": d(t)})
        try:
            return rms(self.run(kind, t, rows, **own)["e"][t >= since])
        except Diverged:
            return np.inf

    @cached_property
    def clean(self) -> Signals | None:
        """The run of the velocity scenario; None where it diverges."""
        t = _times(5.0)
        try:
            return self.run("velocity", t, _reference(t))
        except Diverged:
            return None

    @cached_property
    def disturbed(self) -> tuple[float | None, float | None]:
        """The torque that noise of the encoder causes, and the time that a sample takes."""
        t, random, clean = _times(5.0), np.random.default_rng(0), self.clean
        if clean is None:
            return None, None
        read = clean["theta"] + random.normal(0.0, self.levels["noise"], len(t))
        angle = rounded(read, self.levels["resolution"]) - clean["theta"]
        rows = {"n_theta": angle, "n_w": np.diff(angle, prepend=angle[0]) / STEP}
        begun = time.perf_counter()
        u = self.run("velocity", t, _reference(t) | rows)["u"]
        took = (time.perf_counter() - begun) / len(t)
        return rms((u - clean["u"])[t >= 1.0]), took

    @property
    def allowed(self) -> float:
        """The largest error that "delay" and "rate" allow."""
        return SIZE + (np.inf if self.clean is None else float(np.abs(self.clean["e"]).max()))

    def velocity(self) -> float:
        return np.inf if self.clean is None else rms(self.clean["e"][_times(5.0) >= 1.0])

    def parameters(self) -> float:
        """Return the largest speed error with one more parameter wrong: "J x0.8"."""
        made, off = observer_block(self.name), dict.fromkeys(OTHERS, self.levels["off"])
        cases = wrong(self.name, self.terms.model.known(), [(k,) for k in OTHERS], off)
        errors = {
            case: self._error(1.0, **{f"{made.name}.{k}": v for k, v in values.items()})  # pyright: ignore
            for case, values in cases.items()
        }
        if not errors:
            return self.velocity()
        self.weakest = max(errors, key=lambda which: errors[which])
        return errors[self.weakest]

    def position(self) -> float:
        return self._error(5.0, 10.0, "position")

    def cycle(self) -> float:
        """Return the peak-to-peak position of the limit cycle at a set-point."""
        t = _times(15.0)
        try:
            out = self.run("cycle", t, {"r": SIZE + 0.0 * t}, self.levels["over"])
        except Diverged:
            return np.inf
        return float(np.ptp(out["theta"][t >= 10.0]))

    def noise(self) -> float | None:
        return self.disturbed[0]

    def load(self) -> float:
        """Return the speed error from the step of a load torque on, which acts from 2 to 3.5 s."""
        return self._error(
            2.0, d=lambda t: np.where((t >= 2.0) & (t < 3.5), self.levels["load"], 0.0)
        )

    def delay(self) -> float | None:
        """Return the largest dead time that keeps the error small; None: a run takes too long."""
        low, high = 0.0, LATEST
        for _ in range(HALVINGS if self.clean is not None else 0):
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
            try:
                out = self.run("velocity", t, _reference(t), x0=x0, **{"dead_time.delay": delay})
            except Diverged:
                return False
            x0 = self.last
            if np.abs(out["e"]).max() > self.allowed:
                return False
            if time.thread_time() > end:
                return None
        return True

    def rate(self) -> float:
        """Return the lowest rate at which and above which the error is as small as is allowed."""
        lowest, holds = np.inf, True
        for rate in sorted(self.levels["rates"], reverse=True):
            error, worst = self._at_samples(Sensing(1.0 / rate, speed_noise=0.0))
            self.sampled[f"{rate:g}"] = error
            holds = holds and worst <= self.allowed
            lowest = rate if holds else lowest
        return lowest

    def rounding(self) -> float:
        return self._at_samples(Sensing(STEP, resolution=self.levels["rounding"]))[0]

    def _at_samples(self, sensing: Sensing) -> tuple[float, float]:
        """Return RMS from 0.5 to 1.5 s, and the largest speed error, of a sampled drive."""
        t = _times(1.5, sensing.dt)
        rows, levels = _reference(t), self.believed(self.levels["wrong"])
        control = self.terms.control(self.name, "velocity", GAINS["velocity"], levels)
        try:
            e = self.terms.run(control, "velocity", sensing, SIZE, rows)["w"] - rows["r"]
        except Diverged:
            return np.inf, np.inf
        return rms(e[t >= 0.5]), float(np.abs(e).max())


def _times(length: float, dt: float = STEP) -> np.ndarray:
    return dt * np.arange(round(length / dt) + 1)


def _reference(t: np.ndarray, kind: str = "velocity") -> Signals:
    """Return 0.1 sin 2 pi t and its derivatives: of the speed, or of the position."""
    if kind == "velocity":
        return sine(t, SIZE, 1.0).rows(kind)
    return sine(t, SIZE * TURN, 1.0, phase=0.5 * np.pi).rows(kind)

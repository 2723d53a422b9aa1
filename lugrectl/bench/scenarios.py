"""One observer in all scenarios: its loops, what is disturbed, and the figures."""

from __future__ import annotations

import time
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from typing import Any

import numpy as np

from ..blocks.observers import observer_block
from ..core.errors import Diverged
from ..core.numeric import rms
from ..core.progress import Progress
from ..simulation.encoder import Sensing, rounded
from ..simulation.response import simulate
from .comparison import Compared
from .reference import sine
from .terms import OUTPUTS, Terms, wrong

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
PATIENCE = 1.0  # s for one run with a dead time
FINE = 2.0 * np.pi / 2**17  # rad, the step of an encoder of 17 bits, where none is given
TIMED = {"velocity", "noise", "delay", "rate"}  # with one of them the cost is known

Signals = dict[str, np.ndarray]


@dataclass(frozen=True)
class Levels:
    """How wrong friction is believed, in all scenarios and in "cycle", and the other parameters;
    the load in N m, noise and step of the encoder in rad, sample rates in Hz."""

    wrong: float
    over: float
    off: float
    load: float
    noise: float
    resolution: float
    rates: Sequence[float]

    def summary(self) -> dict[str, Any]:
        """Return them by name, with what the scenarios take where nothing is given."""
        return asdict(self) | {"rounding": self.resolution or FINE, "step": STEP, "gains": GAINS}


class Bench:
    """The loops of one observer: each is built when a scenario needs it."""

    def __init__(self, terms: Terms, name: str, levels: Levels) -> None:
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

    def run(
        self,
        scenario: str,
        rows: Mapping[str, Any],
        t: np.ndarray,
        factor: float | None = None,
        x0: Any = None,
        **params: float,
    ) -> Signals:
        """Return signals by name; friction is believed at ``factor`` of its value."""
        kind = "velocity" if scenario == "velocity" else "position"
        if kind not in self.loops:
            self.loops[kind] = self.terms.closed(self.name, kind, GAINS[scenario])
        values = self._believed(self.levels.wrong if factor is None else factor)
        block = "pi" if kind == "velocity" else "pid"
        gains = self.terms.feedback(self.name, GAINS[scenario])
        values |= {f"{block}.{g}": v for g, v in gains.items()} | params
        system = self.loops[kind]
        given = {k: rows.get(k, 0.0 * t) for k in system.input_labels}
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # a loop that does not work is a result here
            done = simulate(system, t, given, x0, params=values)
        self.last = np.asarray(done.states)[..., -1]
        return dict(zip(OUTPUTS, np.asarray(done.outputs), strict=True))

    def _believed(self, factor: float) -> dict[str, float]:
        """Return the levels of friction that the observer believes, by the keys of its block."""
        made, known = observer_block(self.name), self.terms.values()
        keys = (k for k in ("Fc", "Fs") if k in made.parameters)
        return {f"{made.name}.{k}": factor * known[k] for k in keys}

    def _error(self, scenario: str, rows: Signals, since: float, **params: float) -> float:
        """Return the RMS error from a time on; infinite where the loop diverges."""
        t = STEP * np.arange(len(rows["r"]))
        try:
            return rms(self.run(scenario, rows, t, **params)["e"][t >= since])
        except Diverged:
            return np.inf

    @cached_property
    def clean(self) -> Signals | None:
        """The run of the velocity scenario; None where it diverges."""
        try:
            return self.run("velocity", _reference(5.0), _times(5.0))
        except Diverged:
            return None

    @cached_property
    def disturbed(self) -> tuple[float | None, float | None]:
        """The torque that noise of the encoder causes, and the time that a sample takes."""
        t, random, clean = _times(5.0), np.random.default_rng(0), self.clean
        if clean is None:
            return None, None
        read = clean["theta"] + random.normal(0.0, self.levels.noise, len(t))
        angle = rounded(read, self.levels.resolution) - clean["theta"]
        rows = {"n_theta": angle, "n_w": np.diff(angle, prepend=angle[0]) / STEP}
        begun = time.perf_counter()
        u = self.run("velocity", _reference(5.0) | rows, t)["u"]
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
        made, off = observer_block(self.name), dict.fromkeys(OTHERS, self.levels.off)
        errors, cases = {}, wrong(self.name, self.terms.values(), [[k] for k in OTHERS], off)
        for case, values in cases.items():
            own = {f"{made.name}.{k}": v for k, v in values.items()}
            errors[case] = self._error("velocity", _reference(5.0), 1.0, **own)
        if not errors:
            return self.velocity()
        self.weakest = max(errors, key=lambda which: errors[which])
        return errors[self.weakest]

    def position(self) -> float:
        return self._error("position", _reference(10.0, "position"), 5.0)

    def cycle(self) -> float:
        """Return the peak-to-peak position of the limit cycle at a set-point."""
        t = _times(15.0)
        try:
            out = self.run("cycle", {"r": SIZE + 0.0 * t}, t, self.levels.over)
        except Diverged:
            return np.inf
        return float(np.ptp(out["theta"][t >= 10.0]))

    def noise(self) -> float | None:
        return self.disturbed[0]

    def load(self) -> float:
        """Return the speed error from the step of a load torque on, which acts from 2 to 3.5 s."""
        t = _times(5.0)
        d = np.where((t >= 2.0) & (t < 3.5), self.levels.load, 0.0)
        return self._error("velocity", _reference(5.0) | {"d": d}, 2.0)

    def delay(self) -> float | None:
        """Return the largest dead time for which the error stays as small as is allowed, by
        bisection; None where the loop switches so fast that a run takes too long."""
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
        x0, end = None, time.monotonic() + PATIENCE
        for k in range(20):
            t = STEP * np.arange(50 * k, 50 * k + 51)
            rows = sine(t, SIZE, 1.0).rows("velocity")
            try:
                out = self.run("velocity", rows, t, x0=x0, **{"dead_time.delay": delay})
            except Diverged:
                return False
            x0 = self.last
            if np.abs(out["e"]).max() > self.allowed:
                return False
            if time.monotonic() > end:
                return None
        return True

    def rate(self) -> float:
        """Return the lowest rate at which and above which the error is as small as is allowed."""
        lowest, holds = np.inf, True
        for rate in sorted(self.levels.rates, reverse=True):
            error, worst = self._at_samples(Sensing(1.0 / rate, speed_noise=0.0))
            self.sampled[f"{rate:g}"] = error
            holds = holds and worst <= self.allowed
            lowest = rate if holds else lowest
        return lowest

    def rounding(self) -> float:
        return self._at_samples(Sensing(STEP, resolution=self.levels.resolution or FINE))[0]

    def _at_samples(self, sensing: Sensing) -> tuple[float, float]:
        """Return RMS from 0.5 to 1.5 s, and the largest speed error, of a sampled drive."""
        rows, known = _reference(1.5, dt=sensing.dt), self.terms.values()
        levels = {k: self.levels.wrong * known[k] for k in ("Fc", "Fs") if k in known}
        control = self.terms.control(self.name, "velocity", GAINS["velocity"], levels)
        try:
            e = self.terms.sampled(control, "velocity", sensing, SIZE).run(rows)["w"] - rows["r"]
        except Diverged:
            return np.inf, np.inf
        return rms(e[sensing.dt * np.arange(len(e)) >= 0.5]), float(np.abs(e).max())


def _times(length: float, dt: float = STEP) -> np.ndarray:
    return dt * np.arange(round(length / dt) + 1)


def _reference(length: float, kind: str = "velocity", dt: float = STEP) -> Signals:
    """Return 0.1 sin 2 pi t and its derivatives: of the speed, or of the position."""
    if kind == "velocity":
        return sine(_times(length, dt), SIZE, 1.0).rows(kind)
    return sine(_times(length, dt), SIZE * TURN, 1.0, phase=0.5 * np.pi).rows(kind)

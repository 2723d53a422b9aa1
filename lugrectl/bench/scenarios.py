"""One observer in all scenarios: its loops, what is disturbed, and the figures."""

from __future__ import annotations

import time
import warnings
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..blocks.observers import observer_block
from ..core.errors import Diverged
from ..core.numeric import rms
from ..core.progress import Progress
from ..simulation.encoder import Sensing, rounded
from ..simulation.response import simulate
from .comparison import Compared
from .sampled_drive import sampled_run
from .terms import OUTPUTS, Terms, closed

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


class _Bench:
    """The loop of an observer, built when a scenario needs it and used again by the others."""

    def __init__(self, terms: Terms, name: str) -> None:
        self.terms, self.name = terms, name
        self.loops: dict[str, Any] = {}
        self.last = np.zeros(0)  # the states at the end of the latest run

    def run(
        self,
        scenario: str,
        rows: Mapping[str, Any],
        t: np.ndarray,
        factor: float,
        x0: Any = None,
        **params: float,
    ) -> dict[str, np.ndarray]:
        """Signals by name along a reference; friction is believed at ``factor`` of its value."""
        kind = "velocity" if scenario == "velocity" else "position"
        gains = self.feedback(scenario)
        if kind not in self.loops:
            self.loops[kind] = closed(self.terms, self.name, kind, gains)
        known, made = self.terms.values(), observer_block(self.name)
        values: dict[str, float] = {
            f"{made.name}.{level}": factor * known[level]
            for level in ("Fc", "Fs")
            if level in made.parameters
        }
        block = "pi" if kind == "velocity" else "pid"
        values |= {f"{block}.{g}": v for g, v in gains.items()} | params
        system = self.loops[kind]
        given = {k: rows.get(k, 0.0 * t) for k in system.input_labels}
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # a loop that does not work is a result here
            done = simulate(system, t, given, x0, params=values)
        self.last = np.asarray(done.states)[..., -1]
        return dict(zip(OUTPUTS, np.asarray(done.outputs), strict=True))

    def feedback(self, scenario: str) -> dict[str, float]:
        """The gains of the controller in a scenario."""
        return self.terms.feedback(self.name, GAINS[scenario])


class _Begins:
    """Whether a scenario is wanted, or one of several that share a run; then it is reported."""

    def __init__(self, name: str, wanted: set[str], report: Progress) -> None:
        self.name, self.wanted, self.report = name, wanted, report
        self.done: set[str] = set()

    def __call__(self, *scenarios: str) -> bool:
        if here := self.wanted & {*scenarios}:
            share = len(self.done) / len(self.wanted)
            self.report(share, f"simulating {self.name}, scenario {scenarios[0]}")
            self.done |= here
        return bool(here)


def compared(
    terms: Terms,
    name: str,
    wanted: set[str],
    levels: Mapping[str, float],
    encoder: tuple[float, float],
    rates: Sequence[float],
    report: Progress,
) -> Compared:
    """All scenarios of one observer; ``report`` hears before each which one begins."""
    begins = _Begins(name, wanted, report)
    bench, wrong = _Bench(terms, name), levels["wrong"]
    found: dict[str, float | None] = dict.fromkeys((*SCENARIOS, "cost"))
    t, weakest, clean = STEP * np.arange(5001), None, None
    if begins("velocity", "noise", "delay", "rate"):
        clean, found["velocity"] = _tracked(bench, "velocity", t, wrong, 1.0)
        if clean is not None:
            begun = time.perf_counter()
            disturbed = bench.run(
                "velocity", _reference(t) | _noise(clean["theta"], *encoder), t, wrong
            )
            found["cost"] = (time.perf_counter() - begun) / len(t)
            found["noise"] = rms((disturbed["u"] - clean["u"])[t >= 1.0])
    if begins("parameters"):
        found["parameters"], weakest = _worst(bench, t, wrong, levels["off"])
    peak = np.inf if clean is None else float(np.abs(clean["e"]).max())
    if begins("delay"):
        found["delay"] = 0.0 if clean is None else _borne(bench, wrong, SIZE + peak)
    if begins("load"):
        found["load"] = _loaded(bench, t, wrong, levels["load"])
    sampled: dict[str, float] = {}
    if begins("rate"):
        sampled, found["rate"] = _at_rates(bench, rates, wrong, SIZE + peak)
    if begins("rounding"):
        coarse = Sensing(STEP, resolution=encoder[1] or FINE)
        found["rounding"] = _at_samples(bench, coarse, wrong)[0]
    if begins("position"):
        t = STEP * np.arange(10001)
        found["position"] = _tracked(bench, "position", t, wrong, 5.0)[1]
    if begins("cycle"):
        found["cycle"] = _cycle(bench, levels["over"])
    gains = {f"{s}.{g}": v for s in GAINS for g, v in bench.feedback(s).items()}
    own = {k: v if k in wanted or k == "cost" else None for k, v in found.items()}
    short = name if name == "no_observer" else name.removesuffix("_observer")
    return Compared(name=short, **own, feedback=gains, weakest=weakest, sampled=sampled)


def _reference(t: np.ndarray) -> dict[str, np.ndarray]:
    sine, cosine = np.sin(TURN * t), np.cos(TURN * t)
    return {"r": SIZE * sine, "dr": SIZE * TURN * cosine, "ddr": -SIZE * TURN**2 * sine}


def _noise(theta: np.ndarray, size: float, resolution: float) -> dict[str, np.ndarray]:
    """Errors of an encoder along a motion, and of the velocity that is its difference."""
    angle = np.random.default_rng(0).normal(0.0, size, len(theta))
    angle = rounded(theta + angle, resolution) - theta
    return {"n_theta": angle, "n_w": np.diff(angle, prepend=angle[0]) / STEP}


def _worst(bench: _Bench, t: np.ndarray, factor: float, off: float) -> tuple[float, str | None]:
    """The largest speed error with one more parameter wrong, and which: "J x0.8"."""
    made, known, errors = observer_block(bench.name), bench.terms.values(), {}
    for key in (k for k in OTHERS if k in made.parameters):
        for times in (1.0 - off, 1.0 + off):
            believed = {f"{made.name}.{key}": times * known[key]}
            errors[f"{key} x{times:g}"] = _tracked(bench, "velocity", t, factor, 1.0, believed)[1]
    if not errors:
        return _tracked(bench, "velocity", t, factor, 1.0)[1], None
    weakest = max(errors, key=lambda which: errors[which])
    return errors[weakest], weakest


def _tracked(
    bench: _Bench,
    scenario: str,
    t: np.ndarray,
    factor: float,
    since: float,
    believed: Mapping[str, float] | None = None,
) -> tuple[dict[str, np.ndarray] | None, float]:
    try:
        out = bench.run(scenario, _reference(t), t, factor, **(believed or {}))
    except Diverged:
        return None, np.inf
    return out, rms(out["e"][t >= since])


def _loaded(bench: _Bench, t: np.ndarray, factor: float, load: float) -> float:
    """The speed error from the step of a load torque on, which acts from 2 to 3.5 s."""
    d = np.where((t >= 2.0) & (t < 3.5), load, 0.0)
    try:
        out = bench.run("velocity", _reference(t) | {"d": d}, t, factor)
    except Diverged:
        return np.inf
    return rms(out["e"][t >= 2.0])


def _at_rates(
    bench: _Bench, rates: Sequence[float], factor: float, allowed: float
) -> tuple[dict[str, float], float]:
    """The error at each rate, and the lowest at which and above which it is within ``allowed``."""
    errors: dict[str, float] = {}
    lowest, holds = np.inf, True
    for rate in sorted(rates, reverse=True):
        errors[f"{rate:g}"], worst = _at_samples(
            bench, Sensing(1.0 / rate, speed_noise=0.0), factor
        )
        holds = holds and worst <= allowed
        lowest = rate if holds else lowest
    return errors, lowest


def _at_samples(bench: _Bench, sensing: Sensing, factor: float) -> tuple[float, float]:
    """RMS from 0.5 to 1.5 s, and the largest speed error, of the loop in a sampled drive."""
    t = sensing.dt * np.arange(round(1.5 / sensing.dt) + 1)
    known, gains = bench.terms.values(), bench.feedback("velocity")
    believed = {level: factor * known[level] for level in ("Fc", "Fs") if level in known}
    try:
        given = (sensing, _reference(t), believed)
        out = sampled_run(bench.terms, bench.name, "velocity", gains, *given)
    except Diverged:
        return np.inf, np.inf
    e = out["w"] - _reference(t)["r"]
    return rms(e[t >= 0.5]), float(np.abs(e).max())


def _cycle(bench: _Bench, factor: float) -> float:
    t = STEP * np.arange(15001)
    try:
        out = bench.run("cycle", {"r": SIZE + 0.0 * t}, t, factor)
    except Diverged:
        return np.inf
    return float(np.ptp(out["theta"][t >= 10.0]))


def _borne(bench: _Bench, factor: float, allowed: float) -> float | None:
    """The largest dead time for which the error stays within ``allowed``, by bisection.

    None where the loop switches so fast that a run takes too long.
    """
    low, high = 0.0, LATEST
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        quiet = _quiet(bench, factor, allowed, middle)
        if quiet is None:
            return None
        low, high = (middle, high) if quiet else (low, middle)
    return low


def _quiet(bench: _Bench, factor: float, allowed: float, delay: float) -> bool | None:
    """Whether the error stays within ``allowed`` for 1 s; in pieces, to stop early."""
    x0, end = None, time.monotonic() + PATIENCE
    for k in range(20):
        t = STEP * np.arange(50 * k, 50 * k + 51)
        try:
            out = bench.run("velocity", _reference(t), t, factor, x0, **{"dead_time.delay": delay})
        except Diverged:
            return False
        x0 = bench.last
        if np.abs(out["e"]).max() > allowed:
            return False
        if time.monotonic() > end:
            return None
    return True

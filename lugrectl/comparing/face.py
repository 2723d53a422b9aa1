"""Observers at equal terms: the same drive, wrong belief, linear feedback, encoder and rate."""

from __future__ import annotations

import time
import warnings
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ..blocks.observers import observer_block
from ..checks import flag, number, positive, share, shown
from ..door import as_model
from ..engine.adaptive import Diverged
from ..errors import InputError
from ..progress import Wanted, reporter, shows_progress
from ..simulation import simulate
from ..spec import members
from .result import Compared, ObserverComparison
from .wiring import OUTPUTS, Terms, closed

if TYPE_CHECKING:
    from ..model import Model, Parameters

STEP = 1e-3  # s
SCENARIOS = ("velocity", "parameters", "position", "cycle", "noise", "delay")
OTHERS = ("J", "sigma0", "sigma1", "Fv", "vs")  # believed wrong in "parameters", one at a time
GAINS: dict[str, dict[str, float]] = {
    "velocity": {"kp": 1.6, "ki": 0.16},
    "position": {"kp": 15.0, "ki": 0.0, "kd": 1.2},
    "cycle": {"kp": 15.0, "ki": 30.0, "kd": 0.3},
}
SIZE, TURN = 0.1, 2 * np.pi  # of the reference, and its frequency in rad/s
LATEST, HALVINGS = 0.01, 7  # dead times up to 10 ms, found to 0.08 ms
PATIENCE = 1.0  # s for one run with a dead time


@shows_progress
def compare_observers(
    p: Parameters | Model,
    observers: Sequence[str] | None = None,
    *,
    scenarios: Sequence[str] = SCENARIOS,
    wrong: float = 0.8,
    over: float = 1.2,
    off: float = 0.2,
    k: float = 0.35,
    equal: bool = True,
    noise: float = 1e-5,
    resolution: float = 0.0,
    progress: Wanted = None,
) -> ObserverComparison:
    """Friction observers side by side on one drive, at equal linear feedback.

    Parameters
    ----------
    p : Parameters or Model
        The drive, with LuGre friction.
    observers : list of str, optional
        Names as in ``lugrectl.observers()``, with or without ``_observer``; default: all.
    scenarios : list of str
        Any of "velocity" (r = 0.1 sin 2 pi t rad/s, PI 1.6, 0.16; RMS of w - r over 1 to 5 s),
        "parameters" (the largest such error if one of J, sigma0, sigma1, Fv, vs is believed
        wrong as well, and which), "position" (r = 0.1 sin 2 pi t rad, PD 15, 1.2 and J ddr; RMS
        of theta - r over 5 to 10 s), "cycle" (PID 15, 30, 0.3, step of 0.1 rad;
        peak-to-peak theta over 10 to 15 s), "noise" (torque caused by noise of the encoder, in
        the velocity scenario) and "delay"
        (the largest dead time between torque command and motor, up to 10 ms, with which the
        error of the velocity scenario grows by no more than the reference within 1 s; None if
        the loop switches too fast to be simulated).
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
        noise, are rounded to it. 0 rounds nothing; 2 pi/4096 is 4096 steps a turn.

    Returns
    -------
    ObserverComparison
        A row for each observer; ``print`` shows a table, ``to_frame`` gives a DataFrame.

    Raises
    ------
    InputError
        For an unknown observer or scenario, a drive without LuGre parameters, or a number out of
        bounds.

    Notes
    -----
    The equivalent controller of the correction is k (sigma1 s + sigma0)/(s + a), a =
    sigma0 |w|/h(w): it leaks, where the controller of the others has a full integral. An observer
    on s = (w - dr) + 20 (theta - r) takes k/20 in the position loop, so that its integral action
    is the same; its action on theta and w is larger by sigma0 k/20 and sigma1 k/20. Velocity and
    position are exact except in "noise". The cost is the time of the simulation, not that of a
    drive's processor.
    """
    model = _with_bristles(as_model(p, "p"))
    names = _names(observers)
    strange = [s for s in scenarios if s not in SCENARIOS]
    if strange:
        raise InputError(f"scenario {shown(strange[0])} is none of {', '.join(SCENARIOS)}.")
    levels = {"wrong": positive(wrong, "wrong", "as a factor of friction")}
    levels["over"] = positive(over, "over", "as a factor of friction")
    terms = Terms(model, positive(k, "k", "1/s"), flag(equal, "equal"))
    levels["off"] = share(off, "off")
    encoder = (positive(noise, "noise", "rad"), _step(resolution))
    report, rows = reporter(progress), []
    for i, name in enumerate(names):
        report(i / len(names), f"simulating {name}")
        rows.append(_compared(terms, name, set(scenarios), levels, encoder))
    said = {**levels, "k": terms.k, "equal": terms.equal, "step": STEP}
    said |= dict(zip(("noise", "resolution"), encoder, strict=True))
    return ObserverComparison(rows, said | {"gains": GAINS, "model": model.name})


def _with_bristles(model: Model) -> Model:
    known = model.values()
    missing = [k for k in ("J", "sigma0", "sigma1", "Fc", "Fs", "Fv", "vs") if known.get(k) is None]
    if missing:
        raise InputError(f"p: a comparison of observers needs {', '.join(missing)} of the drive.")
    return model


def _step(resolution: float) -> float:
    if number(resolution, "resolution") < 0.0:
        raise InputError(f"resolution is {resolution:g}; give the step in rad, or 0 for none.")
    return float(resolution)


def _names(wanted: Sequence[str] | None) -> list[str]:
    if isinstance(wanted, str):
        raise InputError(f"observers must be a list of names, not {shown(wanted)}.")
    names = [k for k in members("observer") if k != "no_observer"] if wanted is None else wanted
    return [observer_block(name).name for name in names]


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


def _compared(
    terms: Terms,
    name: str,
    wanted: set[str],
    levels: Mapping[str, float],
    encoder: tuple[float, float],
) -> Compared:
    """All scenarios of one observer."""
    bench, wrong = _Bench(terms, name), levels["wrong"]
    found: dict[str, float | None] = dict.fromkeys((*SCENARIOS, "cost"))
    t = STEP * np.arange(5001)
    weakest = None
    if {"velocity", "noise", "delay"} & wanted:
        clean, found["velocity"] = _tracked(bench, "velocity", t, wrong, 1.0)
        if clean is not None:
            begun = time.perf_counter()
            disturbed = bench.run(
                "velocity", _reference(t) | _noise(clean["theta"], *encoder), t, wrong
            )
            found["cost"] = (time.perf_counter() - begun) / len(t)
            found["noise"] = _rms((disturbed["u"] - clean["u"])[t >= 1.0])
    if "parameters" in wanted:
        found["parameters"], weakest = _worst(bench, t, wrong, levels["off"])
    if "delay" in wanted:
        peak = np.inf if clean is None else float(np.abs(clean["e"]).max())
        found["delay"] = 0.0 if clean is None else _borne(bench, wrong, SIZE + peak)
    if "position" in wanted:
        t = STEP * np.arange(10001)
        found["position"] = _tracked(bench, "position", t, wrong, 5.0)[1]
    if "cycle" in wanted:
        found["cycle"] = _cycle(bench, levels["over"])
    gains = {f"{s}.{g}": v for s in GAINS for g, v in bench.feedback(s).items()}
    own = {k: v if k in wanted or k == "cost" else None for k, v in found.items()}
    return Compared(name=name.removesuffix("_observer"), **own, feedback=gains, weakest=weakest)


def _reference(t: np.ndarray) -> dict[str, np.ndarray]:
    sine, cosine = np.sin(TURN * t), np.cos(TURN * t)
    return {"r": SIZE * sine, "dr": SIZE * TURN * cosine, "ddr": -SIZE * TURN**2 * sine}


def _noise(theta: np.ndarray, size: float, resolution: float) -> dict[str, np.ndarray]:
    """Errors of an encoder along a motion, and of the velocity that is its difference."""
    angle = np.random.default_rng(0).normal(0.0, size, len(theta))
    if resolution:
        angle = resolution * np.round((theta + angle) / resolution) - theta
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
    return out, _rms(out["e"][t >= since])


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


def _rms(x: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.square(x))))

"""One observer on a sampled drive, for all that may be wrong about its parameters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..blocks.observers import observer_block
from ..core.errors import Diverged, InputError
from ..core.numeric import rms
from ..core.progress import Progress
from ..simulation.encoder import Sensing
from .drive_spec import DriveSpec
from .sampled_drive import sampled_run
from .terms import Terms

PERIODS, SETTLED = 1.25, 0.25  # of the reference: simulated, and left out of the error
FEWEST, MOST = 20, 50_000  # samples of a run
EXACT = "exact parameters"
GROWN = 100.0  # times the amplitude of the reference: a loop with such an error has diverged


@dataclass
class Trial:
    """RMS errors by case, infinite where the loop diverges; ``noise``: torque in N m."""

    errors: dict[str, float] = field(default_factory=dict)
    load: float = np.inf
    noise: float = np.inf
    complete: bool = False

    @property
    def worst(self) -> tuple[str, float]:
        """The case with the largest error."""
        case = max(self.errors, key=lambda k: self.errors[k])
        return case, self.errors[case]


@dataclass(frozen=True)
class Course:
    """The reference by name, where the error counts, and the kind of loop that follows it."""

    kind: str
    t: np.ndarray
    rows: Mapping[str, np.ndarray]
    counted: np.ndarray

    def missed(self, out: Mapping[str, np.ndarray]) -> float:
        """The RMS error of a run."""
        y = out["w"] if self.kind == "velocity" else out["theta"]
        return rms((y - self.rows["r"])[self.counted])


def course(spec: DriveSpec, kind: str) -> Course:
    """A sine of the speed, from rest."""
    assert spec.frequency is not None and spec.speed is not None
    turn, size = 2.0 * np.pi * spec.frequency, spec.speed
    samples = round(PERIODS / spec.frequency * spec.rate) + 1
    if not FEWEST <= samples <= MOST:
        raise InputError(
            f"a sine of {spec.frequency:g} Hz at {spec.rate:g} samples per second takes {samples} "
            f"samples, outside {FEWEST} to {MOST}: give another frequency."
        )
    t = np.arange(samples) / spec.rate
    w, a = size * np.sin(turn * t), size * turn * np.cos(turn * t)
    rows = {"r": w, "dr": a} if kind == "velocity" else {
        "r": size / turn * (1.0 - np.cos(turn * t)), "dr": w, "ddr": a}  # fmt: skip
    return Course(kind, t, rows, t >= SETTLED / spec.frequency)


@dataclass(frozen=True)
class Stand:
    """The loop in which the observers are tried."""

    terms: Terms
    spec: DriveSpec
    course: Course
    gains: Mapping[str, float]

    def error(self, name: str, believed: Mapping[str, float], load: float = 0.0) -> float:
        """RMS error with these parameters believed; infinite if the loop diverges."""
        try:
            return self.course.missed(self._run(name, believed, self.spec.sensing, load))
        except Diverged:
            return np.inf

    def noise(self, name: str) -> float:
        """RMS torque that the sensor causes, its rounding included."""
        try:
            runs = (self.spec.sensing, self.spec.sensing.quiet())
            loud, quiet = (self._run(name, {}, sensing, 0.0)["u"] for sensing in runs)
        except Diverged:
            return np.inf
        return rms((loud - quiet)[self.course.counted])

    def _run(
        self, name: str, believed: Mapping[str, float], sensing: Sensing, load: float
    ) -> dict[str, np.ndarray]:
        half = 0.5 * self.course.t[-1]
        rows = dict(self.course.rows) | {"d": np.where(self.course.t >= half, load, 0.0)}
        beside, kind = self.terms.feedback(name, self.gains), self.course.kind
        with np.errstate(all="ignore"):
            out = sampled_run(self.terms, name, kind, beside, sensing, rows, believed)
            if not self.course.missed(out) < GROWN * float(np.abs(self.course.rows["r"]).max()):
                raise Diverged(f"{name}: the error grows without bound.")
        return out

    def first(self, name: str, report: Progress) -> Trial:
        """Exact parameters, the level of friction wrong, a load step, noise."""
        report(0.0, f"simulating {name}")
        made = Trial({EXACT: self.error(name, {})})
        if np.isfinite(made.errors[EXACT]):
            made.errors |= self._tried(name, levels(name, self.terms.values(), self.spec), report)
            made.load = self.error(name, {}, float(self.spec.load or 0.0))
            made.noise = self.noise(name)
        return made

    def finish(self, name: str, trial: Trial, report: Progress) -> None:
        """The other parameters, one at a time."""
        cases = singles(name, self.terms.values(), self.spec)
        trial.errors |= self._tried(name, cases, report)
        trial.complete = True

    def _tried(
        self, name: str, cases: Mapping[str, Mapping[str, float]], report: Progress
    ) -> dict[str, float]:
        errors = {}
        for i, (case, believed) in enumerate(cases.items()):
            report((i + 1) / (len(cases) + 1), f"simulating {name}, {case}")
            errors[case] = self.error(name, believed)
        return errors


def levels(name: str, known: Mapping[str, float], spec: DriveSpec) -> dict[str, dict[str, float]]:
    """Fc and Fs believed wrong together."""
    return _cases(name, known, spec, [("Fc", "Fs")])


def singles(name: str, known: Mapping[str, float], spec: DriveSpec) -> dict[str, dict[str, float]]:
    """The other parameters believed wrong, one at a time."""
    return _cases(name, known, spec, [("J",), ("sigma0",), ("sigma1",), ("Fv",), ("vs",)])


def _cases(
    name: str, known: Mapping[str, float], spec: DriveSpec, groups: Sequence[tuple[str, ...]]
) -> dict[str, dict[str, float]]:
    made, found = observer_block(name).parameters, {}
    for group in groups:
        keys = [k for k in group if k in made and known.get(k)]
        for way in (-1.0, 1.0) if keys else ():
            factors = {k: 1.0 + way * (spec.uncertainty or {}).get(k, 0.0) for k in keys}
            if any(f != 1.0 for f in factors.values()):
                case = f"{', '.join(keys)} x{max(factors.values(), key=lambda f: abs(f - 1)):g}"
                found[case] = {k: f * known[k] for k, f in factors.items()}
    return found


def controller_gains(kind: str, J: float, bandwidth: float) -> dict[str, float]:
    """A PI with its crossover at the bandwidth, or a critically damped PD; 1/s."""
    if kind == "velocity":
        return {"kp": J * bandwidth, "ki": J * bandwidth**2 / 20.0}
    return {"kp": J * bandwidth**2 / 4.0, "ki": 0.0, "kd": J * bandwidth}


def correction(known: Mapping[str, Any], bandwidth: float) -> float:
    """k of the observers that the tracking error corrects: as much integral as the PI has."""
    if not known.get("sigma0"):
        return 0.35
    k = known["J"] * bandwidth**2 / 20.0 / known["sigma0"]
    damping = known.get("sigma1") or 0.0
    return float(min(k, 0.5 * known["J"] * bandwidth / damping) if damping else k)

"""One observer on a sampled drive, for all that may be wrong about its parameters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from ..blocks.controllers import MEASURED
from ..core.errors import Diverged
from ..core.numeric import rms
from ..core.progress import Progress
from ..simulation.encoder import Sensing
from .drive_spec import DriveSpec
from .reference import SETTLED, enough_samples, sine
from .terms import Terms, wrong

EXACT = "exact parameters"
LEVEL, OTHERS = [("Fc", "Fs")], [("J",), ("sigma0",), ("sigma1",), ("Fv",), ("vs",)]
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
class Stand:
    """The loop in which the observers are tried: a sine of the speed, from rest."""

    terms: Terms
    spec: DriveSpec
    kind: str
    gains: Mapping[str, float]

    @cached_property
    def t(self) -> np.ndarray:
        rate, f = self.spec.rate, self.spec.frequency
        what = f"a sine of {f:g} Hz at {rate:g} samples per second"
        return np.arange(enough_samples(f, rate, what)) / rate

    @cached_property
    def rows(self) -> dict[str, np.ndarray]:
        return sine(self.t, self.spec.speed, self.spec.frequency).rows(self.kind)

    def error(self, name: str, believed: Mapping[str, float], load: float = 0.0) -> float:
        """Return the RMS error with these parameters believed; infinite if the loop diverges."""
        try:
            return self._missed(self._run(name, believed, self.spec.sensing, load))
        except Diverged:
            return np.inf

    def noise(self, name: str) -> float:
        """Return the RMS torque that the sensor causes, its rounding included."""
        try:
            runs = (self.spec.sensing, self.spec.sensing.quiet())
            loud, quiet = (self._run(name, {}, sensing)["u"] for sensing in runs)
        except Diverged:
            return np.inf
        return self._counted(loud - quiet)

    def _counted(self, x: np.ndarray) -> float:
        return rms(x[self.t >= SETTLED / self.spec.frequency])

    def _missed(self, out: Mapping[str, np.ndarray]) -> float:
        return self._counted(out[MEASURED[self.kind]] - self.rows["r"])

    def _run(
        self, name: str, believed: Mapping[str, float], sensing: Sensing, load: float = 0.0
    ) -> dict[str, np.ndarray]:
        rows = self.rows | {"d": np.where(self.t >= 0.5 * self.t[-1], load, 0.0)}
        control = self.terms.control(name, self.kind, self.gains, believed)
        out = self.terms.sampled(control, self.kind, sensing, self.spec.speed).run(rows)
        with np.errstate(all="ignore"):
            if not self._missed(out) < GROWN * float(np.abs(self.rows["r"]).max()):
                raise Diverged(f"{name}: the error grows without bound.")
        return out

    def first(self, name: str, report: Progress) -> Trial:
        """Return exact parameters, the level of friction wrong, a load step, noise."""
        report(0.0, f"simulating {name}")
        trial = Trial({EXACT: self.error(name, {})})
        if np.isfinite(trial.errors[EXACT]):
            self._try(name, trial, LEVEL, report)
            trial.load, trial.noise = self.error(name, {}, self.spec.load), self.noise(name)
        return trial

    def finish(self, name: str, trial: Trial, report: Progress) -> None:
        """Try the other parameters, one at a time."""
        self._try(name, trial, OTHERS, report)
        trial.complete = True

    def _try(
        self, name: str, trial: Trial, groups: Sequence[Sequence[str]], report: Progress
    ) -> None:
        cases = wrong(name, self.terms.values(), groups, self.spec.uncertainty)
        for i, (case, believed) in enumerate(cases.items()):
            report((i + 1) / (len(cases) + 1), f"simulating {name}, {case}")
            trial.errors[case] = self.error(name, believed)

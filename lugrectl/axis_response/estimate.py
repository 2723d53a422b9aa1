"""From runs to the response: friction, response, mechanics, and once more with what they say."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from .effects import Known
from .friction_fit import Friction, Problem, fit_friction
from .friction_terms import Terms
from .load_side import load_motion
from .local_response import Response, Shape, centres, local_response, windows_at
from .modes import Mechanics, fit_mechanics
from .rests import filled
from .result import LARGE
from .runs import Run
from .windows import Window

HIGHEST = 0.4  # of half the sampling rate
FRICTION = 40.0  # Hz up to which friction is fitted: above, it has little power
LOWEST = 30  # periods in the longest run
ROUNDS = 2  # with the mechanics that the round before showed
OCTAVE = 0.35  # of log frequency to either side: over it what friction does is a median
SURE = 0.01  # by which the mean log residual must fall for friction, and once more for the load's
ON_LOAD = 0.25  # of the friction: with so much on the load its motion is first computed


@dataclass(frozen=True, eq=False)
class Estimate:
    """The response without and with friction taken out; ``friction`` is None without dry friction
    in the model, ``mechanics`` where the response shows none."""

    raw: Response
    response: Response
    friction: Friction | None
    mechanics: Mechanics | None

    @cached_property
    def governed(self) -> np.ndarray:
        """Where friction governs the response (n,)."""
        return _governed(self.raw, self.response)


def _governed(raw: Response, taken: Response) -> np.ndarray:
    """Where friction changes the response by too many dB (n,), by the median over an octave."""
    with np.errstate(divide="ignore", invalid="ignore"):
        dB = np.abs(20.0 * np.log10(np.abs(raw.P / taken.P)))
    x = np.log(taken.w)
    ends = (np.searchsorted(x, x - OCTAVE), np.searchsorted(x, x + OCTAVE, "right"))
    return np.array([np.nanmedian(dB[a:b]) for a, b in zip(*ends, strict=True)]) >= LARGE


@dataclass(frozen=True, eq=False)
class _Stage:
    """Runs with their windows, and what is known of the mechanics so far."""

    known: Known
    windows: Sequence[Window]
    w: np.ndarray
    mechanics: Mechanics | None = None

    @property
    def runs(self) -> Sequence[Run]:
        return self.known.runs

    def torques(self) -> list[np.ndarray]:
        """The spectra of the commands, less what the known torques cost."""
        every = zip(self.runs, self.known.resisting, self.advance(), strict=True)
        return [run.U - run.spectrum(d) * a for run, d, a in every]

    def moving(self) -> list[np.ndarray]:
        """The same with rests filled in."""
        if self.mechanics is None:
            return self.torques()
        both = zip(self.runs, self.torques(), strict=True)
        return [filled(run, U, self.mechanics) for run, U in both]

    def advance(self) -> list[np.ndarray]:
        """What takes a torque in force to the command; a sample early before more is known."""
        if self.mechanics is None:
            return [np.exp(1j * run.w * run.dt) for run in self.runs]
        return [self.mechanics.advance(run.w) for run in self.runs]

    def shape(self, w: np.ndarray) -> Shape:
        if self.mechanics is None:
            return Shape(np.ones(len(w)), np.ones(len(w)))
        return self.mechanics.shape(w)

    def response(self, friction: Sequence[np.ndarray] | None = None) -> Response:
        V = self.torques()
        if friction is not None:
            V = [U - F for U, F in zip(self.moving(), friction, strict=True)]
        shapes = [self.shape(run.w) for run in self.runs]
        return local_response(self.runs, self.windows, V, shapes, self.shape(self.w))

    def knowing(self, found: Response) -> _Stage:
        """The same with the mechanics that a response shows where friction does not govern it."""
        raw = self.response()
        shown = replace(found, coherence=np.where(_governed(raw, found), 0.0, found.coherence))
        return replace(self, mechanics=fit_mechanics(shown, raw, self.runs[0].dt))

    def problem(self) -> Problem:
        high = 2.0 * np.pi * min(FRICTION, 0.5 * HIGHEST / self.runs[0].dt)
        shapes = [self.shape(run.w) for run in self.runs]
        terms = Terms(self.runs, self.advance(), self.known.scales)
        return Problem.of(terms, self.moving(), shapes, high)

    def friction(self, before: Friction | None) -> Friction:
        """The friction of motor and of load, each where the residual falls clearly with it."""
        problem = self.problem()
        found = fit_friction(problem, before)
        none = problem.without(found)
        if found.cost > none.cost - SURE:
            found = none
        if before is None or self.mechanics is None or not len(self.mechanics.pairs):
            return found
        level = before.levels.get("load Fc") or ON_LOAD * before.levels.get("Fc", 0.0)
        loads = [load_motion(run, self.mechanics, level, before.distance) for run in self.runs]
        both = fit_friction(problem.with_terms(problem.terms.with_load(loads)), before)
        return both if both.cost < found.cost - SURE else found


def estimate(known: Known, dry: bool) -> Estimate:
    """The whole chain; ``dry``: whether the model has friction that reverses with the motion."""
    runs = known.runs
    longest = max(len(run.u) * run.dt for run in runs)
    w = centres(runs, 2.0 * np.pi * LOWEST / longest, np.pi * HIGHEST / runs[0].dt)
    stage = _Stage(known, windows_at(runs, w), w)
    friction, taken = None, None
    for _ in range(1 + ROUNDS):
        if dry:
            friction = stage.friction(friction)
            taken = friction.spectra if friction.levels else None
        stage = stage.knowing(stage.response(taken))
    return Estimate(stage.response(), stage.response(taken), friction, stage.mechanics)

"""One fit of the balance: terms on windows of one width, with the delay and spread of u."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from .constants import (
    BLOCKS,
    FOR_NOISE,
    LARGEST_DELAY,
    LITTLE,
    ROUNDS,
    SLIDING,
    SMALL,
    SPREAD,
    WIDE,
)
from .covariance import Blocks, blocks, coherent, covariance
from .regression import Problem, Solution, deviation, log_density, solve, weights_near
from .result import LEVELS
from .terms import Term
from .windows import Source, Windows


@dataclass(frozen=True)
class Setting:
    """How to fit: rest below so many rad/s, width of the prior of the delay in s.

    With a prior of 0 the delay is not fitted, but is ``delay``. ``held`` are known coefficients.
    """

    rest: float
    delay_prior: float
    held: tuple[tuple[str, float], ...] = ()
    delay: float = 0.0


@dataclass(frozen=True, eq=False)
class Fit:
    """Coefficients ``p`` of the terms, then delay and spread of u where they were fitted.

    ``score`` is the log density of the motion given the torque, ``torque`` the RMS of the torque,
    ``rms`` that of every column. ``of_runs`` says that each run is one point, a block.
    """

    terms: tuple[Term, ...]
    windows: Windows
    setting: Setting
    p: np.ndarray
    solution: Solution
    chunks: list[Blocks]
    rms: np.ndarray
    problem: Problem
    half_width: float = 0.0
    of_runs: bool = False

    @cached_property
    def V(self) -> np.ndarray:
        """The covariance of the coefficients; most fits that are compared never need theirs."""
        return covariance(self.problem, self.solution, self.chunks)

    @cached_property
    def merit(self) -> float:
        """The expected error of J, Fc and Fv as a share of the torque: their spread, and the share
        that noise takes off them. None of them is below 0: a negative one is wrong by its size."""
        at = [i for i, name in enumerate(self.names) if name in LEVELS]
        share = self.rms[at] / self.torque
        p, last = self.p[at] * share, self.solution
        lost = (np.diag(last.N) / np.diag(last.A))[at] * p
        spread = np.minimum(np.sqrt(np.diag(self.V)[at]) * share, 1.0)
        return float(np.sqrt(np.sum(spread**2 + lost**2 + np.minimum(p, 0) ** 2)))

    @cached_property
    def score(self) -> float:
        """Log density of the motion given the torque: the residual is J times that of a."""
        J = abs(self.p[self.names.index("J")]) if "J" in self.names else 1.0
        return log_density(self.solution) + len(self.r) * float(np.log(J + 1e-300))

    @property
    def delay(self) -> float:
        if not self.setting.delay_prior:
            return self.setting.delay
        return float(np.clip(self.p[len(self.terms)], -LARGEST_DELAY, LARGEST_DELAY))

    @property
    def names(self) -> list[str]:
        return [term.key for term in self.terms]

    @property
    def torque(self) -> float:
        return self.windows.torque

    @property
    def r(self) -> np.ndarray:
        return self.solution.r

    @property
    def blocks(self) -> int:
        return int(self.chunks[0][-1]) + 1

    @property
    def overlap(self) -> float:
        """Windows for each independent one."""
        return _overlap(self.chunks[0])

    def value(self, key: str, default: float = 0.0) -> float:
        """The coefficient of a term, or its held value."""
        if key in self.names:
            return float(self.p[self.names.index(key)])
        return dict(self.setting.held).get(key, default)


def fit(
    source: Source,
    half_width: float,
    terms: Sequence[Term],
    setting: Setting,
    delay: float = 0.0,
    rounds: int = ROUNDS,
    start: np.ndarray | None = None,
) -> Fit | None:
    """The terms on windows of one width; the delay of u by Gauss-Newton. None: too few windows.

    ``start`` holds coefficients to start from, so that the fit stays with their explanation.
    """
    made = None
    delay = delay if setting.delay_prior else setting.delay
    for _ in range(rounds):
        windows = source.windows(half_width, terms, setting.rest, delay)
        if windows is None or windows.is_dead():
            return made
        made = replace(regress(windows, terms, setting, delay, start=start), half_width=half_width)
        step, delay = made.delay - delay, made.delay
        if abs(step) < 0.02 * windows.dt:
            break
    return made


def regress(
    windows: Windows,
    terms: Sequence[Term],
    setting: Setting,
    delay: float,
    near: Fit | None = None,
    start: np.ndarray | None = None,
) -> Fit:
    """The terms, whose columns are those of ``windows``, at one delay.

    ``near`` is a fit of other shapes on the same windows: its weights and blocks are used, which
    saves a pass.
    """
    problem, rms = _problem(windows, terms, setting, delay)
    if near is None:
        problem = _without_signal(problem)
        first = solve(problem, None if start is None else weights_near(problem, start))
        chunks = blocks(windows.piece, windows.run, first.r * np.sqrt(first.t))
    else:
        first, chunks = near.solution, near.chunks[:1]
    problem = _sized(problem, first.p, windows, terms, setting, rms, _overlap(chunks[0]))
    last = solve(problem, first.t)
    return Fit(tuple(terms), windows, setting, last.p, last, chunks, rms[: len(terms)], problem)


def tried(
    source: Source, made: Fit, shapes: Sequence[Term], place: int | None = None
) -> tuple[Fit, list[Fit]]:
    """A fit again, and with each shape in the place of a term or beside all of them."""
    every, m, setting = [*made.terms, *shapes], len(made.terms), made.setting
    windows = source.windows(made.half_width, every, setting.rest, made.windows.delay)
    if windows is None:
        return made, []
    plain = regress(windows.only(range(m)), made.terms, setting, made.delay)
    found = []
    for i in range(m, len(every)):
        if np.abs(windows.X[:, i]).max() > SMALL:
            at = [*range(m), i] if place is None else [i if k == place else k for k in range(m)]
            terms = [every[k] for k in at]
            found.append(regress(windows.only(at), terms, setting, made.delay, plain))
    return plain, found


def wide_covariance(made: Fit) -> np.ndarray:
    """The covariance of a fit whose misfit may depend on speed, torque, acceleration or position.

    The residual is then one error for all windows with the same value, not one for each.
    """
    d = made.windows
    variables = [d.w, d.u, d.theta, np.mod(d.theta, 2 * np.pi)]
    if "J" in made.names:
        variables.append(d.X[:, made.names.index("J")])
    return covariance(made.problem, made.solution, made.chunks, coherent(variables))


def _problem(
    windows: Windows, terms: Sequence[Term], setting: Setting, delay: float
) -> tuple[Problem, np.ndarray]:
    """The regression, with priors for a first pass, and the RMS of every column."""
    fitted = windows.du.shape[1] if setting.delay_prior else 0
    X = np.c_[windows.X, windows.du] if fitted else windows.X
    y = windows.y + windows.du[:, 0] * delay if fitted else windows.y
    rms = np.sqrt(np.mean(X**2, axis=0))
    rms[rms == 0] = 1.0
    m = len(terms)
    rough = np.linalg.lstsq(X[:, :m] / rms[:m], windows.y, rcond=1e-6)[0] / rms[:m]
    own = {"J": np.mean(windows.noise_a**2), "Fv": np.mean(windows.noise_w**2)}
    u = windows.noise_u.mean(axis=0)
    problem = Problem(
        y=y,
        X=X,
        prior=rms,
        level=0.0,
        rest=windows.rest,
        noise=np.array([*(own.get(term.key, 0.0) for term in terms), *u[:fitted]]),
        shared=np.array([0.0] * m + [0.0, u[2]][:fitted]),
        noise_y=float(u[3]),
        derivatives=fitted,
    )
    return _sized(problem, rough, windows, terms, setting, rms, 1.0, 2.0), rms


def _sized(
    problem: Problem,
    p: np.ndarray,
    windows: Windows,
    terms: Sequence[Term],
    setting: Setting,
    rms: np.ndarray,
    overlap: float,
    wide: float = 1.0,
) -> Problem:
    """The problem with the level and the priors that coefficients give: wide for terms, shares of
    Fc or J, a few samples for u.

    Windows overlap, so X' W X counts the data ``overlap`` times; priors of u count as often.
    """
    known = dict(setting.held) | dict(zip((term.key for term in terms), p.tolist(), strict=False))
    level = max(abs(known.get("Fc", 0.0)), wide * LITTLE * windows.torque)
    sizes = level, abs(known.get("J", 0.0)) + 1e-300
    prior = [
        WIDE * windows.torque / size if term.share is None else term.share * sizes[term.bent]
        for term, size in zip(terms, rms, strict=False)
    ]
    of_u = np.array([setting.delay_prior, SPREAD][: problem.derivatives]) / np.sqrt(overlap)
    return replace(problem, level=level, prior=np.array([*prior, *of_u]))


def _without_signal(problem: Problem) -> Problem:
    """The problem with no more noise of u than a first fit leaves.

    The noise of u is read off the top of its spectrum. A command that jumps at random has its own
    power there; the balance then leaves less than that "noise".
    """
    n, m = problem.X.shape
    if n < FOR_NOISE * m or not problem.noise_y:
        return problem
    r = solve(problem.with_noise_of_u(0.0)).r[problem.rest < SLIDING]
    share = deviation(r) ** 2 / problem.noise_y if len(r) else 1.0
    return problem if share > 1 else problem.with_noise_of_u(share)


def _overlap(chunk: Blocks) -> float:
    """Windows for each independent one: a block is four memories long."""
    return max(3.0, len(chunk) / (BLOCKS[0] * (int(chunk[-1]) + 1)))

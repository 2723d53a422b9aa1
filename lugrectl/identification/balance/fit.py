"""One fit of the balance: terms on windows of one width, with the delay and spread of u."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from .constants import (
    BLOCK_MEMORIES,
    LARGEST_DELAY,
    MAD,
    ROUNDS_OF_DELAY,
    SCALE_OF_SHAPES,
    SLIDING,
    SPREAD,
    WIDE,
    WINDOWS_FOR_NOISE,
)
from .covariance import Blocks, blocks, coherent, covariance
from .regression import Problem, Solution, log_density, solve, weights_near
from .terms import Term
from .windows import Source, Windows

DERIVATIVES = 2
MAIN = ("J", "Fc", "Fv")


@dataclass(frozen=True)
class Setting:
    """How to fit: rest below so many rad/s, width of the prior of the delay in s.

    With a prior of 0 the delay is not fitted, but is ``delay``.
    """

    rest: float
    delay_prior: float
    held: tuple[tuple[str, float], ...] = ()
    delay: float = 0.0


@dataclass(frozen=True, eq=False)
class Fit:
    """Coefficients ``p`` of the terms, then delay and spread of u where they were fitted.

    ``score`` is the log density of the motion given the torque, ``torque`` the RMS of the torque,
    ``rms`` that of every column, ``blocks`` the number of blocks.
    ``of_runs`` says that each run is one point, a block.
    """

    terms: tuple[Term, ...]
    windows: Windows
    half_width: float
    setting: Setting
    p: np.ndarray
    solution: Solution
    chunks: list[Blocks]
    torque: float
    rms: np.ndarray
    score: float
    problem: Problem
    delay: float = 0.0
    of_runs: bool = False

    @cached_property
    def V(self) -> np.ndarray:
        """The covariance of the coefficients; most fits that are compared never need theirs."""
        return covariance(self.problem, self.solution, self.chunks)

    @cached_property
    def merit(self) -> float:
        """The expected error of J, Fc and Fv as a share of the torque."""
        return _merit(self.solution, self.V, self.terms, self.rms / self.torque)

    @property
    def names(self) -> list[str]:
        return [term.key for term in self.terms]

    @property
    def r(self) -> np.ndarray:
        return self.solution.r

    @property
    def blocks(self) -> int:
        return int(self.chunks[0][-1]) + 1

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
    rounds: int = ROUNDS_OF_DELAY,
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
    overlap = _overlap(len(windows.y), int(chunks[0][-1]) + 1)
    torque = _torque(windows)
    level = _level(first.p, terms, setting, SCALE_OF_SHAPES * torque)
    prior = _prior(
        windows, terms, setting, (level, _inertia(first.p, terms, setting)), overlap, rms
    )
    problem = replace(problem, level=level, prior=prior)
    last = solve(problem, first.t)
    return Fit(
        terms=tuple(terms),
        windows=windows,
        half_width=0.0,
        setting=setting,
        p=last.p,
        solution=last,
        chunks=chunks,
        torque=torque,
        rms=rms[: len(terms)],
        score=_score(last, terms, setting),
        problem=problem,
        delay=_delay(last.p, terms, setting),
    )


def wide_covariance(made: Fit) -> np.ndarray:
    """The covariance of a fit whose misfit may depend on speed, torque, acceleration or position.

    The residual is then one error for all windows with the same value, not one for each.
    """
    d = made.windows
    variables = [d.w, d.u, d.theta, np.mod(d.theta, 2 * np.pi)]
    if "J" in made.names:
        variables.append(d.X[:, made.names.index("J")])
    return covariance(made.problem, made.solution, made.chunks, coherent(variables))


def _without_signal(problem: Problem) -> Problem:
    """The problem with no more noise of u than a first fit leaves.

    The noise of u is read off the top of its spectrum. A command that jumps at random has its own
    power there; the balance then leaves less than that "noise".
    """
    n, m = problem.X.shape
    if n < WINDOWS_FOR_NOISE * m or not problem.noise_y:
        return problem
    free = replace(
        problem, noise_y=0.0, noise=problem.noise * problem.own, shared=0 * problem.shared
    )
    r = solve(free).r[problem.rest < SLIDING]
    share = (MAD * float(np.median(np.abs(r)))) ** 2 / problem.noise_y if len(r) else 1.0
    if share > 1:
        return problem
    noise = np.where(problem.own, problem.noise, share * problem.noise)
    return replace(
        problem, noise=noise, shared=share * problem.shared, noise_y=share * problem.noise_y
    )


def _torque(windows: Windows) -> float:
    """RMS of the torque: of u, or of what is held known where u is 0."""
    sizes = np.mean(windows.u**2), np.mean(windows.y**2)
    return float(np.sqrt(max(sizes))) + 1e-300


def _problem(windows: Windows, terms: Sequence[Term], setting: Setting, delay: float) -> tuple:
    """The regression, with priors for a first pass, and the RMS of every column."""
    fitted = DERIVATIVES if setting.delay_prior else 0
    X = np.c_[windows.X, windows.du] if fitted else windows.X
    y = windows.y + windows.du[:, 0] * delay if fitted else windows.y
    rms = np.sqrt(np.mean(X**2, axis=0))
    rms[rms == 0] = 1.0
    m = len(terms)
    rough = np.linalg.lstsq(X[:, :m] / rms[:m], windows.y, rcond=1e-6)[0] / rms[:m]
    level = _level(rough, terms, setting, 2 * SCALE_OF_SHAPES * _torque(windows))
    own = {"J": np.mean(windows.noise_a**2), "Fv": np.mean(windows.noise_w**2)}
    noise = [own.get(term.key, 0.0) for term in terms]
    u = windows.noise_u.mean(axis=0)
    problem = Problem(
        y=y,
        X=X,
        prior=_prior(windows, terms, setting, (level, _inertia(rough, terms, setting)), 1.0, rms),
        level=level,
        rest=windows.rest,
        noise=np.array([*noise, *u[:fitted]]),
        shared=np.array([0.0] * m + [0.0, u[2]][:fitted]),
        noise_y=float(u[3]),
        derivatives=fitted,
    )
    return problem, rms


def _level(p: np.ndarray, terms: Sequence[Term], setting: Setting, least: float) -> float:
    """The sliding torque, at least ``least``."""
    names = [term.key for term in terms]
    held = dict(setting.held).get("Fc", 0.0)
    return max(abs(float(p[names.index("Fc")] if "Fc" in names else held)), least)


def _inertia(p: np.ndarray, terms: Sequence[Term], setting: Setting) -> float:
    """The size of J."""
    names = [term.key for term in terms]
    J = p[names.index("J")] if "J" in names else dict(setting.held).get("J", 0.0)
    return abs(float(J)) + 1e-300


def _prior(
    windows: Windows,
    terms: Sequence[Term],
    setting: Setting,
    sizes: tuple[float, float],
    overlap: float,
    rms: np.ndarray,
) -> np.ndarray:
    """Standard deviations: wide for terms, shares of Fc or J (``sizes``), a few samples for u.

    Windows overlap, so X' W X counts the data ``overlap`` times; priors of u count as often.
    """
    wide = WIDE * _torque(windows) / rms
    prior = [
        w if t.share is None else t.share * sizes[t.bent] for w, t in zip(wide, terms, strict=False)
    ]
    if setting.delay_prior:
        of_u = np.array([setting.delay_prior, SPREAD])
        prior = [*prior, *(of_u / np.sqrt(overlap))]
    return np.array(prior)


def _overlap(windows: int, blocks: int) -> float:
    """Windows for each independent one: a block is four memories long."""
    return max(3.0, windows / (BLOCK_MEMORIES[0] * blocks))


def independent(made: Fit) -> float:
    """Windows for each independent one."""
    return _overlap(len(made.windows.y), made.blocks)


def _merit(last: Solution, V: np.ndarray, terms: Sequence[Term], share: np.ndarray) -> float:
    """Expected error of J, Fc and Fv: their spread, and the share that noise takes off them.

    None of them is below 0: a negative one is wrong by its size at least.
    """
    at = [i for i, term in enumerate(terms) if term.key in MAIN]
    p = last.p[at] * share[at]
    lost = (np.diag(last.N) / np.diag(last.A))[at] * p
    spread = np.minimum(np.sqrt(np.diag(V)[at]) * share[at], 1.0)
    return float(np.sqrt(np.sum(spread**2 + lost**2 + np.minimum(p, 0) ** 2)))


def _score(last: Solution, terms: Sequence[Term], setting: Setting) -> float:
    """Log density of the motion given the torque: the residual is J times that of a."""
    names = [term.key for term in terms]
    J = abs(last.p[names.index("J")]) if "J" in names else 1.0
    return log_density(last) + len(last.r) * float(np.log(J + 1e-300))


def _delay(p: np.ndarray, terms: Sequence[Term], setting: Setting) -> float:
    if not setting.delay_prior:
        return setting.delay
    return float(np.clip(p[len(terms)], -LARGEST_DELAY, LARGEST_DELAY))

"""All windows of one width: the torque, the terms, and what is known of their noise."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from .constants import (
    ALIGNED,
    FEWEST_SAMPLES,
    MANY,
    NOTHING,
    PER_TERM,
    RARE,
    STEP,
)
from .motion import Sensors, window_means
from .terms import Term
from .track import Track, means, weights


@dataclass(frozen=True, eq=False)
class Windows:
    """n windows of one width.

    ``u`` is the mean of u (n,), ``y`` that minus the terms whose values are held, ``X`` (n, m) are
    the columns of the terms, ``du`` (n, 2) what a delay (per second) and a spread (per squared
    sample) of u take off y. ``rest`` is the share of the weight at which the drive rests, ``piece``
    and ``run`` are its stretch and run; ``t``, ``w``, ``theta`` time, mean speed, and the position
    in the middle (0 without one).

    ``noise_w``, ``noise_a`` are standard deviations; ``noise_u`` (n, 4) the variance of the noise
    in both columns of du, its covariance with y, its variance in y. ``dt`` is the usual sample
    time, ``largest`` the largest torque of the record, ``delay`` that by which u was shifted.
    """

    y: np.ndarray
    u: np.ndarray
    X: np.ndarray
    du: np.ndarray
    rest: np.ndarray
    piece: np.ndarray
    run: np.ndarray
    t: np.ndarray
    w: np.ndarray
    theta: np.ndarray
    noise_w: np.ndarray
    noise_a: np.ndarray
    noise_u: np.ndarray
    dt: float
    largest: float
    delay: float

    @cached_property
    def torque(self) -> float:
        """RMS of the torque: of u, or of what is held known where u is 0."""
        return float(np.sqrt(max(np.mean(self.u**2), np.mean(self.y**2)))) + 1e-300

    def is_dead(self) -> bool:
        """True if the torque is 0 in all but a few windows, and none of it is held."""
        largest = max(np.abs(self.y).max(), self.largest)
        return bool(np.mean(np.abs(self.y) > NOTHING * largest) < RARE)

    def only(self, columns: Iterable[int]) -> Windows:
        """The same windows with some of the columns."""
        return replace(self, X=self.X[:, list(columns)])


@dataclass(eq=False)
class Source:
    """Makes windows from tracks; columns that are asked for again are kept."""

    tracks: Sequence[Track]
    sensors: Sensors
    held: Sequence[tuple[Term, float]] = ()
    _kept: dict = field(default_factory=dict)

    def windows(
        self, half_width: float, terms: Sequence[Term], rest: float, delay: float
    ) -> Windows | None:
        """The windows of half-width ``half_width`` s; None if there are too few.

        ``rest`` is the speed in rad/s below which the drive rests, ``delay`` that of u in s,
        beyond the hold.
        """
        every = (self._part(i, half_width, terms, rest, delay) for i in range(len(self.tracks)))
        parts = [p for p in every if p is not None]
        if sum(len(p["y"]) for p in parts) <= PER_TERM * len(terms):
            return None
        joined = {k: np.concatenate([p[k] for p in parts]) for k in parts[0]}
        dt = float(np.median([p.dt for p in self.tracks]))
        largest = max(float(np.abs(p.u).max()) for p in self.tracks)
        return Windows(**joined, dt=dt, largest=largest, delay=delay)

    def _part(
        self, i: int, half_width: float, terms: Sequence[Term], rest: float, delay: float
    ) -> dict[str, np.ndarray] | None:
        """The windows of one track; an empty track has none."""
        track = self.tracks[i]
        half = max(half_width / track.dt, FEWEST_SAMPLES - 1)
        reach = int(np.ceil(half + abs(self.sensors.lag) / track.dt)) + 1
        late = int(np.ceil((abs(delay) + track.dt) / track.dt / ALIGNED))
        edge = int(np.ceil(half)) + 3 + ALIGNED * late
        step = max(int(half * STEP), sum(map(len, self.tracks)) // MANY, 1)
        place = (i, half, edge, reach)
        at = self._once(place, lambda: track.centres(reach, step, edge))
        if not len(at):
            return None
        motion = self._once(("motion", *place), lambda: window_means(track, half, at, self.sensors))
        k0, k2 = weights(half, 0), weights(half, 2) / track.dt**2

        def column(term: Term) -> np.ndarray:
            samples, k = term.column, k2 if term.bent else k0
            if samples is None:
                return motion.a if term.key == "J" else motion.w
            x = self._once((samples, i), lambda: samples(track))
            return self._once((samples, term.bent, *place), lambda: means(x, k, at))

        one = np.ones(len(at))
        u, du, noise = _torque(track, half, delay, at)
        return {
            "y": u - sum((value * column(term) for term, value in self.held), 0 * one),
            "u": u,
            "X": np.column_stack([column(term) for term in terms]),
            "du": du,
            "rest": np.clip(means(1.0 * (np.abs(track.speed) < rest), k0, at), 0, 1),
            "piece": np.full(len(at), i),
            "run": np.full(len(at), track.run),
            "t": track.t[at],
            "w": motion.w,
            "theta": 0 * one if track.theta is None else track.theta[at],
            "noise_w": motion.noise_w * one,
            "noise_a": motion.noise_a * one,
            "noise_u": self.sensors.noise["u"] ** 2 * noise * one[:, None],
        }

    def _once(self, key, make):
        if key not in self._kept:
            self._kept[key] = make()
        return self._kept[key]


def _torque(
    track: Track, half: float, delay: float, at: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Means of u(t - delay) held over each sample, of its derivatives, and the noise of both.

    A held value acts from its sample to the next, on average half a sample later.
    """
    shift = -(0.5 + delay / track.dt)
    k0 = weights(half, 0, shift, cell=True)
    k1 = weights(half, 1, shift) / track.dt
    k2 = weights(half, 2, shift)
    du = np.c_[means(track.u, k1, at), means(track.u, k2, at)]
    off = (len(k0) - len(k2)) // 2
    shared = float(k0[off : len(k0) - off] @ k2)
    u = means(track.u, k0, at)
    if track.d is not None:  # measured, so as late as the motion: not at all
        u = u - means(track.d, weights(half, 0, -0.5, cell=True), at)
    return u, du, np.array([k1 @ k1, k2 @ k2, shared, k0 @ k0])

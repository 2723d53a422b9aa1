"""Which other effects explain a record as well, by inverse dynamics along the true motion.

The torque of the effect is fitted with what the declared structure may absorb and with each other
effect. What that leaves is compared with the background and with what the effect shows.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.signal import bilinear, lfilter

from .hide import absorbed
from .run import Run

Columns = tuple[str, list[np.ndarray]]
POINTS = 3000
LIKE = 0.35  # of the background, and of what the effect shows


def alike(alone: Run, name: str, every: int, quiet: tuple | None) -> frozenset[str]:
    """The names that fit as well; ``alone`` has this effect only, ``quiet`` is the background."""
    fit = Fit(alone)
    limit = LIKE * min(fit.level(quiet), rms(fit.target))
    least: dict[str, float] = {}
    for other, columns in _candidates(fit, every):
        least[other] = min(least.get(other, np.inf), fit.left(columns))
    return frozenset(n for n, left in least.items() if left < limit and n != name)


class Fit:
    """The effect's torque, the base, and the signals at some thousand instants."""

    def __init__(self, run: Run) -> None:
        self.run, self.m, s = run, run.setup.machine, run.signals
        moving = np.flatnonzero(np.abs(s["w_true"]) > self.m.vs)  # at rest it may be anything
        self.kept = moving[:: max(len(moving) // POINTS, 1)]
        names = ("theta_true", "w_true", "a_true", "u")
        self.theta, self.w, self.a, self.u = (self.cut(s[k]) for k in names)
        self.t, self.s = self.cut(run.t), np.sign(self.w)
        self.base = _basis(list(self.cut(absorbed(run)).T))
        self.target = self.free(self.cut(s["effect"]))

    def cut(self, x: np.ndarray) -> np.ndarray:
        """A signal at the instants of the fit."""
        return x[self.kept]

    def free(self, x: np.ndarray) -> np.ndarray:
        """What the base does not absorb."""
        return x - self.base @ (self.base.T @ x)

    def left(self, columns: list[np.ndarray]) -> float:
        """RMS torque that the base and ``columns`` leave of the effect."""
        basis = _basis([self.free(c) for c in columns])
        return rms(self.target - basis @ (basis.T @ self.target))

    def level(self, quiet: tuple | None) -> float:
        """RMS torque of the background and of the sensors' noise near 10 Hz, N m."""
        noise = self.m.J * self.run.setup.quantum * 0.3 * (2 * np.pi * 10) ** 2
        if quiet is None:
            return noise
        size, order, phase, swing, angle, side, warm, tau, error, often, _ = quiet
        parts = [
            self.free(size * np.sin(order * self.theta + phase)),
            self.free(swing * np.sin(self.theta + angle)),
            self.free(np.full(len(self.theta), side * self.m.Fc)),
            self.free(warm * (1 - np.exp(-self.t / tau)) * self.s * self.m.Fc),
            self.m.J * error * (often * self.w) ** 2 / 1.41,
        ]
        return float(np.sqrt(sum(rms(p) ** 2 for p in parts) + noise**2))


def _basis(columns: list[np.ndarray]) -> np.ndarray:
    """Orthonormal columns; what is almost dependent is dropped."""
    x = np.stack([c / max(rms(c), 1e-300) for c in columns], 1)
    u, s, _ = np.linalg.svd(x, full_matrices=False)
    return u[:, s > 1e-6 * s[0]]


def _candidates(f: Fit, every: int) -> Iterator[Columns]:
    """Every effect on a grid of what enters it other than linearly."""
    theta, w, s = f.theta, f.w, f.s
    yield "constant_torque", [np.ones_like(theta)]
    yield "coulomb_asymmetry", [np.ones_like(theta)]  # s times the direction
    yield "viscous_asymmetry", [np.abs(w)]
    yield "quadratic_drag", [w * np.abs(w)]
    for rest in np.linspace(*np.quantile(theta, [0, 1]), 9):  # farther off it is a constant
        yield "return_spring", [theta - rest]
    if f.m.load[0]:
        yield "load_dependent_friction", [np.abs(np.sin(theta + f.m.load[2])) * s]
    for order in range(1, 61):
        waves = [np.sin(order * theta), np.cos(order * theta)]
        yield "gravity" if order == 1 else "torque_ripple", waves
        yield "position_dependent_friction", [s * x for x in waves]
        yield "torque_constant_ripple", [f.u * x for x in waves]
    for q in np.linspace(0.4, 0.98, 25):  # touched all the time it is a spring
        yield "hard_stop", [np.maximum(theta - np.quantile(theta, q), 0)]
        yield "hard_stop", [np.minimum(theta - np.quantile(theta, 1 - q), 0)]
    yield from _in_time(f)
    yield from _in_command(f, every)
    yield from _two_mass(f)


def _in_time(f: Fit) -> Iterator[Columns]:
    t, end = f.t, f.t[-1]
    for tau in end * np.array([0.1, 0.2, 0.35, 0.5, 0.8]):
        grown = 1 - np.exp(-t / tau)
        yield "thermal_drift", [grown * f.s, grown * f.w]
    for t0 in np.linspace(0.1, 0.9, 33) * end:
        yield "friction_step", [f.s * (t >= t0)]
        yield "inertia_step", [f.a * (t >= t0)]
    hertz = np.arange(2, 200, 0.5) / end  # two periods at least
    power = np.abs(np.exp(-2j * np.pi * hertz[:, None] * t[::3]) @ f.target[::3])
    for i in np.argsort(power)[-8:]:
        phase = 2 * np.pi * hertz[i] * t
        yield "periodic_disturbance", [np.sin(phase), np.cos(phase)]


def _in_command(f: Fit, every: int) -> Iterator[Columns]:
    u, rate = f.run.signals["u"], f.run.setup.rate
    for beyond in (1e-3, 2e-3, 3e-3, 4e-3, 5e-3, 6e-3, 8e-3, 10e-3):
        late = beyond + 0.5 * every / rate
        n, keep = int(late * rate), np.exp(-1 / (rate * late))
        yield "input_delay", [f.cut(u - np.concatenate([np.full(n, u[0]), u[:-n]]))]
        yield "actuator_lag", [f.cut(u - lfilter([1 - keep], [1, -keep], u))]
    for width in np.geomspace(0.02, 0.5, 8) * np.quantile(np.abs(u), 0.9):
        yield "actuator_dead_zone", [f.cut(np.clip(u, -width, width))]


def _two_mass(f: Fit) -> Iterator[Columns]:
    """A load behind a spring; one of the two is as the other where the gap is small."""
    own = [2 * np.pi * hz for hz in (3, 5, 8, 12, 20, 32)]
    names = ["elastic_coupling"]
    for name, at in (("elastic_coupling", 1), ("backlash", 2)):
        if name in f.run.table:
            row = f.run.table[name]
            own += [np.sqrt(row[at] / row[0]) * k for k in (0.4, 0.55, 0.7, 0.8, 0.9, 1.0, 1.1)]
            names = ["elastic_coupling", "backlash"]
    for omega in own:
        for zeta in (0.03, 0.1, 0.3):
            low = [2 * zeta * omega, omega**2], [1, 2 * zeta * omega, omega**2]
            b, a = bilinear(*low, f.run.setup.rate)
            columns = [f.cut(lfilter(b, a, f.run.signals["a_true"]))]
            yield from ((name, columns) for name in names)


def rms(x: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.square(x))))

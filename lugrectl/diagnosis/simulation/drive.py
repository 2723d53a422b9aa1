"""A model along a record: observed, simulated from the torque alone, and how likely it is.

The innovations of the right model are white, whether or not the drive was in closed loop
(prediction-error method, Ljung, System Identification, ch. 7).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Any

import numpy as np
from scipy.linalg import expm

from ...blocks.effects import held_late
from ...blocks.model import Model
from ...blocks.plant import Part as Placed
from ...blocks.plant import assemble
from ...core.deadline import check as check_time
from ...core.errors import InputError
from ...engine.runtime.batch_run import Lanes
from .records import Prepared, Run, Windows, spread

Values = Mapping[str, float]
Sets = Sequence[Values]
Array = np.ndarray
STEP = 2e-3  # s, longest integration step; the engine divides it where necessary
RESTING = 0.1  # of the largest speed: scale of the step errors of a drive at rest
DOUBLINGS = 60  # of a Riccati equation, at most
DIRECT = ((), (), (), ((1.0, 0.0), (0.0, 1.0)))
ENOUGH = 20_000  # samples of training windows, evenly spread, by which a fit is found
COARSE = np.linspace(-10.5, 3.0, 10)  # natural logarithms of factors on the usual dw/dt ...
FINE = np.array([-1.0, -0.5, 0.5, 1.0])  # ... and around the best of these
WORST = 1e30  # innovation of a model that diverges; its square can still be added up


class Drive:
    """One model structure, traced once, for any values. A delay acts on the recorded torque before
    anything else, which is the same for effects that do not change in time."""

    def __init__(self, model: Model) -> None:
        self.late = tuple(p for p in model.effects if p.block.exact is held_late)
        inside = tuple(p for p in model.effects if p not in self.late)
        self.system = assemble(replace(model, effects=inside), sensed=True).bare()
        self.lanes = Lanes(self.system, outputs=["theta_m", "w_m"])
        self.keys = [name.split(".", 1)[1] for name in self.lanes.parameters]
        place = self.lanes.states.index
        own = [(p.block, Placed(f"{p.key}.", p.block).states) for p in inside]
        begun = [both for one, names in own for both in zip(names, one.start, strict=True)]
        known = {"theta": "theta", "w": "speed", "u": "u"}  # other states begin at 0
        self.starts = {0: "theta", 1: "speed"}
        self.starts |= {place(k): known[s] for k, s in begun if s in known}
        self.sensors = [place(k) for one, names in own if "sensor" in one.acts for k in names]
        self.rests = "eps" in model.friction.block.parameters

    def series(self, run: Run, values: Values) -> np.ndarray:
        """Torque and load torque along a run, (N, 2), N m."""
        series = run.inputs.copy()
        delay = sum(values[f"{part.key}.{k}"] for part in self.late for k in part.block.own)
        for a, b in run.pieces:
            series[a:b, 0] = held_late(run.u[a:b], run.dt, delay)
        return series

    def gain(self, run: Run, values: Values, jump: float) -> tuple[np.ndarray, np.ndarray]:
        """Kalman gain of all states (x, 2) and the covariance of the innovations (2, 2); theta, w
        and the sensors' states are corrected, the others follow these."""
        K, S = observer_gain(run.dt, jump, run.noise, self._sensing(values))
        gain = np.zeros((len(self.lanes.states), 2))
        gain[[0, 1, *self.sensors]] = K
        return gain, S

    def _gains(self, run: Run, sets: Sets, jumps: Any, least: float = 0.0) -> Array:
        both = zip(sets, jumps, strict=True)
        return np.array([self.gain(run, v, max(jump, least))[0] for v, jump in both])

    def _sensing(self, values: Values) -> tuple[Any, ...]:
        """The sensors with states, linearised at rest."""
        if not self.sensors:
            return DIRECT
        params = {name: values[k] for name, k in zip(self.lanes.parameters, self.keys, strict=True)}
        rows = [self.system.output_labels.index(name) for name in self.lanes.outputs]
        u, columns = np.zeros(self.system.ninputs), []
        for x in np.eye(len(self.lanes.states))[[0, 1, *self.sensors]]:
            rates = self.system.updfcn(0.0, x, u, params)[self.sensors]
            columns.append(np.append(rates, self.system.outfcn(0.0, x, u, params)[rows]))
        M, n = np.array(columns, float).T, len(self.sensors)
        blocks = (M[:n, 2:], M[:n, :2], M[n:, 2:], M[n:, :2])
        return tuple(tuple(map(tuple, m.tolist())) for m in blocks)

    def observe(self, run: Run, sets: Sets, jumps: Any, where: Windows) -> tuple[Array, Array]:
        """One-step predictions of theta and w (S, n, length, 2), each by the samples before it, for
        S sets of values with their noise of dw/dt (rad/s2) and n windows; and the last states (S,
        n, x). In the first half of a lead the observer stays close to the measured motion."""
        gains, close = self._gains(run, sets, jumps), self._gains(run, sets, jumps, run.usual)
        y = np.empty((len(sets), len(where.start), where.length, 2))
        x = np.zeros((len(sets), len(where.start), len(self.lanes.states)))
        for lead in set(where.lead.tolist()):
            some = where.lead == lead
            start, half = where.start[some] - lead, lead // 2
            for i, signal in self.starts.items():
                x[:, some, i] = getattr(run, signal)[start]
            _, x0 = self._run(run, sets, x[:, some], start, half, close)
            rest = lead - half + where.length
            own, x[:, some] = self._run(run, sets, x0, start + half, rest, gains)
            y[:, some] = own[:, :, lead - half :]
        return y, x

    def simulate(self, values: Values, jump: float, run: Run, where: Windows) -> np.ndarray:
        """theta and w of each window from the torque alone, begun from an observer's state."""
        x = self.observe(run, [values], [jump], replace(where, length=0))[1]
        return self._run(run, [values], x, where.start, where.length, None)[0][0]

    def _run(self, run: Run, sets: Sets, x0: Array, start: Array, length: int, gains: Any) -> Any:
        check_time()
        many, n, start = len(sets), len(start), np.tile(start, len(sets))
        u = np.array([self.series(run, v) for v in sets]) if self.late else run.inputs
        floor = np.zeros(len(self.lanes.states))  # at rest the speed sets no scale of step errors
        floor[1] = RESTING * np.abs(run.speed).max() if self.rests else 0.0
        y, x = self.lanes.run(
            x0.reshape(many * n, -1), start, length, u,
            np.repeat([[v[k] for k in self.keys] for v in sets], n, axis=0), dt=run.dt,
            substeps=max(1, int(np.ceil(run.dt / STEP - 1e-9))), t0=run.t[start] - start * run.dt,
            series=np.repeat(np.arange(many) * bool(self.late), n), floor=floor,
            y=None if gains is None else run.y, rounding=(run.dull, 0.5 * run.counts),
            gain=None if gains is None else np.repeat(gains, n, axis=0),
        )  # fmt: skip
        return y.reshape(many, n, length, 2), x.reshape(many, n, -1)


@dataclass(frozen=True, eq=False)
class Fit:
    """A model with the noise of dw/dt (rad/s2) that makes its predictions most likely."""

    drive: Drive
    values: dict[str, float]
    jump: float

    def observed(self, jump: float, run: Run, where: Windows) -> np.ndarray:
        """Torque missing (N m, resisting), theta, w of an observer, (windows, length, 3)."""
        y = self.drive.observe(run, [self.values], [jump], where)[0][0]
        K = self.drive.gain(run, self.values, jump)[0][1]
        missing = -self.values["J"] / run.dt * innovations(run.y[where.counted], y) @ K
        return np.concatenate([missing[..., None], y], axis=-1)


def fitted(ready: Prepared, model: Model) -> Fit:
    """The model with its noise, once for each in a study. InputError where a value is missing."""
    model, memory = model.with_defaults(), ready.memory
    values = model.known()
    if missing := [k for k in model.values() if k not in values]:
        raise InputError(f"{model.name}: {', '.join(missing)} has no value to simulate with.")
    parts = (model.friction, *model.effects)
    structure = _Structure(model.motion, tuple((p.key, id(p.block)) for p in parts), model)
    drive, key = _drive(structure), (structure.parts, *values.values())
    if key not in memory:
        memory[key] = Fit(drive, values, tuned(ready, drive, values, memory.get("jump")))
        memory["jump"] = memory[key].jump
    return memory[key]


@dataclass(frozen=True)
class _Structure:
    """What is traced of a model, whatever its values are; the model keeps its blocks alive."""

    motion: str
    parts: tuple[tuple[str, int], ...]
    model: Model = field(compare=False)


@lru_cache(maxsize=64)
def _drive(structure: _Structure) -> Drive:
    return Drive(structure.model)


def tuned(ready: Prepared, drive: Drive, values: Values, begun: float | None = None) -> float:
    """The noise of dw/dt, rad/s2, that makes training windows likeliest; climbs from ``begun``."""
    usual, few = max(run.usual for run in ready.runs), spread(ready.train, ENOUGH)

    def totals(logs: np.ndarray) -> np.ndarray:
        made = loglik(ready, drive, [values] * len(logs), usual * np.exp(logs), few)
        return np.maximum(np.nan_to_num(made.sum(axis=1), nan=-np.inf), -(WORST**3))

    best = COARSE[np.argmax(totals(COARSE)) if begun is None else _climbed(totals, begun / usual)]
    a, b, _ = np.polyfit(FINE, totals(best + FINE), 2)
    peak = np.clip(-0.5 * b / a, FINE[0], FINE[-1]) if a < 0 else 0.0
    return usual * float(np.exp(best + peak))


def _climbed(totals: Callable[[np.ndarray], np.ndarray], begun: float) -> int:
    """The place of the likeliest of COARSE, from the one next to a factor on."""
    best, at, known = int(np.argmin(np.abs(COARSE - np.log(begun)))), -1, dict[int, float]()
    while best != at:
        at = best
        near = range(max(at - 1, 0), min(at + 2, len(COARSE)))
        if new := [i for i in near if i not in known]:
            known |= zip(new, totals(COARSE[new]).tolist(), strict=True)
        best = max(near, key=lambda i: known[i])
    return best


def loglik(ready: Prepared, drive: Drive, sets: Sets, jumps: Any, of: Sequence[Windows]) -> Array:
    """Gaussian log-likelihood of each window of all runs, for each set, (sets, windows)."""
    both = zip(ready.runs, of, strict=True)
    made = [whitened(drive, run, sets, jumps, where)[1] for run, where in both if where.size]
    return np.concatenate(made, axis=1)


def whitened(
    drive: Drive, run: Run, sets: Sets, jumps: Any, where: Windows
) -> tuple[np.ndarray, np.ndarray]:
    """Innovations scaled to unit covariance for a correct model, (sets, windows, length, 2), and
    the log-likelihood of each window, (sets, windows). Samples that repeat one count weigh less:
    predicting them is no merit of a model."""
    y, _ = drive.observe(run, sets, jumps, where)
    e, size = innovations(run.y[where.counted], y), np.empty((len(sets), 2))
    weight = 1.0 - run.dull[where.counted]
    for i, (values, jump) in enumerate(zip(sets, jumps, strict=True)):
        root = np.linalg.cholesky(drive.gain(run, values, jump)[1])
        e[i] = e[i] @ np.linalg.inv(root).T * np.sqrt(weight)
        size[i] = np.diag(root)
    constant = np.log(size) @ weight.sum(axis=1).T
    return e, -0.5 * np.einsum("swnc,swnc->sw", e, e) - constant


def innovations(measured: np.ndarray, predicted: np.ndarray) -> np.ndarray:
    """Measured minus predicted: 0 where nothing was recorded, ``WORST`` if it is not a number."""
    e = np.clip(np.nan_to_num(measured - predicted, nan=WORST), -WORST, WORST)
    e[..., np.isnan(measured)] = 0.0
    return e


@lru_cache(maxsize=512)
def observer_gain(
    dt: float, jump: float, noise: tuple[float, ...], sensing: tuple[Any, ...]
) -> tuple[np.ndarray, np.ndarray]:
    """Gain (2 + n, 2) and innovation covariance (2, 2) of dtheta/dt = w, dw/dt = noise (``jump``,
    rad/s2, independent from sample to sample: that of the torque over J).

    Sensors with n states s: ds/dt = A s + B (theta, w), y = C s + D (theta, w) + noise; ``sensing``
    are A, B, C, D as nested tuples. ``noise`` is nan where nothing was recorded: there the gain is
    0 and the covariance 1. Do not write into the arrays.
    """
    n, seen = 2 + len(sensing[0]), np.flatnonzero(np.isfinite(noise))
    shapes = (n - 2, n - 2), (n - 2, 2), (2, n - 2), (2, 2)
    A, B, C, D = (np.reshape(m, shape) for m, shape in zip(sensing, shapes, strict=True))
    flow = np.zeros((n + 1, n + 1))  # the last state is the jump of dw/dt
    flow[0, 1] = flow[1, n] = 1.0
    flow[2:n, :2], flow[2:n, 2:n] = B, A
    step, H, size = expm(flow * dt), np.hstack([D, C])[seen], np.array(noise)[seen]
    kept = np.arange(0 if 0 in seen else 1, n)  # theta is unobservable if not recorded
    scale = np.full(n, noise[0] / dt if 0 in seen else noise[1])  # else it is ill-conditioned
    scale[0] *= dt
    a, push = step[:n, :n] * scale / scale[:, None], jump * step[:n, n] / scale
    P = np.zeros((n, n))
    both = kept[:, None], kept
    P[both] = _riccati(a[both], (H * scale / size[:, None])[:, kept], np.outer(push, push)[both])
    P *= np.outer(scale, scale)
    S = H @ P @ H.T + np.diag(size**2)
    gain, covariance = np.zeros((n, 2)), np.eye(2)
    gain[:, seen], covariance[seen[:, None], seen] = P @ H.T @ np.linalg.inv(S), S
    return gain, covariance


def _riccati(A: np.ndarray, H: np.ndarray, Q: np.ndarray) -> np.ndarray:
    """P = A (P^-1 + H' H)^-1 A' + Q, even if it is ill-conditioned, by the structure-preserving
    doubling of Chu, Fan and Lin (2004)."""
    a, G, P = A.T, H.T @ H, Q
    for _ in range(DOUBLINGS):
        half = np.linalg.solve(np.eye(len(A)) + G @ P, np.hstack([a, G]))
        a_half, G_half = half[:, : len(A)], half[:, len(A) :]
        more = a.T @ P @ a_half
        a, G, P = a @ a_half, G + a @ G_half @ a.T, P + more
        if np.all(np.abs(more) <= 1e-12 * np.abs(P)):
            break
    return 0.5 * (P + P.T)

"""The model run along a log with a Kalman correction: what it fails to predict, sample by sample.

The innovations of the right model are white, whatever loop the drive was in: they carry the
statistics of everything that is fitted, tested and chosen here (prediction-error method, Ljung,
System Identification, ch. 7).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..blocks.friction import EPS, coulomb
from ..blocks.plant import assemble
from ..engine.lanes import Lanes
from ..model import Model, Part
from .data import Data, Log
from .noise import Noise, observer_gain

LEVELS = ("J", "Fc", "Fs", "Fv")
STEP = 1e-3  # s, longest integration step; the engine divides it where it must

Values = Mapping[str, float]


@dataclass(frozen=True)
class Windows:
    """Stretches of equal length: each starts at ``start``, counts after ``burn`` samples."""

    start: np.ndarray
    burn: int
    length: int

    @property
    def counted(self) -> np.ndarray:
        """Sample indices that count, (windows, length)."""
        return self.start[:, None] + self.burn + np.arange(self.length)


def windows(blocks: Sequence[tuple[int, int]], burn: int, length: int) -> Windows:
    """Cut blocks into windows; the burn-in lies inside the block, so that blocks share nothing."""
    starts: list[int] = []
    for a, b in blocks:
        starts += range(a, b - burn - length + 1, length)
    return Windows(np.array(starts, dtype=int), burn, length)


class Predictor:
    """A model's structure on some data: series, innovations and simulations for any values.

    The first ``inside`` effects are part of the traced plant. The others, and all that act on
    the input, are evaluated along the log and fed in as series, so that a candidate needs no
    new engine.
    """

    def __init__(self, model: Model, data: Data, inside: int | None = None) -> None:
        count = len(model.effects) if inside is None else inside
        traced = [p for p in model.effects[:count] if p.block.acts != ("input",)]
        self.model, self.data = model, data
        self.inside = frozenset(p.key for p in traced)
        self.levels = tuple(n for n in LEVELS if n == "J" or n in model.friction.values)
        core = replace(model, effects=tuple(traced))
        block = assemble(core, levels=self.levels)
        self.lanes = Lanes(block.system(**core.known()), outputs=["theta", "w"])  # pyright: ignore[reportArgumentType]
        self.keys = [name.split(".", 1)[1] for name in self.lanes.parameters]
        self.substeps = max(1, int(np.ceil(data.dt / STEP - 1e-9)))

    def like(self, model: Model) -> Predictor:
        """The same traced plant with other effects outside of it."""
        other = copy(self)
        other.model = model
        return other

    def on(self, data: Data) -> Predictor:
        """The same plant on other data."""
        other = copy(self)
        other.data = data
        return other

    @property
    def outside(self) -> tuple[Part, ...]:
        """The effects that are fed in as series."""
        return tuple(p for p in self.model.effects if p.key not in self.inside)

    def series(self, values: Values) -> np.ndarray:
        """Inputs of the plant along the log, (N, 2 + levels): torque, load, relative levels."""
        data = self.data
        u, d = data.u, np.zeros(len(data.u))
        x = {name: np.zeros(len(u)) for name in self.levels}
        for part in self.outside:
            own = {k: values[f"{part.key}.{k}"] for k in part.values}
            if part.block.acts == ("input",):
                u = held(part, u, data.dt, own)
            elif part.block.acts == ("torque",):
                d = d + along(part.block, data.log, own)
            else:
                change = along(part.block, data.log, own)
                for name in part.block.acts:
                    if name in x:
                        x[name] = (1.0 + x[name]) * (1.0 + change) - 1.0
        return np.column_stack([u, d, *x.values()])

    def torque(self, values: Values) -> np.ndarray:
        """What drives the plant along the log with all its effects, as one torque (N,).

        An effect on a level counts by the torque that it takes off.
        """
        log, every = self.data.log, copy(self)
        every.inside = frozenset()
        u, d, *x = every.series(values).T
        parts = {
            "J": values["J"] * log.a,
            "Fv": values.get("Fv", 0.0) * log.w,
            "Fc": self.friction(values) - values.get("Fv", 0.0) * log.w,
        }
        resisting = [parts[n] * xn for n, xn in zip(self.levels, x, strict=True) if n in parts]
        return u - d - np.sum(resisting, axis=0)

    def friction(self, values: Values) -> np.ndarray:
        """The friction law's steady torque along the log, without effects (N,)."""
        level, viscous = values.get("Fc", 0.0), values.get("Fv", 0.0)
        return coulomb(self.data.log.w, Fc=level, Fv=viscous, eps=EPS.value)[0]

    def run(
        self,
        values: Sequence[Values],
        where: Windows,
        noise: Noise | Sequence[Noise],
        *,
        corrected: bool = True,
        x0: np.ndarray | None = None,
    ) -> tuple[np.ndarray, np.ndarray]:
        """Predicted theta, w over the counted samples of each window, for each set of values.

        ``noise`` may differ from set to set; without ``corrected`` the run is free.

        Returns
        -------
        y : (sets, windows, length, 2) array
        x : (sets, windows, states) array
            States after the last sample.
        """
        sets, n = len(values), len(where.start)
        series, index = self._distinct(values)
        p = np.array([[v[k] for k in self.keys] for v in values])
        start = np.tile(where.start, sets)
        if x0 is None:
            x0 = np.concatenate([self.initial(v, where.start) for v in values])
        noises = [noise] * sets if isinstance(noise, Noise) else noise
        gains = [self.gain(q) for q in noises]
        y, x = self.lanes.run(
            x0,
            start,
            where.burn + where.length,
            series,
            np.repeat(p, n, axis=0),
            dt=self.data.dt,
            substeps=self.substeps,
            t0=float(self.data.t[0]),
            series=np.repeat(index, n),
            y=self.data.y if corrected else None,
            gain=np.repeat(np.array(gains), n, axis=0) if corrected else None,
        )
        y = y[:, where.burn :].reshape(sets, n, where.length, 2)
        return y, x.reshape(sets, n, -1)

    def _distinct(self, values: Sequence[Values]) -> tuple[np.ndarray, np.ndarray]:
        """One set of series for each distinct setting of the outside effects."""
        known: dict[tuple[float, ...], int] = {}
        made, index = [], []
        for v in values:
            key = tuple(v[f"{part.key}.{k}"] for part in self.outside for k in part.values)
            if key not in known:
                known[key] = len(made)
                made.append(self.series(v))
            index.append(known[key])
        return np.array(made), np.array(index)

    def gain(self, noise: Noise) -> np.ndarray:
        """Kalman gain to all states; those beyond theta and w follow through them."""
        gain = np.zeros((len(self.lanes.states), len(self.lanes.outputs)))
        gain[:2, :2], _ = observer_gain(self.data.dt, noise)
        return gain

    def initial(self, values: Values, start: np.ndarray) -> np.ndarray:
        """States at the start of each window: smoothed motion, z from the torque balance."""
        log, dt = self.data.log, self.data.dt
        x0 = np.zeros((len(start), len(self.lanes.states)))
        x0[:, 0] = log.theta[start] - 0.5 * dt * log.w[start]
        x0[:, 1] = log.w[start] - 0.5 * dt * log.a[start]
        if "z" in self.lanes.states:
            x0[:, self.lanes.states.index("z")] = self._deflection(values, start)
        return x0

    def _deflection(self, values: Values, start: np.ndarray) -> np.ndarray:
        log = self.data.log
        F = log.u[start] - values["J"] * log.a[start] - values["Fv"] * log.w[start]
        for part in self.model.effects:
            if part.block.acts == ("torque",) and not part.block.states:
                own = {k: values[f"{part.key}.{k}"] for k in part.values}
                F = F - along(part.block, log, own)[start]
        limit = max(values["Fs"], values["Fc"])
        return np.clip(F, -limit, limit) / max(values["sigma0"], 1e-12)


def along(block: Any, log: Log, values: Values) -> np.ndarray:
    """A stateless effect evaluated along a log."""
    names = (["t"] if block.timed else []) + list(block.inputs)
    return np.asarray(block(*[getattr(log, name) for name in names], **values)[0])


def held(part: Part, u: np.ndarray, dt: float, values: Values) -> np.ndarray:
    """An input effect applied to a held torque."""
    if part.block.exact is not None:
        return part.block.exact(u, dt, **values)
    return np.asarray(part.block(u, **values)[0])

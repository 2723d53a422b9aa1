"""One-step-ahead predictor: the model run along a log with a Kalman correction; its innovations.

The innovations of the right model are white, whether or not the drive was in closed loop. All that
is fitted, tested and chosen here uses their statistics (prediction-error method, Ljung, System
Identification, ch. 7).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np

from ...blocks.block import P
from ...blocks.embedding import Part as Placed
from ...blocks.friction import EPS, stribeck
from ...blocks.law_forms import formed
from ...blocks.model import Model, Part
from ...blocks.multi_element_laws import MaxwellSlip
from ...blocks.plant import assemble, stage
from ...core.deadline import check as check_time
from ...engine.runtime.batch_run import Lanes
from ..dataset.dataset import Data, picked
from ..dataset.kalman import Noise, Sensing, observer_gain
from ..dataset.run_effects import PHASE, differences, displaced, repeating
from ..dataset.windows import Windows
from .effect_inputs import UNDOING, Fed, Memory, Values, depends_on_plant, feed, run_alone, run_as

LEVELS = ("J", "Fc", "Fs", "Fv")
STEP = 2e-3  # s, longest integration step; the engine divides it where necessary
RUNS = 8  # along the log that are kept: a fit asks again for the last few
BRISTLE = {"sigma0", "Fc"}  # what a law has whose z is the deflection of bristles
RESTING = 0.1  # of the largest speed: scale of the step errors of a drive at rest


class Predictor:
    """A model structure on some data: input series, innovations, simulations for any values.

    Effects that act only on the command are evaluated along the log and fed in as series, in the
    model's order. The others are part of the traced plant.
    """

    def __init__(self, model: Model, data: Data) -> None:
        traced = [p for p in model.effects if stage(p.block) != "command"]
        self.model, self.data = model, data
        self.inside = frozenset(p.key for p in traced)
        self.levels = tuple(n for n in LEVELS if n == "J" or n in model.friction.values)
        self.core = replace(model, effects=tuple(traced))
        self.substeps = max(1, int(np.ceil(data.dt / STEP - 1e-9)))
        self._runs: Memory = {}

    @cached_property
    def lanes(self) -> Lanes:
        """The plant as the engine runs it; a torque along the log needs none."""
        block = assemble(self.core, levels=("torque", *self.levels), sensed=True)
        values: dict[str, Any] = self.core.known()
        return Lanes(block.bare(**values), outputs=["theta_m", "w_m"])

    @cached_property
    def keys(self) -> list[str]:
        """The plant's parameters, in the order of the engine."""
        return [name.split(".", 1)[1] for name in self.lanes.parameters]

    def like(self, model: Model) -> Predictor:
        """The same traced plant with a model that states other bounds."""
        other = copy(self)
        other.model = model
        return other

    def on(self, data: Data) -> Predictor:
        """The same plant on other data."""
        other = copy(self)
        other.data, other._runs = data, {}
        return other

    def declarations(self) -> dict[str, P]:
        """Declarations of the model's parameters and of those that differ from run to run."""
        own = differences(self.data)
        if not repeating(self.model):
            own = {k: p for k, p in own.items() if p is not PHASE}
        return self.model.declarations() | own

    @property
    def floor(self) -> np.ndarray:
        """Least size of the states to which the errors of the integration steps are compared.

        At rest under static friction the speed sets no scale itself, and every correction of it
        decays at once.
        """
        if "eps" not in self.model.friction.values:
            return np.zeros(len(self.lanes.states))
        speed = RESTING * self.data.log.fastest
        return np.where(np.array(self.lanes.states) == "w", speed, 0.0)

    @property
    def outside(self) -> tuple[Part, ...]:
        """The effects that are fed in as series."""
        return tuple(p for p in self.model.effects if p.key not in self.inside)

    def fed(self, values: Values, memory: Memory | None = None) -> Fed:
        """The series that the effects outside the plant feed into it along the log."""
        outside = {p.key for p in self.outside}
        return feed(self.model, outside, values, self.data, self.levels, memory)

    def torque(self, values: Values) -> np.ndarray:
        """Net torque on the plant along the log with all its effects (N,).

        An effect on a level counts as the torque that it removes, one on a sensor as the torque
        that would look the same.
        """
        log, every = self.data.log, {p.key for p in self.model.effects}
        fed = feed(self.model, every, values, self.data, self.levels)
        plant = _leveled(values, fed)
        inertia = (plant["J"] - values["J"]) * log.a
        apparent = 0.0
        if fed.error is not None:
            apparent = values["J"] * np.gradient(fed.error[:, 1], log.dt)
        return fed.u - fed.load - fed.torque - inertia - self.friction(plant) + apparent

    def friction(self, values: Mapping[str, Any]) -> np.ndarray:
        """The friction law's steady torque along the log, without effects (N,)."""
        level, viscous = values.get("Fc", 0.0), values.get("Fv", 0.0)
        stiction, vs = values.get("Fs", level), values.get("vs", 1.0)
        w, eps = self.data.log.w, values.get("eps", EPS.value)
        law, own = formed(stribeck, {k: values[k] for k in ("delta",) if k in values}, "friction")
        return law(w, Fc=level, Fs=stiction, Fv=viscous, vs=vs, eps=eps, **own)[0]

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

        They are sensor outputs, including effects on the sensors. ``noise`` may differ from set to
        set. Without ``corrected`` it is a simulation without Kalman correction.

        Returns
        -------
        y : (sets, windows, length, 2) array
        x : (sets, windows, states) array
            States after the last sample.
        """
        check_time()
        sets, n = len(values), len(where.start)
        series, errors, index = self.distinct(values)
        p = np.array([[v[k] for k in self.keys] for v in values])
        start = np.tile(where.start, sets)
        if x0 is None:
            x0 = self.initial(values, where).reshape(len(start), -1)
        noises = [noise] * sets if isinstance(noise, Noise) else noise
        gains = [self.filter(q, v)[0] for q, v in zip(noises, values, strict=True)]
        sensed = any(e is not None for e in errors)
        seen = [self.data.y if e is None else self.data.y - e for e in errors if sensed]
        y, x = self.lanes.run(
            x0,
            start,
            where.burn + where.length,
            series,
            np.repeat(p, n, axis=0),
            dt=self.data.dt,
            substeps=self.substeps,
            t0=self.data.t[start] - start * self.data.dt,
            series=np.repeat(index, n),
            y=(np.array(seen) if sensed else self.data.y) if corrected else None,
            seen=np.repeat(index, n) if sensed and corrected else None,
            gain=np.repeat(np.array(gains), n, axis=0) if corrected else None,
            rounding=self.data.rounding if corrected else None,
            floor=self.floor,
        )
        y = y[:, where.burn :].reshape(sets, n, where.length, 2)
        if sensed:
            y = y + np.array([_at(errors[i], where) for i in index])
        return y, x.reshape(sets, n, -1)

    def distinct(
        self, values: Sequence[Values]
    ) -> tuple[np.ndarray, list[np.ndarray | None], np.ndarray]:
        """Series and sensor errors for each distinct setting of the outside effects."""
        outside, known = self.outside, {}
        borrowing = any(depends_on_plant(p) for p in outside)
        own = [f"{p.key}.{k}" for p in outside for k in p.block.own]
        names = [*(self.model.values() if borrowing else own), *differences(self.data)]
        different: list[Values] = []
        index = []
        for v in values:
            key = tuple(v[name] for name in names)
            if key not in known:
                known[key] = len(different)
                different.append(v)
            index.append(known[key])
        memory = self._ran(outside, different)
        fed = [self.fed(v, memory) for v in different]
        series = [np.column_stack([f.u, f.load, f.torque, *f.levels.values()]) for f in fed]
        return np.array(series), [f.error for f in fed], np.array(index)

    def _ran(self, parts: Sequence[Part], values: Sequence[Values]) -> Memory:
        """Outputs and states of effects with states along the log, all sets at once."""
        memory: Memory = {}
        log = self.data.log
        for part in parts:
            if not part.block.states or part.block.exact is not None:
                continue
            sets = {run_as(part, v): v for v in values}
            new = [key for key in sets if key not in self._runs]
            memory |= {key: self._runs[key] for key in sets if key not in new}
            if new:
                own = [Placed(f"{part.key}.", part.block).arguments(sets[key]) for key in new]
                made = run_alone(part.block, log, log.signals, own)
                memory |= dict(zip(new, made, strict=True))
        runs = self._runs | memory
        self._runs = {key: runs[key] for key in [*runs][-RUNS:]}
        return memory

    def filter(self, noise: Noise, values: Values) -> tuple[np.ndarray, np.ndarray]:
        """Kalman gain for all states, and the covariance of the innovations.

        Only theta, w and the sensors' states are corrected; the other states follow these.
        """
        names, sensing = self._sensing(values)
        K, S = observer_gain(self.data.dt, noise, sensing)
        gain = np.zeros((len(self.lanes.states), len(self.lanes.outputs)))
        for row, name in zip(K, ("theta", "w", *names), strict=True):
            gain[self.lanes.states.index(name)] = row
        return gain, S

    def _sensing(self, values: Values) -> tuple[tuple[str, ...], Sensing | None]:
        """The sensors inside the plant that have states, linearised at rest."""
        parts = [
            Placed(f"{p.key}.", p.block)
            for p in self.core.effects
            if "sensor" in p.block.acts and p.block.states
        ]
        names = tuple(name for part in parts for name in part.states)
        if not names:
            return (), None
        columns = []
        for axis in ("theta", "w", *names):
            signals = dict.fromkeys(("theta", "w", *names), 0.0) | {axis: 1.0}
            out, rates = {"theta_m": signals["theta"], "w_m": signals["w"]}, []
            for part in parts:
                own = part.results(
                    signals | {"theta": out["theta_m"], "w": out["w_m"]}, dict(values)
                )
                out, rates = part.outputs(own), rates + list(part.rates(own))
            columns.append([out["theta_m"], out["w_m"], *rates])
        M = np.array(columns, dtype=float).T
        rows = [tuple(map(tuple, m.tolist())) for m in (M[2:, 2:], M[2:, :2], M[:2, 2:], M[:2, :2])]
        return names, Sensing(*rows)

    def initial(self, values: Sequence[Values], where: Windows) -> np.ndarray:
        """States (sets, starts, states) at the start of each window.

        Taken from the smoothed motion; the deflection of bristles from the torque balance, states
        of effects from their run along the log. Other states of a law start at 0.
        """
        log, dt, names, start = self.data.log, self.data.dt, self.lanes.states, where.start
        x0 = np.zeros((len(values), len(start), len(names)))
        for x, v in zip(x0, values, strict=True):
            theta, w = self._motion(v, start)
            x[:, 0], x[:, 1] = theta - 0.5 * dt * w, w - 0.5 * dt * log.a[start]
        ran = {k: made[start] for k, made in self._ran(self.core.effects, values).items()}
        for part in (p for p in self.core.effects if p.block.states):
            places = [names.index(name) for name in Placed(f"{part.key}.", part.block).states]
            for x, v in zip(x0, values, strict=True):
                x[:, places] = ran[run_as(part, v)][:, len(part.block.fresh) :]
        law = self.core.friction.block.function
        if isinstance(law, MaxwellSlip):
            first = names.index("z1")
            z = law.before(values, log.theta, log.runs, start)
            x0[..., first : first + law.elements] = z
        if "z" in names and self.model.friction.values.keys() >= BRISTLE:
            F = self._bristle_torques(values, start, ran)
            sigma0 = np.array([[max(v["sigma0"], 1e-12)] for v in values])
            x0[..., names.index("z")] = F / sigma0
        return x0

    def _motion(self, values: Values, start: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """theta and w without the sensors that are inside the plant, in mid-interval."""
        log, shift = self.data.log, displaced(self.model, self.data, values)
        theta, w = log.theta[start], log.w[start]
        theta = theta if shift is None else theta + shift[start]
        _, sensing = self._sensing(values)
        if sensing is not None and np.any(sensing.C):
            slow, fast = sensing.A[0][0], sensing.B[0][1]
            w = (log.a[start] - slow * w) / fast
        parts = [Placed(f"{p.key}.", p.block) for p in self.core.effects if _instant_sensor(p)]
        for part in reversed(parts):
            seen = theta, w
            for _ in range(UNDOING):
                out = part.outputs(part.results({"theta": theta, "w": w}, dict(values)))
                theta, w = seen[0] - (out["theta_m"] - theta), seen[1] - (out["w_m"] - w)
        return theta, w

    def _bristle_torques(
        self, values: Sequence[Values], start: np.ndarray, ran: Memory
    ) -> np.ndarray:
        """Friction at the starts (sets, starts) from the torque balance, limited to its greatest
        value there. The torque of effects with states is left out."""
        raising = [p for p in self.core.effects if p.block.states and stage(p.block) == "level"]
        instant = [p for p in self.model.effects if not p.block.states and p.block.exact is None]
        model = replace(self.model, effects=(*instant, *raising))
        keys, data = {p.key for p in model.effects}, picked(self.data, start)
        made, memory = [], dict(ran)
        for v in values:
            fed = feed(model, keys, v, data, self.levels, memory)
            F = fed.u - fed.load - fed.torque - v["J"] * data.log.a
            plant = _leveled(v, fed)
            limit = np.maximum(plant.get("Fs", 0.0), plant["Fc"])
            made.append(np.clip(F - plant.get("Fv", 0.0) * data.log.w, -limit, limit))
        return np.array(made)


def _instant_sensor(part: Part) -> bool:
    return "sensor" in part.block.acts and not part.block.states


def _leveled(values: Values, fed: Fed) -> dict[str, Any]:
    """The values, with levels as the effects change them along the log."""
    return {k: v * (1.0 + fed.levels[k]) if k in fed.levels else v for k, v in values.items()}


def _at(error: np.ndarray | None, where: Windows) -> np.ndarray:
    return np.zeros((*where.counted.shape, 2)) if error is None else error[where.counted]

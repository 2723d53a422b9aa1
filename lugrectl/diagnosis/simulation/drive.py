"""A model as the engine runs it along a record: observed, and simulated from the torque alone."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from ...blocks.embedding import Part as Placed
from ...blocks.model import Model, Part
from ...blocks.plant import assemble, stage
from ...core.deadline import check as check_time
from ...engine.runtime.batch_run import Lanes
from .observer import Rows, observer_gain
from .runs import Run, Windows

Values = Mapping[str, float]
LEAD = 1.0  # s, at most, that an observer runs before its states count
STEP = 2e-3  # s, longest integration step; the engine divides it where necessary
RESTING = 0.1  # of the largest speed: scale of the step errors of a drive at rest
WORST = 1e100  # error of a model that diverges; its square can still be added up
NO_SENSOR: tuple[Rows, Rows, Rows, Rows] = ((), (), (), ((1.0, 0.0), (0.0, 1.0)))


class Drive:
    """One model structure, traced once, for any values of its parameters.

    Effects on the command without a state, and those with an exact form along a log, act on the
    recorded torque; from the first other one on, all are inside the traced plant.

    Parameters
    ----------
    model : Model
        Its values are not used.
    """

    def __init__(self, model: Model) -> None:
        command = [p for p in model.effects if stage(p.block) == "command"]
        stop = [p for p in command if p.block.states and p.block.exact is None]
        self.before = tuple(command[: command.index(stop[0]) if stop else len(command)])
        inside = tuple(p for p in model.effects if p not in self.before)
        self.parts = (Part("", model.friction.block, {}), *inside)
        block = assemble(replace(model, effects=inside), sensed=True)
        self.system = block.bare()
        self.lanes = Lanes(self.system, outputs=["theta_m", "w_m"])
        self.states = self.lanes.states
        self.keys = [name.split(".", 1)[1] for name in self.lanes.parameters]
        self.smooth = "eps" not in model.friction.block.parameters
        names = [_names(p) for p in inside if "sensor" in p.block.acts and p.block.states]
        self.sensors = [self.states.index(name) for each in names for name in each]

    def series(self, run: Run, values: Values) -> np.ndarray:
        """Torque and load torque along a run, (N, 2), N m."""
        u = run.u
        for part in self.before:
            own = {k: values[f"{part.key}.{k}"] for k in part.block.own}
            for a, b in run.pieces:
                u = u.copy() if u is run.u else u
                if part.block.exact is not None:
                    u[a:b] = part.block.exact(u[a:b], run.dt, **own)
                else:
                    signals = {"t": run.t[a:b], "u": u[a:b]}
                    u[a:b] = part.block(*(signals[k] for k in part.block.reads), **own)[0]
        return np.column_stack([u, run.d])

    def gain(self, run: Run, values: Values, jump: float) -> tuple[np.ndarray, np.ndarray]:
        """Kalman gain of all states (n, 2) and the covariance of the innovations (2, 2).

        theta, w and the sensors' states are corrected; the other states follow these.
        """
        K, S = observer_gain(run.dt, jump, run.noise, self._sensing(values))
        gain = np.zeros((len(self.states), 2))
        gain[[0, 1, *self.sensors]] = K
        return gain, S

    def _sensing(self, values: Values) -> tuple[Rows, Rows, Rows, Rows]:
        """The sensors with states, linearised at rest."""
        if not self.sensors:
            return NO_SENSOR
        params = dict(zip(self.lanes.parameters, self._row(values), strict=True))
        given, columns = np.zeros(len(self.system.input_labels)), []
        outputs = [self.system.output_labels.index(name) for name in self.lanes.outputs]
        for k in (0, 1, *self.sensors):
            x = np.zeros(len(self.states))
            x[k] = 1.0
            rates = self.system.updfcn(0.0, x, given, params)[self.sensors]
            out = self.system.outfcn(0.0, x, given, params)[outputs]
            columns.append(np.concatenate([rates, out]).astype(float))
        M, n = np.array(columns).T, len(self.sensors)
        A, B, C, D = M[:n, 2:], M[:n, :2], M[n:, 2:], M[n:, :2]
        a, b, c, d = (tuple(map(tuple, m.tolist())) for m in (A, B, C, D))
        return a, b, c, d

    def _row(self, values: Values) -> list[float]:
        return [values[k] for k in self.keys]

    def observe(
        self, run: Run, sets: Sequence[Values], jumps: Sequence[float], where: Windows
    ) -> tuple[np.ndarray, np.ndarray]:
        """One-step predictions of theta and w, by samples up to the one before.

        Parameters
        ----------
        sets, jumps : sequence of S values
            Parameters, and the noise of dw/dt for each.
        where : Windows
            The n windows to predict; before each the observer runs for up to ``LEAD``.

        Returns
        -------
        y : (S, n, length, 2) array
        x : (S, n, states) array
            States after the last sample.
        """
        gains = np.array([self.gain(run, v, q)[0] for v, q in zip(sets, jumps, strict=True)])
        y = np.empty((len(sets), len(where.start), where.length, 2))
        x = np.empty((len(sets), len(where.start), len(self.states)))
        leads = run.lead(where.start, run.samples(LEAD))
        for lead in set(leads.tolist()):
            some = leads == lead
            start, length = where.start[some] - lead, lead + where.length
            x0 = np.tile(self._start(run, start), (len(sets), 1))
            own, end = self._run(run, sets, x0, start, length, gains)
            y[:, some] = own[:, :, lead:]
            x[:, some] = end
        return y, x

    def simulate(self, run: Run, values: Values, jump: float, where: Windows) -> np.ndarray:
        """theta and w of each window from the torque alone, (n, length, 2).

        The state at its start is that of the observer, by samples before it only.
        """
        lead = run.lead(where.start, run.samples(LEAD))
        x = np.empty((len(where.start), len(self.states)))
        for size in set(lead.tolist()):
            some = lead == size
            _, end = self.observe(run, [values], [jump], Windows(where.start[some] - size, size))
            x[some] = end[0]
        return self._run(run, [values], x, where.start, where.length, None)[0][0]

    def _run(
        self,
        run: Run,
        sets: Sequence[Values],
        x0: np.ndarray,
        start: np.ndarray,
        length: int,
        gains: np.ndarray | None,
    ) -> tuple[np.ndarray, np.ndarray]:
        check_time()
        many, n = len(sets), len(start)
        series = [self.series(run, v) for v in (sets if self.before else sets[:1])]
        which = np.repeat(np.arange(many) if self.before else np.zeros(many, int), n)
        every = np.tile(start, many)
        y, x = self.lanes.run(
            x0, every, length, np.array(series),
            np.repeat([self._row(v) for v in sets], n, axis=0),
            dt=run.dt,
            substeps=max(1, int(np.ceil(run.dt / STEP - 1e-9))),
            t0=run.t[every] - every * run.dt,
            series=which,
            y=None if gains is None else run.y,
            gain=None if gains is None else np.repeat(gains, n, axis=0),
            floor=self._floor(run),
        )  # fmt: skip
        return y.reshape(many, n, length, 2), x.reshape(many, n, -1)

    def _floor(self, run: Run) -> np.ndarray:
        """Least size of the states to which errors of steps are compared: at rest under static
        friction the speed sets no scale itself."""
        floor = np.zeros(len(self.states))
        floor[1] = 0.0 if self.smooth else RESTING * np.abs(run.speed()).max()
        return floor

    def _start(self, run: Run, start: np.ndarray) -> np.ndarray:
        """States where an observer begins: the measured motion, others settled or 0, (n, x)."""
        signals = {"theta": run.theta[start], "w": run.speed()[start], "u": run.u[start], "0": 0.0}
        x = np.zeros((len(start), len(self.states)))
        x[:, 0], x[:, 1] = signals["theta"], signals["w"]
        for part in self.parts:
            for name, signal in zip(_names(part), part.block.start, strict=False):
                x[:, self.states.index(name)] = signals.get(signal, 0.0)
        return x


def _names(part: Part) -> tuple[str, ...]:
    return Placed(f"{part.key}." if part.key else "", part.block).states

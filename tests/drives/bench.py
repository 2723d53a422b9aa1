"""An axis that sticks, for bench tests: what is applied answers to what it does."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from .machines import GRAVITY_LOAD, MACHINES, NO_LOAD, Machine
from .run import Program, programmed

Torque = Callable[[int, float, float], float]
Log = dict[str, np.ndarray]


def sticking(**values: float) -> Machine:
    """A machine with static friction and these parameters."""
    return replace(MACHINES["servo"], static=True, **values)  # type: ignore[arg-type]


@dataclass(frozen=True)
class Drive:
    """An axis; its torque is a function of the row, the counted angle and the speed."""

    J: float = 0.003
    Fc: float = 0.15
    Fs: float = 0.2
    vs: float = 0.1
    Fv: float = 0.01
    gravity: float = 0.0
    cogging: float = 0.0
    harmonic: int = 7
    counts: int = 16384
    dt: float = 2e-3

    def run(self, torque: Torque, rows: int, x: float = 0.0, v: float = 0.0) -> Log:
        """A log of so many rows with t, u, theta and w; ``w`` is true, ``theta`` is counted."""
        load = (GRAVITY_LOAD if self.gravity else NO_LOAD, self.gravity, 0.0)
        m = sticking(J=self.J, Fc=self.Fc, Fs=self.Fs, vs=self.vs, Fv=self.Fv)
        table = {"torque_ripple": (self.cogging, self.harmonic, 0.0)}

        def program() -> Program:
            theta, w = x, v
            for k in range(rows):
                theta, w = yield torque(k, counted(theta, self.counts), w)

        motion = programmed(replace(m, load=load), program(), self.dt, (x, v), table)
        log = dict(zip(("u", "theta", "w"), motion, strict=True))
        log["theta"] = counted(log["theta"], self.counts)
        return {"t": np.arange(rows) * self.dt, **log}


def counted(theta, counts: int):
    """The angle as an encoder counts it."""
    return np.floor(theta / (2 * np.pi) * counts) * 2 * np.pi / counts


def kept(log: Log, *channels: str) -> Log:
    return {k: log[k] for k in ("t", "u", *channels)}


def stale(log: Log) -> np.ndarray:
    """The speed as counts over the time since the last edge, which keeps its value without one."""
    theta, dt = log["theta"], log["t"][1]
    edges = np.flatnonzero(np.diff(theta)) + 1
    values = np.diff(theta[np.r_[0, edges]]) / (np.diff(np.r_[0, edges]) * dt)
    last = np.searchsorted(edges, np.arange(len(theta)), side="right") - 1
    return np.where(last < 0, 0.0, values[np.maximum(last, 0)]) if len(edges) else 0 * theta


def held(levels: list[float], rows: int) -> Torque:
    """Levels of the torque, each for so many rows, again and again."""
    return lambda k, theta, w: levels[k // rows % len(levels)]


def speed_loop(reference: np.ndarray, J: float, pole: float = 60.0, dt: float = 2e-3) -> Torque:
    """A PI loop that follows a speed."""
    integral = [0.0]

    def torque(k: int, theta: float, w: float) -> float:
        off = reference[k] - w
        integral[0] += J * pole**2 * off * dt
        return 2 * J * pole * off + integral[0]

    return torque


def ramps(rate: float, travel: float, pause: int, dt: float) -> Torque:
    """The torque rises until the axis has moved so far, is 0 for a while, then rises back."""
    now = {"row": 0, "from": 0.0, "side": 1.0, "off": False}

    def torque(k: int, theta: float, w: float) -> float:
        if not now["off"] and abs(theta - now["from"]) > travel:
            now.update(off=True, row=k)
        if now["off"] and k - now["row"] > pause:
            now.update({"off": False, "row": k, "from": theta, "side": -now["side"]})
        return 0.0 if now["off"] else now["side"] * rate * (k - now["row"]) * dt

    return torque

"""The motions along which signatures are drawn, and the drive's own torque along them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache, cached_property
from typing import Any

import numpy as np

import lugrectl as lg
from lugrectl.blocks.block import members

DRIVE = lg.table1()
LEVELS = ("Fc", "Fs", "Fv")
LATE = 0.02  # s by which the measured motion follows the reference


@dataclass(frozen=True)
class Motion:
    """A motion of the drive: times, position, speed, acceleration; ``words`` for a caption."""

    words: str
    t: np.ndarray
    theta: np.ndarray
    w: np.ndarray
    a: np.ndarray

    @cached_property
    def u(self) -> np.ndarray:
        """The torque that drives the motion, with LuGre friction."""
        return DRIVE.J * self.a + friction(self)

    @property
    def load(self) -> np.ndarray:
        """A declared gravity of 0.2 N m."""
        return 0.2 * np.sin(self.theta)


@cache
def motion(name: str) -> Motion:
    """ "travel": more than a turn each way; "stops": slow, with holds; "small": a few mrad;
    "turns": 0.5 rad each way, once a second."""
    if name == "travel":
        t = np.linspace(0.0, 10.0, 5001)
        words = "-3 cos(0.4 pi t) - 0.8 cos(pi t) rad"
        return _from_rest(words, t, ((3.0, 0.4 * np.pi), (0.8, np.pi)))
    if name == "turns":
        t = np.linspace(0.0, 5.0, 5001)
        return _from_rest("-0.5 cos(2 pi t) rad", t, ((0.5, 2.0 * np.pi),))
    if name == "small":
        t = np.linspace(0.0, 1.0, 4001)
        return _from_rest("-4 cos(4 pi t) mrad", t, ((4e-3, 4.0 * np.pi),))
    t = np.linspace(0.0, 8.0, 8001)
    wave = np.sin(0.5 * np.pi * t)
    w = 0.05 * np.sign(wave) * np.clip(3.0 * (np.abs(wave) - 0.5), 0.0, 1.0)
    theta = np.concatenate(([0.0], np.cumsum(0.5 * (w[1:] + w[:-1]) * np.diff(t))))
    words = "slow moves at 0.05 rad/s both ways, with holds between them"
    return Motion(words, t, theta, w, np.gradient(w, t))


def _from_rest(words: str, t: np.ndarray, parts: tuple[tuple[float, float], ...]) -> Motion:
    """Sum of -A cos(f t), which starts at rest."""
    theta = sum(-A * np.cos(f * t) for A, f in parts)
    w = sum(A * f * np.sin(f * t) for A, f in parts)
    a = sum(A * f**2 * np.cos(f * t) for A, f in parts)
    return Motion(f"theta = {words}", t, np.asarray(theta), np.asarray(w), np.asarray(a))


@cache
def _law(name: str) -> Any:
    """A law whose levels are inputs after its own."""
    made = members("friction")[name]
    own, names = len(made.inputs) + made.timed, [k for k in LEVELS if k in made.parameters]
    rest = {k: p for k, p in made.parameters.items() if k not in names}

    def function(*signals: Any, **values: Any) -> tuple[Any, ...]:
        levels = dict(zip(names, signals[own:], strict=False))
        return made(*signals[:own], *signals[own + len(names) :], **values, **levels)

    inputs = (*made.inputs, *names)
    return replace(made, function=function, inputs=inputs, parameters=rest).system()


def friction(m: Motion, w: np.ndarray | None = None, law: str = "lugre", **levels) -> np.ndarray:
    """Friction torque along a motion; ``levels``: Fc, Fs, Fv as they change with time."""
    system = _law(law)
    given = {k: levels.get(k, getattr(DRIVE, k)) for k in LEVELS if k in system.input_labels}
    inputs = {"w": m.w if w is None else w} | {k: v + 0.0 * m.t for k, v in given.items()}
    return np.asarray(lg.simulate(system, m.t, inputs).outputs["F"]).ravel()


def tracking(m: Motion) -> dict[str, np.ndarray]:
    """What a controller may read: a reference along the motion, followed 20 ms late."""
    late = {k: np.interp(m.t - LATE, m.t, getattr(m, k)) for k in ("theta", "w")}
    s = (late["w"] - m.w) + 20.0 * (late["theta"] - m.theta)
    ar = m.a - 20.0 * (late["w"] - m.w)
    braking = m.u - DRIVE.J * m.a
    return {
        "r": m.theta, "dr": m.w, "ddr": m.a, "a": m.a, "r_cmd": m.theta,
        "y": late["theta"], **late, "e": late["theta"] - m.theta,
        "s": s, "ar": ar, "u": m.u, "u_cmd": m.u, "Fhat": braking,
        "ahat": DRIVE.Fc + 0.0 * m.t,
        "ws": m.w, "wp": m.w, "wp_late": late["w"], "v_late": braking,
    }  # fmt: skip

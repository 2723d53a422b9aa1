"""Error systems of the proposed observer for the tests: exact steps, simulations."""

from __future__ import annotations

from functools import cache
from typing import Any

import control as ct
import numpy as np

import lugrectl as lg

from .wired import joined

KEYS = ("J", "sigma0", "sigma1", "Fc", "Fs", "Fv", "vs")


def h(p: Any, w: Any) -> Any:
    return p.Fc + (p.Fs - p.Fc) * np.exp(-((w / p.vs) ** 2))


def matrices(p: Any, a: Any, K1: Any, K2: Any) -> np.ndarray:
    """The error system at a = sigma0 |w|/h, from the printed first lines of its equations."""
    a, K1, K2 = np.broadcast_arrays(np.asarray(a, dtype=float), K1, K2)
    ez_from = np.stack([-a, -K1], axis=-1)
    ew_from = -np.stack([p.sigma0 + 0 * a, K2], axis=-1) / p.J - p.sigma1 / p.J * ez_from
    return np.stack([ez_from, ew_from], axis=-2)


def propagator(M: np.ndarray, tau: Any) -> np.ndarray:
    """exp(M tau) of 2 x 2 matrices, elementwise over the leading axes."""
    tau = np.asarray(tau)[..., None, None]
    mean = np.trace(M, axis1=-2, axis2=-1)[..., None, None] / 2
    N = M - mean * np.eye(2)
    gap = np.sqrt((N[..., 0, 0] ** 2 + N[..., 0, 1] * N[..., 1, 0]).astype(complex))
    gap = np.where(
        abs(gap) < 1e-9 * abs(mean[..., 0, 0]), 1e-9 * abs(mean[..., 0, 0]) + 1e-300, gap
    )
    gap = gap[..., None, None]
    fast, slow = np.exp((mean - gap) * tau), np.exp((mean + gap) * tau)
    return np.real((slow + fast) / 2 * np.eye(2) + (slow - fast) / (2 * gap) * N)


def errors_at(steps: np.ndarray, start: Any) -> np.ndarray:
    """(n, 2, 2): the errors before and after each of n steps, brought to size 1 before each."""
    e, path = np.asarray(start, dtype=float), []
    for step in steps:
        e = e / np.abs(e).max() if np.any(e) else np.asarray(start)  # afresh where all is gone
        path.append((e, step @ e))
        e = path[-1][1]
    return np.array(path)


@cache
def open_system(kind: str = "proposed") -> ct.InterconnectedSystem:
    """Plant and observer side by side, input u; all parameters can be set at simulation time."""
    p = lg.table1()
    made = {"proposed": lg.proposed_observer, "natural": lg.natural_observer}[kind](p)
    return beside(p, made)


def beside(p: Any, made: Any) -> ct.InterconnectedSystem:
    return joined([lg.plant(p), made], ["u", "d"], ["w", "F", "Fhat"])


def values_of(p: Any, observer: str, **gains: float) -> dict[str, float]:
    own = {f"plant.{k}": getattr(p, k) for k in KEYS}
    keys = [k for k in KEYS if k != "J" or observer.startswith("proposed")]
    return (
        own
        | {f"{observer}.{k}": getattr(p, k) for k in keys}
        | {f"{observer}.{k}": v for k, v in gains.items()}
    )


def simulated(system: Any, t: Any, u: Any, x0: Any, **options: Any) -> dict[str, np.ndarray]:
    """w, e_z, e_w (where the observer has it) and e_f of a drive beside its observer."""
    answer = lg.simulate(system, t, [u, 0 * t], x0, rtol=1e-7, **options)
    x = dict(zip(answer.state_labels, answer.states, strict=True))
    zhat = next(v for k, v in x.items() if k.endswith("zhat"))
    found = {"w": x["plant_w"], "ez": x["plant_z"] - zhat}
    found["ef"] = answer.outputs[1] - answer.outputs[2]
    for key, value in x.items():
        if key.endswith("what"):
            found["ew"] = x["plant_w"] - value
    return found

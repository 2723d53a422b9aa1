"""The error to beat: boosted trees that predict the torque the refitted model lacks.

Trained on the residual torque outside the held-out windows, as a function of position, speed,
torque, acceleration, time and their short lags; added to a simulation of the refitted model
over the held-out windows, where the trees see the simulated motion only. It names nothing.

State and residual come from the diagnosis' traces, smoothed over the restart too: that leans
towards the trees.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..drives.machines import CONSTANT_LOAD, GRAVITY_LOAD, NO_LOAD
from ..drives.plant import EFFECTS, LUGRE, STATES, TH, UA, WIDTH, WS, W, Z, advance, compiled
from ..drives.run import FINE, STIFF
from .limits import restarts, stretches

LAGS = (2e-3, 10e-3, 40e-3)  # s
HOLD = 2e-3  # s, for which a predicted torque is held at least
GAP = 0.25  # s on either side of a held-out sample that trains nothing
SAMPLES = 60_000  # most that train
LOADS = {"gravity": GRAVITY_LOAD, "constant_torque": CONSTANT_LOAD}


@compiled
def windows(x, u, extra, m, on, p, period, n):
    """Every window (rows of x) over one sample of held torque, ``extra`` resisting."""
    for i in range(len(x)):
        advance(x[i], 0.0, u[i] - extra[i], period, n, m, on, p)


def machine_row(model: dict, dt: float) -> np.ndarray:
    """The refitted model for the rig's plant; None of its effects but a load is known here."""
    f, J = dict(model["friction"]), model["plant"]["J"]
    f.setdefault("Fs", f["Fc"])
    f.setdefault("vs", 1.0)
    if "sigma0" not in f:
        f["sigma0"] = STIFF * J / FINE**2
        f["sigma1"] = float(np.sqrt(f["sigma0"] * J))
    load = (NO_LOAD, 0.0, 0.0)
    for e in model.get("effects", []):
        size = e.get("amplitude", e.get("torque", 0.0))
        load = (LOADS[e["name"]], size, e.get("phase", 0.0))
    keys = ("sigma0", "sigma1", "Fc", "Fs", "Fv", "vs")
    return np.array([J, *(f[k] for k in keys), *load, f["Fs"], 0.0, LUGRE, 2.0, 1.0])


def features(theta, w, u, a, t, lags) -> np.ndarray:
    """Columns of the trees; ``lags`` are pairs (w, u) some time ago."""
    later = [x for pair in lags for x in pair]
    return np.column_stack([theta, np.sin(theta), np.cos(theta), w, u, a, t, *later])


def _shifted(x: np.ndarray, k: int) -> np.ndarray:
    return np.concatenate([np.full(k, x[0]), x[:-k]]) if k else x


def trees_error(found: Any, refitted: dict, records: Sequence[Any]) -> dict[str, Any]:
    """RMS error over the held-out windows with the trees, and of the bare simulation."""
    traces, dt = found.traces, records[0].dt
    if traces is None or len(records) > 1:
        return {"reason": "one run only"}
    s = traces.signals
    lags = [max(1, round(lag / dt)) for lag in LAGS]
    past = [(_shifted(s["w"], k), _shifted(s["u"], k)) for k in lags]
    X = features(s["theta"], s["w"], s["u"], s["a"], s["t"], past)
    tree = _trained(X, traces.residual["refitted"], traces.held_out, dt)
    t, held_out = stretches(records, found)[0]
    starts = np.searchsorted(t, restarts(t, held_out, found.error["horizon"]) - 0.5 * dt)
    span = round(found.error["horizon"] / dt)
    m = machine_row(refitted, dt)
    measured = traces.measured[starts[:, None] + np.arange(span)]
    channel = TH if found.error["signal"] == "theta" else W
    made = {}
    for name, with_trees in (("trees", tree), ("bare", None)):
        simulated = _simulate(m, s, starts, span, dt, lags, with_trees)[..., channel]
        made[name] = float(np.sqrt(np.mean((measured - simulated) ** 2)))
    return made


def _trained(X: np.ndarray, torque: np.ndarray, held_out: np.ndarray, dt: float) -> Any:
    from sklearn.ensemble import HistGradientBoostingRegressor

    gap = np.ones(2 * round(GAP / dt) + 1)
    near = np.convolve(held_out.astype(float), gap, mode="same") > 0.5
    use = np.flatnonzero(~near & np.isfinite(torque))
    use = use[:: max(1, len(use) // SAMPLES)]
    tree = HistGradientBoostingRegressor(max_iter=200, learning_rate=0.08, random_state=0)
    return tree.fit(X[use], torque[use])


def _simulate(m, s, starts, span, dt, lags, tree) -> np.ndarray:
    """States of all windows, (windows, span, STATES), restarted at their first samples."""
    x = np.zeros((len(starts), STATES))
    half = 0.5 * dt  # the traces stand in the middle of a sample
    x[:, TH] = s["theta"][starts] - half * s["w"][starts]
    x[:, W] = x[:, WS] = s["w"][starts] - half * s["a"][starts]
    balance = s["u"][starts] - m[0] * s["a"][starts] - m[5] * s["w"][starts]
    x[:, Z] = np.clip(balance, -m[3], m[3]) / m[1]
    x[:, UA] = s["u"][starts]
    on, p = np.zeros(len(EFFECTS), dtype=bool), np.zeros((len(EFFECTS), WIDTH))
    n = max(1, int(np.ceil(dt / FINE)))
    every = max(1, round(HOLD / dt))
    reach = max(lags)
    before = np.arange(-reach, 0)
    w = np.column_stack([s["w"][np.maximum(starts[:, None] + before, 0)], np.zeros((len(x), span))])
    kept, extra, a = np.zeros((len(x), span, STATES)), np.zeros(len(x)), s["a"][starts]
    for k in range(span):
        kept[:, k], w[:, reach + k] = x, x[:, W]
        at = starts + k
        if k:
            a = (w[:, reach + k] - w[:, reach + k - 1]) / dt
        if tree is not None and k % every == 0:
            past = [(w[:, reach + k - g], s["u"][np.maximum(at - g, 0)]) for g in lags]
            theta, speed = x[:, TH] + half * x[:, W], x[:, W] + half * a
            extra = tree.predict(features(theta, speed, s["u"][at], a, s["t"][at], past))
        windows(x, s["u"][at], extra, m, on, p, dt, n)
    return kept

"""Consistency of effects with auxiliary sensors: second encoder, thermometer."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..blocks.parts import Part as Placed
from ..model import Part
from ..spec import unit_for
from .fit import Fitted
from .noise import sensor_noise
from .series import run_alone

VISIBLE = 3.0  # times the noise of the encoders, from which a twist is visible
APART = 5.0  # times that noise or a count, above which the encoders differ significantly
FOLLOWS = 0.9  # share of a drift's power that the temperature explains


def contradicted(fitted: Fitted, key: str) -> bool:
    """True if a second encoder should see the twist of an effect, and does not."""
    part = fitted.predictor.model.part(key)
    seen = _between_encoders(fitted) if "twist" in part.block.states else None
    if seen is None:
        return False
    claimed = _twist(fitted, part)
    would = float(np.std(claimed)) > VISIBLE * sensor_noise(seen)
    return would and bool(np.mean((seen - claimed) ** 2) > np.mean(seen**2))


def confirmed(fitted: Fitted, key: str) -> bool:
    """True if a recorded temperature follows the drift of an effect."""
    part = fitted.predictor.model.part(key)
    return _drifts(fitted, part) and _per_degree(fitted, part) is not None


def statements(fitted: Fitted) -> Iterator[str]:
    """Sentences on how the other channels agree with the effects found."""
    unit = unit_for("rad", fitted.predictor.model.motion)
    seen, parts = _between_encoders(fitted), fitted.predictor.model.effects
    twisting = [p for p in parts if "twist" in p.block.states]
    if seen is not None and twisting:
        claimed = sum(_twist(fitted, p) for p in twisting)
        left = float(np.std(seen - claimed))
        yield (
            f"theta - theta_load varies by {np.std(seen):.3g} {unit} RMS. The model leaves "
            f"{left:.3g} {unit} of it unexplained."
        )
    elif seen is not None and float(np.std(seen)) > APART * _count(fitted, seen):
        yield (
            f"theta and theta_load differ by {np.std(seen):.3g} {unit} RMS: the shaft between "
            "them is elastic, or one encoder is mounted off centre."
        )
    yield from (_warmth(fitted, p) for p in parts if _drifts(fitted, p))


def _between_encoders(fitted: Fitted) -> np.ndarray | None:
    """theta - theta_load minus its median in each record, (N,); None if not both were recorded."""
    data = fitted.predictor.data
    if "theta_load" not in data.others or not np.isfinite(data.y[:, 0]).all():
        return None
    return _centred(data.y[:, 0] - data.others["theta_load"], data.run)


def _twist(fitted: Fitted, part: Part) -> np.ndarray:
    """The twist of an effect with such a state, driven by the measured motion, (N,)."""
    data, placed = fitted.predictor.data, Placed(f"{part.key}.", part.block)
    signals = {k: getattr(data.log, k) for k in part.block.inputs}
    made = run_alone(part.block, data.log, signals, [placed.arguments(fitted.values)])[0]
    column = len(part.block.fresh) + part.block.states.index("twist")
    return _centred(made[:, column], data.run)


def _centred(x: np.ndarray, run: np.ndarray) -> np.ndarray:
    middles = np.array([np.median(x[run == i]) for i in range(int(run.max()) + 1)])
    return x - middles[run]


def _count(fitted: Fitted, seen: np.ndarray) -> float:
    """The encoders' noise or the smallest step of theta, whichever is larger."""
    steps = np.abs(np.diff(fitted.predictor.data.y[:, 0]))
    return max(sensor_noise(seen), float(np.min(steps[steps > 0.0], initial=np.inf)))


def _drifts(fitted: Fitted, part: Part) -> bool:
    smooth = part.block.timed and not part.block.states and "time_constant" in part.block.own
    return smooth and "temperature" in fitted.predictor.data.others


def _warmth(fitted: Fitted, part: Part) -> str:
    per_degree = _per_degree(fitted, part)
    if per_degree is not None:
        return f"{part.key} follows the temperature: {100.0 * per_degree:+.2g} % per degree."
    return f"{part.key} does not follow the recorded temperature: look for another cause."


def _per_degree(fitted: Fitted, part: Part) -> float | None:
    """Change of a drift per degree of temperature; None if it does not follow it."""
    data = fitted.predictor.data
    own = {k: fitted.values[f"{part.key}.{k}"] for k in part.block.own}
    drift = np.broadcast_to(part.block(data.log.t, **own)[0], data.t.shape)
    warm = np.column_stack([np.ones(len(data.t)), data.others["temperature"]])
    line = np.linalg.lstsq(warm, drift, rcond=None)[0]
    left = np.var(drift - warm @ line)
    return float(line[1]) if left < (1.0 - FOLLOWS) * np.var(drift) else None

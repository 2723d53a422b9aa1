"""Whether an effect is proven: certain, large enough, the same all along."""

from __future__ import annotations

import numpy as np

from ..model import Model
from ..spec import P
from .fit import Fitted
from .likelihood import tune
from .predictor import Values
from .structure import colour, repeated

GATE = 20.0  # least gain in log-likelihood, also without the best window
LEAST_SHARE = 0.04  # of the residual torque's power that an effect must remove
LEAST_OF_FIRST = 0.02  # the same of the residual before any effect was added
MOST_OF_REST = 0.5  # of what is left, which matters however little of the first that was
LEAST_SIZE = 0.015  # of the RMS friction torque, below which an effect is not worth a name
LEAST_SIZE_OF_ALL = 0.004  # the same for one that explains most of what is missing
LEAST_REMOVED = 1e-3  # of friction: the residual torque gone, below which nothing was amiss
WHOLE = 0.9  # share above which the effects found explain the residual, whatever is left
MOST_OF_IT = 0.95  # of the residual's power
LEAST_TOUCHED, MOST_TOUCHED = 1e-3, 0.9  # of the samples, beyond a place
FARTHER, FADED = 10.0, 0.5  # a limit so many times farther off, and the part of the gain gone
LOUD = 0.01  # of friction: the torque per sample that is not foreseen
COLOUR = {"theta": 0.3, "w": 0.05}  # of the innovations; quantised positions are never white
CLOSE = 0.02  # relative, to a bound


def proven(base: Fitted, before: Fitted, after: Fitted, key: str) -> bool:
    """Whether an effect is certain, and large enough beside what was there and is there."""
    if not np.isfinite(after.total) or _at_its_bound(after, key) or not _passed(after, key):
        return False
    if gained(before, after) <= GATE * repeated(after.innovations):
        return False  # of the samples that tell anything new
    if after.total - _mirrored(after, key) <= GATE:
        return False
    of_it = share(before, after)
    ill = _measured_ill(before, after, key)
    gone, torque = _removed(before, after), size(after, key)
    if of_it >= MOST_OF_IT and not ill:  # a break-away is over soon, and may be all that is amiss
        worth = max(torque, gone) > LEAST_SIZE_OF_ALL
    else:
        worth = torque > LEAST_SIZE
    matters = share(base, after) - share(base, before) > LEAST_OF_FIRST or of_it > MOST_OF_REST
    removed = of_it > LEAST_SHARE and gone > LEAST_REMOVED
    return worth and (ill or (matters and removed)) and _fades(before, after, key)


def gained(before: Fitted, after: Fitted) -> float:
    """Gain in log-likelihood, without that of the best window."""
    gain = after.loglik - before.loglik
    return float(gain.sum() - max(gain.max(), 0.0))


def _measured_ill(before: Fitted, after: Fitted, key: str) -> bool:
    """Whether a sensor's effect makes most of the innovations, whatever torque that leaves."""
    gain = after.loglik.sum() - before.loglik.sum()
    sensed = "sensor" in after.predictor.model.part(key).block.acts
    return sensed and bool(gain > 0.5 * before.where.counted.size)


def _at_its_bound(fitted: Fitted, key: str) -> bool:
    """Whether an effect would be stronger than it may be: it stands for something else."""
    name, gain = strength(fitted, key)
    ends = [b for b in (gain.low, gain.high) if np.isfinite(b) and b != gain.neutral]
    return any(abs(fitted.values[name] - b) < CLOSE * abs(b) for b in ends)


def strength(fitted: Fitted, key: str) -> tuple[str, P]:
    """Name and declaration of an effect's strength."""
    block = fitted.predictor.model.part(key).block
    return f"{key}.{block.gain}", block.parameters[block.gain]


def off(model: Model, values: Values, key: str) -> dict[str, float]:
    """The values with an effect that does nothing."""
    block = model.part(key).block
    return {**values, f"{key}.{block.gain}": block.parameters[block.gain].neutral or 0.0}


def _fades(before: Fitted, after: Fitted, key: str) -> bool:
    """Whether a limit does what it does by where it is, not by being there at all.

    Bristles that nobody could see still gain something over static friction: they are simulated
    more exactly through a reversal.
    """
    name, gain = strength(after, key)
    if gain.neutral is None or np.isfinite(gain.neutral):
        return True
    farther = after.values | {name: FARTHER * after.values[name]}
    lost = after.loglik.sum() - tune(after.predictor, farther, after.where, after.noise)[1].sum()
    return bool(lost > FADED * (after.loglik.sum() - before.loglik.sum()))


def _passed(fitted: Fitted, key: str) -> bool:
    """Whether the motion was on both sides of an effect's place: a stop never left is a spring."""
    block = fitted.predictor.model.part(key).block
    if not any(p.passed for p in block.parameters.values()):
        return True
    idle = _change(fitted, key) == 0.0
    return LEAST_TOUCHED < 1.0 - np.mean(idle) < MOST_TOUCHED


def _change(fitted: Fitted, key: str) -> np.ndarray:
    """Torque that an effect makes along the log, (samples,)."""
    predictor = fitted.predictor
    return predictor.torque(fitted.values) - predictor.torque(
        off(predictor.model, fitted.values, key)
    )


def _mirrored(fitted: Fitted, key: str) -> float:
    """Log-likelihood of a late input turned round in time; -inf for any other effect.

    Noise on the recorded torque is averaged by a delay or a lag, and as much by an advance:
    only what the advance does not gain is physics.
    """
    predictor, data = fitted.predictor, fitted.predictor.data
    part = predictor.model.part(key)
    if part.block.exact is None:
        return -np.inf
    own = {k: fitted.values[f"{key}.{k}"] for k in part.values}
    ahead = part.block.exact(data.u[::-1], data.dt, **own)[::-1]
    other = predictor.on(data.with_torque(ahead))
    without = off(predictor.model, fitted.values, key)
    return float(tune(other, without, fitted.where, fitted.noise)[1].sum())


def size(fitted: Fitted, key: str) -> float:
    """RMS torque that an effect makes along the training windows, over that of friction."""
    at = fitted.where.counted.ravel()
    change = _change(fitted, key)[at]
    return float(np.std(change) + abs(np.mean(change))) / friction_size(fitted)


def friction_size(fitted: Fitted) -> float:
    """RMS friction torque along the training windows, N m; at most that of the applied torque,
    which a fit gone astray may exceed by far."""
    at, predictor = fitted.where.counted, fitted.predictor
    torques = predictor.friction(fitted.values), predictor.data.u
    return min(float(np.sqrt(np.mean(torque[at] ** 2))) for torque in torques)


def loud(fitted: Fitted) -> bool:
    """Whether the observer makes up for more torque than sensors' noise alone asks of it."""
    return fitted.torque_noise > LOUD * friction_size(fitted)


def coloured(fitted: Fitted) -> bool:
    """Whether the innovations still tell the next one. A smoothed torque colours them by itself.

    Where windows may have missed a hidden state, which colours those in which a load is met: the
    quieter half of them.
    """
    if fitted.predictor.data.smoothed:
        return False
    quiet = fitted.quiet
    if fitted.noise.uneven:
        loudness = np.argsort(np.mean(quiet**2, axis=(1, 2)))
        quiet = quiet[np.sort(loudness[: -(-len(quiet) // 2)])]
    theta, w = colour(quiet)
    return bool(theta > COLOUR["theta"] or w > COLOUR["w"])


def share(before: Fitted, after: Fitted) -> float:
    """Part of the power of the acceleration that the model does not foresee, that is gone."""
    return max(0.0, 1.0 - (after.noise.jump / before.noise.jump) ** 2)


def _removed(before: Fitted, after: Fitted) -> float:
    """The torque per sample that is no longer unforeseen, over the RMS of friction."""
    gone = before.torque_noise * np.sqrt(share(before, after))
    return float(gone / max(friction_size(before), 1e-300))


def firmness(fitted: Fitted, key: str) -> float:
    """How many half-widths of its 95 % interval an effect's strength is from none.

    The intervals go by how much the windows disagree, so noise of any colour counts.
    """
    name, gain = strength(fitted, key)
    away = gain.neutral if gain.neutral is not None and np.isfinite(gain.neutral) else 0.0
    low, high = fitted.intervals().get(name, (away, away))
    half = 0.5 * (high - low)
    return abs(fitted.values[name] - away) / half if half > 0.0 else 0.0

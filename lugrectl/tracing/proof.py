"""Hypothesis test and effect size: whether an effect is significant and large enough."""

from __future__ import annotations

import numpy as np

from ..model import Model
from ..spec import P
from .fit import Fitted
from .likelihood import tune
from .predictor import Values
from .structure import colour, repeated

GATE = 20.0  # least gain in log-likelihood, even without the best window
LEAST_SHARE = 0.04  # of the residual torque's power that an effect must remove
LEAST_OF_FIRST = 0.02  # the same of the residual before any effect was added
MOST_OF_REST = 0.5  # of the present residual, enough however small it is beside the first one
LEAST_SIZE = 0.015  # least size of an effect, as part of the RMS friction torque
LEAST_SIZE_OF_ALL = 0.004  # the same for one that explains most of what is missing
LEAST_REMOVED = 1e-3  # of friction: least removed residual torque; with less, nothing was missing
WHOLE = 0.9  # share above which the effects found count as a full explanation
MOST_OF_IT = 0.95  # of the residual's power
LEAST_TOUCHED, MOST_TOUCHED = 1e-3, 0.9  # of the samples beyond an effect's place
FARTHER, FADED = 10.0, 0.5  # factor on a limit, and the part of the gain that this must cost
LOUD = 0.01  # of friction: the unpredicted torque per sample
COLOUR = {"theta": 0.3, "w": 0.05}  # predictable part; quantised positions are never white
CLOSE = 0.02  # relative distance to a bound


def proven(base: Fitted, before: Fitted, after: Fitted, key: str) -> bool:
    """True if an effect is significant, and large enough beside the first and present residual."""
    if not np.isfinite(after.total) or _at_its_bound(after, key) or not _passed(after, key):
        return False
    if gained(before, after) <= GATE * repeated(after.innovations):
        return False  # repeated samples count once
    if after.total - _mirrored(after, key) <= GATE:
        return False
    of_it = share(before, after)
    ill = _measured_ill(before, after, key)
    gone, torque = _removed(before, after), size(after, key)
    if of_it >= MOST_OF_IT and not ill:  # a break-away is short but may be all that is missing
        worth = max(torque, gone) > LEAST_SIZE_OF_ALL
    else:
        worth = torque > LEAST_SIZE
    matters = share(base, after) - share(base, before) > LEAST_OF_FIRST or of_it > MOST_OF_REST
    removed = of_it > LEAST_SHARE and gone > LEAST_REMOVED
    return worth and (ill or (matters and removed)) and _fades(before, after, key)


def gained(before: Fitted, after: Fitted) -> float:
    """Gain in log-likelihood, without the gain of the best window."""
    gain = after.loglik - before.loglik
    return float(gain.sum() - max(gain.max(), 0.0))


def _measured_ill(before: Fitted, after: Fitted, key: str) -> bool:
    """True if a sensor effect causes most of the innovations, whatever torque that is."""
    gain = after.loglik.sum() - before.loglik.sum()
    sensed = "sensor" in after.predictor.model.part(key).block.acts
    return sensed and bool(gain > 0.5 * before.where.counted.size)


def _at_its_bound(fitted: Fitted, key: str) -> bool:
    """True if an effect's strength is at its bound: it then stands for another effect."""
    name, gain = strength(fitted, key)
    ends = [b for b in (gain.low, gain.high) if np.isfinite(b) and b != gain.neutral]
    return any(abs(fitted.values[name] - b) < CLOSE * abs(b) for b in ends)


def strength(fitted: Fitted, key: str) -> tuple[str, P]:
    """Name and declaration of an effect's strength."""
    block = fitted.predictor.model.part(key).block
    return f"{key}.{block.gain}", block.parameters[block.gain]


def off(model: Model, values: Values, key: str) -> dict[str, float]:
    """The values with one effect switched off."""
    block = model.part(key).block
    return {**values, f"{key}.{block.gain}": block.parameters[block.gain].neutral or 0.0}


def _fades(before: Fitted, after: Fitted, key: str) -> bool:
    """True if the value of a limit matters, not only that the limit exists.

    Even bristles too stiff to be seen gain something over static friction, because a reversal is
    simulated more exactly. So the gain must fall if the limit is moved far away.
    """
    name, gain = strength(after, key)
    if gain.neutral is None or np.isfinite(gain.neutral):
        return True
    farther = after.values | {name: FARTHER * after.values[name]}
    lost = after.loglik.sum() - tune(after.predictor, farther, after.where, after.noise)[1].sum()
    return bool(lost > FADED * (after.loglik.sum() - before.loglik.sum()))


def _passed(fitted: Fitted, key: str) -> bool:
    """True if the motion was on both sides of an effect's place: a stop never left is a spring."""
    block = fitted.predictor.model.part(key).block
    if not any(p.passed for p in block.parameters.values()):
        return True
    idle = _change(fitted, key) == 0.0
    return LEAST_TOUCHED < 1.0 - np.mean(idle) < MOST_TOUCHED


def _change(fitted: Fitted, key: str) -> np.ndarray:
    """Torque of an effect along the log, (samples,)."""
    predictor = fitted.predictor
    return predictor.torque(fitted.values) - predictor.torque(
        off(predictor.model, fitted.values, key)
    )


def _mirrored(fitted: Fitted, key: str) -> float:
    """Log-likelihood with a delay or lag of the input reversed in time; -inf for other effects.

    A delay or lag also low-pass filters torque noise; its time reversal filters equally. Only the
    gain beyond the time-reversed filter is evidence for a delay.
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
    """RMS torque of an effect in the training windows, relative to that of friction."""
    at = fitted.where.counted.ravel()
    change = _change(fitted, key)[at]
    return float(np.std(change) + abs(np.mean(change))) / friction_size(fitted)


def friction_size(fitted: Fitted) -> float:
    """RMS friction torque in the training windows, N m; at most the RMS of the applied torque,
    which a bad fit may exceed by far."""
    at, predictor = fitted.where.counted, fitted.predictor
    torques = predictor.friction(fitted.values), predictor.data.u
    return min(float(np.sqrt(np.mean(torque[at] ** 2))) for torque in torques)


def loud(fitted: Fitted) -> bool:
    """True if the observer supplies more torque than sensor noise alone can explain."""
    return fitted.torque_noise > LOUD * friction_size(fitted)


def coloured(fitted: Fitted) -> bool:
    """True if past innovations predict the next ones.

    Always False for a smoothed torque, as smoothing colours the innovations by itself.

    If windows may have missed a hidden state (which colours those with a contact of the load),
    only the quieter half of them counts.
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
    """Part of the unpredicted power of the acceleration that the newer model explains."""
    return max(0.0, 1.0 - (after.noise.jump / before.noise.jump) ** 2)


def _removed(before: Fitted, after: Fitted) -> float:
    """The torque per sample that the newer model explains, over the RMS of friction."""
    gone = before.torque_noise * np.sqrt(share(before, after))
    return float(gone / max(friction_size(before), 1e-300))


def firmness(fitted: Fitted, key: str) -> float:
    """Distance of an effect's strength from no effect, in half-widths of its 95 % interval.

    The intervals come from the scatter between windows, so they allow for coloured noise.
    """
    name, gain = strength(fitted, key)
    away = gain.neutral if gain.neutral is not None and np.isfinite(gain.neutral) else 0.0
    low, high = fitted.intervals().get(name, (away, away))
    half = 0.5 * (high - low)
    return abs(fitted.values[name] - away) / half if half > 0.0 else 0.0

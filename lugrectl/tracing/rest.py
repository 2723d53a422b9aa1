"""Goodness of fit: whether something significant remains beside the effects found."""

from __future__ import annotations

import numpy as np

from .evaluate import missing_torque
from .fit import Fitted
from .hanging import depends_on
from .noise import sensor_noise
from .proof import LEAST_SIZE, MOST_OF_REST, WHOLE, coloured, friction_size, share
from .repeated import filtered
from .slide import NEARLY_ALL, Sliding, hidden_in_noise, missing_function, while_sliding
from .structure import predictable, uneven

LEFT_SHARE = 0.05  # of the first residual's power that may still depend on a signal
PART = 0.3  # of the first missing torque: an inexact effect may leave as much
TAKEN = 0.25  # share below which a function is no longer part of the residual
HALF = 0.5  # of what was missing first: effects that explain less leave the rest open
SHAKEN = 0.1  # of the RMS friction torque: above, missing torque counts even without a pattern
NOISES = 3.0  # the same in times the noise of the recorded torque
STIRRED = 0.1  # share of samples unlike the previous one, from which a window shows noise
STANDING = 3.0  # standard errors of the share that signals predict


def left_over(
    base: Fitted, final: Fitted, *, found: bool, doubtful: bool, carried: bool = False
) -> tuple[bool, tuple[str, ...]]:
    """True if something significant remains, and the signals on which it depends.

    ``found``: an effect was found. ``doubtful``: the effects found are a patchwork, or explain
    much although the windows disagree on them. ``carried``: a load driven by the measured motion
    explains nearly all that is missing; windows that missed the position of the load are then no
    evidence.
    """
    least = LEAST_SIZE * friction_size(base)
    if not _is_missing(base, final, least, found):
        if carried or _little(base, final, least):
            return False, ()
        if not (doubtful or _odd(base, final, least) or depends_on(final)):
            return False, ()
    return True, signals_of_the_rest(final, base, doubtful=doubtful)


def _odd(base: Fitted, final: Fitted, least: float) -> bool:
    """True if innovations or missing torque are more than noise, as far as sensors show noise."""
    if not _stirred(final).any():
        return False
    if share(base, final) < HALF and _shaken(final):
        return True
    return _loud(final) or _standing(base, final, least) or _tinted(base, final)


def _little(base: Fitted, final: Fitted, least: float) -> bool:
    """True if less is missing than ``least``.

    If windows may have missed a hidden state, inexact values of its effect may leave more.
    """
    if final.noise.uneven:
        least = max(least, PART * _missing(base))
    return _missing(final) <= least


def _shaken(fitted: Fitted) -> bool:
    """True if so much torque is missing that it counts even without a pattern.

    It is far above the noise of the recorded torque: impacts, say, which the recent past does not
    predict.
    """
    noise = sensor_noise(fitted.predictor.data.u)
    return _missing(fitted) > max(SHAKEN * friction_size(fitted), NOISES * noise)


def _missing(fitted: Fitted) -> float:
    """RMS of the missing torque about its mean."""
    return float(
        np.std(missing_torque(fitted.predictor, fitted.values, fitted.where, fitted.noise))
    )


def _is_missing(base: Fitted, final: Fitted, least: float, found: bool) -> bool:
    """True if more than ``least`` is missing while sliding, and more than inexact effects leave.

    It may be a function of signals or of time. Time is excluded if windows may have missed a
    hidden state, as that looks like a torque at a few instants.

    The effects found may be the wrong ones. If they leave more than they explain, or more than a
    function of some signals would leave, half of ``least`` is enough.
    """
    missing, first = (
        missing_function(final, timed=not final.noise.uneven),
        missing_function(base) if found else None,
    )
    if first is not None and first.torque > 0.5 * least and first.is_better_than(final):
        return True
    missing = missing or (None if found else hidden_in_noise(final))
    if missing is None:
        return False
    before = while_sliding(base).torque if found else 0.0
    least = 0.5 * least if found and missing.torque > MOST_OF_REST * before else least
    return missing.torque > max(least, PART * before)


def signals_of_the_rest(final: Fitted, base: Fitted, *, doubtful: bool = False) -> tuple[str, ...]:
    """The signals to name where something significant remains; time if there are none.

    Use the residual of the final model, unless the accepted effects are ``doubtful``; then use
    that of the base model, except for what they have explained. The base model is also used if
    one function of signals explained its residual better than the effects do, if the effects
    explained most of a residual that was nearly all such a function, or if they explained nothing.

    The balance of the sliding drive is examined first. Position, speed, torque and acceleration
    are preferred to time, since any slow signal correlates with time. Time is preferred if all is
    missing at a few instants, or if friction or the torque constant changes with time.
    """
    missing = missing_function(base)
    if missing is not None and missing.is_better_than(final):
        return missing.signals
    left, whole = (while_sliding(f, everywhere=True) for f in (final, base))
    if left.torque > whole.torque:
        final, left = base, whole
    shown: tuple[str, ...] = ()
    mostly = left.torque < HALF * whole.torque  # most is explained by the effects
    for look in (Sliding.of_moments, Sliding.of_fading, Sliding.of_signals, Sliding.of_time):
        best, first = look(left), look(whole)
        if best and not doubtful and left.size(best) > PART * whole.torque:
            return best.signals
        other = look is Sliding.of_moments and mostly and left.comes_back()
        if first and left.share(first.signals) > TAKEN and not other:
            return first.signals
        if look is Sliding.of_signals:
            shown = depends_on(final)
            if shown and "t" not in shown:
                return shown
            if first and mostly and first.share > NEARLY_ALL:
                return first.signals
    shown = shown or depends_on(base)
    sure = None if shown else hidden_in_noise(final)
    return sure.signals if sure else shown or ("t",)


def _standing(base: Fitted, final: Fitted, least: float) -> bool:
    """True if functions of the signals still predict a torque above the least size.

    It must also be a share of what was missing at first.
    """
    if share(base, final) >= WHOLE:
        return False
    before = missing_torque(base.predictor, base.values, base.where, base.noise)
    after = missing_torque(final.predictor, final.values, final.where, base.noise)
    part, t = predictable(after, base.predictor.data.log, base.where.counted)
    explained = part * float(np.mean(after**2))
    return t > STANDING and explained > max(least**2, LEFT_SHARE * float(np.mean(before**2)))


def _loud(fitted: Fitted) -> bool:
    """True if the noise differs more between windows than the model allows."""
    if fitted.noise.uneven:
        return 2 * len(fitted.quiet) < len(fitted.innovations)
    seen = fitted.noise.recorded()
    weight = fitted.predictor.data.weight[fitted.where.counted][..., seen].mean((1, 2))
    return uneven(fitted.innovations / np.sqrt(weight)[:, None, None], _stirred(fitted))


def _stirred(fitted: Fitted) -> np.ndarray:
    """True for windows in which the samples change often enough to show noise, (windows,).

    In the others, no model can predict the steps of the encoder.
    """
    changes = np.diff(fitted.predictor.data.y[fitted.where.counted], axis=1)
    changed = np.any(changes != 0, axis=2, where=np.isfinite(changes))
    return changed.mean(1) > STIRRED


def _tinted(base: Fitted, final: Fitted) -> bool:
    """True if the innovations are coloured by what is missing.

    A low-pass filtered speed colours them as well, and so does an inexact stiffness of an effect
    whose hidden state windows may have missed: neither counts.
    """
    whole = final.noise.uneven and share(base, final) > WHOLE
    return not whole and coloured(final) and not filtered(final.predictor.data)

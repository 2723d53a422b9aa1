"""Whether something proven is left beside the effects found."""

from __future__ import annotations

import numpy as np

from .evaluate import missing_torque
from .fit import Fitted
from .hanging import depends_on
from .noise import sensor_noise
from .proof import LEAST_SIZE, MOST_OF_REST, WHOLE, coloured, friction_size, share
from .repeated import filtered
from .slide import NEARLY_ALL, Sliding, hidden_in_noise, lacking, while_sliding
from .structure import predictable, uneven

LEFT_SHARE = 0.05  # of the first residual's power that may still hang on a signal
PART = 0.3  # of what the sliding drive lacked, below which it is left by an inexact effect
TAKEN = 0.25  # share below which a function is no longer among what is left
HALF = 0.5  # of the power first missing: effects that take less leave open what the rest is
SHAKEN = 0.1  # of the RMS friction torque: missing without a pattern, it is no longer a trifle
NOISES = 3.0  # times the own noise of the recorded torque
STIRRED = 0.1  # of the samples that differ from those before them, where a window tells noise
STANDING = 3.0  # standard errors of that share


def left_over(
    base: Fitted, final: Fitted, *, found: bool, doubtful: bool, carried: bool = False
) -> tuple[bool, tuple[str, ...]]:
    """Whether something proven is left, and the signals that it hangs on.

    ``found``: whether any effect was; ``doubtful``: whether those are a patchwork, or took much of
    it although the windows do not agree on them. ``carried``: a load takes nearly all that is
    lacking as the measured motion drives it; windows that missed where it is say nothing then.
    """
    least = LEAST_SIZE * friction_size(base)
    if not _lacks(base, final, least, found):
        if carried or _little(base, final, least):
            return False, ()
        if not (doubtful or _odd(base, final, least) or depends_on(final)):
            return False, ()
    return True, signals_of_the_rest(final, base, doubtful=doubtful)


def _odd(base: Fitted, final: Fitted, least: float) -> bool:
    """Whether innovations or missing torque look like more than noise, where sensors tell that."""
    if not _stirred(final).any():
        return False
    if share(base, final) < HALF and _shaken(final):
        return True
    return _loud(final) or _standing(base, final, least) or _tinted(base, final)


def _little(base: Fitted, final: Fitted, least: float) -> bool:
    """Whether less is missing than ``least``, or than the inexact values leave of an effect for
    which windows were forgiven."""
    if final.noise.uneven:
        least = max(least, PART * _missing(base))
    return _missing(final) <= least


def _shaken(fitted: Fitted) -> bool:
    """Whether so much torque is missing, far more than the recorded one's own noise, that it can
    be no trifle though it has no pattern: blows, say, which no short past foretells."""
    noise = sensor_noise(fitted.predictor.data.u)
    return _missing(fitted) > max(SHAKEN * friction_size(fitted), NOISES * noise)


def _missing(fitted: Fitted) -> float:
    """RMS torque that is missing, about its mean."""
    return float(
        np.std(missing_torque(fitted.predictor, fitted.values, fitted.where, fitted.noise))
    )


def _lacks(base: Fitted, final: Fitted, least: float, found: bool) -> bool:
    """Whether the sliding drive lacks more than ``least``, and than what inexact effects leave.

    As a function of signals, or of time: of signals only where the noise forgives windows in
    which a hidden state was missed, which are a matter of a few moments.

    What was found may be a wrong picture: half as much counts where it leaves more than it
    takes, or than a function of some signals would leave.
    """
    lack, first = lacking(final, timed=not final.noise.uneven), lacking(base) if found else None
    if first is not None and first.torque > 0.5 * least and first.is_better_than(final):
        return True
    lack = lack or (None if found else hidden_in_noise(final))
    if lack is None:
        return False
    before = while_sliding(base).torque if found else 0.0
    least = 0.5 * least if found and lack.torque > MOST_OF_REST * before else least
    return lack.torque > max(least, PART * before)


def signals_of_the_rest(final: Fitted, base: Fitted, *, doubtful: bool = False) -> tuple[str, ...]:
    """The signals to name where something proven is left: what comes and goes in time if none.

    The balance of the sliding drive comes first. What is left may be a poor picture of one
    thing, torn by ``doubtful`` effects that were found in its place: then all that is missing
    tells more, unless they have taken it; and where one function told it better than they do, or
    they took most of what was nearly all such a function. Effects that took nothing say nothing.
    Time comes last: between two neighbours it tells whatever is slow. It comes first where all
    is missing in a few moments, or where friction or the torque's strength change with it.
    """
    lack = lacking(base)
    if lack is not None and lack.is_better_than(final):
        return lack.signals
    left, whole = (while_sliding(f, everywhere=True) for f in (final, base))
    if left.torque > whole.torque:
        final, left = base, whole
    shown: tuple[str, ...] = ()
    mostly = left.torque < HALF * whole.torque  # the effects took
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
    """Whether functions of the signals still predict a share of what was missing at first, worth
    a name by itself."""
    if share(base, final) >= WHOLE:
        return False
    before = missing_torque(base.predictor, base.values, base.where, base.noise)
    after = missing_torque(final.predictor, final.values, final.where, base.noise)
    part, t = predictable(after, base.predictor.data.log, base.where.counted)
    told = part * float(np.mean(after**2))
    return t > STANDING and told > max(least**2, LEFT_SHARE * float(np.mean(before**2)))


def _loud(fitted: Fitted) -> bool:
    """Whether windows differ more in noise than the model allows."""
    if fitted.noise.uneven:
        return 2 * len(fitted.quiet) < len(fitted.innovations)
    seen = fitted.noise.recorded()
    weight = fitted.predictor.data.weight[fitted.where.counted][..., seen].mean((1, 2))
    return uneven(fitted.innovations / np.sqrt(weight)[:, None, None], _stirred(fitted))


def _stirred(fitted: Fitted) -> np.ndarray:
    """In which windows the sensors tell noise, (windows,): they change often enough.

    Else it is the steps of an encoder that surprise any model, again and again.
    """
    changes = np.diff(fitted.predictor.data.y[fitted.where.counted], axis=1)
    changed = np.any(changes != 0, axis=2, where=np.isfinite(changes))
    return changed.mean(1) > STIRRED


def _tinted(base: Fitted, final: Fitted) -> bool:
    """Whether the innovations are coloured by what is missing.

    Not by a filtered speed, nor by the inexact stiffness of what windows were forgiven for.
    """
    whole = final.noise.uneven and share(base, final) > WHOLE
    return not whole and coloured(final) and not filtered(final.predictor.data)

"""Which effect of the catalogue explains best what the model fails to predict."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from ..spec import members
from .beside import beside
from .blows import closer, search_all
from .driven import convincing, driven
from .fit import QUIETER, Fitted, again, drawn, identified_covariance, tuned
from .predictor import Predictor
from .proof import WHOLE, coloured, loud, share
from .score import Score, whitened_by_parts
from .screening import Trial, lightened, opened, screen

SHAKES = (0.7, 0.7, 0.3)  # largest spread of a random search about what a short fit found
SHAKEN = 40  # sets of it
TRIED = 6  # candidates fitted in full
ANEW = 3  # best fits that start once more with the plant as it was believed to be
FAR, STEPS = (0.2, 5.0), 10  # factors on an effect's values, and steps of a fit from there
UNLIKELY = 0.01  # promise over what another effect has gained, below which one is not tried
SOUGHT = 0.4  # of the leader's gain times its share of what is missing: all sets are tried above
FINE = 2.5  # samples to one of the search, from which their blows are looked at, too
LEAST_SOUGHT = 50.0  # gain in log-likelihood, below which that is not worth the time
SLIGHT = 3.0  # gain after a short fit, below which nothing more is tried
HOPELESS = 0.1  # of the leader's gain after a short fit, below which a candidate is dropped
BEHIND = 0.5  # the same behind a leader that leaves nothing
ABREAST = 4  # trials between two looks at who leads; the answer must not hang on the processors

Say = Callable[[str], None]
Pair = tuple[Trial, Fitted]


@dataclass(frozen=True)
class Contest:
    """All effects by promise, and those that were fitted, best first."""

    trials: list[Trial]
    fits: list[Pair]


def at_anchor(base: Fitted) -> Fitted:
    """The base model at the values that were believed beforehand.

    A model that lacks an effect bends its other parameters to make up for it, sometimes too far
    to find the way back: candidates start from here as well.
    """
    return tuned(replace(base, values=base.values | base.anchor))


def refine(trial: Trial, *, most: int = 30, rough: bool = False) -> Fitted:
    """Fit the model with the trial's effect, all parameters free."""
    anchor = trial.values | trial.fitted.anchor
    start = replace(trial.fitted, values=trial.values, anchor=anchor)
    return again(start, most=most, rough=rough)


def _short(trial: Trial, least: float) -> Pair:
    """A few steps from each of a trial's starts; inside the plant where its series is rough.

    One that comes to more than ``least`` is shaken, in case that there are better optima nearby.
    """
    if trial.rough:
        inside = Predictor(trial.fitted.predictor.model, trial.fitted.predictor.data)
        trial = replace(trial, fitted=replace(trial.fitted, predictor=inside))
    fits = [
        refine(replace(trial, values=v), most=5, rough=True) for v in (trial.values, *trial.others)
    ]
    best = max(fits, key=lambda f: f.total)
    worth = trial.rough and best.total > least
    for reach in SHAKES if worth else ():
        start = _shaken(best, trial.key, reach)
        if start is not None:
            other = refine(replace(trial, values=start), most=5, rough=True)
            best = max(best, other, key=lambda f: f.total)
    return trial, best


def _shaken(found: Fitted, key: str, spread: float) -> dict[str, float] | None:
    """Values near those found that do better as they are.

    Blows make many optima. Drawn with the shape of the uncertainty, the plant's values along
    with the effect's, whose logarithms spread so far.
    """
    own = [i for i, c in enumerate(found.free) if c.key.startswith(f"{key}.") and c.kind == "log"]
    if len(own) < 2:
        return None
    C = identified_covariance(found)
    size = np.sqrt(np.max(np.diag(C)[own]))
    sets = drawn(found, C * (spread / size) ** 2, SHAKEN, len(own)) if size > 0.0 else []
    if not sets:
        return None
    white = whitened_by_parts(found.predictor, sets, found)
    cost = np.sum(white**2, axis=(1, 2, 3))
    best = int(np.argmin(cost))
    return sets[best] if cost[best] < np.sum(found.innovations**2) else None


def _heavy(trial: Trial, base: Fitted, values: dict[str, float]) -> Trial:
    """A trial on all samples again."""
    found = trial.fitted.predictor
    predictor = found.on(base.predictor.data) if trial.rough else base.predictor.like(found.model)
    return replace(trial, fitted=replace(base, predictor=predictor), values=values)


def contest(base: Fitted, names: Sequence[str], gate: float, say: Say) -> Contest:
    """Fit the promising effects shortly from each start, then the best of them to the end.

    All but the end goes on fewer samples a second. It is over with a fit that leaves nothing.
    """
    light = lightened(base)
    promising = screen(Score(light), names)
    short = _shortly(light, [t for t in promising if t.promise > gate][: 2 * TRIED], gate, say)
    if not _settled(light, short):
        believed = at_anchor(light)
        bent = light.total - believed.total > gate
        more = [t for t in screen(Score(believed), names) if t.promise > gate] if bent else []
        short = _shortly(light, more[:TRIED], gate, say, short)
    finished = _to_the_end(base, light, short[:TRIED], gate == 0.0, say)
    if _settled(base, finished):
        return Contest(promising, finished)
    tops = beside(partial(_anew, light=light, least=base.total + gate), finished[:ANEW])
    return Contest(promising, _best_first([*tops, *finished[ANEW:]]))


def _to_the_end(
    base: Fitted, light: Fitted, short: Sequence[Pair], thorough: bool, say: Say
) -> list[Pair]:
    """Those that may come near the leader fitted on all samples; of one with many optima all sets
    are tried, unless another leaves nothing."""
    settled = _settled(light, short)
    lead = short[0][1].total - light.total if short else 0.0
    hope = partial(_hope, light=light, thorough=thorough)
    least = (BEHIND if settled else HOPELESS) * lead
    worth = [pair for pair in short if hope(pair) > max(least, SLIGHT)]
    _named(say, "fitting", (t for t, _ in worth))
    wanted = _worth_seeking(light, worth)

    def finished(pair: Pair) -> Pair:
        seek = pair[0].boxed and (pair is short[0] or not settled)
        return _finished(pair, base, seek and hope(pair) > wanted)

    return _best_first(beside(finished, worth))


def _settled(base: Fitted, fits: Sequence[Pair]) -> bool:
    """Whether the best fit leaves nothing: no other start comes to more, and of the other effects
    only those matter that come near it."""
    if not fits or fits[0][1].predictor.data.smoothed:
        return False
    best = fits[0][1]
    return share(base, best) > WHOLE and not loud(best) and not coloured(best)


def _shortly(
    light: Fitted, chosen: Sequence[Trial], gate: float, say: Say, known: Sequence[Pair] = ()
) -> list[Pair]:
    """The best short fit of each effect, best first; some are ``known``."""
    best = {trial.name: (trial, fitted) for trial, fitted in known}
    queue = sorted(chosen, key=lambda trial: -trial.promise)
    for i in range(0, len(queue), ABREAST):
        lead = max((f.total - light.total for _, f in best.values()), default=0.0)
        likely = [t for t in queue[i : i + ABREAST] if t.promise >= UNLIKELY * lead]
        _named(say, "trying", likely)
        least = light.total + max(HOPELESS * lead, gate)
        for trial, fitted in beside(partial(_short, least=least), likely):
            if trial.name not in best or fitted.total > best[trial.name][1].total:
                best[trial.name] = trial, fitted
    return _best_first(best.values())


def _best_first(pairs: Iterable[Pair]) -> list[Pair]:
    return sorted(pairs, key=lambda pair: -pair[1].total)


def _named(say: Say, doing: str, trials: Iterable[Trial]) -> None:
    names = ", ".join(trial.name for trial in trials)
    if names:
        say(f"{doing} {names}")


def _worth_seeking(light: Fitted, fits: Sequence[Pair]) -> float:
    """The gain from which an effect with many optima may come to more than the leader.

    That is less where the leader leaves much.
    """
    if not fits:
        return LEAST_SOUGHT
    leader = fits[0][1]
    return max(SOUGHT * share(light, leader) * (leader.total - light.total), LEAST_SOUGHT)


def _hope(pair: Pair, light: Fitted, thorough: bool) -> float:
    """What an effect may gain: by a short fit, or where all is tried that might by what it
    promised, if it has many optima, of which that fit saw one."""
    trial, short = pair
    gain = short.total - light.total
    return max(gain, trial.promise) if thorough and trial.boxed else gain


def _finished(pair: Pair, base: Fitted, wanted: bool) -> Pair:
    """A trial on all samples again, fitted to the end; all sets tried where that is ``wanted``."""
    trial, short = pair
    whole = _heavy(trial, base, search_all(short, trial.key) if wanted else short.values)
    fitted = refine(whole, most=0 if wanted else 30)
    if wanted and short.predictor.data.dt > FINE * base.predictor.data.dt:
        fitted = closer(fitted, trial.key)
    return whole, fitted


def loaded(base: Fitted, name: str) -> Pair | None:
    """A load with many optima fitted from where the measured motion drives it, where that is
    convincing; it may gain too little otherwise to be looked at."""
    model = base.predictor.model.with_effect(name, {})
    key = model.effects[-1].key
    few, whole = (
        replace(f, predictor=Predictor(model, f.predictor.data)) for f in (lightened(base), base)
    )
    few = replace(few, values=few.values | opened(key, members("effect")[name], {}))
    loads = driven(few, key)
    if not convincing(loads):
        return None
    trial = Trial(name, whole, key, search_all(few, key, loads), 0.0)
    return trial, refine(trial)


def carries(found: Fitted, key: str) -> tuple[float, float] | None:
    """The shares of the power lacking that a load takes as the measured motion drives it, in the
    fitted windows and elsewhere; None where that is not convincing."""
    loads = driven(lightened(found), key)
    if not convincing(loads):
        return None
    return max(d.share for d in loads), max(d.elsewhere for d in loads)


def _anew(pair: Pair, light: Fitted, least: float) -> Pair:
    """A fit, or a better one: with the plant from where it was believed to be, or from afar."""
    trial, fitted = pair
    if trial.boxed or fitted.total <= least:
        return pair
    plant = {k: v for k, v in trial.fitted.anchor.items() if "." not in k}
    starts = [fitted.values | plant, *_afar(pair, light)]
    others = [refine(replace(trial, values=values)) for values in starts]
    return trial, max([fitted, *others], key=lambda f: f.total)


def _afar(pair: Pair, light: Fitted) -> list[dict[str, float]]:
    """Values of a better optimum far away, if there is one: a hidden state makes several, stiffer
    and less damped bristles, say, and so does an observer that makes up for much.

    On the samples of the ``light`` base model.
    """
    trial, fitted = pair
    if not (trial.rough or loud(fitted)):
        return []
    few = fitted.predictor.on(light.predictor.data)
    there = tuned(replace(fitted, predictor=few, where=light.where))
    own = [c.key for c in fitted.free if c.key.startswith(f"{trial.key}.") and c.kind == "log"]
    sets = [there.values | {k: there.values[k] * r} for k in own for r in FAR if trial.rough]
    fits = [again(replace(there, values=v), most=STEPS, rough=True) for v in sets]
    if loud(there):
        fits += [again(there, most=STEPS, rough=True, quiet=quiet) for quiet in QUIETER]
    best = max([there, *fits], key=lambda f: f.total)
    return [best.values] if best.total > there.total + SLIGHT else []

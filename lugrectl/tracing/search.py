"""Candidate refinement: screen the catalogue, then fit promising effects from several starts."""

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

SHAKES = (0.7, 0.7, 0.3)  # largest spreads of the random searches around a short fit
SHAKEN = 40  # sets of values in such a search
TRIED = 6  # candidates fitted to convergence
ANEW = 3  # best fits that are restarted with the declared plant values
FAR, STEPS = (0.2, 5.0), 10  # factors on an effect's values for a restart, and its number of steps
UNLIKELY = 0.01  # of the best gain so far: effects with a smaller promise are not tried
SEARCHED = 0.4  # of the leader's gain times its explained share: search globally above this
FINE = 2.5  # samples per sample of the search, from which impacts are refined on all samples
LEAST_SEARCHED = 50.0  # least gain in log-likelihood for which a global search is made
SLIGHT = 3.0  # least gain after a short fit for a candidate to be continued
HOPELESS = 0.1  # of the leader's gain after a short fit, below which a candidate is dropped
BEHIND = 0.5  # the same if the leader leaves nothing unexplained
ABREAST = 4  # trials between updates of the leader; fixed, so results do not depend on the CPUs

Say = Callable[[str], None]
Pair = tuple[Trial, Fitted]


@dataclass(frozen=True)
class Contest:
    """All candidates by promise, and those that were fitted, best first."""

    trials: list[Trial]
    fits: list[Pair]


def at_anchor(base: Fitted) -> Fitted:
    """The base model at the declared values.

    Without the effect the other parameters are biased, sometimes into another basin; candidates
    therefore also start from the declared values.
    """
    return tuned(replace(base, values=base.values | base.anchor))


def refine(trial: Trial, *, most: int = 30, rough: bool = False) -> Fitted:
    """Fit the model with the trial's effect, all parameters free."""
    anchor = trial.values | trial.fitted.anchor
    start = replace(trial.fitted, values=trial.values, anchor=anchor)
    return again(start, most=most, rough=rough)


def _short(trial: Trial, least: float) -> Pair:
    """A few steps from each start of a trial, with the effect inside the plant if its series is
    only approximate.

    Around a fit above ``least`` a random search looks for better local maxima nearby.
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
    """Values near those found with a higher likelihood before any refit; None if there are none.

    Impacts cause many local maxima. Values of plant and effect are drawn with the shape of the
    covariance, scaled so that the logarithms of the effect's values have this spread.
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
    """The trial on all samples."""
    found = trial.fitted.predictor
    predictor = found.on(base.predictor.data) if trial.rough else base.predictor.like(found.model)
    return replace(trial, fitted=replace(base, predictor=predictor), values=values)


def contest(base: Fitted, names: Sequence[str], gate: float, say: Say) -> Contest:
    """Fit the promising effects briefly from each start, then the best of them to convergence.

    All but the last fits use fewer samples. It stops at a fit that leaves nothing unexplained.
    """
    light = lightened(base)
    promising = screen(Score(light), names)
    short = _shortly(light, [t for t in promising if t.promise > gate][: 2 * TRIED], gate, say)
    if not _settled(light, short):
        declared = at_anchor(light)
        biased = light.total - declared.total > gate
        more = [t for t in screen(Score(declared), names) if t.promise > gate] if biased else []
        short = _shortly(light, more[:TRIED], gate, say, short)
    finished = _to_the_end(base, light, short[:TRIED], gate == 0.0, say)
    if _settled(base, finished):
        return Contest(promising, finished)
    tops = beside(partial(_anew, light=light, least=base.total + gate), finished[:ANEW])
    return Contest(promising, _best_first([*tops, *finished[ANEW:]]))


def _to_the_end(
    base: Fitted, light: Fitted, short: Sequence[Pair], thorough: bool, say: Say
) -> list[Pair]:
    """Fit those candidates on all samples that may come near the leader.

    One with many local maxima is searched globally, unless another leaves nothing unexplained.
    """
    settled = _settled(light, short)
    lead = short[0][1].total - light.total if short else 0.0
    hope = partial(_hope, light=light, thorough=thorough)
    least = (BEHIND if settled else HOPELESS) * lead
    worth = [pair for pair in short if hope(pair) > max(least, SLIGHT)]
    _named(say, "fitting", (t for t, _ in worth))
    wanted = _worth_searching(light, worth)

    def finished(pair: Pair) -> Pair:
        globally = pair[0].boxed and (pair is short[0] or not settled)
        return _finished(pair, base, globally and hope(pair) > wanted)

    return _best_first(beside(finished, worth))


def _settled(base: Fitted, fits: Sequence[Pair]) -> bool:
    """True if the best fit leaves nothing unexplained.

    Then no other start can gain more, and only effects that come near it matter.
    """
    if not fits or fits[0][1].predictor.data.smoothed:
        return False
    best = fits[0][1]
    return share(base, best) > WHOLE and not loud(best) and not coloured(best)


def _shortly(
    light: Fitted, chosen: Sequence[Trial], gate: float, say: Say, known: Sequence[Pair] = ()
) -> list[Pair]:
    """The best short fit of each effect, best first; ``known`` ones are included."""
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


def _worth_searching(light: Fitted, fits: Sequence[Pair]) -> float:
    """The gain from which an effect with many local maxima may overtake the leader.

    It is lower if the leader leaves much unexplained.
    """
    if not fits:
        return LEAST_SEARCHED
    leader = fits[0][1]
    return max(SEARCHED * share(light, leader) * (leader.total - light.total), LEAST_SEARCHED)


def _hope(pair: Pair, light: Fitted, thorough: bool) -> float:
    """The expected gain of an effect, from its short fit.

    If ``thorough``, an effect with many local maxima counts with its promise if that is higher, as
    a short fit finds only one maximum.
    """
    trial, short = pair
    gain = short.total - light.total
    return max(gain, trial.promise) if thorough and trial.boxed else gain


def _finished(pair: Pair, base: Fitted, wanted: bool) -> Pair:
    """A trial fitted to convergence on all samples; after a global search if ``wanted``."""
    trial, short = pair
    whole = _heavy(trial, base, search_all(short, trial.key) if wanted else short.values)
    fitted = refine(whole, most=0 if wanted else 30)
    if wanted and short.predictor.data.dt > FINE * base.predictor.data.dt:
        fitted = closer(fitted, trial.key)
    return whole, fitted


def loaded(base: Fitted, name: str) -> Pair | None:
    """A hidden load, fitted from the values found with the measured motion as its input.

    None if these values are not convincing. By its gain alone the load may be ranked too low to be
    tried.
    """
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
    """Shares of the missing power that a load driven by the measured motion explains, in the
    fitted windows and elsewhere; None if that is not convincing."""
    loads = driven(lightened(found), key)
    if not convincing(loads):
        return None
    return max(d.share for d in loads), max(d.elsewhere for d in loads)


def _anew(pair: Pair, light: Fitted, least: float) -> Pair:
    """The best of a fit and its restarts from the declared plant values and from distant values."""
    trial, fitted = pair
    if trial.boxed or fitted.total <= least:
        return pair
    plant = {k: v for k, v in trial.fitted.anchor.items() if "." not in k}
    starts = [fitted.values | plant, *_afar(pair, light)]
    others = [refine(replace(trial, values=values)) for values in starts]
    return trial, max([fitted, *others], key=lambda f: f.total)


def _afar(pair: Pair, light: Fitted) -> list[dict[str, float]]:
    """Values of a better local maximum far away, if there is one, on the samples of ``light``.

    Hidden states cause several maxima (stiffer and less damped bristles, say), and so does an
    observer that compensates for much.
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

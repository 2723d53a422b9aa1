"""Effects added one after another, as long as the gain is proven on the training windows."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from ..results import Candidate
from ..spec import members
from .beside import beside
from .blows import forgiving, sharpened
from .choice import FIRM, Step, agreed, as_well, candidate, chosen, in_order, sureness, worth_trying
from .data import Data
from .fit import Fitted, again, fit, refitted
from .hidden import with_hidden
from .job import Progress
from .late import LAG, with_lag
from .once import firm_by_itself, told_once
from .predictor import Predictor
from .proof import (
    GATE,
    LEAST_OF_FIRST,
    LEAST_SIZE,
    WHOLE,
    firmness,
    proven,
    share,
    size,
)
from .rest import coloured, left_over
from .screening import Trial
from .search import Contest, Pair, Say, carries, contest, loaded
from .slide import lacking
from .surprise import foretold
from .windows import Windows
from .witness import contradicted

PIECED = 0.98  # share below which as many effects as are tried are a patchwork, not physics
FIRMER = 1.0  # half-widths as in FIRM, from which an effect is chosen before others
LOST = 0.2  # share of the residual's power taken by effects that are not firm
MOST_EFFECTS = 3
RETRIED = 3  # candidates whose plant values the model without them is fitted from again
TRIED = 6  # candidates fitted in full at each step


@dataclass(frozen=True)
class Explanation:
    """The refitted model, accepted effects, the final model with them inside, and what is left.

    ``unexplained`` says whether something proven is left; ``hangs_on`` on which signals. Where
    ``other`` is given the first effect has shown that its torque is to be taken first: what
    else is here is not to be used.
    """

    base: Fitted
    steps: tuple[Step, ...]
    final: Fitted
    ranking: tuple[Candidate, ...]
    unexplained: bool
    hangs_on: tuple[str, ...]
    other: Data | None = None


def explain(
    base: Fitted,
    report: Progress,
    test: Windows,
    another: Callable[[Fitted, bool], Data | None] = lambda fitted, timed: None,
) -> Explanation:
    """Add the best effect, refit everything, look again, until nothing proven is left.

    ``test`` are the held-out windows; they only tell apart what explains the others equally well.
    ``another`` tells, once an effect is known, whether another torque is to be taken; its second
    argument is whether the only question is its time.
    """
    trace = _Trace(base, test)
    found = _traced(trace, report, another)
    if found.unexplained and not trace.steps and not coloured(trace.current):
        trace.waiting = trace.hidden(partial(report, 0.15))
        found = _traced(trace, report, another) if trace.waiting else found
    if found.unexplained and trace.passed and (trace.stronger or not found.steps):
        other = _traced(trace.otherwise(), report)
        found = found if other.unexplained else other
    if found.unexplained and not any(step.trial.boxed for step in found.steps):
        led = _Trace(base, test)
        led.ranking, led.waiting = trace.ranking, led.loaded()
        other = _traced(led, report) if led.waiting else found
        found = found if other.unexplained else other
    return found


def _traced(
    trace: _Trace,
    report: Progress,
    another: Callable[[Fitted, bool], Data | None] = lambda fitted, timed: None,
) -> Explanation:
    """The rounds, and what they come to; one that is nearly all goes on while something is left."""
    nearly = None
    for turn in range(MOST_EFFECTS):
        at = 0.15 + 0.7 * turn / MOST_EFFECTS
        say = partial(report, at)
        say(f"trying the catalogue, round {turn + 1}")
        sound = trace.sound(say)
        if not sound:
            break
        trace.add(sound, say)
        if trace.carried():
            ended = _ended(trace, report, carried=True)
            if not ended.unexplained:
                return ended
        base, current = trace.base, trace.current
        enough = share(base, current) > 1.0 - LEAST_OF_FIRST and not coloured(current)
        timed = enough or turn > 0  # its noise is judged once
        other = another(current, timed) if not current.noise.uneven else None
        if other is not None and (enough or not trace.rather(other, say)):
            return Explanation(base, tuple(trace.steps), current, (), False, (), other)
        if enough and nearly is None:
            nearly = _ended(trace, report)
            if not nearly.unexplained:
                return nearly
    ended = nearly if nearly and len(trace.steps) == len(nearly.steps) else _ended(trace, report)
    return nearly if nearly and ended.unexplained else ended


def _ended(trace: _Trace, report: Progress, *, carried: bool = False) -> Explanation:
    """What is firm of the effects found, and what is left."""
    base, pieces, ranking = trace.base, trace.current, tuple(trace.ranking)
    sure = tuple(step for step in trace.steps if carried and step.trial.boxed)
    steps, current = _firm(trace.steps, pieces, trace.test, sure)
    current = current if steps else base  # the way there and back may have ended elsewhere
    steps = _still_tied(steps, current, partial(report, 0.84))
    lost = share(current, pieces) > LOST
    pieced = len(steps) == MOST_EFFECTS and share(base, current) < PIECED
    unexplained, signals = left_over(
        base, current, found=bool(steps), doubtful=lost or pieced, carried=carried
    )
    return Explanation(base, tuple(steps), current, ranking, unexplained, signals)


def without_effects(found: Explanation) -> Explanation:
    """The same with none of the effects found; something is left if it was before, too."""
    base = found.base
    left, signals = left_over(base, base, found=False, doubtful=False)
    if found.unexplained:
        left, signals = True, found.hangs_on
    return replace(found, steps=(), final=base, unexplained=left, hangs_on=signals)


def behind_a_filter(found: Explanation) -> Explanation:
    """The same with the lag of a recorded speed that was left out of the fit, if it is late."""
    if not found.final.predictor.data.late:
        return found
    final = with_lag(found.final)
    firm = firmness(final, LAG)
    if firm < FIRM:
        return found
    step = Step(Trial(LAG, final, LAG, final.values, np.inf), (), firm)
    return replace(found, steps=(step, *found.steps), final=final)


class _Trace:
    """The refitted model, the model with the effects accepted so far, and these."""

    def __init__(self, base: Fitted, test: Windows) -> None:
        self.base, self.current, self.test = base, base, test
        self.steps: list[Step] = []
        self.ranking: list[Candidate] = []
        self.waiting: list[Pair] = []
        self.passed: list[Pair] = []
        self.stronger = False  # whether those explained more than the one taken

    def otherwise(self) -> _Trace:
        """The same from the start, led by those ``passed`` over at first: by what explained more
        but was not firm, a stop that few windows meet; else by the firm ones, or where none was by
        those that were surer than the one taken.

        What led instead may not be firm in the end, and have stood in the way of the others.
        """
        other = _Trace(self.base, self.test)
        other.ranking, other.waiting = self.ranking, self.passed
        return other

    def loaded(self) -> list[Pair]:
        """Effects whose load takes nearly all that is lacking, as the measured motion drives it."""
        names = [n for n in worth_trying(self.base.predictor.model) if members("effect")[n].box]
        pairs = (loaded(self.base, name) for name in names)
        return [pair for pair in pairs if pair is not None]

    def carried(self) -> bool:
        """The same of one that was found."""
        return any(s.trial.boxed and carries(self.current, s.trial.key) for s in self.steps)

    def rather(self, other: Data, say: Say) -> bool:
        """Whether another effect explains more than a torque that is moved does.

        Two effects, of which one is known, can look like that.
        """
        if other.ahead <= self.current.predictor.data.ahead:
            return False
        moved = refitted(self.current, other)
        self.waiting = self.sound(say)
        return max((f.total for _, f in self.waiting), default=-np.inf) > moved.total

    def sound(self, say: Say) -> list[Pair]:
        """The effects whose gain is proven; where none is though something colours the
        innovations, those too that promise nothing."""
        if self.waiting:
            found, self.waiting = self.waiting, []
            return found
        names = worth_trying(self.current.predictor.model)
        sound = self._proven(names, 0.5 * GATE, say)
        return sound or (self.hidden(say) if coloured(self.current) else [])

    def hidden(self, say: Say) -> list[Pair]:
        """Those that are proven although they promise nothing, as they have no linear part: what
        decides whether a drive sticks or slips shows in no small change."""
        names = worth_trying(self.current.predictor.model)
        return self._proven([n for n in names if members("effect")[n].tries], 0.0, say)

    def _proven(self, names: Sequence[str], gate: float, say: Say) -> list[Pair]:
        tried = contest(self.current, names, gate, TRIED, say)
        self.ranking = self.ranking or _ranking(self.current, tried)
        better = _better_base(self.current, tried.fits)
        if better is not None:
            far = better.total > self.current.total + GATE
            self.base = better if self.current is self.base else self.base
            self.steps, self.current = _pruned(self.steps, better, self.steps)
            if far and all(f.total < better.total for _, f in tried.fits):  # beyond a ridge
                tried = contest(self.current, names, gate, TRIED, say)
        sound = [(t, f) for t, f in tried.fits if _stands(self.base, self.current, f, t.key)]
        lack = lacking(self.current) if len(sound) > 1 else None
        return [(t, f) for t, f in sound if lack and not lack.stays(f)] or sound

    def add(self, sound: Sequence[Pair], say: Say) -> None:
        """The best of them, the others fitted again and dropped or exchanged if need be."""
        sure = [(pair, sureness(self.current, pair[1], pair[0])) for pair in sound]
        leading = [pair for pair, firm in sure if firm > FIRMER] or sound
        step, current = chosen(self.current, leading, self.test)
        if not self.steps:
            others = [one for one in sure if one[0][0] is not step.trial]
            least = FIRM if any(firm > FIRM for _, firm in others) else step.firm
            more = [pair for pair, _ in others if pair[1].total > current.total + GATE]
            self.stronger = bool(more)
            self.passed = more or [pair for pair, firm in others if firm > least]
        current = in_order(current)
        self.steps = [*self.steps, step]
        self.base, current = _eased(self.steps, self.base, current)
        self.steps, self.current = _pruned(self.steps, current, self.steps[:-1])
        if len(self.steps) > 1:
            self._exchange(say)

    def _exchange(self, say: Say) -> None:
        """The oldest for any other where its colour is left, or where the later ones make it
        unsure; else for one that came near it."""
        whole, oldest = share(self.base, self.current) > WHOLE, self.steps[0]
        torn = whole and coloured(self.current) or oldest.firmness(self.current) <= FIRMER
        rivals = None if torn else oldest.rivals
        if rivals is None or rivals:
            self.steps, current = _exchanged(self.steps, self.current, self.test, rivals, say)
            self.base, self.current = _eased(self.steps, self.base, current)


def _stands(base: Fitted, before: Fitted, after: Fitted, key: str) -> bool:
    return proven(base, before, after, key) and not contradicted(after, key)


def _eased(steps: Sequence[Step], base: Fitted, current: Fitted) -> tuple[Fitted, Fitted]:
    """Under a noise that forgives missed windows, where the newest effect asks for that."""
    if not steps[-1].trial.boxed:
        return base, current
    return forgiving(base), with_hidden(sharpened(current))


def _better_base(current: Fitted, fits: Sequence[Pair]) -> Fitted | None:
    """The model without more effects, fitted again from the plants that the candidates found.

    A refit can end in a poor optimum; then any effect that leads out of it would look good.
    """
    free = [c.key for c in current.free] + list(current.instants)

    def refitted(pair: Pair) -> Fitted:
        values = {k: pair[1].values[k] for k in current.values}
        return fit(
            current.predictor, values, free, current.where, pair[1].noise,
            anchor=current.anchor, most=12,
        )  # fmt: skip

    best = max([current, *beside(refitted, fits[:RETRIED])], key=lambda f: f.total)
    return best if best.total > current.total + 3.0 else None


def _ranking(base: Fitted, tried: Contest) -> list[Candidate]:
    full = {t.name: f for t, f in tried.fits}
    made = []
    for t in tried.trials:
        f = full.get(t.name)
        values = f.values if f else t.values
        own = {k.split(".", 1)[1]: v for k, v in values.items() if k.startswith(t.key + ".")}
        score = f.total - base.total if f else t.promise
        made.append(Candidate(t.name, score, share(base, f) if f else 0.0, own))
    return sorted(made, key=lambda c: -c.score)


def _pruned(
    steps: list[Step], fitted: Fitted, doubtful: Sequence[Step]
) -> tuple[list[Step], Fitted]:
    """Without those doubtful effects that the rest has made needless."""
    for step in doubtful:
        key = step.trial.key
        if size(fitted, key) > LEAST_SIZE:
            continue
        without = _without(fitted, key)
        if without.total > fitted.total - GATE:
            rest, left = ([s for s in of if s is not step] for of in (steps, doubtful))
            return _pruned(rest, without, left)
    return steps, fitted


def _firm(
    steps: list[Step], fitted: Fitted, test: Windows, confirmed: tuple[Step, ...] = ()
) -> tuple[list[Step], Fitted]:
    """Without those effects on whose strength the windows do not agree, the least sure first.

    What a single window tells, a stop met once, may be ``confirmed`` by held-out ones, or by all
    that is in this window; so may what nearly all was missing without, a drift that is soon over,
    and what all windows gain by, if their derivatives, where a drive breaks loose, say little of
    its strength.
    """
    unsure = [s for s in steps if all(s is not c for c in confirmed) and s.firmness(fitted) <= FIRM]
    if not unsure:
        return steps, fitted
    least = min(unsure, key=lambda step: step.firmness(fitted))
    key = least.trial.key
    without = _without(fitted, key)
    once = told_once(fitted, key)
    gained = least.trial.rough and agreed(without, fitted) > FIRM
    told = once or gained or share(without, fitted) > WHOLE
    elsewhere = told and foretold(fitted, without, test)
    if elsewhere or once and firm_by_itself(without, fitted, key) > FIRM:
        return _firm(steps, fitted, test, (*confirmed, least))
    return _firm([s for s in steps if s is not least], without, test)


def _exchanged(
    steps: list[Step], fitted: Fitted, test: Windows, rivals: Sequence[str] | None, say: Say
) -> tuple[list[Step], Fitted]:
    """The oldest effect for another that explains more beside the later ones, if there is one.

    It was chosen when these were missing. Of the ``rivals`` only, where any are given.
    """
    oldest, *later = steps
    without = _without(fitted, oldest.trial.key)
    names = worth_trying(without.predictor.model)
    names = names if rivals is None else [n for n in names if n in rivals]
    tried = contest(without, names, 0.5 * GATE, TRIED, say)
    sound = [(t, f) for t, f in tried.fits if _stands(without, without, f, t.key)]
    if not sound:
        return steps, fitted
    step, whole = chosen(without, sound, test)
    if whole.total < fitted.total + GATE:
        return steps, fitted
    return [*later, step], whole


def _still_tied(steps: Sequence[Step], fitted: Fitted, say: Say) -> list[Step]:
    """The steps with those alternatives only that explain as much beside the later effects, too."""
    if len(steps) < 2:
        return list(steps)
    made = []
    for step in steps:
        if step.tied:
            without = _without(fitted, step.trial.key)
            tried = contest(without, [c.name for c in step.tied], 0.0, TRIED, say)
            left = [(t, f) for t, f in tried.fits if as_well(without, fitted, f)]
            step = replace(step, tied=tuple(candidate(without, t, f) for t, f in left))
        made.append(step)
    return made


def _without(fitted: Fitted, key: str) -> Fitted:
    model = fitted.predictor.model
    rest = replace(model, effects=tuple(p for p in model.effects if p.key != key))
    values, anchor = (
        {k: v for k, v in old.items() if not k.startswith(f"{key}.")}
        for old in (fitted.values, fitted.anchor)
    )
    predictor = Predictor(rest, fitted.predictor.data)
    return again(replace(fitted, predictor=predictor, values=values, anchor=anchor))

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
from .choice import (
    FIRM,
    Step,
    ahead,
    chosen,
    in_order,
    sureness,
    worth_trying_on,
)
from .data import Data
from .fit import Fitted, fit, refitted
from .hidden import with_hidden
from .job import Progress
from .kept import exchanged, firm_ones, pruned, stands, still_tied
from .late import LAG, with_lag
from .proof import (
    GATE,
    LEAST_OF_FIRST,
    WHOLE,
    coloured,
    firmness,
    share,
)
from .rest import left_over
from .screening import Trial
from .search import Contest, Pair, Say, carries, contest, loaded
from .slide import missing_function
from .windows import Windows

PIECED = 0.98  # share below which as many effects as are tried are a patchwork, not physics
FIRMER = 1.0  # half-widths as in FIRM, from which an effect is chosen before others
LOST = 0.2  # share of the residual's power taken by effects that are not firm
MOST_EFFECTS = 3
LIKELY = 0.5  # of the best effect's gain at first, from which another may be it on other samples
RETRIED = 3  # candidates whose plant values the model without them is fitted from again


@dataclass(frozen=True)
class Explanation:
    """The refitted model, accepted effects, the final model with them inside, and what is left.

    ``unexplained`` says whether something proven is left; ``hangs_on`` on which signals. Where
    ``other`` is given the first effect has shown that its torque is to be taken first: what
    else is here is not to be used. ``carried`` are the shares that a load takes of what is lacking
    where the measured motion drives it, by :func:`~lugrectl.tracing.search.carries`.
    """

    base: Fitted
    steps: tuple[Step, ...]
    final: Fitted
    ranking: tuple[Candidate, ...]
    unexplained: bool
    hangs_on: tuple[str, ...]
    other: Data | None = None
    carried: tuple[float, float] | None = None


def explain(
    base: Fitted,
    report: Progress,
    test: Windows,
    another: Callable[[Fitted, bool], Data | None] = lambda fitted, timed: None,
    only: Sequence[str] = (),
) -> Explanation:
    """Add the best effect, refit everything, look again, until nothing proven is left.

    ``test`` are the held-out windows; they only tell apart what explains the others equally well.
    ``another`` tells, once an effect is known, whether another torque is to be taken; its second
    argument is whether the only question is its time. ``only`` these effects are tried, where any
    are given, and no second start is made.
    """
    trace = _Trace(base, test, only)
    found = _traced(trace, report, another)
    if only:
        return found
    if found.unexplained and not trace.steps and not coloured(trace.current):
        trace.waiting = trace.hidden(partial(report, 0.15))
        found = _traced(trace, report, another) if trace.waiting else found
    for way in (trace.passed_over, trace.half_of_two, trace.loaded):
        leading = way(found) if found.unexplained else []
        if leading:
            other = _traced(trace.led_by(leading), report)
            found = other if _settles(other, found) else found
    return found


def _settles(other: Explanation, found: Explanation) -> bool:
    """Whether nothing is left with other effects, which are as likely as those found."""
    likelier = other.final.noise.uneven or other.final.total > found.final.total
    return likelier and not other.unexplained


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
        carried = trace.carried()
        if carried:
            ended = _ended(trace, report, carried=carried)
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


def _ended(
    trace: _Trace, report: Progress, *, carried: tuple[float, float] | None = None
) -> Explanation:
    """What is firm of the effects found, and what is left."""
    base, pieces, ranking = trace.base, trace.current, tuple(trace.ranking)
    sure = tuple(step for step in trace.steps if carried and step.trial.boxed)
    steps, current = firm_ones(trace.steps, pieces, trace.test, sure)
    current = current if steps else base  # the way there and back may have ended elsewhere
    steps = still_tied(steps, current, partial(report, 0.84))
    lost = share(current, pieces) > LOST
    pieced = len(steps) == MOST_EFFECTS and share(base, current) < PIECED
    unexplained, signals = left_over(
        base, current, found=bool(steps), doubtful=lost or pieced, carried=carried is not None
    )
    return Explanation(base, tuple(steps), current, ranking, unexplained, signals, carried=carried)


def likely(found: Explanation) -> tuple[str, ...]:
    """What an explanation names, and what came near it at first."""
    top = max((c.score for c in found.ranking), default=0.0)
    near = [c.name for c in found.ranking if c.score > LIKELY * top]
    named = [n for s in found.steps for n in (s.trial.name, *(c.name for c in s.tied))]
    return tuple(dict.fromkeys([*named, *near]))


def without_effects(found: Explanation) -> Explanation:
    """The same with none of the effects found; something is left if it was before, too."""
    base = found.base
    left, signals = left_over(base, base, found=False, doubtful=False)
    if found.unexplained and not left:
        left, signals = True, found.hangs_on
    return replace(found, steps=(), final=base, unexplained=left, hangs_on=signals, carried=None)


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

    def __init__(self, base: Fitted, test: Windows, only: Sequence[str] = ()) -> None:
        self.base, self.current, self.test, self.only = base, base, test, only
        self.steps: list[Step] = []
        self.ranking: list[Candidate] = []
        self.waiting: list[Pair] = []
        self.first: list[Pair] = []  # what was proven at first, of which one led
        self.leader: Trial | None = None
        self.passed: list[Pair] = []
        self.stronger = False  # whether those explained more than the one taken

    def led_by(self, pairs: list[Pair]) -> _Trace:
        """The same from the start, led by the best of these."""
        other = _Trace(self.base, self.test)
        other.ranking, other.waiting = self.ranking, pairs
        return other

    def passed_over(self, found: Explanation) -> list[Pair]:
        """Effects that explained more at first but were not firm, a stop that few windows meet;
        else the firm ones, or where none was those that were surer than the one taken.

        What led instead may not be firm in the end, and have stood in the way of the others.
        """
        return self.passed if self.stronger or not found.steps else []

    def half_of_two(self, found: Explanation) -> list[Pair]:
        """The effect that promises most with another beside it, of those that did not lead."""
        others = [pair for pair in self.first if pair[0] is not self.leader]
        return [ahead(others)] if others else []

    def loaded(self, found: Explanation) -> list[Pair]:
        """Effects whose load takes nearly all that is lacking, as the measured motion drives it."""
        if any(step.trial.boxed for step in found.steps):
            return []
        names = [n for n in worth_trying_on(self.base) if members("effect")[n].box]
        pairs = (loaded(self.base, name) for name in names)
        return [pair for pair in pairs if pair is not None]

    def carried(self) -> tuple[float, float] | None:
        """The shares that the load of one takes which was found."""
        boxed = [step.trial.key for step in self.steps if step.trial.boxed]
        return carries(self.current, boxed[0]) if boxed else None

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
        names = worth_trying_on(self.current)
        names = [n for n in names if n in self.only] if self.only else names
        sound = self._proven(names, 0.5 * GATE, say)
        more = not (sound or self.only) and coloured(self.current)
        return self.hidden(say) if more else sound

    def hidden(self, say: Say) -> list[Pair]:
        """Those that are proven although they promise nothing, as they have no linear part: what
        decides whether a drive sticks or slips shows in no small change."""
        names = worth_trying_on(self.current)
        return self._proven([n for n in names if members("effect")[n].tries], 0.0, say)

    def _proven(self, names: Sequence[str], gate: float, say: Say) -> list[Pair]:
        tried = contest(self.current, names, gate, say)
        self.ranking = self.ranking or _ranking(self.current, tried)
        better = _better_base(self.current, tried.fits)
        if better is not None:
            far = better.total > self.current.total + GATE
            self.base = better if self.current is self.base else self.base
            self.steps, self.current = pruned(self.steps, better, self.steps)
            if far and all(f.total < better.total + GATE for _, f in tried.fits):  # beyond a ridge
                tried = contest(self.current, names, gate, say)
        sound = [(t, f) for t, f in tried.fits if stands(self.base, self.current, f, t.key)]
        missing = missing_function(self.current) if len(sound) > 1 else None
        return [(t, f) for t, f in sound if missing and not missing.stays(f)] or sound

    def add(self, sound: Sequence[Pair], say: Say) -> None:
        """The best of them, the others fitted again and dropped or exchanged if need be."""
        sure = [(pair, sureness(self.current, pair[1], pair[0])) for pair in sound]
        leading = [pair for pair, firm in sure if firm > FIRMER] or sound
        step, current = chosen(self.current, leading, self.test)
        if not self.steps:
            self.first, self.leader = list(sound), step.trial
            others = [one for one in sure if one[0][0] is not step.trial]
            least = FIRM if any(firm > FIRM for _, firm in others) else step.firm
            more = [pair for pair, _ in others if pair[1].total > current.total + GATE]
            self.stronger = bool(more)
            self.passed = more or [pair for pair, firm in others if firm > least]
        current = in_order(current)
        self.steps = [*self.steps, step]
        self.base, current = _eased(self.steps, self.base, current)
        self.steps, self.current = pruned(self.steps, current, self.steps[:-1])
        if len(self.steps) > 1 and not self._is_all():
            self._exchange(say)

    def _is_all(self) -> bool:
        """Whether the load of the newest effect does better without the others, as the measured
        motion drives it: these were found, and bent its values, while it was missing."""
        newest = self.steps[-1].trial
        pair = loaded(self.base, newest.name) if newest.boxed else None
        if pair is None or pair[1].total < self.current.total:
            return False
        step, current = chosen(self.base, [pair], self.test)
        self.steps = [step]
        self.base, self.current = _eased(self.steps, self.base, current)
        return True

    def _exchange(self, say: Say) -> None:
        """The oldest for any other where its colour is left, or where the later ones make it
        unsure; else for one that came near it."""
        whole, oldest = share(self.base, self.current) > WHOLE, self.steps[0]
        torn = whole and coloured(self.current) or oldest.firmness(self.current) <= FIRMER
        rivals = None if torn else oldest.rivals
        if rivals is None or rivals:
            self.steps, current = exchanged(self.steps, self.current, self.test, rivals, say)
            self.base, self.current = _eased(self.steps, self.base, current)


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

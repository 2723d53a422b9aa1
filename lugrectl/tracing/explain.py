"""Forward stepwise selection: effects are added one by one while their gain is significant."""

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

PIECED = 0.98  # explained share: with less, MOST_EFFECTS effects are a patchwork, not physics
FIRMER = 1.0  # half-widths as in FIRM, from which a candidate is preferred to others
LOST = 0.2  # share of the residual's power explained by insignificant effects: doubtful above
MOST_EFFECTS = 3
LIKELY = 0.5  # of the best first gain, from which another effect may be best on other samples
RETRIED = 3  # candidates whose plant values are starts for a refit of the model without them


@dataclass(frozen=True)
class Explanation:
    """The refitted model, accepted effects, the final model with them inside, and the residual.

    ``unexplained`` says whether something significant remains, ``depends_on`` on which signals it
    depends. If ``other`` is given, the first effect has shown that this torque must be used
    instead: the rest of the result is not valid. ``carried`` are the shares of the missing power
    that a load explains as driven by the measured motion, see
    :func:`~lugrectl.tracing.search.carries`.
    """

    base: Fitted
    steps: tuple[Step, ...]
    final: Fitted
    ranking: tuple[Candidate, ...]
    unexplained: bool
    depends_on: tuple[str, ...]
    other: Data | None = None
    carried: tuple[float, float] | None = None


def explain(
    base: Fitted,
    report: Progress,
    test: Windows,
    another: Callable[[Fitted, bool], Data | None] = lambda fitted, timed: None,
    only: Sequence[str] = (),
) -> Explanation:
    """Add the best effect, refit everything, repeat, until nothing significant is found.

    ``test`` are the held-out windows; they choose between effects that explain the others equally
    well, and confirm effects that few windows support. ``another`` gives, once an effect is known,
    data with another torque to use, or None; its second argument limits the question to the delay
    of the torque. If ``only`` names effects, just these are tried, without restarts.
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
    """True if ``other`` leaves nothing unexplained and is at least as likely as ``found``."""
    likelier = other.final.noise.uneven or other.final.total > found.final.total
    return likelier and not other.unexplained


def _traced(
    trace: _Trace,
    report: Progress,
    another: Callable[[Fitted, bool], Data | None] = lambda fitted, timed: None,
) -> Explanation:
    """Run the rounds of the selection.

    If one effect explains nearly all but something remains, the rounds go on; their result counts
    only if nothing remains then.
    """
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
        timed = enough or turn > 0  # denoising is tried in the first round only
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
    """Remove effects that are not significant, and test the residual."""
    base, pieces, ranking = trace.base, trace.current, tuple(trace.ranking)
    sure = tuple(step for step in trace.steps if carried and step.trial.boxed)
    steps, current = firm_ones(trace.steps, pieces, trace.test, sure)
    current = current if steps else base  # adding and removing may end in another optimum
    steps = still_tied(steps, current, partial(report, 0.84))
    lost = share(current, pieces) > LOST
    pieced = len(steps) == MOST_EFFECTS and share(base, current) < PIECED
    unexplained, signals = left_over(
        base, current, found=bool(steps), doubtful=lost or pieced, carried=carried is not None
    )
    return Explanation(base, tuple(steps), current, ranking, unexplained, signals, carried=carried)


def likely(found: Explanation) -> tuple[str, ...]:
    """Effects that an explanation names, and those that came near them in the first round."""
    top = max((c.score for c in found.ranking), default=0.0)
    near = [c.name for c in found.ranking if c.score > LIKELY * top]
    named = [n for s in found.steps for n in (s.trial.name, *(c.name for c in s.tied))]
    return tuple(dict.fromkeys([*named, *near]))


def without_effects(found: Explanation) -> Explanation:
    """The same without the effects found; unexplained if it is so now or was before."""
    base = found.base
    left, signals = left_over(base, base, found=False, doubtful=False)
    if found.unexplained and not left:
        left, signals = True, found.depends_on
    return replace(found, steps=(), final=base, unexplained=left, depends_on=signals, carried=None)


def behind_a_filter(found: Explanation) -> Explanation:
    """The same with the lag of a recorded speed that is not fitted, if it is significant."""
    if not found.final.predictor.data.late:
        return found
    final = with_lag(found.final)
    firm = firmness(final, LAG)
    if firm < FIRM:
        return found
    step = Step(Trial(LAG, final, LAG, final.values, np.inf), (), firm)
    return replace(found, steps=(step, *found.steps), final=final)


class _Trace:
    """State of the selection: refitted model, model with the accepted effects, these effects."""

    def __init__(self, base: Fitted, test: Windows, only: Sequence[str] = ()) -> None:
        self.base, self.current, self.test, self.only = base, base, test, only
        self.steps: list[Step] = []
        self.ranking: list[Candidate] = []
        self.waiting: list[Pair] = []
        self.first: list[Pair] = []  # significant in the first round; one was accepted
        self.leader: Trial | None = None
        self.passed: list[Pair] = []
        self.stronger = False  # whether those explained more than the accepted one

    def led_by(self, pairs: list[Pair]) -> _Trace:
        """A new selection from the start, which first chooses from these candidates."""
        other = _Trace(self.base, self.test)
        other.ranking, other.waiting = self.ranking, pairs
        return other

    def passed_over(self, found: Explanation) -> list[Pair]:
        """Candidates of the first round that were not accepted but may be right.

        These are the ones that explained more but were not preferred, such as a stop that few
        windows meet. If there are none, and no effect was kept: the significant ones, or if none
        was, those more significant than the accepted one, which may have displaced them.
        """
        return self.passed if self.stronger or not found.steps else []

    def half_of_two(self, found: Explanation) -> list[Pair]:
        """The candidate, not the accepted one, with the largest gain together with a second
        effect."""
        others = [pair for pair in self.first if pair[0] is not self.leader]
        return [ahead(others)] if others else []

    def loaded(self, found: Explanation) -> list[Pair]:
        """Effects whose load, driven by the measured motion, explains nearly all that is
        missing."""
        if any(step.trial.boxed for step in found.steps):
            return []
        names = [n for n in worth_trying_on(self.base) if members("effect")[n].box]
        pairs = (loaded(self.base, name) for name in names)
        return [pair for pair in pairs if pair is not None]

    def carried(self) -> tuple[float, float] | None:
        """Shares of the missing power that an accepted load explains; None without one."""
        boxed = [step.trial.key for step in self.steps if step.trial.boxed]
        return carries(self.current, boxed[0]) if boxed else None

    def rather(self, other: Data, say: Say) -> bool:
        """True if another effect explains more than a shift of the torque in time.

        Two effects, of which one is known, can look like such a shift.
        """
        if other.ahead <= self.current.predictor.data.ahead:
            return False
        moved = refitted(self.current, other)
        self.waiting = self.sound(say)
        return max((f.total for _, f in self.waiting), default=-np.inf) > moved.total

    def sound(self, say: Say) -> list[Pair]:
        """Candidates with a significant gain.

        If there are none but the innovations are coloured, also those that the score test cannot
        see.
        """
        if self.waiting:
            found, self.waiting = self.waiting, []
            return found
        names = worth_trying_on(self.current)
        names = [n for n in names if n in self.only] if self.only else names
        sound = self._proven(names, 0.5 * GATE, say)
        more = not (sound or self.only) and coloured(self.current)
        return self.hidden(say) if more else sound

    def hidden(self, say: Say) -> list[Pair]:
        """Candidates that are significant although the score test shows no gain.

        They have no linear part: a small change does not show what decides whether a drive sticks
        or slips.
        """
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
        """Accept the best candidate; refit the earlier effects, remove or exchange them if
        needed."""
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
        """True if the newest effect (a hidden load), refitted from the measured motion, has a
        higher likelihood without the earlier effects, which were fitted while the load was
        missing."""
        newest = self.steps[-1].trial
        pair = loaded(self.base, newest.name) if newest.boxed else None
        if pair is None or pair[1].total < self.current.total:
            return False
        step, current = chosen(self.base, [pair], self.test)
        self.steps = [step]
        self.base, self.current = _eased(self.steps, self.base, current)
        return True

    def _exchange(self, say: Say) -> None:
        """Exchange the oldest effect if another explains more.

        Any other is tried if the innovations are still coloured although nearly all is explained,
        or if later effects make it insignificant; else only its rivals.
        """
        whole, oldest = share(self.base, self.current) > WHOLE, self.steps[0]
        torn = whole and coloured(self.current) or oldest.firmness(self.current) <= FIRMER
        rivals = None if torn else oldest.rivals
        if rivals is None or rivals:
            self.steps, current = exchanged(self.steps, self.current, self.test, rivals, say)
            self.base, self.current = _eased(self.steps, self.base, current)


def _eased(steps: Sequence[Step], base: Fitted, current: Fitted) -> tuple[Fitted, Fitted]:
    """Allow a larger noise in windows in which a hidden state was missed, if the newest effect
    has such a state."""
    if not steps[-1].trial.boxed:
        return base, current
    return forgiving(base), with_hidden(sharpened(current))


def _better_base(current: Fitted, fits: Sequence[Pair]) -> Fitted | None:
    """The current model refitted from the plants of the candidates; None if not better.

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

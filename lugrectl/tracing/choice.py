"""Model comparison: which effect to accept, and which candidates explain the record as well."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import permutations

import numpy as np

from ..blocks.plant import COMMAND, stage
from ..model import Model, Part
from ..results import Candidate
from ..spec import P, members
from .beside import beside
from .blows import forgiving
from .fit import Fitted, again
from .predictor import Predictor
from .proof import GATE, firmness, share
from .score import Score
from .screening import Trial, lightened, screen
from .search import Pair
from .surprise import surprising
from .windows import Windows

LOOKED = 6  # candidates beside which a second effect is screened
PART = 0.1  # of the leader's gain, by which a candidate that counts as equal may gain less
FIRM = 2.0  # half-widths of its 95 % interval by which a significant strength differs from none
ECCENTRIC = "encoder_eccentricity"
LEAST_OF_A_TURN = 1.0  # rad of travel
TURNING = ("gravity", ECCENTRIC)  # once per turn: not tried on a linear axis
SAME = 2e-3  # of the torque: two models that differ by less are the same


@dataclass(frozen=True)
class Step:
    """One accepted effect, its significance, and what explains the training windows equally well.

    ``firm`` is its significance when it was accepted. ``rivals``, which include the ties, explained
    nearly as much then.
    """

    trial: Trial
    tied: tuple[Candidate, ...]
    firm: float
    rivals: tuple[str, ...] = ()

    def firmness(self, fitted: Fitted) -> float:
        """Significance of the strength: half-widths of its 95 % interval from none.

        Under a noise that may be larger in windows in which a hidden state was missed, only those
        few windows disagree on the strength; then the significance at acceptance counts if it is
        higher.
        """
        now = firmness(fitted, self.trial.key)
        return max(self.firm, now) if fitted.noise.uneven and self.trial.boxed else now


def worth_trying(model: Model) -> list[str]:
    """Effects that are applicable to the model.

    Left out are a second effect of a kind unless it can differ, an effect that the friction law
    contains already, and one that acts only on parameters which the model does not have.
    """
    used = {part.block.name for part in model.effects}
    has = {"J", *model.friction.values}
    names = []
    for name, made in members("effect").items():
        levels = {a.removeprefix("+") for a in made.acts} - {"torque", "input", "sensor"}
        again = name in used and not any(_repeats(p) for p in made.own.values())
        idle = len(levels) == len(made.acts) and not levels & has
        turning = name in TURNING and model.motion == "linear"
        own = {k for k, p in made.own.items() if p.fitted}
        if not (again or idle or turning or has & own):
            names.append(name)
    return names


def worth_trying_on(fitted: Fitted) -> list[str]:
    """The same, for the recorded travel.

    Over a small part of a turn an eccentric encoder is a gain, which the plant's parameters absorb,
    and resembles any effect with a slight curvature.
    """
    log = fitted.predictor.data.log
    short = float(np.ptp(log.theta)) < LEAST_OF_A_TURN
    names = worth_trying(fitted.predictor.model)
    return [n for n in names if not (short and n == ECCENTRIC)]


def _repeats(p: P) -> bool:
    """True if two effects of a kind can differ in it: another harmonic, the other side."""
    return bool(p.choices) or bool(p.grid and p.unit != "s")


def chosen(before: Fitted, sound: Sequence[Pair], test: Windows) -> tuple[Step, Fitted]:
    """The best effect with its ties, and the model with it inside the plant.

    Candidates are compared inside the plant, since the torque of an effect computed along the log
    is not always exact. One that held-out windows contradict is left out if they agree with
    another.
    """
    even = _even(before, beside(inside, _even(before, sound)))
    if len(even) > 1:
        even = [pair for pair in even if not len(surprising(pair[1], test))] or even
    (trial, best), *others = even
    tied = tuple(candidate(before, t, f) for t, f in others)
    near = best.total - _much(before, best)
    rivals = tuple({t.name: t for t, f in sound if f.total > near and t is not trial})
    return Step(trial, tied, sureness(before, best, trial), rivals), best


def ahead(sound: Sequence[Pair]) -> Pair:
    """The candidate with the largest gain together with the best second effect beside it.

    When two effects are missing, either one alone may fit worse than a third effect that resembles
    their sum.
    """
    return max(sound[:LOOKED], key=lambda pair: pair[1].total + _beside(pair[1]))


def _beside(fitted: Fitted) -> float:
    """Gain in log-likelihood that the score test gives the best further effect."""
    light = lightened(fitted)
    trials = screen(Score(light), worth_trying_on(fitted))
    part = light.where.counted.size / fitted.where.counted.size
    return trials[0].promise / part if trials else 0.0


def sureness(before: Fitted, after: Fitted, trial: Trial) -> float:
    """Significance of an effect when it is found.

    Windows in which its hidden state was missed say nothing about its strength by their
    sensitivities. For such an effect the significance of the windows' gain counts, if that is
    higher.
    """
    firm = firmness(after, trial.key)
    return max(firm, agreed(forgiving(before), forgiving(after))) if trial.boxed else firm


def agreed(before: Fitted, after: Fitted) -> float:
    """Gain of the windows in half-widths of its 95 % interval.

    No window's gain counts more than the median.
    """
    gain = after.loglik - before.loglik
    gain = np.minimum(gain, np.median(np.abs(gain)))
    half = 2.0 * float(np.std(gain, ddof=1)) * np.sqrt(len(gain))
    return float(gain.sum()) / half if half > 0.0 else 0.0


def in_order(fitted: Fitted) -> Fitted:
    """The same with the effects on the command in another order, if that is clearly better.

    A dead zone before a lag is not the same as one behind it.
    """
    model = fitted.predictor.model
    command = [p for p in model.effects if stage(p.block) == COMMAND]
    if all(p.block.exact for p in command):  # linear effects commute
        return fitted
    others = tuple(p for p in model.effects if stage(p.block) != COMMAND)

    def ordered(order: Sequence[Part]) -> Fitted:
        predictor = Predictor(replace(model, effects=(*order, *others)), fitted.predictor.data)
        return again(replace(fitted, predictor=predictor))

    tried = beside(ordered, list(permutations(command))[1:])
    best = max([fitted, *tried], key=lambda f: f.total)
    return best if best.total > fitted.total + GATE else fitted


def _even(before: Fitted, sound: Sequence[Pair]) -> list[Pair]:
    """The best effect and all that explain the windows as well within two standard errors.

    Significant ones come first (others would be removed in the end), then those with fewest
    parameters. An effect whose strength may be none only imitates another (a soft spring with a
    distant rest position is a constant torque) and is left out.
    """
    top = max(sound, key=lambda pair: pair[1].total)[1]
    even = [(t, f) for t, f in sound if f is top or as_well(before, top, f)]
    real = [(t, f) for t, f in even if not _imitates(t, f)] or even
    if len(real) == 1:
        return real

    def order(pair: Pair) -> tuple[bool, int, float]:
        trial, fitted = pair
        return sureness(before, fitted, trial) <= FIRM, len(fitted.free), -fitted.total

    first, *rest = sorted(real, key=order)
    return [first, *((t, f) for t, f in rest if not _comes_to(f, first[1]))]


def as_well(before: Fitted, top: Fitted, other: Fitted) -> bool:
    """True within two standard errors over the windows, if it has nearly as much of the gain."""
    lead = top.loglik - other.loglik
    error = float(np.std(lead, ddof=1)) * np.sqrt(len(lead))
    return lead.sum() < min(max(3.0, 2.0 * error), _much(before, top))


def _much(before: Fitted, top: Fitted) -> float:
    """By how much another may gain less and still explain nearly as much."""
    return max(10.0, PART * (top.total - before.total))


def _comes_to(other: Fitted, simple: Fitted) -> bool:
    """True if a model with more parameters gives the same torque: backlash without a gap."""
    if len(other.free) <= len(simple.free):
        return False
    at = simple.where.counted
    torques = [f.predictor.torque(f.values)[at] for f in (other, simple)]
    apart = float(np.std(torques[0] - torques[1]))
    return apart < SAME * float(np.std(torques[1]))


def _imitates(trial: Trial, fitted: Fitted) -> bool:
    gain = fitted.predictor.model.part(trial.key).block.gain
    low, high = fitted.intervals().get(f"{trial.key}.{gain}", (1.0, 1.0))
    return low <= 0.0 <= high


def candidate(before: Fitted, trial: Trial, fitted: Fitted) -> Candidate:
    return Candidate(trial.name, fitted.total - before.total, share(before, fitted))


def inside(pair: Pair) -> Pair:
    """The same model with its effects simulated inside the plant, refitted if they were not."""
    trial, found = pair
    if trial.rough:
        return pair
    inside = Predictor(found.predictor.model, found.predictor.data)
    return trial, again(replace(found, predictor=inside))

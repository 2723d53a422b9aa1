"""Backward elimination and exchange: which effects are kept beside those found after them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from .choice import FIRM, Step, agreed, as_well, candidate, chosen, worth_trying_on
from .fit import Fitted, again
from .once import firm_by_itself, from_one_window
from .predictor import Predictor
from .proof import GATE, LEAST_SIZE, WHOLE, proven, share, size
from .search import Say, contest
from .surprise import predicted
from .windows import Windows
from .witness import confirmed, contradicted


def stands(base: Fitted, before: Fitted, after: Fitted, key: str) -> bool:
    """True if an effect is significant and no second sensor contradicts it."""
    return proven(base, before, after, key) and not contradicted(after, key)


def pruned(
    steps: list[Step], fitted: Fitted, doubtful: Sequence[Step]
) -> tuple[list[Step], Fitted]:
    """Remove those ``doubtful`` effects that the others have made unnecessary."""
    for step in doubtful:
        key = step.trial.key
        if size(fitted, key) > LEAST_SIZE:
            continue
        without = without_it(fitted, key)
        if without.total > fitted.total - GATE:
            rest, left = ([s for s in of if s is not step] for of in (steps, doubtful))
            return pruned(rest, without, left)
    return steps, fitted


def firm_ones(
    steps: list[Step], fitted: Fitted, test: Windows, sure: tuple[Step, ...] = ()
) -> tuple[list[Step], Fitted]:
    """Remove effects whose strength is not significant across windows, the least first.

    Those in ``sure`` are kept. So is an effect that only a single window supports (a stop met once)
    if (a) held-out windows confirm it or (b) it explains more than 99 % of that window.
    Confirmation by held-out windows is also enough for an effect that explains nearly all that was
    missing (a drift soon over), and for one whose gain is significant across windows although its
    strength is not: where a drive breaks loose, sensitivities say little about the strength.
    """
    unsure = [s for s in steps if all(s is not c for c in sure) and s.firmness(fitted) <= FIRM]
    if not unsure:
        return steps, fitted
    least = min(unsure, key=lambda step: step.firmness(fitted))
    key = least.trial.key
    without = without_it(fitted, key)
    once = from_one_window(fitted, key)
    gained = least.trial.rough and agreed(without, fitted) > FIRM
    likely = once or gained or share(without, fitted) > WHOLE
    elsewhere = likely and predicted(fitted, without, test, confirmed=confirmed(fitted, key))
    if elsewhere or once and firm_by_itself(without, fitted, key) > FIRM:
        return firm_ones(steps, fitted, test, (*sure, least))
    return firm_ones([s for s in steps if s is not least], without, test)


def exchanged(
    steps: list[Step], fitted: Fitted, test: Windows, rivals: Sequence[str] | None, say: Say
) -> tuple[list[Step], Fitted]:
    """Exchange the oldest effect if another explains more beside the later ones.

    It was chosen while these were missing. Only the ``rivals`` are tried, if any are given.
    """
    oldest, *later = steps
    without = without_it(fitted, oldest.trial.key)
    names = worth_trying_on(without)
    names = names if rivals is None else [n for n in names if n in rivals]
    tried = contest(without, names, 0.5 * GATE, say)
    sound = [(t, f) for t, f in tried.fits if stands(without, without, f, t.key)]
    if not sound:
        return steps, fitted
    step, whole = chosen(without, sound, test)
    if whole.total < fitted.total + GATE:
        return steps, fitted
    return [*later, step], whole


def still_tied(steps: Sequence[Step], fitted: Fitted, say: Say) -> list[Step]:
    """The steps with only those ties that explain as much beside the later effects, too."""
    if len(steps) < 2:
        return list(steps)
    made = []
    for step in steps:
        if step.tied:
            without = without_it(fitted, step.trial.key)
            tried = contest(without, [c.name for c in step.tied], 0.0, say)
            left = [(t, f) for t, f in tried.fits if as_well(without, fitted, f)]
            step = replace(step, tied=tuple(candidate(without, t, f) for t, f in left))
        made.append(step)
    return made


def without_it(fitted: Fitted, key: str) -> Fitted:
    """The model without an effect, refitted."""
    model = fitted.predictor.model
    rest = replace(model, effects=tuple(p for p in model.effects if p.key != key))
    values, anchor = (
        {k: v for k, v in old.items() if not k.startswith(f"{key}.")}
        for old in (fitted.values, fitted.anchor)
    )
    predictor = Predictor(rest, fitted.predictor.data)
    return again(replace(fitted, predictor=predictor, values=values, anchor=anchor))

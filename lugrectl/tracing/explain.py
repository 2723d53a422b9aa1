"""Effects added one after another, as long as the gain is proven on the training windows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from ..model import Model
from ..results import Candidate
from ..spec import P, members
from .coordinates import free_keys
from .data import Data
from .evaluate import missing_torque
from .fit import Fitted, fit
from .job import Progress, calmed
from .likelihood import tune
from .predictor import Predictor
from .search import Contest, Trial, contest
from .structure import colour, dependences, in_bursts, uneven

GATE = 20.0  # least gain in log-likelihood, also without the best window
LEAST_SHARE = 0.04  # of the residual torque's power that an effect must remove
LEAST_OF_FIRST = 0.02  # the same of the residual before any effect was added
LEAST_SIZE = 0.015  # of the RMS friction torque, below which an effect is not worth a name
LEAST_SIZE_OF_ALL = 0.004  # the same for one that explains most of what is missing
LEAST_REMOVED = 2e-4  # of friction: the residual torque gone, below which nothing was amiss
MOST_OF_IT = 0.95  # of the residual's power
LEFT_SHARE = 0.05  # of the first residual's power that may still hang on a signal
WHOLE = 0.9  # share above which the effects found explain the residual, whatever is left
CLOSE = 0.02  # relative, to a bound
PIECED = 0.98  # share below which as many effects as are tried are a patchwork, not physics
COLOUR = {"theta": 0.3, "w": 0.05}  # of the innovations; quantised positions are never white
SURE = 1.5  # standard errors above which a dependence too weak to prove is at least a hint
MOST_EFFECTS = 3
RETRIED = 3  # candidates whose plant values the model without them is fitted from again
PART = 0.1  # of the leader's gain that one which explains as much may lack
TRIED = 6  # candidates fitted in full at each step
TURNING = ("gravity", "encoder_eccentricity")  # once per turn: nothing on a linear axis


@dataclass(frozen=True)
class Step:
    """One effect accepted, and what explains the training windows equally well."""

    trial: Trial
    fitted: Fitted
    tied: tuple[Candidate, ...]


@dataclass(frozen=True)
class Explanation:
    """The refitted model, accepted effects, the final model with them inside, and what is left.

    ``unexplained`` says whether something proven is left; ``hangs_on`` on which signals. Where
    ``calm`` is given the first effect has shown that the torque is to be smoothed first: what
    else is here is not to be used.
    """

    base: Fitted
    steps: tuple[Step, ...]
    final: Fitted
    ranking: tuple[Candidate, ...]
    unexplained: bool
    hangs_on: tuple[str, ...]
    calm: Data | None = None


def explain(base: Fitted, report: Progress) -> Explanation:
    """Add the best effect, refit everything, look again, until nothing proven is left."""
    steps: list[Step] = []
    ranking: list[Candidate] = []
    current = base
    for turn in range(MOST_EFFECTS):
        at = 0.15 + 0.7 * turn / MOST_EFFECTS
        report(at, f"trying the catalogue, round {turn + 1}")
        names = _names(current.predictor.model)
        tried = contest(current, names, 0.5 * GATE, TRIED, partial(report, at))
        if turn == 0:
            ranking = _ranking(current, tried)
        better = _better_base(current, tried.fits)
        if better is not None:
            base, current = (better if current is base else base), better
            steps, current = _pruned(steps, current, steps)
        proven = [(t, f) for t, f in tried.fits if _proven(base, current, f, t.key)]
        if not proven:
            break
        even = _even(current, proven)
        (trial, best), *others = even
        tied = tuple(_candidate(current, t, f) for t, f in others)
        steps.append(Step(trial, best, tied))
        current = best if trial.rough else _inside(best)
        steps, current = _pruned(steps, current, steps[:-1])
        if _share(base, current) > 1.0 - LEAST_OF_FIRST:
            break
        calm = calmed(current) if turn == 0 else None
        if calm is not None:
            return Explanation(base, tuple(steps), current, (), False, (), calm)
    unexplained, hangs_on = _left_over(base, current, steps)
    return Explanation(base, tuple(steps), current, tuple(ranking), unexplained, hangs_on)


def _better_base(current: Fitted, fits: Sequence[tuple[Trial, Fitted]]) -> Fitted | None:
    """The model without more effects, fitted again from the plants that the candidates found.

    A refit can end in a poor optimum; then any effect that leads out of it would look good.
    """
    best, free = current, [c.key for c in current.free] + list(current.instants)
    for _, found in fits[:RETRIED]:
        values = {k: found.values[k] for k in current.values}
        again = fit(
            current.predictor, values, free, current.where, found.noise,
            anchor=current.anchor, most=12,
        )  # fmt: skip
        best = max(best, again, key=lambda f: f.total)
    return best if best.total > current.total + 3.0 else None


def _names(model: Model) -> list[str]:
    """Effects worth trying on what the model has.

    A second of a kind only where it can differ; nothing that the friction law has already, or
    that acts on what it lacks.
    """
    used = {part.block.name for part in model.effects}
    has = {"J", *model.friction.values}
    names = []
    for name, made in members("effect").items():
        levels = {a.removeprefix("+") for a in made.acts} - {"torque", "input", "sensor"}
        again = name in used and not any(_repeats(p) for p in made.own.values())
        idle = len(levels) == len(made.acts) and not levels & has
        turning = name in TURNING and model.motion == "linear"
        if not (again or idle or turning or has & set(made.own)):
            names.append(name)
    return names


def _repeats(p: P) -> bool:
    """Whether two effects of a kind differ in it: another harmonic, the other side."""
    return bool(p.choices) or bool(p.grid and p.unit != "s")


def _proven(base: Fitted, before: Fitted, after: Fitted, key: str) -> bool:
    """Whether an effect is certain, and large enough beside what was there and is there."""
    gain = after.loglik - before.loglik
    certain = (
        gain.sum() - max(gain.max(), 0.0) > GATE and after.total - _mirrored(after, key) > GATE
    )
    matters = _share(base, after) - _share(base, before) > LEAST_OF_FIRST
    share = _share(before, after)
    least = LEAST_SIZE if share < MOST_OF_IT else LEAST_SIZE_OF_ALL
    large = share > LEAST_SHARE and _removed(before, after) > LEAST_REMOVED
    if _measured_ill(before, after, key):
        matters, large, least = True, True, LEAST_SIZE
    large = large and size(after, key) > least
    sound = bool(np.isfinite(after.total)) and not _at_its_bound(after, key)
    return sound and certain and matters and large


def _measured_ill(before: Fitted, after: Fitted, key: str) -> bool:
    """Whether a sensor's effect makes most of the innovations, whatever torque that leaves."""
    part = next(p for p in after.predictor.model.effects if p.key == key)
    gain = after.loglik.sum() - before.loglik.sum()
    return "sensor" in part.block.acts and bool(gain > 0.5 * before.where.counted.size)


def _at_its_bound(fitted: Fitted, key: str) -> bool:
    """Whether an effect would be stronger than it may be: it stands for something else."""
    part = next(p for p in fitted.predictor.model.effects if p.key == key)
    gain = part.block.parameters[part.block.gain]
    ends = [b for b in (gain.low, gain.high) if np.isfinite(b) and b != gain.neutral]
    value = fitted.values[f"{key}.{part.block.gain}"]
    return any(abs(value - b) < CLOSE * abs(b) for b in ends)


def _mirrored(fitted: Fitted, key: str) -> float:
    """Log-likelihood of a late input turned round in time; -inf for any other effect.

    Noise on the recorded torque is averaged by a delay or a lag, and as much by an advance:
    only what the advance does not gain is physics.
    """
    predictor, data = fitted.predictor, fitted.predictor.data
    part = next(p for p in predictor.model.effects if p.key == key)
    if part.block.exact is None:
        return -np.inf
    own = {k: fitted.values[f"{key}.{k}"] for k in part.values}
    ahead = part.block.exact(data.u[::-1], data.dt, **own)[::-1]
    neutral = part.block.parameters[part.block.gain].neutral or 0.0
    values = fitted.values | {f"{key}.{part.block.gain}": neutral}
    other = predictor.on(data.with_torque(ahead))
    return float(tune(other, values, fitted.where, fitted.noise)[1].sum())


def size(fitted: Fitted, key: str) -> float:
    """RMS torque that an effect makes along the training windows, over that of friction."""
    predictor, at = fitted.predictor, fitted.where.counted.ravel()
    model = predictor.model
    part = next(p for p in model.effects if p.key == key)
    neutral = part.block.parameters[part.block.gain].neutral or 0.0
    off = {f"{key}.{part.block.gain}": neutral}
    change = predictor.torque(fitted.values) - predictor.torque(fitted.values | off)
    friction = predictor.friction(fitted.values)
    return float(np.std(change[at]) + abs(np.mean(change[at]))) / float(
        np.sqrt(np.mean(friction[at] ** 2))
    )


def _share(before: Fitted, after: Fitted) -> float:
    """Part of the power of the acceleration that the model does not foresee, that is gone."""
    return max(0.0, 1.0 - (after.noise.jump / before.noise.jump) ** 2)


def _removed(before: Fitted, after: Fitted) -> float:
    """The torque per sample that is no longer unforeseen, over the RMS of friction."""
    friction = before.predictor.friction(before.values)[before.where.counted]
    gone = before.torque_noise * np.sqrt(_share(before, after))
    return float(gone / max(np.sqrt(np.mean(friction**2)), 1e-300))


def _ranking(base: Fitted, tried: Contest) -> list[Candidate]:
    full = {t.name: f for t, f in tried.fits}
    made = []
    for t in tried.trials:
        f = full.get(t.name)
        values = f.values if f else t.values
        own = {k.split(".", 1)[1]: v for k, v in values.items() if k.startswith(t.key + ".")}
        score = f.total - base.total if f else t.promise
        made.append(Candidate(t.name, score, _share(base, f) if f else 0.0, own))
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


def _without(fitted: Fitted, key: str) -> Fitted:
    model = fitted.predictor.model
    rest = replace(model, effects=tuple(p for p in model.effects if p.key != key))
    predictor = Predictor(rest, fitted.predictor.data)
    values, anchor = (
        {k: v for k, v in old.items() if not k.startswith(f"{key}.")}
        for old in (fitted.values, fitted.anchor)
    )
    free = free_keys(predictor)
    return fit(predictor, values, free, fitted.where, fitted.noise, anchor=anchor)


def _even(before: Fitted, proven: Sequence[tuple[Trial, Fitted]]) -> list[tuple[Trial, Fitted]]:
    """The best effect and all that explain the windows as well within two standard errors.

    Fewest parameters first. An effect whose strength may as well be none imitates another (a
    soft spring with a distant rest is a constant torque) and is left out.
    """
    top = max(proven, key=lambda pair: pair[1].total)[1]
    even = [(t, f) for t, f in proven if f is top or _as_well(before, top, f)]
    real = [(t, f) for t, f in even if not _imitates(t, f)] or even
    return sorted(real, key=lambda pair: (len(pair[1].free), -pair[1].total))


def _as_well(before: Fitted, top: Fitted, other: Fitted) -> bool:
    """Within two standard errors over the windows, and nearly as much of the gain."""
    lead = top.loglik - other.loglik
    error = float(np.std(lead, ddof=1)) * np.sqrt(len(lead))
    much = max(10.0, PART * (top.total - before.total))
    return lead.sum() < min(max(3.0, 2.0 * error), much)


def _imitates(trial: Trial, fitted: Fitted) -> bool:
    gain = next(p for p in fitted.predictor.model.effects if p.key == trial.key).block.gain
    low, high = fitted.intervals().get(f"{trial.key}.{gain}", (1.0, 1.0))
    return low <= 0.0 <= high


def _candidate(before: Fitted, trial: Trial, fitted: Fitted) -> Candidate:
    return Candidate(trial.name, fitted.total - before.total, _share(before, fitted))


def _inside(found: Fitted) -> Fitted:
    """The same model with its effects inside the plant, fitted once more."""
    predictor = Predictor(found.predictor.model, found.predictor.data)
    free = free_keys(predictor)
    return fit(predictor, found.values, free, found.where, found.noise, anchor=found.anchor)


def _left_over(base: Fitted, final: Fitted, steps: Sequence[Step]) -> tuple[bool, tuple[str, ...]]:
    """Whether something proven is left, and the signals that it hangs on.

    Where nothing tells, those on which what was found hangs: it may be a poor picture of one
    thing.
    """
    log = base.predictor.data.log
    before = missing_torque(base.predictor, base.values, base.where, base.noise)
    after = missing_torque(final.predictor, final.values, final.where, base.noise)
    now, first = (dependences(r, log, base.where.counted) for r in (after, before))
    weight = float(np.mean(after**2) / np.mean(before**2))
    standing = now[0].t > 3.0 and weight * now[0].share > LEFT_SHARE
    standing = standing and _share(base, final) < WHOLE
    friction = base.predictor.friction(base.values)[base.where.counted]
    quiet = missing_torque(final.predictor, final.values, final.where, final.noise)
    matters = np.std(quiet) > LEAST_SIZE * np.std(friction)
    loud = uneven(final.innovations)
    pieced = len(steps) == MOST_EFFECTS and _share(base, final) < PIECED
    if not matters or not (standing or loud or pieced or _coloured(final)):
        return False, ()
    hints = [d for d in (*now, *first) if d.share > LEFT_SHARE and d.t > SURE]
    if standing or hints:
        return True, now[0].signals if standing else max(hints, key=lambda d: d.t).signals
    if loud or in_bursts(before) or in_bursts(after):
        return True, ("t",)
    return True, signals_of([step.trial.name for step in steps])


def signals_of(names: Sequence[str]) -> tuple[str, ...]:
    """The signals that effects hang on; friction hangs on w."""
    made: list[str] = []
    for name in names:
        block = members("effect")[name]
        levels = {act.removeprefix("+") for act in block.acts}
        friction = "w" if {"Fc", "Fs", "Fv"} & levels else None
        made += [s for s in ("t" if block.timed else None, *block.inputs, friction) if s]
    return tuple(dict.fromkeys(made))


def _coloured(fitted: Fitted) -> bool:
    """Whether the innovations still tell the next one. A smoothed torque colours them by itself."""
    if fitted.predictor.data.smoothed:
        return False
    theta, w = colour(fitted.innovations)
    return bool(theta > COLOUR["theta"] or w > COLOUR["w"])

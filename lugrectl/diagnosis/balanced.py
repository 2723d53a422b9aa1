"""From a log and a declared model to values and errors: the work of a diagnosis and of an
identification, by the torque balance and a simulation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from time import perf_counter
from typing import Any

import numpy as np

from ..blocks.model import Model
from ..core.deadline import OutOfTime
from ..core.errors import InputError, Refused
from ..core.option_names import option
from ..estimates.balance import Balance
from ..estimates.covariance import Joint, Residuals
from ..record import Stretch
from ..torque_balance.maps import is_map
from ..torque_balance.values import (
    ModelValues,
    as_estimates,
    completed,
    lifted,
    model_values,
    plain_balance,
    told_by_balance,
    with_scale,
)
from ..torque_balance.verdict import Answer
from .asked import Asked
from .contradictions import contradicted, unfit_law
from .mapped import judged_on
from .result import moved, noted
from .simulation import Judged, Prepared, errors, polish, prepared, residuals, torque_noise

NO_INERTIA = (
    "The log does not determine the inertia, and none is declared: what is named does not depend "
    "on it, and no motion is simulated."
)
STOPPED = "the fit was stopped at its limit of time."
MORE_TIME = "Give it more time with {}, or a shorter part of the record."
OTHER_PLACES = (
    "the drive passes most places once, so that few are both in training and in held-out samples. "
    "The torque errors are of shorter parts in turn."
)
PLACES, SLOW = 36, 0.01  # in a turn or travel; of the top speed: slower has no direction
# s: lengths of blocks; those of 2 s, the least, may see one half of a periodic motion each
LENGTHS = (0.0, 2.7, 3.7, 5.3)


@dataclass(frozen=True, eq=False)
class Begun:
    """A log that is read and split."""

    asked: Asked
    start: float
    doubts: tuple[str, ...]
    ready: Prepared | None  # for simulations ...
    why_not: Refused | None  # ... or why it is not
    parts: Sequence[Stretch]  # for the balance, with what is held out
    held_out: Sequence[Any]

    @classmethod
    def of(cls, asked: Asked, horizon: float) -> Begun:
        """Refused where the log cannot answer as it was given."""
        start = perf_counter()
        asked.records()
        asked.refuse_open_time()
        doubts = asked.doubts()
        ready, why_not = ready_of(asked, horizon)
        both = judged_on(asked, ready.held_out if ready else ())
        return cls(asked, start, doubts, ready, why_not, *both)

    def ended(self, made: Answer, least: float) -> Ended:
        """The values and errors of what the balance answers."""
        asked, model, ready = self.asked, self.asked.model, self.ready
        found = made.last, made.interval, made.values, made.covariance
        values = model_values(made, model)
        plain = plain_balance(*found, made.sure, asked.stretches)
        sure = "J" in plain.parameters or model.known().get("J") is not None
        judged, noise, why_not = None, None, self.why_not
        if ready is not None and sure:
            judged, values, noise, why_not = simulated(ready, made, values, least)
        finer = {k: e for k, e in values.estimates.items() if e.ci95 is not None}
        known = {k: finer.get(k, e) for k, e in plain.parameters.items()}
        plain = replace(plain, parameters=known)  # one quantity has one value
        plain = asked.completed(plain, perf_counter() - self.start)
        values = values.beside(plain)
        values = values if sure else values.told(model)
        law = unfit_law(made, values.model, plain, least)
        doubts = self.doubts or asked.doubts(plain)
        if made.verdict not in ("found", "ambiguous"):  # else what is missing contradicts them
            doubts = doubts or contradicted(asked.stretches, model)
        rest = residuals(ready, values.model) if ready and judged else None
        return Ended(asked, made, values, plain, sure, judged, why_not, law, doubts, noise, rest)


@dataclass(frozen=True, eq=False)
class Ended:
    """What a fit and a simulation say, with what the results of both kinds hold in common."""

    asked: Asked
    made: Answer
    values: ModelValues
    plain: Balance
    sure: bool  # the inertia is known, by the log or by a declaration
    judged: Judged | None
    why_not: Refused | None
    law: str  # a sentence where the declared law is not that of the drive
    doubts: Sequence[str]
    noise: float | None
    rest: Residuals | None

    def notes(self, without_errors: str) -> list[str]:
        """What there is to say of the fit; the sentence on missing errors has their reason."""
        made, why = self.made, self.why_not
        notes = [*filter(None, [self.law]), *self.doubts, *made.notes]
        if names := ", ".join(dict.fromkeys(made.candidates)):
            notes.append(f"Candidates that are not certain: {names}.")
        if why is not None:
            notes.append(without_errors.format(why, why.experiment or "").rstrip())
        elif not (self.sure or made.view.is_map):
            notes.append(NO_INERTIA)
        return [*notes, *(self.judged.messages if self.judged else ())]

    def changes(self) -> list[str]:
        return moved(self.values.estimates, self.asked.model)

    def fields(self, notes: Sequence[str]) -> dict[str, Any]:
        judged, values, seen = self.judged, self.values, self.asked.seen
        return {
            "error": judged and judged.error,
            "traces": judged and judged.traces,
            "model": values.model,
            "declared": self.asked.model,
            "estimates": values.estimates,
            "joint": values.joint,
            "record": seen[0],
            "records": tuple(seen),
            "messages": noted(self.asked, notes),
            "residuals": self.rest,
            "torque_noise": self.noise,
            "plain": self.plain,
        }


def ready_of(asked: Asked, horizon: float) -> tuple[Prepared | None, Refused | None]:
    """The records split for simulations, or why they cannot be. Where every other block sees one
    half of a periodic motion, blocks are longer."""
    if is_map(asked.stretches):  # nothing moves that could be simulated
        return None, None
    records, holdout = asked.records(), asked.holdout()
    for length in LENGTHS:
        try:
            ready = prepared(records, asked.model, holdout, horizon, length)
        except Refused as no:
            if not length:
                return None, no
            continue
        if holdout is not None or _same_motion(ready):
            return ready, None
    return None, Refused(OTHER_PLACES)


def _same_motion(ready: Prepared) -> bool:
    """Whether most held-out samples lie at angles that training samples pass the same way."""
    seen, held_out = set[float](), set[float]()
    for i, run in enumerate(ready.runs):
        turn = 2 * np.pi if ready.model.motion == "rotary" else float(np.ptp(run.theta)) or 1.0
        way = np.sign(run.speed) * (np.abs(run.speed) > SLOW * np.abs(run.speed).max())
        place, out = 3 * (np.floor(run.theta / turn * PLACES) % PLACES) + way, 0 * run.t > 0
        for own, start, end in ready.held_out:
            out |= (own == i) & (run.t >= start) & (run.t <= end)
        seen |= {*np.unique(place[~out]).tolist()}
        held_out |= {*np.unique(place[out]).tolist()}
    return len(seen & held_out) > 0.5 * len(held_out)


def simulated(
    ready: Prepared, made: Answer, values: ModelValues, least: float
) -> tuple[Judged | None, ModelValues, float | None, Refused | None]:
    """Errors before and after, values of a last polish (of a clean log, or of a law of whose values
    the balance knows nothing), the noise of the torque, and why there is no error."""
    model, ready = made.view.model, as_it_acts(ready, made)
    refitted = completed(made.refitted, model, made.sure)
    trained = completed(made.trained, model, made.sure, made.parts)
    clean = made.with_names.stays < 2 * least * made.view.size  # a finer fit may be valid
    try:
        own_law = not told_by_balance(model)
        if (clean or own_law) and not made.only_inertia:
            start = _as_logged(values.joint, made)
            finer, own = _polished(ready, trained, values, start, own_law)
            if own_law or torque_noise(ready, finer) < least * made.view.size:
                trained, values = finer, own
                if made.named or made.parts:
                    refitted = _polished(ready, refitted, own, own.joint, own_law)[0]
                else:
                    refitted = trained
        full = None if None in model.values().values() else model
        models = {"declared": full, "refitted": refitted, "augmented": trained}
        return errors(ready, models), values, torque_noise(ready, values.model), None
    except OutOfTime:  # all else is known
        why_not = Refused(STOPPED, MORE_TIME.format(option("time_limit")))
    except Refused as no:
        why_not = no
    except InputError as no:
        why_not = Refused(str(no))
    return None, values, None, why_not


def as_it_acts(ready: Prepared, made: Answer) -> Prepared:
    """The same without what the columns of the runs have beside the torque and the speed: offsets
    (N m), a late torque (s) where no effect says so, and a w that is above the speed."""
    last, (x, low, high) = made.last, made.values["late"]
    own = [b for n, b in zip(last.design.names, last.fit.b.tolist(), strict=True) if n == "run"]
    runs = dict(zip(last.view.with_offset.tolist(), own, strict=True))
    every = last.values["offset"] if last.design.constant else 0.0
    offsets = {r: every + runs.get(r, 0.0) for r in np.unique(last.view.motion.run).tolist()}
    late = x * made.view.longest_hold if low > 0 or high < 0 else 0.0
    late = late if abs(late) > 0.5 * made.view.motion.dt else 0.0
    return ready.as_it_acts(offsets, late, made.view.w_above[0])


def polished_values(ready: Prepared, made: Answer) -> Model:
    """The model of training rows, at its likeliest values by one-step predictions."""
    model = made.view.model
    trained = completed(made.trained, model, made.sure)
    values = model_values(made, model)
    start = _as_logged(values.joint, made)
    return _polished(ready, trained, values, start, not told_by_balance(model))[0]


def _as_logged(joint: Joint, made: Answer) -> Joint:
    """The distribution for a fit that takes the torque as it was logged: J is not as uncertain as
    the motor's constant."""
    if "J" not in joint.names:
        return joint
    i, matrix = joint.names.index("J"), joint.matrix.copy()
    matrix[i, i] = max(matrix[i, i] - made.interval.of_constant, 0.01 * matrix[i, i])
    return replace(joint, matrix=matrix)


def _polished(
    ready: Prepared, trained: Model, values: ModelValues, start: Joint, always: bool
) -> tuple[Model, ModelValues]:
    """Values by one-step predictions, begun from those of the balance with their distribution."""
    own = values.model.declarations()
    free = own.keys() & trained.values().keys() - values.model.held()
    free = [k for k, p in own.items() if p.fitted and k in free]
    made = polish(ready, lifted(trained, ready.model), free, start, always)
    if not made.gained:
        return trained, values
    polished, joint = trained.with_values(made.values), with_scale(made.joint)
    estimates = {k: replace(e, value=made.values.get(k, e.value))
                 for k, e in values.estimates.items()}  # fmt: skip
    estimates |= as_estimates(joint, polished)
    model = values.model.with_values(made.values)
    return polished, replace(values, model=model, estimates=estimates, joint=joint)

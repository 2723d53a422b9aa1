"""The door: compare(stretches, model, plain)."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...blocks.model import Model
from ...core.numeric import rms
from ...record.stretches import Stretch
from ..balance import Balance, balance
from ..balance.constants import KNOWN_INERTIA
from ..balance.speed_channel import sensors_of
from ..balance.track import tracks_of
from ..candidates.base_model import WEIGHT, Base, Record
from ..candidates.candidate import Contender
from ..candidates.friction_shape import settled
from ..candidates.start_values import levels_of, values_of, zeros_of
from ..candidates.unknown_torque import MIDDLE
from ..regression.numbers import (
    ALPHA,
    FEW_STRETCHES,
    HELD,
    LEAST,
    LOST,
    MOST_ROWS,
    MOST_SAMPLES,
    OFF,
)
from ..regression.score import standard_error
from ..regression.smooth_motion import Motion, motion_of
from ..regression.weak_form import Width, quick, rows_of, spacing, usable, widths
from .budget import budget, detectable
from .comparison import Compared, Comparison, Named, place_of
from .stacking import stacked
from .table import Table, in_time
from .values import HeldOut, Valued, valued
from .verdict import Decision, decide, judged, unit_of, without

NOTHING = "The torque balance determines nothing: the record is too short."
SWINGS = (
    "What is not explained is a vibration of about {:.2g} Hz whose size and frequency drift: "
    "{:.3g} {} RMS, {:.2g} % of friction. It follows no signal of the log but the time."
)
SHORT = (
    "The drive slides for too short a time to compare explanations: {} windows of {:.2g} ms of it, "
    "of {} that are needed."
)


def compare(
    stretches: Sequence[Stretch],
    model: Model,
    plain: Balance,
    least: float = LEAST,
    alpha: float = ALPHA,
    held_out: HeldOut | None = None,
) -> Comparison:
    """What is missing from a declared model, by one comparison.

    The verdict is "refused", with the reason as its message, where the torque has nothing to do
    with the motion, or follows it.

    Parameters
    ----------
    stretches : sequence of Stretch
        The samples of one drive, from one log or several.
    model : Model
        The declared model.
    plain : Balance
        The plain answer of the same samples.
    least : float
        The smallest torque that matters, as a share of RMS friction torque.
    alpha : float
        Chance of naming something on a record on which nothing is missing.
    held_out : HeldOut or None
        Samples that the values for errors do not use.

    Returns
    -------
    Comparison
        Verdict, effects with start values (SI), table in nats, budget in N m and as shares of RMS
        friction torque. The equation is that of the package's docstring; models that explain
        equally well are kept in the spirit of Hansen, Lunde and Nason, *The model confidence set*,
        Econometrica 79(2), 2011. Rests are left out: there friction may be anything.
    """
    if not answered(plain):
        said = plain.refused or plain.blind or (plain.notes or (NOTHING,))[-1]
        return Comparison("refused", messages=(said,), least=least)
    began = time.perf_counter()
    with np.errstate(all="ignore"):  # a record without noise divides by nearly 0
        record = record_of(stretches, model, plain)
        if len(record.rows) < WEIGHT:  # fewer than it has terms
            said = SHORT.format(len(record.rows), 2e3 * record.rows.h, WEIGHT)
            return Comparison("refused", messages=(said,), least=least, stretches=0)
        found = decide(record, least, alpha)
        surer = _with_suspect(stretches, model, found)
        found = found if surer is None else decide(surer, least, alpha)
        made = _result(_held(found, model, (least, alpha)), model, least, held_out)
    return replace(made, seconds=time.perf_counter() - began)


def answered(plain: Balance) -> bool:
    """Whether there is anything with which to compare."""
    return bool(plain.names) and not (plain.refused or plain.blind)


def _with_suspect(stretches: Sequence[Stretch], model: Model, found: Decision) -> Record | None:
    """The record with the inertia of a balance that has the likeliest effect, if it is sure there.

    A torque that the plain balance does not know of may be what hides the inertia from it.
    """
    if found.suspect is None:
        return None
    more = model.with_effect(found.suspect.name, values_of(found.suspect, model))
    made = record_of(stretches, model, balance(stretches, more, sorted(model.held())))
    return made if made.sure else None


def alone(
    stretches: Sequence[Stretch],
    model: Model,
    plain: Balance,
    held_out: HeldOut | None = None,
    least: float = LEAST,
) -> Comparison:
    """The declared model alone on a record: its values, with nothing compared; "refused", with
    values to start a fit from, where the plain answer is, or the record too short for intervals."""
    with np.errstate(all="ignore"):
        base = in_time(settled(record_of(stretches, model, plain)))
        if not answered(plain) or len(base.record.rows) < WEIGHT:
            return Comparison("refused", alone=levels_of(base), least=least, stretches=0)
        own = valued(base, (), model, held_out)
        shares = budget(base, (), None, own)
    return Comparison(
        verdict="adequate",
        budget=tuple(shares),
        plant=_of_plant(own),
        alone=own.trained,
        least=least,
        written_late=base.written_late,
        stretches=base.record.independent,
        valued=own,
        friction=base.friction_rms,
    )


def _held(found: Decision, model: Model, limits: tuple[float, float]) -> Decision:
    """The decision without effects of which nothing may be there: the interval of their strength
    holds the value at which they change nothing."""
    for _ in found.effects:
        own = valued(found.last, _inside(found), model)
        if found.gravity is not None and own.may_be_nothing(found.gravity.name, whole=True):
            found = decide(found.last.record, *limits, weighed=False)
            continue
        inside, short = _inside(found), found.last.record.independent < FEW_STRETCHES
        gone = next((c for c in inside if own.may_be_nothing(c.name, short)), None)
        if gone is None:
            break
        found = judged(without(found, gone, *limits))
    return found


def _weighed(
    found: Decision, inside: Sequence[Contender], model: Model
) -> tuple[tuple[Named, ...], tuple[Named, ...]]:
    """The effects and the rivals of one of them, with the weights of those models, and the values
    of each rival's; gravity that joined the base has none."""
    effects = [_named(c, model) for c in found.effects]
    rivals = [_named(c, model) for c in found.alternatives]
    place = place_of(effects) if rivals else 0
    if rivals and found.effects[place] in inside:
        whole = [inside[-1].blocks, *(c.blocks for c in found.alternatives)]
        first, *others = stacked(whole)
        effects[place] = replace(effects[place], weight=first)
        for i, (c, weight) in enumerate(zip(found.alternatives, others, strict=True)):
            chain = [c if one is found.effects[place] else one for one in inside]
            rivals[i] = replace(rivals[i], weight=weight, valued=valued(c.base, chain, model))
    return tuple(effects), tuple(rivals)


def _inside(found: Decision) -> list[Contender]:
    """The named effects with torques of their own, without gravity that joined the base."""
    return [c for c in found.effects if c is not found.gravity and not found.only_inertia]


def _result(found: Decision, model: Model, least: float, held_out: HeldOut | None) -> Comparison:
    table, base = found.table, found.last
    assert table is not None
    inside = _inside(found)
    seen = found.verdict == "adequate" and base.record.sure
    unknown = _unknown(found, base)
    wave = unknown if found.verdict == "unexplained" and not found.events else None
    swings = None if wave is None else wave.values.get(MIDDLE)
    own = valued(base, inside, model, held_out)
    effects, alternatives = _weighed(found, inside, model)
    return Comparison(
        verdict=found.verdict,
        effects=effects,
        alternatives=alternatives,
        depends_on=tuple(sorted(found.depends_on)),
        rows=tuple(_rows(table)),
        budget=tuple(budget(base, inside, unknown, own)),
        detectable=tuple(detectable(table, least)) if seen else (),
        messages=(*found.messages, *([_vibration(wave, swings)] if wave and swings else [])),
        plant=_of_plant(own),
        alone=valued(table.base, (), model, held_out).trained,
        least=least,
        only_inertia=found.only_inertia,
        events=found.events,
        swings=swings,
        written_late=base.written_late,
        stretches=base.record.independent,
        valued=own,
        friction=base.friction_rms,
    )


def _of_plant(own: Valued) -> dict[str, float]:
    """Inertia and friction, without effects."""
    return {k: v for k, v in own.values.items() if "." not in k}


def _vibration(c: Contender, frequency: float) -> str:
    """How fast and how large an unknown torque is that swings in time."""
    return SWINGS.format(frequency, rms(c.torque), unit_of(c.base), 100.0 * c.share)


def _unknown(found: Decision, base: Base) -> Contender | None:
    """The unknown torque, beside the effects that are named."""
    table = found.table if found.beside is None or found.beside.base is not base else found.beside
    own = found.unknown
    if own is None or own.base is base or table is None or table.base is not base:
        return own
    return next((c for c in table.unknown if c.name == own.name), own)


def _named(c: Contender, model: Model) -> Named:
    return Named(c.name, values_of(c, model), c.share, zeros_of(c))


def _rows(table: Table) -> list[Compared]:
    """The declared model and all contenders, the best first."""
    base = table.base
    own = int(base.made.free.sum())
    rows = [Compared("declared", 0.0, 0.0, 0.0, own)]
    for c in table.rows:
        se = standard_error(c.blocks - c.base.score)
        rows.append(Compared(c.name, c.gain, se, c.share, own + c.own + len(c.values)))
    return rows


def record_of(stretches: Sequence[Stretch], model: Model, plain: Balance) -> Record:
    """Motion, windows and blocks of a record."""
    tracks = tracks_of(stretches)
    sensors, speeds, _ = sensors_of(tracks)
    if speeds is None and tracks[0].theta is None:
        sensors = replace(sensors, offset=plain.speed_offset)
    motion = motion_of(tracks, sensors, model.motion)
    declared = {k: v for k, v in model.known().items() if "." not in k}
    J, sure = _inertia(plain, declared)
    width, sure = _width(motion, declared, J, sure)
    held = (declared["J"] / OFF, np.inf) if declared.get("J") else J
    motion = motion.part(_share(motion, width.h))
    has = frozenset(model.friction.block.own)
    lag = None
    if speeds is not None and not sensors.one_source:
        lag = float(speeds.values[2]), float(np.sqrt(speeds.covariance[2, 2]))
    rows = rows_of(motion, width.h)
    made = Record.of(motion, rows, declared, held, sure, width.heavy, model.effects, has, lag)
    logged = plain.written_late(motion.dt)
    made = replace(made, logged=-logged, lighter=_lighter(plain, declared))
    return made.later(-logged) if logged else made


def _lighter(plain: Balance, declared: dict[str, float]) -> float | None:
    """The inertia of the plain answer, where it is certainly far below the declared one."""
    known = plain.parameters.get("J") or plain.uncertain.get("J")
    J = declared.get("J")
    far = J and known and known.ci95 and known.ci95[1] < J / OFF
    return known.value if known and far else None


def _share(m: Motion, h: float) -> float:
    """Share of a long motion that says enough."""
    return min(1.0, MOST_SAMPLES / len(m), MOST_ROWS * spacing(m, h) / len(m))


def _inertia(plain: Balance, declared: dict[str, float]) -> tuple[tuple[float, float] | None, bool]:
    """The inertia of the plain answer, widened, and whether it is known at all."""
    known = plain.parameters.get("J") or plain.uncertain.get("J")
    if known is None or known.ci95 is None:
        return None, bool(declared.get("J"))
    half = max(0.5 * (known.ci95[1] - known.ci95[0]), HELD * abs(known.value))
    sure = known.value > 0 and half < KNOWN_INERTIA * known.value
    if known.value > 0 and half < 0.3 * known.value:
        return (known.value - half, known.value + half), True
    return None, sure or bool(declared.get("J"))


def _width(
    m: Motion, declared: dict[str, float], J: tuple[float, float] | None, sure: bool
) -> tuple[Width, bool]:
    """The narrowest windows in which noise is small, with the inertia that is known.

    A torque that wider windows average away may be what is missing.
    """
    known = declared.get("J")
    inertia = known or (None if J is None else 0.5 * (J[0] + J[1]))
    tried: list[Width] = []
    for h in widths(m):
        one = quick(m, h, inertia, declared.get("Fc"))
        if one is not None:
            tried.append(one)
            if inertia and usable(one, declared=bool(known)):
                return one, sure
    if not tried:
        return Width(widths(m)[0], np.nan, np.nan, 1.0, np.inf, 1.0, False, 0.0), False
    least = min(tried, key=lambda w: max(w.noisy, w.lost / LOST))
    good = [w for w in tried if usable(w, declared=False)]
    return (good or [least])[0], sure and inertia is not None

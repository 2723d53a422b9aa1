"""Fit the declared model alone."""

from __future__ import annotations

from typing import Any

from ..blocks.model import Model
from ..core.errors import Refused
from ..core.progress import Progress, reporter
from ..friction_maps.low_speed import as_shown
from ..friction_maps.points import is_map
from ..identification.selection import alone
from ..record import Record, unlikely_time
from .duplicate_messages import with_plain
from .identify import Identification
from .judged import judged
from .other_law import lacking
from .plain_answer import plainly
from .question import Asked, judged_by
from .steady_runs import (
    Fits,
    begin_map,
    errors_of,
    estimates_of,
    final_model,
    map_of,
    messages_of,
)
from .study import prepared, residuals
from .winning_model import winner

ONLY_PLAIN = "The values are those of the torque balance alone, without errors of a simulation: {}"
OF_CHANNELS = frozenset(("u_delay", "w_gain", "w_offset", "w_lag", "drift"))


def identified(
    record: Any, model: Any, holdout: Any, horizon: Any, seed: Any, reading: Any, progress: Any
) -> Identification:
    asked = Asked.of(record, model, holdout, **reading)
    horizon, seed = judged_by(horizon, seed)
    report = reporter(progress)
    report(0.0, "torque balance")
    if asked.plain.hopeless:  # the plain answer first: it stands whatever follows
        no = Refused(" ".join(asked.plain.against))
        no.plain = asked.plain
        raise no
    try:
        found = _finer(asked, horizon, report)
    except Refused as no:
        found = _plainly(asked, no)
    return with_plain(found, asked)


def _plainly(asked: Asked, no: Refused) -> Identification:
    """What the torque balance knows where the finer fit is refused.

    Refused if it knows nothing of the drive; how its sensors behave is no answer, and no value is
    one as long as the unit of t is open.
    """
    plain, model = asked.plain, asked.model
    known = plain.parameters.keys() - OF_CHANNELS or plain.combinations
    if not known or any(unlikely_time(one) for one in asked.seen):
        no.plain = plain
        raise no
    known, answered = plainly(plain, model)
    said = asked.seen[0].messages if asked.seen and not asked.several else ()
    return Identification(
        estimates=known,
        error=None,
        model=answered,
        record=asked.seen[0] if asked.seen else None,
        messages=(*model.remarks(), *said, ONLY_PLAIN.format(no)),
        declared=model,
    )


def _finer(asked: Asked, horizon: float, report: Progress) -> Identification:
    """The model at its values with errors; Refused where the record cannot give them."""
    record, model = asked.records(), asked.model
    holdout = asked.holdout()
    if not isinstance(record, Record) and is_map(record):
        return _map_identified(begin_map(record, model, holdout, report), model)
    asked.refuse_unfit()
    ready = prepared(record, model, holdout, horizon)
    plain = asked.plain
    found = alone(plain.stretches, asked.completed, plain, held_out=ready.held_out)
    ready = ready.begun_from(plain, asked.starts(found.alone), found.written_late)
    won = winner(ready, found, report)
    own = judged(won, asked)
    if own.failed:
        raise Refused(own.failed)
    lacks = lacking(found, model, plain)
    return Identification(
        estimates=own.estimates,
        error={k: v for k, v in own.scored["error"].items() if k != "augmented"},
        model=won.whole.predictor.model.with_values(won.whole.values),
        record=own.job.records[0],
        messages=(*([lacks] if lacks else []), *own.job.messages),
        declared=model,
        traces=own.traces,
        joint=won.joint,
        residuals=residuals(won.whole),
        torque_noise=won.whole.torque_noise,
    )


def _map_identified(fits: Fits, declared: Model) -> Identification:
    """The declared friction fitted to all points of a map of runs at steady speed."""
    whole = as_shown(fits.everywhere, fits.declared)
    error = errors_of(fits, fits.base)
    return Identification(
        estimates=estimates_of(whole),
        error={k: v for k, v in error.items() if k != "augmented"},
        model=final_model(fits, whole),
        record=fits.records[0],
        messages=messages_of(fits, whole),
        declared=declared,
        map=map_of(fits, whole, {"refitted": fits.base}),
    )

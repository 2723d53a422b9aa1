"""Simulated cases as records and models, and the refitted model that a diagnosis begins with."""

from lugrectl import diagnose
from lugrectl.blocks.model import Model, model_from_dict
from lugrectl.diagnosis.question import Asked
from lugrectl.diagnosis.result import Diagnosis
from lugrectl.diagnosis.study import Job, begin, prepared
from lugrectl.identification.selection import alone
from lugrectl.record import Record

from ..rig import Case


def quiet(*_) -> None:
    """No progress is shown."""


def record_of(case: Case) -> Record:
    """The columns of a case as a record."""
    c = {k: v for k, v in case.columns.items() if k != "t"}
    t = case.columns["t"]
    motion = case.model["motion"]
    return Record(t=t, dt=(t[-1] - t[0]) / (len(t) - 1), motion=motion, **c)


def model_of(case: Case) -> Model:
    """The model that a case declares."""
    return model_from_dict(case.model, "case")


def begun(
    record: Record | list[Record],
    model: Model,
    holdout: str | Record | None = None,
    horizon: float = 1.0,
) -> Job:
    """The declared model refitted to the training samples of a record, or of several."""
    asked = Asked.of(record, model)
    friction = alone(asked.plain.stretches, model, asked.plain).alone
    ready = prepared(record, model, holdout, horizon)
    return begin(ready.from_values(asked.starts(friction)), quiet)


def verdict(case: Case) -> tuple[Diagnosis, list[str]]:
    """The diagnosis of a case, and the names of the effects in it."""
    found = diagnose(record_of(case), model_of(case))
    return found, [effect.name for effect in found.effects]

"""Simulated cases as records and models, and what is said of them."""

from lugrectl import diagnose
from lugrectl.blocks.model import Model, model_from_dict
from lugrectl.diagnosis.result import Diagnosis
from lugrectl.record import Record

from ..drives import Case


def record_of(case: Case) -> Record:
    """The columns of a case as a record."""
    c = {k: v for k, v in case.columns.items() if k != "t"}
    t = case.columns["t"]
    motion = case.model["motion"]
    return Record(t=t, dt=(t[-1] - t[0]) / (len(t) - 1), motion=motion, **c)


def model_of(case: Case) -> Model:
    """The model that a case declares."""
    return model_from_dict(case.model, "case")


def verdict(case: Case) -> tuple[Diagnosis, list[str]]:
    """The diagnosis of a case, and the names of the effects in it."""
    found = diagnose(record_of(case), model_of(case))
    return found, [effect.name for effect in found.effects]

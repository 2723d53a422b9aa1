"""Records of this simulator as questions: one effect (``effect``, ``unknown``) or ``none``."""

from __future__ import annotations

from ..scores.question import Question
from .effects import CATALOGUE, STRANGERS, find
from .sample import sample


def draw(seed: int, kind: str) -> Question:
    """The question of a seed; the same one each time."""
    names = {"effect": [*CATALOGUE], "unknown": [*STRANGERS]}.get(kind, ["none"])
    name = names[seed % len(names)]
    case = sample(name, seed)
    truth = case.truth
    values = {k: truth["plant"][k] for k in ("J", "Fc", "Fv")}
    if name in CATALOGUE:
        values |= {f"{name}.{k}": v for k, v in truth["parameters"].items()}
    signals = (frozenset(find(name).depends_on),) if name in STRANGERS else ()
    rms = truth["effect_rms"], truth["friction_rms"]
    about = f"{truth['machine']} {truth['excitation']} {truth['rate']:g} Hz"
    return Question(
        seed, kind, case.columns, case.model, name, values, signals,
        hidden=rms[0], friction=rms[1], about=about,
    )  # fmt: skip

"""Effects that a model may be missing, and the signals on which effects depend."""

from __future__ import annotations

from collections.abc import Sequence

from ...blocks.block import Block, members
from ...blocks.model import Model
from .search_ranges import grid_of

TURNING = ("gravity", "encoder_eccentricity")  # once per turn: not tried on a linear axis


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
        again = name in used and not any(_repeats(made, key) for key in made.own)
        idle = len(levels) == len(made.acts) and not levels & has
        turning = name in TURNING and model.motion == "linear"
        own = {k for k, p in made.own.items() if p.fitted}
        if not (again or idle or turning or has & own):
            names.append(name)
    return names


def _repeats(made: Block, key: str) -> bool:
    """True if two effects of a kind can differ in it: another harmonic, the other side."""
    p = made.own[key]
    return bool(p.choices) or (grid_of(made, key) is not None and p.unit != "s")


def signals_of(names: Sequence[str]) -> tuple[str, ...]:
    """The signals that effects depend on; friction depends on w."""
    made: list[str] = []
    for name in names:
        block = members("effect")[name]
        levels = {act.removeprefix("+") for act in block.acts}
        friction = "w" if {"Fc", "Fs", "Fv"} & levels else None
        made += [s for s in (*block.reads, friction) if s]
    return tuple(dict.fromkeys(made))

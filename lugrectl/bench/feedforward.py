"""The torque of a model's effects, computed from the measured motion, for feed-forward."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import control as ct

from ..blocks.block import Block
from ..blocks.model import Model, Part
from ..blocks.plant import assemble
from ..estimates.findings import Table

_REASONS = (
    ("input", "it acts between the command and the motor"),
    ("sensor", "it acts on the sensor signals only"),
    ("J", "it changes the inertia"),
)


def _why_not(block: Block) -> str | None:
    """Why an effect's torque cannot be fed forward; None if it can."""
    if "load_inertia" in block.own:
        return "the second mass is not measured"
    return next((why for act, why in _REASONS if act in block.acts), None)


def sorted_out(
    model: Model, table: Table | None
) -> tuple[tuple[str, ...], tuple[tuple[str, str], ...]]:
    """Return what of a model's effects and a table is compensated, and what is not and why."""
    reasons = {part.key: _why_not(part.block) for part in model.effects}
    if table is not None:
        on_u = table.signals[0] == "u"
        reasons[table.name] = "it depends on the torque itself" if on_u else None
    fed = tuple(k for k, why in reasons.items() if why is None)
    return fed, tuple((k, why) for k, why in reasons.items() if why is not None)


def effects_torque(model: Model, *, name: str = "effects") -> ct.NonlinearIOSystem | None:
    """The torque of a model's effects from the measured motion: inputs w_m, theta_m, output u.

    None if no effect of the model can be compensated. The torque is computed by the equations of
    the plant: with u = 0 the resisting torque is -J dw/dt.
    """
    parts = tuple(part for part in model.effects if _why_not(part.block) is None)
    if not parts:
        return None
    made = _torque_block(replace(model, effects=parts), parts)
    known = model.known()
    return made.system(
        name=name,
        inputs=["w_m", "theta_m"],
        outputs=["u"],
        **{k: known[k] for k in made.parameters},
    )


def _torque_block(model: Model, parts: Sequence[Part]) -> Block:
    idle = all(part.block.acts == ("torque",) and not part.block.states for part in parts)
    return _Resisting(assemble(model), assemble(replace(model, effects=())), idle).block()


@dataclass(frozen=True)
class _Resisting:
    """What the plant ``full`` resists at u = 0 beyond the plant ``bare``, which has no effects.

    ``idle``: the effects are torques without states, so that the friction is the same in both.
    """

    full: Block
    bare: Block
    idle: bool

    def __call__(self, t: Any, w: Any, theta: Any, *x: Any, **values: Any) -> tuple[Any, ...]:
        first, second = len(self.full.states) - 2, len(self.bare.states) - 2
        given = (0.0,) * (first + second) if self.idle else x
        F, _, dw, *rates = self.full(t, 0.0, 0.0, theta, w, *given[:first], **values)
        resisting = -values["J"] * dw
        if self.idle:  # both contain the same friction, which cancels
            return (resisting - F,)
        own = {k: values[k] for k in self.bare.parameters}
        alone, _, _, *others = self.bare(t, 0.0, 0.0, theta, w, *given[first:], **own)
        return resisting - alone, *rates, *others

    def block(self) -> Block:
        full, bare = self.full.states[2:], self.bare.states[2:]
        return Block(
            name="effects",
            kind="controller",
            function=self,
            inputs=("w", "theta"),
            outputs=("u",),
            states=() if self.idle else (*full, *(f"{s}_bare" for s in bare)),
            parameters=self.full.parameters,
            timed=True,
        )

"""The controller of a drive that compensates friction, between its sensor and its torque."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from ..blocks import controllers
from ..blocks.model import Model
from ..blocks.observers import observer, observer_block
from .parts import error_s

MEASURED = {"w": "w_m", "theta": "theta_m", "u": "u_fb"}
REFERENCE = ("r", "dr", "ddr")


@dataclass(frozen=True)
class Control:
    """A PI of the speed or a PID of the position by its gains ``feedback``, and an observer by its
    name and its ``gains``. ``ahead``: J times the acceleration of the reference is added."""

    kind: str
    feedback: Mapping[str, float]
    observer: str | None = None
    gains: Mapping[str, Any] = field(default_factory=dict)
    ahead: bool = True

    def blocks(self, p: Model) -> list[Any]:
        """Return the blocks from w_m, theta_m, r and its derivatives to u, by the model p.

        u_fb is u without what else puts out u; ``compensation.scale`` is the share of Fhat in it.
        """
        made = observer_block("no_observer" if self.observer is None else self.observer)
        measured = MEASURED[controllers.MEASURED[self.kind]]
        seen = [MEASURED.get(s, s) for s in made.inputs]
        own: Any = {"outputs": ["u_fb"]}
        return [
            controllers.error(self.kind, inputs=["r", measured]),
            *self._feedback(own),
            *[controllers.feedforward(p, self.kind, **own)] * self.ahead,
            observer(made.name, p, inputs=seen, **self.gains),
            controllers.compensation(1.0, **own),
            controllers.compensation(name="drive", inputs=["u_fb"]),
            *([error_s(self.kind, None, MEASURED)] if "s" in made.inputs else []),
        ]

    def _feedback(self, own: Any) -> list[Any]:
        if self.kind == "velocity":
            return [controllers.pi(**self.feedback, **own)]
        # D on the velocity error: on w alone it would act against the reference motion
        error = controllers.error(name="error_w", inputs=["dr", "w_m"], outputs=["e_w"])
        return [error, controllers.pid(**self.feedback, inputs=["e", "e_w"], **own)]


def read_of(parts: list[Any]) -> list[str]:
    """Return the reference and those of its derivatives that the blocks read."""
    read = {signal for block in parts for signal in block.input_labels}
    return [signal for signal in REFERENCE if signal in read]

"""What is equal for all observers that are compared, and the loop of one of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import control as ct
import numpy as np

from ..blocks.drive import dead_time
from ..blocks.model import Model
from ..blocks.observers import observer_block
from ..blocks.plant import plant, sensor
from ..engine.runtime.sampled_run import interpreted
from ..loops.compensated import Control, read_of
from ..loops.parts import connected
from ..simulation.encoder import Sensing
from .loop import FASTEST, SampledLoop, Task

LAM = 20.0  # 1/s, of the sliding error in a position loop
OUTPUTS = ("theta", "w", "Fhat", "u", "e")


@dataclass(frozen=True)
class Terms:
    """What is equal for all observers, and how their own feedback is made up for.

    An observer that is corrected by k e is a controller k (sigma1 s + sigma0)/(s + a) as well,
    a = sigma0 |w|/h(w). The others get the same as kp + sigma1 k and ki + sigma0 k. ``designed``
    holds the gains of observers by name; k goes before a k in it. ``ahead``: the velocity loop
    has the feed-forward J dr; the position loop always has J ddr. ``bodies``: drives already built.
    """

    model: Model
    k: float
    equal: bool
    designed: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    ahead: bool = False
    bodies: dict[Any, Any] = field(default_factory=dict)

    def values(self) -> dict[str, float]:
        """Return the parameters of the drive that have a value."""
        return {k: v for k, v in self.model.values().items() if v is not None}

    def feedback(self, name: str, gains: Mapping[str, float]) -> dict[str, float]:
        """Return the gains of the controller beside an observer."""
        known = self.values()
        if not self.equal or corrected(name) or "sigma0" not in known:
            return dict(gains)
        extra = {"kp": self.k * known.get("sigma1", 0.0), "ki": self.k * known["sigma0"]}
        return {g: v + extra.get(g, 0.0) for g, v in gains.items()}

    def own(self, name: str, kind: str) -> dict[str, Any]:
        """Return the gains of an observer; s contains 20 e of position, as its k allows for."""
        gains = dict(self.designed.get(name, {}))
        if not corrected(name):
            return gains
        on_s = "s" in observer_block(name).inputs and kind == "position"
        return gains | {"k": self.k / LAM if on_s else self.k}

    def control(
        self, name: str, kind: str, gains: Mapping[str, float], believed: Mapping[str, float]
    ) -> list[Any]:
        """Return the blocks of the controller; ``believed``: parameters of the observer in place of
        those of the drive."""
        known = {k: v for k, v in believed.items() if k in observer_block(name).parameters}
        own, ahead = self.own(name, kind) | known, self.ahead or kind == "position"
        return Control(kind, self.feedback(name, gains), name, own, ahead).blocks(self.model)

    def closed(self, name: str, kind: str, gains: Mapping[str, float]) -> Any:
        """Return the loop in continuous time: inputs r and its derivatives, noise of position and
        velocity, the load torque d."""
        parts = [
            plant(self.model, inputs=["u_late", "d"]),
            dead_time(0.0, inputs=["u"], outputs=["u_late"]),
            sensor(self.model, outputs=["w_s", "theta_s"]),
            ct.summing_junction(["theta_s", "n_theta"], "theta_m", name="encoder"),
            ct.summing_junction(["w_s", "n_w"], "w_m", name="speed"),
            *self.control(name, kind, gains, {}),
        ]
        inputs = [*read_of(parts), "n_theta", "n_w", "d"]
        return connected(parts, inputs, OUTPUTS, f"{observer_block(name).name}_{kind}_loop")

    def run(
        self,
        control: Sequence[Any],
        kind: str,
        sensing: Sensing,
        fastest: float,
        rows: Mapping[str, np.ndarray],
    ) -> dict[str, np.ndarray]:
        """Return the signals of a sampled drive by name; ``fastest``: the largest speed of its
        reference. Raises Diverged."""
        task = Task(self.model, kind, {}, noisy=False)
        loop = SampledLoop(task, sensing, control, FASTEST * fastest, bodies=self.bodies)
        with interpreted():  # each loop runs a few times only
            return loop.run(rows)


def corrected(name: str) -> bool:
    """Return whether an observer is corrected by the tracking error."""
    made = observer_block(name)
    return bool({"e", "s"} & {*made.inputs}) and "k" in made.parameters


def wrong(
    name: str, known: Mapping[str, float], groups: Sequence[Sequence[str]], off: Mapping[Any, float]
) -> dict[str, dict[str, float]]:
    """Return what an observer may believe, by the words for it: each group of its parameters wrong
    together, by shares of their values, each way."""
    needs, cases = observer_block(name).parameters, {}
    for group in groups:
        keys = [k for k in group if k in needs and known.get(k)]
        for way in (-1.0, 1.0) if any(off.get(k) for k in keys) else ():
            factors = {k: 1.0 + way * off.get(k, 0.0) for k in keys}
            largest = max(factors.values(), key=lambda factor: abs(factor - 1.0))
            cases[f"{', '.join(keys)} x{largest:g}"] = {k: f * known[k] for k, f in factors.items()}
    return cases

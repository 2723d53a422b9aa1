"""The loop in which observers are compared: one encoder with noise, a dead time, a controller."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import control as ct

from ..blocks import controllers
from ..blocks.drive import dead_time
from ..blocks.model import Model
from ..blocks.observers import observer, observer_block
from ..blocks.plant import plant
from ..blocks.sliding_control import sliding_error

LAM = 20.0  # 1/s, of the sliding error in a position loop
OUTPUTS = ("theta", "w", "Fhat", "u", "e")
MEASURED = {"theta": "theta_m", "w": "w_m"}


@dataclass(frozen=True)
class Terms:
    """What is equal for all observers, and how their own feedback is made up for.

    An observer that is corrected by k e is a controller k (sigma1 s + sigma0)/(s + a) as well,
    a = sigma0 |w|/h(w). The others get the same as kp + sigma1 k and ki + sigma0 k. ``designed``
    holds the gains of observers by name; k goes before a k in it. ``ahead``: the velocity loop
    has the feed-forward J dr; the position loop always has J ddr.
    """

    model: Model
    k: float
    equal: bool
    designed: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    ahead: bool = False

    def values(self) -> dict[str, float]:
        """The parameters of the drive that have a value."""
        return {k: v for k, v in self.model.values().items() if v is not None}

    def feedback(self, name: str, gains: Mapping[str, float]) -> dict[str, float]:
        """The gains of the controller beside an observer."""
        known = self.values()
        if not self.equal or corrected(name) or "sigma0" not in known:
            return dict(gains)
        extra = {"kp": self.k * known.get("sigma1", 0.0), "ki": self.k * known["sigma0"]}
        return {g: v + extra.get(g, 0.0) for g, v in gains.items()}

    def own(self, name: str, kind: str) -> dict[str, Any]:
        """The gains of an observer; s contains 20 e of position, which its k makes up for."""
        gains = dict(self.designed.get(name, {}))
        if not corrected(name):
            return gains
        on_s = "s" in observer_block(name).inputs and kind == "position"
        return gains | {"k": self.k / LAM if on_s else self.k}


def corrected(name: str) -> bool:
    """Whether an observer is corrected by the tracking error."""
    made = observer_block(name)
    return bool({"e", "s"} & {*made.inputs}) and "k" in made.parameters


def around(
    terms: Terms, name: str, kind: str, gains: Mapping[str, Any], believed: Mapping[str, float]
) -> list[Any]:
    """Error, observer, controller and what they need, between theta_m, w_m and u.

    ``believed``: parameters of the observer in place of those of the drive.
    """
    made, position = observer_block(name), kind == "position"
    own: dict[str, Any] = terms.own(name, kind) | {
        k: v for k, v in believed.items() if k in made.parameters
    }
    seen = [MEASURED.get(s, s) for s in made.inputs]
    parts = [
        controllers.error(kind, inputs=["r", MEASURED[controllers.MEASURED[kind]]]),
        observer(name, terms.model, inputs=seen, **own),
        controllers.compensation(),
    ]
    if position:  # D on the velocity error: on w alone it would act against the reference
        parts += [
            controllers.error("velocity", name="slip", inputs=["dr", "w_m"], outputs=["e_w"]),
            controllers.pid(**gains, inputs=["e", "e_w"]),
            controllers.feedforward(terms.model, "position"),
        ]
    else:
        parts.append(controllers.pi(**gains))
        parts += [controllers.feedforward(terms.model, "velocity")] * terms.ahead
    if "s" in made.inputs:
        read = ["theta_m", "w_m", "r", "dr", "ddr"] if position else ["w_m", "r", "dr"]
        parts.append(sliding_error(LAM, kind, inputs=read))
    return parts


def closed(terms: Terms, name: str, kind: str, gains: Mapping[str, Any]) -> Any:
    """The loop of a kind in continuous time.

    Inputs: r and its derivatives, noise of position and velocity, the load torque d.
    """
    derivatives = ["dr", "ddr"] if kind == "position" else []
    if not derivatives and "s" in observer_block(name).inputs:
        derivatives = ["dr"]
    parts = [
        plant(terms.model, inputs=["u_late", "d"]),
        dead_time(0.0, inputs=["u"], outputs=["u_late"]),
        ct.summing_junction(["theta", "n_theta"], "theta_m", name="encoder"),
        ct.summing_junction(["w", "n_w"], "w_m", name="speed"),
        *around(terms, name, kind, gains, {}),
    ]
    return ct.interconnect(
        parts,
        inputs=["r", *derivatives, "n_theta", "n_w", "d"],
        outputs=list(OUTPUTS),
        params={},
        check_unused=False,
        name=f"{observer_block(name).name}_{kind}_loop",
    )

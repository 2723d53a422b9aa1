"""The plant J dw/dt = u - F - d, with the friction and the effects of a whole model inside."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import control as ct

from ..errors import InputError
from ..spec import Block, P
from .friction import J

if TYPE_CHECKING:
    from ..model import Model, Parameters


def acceleration(u: Any, F: Any, d: Any, J: Any) -> Any:
    """dw/dt = (u - F - d) / J (eq. mechanical_sys1, with a load torque d)."""
    return (u - F - d) / J


@dataclass(frozen=True)
class _Part:
    """A friction law or effect inside the plant: where its parameters and states stand."""

    prefix: str
    block: Block

    @property
    def states(self) -> tuple[str, ...]:
        return tuple(self.prefix.replace(".", "_") + name for name in self.block.states)

    def own(self, values: Mapping[str, Any]) -> dict[str, Any]:
        return {k: values[self.prefix + k] for k in self.block.parameters}

    def evaluate(
        self, signals: Mapping[str, Any], values: Mapping[str, Any]
    ) -> tuple[Any, tuple[Any, ...]]:
        """The part's output and its rates."""
        args = [signals["t"]] if self.block.timed else []
        args += [signals[name] for name in self.block.inputs]
        args += [signals[name] for name in self.states]
        out, *rates = self.block(*args, **values)
        return out, tuple(rates)


def assemble(model: Model, *, levels: Sequence[str] = ()) -> Block:
    """The plant of a model as one block with inputs u, d and outputs theta, w, F.

    For each name in ``levels`` there is one more input ``x_name``, by which that parameter is
    multiplied as 1 + x: an effect on a level can then be fed in as a series.
    """
    friction = _Part("", model.friction.block)
    effects = [_Part(f"{use.key}.", use.block) for use in model.effects]
    parts = [friction, *effects]
    states = ["theta", "w", *(name for part in parts for name in part.states)]

    inputs = ("u", "d", *(f"x_{name}" for name in levels))

    def function(t: Any, *given: Any, **values: Any) -> tuple[Any, ...]:
        signals = {"t": t, **dict(zip((*inputs, *states), given, strict=True))}
        rates: dict[str, tuple[Any, ...]] = {}
        scaled, torque = dict(values), signals["d"]
        for name in levels:
            scaled[name] = scaled[name] * (1.0 + signals[f"x_{name}"])
        for part in effects:
            out, rates[part.prefix] = part.evaluate(signals, part.own(values))
            if part.block.acts == ("input",):
                signals["u"] = out
            elif part.block.acts == ("torque",):
                torque = torque + out
            else:
                for name in part.block.acts:
                    if name in scaled:
                        scaled[name] = scaled[name] * (1.0 + out)
        F, rates[""] = friction.evaluate(signals, friction.own(scaled))
        dw = acceleration(signals["u"], F, torque, scaled["J"])
        flat = [rate for part in parts for rate in rates[part.prefix]]
        return F, signals["w"], dw, *flat

    return Block(
        name="plant",
        kind="plant",
        function=function,
        inputs=inputs,
        outputs=("theta", "w", "F"),
        states=tuple(states),
        parameters={"J": J, **_parameters(parts)},
        timed=True,
    )


def _parameters(parts: Sequence[_Part]) -> dict[str, P]:
    return {part.prefix + k: p for part in parts for k, p in part.block.parameters.items()}


def plant(
    of: Parameters | Model,
    *,
    name: str = "plant",
    inputs: Sequence[str] | None = None,
    outputs: Sequence[str] | None = None,
) -> ct.NonlinearIOSystem:
    """The drive J dw/dt = u - F - d as a block: inputs u, d (N m), outputs theta, w, F.

    Parameters
    ----------
    of : Parameters or Model
        LuGre parameters, or a whole model: friction, input, level and torque effects inside.
    name, inputs, outputs : str, list of str
        Block name and, in order, other names for the signals.

    Returns
    -------
    control.NonlinearIOSystem
        States theta, w, the friction's z, then those of the effects; parameters keyed
        ``plant.J``, ``plant.Fc``, ``plant.gravity.amplitude`` ...

    Raises
    ------
    InputError
        When a parameter has no value yet.

    Notes
    -----
    Source paper, eq. mechanical_sys1. theta is the integral of w and is not wrapped.
    """
    from ..model import Model

    model = of if isinstance(of, Model) else Model.of(of)
    values = model.values()
    missing = [k for k, v in values.items() if v is None]
    if missing:
        raise InputError(f"{model.name}: {', '.join(missing)} has no value; identify it first.")
    made = assemble(model)
    return made.system(name=name, inputs=inputs, outputs=outputs, **values)

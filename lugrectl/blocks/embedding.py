"""A friction law or an effect inside a model: the names of its parameters and states there."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from .block import Block, P


def borrowed(block: Block, plant: Mapping[str, Any]) -> dict[str, Any]:
    """The values that an effect shares with the plant, by name.

    For a friction law without Fs, Fs = Fc; without Fc, both are 0. Other parameters that the law
    does not have (vs, eps) keep the effect's default.
    """
    fallback = {"Fc": 0.0, "Fs": plant.get("Fc", 0.0)}
    return {
        k: plant.get(k, fallback.get(k, p.value)) for k, p in block.parameters.items() if p.shared
    }


@dataclass(frozen=True)
class Part:
    """A block whose parameters and states get a prefix."""

    prefix: str
    block: Block

    @property
    def states(self) -> tuple[str, ...]:
        return tuple(self.prefix.replace(".", "_") + name for name in self.block.states)

    @property
    def parameters(self) -> dict[str, P]:
        return {self.prefix + k: p for k, p in self.block.own.items()}

    def arguments(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """The block's parameters, its own and shared ones, from the values of the plant."""
        own = {k: values[self.prefix + k] for k in self.block.own}
        return own | borrowed(self.block, values)

    def results(self, signals: Mapping[str, Any], values: Mapping[str, Any]) -> tuple[Any, ...]:
        """The block's outputs, then its rates, for the signals and values of the whole plant."""
        args = [signals["t"]] if self.block.timed else []
        args += [signals[name] for name in (*self.block.inputs, *self.states)]
        return self.block(*args, **self.arguments(values))

    def outputs(self, results: Sequence[Any]) -> dict[str, Any]:
        return dict(zip(self.block.fresh, results, strict=False))

    def rates(self, results: Sequence[Any]) -> tuple[Any, ...]:
        return tuple(results[len(self.block.fresh) :])


def through_sensors(
    sensors: Sequence[Part],
    signals: Mapping[str, Any],
    values: Mapping[str, Any],
    rates: dict[str, tuple[Any, ...]],
) -> tuple[Any, Any]:
    """w and theta after all sensors in series; the sensors' rates are stored in ``rates``."""
    w, theta = signals["w"], signals["theta"]
    for part in sensors:
        results = part.results({**signals, "w": w, "theta": theta}, values)
        said, rates[part.prefix] = part.outputs(results), part.rates(results)
        w, theta = said["w_m"], said["theta_m"]
    return w, theta

"""The plant J dw/dt = u - F - d, with the friction and the effects of a model."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar, Unpack

from ..core.errors import InputError
from .block import Block, P
from .effects import load_motion
from .factories import Names, factory
from .friction import J
from .model import Model, Parameters, as_model

if TYPE_CHECKING:
    import control as ct


def borrowed(block: Block, plant: Mapping[str, Any]) -> dict[str, Any]:
    """The plant's values that an effect shares: without Fs, Fs = Fc; without Fc, both are 0."""
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

    def outputs(
        self, signals: Mapping[str, Any], values: Mapping[str, Any], rates: Rates
    ) -> tuple[Any, ...]:
        """The outputs for signals and values of the whole plant; the rates go into ``rates``."""
        args = [signals["t"]] if self.block.timed else []
        args += [signals[name] for name in (*self.block.inputs, *self.states)]
        own = {k: values[self.prefix + k] for k in self.block.own}
        results = self.block(*args, **own, **borrowed(self.block, values))
        count = len(self.block.fresh)
        rates[self.prefix] = results[count:]
        return results[:count]


Rates = dict[str, tuple[Any, ...]]  # of the states of each part, by its prefix


def acceleration(u: Any, F: Any, d: Any, J: Any) -> Any:
    """dw/dt = (u - F - d) / J (eq. mechanical_sys1, with a load torque d)."""
    return (u - F - d) / J


def assemble(model: Model, *, sensed: bool = False, loads: Sequence[str] = ()) -> Block:
    """The plant of a model as one block with inputs u, d and outputs theta, w, F.

    Effects act in physical order, STAGES, within a group in the order of the model. ``sensed`` adds
    the outputs theta_m, w_m with the sensor effects inside, ``loads`` theta_load, w_load of these
    couplings.
    """
    friction, uses = Part("", model.friction.block), _uses(model)
    for use in uses:
        if not use.block.acts:
            raise InputError(
                f"{use.block.name} acts on nothing inside a drive: declare it with acts=, or wire "
                "its block to the drive's inputs."
            )
    sensors = tuple(part for part in uses if "sensor" in part.block.acts)
    effects = tuple(part for part in uses if part not in sensors)
    parts = (friction, *effects, *(sensors if sensed else ()))
    return _Motion(parts, sensors if sensed else (), effects, sensed, tuple(loads)).block()


def _uses(model: Model) -> tuple[Part, ...]:
    return tuple(Part(f"{use.key}.", use.block) for use in model.effects)


def load_outputs(model: Model) -> tuple[str, ...]:
    """The plant's outputs on the load's side: of each coupling, the second one numbered."""
    return _load_names(len(_loads(model)))


def _loads(model: Model) -> tuple[str, ...]:
    """The keys of the couplings that have a load behind them."""
    return tuple(
        use.key
        for use in model.effects
        if {"twist", "w_load"} <= {*use.block.states} and use.values.get("load_inertia", 0.0) != 0.0
    )


def _load_names(many: int) -> tuple[str, ...]:
    ends = ["" if k == 0 else f"_{k + 1}" for k in range(many)]
    return tuple(f"{name}_load{end}" for end in ends for name in ("theta", "w"))


@dataclass(frozen=True)
class _Sensing:
    """The function of :func:`sensor`: sensors in series."""

    parts: tuple[Part, ...]
    sensors: tuple[Part, ...]

    name: ClassVar = "sensor"
    inputs: ClassVar = ("w", "theta")
    motion: ClassVar = ()  # states besides those of the parts

    @property
    def outputs(self) -> tuple[str, ...]:
        return "w_m", "theta_m"

    @cached_property
    def states(self) -> tuple[str, ...]:
        return (*self.motion, *(name for part in self.parts for name in part.states))

    def signals(self, t: Any, given: Sequence[Any]) -> dict[str, Any]:
        return {"t": t, **dict(zip((*self.inputs, *self.states), given, strict=True))}

    def seen(self, signals: Mapping[str, Any], values: Mapping[str, Any], rates: Rates) -> Any:
        """w and theta after all sensors; the sensors' rates are stored in ``rates``."""
        w, theta = signals["w"], signals["theta"]
        for part in self.sensors:
            outputs = part.outputs({**signals, "w": w, "theta": theta}, values, rates)
            found = dict(zip(part.block.fresh, outputs, strict=True))
            w, theta = found["w_m"], found["theta_m"]
        return w, theta

    def __call__(self, t: Any, *given: Any, **values: Any) -> tuple[Any, ...]:
        rates: Rates = {}
        measured = self.seen(self.signals(t, given), values, rates)
        return *measured, *(rate for part in self.parts for rate in rates[part.prefix])

    def block(self) -> Block:
        own = {k: p for part in self.parts for k, p in part.parameters.items()}
        own = {"J": J, **own} if self.motion else own
        return Block(
            self.name, self.name, self, self.inputs, self.outputs, self.states, own, timed=True
        )


@dataclass(frozen=True)
class _Motion(_Sensing):
    effects: tuple[Part, ...]
    sensed: bool
    loads: tuple[str, ...]

    name: ClassVar = "plant"
    inputs: ClassVar = ("u", "d")
    motion: ClassVar = ("theta", "w")

    @property
    def outputs(self) -> tuple[str, ...]:
        sensed = super().outputs if self.sensed else ()
        return "theta", "w", "F", *sensed, *_load_names(len(self.couplings))

    @cached_property
    def couplings(self) -> tuple[Part, ...]:
        return tuple(part for part in self.effects if part.prefix.removesuffix(".") in self.loads)

    def __call__(self, t: Any, *given: Any, **values: Any) -> tuple[Any, ...]:
        signals, rates = self.signals(t, given), {}
        torque, values = _applied(self.effects, signals, values, rates)
        F, *_ = self.parts[0].outputs(signals, values, rates)
        measured = self.seen(signals, values, rates) if self.sensed else ()
        dw = acceleration(signals["u"], F, torque, values["J"])
        beyond: list[Any] = []  # position and speed of the load of each coupling
        for part in self.couplings:
            own = dict(zip(part.block.states, (signals[k] for k in part.states), strict=True))
            turn, inertia = (own["twist"], own["w_load"]), values[f"{part.prefix}load_inertia"]
            beyond += load_motion(signals["theta"], signals["w"], *turn, inertia)
        own = (rate for part in self.parts for rate in rates[part.prefix])
        return F, *measured, *beyond, signals["w"], dw, *own


STAGES = ("command", "motor", "load", "level", "torque")  # along the signals of a drive


def stage(block: Block) -> str:
    """Where an effect acts; a torque that is a level too acts last, and uses all other levels."""
    if "torque" in block.acts:
        return "load" if block.load else "torque"
    if block.acts != ("input",):
        return "level"
    return "command" if block.inputs == ("u",) else "motor"


def _applied(
    effects: Sequence[Part], signals: dict[str, Any], values: Mapping[str, Any], rates: Rates
) -> tuple[Any, dict[str, Any]]:
    """All effects: the resisting torque and the plant's values; u and load are set in signals.
    Effects on levels read the plant's own values, before any effect multiplies them."""

    def deeds(at: str, values: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
        for part in effects:
            if stage(part.block) == at:
                yield from part.block.deeds(part.outputs(signals, values, rates))

    for at in ("command", "motor"):
        for _, u in deeds(at, values):
            signals["u"] = u  # the next one reads it
    load = sum((out for _, out in deeds("load", values)), signals["d"])
    signals["load"] = load
    scaled = leveled(values, [*deeds("level", values)])
    torque = 0.0
    for act, out in deeds("torque", scaled):
        if act == "torque":
            torque = torque + out
        else:
            scaled |= leveled(scaled, [(act, out)])
    return load + torque, scaled


def leveled(values: Mapping[str, Any], deeds: Sequence[tuple[str, Any]]) -> dict[str, Any]:
    """The values after deeds on levels that there are: multiplied by 1 + x, then increased."""
    made = dict(values)
    for act, out in deeds:
        if act in made:
            made[act] = made[act] * (1.0 + out)
    for act, out in deeds:
        name = act.removeprefix("+")
        if act != name and name in made:
            made[name] = made[name] + out
    return made


@factory
def plant(p: Parameters | Model, **names: Unpack[Names]):
    """The drive J dw/dt = u - F - d as a block: inputs u, d (N m), outputs theta, w, F.

    A load inertia behind ``elastic_coupling`` or ``backlash`` adds the outputs theta_load,
    w_load: the load's own position and speed, as an encoder on the load measures them.

    Parameters
    ----------
    p : Parameters or Model
        LuGre parameters, or a whole model: friction, input, level and torque effects inside;
        its sensor effects make the block :func:`lugrectl.sensor`. A friction law of your own
        takes the defaults of its declaration where the model has no value.

    Returns
    -------
    States theta, w, the friction's z, then those of the effects; parameters keyed
    ``plant.J``, ``plant.Fc``, ``plant.gravity.amplitude`` ...

    Raises
    ------
    When a parameter has no value yet.

    Notes
    -----
    Source paper, eq. mechanical_sys1. theta is the integral of w and is not wrapped. theta_load is
    theta minus the twist of the coupling. The outputs of a second coupling are theta_load_2,
    w_load_2.

    Examples
    --------
    >>> p = lg.table1()
    >>> lg.plant(p).output_labels
    ['theta', 'w', 'F']

    A drive with an unbalanced arm; its parameters are changed at simulation time by these keys:

    >>> arm = lg.Model.of(p, effects={"name": "gravity", "amplitude": 0.4, "phase": 0.0})
    >>> [key for key in lg.plant(arm).params if "gravity" in key]
    ['plant.gravity.amplitude', 'plant.gravity.phase']
    """
    model = as_model(p).with_defaults()
    return _system(assemble(model, loads=_loads(model)), model, names)


@factory
def sensor(p: Parameters | Model, **names: Unpack[Names]):
    """The sensors of the motion: inputs w, theta, outputs w_m, theta_m.

    Parameters
    ----------
    p : Parameters or Model
        Gives the sensor effects, which act in series; without any the signals are not changed.

    Returns
    -------
    States are those of the sensor effects; outputs in rad/s and rad.

    Raises
    ------
    When a parameter of a sensor effect has no value yet.

    Examples
    --------
    A drive whose speed is filtered before it is read:

    >>> filtered = {"name": "velocity_sensor_lag", "time_constant": 2e-3}
    >>> drive = lg.Model.of(lg.table1(), effects=filtered)
    >>> lg.sensor(drive).output_labels
    ['w_m', 'theta_m']
    """
    model = as_model(p)
    parts = tuple(part for part in _uses(model) if "sensor" in part.block.acts)
    return _system(_Sensing(parts, parts).block(), model, names)


def _system(made: Block, model: Model, names: Names) -> ct.NonlinearIOSystem:
    values: dict[str, Any] = {k: v for k, v in model.values().items() if k in made.parameters}
    missing = [k for k, v in values.items() if v is None]
    if missing:
        what = "has no value; identify it" if len(missing) == 1 else "have no values; identify them"
        raise InputError(f"{model.name}: {', '.join(missing)} {what} first.")
    return made.system(**names, **values)

"""The declared model: plant, friction and effects, with TOML in and out."""

from __future__ import annotations

import difflib
import math
import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

from .blocks import effects as _effects  # noqa: F401  fills the registry
from .blocks import friction as _friction  # noqa: F401
from .blocks.friction import J as J_DECLARATION
from .display import Row, Shown
from .errors import InputError
from .spec import Block, members, unit_for


@dataclass(frozen=True, repr=False)
class Parameters(Shown):
    """A drive with LuGre friction: J, sigma0, sigma1, Fc, Fs, Fv, vs in SI units.

    kg m2, N m/rad, N m s/rad, N m, N m, N m s/rad, rad/s; letters as in the source paper.
    """

    J: float
    sigma0: float
    sigma1: float
    Fc: float
    Fs: float
    Fv: float
    vs: float

    def __post_init__(self) -> None:
        Model.of(self)

    def friction(self) -> dict[str, float]:
        return {f.name: getattr(self, f.name) for f in fields(self) if f.name != "J"}

    def _rows(self) -> Iterable[Row]:
        model = Model.of(self)
        return [Row(k, v, model.unit(k)) for k, v in model.values().items()]


def table1() -> Parameters:
    """The parameters of the source paper's Table 1."""
    return Parameters(J=0.0022, sigma0=260.0, sigma1=0.6, Fc=0.285, Fs=0.335, Fv=0.018, vs=0.01)


@dataclass(frozen=True, repr=False)
class Part(Shown):
    """A block with values, where None marks one to be identified."""

    key: str
    block: Block
    values: Mapping[str, float | None]

    def _title(self) -> str:
        return self.key

    def _rows(self) -> Iterable[Row]:
        own = self.block.own
        return [_value_row(k, v, own[k].unit) for k, v in self.values.items()]


@dataclass(frozen=True, repr=False)
class Model(Shown):
    """A declared model: inertia, one friction law, any number of effects.

    ``values()`` is flat: ``J``, the friction parameters by name, effects as ``key.parameter``.
    """

    name: str
    motion: str
    J: float | None
    friction: Part
    effects: tuple[Part, ...] = ()

    @classmethod
    def of(cls, p: Parameters) -> Model:
        """The model of a LuGre drive without effects."""
        values = {"model": "lugre", **p.friction()}
        return model_from_dict({"plant": {"J": p.J}, "friction": values}, "parameters")

    def values(self) -> dict[str, float | None]:
        flat: dict[str, float | None] = {"J": self.J, **self.friction.values}
        for part in self.effects:
            flat |= {f"{part.key}.{k}": v for k, v in part.values.items()}
        return flat

    def part(self, key: str) -> Part:
        """The effect of that key."""
        return next(part for part in self.effects if part.key == key)

    def known(self) -> dict[str, float]:
        """``values()`` without those still missing."""
        return {k: v for k, v in self.values().items() if v is not None}

    def with_values(self, flat: Mapping[str, float | None]) -> Model:
        """The same structure with other values; names left out stay as they are."""
        all_values = self.values() | dict(flat)

        def own(part: Part, prefix: str) -> Part:
            return replace(part, values={k: all_values[prefix + k] for k in part.values})

        return replace(
            self,
            J=all_values["J"],
            friction=own(self.friction, ""),
            effects=tuple(own(part, f"{part.key}.") for part in self.effects),
        )

    def with_effect(self, name: str, values: Mapping[str, float | None] | None = None) -> Model:
        """The model with one more effect; a second of a name gets the key ``name_2``."""
        made, given = members("effect")[name], values or {}
        used = sum(part.block.name == name for part in self.effects)
        key = name if not used else f"{name}_{used + 1}"
        values = {k: given.get(k, None if p.fitted else p.value) for k, p in made.own.items()}
        return replace(self, effects=(*self.effects, Part(key, made, values)))

    def declarations(self) -> dict[str, Any]:
        """The parameter declarations (unit, bounds) under the names of ``values()``."""
        flat = {"J": J_DECLARATION, **self.friction.block.parameters}
        for part in self.effects:
            flat |= {f"{part.key}.{k}": p for k, p in part.block.own.items()}
        return flat

    def unit(self, key: str) -> str:
        p = self.declarations()[key]
        return p.unit if p.angle else unit_for(p.unit, self.motion)

    def remarks(self) -> tuple[str, ...]:
        """What looks wrong about the values, one sentence each."""
        Fs, Fc = self.friction.values.get("Fs"), self.friction.values.get("Fc")
        if Fs is None or Fc is None or Fs >= Fc:
            return ()
        return (
            f"model {self.name}: Fs = {Fs:g} is below Fc = {Fc:g}, though stiction is the higher "
            "of the two; the fit starts from Fs = Fc and keeps Fs above it.",
        )

    def to_dict(self) -> dict[str, Any]:
        """Nested like the TOML file; values not yet known are left out."""

        def known(values: Mapping[str, float | None]) -> dict[str, float]:
            return {k: v for k, v in values.items() if v is not None}

        return {
            "name": self.name,
            "motion": self.motion,
            "plant": known({"J": self.J}),
            "friction": {"model": self.friction.block.name, **known(self.friction.values)},
            "effects": [{"name": part.block.name, **known(part.values)} for part in self.effects],
        }

    def _title(self) -> str:
        return f"Model {self.name}: {self.motion}, {self.friction.block.name} friction"

    def _rows(self) -> Iterable[Row]:
        rows = [_value_row(k, v, self.unit(k)) for k, v in self.values().items()]
        bare = [part.key for part in self.effects if not part.values]
        return [*rows, *(Row(key, "no parameters") for key in bare)]


def _value_row(key: str, value: float | None, unit: str) -> Row:
    return Row(key, "to be identified" if value is None else value, "" if unit == "1" else unit)


def model_from_dict(data: Mapping[str, Any], where: str) -> Model:
    """Build a model from a dictionary nested like the TOML file.

    Raises
    ------
    InputError
        For an unknown key, friction model or effect, a value that is no number or outside its
        bounds; the sentence starts with ``where``.
    """
    _known(data, ("name", "motion", "plant", "friction", "effects"), where)
    motion = data.get("motion", "rotary")
    if motion not in ("rotary", "linear"):
        raise InputError(f"{where}: motion must be 'rotary' or 'linear', not {motion!r}.")
    plant, friction = _table(data, "plant", where), _table(data, "friction", where)
    _known(plant, ("J",), f"{where}: [plant]")
    law = friction.get("model", "lugre")
    part = _part(law, members("friction"), friction, f"{where}: [friction]", "friction model")
    model = Model(
        name=str(data.get("name", "drive")),
        motion=motion,
        J=_number(plant.get("J"), J_DECLARATION, f"{where}: [plant] J"),
        friction=part,
    )
    effects = data.get("effects", [])
    if not isinstance(effects, list):
        raise InputError(f"{where}: effects are written [[effects]], once for each effect.")
    for entry in effects:
        name = entry.get("name")
        use = _part(name, members("effect"), entry, f"{where}: [[effects]] {name}", "effect")
        model = model.with_effect(use.block.name, use.values)
    return model


def _part(name: Any, known: Mapping[str, Block], entry: Any, where: str, what: str) -> Part:
    if name not in known:
        hint = difflib.get_close_matches(str(name), known, n=1)
        meant = f" Did you mean '{hint[0]}'?" if hint else ""
        raise InputError(f"{where}: unknown {what} {name!r}; known: {', '.join(known)}.{meant}")
    made = known[name]
    tag = "model" if what == "friction model" else "name"
    _known(entry, (tag, *made.own), where)
    values = {
        k: _number(entry.get(k), p, f"{where} {k}") if k in entry or p.fitted else p.value
        for k, p in made.own.items()
    }
    return Part(name, made, values)


def _table(data: Mapping[str, Any], key: str, where: str) -> Mapping[str, Any]:
    table = data.get(key, {})
    if not isinstance(table, Mapping):
        raise InputError(f"{where}: {key} must be a table, written [{key}].")
    return table


def _known(table: Mapping[str, Any], known: Iterable[str], where: str) -> None:
    for key in table:
        if key not in known:
            hint = difflib.get_close_matches(key, list(known), n=1)
            meant = f" Did you mean '{hint[0]}'?" if hint else ""
            raise InputError(f"{where}: unknown key '{key}'; known: {', '.join(known)}.{meant}")


def _number(value: Any, p: Any, where: str) -> float | None:
    if value is None:
        return None
    real = isinstance(value, (int, float)) and not isinstance(value, bool)
    if not real or not (math.isfinite(value) or value == p.neutral):
        raise InputError(f"{where} must be a finite number, not {value!r}.")
    if p.choices and value not in p.choices:
        known = " or ".join(f"{c:g}" for c in p.choices)
        raise InputError(f"{where} = {value:g}; it must be {known}.")
    if value < p.low or value > p.high:
        rule = "negative" if value < 0 <= p.low else f"outside [{p.low:g}, {p.high:g}]"
        raise InputError(
            f"{where} = {value:g} is {rule}; give a value in {p.unit} or leave it out."
        )
    return float(value)


def read_model(path: str | Path) -> Model:
    """Read a model file (TOML, section 4 of the format description in the README).

    Raises
    ------
    InputError
        When the file is missing, is not TOML, or says something that is not understood.
    """
    path = Path(path)
    try:
        data = tomllib.loads(path.read_text(encoding="utf-8-sig"))
    except FileNotFoundError:
        raise InputError(f"{path}: no such model file.") from None
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: cannot be read as a text file ({error}).") from None
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{path}: not a TOML file: {error}.") from None
    return model_from_dict(data, str(path))


def write_model(model: Model, path: str | Path) -> None:
    """Write a model as the TOML file that :func:`read_model` reads."""
    Path(path).write_text(model_toml(model), encoding="utf-8")


def model_toml(model: Model) -> str:
    """The model file's text, with the unit of each value as a comment."""
    data, lines = model.to_dict(), []
    lines += [f"name = {_quoted(data['name'])}", f'motion = "{data["motion"]}"', "", "[plant]"]
    lines += _rows(data["plant"], "", model)
    lines += ["", "[friction]", f'model = "{data["friction"].pop("model")}"']
    lines += _rows(data["friction"], "", model)
    for part, entry in zip(model.effects, data["effects"], strict=True):
        lines += ["", "[[effects]]", f'name = "{entry.pop("name")}"']
        lines += _rows(entry, f"{part.key}.", model)
    return "\n".join(lines) + "\n"


def _rows(values: Mapping[str, float], prefix: str, model: Model) -> list[str]:
    return [f"{k} = {float(v)!r}  # {model.unit(prefix + k)}" for k, v in values.items()]


def _quoted(text: str) -> str:
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n") + '"'

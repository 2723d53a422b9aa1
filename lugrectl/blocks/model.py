"""The declared model: plant, friction and effects with their values."""

from __future__ import annotations

import math
import os
import pickle
import re
import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from types import MappingProxyType, SimpleNamespace
from typing import Any

from ..core.display import Row, Shown
from ..core.errors import InputError
from ..core.provenance import SourceFile
from ..core.validation import (
    as_path,
    flag,
    holds_samples,
    is_file,
    like_it,
    positive,
    shown,
    text,
    within,
)
from ..core.writing import write_whole
from .block import Block, P, is_ours, members, unit_for
from .declaration import block_named, files_of_blocks, load_named, meant, name_of
from .friction import J as J_DECLARATION
from .friction import formed, usual_values, written_form

_MODEL = "a Model, Parameters, a dict or the path of a model file"
_FILE = ("name", "motion", "blocks", "plant", "friction", "effects")


KEYS = ("value", "fixed", "min", "max", "std")


@dataclass(frozen=True)
class Stated:
    """``fixed``: the value is held. ``low`` and ``high``: the fit stays between them. ``std``:
    the value is the mean of a Gaussian prior with this standard deviation. None: not stated."""

    fixed: bool = False
    low: float | None = None
    high: float | None = None
    std: float | None = None

    def clipped(self, value: float) -> float:
        """The value, or the bound beyond which it lies."""
        value = value if self.low is None else max(value, self.low)
        return value if self.high is None else min(value, self.high)

    @property
    def bounded(self) -> bool:
        return self.low is not None or self.high is not None

    def table(self) -> dict[str, Any]:
        given = {"fixed": self.fixed or None, "min": self.low, "max": self.high, "std": self.std}
        return {k: v for k, v in given.items() if v is not None}

    def words(self) -> str:
        """For a row of a table: "held", "0.1 to 0.5, prior +-0.02"."""
        if self.fixed:
            return "held"
        ends = [f"{x:g}" if x is not None else "" for x in (self.low, self.high)]
        text = f"{ends[0]} to {ends[1]}" if all(ends) else f"at least {ends[0]}"
        text = text if ends[0] else f"at most {ends[1]}"
        prior = f"prior +-{self.std:g}" if self.std is not None else ""
        return ", ".join(filter(None, [text if self.bounded else "", prior]))


NOTHING = Stated()


def declared(given: Any, p: P, where: str) -> tuple[float | None, Stated]:
    """A value of a model, None for one to be identified, and what its table states of it:
    ``{value = 0.285, fixed = true}``."""
    if not isinstance(given, Mapping):
        return None if given is None else within(given, where, p), NOTHING
    check_keys(given, KEYS, where)

    def one(key: str, at: str) -> float | None:
        found = given.get(key)
        if found is None or key != "value" and found == 0:  # a bound of a value above 0, too
            return found
        return within(found, at, p)

    value, low, high = one("value", where), one("min", f"{where}: min"), one("max", f"{where}: max")
    fixed, std = given.get("fixed", False), given.get("std")
    std = None if std is None else positive(std, f"{where}: std")
    made = Stated(flag(fixed, f"{where}: fixed"), low, high, std)
    if value is None and (fixed or std is not None):
        raise InputError(f"{where}: {'fixed' if fixed else 'std'} needs a value beside it.")
    if low is not None and high is not None and low >= high:
        raise InputError(f"{where}: min = {low:g} must be below max = {high:g}.")
    if value is not None and made.clipped(value) != value:
        bounds = Stated(low=low, high=high).words()
        raise InputError(f"{where}: value = {value:g} lies outside its own bounds, {bounds}.")
    return value, made


def check_keys(table: Mapping[str, Any], known: Iterable[str], where: str) -> None:
    for key in table:
        if key not in known:
            raise InputError(f"{where}: unknown key '{key}'; {meant(key, known)}")


def _holding(
    values: Mapping[str, float | None],
    before: Mapping[str, Stated],
    names: Iterable[Any],
    where: str,
) -> dict[str, Stated]:
    """The statements with these values held; the name of an effect holds all of its values."""
    made = dict(before)
    for name in names:
        keys = [k for k in values if k == name or k.startswith(f"{name}.")]
        if not keys:
            raise InputError(f"{where}: no value of the model is '{name}'; {meant(name, values)}")
        for key in keys:
            if values[key] is None:
                raise InputError(f"{where}: {key} has no declared value to hold: give it one.")
            made[key] = replace(made.get(key, Stated()), fixed=True)
    return made


def refuse_crossed(
    values: Mapping[str, float | None], said: Mapping[str, Stated], where: str
) -> None:
    """Raise InputError if no Fs that is allowed lies above an Fc that is allowed."""
    ends = []
    for key, side, none in (("Fs", "high", math.inf), ("Fc", "low", -math.inf)):
        one, value = said.get(key, Stated()), values.get(key)
        far = value if one.fixed and value is not None else getattr(one, side)
        ends.append(none if far is None else far)
    if ends[0] < ends[1]:
        raise InputError(
            f"{where}: Fs is at most {ends[0]:g} and Fc at least {ends[1]:g}, but stiction cannot "
            "be less than Coulomb friction: hold one of them at most, or give other bounds."
        )


@dataclass(frozen=True, repr=False)
class Parameters(Shown):
    """A drive with LuGre friction, in SI units; letters as in the source paper.

    For a drive of which not every value is known see :meth:`Model.of`.

    Parameters
    ----------
    J : float
        Inertia in kg m2.
    sigma0, sigma1 : float
        Stiffness in N m/rad and damping in N m s/rad of the bristles.
    Fc, Fs : float
        Coulomb friction and stiction in N m.
    Fv : float
        Viscous friction in N m s/rad.
    vs : float
        Stribeck velocity in rad/s.

    Raises
    ------
    InputError
        When a value is missing, is not a number or is out of bounds.

    Examples
    --------
    >>> p = lg.Parameters(J=0.002, sigma0=260.0, sigma1=0.6, Fc=0.3, Fs=0.35, Fv=0.02, vs=0.01)
    >>> p.Fs
    0.35
    """

    J: float = math.nan
    sigma0: float = math.nan
    sigma1: float = math.nan
    Fc: float = math.nan
    Fs: float = math.nan
    Fv: float = math.nan
    vs: float = math.nan

    def __post_init__(self) -> None:
        left = [f.name for f in fields(self) if getattr(self, f.name) is f.default]
        if left:
            raise InputError(
                f"Parameters: {', '.join(left)} missing; Model.of(J=0.002) takes some values and "
                "leaves the others to be identified."
            )
        for key, value in Model.of(self).known().items():
            object.__setattr__(self, key, value)

    def friction(self) -> dict[str, float]:
        """All values but J, by name, in the units above."""
        return {f.name: getattr(self, f.name) for f in fields(self) if f.name != "J"}

    def _rows(self) -> Iterable[Row]:
        model = Model.of(self)
        return [Row(k, v, model.unit(k)) for k, v in model.values().items()]


def table1() -> Parameters:
    """The parameters of the source paper's Table 1.

    Returns
    -------
    Parameters
        J = 0.0022 kg m2, sigma0 = 260 N m/rad, sigma1 = 0.6 N m s/rad, Fc = 0.285 N m,
        Fs = 0.335 N m, Fv = 0.018 N m s/rad, vs = 0.01 rad/s.

    Examples
    --------
    >>> p = lg.table1()
    >>> p.Fc, p.Fs
    (0.285, 0.335)
    """
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

    :meth:`Model.of` builds one from values by name. ``values()`` is flat: ``J``, the friction
    parameters by name, effects as ``key.parameter``.

    Attributes
    ----------
    name : str
        Of the drive.
    motion : "rotary" or "linear"
        It decides the units: N m, rad and kg m2, or N, m and kg.
    J : float or None
        Inertia in kg m2 or mass in kg; None is to be identified, here and in all values.
    friction : Part
        The friction law as a block, with its values.
    effects : tuple of Part
        The declared effects.
    stated : dict
        By a key of ``values()`` what is held, bounded or known with an uncertainty.
    file : SourceFile or None
        The model file that was read, None once anything was changed.
    blocks : tuple of str
        The files with blocks of the user's own that it names.

    Examples
    --------
    A drive of which J and Fc are known, and which carries an arm:

    >>> model = lg.Model.of(J=0.0022, Fc=0.285, effects="gravity")
    >>> model.known()
    {'J': 0.0022, 'Fc': 0.285}
    >>> model.fix("J").held()
    {'J'}
    """

    name: str
    motion: str
    J: float | None
    friction: Part
    effects: tuple[Part, ...] = ()
    stated: Mapping[str, Stated] = field(default_factory=dict)
    blocks: tuple[str, ...] = field(default=(), compare=False)
    file: SourceFile | None = field(default=None, init=False, repr=False, compare=False)

    @classmethod
    def of(
        cls,
        given: Any = MappingProxyType({}),
        *,
        J: Any = None,
        friction: str | Block | None = None,
        effects: Any = None,
        name: str | None = None,
        motion: str | None = None,
        **values: Any,
    ) -> Model:
        """A model from values by name: ``Model.of(J=0.002, Fc=0.3)``, ``Model.of(table1())``.

        Parameters
        ----------
        given : Parameters, Model, dict or path, optional
            What to start from; else nothing is known.
        J : float, optional
            In kg m2 (kg on a linear drive). What is left out here and below is identified.
        friction : str, optional
            The law, "lugre" unless given: its name, or the block that declares it.
        effects : list of str or dict, optional
            Declared effects by name or block, or ``{"name": "gravity", "amplitude": 0.2}``; one
            will do.
        name, motion : str, optional
            "drive" and "rotary" unless given.
        values : float or dict
            Parameters of the friction law, ``Fc=0.3``. Any value may be a dict as in a model file:
            ``{"value": 0.3, "fixed": True}`` holds it, ``{"min": 0.1, "max": 0.5}`` bounds it,
            ``{"value": 0.3, "std": 0.02}`` is a prior.

        Raises
        ------
        InputError
            As :func:`read_model` for what stands in a file.
        """
        own = {"J": J, "friction": friction, "effects": effects, "name": name, "motion": motion}
        changes = {k: v for k, v in (own | values).items() if v is not None}
        return changed(given, changes, "Model.of") if changes else as_model(given)

    def values(self) -> dict[str, float | None]:
        """All values by name, in the units of :meth:`unit`; None is to be identified."""
        own = {f"{part.key}.{k}": v for part in self.effects for k, v in part.values.items()}
        return {"J": self.J, **self.friction.values, **own}

    def part(self, key: str) -> Part:
        """The declared effect with this key."""
        return next(part for part in self.effects if part.key == key)

    def known(self) -> dict[str, float]:
        """The values that are not to be identified, by name."""
        return {k: v for k, v in self.values().items() if v is not None}

    def fix(self, *names: str, what: str = "fix") -> Model:
        """The model with these declared values held: ``model.fix("J", "Fc")``.

        ``"gravity.phase"`` is one value of an effect, ``"gravity"`` all of them. InputError for a
        name that the model does not have, or a value that is not declared; it starts with ``what``.
        """
        made = replace(self, stated=_holding(self.values(), self.stated, names, what))
        refuse_crossed(made.values(), made.stated, what)
        return made

    def held(self) -> set[str]:
        """The names of the values that a fit leaves as they are."""
        return {k for k, one in self.stated.items() if one.fixed}

    def kept(self, values: Mapping[str, float]) -> dict[str, float]:
        """Values for a fit: held ones as declared, the others inside their stated bounds."""
        made, own = dict(values), self.values() if self.stated else {}
        for key in self.stated.keys() & made.keys():
            value, one = own.get(key), self.stated[key]
            made[key] = value if one.fixed and value is not None else one.clipped(made[key])
        return made

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

    def with_defaults(self) -> Model:
        """The model for a simulation: a friction law of the user's own takes the defaults of its
        declaration where it has no value.

        A fit identifies these values, from the defaults on. Laws of the package have no defaults:
        those of their declarations are the values of another drive.
        """
        law = self.friction.block
        if is_ours(law.home):
            return self
        own, values = law.parameters, self.friction.values
        known = {k: own[k].value if v is None else v for k, v in values.items()}
        return replace(self, friction=replace(self.friction, values=known))

    def with_effect(
        self, name: str | Block, values: Mapping[str, float | None] | None = None
    ) -> Model:
        """The model with one more effect; a second of a name gets the key ``name_2``.

        Common names are understood (``cogging`` is ``torque_ripple``), the block itself too;
        InputError for others.
        A usual value that is not among ``values`` is held.
        """
        made, given = block_named("effect", name), values or {}
        used = sum(part.block.name == made.name for part in self.effects)
        key = made.name if not used else f"{made.name}_{used + 1}"
        usual = {k: x for k, x in usual_values(made, given).items() if k not in given}
        values = {k: given.get(k, None if p.fitted else p.value) for k, p in made.own.items()}
        held = {f"{key}.{k}": Stated(fixed=True) for k in usual}
        part = Part(key, made, values | usual)
        return replace(self, effects=(*self.effects, part), stated={**self.stated, **held})

    def declarations(self) -> dict[str, Any]:
        """The parameter declarations (unit, bounds) under the names of ``values()``."""
        own = {f"{part.key}.{k}": p for part in self.effects for k, p in part.block.own.items()}
        return {"J": J_DECLARATION, **self.friction.block.parameters, **own}

    def bounds(self, key: str) -> tuple[float, float]:
        """Where a value may lie: by its declaration, and as the model states it; KeyError for a
        name that is not in :meth:`values`."""
        p, one = self.declarations()[key], self.stated.get(key, Stated())
        low = p.low if one.low is None else max(p.low, one.low)
        return low, p.high if one.high is None else min(p.high, one.high)

    def unit(self, key: str) -> str:
        """The SI unit of a value, "1" for none; KeyError for a name that is not in
        :meth:`values`."""
        p = self.declarations()[key]
        return p.unit if p.angle else unit_for(p.unit, self.motion)

    def remarks(self) -> tuple[str, ...]:
        """What looks wrong about the values, one sentence each."""
        Fs, Fc = self.friction.values.get("Fs"), self.friction.values.get("Fc")
        if Fs is None or Fc is None or Fs >= Fc:
            return ()
        return (
            f"model {self.name}: Fs = {Fs:g} is below Fc = {Fc:g}, but stiction cannot be less "
            "than Coulomb friction; the fit starts from and keeps an Fs that is not.",
        )

    def to_dict(self, *, stated: bool = False) -> dict[str, Any]:
        """A dict nested like the TOML file; values that are not known yet are left out.

        With ``stated`` a value of which more is stated is a table, as in the file.
        """

        def known(values: Mapping[str, float | None], prefix: str = "") -> dict[str, Any]:
            more = {k: self.stated.get(prefix + k) for k in values} if stated else {}
            tables = {k: one.table() for k, one in more.items() if one and one.table()}
            plain = {k: v for k, v in values.items() if v is not None or k in tables}
            return {k: {"value": v, **tables[k]} if k in tables else v for k, v in plain.items()}

        effects = [{"name": p.block.name, **known(p.values, f"{p.key}.")} for p in self.effects]
        return {
            "name": self.name,
            "motion": self.motion,
            "plant": known({"J": self.J}),
            "friction": written_form(self.friction.block) | known(self.friction.values),
            "effects": effects,
        }

    def statements(self) -> dict[str, dict[str, Any]]:
        """What is stated of its values besides them, by key: ``{"Fc": {"fixed": True}}``."""
        return {k: self.stated[k].table() for k in self.values() if k in self.stated}

    def _title(self) -> str:
        return f"Model {self.name}: {self.motion}, {self.friction.block.name} friction"

    def _rows(self) -> Iterable[Row]:
        return [
            _value_row(k, v, self.unit(k), self.stated.get(k)) for k, v in self.values().items()
        ]


def _value_row(key: str, value: float | None, unit: str, more: Stated | None = None) -> Row:
    note = f"({words})" if more and (words := more.words()) else ""
    unit = "" if unit == "1" else unit
    return Row(key, "to be identified" if value is None else value, unit, note)


def model_from_dict(data: Mapping[str, Any], where: str, folder: str | Path = "") -> Model:
    """Build a model from a dictionary nested like the TOML file, its ``blocks`` in ``folder``."""
    check_keys(data, _FILE, where)
    blocks = load_named(data.get("blocks", []), folder, where)
    motion = data.get("motion", "rotary")
    if motion not in ("rotary", "linear"):
        raise InputError(f"{where}: motion must be 'rotary' or 'linear', not {motion!r}.")
    plant, friction = _table(data, "plant", where), _table(data, "friction", where)
    check_keys(plant, ("J",), f"{where}: [plant]")
    J, of_J = declared(plant.get("J"), J_DECLARATION, f"{where}: [plant] J")
    law = friction.get("model", "lugre")
    made = block_named("friction", law, where=f"{where}: [friction]", what="friction model")
    part, held = _part(made, "model", friction, f"{where}: [friction]")
    model = Model(
        name=text(data.get("name", "drive"), f"{where}: name"),
        motion=motion,
        J=J,
        friction=part,
        stated=held if of_J == NOTHING else {"J": of_J, **held},
        blocks=blocks,
    )
    effects = data.get("effects", [])
    if not isinstance(effects, list):
        raise InputError(f"{where}: write [[effects]] above each effect.")
    for entry in effects:
        model = _with_entry(model, entry, f"{where}: [[effects]]")
    refuse_crossed(model.values(), model.stated, where)
    return model


def _with_entry(model: Model, entry: Any, where: str) -> Model:
    if not isinstance(entry, Mapping):
        raise InputError(f"{where} must be a table with a name, not {shown(entry)}.")
    if "name" not in entry:
        raise InputError(f'{where} needs a name, such as name = "gravity".')
    made = block_named("effect", entry["name"], where=where, what="effect")
    use, held = _part(made, "name", entry, f"{where} {entry['name']}")
    if any(_alike(part, use) for part in model.effects):
        raise InputError(
            f"{where} {use.block.name} is declared twice, and no record can distinguish the "
            "two: keep one of them."
        )
    model = model.with_effect(use.block.name, use.values)
    own = {f"{model.effects[-1].key}.{k}": one for k, one in held.items()}
    return replace(model, stated={**model.stated, **own})


def _alike(one: Part, other: Part) -> bool:
    """Whether two effects add up to one of a kind: they differ in strength and phase at most."""
    if one.block.name != other.block.name:
        return False
    own = one.block.own
    differing = [k for k, p in own.items() if p.fitted and p.neutral is None and p.span is None]
    if {"input", "sensor"} & {*one.block.acts} and len(own) == 1:
        differing = [*own]  # two lags in series are a filter of second order
    known = all(one.values[k] is not None for k in differing)
    return known and all(one.values[k] == other.values[k] for k in differing)


def _part(made: Block, tag: str, entry: Any, where: str) -> tuple[Part, dict[str, Stated]]:
    """The block with the values of an entry, in which ``tag`` names it, and what it states."""
    usual = usual_values(made, entry)
    entry = {**entry, **{k: {"value": value, "fixed": True} for k, value in usual.items()}}
    check_keys(entry, (tag, *made.own, *made.form_keys), where)
    made, entry = formed(made, entry, where)
    found = {
        k: declared(entry.get(k, None if p.fitted else p.value), p, f"{where} {k}")
        for k, p in made.own.items()
    }
    held = {k: one for k, (_, one) in found.items() if one != NOTHING}
    return Part(made.name, made, {k: value for k, (value, _) in found.items()}), held


def _table(data: Mapping[str, Any], key: str, where: str) -> Mapping[str, Any]:
    table = data.get(key, {})
    if not isinstance(table, Mapping):
        raise InputError(f"{where}: {key} must be a table, written [{key}].")
    return table


def read_model(path: str | Path) -> Model:
    """Read a model file in TOML; ``lugrectl model`` prints a commented one.

    Parameters
    ----------
    path : str or Path
        The model file.

    Returns
    -------
    Model
        What the file declares; values that it leaves out are to be identified.

    Raises
    ------
    InputError
        When the file is missing, is not TOML, or holds an unknown key or a wrong value.

    Examples
    --------
    A drive of which J is known and LuGre friction is to be identified:

    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder) / "axis.toml"
    ...     _ = path.write_text("plant.J = 0.002 # kg m2, from the data sheet")
    ...     model = lg.read_model(path)
    >>> model.known(), model.friction.key
    ({'J': 0.002}, 'lugre')
    """
    path = as_path(path, "the model file")
    try:
        data = tomllib.loads(path.read_text(encoding="utf-8-sig"))
    except FileNotFoundError:
        raise InputError(f"{path}: no such model file{like_it(path)}.") from None
    except (OSError, ValueError, RecursionError) as error:  # ValueError: TOML, UTF-8, huge numbers
        raise InputError(
            f"{path}: not a TOML file in UTF-8: {error}. A model is needed here: lugrectl model > "
            "my.toml writes one to start from."
        ) from None
    model = model_from_dict(data, str(path), path.parent)
    object.__setattr__(model, "file", SourceFile.of(path))
    return model


def write_model(model: Model, path: str | Path) -> None:
    """Write a model as the TOML file that :func:`read_model` reads.

    Parameters
    ----------
    model : Model, Parameters or dict
        The model to write.
    path : str or Path
        The file; one that exists is replaced.

    Raises
    ------
    InputError
        When the file cannot be written, or the model holds what a file cannot: a value that is
        no number or outside its bounds, half of a surrogate pair in its name.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> model = lg.Model.of(J=0.0022, effects="gravity")
    >>> with TemporaryDirectory() as folder:
    ...     lg.write_model(model, Path(folder) / "axis.toml")
    ...     lg.read_model(Path(folder) / "axis.toml").known()
    {'J': 0.0022}
    """

    model, path = as_model(model), as_path(path, "path")
    content = model_toml(model, path.parent)
    model_from_dict(tomllib.loads(model_toml(model)), f"model {model.name}")
    write_whole(path, content.encode())


def model_toml(
    model: Model, folder: Path | None = None, known: Mapping[str, str] | None = None
) -> str:
    """The model file's text, with the unit of each value as a comment, and what is ``known`` of it;
    files with blocks of the user's own are named as seen from the folder of the model file."""
    data, declared, known = model.to_dict(stated=True), model.declarations(), known or {}

    def rows(values: Mapping[str, Any], prefix: str = "") -> list[str]:
        made = []
        for key, value in values.items():
            unit = model.unit(prefix + key) if prefix + key in declared else ""
            note = ", ".join(filter(None, [unit, known.get(prefix + key)]))
            note = "".join(c for c in f"  # {note}" if c.isprintable()) if note else ""
            key = key if re.fullmatch(r"[A-Za-z0-9_-]+", key) else _written(key)
            made.append(f"{key} = {_written(value)}{note}")
        return made

    used = files_of_blocks([p.block.home for p in (model.friction, *model.effects)])
    files = [_seen_from(folder, file) for file in dict.fromkeys([*model.blocks, *used])]
    head = {"name": data["name"], "motion": data["motion"]} | ({"blocks": files} if files else {})
    lines = [*rows(head), "", "[plant]", *rows(data["plant"]), "", "[friction]"]
    lines += rows(data["friction"])
    for part, entry in zip(model.effects, data["effects"], strict=True):
        lines += ["", "[[effects]]", *rows({"name": entry.pop("name")})]
        lines += rows(entry, f"{part.key}.")
    return "\n".join(lines) + "\n"


def _written(value: Any) -> str:
    """A value as TOML; InputError for half of a surrogate pair, which no TOML file can hold."""
    if isinstance(value, str):
        if half := re.search("[\ud800-\udfff]", value):
            raise InputError(
                f"the name {ascii(value)} holds half of a surrogate pair, {ascii(half[0])}, which "
                "no TOML file can hold: give it another name."
            )
        text = value.replace("\\", "\\\\").replace('"', '\\"')
        return '"' + re.sub(r"[\x00-\x1f\x7f]", lambda c: f"\\u{ord(c[0]):04x}", text) + '"'
    if isinstance(value, (bool, int)):
        return str(value).lower()
    if isinstance(value, list):
        return "[" + ", ".join(map(_written, value)) + "]"
    if not isinstance(value, Mapping):
        return repr(float(value))
    return "{" + ", ".join(f"{k} = {_written(v)}" for k, v in value.items() if v is not None) + "}"


def _seen_from(folder: Path | None, file: str) -> str:
    try:
        return file if folder is None else Path(os.path.relpath(file, folder.resolve())).as_posix()
    except ValueError:  # on another drive of Windows
        return file


def as_model(given: Any, what: str = "model") -> Model:
    """The model that is meant; InputError names the argument ``what``."""
    if isinstance(given, Model):  # it may have been given values that none of a file could have
        known = given.declarations()
        for key, value in given.values().items():
            declared(value, known[key], f"{what}: {key}")
        refuse_crossed(given.values(), given.stated, what)
        return given
    if isinstance(given, Parameters):
        values = {"model": "lugre", **given.friction()}
        return model_from_dict({"plant": {"J": given.J}, "friction": values}, "parameters")
    if is_file(given):
        return read_model(given)
    if isinstance(given, Mapping):
        if holds_samples(given):
            raise InputError(f"{what} must be {_MODEL}, not a dict of samples: that is a log.")
        return _from_dict(given, what)
    raise InputError(f"{what} must be {_MODEL}, not {shown(given)}.")


def _from_dict(given: Mapping[Any, Any], what: str) -> Model:
    """A dict nested like a model file, or one of values by name, ``{"J": 0.002}``."""
    if isinstance(given.get("stated"), Mapping):  # the model of a JSON document
        tables = given["stated"]
        model = _from_dict({k: v for k, v in given.items() if k != "stated"}, what)
        values, known = model.values(), model.declarations()
        check_keys(tables, values, f"{what}: stated")
        whole = {k: {"value": values[k], **_table(tables, k, what)} for k in tables}
        found = {k: declared(table, known[k], f"{what}: {k}")[1] for k, table in whole.items()}
        refuse_crossed(values, found, what)
        return replace(model, stated={k: one for k, one in found.items() if one != NOTHING})
    flat = set(given) - {*_FILE}
    if "plant" in given or not (flat or isinstance(given.get("friction"), (str, Block))):
        return model_from_dict({**given, "effects": _effects(given.get("effects"))}, what)
    return changed({}, {str(k): v for k, v in given.items()}, what)


def changed(given: Any, changes: Mapping[str, Any], what: str) -> Model:
    """The model ``given``, {} for one of which nothing is known, with other values by name: ``J``,
    ``name``, ``motion``, the law ``friction``, more ``effects``, parameters of the law."""
    data = as_model(given).to_dict(stated=True)
    changes = {k: v for k, v in changes.items() if v is not None}
    data |= {k: changes.pop(k) for k in ("name", "motion") if k in changes}
    if "J" in changes:
        data["plant"] = {"J": changes.pop("J")}
    data["effects"] = [*data["effects"], *_effects(changes.pop("effects", None))]
    law = name_of("friction", changes.pop("friction", None))
    law = dict(law) if isinstance(law, Mapping) else {} if law is None else {"model": law}
    data["friction"] = _law(data["friction"], law | changes)
    return replace(model_from_dict(data, what), blocks=as_model(given).blocks)


def _law(before: Mapping[str, Any], given: Mapping[str, Any]) -> dict[str, Any]:
    """The friction table with what is given; another law keeps the values that it has, too."""
    name, laws = given.get("model", before["model"]), members("friction")
    made = laws.get(name) if isinstance(name, str) else None
    if made is None:
        return {**before, "model": name, **given}
    own, had = ({**m.own, **m.form_keys} for m in (made, laws[before["model"]]))
    # n is another number in each law
    kept = {k for k, p in own.items() if not p.usual or p == had.get(k)}
    return {**{k: v for k, v in before.items() if k in kept}, "model": name, **given}


def _effects(given: Any) -> list[Any]:
    """Entries as in a model file from names, dicts or a list of both."""
    if given is None:
        return []
    if isinstance(given, (str, Mapping, Part)) or callable(given) or hasattr(given, "ninputs"):
        given = [given]
    if not isinstance(given, Iterable):
        raise InputError(f"effects must be a list of names or dicts, not {shown(given)}.")
    made = []
    for one in (name_of("effect", one) for one in given):
        one = {"name": one.block.name, **one.values} if isinstance(one, Part) else one
        made.append({"name": one} if isinstance(one, str) else one)
    return made


def values_of(p: Any) -> Any:
    """An object with the parameters as attributes: p itself, or the values of a model."""
    if isinstance(p, (Model, str, os.PathLike, Mapping)):
        return SimpleNamespace(**as_model(p, "p").values())
    return p


@dataclass(frozen=True)
class Sent:
    """A model for another process, where the user's own effects are declared when it is opened."""

    packed: bytes

    @classmethod
    def of(cls, model: Model) -> Sent:
        own = [made for made in members("effect").values() if not is_ours(made.home)]
        return cls(pickle.dumps((own, model)))

    def open(self) -> Model:
        return pickle.loads(self.packed)[1]

"""What a diagnosis and an identification have in common: fitted parameters and their forms, and
models drawn from what a fit knows, by weight and the values of each jointly."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..blocks.model import Model, Stated, as_model
from ..core.display import Grid, Row, brief, grid_html, grid_text, noticed, number, with_interval
from ..core.errors import InputError, Refused
from ..core.numeric import Z95
from ..core.provenance import Provenance
from ..core.result import ComparedRows, NamedRows, Result, library, picked, plain
from ..core.validation import whole
from ..core.views import view
from ..record import Record
from .findings import Balance, Estimate, FrictionMap, Joint, Residuals, Traces

ROUNDS = 50  # of drawing again what is out of bounds, before it is moved to the bound
TORQUE = ("N m", "N")
INTERVAL = 2.0 * Z95  # standard deviations in a 95 % interval


@dataclass(frozen=True, eq=False, repr=False)
class Belief:
    """A model, the joint distribution of its values, and its weight among others."""

    model: Model
    joint: Joint
    weight: float = 1.0

    @classmethod
    def of(
        cls,
        model: Model,
        joint: Joint | None,
        estimates: Mapping[str, Estimate],
        weight: float = 1.0,
    ) -> Belief:
        """What a fit knows; of values that it does not determine, what is declared. Those with an
        interval alone are independent of the others."""
        known, limits = model.known(), model.declarations()
        size = {k: (e.ci95[1] - e.ci95[0]) / INTERVAL for k, e in estimates.items()
                if e.ci95 and not e.held and k in known}  # fmt: skip
        inside = [k for k in (joint.names if joint else ()) if k in size]
        size |= {k: one.std for k, one in model.stated.items()
                 if one.std and k in known and k not in size}  # fmt: skip
        names = (*inside, *(k for k in size if k not in inside))
        C, values = np.diag([size[k] ** 2 for k in names]), np.array([known[k] for k in names])
        if joint:
            at = [joint.names.index(k) for k in inside]
            C[: len(at), : len(at)] = joint.matrix[np.ix_(at, at)]
        positive = (np.array([limits[k].low for k in names]) >= 0.0) & (values > 0.0)
        return cls(model, Joint(names, values, C, positive), weight)

    def moved_by(self, records: Sequence[Record]) -> Belief:
        """The same with friction that the torque of these records overcame, as the drive moved."""
        known, stated = self.model.known(), dict(self.model.stated)
        loads = [abs(v) for k, v in known.items() if "." in k and self.model.unit(k) in TORQUE]
        most = max((float(np.max(np.abs(r.u))) for r in records), default=np.inf) + sum(loads)
        for k in {"Fc", "Fs"} & known.keys():
            was = stated.get(k, Stated())
            if known[k] < most < (np.inf if was.high is None else was.high):
                stated[k] = replace(was, high=most)
        return replace(self, model=replace(self.model, stated=stated))

    @classmethod
    def read(cls, given: Mapping[str, Any]) -> Belief:
        """From an entry of "members" of the JSON document."""
        names, values = tuple(given["names"]), np.array(given["values"], float)
        matrix = np.array(given["matrix"], float).reshape(len(names), len(names))
        joint = Joint(names, values, matrix, np.array(given["positive"], bool))
        return cls(as_model(given["model"], "members"), joint, float(given["weight"]))

    @property
    def unknown(self) -> tuple[str, ...]:
        """Values that are neither determined, nor declared as held or with a std."""
        own, held = self.model.declarations(), self.model.held()
        free = [k for k, p in own.items() if p.fitted and not (p.whole or p.choices)]
        return tuple(k for k in free if k not in held and k not in self.joint.names)

    def drawn(self, n: int, random: np.random.Generator) -> dict[str, np.ndarray]:
        """n sets of values inside their bounds: name -> (n,)."""
        made = self.joint.sample(n, random)
        for _ in range(ROUNDS):
            out = self._outside(made)
            if not out.any():
                return made
            for k, v in self.joint.sample(int(out.sum()), random).items():
                made[k][out] = v
        return {k: np.clip(v, *self.model.bounds(k)) for k, v in made.items()}

    def _outside(self, made: Mapping[str, np.ndarray]) -> np.ndarray:
        """Which sets are out of bounds, or have an Fs below Fc."""
        inside = [(v >= low) & (v <= high)
                  for k, v in made.items() for low, high in [self.model.bounds(k)]]  # fmt: skip
        Fc, Fs = (self.model.known().get(k, np.nan) for k in ("Fc", "Fs"))
        crossed = (Fs >= Fc) & (made.get("Fs", Fs) < made.get("Fc", Fc))
        return ~np.all(inside, axis=0) | crossed

    def summary(self) -> dict[str, Any]:
        """As under "members" in the JSON document; :meth:`read` reads it."""
        model = self.model.to_dict() | {"stated": self.model.statements()}
        joint = picked(self.joint, "names values matrix positive")
        return picked(self, "weight unknown") | joint | {"model": model}


class Members(Result, Sequence[Model]):
    """Drives as they may be: models drawn by :meth:`sample`, each with a value for everything.

    ``members[0]`` is a :class:`Model`; ``members["J"]`` are the values of all, nan where a member's
    model has none of that name; ``names`` are those that were drawn. A sweep takes members in
    place of its table, as the parameters of the block ``plant``.

    Raises
    ------
    Refused
        By ``members[0]``, for a value that the log does not determine and of which nothing is
        declared; the sentence names it.

    Examples
    --------
    >>> t = 1e-2 * np.arange(400)
    >>> w = np.sin(np.pi * t) + 0.5 * np.sin(8.0 * t)
    >>> u = 0.002 * np.gradient(w, t) + 0.3 * np.tanh(w / 1e-3) + 0.02 * w
    >>> fit = lg.identify({"t": t, "u": u, "w": w}, lg.Model.of(friction="coulomb"))
    >>> members = fit.sample(100)
    >>> len(members), members.names
    (100, ('J', 'Fc', 'Fv'))
    >>> bool(abs(members[0].known()["Fc"] - 0.3) < 0.05)
    True
    """

    def __init__(self, beliefs: Sequence[Belief], n: int, seed: int | None) -> None:
        n, random = whole(n, "n, the number of samples,", least=1), np.random.default_rng(seed)
        weights = np.array([b.weight for b in beliefs])
        self.beliefs = tuple(beliefs)
        self.which = random.choice(len(beliefs), n, p=weights / weights.sum())
        self.names = tuple(dict.fromkeys(k for b in beliefs for k in b.joint.names))
        self._columns = {k: np.full(n, np.nan) for k in self.names}
        for i, belief in enumerate(beliefs):
            mine = self.which == i
            for k, v in belief.drawn(int(mine.sum()), random).items() if mine.any() else ():
                self._columns[k][mine] = v

    def __len__(self) -> int:
        return len(self.which)

    def keys(self) -> tuple[str, ...]:
        """The names of the values that were drawn."""
        return self.names

    def __getitem__(self, index: Any) -> Any:
        if isinstance(index, str):
            if index not in self._columns:
                raise InputError(f"there is no drawn value '{index}'; there is {self.names}.")
            return self._columns[index]
        if isinstance(index, slice):
            return [self[i] for i in range(*index.indices(len(self)))]
        belief = self.beliefs[self.which[index]]
        refuse_unknown(belief)
        return belief.model.with_values(
            {k: float(self._columns[k][index]) for k in belief.joint.names}
        )

    def __iter__(self) -> Iterator[Model]:
        return (self[i] for i in range(len(self)))

    def columns_of(self, block: str = "plant") -> dict[str, np.ndarray]:
        """The table of a sweep: the parameters of a block, ``{"plant.Fc": (n,), ...}``."""
        if len(set(self.which)) > 1:
            raise InputError("the members are of different models: sweep those of each separately.")
        refuse_unknown(self.beliefs[self.which[0]])
        return {f"{block}.{k}": v for k, v in self._columns.items()}

    def summary(self) -> dict[str, Any]:
        return {"members": len(self), "values": plain(self._columns)}

    def to_frame(self) -> Any:
        """A DataFrame, a row for each member; InputError where pandas is not installed."""
        return library("pandas").DataFrame(self._columns)

    def _title(self) -> str:
        return f"{len(self)} members"

    def _rows(self) -> Iterable[Row]:
        for k, v in self._columns.items():
            low, middle, high = np.nanquantile(v, (0.025, 0.5, 0.975))
            unit = next(b for b in self.beliefs if k in b.joint.names).model.unit(k)
            yield Row(k, float(middle), unit, f"(95 % from {number(low)} to {number(high)})")


def refuse_unknown(belief: Belief) -> None:
    """Refused where a value would be taken as certain that is not."""
    left = belief.unknown
    if left:
        names, each = ", ".join(left), ("it", "each")[len(left) > 1]
        raise Refused(
            f"{belief.model.name}: the log does not determine {names}, so no member can be drawn: "
            f"declare {each} with what is known of it, {left[0]} = {{value = ..., std = ...}} or "
            "fixed = true.",
            f"Record a motion that shows {names}: start, stop and reverse slowly, and pass the "
            "speeds of interest.",
        )


# ---- fitted parameters, and what both kinds of answers have


class Parameter(NamedTuple):
    """A fitted value and its 95 % interval (None if it cannot be determined) in ``unit``;
    ``declared`` is the value in the model file, None if it gives none."""

    name: str
    value: float
    low: float | None
    high: float | None
    unit: str
    declared: float | None


class ParameterTable(NamedRows[Parameter]):
    """Fitted parameters, a row for each: ``table[0]``, ``table["J"].value``, ``"J" in table``."""

    _unknown = "there is no fitted parameter {0!r}; there is {1}."

    def __init__(self, estimates: Mapping[str, Estimate], declared: Model | None = None) -> None:
        before = declared.values() if declared is not None else {}
        self._estimates = dict(estimates)
        self._rows = tuple(
            Parameter(name, e.value, *(e.ci95 or (None, None)), e.unit, before.get(name))
            for name, e in estimates.items()
        )

    def to_dict(self) -> dict[str, dict[str, Any]]:
        """Plain Python: name -> value, low, high, unit, declared."""
        return {name: plain(dict(zip(Parameter._fields[1:], row, strict=True)))
                for name, *row in self}  # fmt: skip

    def to_frame(self) -> Any:
        """A DataFrame with the names as index; InputError where pandas is not installed."""
        frame = library("pandas").DataFrame(list(self), columns=list(Parameter._fields))
        numbers = dict.fromkeys(("value", "low", "high", "declared"), float)
        return frame.astype(numbers).set_index("name")

    def _grid(self) -> Grid:
        rows = []
        for row in self:
            value, interval = with_interval(self._estimates[row.name])
            rows.append((row.name, number(row.declared), value, interval, row.unit))
        head = ("parameter", "declared", "fitted", "95 % interval", "unit")
        return Grid(head, "lrrrl", tuple(rows))

    def __repr__(self) -> str:
        return "\n".join(grid_text(self._grid())) if self else "no fitted parameters"

    def _repr_html_(self) -> str:
        return grid_html(self._grid()) if self else "<p>no fitted parameters</p>"


@dataclass(frozen=True, repr=False, kw_only=True)
class Fitted(Result):
    """What a diagnosis and an identification have in common; its fields stand with a diagnosis."""

    estimates: Mapping[str, Estimate] = field(default_factory=dict)
    error: Mapping[str, Any] | None = None
    model: Model | None
    declared: Model | None = None
    record: Record | None = None
    records: tuple[Record, ...] = ()
    messages: tuple[str, ...] = ()
    traces: Traces | None = None
    map: FrictionMap | None = None
    plain: Balance | None = None
    joint: Joint | None = None
    residuals: Residuals | None = None
    laws: ComparedRows | None = None
    rivals: tuple[Belief, ...] = ()
    torque_noise: float | None = None
    provenance: Provenance | None = None

    @property
    def covariance(self) -> Joint:
        """The joint covariance of the fitted parameters: ``.matrix``, ``.names``, ``.to_frame()``.

        Raises InputError where nothing was fitted.
        """
        if self.joint is None:
            raise InputError("this result has no fit, and so no covariance of its parameters.")
        return self.joint

    def sample(self, n: int = 1000, seed: int | None = 0) -> Members:
        """n drives as they may be, :class:`Members`: models with values drawn from their joint
        covariance, inside their bounds.

        Where several models explain the record each is drawn as often. Of a value that the log does
        not determine the declared std counts; without one the members have no value of it, and each
        is refused with a sentence that names it. Values with an interval but no covariance are
        drawn independently.
        """
        return Members(self.beliefs(), n, seed)

    def beliefs(self) -> tuple[Belief, ...]:
        """The model with the distribution of its values, and those that explain the record too."""
        if self.model is None:
            raise InputError("this result has no model, and so nothing to draw from.")
        left = 1.0 - sum(one.weight for one in self.rivals)
        own = Belief.of(self.model, self.joint, self.estimates, left)
        return tuple(one.moved_by(self.records) for one in (own, *self.rivals))

    def _document(self, **more: Any) -> dict[str, Any]:
        """The JSON document: what both results have, and ``more``; never NaN or Infinity."""
        model, every = self.model, self.records or ([self.record] if self.record else [])
        nested = model.to_dict() if model else {"plant": {}, "friction": {}, "effects": []}
        seen = view("assure.seen_in", "bench")(self.record, self.torque_noise)
        made = {
            "model": {k: nested[k] for k in ("plant", "friction", "effects")}
            | {"stated": model.statements() if model else {}},
            "parameters": self.estimates,
            "records": [{"name": r.source, **r.summary()} for r in every],
            "covariance": self.joint,
            "members": self.beliefs() if model else None,
            "drive": seen or None,
        }
        same = picked(self, "error record messages plain residuals laws provenance")
        return {"schema": 1, **more, **plain(made), **same}

    @property
    def parameters(self) -> ParameterTable:
        """Fitted parameters: name, value, low and high of the 95 % interval, unit, declared."""
        return ParameterTable(self.estimates, self.declared)

    def to_frame(self) -> Any:
        """The fitted parameters as a DataFrame; InputError where pandas is not installed."""
        return self.parameters.to_frame()

    def save(self, folder: str | Path) -> list[Path]:
        """Write report.html, report.json and model.toml into a folder, all or none.

        The folder is made when it is missing. A refusal has no model, so no model.toml. Returns
        the paths. Raises InputError where nothing can be written.
        """
        return view("write")(self, folder)

    def plot(self, ax: Any = None) -> Any:
        """Draw what there is: motion, error, residual, budget, in a figure that shows itself.

        Returns an array of Axes, one for each panel; a single one where there is one panel. Into
        a given ``ax`` the first panel is drawn, measured and simulated motion where there is any,
        and ``ax`` is returned. Raises InputError where there is nothing to draw.
        """
        return view("diagnosis_plots.overview")(self, ax)

    def _last_rows(self, *names: str) -> list[Row]:
        """The errors of these models, the records, and what was noticed."""
        rows = []
        if self.error:
            values = " -> ".join(number(self.error.get(name), 3) for name in names)
            name, note = f"error of {self.error['signal']}", f"({' -> '.join(names)})"
            rows.append(Row(name, values, self.error["unit"], note))
        if every := self.records or ([self.record] if self.record else []):
            length = f"{sum(r.samples for r in every)} samples"
            rows.append(Row("records", f"{brief([r.source for r in every])}: {length}"))
        return rows + noticed(self.messages, "messages")

    def __str__(self) -> str:
        return view("text")(self)

    def _repr_html_(self) -> str:
        return view("fragment")(self)

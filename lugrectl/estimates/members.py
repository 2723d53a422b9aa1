"""Models drawn from what a fit knows: by weight, and the values of each jointly."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, overload

import numpy as np

from ..blocks.model import Model, Stated, as_model
from ..core.display import Row, number
from ..core.errors import InputError, Refused
from ..core.numeric import Z95
from ..core.result import Result, library, picked, plain
from ..core.validation import whole
from .covariance import Joint
from .findings import Estimate

if TYPE_CHECKING:
    from ..record import Record

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

    @overload
    def __getitem__(self, index: str) -> np.ndarray: ...
    @overload
    def __getitem__(self, index: int) -> Model: ...
    @overload
    def __getitem__(self, index: slice) -> list[Model]: ...
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

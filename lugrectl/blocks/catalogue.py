"""Lists of what there is: effects, friction laws, observers, controllers."""

from __future__ import annotations

import inspect
import math
import textwrap
import unicodedata
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

from ..core.errors import InputError
from ..core.result import NamedRows, library, picked
from ..core.validation import shown
from . import DECLARING
from .block import Block, P, members
from .declaration import also_called, block_named, name_of

Listing = TypeVar("Listing", bound=Callable[..., "Catalogue"])
WIDTH = 80  # columns of an entry as text
_INDENTED: Any = {
    "initial_indent": "  ", "subsequent_indent": "    ", "break_on_hyphens": False
}  # fmt: skip


@dataclass(frozen=True)
class Entry:
    """One block of a list, as it is declared: ``parameters`` maps a name to its :class:`P`, in the
    units of a rotary drive."""

    name: str
    kind: str
    equation: str
    parameters: Mapping[str, P]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    source: str
    about: str
    acts_on: tuple[str, ...] = ()
    confused_with: tuple[str, ...] = ()
    experiment: str = ""
    also_called: tuple[str, ...] = ()

    @classmethod
    def of(cls, made: Block) -> Entry:
        about, _, rest = made.doc.partition("\n")[2].partition("\nReferences\n")
        return cls(
            name=made.name,
            kind=made.kind,
            equation=made.equation.rstrip(".,"),
            parameters={k: p for k, p in {**made.own, **made.form_keys}.items() if p.fitted},
            inputs=made.inputs,
            outputs=made.outputs,
            source=made.source or " ".join(rest.strip("-\n ").split()),
            about=" ".join(about.split()),
            acts_on=made.acts,
            confused_with=made.confused,
            experiment=made.experiment,
            also_called=also_called(made.kind, made.name),
        )

    def summary(self) -> dict[str, Any]:
        """Plain Python, None for infinity: what ``lugrectl effects NAME --json`` prints.

        ``strength`` names the parameter whose neutral value switches an effect off.
        """
        own = {k: picked(p, "value low high neutral unit") for k, p in self.parameters.items()}
        facts = picked(self, "name equation") | {"parameters": own, "source": self.source or None}
        facts |= {"about": self.about}
        if self.kind != "effect":
            return facts | picked(self, "inputs outputs")
        off = (k for k, p in self.parameters.items() if p.neutral is not None)
        facts |= {"strength": next(off, None), **picked(self, "acts_on confused_with")}
        return facts | {"experiment": self.experiment or None, **picked(self, "also_called")}

    def __str__(self) -> str:
        also = [f"also called: {', '.join(self.also_called)}"] if self.also_called else []
        rows = [self.about, *also, *self._parameter_lines(), *self._relations()]
        return self._with(rows)

    __repr__ = __str__

    def short(self) -> str:
        """Name, equation, parameters, what it is confused with and how to distinguish them."""
        return self._with([f"parameters: {_labels(self) or 'none'}", *self._relations()[1:]])

    def _with(self, rows: Sequence[str]) -> str:
        rows = [self.equation, *rows, f"source: {self.source}" if self.source else ""]
        filled = [textwrap.fill(row, WIDTH, **_INDENTED) for row in rows if row]
        return "\n".join([self.name, *filled])

    def has(self, words: Sequence[str]) -> bool:
        """Whether all words, without capitals and accents, stand in what is said of it."""
        said = (self.name, *self.also_called, self.equation, self.about, self.source)
        return all(word in _bare(" ".join(said)) for word in words)

    def _parameter_lines(self) -> list[str]:
        lines = ["parameters:"] if self.parameters else ["parameters: none"]
        for name, p in self.parameters.items():
            said = f"  {name}: {'no unit' if p.unit == '1' else p.unit}, {_bounds(p)}"
            said += ", a whole number on a rotary drive" if p.whole else ""
            said += f", {_number(p.value)} unless given" if p.usual else ""
            said += f", no effect at {_number(p.neutral)}" if p.neutral is not None else ""
            lines.append(said)
        return lines

    def _relations(self) -> list[str]:
        if self.kind != "effect":
            return [f"inputs: {', '.join(self.inputs)}", f"outputs: {', '.join(self.outputs)}"]
        lines = [f"acts on: {', '.join(self.acts_on) or 'nothing'}"]
        lines += [f"confused with: {', '.join(self.confused_with)}"] if self.confused_with else []
        return lines + ([f"to distinguish: {self.experiment}"] if self.experiment else [])


class Catalogue(NamedRows[Entry]):
    """A list of entries, in order; an index may be a name: ``lg.effects()["torque_ripple"]``."""

    def __init__(self, kind: str, entries: Sequence[Entry]) -> None:
        self.kind = kind
        self._rows = tuple(entries)

    def __getitem__(self, index: Any) -> Any:
        """An entry by place, by name (a common one, or without ``_observer``) or by its block, or a
        part of the list; InputError with the nearest name, IndexError for a place."""
        if isinstance(index, slice):
            return Catalogue(self.kind, self._rows[index])
        which = name_of(self.kind, index)
        if not isinstance(which, str):
            return self._rows[which]
        name = block_named(self.kind, which).name
        for entry in self._rows:
            if entry.name == name:
                return entry
        raise InputError(f"this list has no {self.kind} named {which!r}.")

    def __contains__(self, item: object) -> bool:
        return super().__contains__(item.name if isinstance(item, Block) else item)

    def summary(self) -> list[dict[str, Any]]:
        """Plain Python: one dictionary for each entry."""
        return [entry.summary() for entry in self._rows]

    def to_frame(self) -> Any:
        """A DataFrame, a row for each entry with its name as index; InputError without pandas."""
        pandas, head = library("pandas"), ["name", "equation", "parameters", "source"]
        rows = [(e.name, e.equation, _labels(e), e.source) for e in self._rows]
        return pandas.DataFrame(rows, columns=pandas.Index(head)).set_index("name")

    def __str__(self) -> str:
        return "\n".join(entry.short() for entry in self._rows)

    __repr__ = __str__


_ABOUT = """
Parameters
----------
about : str
    Only those whose name, equation, text or source has all these words, such as an author's
    name; capitals and accents make no difference.

Returns
-------
Catalogue
    Rows by place or by name; ``print`` shows each in a few lines, ``to_frame`` gives a DataFrame.

Raises
------
InputError
    If no entry has these words.

Examples
"""


def _documented(listing: Listing) -> Listing:
    listing.__doc__ = (inspect.getdoc(listing) or "").replace("\nExamples\n", _ABOUT)
    return listing


@_documented
def effects(about: str = "") -> Catalogue:
    """The catalogue of effects that a model may declare or a diagnosis may name.

    Effects that the user registered with :func:`lugrectl.block` are in it.

    Examples
    --------
    >>> ripple = lg.effects()["cogging"]  # a common name for it
    >>> ripple.name, ripple.acts_on
    ('torque_ripple', ('torque',))
    >>> "gravity" in lg.effects()
    True
    """
    return _listed("effect", about)


@_documented
def laws(about: str = "") -> Catalogue:
    """The friction laws: what ``[friction] model`` in a model file may be.

    Examples
    --------
    >>> "lugre" in lg.laws()
    True
    >>> list(lg.laws()["coulomb"].parameters)
    ['Fc', 'Fv']
    """
    return _listed("friction", about)


@_documented
def observers(about: str = "") -> Catalogue:
    """The friction observers: what ``observer=`` of a loop may be.

    Examples
    --------
    What an observer reads, and the unit of one of its parameters:

    >>> observer = lg.observers()["position_lugre"]
    >>> observer.name, observer.inputs
    ('position_lugre_observer', ('theta', 'u'))
    >>> observer.parameters["sigma0"].unit
    'N m/rad'

    By author:

    >>> lg.observers("tafazoli").names
    ('position_coulomb_observer',)
    """
    return _listed("observer", about)


@_documented
def controllers(about: str = "") -> Catalogue:
    """The controllers and what stands beside them: error, compensation, feedforward, prefilter.

    Examples
    --------
    >>> "pi" in lg.controllers()
    True
    >>> lg.controllers()["slotine_li"].equation
    'u = J ar - KD s'
    """
    return _listed("controller", about)


def _listed(kind: str, about: str) -> Catalogue:
    """The blocks in the order of the package's modules, whatever was imported first."""
    if not isinstance(about, str):
        raise InputError(f"about = {shown(about)} must be words, such as an author's name.")

    def place(made: Block) -> int:
        module = made.home.removeprefix(f"{__package__}.").split(".")[0]
        return DECLARING.index(module) if module in DECLARING else len(DECLARING)

    rows = [Entry.of(made) for made in sorted(members(kind).values(), key=place)]
    found = [row for row in rows if row.has(_bare(about).split())]
    if not found:
        what = "law" if kind == "friction" else kind
        raise InputError(f"no {what} is about {shown(about)}; lg.{what}s() lists all.")
    return Catalogue(kind, found)


def _bare(text: str) -> str:
    return "".join(c for c in unicodedata.normalize("NFD", text.lower()) if c.isascii())


def _labels(entry: Entry) -> str:
    return ", ".join(f"{k} [{p.unit}]" for k, p in entry.parameters.items())


def _bounds(p: P) -> str:
    """The bounds of a parameter in words, which the reference shows as well."""
    if p.choices:
        return " or ".join(f"{c:g}" for c in p.choices)
    low, high = _number(p.low), _number(p.high)
    if p.low == -math.inf:
        return "any value" if p.high == math.inf else f"at most {high}"
    return f"at least {low}" if p.high == math.inf else f"{low} to {high}"


def _number(value: float) -> str:
    named = {math.inf: "infinity", math.pi: "pi", -math.pi: "-pi"}
    return named.get(value, f"{value:g}")

"""One page for each topic: every public name of the package, as its docstring says it."""

from __future__ import annotations

import inspect
from typing import Any

import lugrectl as lg

from .rst import escaped, filled, literal, prose, table, title, toctree

TOPICS = {  # topic: the modules whose public names it holds
    "blocks": "blocks.block blocks.declaration blocks.plant blocks.table simulation.sampled_block",
    "observers": "blocks.observers bench.observers",
    "controllers": "blocks.controllers blocks.sliding_control",
    "laws": "",
    "effects": "blocks.factories",
    "loops": "loops simulation",
    "checks": "linear design hunting paper",
    "diagnosis": "diagnosis bench commissioning",
    "records": "record blocks.model estimates",
    "ensembles": "simulation.sweep",
}
NAMED = {  # names whose topic is not that of their module
    "observers": "observers",
    "controllers": "controllers",
    "laws": "laws",
    "friction": "laws",
    "compare_laws": "laws",
    "LawComparison": "laws",
    "effects": "effects",
    "Diverged": "loops",
    "InputError": "records",
    "Refused": "records",
    "Diagnosis": "diagnosis",
    "Table": "diagnosis",
    "__version__": "records",
}
TITLES = {
    "laws": "Friction laws in Python",
    "effects": "Effects in Python",
    "observers": "Observers in Python",
    "controllers": "Controllers in Python",
    "blocks": "Blocks of a drive",
    "loops": "Loops and simulation",
    "checks": "Checks and design",
    "records": "Records and models",
    "diagnosis": "Diagnosis",
    "ensembles": "Ensembles",
}
LISTS = ("effects", "laws", "observers", "controllers")


def pages() -> dict[str, str]:
    """A page for each topic, and the list of topics."""
    topics: dict[str, list[str]] = {topic: [] for topic in TOPICS}
    for name in lg.__all__:
        topics.setdefault(topic(name), []).append(name)
    made = {f"python/{t}": _page(t, names) for t, names in topics.items()}
    rows = [(f":doc:`{t}`", ", ".join(map(_linked, names))) for t, names in topics.items()]
    return made | {
        "python/index": filled(
            "kind",
            title=title("Python"),
            about="Every public name of the package: ``import lugrectl as lg``, then ``lg.NAME``.",
            table=table(("topic", "names"), rows, "20 80"),
            toctree=toctree(topics),
        )
    }


def topic(name: str) -> str:
    """The topic of a public name: that of its module, "others" for a module without one."""
    home = "" if name in NAMED else lg._HOME.get(name, "")
    parents = [home, home.partition(".")[0]]
    known = {module: t for t, modules in TOPICS.items() for module in modules.split()}
    return NAMED.get(name) or next((known[p] for p in parents if p in known), "others")


def _page(topic: str, names: list[str]) -> str:
    names = sorted(names, key=str.lower)
    rows = [(_linked(name), prose(summary(getattr(lg, name), name))) for name in names]
    more = ""
    if topic in LISTS:
        more = f"Each has a page of its own: :doc:`/generated/{topic}/index`."
    return filled(
        "topic",
        title=title(TITLES.get(topic, "Other names")),
        table=table(("name", "what it is"), rows, "30 70"),
        more=more,
        entries="\n\n".join(_entry(name, getattr(lg, name)) for name in names),
    )


def _linked(name: str) -> str:
    return f":py:obj:`{name} <lugrectl.{name}>`"


def summary(thing: Any, name: str) -> str:
    """The first sentence of the docstring."""
    if not (inspect.isclass(thing) or callable(thing)):
        return DATA.get(name, "A constant.").partition("\n")[0]
    return " ".join((inspect.getdoc(thing) or "").split("\n\n")[0].split())


DATA = {
    "__version__": "The version of the package.",
    "PAPER": "The equations and lemmas of the source paper, and which of them hold.",
}


def _entry(name: str, thing: Any) -> str:
    """The directive by which Sphinx reads the docstring."""
    head = title(escaped(name), "-")
    if inspect.isclass(thing):
        listed = ", ".join(members(thing))
        shown = f"\n   :members: {listed}" if listed else ""
        return f"{head}\n\n.. autoclass:: {name}{shown}"
    if callable(thing):
        return f"{head}\n\n.. autofunction:: {name}"
    said = [f".. py:data:: {name}", f"   {summary(thing, name)}"]
    return "\n\n".join([head, *said, *_labels(thing)])


def _labels(thing: Any) -> list[str]:
    """The rows of PAPER as a table; of another constant its value."""
    if not isinstance(thing, tuple):
        return [literal(repr(thing))]
    keys = [k for k in thing[0]._fields if k != "test"]
    rows = [[prose(str(getattr(one, k))) for k in keys] for one in thing]
    return [table(keys, rows)]


def members(cls: type) -> list[str]:
    """The documented methods and properties of a class that the package defines."""
    own = [c for c in cls.__mro__ if c.__module__.startswith("lugrectl")]
    named = {k: v for c in reversed(own) for k, v in vars(c).items() if not k.startswith("_")}
    kinds = (property, staticmethod, classmethod)
    return [
        k
        for k, v in sorted(named.items())
        if (inspect.isfunction(v) or isinstance(v, kinds)) and inspect.getdoc(v)
    ]

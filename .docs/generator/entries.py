"""One page for each effect, law, observer and controller of the registry."""

from __future__ import annotations

import math

import lugrectl as lg
from lugrectl.blocks.block import P, members
from lugrectl.blocks.catalogue import Entry
from lugrectl.blocks.catalogue import _bounds as bounds  # the words of the command line
from lugrectl.blocks.catalogue import _number as number

from . import signatures
from .rst import code, escaped, filled, listed, literal, prose, table, title, toctree
from .signatures import FOLDERS

TITLES = {
    "effects": "Effects",
    "laws": "Friction laws",
    "observers": "Observers",
    "controllers": "Controllers",
}


def pages() -> dict[str, str]:
    """A page for each entry, and one for each list."""
    made = {}
    for folder, listing in FOLDERS.values():
        own = listing()
        made[f"{folder}/index"] = _list(folder, listing, own)
        made |= {f"{folder}/{e.name}": page(e) for e in own}
    return made


def label(entry: Entry) -> str:
    return f"{entry.kind}-{entry.name}"


def page(entry: Entry) -> str:
    """The page of one entry."""
    folder, listing = FOLDERS[entry.kind]
    look_up = f"lugrectl effects {entry.name}"
    if entry.kind != "effect":
        look_up = f'print(lg.{listing.__name__}()["{entry.name}"])'
    command = f"``{look_up}`` prints:"
    return filled(
        "entry",
        label=label(entry),
        title=title(entry.name),
        name=entry.name,
        equation=literal(entry.equation),
        about=prose(entry.about),
        alt=f"Signature of {entry.name}: torque over time, position and speed",
        caption=signatures.caption(entry),
        signals=_signals(entry),
        parameters=_parameters(entry),
        relations=_relations(entry),
        source=f"{title('Source', '-')}\n\n{prose(entry.source)}." if entry.source else "",
        use=_use(entry),
        command=command,
        text=literal(str(entry)),
    )


def _list(folder: str, listing: object, own: lg.catalogue.Catalogue) -> str:
    rows = [
        (f":ref:`{e.name} <{label(e)}>`", code(e.equation), listed(map(code, e.parameters)))
        for e in own
    ]
    name = getattr(listing, "__name__", "")
    return filled(
        "kind",
        title=title(TITLES[folder]),
        about=f"{getattr(listing, '__doc__', '').splitlines()[0]} "
        f"In Python: :func:`lugrectl.{name}`.",
        table=table(("name", "equation", "parameters"), rows, "25 50 25"),
        toctree=toctree(e.name for e in own),
    )


def _signals(entry: Entry) -> str:
    made = members(entry.kind)[entry.name]
    names = {"inputs": made.reads, "outputs": made.outputs, "states": made.states}
    if entry.kind == "effect":
        names["acts on"] = entry.acts_on
    rows = [(what, listed(map(code, own))) for what, own in names.items() if own]
    return table(("signals", "names"), rows)


def _parameters(entry: Entry) -> str:
    off = entry.kind == "effect"
    head = ("name", "unit", "bounds", "default") + ("no effect at",) * off
    rows = [
        (code(k), _unit(p), bounds(p), number(p.value)) + (_neutral(p),) * off
        for k, p in entry.parameters.items()
    ]
    return table(head, rows) or "None."


def _unit(p: P) -> str:
    unit = "no unit" if p.unit == "1" else escaped(p.unit)
    return f"{unit}, a whole number on a rotary drive" if p.whole else unit


def _neutral(p: P) -> str:
    return "" if p.neutral is None else number(p.neutral)


def _relations(entry: Entry) -> str:
    """What an effect is confused with, and the experiment that distinguishes them."""
    if not (entry.confused_with or entry.experiment or entry.also_called):
        return ""
    rows = []
    if entry.also_called:
        rows.append(f"**Also called:** {listed(map(code, entry.also_called))}.")
    if entry.confused_with:
        rows.append(f"**Confused with:** {listed(_linked(n) for n in entry.confused_with)}.")
    if entry.experiment:
        rows.append(f"**To distinguish them:** {prose(entry.experiment)}.")
    return "\n\n".join([title("What looks similar", "-"), *rows])


def _linked(effect: str) -> str:
    return f":ref:`{effect} <effect-{effect}>`" if effect in members("effect") else code(effect)


def _use(entry: Entry) -> str:
    """What a model file says, and the call that makes the block."""
    if entry.kind == "effect":
        values = ", ".join(f"{k}={p.value:g}" for k, p in _finite(entry).items())
        start, call = "[[effects]]\nname", f'lg.effect("{entry.name}", {values}'.rstrip(", ") + ")"
        note = ", here with the values that it has if they are left out"
    elif entry.kind == "friction":
        start, call, note = "[friction]\nmodel", f'lg.friction("{entry.name}")', ""
        note = ", here with the values of the source paper"
    elif entry.name in lg.__all__:
        return f"As a block: :func:`lugrectl.{entry.name}`."
    else:
        return "It stands for a loop without an observer: ``observer=None``."
    lines = [f"{k} = {p.value:g}  # {p.unit}" for k, p in _finite(entry).items()]
    toml = "\n".join([f'{start} = "{entry.name}"', *lines])
    file = f"In a :doc:`model file </generated/files/model>`{note}:"
    return "\n\n".join([file, literal(toml, "toml"), "As a block:", literal(call, "python")])


def _finite(entry: Entry) -> dict[str, P]:
    """The parameters of the registered block with a finite default that a model must give."""
    own = members(entry.kind)[entry.name].own
    return {k: p for k, p in own.items() if p.fitted and not p.usual and math.isfinite(p.value)}

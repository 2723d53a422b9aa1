"""Values of declared effects that a model leaves open, and in which an effect is not linear."""

from __future__ import annotations

import numpy as np

from ..blocks.block import Block
from .columns import linear, searched
from .friction import Term, View
from .search import Search
from .table import Table


def find_open(view: View, sure: bool) -> None:
    """Give each declared effect of a view a value of everything: where the best contender of its
    name lies beside the rest of the model, or the usual one. ``sure``: the log determines J."""
    opened = [t for t in view.terms if _missing(t)]
    view.terms = [t for t in view.terms if not _missing(t)]
    for term in opened:
        table = Table(view)
        never, own = frozenset[str](), {term.name}
        rows = Search(table, sure, never, {}, only=own).rows()
        found = rows[0].q if rows else {}
        usual = {k: _usual(term.block, k, view) for k in _missing(term)}
        term.q = usual | {k: x for k, x in found.items() if k in usual} | term.q
        if rows and rows[0].C is not None and not term.b.any():
            term.b = rows[0].b[: len(linear(term.block))].copy()
        view.terms = [*view.terms, term]


def _usual(block: Block, key: str, view: View) -> float:
    """The value of a declaration; of an instant the middle of the log: at its ends an event is
    none."""
    p = block.own[key]
    return float(np.median(view.motion.t)) if p.instant else float(p.value or 0.0)


def _missing(term: Term) -> list[str]:
    known: Block = term.block
    return [k for k in searched(known) if k not in term.q]

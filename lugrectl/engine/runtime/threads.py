"""Parallel map on threads: most of a fit's time is spent in compiled code."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

from .backend import alone, compiler, threads

Item = TypeVar("Item")
Made = TypeVar("Made")


def each_beside(work: Callable[[Item], Made], items: Iterable[Item]) -> Iterator[Made]:
    """The results of ``work`` on each item, in the items' order, each as soon as it is there.

    Each call uses one thread. Without compiled code, which lets other threads run, the items are
    processed one after another.
    """
    given = list(items)
    workers = min(threads() if compiler() else 1, len(given))
    if workers < 2:
        yield from map(work, given)
        return
    with ThreadPoolExecutor(workers, initializer=alone) as pool:
        yield from pool.map(work, given)

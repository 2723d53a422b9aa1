"""Progress of long work. ``progress`` is a callable ``(fraction, what)``, True, False, or None: a
bar in Jupyter, nothing elsewhere. True shows one on a terminal too."""

from __future__ import annotations

import functools
import html
import shutil
import sys
import time
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from typing import Any, ParamSpec, TypeVar

from .errors import InputError

P = ParamSpec("P")
R = TypeVar("R")
Progress = Callable[[float, str], None]
Wanted = Progress | bool | None
_EVERY = 0.1  # seconds between two drawings
_AFTER = 0.5  # seconds that work in a notebook takes before it gets a bar


def shows_progress(work: Callable[P, R]) -> Callable[P, R]:
    """Let a function that reports to a callable ``progress`` take all that a user may give."""

    @functools.wraps(work)
    def shown(*args: P.args, **kwargs: P.kwargs) -> R:
        wanted: Any = kwargs.get("progress")
        with bar_for(wanted) as report:
            kwargs["progress"] = report
            return work(*args, **kwargs)

    return shown


def bar_for(wanted: Wanted) -> AbstractContextManager[Progress]:
    """What reports where the user wants to see it, in a ``with`` block."""
    if callable(wanted):
        return nullcontext(wanted)
    if wanted not in (None, True, False):
        raise InputError(f"progress must be a function, True, False or None, not {wanted!r}.")
    if wanted is False or (wanted is None and not in_notebook()):
        return nullcontext(silent)
    return Bar(in_cell(), _AFTER) if in_notebook() else Bar(on_terminal)


def silent(fraction: float, what: str = "") -> None:
    """Shows nothing."""


def reporter(wanted: Wanted) -> Progress:
    """The callable that :func:`shows_progress` gave a function; silent without it."""
    return wanted if callable(wanted) else silent


def part_of(report: Progress, low: float, high: float) -> Progress:
    """What reports a part of the work, from 0 to 1, as between two shares of the whole."""
    return lambda share, what: report(low + share * (high - low), what)


def in_notebook() -> bool:
    """Whether a Jupyter kernel runs this code; IPython on a terminal is none."""
    ipython = sys.modules.get("IPython")
    shell = ipython.get_ipython() if ipython is not None else None
    return getattr(shell, "kernel", None) is not None


class Bar:
    """Has the fraction done (0 to 1) and a few words drawn, a few times a second at most, and the
    end always, but nothing before ``after`` seconds; at the end of a ``with`` block, None."""

    def __init__(self, draw: Callable[[float | None, str], None], after: float = 0.0) -> None:
        self._draw, self._next, self._begun = draw, time.monotonic() + after, after == 0.0

    def __call__(self, fraction: float, what: str = "") -> None:
        now = time.monotonic()
        if now >= self._next or (fraction >= 1.0 and self._begun):
            self._next, self._begun = now + _EVERY, True
            self._draw(min(max(fraction, 0.0), 1.0), what)

    def __enter__(self) -> Bar:
        return self

    def __exit__(self, *error: object) -> None:
        if self._begun:
            self._draw(None, "")


def on_terminal(fraction: float | None, what: str) -> None:
    """Draw a bar on one line of stderr; nothing where that is no terminal."""
    if sys.stderr is None or not sys.stderr.isatty():
        return
    done = round(30 * (fraction or 0.0))
    line = f"[{'#' * done}{'.' * (30 - done)}] {100 * (fraction or 0.0):3.0f} %  {what}"
    line = "" if fraction is None else line[: shutil.get_terminal_size().columns - 1]
    sys.stderr.write(f"\r{line}\x1b[K")
    sys.stderr.flush()


def in_cell() -> Callable[[float | None, str], None]:
    """Draws a bar of plain HTML in a notebook."""
    place: list[Any] = []

    def draw(fraction: float | None, what: str) -> None:
        from IPython.display import HTML, display

        words = f"{100 * (fraction or 0.0):.0f} % {html.escape(what)}"
        text = f'<progress max="1" value="{fraction or 0.0:.3f}"></progress> {words}'
        shown = HTML("" if fraction is None else text)
        if place:
            place[0].update(shown)
        else:
            place.append(display(shown, display_id=True))

    return draw

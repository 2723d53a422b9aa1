"""Progress of long work. ``progress`` is a callable ``(fraction, what)``, True, False, or None: a
bar in Jupyter, nothing elsewhere. True shows one on a terminal too."""

from __future__ import annotations

import functools
import html
import shutil
import sys
import time
from collections.abc import Callable
from typing import Any, ParamSpec, TextIO, TypeVar

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


def bar_for(wanted: Wanted) -> Bar:
    """What reports where the user wants to see it."""
    if callable(wanted):
        return Called(wanted)
    if wanted not in (None, True, False):
        raise InputError(f"progress must be a function, True, False or None, not {wanted!r}.")
    if wanted is False or (wanted is None and not in_notebook()):
        return Bar()
    return Cell() if in_notebook() else Terminal(sys.stderr)


def reporter(wanted: Wanted) -> Progress:
    """The callable that :func:`shows_progress` gave a function; silent without it."""
    return wanted if callable(wanted) else Bar()


def part_of(report: Progress, low: float, high: float) -> Progress:
    """What reports a part of the work, from 0 to 1, as between two shares of the whole."""
    return lambda share, what: report(low + share * (high - low), what)


def in_notebook() -> bool:
    """Whether a Jupyter kernel runs this code; IPython on a terminal is none."""
    ipython = sys.modules.get("IPython")
    shell = ipython.get_ipython() if ipython is not None else None
    return getattr(shell, "kernel", None) is not None


class Bar:
    """Takes the fraction done (0 to 1) and a few words; it draws a few times a second at most, and
    the end always, but nothing before ``after`` seconds. This one shows nothing. A ``with`` block
    ends it."""

    def __init__(self, after: float | None = None) -> None:
        after = _AFTER if after is None else after
        self._next = time.monotonic() + after
        self._begun = after == 0.0
        self._place: Any = None

    def __call__(self, fraction: float, what: str = "") -> None:
        now = time.monotonic()
        if now < self._next and (fraction < 1.0 or not self._begun):
            return
        self._next, self._begun = now + _EVERY, True
        self._draw(min(max(fraction, 0.0), 1.0), what)

    def _draw(self, fraction: float, what: str) -> None:
        """Show the bar at this fraction."""

    def close(self) -> None:
        """Take the bar away."""

    def __enter__(self) -> Bar:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()


class Called(Bar):
    """Hands everything to the user's own function."""

    def __init__(self, progress: Progress) -> None:
        self._progress = progress

    def __call__(self, fraction: float, what: str = "") -> None:
        self._progress(fraction, what)


class Terminal(Bar):
    """Progress on one line of a terminal; silent on anything else."""

    def __init__(self, stream: TextIO) -> None:
        super().__init__(0.0)
        self._stream = stream
        self._live = stream is not None and stream.isatty()

    def _draw(self, fraction: float, what: str) -> None:
        self._put(self.line(fraction, what, shutil.get_terminal_size().columns - 1))

    @staticmethod
    def line(fraction: float, what: str, width: int) -> str:
        """The bar, cut to a width."""
        done = round(30 * fraction)
        return f"[{'#' * done}{'.' * (30 - done)}] {100 * fraction:3.0f} %  {what}"[:width]

    def close(self) -> None:
        self._put("")

    def _put(self, text: str) -> None:
        if self._live:
            self._stream.write(f"\r{text}\x1b[K")
            self._stream.flush()


class Cell(Bar):
    """A bar of plain HTML in a notebook."""

    def _draw(self, fraction: float, what: str) -> None:
        words = f"{100 * fraction:.0f} % {html.escape(what)}"
        self._show(f'<progress max="1" value="{fraction:.3f}"></progress> {words}')

    def close(self) -> None:
        if self._place is not None:
            self._show("")

    def _show(self, text: str) -> None:
        from IPython.display import HTML, display  # pyright: ignore[reportMissingModuleSource]

        if self._place is None:
            self._place = display(HTML(text), display_id=True)
        else:
            self._place.update(HTML(text))

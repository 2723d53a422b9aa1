"""A progress bar in a few lines."""

from __future__ import annotations

import shutil
import time
from typing import TextIO

_EVERY = 0.1  # seconds between two drawings


class Bar:
    """A progress bar on one line of a terminal; prints nothing on anything else.

    Call it with the fraction done (0 to 1) and a few words. The line is cleared when the
    ``with`` block ends.
    """

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream
        self._live = stream.isatty()
        self._last = -_EVERY

    def __call__(self, fraction: float, what: str = "") -> None:
        now = time.monotonic()
        if not self._live or (now - self._last < _EVERY and fraction < 1.0):
            return
        self._last = now
        self._put(self.line(fraction, what, shutil.get_terminal_size().columns - 1))

    @staticmethod
    def line(fraction: float, what: str, width: int) -> str:
        """The bar, cut to a width."""
        fraction = min(max(fraction, 0.0), 1.0)
        done = round(30 * fraction)
        return f"[{'#' * done}{'.' * (30 - done)}] {100 * fraction:3.0f} %  {what}"[:width]

    def __enter__(self) -> Bar:
        return self

    def __exit__(self, *_: object) -> None:
        if self._live:
            self._put("")

    def _put(self, text: str) -> None:
        self._stream.write(f"\r{text}\x1b[K")
        self._stream.flush()

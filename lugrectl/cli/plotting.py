"""``lugrectl plot``: the log as it was read, the friction curve, and the plain torque balance."""

from __future__ import annotations

import io
import sys
from argparse import Namespace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..core.errors import InputError
from ..core.writing import write_whole
from .inputs import declared, files, reading
from .output import print_out

if TYPE_CHECKING:
    from ..blocks.model import Model
    from ..record import Log

FORMATS = ("png", "svg", "pdf", "jpg")
NO_SCREEN = (
    "there is no screen to draw on: only the numbers follow; give --plot plot.png to get the "
    "picture as a file"
)


def plot(a: Namespace) -> int:
    """Print the plain answer and draw it, into a file or on the screen.

    That there is no screen is said before the work.
    """
    from ..diagnosis.asked import plain_answer
    from ..report import plain_text

    kind = format_of(a.plot)
    logs, model = _read(a)  # first: an input that cannot be read has one sentence
    blind = kind is None and not has_screen()
    if blind:
        print(f"lugrectl: {NO_SCREEN}.", file=sys.stderr, flush=True)
    balance = plain_answer(logs, model)
    said = "" if blind else drawn(balance, a.plot, kind)
    print_out(balance.to_json() if a.json else plain_text(balance))
    if said:
        print(f"lugrectl: {said}", file=sys.stderr)
    return 0


def answered(found: Any, a: Namespace, kind: str | None, text: str) -> None:
    """Draw a result where --plot asks for it, print its text, then say where the picture is."""
    said = drawn(found, a.plot, kind) if kind else ""
    print_out(text)
    if said:
        print(f"lugrectl: {said}", file=sys.stderr)


def _read(a: Namespace) -> tuple[list[Log], Model]:
    """The logs, and the model; one of which nothing is known where none is given."""
    from ..blocks.model import changed
    from ..record import read_log

    model = None if a.model is None else declared(a)
    motion = None if model is None else model.motion
    logs = [read_log(name, **reading(a), motion=motion) for name in files(a.records)]
    return logs, model or changed({}, {"motion": logs[0].motion}, "model")


def format_of(out: str | None) -> str | None:
    """The kind of picture that a name asks for, None without one; InputError for another kind."""
    if out is None:
        return None
    kind = Path(out).suffix.lower().lstrip(".")
    if kind not in FORMATS:
        raise InputError(f"--plot {out}: the picture must be a file .{', .'.join(FORMATS)}.")
    if not Path(out).absolute().parent.is_dir():
        raise InputError(f"--plot {out}: there is no folder {Path(out).parent}.")
    return kind


def has_screen() -> bool:
    """Whether pyplot can open a window, and not only draw into files."""
    import matplotlib.pyplot as plt
    from matplotlib.backend_bases import FigureManagerBase

    try:
        figure = plt.figure()  # loads the backend, which may need a screen
    except Exception:  # each toolkit has errors of its own
        return False
    manager = type(figure.canvas).manager_class
    plt.close(figure)
    return any(
        getattr(manager, name).__func__ is not getattr(FigureManagerBase, name).__func__
        for name in ("start_main_loop", "pyplot_show")
    )


def drawn(result: Any, out: str | None, kind: str | None) -> str:
    """Draw a result into a file, or without one on the screen; returns what there is to say."""
    import matplotlib
    import numpy as np

    if out is not None:
        matplotlib.use("agg")
    import matplotlib.pyplot as plt

    figure = np.ravel(result.plot())[0].figure
    if out is None:
        plt.show()
        return "shown."
    made = io.BytesIO()
    figure.savefig(made, format=kind, dpi=130)
    plt.close(figure)
    write(Path(out), made.getvalue(), "--plot")
    return f"picture: {out}"


def write(path: Path, content: bytes, option: str) -> None:
    """Write a file whole or not at all."""
    try:
        write_whole(path, content)
    except OSError as error:
        raise InputError(
            f"{option} {path} cannot be written ({error.strerror or error})."
        ) from None

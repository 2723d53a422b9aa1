"""What a command gives back: text, one JSON document, a picture, and where files were written."""

from __future__ import annotations

import io
import json
import sys
from argparse import Namespace
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ..core.errors import InputError
from ..core.writing import write_whole

FORMATS = ("png", "svg", "pdf", "jpg")


def print_out(text: str) -> None:
    """Print with one newline at the end; escape what the terminal's encoding cannot show."""
    encoding = getattr(sys.stdout, "encoding", None) or "utf-8"
    print(text.rstrip("\n").encode(encoding, "backslashreplace").decode(encoding))


def say(sentence: str) -> None:
    """Print a sentence that is no part of the answer."""
    print(f"lugrectl: {sentence}", file=sys.stderr, flush=True)


def answer(found: Any, a: Namespace, text: str | None = None, picture: Any = None) -> None:
    """Draw a result or ``picture`` for --plot, print it or ``text``, say where the picture is."""
    said = drawn(found if picture is None else picture, a.plot) if a.plot else ""
    print_out(text or (found.to_json() if a.json else repr(found)))
    if said:
        say(said)


def listed(what: str, files: Sequence[Path], a: Namespace, more: str = "") -> None:
    """Print which files were written; with --json not on stdout."""
    if files:
        where = f"{what}: {files[0]} (and {', '.join(p.name for p in files[1:])}{more})"
        print(where, file=sys.stderr if a.json else sys.stdout)


def as_json(value: Any) -> str:
    """Return plain Python as a JSON document."""
    return json.dumps(value, indent=2, allow_nan=False)


def check_picture(out: str) -> None:
    """Raise InputError for a picture of an unknown kind, or in a folder that is missing."""
    if Path(out).suffix.lower().lstrip(".") not in FORMATS:
        raise InputError(f"--plot {out}: the picture must be a file .{', .'.join(FORMATS)}.")
    if not Path(out).absolute().parent.is_dir():
        raise InputError(f"--plot {out}: there is no folder {Path(out).parent}.")


def has_screen() -> bool:
    """Whether pyplot can open a window, and not only draw into files."""
    import matplotlib
    import matplotlib.pyplot as plt

    try:
        plt.close(plt.figure())  # loads the backend, which may need a screen
    except Exception:  # each toolkit has errors of its own
        return False
    return matplotlib.get_backend().lower() not in ("agg", "cairo", "pdf", "pgf", "ps", "svg")


def drawn(result: Any, out: str | None) -> str:
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
    picture = io.BytesIO()
    figure.savefig(picture, format=Path(out).suffix.lower().lstrip("."), dpi=130)
    plt.close(figure)
    write_whole(Path(out), picture.getvalue(), "--plot")
    return f"picture: {out}"

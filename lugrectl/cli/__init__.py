"""The command line: ``lugrectl COMMAND``; see ``lugrectl --help``."""

from __future__ import annotations

import contextlib
import os
import shlex
import sys
import traceback
import warnings
from collections.abc import Iterator, Sequence
from typing import Any

from ..core.blas_threads import BLAS
from ..core.errors import BROKEN_PIPE, INTERRUPTED, UNEXPECTED, InputError, NotLoaded
from ..core.option_names import on_command_line
from .options import parser
from .output import check_picture, say


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command and return its exit code.

    0 answered; 1 a checked property does not hold; 2 wrong usage or unreadable input; 3 the
    record cannot answer the question; 70 a defect of this program; 130 interrupted.
    """
    for name in BLAS if argv is None else ():  # set before NumPy is loaded: on small matrices
        os.environ.setdefault(name, "1")  # its threads cost more time than they save
    with warnings.catch_warnings():
        if argv is None and not sys.warnoptions:
            warnings.simplefilter("ignore")
        with _own_warnings(), on_command_line():
            code = _run(argv)
    return code


@contextlib.contextmanager
def _own_warnings() -> Iterator[None]:
    """Say in one line each which installed package's blocks are not there."""
    others = warnings.showwarning

    def show(message: Any, category: Any, *place: Any, **more: Any) -> None:
        if issubclass(category, NotLoaded):
            _said(f"warning: {message}", 0)
        else:
            others(message, category, *place, **more)

    warnings.showwarning = show
    warnings.simplefilter("always", NotLoaded)
    yield


def _run(argv: Sequence[str] | None) -> int:
    blocks: Sequence[str] = ()
    try:
        arguments = parser().parse_args(argv)
        arguments.typed = shlex.join(["lugrectl", *(sys.argv[1:] if argv is None else argv)])
        blocks = getattr(arguments, "blocks", None) or ()
        _load(blocks)
        if getattr(arguments, "plot", None) is not None:
            check_picture(arguments.plot)
        code = arguments.run(arguments)
        sys.stdout.flush()
        return code
    except SystemExit as stop:  # argparse: 0 after --help, 2 for wrong usage
        return int(stop.code or 0)
    except KeyboardInterrupt:
        return _said("interrupted.", INTERRUPTED)
    except BrokenPipeError:  # the reader closed the pipe: print nothing, not even at exit
        with contextlib.suppress(OSError):  # stdout may not be a file
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return BROKEN_PIPE
    except Exception as error:
        return _failed(error, blocks)


def _load(files: Sequence[str]) -> None:
    """Declare the blocks of the files of --blocks."""
    if files:
        from ..blocks.extending import load_blocks

        for file in files:
            load_blocks(file)


def _in_own_file(error: Exception, blocks: Sequence[str]) -> str | None:
    """File and line of a file of --blocks in which it went wrong."""
    own = {os.path.realpath(file) for file in blocks}
    for frame in reversed(traceback.extract_tb(error.__traceback__)):
        if os.path.realpath(frame.filename) in own:
            return f"{frame.filename}, line {frame.lineno}"
    return None


def _failed(error: Exception, blocks: Sequence[str] = ()) -> int:
    code = getattr(error, "exit_code", None)
    if code is not None:
        return _said(f"error: {error}", code)
    if os.environ.get("LUGRECTL_DEBUG") == "1":
        traceback.print_exc()
    what = " ".join(f"{type(error).__name__}: {error}".split())
    place = _in_own_file(error, blocks)
    if place is not None:
        return _said(f"error: {place}: {what}", InputError.exit_code)
    return _said(
        f"unexpected {what}. Please report this with the command you typed; "
        "set LUGRECTL_DEBUG=1 to see where it happened.",
        UNEXPECTED,
    )


def _said(sentence: str, code: int) -> int:
    say(sentence)
    return code

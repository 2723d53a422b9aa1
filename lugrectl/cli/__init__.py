"""The command line: ``lugrectl COMMAND``; see ``lugrectl --help``."""

from __future__ import annotations

import contextlib
import os
import shlex
import sys
import traceback
import warnings
from collections.abc import Sequence

import lugrectl as lg

from ..core.blas_threads import BLAS
from ..core.errors import BROKEN_PIPE, INTERRUPTED, UNEXPECTED, InputError
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
        with on_command_line():
            code = _run(argv)
    return code


def _run(argv: Sequence[str] | None) -> int:
    blocks: Sequence[str] = ()
    try:
        arguments = parser().parse_args(argv)
        arguments.typed = shlex.join(["lugrectl", *(sys.argv[1:] if argv is None else argv)])
        blocks = getattr(arguments, "blocks", None) or ()
        for file in blocks:
            lg.load_blocks(file)
        if getattr(arguments, "plot", None) is not None:
            check_picture(arguments.plot)
        code = arguments.run(arguments)
        sys.stdout.flush()
        return code
    except SystemExit as stop:  # argparse: 0 after --help, 2 for wrong usage
        return int(stop.code or 0)
    except KeyboardInterrupt:
        say("interrupted.")
        return INTERRUPTED
    except BrokenPipeError:  # the reader closed the pipe: print nothing, not even at exit
        with contextlib.suppress(OSError):  # stdout may not be a file
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return BROKEN_PIPE
    except Exception as error:
        return _failed(error, blocks)


def _failed(error: Exception, blocks: Sequence[str]) -> int:
    """Say what went wrong; an error in a file of --blocks with its line."""
    code = getattr(error, "exit_code", None)
    if code is not None:
        say(f"error: {error}")
        return code
    if os.environ.get("LUGRECTL_DEBUG") == "1":
        traceback.print_exc()
    what = " ".join(f"{type(error).__name__}: {error}".split())
    own = {os.path.realpath(file) for file in blocks}
    for frame in reversed(traceback.extract_tb(error.__traceback__)):
        if os.path.realpath(frame.filename) in own:
            say(f"error: {frame.filename}, line {frame.lineno}: {what}")
            return InputError.exit_code
    say(
        f"unexpected {what}. Please report this with the command you typed; "
        "set LUGRECTL_DEBUG=1 to see where it happened."
    )
    return UNEXPECTED

"""What a command prints."""

from __future__ import annotations

import sys


def print_out(text: str) -> None:
    """Print with one newline at the end; escape what the terminal's encoding cannot show."""
    encoding = getattr(sys.stdout, "encoding", None) or "utf-8"
    print(text.rstrip("\n").encode(encoding, "backslashreplace").decode(encoding))

"""``lugrectl assure``: how much friction compensation to dare, with its probabilities."""

from __future__ import annotations

import sys
from argparse import Namespace

from .output import print_out
from .plotting import drawn, format_of


def assure(a: Namespace) -> int:
    """0 once it is answered; whether the compensation is worth anything is in the answer."""
    from ..compensated_loop import assure as work
    from .progress import Bar

    kind = None if a.plot is None else format_of(a.plot, "--plot")
    names = ("loop", "kp", "ki", "kd", "bandwidth", "rate", "dead_time", "counts", "speed",
             "frequency", "members", "seed", "jobs", "hunts", "still")  # fmt: skip
    options = {k: getattr(a, k) for k in names}
    with Bar(sys.stderr) as bar:
        found = work(a.report, a.confidence, observers=a.observer, progress=bar, **options)
    said = drawn(found, a.plot, kind, "--plot") if kind else ""
    print_out(found.to_json() if a.json else repr(found))
    if said:
        print(f"lugrectl: {said}", file=sys.stderr)
    return 0

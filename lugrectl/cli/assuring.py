"""``lugrectl assure``: how much friction compensation to dare, with its probabilities."""

from __future__ import annotations

import sys
from argparse import Namespace

from .plotting import answered, format_of


def assure(a: Namespace) -> int:
    """0 once it is answered; whether the compensation is worth anything is in the answer."""
    from ..bench import assure as work
    from .progress import Bar

    kind = format_of(a.plot)
    names = ("loop", "kp", "ki", "kd", "bandwidth", "rate", "dead_time", "counts", "speed",
             "frequency", "members", "seed", "jobs", "hunts", "still")  # fmt: skip
    options = {k: getattr(a, k) for k in names}
    with Bar(sys.stderr) as bar:
        found = work(a.report, a.confidence, observers=a.observer, progress=bar, **options)
    answered(found, a, kind, found.to_json() if a.json else repr(found))
    return 0

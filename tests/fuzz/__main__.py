"""Run cases and print what is wrong, one JSON document for each, then how many of each kind."""

import faulthandler
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

from .checks import wrong_with
from .files import described

ALL = 2000


def main(first: int = 0, last: int = ALL) -> int:
    faulthandler.enable()
    seen, bad = Counter(), 0
    with tempfile.TemporaryDirectory() as folder:
        for number in range(first, last):
            began = time.perf_counter()
            print(f"at {number}", file=sys.stderr, flush=True)
            kind, ways, wrong = wrong_with(number, Path(folder))
            seen[kind] += 1
            took = time.perf_counter() - began
            if wrong is not None or took > 5:
                bad += wrong is not None
                print(described(number, kind, ways, wrong or f"took {took:.1f} s"), flush=True)
    print(f"{bad} wrong of {sum(seen.values())}: {dict(seen)}")
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main(*map(int, sys.argv[1:])))

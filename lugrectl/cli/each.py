"""``lugrectl diagnose --each``: every log separately, one table."""

from __future__ import annotations

import sys
from argparse import Namespace
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from ..core.blas_threads import processors
from ..core.errors import INTERRUPTED, UNEXPECTED, InputError
from ..core.progress import Terminal
from .inputs import declared, fixed, reading, searched, spare
from .output import listed, print_out, say

if TYPE_CHECKING:
    from ..diagnosis.fleet import Fleet, Outcome


def each(a: Namespace) -> int:
    """Diagnose, print and write; the exit code is the highest of the logs'."""
    from ..diagnosis.fleet import run_each
    from ..record import parse_pairs
    from ..record.as_record import record_files
    from ..report import content

    if a.holdout not in (None, "last"):
        raise InputError(
            f"--holdout {a.holdout} is one file, but with --each the errors of every log are "
            "computed on its own samples; leave it out, or give --holdout last."
        )
    model, how = fixed(declared(a), a), reading(a)
    for what in ("columns", "units", "scale"):  # a mistake here would make every log fail
        if how[what]:
            parse_pairs(how[what], what)
    files = [str(file) for file in record_files(a.records)]
    out = Store(a.out, files, a.model) if a.out is not None else None
    with Terminal(sys.stderr) as bar:
        fleet = run_each(
            files,
            model,
            how,
            searched(a),
            jobs=a.jobs or min(processors(), len(files)),
            progress=bar,
            keep=False,
            render=partial(content, folder=Path(a.out, "log")) if a.out else None,
            done=out,
            command=a.typed,
        )
    written: Sequence[Path] = ()
    try:
        written = out.index(fleet) if out and fleet.outcomes else ()
    finally:  # print the answer even if the disk is full
        print_out(fleet.to_json() if a.json else str(fleet))
    listed("table", written, a, ", a folder for each report")
    _tell(fleet, a)
    return INTERRUPTED if fleet.unfinished else fleet.exit_code


def _tell(fleet: Fleet, a: Namespace) -> None:
    """Say why the work ended early, and what the table on stdout does not show."""
    from ..record.as_record import passed_over

    done, without = len(fleet.outcomes), [o for o in fleet.outcomes if o.exit_code]
    if without and a.json:
        say(f"{len(without)} of {done} logs have no answer; see their reason.")
    broken = next((o.file for o in without if o.exit_code == UNEXPECTED), None)
    if broken:
        say(
            f"{broken}: unexpected error. Please report this with the command you typed; to see "
            "where it happened, diagnose that log alone with LUGRECTL_DEBUG=1."
        )
    if fleet.unfinished:
        say(f"interrupted: {done} of {done + len(fleet.unfinished)} logs done.")
    if left := passed_over(a.records):
        say(f"passed over, as no logs: {', '.join(path.name for path in left)}.")


class Store:
    """Writes the report of each log as soon as it is done, and the index at the end."""

    def __init__(self, folder: str, files: Sequence[str], model: str) -> None:
        from ..report import FILES, check_folder
        from ..report.fleet_page import INDEX, folder_names

        self._folder = Path(folder)
        self._names = dict(zip(files, folder_names(files), strict=True))
        self._links: dict[str, str] = {}
        check_folder(folder)
        if any(Path(file).resolve().parent == self._folder.resolve() for file in files):
            raise InputError(
                f"--out {self._folder} holds records, and the next run would read summary.csv "
                "as a record; choose another folder."
            )
        targets = [self._folder / name for name in INDEX]
        targets += [self._folder / n / name for n in self._names.values() for name in FILES]
        spare(str(self._folder), [*files, model], targets)

    def __call__(self, outcome: Outcome, content: dict[str, str] | None) -> Outcome:
        from ..report import written

        name = self._names[outcome.file]
        try:
            if content is not None:
                written(content, self._folder / name, "report")
                self._links[outcome.file] = f"{name}/report.html"
        except InputError as no:
            return replace(outcome, exit_code=no.exit_code, reason=str(no))
        return outcome

    def index(self, fleet: Fleet) -> list[Path]:
        """Write the table with links to the reports; returns its files."""
        from ..report.fleet_page import write_index

        return write_index(fleet, self._folder, self._links)

"""The commands that work on records: what they print and return.

Slow imports are left to the command that needs them.
"""

from __future__ import annotations

import sys
from argparse import Namespace
from dataclasses import replace
from functools import partial
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..core.errors import InputError, Refused
from ..core.provenance import stamp
from .inputs import AUTO, chosen, declared, files, fixed, reading
from .output import print_out

if TYPE_CHECKING:
    from ..blocks.model import Model
    from ..record import Log


def diagnose(a: Namespace) -> int:
    """``lugrectl diagnose``; with --each every log separately."""
    if a.each:
        from .each import each

        if a.compensate is not None:
            raise InputError("--compensate is for one drive: it cannot be combined with --each.")
        if a.plot is not None:
            raise InputError("--plot is for one drive: with --each give --out for all reports.")
        if a.law == AUTO:
            raise InputError("--law auto is for one drive: with --each give the law by name.")
        return each(a)
    if a.jobs is not None:
        raise InputError("--jobs is for many logs: use it together with --each.")
    from ..diagnosis.diagnose import diagnose as work

    return _main_job(work if a.compensate is None else partial(_closing, work, a.compensate), a)


def _closing(work: Any, loop: str, record: Any, model: Model, **options: Any) -> Any:
    """The result of ``work``, with the control loop compensated by the model it found."""
    from ..bench import compensate

    found = work(record, model, **options)
    if found.model is None:
        return found
    options["progress"](0.97, "closing the control loop")
    lugre = "sigma1" in model.friction.values
    options = {
        "observer": "proposed" if lugre else "disturbance",
        "record": found.record,
        "covariance": found.joint,
        "seed": options.get("seed", 0),
    }
    try:
        made = compensate(found.model, declared=model, loop=loop, table=found.table, **options)
    except InputError as no:  # the diagnosis is still valid
        message = f"the control loop was not closed: {no}"
        return replace(found, messages=(*found.messages, message))
    return replace(found, compensation=made)


def identify(a: Namespace) -> int:
    """``lugrectl identify``."""
    from ..diagnosis.identify import identify as work

    return _main_job(work, a)


def demo(a: Namespace) -> int:
    """``lugrectl demo``: diagnose the record and model that ship with the package."""
    from ..diagnosis.diagnose import diagnose as work

    with resources.as_file(resources.files("lugrectl") / "demo") as folder:
        files = {"records": [str(folder / "record.csv")], "model": str(folder / "model.toml")}
        options = {"columns": None, "units": None, "scale": None, "rate": None}
        fixed = {"holdout": None, "horizon": 1.0}
        return _main_job(work, Namespace(**vars(a), **files, **options, **fixed))


def reproduce(a: Namespace) -> int:
    """``lugrectl reproduce``: the source paper's numbers and figures, and what is not in it."""
    from ..paper import reproduce as work
    from ..paper import text, write
    from ..report import check_folder
    from .progress import Bar

    if a.out is not None:
        check_folder(a.out)
    with Bar(sys.stderr) as bar:
        result = stamp(work(progress=bar), a.typed)
        bar(1.0, "writing")
        written = write(result, a.out) if a.out is not None else []
    print_out(result.to_json() if a.json else text(result))
    if written:
        where = f"page: {written[0]} (and {', '.join(p.name for p in written[1:])})"
        print(where, file=sys.stderr if a.json else sys.stdout)
    return 0


def _main_job(work: Any, a: Namespace) -> int:
    from ..blocks.extending import files_loaded
    from ..report import check_folder, text, write
    from .plotting import answered, format_of

    kind = format_of(a.plot)
    model = fixed(declared(a), a)
    a.records = files(a.records)
    if a.out is not None:
        check_folder(a.out)
        _spare(a)
    sources = [*a.records, model, a.holdout, *files_loaded()]
    result = stamp(_answered(work, a, model), a.typed, sources)
    refused = getattr(result, "verdict", None) == "refused"
    written = write(result, a.out) if a.out is not None else []
    answered(result, a, None if refused else kind, result.to_json() if a.json else text(result))
    if written:
        where = f"report: {written[0]} (and {', '.join(p.name for p in written[1:])})"
        print(where, file=sys.stderr if a.json else sys.stdout)
    if refused and a.json:
        print(f"lugrectl: refused: {result.reason}", file=sys.stderr)
    return Refused.exit_code if refused else 0


def _answered(work: Any, a: Namespace, model: Model) -> Any:
    """The result of ``work``; a record that cannot answer gives the verdict "refused"."""
    from ..diagnosis.notes import refusal
    from .progress import Bar

    logs, holdout = _read_all(a, model)
    options = {"holdout": holdout, "horizon": a.horizon, "seed": a.seed}
    options |= chosen(a) | ({"law": AUTO} if getattr(a, "law", None) == AUTO else {})
    record = logs[0] if len(logs) == 1 else logs
    try:
        with Bar(sys.stderr) as bar:
            return work(record, model, progress=bar, **options)
    except Refused as no:
        return refusal(no, model, [], no.plain)


def _read_all(a: Namespace, model: Model) -> tuple[list[Log], Any]:
    """The logs, and the value of ``holdout``."""
    names = [Path(name).resolve() for name in a.records]
    twice = next((n for n in names if names.count(n) > 1), None)
    if twice is not None:
        raise InputError(f"{twice.name} is given twice; name each record once.")
    apart = a.holdout not in (None, "last")
    if apart and Path(a.holdout).resolve() in names:
        raise InputError(
            f"--holdout {a.holdout} is a training record too; give another file, or --holdout last."
        )
    logs = [_read(name, a, model) for name in a.records]
    return logs, _read(a.holdout, a, model) if apart else a.holdout


def _read(name: str, a: Namespace, model: Model) -> Log:
    from ..record import read_log

    return read_log(name, **reading(a), motion=model.motion)


def _spare(a: Namespace) -> None:
    """Raise InputError if the report would overwrite one of its input files."""
    from ..report import FILES

    sources = {Path(name).resolve() for name in [*a.records, a.model, a.holdout or "last"]}
    for name in FILES:
        if (Path(a.out) / name).resolve() in sources:
            raise InputError(
                f"--out {a.out} would overwrite {Path(a.out) / name}, which is an input; "
                "choose another folder."
            )

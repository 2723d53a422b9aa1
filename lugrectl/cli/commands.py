"""The commands: what they do with their options, and their exit code. Slow imports are left to the
command that needs them.
"""

from __future__ import annotations

import math
from argparse import Namespace
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Any

import lugrectl as lg

from ..core.blas_threads import processors
from ..core.errors import INTERRUPTED, UNEXPECTED, InputError, Refused
from ..core.progress import bar_for
from ..core.provenance import stamp
from ..core.writing import write_whole
from .inputs import (
    AUTO,
    declared,
    files,
    fixed,
    given,
    logs,
    reading,
    searched,
    spare,
    with_holdout,
)
from .output import answer, as_json, drawn, has_screen, listed, print_out, say

if TYPE_CHECKING:
    from ..blocks.model import Model
    from ..diagnosis.fleet import Fleet, Outcome

NO_SCREEN = (
    "there is no screen to draw on: only the numbers follow; give --plot plot.png to get the "
    "picture as a file"
)
OUTCOMES = {"rests": 0, "hunts": 1, "undecided": 3}  # exit codes of hunt


# --- diagnose, identify, demo, reproduce ---------------------------------------------------


def diagnose(a: Namespace) -> int:
    """``lugrectl diagnose``; with --each every log separately."""
    if a.each:
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

    return _fitted(work if a.compensate is None else partial(_closing, work, a.compensate), a)


def _closing(work: Any, loop: str, record: Any, model: Model, **options: Any) -> Any:
    """The result of ``work``, with the control loop compensated by the model it found."""
    found = work(record, model, **options)
    if found.model is None:
        return found
    options["progress"](0.97, "closing the control loop")
    options = {
        "observer": "proposed" if "sigma1" in model.friction.values else "disturbance",
        "record": found.record,
        "covariance": found.joint,
        "seed": options.get("seed", 0),
    }
    try:
        made = lg.compensate(found.model, declared=model, loop=loop, table=found.table, **options)
    except InputError as no:  # the diagnosis is still valid
        message = f"the control loop was not closed: {no}"
        return replace(found, messages=(*found.messages, message))
    return replace(found, compensation=made)


def identify(a: Namespace) -> int:
    from ..diagnosis.diagnose import identify as work

    return _fitted(work, a)


def demo(a: Namespace) -> int:
    """``lugrectl demo``: diagnose the record and model that ship with the package."""
    from ..diagnosis.diagnose import diagnose as work

    with resources.as_file(resources.files("lugrectl") / "demo") as folder:
        a.records, a.model = [str(folder / "record.csv")], str(folder / "model.toml")
        a.columns = a.units = a.scale = a.rate = a.holdout = None
        a.horizon = 1.0
        return _fitted(work, a)


def _fitted(work: Any, a: Namespace) -> int:
    """Fit, print and write; a record that cannot answer gives the verdict "refused"."""
    from ..blocks.declaration import files_of_blocks
    from ..diagnosis.result import refusal
    from ..report import FILES, check_folder

    model = fixed(declared(a), a)
    a.records = files(a.records)
    if a.out is not None:
        check_folder(a.out)
        named = [*a.records, a.model, a.holdout or "last"]
        spare(a.out, named, [Path(a.out) / name for name in FILES])
    sources = [*a.records, model, a.holdout, *files_of_blocks()]
    training, holdout = with_holdout(a, model)
    options = searched(a) | {"holdout": holdout}
    options |= {"law": AUTO} if getattr(a, "law", None) == AUTO else {}
    record = training[0] if len(training) == 1 else training
    try:
        with bar_for(True) as bar:
            result = work(record, model, progress=bar, **options)
    except Refused as no:
        result = refusal(no, model, [], no.plain)
    result = stamp(result, a.typed, sources)
    refused = getattr(result, "verdict", None) == "refused"
    written = result.save(a.out) if a.out is not None else []
    a.plot = None if refused else a.plot
    answer(result, a, None if a.json else str(result))
    listed("report", written, a)
    if refused and a.json:
        say(f"refused: {result.reason}")
    return Refused.exit_code if refused else 0


def reproduce(a: Namespace) -> int:
    """``lugrectl reproduce``: the source paper's numbers and figures, and what is not in it."""
    from ..paper import reproduce as work
    from ..report import check_folder

    if a.out is not None:
        check_folder(a.out)
    with bar_for(True) as bar:
        result = stamp(work(progress=bar), a.typed)
        bar(1.0, "writing")
        written = result.save(a.out) if a.out is not None else []
    print_out(result.to_json() if a.json else str(result))
    listed("page", written, a)
    return 0


# --- every log separately ------------------------------------------------------------------


def each(a: Namespace) -> int:
    """Diagnose, print and write; the exit code is the highest of the logs'."""
    from ..diagnosis.fleet import run_each
    from ..record import parse_pairs
    from ..record.as_record import record_files
    from ..report import content, fleet_page

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
    done, links = _reports(a, files)
    with bar_for(True) as bar:
        fleet = run_each(
            files,
            model,
            how,
            searched(a),
            jobs=a.jobs or min(processors(), len(files)),
            progress=bar,
            keep=False,
            render=partial(content, folder=Path(a.out, "log")) if a.out else None,
            done=done,
            command=a.typed,
        )
    index: Sequence[Path] = ()
    try:
        if a.out and fleet.outcomes:
            index = fleet_page.write_index(fleet, Path(a.out), links)
    finally:  # print the answer even if the disk is full
        print_out(fleet.to_json() if a.json else str(fleet))
    listed("table", index, a, ", a folder for each report")
    _tell(fleet, a)
    return INTERRUPTED if fleet.unfinished else fleet.exit_code


def _tell(fleet: Fleet, a: Namespace) -> None:
    """Say why the work ended early, and what the table on stdout does not show."""
    from ..record.as_record import passed_over

    broken = next((o.file for o in fleet.outcomes if o.exit_code == UNEXPECTED), None)
    if broken:
        say(f"{broken}: unexpected error; diagnose that log alone with LUGRECTL_DEBUG=1.")
    if fleet.unfinished:
        done = len(fleet.outcomes)
        say(f"interrupted: {done} of {done + len(fleet.unfinished)} logs done.")
    if left := passed_over(a.records):
        say(f"passed over, as no logs: {', '.join(path.name for path in left)}.")


def _reports(a: Namespace, files: Sequence[str]) -> tuple[Any, dict[str, str]]:
    """What writes the report of a log into --out when it is done, and the links to those that are
    there; InputError where --out holds records."""
    from ..report import FILES, check_folder, fleet_page, written

    links: dict[str, str] = {}
    if a.out is None:
        return None, links
    folder, names = Path(a.out), dict(zip(files, fleet_page.folder_names(files), strict=True))
    check_folder(a.out)
    if any(Path(file).resolve().parent == folder.resolve() for file in files):
        raise InputError(
            f"--out {folder} holds records, and the next run would read summary.csv "
            "as a record; choose another folder."
        )
    targets = [folder / name for name in fleet_page.INDEX]
    targets += [folder / name / file for name in names.values() for file in FILES]
    spare(a.out, [*files, a.model], targets)

    def done(outcome: Outcome, content: dict[str, str] | None) -> Outcome:
        try:
            if content is not None:
                written(content, folder / names[outcome.file], "report")
                links[outcome.file] = f"{names[outcome.file]}/report.html"
        except InputError as no:
            return replace(outcome, exit_code=no.exit_code, reason=str(no))
        return outcome

    return done, links


# --- plot, bode ----------------------------------------------------------------------------


def plot(a: Namespace) -> int:
    """Print the plain answer and draw it, into a file or on the screen."""
    from ..blocks.model import changed
    from ..core.result import plain
    from ..diagnosis.asked import plain_answer
    from ..report import plain_text

    model = None if a.model is None else declared(a)
    a.records = files(a.records)
    read = logs(a, None if model is None else model.motion)  # an unreadable input: one sentence
    blind = a.plot is None and not has_screen()
    if blind:
        say(f"{NO_SCREEN}.")
    balance = plain_answer(read, model or changed({}, {"motion": read[0].motion}, "model"))
    said = "" if blind else drawn(balance, a.plot)
    document = {**balance.summary(), "messages": balance.said}
    print_out(as_json(plain(document)) if a.json else plain_text(balance))
    if said:
        say(said)
    return 0


def bode(a: Namespace) -> int:
    """Print the response, and draw it; with --plan write an excitation, else tune a model."""
    if a.plan is not None:
        return _planned(a)
    more = [k for k in ("ms", "bandwidth", "dead_time", "no_hunting") if getattr(a, k)]
    if more and not a.tune:
        raise InputError(f"--{more[0].replace('_', '-')} is for gains: use it with --tune.")
    if not a.records and not a.tune:
        raise InputError("give a record; without one, --tune P-PI gives the gains of the model.")
    model = declared(a)
    if not a.records:
        answer(stamp(_tuned(model, a, rate=a.rate), a.typed, [model]), a)
        return 0
    a.records, none = files(a.records), None
    try:
        found = lg.frequency_response(logs(a, model.motion), model)
    except Refused as no:
        if a.json:
            arrays = ("frequency", "magnitude", "phase", "low", "high", "coherence", "modes")
            empty = {"schema": 1, **{k: [] for k in arrays}, "gains": None, "reason": str(no)}
            print_out(as_json(empty | {"experiment": no.experiment}))
        raise
    found = stamp(found, a.typed, [*a.records, model])
    try:
        found = replace(found, gains=_tuned(found, a, model=model)) if a.tune else found
    except Refused as no:
        none = no
        found = replace(found, messages=(*found.messages, f"No gains: {no}"))
    both = "\n".join(map(repr, filter(None, (found, found.gains))))
    answer(found, a, None if a.json else both)
    if none:
        raise none
    return 0


def _tuned(axis: Any, a: Namespace, **known: Any) -> Any:
    known |= given(a, "dead_time") | ({} if a.ms is None else {"Ms": a.ms})
    known |= {} if a.bandwidth is None else {"bandwidth": 2.0 * math.pi * a.bandwidth}
    return lg.tune(axis, a.tune, hunting=not a.no_hunting, **known)


def _planned(a: Namespace) -> int:
    """Write the references to record as CSV, and print how to play them."""
    pairs = [one.partition("=") for one in (a.limits or "").split(",") if one.strip()]
    try:
        limits: dict[str, Any] = {name.strip(): float(value) for name, _, value in pairs}
    except ValueError:
        limits = {"": 0.0}
    if not {*limits} <= {"w", "u", "theta"}:
        raise InputError(f"--limits is '{a.limits}', but w=60,u=3,theta=6 or part of it is needed.")
    if a.records or a.rate is None or not {"w", "u"} <= {*limits}:
        raise InputError(
            "--plan needs the rate and the limits of the drive in place of a record, such as "
            "--plan excitation.csv --rate 1000 --limits w=60,u=3."
        )
    if a.tune or a.plot:
        raise InputError("--plan writes an excitation only: use --tune and --plot with its log.")
    plan = lg.response_plan(lg.read_model(a.model), rate=a.rate, kp=a.kp, **limits)
    write_whole(Path(a.plan), plan.to_csv().encode(), "--plan")
    answer(plan, a)
    return 0


# --- hunt, assure --------------------------------------------------------------------------


def hunt(a: Namespace) -> int:
    """0 where every start comes to rest, 1 where one does not, 3 where it is undecided; with
    ``--speed`` 0 where both speeds are known."""
    gains = {k: getattr(a, k) for k in ("kp", "ki", "kd", "kv")}
    loop = {k: getattr(a, k) for k in ("rate", "dead_time", "counts", "limit", "time_limit")}
    vary = {}
    for text in a.vary or ():  # ki=1:50
        name, _, ends = text.partition("=")
        try:
            low, high = map(float, ends.split(":"))
        except ValueError:
            raise InputError(
                f"--vary is '{text}', but a gain and its ends are needed, such as ki=1:50."
            ) from None
        vary[name.strip()] = low, high
    moving = _moving(a, gains, vary or None) if a.speed else None
    if not a.report:
        vary = None if moving else vary or None
        model = lg.read_model(a.model)
        found: Any = lg.limit_cycles(model, **gains, **loop, vary=vary, progress=True)
        found = replace(found, stick_slip=moving) if moving else found
    elif vary:
        raise InputError("--vary is for one drive: give --model instead of --report.")
    else:
        found = lg.hunting_chance(a.report, members=a.members, progress=True, **gains, **loop)
    answer(found, a, picture=moving)
    return int(not math.isfinite(moving.speed_end)) if moving else OUTCOMES[found.outcome]


def _moving(a: Namespace, gains: dict[str, Any], vary: Any) -> Any:
    """Below which speeds the loop sticks and slips."""
    if a.report:
        raise InputError("--speed is for one drive: give --model instead of --report.")
    if a.rate or a.dead_time or a.counts or a.limit:
        raise Refused(
            "--speed is answered for a loop in continuous time without a limit: leave out --rate, "
            "--dead-time, --counts and --limit."
        )
    return lg.stick_slip_speed(lg.read_model(a.model), **gains, vary=vary, progress=True)


def assure(a: Namespace) -> int:
    """0 once it is answered; whether the compensation is worth anything is in the answer."""
    names = "loop kp ki kd bandwidth rate dead_time counts speed frequency members seed jobs hunts"
    options = {k: getattr(a, k) for k in (*names.split(), "still")}
    answer(lg.assure(a.report, a.confidence, observers=a.observer, progress=True, **options), a)
    return 0


# --- what needs no work --------------------------------------------------------------------


def effects(a: Namespace) -> int:
    """``lugrectl effects``: the catalogue, or one effect."""
    known = lg.effects()
    chosen: Any = known if a.name is None else known[a.name]
    if a.json:
        print_out(as_json(chosen.summary()))
    else:
        print_out(str(chosen) if a.name else "\n".join(entry.short() for entry in known))
    return 0


def template(a: Namespace) -> int:
    """``lugrectl model``."""
    toml = (resources.files("lugrectl") / "demo" / "template.toml").read_text(encoding="utf-8")
    print_out(as_json({"schema": 1, "toml": toml}) if a.json else toml)
    return 0


def schema(a: Namespace) -> int:
    file = resources.files("lugrectl") / "report" / "report.schema.json"
    print_out(file.read_text(encoding="utf-8"))
    return 0

"""The commands and their options."""

from __future__ import annotations

import argparse
import difflib
import math
import sys
from collections.abc import Callable, Sequence
from typing import Any, NoReturn

from ..core.provenance import version
from . import assuring, bode, commands, given, hunting, lookups, plotting
from .overview import overview

UNBUILT = ("compare", "plan", "export")  # commands that are announced


def parser() -> argparse.ArgumentParser:
    """The parser of all commands; ``run`` of its result is the command's function."""
    top = _Parser(
        prog="lugrectl",
        description="Find out which friction effect is missing from the model of a servo drive, "
        "from a log of its torque and motion.",
        epilog="Exit codes: 0 answered, 1 a checked property does not hold or a loop hunts, "
        "2 wrong usage or unreadable file, 3 the record cannot answer the question. "
        "lugrectl COMMAND --help shows "
        "a command's options. To begin: lugrectl demo, then lugrectl model > my.toml and "
        "lugrectl diagnose run.csv --model my.toml --out report.",
        allow_abbrev=False,
    )
    top.add_argument("--version", action=_Version, help="show the version and exit")
    made = top.add_subparsers(dest="command", metavar="COMMAND")
    top.set_defaults(run=lambda a: print(top.format_help(), end="") or 0, parser=top)
    top.format_help = lambda: overview(top, made)
    for add in (_on_records, _on_models, _looked_up):
        add(made)
    return top


def _on_records(made: Any) -> None:
    demo = _command(made, "demo", commands.demo, "diagnose a sample record that is included")
    _results(demo, out="lugrectl-demo")
    demo.add_argument(
        "--seed", type=_seed, default=0, metavar="N", help="seed of random numbers (default: 0)"
    )
    _diagnosing(
        _command(made, "diagnose", commands.diagnose, "name what is missing from the model")
    )
    _records(_command(made, "identify", commands.identify, "fit the declared model only"))
    drawing = _command(made, "plot", plotting.plot, "draw a log as it was read, and its friction")
    _logs(drawing)
    drawing.add_argument(
        "--model", metavar="MODEL.toml", help="the declared model, if there is one"
    )
    _picture(drawing, "--out")
    _axis(_command(made, "bode", bode.bode, "frequency response of the axis, friction taken out"))


def _on_models(made: Any) -> None:
    _command(made, "model", lookups.template, "print a commented model file to start from")
    _checks(
        _command(made, "check", lookups.check, "checks: l2, spr, bandwidth, stability, passivity")
    )
    _hunting(_command(made, "hunt", hunting.hunt, "find friction limit cycles of a position loop"))
    _assuring(_command(made, "assure", assuring.assure, "how much compensation to dare"))


def _looked_up(made: Any) -> None:
    known = _command(made, "effects", lookups.effects, "list the effects, or explain one")
    known.add_argument(
        "name", nargs="?", metavar="NAME", help="an effect; common names such as cogging will do"
    )
    _command(made, "schema", lookups.schema, "print the JSON schema of report.json")
    paper = _command(made, "reproduce", commands.reproduce, "recompute the source paper")
    paper.add_argument("--out", metavar="DIR", help="write reproduce.html and reproduce.json there")


def _diagnosing(command: argparse.ArgumentParser) -> None:
    _records(command)
    command.add_argument(
        "--time-limit",
        type=_positive,
        default=270.0,
        metavar="S",
        help="seconds after which the fit stops itself (default: 270); what was compared before "
        "stands all the same",
    )
    command.add_argument(
        "--least",
        type=_share,
        metavar="SHARE",
        help="smallest torque that matters, as a share of RMS friction torque (default: 0.015)",
    )
    command.add_argument(
        "--alpha",
        type=_share,
        metavar="P",
        help="chance of naming something where nothing is missing (default: 0.01)",
    )
    command.add_argument(
        "--compensate",
        choices=("velocity", "position"),
        help="also close this control loop in simulation: friction compensation with the "
        "declared and with the augmented model, and the tracking error of both, on the exact model "
        "and on drives like the recorded one",
    )
    _fleet(command)


def _axis(command: argparse.ArgumentParser) -> None:
    _logs(command, "*")
    add = command.add_argument
    add("--model", required=True, metavar="MODEL.toml", help="the declared model")
    _picture(command, "--out")
    gains = command.add_argument_group(
        "gains",
        "Without a record they are those of the model, whose values must be known. The controller "
        "runs at the rate of the record; without one at --rate, else in continuous time.",
    )
    what = "also the gains with the most integral action for every axis in the band"
    gains.add_argument("--tune", choices=("P-PI", "PID", "PI"), help=what)
    what = "with --tune: largest peak of the sensitivity (default: 1.6)"
    gains.add_argument("--ms", type=_positive, metavar="X", help=what)
    what = "with --tune: gains with this bandwidth (-3 dB) in place of the highest"
    gains.add_argument("--bandwidth", type=_positive, metavar="HZ", help=what)
    what = "with --tune: dead time in the loop that the record does not show"
    gains.add_argument("--dead-time", type=_finite, metavar="S", help=what)
    what = "with --tune: as little integral action as keeps the loop from hunting"
    gains.add_argument("--no-hunting", action="store_true", help=what)
    plan = command.add_argument_group("to record a good log", "In place of a record, with --rate.")
    plan.add_argument("--plan", metavar="FILE.csv", help="write the speed reference to record")
    most = "largest speed, torque and, if need be, distance from the start, SI units"
    plan.add_argument("--limits", metavar="w=60,u=3,theta=6", help=most)
    gain = "gain of the speed loop in N m s/rad or N s/m (default: that of 10 Hz bandwidth)"
    plan.add_argument("--kp", type=_positive, metavar="X", help=gain)


def _command(made: Any, name: str, run: Callable[..., int], what: str) -> argparse.ArgumentParser:
    command = made.add_parser(
        name, help=what, description=what[0].upper() + what[1:] + ".", allow_abbrev=False
    )
    command.set_defaults(run=run, parser=command)
    command.add_argument("--json", action="store_true", help="one JSON document on stdout")
    command.add_argument(
        "--blocks",
        action="append",
        default=[],
        metavar="FILE.py",
        help="Python file with effects, friction laws or observers of your own, each declared "
        "with @lugrectl.block; may be given several times",
    )
    return command


def _results(command: argparse.ArgumentParser, out: str | None = None) -> None:
    command.add_argument(
        "--out",
        metavar="DIR",
        default=out,
        help="write report.html, report.json and model.toml there"
        + (f" (default: {out})" if out else ""),
    )
    _picture(command)


def _picture(command: argparse.ArgumentParser, *also: str) -> None:
    """The picture of the answer; ``also`` are older names of the option."""
    what = "draw the answer: .png, .svg, .pdf or .jpg"
    command.add_argument("--plot", *also, dest="plot", metavar="FILE", help=what)


def _logs(command: argparse.ArgumentParser, many: str = "+") -> None:
    """The logs, and how to read them."""
    add = command.add_argument
    add(
        "records",
        nargs=many,
        metavar="RECORD",
        help="text (CSV and the like), JSON, MAT, NPY, NPZ, HDF5, Parquet or Excel file, or - for "
        "standard input; several files are runs of one drive",
    )
    for name, example, what in (
        (
            "columns",
            "t=time,u=torque",
            "names of the columns, or numbers from 1; w= for none",
        ),
        ("units", "theta=deg", "units of the columns, in place of those in the header"),
        ("scale", "u=35.15", "factors on raw values, such as theta=2pi/16384"),
    ):
        add(f"--{name}", action="append", metavar=example, help=what)
    add("--rate", type=_positive, metavar="HZ", help="sampling rate; a column t is then not used")


def _records(command: argparse.ArgumentParser) -> None:
    add = command.add_argument
    _logs(command)
    add("--model", required=True, metavar="MODEL.toml", help="the declared model")
    add(
        "--holdout",
        metavar="RECORD|last",
        help="hold out this file, or the last half, to compute the errors (default: every other "
        "block)",
    )
    add(
        "--horizon",
        type=_positive,
        default=1.0,
        metavar="S",
        help="seconds of simulation between restarts (default: 1)",
    )
    _results(command)
    add(
        "--law",
        metavar="NAME",
        help="friction law in place of the model's; values that both laws have are kept; auto: "
        "the simplest that predicts held-out samples as well as any",
    )
    add(
        "--fix",
        action="append",
        metavar="J,Fc",
        help="hold these declared values: J, parameters of the friction law, EFFECT.PARAMETER",
    )
    add("--seed", type=_seed, default=0, metavar="N", help="seed of random numbers (default: 0)")


def _fleet(command: argparse.ArgumentParser) -> None:
    many = command.add_argument_group(
        "many drives",
        "One log per drive, and one table of all. A RECORD may then be a folder: every record in "
        "it is taken. --out writes DIR/LOG/report.html, report.json and model.toml when a log is "
        "done. DIR/index.html and DIR/summary.csv follow at the end; after Ctrl-C they hold the "
        "logs that are done. All logs are diagnosed even if one fails. Exit code: 0 if every log "
        "was answered, else the highest code of a single log.",
    )
    many.add_argument("--each", action="store_true", help="diagnose every log separately")
    many.add_argument(
        "--jobs",
        type=_count,
        metavar="N",
        help="number of logs diagnosed at the same time, each in its own process (default: the "
        "number of processors or of logs, whichever is smaller); 1 starts no other process",
    )


def _checks(command: argparse.ArgumentParser) -> None:
    add = command.add_argument
    add(
        "property",
        choices=("l2", "spr", "bandwidth", "stability", "passivity"),
        help="l2: is the L2 gain of (J s + K2)/(sigma1 s + sigma0), from speed to bristle error "
        "of the proposed observer, finite; spr: is (sigma1 s + sigma0)/(J s^2 + C(s)) for the "
        "position loop, or (sigma1 s + sigma0)/(J s + C(s)) for the velocity loop, strictly "
        "positive real; bandwidth: bandwidth of the closed loop with friction compensated; "
        "stability: is that loop stable, and what are its gain, phase, modulus and delay margin; "
        "passivity: can the friction of the model never give back more energy than it stores",
    )
    add("--model", metavar="MODEL.toml", help="default: Table 1 of the source paper")
    loop = command.add_mutually_exclusive_group()
    loop.add_argument(
        "--position",
        dest="loop",
        action="store_const",
        const="position",
        help="check the position loop (default for spr)",
    )
    loop.add_argument(
        "--velocity",
        dest="loop",
        action="store_const",
        const="velocity",
        help="check the velocity loop (default for bandwidth and stability)",
    )
    for gain, what in (
        ("kp", "proportional gain (default of kp, ki, kd: the paper's if none is given, else 0)"),
        ("ki", "integral gain"),
        ("kd", "derivative gain"),
        ("tau", "filtered integral, ki/(X s + 1), X in s (default: pure, ki/s)"),
        ("K2", "observer gain, for l2 (default: 22)"),
    ):
        add(f"--{gain}", type=_finite, metavar="X", help=what)
    add("--leak", type=_finite, metavar="X", help="leaky integral, ki/(s + X), X in 1/s")
    add("--derivative-filter", type=_finite, metavar="X", help="kd s/(X s + 1), X in s")
    add(
        "--dead-time",
        type=_finite,
        metavar="S",
        help="dead time of the torque in the loop, exact; with --num and --den: T(s) exp(-S s)",
    )
    add("--prefilter", action="store_true", default=None, help="2/(s + 2) in front of the loop")
    add(
        "--num",
        metavar="1,10",
        help="check T = num/den instead (stability: the open loop): its numerator, highest power "
        "first",
    )
    add("--den", metavar="1,2,0.5", help="denominator of T")
    add("--dt", type=_positive, metavar="S", help="T(z) with this sample time (default: T(s))")
    _picture(command)
    add(
        "--half-power",
        action="store_true",
        default=None,
        help="bandwidth at half power (-3.0103 dB) instead of -3 dB",
    )


def _hunting(command: argparse.ArgumentParser) -> None:
    add = command.add_argument
    drive = command.add_mutually_exclusive_group(required=True)
    drive.add_argument("--model", metavar="MODEL.toml", help="the drive, all values known")
    drive.add_argument(
        "--report",
        metavar="report.json",
        help="a result: the chance of hunting over drives that its covariance draws",
    )
    add("--members", type=_count, default=40, metavar="N", help="with --report: drives (40)")
    for gain, what in (
        ("kp", "gain of the position error in N m/rad (default of kp, ki, kd: the paper's if none"),
        ("ki", "of its integral in N m/(rad s)"),
        ("kd", "of the speed in N m s/rad"),
        ("kv", "of a P position loop in 1/s: --kp and --ki are then those of a PI speed loop"),
    ):
        more = " is given, else 0)" if gain == "kp" else ""
        add(f"--{gain}", type=_finite, metavar="X", help=what + more)
    add("--rate", type=_positive, metavar="HZ", help="a sampled controller, whose torque is held")
    late = "with --rate: from measurement to torque"
    add("--dead-time", type=_finite, default=0.0, metavar="S", help=late)
    add("--counts", type=_count, metavar="N", help="with --rate: counts of the encoder in a turn")
    add("--limit", type=_positive, metavar="X", help="largest torque of the controller in N m")
    budget = "seconds after which a search by simulation leaves undecided what it does not know"
    add("--time-limit", type=_positive, metavar="S", help=budget)
    what = "also under r = v t: below which speeds sliding is unstable, and stick-slip persists"
    add("--speed", action="store_true", help=what)
    ends = "also find the values of a gain between which the loop hunts (--speed: sticks and slips)"
    add("--vary", action="append", metavar="ki=1:50", help=ends)
    _picture(command)


def _assuring(command: argparse.ArgumentParser) -> None:
    add = command.add_argument
    add("report", metavar="report.json", help="of diagnose or identify")
    add(
        "--confidence",
        type=_share,
        default=0.95,
        metavar="P",
        help="share of the drives for which the bound of the error holds (default: 0.95)",
    )
    ends = "share of the drives that may hunt at rest (default: 0.05)"
    add("--hunts", type=_share, default=0.05, metavar="P", help=ends)
    ends = "swing that is no hunting, peak to peak in rad (default: two counts)"
    add("--still", type=_positive, metavar="X", help=ends)
    add(
        "--loop",
        choices=("position", "velocity"),
        default="position",
        help="PID on the position (default) or PI on the speed",
    )
    for gain in ("kp", "ki", "kd"):
        more = " (default: all poles at -bandwidth)" if gain == "kp" else ""
        add(f"--{gain}", type=_finite, metavar="X", help=f"gain of the controller{more}")
    speed = "speed of all poles in 1/s, without gains (default: 20, or less at a low rate)"
    add("--bandwidth", type=_positive, metavar="X", help=speed)
    add("--observer", action="append", metavar="NAME", help="one to try; may be given again")
    add("--rate", type=_positive, metavar="HZ", help="of the controller (default: as recorded)")
    add("--dead-time", type=_finite, metavar="S", help="from measurement to torque (default: 0)")
    add("--counts", type=_count, metavar="N", help="of the encoder in a turn (as recorded)")
    add("--speed", type=_positive, metavar="X", help="of the reference, a sine, in rad/s")
    add("--frequency", type=_positive, metavar="HZ", help="of the reference (default: 1)")
    add("--members", type=_count, metavar="N", help="drives (default: as few as give a bound)")
    add("--seed", type=_seed, default=0, metavar="N", help="seed of random numbers (default: 0)")
    add("--jobs", type=_count, default=1, metavar="N", help="processes (default: 1)")
    _picture(command)


class _Parser(argparse.ArgumentParser):
    """A parser whose complaints are one sentence, with what was probably meant."""

    _given: Sequence[str] = ()

    def parse_args(self, args: Any = None, namespace: Any = None) -> Any:
        found, left = self.parse_known_args(args, namespace)
        if left:
            found.parser.error(f"unrecognized arguments: {' '.join(left)}")
        return found

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        self._given = given.joined(sys.argv[1:] if args is None else args)
        return super().parse_known_args(self._given, namespace)

    def error(self, message: str) -> NoReturn:
        """Leave with code 2 after one sentence; no usage in front of it."""
        if "invalid choice" in message and (new := {*UNBUILT} & {*self._given[:1]}):
            said = f"{new.pop()} is not built yet; {self.prog} --help shows what there is.\n"
            self.exit(2, f"{self.prog}: error: {said}")
        typed, near = next(filter(None, map(self._meant, self._given)), ("", ""))
        hint = f" (did you mean {near}?)" if near else ""
        if "--model" in message and not hint:
            model = next((word for word in self._given if word.lower().endswith(".toml")), None)
            hint = " (lugrectl model > my.toml writes one to start from)"
            hint = f" (give --model {model})" if model else hint
        what = message.split(" (choose from")[0] if hint and "choose from" in message else message
        for action in self._actions if not near or "invalid choice" in message else ():
            what = _of_places(what, action)
        if "are required" in message and near:  # the option that is missing is the misspelt one
            what = f"there is no option {typed}"
        said = f"{what.removesuffix('.')}{hint}; {self.prog} --help shows what there is.\n"
        self.exit(2, f"{self.prog}: error: {said}")

    def _meant(self, word: str) -> tuple[str, str] | None:
        """A word that is no option, and no command, of this parser, and what it resembles."""
        known = list(self._option_string_actions)
        if not word.startswith("-"):
            known = [c for a in self._actions if not a.option_strings for c in a.choices or ()]
        typed, bare = word.partition("=")[0], {k.lstrip("-").lower(): k for k in known}
        near = difflib.get_close_matches(typed.lstrip("-").lower(), bare, 1)
        return (typed, bare[near[0]]) if near and typed not in known else None


def _of_places(what: str, action: argparse.Action) -> str:
    """A complaint about the place of a command or property, in words, and with its choices."""
    if action.option_strings or not action.choices:
        return what
    name = str(action.metavar or action.dest)
    what = what.replace(f"argument {name}: invalid choice:", f"there is no {name.lower()}")
    missing = f"required: {name}"
    return what.replace(missing, f"{missing} ({', '.join(map(str, action.choices))})")


class _Version(argparse.Action):
    """The installed version, looked up only when it is asked for."""

    def __init__(self, option_strings: Any, dest: str, **options: Any) -> None:
        super().__init__(option_strings, dest, nargs=0, **options)

    def __call__(self, parser: argparse.ArgumentParser, *_: Any) -> None:
        print(f"lugrectl {version()}")
        parser.exit(0)


def _finite(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise argparse.ArgumentTypeError(f"'{text}' is not a finite number")
    return value


def _share(text: str) -> float:
    """A number between 0 and 1."""
    value = _positive(text)
    if value >= 1.0:
        raise argparse.ArgumentTypeError(f"{text} is not below 1; give a share such as 0.015.")
    return value


def _positive(text: str) -> float:
    if (value := _finite(text)) <= 0:
        raise argparse.ArgumentTypeError(f"{text} is not above 0")
    return value


def _count(text: str) -> int:
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"'{text}' is not a whole number of at least 1")
    return int(text)


def _seed(text: str) -> int:
    if not text.isdecimal():
        raise argparse.ArgumentTypeError(f"'{text}' is not a whole number of at least 0")
    return int(text)

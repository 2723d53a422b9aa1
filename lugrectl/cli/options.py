"""The table of the commands: what each does, its function and its options; and its parser.

An option is written as in a help, ``"--seed N >= 0 = 0": "seed of ..."``: its name, the word for
its value with its bound, its default, and ``...`` where it may be given several times. A word in
braces is one of several; without a word the option is a flag. At the end ``!`` stands for what must
be given, ``?``, ``*`` and ``+`` for how many words a place takes.
"""

from __future__ import annotations

import argparse
import math
import sys
import textwrap
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NoReturn

from ..core.provenance import version
from . import checks, commands

# --- types of options ----------------------------------------------------------------------


def finite(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise argparse.ArgumentTypeError(f"'{text}' is not a finite number")
    return value


def positive(text: str) -> float:
    """A finite number above 0."""
    if (value := finite(text)) <= 0:
        raise argparse.ArgumentTypeError(f"{text} is not above 0")
    return value


def share(text: str) -> float:
    """A number between 0 and 1."""
    value = positive(text)
    if value >= 1.0:
        raise argparse.ArgumentTypeError(f"{text} is not below 1; give a share such as 0.015.")
    return value


def seed(text: str, least: int = 0) -> int:
    """A whole number from 0 on."""
    if not text.isdecimal() or int(text) < least:
        raise argparse.ArgumentTypeError(f"'{text}' is not a whole number of at least {least}")
    return int(text)


def count(text: str) -> int:
    """A whole number from 1 on."""
    return seed(text, 1)


KINDS: dict[str, Callable[[str], Any]] = {
    **{"HZ": positive, "X": finite, "X > 0": positive, "S": finite, "S > 0": positive},
    **{"N": count, "N >= 0": seed, "P": share, "SHARE": share},
}


Group = tuple[str, str, Mapping[str, str]]  # title, text, table


def _read(table: Mapping[str, str]) -> Iterator[tuple[list[str], dict[str, Any]]]:
    """The names and settings for ``add_argument`` of the options in a table."""
    for written, what in table.items():
        written, _, default = written.partition(" = ")
        written, several, _ = written.partition(" ...")
        written, mark = (written[:-2], written[-1]) if written[-1] in "!?*+" else (written, "")
        names, _, word = written.partition(" ")
        more: dict[str, Any] = {"help": what}
        if mark:
            more |= {"required": True} if mark == "!" else {"nargs": mark}
        if not word:
            more |= {"action": "store_true"}
        elif word[0] == "{":
            more |= {"choices": tuple(word.strip("{}").split(","))}
        else:
            more |= {"metavar": word.split(" ")[0], "type": KINDS.get(word, str)}
        more |= {"action": "append"} if several else {}
        more |= {"default": more.get("type", str)(default)} if default else {}
        yield names.split(","), more


@dataclass(frozen=True)
class Command:
    """What a command does, its function, which returns the exit code, and its options."""

    what: str
    run: Callable[[argparse.Namespace], int]
    table: Mapping[str, str] = field(default_factory=dict)
    groups: Sequence[Group] = ()  # options under a title of their own
    either: Mapping[str, str] = field(default_factory=dict)  # of which one at most is given
    needs_one: bool = False  # one of these must be given

    def add(self, command: Any) -> None:
        places: list[tuple[Any, Mapping[str, str]]] = [(command, ALL)]
        if self.either:
            group = command.add_mutually_exclusive_group(required=self.needs_one)
            places.append((group, self.either))
        places.append((command, self.table))
        places += [(command.add_argument_group(*said), table) for *said, table in self.groups]
        for place, table in places:
            for names, settings in _read(table):
                place.add_argument(*names, **settings)


# --- options -------------------------------------------------------------------------------

RECORDS = (
    "text (CSV and the like), JSON, MAT, NPY, NPZ, HDF5, Parquet or Excel file, or - for standard "
    "input; several files are runs of one drive"
)
LOGS, LOGS_OR_NONE = {"records RECORD +": RECORDS}, {"records RECORD *": RECORDS}
MODEL = {"--model MODEL.toml !": "the declared model"}
DRAWN = "draw the answer: .png, .svg, .pdf or .jpg"
PICTURE, PICTURE_OUT = {"--plot FILE": DRAWN}, {"--plot,--out FILE": DRAWN}
PROPERTY = (
    "l2: is the L2 gain of (J s + K2)/(sigma1 s + sigma0), from speed to bristle error of the "
    "proposed observer, finite; spr: is (sigma1 s + sigma0)/(J s^2 + C(s)) for the position loop, "
    "or (sigma1 s + sigma0)/(J s + C(s)) for the velocity loop, strictly positive real; bandwidth: "
    "bandwidth of the closed loop with friction compensated; stability: is that loop stable, and "
    "what are its gain, phase, modulus and delay margin; passivity: can the friction of the model "
    "never give back more energy than it stores"
)
LOOPS = {
    "--position": "check the position loop (default for spr)",
    "--velocity": "check the velocity loop (default for bandwidth and stability)",
}
ONE_OR_MANY = {
    "--model MODEL.toml": "the drive, all values known",
    "--report report.json": "a result: the chance of hunting over drives that its covariance draws",
}

ALL = {
    "--json": "one JSON document on stdout",
    "--blocks FILE.py ...": "Python file with effects, friction laws or observers of your own, "
    "each declared with @lugrectl.block; may be given several times",
}
READING = {
    "--columns t=time,u=torque ...": "names of the columns, or numbers from 1; w= for none",
    "--units theta=deg ...": "units of the columns, in place of those in the header",
    "--scale u=35.15 ...": "factors on raw values, such as theta=2pi/16384",
    "--rate HZ": "sampling rate; a column t is then not used",
}
SEED = {"--seed N >= 0 = 0": "seed of random numbers (default: 0)"}
OUT = "write report.html, report.json and model.toml there"
FITTED = (
    LOGS
    | MODEL
    | PICTURE
    | READING
    | {
        "--holdout RECORD|last": "hold out this file, or the last half, to compute the errors "
        "(default: every other block)",
        "--horizon S > 0 = 1.0": "seconds of simulation between restarts (default: 1)",
        "--out DIR": OUT,
        "--law NAME": "friction law in place of the model's; values that both laws have are kept; "
        "auto: the simplest that predicts held-out samples as well as any",
        "--fix J,Fc ...": "hold these declared values: J, parameters of the friction law, "
        "EFFECT.PARAMETER",
        **SEED,
    }
)
DIAGNOSED = FITTED | {
    "--time-limit S > 0 = 270.0": "seconds after which the fit stops itself (default: 270); what "
    "was compared before stands all the same",
    "--least SHARE": "smallest torque that matters, as a share of RMS friction torque "
    "(default: 0.015)",
    "--alpha P": "chance of naming something where nothing is missing (default: 0.01)",
    "--compensate {velocity,position}": "also close this control loop in simulation: friction "
    "compensation with the declared and with the augmented model, and the tracking error of both, "
    "on the exact model and on drives like the recorded one",
}
FLEET: Group = (
    "many drives",
    "One log per drive, and one table of all. A RECORD may then be a folder: every record in "
    "it is taken. --out writes DIR/LOG/report.html, report.json and model.toml when a log is "
    "done. DIR/index.html and DIR/summary.csv follow at the end; after Ctrl-C they hold the "
    "logs that are done. All logs are diagnosed even if one fails. Exit code: 0 if every log "
    "was answered, else the highest code of a single log.",
    {
        "--each": "diagnose every log separately",
        "--jobs N": "number of logs diagnosed at the same time, each in its own process (default: "
        "the number of processors or of logs, whichever is smaller); 1 starts no other process",
    },
)
AXIS_GAINS: Group = (
    "gains",
    "Without a record they are those of the model, whose values must be known. The controller "
    "runs at the rate of the record; without one at --rate, else in continuous time.",
    {
        "--tune {P-PI,PID,PI}": "also the gains with the most integral action for every axis in "
        "the band",
        "--ms X > 0": "with --tune: largest peak of the sensitivity (default: 1.6)",
        "--bandwidth HZ": "with --tune: gains with this bandwidth (-3 dB) in place of the highest",
        "--dead-time S": "with --tune: dead time in the loop that the record does not show",
        "--no-hunting": "with --tune: as little integral action as keeps the loop from hunting",
    },
)
TO_RECORD: Group = (
    "to record a good log",
    "In place of a record, with --rate.",
    {
        "--plan FILE.csv": "write the speed reference to record",
        "--limits w=60,u=3,theta=6": "largest speed, torque and, if need be, distance from the "
        "start, SI units",
        "--kp X > 0": "gain of the speed loop in N m s/rad or N s/m (default: that of 10 Hz "
        "bandwidth)",
    },
)
CHECK = {
    f"property {{{','.join(checks.UNUSED)}}}": PROPERTY,
    **PICTURE,
    "--model MODEL.toml": "default: Table 1 of the source paper",
    "--kp X": "proportional gain (default of kp, ki, kd: the paper's if none is given, else 0)",
    "--ki X": "integral gain",
    "--kd X": "derivative gain",
    "--tau X": "filtered integral, ki/(X s + 1), X in s (default: pure, ki/s)",
    "--K2 X": "observer gain, for l2 (default: 22)",
    "--leak X": "leaky integral, ki/(s + X), X in 1/s",
    "--derivative-filter X": "kd s/(X s + 1), X in s",
    "--dead-time S": "dead time of the torque in the loop, exact; with --num and --den: "
    "T(s) exp(-S s)",
    "--prefilter": "2/(s + 2) in front of the loop",
    "--num 1,10": "check T = num/den instead (stability: the open loop): its numerator, highest "
    "power first",
    "--den 1,2,0.5": "denominator of T",
    "--dt S > 0": "T(z) with this sample time (default: T(s))",
    "--half-power": "bandwidth at half power (-3.0103 dB) instead of -3 dB",
}
HUNT = PICTURE | {
    "--members N = 40": "with --report: drives (40)",
    "--kp X": "gain of the position error in N m/rad (default of kp, ki, kd: the paper's if none "
    "is given, else 0)",
    "--ki X": "of its integral in N m/(rad s)",
    "--kd X": "of the speed in N m s/rad",
    "--kv X": "of a P position loop in 1/s: --kp and --ki are then those of a PI speed loop",
    "--rate HZ": "a sampled controller, whose torque is held",
    "--dead-time S = 0.0": "with --rate: from measurement to torque",
    "--counts N": "with --rate: counts of the encoder in a turn",
    "--limit X > 0": "largest torque of the controller in N m",
    "--time-limit S > 0": "seconds after which a search by simulation leaves undecided what it "
    "does not know",
    "--speed": "also under r = v t: below which speeds sliding is unstable, and stick-slip "
    "persists",
    "--vary ki=1:50 ...": "also find the values of a gain between which the loop hunts (--speed: "
    "sticks and slips)",
}
ASSURE = {
    "report report.json": "of diagnose or identify",
    **PICTURE,
    "--confidence P = 0.95": "share of the drives for which the bound of the error holds "
    "(default: 0.95)",
    "--hunts P = 0.05": "share of the drives that may hunt at rest (default: 0.05)",
    "--still X > 0": "swing that is no hunting, peak to peak in rad (default: two counts)",
    "--loop {position,velocity} = position": "PID on the position (default) or PI on the speed",
    "--kp X": "gain of the controller (default: all poles at -bandwidth)",
    "--ki X": "gain of the controller",
    "--kd X": "gain of the controller",
    "--bandwidth X > 0": "speed of all poles in 1/s, without gains (default: 20, or less at a low "
    "rate)",
    "--observer NAME ...": "one to try; may be given again",
    "--rate HZ": "of the controller (default: as recorded)",
    "--dead-time S": "from measurement to torque (default: 0)",
    "--counts N": "of the encoder in a turn (as recorded)",
    "--speed X > 0": "of the reference, a sine, in rad/s",
    "--frequency HZ": "of the reference (default: 1)",
    "--members N": "drives (default: as few as give a bound)",
    **SEED,
    "--jobs N = 1": "processes (default: 1)",
}
DEMO = PICTURE | {"--out DIR = lugrectl-demo": f"{OUT} (default: lugrectl-demo)"} | SEED
PLOT = LOGS | PICTURE_OUT | READING
PLOT |= {"--model MODEL.toml": "the declared model, if there is one"}
PAPER = {"--out DIR": "write reproduce.html and reproduce.json there"}
NAME = {"name NAME ?": "an effect; common names such as cogging will do"}

COMMANDS: dict[str, dict[str, Command]] = {
    "On records": {
        "demo": Command("diagnose a sample record that is included", commands.demo, DEMO),
        "diagnose": Command(
            "name what is missing from the model", commands.diagnose, DIAGNOSED, [FLEET]
        ),
        "identify": Command("fit the declared model only", commands.identify, FITTED),
        "plot": Command("draw a log as it was read, and its friction", commands.plot, PLOT),
        "bode": Command(
            "frequency response of the axis, friction taken out",
            commands.bode,
            LOGS_OR_NONE | MODEL | PICTURE_OUT | READING,
            [AXIS_GAINS, TO_RECORD],
        ),
    },
    "On models": {
        "model": Command("print a commented model file to start from", commands.template),
        "check": Command(
            "checks: l2, spr, bandwidth, stability, passivity", checks.check, CHECK, either=LOOPS
        ),
        "hunt": Command(
            "find friction limit cycles of a position loop",
            commands.hunt,
            HUNT,
            either=ONE_OR_MANY,
            needs_one=True,
        ),
        "assure": Command("how much compensation to dare", commands.assure, ASSURE),
    },
    "To look up": {
        "effects": Command("list the effects, or explain one", commands.effects, NAME),
        "schema": Command("print the JSON schema of report.json", commands.schema),
        "reproduce": Command("recompute the source paper", commands.reproduce, PAPER),
    },
}


# --- the parser -----------------------------------------------------------------------------

UNBUILT = ("compare", "plan", "export")  # commands that are announced
_EXAMPLE = """Example:
  lugrectl diagnose run.csv --model my.toml --out report"""


class Parser(argparse.ArgumentParser):
    """A parser whose complaints are one sentence, with what was probably meant."""

    _hint = ""

    def parse_args(self, args: Any = None, namespace: Any = None) -> Any:
        words = sys.argv[1:] if args is None else list(args)
        (commands,) = (a.choices or {} for a in self._actions if a.dest == "command")
        if words and not words[0].startswith("-"):
            if words[0] in UNBUILT:
                self.error(f"{words[0]} is not built yet")
            self._known("command", words[0], list(commands))
            commands[words[0]].check(words[1:])  # type: ignore[index]
        return super().parse_args(words, namespace)

    def check(self, words: Sequence[str]) -> None:
        """Leave with code 2 where a word is no option, or no choice, of this command."""
        for action in self._actions:
            if action.choices and not action.option_strings and words and words[0][:1] != "-":
                self._known(action.dest, words[0], [*action.choices])
        for word in (w.partition("=")[0] for w in words if w.startswith("--")):
            self._known("option", word, [*self._option_string_actions])
        toml = next((word for word in words if word.lower().endswith(".toml")), None)
        self._hint = " (lugrectl model > my.toml writes one to start from)"
        self._hint = f" (give --model {toml})" if toml else self._hint

    def _known(self, what: str, word: str, known: list[str]) -> None:
        if word in known:
            return
        from ..core.validation import nearest  # loads NumPy, which help does without

        bare = {name.lstrip("-"): name for name in known}
        near = nearest(word.lstrip("-"), bare)
        hint = f"did you mean {bare[near]}?" if near else f"known: {', '.join(known)}"
        self.error(f"there is no {what} '{word}' ({hint})")

    def error(self, message: str) -> NoReturn:
        """Leave with code 2 after one sentence; no usage in front of it."""
        hint = self._hint if message.endswith("--model") else ""
        said = f"{message.removesuffix('.')}{hint}; {self.prog} --help shows what there is.\n"
        self.exit(2, f"{self.prog}: error: {said}")


def overview(top: Parser) -> str:
    """The text of ``lugrectl --help``: what each command does, in groups."""
    width = max(len(name) for group in COMMANDS.values() for name in group) + 2
    parts = ["usage: lugrectl COMMAND [options]", _filled(top.description)]
    for title, group in COMMANDS.items():
        rows = [f"  {name:<{width}}{one.what}" for name, one in group.items()]
        parts.append("\n".join([f"{title}:", *rows]))
    options = "Options:\n  --help, -h  show this help\n  --version   show the version"
    return "\n\n".join([*parts, options, _EXAMPLE, _filled(top.epilog)]) + "\n"


def _said(top: Parser, asked: bool) -> int:
    print(f"lugrectl {version()}\n" if asked else top.format_help(), end="")
    return 0


def _filled(text: str | None) -> str:
    return textwrap.fill(text or "", 80, break_on_hyphens=False)


def parser() -> argparse.ArgumentParser:
    """The parser of all commands; ``run`` of its result is the command's function."""
    top = Parser(
        prog="lugrectl",
        description="Find out which friction effect is missing from the model of a servo drive, "
        "from a log of its torque and motion.",
        epilog="Exit codes: 0 answered, 1 a checked property does not hold or a loop hunts (hunt "
        "--speed: 0, its answer is two speeds), 2 wrong usage or unreadable file, 3 the record "
        "cannot answer the question. lugrectl COMMAND --help shows a command's options. To begin: "
        "lugrectl demo, then lugrectl model > my.toml and lugrectl diagnose run.csv --model "
        "my.toml --out report.",
        allow_abbrev=False,
    )
    top.add_argument("--version", action="store_true", help="show the version and exit")
    top.set_defaults(run=lambda a: _said(top, a.version), parser=top)
    made = top.add_subparsers(dest="command", metavar="COMMAND")
    top.format_help = lambda: overview(top)
    for group in COMMANDS.values():
        for name, one in group.items():
            said = one.what[0].upper() + one.what[1:] + "."
            command = made.add_parser(name, help=one.what, description=said, allow_abbrev=False)
            command.set_defaults(run=one.run, parser=command)
            one.add(command)
    return top

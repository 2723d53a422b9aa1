"""The commands that need no record: checks, catalogue, model template."""

from __future__ import annotations

import json
import math
import sys
import textwrap
from argparse import Namespace
from collections.abc import Mapping
from functools import partial
from importlib import resources
from typing import Any

from ..core.errors import InputError
from .given import facts as transfer_facts
from .given import transfer, written
from .output import print_out
from .plotting import answered, format_of

# The source paper's gains, by loop; K2 of the proposed observer.
PAPER = {"velocity": {"kp": 1.6, "ki": 0.16}, "position": {"kp": 15.0, "ki": 1.55}}
PAPER_K2 = 22.0
_MADE = {"spr": "T", "bandwidth": "loop_tf", "stability": "L"}  # of which transfer function
_BRISTLES = ("J", "sigma0", "sigma1")
_NEEDED = {"l2": _BRISTLES, "spr": _BRISTLES, "passivity": ("sigma1", "Fc", "Fs", "Fv", "vs")}
_SHOWN = (
    *("gain", "frequency", "bandwidth", "hertz", "margin", "band_edge", "gain_margin"),
    *("phase_margin", "modulus_margin", "delay_margin", "least_Fv", "largest_sigma1", "speed"),
)


def check(a: Namespace) -> int:
    """``lugrectl check``: 0 when the property holds, 1 when not."""
    from .. import linear

    loop = a.loop or ("position" if a.property == "spr" else "velocity")
    kind = format_of(a.plot)
    T = transfer(a)
    if T is not None and a.property == "passivity":
        raise InputError("--num: passivity is about the friction of a model; give it --model.")
    p, name = _parameters(a) if T is None else (None, None)
    level = "half-power" if a.half_power else "-3dB"
    verdict_of = {
        "l2": linear.l2_check,
        "spr": linear.spr_check,
        "bandwidth": partial(linear.bandwidth_check, level=level),
        "stability": linear.stability_check,
        "passivity": linear.passivity_check,
    }[a.property]
    if T is not None:
        gains, about, verdict = {}, {"transfer": transfer_facts(a)}, verdict_of(T)
    elif a.property == "passivity":
        gains, about, verdict = {}, {}, verdict_of(p)
    elif a.property == "l2":
        gains = {"K2": PAPER_K2 if a.K2 is None else a.K2}
        verdict, about = linear.l2_check(p, **gains), {}
    else:
        gains, about = _gains(a, loop), {"loop": loop}
        made = getattr(linear, f"{loop}_{_MADE[a.property]}")
        filtered = {"prefilter": bool(a.prefilter)} if a.property == "bandwidth" else {}
        verdict, about = verdict_of(made(p, **gains, **filtered)), about | filtered
    _unused(a)
    facts = {"schema": 1, "check": a.property, **about, "model": name, "gains": gains}
    facts |= verdict.summary()
    text = _document(facts) if a.json else _check_text(facts, verdict._units)
    answered(verdict, a, kind, text)
    return 0 if verdict else 1


def _parameters(a: Namespace) -> tuple[Any, str]:
    """An object with the parameters that a check needs, and the model's name."""
    from ..blocks.model import read_model, table1

    if a.model is None:
        return table1(), "Table 1"
    model = read_model(a.model)
    needed = _NEEDED.get(a.property, ("J",))
    values = model.values()
    if set(needed) - set(values):
        raise InputError(
            f"{a.model}: {a.property} is about LuGre friction, but the file declares "
            f"'{model.friction.block.name}'; set model = \"lugre\" with sigma0 and sigma1."
        )
    missing = [k for k in needed if values[k] is None]
    if missing:
        raise InputError(
            f"{a.model}: {a.property} needs {' and '.join(missing)}, which the file does not give."
        )
    return (model if a.property == "passivity" else Namespace(**values)), model.name


def _gains(a: Namespace, loop: str) -> dict[str, float]:
    """The paper's gains if none is given, else the given ones and 0 for the others."""
    given = {k: getattr(a, k) for k in ("kp", "ki", "kd") if getattr(a, k) is not None}
    gains = {"kp": 0.0, "ki": 0.0, "kd": 0.0} | (given or PAPER[loop])
    times = {k: getattr(a, k) for k in ("tau", "leak", "derivative_filter", "dead_time")}
    return gains | {k: v for k, v in times.items() if v is not None}


def _unused(a: Namespace) -> None:
    times = ("tau", "leak", "derivative_filter")
    loop, filters = ("kp", "ki", "kd", *times), ("prefilter", "half_power")
    names = {
        "l2": (*loop, *filters, "dead_time"),
        "spr": ("K2", *filters),
        "bandwidth": ("K2",),
        "stability": ("K2", *filters),
        "passivity": (*loop, *filters, "K2", "dead_time", "dt"),
    }[a.property]
    if a.num is not None:
        names = ("model", "K2", *loop, "prefilter", *filters[1:])
        names = names[: -1 if a.property == "bandwidth" else None]
    extra = [f"--{k.replace('_', '-')}" for k in names if getattr(a, k) is not None]
    extra += [f"--{a.loop}"] if a.loop and (a.property in ("l2", "passivity") or a.num) else []
    if extra:
        said = f"note: {a.property} does not depend on {', '.join(extra)}: not used."
        print(f"lugrectl: {said}", file=sys.stderr)


def _check_text(facts: dict[str, Any], units: Mapping[str, str]) -> str:
    about = f"{facts['loop']} loop of " if "loop" in facts else ""
    gains = ", ".join(f"{k} {v:g}" for k, v in facts["gains"].items())
    gains += ", prefilter 2/(s + 2)" if facts.get("prefilter") else ""
    said = [facts[k].rstrip(".") + "." for k in ("reason", "meaning", "repair") if facts.get(k)]
    what = about + ", ".join(filter(None, (facts["model"], gains)))
    if "transfer" in facts:
        what = written(facts["transfer"])
    lines = [
        f"{_answer(facts)}: {what}",
        *(textwrap.fill(s, 80, initial_indent="  ", subsequent_indent="  ") for s in said),
    ]
    known = [k for k in _SHOWN if k in facts and not math.isnan(facts[k])]
    lines += [
        f"  {k}: {facts[k]:.6g} {units.get(k, '')}".rstrip() + _where(facts, k) for k in known
    ]
    return "\n".join(lines)


def _where(facts: dict[str, Any], margin: str) -> str:
    """At which frequency a margin is, and the other form in which it is known."""
    more = []
    if margin == "gain_margin" and 0 < facts[margin] < math.inf:
        more.append(f"{20 * math.log10(facts[margin]):.4g} dB")
    if margin == "modulus_margin":
        more.append(f"Ms {facts['Ms']:.6g}")
    at = facts.get(f"{margin}_frequency", math.nan)
    more += [] if math.isnan(at) else [f"at {at:.6g} rad/s" if math.isfinite(at) else "as w grows"]
    return f" ({', '.join(more)})" if more else ""


def _answer(facts: dict[str, Any]) -> str:
    if facts["check"] == "l2":
        return "finite L2 gain" if facts["holds"] else "no finite L2 gain"
    if facts["check"] == "spr":
        return "SPR" if facts["holds"] else "not SPR"
    if facts["check"] == "passivity":
        return "passive friction" if facts["holds"] else "friction that is not passive"
    if facts["check"] == "stability":
        return "stable loop" if facts["holds"] else "unstable loop"
    if math.isnan(facts["bandwidth"]):
        return "no bandwidth"
    if not facts["stable"]:
        return "unstable T" if "transfer" in facts else "unstable loop"
    return f"bandwidth {facts['hertz']:.4g} Hz" if facts["holds"] else "no bandwidth"


def effects(a: Namespace) -> int:
    """``lugrectl effects``: the catalogue, or one effect."""
    from ..blocks.catalogue import effects

    listed = effects()
    if a.name is not None:
        one = listed[a.name]
        print_out(_written(one.summary()) if a.json else str(one))
    else:
        every = "\n".join(entry.short() for entry in listed)
        print_out(_written(listed.summary()) if a.json else every)
    return 0


def template(a: Namespace) -> int:
    """``lugrectl model``."""
    toml = (resources.files("lugrectl") / "demo" / "template.toml").read_text(encoding="utf-8")
    print_out(_written({"schema": 1, "toml": toml}) if a.json else toml)
    return 0


def schema(a: Namespace) -> int:
    """``lugrectl schema``."""
    made = resources.files("lugrectl") / "report" / "report.schema.json"
    print_out(made.read_text(encoding="utf-8"))
    return 0


def _written(value: Any) -> str:
    return json.dumps(value, indent=2, allow_nan=False)


def _document(value: Any) -> str:
    from ..core.result import plain

    return _written(plain(value))

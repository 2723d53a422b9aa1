"""``lugrectl check``: the linear checks of a loop, or of a transfer function that is typed."""

from __future__ import annotations

import math
from argparse import Namespace
from fractions import Fraction
from functools import partial
from typing import Any

import lugrectl as lg

from ..core.errors import InputError
from .inputs import given
from .output import answer, as_json, say

# The source paper's gains, by loop; K2 of the proposed observer.
PAPER = {"velocity": {"kp": 1.6, "ki": 0.16}, "position": {"kp": 15.0, "ki": 1.55}}
PAPER_K2 = 22.0
_MADE = {"spr": "T", "bandwidth": "loop_tf", "stability": "L"}  # of which transfer function
_ANSWERS = {  # where the property holds, and where not
    "l2": ("finite L2 gain", "no finite L2 gain"),
    "spr": ("SPR", "not SPR"),
    "passivity": ("passive friction", "friction that is not passive"),
    "stability": ("stable loop", "unstable loop"),
}
_LOOP, _FILTERS = (
    ("kp", "ki", "kd", "tau", "leak", "derivative_filter"),
    ("prefilter", "half_power"),
)
UNUSED = {  # options on which a property does not depend
    "l2": (*_LOOP, *_FILTERS, "dead_time"),
    "spr": ("K2", *_FILTERS),
    "bandwidth": ("K2",),
    "stability": ("K2", *_FILTERS),
    "passivity": (*_LOOP, *_FILTERS, "K2", "dead_time", "dt"),
}


def check(a: Namespace) -> int:
    """``lugrectl check``: 0 when the property holds, 1 when not."""
    from ..core.result import plain

    a.loop = next((loop for loop in PAPER if getattr(a, loop)), None)
    T, work = _transfer(a), getattr(lg, f"{a.property}_check")
    if a.property == "bandwidth":
        work = partial(work, level="half-power" if a.half_power else "-3dB")
    if T is None:
        verdict, about = _of_loop(a, work)
    else:
        num, den = ([float(c) for c in _coefficients(text, "")] for text in (a.num, a.den))
        typed = {"num": num, "den": den, "dt": a.dt, **given(a, "dead_time")}
        verdict, about = work(T), {"transfer": typed}
    names = UNUSED[a.property]
    if a.num is not None:
        more = () if a.property == "bandwidth" else ("half_power",)
        names = ("model", "K2", *_LOOP, "prefilter", *more)
    extra = [f"--{k.replace('_', '-')}" for k in given(a, " ".join(names))]
    extra += [f"--{a.loop}"] if a.loop and (a.property in ("l2", "passivity") or a.num) else []
    if extra:
        say(f"note: {a.property} does not depend on {', '.join(extra)}: not used.")
    about = {"model": None, "gains": {}} | about
    last = {k: about.pop(k) for k in ("model", "gains")}
    facts = {"schema": 1, "check": a.property, **about, **last, **verdict.summary()}
    words = [f"{_answer(facts)}: {_about(facts)}", *repr(verdict).splitlines()[1:]]
    answer(verdict, a, as_json(plain(facts)) if a.json else "\n".join(words))
    return 0 if verdict else 1


def _of_loop(a: Namespace, work: Any) -> tuple[Any, dict[str, Any]]:
    """The verdict on a loop with a model, and what it is about."""
    p: Any = lg.table1() if a.model is None else lg.read_model(a.model)
    name = "Table 1" if a.model is None else p.name
    if a.property == "passivity":
        return work(p), {"model": name}
    if a.property == "l2":
        gains = {"K2": PAPER_K2 if a.K2 is None else a.K2}
        return work(p, **gains), {"model": name, "gains": gains}
    loop = a.loop or ("position" if a.property == "spr" else "velocity")
    # the paper's gains if none is given, else the given ones and 0 for the others
    gains = {"kp": 0.0, "ki": 0.0, "kd": 0.0} | (given(a, "kp ki kd") or PAPER[loop])
    gains |= given(a, "tau leak derivative_filter dead_time")
    filtered = {"prefilter": bool(a.prefilter)} if a.property == "bandwidth" else {}
    made = getattr(lg, f"{loop}_{_MADE[a.property]}")(p, **gains, **filtered)
    return work(made), {"loop": loop, **filtered, "model": name, "gains": gains}


# --- a transfer function that is typed -----------------------------------------------------


def _transfer(a: Namespace) -> Any:
    """T of --num and --den; None where neither is given."""
    if a.num is None and a.den is None:
        if a.dt is not None:
            raise InputError("--dt is the sample time of T(z): give --num and --den too.")
        return None
    if a.num is None or a.den is None:
        missing = "--num" if a.num is None else "--den"
        raise InputError(f"{missing} is missing: a transfer function needs --num and --den.")
    num, den = _coefficients(a.num, "--num"), _coefficients(a.den, "--den")
    if not any(den):
        raise InputError("--den is zero; give the coefficients of a polynomial.")
    if a.property == "passivity":
        raise InputError("--num: passivity is about the friction of a model; give it --model.")
    T: Any = (num, den)
    if a.dt is not None:
        import control as ct

        T = ct.tf([float(c) for c in num], [float(c) for c in den], a.dt)
    return T if a.dead_time is None else lg.delayed(T, a.dead_time)


def _coefficients(text: str, option: str) -> list[Fraction]:
    """Decimal numbers, exactly, in descending powers."""
    try:
        found = [Fraction(word) for word in text.replace(",", " ").split()]
        if not found or not all(abs(float(c)) < float("inf") for c in found):
            raise ValueError
    except (ValueError, OverflowError, ZeroDivisionError):
        raise InputError(
            f"{option} is '{text}', but numbers in descending powers are needed, such as 1,2,0.5."
        ) from None
    return found


# --- the answer in words -------------------------------------------------------------------


def _about(facts: dict[str, Any]) -> str:
    """The loop with its gains, or T(s) = ... or T(z) = ... in one line."""
    if T := facts.get("transfer"):
        num, den = (", ".join(f"{c:g}" for c in T[k]) for k in ("num", "den"))
        of = f"T({'s' if T['dt'] is None else 'z'}) = [{num}]/[{den}]"
        of += f" exp(-{T['dead_time']:g} s)" if T.get("dead_time") else ""
        return of if T["dt"] is None else f"{of}, dt = {T['dt']:g} s"
    loop = f"{facts['loop']} loop of " if "loop" in facts else ""
    gains = ", ".join(f"{k} {v:g}" for k, v in facts["gains"].items())
    gains += ", prefilter 2/(s + 2)" if facts.get("prefilter") else ""
    return loop + ", ".join(filter(None, (facts["model"], gains)))


def _answer(facts: dict[str, Any]) -> str:
    if facts["check"] in _ANSWERS:
        return _ANSWERS[facts["check"]][not facts["holds"]]
    if math.isnan(facts["bandwidth"]):
        return "no bandwidth"
    if not facts["stable"]:
        return "unstable T" if "transfer" in facts else "unstable loop"
    return f"bandwidth {facts['hertz']:.4g} Hz" if facts["holds"] else "no bandwidth"

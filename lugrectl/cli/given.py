"""A transfer function typed on the command line: ``--num 1,10 --den 1,2,0.5 [--dt 0.001]``."""

from __future__ import annotations

import re
from argparse import Namespace
from collections.abc import Sequence
from fractions import Fraction
from typing import Any

from ..core.errors import InputError

SIGNED = ("--num", "--den")  # options whose value may begin with a minus sign


def transfer(a: Namespace) -> Any:
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
    made: Any = (num, den)
    if a.dt is not None:
        import control as ct

        made = ct.tf([float(c) for c in num], [float(c) for c in den], a.dt)
    if a.dead_time is None:
        return made
    from ..linear import delayed

    return delayed(made, a.dead_time)


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


def facts(a: Namespace) -> dict[str, Any]:
    """T for the JSON document."""
    num, den = (
        [float(c) for c in _coefficients(text, option)]
        for text, option in ((a.num, "--num"), (a.den, "--den"))
    )
    late = {} if a.dead_time is None else {"dead_time": a.dead_time}
    return {"num": num, "den": den, "dt": a.dt, **late}


def written(T: dict[str, Any]) -> str:
    """T(s) = ... or T(z) = ... in one line."""
    name = "s" if T["dt"] is None else "z"
    of = f"T({name}) = ({_polynomial(T['num'], name)})/({_polynomial(T['den'], name)})"
    of += f" exp(-{T['dead_time']:g} s)" if T.get("dead_time") else ""
    return of if T["dt"] is None else f"{of}, dt = {T['dt']:g} s"


def _polynomial(p: Sequence[float], name: str) -> str:
    terms = []
    for power, c in zip(range(len(p) - 1, -1, -1), p, strict=True):
        if not c:
            continue
        x = "" if not power else name if power == 1 else f"{name}^{power}"
        size = x if x and abs(c) == 1 else f"{abs(c):g} {x}".strip()
        sign = ("-" if c < 0 else "") if not terms else (" - " if c < 0 else " + ")
        terms.append(sign + size)
    return "".join(terms) or "0"


def joined(words: Sequence[str]) -> list[str]:
    """``--num -1 2`` as ``--num=-1 2``: argparse takes "-1" for an option."""
    out: list[str] = []
    for word in words:
        option, given, _ = out[-1].partition("=") if out else ("", "", "")
        if option in SIGNED and re.match(r"[-+]?[0-9.]", word):
            out[-1] += f" {word}" if given else f"={word}"
        else:
            out.append(word)
    return out

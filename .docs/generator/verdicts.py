"""A page for each verdict: README's table and the wording of the report."""

from __future__ import annotations

import re
from pathlib import Path

import lugrectl as lg
from lugrectl.errors import Refused
from lugrectl.report.wording import headline
from lugrectl.results import VERDICTS, Candidate, Diagnosis, Estimate, Finding

from .rst import code, filled, literal, prose, table, title, toctree

README = Path(__file__).parents[2] / "README.md"
_ROW = re.compile(r"^\|`(\w+)`\|([^|]+)\|([^|]+)\|$", re.M)


def pages() -> dict[str, str]:
    """A page for each verdict, and the list."""
    said = rows()
    made = {f"verdicts/{name}": _page(name, *said[name]) for name in VERDICTS}
    listed = [
        (f":ref:`{name} <verdict-{name}>`", _markup(said[name][0]), _markup(said[name][1]))
        for name in VERDICTS
    ]
    return made | {
        "verdicts/index": filled(
            "kind",
            title=title("Verdicts"),
            about="What a diagnosis answers: ``verdict`` of :class:`lugrectl.Diagnosis` and of "
            ":doc:`report.json </generated/files/report>`.",
            table=table(("verdict", "meaning", "what to do"), listed, "20 40 40"),
            toctree=toctree(VERDICTS),
        )
    }


def rows() -> dict[str, tuple[str, str]]:
    """Of each verdict its meaning and what to do, from README's table."""
    found = _ROW.findall(README.read_text("utf-8"))
    return {name: (meaning, action) for name, meaning, action in found if name in VERDICTS}


def _page(name: str, meaning: str, action: str) -> str:
    title_, sentence = headline(invented(name))
    return filled(
        "verdict",
        name=name,
        title=title(name),
        meaning=_markup(meaning),
        action=_markup(action),
        code=code(str(Refused.exit_code if name == "refused" else 0)),
        headline=literal(f"{title_}\n  {sentence}"),
        filled=f"In Python a result of this verdict prints as:\n\n{literal(repr(invented(name)))}",
    )


def _markup(text: str) -> str:
    return prose(re.sub(r"`([^`]+)`", r"``\1``", text))


def invented(verdict: str) -> Diagnosis:
    """A result put together by hand, to show the words of a verdict."""
    amplitude = {"amplitude": Estimate(0.04, "N m", (0.038, 0.042))}
    other = (Candidate("periodic_disturbance", 0.0, 0.2),) if verdict == "ambiguous" else ()
    named = (Finding("torque_ripple", amplitude, other),)
    error = {"signal": "w", "unit": "rad/s", "samples": 9000, "horizon": 1.0, "declared": 0.95}
    error |= {"refitted": 0.62, "augmented": 0.004, "noise_floor": 0.003}
    on = {"found": ("theta",), "ambiguous": ("theta",), "unexplained": ("theta", "w")}
    return Diagnosis(
        verdict,
        effects=named if verdict in ("found", "ambiguous") else (),
        depends_on=on.get(verdict, ()),
        experiment=named[0].apart() or None,
        error=None if verdict == "refused" else error,
        reason="the torque is a function of the position" if verdict == "refused" else None,
        model=None if verdict == "refused" else lg.Model.of(lg.table1()),
    )

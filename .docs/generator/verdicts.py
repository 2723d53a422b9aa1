"""A page for each verdict: README's table and the wording of the report."""

from __future__ import annotations

import re
import textwrap
from pathlib import Path

import numpy as np

import lugrectl as lg
from lugrectl.core.errors import Refused
from lugrectl.diagnosis.result import VERDICTS, Diagnosis
from lugrectl.estimates.findings import Candidate, Estimate, Finding
from lugrectl.report.wording import headline

from .rst import filled, literal, prose, table, title, toctree

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
    result = shown(name)
    verdict, sentence = headline(result)
    return filled(
        "verdict",
        name=name,
        title=title(name),
        meaning=_markup(meaning),
        action=_markup(action),
        code=str(Refused.exit_code if name == "refused" else 0),
        headline=literal("\n  ".join([verdict, *textwrap.wrap(sentence, 80)])),
        result=literal(repr(result)),
    )


def _markup(text: str) -> str:
    return prose(re.sub(r"`([^`]+)`", r"``\1``", text))


def shown(verdict: str) -> Diagnosis:
    """A result to show the words of a verdict: refused by a record, the others made by hand."""
    if verdict == "refused":
        t = np.linspace(0.0, 5.0, 2501)
        log = {"t": t, "u": 0.1 * np.sin(t), "theta": 0.0 * t}
        return lg.diagnose(log, lg.Model.of(lg.table1()), progress=False)
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
        error=error,
        model=lg.Model.of(lg.table1()),
    )

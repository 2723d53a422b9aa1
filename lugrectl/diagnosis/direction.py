"""A log that moves in one direction: friction there is a sum with a constant torque."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from ..identification.balance import Balance
from ..identification.balance.result import Combination
from ..model import Model
from ..results import Estimate

ONE_WAY = (
    "This log moves in one direction only, so {0} is not determined alone: in the fitted model it "
    "is {1}, {2:.4g} {3}."
)
AS_DECLARED = " With {0} as declared, {1:.6g} {2}, the constant torque is {3:.3g} {2}."
OTHER = "Record the other direction, too."
NEXT = "{}, too: it separates the parts of {}."


def not_alone(found: Mapping[str, Estimate], plain: Balance) -> dict[str, Estimate]:
    """The estimates, with the sum in place of an interval where a value is not known alone.

    A value that is held, or of an effect, stays.
    """
    return {
        key: replace(e, ci95=None, together=plain.together[key].text)
        if key in plain.together and not e.held
        else e
        for key, e in found.items()
    }


def one_way(found: Mapping[str, Estimate], plain: Balance, model: Model) -> list[str]:
    """A sentence for each value that stands for a sum, with the sum and what to record."""
    return [_sum(key, e, plain, model) for key, e in found.items() if e.together]


def next_way(plain: Balance, then: str | None) -> str | None:
    """What to record next: what ``then`` says, and the other direction where it is missing."""
    sums: dict[str, Combination] = {c.text: c for c in plain.together.values()}
    said = [NEXT.format(_capital(c.to_separate), c.text) for c in sums.values()]
    return " ".join(filter(None, (then, *said))) or None


def _sum(key: str, e: Estimate, plain: Balance, model: Model) -> str:
    said = ONE_WAY.format(key, e.together, e.value, e.unit)
    declared, load = model.known().get(key), plain.parameters.get("constant_torque")
    if declared is not None and load is not None:
        said += AS_DECLARED.format(key, declared, e.unit, load.value)
    return f"{said} {OTHER}"


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]

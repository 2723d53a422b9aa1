"""``lugrectl bode --plan``: the excitation to record for a good response."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path
from typing import Any

from ..core.errors import InputError
from .output import print_out
from .plotting import write


def planned(a: Namespace) -> int:
    """Write the references as CSV, and print how to play them."""
    from ..blocks.model import read_model
    from ..commissioning import response_plan

    if a.records or a.rate is None or not {"w", "u"} <= {*(limits := _limits(a.limits))}:
        raise InputError(
            "--plan needs the rate and the limits of the drive in place of a record, such as "
            "--plan excitation.csv --rate 1000 --limits w=60,u=3."
        )
    if a.tune or a.plot:
        raise InputError("--plan writes an excitation only: use --tune and --plot with its log.")
    made = response_plan(read_model(a.model), rate=a.rate, kp=a.kp, **limits)
    write(Path(a.plan), made.to_csv().encode(), "--plan")
    print_out(made.to_json() if a.json else repr(made))
    return 0


def _limits(text: str | None) -> dict[str, Any]:
    """ "w=60,u=3" by name."""
    pairs = [one.partition("=") for one in (text or "").split(",") if one.strip()]
    try:
        found: dict[str, Any] = {name.strip(): float(value) for name, _, value in pairs}
    except ValueError:
        found = {"": 0.0}
    if not {*found} <= {"w", "u", "theta"}:
        raise InputError(f"--limits is '{text}', but w=60,u=3,theta=6 or part of it is needed.")
    return found

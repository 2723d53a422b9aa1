"""``lugrectl bode``: the frequency response of an axis, with friction taken out, and gains."""

from __future__ import annotations

import json
import sys
from argparse import Namespace
from pathlib import Path
from typing import Any

from ..core.errors import InputError, Refused
from ..core.provenance import stamp
from .inputs import declared, files, reading
from .output import print_out
from .plotting import drawn, format_of, write


def bode(a: Namespace) -> int:
    """Print the response, and draw it into a file; a refusal is printed as JSON all the same.

    With --plan it writes the excitation to record instead.
    """
    if a.plan is not None:
        return _planned(a)
    from ..axis_response import frequency_response
    from ..record import read_log
    from .tuning import check_options, of_model, said_of, with_gains

    kind = None if a.out is None else format_of(a.out)
    check_options(a)
    model = declared(a)
    if not a.records:
        return of_model(a, model, kind)
    names = files(a.records)
    logs = [read_log(name, **reading(a), motion=model.motion) for name in names]
    try:
        found = stamp(frequency_response(logs, model), a.typed, [*names, model])
    except Refused as no:
        if a.json:
            print_out(_refused(no))
        raise
    found, no = with_gains(found, a, model)
    said = drawn(found, a.out, kind) if kind else ""
    print_out(found.to_json() if a.json else said_of(found))
    if said:
        print(f"lugrectl: {said}", file=sys.stderr)
    if no:
        raise no
    return 0


def _planned(a: Namespace) -> int:
    from ..axis_response import response_plan
    from ..blocks.model import read_model

    if a.records or a.rate is None or not {"w", "u"} <= {*(limits := _limits(a.limits))}:
        raise InputError(
            "--plan needs the rate and the limits of the drive in place of a record, such as "
            "--plan excitation.csv --rate 1000 --limits w=60,u=3."
        )
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


def _refused(no: Refused) -> str:
    arrays = ("frequency", "magnitude", "phase", "low", "high", "coherence", "modes")
    made = {"schema": 1, **{k: [] for k in arrays}, "gains": None, "reason": str(no)}
    return json.dumps(made | {"experiment": no.experiment}, indent=2, allow_nan=False)

"""``lugrectl bode``: the frequency response of an axis, with friction taken out, and gains."""

from __future__ import annotations

import json
from argparse import Namespace

from ..core.errors import Refused
from ..core.provenance import stamp
from .inputs import declared, files, reading
from .output import print_out
from .plotting import answered, format_of
from .response_plan import planned


def bode(a: Namespace) -> int:
    """Print the response, and draw it into a file; a refusal is printed as JSON all the same.

    With --plan it writes the excitation to record instead.
    """
    if a.plan is not None:
        return planned(a)
    from ..commissioning import frequency_response
    from ..record import read_log
    from .tuning import check_options, of_model, said_of, with_gains

    kind = format_of(a.plot)
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
    answered(found, a, kind, found.to_json() if a.json else said_of(found))
    if no:
        raise no
    return 0


def _refused(no: Refused) -> str:
    arrays = ("frequency", "magnitude", "phase", "low", "high", "coherence", "modes")
    made = {"schema": 1, **{k: [] for k in arrays}, "gains": None, "reason": str(no)}
    return json.dumps(made | {"experiment": no.experiment}, indent=2, allow_nan=False)

"""The plain torque balance of a log, alone."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ..core.blas_threads import one_blas_thread
from ..core.errors import Refused
from ..estimates.balance import Balance
from .asked import Asked


@one_blas_thread()
def balance(
    record: Any,
    model: Any = None,
    *,
    columns: Mapping[str, str] | str | None = None,
    units: Mapping[str, str] | str | None = None,
    scale: Mapping[str, float] | str | None = None,
    rate: float | None = None,
) -> Balance:
    """The plain torque balance of a log, as it stands beside every diagnosis; in a second.

        u(t - T) = J dw/dt + Fc sign(w) + Fv w + constant + declared effects + residual

    in means over windows, by one robust regression: the first row of the table of
    :func:`lugrectl.diagnose`. An effect that is not declared biases the values beyond their
    intervals.

    Parameters
    ----------
    record : path, DataFrame, dict of arrays or Record, or a list of them
        The runs of one drive.
    model : Model, Parameters, dict or path
        The declared model: its effects are further terms, its held values are known. None:
        nothing is known.
    columns, units, scale, rate : optional
        How to read a log, as for :func:`lugrectl.read_record`.

    Returns
    -------
    Balance
        ``parameters`` with 95 % intervals, SI (J in kg m2, Fc in N m, Fv in N m s/rad, u_delay in
        s; on a linear axis kg, N, N s/m, s), the sums that are certain, the friction curve.

    Raises
    ------
    InputError
        When an argument cannot be meant, or a file cannot be read or understood.
    Refused
        When t has no unit, and no drive writes a log at that rate in s.

    Examples
    --------
    A made-up log of a drive with J = 0.002 kg m2, Fc = 0.3 N m and Fv = 0.02 N m s/rad:

    >>> t = 4e-3 * np.arange(3000)
    >>> w = np.sin(np.pi * t) + 0.5 * np.sin(8.0 * t)
    >>> u = 0.002 * np.gradient(w, t) + 0.3 * np.sign(w) + 0.02 * w
    >>> plain = lg.balance({"t": t, "u": u, "w": w})
    >>> round(plain.parameters["Fc"].value, 2), round(plain.parameters["Fv"].value, 2)
    (0.3, 0.02)
    """
    reading = {"columns": columns, "units": units, "scale": scale, "rate": rate}
    asked = Asked.of(record, {} if model is None else model, **reading)
    try:
        asked.refuse_open_time()
    except Refused as no:  # all rates and the inertia depend on it: no value is an answer
        no.plain = asked.plain
        raise
    return asked.plain

"""Linearization of a loop of blocks around its dead times, which stay exact.

The block of a dead time h is the Pade form p1' = r p2, p2' = r (12 (q - p1) - 6 p2), out = q - p2
with r = 1/h in python-control. So in the linear system its input q is known from the row of p2,
and with p2 = q - v the signal v that leaves it becomes an input of its own: v = q exp(-s h).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from itertools import combinations
from typing import Any

import control as ct
import numpy as np

from ..blocks.drive import DeadTime, dead_times
from ..core.errors import InputError
from ..core.validation import array, shown
from .delayed import DelayedTransfer, reduced
from .exact import Poly, Quasi, add, divide, mul, scale
from .transfer import number, state_space_polynomials

STEP = 1e-6  # of the differences, as control.linearize has it
NOISE = 1e-6  # what the differences leave of a path that is not there


def linearize(
    system: Any,
    x0: Any = 0,
    u0: Any = 0,
    t: float = 0.0,
    *,
    input: str | None = None,
    output: str | None = None,
    params: Mapping[str, Any] | None = None,
) -> Any:
    """The linear system about an operating point, its dead times exact.

    As ``control.linearize``, with central differences; the dead times of the package's blocks
    (:func:`dead_time`, the effect ``input_delay`` of a model, ``delay=`` of :func:`cascade_loop`)
    are not linearized as the Pade form that they are in python-control: T(s) holds exp(-s h).

    Parameters
    ----------
    system : control.NonlinearIOSystem
        A block or a loop: :func:`velocity_loop`, :func:`cascade_loop`, ``control.interconnect``.
    x0, u0 : array_like, control.OperatingPoint
        States and inputs of the operating point, in the order of the system; 0 is at rest.
    t : float
        Time in s, where the system depends on it.
    input, output : str, optional
        The labels of one input and one output, such as "r" and "w"; needed where there are several
        and a dead time is not 0.
    params : dict, optional
        Parameters that differ from the system's, by key.

    Returns
    -------
    DelayedTransfer or control.StateSpace
        A state-space model if no dead time is above 0.

    Raises
    ------
    InputError
        If the system is no control system in continuous time, or for an unknown label.

    Notes
    -----
    The states of the Pade form keep their places in x0; their values do not matter. Two dead
    times in one system are exact too. With ``output`` given, an integrator that neither it nor
    another state reads is left out: the position of a drive whose loop is closed over w. It is no
    part of ``open_loop`` either, where only the output reads it.

    Examples
    --------
    A cascade with 1 ms of dead time in the drive, about rest, with viscous friction only; the
    loop around the dead time stands 0.76 ms more:

    >>> p = lg.Model.of(J=0.0022, friction="viscous", Fv=0.018)
    >>> loop = lg.cascade_loop(p, kv=20.0, kp=1.6, ki=16.0, lag=5e-4, delay=1e-3)
    >>> T = lg.linearize(loop, input="r", output="theta")
    >>> T.dead_times
    (0.001,)
    >>> round(1e3 * lg.stability_check(T.open_loop).delay_margin, 2)
    0.76
    """
    if not hasattr(system, "linearize") or system.isdtime(strict=True):
        raise InputError(
            f"system is {shown(system)}, but a continuous control system or block is needed."
        )
    late = [one for one in dead_times(system, params) if np.isfinite(one.seconds)]
    linear = _differences(system, x0, u0, t, params)
    inputs = _chosen(input, system.input_labels, "input", late)
    outputs = _chosen(output, system.output_labels, "output", late)
    A, B, C, D = _without_pade(linear, late)
    made = [number(one.seconds, "delay") for one in late if one.seconds > 0]
    columns = [*inputs, *range(B.shape[1] - len(made), B.shape[1])]
    around = [*range(len(C) - len(made), len(C))]
    rows = [*outputs, *around]
    keep = [*range(len(A))] if output is None and not made else _read(A, C[rows])
    A, B, C = A[np.ix_(keep, keep)], B[np.ix_(keep, columns)], C[:, keep]
    model = ct.ss(A, B, C[rows], D[np.ix_(rows, columns)])
    if not made:
        model.set_inputs([system.input_labels[k] for k in inputs])
        model.set_outputs([system.output_labels[k] for k in outputs])
        return model
    T = closed_over(model, made)
    return replace(T, outside=len(A) - len(_read(A, C[around])))


def _read(A: np.ndarray, C: np.ndarray) -> list[int]:
    """The states without integrators that nothing reads, no other state and no row of C: the
    position of a drive in a loop over its speed adds a pole at s = 0 that is no part of it."""
    keep = [*range(len(A))]
    while True:
        free = [k for k in keep if not A[keep, k].any() and not C[:, k].any()]
        if not free:
            return keep
        keep = [k for k in keep if k not in free]


def closed_over(model: Any, late: Sequence[Fraction]) -> DelayedTransfer:
    """T(s) from the first input to the first output, where each further output, delayed, is the
    further input."""
    # With H the response of the model, z the diagonal of exp(-s h) and H22 its part of the further
    # channels, T = det(I - H z, of all channels but the first input's)/det(I - H22 z); both are
    # sums of principal minors of H.
    tops, den = state_space_polynomials(model)
    sets = [S for k in range(len(late) + 1) for S in combinations(range(1, len(late) + 1), k)]
    num_terms, den_terms = [], []
    for S in sets:
        delay, sign = sum((late[i - 1] for i in S), Fraction(0)), (-1) ** len(S)
        num_terms.append((delay, scale(_minor(tops, (0, *S), den), sign)))
        den_terms.append((delay, scale(_minor(tops, S, den), sign)))
    return reduced(Quasi.of(num_terms), Quasi.of(den_terms))


def _minor(tops: Any, S: tuple[int, ...], den: Poly) -> Poly:
    """The principal minor of H of the channels S times ``den``, a polynomial."""
    if not S:
        return den
    minor = _determinant([[tops[i][k] for k in S] for i in S])
    for _ in S[1:]:
        minor = divide(minor, den)[0]
    return minor


def _determinant(M: list[list[Poly]]) -> Poly:
    if len(M) == 1:
        return M[0][0]
    total: Poly = ()
    for k, top in enumerate(M[0]):
        rest = [[*row[:k], *row[k + 1 :]] for row in M[1:]]
        total = add(total, scale(mul(top, _determinant(rest)), (-1) ** k))
    return total


def _differences(system: Any, x0: Any, u0: Any, t: float, params: Any) -> list[np.ndarray]:
    """A, B, C and D by central differences."""
    if isinstance(system, ct.StateSpace):
        return [np.asarray(M, dtype=float) for M in (system.A, system.B, system.C, system.D)]
    for value, name, many in ((x0, "x0", system.nstates), (u0, "u0", system.ninputs)):
        if not isinstance(value, ct.OperatingPoint):
            rows = array(value, name)
            if rows.ndim and rows.size != many:
                raise InputError(f"{name} needs {many} values, or one for all, such as 0.")
            if not np.isfinite(rows).all():
                raise InputError(f"{system.name}: {name} must be finite.")
    try:
        one, other = (
            system.linearize(x0, u0, t=t, params=params, eps=step) for step in (STEP, -STEP)
        )
    except (ValueError, TypeError, RuntimeError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{system.name} cannot be linearized there: {error}.") from None
    pairs = zip((one.A, one.B, one.C, one.D), (other.A, other.B, other.C, other.D), strict=True)
    return [0.5 * (np.asarray(a) + np.asarray(b)) for a, b in pairs]


def _chosen(label: str | None, labels: list[str], what: str, late: list[DeadTime]) -> list[int]:
    if label is None:
        if len(labels) > 1 and any(one.seconds > 0 for one in late):
            raise InputError(
                f"the system has {len(labels)} {what}s and a dead time: give {what}=, one of "
                f"{', '.join(labels)}."
            )
        return [*range(len(labels))]
    if label not in labels:
        raise InputError(f"{what} is {shown(label)}, but there is {', '.join(labels)}.")
    return [labels.index(label)]


def _without_pade(
    linear: list[np.ndarray], late: list[DeadTime]
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """The system without the states of its dead times, whose inputs and outputs are the last."""
    A, B, C, D = linear
    first = [one.place for one in late]
    second = [k + 1 for k in first]
    keep = [k for k in range(len(A)) if k not in {*first, *second}]
    on = [k for k, one in enumerate(late) if one.seconds > 0]
    places = [second[k] for k in on]
    # q = Q x + P p2 + R u of the signals that enter, from the rows of p2
    size = np.array([12.0 / late[k].seconds for k in on])[:, None]
    Q, R = A[np.ix_(places, keep)] / size, B[places] / size
    P = A[np.ix_(places, places)] / size + 0.5 * np.eye(len(places))
    P[np.abs(P) < NOISE] = 0.0
    # p2 = q - v = P p2 + Q x + R u - v
    solve = np.linalg.inv(np.eye(len(places)) - P)
    x_to, u_to, v_to = solve @ Q, solve @ R, -solve
    columns = np.vstack([A[np.ix_(keep, places)], C[:, places]])
    states, own = len(keep), np.vstack([A[np.ix_(keep, keep)], C[:, keep]])
    inputs = np.vstack([B[keep], D])
    own, inputs, new = own + columns @ x_to, inputs + columns @ u_to, columns @ v_to
    A1, C1 = own[:states], np.vstack([own[states:], x_to])
    B1 = np.hstack([inputs[:states], new[:states]])
    below = np.hstack([u_to, v_to + np.eye(len(places))])
    D1 = np.vstack([np.hstack([inputs[states:], new[states:]]), below])
    return A1, B1, C1, D1

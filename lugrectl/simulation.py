"""Time responses of python-control systems, traced, compiled and stepped with located events."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from typing import Any

import control as ct
import numpy as np
from numpy.typing import ArrayLike
from scipy.integrate import solve_ivp

from .engine.adaptive import Diverged
from .engine.compiled import compiled
from .engine.symbolic import TraceError
from .errors import InputError

_respond: Any = ct.input_output_response  # its annotations know no arrays


def simulate(
    system: Any,
    t: ArrayLike,
    inputs: ArrayLike | Sequence[Any] | None = None,
    x0: ArrayLike | Sequence[Any] = 0.0,
    *,
    params: Mapping[str, Any] | None = None,
    method: str | None = None,
    hold: bool = False,
    rtol: float = 1e-6,
    squeeze: bool | None = None,
) -> ct.TimeResponseData:
    """The response of a block or an interconnection, as ``ct.input_output_response`` gives it.

    Parameters
    ----------
    system : control.NonlinearIOSystem
        Any python-control system. In discrete time python-control's own loop is used.
    t : (N,) array_like
        Increasing times in s, evenly spaced or not.
    inputs : array_like or list, optional
        (m, N), or (N,) for one input, a number, or a list of such parts; default 0.
    x0 : array_like or list
        Initial states: a number for all, or a list that is padded with zeros.
    params : dict, optional
        Parameters in place of the defaults; other values need no new compilation.
    method : str, optional
        "rosenbrock" (default), or a method of ``scipy.integrate.solve_ivp`` by python-control.
    hold : bool
        Inputs are held between samples, as a drive holds its torque, instead of linear.
    rtol : float
        Error allowed in a step, relative to the largest value that each state has had.
    squeeze : bool, optional
        As for ``ct.input_output_response``.

    Returns
    -------
    control.TimeResponseData
        With the labels, shapes and parameters of ``ct.input_output_response``.

    Raises
    ------
    InputError
        For times that do not increase, shapes that do not fit, a NaN in an input, an unknown
        parameter, or an algebraic loop (the blocks are named).
    Diverged
        When a state grows without bound or is no number: names the state and the time.

    Notes
    -----
    The blocks' own functions are traced to one expression graph (``lugrectl.engine``), compared
    with the system's right-hand side, and stepped by an L-stable Rosenbrock method of order 4
    (Hairer and Wanner, Solving Ordinary Differential Equations II, section IV.7). Steps end at
    the samples and where an absolute value, a sign, a comparison or a limit switches. A system
    whose functions cannot be traced is left to LSODA, with a warning that names the block.
    """
    if None in (system.nstates, system.ninputs, system.noutputs):
        raise InputError(f"{system.name}: give its inputs=, outputs= and states= in ct.nlsys.")
    times = _times(t)
    u = _inputs(system, times, inputs)
    start = _start(system, x0)
    if system.isdtime(strict=True):
        return _respond(system, times, u, start, params=params, squeeze=squeeze)
    states, y = None, None
    if method in (None, "rosenbrock"):
        try:
            states, y = _by_rosenbrock(system, times, u, start, params, hold, rtol)
        except TraceError as error:
            warnings.warn(f"{error}; LSODA is used instead.", RuntimeWarning, stacklevel=2)
    if y is None:
        states, y = _by_scipy(system, times, u, start, params, hold, rtol, method or "LSODA")
    return ct.TimeResponseData(
        times,
        y,
        states if system.nstates else None,
        u,
        params=params,
        issiso=system.issiso(),
        output_labels=system.output_labels,
        input_labels=system.input_labels,
        state_labels=system.state_labels if system.nstates else None,
        sysname=system.name,
        title="Input/output response for " + system.name,
        squeeze=squeeze,
    )


def _by_rosenbrock(
    system: Any,
    t: np.ndarray,
    u: np.ndarray,
    x0: np.ndarray,
    params: Mapping[str, Any] | None,
    hold: bool,
    rtol: float,
) -> tuple[np.ndarray, np.ndarray]:
    engine = compiled(system, params)
    p = engine.program.arguments(params)
    states = x0[:, None]
    if system.nstates and len(t) > 1:
        run = engine.run(t, u, x0, p, hold=hold, rtol=rtol)
        states = run.states
        if np.isfinite(run.unsettled):
            warnings.warn(
                f"{system.name}: a sign or comparison switches without end near t = "
                f"{run.unsettled:.6g} s; the result there is coarse: write np.tanh(w/eps) for "
                "np.sign(w).",
                RuntimeWarning,
                stacklevel=3,
            )
    elif not system.nstates:
        states = np.empty((0, len(t)))
    y = engine.outputs(t, states, u, p)
    _all_finite(system, t, y)
    return states, y


def _all_finite(system: Any, t: np.ndarray, y: np.ndarray) -> None:
    bad = np.argwhere(~np.isfinite(y.T))
    if len(bad):
        k, i = bad[0]
        raise Diverged(
            f"{system.name}: output {system.output_labels[i]} is {y[i, k]} at t = {t[k]:.6g} s."
        )


def _by_scipy(
    system: Any,
    t: np.ndarray,
    u: np.ndarray,
    x0: np.ndarray,
    params: Mapping[str, Any] | None,
    hold: bool,
    rtol: float,
    method: str,
) -> tuple[np.ndarray | None, np.ndarray]:
    """python-control's simulation, or its functions under solve_ivp where the input is held."""
    options = {"rtol": rtol, "atol": 1e-4 * rtol}
    try:
        if not hold or not system.nstates:
            response = _respond(
                system,
                t,
                u,
                x0,
                params=params,
                solve_ivp_method=method,
                solve_ivp_kwargs=options,
                squeeze=False,
            )
            states, y = response.states, np.asarray(response.outputs)
        else:
            states, y = _held_by_scipy(system, t, u, x0, params, dict(options, method=method))
    except RuntimeError as error:
        raise Diverged(f"{system.name}: python-control's simulation failed: {error}.") from error
    _all_finite(system, t, y)
    return states, y


def _held_by_scipy(
    system: Any,
    t: np.ndarray,
    u: np.ndarray,
    x0: np.ndarray,
    params: Mapping[str, Any] | None,
    options: Mapping[str, Any],
) -> tuple[np.ndarray, np.ndarray]:
    system._update_params(params)
    states = np.empty((system.nstates, len(t)))
    states[:, 0] = x0
    for k in range(len(t) - 1):
        part = solve_ivp(
            lambda time, x, held=u[:, k]: system._rhs(time, x, held),
            (t[k], t[k + 1]),
            states[:, k],
            **options,
        )
        if not part.success:
            raise RuntimeError(part.message)
        states[:, k + 1] = part.y[:, -1]
    y = [system._out(now, x, held) for now, x, held in zip(t, states.T, u.T, strict=True)]
    return states, np.array(y).T


def _times(t: ArrayLike) -> np.ndarray:
    times = np.array(t, dtype=float)
    if times.ndim != 1 or not len(times) or not np.all(np.isfinite(times)):
        raise InputError("t must be a list of finite times.")
    back = np.flatnonzero(np.diff(times) <= 0)
    if len(back):
        k = int(back[0])
        raise InputError(f"t must increase; after {times[k]:g} s comes {times[k + 1]:g} s.")
    return times


def _inputs(system: Any, t: np.ndarray, inputs: Any) -> np.ndarray:
    """The inputs as (m, N), in every form that python-control takes."""
    rows: Any = 0.0 if inputs is None else inputs
    if isinstance(rows, (list, tuple)) and len(rows) != len(t):
        rows = np.vstack([_row(part, len(t)) for part in rows]) if rows else 0.0
    u = np.array(rows, dtype=float)
    count = system.ninputs
    if u.ndim == 0:
        u = np.full((count, len(t)), float(u))
    if u.ndim == 1 and count == 1:
        u = u[None]
    if u.shape != (count, len(t)):
        labels = ", ".join(system.input_labels)
        raise InputError(
            f"{system.name} needs inputs ({labels}) of shape ({count}, {len(t)}), not {u.shape}."
        )
    bad = np.argwhere(~np.isfinite(u))
    if len(bad):
        i, k = bad[0]
        raise InputError(f"input {system.input_labels[i]} is {u[i, k]} at t = {t[k]:.6g} s.")
    return u


def _row(part: Any, samples: int) -> np.ndarray:
    row = np.asarray(part, dtype=float)
    if row.ndim == 2 or (row.ndim == 1 and len(row) == samples):
        return np.atleast_2d(row)
    return np.outer(row, np.ones(samples))


def _start(system: Any, x0: Any) -> np.ndarray:
    if np.ndim(x0) == 0 and not isinstance(x0, (list, tuple)):
        return np.full(system.nstates, float(x0))
    parts = x0 if isinstance(x0, (list, tuple)) else [x0]
    start = np.concatenate([np.ravel(np.asarray(part, dtype=float)) for part in parts] or [[]])
    if len(start) > system.nstates:
        raise InputError(f"{system.name} has {system.nstates} states, x0 has {len(start)}.")
    if not np.all(np.isfinite(start)):
        raise InputError(f"{system.name}: x0 must be finite.")
    return np.concatenate([start, np.zeros(system.nstates - len(start))])

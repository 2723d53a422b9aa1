"""Times, inputs and initial states in the forms that a user may give."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import control as ct
import numpy as np
from numpy.typing import ArrayLike
from scipy.integrate import OdeSolver

from ..blocks.block import Block
from ..blocks.model import Model
from ..blocks.plant import plant
from ..core.errors import InputError
from ..core.validation import array, flag, positive, real, shown, within

METHODS = ("rosenbrock", "LSODA", "BDF", "Radau", "RK45", "RK23", "DOP853")
FINEST = 1e-14  # least rtol: below it a step cannot be distinguished from rounding


def system(given: Any, what: str = "system") -> Any:
    """What can be simulated: of a transfer function its state space, of a model its plant."""
    if isinstance(given, Model):
        return plant(given)
    if isinstance(given, ct.TransferFunction):
        try:
            given = ct.ss(given)
        except Exception as error:  # not proper, or several channels without Slycot
            raise InputError(
                f"{given.name}: this transfer function has no state-space form here ({error}); "
                "give a proper one with one input and one output, or a control.StateSpace."
            ) from None
    if isinstance(given, ct.FrequencyResponseData):
        raise InputError(
            f"{what}: {given.name} is a frequency response, which has no states to simulate; give "
            "a transfer function or a state space of it."
        )
    if isinstance(given, Block):
        raise InputError(f"{what} must be a python-control system: {given.wiring()}")
    if not isinstance(given, ct.NonlinearIOSystem):
        raise InputError(f"{what} must be a python-control system, not {shown(given)}.")
    if None in (given.nstates, given.ninputs, given.noutputs):
        raise InputError(f"{given.name}: give its inputs=, outputs= and states= in ct.nlsys.")
    return given


def settings(rtol: Any, hold: Any = False, method: Any = None, squeeze: Any = None) -> float:
    """The accuracy as a float; InputError for a value that is not usable."""
    made = positive(rtol, "rtol")
    if not FINEST <= made < 1.0:
        raise InputError(f"rtol must lie between {FINEST:g} and 1, not {made:g}.")
    flag(hold, "hold")
    solver = isinstance(method, type) and issubclass(method, OdeSolver)
    if not (method is None or solver or (isinstance(method, str) and method in METHODS)):
        raise InputError(f"method must be one of {', '.join(METHODS)}, not {shown(method)}.")
    if squeeze is not None:
        flag(squeeze, "squeeze")
    return made


def parameters(systems: Sequence[Any], params: Any) -> None:
    """InputError if ``params`` is no dict, or a value is outside the bounds of its block."""
    if params is None:
        return
    if not isinstance(params, Mapping):
        raise InputError(
            "params must be a dict of values by name, such as {'plant.Fc': 0.3}, "
            f"not {shown(params)}."
        )
    declared, defaults, inside = {}, {}, [*systems]
    for block in inside:  # the declarations of the package's blocks, and the values of all
        declared = getattr(getattr(block, "outfcn", None), "declared", {}) | declared
        defaults = dict(block.params) | defaults
        inside += getattr(block, "syslist", ())
    for key, value in params.items():
        default, number = real(defaults.get(key)), real(value)
        if key in declared:
            within(value, f"params: {key}", declared[key])
        elif default is not None:
            infinite = number is not None and abs(number) == np.inf
            if number is None or number != number or (infinite and abs(default) < np.inf):
                raise InputError(f"params: {key} must be a finite number, not {shown(value)}.")


def times(t: ArrayLike | None, timepts: ArrayLike | None = None) -> np.ndarray:
    """The times as an array; InputError if they do not increase, or are given twice."""
    if t is not None and timepts is not None:
        raise InputError("the times are given twice: give t or timepts.")
    grid = array(timepts if t is None else t, "t")
    if grid.ndim != 1 or not len(grid) or not np.all(np.isfinite(grid)):
        raise InputError("t must be a list of finite times.")
    back = np.flatnonzero(np.diff(grid) <= 0)
    if len(back):
        k = int(back[0])
        raise InputError(f"t must increase; after {grid[k]:g} s comes {grid[k + 1]:g} s.")
    return grid


def inputs(name: str, labels: Sequence[str], t: np.ndarray, given: Any) -> np.ndarray:
    """The inputs as (m, N), by name or in every form that python-control takes: a number, (N,),
    (m, N), or a list of these."""
    if isinstance(given, Mapping):
        return by_name(name, labels, t, given)
    is_list = isinstance(given, (list, tuple)) and len(given) not in (0, len(t))
    nothing = given is None or (isinstance(given, (list, tuple)) and not given)
    parts: Any = given if is_list else [0.0 if nothing else given]
    rows, told = [], []
    for i, part in enumerate(parts):
        row = array(part, f"inputs[{i}]" if is_list else "inputs")
        told.append(str(row.shape))
        if row.ndim < 2 and row.shape != (len(t),):  # each number of a part for all times
            row = np.outer(row, np.ones(len(t)))
        rows.append(np.atleast_2d(row))
    shapes = {row.shape[1:] for row in rows}
    if shapes == {(len(t),)}:
        u = np.vstack(rows)
        alone = not is_list and len(u) == 1 and np.ndim(parts[0]) == 0
        u = np.repeat(u, len(labels), axis=0) if alone else u
        if len(u) == len(labels):
            _finite(labels, t, u)
            return u
    raise InputError(
        f"{name} needs inputs ({', '.join(labels)}) of shape ({len(labels)}, {len(t)}), not "
        f"{' and '.join(told)}."
    )


def by_name(
    name: str, labels: Sequence[str], t: np.ndarray, given: Mapping[str, Any]
) -> np.ndarray:
    """Inputs from a dict, each a number or (N,); 0 if left out."""
    strange = [k for k in given if k not in labels]
    if strange:
        known = ", ".join(labels) or "none"
        raise InputError(f"{name}: there is no external input '{strange[0]}'; known: {known}.")
    u = np.zeros((len(labels), len(t)))
    for row, label in zip(u, labels, strict=True):
        values = array(given.get(label, 0.0), f"input {label}")
        if values.shape not in ((), (len(t),)):
            raise InputError(
                f"input {label} must be a finite number or {len(t)} of them, not {values.shape}."
            )
        row[:] = values
    _finite(labels, t, u)
    return u


def _finite(labels: Sequence[str], t: np.ndarray, u: np.ndarray) -> None:
    bad = np.argwhere(~np.isfinite(u))
    if len(bad):
        i, k = bad[0]
        raise InputError(f"input {labels[i]} is {u[i, k]} at t = {t[k]:.6g} s.")


def start(name: str, states: int, x0: Any, what: str = "x0") -> np.ndarray:
    """Initial states: a number for all, or a list that is padded with zeros.

    A list of parts, one for each block as python-control takes them, must have all states, or end
    with 0; a matrix (a covariance) is taken row by row.
    """
    parts = [
        array(p, what)
        for p in (x0 if isinstance(x0, (list, tuple)) else [0.0 if x0 is None else x0])
    ]
    values = np.concatenate([part.ravel() for part in parts]) if parts else np.zeros(0)
    if not isinstance(x0, (list, tuple)) and parts[0].ndim == 0:
        values = np.full(states, float(values[0]))
    ragged = len({part.shape for part in parts}) > 1
    short = ragged and len(values) < states and values[-1] != 0.0
    if len(values) > states or short:
        raise InputError(f"{name} has {states} states, {what} has {len(values)}.")
    if not np.all(np.isfinite(values)):
        raise InputError(f"{name}: {what} must be finite.")
    return np.concatenate([values, np.zeros(states - len(values))])

"""Blocks on a sampled drive: discrete-time forms that are exact at constant speed."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import Any

import control as ct
import numpy as np
from scipy.linalg import expm

from .errors import InputError

NEAR = 0.1  # relative distance of two eigenvalues below which their slope is integrated
NODES, WEIGHTS = np.polynomial.legendre.leggauss(6)
SERIES = [1.0 / math.factorial(k + 3) for k in range(12, -1, -1)]  # phi3, highest power first


def sampled(
    system: ct.NonlinearIOSystem,
    dt: float,
    *,
    held: Sequence[str] | None = None,
    name: str | None = None,
) -> ct.NonlinearIOSystem:
    """A block in discrete time, its states advanced jointly and exactly at constant speed.

    x[k+1] = x[k] + dt phi1(A dt) f(x[k], v[k]) + dt phi2(A dt) (f(x[k], v[k+1]) - f(x[k], v[k]))
    for dx/dt = f(x, v), A = df/dx at the inputs in the middle of the step.

    Parameters
    ----------
    system : control.NonlinearIOSystem
        A continuous block whose rates are affine in its states at given inputs: the natural,
        existing, proposed, Friedland-Park, disturbance and extended-state observers, pi, pid,
        prefilter.
    dt : float
        Sample time in s.
    held : list of str, optional
        Inputs that are held between samples, as a drive holds its torque; all others run
        linearly. Default: "u" where there is one.
    name : str, optional
        Default: the system's name.

    Returns
    -------
    control.NonlinearIOSystem
        Inputs, outputs and parameters of the system. States: those of the system at the last
        sample, the inputs then (``last_w`` ...), and ``begun``, 0 until the first sample, at
        which the states are taken as they are.

    Raises
    ------
    InputError
        For a dt that is not positive, a system that is discrete or has no states, an unknown
        input in ``held``, or rates that are not affine in the states (the adaptive observer).

    Notes
    -----
    phi1(x) = (e^x - 1)/x, phi2(x) = (phi1(x) - 1)/x. At constant speed, other inputs linear
    between samples, the result is that of the continuous block, and as stable; the speed within a
    step is its value in the middle, which where it changes leaves an error of second order in dt.
    The outputs answer the sample just taken, except for held inputs, which act from then on.
    """
    _fits(system, dt)
    labels = list(system.input_labels)
    keep = [s for s in ("u",) if s in labels] if held is None else list(held)
    strange = [s for s in keep if s not in labels]
    if strange:
        raise InputError(f"{system.name} has no input {strange[0]}; it has {', '.join(labels)}.")
    holds = np.array([s in keep for s in labels], dtype=bool)
    n, keys, evaluate = int(system.nstates or 0), tuple(system.params), _functions(system)

    @lru_cache(maxsize=4)  # output and update ask for the same step
    def advanced(x: tuple, before: tuple, now: tuple, values: tuple) -> np.ndarray:
        rates, _ = evaluate(dict(zip(keys, values, strict=True)))
        return advance(rates, np.array(x), np.array(before), np.array(now), dt)

    def state(t: float, s: Any, v: Any, params: Any) -> np.ndarray:
        if s[-1] < 0.5:
            return np.array(s[:n], dtype=float)
        last = s[n:-1]
        before, now = (t - dt, *map(float, last)), (t, *map(float, np.where(holds, last, v)))
        return advanced(tuple(map(float, s[:n])), before, now, tuple(params[k] for k in keys))

    def update(t: float, s: Any, v: Any, params: Any) -> np.ndarray:
        return np.concatenate([state(t, s, v, params), v, [1.0]])

    def output(t: float, s: Any, v: Any, params: Any) -> np.ndarray:
        _, outputs = evaluate(params)
        return outputs(state(t, s, v, params), np.array([t, *v]))

    return ct.nlsys(
        update,
        output,
        inputs=labels,
        outputs=list(system.output_labels),
        states=[*system.state_labels, *(f"last_{s}" for s in labels), "begun"],
        params=dict(system.params),
        name=name or system.name,
        dt=float(dt),
    )


def advance(
    rates: Callable[[Any, Any], Any],
    x: np.ndarray,
    before: np.ndarray,
    now: np.ndarray,
    dt: float,
) -> np.ndarray:
    """One step of dx/dt = rates(x, v), affine in x, as :func:`sampled` describes it.

    Parameters
    ----------
    rates : callable
        ``rates(x, v)`` of shape (n, ...), elementwise in the trailing axes.
    x : (n, ...) ndarray
        States; a batch of any shape in the trailing axes.
    before, now : (m, ...) ndarray
        Inputs at the start and the end of the step.
    dt : float
        Length of the step in s.

    Returns
    -------
    (n, ...) ndarray
    """
    start = rates(x, before)
    change = rates(x, now) - start
    middle = 0.5 * (before + now)
    rest, units = rates(0.0 * x, middle), np.eye(len(x))
    columns = [rates((0.0 * x.T + unit).T, middle) - rest for unit in units]
    return x + dt * ramp_response(dt * np.stack(columns, axis=1), start, change)


def ramp_response(B: np.ndarray, start: np.ndarray, change: np.ndarray) -> np.ndarray:
    """phi1(B) start + phi2(B) change: x(1) for dx/ds = B x + start + change s, x(0) = 0.

    Parameters
    ----------
    B : (n, n, ...) ndarray
        Closed form for n = 1 and 2; otherwise ``scipy.linalg.expm``.
    start, change : (n, ...) ndarray

    Returns
    -------
    (n, ...) ndarray
    """
    if len(B) == 1:
        one, two, _ = _phi(B[0])
        return one * start + two * change
    if len(B) == 2:
        return _by_eigenvalues(B, start, change)
    return _by_expm(B, start, change)


def _by_eigenvalues(B: np.ndarray, start: np.ndarray, change: np.ndarray) -> np.ndarray:
    """f(B) = mean of f at the eigenvalues + (slope of f between them) (B - middle)."""
    middle, half = 0.5 * (B[0, 0] + B[1, 1]), 0.5 * (B[0, 0] - B[1, 1])
    reach = np.sqrt(half * half + B[0, 1] * B[1, 0] + 0j)
    near = np.abs(reach) < NEAR * np.maximum(1.0, np.abs(middle))
    places = np.array([1.0, -1.0, *NODES]).reshape(-1, *[1] * np.ndim(reach))
    one, two, three = _phi(middle + places * reach)
    weights = 0.5 * WEIGHTS.reshape(places[2:].shape)
    total, twice = 0.0, np.where(near, 1.0, 2.0 * reach)
    # phi1' = phi1 - phi2, phi2' = phi2 - 2 phi3
    for f, slope, v in ((one, one - two, start), (two, two - 2.0 * three, change)):
        inside = (weights * slope[2:]).sum(axis=0)
        slant = np.where(near, inside, (f[0] - f[1]) / twice)
        turned = np.array([half * v[0] + B[0, 1] * v[1], B[1, 0] * v[0] - half * v[1]])
        total = total + np.real(0.5 * (f[0] + f[1]) * v + slant * turned)
    return np.asarray(total)


def _by_expm(B: np.ndarray, start: np.ndarray, change: np.ndarray) -> np.ndarray:
    n = len(B)
    W = np.zeros((n + 2, n + 2, *B.shape[2:]))
    W[:n, :n], W[:n, n], W[:n, n + 1], W[n, n + 1] = B, change, start, 1.0
    whole = expm(np.moveaxis(W, (0, 1), (-2, -1)))
    return np.moveaxis(whole[..., :n, -1], -1, 0)


def _phi(x: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """phi1, phi2, phi3, where phi0 = e^x and phi(k+1) = (phi(k) - 1/k!)/x."""
    small = np.abs(x) < 0.5
    near, far = np.where(small, x, 0.0), np.where(small, 1.0, x)
    three = SERIES[0]
    for factor in SERIES[1:]:
        three = factor + near * three
    two = np.where(small, 0.5 + near * three, (np.expm1(far) / far - 1.0) / far)
    one = np.where(small, 1.0 + near * two, np.expm1(far) / far)
    return one, two, np.where(small, three, (two - 0.5) / far)


def _functions(system: Any) -> Callable[[Any], tuple[Any, Any]]:
    """Rates and outputs as functions of the states and the inputs, of which time is the first."""

    def evaluate(params: Any) -> tuple[Any, Any]:
        def rates(x: Any, v: Any) -> Any:
            return np.asarray(system.updfcn(v[0], x, v[1:], params))

        def outputs(x: Any, v: Any) -> Any:
            if system.outfcn is None:
                return x[: system.noutputs]
            return np.asarray(system.outfcn(v[0], x, v[1:], params))

        return rates, outputs

    return evaluate


def _fits(system: Any, dt: float) -> None:
    if not (isinstance(dt, (int, float, np.number)) and math.isfinite(dt) and dt > 0.0):
        raise InputError(f"the sample time must be a positive number of seconds, not {dt!r}.")
    if system.isdtime(strict=True):
        raise InputError(f"{system.name} is discrete already (dt = {system.dt}).")
    if not system.nstates:
        raise InputError(f"{system.name} has no states: use it as it is beside sampled blocks.")
    rates, _ = _functions(system)(system.params)
    rng = np.random.default_rng(0)
    for _ in range(5):
        v = rng.normal(size=system.ninputs + 1)
        a, b = rng.normal(size=(2, system.nstates))
        parts = np.array([rates(a + b, v), rates(0.0 * a, v), -rates(a, v), -rates(b, v)])
        scale = np.abs(parts).max(axis=0) + 1e-300
        if not np.all(np.abs(parts.sum(axis=0)) <= 1e-9 * scale):
            raise InputError(
                f"{system.name}: its rates are not affine in its states at given inputs, so "
                "there is no exact sampled form."
            )

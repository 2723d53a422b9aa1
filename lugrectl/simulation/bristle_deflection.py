"""The bristle deflection along a measured velocity, exact for a velocity held between samples."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import lapack

from ..blocks.friction import bristle
from ..blocks.model import as_model
from ..core.errors import InputError
from ..core.validation import array, positive
from ..engine.backend import load
from ..engine.graph import Graph, Node, derivatives, rename, substitute
from ..engine.python_source import Emitter, indent

if TYPE_CHECKING:
    from ..blocks.model import Model, Parameters

_dtbtrs: Any = lapack.dtbtrs  # pyright: ignore[reportAttributeAccessIssue]
KEYS = ("sigma0", "Fc", "Fs", "vs")
BLOCK = 8192  # samples whose coefficients stay in the processor's cache

# dz/dt = b - a z at held w; in one step z covers the share 1 - e^(-a dt) of the distance to b/a,
# and changes by b dt if a is 0.
_COEFFICIENTS = """
def coefficients(w, p, dt):
    {names}, = p
{body}
    a = {a}
    return np.expm1(-dt * a), a, {b}
"""


def deflection(w: ArrayLike, dt: float, p: Parameters | Model, z0: ArrayLike = 0.0) -> np.ndarray:
    """The bristle deflection z of the LuGre law along a velocity that is held between samples.

    z[k+1] = e^(-a dt) z[k] + (1 - e^(-a dt)) w[k]/a, a = sigma0 |w[k]| / h(w[k]).

    Parameters
    ----------
    w : (N,) or (L, N) array_like
        Velocity in rad/s, one record or L of them.
    dt : float
        Sample time in s.
    p : Parameters or Model
        Of a LuGre drive; gives sigma0, Fc, Fs, vs, and delta where it has one.
    z0 : float or (L,) array_like
        Deflection in rad at the first sample.

    Returns
    -------
    ndarray
        z in rad, of the shape of w; z[0] = z0.

    Raises
    ------
    InputError
        For a dt that is not positive, a NaN in the velocity, shapes that do not fit, or a LuGre
        parameter without a value.

    Notes
    -----
    Exact for a velocity that is constant between samples, at any speed. The velocity of a real
    drive varies between samples, which leaves an error of first order in dt. Source paper, eq.
    LuGre1, evaluated by the friction law's own function.

    Examples
    --------
    A slow reversal: the bristles bend by h(w)/sigma0, one way and then the other.

    >>> p = lg.table1()
    >>> w = np.repeat([0.1, -0.1], 500)
    >>> z = lg.deflection(w, dt=1e-3, p=p)
    >>> np.round(1e3 * z[[499, 999]], 2)  # mrad
    array([ 1.1, -1.1])
    """
    dt = positive(dt, "dt, the sample time,", "seconds")
    speed = array(w, "w")
    if speed.ndim not in (1, 2) or not speed.shape[-1]:
        raise InputError(f"w must be (N,) or (L, N), not {speed.shape}.")
    speed = np.ascontiguousarray(np.atleast_2d(speed))
    if not np.isfinite(speed).all():
        lane, k = np.argwhere(~np.isfinite(speed))[0]
        raise InputError(f"the velocity is {speed[lane, k]} at sample {k}: fill the gap first.")
    start = array(z0, "z0")
    if start.shape not in ((), (len(speed),)) or not np.all(np.isfinite(start)):
        raise InputError(f"z0 must be a finite number or {len(speed)} of them.")
    values = _values(p)
    coefficients = _coefficients(len(values) > len(KEYS))
    z = np.empty((len(speed), speed.shape[1] + 1))
    z[:, 0] = start
    for row, out in zip(speed, z, strict=True):
        for begin in range(0, len(row), BLOCK):
            with np.errstate(all="ignore"):
                less, a, b = coefficients(row[begin : begin + BLOCK], values, dt)
            _advance(less, a, b, dt, out[begin : begin + BLOCK + 1])
    return z[:, :-1].reshape(np.shape(w))


def _values(p: Parameters | Model) -> tuple[float, ...]:
    model = as_model(p, "p")
    have = model.values()
    law = model.friction.block
    if law.states and law.name != "lugre":
        raise InputError(f"{model.name} has '{law.name}' friction: deflection is for LuGre alone.")
    keys = (*KEYS, "delta") if "delta" in have else KEYS
    missing = [k for k in keys if have.get(k) is None]
    if missing:
        raise InputError(
            f"{model.name} gives no {', '.join(missing)}: the deflection needs a LuGre model."
        )
    values = {k: float(have[k]) for k in keys}  # pyright: ignore[reportArgumentType]
    law.check(values)
    return tuple(values.values())


def _advance(less: np.ndarray, a: np.ndarray, b: np.ndarray, dt: float, z: np.ndarray) -> None:
    """The recursion as a unit lower bidiagonal system of equations."""
    n, moving = len(less), a > 0.0
    gain = np.where(moving, -less / np.where(moving, a, 1.0), dt)
    band = np.empty((2, n + 1), order="F")
    band[1, :n] = -1.0 - less
    right = np.empty(n + 1)
    right[0], right[1:] = z[0], gain * b
    solved, _ = _dtbtrs(band, right, uplo="L", diag="U", overwrite_b=True)
    z[:] = solved


@cache
def _coefficients(free: bool) -> Callable[..., tuple[np.ndarray, ...]]:
    """e^(-a dt) - 1, a and b from the friction law's own function, which is affine in z."""
    graph, keys = Graph(), (*KEYS, "delta") if free else KEYS
    w, z, *p = (graph.symbol(name) for name in ("w", "z", *keys))
    rate: Any = bristle(w, z, *p)
    slope = derivatives([rate], z)[0]
    still = rename([rate], {z.index: graph.constant(0.0)})[0]

    def no_underflow(node: Node, args: tuple[Node, ...]) -> Node | None:
        """Limit e^x to 1e-304: smaller values are several times slower and contribute nothing."""
        return np.exp(np.maximum(args[0], -700.0)) if node.op == "exp" else None  # pyright: ignore

    emitter = Emitter("array")
    a, b = emitter.write(substitute([-slope, still], no_underflow))
    text = _COEFFICIENTS.format(names=", ".join(keys), body=indent(emitter.body, 1), a=a, b=b)
    return load(text, "numpy").coefficients

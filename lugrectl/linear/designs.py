"""The checks on many designs at once."""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..blocks.model import values_of
from ..core.errors import InputError
from ..core.result import Result
from ..core.validation import array as numbers
from ..core.validation import shown
from . import closed_forms as forms
from .band import bandwidth_check, level_power
from .loops import position_loop_tf, velocity_loop_tf

CHUNK = 8192  # designs at a time, so that temporary arrays fit into the cache
NAMES = ("J", "sigma0", "sigma1", "kp", "ki", "kd", "K2")


@dataclass(frozen=True, repr=False)
class DesignChecks(Result):
    """The checks of many designs, arrays of one shape.

    ``l2_gain``, ``l2_frequency`` as in ``l2_check``; ``classification`` an index into
    ``CLASSES`` ("not PR", "PR", "WSPR", "SPR"); ``bandwidth`` in rad/s and ``stable`` as in
    ``bandwidth_check``.
    """

    l2_gain: NDArray[np.float64]
    l2_frequency: NDArray[np.float64]
    classification: NDArray[np.int8]
    bandwidth: NDArray[np.float64]
    stable: NDArray[np.bool_]
    _units = {"l2_gain": "s", "l2_frequency": "rad/s", "bandwidth": "rad/s"}

    @property
    def spr(self) -> NDArray[np.bool_]:
        """Which T(s) are SPR."""
        return self.classification == forms.SPR

    @property
    def names(self) -> NDArray[np.str_]:
        """The classification in words."""
        return np.array(forms.CLASSES)[self.classification]

    def summary(self) -> dict[str, Any]:
        """Plain Python: the number of designs, and of each outcome."""
        counts = np.bincount(self.classification.ravel(), minlength=len(forms.CLASSES))
        return {
            "designs": self.stable.size,
            "finite_gain": int(np.isfinite(self.l2_gain).sum()),
            "classification": dict(zip(forms.CLASSES, counts.tolist(), strict=True)),
            "stable": int(self.stable.sum()),
        }


def check_designs(
    p: Any,
    kp: ArrayLike = 0.0,
    ki: ArrayLike = 0.0,
    kd: ArrayLike = 0.0,
    *,
    K2: ArrayLike,
    loop: str = "velocity",
    level: str | float = "-3dB",
) -> DesignChecks:
    """L2 gain, SPR class and bandwidth of many designs in one call.

    Gives the answers of ``l2_check(p, K2)``, ``spr_check(position_T(p, kp, ki, kd))`` and
    ``bandwidth_check(position_loop_tf(p, kp, ki, kd), level)``, or their velocity counterparts,
    by closed forms: the classes exactly for the given floats, the bandwidths to about 1e-9.

    Parameters
    ----------
    p : Parameters, Model or any object with attributes J > 0, sigma0 > 0, sigma1 >= 0
        SI units; the attributes are numbers or arrays.
    kp, ki, kd : float or array_like
        Gains in the units of :func:`position_T` or :func:`velocity_T`; pure integral action only.
    K2 : float or array_like
        Observer gain in N m s/rad. It and all the others broadcast.
    loop : "velocity" or "position"
        For the class and the bandwidth.
    level : "-3dB", "half-power" or float
        As for :func:`bandwidth_check`.

    Returns
    -------
    DesignChecks
        Arrays of the broadcast shape: ``l2_gain`` (s), ``l2_frequency`` (rad/s), ``names`` (the SPR
        classes), ``spr``, ``bandwidth`` (rad/s), ``stable``.

    Raises
    ------
    InputError
        For another loop or level, shapes that do not fit, values that are not finite or out of
        range, and a velocity loop with J + kd <= 0.

    Notes
    -----
    Designs for which the closed form is uncertain are checked one by one. All properties are those
    of the linear loop with friction compensated.

    Examples
    --------
    The least derivative gain of a PD position controller that makes T(s) SPR lies above
    sigma0 J/sigma1 = 0.953 N m s/rad:

    >>> checks = lg.check_designs(lg.table1(), 15.0, 0.0, [0.9, 1.0], K2=22.0, loop="position")
    >>> checks.spr.tolist()
    [False, True]
    """
    if not isinstance(loop, str) or loop not in ("velocity", "position"):
        raise InputError(f"loop must be 'velocity' or 'position', not {shown(loop)}.")
    p = values_of(p)
    given = [getattr(p, name, None) for name in NAMES[:3]] + [kp, ki, kd, K2]
    parts = [_array(value, name) for value, name in zip(given, NAMES, strict=True)]
    try:
        shape = np.broadcast_shapes(*(part.shape for part in parts))
    except ValueError:
        shapes = ", ".join(f"{n} {a.shape}" for n, a in zip(NAMES, parts, strict=True) if a.ndim)
        raise InputError(f"The designs' arrays do not fit together: {shapes}.") from None
    _in_range(parts, loop)
    return _all_chunks(parts, shape, loop, level)


def _array(value: Any, name: str) -> NDArray[np.float64]:
    array = numbers(value, name)
    if not np.all(np.isfinite(array)):
        raise InputError(f"{name} holds a value that is not a finite number.")
    return array


def _in_range(parts: list[Any], loop: str) -> None:
    J, sigma0, sigma1, _, _, kd, _ = parts
    for name, wrong in (
        ("J is not above 0", np.any(J <= 0)),
        ("sigma0 is not above 0", np.any(sigma0 <= 0)),
        ("sigma1 is below 0", np.any(sigma1 < 0)),
        ("J + kd is not above 0", loop == "velocity" and np.any(J + kd <= 0)),
    ):
        if wrong:
            raise InputError(f"{name} in a design; use the check of a single design for it.")


def _all_chunks(parts: list[Any], shape: Any, loop: str, level: str | float) -> DesignChecks:
    flat = [a if a.size == 1 else np.broadcast_to(a, shape).ravel() for a in parts]
    size = int(np.prod(shape))
    out = DesignChecks(*(np.empty(size, kind) for kind in (float, float, np.int8, float, np.bool_)))
    for start in range(0, size, CHUNK):
        here = slice(start, min(start + CHUNK, size))
        chunk = [a.reshape(1) if a.size == 1 else a[here] for a in flat]
        _chunk(chunk, here, loop, level, out)
    return DesignChecks(*(getattr(out, f).reshape(shape) for f in out.__dataclass_fields__))


def _chunk(parts: list[Any], here: slice, loop: str, level: str | float, out: DesignChecks) -> None:
    J, sigma0, sigma1, kp, ki, kd, K2 = parts
    out.l2_gain[here], out.l2_frequency[here] = forms.l2_gain(J, sigma0, sigma1, K2)
    kind, stable, width = {
        "velocity": (forms.velocity_class, forms.velocity_stable, forms.velocity_bandwidth),
        "position": (forms.position_class, forms.position_stable, forms.position_bandwidth),
    }[loop]
    out.classification[here] = kind(J, sigma0, sigma1, kp, ki, kd)
    out.stable[here] = stable(J, kp, ki, kd)
    with np.errstate(all="ignore"):
        out.bandwidth[here], doubt = width(J, kp, ki, kd, float(level_power(level)))
    for i in np.nonzero(np.broadcast_to(doubt, out.bandwidth[here].shape))[0]:
        one = [float(a[i if a.size > 1 else 0]) for a in (J, kp, ki, kd)]
        out.bandwidth[here.start + i] = _exact_bandwidth(loop, one, level)


def _exact_bandwidth(loop: str, design: list[float], level: str | float) -> float:
    J, *gains = design
    made = position_loop_tf if loop == "position" else velocity_loop_tf
    return bandwidth_check(made(SimpleNamespace(J=J), *gains), level).bandwidth

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
from .band import bandwidth_check, level_power
from .exact import classify
from .l2 import l2_check
from .loops import position_loop_tf, position_T, velocity_loop_tf, velocity_T
from .transfer import read_transfer

CLASSES = ("not PR", "PR", "WSPR", "SPR")
LOOPS = {"velocity": (velocity_T, velocity_loop_tf), "position": (position_T, position_loop_tf)}
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
        return self.classification == CLASSES.index("SPR")

    @property
    def names(self) -> NDArray[np.str_]:
        """The classification in words."""
        return np.array(CLASSES)[self.classification]

    def summary(self) -> dict[str, Any]:
        """Plain Python: the number of designs, and of each outcome."""
        counts = np.bincount(self.classification.ravel(), minlength=len(CLASSES))
        return {
            "designs": self.stable.size,
            "finite_gain": int(np.isfinite(self.l2_gain).sum()),
            "classification": dict(zip(CLASSES, counts.tolist(), strict=True)),
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
    ``bandwidth_check(position_loop_tf(p, kp, ki, kd), level)``, or their velocity counterparts.

    Parameters
    ----------
    p : Parameters, Model or any object with attributes J, sigma0, sigma1
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
        For another loop or level, shapes that do not fit, and what the checks do not take.

    Notes
    -----
    All properties are those of the linear loop with friction compensated. A design takes about
    a millisecond.

    Examples
    --------
    The least derivative gain of a PD position controller that makes T(s) SPR lies above
    sigma0 J/sigma1 = 0.953 N m s/rad:

    >>> checks = lg.check_designs(lg.table1(), 15.0, 0.0, [0.9, 1.0], K2=22.0, loop="position")
    >>> checks.spr.tolist()
    [False, True]
    """
    if not isinstance(loop, str) or loop not in LOOPS:
        raise InputError(f"loop must be 'velocity' or 'position', not {shown(loop)}.")
    level_power(level)
    p = values_of(p)
    given = [getattr(p, name, None) for name in NAMES[:3]] + [kp, ki, kd, K2]
    parts = [numbers(value, name) for value, name in zip(given, NAMES, strict=True)]
    try:
        each = np.broadcast_arrays(*parts)
    except ValueError:
        shapes = ", ".join(f"{n} {a.shape}" for n, a in zip(NAMES, parts, strict=True) if a.ndim)
        raise InputError(f"The designs' arrays do not fit together: {shapes}.") from None
    rows = [_checked(loop, level, row) for row in zip(*(a.flat for a in each), strict=True)]
    found: Any = np.array(rows, dtype=float).reshape(-1, 5).T.reshape(5, *each[0].shape)
    gain, frequency, kind, width, stable = found
    return DesignChecks(gain, frequency, kind.astype(np.int8), width, stable.astype(bool))


def _checked(loop: str, level: str | float, row: Any) -> tuple[float, ...]:
    J, sigma0, sigma1, *gains, K2 = map(float, row)
    p = SimpleNamespace(J=J, sigma0=sigma0, sigma1=sigma1)
    error, reference = (make(p, *gains) for make in LOOPS[loop])
    gain, band = l2_check(p, K2), bandwidth_check(reference, level)
    kind = CLASSES.index(classify(*read_transfer(error)))
    return gain.gain, gain.frequency, kind, band.bandwidth, band.stable

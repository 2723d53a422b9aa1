"""Passivity of the LuGre friction itself: whether it can give energy back, and at which speeds."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import brentq

from ..blocks.friction import level
from ..blocks.model import as_model
from ..core.errors import InputError
from ..core.views import view
from .verdict import Verdict

NAMES = ("sigma1", "Fc", "Fs", "Fv", "vs")


@dataclass(frozen=True, repr=False)
class PassivityVerdict(Verdict):
    """Truthy iff the friction is passive from the velocity w to its torque F.

    ``margin`` = Fv - sigma1 (Fs - Fc)/Fc in N m s/rad. ``least_Fv`` and ``largest_sigma1``, in N m
    s/rad, are the values at which it is 0. ``speed`` in rad/s: as long as |w| stays below it no
    motion takes out more energy than the bristles store; inf if the friction is passive.
    ``meaning`` says what this is for a loop.
    """

    margin: float
    least_Fv: float
    largest_sigma1: float
    speed: float
    reason: str
    meaning: str
    _units = {
        "margin": "N m s/rad",
        "least_Fv": "N m s/rad",
        "largest_sigma1": "N m s/rad",
        "speed": "rad/s",
    }

    def __bool__(self) -> bool:
        return self.margin >= 0

    def plot(self, ax: Any = None) -> Any:
        """Draw the least lost power over w^2 and the speed where it is 0; returns the Axes."""
        return view("loop_plots.passivity")(self, ax)


def passivity_check(p: Any) -> PassivityVerdict:
    """Whether LuGre friction is passive: integral of w F dt >= -(energy stored at the start).

    With F = sigma0 z + sigma1 dz/dt + Fv w, dz/dt = w - sigma0 |w| z/h(w), the energy
    V = sigma0 z^2/2 and the deflection q = sigma0 z sign(w)/h(w),

        w F - dV/dt = |w| h(w) q^2 + w^2 (Fv + sigma1 (1 - q)).

    Fc <= h(w) <= Fs, and |z| <= Fs/sigma0 once it is so: q is at most Fs/h(w), thus Fs/Fc. The
    right side is then never negative if

        Fv >= sigma1 (Fs - Fc)/Fc,

    and if this fails it is negative at high speed, with bristles that a slow motion has bent to
    Fs/sigma0. The condition is necessary for any other stored energy too: after such a slow motion
    a jump to a large speed w over the angle x gives back
    w (sigma1 (Fs - Fc) (1 - exp(-sigma0 x/Fc))/sigma0 - Fv x), less a part that does not grow with
    w. For small x this grows without bound with w, while bending the bristles again costs the
    same each time.

    Parameters
    ----------
    p : Parameters, Model, or path of a model file
        Gives sigma1 >= 0, Fs >= Fc > 0, Fv >= 0 and vs > 0 of a rotary drive; sigma0 does not
        matter.

    Returns
    -------
    PassivityVerdict
        Truthy if the friction is passive; ``margin``, ``least_Fv``, ``largest_sigma1`` in
        N m s/rad, ``speed`` in rad/s, ``reason`` and ``meaning``.

    Raises
    ------
    InputError
        If a value is missing or out of these bounds, and for a damping that fades with the speed
        (``vd``), for which this condition is not necessary.

    Notes
    -----
    ``speed`` is where the least of the right side over q from 0 to Fs/h(w) is 0; it falls with
    |w|, and its zero is found by bisection. Below it the friction is passive as long as the motion
    stays there. The condition is about w and F of the friction alone: a drive also has inertia,
    and in many loops the feedback has damping enough.

    References
    ----------
    N. Barahanov and R. Ortega, Necessary and sufficient conditions for passivity of the LuGre
    friction model, IEEE Trans. Automatic Control 45(4), 2000. C. Canudas de Wit, H. Olsson,
    K. J. Astrom and P. Lischinsky, A new model for control of systems with friction, 40(3), 1995.

    Examples
    --------
    Table 1 of the source paper needs six times its viscous friction, or a sixth of its sigma1; up
    to 4.5 rad/s no motion shows it:

    >>> check = lg.passivity_check(lg.table1())
    >>> bool(check), round(check.least_Fv, 4), round(check.largest_sigma1, 4)
    (False, 0.1053, 0.1026)
    >>> round(check.speed, 2)
    4.51
    """
    sigma1, Fc, Fs, Fv, _ = source = _values(p)
    least = sigma1 * (Fs - Fc) / Fc
    margin = Fv - least
    most = Fv * Fc / (Fs - Fc) if Fs > Fc else math.inf
    speed = math.inf if margin >= 0 else _speed(source)
    said = f"Fv = {Fv:.6g} against sigma1 (Fs - Fc)/Fc = {least:.6g} N m s/rad"
    if margin >= 0:
        reason = f"the friction is passive: {said}"
        meaning = (
            "closed over a strictly passive drive with its controller the loop is stable by the "
            "passivity theorem, whatever the friction's state"
        )
    else:
        reason = (
            f"the friction is not passive: {said}; it would be with Fv of at least {least:.6g} or "
            f"sigma1 of at most {most:.6g} N m s/rad"
        )
        meaning = (
            "a stability proof that leans on passive friction covers the motion only as long as "
            f"|w| stays below {speed:.6g} rad/s; beyond it a jump of the speed after slow "
            "motion may draw energy from the model, which the controller must take up"
        )
    return PassivityVerdict(margin, least, most, speed, reason, meaning).of(source)


def _values(p: Any) -> tuple[float, ...]:
    """sigma1, Fc, Fs, Fv and vs, checked."""
    model = as_model(p, "p")
    have = model.values()
    given = {k: float(v) for k in NAMES if (v := have.get(k)) is not None}
    missing = [k for k in NAMES if k not in given]
    if missing:
        raise InputError(
            f"passivity_check needs {', '.join(missing)}, which {model.name} does not give; "
            "give it the parameters of a LuGre model."
        )
    if have.get("vd") is not None:
        raise InputError("passivity_check is for a constant sigma1, but the model gives vd.")
    sigma1, Fc, Fs, Fv, vs = found = tuple(given[k] for k in NAMES)
    if not (sigma1 >= 0 and Fs >= Fc > 0 and Fv >= 0 and vs > 0):
        raise InputError(
            "passivity_check needs sigma1 >= 0, Fs >= Fc > 0, Fv >= 0 and vs > 0; it was given "
            f"{', '.join(f'{k} = {x:g}' for k, x in zip(NAMES, found, strict=True))}."
        )
    return found


def least_power(w: Any, sigma1: float, Fc: float, Fs: float, Fv: float, vs: float) -> Any:
    """The least (w F - dV/dt)/w^2 over the deflections that there are, in N m s/rad, at w > 0."""
    w = np.asarray(w, dtype=float)
    with np.errstate(over="ignore"):  # of (w/vs)^2: h is then Fc
        h = level(w, Fc, Fs, vs)
    q = np.minimum(0.5 * sigma1 * w / h, Fs / h)
    return h * q * q / w + Fv + sigma1 * (1.0 - q)


def _speed(source: tuple[float, ...]) -> float:
    """Where the least power is 0; it falls with w, to the margin."""
    high = 1.0
    while least_power(high, *source) > 0:
        high *= 2.0
        if math.isinf(high):
            return high
    low = high
    while least_power(low, *source) <= 0:
        low /= 2.0
    zero: Any = brentq(lambda w: float(least_power(w, *source)), low, high, xtol=1e-300)
    return float(zero)

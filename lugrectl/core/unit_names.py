"""Names of units on rotary and on linear drives, and those of channels."""

from __future__ import annotations

_LINEAR = {
    "N m": "N",
    "N m/rad": "N/m",
    "N m s/rad": "N s/m",
    "N m/(rad s)": "N/(m s)",
    "N m s2/rad2": "N s2/m2",
    "N m (s/rad)^n": "N (s/m)^n",
    "N m (s/rad)^mu": "N (s/m)^mu",
    "N m/rad3": "N/m3",
    "N m s2/rad3": "N s2/m3",
    "kg m2 s2/rad2": "kg s2/m2",
    "1/(N m s)": "1/(N s m)",
    "rad/s2": "m/s2",
    "(rad/s)^(1-gamma)/s": "(m/s)^(1-gamma)/s",
    "rad/s": "m/s",
    "rad": "m",
    "kg m2": "kg",
    "1/rev": "rad/m",
}


_OF_ROLE = {"t": "s", "u": "N m", "d": "N m", "w": "rad/s", "theta": "rad", "theta_load": "rad"}


def unit_for(unit: str, motion: str = "rotary") -> str:
    """The unit's name on a rotary or a linear drive."""
    return _LINEAR.get(unit, unit) if motion == "linear" else unit


def si_unit(role: str, motion: str) -> str:
    """The SI unit of a channel; empty if it has none (r, temperature)."""
    return unit_for(_OF_ROLE.get(role, ""), motion)

"""Bandwidths of the source paper's loops, and of stable ones with the same crossing."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import control as ct
import numpy as np
from scipy.optimize import brentq

from ..blocks.model import Parameters
from ..linear import (
    bandwidth_check,
    position_loop_tf,
    position_T,
    spr_check,
    velocity_loop_tf,
    velocity_T,
)
from .results import Width
from .studies import POSITION, STRONG, VELOCITY


def same_width(p: Parameters, damping: float = 0.5**0.5) -> dict[str, float]:
    """A stable PID with the -3 dB crossing of the source paper's position PI.

    Kp = J wn^2, Kd = 2 damping J wn, Ki in the paper's ratio to Kp; wn is solved for.
    """
    wanted = bandwidth_check(position_loop_tf(p, **POSITION)).bandwidth
    ratio = POSITION["ki"] / POSITION["kp"]

    def gains(wn: float) -> dict[str, float]:
        kp = p.J * wn**2
        return {"kp": kp, "ki": ratio * kp, "kd": 2 * damping * p.J * wn}

    def miss(wn: float) -> float:
        return bandwidth_check(position_loop_tf(p, **gains(wn))).bandwidth - wanted

    return gains(float(brentq(miss, 0.2 * wanted, 5 * wanted, xtol=1e-10)))  # type: ignore


def same_width_spr(p: Parameters) -> dict[str, float]:
    """A PD with the same crossing whose T(s) is SPR: Kd 5 % above sigma0 J / sigma1.

    Kp solves c |Kp + j Kd w - J w^2|^2 = Kp^2 at the crossing w, with c = 10^(-3/10).
    """
    w = bandwidth_check(position_loop_tf(p, **POSITION)).bandwidth
    kd, c = 1.05 * p.sigma0 * p.J / p.sigma1, 10 ** (-3 / 10)
    a, half = 1 / c - 1, p.J * w**2
    # (1/c - 1) Kp^2 + 2 J w^2 Kp - (J w^2)^2 - (Kd w)^2 = 0
    kp = (-half + math.sqrt(half**2 + a * (half**2 + (kd * w) ** 2))) / a
    return {"kp": kp, "ki": 0.0, "kd": kd}


def widths(p: Parameters) -> tuple[Width, ...]:
    """Bandwidths of the paper's loops and of the loops compared with them."""
    v, q = VELOCITY, POSITION
    strong = [dict(c.gains) for c in STRONG]
    around, about = "around 115 Hz at -3 dB", "approximately 20 Hz"
    spr_v, spr_q = (
        lambda g: spr_check(velocity_T(p, **g)).classification,
        lambda g: spr_check(position_T(p, **g)).classification,
    )
    return (
        _width(p, "velocity", "paper's PI", v, "-3dB", spr_v(v), around),
        _width(p, "velocity", "paper's PI", v, "half-power", spr_v(v), around),
        _width(p, "velocity", "paper's PI, Fv left in", v, "-3dB", None, around),
        *(_width(p, "velocity", "strong PI", g, "-3dB", spr_v(g), "") for g in strong),
        _width(p, "position", "paper's PI", q, "-3dB", spr_q(q), about),
        _width(p, "position", "paper's PI, Fv left in", q, "-3dB", None, about),
        *(
            _width(p, "position", name, g, "-3dB", spr_q(g), "")
            for name, g in (("PID", same_width(p)), ("PD", same_width_spr(p)))
        ),
    )


def _width(
    p: Parameters,
    loop: str,
    label: str,
    gains: Mapping[str, float],
    level: str,
    spr: str | None,
    paper: str,
) -> Width:
    make = velocity_loop_tf if loop == "velocity" else position_loop_tf
    T = make(p, **gains)
    if "Fv" in label:
        T = _with_viscous(T, p.Fv)
    found = bandwidth_check(T, level)
    return Width(loop, label, gains, level, found.hertz, found.stable, found.poles, spr, paper)


def _with_viscous(T: Any, Fv: float) -> Any:
    """T with Fv s^(n-1) added to its denominator of degree n, led by J s^n."""
    num, den = T.num[0][0], np.array(T.den[0][0], dtype=float)
    den[1] += Fv
    return ct.tf(num, den)

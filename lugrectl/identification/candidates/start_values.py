"""The parameters of a contender in the terms of its block: start values for a fit."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.optimize import nnls

from ...blocks.block import REGISTRY, Block
from ...blocks.model import Model
from .base_model import LEVELS, Base
from .candidate import Contender
from .driven_load import of_unit_load
from .effect_columns import spanned
from .friction_terms import FORCES, NAMES, VISCOUS, Law


def values_of(c: Contender, model: Model) -> dict[str, float]:
    """All parameters of a named effect, within the bounds of their declaration."""
    block = REGISTRY["effect", c.name]
    found = _own(c, block)
    whole = {k: p.value for k, p in block.own.items() if p.fitted and not p.usual} | found
    return {k: float(np.clip(v, block.own[k].low, block.own[k].high)) for k, v in whole.items()}


def _own(c: Contender, block: Block) -> dict[str, float]:
    if "damping_ratio" in c.values:
        return _load(c, block)
    if not c.own and c.u is None:
        return {k: v for k, v in c.values.items() if k in block.own}
    if c.u is not None:
        return _of_torque(c, block)
    free, b = spanned(block), c.coefficients
    b = b[:2] if c.entry.by_run else b  # of the first run: there the phase counts from
    if "J" in block.acts:  # its columns are of the inertia of the base without it
        b = b * c.base.J / float(c.made.b[0])
    found = {k: v for k, v in c.values.items() if k in block.own}
    if free is None:
        return found | {block.gain: float(b[0])}
    if free in found:
        return found
    if block.own[free].angle:
        size, angle = float(np.hypot(*b)), float(np.arctan2(b[1], b[0]))
        return found | {block.gain: size, free: angle}
    middle = float(np.mean(c.base.record.motion.theta))
    return found | {block.gain: float(b[0]), free: middle + float(b[1] / b[0])}


def zeros_of(c: Contender) -> dict[int, float]:
    """Shifts of theta, by run, with which an effect has one phase in all runs."""
    if not c.entry.by_run:
        return {}
    order = float(c.values["harmonic"])
    phases = [float(np.arctan2(b, a)) for a, b in c.coefficients.reshape(-1, 2)]
    runs = np.unique(c.base.record.motion.run).tolist()
    turned = [float(np.angle(np.exp(1j * (phase - phases[0])))) for phase in phases]
    return {int(run): x / order for run, x in zip(runs[1:], turned[1:], strict=True)}


def _of_torque(c: Contender, block: Block) -> dict[str, float]:
    """A delay counts beyond the hold of u, which is half a sample on average."""
    found = {k: v for k, v in c.values.items() if k in block.own}
    if block.own[block.gain].unit != "s":
        return found
    dt, shift = c.base.record.motion.dt, c.base.record.shift
    return {k: max(v + shift - 0.5 * dt, 0.1 * dt) for k, v in found.items()}


def _load(c: Contender, block: Block) -> dict[str, float]:
    inertia = float(c.coefficients[0])
    frequency, damping = c.values["frequency"], c.values["damping_ratio"]
    own = c.values.get("gap"), c.values.get("slowing", 0.0)
    unit = of_unit_load(frequency, damping, *own)
    return {k: v if k == "gap" else v * inertia for k, v in unit.items() if k in block.own}


CURVE = ("Fc", "dip", "Fv")  # one Coulomb level, one Stribeck curve, one viscous term


def curve_of(law: Law) -> Callable[[np.ndarray], dict[str, float]]:
    """What makes Fc, Fs and Fv of the coefficients of all shapes of friction.

    Many shapes share the torque among them. The closest curve of one Coulomb level, one Stribeck
    curve and one viscous term has the levels of all.
    """
    own = [NAMES.index(k) for k in (*FORCES, *VISCOUS)]
    Q, R = np.linalg.qr(law.shapes[:, [NAMES.index(k) for k in CURVE]])
    P = Q.T @ law.shapes[:, own]

    def levels(b: np.ndarray) -> dict[str, float]:
        (Fc, dip, Fv), _ = nnls(R, P @ b[own])
        return {"Fc": float(Fc), "Fs": float(Fc + dip), "Fv": float(Fv)}

    return levels


def levels_of(base: Base) -> dict[str, float]:
    """Inertia and friction of a base: start values for the plant."""
    own = base.made.b[LEVELS] if base.levels is None else base.levels
    found = curve_of(base.law)(own)
    if not found["Fs"] > found["Fc"] > 0:
        del found["Fs"]
    return {"J": base.J, **found, "vs": base.law.vs, **bristle(found["Fc"], own, base.law.x0)}


def bristle(Fc: float, levels: np.ndarray, x0: float) -> dict[str, float]:
    """Stiffness and damping of bristles that reach Fc over the distance x0."""
    return {"sigma0": Fc / x0, "sigma1": float(levels[NAMES.index("sigma1")]) / x0}

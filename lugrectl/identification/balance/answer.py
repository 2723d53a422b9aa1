"""From a fit to the answer."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy import stats

from ...core.display import between
from ...estimates.findings import Estimate
from .constants import LITTLE, QUARTER, SMALL, STEEP, TOP
from .contradictions import contradictions, left_of, one_direction
from .estimate import Estimated
from .fit import Fit
from .friction_curve import curve
from .parameters import answers, combinations, own
from .problem import Ground
from .result import Balance, Combination, Residual
from .speed_offset import KEY as OFFSET

TWO_SIDED = 0.5 + TOP / 2
CONSTANT, SLOPE, BEND = "constant_torque", "slope", "bend"
ONE_WAY = (
    "The motion goes in one direction: to separate Fc from a constant torque, record the other "
    "direction."
)
MIXED = (
    "The position changes by {:.2g} rad only: a constant torque and gravity cannot be separated, "
    "but their sum is certain."
)
SHIFTED = "w is {:.3g} {} too {}: friction turns over at that speed. The balance subtracts it."
LATE = "u comes {:.3g} ms {} ({}), {}: the balance shifts it by that time."
EARLY = "as after a delay in the drive or with a late sensor"


def answer(ground: Ground, found: Estimated) -> Balance:
    """What is certain, what is not, and what was noticed."""
    made, V = separated(found.fit, found.V)
    quantile = float(stats.t.ppf(TWO_SIDED, max(found.freedom, 1.0)))
    every = answers(made, ground.model, ground.uses)
    speed = "m/s" if ground.model.motion == "linear" else "rad/s"
    every += [
        replace(a, value=ground.sensors.offset + a.value) for a in own(made, OFFSET, OFFSET, speed)
    ]
    estimates = {a.key: a.estimate(V, quantile) for a in every}
    if not found.freedom:
        estimates = {k: replace(e, ci95=None) for k, e in estimates.items()}
    left = left_of(made)
    against = contradictions(made, estimates, V, quantile, left, ground.sensors.noise["u"])
    notes = [*ground.notes, *found.notes, *against.notes]
    if one_direction(made) and not {"Fc", CONSTANT} & {*ground.held}:
        notes.append(ONE_WAY)
    sure = {a.key for a in every if a.is_certain(a.half(V, quantile), made.torque)}
    sure = set() if against.all_refused else sure - against.refused
    notes += _noticed({k: e for k, e in estimates.items() if k in sure}, made.windows.dt)
    sums: list[Combination] = []
    if not against.all_refused:
        sums, said = _sums(ground, made, V, quantile, sure)
        notes += said
    if not found.freedom:
        sums = [replace(c, ci95=None) for c in sums]
    tach, tach_V = _tachometer(ground, speed)
    sure |= {*tach}
    estimates |= tach
    G, d = np.array([a.gradient for a in every]), made.windows
    return Balance(
        parameters={k: e for k, e in estimates.items() if k in sure},
        uncertain={k: e for k, e in estimates.items() if k not in sure},
        combinations=tuple(sums),
        curve=curve(made) if found.curve is None else found.curve,
        left=left,
        notes=tuple(notes),
        names=tuple(estimates),
        covariance=_joint(G @ V @ G.T, tach_V),
        is_map=ground.is_map,
        half_width=made.half_width,
        residual=Residual(d.t, d.run, made.r, d.rest < LITTLE),
        refused=against.notes[0] if against.impossible else "",
        blind=ground.blind,
    )


def _joint(V: np.ndarray, more: np.ndarray) -> np.ndarray:
    """The covariance of two independent sets of parameters."""
    return np.block([[V, np.zeros((len(V), len(more)))], [np.zeros((len(more), len(V))), more]])


def _sums(
    ground: Ground, made: Fit, V: np.ndarray, quantile: float, sure: set[str]
) -> tuple[list[Combination], list[str]]:
    """What is certain of the terms that are not; gravity beside a constant torque, over an angle
    too small to separate them, is said."""
    known = {*sure, *(("gravity.sin", "gravity.cos") if "gravity.amplitude" in sure else ())}
    sums = combinations(
        made, V, quantile, [n for n in made.names if n not in known], ground.model.motion
    )
    if not {CONSTANT, BEND} <= {*made.names} or CONSTANT in sure:
        return sums, []
    both = np.zeros(len(made.p))
    both[[made.names.index(CONSTANT), made.names.index(BEND)]] = 1.0
    value, half = float(both @ made.p), quantile * float(np.sqrt(both @ V @ both))
    if half >= max(SMALL * made.torque, QUARTER * abs(value)):
        return sums, []
    text = f"constant_torque + gravity at {ground.travel.middle:.3g} rad"
    mixed = Combination(text, value, "N m", (value - half, value + half), "record other angles")
    others = [c for c in sums if CONSTANT not in c.text]
    return [*others, mixed], [MIXED.format(ground.travel.span)]


def _noticed(sure: dict[str, Estimate], dt: float) -> list[str]:
    """Sentences on a delay of more than a sample and on an offset of w that are no chance."""
    said, delay, offset = [], sure.get("u_delay"), sure.get(OFFSET)
    if delay is not None and delay.ci95 and not delay.may_be(0.0) and abs(delay.value) >= dt:
        low, high = sorted(abs(x) * 1e3 for x in delay.ci95)
        side, how = ("late", "compared with the motion") if delay.value < 0 else ("early", EARLY)
        said.append(LATE.format(abs(delay.value) * 1e3, side, between((low, high)), how))
    if offset is not None and not offset.may_be(0.0):
        side = "high" if offset.value > 0 else "low"
        said.append(SHIFTED.format(abs(offset.value), offset.unit, side))
    return said


def _tachometer(ground: Ground, speed: str) -> tuple[dict[str, Estimate], np.ndarray]:
    """Gain, offset and lag of w, where theta is beside it."""
    if ground.comparison is None:
        return {}, np.zeros((0, 0))
    values, V = ground.comparison.values, ground.comparison.covariance
    half = float(stats.norm.ppf(TWO_SIDED)) * np.sqrt(np.diag(V))
    units = {"w_gain": "1", "w_offset": speed, "w_lag": "s"}
    rows = zip(units.items(), values.tolist(), half.tolist(), strict=True)
    return {k: Estimate(x, unit, (x - h, x + h)) for (k, unit), x, h in rows}, V


def separated(made: Fit, V: np.ndarray) -> tuple[Fit, np.ndarray]:
    """The fit, and its covariance, with gravity's part in the constant taken off the constant.

    The fit has (constant + b) and the bend b (cos(x) - 1). With any phase alike, b / a is the
    tangent of an even angle: ``b`` has the prior STEEP^2 (a^2 + var a). Without the prior, a record
    in which no bend can be seen would know nothing of a constant torque that no gravity disturbs.
    """
    if not {CONSTANT, SLOPE, BEND} <= {*made.names}:
        return made, V
    k, a, b = (made.names.index(key) for key in (CONSTANT, SLOPE, BEND))
    prior = STEEP**2 * (made.p[a] ** 2 + V[a, a])
    gain = V[:, b] / (V[b, b] + prior)
    p, V = made.p - gain * made.p[b], V - np.outer(gain, V[b])
    change = np.eye(len(p))
    change[k, b] = -1.0
    return replace(made, p=change @ p), change @ V @ change.T

"""From a fit to the answer."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy import stats

from ...estimates.findings import Estimate
from .constants import CONFIDENCE, SHARE_OF_TORQUE, SHARE_OF_VALUE, SLIDES, STEEP
from .contradictions import contradictions, left_of, one_direction
from .estimate import Estimated
from .fit import Fit
from .friction_curve import curve
from .parameters import Answer, answers, combinations, is_certain
from .problem import Ground
from .result import Balance, Combination, Residual
from .speed_offset import KEY as OFFSET

TWO_SIDED = 0.5 + CONFIDENCE / 2
CONSTANT, SLOPE, BEND = "constant_torque", "slope", "bend"


def answer(ground: Ground, found: Estimated) -> Balance:
    """What is certain, what is not, and what was noticed."""
    made, V = separated(found.fit, found.V)
    quantile = float(stats.t.ppf(TWO_SIDED, max(found.freedom, 1.0)))
    notes = [*ground.notes, *found.notes]
    own = [*answers(made, ground.model, ground.uses), *_offset(ground, made)]
    estimates = {a.key: a.estimate(V, quantile) for a in own}
    if not found.freedom:
        estimates = {k: replace(e, ci95=None) for k, e in estimates.items()}
    left = left_of(made)
    against = contradictions(made, estimates, V, quantile, left, ground.sensors.noise["u"])
    notes += against.notes
    if one_direction(made) and not {"Fc", "constant_torque"} & {*ground.held}:
        notes.append("The motion goes in one direction: to separate Fc from a constant torque, "
                     "record the other direction.")  # fmt: skip
    sure = {
        a.key
        for a in own
        if is_certain(a, a.half(V, quantile), made.torque)
        and a.key not in against.refused
        and not against.all_refused
    }
    notes += _late(estimates.get("u_delay"), made.windows.dt) if "u_delay" in sure else []
    notes += _shifted(estimates[OFFSET]) if OFFSET in sure else []
    mixed, more = _mixed(ground, made, V, quantile, sure) if not against.all_refused else (None, [])
    notes += more
    sums = [] if against.all_refused else _sums(ground, made, V, quantile, sure, mixed)
    if not found.freedom:
        sums = [replace(c, ci95=None) for c in sums]
    tach, tach_V = _tachometer(ground)
    estimates |= tach
    sure |= {*tach}
    return Balance(
        parameters={k: e for k, e in estimates.items() if k in sure},
        uncertain={k: e for k, e in estimates.items() if k not in sure},
        combinations=tuple(sums),
        curve=curve(made) if found.curve is None else found.curve,
        left=left,
        notes=tuple(notes),
        names=tuple(estimates),
        covariance=_joint(own, V, tach_V),
        is_map=ground.is_map,
        half_width=made.half_width,
        residual=_residual(made),
        refused=against.notes[0] if against.impossible else "",
        blind=ground.blind,
    )


def _sums(
    ground: Ground,
    made: Fit,
    V: np.ndarray,
    quantile: float,
    sure: set[str],
    mixed: Combination | None,
) -> list[Combination]:
    """What is certain of the terms that are not."""
    unsure = [n for n in made.names if n not in sure and not _wave_sure(n, sure)]
    sums = combinations(made, V, quantile, unsure, ground.model.motion)
    if mixed is None:
        return sums
    return [*(c for c in sums if "constant_torque" not in c.text), mixed]


def _offset(ground: Ground, made: Fit) -> list[Answer]:
    """The offset of a speed that was logged alone, where it is a term."""
    if OFFSET not in made.names:
        return []
    i = made.names.index(OFFSET)
    value = float(ground.sensors.offset + made.p[i])
    unit = "m/s" if ground.model.motion == "linear" else "rad/s"
    return [Answer(OFFSET, value, np.eye(len(made.p))[i], unit, made.rms[i])]


def _shifted(offset: Estimate) -> list[str]:
    """A sentence on an offset that is no chance."""
    if offset.may_be(0.0):
        return []
    side = "high" if offset.value > 0 else "low"
    return [
        f"w is {abs(offset.value):.3g} {offset.unit} too {side}: friction turns over at that "
        "speed. The balance subtracts it."
    ]


def _late(delay: Estimate | None, dt: float) -> list[str]:
    """A sentence on a delay of more than a sample that is no chance."""
    if delay is None or delay.ci95 is None:
        return []
    low, high = sorted(abs(x) * 1e3 for x in delay.ci95)
    if delay.ci95[0] <= 0 <= delay.ci95[1] or abs(delay.value) < dt:
        return []
    size = f"{abs(delay.value) * 1e3:.3g} ms {{}} [{low:.3g}, {high:.3g}]"
    if delay.value < 0:
        return [
            f"u comes {size.format('late')}, compared with the motion: the balance shifts it by "
            "that time."
        ]
    how = "as after a delay in the drive or with a late sensor"
    return [f"u comes {size.format('early')}, {how}: the balance shifts it by that time."]


def _wave_sure(name: str, sure: set[str]) -> bool:
    return name in ("gravity.sin", "gravity.cos") and "gravity.amplitude" in sure


def _mixed(
    ground: Ground, made: Fit, V: np.ndarray, quantile: float, sure: set[str]
) -> tuple[Combination | None, list[str]]:
    """Gravity beside a constant torque, over an angle too small to separate them."""
    if BEND not in made.names or CONSTANT not in made.names or CONSTANT in sure:
        return None, []
    sum_of = np.zeros(len(made.p))
    sum_of[[made.names.index(CONSTANT), made.names.index(BEND)]] = 1.0
    value, half = float(sum_of @ made.p), quantile * float(np.sqrt(sum_of @ V @ sum_of))
    if half >= max(SHARE_OF_TORQUE * made.torque, SHARE_OF_VALUE * abs(value)):
        return None, []
    note = (
        f"The position changes by {ground.travel.span:.2g} rad only: a constant torque and "
        "gravity cannot be separated, but their sum is certain."
    )
    text = f"constant_torque + gravity at {ground.travel.middle:.3g} rad"
    both = (value - half, value + half)
    return Combination(text, value, "N m", both, "record other angles"), [note]


def _tachometer(ground: Ground) -> tuple[dict[str, Estimate], np.ndarray]:
    """Gain, offset and lag of w, where theta is beside it."""
    if ground.comparison is None:
        return {}, np.zeros((0, 0))
    speed = "m/s" if ground.model.motion == "linear" else "rad/s"
    V = ground.comparison.covariance
    names = (("w_gain", "1"), ("w_offset", speed), ("w_lag", "s"))
    made = {}
    for i, (key, unit) in enumerate(names):
        value = float(ground.comparison.values[i])
        half = float(stats.norm.ppf(TWO_SIDED) * np.sqrt(V[i, i]))
        made[key] = Estimate(value, unit, (value - half, value + half))
    return made, V


def _joint(own: list[Answer], V: np.ndarray, more: np.ndarray) -> np.ndarray:
    """The covariance of all parameters."""
    G = np.array([a.gradient for a in own])
    n, m = len(own), len(more)
    joint = np.zeros((n + m, n + m))
    joint[:n, :n] = G @ V @ G.T
    joint[n:, n:] = more
    return joint


def _residual(made: Fit) -> Residual:
    d = made.windows
    return Residual(d.t, d.run, made.r, d.rest < SLIDES)


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

"""From a fit to the answer."""

from __future__ import annotations

import numpy as np
from scipy import stats

from ...results import Estimate
from .answers import Answer, answers
from .certain import combinations, is_certain
from .constants import CONFIDENCE, SHARE_OF_TORQUE, SLIDES
from .curve import curve
from .estimate import Estimated
from .fit import Fit
from .ground import Ground
from .offset import KEY as OFFSET
from .result import Balance, Combination, Residual
from .small_angle import open_constant
from .verdicts import contradictions, left_of, one_direction

TWO_SIDED = 0.5 + CONFIDENCE / 2


def answer(ground: Ground, found: Estimated) -> Balance:
    """What is certain, what is not, and what was noticed."""
    made, V = found.fit, found.V
    quantile = float(stats.t.ppf(TWO_SIDED, max(made.blocks - _counted(made), 2)))
    notes = [*ground.notes, *found.notes]
    V, mixed, more = _small_angle(ground, made, V, quantile)
    own = [*answers(made, ground.model, ground.uses), *_offset(ground, made)]
    estimates = {a.key: a.estimate(V, quantile) for a in own}
    left = left_of(made)
    against = contradictions(made, estimates, V, quantile, left, ground.sensors.noise["u"])
    notes += [*more, *against.notes]
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
    sums = [] if against.all_refused else _sums(ground, made, V, quantile, sure, mixed)
    tach, tach_V = _tachometer(ground)
    estimates |= tach
    sure |= {*tach}
    return Balance(
        parameters={k: e for k, e in estimates.items() if k in sure},
        uncertain={k: e for k, e in estimates.items() if k not in sure},
        combinations=tuple(sums),
        curve=curve(made),
        left=left,
        notes=tuple(notes),
        names=tuple(estimates),
        covariance=_joint(own, V, tach_V),
        is_map=ground.is_map,
        half_width=made.half_width,
        residual=_residual(made),
        refused=against.notes[0] if against.impossible else "",
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


def _counted(made: Fit) -> int:
    """Terms that the blocks have to determine."""
    return sum(term.share is None for term in made.terms)


def _wave_sure(name: str, sure: set[str]) -> bool:
    return name in ("gravity.sin", "gravity.cos") and "gravity.amplitude" in sure


def _small_angle(
    ground: Ground, made: Fit, V: np.ndarray, quantile: float
) -> tuple[np.ndarray, Combination | None, list[str]]:
    """Gravity beside a constant torque, over an angle too small to separate them."""
    rotary = ground.model.motion != "linear" and not ground.is_map
    if "slope" not in made.names or "constant_torque" not in made.names or not rotary:
        return V, None, []
    k = made.names.index("constant_torque")
    room = open_constant(ground.source, made)
    own = quantile * float(np.sqrt(V[k, k]))
    if quantile * np.sqrt(room) <= max(SHARE_OF_TORQUE * made.torque, own):
        return V, None, []
    wider = V.copy()
    wider[k, k] += room
    note = (
        f"The position changes by {ground.travel.span:.2g} rad only: a constant torque and "
        "gravity cannot be separated, but their sum is certain."
    )
    value = float(made.p[k])
    if own >= max(SHARE_OF_TORQUE * made.torque, 0.25 * abs(value)):
        return wider, None, []
    text = f"constant_torque + gravity at {ground.travel.middle:.3g} rad"
    both = (value - own, value + own)
    return wider, Combination(text, value, "N m", both, "record other angles"), [note]


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

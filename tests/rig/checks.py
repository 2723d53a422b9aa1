"""What a usable record must fulfil, whatever it hides."""

from __future__ import annotations

import numpy as np

from .machines import MACHINES
from .record import Case


def problems(case: Case) -> list[str]:
    """Everything that is wrong with a record; empty when it is fit for use."""
    return [*_motion(case), *_drive(case), *_effect(case)]


def _motion(case: Case) -> list[str]:
    m, s = MACHINES[case.truth["machine"]], case.hidden.signals
    found = [f"{k} is not finite" for k, x in case.columns.items() if not np.all(np.isfinite(x))]
    slow = case.truth["excitation"] in ("sparse", "stopgo")
    if m.rotary and not slow and np.ptp(s["theta_true"]) < 2.0 * np.pi:
        found.append(f"travels only {np.ptp(s['theta_true']):.2f} rad")
    if not np.mean(np.abs(s["w_true"]) > m.vs) > 0.15:
        found.append("hardly moves")
    ways = np.mean(s["w_true"] > m.vs), np.mean(s["w_true"] < -m.vs)
    if not min(ways) > 0.02 * sum(ways):  # such a record is to be refused, whatever it hides
        found.append("moves in one direction only")
    if not np.max(np.abs(s["w_true"])) < 5.0 * m.w_max:
        found.append(f"runs away: {np.max(np.abs(s['w_true'])):.3g}")
    return found


def _drive(case: Case) -> list[str]:
    u = case.hidden.signals["u"]
    found = []
    if np.mean(np.abs(u) > 0.999 * case.truth["drive"]["limit"]) > 0.003:
        found.append("torque sits at its limit")
    if not np.std(u) > 0.0:
        found.append("torque is constant")
    return found


def _effect(case: Case) -> list[str]:
    found = []
    for entry in case.truth["effects"]:
        ratio = entry["effect_rms"] / entry["friction_rms"]
        if entry["limited"] and ratio < 0.4 * case.truth["strength"]:
            found.append(f"{entry['effect']} hardly visible: {ratio:.3f}")
        if entry["limited"] and ratio > 1.5 * case.truth["strength"]:
            found.append(f"{entry['effect']} too strong: {ratio:.3f}")
        if entry["effect"] == "hard_stop" and not _touched(case, **entry["parameters"]):
            found.append("hard_stop never touched")  # another effect may change the motion
    return found


def _touched(case: Case, position: float, side: float, **_more: float) -> bool:
    return bool(np.any(side * (case.hidden.signals["theta_true"] - position) > 0.0))

"""The plain answer is the floor: a finer fit must not leave more of the torque than it does."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.signal import oaconvolve

from ..blocks.block import unit_for
from ..blocks.model import Model
from ..core.errors import Refused
from ..estimates.findings import Estimate
from ..identification.balance import Balance
from ..identification.balance.track import weights
from ..identification.dataset.dataset import Data
from ..identification.regression.numbers import FEW_STRETCHES
from ..identification.selection import Comparison
from .question import Asked

MORE = 1.05  # times what the plain balance leaves; a finer fit that leaves more has failed ...
GAINS = 0.95  # of the error without an effect, below which the simulation gains from it
UNBORNE = (
    "{} would be a torque of {:.2g} % of friction beside what the law has of it, but the "
    "simulation of held-out samples gains nothing from it: it is not named."
)
POINTS = 0.003  # ... if it is also this share of the RMS torque more
FAILED = (
    "The fit by simulation failed: in the same windows it leaves {:.1f} % of the RMS torque, the "
    "plain torque balance {:.1f} %. The values are those of torque balances, which need no "
    "simulation."
)


def failure(data: Data, residual: np.ndarray, asked: Asked) -> str | None:
    """What to say where a model leaves more of the torque than the plain balance.

    ``residual`` (N,) is the torque that it leaves, N m.
    A model of which the user holds or bounds values may: nothing is said of it. Both are RMS of
    the residual torque, averaged over the windows of the balance in which the drive slides, as a
    share of the RMS torque there.
    """
    plain = asked.plain
    if asked.model.statements():
        return None
    left = share_left(data, residual, plain)
    if left is None or plain.left is None or left <= MORE * plain.left + POINTS:
        return None
    return FAILED.format(100.0 * left, 100.0 * plain.left)


def refuse_without_inertia(found: Mapping[str, Estimate], declared: Model) -> None:
    """Refuse values that do not determine an undeclared inertia: nothing can be simulated."""
    if declared.J is not None:
        return
    J, unit = found["J"], unit_for("kg m2", declared.motion)
    if not determines(J):
        low, high = J.ci95 or (0.0, np.inf)
        raise Refused(
            f"The fit by simulation hardly determines the inertia: {_range(low, high, unit)} fits "
            "about as well.",
            "Record a motion with clear acceleration in both directions, or declare J.",
        )


def borne(found: Comparison, error: Mapping[str, Any]) -> Comparison:
    """The comparison without effects whose own torque is below the least that matters, where the
    simulation of held-out samples gains nothing from them; in a short record, without any such.

    Such an effect is named for what the declared law imitates of it. That is a claim on the motion.
    In a short record the comparison is uncertain, and the motion has to say the same.
    """
    before, after = (error["declared"], error["refitted"]), error["augmented"]
    known = [x for x in before if x is not None]
    if found.verdict not in ("found", "ambiguous") or after is None or not known:
        return found
    short = (found.stretches or 0) < FEW_STRETCHES
    small = [e for e in found.effects if short or e.share <= found.least]
    if not small or after < GAINS * min(known):
        return found
    left = tuple(e for e in found.effects if e not in small)
    said = tuple(UNBORNE.format(e.name, 100.0 * e.share) for e in small)
    verdict = "found" if left else "adequate"
    return replace(found, effects=left, alternatives=(), verdict=verdict, valued=None,
                   messages=(*found.messages, *said))  # fmt: skip


def determines(J: Estimate) -> bool:
    """Whether an inertia is known well enough to simulate with."""
    return J.held or J.ci95 is not None and J.ci95[1] - J.ci95[0] <= J.value


def _range(low: float, high: float, unit: str) -> str:
    """'any value', or the values between two bounds in words."""
    if low > 0 and np.isfinite(high):
        return f"any value from {low:.3g} to {high:.3g} {unit}"
    if np.isfinite(high):
        return f"any value up to {high:.3g} {unit}"
    return f"any value above {low:.3g} {unit}" if low > 0 else "any value"


def share_left(data: Data, residual: np.ndarray, plain: Balance) -> float | None:
    """Share of the RMS torque that a residual torque (N,) is in the windows of the balance.

    Windows with a sample of which nothing is known (NaN) are left out. None if none remains.
    """
    if plain.residual is None or not plain.half_width or not plain.left:
        return None
    squares = balanced = 0.0
    for mine, theirs in _means(data, residual, plain):
        squares, balanced = squares + float(mine @ mine), balanced + float(theirs @ theirs)
    return plain.left * float(np.sqrt(squares / balanced)) if balanced else None


def _means(
    data: Data, residual: np.ndarray, plain: Balance
) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """For each stretch: the residual and that of the balance in the windows, N m."""
    windows, half = plain.residual, plain.half_width or 0.0
    assert windows is not None
    bump = weights(half / data.dt, 0)
    for begin, end in data.runs:
        t, known = data.t[begin:end], np.isfinite(residual[begin:end])
        at = windows.sliding & (windows.run == data.run[begin])
        at &= (windows.t > t[0] + half) & (windows.t < t[-1] - half)
        if not at.any() or end - begin <= len(bump):
            continue
        mean = oaconvolve(np.where(known, residual[begin:end], 0.0), bump, "same")
        whole = oaconvolve(known.astype(float), bump, "same") > 1.0 - 1e-6
        usable = np.interp(windows.t[at], t, whole.astype(float)) > 0.999
        yield np.interp(windows.t[at], t, mean)[usable], windows.value[at][usable]

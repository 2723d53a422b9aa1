"""What contradicts physics, and what then is certain."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ...core.display import between
from ...core.option_names import option
from ...estimates.findings import Estimate
from .constants import (
    ALL_LEFT,
    LITTLE,
    SHARE_OF_TORQUE,
    SLIDES,
)
from .fit import Fit

MAIN = ("J", "Fc", "Fv")
UNRELATED = (
    "{:.0%} of u remains unexplained: the motion shows next to nothing of it. u changes faster "
    "than the log, or is not the torque of this axis."
)


def _turn() -> str:
    """What to do about a wrong sign of u."""
    turned = option("scale", "u=-1")
    return f"give {turned}; where you give a scale of u already, give it with the other sign."


@dataclass(frozen=True)
class Contradictions:
    """Parameters that physics does not allow, whether nothing is certain, and sentences.

    ``impossible``: no term that is missing makes it possible.
    """

    refused: frozenset[str] = frozenset()
    all_refused: bool = False
    notes: tuple[str, ...] = ()
    impossible: bool = False


def contradictions(
    made: Fit,
    estimates: Mapping[str, Estimate],
    V: np.ndarray,
    quantile: float,
    left: float | None,
    noise_u: float,
) -> Contradictions:
    """Compare the intervals with what an inertia with friction can do."""
    if left is not None and left > ALL_LEFT:
        return Contradictions(all_refused=True, notes=(UNRELATED.format(left),))
    if "J" not in made.names and noise_u > made.torque and not dict(made.setting.held).get("J"):
        return _nothing(
            f"u changes by {noise_u:.3g} from sample to sample, more than its mean effect "
            f"({made.torque:.3g}): what acted between the samples is not in the log."
        )
    return _signs(made, estimates, V, quantile)


def _signs(
    made: Fit, estimates: Mapping[str, Estimate], V: np.ndarray, quantile: float
) -> Contradictions:
    share = dict(zip(made.names, made.rms / made.torque, strict=True))
    high = {k: _high(estimates[k]) for k in MAIN if k in estimates}
    below = {k for k in high if estimates[k].value < 0}
    loss = _loss(made, V, quantile)
    w = made.windows.w
    if high.get("J", 1.0) < 0 and high.get("Fc", 1.0) < 0:
        return _nothing(f"J and Fc both come out negative: u has the wrong sign: {_turn()}")
    idle = "J" in below and high["J"] * share["J"] < SHARE_OF_TORQUE
    hardly = high.get("Fc", 0.0) < LITTLE * made.torque
    if idle and hardly and loss < SHARE_OF_TORQUE * made.torque * np.mean(np.abs(w)):
        return _nothing(
            "Impossible: the inertia comes out negative and there is no friction. u follows the "
            "motion (the log of a controller, a hand or another axis that moves it), or has the "
            f"wrong sign. If it has: {_turn()}"
        )
    refused = {k for k in below if high[k] * share[k] > SHARE_OF_TORQUE}
    notes = [_negative(k, estimates[k]) for k in ("Fc", "Fv") if high.get(k, 1.0) < 0]
    refused |= {k for k in below if high[k] < 0}
    if high.get("J", 1.0) < 0:
        notes.append(
            "The inertia comes out negative: its torque is not in u (was it subtracted before?)."
        )
    elif loss < 0 and np.mean(made.windows.u * w) < 0:
        notes.append(
            "u takes power out of the motion: it has the wrong sign, or something else drives "
            f"the axis. If it is the sign: {_turn()}"
        )
    return Contradictions(frozenset(refused), False, tuple(notes))


def _nothing(note: str) -> Contradictions:
    return Contradictions(all_refused=True, notes=(note,), impossible=True)


def _high(e: Estimate) -> float:
    """The upper end of an interval; where there is none, any value may be right."""
    return e.ci95[1] if e.ci95 else np.inf


def _negative(key: str, e: Estimate) -> str:
    assert e.ci95
    return (
        f"{key} comes out negative ({between(e.ci95)}): no friction is negative. "
        "It stands for something that is missing from the balance."
    )


def _loss(made: Fit, V: np.ndarray, quantile: float) -> float:
    """Upper bound of the power that friction takes, mean of Fc |w| + Fv w^2."""
    w, gradient = made.windows.w, np.zeros(len(made.p))
    for key, mean in (("Fc", np.mean(np.abs(w))), ("Fv", np.mean(w**2))):
        if key in made.names:
            gradient[made.names.index(key)] = mean
    held = dict(made.setting.held)
    known = held.get("Fc", 0.0) * np.mean(np.abs(w)) + held.get("Fv", 0.0) * np.mean(w**2)
    spread = np.sqrt(max(gradient @ V @ gradient, 0.0))
    return float(known + gradient @ made.p + quantile * spread)


def left_of(made: Fit) -> float | None:
    """RMS of the residual as a share of the RMS torque, over sliding windows; of a map, whose runs
    are points, over the means of the runs."""
    slides = made.windows.rest < SLIDES
    if slides.sum() <= 5:
        return None
    size = np.sqrt(np.mean(made.windows.u[slides] ** 2)) or made.torque
    r = made.r[slides]
    if made.of_runs:
        r = np.bincount(made.chunks[0], made.r) / np.bincount(made.chunks[0])
    return float(np.sqrt(np.mean(r**2)) / size)


def one_direction(made: Fit) -> bool:
    """Whether the sliding windows all go one way."""
    w = made.windows.w[made.windows.rest < SLIDES]
    return not (np.any(w > 0) and np.any(w < 0))

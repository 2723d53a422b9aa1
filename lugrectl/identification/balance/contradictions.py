"""What contradicts physics, and what then is certain."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ...core.display import between
from ...core.option_names import option
from ...estimates.findings import Estimate
from .constants import ALL_LEFT, LITTLE, SMALL
from .fit import Fit
from .result import LEVELS

UNRELATED = (
    "{:.0f} % of u remains unexplained: the motion shows next to nothing of it. u changes faster "
    "than the log, or is not the torque of this axis."
)
BETWEEN = (
    "u changes by {:.3g} from sample to sample, more than its mean effect ({:.3g}): what acted "
    "between the samples is not in the log."
)
BOTH_NEGATIVE = "J and Fc both come out negative: u has the wrong sign: "
FOLLOWS = (
    "Impossible: the inertia comes out negative and there is no friction. u follows the motion "
    "(the log of a controller, a hand or another axis that moves it), or has the wrong sign. If "
    "it has: "
)
SUBTRACTED = "The inertia comes out negative: its torque is not in u (was it subtracted before?)."
DRIVEN = (
    "u takes power out of the motion: it has the wrong sign, or something else drives the axis. "
    "If it is the sign: "
)
NEGATIVE = (
    "{} comes out negative ({}): no friction is negative. It stands for something that is missing "
    "from the balance."
)


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
        return Contradictions(all_refused=True, notes=(UNRELATED.format(100.0 * left),))
    if "J" not in made.names and noise_u > made.torque and not made.value("J"):
        return _nothing(BETWEEN.format(noise_u, made.torque))
    turn = option("scale", "u=-1")
    turn = f"give {turn}; where you give a scale of u already, give it with the other sign."
    share = dict(zip(made.names, made.rms / made.torque, strict=True))
    known = {k: estimates[k] for k in LEVELS if k in estimates}
    # the upper end of an interval; where there is none, any value may be right
    high = {k: e.ci95[1] if e.ci95 else np.inf for k, e in known.items()}
    below = {k for k, e in known.items() if e.value < 0}
    w, loss = made.windows.w, _loss(made, V, quantile)
    if high.get("J", 1.0) < 0 and high.get("Fc", 1.0) < 0:
        return _nothing(BOTH_NEGATIVE + turn)
    idle = "J" in below and high["J"] * share["J"] < SMALL
    hardly = high.get("Fc", 0.0) < LITTLE * made.torque
    if idle and hardly and loss < SMALL * made.torque * np.mean(np.abs(w)):
        return _nothing(FOLLOWS + turn)
    negative = {k: e for k, e in known.items() if high[k] < 0}
    refused = {k for k in below if high[k] * share[k] > SMALL or high[k] < 0}
    notes = [
        NEGATIVE.format(k, between(e.ci95)) for k, e in negative.items() if k != "J" and e.ci95
    ]
    if "J" in negative:
        notes.append(SUBTRACTED)
    elif loss < 0 and np.mean(made.windows.u * w) < 0:
        notes.append(DRIVEN + turn)
    return Contradictions(frozenset(refused), False, tuple(notes))


def _nothing(note: str) -> Contradictions:
    return Contradictions(all_refused=True, notes=(note,), impossible=True)


def _loss(made: Fit, V: np.ndarray, quantile: float) -> float:
    """Upper bound of the power that friction takes, mean of Fc |w| + Fv w^2."""
    w, gradient, loss = made.windows.w, np.zeros(len(made.p)), 0.0
    for key, mean in (("Fc", np.mean(np.abs(w))), ("Fv", np.mean(w**2))):
        loss += made.value(key) * mean
        if key in made.names:
            gradient[made.names.index(key)] = mean
    return float(loss + quantile * np.sqrt(max(gradient @ V @ gradient, 0.0)))


def left_of(made: Fit) -> float | None:
    """RMS of the residual as a share of the RMS torque, over sliding windows; of a map, whose runs
    are points, over the means of the runs."""
    slides = made.windows.rest < LITTLE
    if slides.sum() <= 5:
        return None
    size = np.sqrt(np.mean(made.windows.u[slides] ** 2)) or made.torque
    r = made.r[slides]
    if made.of_runs:
        r = np.bincount(made.chunks[0], made.r) / np.bincount(made.chunks[0])
    return float(np.sqrt(np.mean(r**2)) / size)


def one_direction(made: Fit) -> bool:
    """Whether the sliding windows all go one way."""
    w = made.windows.w[made.windows.rest < LITTLE]
    return not (np.any(w > 0) and np.any(w < 0))

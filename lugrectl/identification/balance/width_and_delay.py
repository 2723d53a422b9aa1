"""The width of the windows and the delay of u."""

from __future__ import annotations

from collections.abc import Sequence

from .constants import CLEARLY
from .fit import Fit, Setting, fit
from .terms import Term
from .windows import Source


def best_width(
    source: Source, widths: Sequence[float], terms: Sequence[Term], setting: Setting
) -> Fit | None:
    """The fit with the least expected error of J, Fc and Fv, from wide windows to narrow ones.

    Wide windows suffer from what they average away, narrow ones from noise: so the width
    follows from the noise of the record.
    """
    tried, delay = [], 0.0
    for half_width in reversed(widths):
        made = fit(source, half_width, terms, setting, delay)
        if made is not None:
            tried.append(made)
            delay = made.delay
    if not tried:
        return None
    return _with_inertia(source, min(tried, key=lambda f: f.merit))


def _with_inertia(source: Source, made: Fit) -> Fit:
    """Of (J, T) and (-J, T + 2 J / Fv), which have one gain and one phase, the first."""
    J, Fv = made.value("J"), made.value("Fv")
    if not (made.setting.delay_prior and J < 0 < Fv and "J" in made.names):
        return made
    other = fit(source, made.half_width, made.terms, made.setting, made.delay + 2 * J / Fv)
    if other is None or other.value("J") < 0 or other.score < made.score - CLEARLY:
        return made
    return other

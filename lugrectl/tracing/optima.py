"""Several starts of a fit: the best local maximum of the likelihood, and others as likely.

How friction falls with speed shows at a few break-aways only. A small change of Fs or vs moves
each of them in time, so the likelihood has several local maxima and long, curved ridges.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import product

import numpy as np
from scipy.stats import chi2

from .beside import beside
from .coordinates import inside
from .fit import ANYWHERE, Fitted, fit
from .likelihood import loglik, whitened
from .windows import spread

SPEEDS = np.geomspace(3e-4, 0.1, 9)  # vs as a share of the largest speed
EXCESSES = (0.05, 0.1, 0.2, 0.35, 0.6, 1.0)  # of Fs over Fc, relative
ENOUGH, LEAST = 12_000, 12  # counted samples on which starts are compared, and least windows
TRIED = 3  # best starts that are followed
SHORT = 10  # steps of a fit from each
NOISIER = 1.5  # times the noise before: above, another maximum may be better
WIDE = 0.3  # standard deviation of a logarithm, above which the likelihood is no parabola
CLOSE = 0.02  # gain in log-likelihood of two steps that ends the last fit
MOST = 0.05  # probability outside the region of values that are as likely

OTHER = (
    "Other values are as likely (log-likelihood lower by {:.1f}): {}. The intervals contain them; "
    "more starts from rest and reversals would decide."
)


def surest(whole: Fitted, before: Fitted, opened: Collection[str]) -> Fitted:
    """The best fit to the windows of ``whole`` from several starts, with others as likely.

    ``before`` is a fit to a part of the windows. Its noise is held at first: under a larger one
    the observer compensates wrong values. Starts over the decades of vs and Fs follow where the
    noise has grown or the fit hardly determines them. ``opened`` are the undeclared values, about
    which no prior is known.
    """
    if whole.noise.uneven:
        return whole
    start = replace(before, where=whole.where)
    held = _from(before.values, start=start, opened=opened)
    best = max(held, whole, key=lambda f: f.total)
    tried = [held, whole]
    if _uncertain(best, before):
        tried += beside(partial(_from, start=start, opened=opened), starts(start))
        best = max(tried, key=lambda f: f.total)
    best = _from(best.values, start=replace(start, noise=best.noise), opened=opened, most=0)
    others = _distinct(best, [f for f in tried if _as_likely(best, f)])
    return replace(best, others=tuple(others))


def starts(found: Fitted) -> list[dict[str, float]]:
    """The most likely of a grid over vs and Fs, with the other values and the noise as found."""
    keys = {c.key for c in found.free}
    Fc, vs = found.values.get("Fc"), found.values.get("vs")
    if not {"vs", "Fs"} & keys or not Fc or vs is None:
        return []
    fastest = found.predictor.data.log.fastest
    speeds = SPEEDS * fastest if "vs" in keys else [vs]
    levels = [Fc * (1.0 + e) for e in EXCESSES] if "Fs" in keys else [found.values["Fs"]]
    pairs = [{"vs": float(v), "Fs": float(F)} for v, F in product(speeds, levels)]
    model, free = found.predictor.model, found.free
    sets = [inside(free, found.values | pair, model) for pair in pairs]
    where = spread(found.where, ENOUGH, LEAST)
    white = whitened(found.predictor, sets, where, found.noise)
    totals = [
        float(np.nan_to_num(loglik(found.predictor, w, found.noise, v, where).sum(), nan=-np.inf))
        for w, v in zip(white, sets, strict=True)
    ]
    return [sets[i] for i in np.argsort(totals)[::-1][:TRIED]]


def other_optima(fitted: Fitted) -> list[str]:
    """A sentence for each other maximum that is as likely."""
    made, own = [], replace(fitted, others=()).intervals()
    for other in fitted.others:
        keys = [c.key for c in fitted.free if not _within(own, other, c.key)]
        shown = ", ".join(f"{k} = {other.values[k]:.3g}" for k in keys)
        made.append(OTHER.format(max(fitted.total - other.total, 0.0), shown))
    return made


def _from(
    values: dict[str, float],
    *,
    start: Fitted,
    opened: Collection[str],
    most: int = SHORT,
) -> Fitted:
    """The fit from some values; to the end if ``most`` is 0, else with the noise held at first."""
    free = [c.key for c in start.free] + list(start.instants)
    anchor = start.anchor | {k: values[k] for k in opened if k in values}
    options = {"most": most, "hold": True} if most else {"settled": CLOSE}
    return fit(start.predictor, values, free, start.where, start.noise, anchor=anchor, **options)


def _uncertain(best: Fitted, before: Fitted) -> bool:
    """True if the noise has grown, or the fit hardly determines Fs or vs."""
    if best.noise.jump > NOISIER * before.noise.jump:
        return True
    spread_ = np.sqrt(np.diag(best.covariance()))
    shape = [s for c, s in zip(best.free, spread_, strict=True) if c.key in ("Fs", "vs")]
    return any(WIDE < s < ANYWHERE**0.5 or not np.isfinite(s) for s in shape)


def _as_likely(best: Fitted, other: Fitted) -> bool:
    """True if the other values are inside the 95 % region by the likelihood ratio, even without
    the window that distinguishes most."""
    lost = best.loglik - other.loglik
    limit = 0.5 * float(chi2.ppf(1.0 - MOST, max(len(best.free), 1)))
    return bool(best.total - other.total < limit and lost.sum() - lost.max() < limit)


def _distinct(best: Fitted, others: Sequence[Fitted]) -> list[Fitted]:
    """Those with a value outside the intervals so far, best first."""
    made: list[Fitted] = []
    for other in sorted(others, key=lambda f: -f.total):
        whole = replace(best, others=tuple(made)).intervals()
        if not all(_within(whole, other, c.key) for c in best.free):
            made.append(other)
    return made


def _within(intervals: Mapping[str, tuple[float, float]], other: Fitted, key: str) -> bool:
    low, high = intervals.get(key, (-np.inf, np.inf))
    return low <= other.values[key] <= high

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

from ...engine.runtime.threads import beside
from ..dataset.windows import Windows, spread
from .likelihood import loglik, whitened
from .maximise import Fitted, fit
from .parameters import Coordinate, inside

SPEEDS = np.geomspace(3e-4, 0.1, 9)  # vs as a share of the largest speed
EXCESSES = (0.05, 0.1, 0.2, 0.35, 0.6, 1.0)  # of Fs over Fc, relative
ENOUGH, LEAST = 12_000, 12  # counted samples on which starts are compared, and least windows
TRIED = 3  # best starts that are followed, at most
SHORT = 8  # steps of a fit beside the best
NOISIER = 1.5  # times the noise before: above, another maximum may be better
WIDE = 0.3  # standard deviation of a logarithm, above which the likelihood is no parabola
BEYOND = (1.5, 2.25)  # half-widths at which Fs and vs are then held: that may be as likely
MOST = 0.05  # probability outside the region of values that are as likely

OTHER = (
    "Other values are as likely (log-likelihood lower by {:.1f}): {}. The intervals contain them; "
    "more starts from rest and reversals would decide."
)


def surest(before: Fitted, where: Windows, opened: Collection[str]) -> Fitted:
    """The best fit to other windows, with others as likely.

    ``before`` is a fit to a part of them. Its noise is held at first: under a larger one the
    observer compensates wrong values. Where the noise has grown or the fit hardly determines vs and
    Fs, more likely values over the decades of them are followed. ``opened`` are the undeclared
    values, about which no prior is known.
    """
    start = replace(before, where=where)
    tried = [_from(before.values, start=start, opened=opened)]
    if _uncertain(tried[0], before):
        tried += beside(partial(_from, start=start, opened=opened), starts(tried[0]))
    best = max(tried, key=lambda f: f.total)
    others = [f for f in [*tried, *_probed(best)] if f is not best and _as_likely(best, f)]
    return replace(best, others=tuple(_distinct(best, others)))


def with_others(found: Fitted) -> Fitted:
    """The same fit with values beside it that are as likely."""
    others = [f for f in _probed(found) if _as_likely(found, f)]
    return replace(found, others=tuple(_distinct(found, others)))


def starts(found: Fitted) -> list[dict[str, float]]:
    """The most likely of a grid over vs and Fs, with the other values and the noise as found.

    Only those that are more likely than the fit itself.
    """
    keys = {c.key for c in found.free}
    Fc, vs = found.values.get("Fc"), found.values.get("vs")
    if not {"vs", "Fs"} & keys or not Fc or vs is None:
        return []
    fastest = found.predictor.data.log.fastest
    speeds = SPEEDS * fastest if "vs" in keys else [vs]
    levels = [Fc * (1.0 + e) for e in EXCESSES] if "Fs" in keys else [found.values["Fs"]]
    pairs = [{"vs": float(v), "Fs": float(F)} for v, F in product(speeds, levels)]
    model, free = found.predictor.model, found.free
    sets = [found.values, *(inside(free, found.values | pair, model) for pair in pairs)]
    where = spread(found.where, ENOUGH, LEAST)
    white = whitened(found.predictor, sets, where, found.noise)
    totals = [
        float(np.nan_to_num(loglik(found.predictor, w, found.noise, v, where).sum(), nan=-np.inf))
        for w, v in zip(white, sets, strict=True)
    ]
    return [sets[i] for i in np.argsort(totals)[::-1][:TRIED] if totals[i] > totals[0]]


def other_optima(fitted: Fitted) -> list[str]:
    """A sentence for each other maximum that is as likely."""
    made, own = [], replace(fitted, others=()).intervals()
    for other in (o for o in fitted.others if len(o.free) == len(fitted.free)):
        keys = [c.key for c in fitted.free if not _within(own, other, c.key)]
        shown = ", ".join(f"{k} = {other.values[k]:.3g}" for k in keys)
        made.append(OTHER.format(max(fitted.total - other.total, 0.0), shown))
    return made


def _from(values: dict[str, float], *, start: Fitted, opened: Collection[str]) -> Fitted:
    """A fit from some values, with the noise held at first."""
    free, anchor = _keys(start), start.anchor | {k: values[k] for k in opened if k in values}
    return fit(
        start.predictor, values, free, start.where, start.noise, anchor=anchor, hold=True
    )  # fmt: skip


def _keys(found: Fitted) -> list[str]:
    return [c.key for c in found.free] + list(found.instants)


def _probed(best: Fitted) -> list[Fitted]:
    """Fits with Fs, or vs, held beyond its interval: where the likelihood is no parabola, they
    may be as likely."""
    ends, made = best.intervals(), []
    for c in _shapes(best):
        low, high = ends.get(c.key, (0.0, 0.0))
        for end in (low, high) if c.key == "vs" else (high,):
            made += _outward(best, c, end) if end > 0.0 else []
    return made


def _outward(best: Fitted, c: Coordinate, end: float) -> list[Fitted]:
    """Fits with one value held ever farther from the best, up to where they are less likely."""
    made: list[Fitted] = []
    for far in BEYOND[: 1 if c.key == "vs" else None]:
        other = _with_held(best, c, end, far)
        if not _as_likely(best, other):
            middle = 0.5 * (far + far / BEYOND[0])
            return [*made, _with_held(best, c, end, middle)] if c.key == "Fs" else made
        made.append(other)
    return made


def _with_held(best: Fitted, c: Coordinate, end: float, far: float) -> Fitted:
    """The fit with one value held, ``far`` times as far from the best as an end of its interval."""
    x = c.into(best.values)
    at = c.whole().back(x + far * (c.into(best.values | {c.key: end}) - x), best.values)
    free = [k for k in _keys(best) if k != c.key]
    return fit(
        best.predictor, best.values | {c.key: at}, free, best.where, best.noise,
        anchor=best.anchor | {c.key: at}, most=SHORT, rough=True,
    )  # fmt: skip


def _shapes(found: Fitted) -> list[Coordinate]:
    """The coordinates of Fs and vs, where the fit hardly determines them."""
    sizes = np.sqrt(np.diag(found.covariance()))
    return [
        c
        for c, s in zip(found.free, sizes, strict=True)
        if c.key in ("Fs", "vs") and c.kind in ("log", "excess") and s > WIDE
    ]


def _uncertain(best: Fitted, before: Fitted) -> bool:
    """True if the noise has grown, or the fit hardly determines Fs or vs."""
    if best.noise.jump > NOISIER * before.noise.jump:
        return True
    return bool(_shapes(best))


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

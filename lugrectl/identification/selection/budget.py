"""The torque budget: where the torque of a record goes, and the smallest effect it would show."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from scipy import stats

from ...blocks.block import REGISTRY
from ..candidates.base_model import LEVELS, SLIGHT, WEIGHT, Base, rms
from ..candidates.candidate import Contender
from ..candidates.friction_terms import FORCES, NAMES, SMEAR, VISCOUS
from ..regression.numbers import ALPHA, FEWEST_PARTS, POWER
from ..regression.score import moves
from .comparison import Detectable, Share
from .table import Table
from .values import Valued

TWO_SIDED = 0.975
VALUES = {"inertia": "J", "coulomb": "Fc", "viscous": "Fv"}
ALIKE = 0.03  # of the largest singular value: columns that the record hardly tells apart
LARGE = 0.1  # of friction: a torque that is not explained and may bias the terms ...
CLEAR = 4.0  # ... if it is so many times the noise


def budget(
    base: Base, parts: Sequence[Contender], unknown: Contender | None, own: Valued
) -> list[Share]:
    """Each term with its RMS in the windows, as a share of friction, largest first.

    ``parts`` are the named effects in ``base``, in the order in which they joined; ``unknown`` is
    an unknown torque beside them. What is left is what the fit with all of them leaves; the noise
    is a part of it. Where a large torque is not explained, there are no intervals: a part of it may
    look like a term, which no spread over blocks shows. Few blocks have no spread either. No share
    is surer than its value in ``own``: the torque of Coulomb friction may be viscous as well.
    """
    V = _covariance(base)
    made = [_as_sure(_share(base, V, *term), own) for term in _terms(base, parts)]
    made += [_of_torque(base, c) for c in parts if not c.own]
    if unknown is not None:
        signals = tuple(sorted(unknown.depends_on))
        made.append(_plainly(base, "unknown torque", unknown.torque, signals))
    made.sort(key=lambda s: -s.rms)
    rest = base.made.r if unknown is None else unknown.made.r
    left = _plainly(base, "left", rest * base.view.scale.sigma, ())
    noise = _noise(base)
    few = base.record.independent < FEWEST_PARTS
    if few or unknown is not None or left.share > max(LARGE, CLEAR * noise.share):
        made = [replace(s, ci95=None) for s in made]
    return [*made, left, min(noise, replace(left, term="noise"), key=lambda s: s.rms)]


def _terms(
    base: Base, parts: Sequence[Contender]
) -> Iterator[tuple[str, np.ndarray, list[int], tuple[str, ...]]]:
    """The columns of each term of the base, those of the coefficients that they belong to, and the
    signals on which its torque depends."""
    X = base.columns.X

    def plainly(name: str, at: list[int], on: str) -> tuple[str, np.ndarray, list[int], tuple]:
        return name, X[:, at], at, (on,)

    yield plainly("inertia", [0], "a")
    yield from _friction(base)
    yield plainly("offset and unbalance", SLIGHT, "theta")
    if base.gravity:
        yield plainly("gravity", [WEIGHT, WEIGHT + 1], "theta")
    end = X.shape[1]
    for c in reversed(parts):
        if c.own:
            at = [*range(end - c.own, end)]
            yield c.name, X[:, at], at, _signals(c.name)
            end -= c.own


def _friction(base: Base) -> Iterator[tuple[str, np.ndarray, list[int], tuple[str, ...]]]:
    """Coulomb friction with its Stribeck curve, and the rest of what depends on speed.

    Many shapes share the torque among them; coulomb is the level in the closest curve of one level,
    one Stribeck curve and one viscous term. At one speed these are alike, and share it evenly.
    """
    at = {name: LEVELS.start + i for i, name in enumerate(NAMES)}
    own, smear = [at[k] for k in (*FORCES, *VISCOUS)], [at[k] for k in SMEAR]
    X = base.columns.X
    curve = X[:, [at[k] for k in ("Fc", "dip", "Fv")]]
    size = np.linalg.norm(curve, axis=0) + 1e-300
    closest = np.linalg.lstsq(curve / size, X[:, own], rcond=ALIKE)[0]
    level = curve[:, :2] / size[:2] @ closest[:2]
    yield "coulomb", np.hstack([level, X[:, smear]]), own + smear, ("w",)
    yield "viscous", X[:, own] - level, own, ("w",)


def _signals(name: str) -> tuple[str, ...]:
    block = REGISTRY["effect", name]
    level = {"Fc", "Fs", "Fv", "+Fc"} & set(block.acts)
    own = [k for k in ("t", *block.inputs) if k != "t" or block.timed]
    return tuple(dict.fromkeys([*own, *(["w"] if level else [])]))


def _covariance(base: Base) -> np.ndarray:
    """Of the coefficients, from how they move when a block is left out; 0 where held."""
    c, made = base.columns, base.made
    d = moves(made, c.X, c.prior, base.view.scale, base.record.blocks)
    V = np.zeros((len(made.b), len(made.b)))
    d = d - d.mean(axis=0)
    free = np.flatnonzero(made.free)
    V[free[:, None], free] = (len(d) - 1) / len(d) * d.T @ d
    return V


def _share(
    base: Base, V: np.ndarray, name: str, X: np.ndarray, at: list[int], signals: tuple[str, ...]
) -> Share:
    torque = X @ base.made.b[at]
    size = rms(torque)
    slope = X.T @ torque / (len(torque) * max(size, 1e-300))
    half = stats.norm.ppf(TWO_SIDED) * float(np.sqrt(max(slope @ V[np.ix_(at, at)] @ slope, 0.0)))
    ends = float(max(size - half, 0.0)), float(size + half)
    friction = base.friction_rms
    return Share(name, size, size / friction, (ends[0] / friction, ends[1] / friction), signals)


def _as_sure(share: Share, own: Valued) -> Share:
    """With an interval no narrower than that of the value it is made of; none where that may be 0.

    An effect has its strength, another term its parameter.
    """
    effect = REGISTRY.get(("effect", share.term))
    key = VALUES.get(share.term) if effect is None else f"{share.term}.{effect.gain}"
    if share.ci95 is None or key is None or key not in own.values or not share.share:
        return share
    half = own.half(key)
    if half is None or half > abs(own.values[key]):
        return replace(share, ci95=None)
    half = max(half / abs(own.values[key]) * share.share, 0.5 * (share.ci95[1] - share.ci95[0]))
    return replace(share, ci95=(max(share.share - half, 0.0), share.share + half))


def _of_torque(base: Base, c: Contender) -> Share:
    return _plainly(base, c.name, c.torque, _signals(c.name))


def _plainly(base: Base, name: str, torque: np.ndarray, signals: tuple[str, ...]) -> Share:
    return Share(name, rms(torque), rms(torque) / base.friction_rms, None, signals)


def _noise(base: Base) -> Share:
    """What the noise of the sensors makes of J a in the windows."""
    return Share("noise", base.noise * base.friction_rms, base.noise, None, ())


def detectable(table: Table, least: float) -> list[Detectable]:
    """The smallest share of friction at which each effect would have been seen, 80 % power.

    (z_alpha/K + z_0.8) standard errors of its strength, with K contenders; at least ``least``,
    below which nothing is named.
    """
    many = max(len(table.named), 1)
    z = float(stats.norm.ppf(1 - ALPHA / many / 2) + stats.norm.ppf(POWER))
    found = [Detectable(c.name, max(least, z * _error(c))) for c in table.named]
    return sorted(found, key=lambda d: d.share)


def _error(c: Contender) -> float:
    """Standard error of its strength, as a share of friction."""
    base = c.base
    if not c.own:  # its torque is known as well as the windows allow
        return base.view.scale.sigma / np.sqrt(len(base.y)) / base.friction_rms
    columns, made = c.columns, c.made
    d = moves(made, columns.X, columns.prior, base.view.scale, base.record.blocks)
    own = d[:, -int(made.free[-c.own :].sum()) or len(made.b) :]
    if not made.free[-c.own :].any():
        return base.view.scale.sigma / np.sqrt(len(base.y)) / base.friction_rms
    X = c.its.X[:, made.free[-c.own :]]
    B = base.columns.X[:, base.made.free]
    X = X - B @ np.linalg.lstsq(B, X, rcond=None)[0]
    spread = (own - own.mean(axis=0)) @ X.T  # of the torque, for each block left out
    return float(np.sqrt(np.sum(np.mean(spread**2, axis=1)))) / base.friction_rms

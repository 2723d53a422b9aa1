"""What a map of runs at steady speeds has beside any other answer: points, curves, ripples."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np
from scipy import signal, stats

from ..blocks.block import members, unit_for
from ..core.errors import InputError
from ..estimates.findings import Candidate, Estimate, Finding, FrictionMap
from ..estimates.fitted import Fitted
from ..record import Stretch, stretches
from ..torque_balance.constants import FLOOR
from ..torque_balance.last_fit import Design, LastFit
from ..torque_balance.maps import MapView, Nodes, Run, is_map
from ..torque_balance.verdict import Answer
from .asked import Asked
from .result import Diagnosis
from .simulation import Span

FINE = 400  # speeds at which the curves are drawn
LEAST_TURNS = 2.0  # of a run, so that orders half an order apart are separated
HIGHEST = 8  # order of a turn that is examined
LEAST_RUNS = 3  # that turn so far
CHANCE = 0.01  # probability that any order is named although there is no ripple
MAP = "{} runs at steady speeds were taken as one map of torque over speed; they do not tell {}."
SWINGS = (
    "The torque varies with the angle: {} of friction. Its phase in the runs is unknown, so it is "
    "not part of the model."
)
SLOWER = "Record runs slower than {:.3g} {}, too: there friction may fall over the speed."
NOT_STEADY = "{} is not at a steady speed like the other runs; hold out one that is, or none."
LOG_ANGLE = (
    "To distinguish {} from {}: log theta from one zero mark in every run, over slow turns in both "
    "directions."
)
Found = TypeVar("Found", bound=Fitted)
Swing = tuple[int, Estimate]


def judged_on(asked: Asked, held_out: Sequence[Span]) -> tuple[list[Stretch], list[Span]]:
    """All stretches, and (run, start, end) in s that are held out: of a map every third run."""
    parts, other = list(asked.stretches), asked.holdout()
    if not is_map(parts) or other is None:
        return parts, list(held_out)
    if isinstance(other, str):
        ends = [[s.t[[0, -1]] for s in parts if s.run == run] for run in range(len(asked.logs))]
        return parts, [(i, float(np.mean([x[0][0], x[-1][1]])), np.inf) for i, x in enumerate(ends)]
    run, log = len(asked.logs), other.log
    assert log is not None
    added = [replace(s, run=run) for s in stretches([log])[0]]
    if not is_map([*parts, *added]):
        raise InputError(NOT_STEADY.format(other.source))
    return [*parts, *added], [(run, -np.inf, np.inf)]


def of_map(found: Found, made: Answer, asked: Asked) -> Found:
    """An answer, of a diagnosis or an identification, with what only a map has."""
    model, motion = asked.model, asked.model.motion
    view = made.view
    assert isinstance(view, MapView) and found.model
    swing, error = swings(asked.stretches, unit_for("N m", motion)), torque_errors(made)
    known = {k: e for k, e in found.estimates.items() if e.ci95 is not None or e.held}
    silent = [k for k, p in model.declarations().items() if p.fitted and k not in known]
    values = {k: x for k, x in model.values().items() if k in silent}
    if Fs := values.get("Fs"):  # a declared one stays, but not below Fc
        values["Fs"] = max(Fs, found.model.known()["Fc"])
    fields: dict[str, Any] = {
        "error": error | _facts(view, made, error),
        "estimates": known,
        "map": friction_map(made, motion, swing),
        "model": found.model.with_values(values),
        "messages": (*found.messages, *_said(made, asked, silent, swing)),
    }
    if not isinstance(found, Diagnosis):
        del fields["error"]["augmented"]
        return replace(found, **fields)
    if "vs" in silent and found.experiment is None:
        slow = float(np.abs(view.motion.w).min())
        fields["experiment"] = SLOWER.format(slow, unit_for("rad/s", motion))
    fields["torque_error"] = error
    fields["free_error"] = error | {"signal": "u", "in_sample": False}
    fields["depends_on"] = tuple(s for s in found.depends_on if s != "t")
    return _swung(replace(found, **fields), made, swing)


def _said(
    made: Answer, asked: Asked, silent: Sequence[str], swing: Sequence[Swing]
) -> Iterator[str]:
    """What the map does not tell, and what varies with angle."""
    view = made.view
    hidden = [p.key for p in asked.model.effects if p not in view.model.effects]
    unknown = [k for k in silent if k.rpartition(".")[0] not in hidden] + hidden
    yield MAP.format(len(np.unique(view.motion.run)), ", ".join(unknown) or "J")
    if swing and not any("theta" in t.block.inputs for t in made.last.state.terms):
        share = 100.0 / view.size
        orders = [f"{n} times per turn by {share * e.value:.2g} %" for n, e in swing]
        yield SWINGS.format(", ".join(orders))


def torque_errors(made: Answer) -> dict[str, Any]:
    own = made.declared_error, made.without.error, made.with_names.error
    both = zip(("declared", "refitted", "augmented"), own, strict=True)
    return {"unit": unit_for("N m", made.view.model.motion), **dict(both)}


def _facts(view: MapView, made: Answer, error: Mapping[str, Any]) -> dict[str, Any]:
    """What else is said of errors of means over stretches of the held-out runs."""
    m, known = view.motion, [x for x in error.values() if isinstance(x, float)]
    test = np.isin(m.row, np.flatnonzero(made.split.test))
    return {
        "signal": "u",
        "samples": int(m.size[test].sum()),
        "horizon": float(np.median([np.ptp(m.stamp[m.run == run]) for run in np.unique(m.run)])),
        "noise_floor": min([view.scatter(made.last.left), *known]),
    }


def friction_map(made: Answer, motion: str, swing: Sequence[Swing] = ()) -> FrictionMap:
    """The mean torque of each run without what depends on the angle, and the fits' curves."""
    view, d = made.view, made.last.design
    assert isinstance(view, MapView)
    over_angle = ~_of_speed(d)
    y = d.y - d.X[:, over_angle] @ made.last.fit.b[over_angle]
    test = made.split.test
    part = np.unique(2 * view.apart + test, return_inverse=True)[1]  # of a run, held out or not
    many = np.bincount(part)
    u, square, w, held_out = (
        np.bincount(part, x) / many for x in (y, y**2, view.motion.w[view.rows.at], 1.0 * test)
    )
    error = np.sqrt(np.maximum(square - u**2, 0.0) / np.maximum(many - 1, 1))
    half = np.linspace(np.abs(w).min(), np.abs(w).max(), FINE // 2)
    at = np.concatenate([-half[::-1], half])
    fits = {"refitted": made.refitted, "augmented": made.trained}
    curves = {name: _curve(last, at) for name, last in fits.items()}
    return FrictionMap(w, u, error, held_out > 0.5, at, curves, motion, tuple(swing))


def _of_speed(design: Design) -> np.ndarray:
    """Which columns depend on the speed alone, or on nothing."""
    terms = design.state.terms
    return np.array([n != "~" if isinstance(n, str) else "theta" not in terms[n[0]].block.inputs
                     for n in design.names])  # fmt: skip


def _curve(last: LastFit, w: np.ndarray) -> np.ndarray:
    """Torque (n,) at other speeds (n,), without what depends on the angle."""
    view, one = last.view, np.ones(1)
    runs = [Run(i, float(x), 0.0, one, one, 0 * one, 0 * one, one, np.zeros(1, int))
            for i, x in enumerate(w)]  # fmt: skip
    other = MapView(Nodes(runs, True), view.model)
    other.x0, other.vs, other.force = view.x0, view.vs, view.force
    d, b = Design(other, last.state.copy()), dict(zip(last.design.names, last.fit.b, strict=True))
    return d.X @ np.where(_of_speed(d), [b.get(n, 0.0) for n in d.names], 0.0)


# The ripple over an angle of which each run has its own zero


def swings(parts: Sequence[Stretch], unit: str) -> list[Swing]:
    """The orders of a turn at which the torque swings, largest first, with amplitudes: those whose
    power exceeds that of half an order beside it on either side by more than chance allows,
    whatever the colour of the noise (F tests of the runs, joined as Fisher does)."""
    orders, power = np.arange(1.0, 2 * HIGHEST + 2) / 2.0, []
    for s in parts:
        theta = s.theta
        if theta is None:
            assert s.w is not None
            theta = np.cumsum(s.w) * s.dt
        if np.ptp(theta) >= 2 * np.pi * LEAST_TURNS:
            u = signal.detrend(s.u) * np.hanning(len(s.u)) * 2.0
            power.append(np.abs(2.0 * np.exp(-1j * np.outer(orders, theta)) @ u / len(u)) ** 2)
    many = len(power)
    if many < LEAST_RUNS:
        return []
    every = np.array(power)  # (runs, half orders from 1/2 on)
    own, beside = every[:, 1::2], 0.5 * (every[:, :-1:2] + every[:, 2::2])
    chance = -4.0 * np.sum(np.log1p(-own / (own + 2.0 * beside)), axis=0)
    there = np.flatnonzero(stats.chi2.sf(chance, 2 * many) <= CHANCE / HIGHEST)
    excess = own - beside
    mean, half = excess.mean(axis=0), stats.sem(excess) * stats.t.ppf(0.975, many - 1)
    size = np.sqrt(np.maximum([mean, mean - half, mean + half], 0.0))[:, there].T.tolist()
    found = [
        (i + 1, Estimate(a, unit, (b, c)))
        for i, (a, b, c) in zip(there.tolist(), size, strict=True)
    ]
    return sorted(found, key=lambda one: -one[1].value)


def _swung(found: Diagnosis, made: Answer, swing: Sequence[Swing]) -> Diagnosis:
    """A ripple that is the largest part of what is missing is named by what can cause it: a map
    does not tell its causes apart, nor its phase."""
    shares = [made.last.share(i) for i, t in enumerate(made.last.state.terms) if not t.declared]
    size = swing[0][1].value / np.sqrt(2.0) / made.view.size if swing else 0.0
    known = {*found.depends_on}.union(*(t.block.inputs for t in made.view.terms))
    if found.verdict == "unexplained" or "theta" in known or size < max([FLOOR, *shares]):
        return found
    order, amplitude = swing[0]
    name = "gravity" if order == 1 else "torque_ripple"
    others = [n for n, b in members("effect").items() if not {"J", "torque"} & {*b.acts}
              and any(p.whole and p.low <= order <= p.high for p in b.own.values())]  # fmt: skip
    own = {"amplitude": amplitude}
    own |= {} if order == 1 else {"harmonic": Estimate(float(order), "1/rev")}
    finding = Finding(name, own, tuple(Candidate(n, 0.0, 0.0) for n in others))
    return replace(
        found,
        verdict="ambiguous",
        effects=(*found.effects, finding),
        experiment=LOG_ANGLE.format(name, " or ".join(others)),
        depends_on=(*found.depends_on, "theta"),
    )

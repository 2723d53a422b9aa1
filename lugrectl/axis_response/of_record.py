"""From a log and a model to the frequency response of the axis."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import control as ct
import numpy as np

from ..blocks.model import Model, as_model
from ..core.errors import InputError, Refused
from ..core.provenance import stamped
from ..record import Record, pooled, record_of, refuse_dead
from ..record.as_record import as_logs
from .effects import known_effects
from .estimate import HIGHEST, LOWEST, Estimate, estimate
from .local_response import Response
from .modes import FEWEST, Mode
from .result import BAD, CERTAIN, FEW, GOOD, RECORD, THIN, FrequencyResponse, unwrapped
from .runs import Run, runs_of

SLOW = 10.0  # Hz below which friction is looked for
NEAR, TENTH = 0.4, 0.1  # so near a mode's frequency so many points must be certain
VAGUE = 0.1  # of its value: a mode or an inertia less certain than that is not given
LEAST_RANGE = 0.5  # decades of frequency
NOWHERE = (
    "the response is certain at no frequency from {:.3g} to {:.3g} Hz: the torque explains at most "
    "{:.0%} of the speed about {:.3g} Hz, and it must be 95 %. The log excites the axis too little "
    "there, or something else moves it."
)
NONE = "No dry friction shows clearly in the log: nothing is taken out."
ONE_WAY = "The axis never reverses: friction is a constant torque there, and nothing is taken out."


@stamped("lugrectl.frequency_response")
def frequency_response(
    record: Any,
    model: Any,
    *,
    columns: Mapping[str, str] | str | None = None,
    units: Mapping[str, str] | str | None = None,
    scale: Mapping[str, float] | str | None = None,
    rate: float | None = None,
) -> FrequencyResponse:
    """The frequency response of an axis from an ordinary log, with friction taken out.

        U(k) = W(k)/P(k) + T(k) + a(k) F(k)

    U and W are the spectra of torque and motor speed, F that of friction along the measured
    motion, T transients. Friction is fitted together with 1/P, without a model of the mechanics;
    then P is estimated from torque less friction to speed.

    Parameters
    ----------
    record : path, DataFrame, dict of arrays or Record, or a list of them
        Runs of one axis, in open or closed loop, that reverse. A reference r, of position or
        speed, serves as instrument: noise in the loop does not bias the response then.
    model : Model, Parameters, dict or path
        The declared model. The level of friction is fitted; a law without dry friction
        ("viscous") takes none out. Its other effects are taken out with their values.
    columns, units, scale, rate : optional
        How to read a log, as for :func:`lugrectl.read_record`.

    Returns
    -------
    FrequencyResponse
        ``frd`` from torque (N m, or N) to speed (rad/s, or m/s), from 30 periods of the log to 0.4
        of half the sampling rate; ``low``, ``high``, ``coherence``, ``modes``, ``plot()``.

    Raises
    ------
    InputError
        When an argument cannot be meant, or a file cannot be read or understood.
    Refused
        When the log is too short, shows no motion, or makes the response certain nowhere.

    Notes
    -----
    Viscous friction is linear and stays in P, and so do dead time, current lag and the hold of the
    torque. The motion must be that of the motor: behind an elastic coupling a resonance comes
    without its antiresonance. Coherence does not show friction where the excitation is periodic;
    ``correction`` does, and where it is above 2 dB no band holds: these points are ``governed``,
    and the fitted mechanics, its modes and the gains of :func:`tune` follow from the others.

    References
    ----------
    R. Pintelon and J. Schoukens, System Identification: A Frequency Domain Approach, 2nd ed.,
    Wiley 2012, ch. 7 (local polynomials, instruments).

    Examples
    --------
    A rigid axis of 0.02 kg m2 with 0.3 N m of Coulomb friction, moved to and fro:

    >>> t, rng = 2e-3 * np.arange(8000), np.random.default_rng(0)
    >>> w = 10.0 * np.sin(20.0 * t) + np.convolve(rng.normal(0.0, 2.0, 8000), np.ones(5), "same")
    >>> u = 0.02 * np.gradient(w, t) + 0.3 * np.sign(w)
    >>> found = lg.frequency_response({"t": t, "u": u, "w": w}, lg.Model.of(friction="coulomb"))
    >>> found.trusted, round(found.friction["Fc"], 1)
    (True, 0.3)
    """
    made = as_model(model)
    logs = as_logs(record, made.motion, columns=columns, units=units, scale=scale, rate=rate)
    records = pooled([record_of(log, alone=len(logs) == 1) for log in logs])
    refuse_dead(records)
    _refuse_unlike(records)
    runs = runs_of(records)
    _refuse_short(runs)
    known = known_effects(runs, made)
    reverses = any(len(run.strokes[1]) > 1 for run in runs)
    dry = "Fc" in made.friction.values
    found = estimate(known, dry and reverses)
    _refuse_uncertain(found.response)
    said = [*known.said, *(message for one in records for message in one.messages)]
    return _result(found, runs, made, [*_verdict(found, dry), *said])


def _refuse_unlike(records: Sequence[Record]) -> None:
    steps = [record.dt for record in records]
    if max(steps) > 1.001 * min(steps):
        rates = ", ".join(f"{record.source} {record.rate:g} Hz" for record in records)
        raise InputError(f"runs of one sampling rate are averaged, but there is {rates}.")


def _refuse_short(runs: Sequence[Run]) -> None:
    longest = max(runs, key=lambda run: len(run.u))
    low, high = LOWEST / (len(longest.u) * longest.dt), 0.5 * HIGHEST / longest.dt
    if high < low * 10**LEAST_RANGE:
        raise Refused(
            f"the longest stretch has {len(longest.u)} samples: its response would reach from "
            f"{low:.3g} to {high:.3g} Hz only; record longer or faster.",
            RECORD,
        )


def _refuse_uncertain(r: Response) -> None:
    best = int(np.argmax(r.coherence))
    if r.coherence[best] < CERTAIN:
        f = r.w / (2.0 * np.pi)
        raise Refused(NOWHERE.format(f[0], f[-1], float(r.coherence[best]), f[best]), RECORD)


def _verdict(found: Estimate, dry: bool) -> list[str]:
    """What friction does to the response, how much of it is certain, and what to record."""
    correction, below = _correction(found)
    sure, bad = _certain(found), found.governed
    f, few = found.response.w[bad] / (2.0 * np.pi), sure.mean() < FEW
    taken = found.friction is not None and found.friction.levels
    made = [GOOD.format(below, correction)] if taken and not len(f) else []
    made += [BAD.format(len(f), len(bad), f[0], f[-1])] if len(f) else []
    made += [] if taken or not dry else [ONE_WAY if found.friction is None else NONE]
    made += [THIN.format(sure.sum(), len(sure))] if few else []
    return [*made, *([RECORD] if len(f) or few else [])]


def _result(
    found: Estimate, runs: Sequence[Run], model: Model, said: Sequence[str]
) -> FrequencyResponse:
    r, dt = found.response, runs[0].dt
    sure, size = _certain(found), np.abs(r.P)
    mechanics = found.mechanics if sure.sum() >= FEWEST else None
    modes = () if mechanics is None else mechanics.modes()
    inertia = None if mechanics is None else mechanics.inertia
    known = inertia is not None and _narrow(inertia[1])
    return FrequencyResponse(
        frd=ct.FrequencyResponseData(r.P, r.w, dt),
        raw=ct.FrequencyResponseData(found.raw.P, r.w, dt),
        unwrapped=unwrapped(r.w, r.P, r.coherence >= CERTAIN),
        low=np.where(sure, np.maximum(size - r.radius, 0.0), np.nan),
        high=np.where(sure, size + r.radius, np.nan),
        coherence=r.coherence,
        correction=_correction(found)[0],
        governed=found.governed,
        modes=tuple(mode for mode in modes if _seen(mode, r.w, sure)),
        inertia=inertia[0] if inertia and known else None,
        inertia_ci95=inertia[1] if inertia and known else None,
        friction={} if found.friction is None else found.friction.levels,
        reference=runs[0].E is not None,
        motion=model.motion,
        messages=tuple(dict.fromkeys(said)),
        mechanics=mechanics,
    )


def _certain(found: Estimate) -> np.ndarray:
    return (found.response.coherence >= CERTAIN) & ~found.governed


def _correction(found: Estimate) -> tuple[float, float]:
    """By how many dB friction changes the response at low frequencies, and below how many Hz."""
    w = found.response.w
    top = max(2.0 * np.pi * SLOW, 3.0 * float(w[0]))
    low = w < top
    change = 20.0 * np.log10(np.abs(found.raw.P[low] / found.response.P[low]))
    return float(np.median(np.abs(change))), top / (2.0 * np.pi)


def _seen(mode: Mode, w: np.ndarray, sure: np.ndarray) -> bool:
    """Whether its frequency is known, and some points about it are certain: in an antiresonance,
    where the axis hardly moves, few are."""
    near = np.abs(np.log(w / mode.frequency)) < NEAR
    return _narrow(mode.ci95) and bool(np.mean(sure[near]) >= TENTH)


def _narrow(ci95: tuple[float, float]) -> bool:
    return ci95[1] <= (1.0 + VAGUE) ** 2 * ci95[0]

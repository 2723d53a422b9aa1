"""The source paper recomputed: its two figures, and further studies."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import replace
from typing import Any

import control as ct
import numpy as np

from ..blocks.model import Parameters, table1
from ..core.errors import InputError
from ..core.progress import Wanted, reporter, shows_progress
from ..linear import bandwidth_check, position_loop_tf, velocity_loop_tf
from . import studies
from .bench import Bench, Trace, rms, run
from .claims import claims
from .results import Growth, PaperFigure, Reproduction
from .setting import Case, Compensation, Measure, Reference, Study
from .widths import same_width, same_width_spr, widths

FIGURES = ("velocity", "position")
PI_NOTES = (
    "With exact parameters the natural and the proposed observer cancel friction completely; the "
    "remaining frictionless loop is unstable and its oscillation grows. With the existing observer "
    "it grows more slowly (k = 0.35, and k = 5 from the unfiltered step) or becomes a lasting "
    "oscillation. If the estimate is too small (-20 %), the remaining friction stabilises the "
    "loop; if it is too large (+20 %), the oscillation grows faster. Without an observer friction "
    "holds the drive at rest.",
)
FIRST = Measure("e", "rad", (1.0, 5.0))


def all_studies(p: Parameters) -> tuple[Study, ...]:
    """Every study, in the order of the page."""
    pid, pd = same_width(p), same_width_spr(p)
    return (
        studies.mismatch("friction-level", "Fc", "Fs"),
        studies.mismatch("stiffness", "sigma0"),
        studies.forward(),
        studies.initial(),
        studies.standstill(),
        studies.overcompensation(),
        studies.position(
            "position-pi",
            "The paper's position PI over 100 s",
            "the paper's PI",
            studies.POSITION,
            PI_NOTES,
        ),
        studies.position("position-pid", "Stable PID of the same bandwidth over 100 s", "PID", pid),
        studies.position(
            "position-pd", "Stable PD of the same bandwidth, T(s) SPR, over 100 s", "PD", pd
        ),
        studies.position_mismatch("PID", pid),
    )


@shows_progress
def reproduce(
    *,
    only: Collection[str] | None = None,
    progress: Wanted = None,
) -> Reproduction:
    """Recompute the source paper's numbers and figures, and cases that it does not show.

    Parameters
    ----------
    only : collection of str, optional
        Keys of studies and figures ("velocity", "position") to run; default: all.
    progress : callable, True, False or None
        ``progress(fraction, what)``, or whether to show a bar. None: in Jupyter only.

    Raises
    ------
    InputError
        For an unknown key.
    """
    p, report = table1(), reporter(progress)
    chosen = _chosen(all_studies(p), only)
    total = sum(len(s.cases) * len(s.compensations) for s in chosen) or 1
    done = 0

    def tick(what: str) -> None:
        nonlocal done
        done += 1
        report(min(done / total, 1.0), what)

    bench = Bench(p)
    makers = {"velocity": velocity_figure, "position": position_figure}
    figures = [make(bench) for key, make in makers.items() if only is None or key in only]
    outcomes = tuple(run(bench, study, tick) for study in chosen)
    wanted = only is None or "position-pi" in only
    grown = growth(bench) if wanted else None
    made = Reproduction(p, widths(p), tuple(figures), grown, outcomes)
    return replace(made, claims=claims(made))


def _chosen(known: tuple[Study, ...], only: Collection[str] | None) -> list[Study]:
    keys = [s.key for s in known]
    strange = sorted(set(only or ()) - {*keys, *FIGURES})
    if strange:
        raise InputError(f"unknown study '{strange[0]}'; known: {', '.join([*FIGURES, *keys])}.")
    return [s for s in known if only is None or s.key in only]


def _ideal(p: Parameters, loop: str, gains: Mapping[str, float], t: Any, r: Any) -> np.ndarray:
    """The loop without friction, by python-control's linear simulation."""
    make = velocity_loop_tf if loop == "velocity" else position_loop_tf
    return np.asarray(ct.forced_response(make(p, **gains), t, r).outputs)


def velocity_figure(bench: Bench) -> PaperFigure:
    """PI without friction, with friction, and with the proposed observer."""
    case = Case("", studies.SINE, (studies.MOVING,), duration=3.0)
    text = (
        f"{studies.VELOCITY_TEXT}, no feed-forward, no prefilter, {studies.SINE_TEXT} (the text "
        "of the paper gives no reference: this one is chosen here), observer parameters exact, "
        "all states 0 at the start."
    )
    return _figure(bench, "velocity", text, studies.VELOCITY, case, "w", "rad/s", (1.0, 3.0))


def position_figure(bench: Bench) -> PaperFigure:
    """The same for the position loop with the prefilter 2/(s + 2), over the first seconds."""
    case = Case("", Reference("step", 1.0, prefilter=True), (FIRST,))
    text = (
        "Position loop, Kp 15, Ki 1.55, prefilter 2/(s + 2), no feed-forward, reference a step of "
        "1 rad (the text of the paper gives no reference: this one is chosen here), observer "
        "parameters exact, all states 0 at the start."
    )
    return _figure(bench, "position", text, studies.POSITION, case, "theta", "rad", (1.0, 5.0))


def _figure(
    bench: Bench,
    loop: str,
    text: str,
    gains: Mapping[str, float],
    case: Case,
    signal: str,
    unit: str,
    window: tuple[float, float],
) -> PaperFigure:
    none, proposed = studies.OBSERVERS[0], studies.OBSERVERS[-1]
    t, with_friction = bench.respond(loop, gains, none, case)
    _, compensated = bench.respond(loop, gains, proposed, case)
    r = case.reference.inputs(t, loop, False)[0]
    drawn = {
        "no friction": _ideal(bench.p, loop, gains, t, r),
        "friction, no observer": with_friction[signal],
        f"friction, {proposed.label}": compensated[signal],
    }
    errors = {name: rms(t, y - r, window) for name, y in drawn.items()}
    traces = tuple(Trace(name, t, y) for name, y in drawn.items())
    return PaperFigure(loop, text, unit, window, Trace("reference", t, r), traces, errors)


def growth(bench: Bench, observer: Compensation = studies.OBSERVERS[-1]) -> Growth:
    """Time constant of the paper's position PI with exact compensation: pole and simulation."""
    poles = bandwidth_check(position_loop_tf(bench.p, **studies.POSITION)).poles
    case = Case(
        "",
        Reference("step", 1.0, prefilter=True),
        (FIRST,),
        duration=100.0,
        dt=2e-3,
    )
    window = (40.0, 100.0)
    t, y = bench.respond("position", studies.POSITION, observer, case)
    simulated = envelope_time_constant(t, y["e"], window)
    return Growth(1 / poles[0].real, simulated, observer.label, window)


def envelope_time_constant(t: np.ndarray, y: np.ndarray, window: tuple[float, float]) -> float:
    """Time constant in s of the growth of max |y|, fitted to the peaks in bins of one second.

    For growth that is slow compared with the oscillation; negative if |y| decays.
    """
    edges = np.arange(window[0], window[1] + 0.5)
    starts = np.searchsorted(t, edges)
    pieces = [np.abs(y[a:b]) for a, b in zip(starts, starts[1:], strict=False)]
    times = [t[a + np.argmax(piece)] for a, piece in zip(starts, pieces, strict=False)]
    slope = np.polyfit(times, np.log([piece.max() for piece in pieces]), 1)[0]
    return float(1 / slope)

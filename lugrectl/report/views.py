"""The arrays behind the plots of a diagnosis: the stretch to show, errors, residuals."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..blocks.block import Block, members, unit_for
from ..estimates.findings import Traces

STRETCH = 2.0  # s of measured and simulated motion that are shown
UNITS = {"theta": "rad", "w": "rad/s", "u": "N m", "t": "s"}
_BINS = 200  # of the error over the record
_LEAST = 60  # of the residual over a signal
_FINE, _IN_BIN = 20, 20  # bins in a cycle of the effect, at so many samples in each
_TURNS = 12  # harmonics up to this order are shown over one whole turn


@dataclass(frozen=True)
class Residual:
    """Residual torque against the signal that explains it.

    ``before`` and ``after`` belong to the refitted and the augmented model (``after`` is None
    if they are the same), both multiplied by the sign of the signal ``times``, if any. Samples
    where ``x`` or ``before`` is NaN are left out. ``x`` is shown modulo ``span``, 0 if as it is,
    in which the effect repeats ``cycles`` times.
    """

    x: np.ndarray
    before: np.ndarray
    after: np.ndarray | None
    label: str
    times: str
    held_out: bool
    span: float = 0.0
    cycles: float = 1.0

    def edges(self) -> np.ndarray:
        """Edges of the bins of ``x`` in which the residual is averaged."""
        if not self.span:
            return np.linspace(*limits(self.x, 0.1), _LEAST + 1)
        fine = min(round(_FINE * self.cycles), len(self.x) // _IN_BIN)
        return np.linspace(0.0, self.span, max(fine, _LEAST) + 1)


def motion_of(d: Any) -> str:
    """ "rotary" or "linear"."""
    return next((x.motion for x in (d.model, d.declared, d.record) if x is not None), "rotary")


def simulated(traces: Traces | None, name: str) -> np.ndarray | None:
    """A simulated trace, or None if it is missing or all NaN."""
    values = traces.simulated.get(name) if traces is not None else None
    return values if values is not None and np.isfinite(values).any() else None


def stretch(traces: Traces) -> slice:
    """The two seconds of samples with the largest error of the refitted model."""
    model = simulated(traces, "refitted")
    n = len(traces.t)
    if model is None or n < 2:
        return slice(0, n)
    width = min(max(round(STRETCH / float(np.median(np.diff(traces.t)))), 2), n)
    power = np.nan_to_num(np.square(traces.measured - model))
    total = np.r_[0.0, np.cumsum(power)]
    start = int(np.argmax(total[width:] - total[:-width]))
    return slice(start, start + width)


def rms_over_time(t: np.ndarray, error: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Edges and RMS of an error in equal bins of the record; NaN for a bin without values."""
    edges = np.linspace(t[0], t[-1], min(_BINS, max(len(t) // 20, 1)) + 1)
    _, mean = binned(t, np.square(error), edges, least=1)
    return edges, np.sqrt(mean)


def binned(
    x: np.ndarray, y: np.ndarray, edges: np.ndarray, least: int = 5
) -> tuple[np.ndarray, np.ndarray]:
    """Centres and means of y in bins of x; NaN for bins of fewer than ``least`` finite values."""
    good = np.isfinite(x) & np.isfinite(y)
    bins = len(edges) - 1
    where = np.clip(np.searchsorted(edges, x[good], side="right") - 1, 0, bins - 1)
    count = np.bincount(where, minlength=bins)
    total = np.bincount(where, weights=y[good], minlength=bins)
    mean = np.where(count >= least, total / np.maximum(count, 1), np.nan)
    return (edges[1:] + edges[:-1]) / 2, mean


def residual(d: Any) -> Residual | None:
    """The residual torque against the signal that explains it; None without traces."""
    traces: Traces | None = d.traces
    if traces is None:
        return None
    before = traces.residual.get("refitted")
    if before is None or not np.isfinite(before).any():
        return None
    times = _times(d)
    x, label, span, cycles = _explaining(d, times)
    after = traces.residual.get("augmented")
    sign = np.sign(traces.signals[times]) if times else np.ones_like(x)
    good = np.isfinite(x) & np.isfinite(before) & np.isfinite(sign)
    if not good.any():
        return None
    held_out = bool((good & traces.held_out).any())
    good = good & traces.held_out if held_out else good
    if not d.effects or (after is not None and np.array_equal(after, before, equal_nan=True)):
        after = None
    return Residual(
        x=x[good],
        before=before[good] * sign[good],
        after=None if after is None else after[good] * sign[good],
        label=label,
        times=times,
        held_out=held_out,
        span=span,
        cycles=cycles,
    )


def limits(values: np.ndarray, cut: float) -> tuple[float, float]:
    """Range of the finite values without ``cut`` percent at either end; never empty."""
    finite = values[np.isfinite(values)]
    low, high = np.percentile(finite, [cut, 100.0 - cut])
    return (low, high) if high > low else (low - 0.5, high + 0.5)


def _effect(d: Any) -> tuple[Block | None, dict[str, float]]:
    """The best effect's block and its values; no block if the verdict is "unexplained"."""
    if not d.effects or d.verdict == "unexplained":
        return None, {}
    first = d.effects[0]
    return members("effect").get(first.name), {k: e.value for k, e in first.parameters.items()}


def _times(d: Any) -> str:
    """The signal whose sign the residual is multiplied by, "" if none.

    w if an effect changes a friction parameter, so that the plot shows the friction level. If
    the unexplained residual depends on two signals: a, else u, else w.
    """
    made, _ = _effect(d)
    given = d.traces.signals
    if made is None:
        pair = d.depends_on if d.verdict == "unexplained" and len(d.depends_on) == 2 else ()
        return next((s for s in "auw" if s in pair and s in given), "")
    plain = made.acts in (("torque",), ("input",)) or not made.acts
    return "w" if "w" in given and not plain else ""


def _explaining(d: Any, times: str) -> tuple[np.ndarray, str, float, float]:
    """The abscissa of the residual, its label with unit, what it is folded over and how often the
    effect repeats in that; never the signal ``times`` of an unexplained residual."""
    made, values = _effect(d)
    signals = {"t": d.traces.t, **d.traces.signals}
    own = [*made.inputs, *(["t"] if made.timed else [])] if made else []
    wanted = [*own, *(s for s in d.depends_on if made or s != times)]
    name = next((s for s in [*wanted, "w", "theta"] if s in signals), "t")
    motion = motion_of(d)
    unit, x = unit_for(UNITS.get(name, ""), motion), signals[name]
    if made and made.acts == ("input",) and made.states and name == "u":
        return np.gradient(x, d.traces.t), f"du/dt [{unit}/s]", 0.0, 1.0
    period = _period(name, made, values, motion)
    if period and np.ptp(x[np.isfinite(x)]) > period:
        turn = "one turn" if period == 2 * np.pi and motion == "rotary" else f"{period:.4g} {unit}"
        cycles = max(values.get("harmonic", 1.0) * period / (2 * np.pi), 1.0)
        return np.mod(x, period), f"{name} modulo {turn} [{unit}]", period, cycles
    return x, f"{name} [{unit}]" if unit else name, 0.0, 1.0


def _period(name: str, made: Block | None, values: dict[str, float], motion: str) -> float | None:
    """The period modulo which a signal is shown, None if it is shown as it is."""
    if "frequency" in values and name == "t":
        return 1.0 / values["frequency"]
    if name not in ("theta", "theta_load"):
        return None
    order = values.get("harmonic", 1.0)
    if motion == "linear":
        return 2 * np.pi / order if "harmonic" in values else None
    if made is not None and "phase" not in made.parameters:
        return None
    return 2 * np.pi if order <= _TURNS else 2 * np.pi / order

"""Plots of a log as it was read, and of a diagnosis or an identification. Each takes ``ax=None``
and returns the Axes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from ..blocks.block import Block, members, unit_for
from ..core.display import number
from ..core.errors import InputError
from ..core.numeric import Z95, top_speed
from ..core.unit_names import si_unit
from ..estimates.findings import Balance, friction
from . import loop_plots
from .canvas import AFTER, BEFORE, HALF, MEASURED, QUIET, binned, drawn, headed, on_pyplot
from .page import Figure
from .wording import BUDGET, kind, motion_of, percent, readable, terms

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from ..estimates.findings import Traces

# ---- the log: torque and motion over time, the friction curve, the plain fit


LEFT_OUT = "#e9b44c"
TITLES = {"u": "Torque", "w": "Speed", "theta": "Angle"}
_BINS = 1500  # of time over which a long signal is drawn as a band from least to greatest value
_MEANS, _SOME = 160, 4000  # bins in which a residual is averaged, and points of it
_REST = 0.02  # of the top speed, below which a sample is at rest


def plot(balance: Balance) -> list[Axes]:
    return on_pyplot([figure.draw for figure in log_figures(balance)], columns=2)


def log_figures(balance: Balance) -> list[Figure]:
    """Every plot that there is something for."""
    if not balance.stretches:
        return []
    motion = [k for k in ("w", "theta") if getattr(balance.stretches[0], k) is not None]
    panels = [(f"{role} as recorded; shaded: left out.", partial(signal, balance, role=role))
              for role in ("u", *motion)]  # fmt: skip
    if balance.curve:
        caption = "Friction over speed, with 95 % bars, and the plain fit."
        panels.append((caption, partial(curve, balance)))
    if balance.residual is not None:
        caption = "What the plain balance leaves over {}, with its mean; without samples at rest."
        over = dict.fromkeys(("t", "w", *motion))
        panels += [(caption.format(role), partial(rest, balance, role=role)) for role in over]
    return [Figure(f"log-{i}", caption, draw, HALF) for i, (caption, draw) in enumerate(panels)]


def starts(balance: Balance) -> list[float]:
    """What is added to the time of each stretch, so that runs follow one another."""
    made, shift, last, run = [], 0.0, 0.0, None
    for one in balance.stretches:
        if run is not None and one.run != run:
            shift = last - float(one.t[0])
        made.append(shift)
        run, last = one.run, shift + float(one.t[-1])
    return made


@drawn
def signal(balance: Balance, ax: Axes, role: str = "u") -> Axes:
    """A channel over time; a long one as the band between its least and greatest values."""
    for one, shift in zip(balance.stretches, starts(balance), strict=True):
        t, low, high = envelope(one.t + shift, getattr(one, role))
        ax.fill_between(t, low, high, color=MEASURED, lw=0.6, rasterized=True)
        edges = np.flatnonzero(np.diff(np.r_[False, ~one.ok, False]))
        for a, b in edges.reshape(-1, 2):  # samples that are not used
            start, end = float(one.t[a]) + shift, float(one.t[b - 1]) + shift
            ax.axvspan(start, end, color=LEFT_OUT, alpha=0.5, lw=0)
    _between_runs(balance, ax)
    label = f"{role} [{si_unit(role, balance.motion)}]"
    return headed(ax, f"{TITLES[role]} as recorded", xlabel="t [s]", ylabel=label, xmargin=0.01)


@drawn
def curve(balance: Balance, ax: Axes) -> Axes:
    points, values = balance.curve, balance.values()
    w, torque = (np.array([getattr(p, k) for p in points]) for k in ("w", "torque"))
    factor, unit = readable([np.abs(torque).max(initial=0.0)], unit_for("N m", balance.motion))
    bars = np.array([p.ci95 or (p.torque, p.torque) for p in points])
    sides = np.abs(bars - torque[:, None]).T
    ax.errorbar(w, factor * torque, factor * sides, fmt="o", ms=4, lw=1.0, color=AFTER)
    for side in (-1, 1) if "Fc" in values and balance.half_width is not None else ():
        x = np.linspace(0.0, side * (side * w).max(initial=0.0), 2)
        law = friction(balance, x, side) + values.get("constant_torque", 0.0)
        ax.plot(x, factor * law, color=MEASURED, lw=1.2, label="plain fit" if side > 0 else None)
    speed = f"w [{unit_for('rad/s', balance.motion)}]"
    return headed(ax, "Friction over speed", xlabel=speed, ylabel=f"friction [{unit}]")


@drawn
def rest(balance: Balance, ax: Axes, role: str = "theta") -> Axes:
    """What the plain balance leaves of the torque over time, speed or angle, and its mean; samples
    at rest would cover all others."""
    pairs = zip(balance.stretches, starts(balance), strict=True)
    windows = balance.residual
    assert windows is not None
    parts = [(windows.along(one), shift) for one, shift in pairs]
    parts = [part | {"t": part["t"] + shift} for part, shift in parts]
    w, x, y = (np.concatenate([part[k] for part in parts]) for k in ("w", role, "left"))
    good = np.isfinite(y)
    moving = good & (np.abs(w) > _REST * top_speed(w[good]))
    good = moving if moving.any() else good
    x, y = x[good], y[good]
    span = 2.0 * np.pi if role == "theta" and balance.motion == "rotary" else 0.0
    turns = span > 0.0 and bool(np.ptp(x) > span)
    x = np.mod(x, span) if turns else x
    edges = np.linspace(x.min(), x.max(), max(4, min(_MEANS, len(x) // 20)) + 1)
    factor, unit = readable([np.quantile(np.abs(y), 0.99)], unit_for("N m", balance.motion))
    some = slice(None, None, max(1, len(x) // _SOME))
    ax.plot(x[some], factor * y[some], ".", ms=1.5, color=MEASURED, alpha=0.25, rasterized=True)
    ax.plot(*binned(x, factor * y, edges), color=AFTER, lw=1.8)
    low, high = np.quantile(factor * y, [0.005, 0.995])
    ax.set_ylim(1.3 * low - 0.3 * high, 1.3 * high - 0.3 * low)
    over = f"{role}{' modulo one turn' * turns} [{si_unit(role, balance.motion)}]"
    if role == "t":
        _between_runs(balance, ax)
    left = number(100.0 * (balance.left or 0.0), 2)
    title = f"Plain fit: leaves {left} % of the RMS torque, over {role}"
    return headed(ax, title, xlabel=over, ylabel=f"residual torque [{unit}]")


def _between_runs(balance: Balance, ax: Axes) -> None:
    """A line where a run ends and the next one begins."""
    parts, shifts = balance.stretches, starts(balance)
    for before, one, shift in zip(parts, parts[1:], shifts[1:], strict=False):
        if one.run != before.run:
            ax.axvline(float(one.t[0]) + shift, color="#9aa4b0", lw=0.9, ls="--")


def envelope(t: np.ndarray, x: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    if len(x) <= 2 * _BINS:
        return t, x, x
    edges = np.linspace(0, len(x), _BINS + 1).astype(int)[:-1]
    with np.errstate(invalid="ignore"):
        return t[edges], np.fmin.reduceat(x, edges), np.fmax.reduceat(x, edges)


# ---- the diagnosis


_POINTS = 2500  # largest number of points drawn of a scatter or a line
_DOTS: dict[str, Any] = {"ms": 2.5, "alpha": 0.25, "mew": 0, "rasterized": True}
STRETCH = 2.0  # s of measured and simulated motion that are shown
_LEAST = 60  # of the residual over a signal
_FINE, _IN_BIN = 20, 20  # bins in a cycle of the effect, at so many samples in each
_TURNS = 12  # harmonics up to this order are shown over one whole turn
_CURVES = {"refitted": BEFORE, "augmented": AFTER}
_RUN: dict[str, Any] = {"fmt": "o", "ms": 4.0, "lw": 1.0}
_TERMS = {"friction": "#5b6675", "effect": AFTER, "rest": QUIET}
CAPTIONS = {
    "motion": "The two held-out seconds of the refitted model's largest error. Where the models "
    "jump, they are restarted from the measured motion.",
    "budget": "Where the torque goes; blue: what is missing from the model.",
    "map": "Mean torque of each run over its mean speed, with 95 % bars, and the fitted curves.",
    "torque": "Residual torque: single samples (dots) and their mean (lines).",
    "table": "The residual torque as a table, with its 95 % band, without a physical explanation.",
    "tracking": "Tracking error of the simulated loop: motion minus reference.",
}
_LAGS = {
    "autocorrelation": (AFTER, "of the residual"),
    "cross": (BEFORE, "with the change of u before"),
}


# --- motion and error over time ------------------------------------------------------------


@drawn
def motion(d: Any, ax: Axes) -> Axes:
    traces, models = d.traces, _models(d)
    cut = stretch(traces)
    cut = slice(cut.start, cut.stop, max((cut.stop - cut.start) // _POINTS, 1))
    t, of = traces.t[cut], d.error or {}
    name, unit = of.get("signal", "w"), of.get("unit") or unit_for("rad/s", motion_of(d))
    ax.plot(t, traces.measured[cut], color=QUIET, lw=3.5, label="measured")
    for model, values in models.items():
        ax.plot(t, values[cut], color=_CURVES[model], lw=1.3, label=f"simulated, {model}")
    shown: Any = {"xlabel": "t [s]", "ylabel": f"{name} [{unit}]", "xlim": (t[0], t[-1])}
    return headed(ax, "Measured and simulated, held-out samples", **shown)


def _models(d: Any) -> dict[str, np.ndarray]:
    """The trace of each model to draw: refitted and, with effects, augmented."""
    made = {name: simulated(d.traces, name) for name in _CURVES}
    if made["refitted"] is None:
        raise InputError("this diagnosis holds no simulated motion to plot.")
    return {k: x for k, x in made.items() if x is not None and (k == "refitted" or d.effects)}


def simulated(traces: Traces | None, name: str) -> np.ndarray | None:
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


# --- residual torque -----------------------------------------------------------------------


@drawn
def torque(d: Any, ax: Axes) -> Axes:
    """Residual torque against the signal that explains it: samples and their mean."""
    view = residual(d)
    if view is None:
        raise InputError("this diagnosis holds no residual torque to plot.")
    edges, unit, n = view.edges(), unit_for("N m", motion_of(d)), len(view.x)
    some: Any = slice(None)
    if n > _POINTS:  # chosen at random but always the same
        some = np.random.default_rng(0).choice(n, _POINTS, replace=False)
    shown = list(limits(view.before, 1.0))
    name = "residual torque" if unit == "N m" else "residual force"
    factor, unit = readable(shown, unit)
    shown = [factor * y for y in shown]
    for label, torque in (("refitted", view.before), ("augmented", view.after)):
        if torque is None:
            continue
        y, color = factor * torque, _CURVES[label]
        x, mean = binned(view.x, y, edges)
        ax.plot(view.x[some], y[some], ".", **_DOTS, color=color)
        ax.plot(x, mean, color="white", lw=3.6)
        ax.plot(x, mean, color=color, lw=2.0, label=f"{label}, mean")
        shown += list(mean[np.isfinite(mean)])
    times = " x sign(w)" * view.signed
    margin = 0.15 * (max(shown) - min(shown))
    ax.set(xlim=(edges[0], edges[-1]), ylim=(min(shown) - margin, max(shown) + margin))
    title = f"{name.capitalize()}{', held-out samples' * view.held_out}"
    return headed(ax, title, xlabel=view.label, ylabel=f"{name}{times} [{unit}]")


def limits(values: np.ndarray, cut: float) -> tuple[float, float]:
    """Range of the finite values without ``cut`` percent at either end; never empty."""
    finite = values[np.isfinite(values)]
    low, high = np.percentile(finite, [cut, 100.0 - cut])
    return (low, high) if high > low else (low - 0.5, high + 0.5)


@dataclass(frozen=True)
class Residual:
    """Residual torque against the signal that explains it."""

    x: np.ndarray
    label: str
    before: np.ndarray  # of the refitted model, times the sign of w where ``signed``
    after: np.ndarray | None  # of the augmented model, None if it is the same
    signed: bool
    held_out: bool
    span: float = 0.0  # modulo which x is shown, 0 if as it is
    cycles: float = 1.0  # of the effect in that

    def edges(self) -> np.ndarray:
        """Edges of the bins of ``x`` in which the residual is averaged."""
        if not self.span:
            return np.linspace(*limits(self.x, 0.1), _LEAST + 1)
        fine = min(round(_FINE * self.cycles), len(self.x) // _IN_BIN)
        return np.linspace(0.0, self.span, max(fine, _LEAST) + 1)


def residual(d: Any) -> Residual | None:
    """The residual torque against the signal that explains it; None without traces. Of an effect
    that changes a friction parameter the sign of w is taken out."""
    traces = getattr(d, "traces", None)
    if traces is None or not np.isfinite(traces.residual.get("refitted", np.nan)).any():
        return None
    before, after = traces.residual["refitted"], traces.residual.get("augmented")
    first = d.effects[0] if d.effects and d.verdict != "unexplained" else None
    block = members("effect").get(first.name) if first else None
    values = {k: e.value for k, e in first.parameters.items()} if first else {}
    signals = {"t": traces.t, **traces.signals}
    own = [*block.inputs, *(["t"] if block.timed else [])] if block else []
    name = next((s for s in [*own, *d.depends_on, "w", "theta"] if s in signals), "t")
    signed = bool(block and block.acts and block.acts not in (("torque",), ("input",)))
    sign = np.sign(signals["w"]) if signed and "w" in signals else np.ones(len(traces.t))
    x, motion = signals[name], motion_of(d)
    good = np.isfinite(x) & np.isfinite(before) & np.isfinite(sign)
    held_out = bool((good & traces.held_out).any())
    good = good & traces.held_out if held_out else good
    if not good.any():
        return None
    if not d.effects or (after is not None and np.array_equal(after, before, equal_nan=True)):
        after = None
    unit, span, cycles = si_unit(name, motion), _period(name, block, values, motion), 1.0
    if span and np.ptp(x[good]) > span:
        turn = "one turn" if span == 2 * np.pi and motion == "rotary" else f"{span:.4g} {unit}"
        cycles, x = max(values.get("harmonic", 1.0) * span / (2 * np.pi), 1.0), np.mod(x, span)
        label = f"{name} modulo {turn} [{unit}]"
    else:
        span, label = 0.0, f"{name} [{unit}]" if unit else name
    before, after = (before * sign)[good], None if after is None else (after * sign)[good]
    return Residual(x[good], label, before, after, signed, held_out, span, cycles)


def _period(name: str, block: Block | None, values: Mapping[str, float], motion: str) -> float:
    """The period modulo which a signal is shown, 0 if it is shown as it is."""
    order = values.get("harmonic", 1.0)
    if name == "t" and "frequency" in values:
        return 1.0 / values["frequency"]
    if not name.startswith("theta") or (block is not None and "phase" not in block.parameters):
        return 0.0
    if motion == "linear" or order > _TURNS:
        return 2 * np.pi / order if "harmonic" in values else 0.0
    return 2 * np.pi


# --- budget, friction map, prediction errors -----------------------------------------------


@drawn
def bars(d: Any, ax: Axes) -> Axes:
    parts = d.comparison.budget[::-1]
    colours = [_TERMS[kind(s.term)] for s in parts]
    ax.barh(range(len(parts)), [100.0 * s.share for s in parts], color=colours, height=0.7)
    beside: dict[str, Any] = {"xytext": (4, 0), "textcoords": "offset points"}
    for i, s in enumerate(parts):
        if s.ci95 is not None:
            ax.plot([100 * x for x in s.ci95], [i, i], color="#1c2430", lw=1.2)
        end = 100.0 * max((s.share, *(s.ci95 or ())))  # else the interval strikes it through
        share = percent(s.share)
        ax.annotate(share, (end, i), **beside, va="center", fontsize="small")
    ax.set_yticks(range(len(parts)), terms(parts))
    ax.grid(False, axis="y")
    return headed(ax, BUDGET, xlabel="RMS torque [% of friction]", xmargin=0.15)


@drawn
def friction_map(made: Any, ax: Axes) -> Axes:
    """Mean torque over speed, one point with its 95 % bar per run, and the models' curves."""
    factor, unit = readable([float(np.max(np.abs(made.u)))], unit_for("N m", made.motion))
    name = "torque" if made.motion == "rotary" else "force"
    shown: Any = {
        "xlabel": f"w [{unit_for('rad/s', made.motion)}]",
        "ylabel": f"mean {name} [{unit}]",
    }
    left = made.at < 0.0
    for model, curve in made.curves.items():
        for side, label in ((left, model), (~left, None)):
            ax.plot(made.at[side], factor * curve[side], color=_CURVES[model], label=label)
    for which, face, label in ((~made.held_out, MEASURED, None), (made.held_out, "w", "held out")):
        y, bars = (factor * values[which] for values in (made.u, Z95 * made.error))
        ax.errorbar(made.w[which], y, bars, color=MEASURED, mfc=face, label=label, **_RUN)
    return headed(ax, f"Mean {name} over speed, one point for each run", **shown)


@drawn
def correlations(r: Any, ax: Axes) -> Axes:
    ax.axhspan(-r.bound, r.bound, color="#e6eaef", label="99 % of chance")
    for i, (name, (colour, label)) in enumerate(_LAGS.items()):
        first = 1 if name == "autocorrelation" else 0
        y, at = getattr(r, name)[first:], r.lags[first:] + 0.2 * i
        ax.vlines(at, 0.0, y, color=colour, lw=2, label=label)
    title = f"Prediction errors of {r.signal}"
    return headed(ax, title, xlabel="lag [samples]", ylabel="correlation")


# --- all of them ---------------------------------------------------------------------------


def figures(d: Any) -> list[Figure]:
    """Every plot that the result holds data for, with its caption; none if it was refused."""
    if getattr(d, "verdict", None) in (None, "refused"):
        return []
    loop, simulates = getattr(d, "compensation", None), getattr(d, "traces", None)
    of = {
        "motion": (motion, d if simulated(simulates, "refitted") is not None else None),
        "budget": (bars, d if getattr(getattr(d, "comparison", None), "budget", ()) else None),
        "map": (friction_map, getattr(d, "map", None)),
        "torque": (torque, d if residual(d) is not None else None),
        "table": (loop_plots.table, getattr(d, "table", None)),
        "tracking": (loop_plots.tracking, loop if loop is not None and loop.runs else None),
    }
    return [
        Figure(name, CAPTIONS[name], partial(draw, what))
        for name, (draw, what) in of.items()
        if what is not None
    ]


def overview(d: Any, ax: Axes | None = None) -> Any:
    """All plots that the result has data for, in one new figure; returns an array of their Axes.

    If there is only one plot, its Axes is returned. With ``ax`` given, only the first plot
    (measured and simulated motion, if there is any) is drawn into it, and that Axes is returned.
    Raises InputError when there is nothing to plot.
    """
    plots = [figure.draw for figure in figures(d)]
    if ax is not None and plots:
        return plots[0](ax)
    axes = on_pyplot(plots, columns=2)
    return axes[0] if len(axes) == 1 else np.array(axes, dtype=object)

"""The source paper recomputed: its bandwidths, its two figures, further studies, and their page."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass, replace
from functools import lru_cache, partial
from itertools import count
from pathlib import Path
from typing import Any

import control as ct
import numpy as np
from scipy.optimize import brentq

import lugrectl as lg

from .. import report
from ..core.display import NONE, Grid, Row, Shown, number, show_poles
from ..core.errors import Diverged, InputError
from ..core.numeric import rms
from ..core.progress import Wanted, reporter, shows_progress
from ..core.provenance import Provenance
from ..core.result import Fields, Result, picked, plain
from ..report.canvas import headed
from ..report.page import Figure, Page, Section
from . import studies
from .equations import FAILS, HOLDS, PAPER
from .studies import Case, Compensation, Measure, Study

SMALL = 1e-6  # a smaller RMS value counts as 0
FILES: tuple[str, ...] = ("reproduce.html", "reproduce.json")
WIDTHS = (
    "Friction compensated; plant 1/(J s), or 1/(J s^2) with D on the measured speed. Of a loop "
    "that is not stable the frequency is where |T| crosses, not a bandwidth. Last column: T(s) in "
    "the condition of the existing observer, whose proof needs SPR and the feed-forward. PID and "
    "PD are chosen for the same crossing: damping ratio 0.71 and the paper's Ki/Kp; Kd 5 % above "
    "sigma0 J/sigma1, where T(s) becomes SPR."
)
Signals = dict[str, np.ndarray]


@dataclass(frozen=True)
class Errors:
    """RMS values of one measure, one for each compensation; inf if the loop diverged."""

    case: Case
    measure: Measure
    rms: dict[str, float]

    def summary(self) -> dict[str, Any]:
        return {"case": self.case.label, **plain(asdict(self.measure)), "rms": plain(self.rms)}


@dataclass(frozen=True, repr=False)
class Outcome(Shown):
    """The result of a study: rows of RMS values, and times and signals to draw, by column."""

    study: Study
    rows: tuple[Errors, ...]
    traces: Mapping[str, tuple[np.ndarray, np.ndarray]]

    def summary(self) -> dict[str, Any]:
        return self.study.summary() | {"rows": plain(self.rows)}


@dataclass(frozen=True, repr=False)
class Width(Shown):
    """Bandwidth of one loop, r to w or theta, with all friction or all but Fv compensated."""

    loop: str
    label: str
    gains: Mapping[str, float]
    level: str
    hertz: float
    stable: bool
    poles: tuple[complex, ...]  # 1/s
    spr: str | None  # class of T(s), the existing observer's condition; None if not applicable
    paper: str

    def summary(self) -> dict[str, Any]:
        return plain(asdict(self) | {"poles": [[q.real, q.imag] for q in self.poles]})


@dataclass(frozen=True, repr=False)
class PaperFigure(Shown):
    """A figure of the source paper: reference, and the response of three loops."""

    key: str
    scenario: str
    unit: str
    window: tuple[float, float]
    t: np.ndarray
    reference: np.ndarray
    responses: Signals
    errors: Mapping[str, float]

    def summary(self) -> dict[str, Any]:
        return picked(self, "key scenario unit window") | {"rms": plain(self.errors)}


@dataclass(frozen=True, repr=False)
class Growth(Shown, Fields):
    """Growth of the compensated position PI: predicted from its poles, and simulated."""

    predicted: float  # time constant, s
    simulated: float
    observer: str
    window: tuple[float, float]  # s, of the simulation


@dataclass(frozen=True)
class Claim(Fields):
    """A statement of the source paper, what was found, and whether it holds."""

    paper: str
    found: str
    status: str


@dataclass(frozen=True, repr=False)
class Reproduction(Result):
    """Everything that ``lugrectl reproduce`` shows."""

    parameters: lg.Parameters
    widths: tuple[Width, ...]
    figures: tuple[PaperFigure, ...]
    growth: Growth | None
    outcomes: tuple[Outcome, ...]
    claims: tuple[Claim, ...] = ()
    provenance: Provenance | None = None

    def outcome(self, key: str) -> Outcome | None:
        """The outcome of a study, None if it was not run."""
        return next((o for o in self.outcomes if o.study.key == key), None)

    def figure(self, key: str) -> PaperFigure | None:
        """A figure of the source paper, "velocity" or "position"; None if it was not made."""
        return next((f for f in self.figures if f.key == key), None)

    def _width(self, loop: str, label: str, level: str = "-3dB") -> Width:
        wanted = (loop, label, level)
        return next(w for w in self.widths if (w.loop, w.label, w.level) == wanted)

    def summary(self) -> dict[str, Any]:
        """Plain Python, as in the JSON document; never NaN or Infinity."""
        return {
            "schema": 1,
            "parameters": asdict(self.parameters),
            "bandwidths": plain(self.widths),
            "figures": plain(self.figures),
            "growth": plain(self.growth),
            "studies": plain(self.outcomes),
            "claims": plain(self.claims),
            "slips": [picked(p, "label status note") for p in PAPER if p.status != HOLDS],
            "provenance": plain(self.provenance),
        }

    def save(self, folder: str | Path) -> list[Path]:
        """Write reproduce.html and reproduce.json into a folder, both or none; their paths."""
        report.check_folder(folder)
        content = dict(zip(FILES, (page(self).html(), self.to_json() + "\n"), strict=True))
        return report.written(content, Path(folder), "page")

    def _title(self) -> str:
        return "Reproduction of the source paper"

    def _rows(self) -> Iterable[Row]:
        return [
            *(Row(f"bandwidth, {w.label}", w.hertz, "Hz") for w in self.widths),
            Row("figures", ", ".join(f.key for f in self.figures)),
            Row("studies", ", ".join(o.study.key for o in self.outcomes)),
        ]

    def __str__(self) -> str:
        return page(self).text()

    def _repr_html_(self) -> str:
        return page(self).fragment()


def milli(value: float) -> str:
    """A value in thousandths, three digits; "diverges" for infinity."""
    if not np.isfinite(value):
        return "diverges"
    if value < SMALL:
        return "<0.001"
    value *= 1e3
    return number(value, 3 if value >= 0.1 else 2)


def claims(r: Reproduction) -> Iterator[Claim]:
    """The statements of the paper that can be checked by simulation, and what was found."""
    v, half, left = (
        r._width("velocity", f"paper's PI{end}", level)
        for end, level in (("", "-3dB"), ("", "half-power"), (", Fv left in", "-3dB"))
    )
    found = f"{v.hertz:.1f} Hz (half power {half.hertz:.1f} Hz; Fv left in {left.hertz:.1f} Hz)"
    yield Claim("Velocity PI: around 115 Hz at -3 dB", found, HOLDS)
    pi, left = (r._width("position", f"paper's PI{end}") for end in ("", ", Fv left in"))
    found = f"|T| crosses -3 dB at {pi.hertz:.1f} Hz, but the loop is unstable and has no "
    found += "bandwidth; stable with Fv left uncompensated (Fv Kp > J Ki, "
    yield Claim("Position PI: approximately 20 Hz", f"{found}{left.hertz:.1f} Hz)", FAILS)
    errors = {f.key: [milli(value) for value in f.errors.values()] for f in r.figures}
    if "velocity" in errors:
        _, none, best = errors["velocity"]
        said = "Velocity: friction degrades the PI severely, the proposed observer is a remedy"
        found = f"{none} against {best} mrad/s RMS, with exact observer parameters, where the "
        found += "natural observer does the same; with wrong ones see the tables"
        yield Claim(said, found, HOLDS)
    if "position" in errors:
        _, none, best = errors["position"]
        found = f"{best} mrad RMS over 1 to 5 s, {none} with no observer (step of 1 rad, "
        found += "prefilter, exact parameters); later it grows without bound"
        yield Claim("Position: the proposed observer performs well", found, FAILS)
    if g := r.growth:
        said = "(not in the paper) growth of the compensated position loop"
        found = f"time constant {g.predicted:.2f} s from the poles, {g.simulated:.2f} s in "
        found += f"simulation over {g.window[0]:g} to {g.window[1]:g} s with the {g.observer}"
        yield Claim(said, found, "unstable")


LOOPS = {"velocity": lg.velocity_loop, "position": lg.position_loop}
LOOPS_TF = {"velocity": lg.velocity_loop_tf, "position": lg.position_loop_tf}
SAID = {"velocity": "around 115 Hz at -3 dB", "position": "approximately 20 Hz"}  # by the paper
CHOSEN = "(the text of the paper gives no reference: this one is chosen here)"


@shows_progress
def reproduce(*, only: Collection[str] | None = None, progress: Wanted = None) -> Reproduction:
    """Recompute the paper, and cases not in it; ``only``: keys of studies and figures to run."""
    p, report, done = lg.table1(), reporter(progress), count(1)
    known = studies.all_studies(same_width(p), same_width_spr(p))
    keys = [*LOOPS, *(s.key for s in known)]
    chosen = keys if only is None else [k for k in keys if k in only]
    strange = sorted({*(only or ())} - {*keys})
    if strange:
        raise InputError(f"unknown study '{strange[0]}'; known: {', '.join(keys)}.")
    wanted = [s for s in known if s.key in chosen]
    total = sum(len(s.cases) * len(s.compensations) for s in wanted)
    figures = tuple(figure(p, key) for key in LOOPS if key in chosen)
    outcomes = tuple(run(p, s, lambda what: report(next(done) / total, what)) for s in wanted)
    grown = growth(p) if "position-pi" in chosen else None
    made = Reproduction(p, widths(p), figures, grown, outcomes)
    return replace(made, claims=tuple(claims(made)))


# --- bandwidths ----------------------------------------------------------------------------


def widths(p: lg.Parameters) -> tuple[Width, ...]:
    """Bandwidths of the paper's loops and of the loops compared with them."""
    made, V, X = [], studies.VELOCITY, studies.POSITION
    for loop, label, gains, level in (
        ("velocity", "paper's PI", V, "-3dB"),
        ("velocity", "paper's PI", V, "half-power"),
        ("velocity", "paper's PI, Fv left in", V, "-3dB"),
        *(("velocity", "strong PI", c.gains, "-3dB") for c in studies.STRONG),
        ("position", "paper's PI", X, "-3dB"),
        ("position", "paper's PI, Fv left in", X, "-3dB"),
        ("position", "PID", same_width(p), "-3dB"),
        ("position", "PD", same_width_spr(p), "-3dB"),
    ):
        T: Any = LOOPS_TF[loop](p, **gains)
        left_in = "Fv" in label
        if left_in:  # Fv s^(n-1) in the denominator of degree n, led by J s^n
            den = np.array(T.den[0][0], dtype=float)
            den[1] += p.Fv
            T = ct.tf(T.num[0][0], den)
        b = lg.bandwidth_check(T, level)
        of_spr = lg.velocity_T if loop == "velocity" else lg.position_T
        spr = None if left_in else lg.spr_check(of_spr(p, **gains)).classification
        said = SAID[loop] if label.startswith("paper's") else ""
        made.append(Width(loop, label, {**gains}, level, b.hertz, b.stable, b.poles, spr, said))
    return tuple(made)


def _crossing(p: lg.Parameters, gains: Mapping[str, float] = studies.POSITION) -> float:
    """Where |T| of a position loop crosses -3 dB, in rad/s."""
    return lg.bandwidth_check(lg.position_loop_tf(p, **gains)).bandwidth


def same_width(p: lg.Parameters) -> dict[str, float]:
    """A stable PID with the -3 dB crossing of the source paper's position PI, its Ki/Kp."""
    wanted, ratio = _crossing(p), studies.POSITION["ki"] / studies.POSITION["kp"]

    def gains(wn: float) -> dict[str, float]:
        kp = p.J * wn**2
        return {"kp": kp, "ki": ratio * kp, "kd": 2**0.5 * p.J * wn}  # damping 1/sqrt(2)

    def miss(wn: float) -> float:
        return _crossing(p, gains(wn)) - wanted

    return gains(float(brentq(miss, 0.2 * wanted, 5 * wanted, xtol=1e-10)))  # type: ignore


def same_width_spr(p: lg.Parameters) -> dict[str, float]:
    """A PD with the same crossing whose T(s) is SPR: Kd 5 % above sigma0 J / sigma1."""
    w = _crossing(p)
    kd, c = 1.05 * p.sigma0 * p.J / p.sigma1, 10 ** (-3 / 10)
    a, half = 1 / c - 1, p.J * w**2
    # (1/c - 1) Kp^2 + 2 J w^2 Kp - (J w^2)^2 - (Kd w)^2 = 0
    kp = (-half + math.sqrt(half**2 + a * (half**2 + (kd * w) ** 2))) / a
    return {"kp": kp, "ki": 0.0, "kd": kd}


# --- simulations ---------------------------------------------------------------------------


@lru_cache
def loop_of(p: lg.Parameters, loop: str, observer: str | None) -> Any:
    return LOOPS[loop](p, observer, feedforward=True)


def respond(
    p: lg.Parameters, loop: str, controller: Mapping[str, float], c: Compensation, case: Case
) -> tuple[np.ndarray, Signals]:
    """Times and signals of one run (outputs of the loop, and F - Fhat); Diverged."""
    system = loop_of(p, loop, c.observer)
    t = np.arange(round(case.duration / case.dt) + 1) * case.dt
    start = [case.start.get(label, 0.0) for label in system.state_labels]
    r = case.reference.inputs(t, loop, case.feedforward)
    # every value that differs between cases, so that one compilation serves them all
    block = "pi" if loop == "velocity" else "pid"
    values = {f"{block}.{k}": c.gains.get(k, v) for k, v in controller.items()}
    if c.observer is not None:
        own = {k: v * case.scale.get(k, 1.0) for k, v in p.friction().items()}
        values |= {f"{c.observer}_observer.{k}": v for k, v in (own | {**c.gains}).items()}
    outputs = np.asarray(lg.simulate(system, t, r, start, params=values).outputs)
    y = dict(zip(system.output_labels, outputs, strict=True))
    return t, y | {"F - Fhat": y["F"] - y["Fhat"]}


def within(t: np.ndarray, window: tuple[float, float]) -> np.ndarray:
    """Return which samples lie in a window (s), ends included."""
    slack = 1e-9 * max(window[1], 1.0)
    return (t >= window[0] - slack) & (t <= window[1] + slack)


def run(p: lg.Parameters, study: Study, tick: Callable[[str], None]) -> Outcome:
    """All cases of a study under all its compensations."""
    rows, traces, drawn = list[Errors](), {}, study.drawn
    for i, case in enumerate(study.cases):
        own = [Errors(case, measure, {}) for measure in case.measures]
        for c in study.compensations:
            with contextlib.suppress(Diverged):
                t, y = respond(p, study.loop, study.controller, c, case)
                for row in own:
                    row.rms[c.name] = rms(y[row.measure.signal][within(t, row.measure.window)])
                if drawn and i == drawn.case and (not drawn.columns or c.name in drawn.columns):
                    inside = within(t, drawn.span)
                    traces[c.name] = t[inside], y[drawn.signal][inside]
            for row in own:
                row.rms.setdefault(c.name, np.inf)
            tick(f"{study.title}: {c.name}")
        rows += own
    return Outcome(study, tuple(rows), traces)


# --- the figures of the paper --------------------------------------------------------------


def figure(p: lg.Parameters, loop: str) -> PaperFigure:
    """A loop without friction, with friction, and with the proposed observer."""
    if loop == "velocity":
        measure, gains = Measure("w", "rad/s", (1.0, 3.0)), studies.VELOCITY
        case, text = Case("", studies.SINE, (measure,), duration=3.0), studies.FROM_REST
    else:
        measure, gains = Measure("theta", "rad", (1.0, 5.0)), studies.POSITION
        case = Case("", studies.STEP, (measure,))
        text = "Position loop, Kp 15, Ki 1.55, prefilter 2/(s + 2), no feed-forward, reference a "
        text += "step of 1 rad"
    t, with_friction = respond(p, loop, gains, studies.NONE, case)
    _, compensated = respond(p, loop, gains, studies.PROPOSED, case)
    r = case.reference.inputs(t, loop, False)[0]
    _, free = ct.forced_response(LOOPS_TF[loop](p, **gains), t, r)
    responses = {
        "no friction": free,
        "friction, no observer": with_friction[measure.signal],
        f"friction, {studies.PROPOSED.label}": compensated[measure.signal],
    }
    said = f"{text} {CHOSEN}, observer parameters exact, all states 0 at the start."
    inside = within(t, measure.window)
    errors = {name: rms((y - r)[inside]) for name, y in responses.items()}
    return PaperFigure(loop, said, measure.unit, measure.window, t, r, responses, errors)


def growth(p: lg.Parameters, observer: Compensation = studies.PROPOSED) -> Growth:
    """Time constant of the paper's position PI with exact compensation: pole and simulation."""
    poles = lg.bandwidth_check(lg.position_loop_tf(p, **studies.POSITION)).poles
    window, case = (40.0, 100.0), replace(studies.LONG, measures=())
    t, y = respond(p, "position", studies.POSITION, observer, case)
    inside = within(t, window)
    times, highs = peaks(t[inside][:-1], y["e"][inside][:-1], 60)  # in each second
    slope = np.polyfit(times, np.log(highs), 1)[0]
    return Growth(1 / poles[0].real, float(1 / slope), observer.label, window)


def peaks(t: np.ndarray, y: np.ndarray, parts: int) -> np.ndarray:
    """When |y| is largest in each of so many parts, and how large it is there."""
    pieces = zip(np.array_split(t, parts), np.array_split(np.abs(y), parts), strict=True)
    return np.array([(a[np.argmax(x)], x.max()) for a, x in pieces]).T


# --- words, tables and figures -------------------------------------------------------------


def page(r: Reproduction) -> Page:
    """The reproduction, of which the text has about 80 columns."""
    v, pi = (r._width(loop, "paper's PI") for loop in ("velocity", "position"))
    title = "The position PI of the paper is unstable once friction is compensated"
    meaning = (
        f"Its velocity loop is confirmed ({v.hertz:.1f} Hz). "
        f"Its position loop crosses -3 dB at {pi.hertz:.1f} Hz, but its poles are "
        f"{show_poles(pi.poles)} 1/s: J s^3 + Kp s + Ki has no s^2 term for any Ki > 0. The "
        f"oscillation grows by e every {1 / pi.poles[0].real:.1f} s, too slowly to be seen in a "
        "figure of a few seconds. Which observer tracks best depends on its gains and on the "
        "scenario: every table below names both."
    )
    return Page(title, meaning, [*_parts(r)], kind="refused")


def _parts(r: Reproduction) -> Iterator[Section | Figure]:
    """Paper against toolkit, bandwidths, figures, studies, the errors in the text."""
    said = (f"- {c.paper} ({c.status}): {c.found}." for c in r.claims)
    yield Section("Paper and recomputation", tuple(said))
    for loop, said in (("velocity", ""), ("position", WIDTHS)):
        rows = tuple(
            (
                w.label,
                ", ".join(f"{k.capitalize()} {v:.4g}" for k, v in w.gains.items() if v),
                f"{w.hertz:.1f}",
                w.level if w.stable else "UNSTABLE",
                w.spr or NONE,
            )
            for w in r.widths
            if w.loop == loop
        )
        grid = Grid(("controller", "gains", "Hz", "level", "T(s)"), "llrll", rows)
        yield Section(f"Bandwidth, {loop} loop", (), grid, said)
    for one in r.figures:
        head = ("loop", f"RMS error {one.window[0]:g} to {one.window[1]:g} s [m{one.unit}]")
        grid = Grid(head, "lr", tuple((name, milli(x)) for name, x in one.errors.items()))
        yield Section(f"The paper's {one.key} figure", (one.scenario,), grid)
        caption = "The lines without friction and with the observer coincide."
        yield Figure(f"paper-{one.key}", caption, partial(responses, one))
    for o in r.outcomes:
        yield _table(o)
        yield Figure(o.study.key, "Names as in the table.", partial(_picture, o))
    slips = (f"- {one.label} ({one.status}): {one.note}." for one in PAPER if one.status != HOLDS)
    yield Section("Where the paper's text does not hold as printed", tuple(slips))


def _table(o: Outcome) -> Section:
    """One study: scenario, table, what its columns are."""
    measures = [row.measure for row in o.rows]
    windows, signals = {m.window for m in measures}, {m.signal for m in measures}
    units = " and ".join(sorted({f"{m.signal} in m{m.unit}" for m in measures}))
    names, rows = [c.name for c in o.study.compensations], []
    for row, m in zip(o.rows, measures, strict=True):
        window = f"{m.window[0]:g}-{m.window[1]:g} s"
        more = [*[m.signal] * (len(signals) > 1), *[window] * (len(windows) > 1)]
        label = ", ".join([row.case.label, *more])
        rows.append((label, *(milli(row.rms[name]) for name in names)))
    only = f" over {measures[0].window[0]:g} to {measures[0].window[1]:g} s"
    lines = (f"{o.study.scenario} RMS of {units}{only * (len(windows) == 1)}.", *o.study.notes)
    columns = "; ".join(f"{c.name}: {c.label}" for c in o.study.compensations)
    grid = Grid(("", *names), "l" + "r" * len(names), tuple(rows))
    return Section(o.study.title, lines, grid, f"{columns}.")


def responses(one: PaperFigure, ax: Any) -> Any:
    for name, y in {"reference": one.reference, **one.responses}.items():
        ax.plot(one.t[::5], y[::5], lw=1.3, label=name)
    return headed(ax, "", columns=2, xlabel="t [s]", ylabel=f"[{one.unit}]")


def _picture(o: Outcome, ax: Any) -> Any:
    """One case over time, as the largest magnitude in each of 200 parts where it is logarithmic;
    of a sweep the table."""
    if (drawn := o.study.drawn) is None:
        x = [row.case.label.partition(",")[0] for row in o.rows]
        for c in o.study.compensations:
            ax.plot(x, [1e3 * row.rms[c.name] for row in o.rows], "o-", ms=3, label=c.name)
        ax.set_yscale("log")
        unit, of = o.rows[0].measure.unit, "error of the observer's parameters"
        return headed(ax, o.study.title, columns=4, xlabel=of, ylabel=f"RMS error [m{unit}]")
    for name, (t, y) in o.traces.items():
        x, y = peaks(t, np.maximum(np.abs(y), 1e-9), 200) if drawn.log else (t, y)
        ax.plot(x, 1e3 * y, lw=1.3, label=name)
    ax.set_yscale("log" if drawn.log else "linear")
    of = f"|{drawn.signal}|" if drawn.log else drawn.signal
    head = f"{o.study.title}: {o.study.cases[drawn.case].label}"
    return headed(ax, head, columns=4, xlabel="t [s]", ylabel=f"{of} [m{drawn.unit}]")

"""Findings of a diagnosis, of the torque balance and of bench tests: small frozen objects that
neither draw nor print."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from ..blocks.block import members, unit_for
from ..blocks.table import tabulated
from ..core.display import Row, Shown, between, estimated, noticed, with_interval
from ..core.numeric import Z95, rms
from ..core.result import Fields, Result, library, picked, plain
from ..core.validation import whole
from ..core.views import view
from ..record import Stretch

if TYPE_CHECKING:
    import control as ct

AGAINST_HELD = "The record contradicts held values"  # a note that the headline repeats


@dataclass(frozen=True, repr=False)
class Estimate(Shown):
    """A fitted value with its unit and 95 % interval (None if it cannot be determined).

    ``held``: the value was declared as fixed, and no fit has changed it. ``together``: the sum
    that the value stands for, where the record does not determine it alone.
    """

    value: float
    unit: str
    ci95: tuple[float, float] | None = None
    held: bool = False
    together: str = ""

    def summary(self) -> dict[str, Any]:
        more = " held" * self.held + " together" * bool(self.together)
        return picked(self, "value unit ci95" + more)

    def may_be(self, value: float) -> bool:
        """Whether the 95 % interval holds this value."""
        return self.ci95 is not None and self.ci95[0] <= value <= self.ci95[1]

    def _title(self) -> str:
        return estimated("", self).text()

    def _rows(self) -> Iterable[Row]:
        return ()


@dataclass(frozen=True, repr=False)
class Candidate(Shown):
    """One effect that was tried: how much better it predicts left-out blocks of training samples.

    ``score`` is the gain in log predictive density over the declared model, nats; ``share`` the RMS
    of the torque that it adds, over that of friction. Both are 0 where it was not compared.
    """

    name: str
    score: float
    share: float

    def summary(self) -> dict[str, Any]:
        return picked(self, "name score")

    def _title(self) -> str:
        return self.name


ELSEWHERE = "record a run with other speeds, positions and loads"


@dataclass(frozen=True, repr=False)
class Finding(Shown):
    """An effect missing from the declared model, and others that would explain the same."""

    name: str
    parameters: Mapping[str, Estimate]
    alternatives: tuple[Candidate, ...] = ()

    def apart(self) -> str:
        """The experiments that distinguish it from its alternatives; "" if it has none.

        Each may tell another one from the rest.
        """
        others, known = [c.name for c in self.alternatives], members("effect")
        own = [known[n].experiment for n in (self.name, *others) if n in known]
        how = "; or ".join(dict.fromkeys(filter(None, own))) or ELSEWHERE
        return f"to distinguish {self.name} from {' or '.join(others)}: {how}" if others else ""

    def summary(self) -> dict[str, Any]:
        return picked(self, "name parameters alternatives")

    def _title(self) -> str:
        return f"Finding: {self.name}"

    def _rows(self) -> Iterable[Row]:
        rows = [estimated(k, e) for k, e in self.parameters.items()]
        others = ", ".join(c.name for c in self.alternatives)
        return [*rows, Row("alternatives", others)] if others else rows


@dataclass(frozen=True, repr=False, eq=False)
class Traces(Shown):
    """Arrays behind the plots, one value for each sample of the first record.

    ``simulated`` maps "declared", "refitted", "augmented" to the error signal simulated with
    restarts on held-out samples (NaN elsewhere); ``residual`` maps the same names to the
    residual torque; ``signals`` holds theta, w, u, t smoothed; ``held_out`` marks the samples.
    """

    t: np.ndarray
    measured: np.ndarray
    held_out: np.ndarray
    simulated: Mapping[str, np.ndarray]
    residual: Mapping[str, np.ndarray]
    signals: Mapping[str, np.ndarray]


@dataclass(frozen=True, repr=False, eq=False)
class Table(Result):
    """An unexplained residual torque as a table over the signals it depends on: no physics.

    Attributes
    ----------
    signals : tuple of str
        The table's abscissa, followed by "w" if each direction has its own values.
    points : (n,) ndarray
        In the abscissa's SI unit.
    values : (n,) or (2, n) ndarray
        Torque in ``unit``, positive where it resists; two rows for w > 0 and w < 0.
    error : ndarray
        The standard errors of ``values``.
    periodic : bool
        It repeats every 2 pi.
    share : float
        Part of the residual torque's power that such a table predicts on windows that it was not
        fitted to (below 0 if it is worse than no table).
    share95 : (float, float)
        The 95 % interval of ``share`` over ``windows`` windows.
    rms : float
        Of the tabulated torque along the record.
    unit : str
        N m, or N on a linear drive.
    windows : int
        The number of windows behind ``share95``.
    motion : "rotary" or "linear"
        That of the record.

    Examples
    --------
    The table of a diagnosis, here a made-up one, as a block that acts on a simulated drive:

    >>> angles, torque = np.array([0.0, 2.0, 4.0]), np.array([0.0, 0.05, -0.05])
    >>> table = lg.Table(
    ...     ("theta",), angles, torque, error=0.001 * np.ones(3), periodic=True, share=0.8,
    ...     share95=(0.7, 0.9), rms=0.035, unit="N m", windows=12,
    ... )
    >>> block = table.block()
    >>> block.input_labels, block.output_labels
    (['theta'], ['d'])
    """

    signals: tuple[str, ...]
    points: np.ndarray
    values: np.ndarray
    error: np.ndarray
    periodic: bool
    share: float
    share95: tuple[float, float]
    rms: float
    unit: str
    windows: int
    motion: str = "rotary"

    @property
    def name(self) -> str:
        """The table's name in words."""
        over = self.signals[0] + " and the direction of w" * (len(self.signals) == 2)
        return f"unexplained residual over {over} (table, no physics)"

    def block(
        self,
        *,
        name: str = "table",
        inputs: Sequence[str] | None = None,
        outputs: Sequence[str] | None = None,
    ) -> ct.NonlinearIOSystem:
        """The table as a block with output d: :func:`lugrectl.tabulated`."""
        shape = {"periodic": self.periodic, "name": name, "inputs": inputs, "outputs": outputs}
        return tabulated(self.signals[0], self.points, self.values, **shape)

    def summary(self) -> dict[str, Any]:
        """Plain Python, as under "table" in the JSON document."""
        made = picked(self, "name signals unit periodic points values share rms windows")
        return made | {"standard_error": plain(self.error), "share_ci95": plain(self.share95)}

    def to_frame(self) -> Any:
        """A DataFrame, a row for each point: the signal, torque and standard error, of tables for
        each direction with "w > 0" and "w < 0" behind the names."""
        columns: dict[str, Any] = {self.signals[0]: self.points}
        ways = ("",) if self.values.ndim == 1 else (", w > 0", ", w < 0")
        for name, values in (("torque", self.values), ("standard_error", self.error)):
            columns |= zip((name + way for way in ways), np.atleast_2d(values), strict=True)
        return library("pandas").DataFrame(columns)

    def _title(self) -> str:
        return f"Table: {self.name}"

    def _rows(self) -> Iterable[Row]:
        ends = between([100.0 * share for share in self.share95])
        interval = f"({ends} %, {self.windows} windows)"
        return [
            Row(self.signals[0], self.points),
            Row("values", self.values, self.unit),
            Row("RMS along the record", self.rms, self.unit),
            Row("share of the residual's power", f"{100.0 * self.share:.0f} %", "", interval),
        ]

    def plot(self, ax: Any = None) -> Any:
        """Draw the table with its 95 % band, into ``ax`` or a new figure; returns the Axes."""
        return view("loop_plots.table")(self, ax)


@dataclass(frozen=True, repr=False, eq=False)
class FrictionMap(Result):
    """Torque over speed of runs at steady speed, one point for each run.

    ``w`` (n,), ``u`` (n,) and its standard ``error`` (n,), SI; ``held_out`` (n,) marks what no
    fit saw before the errors were taken. ``at`` (m,) are speeds over which ``curves`` maps
    "refitted" and "augmented" to torque (m,). ``swing`` are the orders of a turn at which the
    torque swings, each with its amplitude and 95 % interval.
    """

    w: np.ndarray
    u: np.ndarray
    error: np.ndarray
    held_out: np.ndarray
    at: np.ndarray
    curves: Mapping[str, np.ndarray]
    motion: str
    swing: tuple[tuple[int, Estimate], ...] = ()

    def summary(self) -> dict[str, Any]:
        """Plain Python, as under "map" in the JSON document."""
        swing = [{"order": n} | e.summary() for n, e in self.swing]
        return picked(self, "w u error held_out") | {"swing": swing}

    def to_frame(self) -> Any:
        """A DataFrame, a row for each run: w, u, error, held_out."""
        return library("pandas").DataFrame(picked(self, "w u error held_out"))

    def _rows(self) -> Iterable[Row]:
        torque = unit_for("N m", self.motion)
        return [
            Row("runs", len(self.w), "", f"({int(self.held_out.sum())} held out)"),
            Row("w", self.w, unit_for("rad/s", self.motion)),
            Row("u", self.u, torque),
            Row("standard error", self.error, torque),
            *(estimated(f"swing, order {n}", e) for n, e in self.swing),
        ]

    def plot(self, ax: Any = None) -> Any:
        """Draw the points with their 95 % bars and the models' curves, into ``ax`` or a new figure;
        returns the Axes."""
        return view("diagnosis_plots.friction_map")(self, ax)


# ---- the table of models: verdict, rows, budget, limits


@dataclass(frozen=True)
class Share(Fields):
    """Where a part of the torque goes."""

    term: str
    rms: float  # N m
    share: float  # of the RMS friction torque, with its 95 % interval
    ci95: tuple[float, float] | None
    signals: tuple[str, ...]  # on which it depends


@dataclass(frozen=True)
class Compared(Fields):
    """A row of the table: how much better it predicts left-out blocks than the declared model."""

    model: str
    elpd: float  # log predictive density relative to it, nats, with its paired standard error
    se: float
    torque: float  # RMS of what it adds, as a share of friction
    parameters: int  # its free ones


@dataclass(frozen=True)
class Detectable(Fields):
    """The smallest share of friction at which an effect would have been seen.

    ``finest``: of waves over theta, those of an order (1/rev; rad/m on linear drives) up to this
    one; windows that average over noise hide finer ones. None for other effects.
    """

    name: str
    share: float
    finest: float | None = None


@dataclass(frozen=True)
class Comparison:
    """What the table says of a record.

    ``rows`` are the models that were compared, ``budget`` says where the torque goes,
    ``detectable`` how small an effect would have been seen. ``least`` is the smallest torque that
    matters, as a share of ``friction``, the RMS friction torque (N m). ``stretches`` counts the
    independent parts of the motion that were compared; None if that is not known.
    """

    verdict: str
    rows: tuple[Compared, ...] = ()
    budget: tuple[Share, ...] = ()
    detectable: tuple[Detectable, ...] = ()
    least: float = 0.0
    friction: float = 0.0
    stretches: int | None = None

    def summary(self) -> dict[str, Any]:
        """Its keys of the JSON document."""
        limits = self.detectable if self.verdict == "adequate" else None
        return plain({"budget": self.budget, "comparison": self.rows, "detectable": limits})


# ---- the joint distribution of fitted parameters, and the tests of what a fit leaves


LAGS = 25
TINY = 1e-150  # its square is still above 0
BOUND = 2.576  # standard deviations of a 99 % bound


@dataclass(frozen=True, eq=False, repr=False)
class Joint(Result):
    """The joint normal distribution of the free parameters around their fitted values.

    Attributes
    ----------
    names : tuple of str
        The free parameters.
    values : ndarray (n,)
        Their fitted values, SI.
    matrix : ndarray (n, n)
        Their covariance. Fc and Fv, for example, are strongly correlated.
    positive : ndarray (n,) of bool
        Those that are drawn as log-normal, since they are above 0.
    """

    names: tuple[str, ...]
    values: np.ndarray
    matrix: np.ndarray
    positive: np.ndarray

    @property
    def correlation(self) -> np.ndarray:
        """The correlation of the parameters, (n, n)."""
        size = np.sqrt(np.maximum(np.diag(self.matrix), 1e-300))
        return self.matrix / np.outer(size, size)

    @property
    def _sizes(self) -> np.ndarray:
        """Standard deviations of the values, or of their logarithms where ``positive``."""
        size = np.sqrt(np.maximum(np.diag(self.matrix), 0.0))
        ratio = size / np.where(self.positive, self.values, 1.0)
        return np.where(self.positive, np.sqrt(np.log1p(ratio**2)), size)

    def _away(self, steps: np.ndarray) -> np.ndarray:
        """The values, moved by steps of these sizes."""
        return np.where(self.positive, self.values * np.exp(steps), self.values + steps)

    def interval(self) -> np.ndarray:
        """The 95 % interval of each parameter by itself, (n, 2)."""
        half = Z95 * self._sizes
        return np.column_stack([self._away(-half), self._away(half)])

    def sample(self, n: int, seed: Any = None) -> dict[str, np.ndarray]:
        """n random sets of parameters: name -> (n,).

        A log-normal one has its value as median, and the logarithm's variance is
        log(1 + variance/value^2), that of the log-normal distribution with these moments.
        """
        n = whole(n, "n, the number of samples,", least=1)
        size = self._sizes
        C = self.correlation * np.outer(size, size)
        w, V = np.linalg.eigh(0.5 * (C + C.T))
        draws = np.random.default_rng(seed).standard_normal((n, len(w)))
        steps = (draws * np.sqrt(np.maximum(w, 0.0))) @ V.T
        return dict(zip(self.names, self._away(steps).T, strict=True))

    def summary(self) -> dict[str, Any]:
        return picked(self, "names matrix")

    def to_frame(self) -> Any:
        """The covariance as a DataFrame; InputError where pandas is not installed."""
        names = list(self.names)
        return library("pandas").DataFrame(self.matrix, index=names, columns=names)

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> np.ndarray:
        return np.array(self.matrix, dtype=dtype)

    def _title(self) -> str:
        return "Covariance of the fitted parameters"

    def _rows(self) -> Iterable[Row]:
        strong = np.abs(np.tril(self.correlation, -1))
        for at in np.argsort(strong, axis=None)[::-1][:3]:
            i, k = np.unravel_index(at, strong.shape)
            if strong[i, k] > 0:
                name = f"correlation of {self.names[k]} and {self.names[i]}"
                yield Row(name, float(self.correlation[i, k]))


@dataclass(frozen=True, eq=False, repr=False)
class Residuals(Result):
    """What one-step predictions leave, with its correlation in time and with the torque.

    Attributes
    ----------
    signal : str
        The signal of the prediction errors.
    lags : ndarray (k,)
        In samples.
    autocorrelation, cross : ndarray (k,)
        Of the residual, and of the residual with u that many samples earlier.
    bound : float
        99 % bound of both for a model that misses nothing.
    """

    signal: str
    lags: np.ndarray
    autocorrelation: np.ndarray
    cross: np.ndarray
    bound: float

    @property
    def white(self) -> bool:
        """Whether the residual does not predict itself: all but a few lags are in the bound."""
        return bool(np.mean(np.abs(self.autocorrelation[1:]) < self.bound) > 0.9)

    @property
    def independent(self) -> bool:
        """Whether the residual does not depend on the torque before."""
        return bool(np.mean(np.abs(self.cross) < self.bound) > 0.9)

    def summary(self) -> dict[str, Any]:
        return picked(self, "signal lags autocorrelation cross bound white independent")

    def to_frame(self) -> Any:
        """A DataFrame: a row for each lag; InputError where pandas is not installed."""
        columns = picked(self, "autocorrelation cross")
        return library("pandas").DataFrame(columns, index=self.lags)

    def plot(self, ax: Any = None) -> Any:
        """Draw both correlations with their bound, into ``ax`` or a new figure."""
        return view("diagnosis_plots.correlations")(self, ax)

    def _title(self) -> str:
        return f"Residuals of {self.signal}"

    def _rows(self) -> Iterable[Row]:
        yield Row("white", "yes" if self.white else "no")
        yield Row("independent of u", "yes" if self.independent else "no")


def residuals_of(signal: str, e: np.ndarray, u: np.ndarray) -> Residuals:
    """The tests of prediction errors e, (windows, length), beside the torque u of their shape."""
    lags = np.arange(min(LAGS, e.shape[1] - 1) + 1)
    du = np.diff(u, axis=1, prepend=u[:, :1])  # a held torque repeats itself
    e, du = (x / max(rms(x), TINY) for x in (e - e.mean(), du))
    own, with_u = (
        np.array([np.mean(e[:, k:] * x[:, : e.shape[1] - k]) for k in lags]) for x in (e, du)
    )
    return Residuals(signal, lags, own, with_u, BOUND / float(np.sqrt(e.size)))


# ---- the answers of the torque balance and of the bench tests


LEVELS = ("J", "Fc", "Fv")  # inertia and friction: terms of every drive
NEEDS = {"J": "faster changes of speed", "Fc": "both directions, or rests", "Fv": "other speeds"}
ONE_WAY = " + constant_torque"  # what a friction torque holds beside itself in one direction
ALONE = " In one direction Fc holds a constant torque, too."


@dataclass(frozen=True)
class Combination:
    """A sum of parameters that is certain where its parts are not."""

    text: str
    value: float
    unit: str
    ci95: tuple[float, float] | None  # None where nothing is left to tell its error
    to_separate: str
    parts: Mapping[str, float] = field(default_factory=dict, hash=False)  # factors by name

    def summary(self) -> dict[str, Any]:
        return picked(self, "text value unit ci95 to_separate")


@dataclass(frozen=True)
class CurvePoint(Fields):
    """Mean friction torque in a bin of speeds, or of a run at steady speed."""

    w: float
    torque: float
    ci95: tuple[float, float] | None  # None where nothing is left to tell its error
    samples: int


@dataclass(frozen=True, eq=False)
class Residual:
    """What remains of u in each window in motion: time, run, torque."""

    t: np.ndarray
    run: np.ndarray
    value: np.ndarray

    def along(self, one: Stretch) -> dict[str, np.ndarray]:
        """t, theta, w and what is left in the windows of a stretch."""
        at = (self.run == one.run) & (self.t >= one.t[0]) & (self.t <= one.t[-1])
        theta: Any = np.full(len(one.t), np.nan) if one.theta is None else one.theta
        w = np.gradient(theta, one.t) if one.w is None else one.w
        made = {"t": one.t, "theta": theta, "w": w}
        made = {k: np.interp(self.t[at], one.t, x) for k, x in made.items()}
        return made | {"left": self.value[at]}


@dataclass(frozen=True, repr=False)
class BenchTable(Fields, Shown):
    """``columns`` are names with units; a row holds numbers or words, None where unknown."""

    columns: tuple[str, ...]
    rows: tuple[tuple[Any, ...], ...]


@dataclass(frozen=True, repr=False)
class BenchTest(Shown):
    """A bench test that was recognised in the logs."""

    kind: str  # breakaway_ramps, slow_scan, coast_down, free_swing, steps_and_pulses, staircase
    text: str  # the answer in one sentence
    values: Mapping[str, Estimate] = field(default_factory=dict)  # what the test is done for
    table: BenchTable | None = None

    def summary(self) -> dict[str, Any]:
        return picked(self, "kind text values" + " table" * (self.table is not None))

    def _title(self) -> str:
        return f"Bench test: {self.kind}"

    def _rows(self) -> Iterable[Row]:
        return [estimated(k, e) for k, e in self.values.items()]


def in_words(values: Mapping[str, Estimate]) -> str:
    """Values with their intervals: "Fc 0.120 N m (0.118 to 0.122), ..."."""
    shown = {name: with_interval(e) for name, e in values.items()}
    parts = [f"{k} {value} {values[k].unit} ({ends})" for k, (value, ends) in shown.items()]
    return ", ".join(parts)


@dataclass(frozen=True, eq=False, repr=False)
class Balance(Result):
    """The plain answer of a torque balance.

    Attributes
    ----------
    parameters, uncertain : dict of Estimate
        The certain parameters, and those whose interval is too wide to be an answer.
    combinations : tuple of Combination
        Sums that are certain where their parts are not.
    curve : tuple of CurvePoint
        Friction torque over speed, in both directions.
    left : float or None
        RMS of the residual as a share of the RMS torque.
    notes, reading : tuple of str
        What the balance noticed, and how the logs were read, in sentences.
    names, covariance : tuple of str, ndarray
        All parameters, certain or not, and their joint covariance.
    is_map : bool
        True if the runs keep one speed each.
    stretches : tuple of Stretch
        The samples that it was computed from.
    refused : str
        Why nothing can be learnt of the drive; empty where something can.
    unlike : tuple of str
        A sentence for each run in another unit or sign than the others. These runs are left out.
    against : tuple of str
        A sentence for each held or bounded value of the model that the log contradicts by far.
    hopeless : bool
        With these values nothing can be answered.
    bench_tests : tuple of BenchTest
        The standard tests that the logs hold, each with its answer.
    """

    parameters: Mapping[str, Estimate] = field(default_factory=dict)
    uncertain: Mapping[str, Estimate] = field(default_factory=dict)
    combinations: tuple[Combination, ...] = ()
    curve: tuple[CurvePoint, ...] = ()
    left: float | None = None
    seconds: float = 0.0
    notes: tuple[str, ...] = ()
    names: tuple[str, ...] = ()
    covariance: np.ndarray = field(default_factory=lambda: np.zeros((0, 0)))
    is_map: bool = False
    half_width: float | None = None
    residual: Residual | None = None
    stretches: tuple[Stretch, ...] = ()
    motion: str = "rotary"
    reading: tuple[str, ...] = ()
    unlike: tuple[str, ...] = ()
    refused: str = ""
    against: tuple[str, ...] = ()
    hopeless: bool = False
    bench_tests: tuple[BenchTest, ...] = ()

    @property
    def said(self) -> tuple[str, ...]:
        """All sentences: what makes the log impossible, how it was read, what was noticed."""
        return (*self.against, *self.reading, *self.notes)

    @property
    def why_not(self) -> tuple[str, ...]:
        """Why the log does not give an inertia or a friction that stands in no sum, either."""
        in_sums = {k for c in self.combinations for k in c.parts}
        return tuple(
            f"{k} is not certain, {between(e.ci95)} {e.unit}: that needs {how}."
            for k, how in NEEDS.items()
            if k not in in_sums and (e := self.uncertain.get(k)) and e.ci95
        )

    def values(self) -> dict[str, float]:
        """The best value of every parameter, certain or not: start values for a finer fit."""
        both = {**self.uncertain, **self.parameters}
        return {k: both[k].value for k in self.names if k in both}

    def summary(self) -> dict[str, Any]:
        """The answer as plain Python values, as under "plain" in the JSON document."""
        more = " bench_tests" * bool(self.bench_tests)
        return picked(self, "parameters combinations curve left seconds" + more)

    def to_frame(self) -> Any:
        """A DataFrame of the certain parameters: value, low, high, unit."""
        rows = {
            k: {"value": e.value, "low": ends[0], "high": ends[1], "unit": e.unit}
            for k, e in self.parameters.items()
            if (ends := e.ci95 or (None, None))
        }
        return library("pandas").DataFrame.from_dict(rows, orient="index")

    def plot(self) -> Any:
        """Draw the log as it was read, the friction curve and the fit; returns the Axes."""
        return view("diagnosis_plots.plot")(self)

    def _title(self) -> str:
        return "Plain torque balance"

    def _rows(self) -> Iterable[Row]:
        rows = [Row(test.kind, test.text) for test in self.bench_tests]
        rows += [estimated(k, e) for k, e in self.parameters.items()]
        rows += [estimated(one.text, one) for one in self.combinations]
        if self.left is not None:
            rows.append(Row("left", f"{100.0 * self.left:.2g} %", "", "of the RMS torque"))
        return [*rows, *noticed((*self.against, *self.why_not, *self.notes, *self.reading), "said")]


def friction(balance: Balance, w: np.ndarray, side: np.ndarray | float) -> np.ndarray:
    """The friction torque of the plain fit at speeds w in the direction ``side``."""
    values = balance.values()
    return values.get("Fc", 0.0) * side + values.get("Fv", 0.0) * w

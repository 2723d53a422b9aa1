"""One run of a net: flow with error control and located events, and sampled updates.

The net is traced, or its sampled blocks, or all blocks, are called; or it ends badly: it grows
without bound, is no number, or never settles.
"""

from __future__ import annotations

import contextlib
import copy
import threading
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np

from ..core.errors import Diverged
from .adaptive_step import run_code
from .backend import call, compiler, kind_of, laid_out, load, load_steps
from .graph import Node, symbols_in
from .python_source import Section, indent
from .tracer import Hybrid, Net, Program, traced_net

BOUND = 1e15  # of what starts and drives a run: beyond it no digit of a double is about the start
HALVED = 1e-4  # in the first half of the run at most this part: it grows like an exponential
SIGN = (
    " Does the feedback have the right sign? The controllers here act on e = measured - reference."
)
STEPS = 5000  # of a solver that may be held at one time
LITTLE = 1e-4  # of the whole time


def bounded(
    name: str,
    t: np.ndarray,
    rows: Sequence[np.ndarray],
    labels: Callable[[], Sequence[Sequence[str]]],
    driven: Sequence[np.ndarray],
    *,
    looped: bool,
) -> None:
    """Raise Diverged, with signal and time, where a row of arrays (n, N) grows without bound or is
    not a number; the largest of ``driven``, at least 1, is the size of the run."""
    size = max([1.0, *(float(np.max(np.abs(part))) for part in driven if np.size(part))])
    large = [np.size(group) and not np.abs(group).max() <= BOUND * size for group in rows]
    for i, names in enumerate(labels() if any(large) else ()):
        group = rows[i]
        found = []
        for row, label in zip(group if large[i] else (), names, strict=False):
            beyond = ~(np.abs(row) <= BOUND * size)
            k, early = int(np.argmax(beyond)), np.abs(row[t <= 0.5 * (t[0] + t[-1])]).max()
            grows = early <= HALVED * np.abs(row).max()  # like an exponential
            if beyond.any() and (grows or not np.isfinite(row).all()):
                found.append((k, label, row[k]))
        if found:
            k, label, value = min(found, key=lambda one: one[0])
            said = f"{name}: {label} grows without bound: it is {value:.3g} at t = {t[k]:.6g} s."
            raise Diverged(said + (SIGN if looped else ""))


def first_bad(t: np.ndarray, y: np.ndarray) -> tuple[int, int, str] | None:
    """Return row, sample and "nan at t = 1 s" of the earliest value that is not finite."""
    if np.isfinite(y).all():
        return None
    k, i = np.argwhere(~np.isfinite(y.T))[0]
    return int(i), int(k), f"{y[i, k]} at t = {t[k]:.6g} s."


def warn_unsettled(name: str, when: float, stacklevel: int) -> None:
    """Warn of a sign that switches without end near a time (nan: none does)."""
    if np.isfinite(when):
        warnings.warn(
            f"{name}: a sign or comparison switches without end near t = {when:.6g} s; the result "
            "there is coarse: write np.tanh(w/eps) for np.sign(w).",
            RuntimeWarning,
            stacklevel=stacklevel + 1,
        )


def chatter(name: str, seconds: float) -> Callable[[float, np.ndarray], float]:
    """An event function for ``solve_ivp`` that never occurs: it sees every step, and raises
    Diverged where a comparison in a block holds the solver at one time."""
    seen: list[float] = [-np.inf]

    def event(t: float, x: np.ndarray) -> float:
        seen.append(t)
        if len(seen) > STEPS:
            if t - seen[0] < LITTLE * seconds:
                raise Diverged(
                    f"{name}: a comparison (an if) in a block switches without end near "
                    f"t = {t:.6g} s: write np.where for it, or np.tanh(x/eps) for a sign."
                )
            seen[:] = [t]
        return 1.0

    return event


@dataclass(frozen=True)
class Accuracy:
    """The error allowed in a step: relative to the size of a state, and near zero in its unit."""

    rtol: float
    atol: float | None = None

    @property
    def floor(self) -> float:
        """The value of a state below which its error is absolute."""
        return 1e-9 if self.atol is None else float(self.atol) / float(self.rtol)


@dataclass(frozen=True)
class Course:
    """The times ``grid`` (N,) at which a net is stepped, the external inputs ``given`` (m, N), the
    updates ``flags`` (groups, N) of :class:`Hybrid`, and the places to keep."""

    grid: np.ndarray
    given: np.ndarray
    flags: np.ndarray
    hold: bool
    kept: Any = field(default_factory=lambda: slice(None))

    @classmethod
    def along(cls, t: np.ndarray, u: np.ndarray, groups: int, hold: bool) -> Course:
        """Return a course with updates of all sample times at each time, all of them kept."""
        return cls(t, u, np.ones((groups, len(t))), hold)

    @property
    def ticks(self) -> np.ndarray:
        return np.asarray((self.flags > 0.0).any(axis=0))


@dataclass(frozen=True)
class Track:
    """Continuous states, sampled states before the updates, and signals at the grid points;
    ``unsettled`` is the last time at which a relay did not come to rest (nan: never)."""

    x: np.ndarray
    q: np.ndarray
    y: np.ndarray
    unsettled: float = np.nan
    steps: int = 0

    def at(self, kept: Any) -> Track:
        """The track at these grid points."""
        return replace(self, x=self.x[:, kept], q=self.q[:, kept], y=self.y[:, kept])


@dataclass(frozen=True)
class Now:
    """Where a run is: continuous and sampled states, held values, and sizes (``Engine.run``)."""

    x: np.ndarray
    q: np.ndarray
    h: np.ndarray
    sizes: np.ndarray

    @classmethod
    def start(cls, x: Any, q: Any, held: int) -> Now:
        x, q = np.array(x, dtype=float), np.array(q, dtype=float)
        return cls(x, q, np.zeros(held), np.zeros(3 * len(x)))


def chosen_backend() -> str:
    """What runs a single system here: "c" or "numba" where there is one, else "python"."""
    return compiler() or "python"


_HERE = threading.local()
FEW = 2000  # grid points; 25 times as many if there are no continuous states


@contextlib.contextmanager
def interpreted() -> Iterator[None]:
    """Nets that this thread runs meanwhile stay in plain Python: for short runs of many nets."""
    before, _HERE.plain = getattr(_HERE, "plain", False), True
    try:
        yield
    finally:
        _HERE.plain = before


class Engine:
    """The generated run of a net; always picklable without its equations (:meth:`portable`).

    ``backend`` None: plain Python up to FEW points, then the first one available.
    """

    def __init__(self, hybrid: Hybrid, backend: str | None = None) -> None:
        self.hybrid, self.backend = hybrid, backend
        self.net, self.name, self.outputs = hybrid.net, hybrid.net.name, hybrid.flow.outputs
        self.states, self.held = hybrid.flow.states, len(hybrid.net.held) if hybrid.ticked else 0
        self.right = set[bytes]()  # signs of parameters for which the feedback has the right sign
        self._points = 0
        self._code: dict[str, str] = {}
        self._runs: dict[str, Any] = {}

    @property
    def program(self) -> Program:
        return self.hybrid.flow

    def of(self, hybrid: Hybrid) -> Engine:
        """The same code for equations of the same outline, which may have other defaults."""
        other = Engine(hybrid, self.backend)
        other._code, other._runs, other.right = self._code, self._runs, self.right
        return other

    def portable(self) -> Engine:
        """The code alone: functions of a user may not pickle, and expression graphs are deep."""
        self._text(kind_of(self.backend or "python"))
        other = object.__new__(Engine)
        other.__dict__ |= {
            k: v for k, v in vars(self).items() if k not in ("hybrid", "net", "_runs")
        }
        return other

    def loaded(self) -> Engine:
        """A copy of a portable run for one worker, compiled with what it has: threads share this
        one, and machine code is in the cache."""
        other = copy.copy(self)
        if other.backend != "python":
            other.backend = compiler() or other.backend
        other._runs = {}
        return other

    def _text(self, kind: str) -> str:
        if kind not in self._code:
            self._code[kind] = run_code(self.hybrid, kind)
        return self._code[kind]

    def run(self, course: Course, now: Now, p: np.ndarray, accuracy: Accuracy) -> Track:
        """The track from ``now``, which is moved to its end; Diverged with state and time."""
        backend = self._chosen(len(course.grid))
        if backend not in self._runs:
            self._runs[backend] = load_steps(self._text(kind_of(backend)), backend).run
        counts = len(now.x), len(now.q), len(self.outputs)
        x, q, y = (np.empty((count, len(course.grid))) for count in counts)
        status = np.array([0.0, 0.0, 0.0, np.nan, 0.0])
        given = (course.grid, course.given, course.ticks, course.flags, bool(course.hold))
        given = (*given, p, float(accuracy.rtol), accuracy.floor)
        filled = [now.x, now.q, now.h, now.sizes, x, q, y, status]
        code = call(self._runs[backend], backend, laid_out(given, backend), filled)
        if code == 1:
            raise Diverged(
                f"{self.name}: state {self.states[int(status[2])]} grows without bound, is not a "
                f"number, or changes faster than steps can follow, at t = {status[1]:.6g} s."
            )
        if code == 2:
            raise Diverged(not_finite(self.net, now.q, now.h, status[1]))
        return Track(x, q, y, float(status[3]), int(status[4]))

    def follow(
        self, course: Course, x: np.ndarray, q: np.ndarray, p: np.ndarray, accuracy: Accuracy
    ) -> Track:
        """The track at the kept points from the continuous states x and the sampled ones q."""
        return self.run(course, Now.start(x, q, self.held), p, accuracy).at(course.kept)

    def _chosen(self, points: int) -> str:
        """The backend for so many more points."""
        if self.backend is not None:
            return self.backend
        self._points += points
        few = FEW if self.states else 25 * FEW
        plain = getattr(_HERE, "plain", False) or self._points <= few
        return "python" if plain else compiler() or "python"


def not_finite(net: Net, q: np.ndarray, h: np.ndarray, t: float) -> str:
    """The sampled block with an output or a state that is not a number."""
    outputs = [(net.parts[i].block, net.parts[i].outputs[j]) for i, j in net.held]
    found = [(f"output {k} of block {b.name}", v) for (b, k), v in zip(outputs, h, strict=True)]
    for part, place in zip(net.parts, net.places, strict=True):
        labels = part.block.state_labels if part.sampled and part.nstates else ()
        rows = zip(labels, q[place], strict=False)
        found += [(f"state {k} of block {part.block.name}", v) for k, v in rows]
    what = next((f"{k} is {v}" for k, v in found if not np.isfinite(v)), "a signal is no number")
    return f"{net.name}: {what} at t = {t:.6g} s."


class Called:
    """A net evaluated by its blocks' own functions; ``method`` is one of ``solve_ivp`` for the
    flow, None: the traced flow, with a TraceError if it cannot be traced."""

    def __init__(
        self, net: Net, params: Mapping[str, Any] | None = None, method: str | None = None
    ) -> None:
        self.net, self.params, self.method, self.engine = net, params, method, None
        if method is None and net.count(False) > 0:
            flow = traced_net(net, params, ticks=False)
            flow.check()
            self.engine = Engine(flow, chosen_backend())
        self.hybrid = made = traced_net(net, params, called=True)
        self._rates = self._function(made.flow.xdot)
        self._shown = self._function(made.flow.y)
        self._updated = self._function(made.ticked)

    def _function(self, nodes: Sequence[Node]) -> Callable[..., list[float]]:
        """The values of nodes at t, x, u, with the held values before a tick, q and flags."""
        flow = self.hybrid.flow
        section = Section([f"row{i}" for i in range(len(nodes))], nodes, "v")
        read = [name for name in sorted(symbols_in(nodes)) if name != "t"]
        lines = [f"{name} = {name[0]}[{name[1:]}]" for name in read] + section.lines(True)
        lines += [f"return [{', '.join(section.names)}]"]
        text = f"{section.robust()}def found(p, called, t, x, u, b=(), q=(), g=()):\n"
        found = load(text + indent(lines, 1), "python").found
        return partial(found, flow.arguments(self.params).tolist(), flow.graph.called)

    def follow(self, course: Course, x: np.ndarray, q: np.ndarray, accuracy: Accuracy) -> Track:
        """As :meth:`Engine.follow`; SciPy integrates in one run where that can be."""
        now, net, unsettled = Now.start(x, q, len(self.net.held)), self.net, np.nan
        event = chatter(net.name, course.grid[-1] - course.grid[0])
        atol = 1e-4 * accuracy.rtol if accuracy.atol is None else accuracy.atol
        options = {"method": self.method or "LSODA", "rtol": accuracy.rtol, "atol": atol}
        options |= {"events": event}
        ticks, last, rows, whole = course.ticks, len(course.grid) - 1, ([], [], []), None
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            # LSODA warns of convergence; the error names state and time
            warnings.filterwarnings("ignore", "lsoda", UserWarning)
            if last and len(x) and not (self.engine or net.groups or course.hold):
                whole = self._solved(course, now, options)
            for k, t in enumerate(course.grid):
                u, before = course.given[:, k], now.h.copy()
                rows[1].append(now.q.copy())
                if ticks[k]:
                    new = self._updated(t, now.x, [*u, *now.h], (), now.q, course.flags[:, k])
                    now.q[:], now.h[:] = new[: len(now.q)], new[len(now.q) :]
                    if not np.isfinite(new).all():
                        raise Diverged(not_finite(net, now.q, now.h, t))
                rows[0].append(now.x.copy())
                rows[2].append(self._shown(t, now.x, [*u, *now.h], before))
                if k == last or not len(x):
                    continue
                part = Course.along(
                    course.grid[k : k + 2], course.given[:, k : k + 2], 0, course.hold
                )
                if whole is not None:
                    now.x[:] = whole[:, k + 1]
                elif self.engine is None:
                    now.x[:] = self._solved(part, now, options)[:, -1]
                else:
                    p, moved = self.engine.program.arguments(self.params), replace(now, q=q[:0])
                    relay = self.engine.run(part, moved, p, accuracy).unsettled
                    unsettled = relay if np.isnan(unsettled) else unsettled
        x, q, y = (np.reshape(part, (last + 1, -1)).T for part in rows)
        return Track(x, q, y, unsettled).at(course.kept)

    def _solved(self, course: Course, now: Now, options: Any) -> np.ndarray:
        """States (n, N) at the times of a course."""
        t, given, last = course.grid, course.given, len(course.grid) - 2

        def rates(time: float, x: np.ndarray) -> list[float]:
            k = min(int(np.searchsorted(t[1:], time, side="right")), last)
            share = 0.0 if course.hold else (time - t[k]) / (t[k + 1] - t[k])
            u = given[:, k] + share * (given[:, k + 1] - given[:, k])
            return self._rates(time, x, [*u, *now.h])

        from scipy.integrate import solve_ivp  # slow to import

        done = solve_ivp(rates, (t[0], t[-1]), now.x, t_eval=t, **options)
        end = done.y[:, -1] if done.y.size else now.x
        if not done.success or not np.isfinite(end).all():
            i = int(np.argmax(np.where(np.isfinite(end), np.abs(end), np.inf)))
            label, why = self.net.states(sampled=False)[i], done.message.rstrip(".")
            raise Diverged(
                f"{self.net.name}: the solver stops at t = {done.t[-1]:.6g} s, where state {label} "
                f"is {end[i]:.3g}: {why}.{SIGN if self.net.looped else ''}"
            )
        return done.y

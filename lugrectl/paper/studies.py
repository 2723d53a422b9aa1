"""The studies: the source paper's two loops, in its own scenarios and in further ones.

A study is cases and compensations: a table of RMS values.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import control as ct
import numpy as np

from ..core.result import picked

PREFILTER = 2.0  # 1/s, the source paper's 2/(s + 2)
VELOCITY = {"kp": 1.6, "ki": 0.16}
POSITION = {"kp": 15.0, "ki": 1.55, "kd": 0.0}
PERCENT = (-30, -20, -10, 0, 10, 20, 40)


@dataclass(frozen=True)
class Compensation:
    """A friction compensation with its gains, or a controller without compensation."""

    name: str  # the column's heading
    label: str  # observer and gains
    observer: str | None = None
    # K1, K2, k of the observer, or kp, ki in place of those of the study's controller
    gains: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Reference:
    """``offset`` + ``size`` sin(2 pi f t + ``phase``) in rad/s or rad, f in Hz; ``prefilter``:
    filtered by 2/(s + 2)."""

    offset: float = 0.0
    size: float = 0.0
    hertz: float = 1.0
    phase: float = 0.0
    prefilter: bool = False

    def inputs(self, t: np.ndarray, loop: str, feedforward: bool) -> np.ndarray:
        """(2, N): r, and its first (velocity) or second (position) derivative, or 0 for none."""
        turn = 2 * np.pi * self.hertz
        sin, cos = (self.size * f(turn * t + self.phase) for f in (np.sin, np.cos))
        r, first, second = self.offset + sin, turn * cos, -(turn**2) * sin
        if self.prefilter:
            command: Any = r
            smooth = ct.tf([PREFILTER], [1, PREFILTER])
            _, r = ct.forced_response(smooth, t, command)
            first = PREFILTER * (command - r)
            second = PREFILTER * (turn * cos - first)
        rate = first if loop == "velocity" else second
        return np.array([r, rate if feedforward else 0.0 * t])


@dataclass(frozen=True)
class Measure:
    """An RMS value of a signal over a window in s."""

    signal: str
    unit: str
    window: tuple[float, float]


@dataclass(frozen=True)
class Case:
    """One simulation for each compensation, and the measures of it."""

    label: str
    reference: Reference
    measures: tuple[Measure, ...]
    scale: Mapping[str, float] = field(default_factory=dict)  # on the observer's parameters
    start: Mapping[str, float] = field(default_factory=dict)  # states by label, of any observer
    feedforward: bool = False
    duration: float = 5.0
    dt: float = 1e-3

    def off(self, percent: float, *names: str) -> Case:
        """Return the case with some of the observer's parameters wrong."""
        said = [f"{percent:+g} %" if percent else "exact", *[self.label] * bool(self.label)]
        scale = {name: 1 + percent / 100 for name in names}
        return replace(self, label=", ".join(said), scale=scale)


def each_off(case: Case, percent: Iterable[float], *names: str) -> tuple[Case, ...]:
    return tuple(case.off(q, *names) for q in percent)


@dataclass(frozen=True)
class Drawn:
    """The picture of a study: a signal of one case over time; a sweep's shows its table."""

    case: int
    signal: str
    unit: str
    span: tuple[float, float]  # s
    columns: tuple[str, ...] = ()  # empty for all
    log: bool = False  # magnitude, logarithmic


NONE = Compensation("none", "no observer")
PAPERS = {"K1": -10.24, "K2": 22.0}
PROPOSED = Compensation("proposed", "proposed observer, K1 = -10.24, K2 = 22", "proposed", PAPERS)
KS = (0.35, 5.0, 20.0)
OBSERVERS = (
    NONE,
    Compensation("natural", "natural observer", "natural"),
    *(Compensation(f"k {k:g}", f"existing observer, k = {k:g}", "existing", {"k": k}) for k in KS),
    PROPOSED,
)
# sigma1 k and sigma0 k of the existing observer at k = 20, added to the paper's gains
STRONG = (
    Compensation("Ki 160", "no observer, PI with Ki = 160", None, {"kp": 1.6, "ki": 160.0}),
    Compensation(
        "Ki 5200", "no observer, PI with Kp = 13.6, Ki = 5200", None, {"kp": 13.6, "ki": 5200.0}
    ),
)
ALL = OBSERVERS + STRONG


@dataclass(frozen=True)
class Study:
    """Cases and compensations: a table of RMS values and a picture."""

    key: str
    title: str
    scenario: str
    cases: tuple[Case, ...]
    notes: tuple[str, ...] = ()
    loop: str = "velocity"
    controller: Mapping[str, float] = field(default_factory=lambda: VELOCITY)
    compensations: tuple[Compensation, ...] = ALL
    drawn: Drawn | None = None

    def summary(self) -> dict[str, Any]:
        known = picked(self, "key title scenario loop controller")
        return known | {"columns": [asdict(c) for c in self.compensations]}


SINE = Reference(size=0.1)
STEP = Reference(offset=1.0, prefilter=True)
LEVELS = ("Fc", "Fs")
SINE_TEXT = "reference 0.1 sin(2 pi t) rad/s"
VELOCITY_TEXT = "Velocity loop, Kp 1.6, Ki 0.16"
FROM_REST = f"{VELOCITY_TEXT}, no feed-forward, no prefilter, {SINE_TEXT}"
OFF = "The observer's {} as in the first column{}."

STILL = Reference()
RAISED = Reference(0.1, 0.1, 0.5, -np.pi / 2)

MOVES = Case("", SINE, (Measure("e", "rad/s", (1.0, 5.0)),))
EARLY = Case("all right", SINE, (Measure("e", "rad/s", (0.0, 0.5)),))
AT_REST = (Measure("w", "rad/s", (0.0, 5.0)), Measure("F - Fhat", "N m", (4.0, 5.0)))
RESTS = Case("free", STILL, AT_REST, start={"plant_z": 1e-3})
PUSHED = {"plant_w": 0.01}
MINUTE = Case("", STILL, (Measure("w", "rad/s", (1.0, 60.0)),), {}, PUSHED, False, 60.0, 2e-3)
EARLY_LATE = (Measure("e", "rad", (1.0, 5.0)), Measure("e", "rad", (60.0, 100.0)))
LONG = Case("", STEP, EARLY_LATE, duration=100.0, dt=2e-3)
WAVE = Case("", RAISED, (Measure("e", "rad", (2.0, 8.0)),), duration=8.0)


def mismatch(key: str, *names: str, notes: tuple[str, ...] = ()) -> Study:
    """The velocity loop with some of the observer's parameters wrong by -30 to +40 %."""
    what = " and ".join(names)
    return Study(
        key,
        f"Velocity loop, observer's {what} wrong",
        f"{FROM_REST}, all states 0 at the start. "
        f"{OFF.format(what, ', its other parameters exact')}",
        each_off(MOVES, PERCENT, *names),
        notes=notes,
    )


def _of_gains(name: str, controller: Mapping[str, float]) -> str:
    gains = ", ".join(f"{k.capitalize()} {v:.4g}" for k, v in controller.items() if v)
    return f"Position loop, {name}, {gains}"


def position(
    key: str, title: str, name: str, controller: Mapping[str, float], notes: tuple[str, ...] = ()
) -> Study:
    """A step of 1 rad on a position loop, for 100 s."""
    return Study(
        key,
        title,
        f"{_of_gains(name, controller)}; reference a step of 1 rad through the prefilter "
        f"2/(s + 2), 100 s, all states 0 at the start. {OFF.format('Fc and Fs', '')} "
        "FF: feed-forward J ddr, without the impulse at t = 0. No PF: the bare step.",
        (
            LONG.off(0, *LEVELS),
            replace(LONG, label="FF", feedforward=True).off(0, *LEVELS),
            replace(LONG, label="no PF", reference=Reference(offset=1.0)).off(0, *LEVELS),
            *each_off(LONG, (-20, 20), *LEVELS),
        ),
        notes,
        loop="position",
        controller=controller,
        compensations=OBSERVERS,
        drawn=Drawn(0, "e", "rad", (0.0, 100.0), ("none", "k 0.35", "k 20", "proposed"), True),
    )


STRONG_NOTE = (
    "The existing observer adds sigma1 k and sigma0 k/s (leaky while the drive slides) to the "
    "controller. At k = 20 that is Kp + 12 and Ki + 5200; the last column shows this PI "
    "without any observer. Both have a crossover frequency near 1 kHz, and these simulations "
    "contain no noise, delay, sampling or elasticity."
)
PI_NOTE = (
    "With exact parameters the natural and the proposed observer cancel friction completely; the "
    "remaining frictionless loop is unstable and its oscillation grows. With the existing observer "
    "it grows more slowly (k = 0.35, and k = 5 from the unfiltered step) or becomes a lasting "
    "oscillation. If the estimate is too small (-20 %), the remaining friction stabilises the "
    "loop; if it is too large (+20 %), the oscillation grows faster. Without an observer friction "
    "holds the drive at rest."
)


def all_studies(pid: Mapping[str, float], pd: Mapping[str, float]) -> tuple[Study, ...]:
    """Every study, in the order of the page; ``pid`` and ``pd`` are stable position loops."""
    pi = "The paper's position PI over 100 s"
    same = "Stable {} of the same bandwidth{} over 100 s"
    return (
        mismatch("friction-level", *LEVELS, notes=(STRONG_NOTE,)),
        mismatch("stiffness", "sigma0"),
        *VELOCITY_STUDIES,
        position("position-pi", pi, "the paper's PI", POSITION, (PI_NOTE,)),
        position("position-pid", same.format("PID", ""), "PID", pid),
        position("position-pd", same.format("PD", ", T(s) SPR,"), "PD", pd),
        Study(
            "position-level",
            "Position loop that is stable, observer's Fc and Fs wrong",
            f"{_of_gains('PID', pid)}; reference 0.1 (1 - cos(pi t)) rad, no feed-forward, no "
            f"prefilter, all states 0 at the start. {OFF.format('Fc and Fs', '')}",
            each_off(WAVE, PERCENT, *LEVELS),
            notes=(
                "D acts on the measured speed and delays the motion like viscous friction; too "
                "much friction compensation cancels a part of that.",
            ),
            loop="position",
            controller=pid,
            compensations=OBSERVERS,
        ),
    )


VELOCITY_STUDIES = (
    Study(
        "forward",
        "Velocity loop, with and without feed-forward and prefilter",
        f"{VELOCITY_TEXT}, {SINE_TEXT}, all states 0 at the start; observer's Fc and Fs exact or "
        "20 % low. FF: feed-forward J dr/dt. PF: prefilter 2/(s + 2), error against the filtered "
        "reference, which is 0.3 times as large.",
        tuple(
            replace(
                MOVES,
                label=" ".join(["FF"] * ahead + ["PF"] * smooth),
                reference=replace(SINE, prefilter=smooth),
                feedforward=ahead,
            ).off(q, *LEVELS)
            for q in (0, -20)
            for ahead in (False, True)
            for smooth in (False, True)
        ),
        drawn=Drawn(6, "e", "rad/s", (1.0, 3.0)),
    ),
    Study(
        "initial",
        "Velocity loop, wrong initial state",
        f"{FROM_REST}, parameters exact. "
        "z +-1.1: the drive's bristles start with a deflection of 1.1 mrad (full sliding "
        "friction), those of the observers with 0. what 0.1: the proposed observer, the only one "
        "with that state, starts at what = 0.1 rad/s.",
        (
            EARLY,
            replace(EARLY, label="z +1.1", start={"plant_z": 1.1e-3}),
            replace(EARLY, label="z -1.1", start={"plant_z": -1.1e-3}),
            replace(EARLY, label="what 0.1", start={"proposed_observer_what": 0.1}),
        ),
        drawn=Drawn(1, "e", "rad/s", (0.0, 0.5)),
    ),
    Study(
        "standstill",
        "Velocity loop at standstill",
        f"{VELOCITY_TEXT}, reference 0, parameters exact, z(0) = 1 mrad (friction torque "
        "0.26 N m), zhat(0) = 0. Free: the integral is empty. Held: it balances the friction "
        "torque.",
        (RESTS, replace(RESTS, label="held", start={"plant_z": 1e-3, "pi_q": 0.26 / 0.16})),
        (
            "In the case held the drive is at rest (w = 0, e = 0), and only the proposed observer "
            "still corrects its estimate. This has a drawback: the compensation is added to the "
            "torque of the integral action, so the drive moves until the integral has decayed.",
        ),
        compensations=OBSERVERS,
        drawn=Drawn(0, "F - Fhat", "N m", (0.0, 2.0), log=True),
    ),
    Study(
        "over",
        "Velocity loop, over-compensation at rest",
        f"{VELOCITY_TEXT}, reference 0, w(0) = 0.01 rad/s, 60 s. {OFF.format('Fc and Fs', '')}",
        each_off(MINUTE, (0, 10, 20, 40), *LEVELS),
        (
            "With too much friction compensated, rest is not stable with the natural observer: "
            "the drive breaks away by itself, at +20 % more than 10 s after the initial speed.",
        ),
        drawn=Drawn(2, "w", "rad/s", (0.0, 60.0), ("natural", "k 0.35", "proposed", "Ki 160")),
    ),
)

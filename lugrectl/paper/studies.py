"""The studies: the source paper's two loops, in its own scenarios and in further ones.

A study is cases and compensations: a table of RMS values, and a figure.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import control as ct
import numpy as np
from scipy.signal import lfilter

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
    """A reference: ``kind`` "still", "sine" A sin(2 pi f t), "raised" A (1 - cos(2 pi f t)) or
    "step" A; A in rad/s or rad, f in Hz; ``prefilter``: filtered by 2/(s + 2)."""

    kind: str = "still"
    amplitude: float = 0.0
    hertz: float = 1.0
    prefilter: bool = False

    def inputs(self, t: np.ndarray, loop: str, feedforward: bool) -> np.ndarray:
        """(2, N): r, and its first (velocity) or second (position) derivative, or 0 for none."""
        a, w = self.amplitude, 2 * np.pi * self.hertz
        sin, cos, still = a * np.sin(w * t), a * np.cos(w * t), 0.0 * t
        r, first, second = {
            "sine": (sin, w * cos, -(w**2) * sin),
            "raised": (a - cos, w * sin, w**2 * cos),
            "step": (a + still, still, still),
            "still": (still, still, still),
        }[self.kind]
        if self.prefilter:
            command, pole = r, PREFILTER
            # from rest, exact for a command that is linear between equidistant samples
            smooth: Any = ct.TransferFunction([pole], [1, pole]).sample(t[1] - t[0], method="foh")
            b, a = smooth.num[0][0], smooth.den[0][0]
            b = np.r_[np.zeros(len(a) - len(b)), b]
            r = np.asarray(lfilter(b, a, command, zi=[-b[0] * command[0]])[0])
            first, second = pole * (command - r), pole * first - pole**2 * (command - r)
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
    x: float | None = None  # abscissa in a sweep


@dataclass(frozen=True)
class Drawn:
    """The trace to draw: the case's number, its signal with unit, and the time shown in s."""

    case: int
    signal: str
    unit: str
    span: tuple[float, float]
    columns: tuple[str, ...] = ()  # names of the curves, all if empty
    log: bool = False  # magnitude, logarithmic


def _observer(kind: str, **gains: float) -> Compensation:
    said = ", ".join(f"{k} = {v:g}" for k, v in gains.items())
    name = said.replace("=", "").replace("  ", " ") if kind == "existing" else kind
    return Compensation(name, f"{kind} observer{', ' * bool(said)}{said}", kind, gains)


NONE = Compensation("none", "no observer")
PROPOSED = _observer("proposed", K1=-10.24, K2=22.0)
EXISTING = tuple(_observer("existing", k=k) for k in (0.35, 5.0, 20.0))
OBSERVERS = (NONE, _observer("natural"), *EXISTING, PROPOSED)
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
    """Cases and compensations: a table and a figure (a sweep's figure shows the table)."""

    key: str
    title: str
    scenario: str
    cases: tuple[Case, ...]
    drawn: Drawn | None = None
    ranked: tuple[int, ...] = ()
    notes: tuple[str, ...] = ()
    loop: str = "velocity"
    controller: Mapping[str, float] = field(default_factory=lambda: VELOCITY)
    compensations: tuple[Compensation, ...] = ALL

    def summary(self) -> dict[str, Any]:
        known = picked(self, "key title scenario loop controller")
        return known | {"columns": [asdict(c) for c in self.compensations]}


SINE = Reference("sine", 0.1, 1.0)
STEP = Reference("step", 1.0, prefilter=True)
MOVING = Measure("e", "rad/s", (1.0, 5.0))
SINE_TEXT = "reference 0.1 sin(2 pi t) rad/s"
VELOCITY_TEXT = "Velocity loop, Kp 1.6, Ki 0.16"
OFF = "The observer's {} as in the first column{}."


def _percent(value: float) -> str:
    return f"{value:+g} %" if value else "exact"


def _scale(percent: float, *names: str) -> dict[str, float]:
    return {name: 1 + percent / 100 for name in names}


def _swept(case: Case, *names: str) -> tuple[Case, ...]:
    """The case with some of the observer's parameters wrong by -30 to +40 %."""
    return tuple(
        replace(case, label=_percent(q), scale=_scale(q, *names), x=float(q)) for q in PERCENT
    )


def mismatch(key: str, *names: str) -> Study:
    """The velocity loop with some of the observer's parameters wrong by -30 to +40 %."""
    what = " and ".join(names)
    strong = (
        "The existing observer adds sigma1 k and sigma0 k/s (leaky while the drive slides) to the "
        "controller. At k = 20 that is Kp + 12 and Ki + 5200; the last column shows this PI "
        "without any observer. Both have a crossover frequency near 1 kHz, and these simulations "
        "contain no noise, delay, sampling or elasticity."
    )
    level = key == "friction-level"
    return Study(
        key,
        f"Velocity loop, observer's {what} wrong",
        f"{VELOCITY_TEXT}, no feed-forward, no prefilter, {SINE_TEXT}, all states 0 at the "
        f"start. {OFF.format(what, ', its other parameters exact')}",
        _swept(Case("", SINE, (MOVING,)), *names),
        ranked=(1, 3) if level else (1,),
        notes=(strong,) if level else (),
    )


def _ahead(percent: float, forward: bool, smooth: bool) -> Case:
    """The velocity loop with or without feed-forward and prefilter."""
    said = [word for word, on in (("FF", forward), ("PF", smooth)) if on]
    label = " ".join([_percent(percent) + "," * bool(said), *said])
    scale, reference = _scale(percent, "Fc", "Fs"), replace(SINE, prefilter=smooth)
    return Case(label, reference, (MOVING,), scale=scale, feedforward=forward)


FORWARD = Study(
    "forward",
    "Velocity loop, with and without feed-forward and prefilter",
    f"{VELOCITY_TEXT}, {SINE_TEXT}, all states 0 at the start; observer's Fc and Fs exact or "
    "20 % low. FF: feed-forward J dr/dt. PF: prefilter 2/(s + 2), error against the filtered "
    "reference, which is 0.3 times as large.",
    tuple(_ahead(q, ff, pf) for q in (0, -20) for ff in (False, True) for pf in (False, True)),
    Drawn(6, "e", "rad/s", (1.0, 3.0)),
    ranked=(6,),
)
_EARLY = Case("all right", SINE, (Measure("e", "rad/s", (0.0, 0.5)),))
INITIAL = Study(
    "initial",
    "Velocity loop, wrong initial state",
    f"{VELOCITY_TEXT}, no feed-forward, no prefilter, {SINE_TEXT}, parameters exact. "
    "z +-1.1: the drive's bristles start with a deflection of 1.1 mrad (full sliding "
    "friction), those of the observers with 0. what 0.1: the proposed observer, the only one "
    "with that state, starts at what = 0.1 rad/s.",
    (
        _EARLY,
        replace(_EARLY, label="z +1.1", start={"plant_z": 1.1e-3}),
        replace(_EARLY, label="z -1.1", start={"plant_z": -1.1e-3}),
        replace(_EARLY, label="what 0.1", start={"proposed_observer_what": 0.1}),
    ),
    Drawn(1, "e", "rad/s", (0.0, 0.5)),
    ranked=(1,),
)
_RESTING = (Measure("w", "rad/s", (0.0, 5.0)), Measure("F - Fhat", "N m", (4.0, 5.0)))
STANDSTILL = Study(
    "standstill",
    "Velocity loop at standstill",
    f"{VELOCITY_TEXT}, reference 0, parameters exact, z(0) = 1 mrad (friction torque "
    "0.26 N m), zhat(0) = 0. Free: the integral is empty. Held: it balances the friction "
    "torque.",
    (
        Case("free", Reference(), _RESTING, start={"plant_z": 1e-3}),
        Case("held", Reference(), _RESTING, start={"plant_z": 1e-3, "pi_q": 0.26 / 0.16}),
    ),
    Drawn(0, "F - Fhat", "N m", (0.0, 2.0), log=True),
    notes=(
        "In the case held the drive is at rest (w = 0, e = 0), and only the proposed observer "
        "still corrects its estimate. This has a drawback: the compensation is added to the "
        "torque of the integral action, so the drive moves until the integral has decayed.",
    ),
    compensations=OBSERVERS,
)
_MINUTE = Case("", Reference(), (Measure("w", "rad/s", (1.0, 60.0)),), duration=60.0, dt=2e-3)
OVER = Study(
    "over",
    "Velocity loop, over-compensation at rest",
    f"{VELOCITY_TEXT}, reference 0, w(0) = 0.01 rad/s, 60 s. {OFF.format('Fc and Fs', '')}",
    tuple(
        replace(_MINUTE, label=_percent(q), scale=_scale(q, "Fc", "Fs"), start={"plant_w": 0.01})
        for q in (0, 10, 20, 40)
    ),
    Drawn(2, "w", "rad/s", (0.0, 60.0), ("natural", "k 0.35", "proposed", "Ki 160")),
    notes=(
        "With too much friction compensated, rest is not stable with the natural observer: "
        "the drive breaks away by itself, at +20 % more than 10 s after the initial speed.",
    ),
)


def _of_gains(name: str, controller: Mapping[str, float]) -> str:
    gains = ", ".join(f"{k.capitalize()} {v:.4g}" for k, v in controller.items() if v)
    return f"Position loop, {name}, {gains}"


def position(key: str, title: str, controller: Mapping[str, float], **options: Any) -> Study:
    """A step of 1 rad on a position loop, for 100 s; the title begins with the controller."""
    early, late = Measure("e", "rad", (1.0, 5.0)), Measure("e", "rad", (60.0, 100.0))
    long = Case("exact", STEP, (early, late), duration=100.0, dt=2e-3)
    name = {"position-pi": "the paper's PI"}.get(key, key[-3:].strip("-").upper())
    return Study(
        key,
        title,
        f"{_of_gains(name, controller)}; reference a step of 1 rad through the prefilter "
        f"2/(s + 2), 100 s, all states 0 at the start. {OFF.format('Fc and Fs', '')} "
        "FF: feed-forward J ddr, without the impulse at t = 0. No PF: the bare step.",
        (
            long,
            replace(long, label="exact, FF", feedforward=True),
            replace(long, label="exact, no PF", reference=replace(STEP, prefilter=False)),
            replace(long, label="-20 %", scale=_scale(-20, "Fc", "Fs")),
            replace(long, label="+20 %", scale=_scale(20, "Fc", "Fs")),
        ),
        Drawn(0, "e", "rad", (0.0, 100.0), ("none", "k 0.35", "k 20", "proposed")),
        **{"ranked": (0,), **options},
        loop="position",
        controller=controller,
        compensations=OBSERVERS,
    )


def position_mismatch(controller: Mapping[str, float]) -> Study:
    """A moving reference on the stable position loop, observer wrong by -30 to +40 %."""
    wave = Case("", Reference("raised", 0.1, 0.5), (Measure("e", "rad", (2.0, 8.0)),), duration=8.0)
    return Study(
        "position-level",
        "Position loop that is stable, observer's Fc and Fs wrong",
        f"{_of_gains('PID', controller)}; reference 0.1 (1 - cos(pi t)) rad, no feed-forward, no "
        f"prefilter, all states 0 at the start. {OFF.format('Fc and Fs', '')}",
        _swept(wave, "Fc", "Fs"),
        ranked=(1, 5),
        notes=(
            "D acts on the measured speed and delays the motion like viscous friction; too much "
            "friction compensation cancels a part of that.",
        ),
        loop="position",
        controller=controller,
        compensations=OBSERVERS,
    )


PI_NOTES = (
    "With exact parameters the natural and the proposed observer cancel friction completely; the "
    "remaining frictionless loop is unstable and its oscillation grows. With the existing observer "
    "it grows more slowly (k = 0.35, and k = 5 from the unfiltered step) or becomes a lasting "
    "oscillation. If the estimate is too small (-20 %), the remaining friction stabilises the "
    "loop; if it is too large (+20 %), the oscillation grows faster. Without an observer friction "
    "holds the drive at rest.",
)


def all_studies(pid: Mapping[str, float], pd: Mapping[str, float]) -> tuple[Study, ...]:
    """Every study, in the order of the page; ``pid`` and ``pd`` are stable position loops."""
    pi = "The paper's position PI over 100 s"
    return (
        mismatch("friction-level", "Fc", "Fs"),
        mismatch("stiffness", "sigma0"),
        FORWARD,
        INITIAL,
        STANDSTILL,
        OVER,
        position("position-pi", pi, POSITION, ranked=(0, 1), notes=PI_NOTES),
        position("position-pid", "Stable PID of the same bandwidth over 100 s", pid),
        position("position-pd", "Stable PD of the same bandwidth, T(s) SPR, over 100 s", pd),
        position_mismatch(pid),
    )

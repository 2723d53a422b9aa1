"""The studies: the source paper's two loops, in its own scenarios and in further ones."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from .setting import Case, Compensation, Drawn, Measure, Reference, Study

VELOCITY = {"kp": 1.6, "ki": 0.16}
POSITION = {"kp": 15.0, "ki": 1.55, "kd": 0.0}
PERCENT = (-30, -20, -10, 0, 10, 20, 40)

OBSERVERS = (
    Compensation("none", "no observer"),
    Compensation("natural", "natural observer", "natural"),
    Compensation("k 0.35", "existing observer, k = 0.35", "existing", {"k": 0.35}),
    Compensation("k 5", "existing observer, k = 5", "existing", {"k": 5.0}),
    Compensation("k 20", "existing observer, k = 20", "existing", {"k": 20.0}),
    Compensation(
        "proposed",
        "proposed observer, K1 = -10.24, K2 = 22",
        "proposed",
        {"K1": -10.24, "K2": 22.0},
    ),
)
# sigma1 k and sigma0 k of the existing observer at k = 20, added to the paper's gains
STRONG = (
    Compensation("Ki 160", "no observer, PI with Ki = 160", None, {"kp": 1.6, "ki": 160.0}),
    Compensation(
        "Ki 5200", "no observer, PI with Kp = 13.6, Ki = 5200", None, {"kp": 13.6, "ki": 5200.0}
    ),
)
ALL = OBSERVERS + STRONG

SINE = Reference("sine", 0.1, 1.0)
MOVING = Measure("e", "rad/s", (1.0, 5.0))
SINE_TEXT = "reference 0.1 sin(2 pi t) rad/s"
VELOCITY_TEXT = "Velocity loop, Kp 1.6, Ki 0.16"


def _percent(value: float) -> str:
    return f"{value:+g} %" if value else "exact"


def _scale(percent: float, *names: str) -> dict[str, float]:
    return {name: 1 + percent / 100 for name in names}


def mismatch(key: str, *names: str) -> Study:
    """The velocity loop with some of the observer's parameters wrong by -30 to +40 %."""
    cases = tuple(
        Case(_percent(q), SINE, (MOVING,), scale=_scale(q, *names), x=float(q)) for q in PERCENT
    )
    what = " and ".join(names)
    notes = (
        "The existing observer adds sigma1 k and sigma0 k/s (leaky while the drive slides) to the "
        "controller. At k = 20 that is Kp + 12 and Ki + 5200; the last column shows this PI "
        "without any observer. Both have a crossover frequency near 1 kHz, and these simulations "
        "contain no noise, delay, sampling or elasticity.",
    )
    return Study(
        key,
        f"Velocity loop, observer's {what} wrong",
        f"{VELOCITY_TEXT}, no feed-forward, no prefilter, {SINE_TEXT}, all states 0 at the "
        f"start. The observer's {what} as in the first column, its other parameters exact.",
        "velocity",
        VELOCITY,
        ALL,
        cases,
        ranked=(1, 3) if key == "friction-level" else (1,),
        notes=notes if key == "friction-level" else (),
    )


def forward() -> Study:
    """Feed-forward and prefilter on and off, observer exact and 20 % low."""
    cases = []
    for percent in (0, -20):
        for ahead in (False, True):
            for smooth in (False, True):
                said = [w for w, on in (("FF", ahead), ("PF", smooth)) if on]
                label = " ".join([_percent(percent) + "," * bool(said), *said])
                cases.append(
                    Case(
                        label,
                        replace(SINE, prefilter=smooth),
                        (MOVING,),
                        scale=_scale(percent, "Fc", "Fs"),
                        feedforward=ahead,
                    )
                )
    return Study(
        "forward",
        "Velocity loop, with and without feed-forward and prefilter",
        f"{VELOCITY_TEXT}, {SINE_TEXT}, all states 0 at the start; observer's Fc and Fs exact or "
        "20 % low. FF: feed-forward J dr/dt. PF: prefilter 2/(s + 2), error against the filtered "
        "reference, which is 0.3 times as large.",
        "velocity",
        VELOCITY,
        ALL,
        tuple(cases),
        Drawn(6, "e", "rad/s", (1.0, 3.0)),
        ranked=(6,),
    )


def initial() -> Study:
    """The observer starts with a wrong state, the drive moves."""
    early = (Measure("e", "rad/s", (0.0, 0.5)),)
    cases = (
        Case("all right", SINE, early),
        Case("z +1.1", SINE, early, start={"plant_z": 1.1e-3}),
        Case("z -1.1", SINE, early, start={"plant_z": -1.1e-3}),
        Case("what 0.1", SINE, early, start={"proposed_observer_what": 0.1}),
    )
    return Study(
        "initial",
        "Velocity loop, wrong initial state",
        f"{VELOCITY_TEXT}, no feed-forward, no prefilter, {SINE_TEXT}, parameters exact. "
        "z +-1.1: the drive's bristles start with a deflection of 1.1 mrad (full sliding "
        "friction), those of the observers with 0. what 0.1: the proposed observer, the only one "
        "with that state, starts at what = 0.1 rad/s.",
        "velocity",
        VELOCITY,
        ALL,
        cases,
        Drawn(1, "e", "rad/s", (0.0, 0.5)),
        ranked=(1,),
    )


def standstill() -> Study:
    """Zero reference, deflected bristles: free, and held by the integral action."""
    still = Reference()
    both = (Measure("w", "rad/s", (0.0, 5.0)), Measure("F - Fhat", "N m", (4.0, 5.0)))
    cases = (
        Case("free", still, both, start={"plant_z": 1e-3}),
        Case("held", still, both, start={"plant_z": 1e-3, "pi_q": 0.26 / 0.16}),
    )
    notes = (
        "In the case held the drive is at rest (w = 0, e = 0), and only the proposed observer "
        "still corrects its estimate. This has a drawback: the compensation is added to the "
        "torque of the integral action, so the drive moves until the integral has decayed.",
    )
    return Study(
        "standstill",
        "Velocity loop at standstill",
        f"{VELOCITY_TEXT}, reference 0, parameters exact, z(0) = 1 mrad (friction torque "
        "0.26 N m), zhat(0) = 0. Free: the integral is empty. Held: it balances the friction "
        "torque.",
        "velocity",
        VELOCITY,
        OBSERVERS,
        cases,
        Drawn(0, "F - Fhat", "N m", (0.0, 2.0), log=True),
        notes=notes,
    )


def overcompensation() -> Study:
    """At rest with too much friction compensated, for a minute."""
    late = (Measure("w", "rad/s", (1.0, 60.0)),)
    cases = tuple(
        Case(
            _percent(q),
            Reference(),
            late,
            scale=_scale(q, "Fc", "Fs"),
            start={"plant_w": 0.01},
            duration=60.0,
            dt=2e-3,
        )
        for q in (0, 10, 20, 40)
    )
    return Study(
        "over",
        "Velocity loop, over-compensation at rest",
        f"{VELOCITY_TEXT}, reference 0, w(0) = 0.01 rad/s, 60 s. The observer's Fc and Fs as in "
        "the first column.",
        "velocity",
        VELOCITY,
        ALL,
        cases,
        Drawn(2, "w", "rad/s", (0.0, 60.0), ("natural", "k 0.35", "proposed", "Ki 160")),
        notes=(
            "With too much friction compensated, rest is not stable with the natural observer: "
            "the drive breaks away by itself, at +20 % more than 10 s after the initial speed.",
        ),
    )


def position(
    key: str,
    title: str,
    name: str,
    controller: Mapping[str, float],
    notes: tuple[str, ...] = (),
) -> Study:
    """A step of 1 rad on a position loop, for 100 s."""
    early, late = Measure("e", "rad", (1.0, 5.0)), Measure("e", "rad", (60.0, 100.0))
    smooth = Reference("step", 1.0, prefilter=True)
    long = Case("exact", smooth, (early, late), duration=100.0, dt=2e-3)
    cases = (
        long,
        replace(long, label="exact, FF", feedforward=True),
        replace(long, label="exact, no PF", reference=replace(smooth, prefilter=False)),
        replace(long, label="-20 %", scale=_scale(-20, "Fc", "Fs")),
        replace(long, label="+20 %", scale=_scale(20, "Fc", "Fs")),
    )
    gains = ", ".join(f"{k.capitalize()} {v:.4g}" for k, v in controller.items() if v)
    return Study(
        key,
        title,
        f"Position loop, {name}, {gains}; reference a step of 1 rad through the prefilter "
        "2/(s + 2), 100 s, all states 0 at the start. The observer's Fc and Fs as in the first "
        "column. FF: feed-forward J ddr, without the impulse at t = 0. No PF: the bare step.",
        "position",
        controller,
        OBSERVERS,
        cases,
        Drawn(0, "e", "rad", (0.0, 100.0), ("none", "k 0.35", "k 20", "proposed")),
        ranked=(0, 1) if key == "position-pi" else (0,),
        notes=notes,
    )


def position_mismatch(name: str, controller: Mapping[str, float]) -> Study:
    """A moving reference on the stable position loop, observer wrong by -30 to +40 %."""
    moving = (Measure("e", "rad", (2.0, 8.0)),)
    wave = Reference("raised", 0.1, 0.5)
    cases = tuple(
        Case(_percent(q), wave, moving, scale=_scale(q, "Fc", "Fs"), x=float(q), duration=8.0)
        for q in PERCENT
    )
    gains = ", ".join(f"{k.capitalize()} {v:.4g}" for k, v in controller.items() if v)
    return Study(
        "position-level",
        "Position loop that is stable, observer's Fc and Fs wrong",
        f"Position loop, {name}, {gains}; reference 0.1 (1 - cos(pi t)) rad, no feed-forward, no "
        "prefilter, all states 0 at the start. The observer's Fc and Fs as in the first column.",
        "position",
        controller,
        OBSERVERS,
        cases,
        ranked=(1, 5),
        notes=(
            "D acts on the measured speed and delays the motion like viscous friction; too much "
            "friction compensation cancels a part of that.",
        ),
    )

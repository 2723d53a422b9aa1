"""The signature of an entry: its torque over time, position and speed along one motion."""

from __future__ import annotations

import io
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import lugrectl as lg
from lugrectl.blocks.block import members
from lugrectl.blocks.catalogue import Entry

from .motions import DRIVE, LATE, Motion, friction, motion, tracking

FOLDERS = {
    "effect": ("effects", lg.effects),
    "friction": ("laws", lg.laws),
    "observer": ("observers", lg.observers),
    "controller": ("controllers", lg.controllers),
}

SHARE = 0.2  # of the RMS friction torque: how strong an effect is drawn
FINE = np.array([0.2, 0.3, 0.4, 0.5, 0.63, 0.8, 1.0, 1.25, 1.6, 2.0, 2.5, 3.2, 4.0, 5.0])
DRAWN = {  # strengths that a real drive may have, where SHARE needs others
    "dwell_stiction": 1.0,
    "presliding": DRIVE.sigma0,
    "inertia_step": 1.0,
    "pose_dependent_inertia": 0.5,
    "encoder_eccentricity": 0.05,
}
STOPS, SMALL = ("stribeck", "dwell_stiction"), ("presliding",)
# the law that an effect completes, where that is not LuGre
AGAINST = {"stribeck": "coulomb", "presliding": "coulomb", "dwell_stiction": "stribeck"}
NOW = 5.0  # s: when a step in time is drawn
BELIEVED = 0.8  # Fc and Fs of an observer, as a factor of the drive's


@dataclass(frozen=True)
class Signature:
    """What is drawn over ``t``, ``theta`` and ``w``: curves by name, the first in front."""

    t: np.ndarray
    theta: np.ndarray
    w: np.ndarray
    curves: dict[str, np.ndarray]
    unit: str = "N m"
    title: str = ""


def caption(entry: Entry) -> str:
    """What the picture of an entry shows."""
    drive = "the drive of Table 1 of the source paper"
    if entry.kind == "effect":
        m = motion(_motion(entry))
        return f"{_effect_words(entry)}, along a motion of {drive}: {m.words}. {_strength(entry)}"
    if entry.kind == "friction":
        return (
            f"Friction torque F along {motion('small').words}, with the default parameters. Where "
            "the law has a memory, the curve over w is a loop."
        )
    if entry.kind == "observer":
        return (
            f"Friction F of {drive} and its estimate Fhat in a velocity loop, r = 2 sin(2 pi t) "
            "rad/s, with default gains. The observer believes Fc and Fs 20 % too small, where it "
            "uses them; it starts from zero."
        )
    if _closed(entry):
        return (
            f"Torque u of the controller in a position loop with {drive}, with the default "
            f"parameters and no observer. The reference moves as {motion('turns').words}."
        )
    m, made = motion("travel"), members("controller")[entry.name]
    return (
        f"Output {made.outputs[0]} with the default parameters. The reference is {m.words}, "
        f"which the measured motion follows {LATE:g} s late."
    )


def _closed(entry: Entry) -> bool:
    """Whether the controller acts on the sliding error: it adapts, so only a loop shows it. One
    whose memory is an input does not fit into a ready-made loop."""
    return {"s", "ar"} <= {*entry.inputs} and "v_late" not in entry.inputs


def _effect_words(entry: Entry) -> str:
    if "input" in entry.acts_on:
        return "Torque that is commanded and logged but does not reach the drive"
    if "sensor" in entry.acts_on:
        return "Residual torque that the wrong measurement of the motion pretends"
    return "Torque that the effect adds to the resisting side"


def _strength(entry: Entry) -> str:
    said = "Its strength stands above the picture."
    if entry.name == "load_dependent_friction":
        said += " The load is a gravity torque of 0.2 sin(theta) N m."
    if entry.name in AGAINST:
        said += f" The friction beside it is the {AGAINST[entry.name]} law."
    return said


def pictures(folder: Path) -> Iterator[tuple[str, bytes]]:
    """Path and PNG of every entry whose picture is missing or older than the code."""
    sources = [*Path(__file__).parent.glob("*.py"), *Path(lg.__file__).parent.rglob("*.py")]
    newest = max(source.stat().st_mtime for source in sources)
    for name, listing in FOLDERS.values():
        for entry in listing():
            where = f"{name}/{entry.name}"
            old = folder / f"{where}.png"
            if not old.exists() or old.stat().st_mtime < newest:
                yield where, drawn(signature(entry))


def signature(entry: Entry) -> Signature:
    """The curves of an entry."""
    kinds = {"effect": _effect, "friction": _friction, "observer": _observer}
    return kinds.get(entry.kind, _controller)(entry)


def _friction(entry: Entry) -> Signature:
    m = motion("small")
    F = lg.simulate(lg.friction(entry.name), m.t, {"w": m.w}).outputs["F"]
    return Signature(m.t, m.theta, m.w, {"F": np.ravel(F)})


def _observer(entry: Entry) -> Signature:
    low = {k: BELIEVED * getattr(DRIVE, k) for k in ("Fc", "Fs")}
    name = None if entry.name == "no_observer" else entry.name
    believed = lg.Model.of(DRIVE).with_values(low)
    loop = lg.velocity_loop(DRIVE, name, observer_parameters=believed)
    t = np.linspace(0.0, 2.0, 2001)
    y = lg.simulate(loop, t, {"r": 2.0 * np.sin(2.0 * np.pi * t)}).outputs
    curves = {"Fhat": np.ravel(y["Fhat"]), "F": np.ravel(y["F"])}
    return Signature(t, np.ravel(y["theta"]), np.ravel(y["w"]), curves)


def _controller(entry: Entry) -> Signature:
    m = motion("travel")
    if _closed(entry):
        m, loop = motion("turns"), lg.position_loop(DRIVE, controller=entry.name)
        y = lg.simulate(loop, m.t, {"r": m.theta - m.theta[0], "dr": m.w, "ddr": m.a}).outputs
        return Signature(m.t, *(np.ravel(y[k]) for k in ("theta", "w")), {"u": np.ravel(y["u"])})
    made = members("controller")[entry.name]
    system, signals = made.system(), tracking(m)
    y = lg.simulate(system, m.t, {k: signals[k] for k in made.inputs}).outputs
    out = made.outputs[0]
    unit = {"e": "rad", "r": "rad"}.get(out, "N m" if out.startswith("u") else "rad/s")
    return Signature(m.t, m.theta, m.w, {out: np.ravel(y[out])}, unit)


def _motion(entry: Entry) -> str:
    return "stops" if entry.name in STOPS else "small" if entry.name in SMALL else "travel"


def _effect(entry: Entry) -> Signature:
    """The effect at the strength DRAWN, or where its torque is SHARE of the friction torque."""
    m, made = motion(_motion(entry)), members("effect")[entry.name]
    goal = SHARE * _rms(friction(m, law=AGAINST.get(entry.name, "lugre")))
    others = {"time": NOW} if "time" in made.parameters else {}
    own, gain = made.parameters[made.gain], made.gain

    def miss(value: float) -> float:
        r = residual(entry, m, {**others, gain: value})
        return abs(np.log(max(_rms(r), 1e-12) / goal)) if np.isfinite(r).all() else np.inf

    best = DRAWN.get(entry.name)
    if best is None:
        decade = min(_tried(own, 10.0 ** np.arange(-4, 6)), key=miss)
        best = min(_tried(own, decade * FINE), key=miss)
    torque = residual(entry, m, {**others, gain: best})
    unit = "" if own.unit == "1" else f" {own.unit}"
    title = f"{entry.name}: {gain} = {best:.2g}{unit}"
    return Signature(m.t, m.theta, m.w, {"r_e": torque}, title=title)


def _tried(p: lg.P, values: np.ndarray) -> list[float]:
    """The values within the bounds, and the upper bound where it is finite."""
    end = [p.high] if np.isfinite(p.high) and p.high != p.neutral else []
    return [*(float(x) for x in values if p.low <= x <= p.high), *end]


def _rms(x: np.ndarray) -> float:
    return float(np.sqrt(np.mean(x**2)))


def residual(entry: Entry, m: Motion, values: dict[str, float]) -> np.ndarray:
    """The torque that an effect adds to the resisting side along a motion."""
    made = members("effect")[entry.name]
    system = made.system(entry.name)
    params = {f"{entry.name}.{k}": v for k, v in values.items()}
    inputs = {k: getattr(m, k) for k in made.inputs}
    try:
        y = lg.simulate(system, m.t, inputs, params=params, squeeze=False).outputs
    except lg.Diverged:
        return np.full(len(m.t), np.nan)
    if "input" in made.acts:
        return m.u - y[0]
    if "sensor" in made.acts:
        w = y[0]
        return m.u - DRIVE.J * np.gradient(w, m.t) - friction(m, w)
    torque, levels = np.zeros(len(m.t)), {}
    for act, out in made.deeds(tuple(y)):
        if act == "torque":
            torque = torque + out
        elif act == "J":
            torque = torque + DRIVE.J * out * m.a
        else:
            name = act.lstrip("+")
            own = getattr(DRIVE, name)
            levels[name] = own + out if act.startswith("+") else own * (1.0 + out)
    law = AGAINST.get(entry.name, "lugre")
    return torque + (friction(m, law=law, **levels) - friction(m, law=law) if levels else 0.0)


def drawn(s: Signature) -> bytes:
    """Three panels as a PNG."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.0, 2.7), dpi=110, layout="constrained")
    panels = figure.subplots(1, 3, sharey=True)
    for ax, (x, label) in zip(panels, _axes(s), strict=True):
        for i, (name, y) in reversed(list(enumerate(s.curves.items()))):
            ax.plot(x, y, lw=1.0, color=("#1f5fa8", "#a0a0a0")[i], label=name)
        ax.set_xlabel(label)
        ax.locator_params("x", nbins=5)
        ax.grid(alpha=0.3)
    low, high = panels[0].get_ylim()
    panels[0].set_ylim(min(low, 0.0), max(high, 0.0))
    panels[0].set_ylabel(f"{', '.join(s.curves)} [{s.unit}]")
    if len(s.curves) > 1:
        panels[1].legend(fontsize="small", loc="center")
    figure.suptitle(s.title, fontsize="small")
    made = io.BytesIO()
    FigureCanvasAgg(figure).print_png(made, metadata={"Software": None})
    return made.getvalue()


def _axes(s: Signature) -> list[tuple[np.ndarray, str]]:
    """Time, position and speed; small ones in mrad."""
    made = [(s.t, "t [s]")]
    for x, name, unit in ((s.theta, "theta", "rad"), (s.w, "w", "rad/s")):
        small = bool(np.abs(x).max() < 0.1)
        made.append((1e3 * x if small else x, f"{name} [{'m' * small}{unit}]"))
    return made

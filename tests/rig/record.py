"""Records with one hidden effect which the declared model file does not contain."""

from __future__ import annotations

import json
import zlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from .bench import Run, Setup, drive_row, simulate, tune
from .declared import model_text, model_tree
from .excitation import EXCITATIONS
from .hiding import Context, Effect, Size, find, needs_gravity, suits
from .machines import MACHINES, PARAMETERS, Machine, specimen, with_load
from .plant import KI, KP
from .strength import COARSE, calibrate, present

Names = str | Sequence[str]


@dataclass(frozen=True)
class Case:
    """Columns as recorded, the declared model, and what the model does not say."""

    columns: dict[str, np.ndarray]
    model: dict
    truth: dict
    hidden: Run

    def write(self, folder: str | Path) -> Path:
        """Write record.csv, model.toml and truth.json; returns the folder."""
        folder = Path(folder)
        folder.mkdir(parents=True, exist_ok=True)
        linear = self.model["motion"] == "linear"
        units = {"t": "s", "u": "N m", "theta": "rad", "w": "rad/s"}
        if linear:
            units = {"t": "s", "u": "N", "theta": "m", "w": "m/s"}
        header = ",".join(f"{name} [{units[name]}]" for name in self.columns)
        rows = np.column_stack(list(self.columns.values()))
        np.savetxt(
            folder / "record.csv", rows, fmt="%.10g", delimiter=",", header=header, comments=""
        )
        (folder / "model.toml").write_text(model_text(self.model))
        (folder / "truth.json").write_text(json.dumps(self.truth, indent=1))
        return folder


def stream(seed: int, purpose: str) -> np.random.Generator:
    return np.random.default_rng([seed, zlib.crc32(purpose.encode())])


def names_of(effect: Names) -> list[str]:
    names = [effect] if isinstance(effect, str) else list(effect)
    return [name for name in names if name != "none"]


def _machine(name: str, seed: int, names: list[str], excitation: str, load: bool | None) -> Machine:
    """The seed's specimen; loads are left out where the hidden effect is a load itself."""
    if name not in MACHINES:
        raise ValueError(f"unknown machine {name!r}: one of {', '.join(MACHINES)}")
    machine = specimen(name, stream(seed, "machine"))
    rng = stream(seed, "load")
    wanted = rng.random() < 0.35 and name != "spindle" if load is None else load
    open_loop = excitation == "torque"
    if load is None and (open_loop or set(names) & {"gravity", "constant_torque"}):
        wanted = False
    if needs_gravity(names):
        wanted = True
    return with_load(machine, rng, 0.5 if open_loop else 1.3) if wanted else machine


def _prepare(machine, names, excitation, seed, rate, duration, options) -> Setup:
    if excitation not in EXCITATIONS:
        raise ValueError(f"unknown excitation {excitation!r}: one of {', '.join(EXCITATIONS)}")
    t = np.arange(int(round(duration * rate))) / rate
    loop, refs = EXCITATIONS[excitation](machine, stream(seed, "excitation"), t)
    rng = stream(seed, "sensor")
    quantum = options["quantum"]
    quantum = float(rng.choice(machine.quanta)) if quantum is None else quantum
    theta0 = float(rng.uniform(-np.pi, np.pi)) if machine.rotary and rng.random() < 0.5 else 0.0
    sigma = options["w_noise"]
    noise = rng.normal(0.0, 1.0, (1, len(t))) * sigma
    late = any(find(n).late for n in names)
    gains = tune(machine, loop, rate, stream(seed, "gains"), late, options["position_only"])
    drive = drive_row(machine, gains, quantum, theta0)
    setup = Setup(machine, loop, refs, noise, rate, quantum, theta0, drive)
    return _strong_enough(setup) if excitation == "torque" else setup


def _strong_enough(setup: Setup) -> Setup:
    """Open loop: raise the torque until the machine travels, or comes near its top speed."""
    m = setup.machine
    for _ in range(10):
        moved = simulate(replace(setup, step=COARSE), {}).signals
        speed = np.sqrt(np.mean(moved["w_true"] ** 2))
        far = np.ptp(moved["theta_true"]) > (3.4 * np.pi if m.rotary else 0.05)
        if (far and speed > 0.1 * m.w_max) or speed > 0.8 * m.w_max:
            break
        setup = replace(setup, refs=setup.refs * np.array([[1.0], [1.0], [1.15]]))
    return setup


def _hide(
    setup: Setup, names: list[str], seed: int, strength: float
) -> tuple[Run, list[dict], Machine]:
    """Draw and scale each effect on its own, then run them together."""
    base = simulate(setup, {})
    if not names:
        return base, [], setup.machine
    s = base.signals
    context = Context(
        setup.machine,
        base.t,
        s["u"],
        s["theta_true"],
        s["w_true"],
        base.friction_rms,
        strength,
        setup.rate,
        1.0 / (setup.rate * setup.fine_steps),
    )
    sizes, told = {}, []
    for name in names:
        effect = find(name)
        size = effect.recipe(context, stream(seed, name))
        x, alone = calibrate(setup, effect, size, strength)
        sizes[name] = (size, x)
        told.append(_tell(effect, size, x, alone, strength))
    table, truth = present(setup.machine, sizes)
    return simulate(setup, table, truth), told, truth


def _tell(effect: Effect, size: Size, x: float, alone: Run, strength: float) -> dict:
    ratio = alone.effect_rms / alone.friction_rms
    values = size.build(x)
    known = dict(zip(effect.parameters, map(float, values), strict=False))
    return {
        "effect": f"outside the catalogue: {effect.text}" if effect.text else effect.name,
        "parameters": known,
        "depends_on": list(effect.depends_on),
        "effect_rms": alone.effect_rms,
        "friction_rms": alone.friction_rms,
        "limited": bool(abs(np.log(ratio / strength)) > np.log(1.15)),
        "row": list(map(float, values)),
    }


def _answer(run: Run, told: list[dict]) -> dict:
    """What is hidden: of one effect its parameters, of several a table for each."""
    each = {entry["effect"]: entry["parameters"] for entry in told}
    return {
        "effect": " + ".join(each) or "none",
        "parameters": told[0]["parameters"] if len(told) == 1 else each,
        "effect_rms": run.effect_rms,
        "friction_rms": run.friction_rms,
        "effects": told,
    }


def _rig(setup: Setup, m: Machine) -> dict:
    """The machine as it really is, and its drive."""
    gains = setup.drive
    return {
        "quantum": setup.quantum,
        "drive": {
            "loop": setup.loop,
            "kp": float(gains[KP]),
            "ki": float(gains[KI]),
            "limit": setup.machine.torque_peak,
        },
        "plant": {key: float(getattr(m, key)) for key in PARAMETERS},
        "load": m.load,
    }


def make(
    effect: Names = "none",
    machine: str = "servo",
    excitation: str = "rich",
    seed: int = 0,
    rate: float = 1000.0,
    duration: float = 30.0,
    strength: float = 0.2,
    declared_error: float = 0.1,
    position_only: bool = False,
    torque_noise: float = 0.0,
    w_noise: float | None = None,
    quantum: float | None = None,
    load: bool | None = None,
    omit: Sequence[str] = (),
) -> Case:
    """Simulate one record whose model file lacks `effect` (a name, names, or "none").

    `strength` is the RMS of the effect torque over that of friction.  The effect torque is what
    the declared structure with true parameters leaves of the recorded torque along the measured
    motion, so it covers drive and sensor effects too.  `torque_noise` and `w_noise` are standard
    deviations in the record's units, `quantum` the encoder step (`None`: the machine's own).
    `load`: with or without a declared load; `omit`: values left out of the model file.
    Raises ValueError for unknown names and for effects that the record cannot carry.
    """
    names = names_of(effect)
    m = _machine(machine, seed, names, excitation, load)
    for name in names:
        if not suits(name, m, position_only):
            raise ValueError(f"{name} cannot be hidden here: it needs {find(name).only}")
    sigma = m.w_noise if w_noise is None else w_noise
    options = {"quantum": quantum, "w_noise": sigma, "position_only": position_only}
    setup = _prepare(m, names, excitation, seed, rate, duration, options)
    run, told, true = _hide(setup, names if strength > 0.0 else [], seed, strength)
    model = model_tree(m, names, stream(seed, "declared"), declared_error, omit)
    columns = {"t": run.t, "u": run.signals["u"], "theta": run.signals["theta"]}
    columns["u"] = columns["u"] + torque_noise * stream(seed, "torque").normal(size=len(run.t))
    if not position_only:
        columns["w"] = run.signals["w"]
    truth = {
        **_answer(run, told),
        "w_noise": None if position_only else sigma,
        "torque_noise": torque_noise,
        "strength": strength,
        "machine": machine,
        "excitation": excitation,
        "seed": seed,
        "rate": rate,
        "position_only": position_only,
        **_rig(setup, true),
    }
    return Case(columns, model, truth, run)

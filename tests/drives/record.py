"""Records with one hidden effect which the declared model file does not contain."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace

import numpy as np

from .declared import model_tree
from .effects import Context, Effect, Size, find, needs_gravity, suits
from .hide import COARSE, calibrate, present, visible
from .logger import NUISANCES, Logger, carries, nuisance, stream, turned, warmed
from .machines import MACHINES, NO_LOAD, PARAMETERS, Machine, specimen, with_load
from .moves import EXCITATIONS
from .plant import KI, KP
from .run import Run, Setup, drive_row, simulate, tune

Names = str | Sequence[str]


@dataclass(frozen=True)
class Case:
    """Columns as recorded, the declared model, and what the model does not say."""

    columns: dict[str, np.ndarray]
    model: dict
    truth: dict
    hidden: Run
    more: tuple[Case, ...] = ()  # further runs of the same machine


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
    again = options["again"]
    loop, refs = EXCITATIONS[excitation](machine, stream(seed, "excitation" + again), t)
    rng = stream(seed, "sensor" + again)
    quantum = options["quantum"]
    quantum = float(rng.choice(machine.quanta)) if quantum is None else quantum
    theta0 = float(rng.uniform(-np.pi, np.pi)) if machine.rotary and rng.random() < 0.5 else 0.0
    sigma = options["w_noise"]
    noise = rng.normal(0.0, 1.0, (1, len(t))) * sigma
    late = any(find(n).late for n in names)
    gains = tune(machine, loop, rate, stream(seed, "gains"), late, options["position_only"])
    drive = drive_row(machine, gains, quantum, theta0)
    jitter = options["jitter"]
    setup = Setup(machine, loop, refs, noise, rate, quantum, theta0, drive, jitter=jitter)
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
        "visible": visible(alone) / alone.friction_rms,
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
    jitter: float = 0.0,
    dropped: float = 0.0,
    channels: Sequence[str] = (),
    runs: int = 1,
    nuisances: tuple[str, ...] = NUISANCES,
) -> Case:
    """Simulate one record whose model file lacks `effect` (a name, names, or "none").

    `strength` is the RMS of the effect torque over that of friction.  The effect torque is what
    the declared structure with true parameters leaves of the recorded torque along the measured
    motion, so it covers drive and sensor effects too.  `torque_noise` and `w_noise` are standard
    deviations in the record's units, `quantum` the encoder step (`None`: the machine's own).
    `load`: with or without a declared load; `omit`: values left out of the model file.
    `jitter` is of the sampling period, `dropped` the share of samples lost; `channels` are
    recorded too where the machine has them (a load that is recorded is not declared).  `runs`
    of the same machine differ by `nuisances`; those after the first are the case's `more`.
    Raises ValueError for unknown names and for effects that the record cannot carry.
    """
    names = names_of(effect)
    m = _machine(machine, seed, names, excitation, load)
    for name in names:
        if not suits(name, m, position_only):
            raise ValueError(f"{name} cannot be hidden here: it needs {find(name).only}")
    sigma = m.w_noise if w_noise is None else w_noise
    options = {"quantum": quantum, "w_noise": sigma, "position_only": position_only}
    options |= {"jitter": jitter, "again": ""}
    plan = names, excitation, seed, rate, duration
    setup = _prepare(m, *plan, options)
    run, told, true = _hide(setup, names if strength > 0.0 else [], seed, strength)
    seen = tuple(c for c in channels if carries(c, m, setup.loop))
    logger = Logger(position_only, torque_noise, seen, dropped)
    declared = replace(m, load=(NO_LOAD, 0.0, 0.0)) if "d" in seen else m
    model = model_tree(declared, names, stream(seed, "declared"), declared_error, omit)
    truth = {
        **_answer(run, told),
        "w_noise": None if position_only else sigma,
        "torque_noise": torque_noise,
        "strength": strength,
        "machine": machine,
        "excitation": excitation,
        "seed": seed,
        "rate": rate,
        "duration": duration,
        "position_only": position_only,
        "channels": list(seen),
        **_rig(setup, true),
    }
    case = Case(logger.columns(run, seed), model, truth, run)
    options["quantum"] = setup.quantum
    others = [f" {i}" for i in range(1, runs)]
    rigs = [_prepare(m, *plan, {**options, "again": again}) for again in others]
    more = [
        _repeat(case, rig, again, logger, nuisances)
        for rig, again in zip(rigs, others, strict=True)
    ]
    return replace(case, more=tuple(more))


def _repeat(case: Case, setup: Setup, again: str, logger: Logger, kinds: tuple[str, ...]) -> Case:
    """Another run: the same machine and effect, other references, noise and nuisances."""
    seed, before = case.truth["seed"], case.hidden
    brings = nuisance(before.machine, before.table, kinds, stream(seed, "nuisance" + again))
    setup = replace(setup, machine=warmed(setup.machine, brings.friction))
    machine = warmed(before.machine, brings.friction)
    run = simulate(setup, turned(before.table, brings.turn), machine)
    columns = logger.columns(run, seed, again)
    columns["u"] = columns["u"] + brings.offset
    columns["theta"] = columns["theta"] + brings.zero
    return Case(columns, case.model, case.truth | {"nuisance": asdict(brings)}, run)

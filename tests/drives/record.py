"""Records with hidden effects which the declared model file does not contain."""

from __future__ import annotations

import json
import zlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from .effects import CATALOGUE, Context, Effect, Size, find, needs_gravity, suits
from .machines import (
    CONSTANT_LOAD,
    GRAVITY_LOAD,
    MACHINES,
    PARAMETERS,
    Machine,
    specimen,
    with_load,
)
from .moves import EXCITATIONS
from .run import Run, Setup, Table, drive_row, simulate, tune

Names = str | Sequence[str]
Columns = dict[str, np.ndarray]
COARSE = 100e-6  # s: good enough to search with; the last runs are fine again
FRICTION = {
    "lugre": ("sigma0", "sigma1", "Fc", "Fs", "Fv", "vs"),
    "stribeck": ("Fc", "Fs", "Fv", "vs"),
    "coulomb": ("Fc", "Fv"),
}
ABSOLUTE = {  # effects whose position counts from a fixed place
    *("gravity", "return_spring", "hard_stop", "encoder_eccentricity"),
    *("pose_dependent_inertia", "torque_bumps"),
}


@dataclass(frozen=True)
class Case:
    """Columns as recorded, the declared model, and what the model does not say."""

    columns: Columns
    model: dict
    truth: dict
    hidden: Run
    more: tuple[Case, ...] = ()  # further runs of the same machine


def stream(seed: int, purpose: str) -> np.random.Generator:
    return np.random.default_rng([seed, zlib.crc32(purpose.encode())])


def names_of(effect: Names) -> list[str]:
    names = [effect] if isinstance(effect, str) else list(effect)
    return [name for name in names if name != "none"]


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
    runs: int = 1,
) -> Case:
    """Simulate one record whose model file lacks `effect` (a name, names, or "none").

    `strength` is the RMS of the effect torque over that of friction.  The effect torque is what
    the declared structure with true parameters leaves of the recorded torque along the measured
    motion, so it covers drive and sensor effects too.  `torque_noise` and `w_noise` are standard
    deviations in the record's units, `quantum` the encoder step (`None`: the machine's own).
    `load`: with or without a declared load; `omit`: values left out of the model file.
    `jitter` is of the sampling period, `dropped` the share of samples lost.  `runs` of the same
    machine differ by an offset of the torque, the encoder's zero and the temperature; those after
    the first are the case's `more`.
    Raises ValueError for unknown names and for effects that the record cannot carry.
    """
    names = names_of(effect)
    m = _machine(machine, seed, names, excitation, load)
    for name in names:
        if not suits(name, m, position_only):
            raise ValueError(f"{name} cannot be hidden here: it needs {find(name).only}")
    noise = m.w_noise if w_noise is None else w_noise
    late = any(find(n).late for n in names)
    sensors = (quantum, noise, jitter, late, position_only)
    prepared = partial(_prepare, m, excitation, seed, rate, duration, sensors)
    log = partial(_logged, seed, position_only, torque_noise, dropped)
    setup = prepared("")
    run, hidden = _hide(setup, names if strength > 0.0 else [], seed, strength)
    truth = {
        "effect": " + ".join(e["effect"] for e in hidden) or "none",
        "parameters": hidden[0]["parameters"] if len(hidden) == 1 else {},
        "effect_rms": run.effect_rms,
        "friction_rms": run.friction_rms,
        "effects": hidden,
        "strength": strength,
        "machine": machine,
        "excitation": excitation,
        "seed": seed,
        "rate": rate,
        "duration": duration,
        "position_only": position_only,
        "quantum": setup.quantum,
        "plant": {key: float(getattr(run.machine, key)) for key in PARAMETERS},
    }
    model = model_tree(m, names, stream(seed, "declared"), declared_error, omit)
    case = Case(log(run, ""), model, truth, run)
    sensors = (setup.quantum, *sensors[1:])
    prepared = partial(_prepare, m, excitation, seed, rate, duration, sensors)
    others = [f" {i}" for i in range(1, runs)]
    return replace(case, more=tuple(_repeat(case, prepared(one), one, log) for one in others))


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


def _prepare(m: Machine, excitation, seed, rate, duration, sensors, again: str) -> Setup:
    """Reference, sensors and gains; `again` tells further runs apart."""
    if excitation not in EXCITATIONS:
        raise ValueError(f"unknown excitation {excitation!r}: one of {', '.join(EXCITATIONS)}")
    quantum, sigma, jitter, late, position_only = sensors
    t = np.arange(int(round(duration * rate))) / rate
    loop, refs = EXCITATIONS[excitation](m, stream(seed, "excitation" + again), t)
    rng = stream(seed, "sensor" + again)
    quantum = float(rng.choice(m.quanta)) if quantum is None else quantum
    theta0 = float(rng.uniform(-np.pi, np.pi)) if m.rotary and rng.random() < 0.5 else 0.0
    noise = rng.normal(0.0, 1.0, (1, len(t))) * sigma
    gains = tune(m, loop, rate, stream(seed, "gains"), late, position_only)
    drive = drive_row(m, gains, quantum, theta0)
    setup = Setup(m, loop, refs, noise, rate, quantum, theta0, drive, jitter=jitter)
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


# --- the effects -------------------------------------------------------------------------


def _hide(setup: Setup, names: list[str], seed: int, strength: float) -> tuple[Run, list[dict]]:
    """Draw and scale each effect on its own, then run them together."""
    base = simulate(setup, {})
    if not names:
        return base, []
    motion = [base.signals[k] for k in ("u", "theta_true", "w_true")]
    fine = 1.0 / (setup.rate * setup.fine_steps)
    about = (setup.machine, base.t, *motion, base.friction_rms, strength, setup.rate, fine)
    sizes, said = {}, []
    for name in names:
        one = find(name)
        size = one.recipe(Context(*about), stream(seed, name))
        x, alone = calibrate(setup, one, size, strength)
        sizes[name] = (size, x)
        ratio = alone.effect_rms / alone.friction_rms
        known = zip(one.parameters, map(float, size.build(x)), strict=False)
        entry = {
            "effect": f"outside the catalogue: {one.text}" if one.text else name,
            "parameters": dict(known),
            "depends_on": list(one.depends_on),
            "effect_rms": alone.effect_rms,
            "friction_rms": alone.friction_rms,
            "limited": bool(abs(np.log(ratio / strength)) > np.log(1.15)),
        }
        said.append(entry)
    table, machine = present(setup.machine, sizes)
    return simulate(setup, table, machine), said


def present(machine: Machine, sizes: dict[str, tuple[Size, float]]) -> tuple[Table, Machine]:
    """Effect table and machine with these effects at these sizes."""
    table: Table = {}
    for name, (size, x) in sizes.items():
        if size.friction is not None:
            machine = size.friction(machine, x)
        else:
            table[name] = size.build(x)
    return table, machine


def search(miss: Callable[[float], float], size: Size, tries: int, close: float) -> float:
    """The x with miss(x) nearest to 0: steps along a power law, kept inside a bracket.

    `miss` is log(wanted / achieved).
    """
    x, best, least = size.start, size.start, np.inf
    short, long = size.low, size.high  # too little and too much effect
    if size.power < 0.0:
        short, long = long, short
    tried: set[float] = set()
    for _ in range(tries):
        x = float(np.clip(x, size.low, size.high))
        if x in tried:
            break
        tried.add(x)
        off = miss(x)
        if abs(off) < least:
            best, least = x, abs(off)
        if abs(off) < close:
            break
        short, long = (x, long) if off > 0.0 else (short, x)
        new = x * float(np.exp(np.clip(off / size.power, -1.2, 1.2)))
        low, high = min(short, long), max(short, long)
        inside = low < new < high
        x = new if inside else float(np.sqrt(max(low, 0.1 * x) * min(high, 10.0 * x)))
    return best


def calibrate(setup: Setup, effect: Effect, size: Size, strength: float) -> tuple[float, Run]:
    """The number that carries the strength, and the record with this effect alone."""
    runs: dict[float, Run] = {}

    def miss(rig: Setup, x: float) -> float:
        runs[x] = simulate(rig, *present(setup.machine, {effect.name: (size, x)}))
        ratio = runs[x].effect_rms / runs[x].friction_rms
        return float(np.log(strength / max(ratio, 1e-9))) if np.isfinite(ratio) else -9.0

    x = search(partial(miss, replace(setup, step=COARSE)), size, 9, 0.04)
    runs.clear()
    x = search(partial(miss, setup), replace(size, start=x), 3, 0.1)
    return x, runs[x]


# --- what is written of a run ------------------------------------------------------------


def _logged(seed, position_only, torque_noise, dropped, run: Run, again: str) -> Columns:
    s, n = run.signals, len(run.t)
    noise = torque_noise * stream(seed, "torque" + again).normal(size=n)
    columns = {"t": run.t, "u": s["u"] + noise, "theta": s["theta"]}
    if not position_only:
        columns["w"] = s["w"]
    if not dropped:
        return columns
    rng = stream(seed, "dropped" + again)  # samples lost singly, and one longer stretch
    keep = np.ones(n, dtype=bool)
    keep[rng.choice(np.arange(3, n - 3), int(dropped * n), replace=False)] = False
    start = int(rng.uniform(0.3, 0.7) * n)
    keep[start : start + int(rng.integers(6, 40))] = False
    return {name: values[keep] for name, values in columns.items()}


def _repeat(case: Case, setup: Setup, again: str, log: Callable[[Run, str], Columns]) -> Case:
    """Another run: the same machine and effect, other references, noise and circumstances."""
    m, table = case.hidden.machine, dict(case.hidden.table)
    rng = stream(case.truth["seed"], "nuisance" + again)
    offset, zero = rng.normal(0.0, 0.03) * m.Fc, rng.uniform(-np.pi, np.pi)
    warmer, turn = rng.uniform(0.95, 1.05), rng.uniform(-np.pi, np.pi)
    if ABSOLUTE & set(table) or m.load[0] == GRAVITY_LOAD or not m.rotary:
        zero = 0.0
    if "periodic_disturbance" in table:  # at another phase in each run
        amplitude, frequency, phase = table["periodic_disturbance"]
        phase = float(np.pi - (np.pi - phase - turn) % (2.0 * np.pi))
        table["periodic_disturbance"] = amplitude, frequency, phase
    setup = replace(setup, machine=_warmed(setup.machine, warmer))
    run = simulate(setup, table, _warmed(m, warmer))
    columns = log(run, again)
    columns |= {"u": columns["u"] + offset, "theta": columns["theta"] + zero}
    return Case(columns, case.model, case.truth, run)


def _warmed(m: Machine, factor: float) -> Machine:
    twin = m.Fs_twin * factor if m.Fs_twin >= 0.0 else m.Fs_twin
    return replace(m, Fc=m.Fc * factor, Fs=m.Fs * factor, Fv=m.Fv * factor, Fs_twin=twin)


# --- the model file ----------------------------------------------------------------------


def model_tree(
    m: Machine, names: Sequence[str], rng: np.random.Generator, error: float, omit: Sequence[str]
) -> dict:
    """Nested like the file; each value times a factor of its own, Fs drawn above Fc."""

    def off(value: float) -> float:
        return value * float(rng.uniform(1.0 - error, 1.0 + error))

    kinds = {CATALOGUE[n].declared for n in names if n in CATALOGUE} - {"lugre"}
    kind = kinds.pop() if kinds else "lugre"
    inertia = off(m.J)
    values = {key: off(getattr(m, key)) for key in FRICTION["lugre"]}
    while values["Fs"] <= values["Fc"]:
        values["Fs"] = off(m.Fs)
    friction = {key: values[key] for key in FRICTION[kind] if key not in omit}
    tree = {
        "name": f"{m.name} {m.motion}",
        "motion": m.motion,
        "plant": {} if "J" in omit else {"J": inertia},
        "friction": {"model": kind, **friction},
    }
    load, size, phase = m.load
    if load == GRAVITY_LOAD:
        phase = float(np.clip(off(phase), -3.14, 3.14))
        tree["effects"] = [{"name": "gravity", "amplitude": off(size), "phase": phase}]
    elif load == CONSTANT_LOAD:
        tree["effects"] = [{"name": "constant_torque", "torque": off(size)}]
    return tree


def model_text(tree: dict) -> str:
    """The tree as TOML."""

    def lines(values: dict) -> list[str]:
        return [
            f"{k} = {json.dumps(v) if isinstance(v, str) else repr(v)}" for k, v in values.items()
        ]

    made = lines({key: tree[key] for key in ("name", "motion")})
    for table in ("plant", "friction"):
        made += ["", f"[{table}]", *lines(tree[table])]
    for entry in tree.get("effects", []):
        made += ["", "[[effects]]", *lines(entry)]
    return "\n".join(made) + "\n"

"""Compensation before and after: designs, simulates and compares three loops."""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import control as ct
import numpy as np
from numpy.typing import ArrayLike

from ..blocks.aliases import name_of
from ..blocks.block import unit_for
from ..blocks.controllers import MEASURED
from ..blocks.model import Model, as_model
from ..blocks.observers import Gain, observer_block
from ..core.errors import Diverged, InputError
from ..core.numeric import rms
from ..core.progress import Progress, Wanted, reporter, shows_progress
from ..core.validation import shown, whole
from ..estimates.covariance import Joint
from ..estimates.findings import Table
from ..record.as_record import as_record
from ..simulation.response import simulate
from .drive import DRAWS, spread
from .feedforward import sorted_out, with_table
from .gains import controller, observer_gains
from .loop import OUTPUTS, Task, closed
from .reference import Course, course
from .result import LOOPS, Compensation, Run

WORSE = 1.05  # ratio above which the error counts as larger


@shows_progress
def compensate(
    model: Any,
    *,
    declared: Any = None,
    loop: str = "velocity",
    kp: float | None = None,
    ki: float | None = None,
    kd: float | None = None,
    bandwidth: float = 20.0,
    observer: str | None = "proposed",
    K1: Gain | None = None,
    K2: Gain | None = None,
    gains: Mapping[str, Any] | None = None,
    reference: tuple[ArrayLike, ArrayLike] | None = None,
    record: Any = None,
    table: Table | None = None,
    covariance: Joint | None = None,
    draws: int = DRAWS,
    seed: int = 0,
    progress: Wanted = None,
) -> Compensation:
    """Tracking error with the compensation of the declared and of the augmented model.

    u = C (r - y) + J a + Fhat + d: controller, acceleration a of the reference, observer, and the
    torque d of the model's effects from the measured w, theta and t. The simulated drive is the
    augmented model with all its effects, sensors included. The compensation uses the declared
    model ("before") or the augmented one ("after").

    Parameters
    ----------
    model : Model, Parameters, dict or path
        The augmented model, ``diagnose(...).model``.
    declared : Model, Parameters, dict or path, optional
        Default: ``model`` without its effects. Values that it does not give are those of
        ``model``.
    loop : "velocity" or "position"
        PI on w, or PID on theta with D on the error of w.
    kp, ki, kd : float, optional
        Units as in :func:`lugrectl.velocity_loop` and :func:`lugrectl.position_loop`. If none is
        given all poles of the compensated loop are at -bandwidth; else those left out are 0.
    bandwidth : float
        In 1/s, for the gains that are left out.
    observer : str or None
        As in the ready-made loops; None to compensate the effects' torque only.
    K1, K2 : float or callable, optional
        Gains of the proposed observer, both or none. Default: ``design_gains(...)`` for each
        model, or -1 and 2 sqrt(J sigma0) if sigma1 is below a tenth of the latter.
    gains : dict, optional
        Other gains of the observer by name; those left out keep their defaults.
    reference : (t, r), optional
        Times in s and the reference in rad/s or rad; the drive starts at rest at its first
        value. Default: a sine of the speed inside the range of ``record``, or of 1 rad/s at
        0.25 Hz.
    record : Record, path, DataFrame or dict of arrays, optional
        For the default reference, and for the drive that ``drive`` of the result is about: its
        sample rate, encoder steps and noise of speed and torque.
    table : Table, optional
        An unexplained torque that also acts on the drive. It is compensated "after", unless it
        is a table over u.
    covariance : Joint, optional
        ``diagnose(...).covariance``: the drive's parameters are drawn from it, while the
        compensation believes ``model``. Needs ``record``.
    draws, seed : int
        Number of drawn drives, and the seed of parameters and noise.
    progress : callable, True, False or None
        ``progress(fraction, what)``, or whether to show a bar. None: in Jupyter only.

    Returns
    -------
    Compensation
        The errors without compensation, with the declared and with the augmented model, the loops
        and their simulations.

    Raises
    ------
    InputError
        For an unknown loop or observer, a gain out of bounds, a value that is missing from the
        model, or a friction law that the observer cannot copy.

    Notes
    -----
    Torque and level effects are compensated. The torque of a level effect is the friction law
    with it minus the law without it, each with its own bristle state, along the measured motion;
    feeding forward a step at w = 0 would shake a drive at rest. The input of the observer is u
    without d, because it does not model loads. Effects on the command, the sensors, the inertia
    or a second mass are not compensated. The error is that of the motion itself, not of the
    sensor signals.

    In ``none``, ``before`` and ``after`` the simulated drive is exactly the model and the control
    is continuous: they show what the structure of the compensation can reach. ``drive`` shows
    what a drive like the recorded one will see.

    Examples
    --------
    What it brings to feed forward the cogging torque that a diagnosis found. It simulates three
    loops, which takes some seconds:

    >>> cogging = {"name": "cogging", "amplitude": 0.05, "harmonic": 12, "phase": 0.0}
    >>> drive = lg.Model.of(lg.table1(), effects=cogging)
    >>> print(lg.compensate(drive, loop="position", bandwidth=30.0))  # doctest: +SKIP
    """
    if not isinstance(loop, str) or loop not in MEASURED:
        raise InputError(f"unknown loop {shown(loop)}; known: {', '.join(MEASURED)}.")
    if not (table is None or isinstance(table, Table)):
        raise InputError(f"table must be the table of a diagnosis, not {shown(table)}.")
    model, observer = as_model(model), name_of("observer", observer)
    record = None if record is None else as_record(record, model.motion)
    bare = replace(model, effects=())
    before = bare if declared is None else _completed(declared, model)
    given = {"kp": kp, "ki": ki, "kd": kd}
    if loop == "velocity" and kd is not None:
        raise InputError("a velocity loop has no kd; its gains are kp and ki.")
    if not (covariance is None or isinstance(covariance, Joint)):
        raise InputError(
            f"covariance must be that of a diagnosis, result.covariance, not {shown(covariance)}."
        )
    draws, seed = whole(draws, "draws", least=1), whole(seed, "seed")
    task = Task(model, table, loop, controller(given, loop, bandwidth, _value(model, "J")))
    timed = any(part.block.timed for part in (*model.effects, *before.effects))
    timed = timed or (table is not None and table.signals[0] == "t")
    way = course(reference, record, loop, bandwidth, timed)
    chosen = {"before": before, "after": model}
    designs = {k: observer_gains(m, observer, K1, K2, gains) for k, m in chosen.items()}
    systems = {"none": closed(task, None, None, {}, "none")}
    for key, believed in chosen.items():
        systems[key] = closed(task, believed, observer, designs[key][0], key)
    copies = _copies(observer)
    report = reporter(progress)
    runs, errors, messages = _simulated(task, systems, way, copies, report)
    messages += _useless(errors)
    unit = unit_for("rad/s" if loop == "velocity" else "rad", model.motion)
    drive = None
    if record is not None:
        own = {"none": {}} | {key: design[0] for key, design in designs.items()}
        drive = spread(task, {"none": None} | chosen, observer, own, way, record, copies,
                       covariance, draws, seed, report)  # fmt: skip
        messages += drive.advice(unit)
    fed, left = sorted_out(model)
    if table is not None:
        fed, left = with_table(table, fed, left)
    return Compensation(
        kind=loop,
        observer=observer,
        none=errors["none"],
        before=errors["before"],
        after=errors["after"],
        unit=unit,
        controller=task.controller,
        gains={k: d[1] for k, d in designs.items()},
        certificate=designs["after"][2],
        compensated=fed,
        left=left,
        reference=way.summary,
        messages=tuple(messages),
        loop=systems,
        runs=runs,
        drive=drive,
    )


def _value(model: Model, key: str) -> float:
    value = model.values()[key]
    if value is None:
        raise InputError(f"{model.name}: {key} has no value; identify it first.")
    return value


def _completed(declared: Any, model: Model) -> Model:
    """The declared model; values that it does not give are those of the augmented one."""
    made = as_model(declared, "declared")
    known = model.known()
    return made.with_values({k: known.get(k) for k, v in made.values().items() if v is None})


def _copies(observer: str | None) -> list[str]:
    """The observer's states that follow the position: they start where the drive stands."""
    if observer is None:
        return []
    made = observer_block(observer)
    pairs = zip(made.states, made.start, strict=True)
    return [f"{made.name}_{state}" for state, start in pairs if start == "theta"]


def _simulated(
    task: Task,
    systems: Mapping[str, ct.InterconnectedSystem],
    way: Course,
    copies: list[str],
    report: Progress,
) -> tuple[dict[str, Run], dict[str, float], list[str]]:
    """Each loop's run and error, and a message for each loop that does not work."""
    r, inputs = way.followed(task.kind), way.inputs(task.kind)
    runs, errors, messages = {}, {}, []
    for i, (key, system) in enumerate(systems.items()):
        report(i / len(systems), f"simulating the loop {LOOPS[key]}")
        x0 = np.zeros(system.nstates)
        placed = ["plant_theta"] if key == "none" else ["plant_theta", *copies]
        for state in placed:
            x0[system.state_labels.index(state)] = way.theta[0]
        try:
            with warnings.catch_warnings(record=True) as said:
                warnings.simplefilter("always")
                response = simulate(system, way.t, inputs, x0)
        except Diverged as error:
            errors[key] = math.inf
            messages.append(f"The loop {LOOPS[key]} is unstable; its simulation diverged ({error})")
            continue
        outputs: dict[str, Any] = dict(zip(OUTPUTS, response.outputs, strict=True))
        runs[key] = run = Run(way.t, r, outputs[MEASURED[task.kind]], outputs["u"])
        errors[key] = rms(run.y - r)
        messages += [f"The loop {LOOPS[key]}: {warning.message}" for warning in said]
        messages += _trouble(run, LOOPS[key])
    return runs, errors, messages


def _useless(errors: Mapping[str, float]) -> list[str]:
    """Messages if a compensation does not reduce the error."""
    made = []
    if errors["after"] > WORSE * errors["before"]:
        made.append(f"The error is larger {LOOPS['after']} than {LOOPS['before']}.")
    for key in ("before", "after"):
        if errors["none"] < WORSE * errors[key] < math.inf:
            made.append(
                f"{LOOPS[key].capitalize()} the drive tracks no better than without compensation."
            )
    return made


def _trouble(run: Run, which: str) -> list[str]:
    """A message if a loop's error grows, or is as large as the reference's variation."""
    e, size = run.y - run.r, rms(run.r - run.r.mean())
    first, *_, last = (rms(part) for part in np.array_split(e, 4))
    if last > 2.0 * first and last > 0.5 * size:
        return [f"The loop {which} is unstable: its error grows."]
    if rms(e) > size:
        return [f"The loop {which} does not follow its reference."]
    return []

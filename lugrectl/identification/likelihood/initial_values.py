"""Initial values of a fit: the most likely of those that are known, and for undeclared ones."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import product
from typing import NamedTuple

import numpy as np

from ...blocks.model import Model, Part
from ...core.errors import Refused
from ...engine.runtime.threads import beside
from ..dataset.dataset import Data, thinned
from ..dataset.kalman import Noise
from ..dataset.run_effects import alike
from ..dataset.windows import Windows, coarser, spread
from .likelihood import tune, whitened
from .maximise import Fitted, again, fit
from .parameters import coordinates, free_keys, inside
from .predictor import Predictor

DEFLECTIONS = (1e-5, 1e-4, 1e-3, 1e-2)  # Fc / sigma0 as a share of the largest speed, in s
BALANCED = ("J", "Fc", "Fv", "Fs", "vs", "sigma0")
# least values as parts of the torque's std (Fv at top speed, J at the std of the acceleration):
# a fit stays near its start, so none is near zero
LEAST = {"J": 0.01, "Fc": 1e-3, "Fv": 0.05}
ROUNDS = 5  # of fits, each from the values of the previous one
BETTER = 3.0  # least gain in log-likelihood that counts as an improvement
TURNS = (0.5 * np.pi, np.pi, -0.5 * np.pi)  # rad, changes of a declared phase
EXCESS = 1.05  # start of Fs over Fc, where the declared one is below
ENOUGH, MANY_WINDOWS = 40_000, 24  # counted samples and windows on which starts are compared
COARSE = 2e-3  # s, longest sampling interval there
STRIBECK_SPEEDS = (1e-3, 5e-3, 2e-2, 0.1, 0.4)  # vs as a share of the largest speed
FACTORS = (0.4, 2.5)  # on the default of a parameter that only one law has


class Start(NamedTuple):
    """Values from which a fit starts, the noise that suits them, and their log-likelihood."""

    values: dict[str, float]
    noise: Noise
    total: float


def completed(model: Model, data: Data, train: Windows) -> Model:
    """The model with an initial value for every undeclared one.

    Inertia, Coulomb and viscous friction come from the plain torque balance; presliding and
    Stribeck values from a coarse search; a declared effect without values from the comparison
    of torques.

    Raises
    ------
    Refused
        If the record does not identify a declared effect without values.
    """
    if None not in model.values().values():
        return model
    known = [part for part in model.effects if None not in part.values.values()]
    core = replace(model, effects=tuple(known))
    core = core.with_values(core.kept(_balanced(core, data)))
    core = _searched(core, data, train, model)
    for part in model.effects:
        core = _with_effect(core, part, data) if part not in known else core
    return core


def begun(predictor: Predictor, train: Windows, declared: Model) -> Fitted:
    """The fit of the declared model from the most likely of the values that are known beforehand.

    These are the declared ones and those that the comparison of torques finds, which are usually in
    the better basin; the phases of declared effects turned; for undeclared values also the points
    of the coarse search.
    """
    data, opened = predictor.data, [k for k, v in declared.values().items() if v is None]
    anchor = predictor.model.known() | alike(data)
    guesses = [anchor | guess for guess in _guesses(declared, anchor, data)]
    starts = [anchor, _balanced_start(predictor, anchor), *guesses]
    start = turned(predictor, train, likeliest(predictor, train, data.noise, starts))
    free = free_keys(predictor)
    return _unbound(fit(predictor, start.values, free, train, start.noise, anchor=anchor), opened)


def likeliest(
    predictor: Predictor, train: Windows, noise: Noise, starts: Iterable[Mapping[str, float]]
) -> Start:
    """The most likely of some values, on as few samples as are needed to compare them."""
    data = predictor.data
    every = max(1, int(COARSE / data.dt + 1e-9))
    if every > 1:
        train = coarser(train, data.runs, every)
        predictor = predictor.on(thinned(data, every))
    where = spread(train, ENOUGH, MANY_WINDOWS)

    def looked(values: Mapping[str, float]) -> Start:
        own, each = tune(predictor, values, where, noise)
        return Start(dict(values), own, float(each.sum()))

    return max(beside(looked, starts), key=lambda start: start.total)


def lifted(model: Model) -> Model:
    """The model with an Fs a little above Fc to start from, where the declared one is below."""
    Fc, Fs = (model.friction.values.get(k) for k in ("Fc", "Fs"))
    if Fc is None or Fs is None or Fs >= Fc:
        return model
    return model.with_values(model.kept({"Fs": EXCESS * Fc}))


def _unbound(found: Fitted, opened: Sequence[str]) -> Fitted:
    """The fit without a prior around guessed values: these are no prior knowledge."""
    for _ in range(ROUNDS if opened else 0):
        anchor = found.anchor | {k: found.values[k] for k in opened}
        further = again(replace(found, anchor=anchor))
        if further.total < found.total + BETTER:
            break
        found = further
    return found


def _balanced_start(predictor: Predictor, anchor: Mapping[str, float]) -> dict[str, float]:
    """The values of the plain balance and of the comparison, where they know them."""
    held, known = predictor.model.held(), predictor.data.plain
    found = {k: known[k] for k in BALANCED if k in anchor and known.get(k, 0.0) > 0.0}
    free = coordinates(predictor, [k for k in found if k not in held], anchor)
    values = dict(anchor) | {k: v for k, v in found.items() if k not in held}
    return inside(free, values, predictor.model)


def turned(predictor: Predictor, train: Windows, start: Start) -> Start:
    """The values with the phases of declared effects turned, where that is more likely.

    Angles and times have a different zero in each log.
    """
    model, held = predictor.model, predictor.model.held()
    angles = [
        f"{part.key}.{name}"
        for part in model.effects
        for name, p in part.block.parameters.items()
        if p.angle and f"{part.key}.{name}" not in held
    ]
    for key in angles:
        sets = [start.values | {key: start.values[key] + turn} for turn in (0.0, *TURNS)]
        start = likeliest(predictor, train, start.noise, sets)
    return start


def _balanced(model: Model, data: Data) -> dict[str, float]:
    """Undeclared values of inertia, Coulomb and viscous friction, from the plain torque balance.

    What it does not know, or has no sign of, starts at a small value.
    """
    log = data.log
    size = float(np.std(log.u))
    least = {k: size * part for k, part in LEAST.items()}
    least["Fv"] /= float(np.max(np.abs(log.w)))
    least["J"] /= float(np.std(log.a))
    opened = [k for k in LEAST if k in model.values() and model.values()[k] is None]
    return {k: max(data.plain.get(k, 0.0), least[k]) for k in opened}


def _searched(core: Model, data: Data, train: Windows, asked: Model) -> Model:
    """The best point of a coarse grid for what the regression cannot identify."""
    guesses = [core.with_values(guess) for guess in _guesses(asked, core.values(), data)]
    if not guesses:
        return core
    predictor = Predictor(guesses[0], data)
    noise = replace(data.noise, jump=0.3 * data.noise.jump)
    white = whitened(predictor, [g.known() for g in guesses], train, noise)
    cost = np.sum(white**2, axis=(1, 2, 3))
    return guesses[int(np.argmin(np.where(np.isfinite(cost), cost, np.inf)))]


def _guesses(asked: Model, values: Mapping, data: Data) -> list[dict[str, float]]:
    """A coarse grid of the undeclared values that a regression cannot identify."""
    opened = {k for k, v in asked.values().items() if v is None}
    J, Fc, speed = values["J"] or 0.0, values.get("Fc") or 0.0, data.log.fastest
    guesses = []
    for more, z, v in product(_own(asked), DEFLECTIONS, STRIBECK_SPEEDS):
        sigma0 = Fc / (z * speed) if Fc else 1.0
        guess = {"sigma0": sigma0, "sigma1": np.sqrt(sigma0 * J), "Fs": 1.2 * Fc, "vs": v * speed}
        missing = {k: float(g) for k, g in guess.items() if k in opened} | more
        guesses.append(asked.kept(_ordered(values, missing)))
    return [g for i, g in enumerate(guesses) if g and g not in guesses[:i]]


def _own(asked: Model) -> list[dict[str, float]]:
    """Undeclared parameters that only this law has: their defaults, then each one changed."""
    own = {k: p for k, p in asked.friction.block.own.items() if k not in (*BALANCED, "sigma1")}
    usual = {k: p.value for k, p in own.items() if asked.friction.values.get(k, 0.0) is None}
    changed = [
        usual | {k: float(np.clip(factor * usual[k], own[k].low, own[k].high))}
        for k in usual
        for factor in FACTORS
    ]
    return [usual, *changed]


def _ordered(values: Mapping, missing: dict[str, float]) -> dict[str, float]:
    """Keep a guessed stiction above a given Coulomb level."""
    if "Fs" in missing:
        missing["Fs"] = max(missing["Fs"], EXCESS * (values["Fc"] or 0.0))
    return missing


def _with_effect(core: Model, part: Part, data: Data) -> Model:
    """The model with a declared effect without values, as the comparison of torques found it.

    Where that finds no strength within the bounds, the values beside it are the usual ones.
    """
    own = part.block.own
    found = {k: data.plain.get(f"{part.key}.{k}", v) for k, v in part.values.items()}
    if (found[part.block.gain] or 0.0) < own[part.block.gain].low:
        found = {k: own[k].value if v is None else v for k, v in found.items()}
    values = {
        k: float(np.clip(v, own[k].low, own[k].high)) for k, v in found.items() if v is not None
    }
    if len(values) < len(found):
        raise Refused(
            f"The declared effect {part.block.name} cannot be identified from the record: no value "
            "within its bounds fits.",
            "Give its values in the model file, or leave the effect out.",
        )
    return core.with_effect(part.block.name, values)

"""Any registered block as columns along a measured motion.

No equation of an effect or of a friction law stands here: a block's own function is evaluated
along the motion, its states are integrated along it, and its declaration says the rest (what it
acts on, its neutral value, its bounds, what combines linearly). A torque stands on the resisting
side:

    u = J a + F + columns @ coefficients

An effect is linear in its strength, the distance of its first parameter from the neutral value;
with an inertia and a spring, if the other parameters in N m or kg are scaled with it. A phase or a
rest that is declared with ``span`` is a second column. What else is fitted enters by its slopes.
Blocks with states are integrated by the engine.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property, wraps
from typing import Any, TypeVar

import numpy as np

from ..blocks.block import Block
from ..blocks.friction import level as sliding_level
from ..blocks.plant import borrowed
from ..core.bare_system import BareSystem
from ..engine.batch_run import Lanes
from . import constants as const
from .motion import bend, by_piece, cubic, slope

Signals = Mapping[str, np.ndarray]
Pieces = Sequence[tuple[slice, float]]
T = TypeVar("T")


def once_a_block(function: Callable[[Block], T]) -> Callable[[Block], T]:
    """What is asked of a block, answered once for each."""
    known: dict[int, tuple[Block, T]] = {}  # a block that is kept keeps its id

    @wraps(function)
    def asked(block: Block) -> T:
        if id(block) not in known:
            known[id(block)] = block, function(block)
        return known[id(block)][1]

    return asked


def changes(block: Block, results: Sequence[Any], signals: Mapping[str, Any]) -> list[Any]:
    """What each output changes: torque lost at the input, a sensor's error, or itself."""
    made = []
    for i, name in enumerate(block.fresh):
        act = block.acts[i if len(block.fresh) == len(block.acts) else 0] if block.acts else ""
        out = results[i]
        if act == "input":
            out = signals["u"] - out
        elif act == "sensor":
            out = out - signals[name.removesuffix("_m")]
        made.append(out)
    return made


def driven(
    block: Block, sets: Sequence[Mapping[str, float]], signals: Signals, pieces: Pieces
) -> list[np.ndarray]:
    """Changes by each output of a block with states, (n, sets) each: means around each sample, so
    that a torque is neither early nor late; where u is held, over the cell in which it is."""
    out = np.zeros((len(block.fresh), len(next(iter(signals.values()))), len(sets)))
    for piece, dt in pieces:
        own = {k: x[piece] for k, x in signals.items()}
        k = int(np.clip(round(dt / const.FINE), 1, 10))
        some = max(1, const.ROOM // (len(block.states) * k * len(own[block.reads[0]])))
        for first in range(0, len(sets), some):
            few = slice(first, first + some)
            out[:, piece, few] = _along(block, sets[few], own, dt, k)
    return list(out)


def _along(
    block: Block, sets: Sequence[Mapping[str, float]], own: Signals, dt: float, k: int
) -> np.ndarray:
    """Changes (outputs, n, sets) over one piece, by ``k`` steps a sample."""
    held, lanes, n = "input" in block.acts, _lanes(block), len(own[block.reads[0]])
    many, shares = len(block.fresh), (np.arange(k) + 0.5) / k
    between = _between(own, shares, dt, held)
    p = np.array([[float(one[name]) for name in lanes.parameters] for one in sets])
    first = [0.0 if name == "0" else float(own[name][0]) for name in block.start]
    sums, last = lanes.run(
        np.tile([*first, *[0.0] * many], (len(sets), 1)), np.zeros(len(sets), int), n * k,
        np.column_stack([between[name] for name in block.reads])[None],
        p.reshape(len(sets), -1), dt=dt / k, substeps=1,
    )  # fmt: skip
    sums = np.concatenate([sums, last[:, None, -many:]], axis=1)
    means = np.moveaxis(np.diff(sums, axis=1) / (dt / k), 0, 2).reshape(n, k, many, len(sets))
    if held:
        return means.mean(1).swapaxes(0, 1)
    return _around(means, shares).swapaxes(0, 1)


def _between(own: Signals, shares: np.ndarray, dt: float, held: bool) -> dict[str, np.ndarray]:
    """Signals (n shares,) between the samples; beyond the end the speed stays."""
    made = {}
    for name, x in own.items():
        rise = np.append(np.diff(x), 0.0) * (name != "u" or not held)
        made[name] = (x[:, None] + shares * rise[:, None]).ravel()
    if {"theta", "w"} <= own.keys():
        theta, rise = cubic(own["theta"], own["w"] * dt, shares)
        made |= {"theta": theta.ravel(), "w": rise.ravel() / dt}
    return made


def _around(means: np.ndarray, shares: np.ndarray) -> np.ndarray:
    """Means over steps (n, k, ...) -> around the samples (n, ...), by triangles, without what these
    take off slow changes; the first sample has only what comes after it."""
    before, after = (np.tensordot(means, w / len(w), (1, 0)) for w in (shares, 1.0 - shares))
    made = after
    made[1:] += before[:-1]
    made[0] *= 2.0
    spread = float(np.mean((1.0 - shares) * shares**2))
    made[1:-1] -= spread * (made[2:] - 2.0 * made[1:-1] + made[:-2])
    return made


@once_a_block
def _lanes(block: Block) -> Lanes:
    """The states of a block and the integrals of its changes, as the engine reads them."""
    many = len(block.fresh)
    sums = tuple(f"sum of {name}" for name in block.fresh)

    def rates(_t: Any, x: Any, u: Any, p: Mapping[str, Any]) -> np.ndarray:
        values = {k: p[k] for k in block.parameters}
        results = block(*u, *x[: len(block.states)], **values)
        signals = dict(zip(block.reads, u, strict=True))
        return np.array([*results[many:], *changes(block, results[:many], signals)])

    return Lanes(BareSystem(
        rates, lambda _t, x, _u, _p: x[len(block.states) :], inputs=block.reads, outputs=sums,
        states=(*block.states, *sums), params={k: x or 0.0 for k, x in block.defaults().items()},
        name=block.name,
    ))  # fmt: skip


SERVED = ("torque", "input", "sensor", "J", "Fc", "Fs", "Fv", "+J", "+Fc", "+Fs", "+Fv")
SIGNALS = ("t", "theta", "w", "u", "d", "load")
OF_THE_DRIVE = ("z", "follows", "coulomb", "level", "viscous", "load")

TINY = np.finfo(float).tiny  # a speed that has a direction at rest

Values = Mapping[str, Any]


@dataclass(frozen=True, eq=False)
class Along:
    """The signals of one log, sample by sample: (n,) arrays in SI units."""

    t: np.ndarray
    theta: np.ndarray  # smooth, as w
    w: np.ndarray
    acceleration: np.ndarray  # the stiffer one, which J goes with
    path: np.ndarray  # the stiffer position, without jumps between the pieces
    pieces: Pieces  # stretches of even time and their step: nothing looks across a cut
    u: np.ndarray  # as recorded, or as earlier effects on the input left it
    z: np.ndarray  # deflection of the bristle in units of its limit
    follows: np.ndarray  # its derivative by an asymmetry of that limit
    coulomb: np.ndarray  # Coulomb and Stribeck part of friction
    level: np.ndarray  # of that, >= 0
    viscous: np.ndarray
    load: np.ndarray  # torque of the loads: declared ones and the measured d
    J: float
    values: Mapping[str, float]  # of the plant and its friction law
    d: np.ndarray | None = None

    @classmethod
    def of(cls, motion: Any, **known: Any) -> Along:
        """The signals of a motion; what is not known of the drive is 0."""
        own = ("t", "theta", "w", "acceleration", "path", "pieces", "u")
        none = dict.fromkeys(OF_THE_DRIVE, np.zeros(len(motion)))
        known = {"J": 0.0, "values": {}, **none, **known}
        return cls(**{k: getattr(motion, k) for k in own} | known)

    def __len__(self) -> int:
        return len(self.t)

    @cached_property
    def stiff(self) -> dict[str, np.ndarray]:
        """Position and speed of the motion that the acceleration belongs to."""
        theta, w = self.path.copy(), np.empty(len(self))
        for piece, dt in self.pieces:
            theta[piece] += np.mean(self.theta[piece] - self.path[piece])
            w[piece] = slope(self.path[piece], dt)
        return {"theta": theta, "w": w}

    def signals(self, block: Block) -> dict[str, np.ndarray]:
        """What a block reads. One with an inertia or a sensor moves with the stiffer motion."""
        d = np.zeros(len(self)) if self.d is None else self.d
        own = {k: getattr(self, k) for k in SIGNALS} | {"d": d}
        return own | self.stiff if _is_stiff(block) else own


@dataclass(frozen=True, eq=False)
class Columns:
    """Torques (n, k) on the resisting side for coefficients of 1, and the coefficients' bounds."""

    wide: np.ndarray | None  # to be smoothed as u is; None stands for zeros
    narrow: np.ndarray | None  # belongs to the smooth acceleration already
    low: np.ndarray
    high: np.ndarray

    @property
    def torque(self) -> np.ndarray:
        """Both parts together (n, k)."""
        wide, narrow = (0.0 if x is None else x for x in (self.wide, self.narrow))
        return np.asarray(wide + narrow)

    def of(self, function: Any, low: np.ndarray, high: np.ndarray) -> Columns:
        """Other columns, by a function of each part."""
        parts = (None if x is None else function(x) for x in (self.wide, self.narrow))
        return Columns(*parts, low=low, high=high)


# What a declaration says


def linear(block: Block) -> tuple[str, ...]:
    """The parameters in which a block is linear: strength, ``span``-ned phase or rest; or none."""
    if block.kind != "effect" or scaled(block) is None:
        return ()
    span = _spanned(block)
    return (block.gain,) if span is None else (block.gain, span)


def nonlinear(block: Block, motion: str = "rotary") -> tuple[str, ...]:
    """What else is fitted: neither choices nor what keeps its usual value, nor a whole number."""
    rest = (k for k in searched(block) if not block.own[k].choices)
    return tuple(k for k in rest if motion == "linear" or not block.own[k].whole)


def searched(block: Block) -> tuple[str, ...]:
    """What else a log has to say: as :func:`nonlinear`, with choices and whole numbers."""
    known = linear(block)
    return tuple(k for k, p in block.own.items() if k not in known and p.fitted and not p.usual)


def needs_inertia(block: Block) -> bool:
    """Whether an effect means nothing where J is not known: mass, or a sensor's error."""
    of_mass = any(p.unit == "kg m2" for p in block.parameters.values())
    return of_mass or bool({"J", "+J", "sensor"} & {*block.acts})


@once_a_block
def refused(block: Block) -> str:
    """One sentence why a block cannot be a candidate, '' if it can."""
    if block.kind not in ("effect", "friction"):
        return f"{block.name} is a {block.kind}, neither an effect nor a friction law"
    if block.kind == "effect" and not block.acts:
        return f"{block.name} acts on nothing inside a drive"
    for name in (*block.acts, *block.inputs):
        if name not in (*SERVED, *SIGNALS):
            return f"{block.name} acts on or reads {name}, which no log has"
    log = _some_motion()
    try:
        with np.errstate(all="ignore"):
            _torques(block, [_filled(block, {}, log)], log)
    except NameError:  # a misspelt name is no reason to leave an effect out: it is said
        raise
    except Exception as error:  # whatever a function of the user raises
        why = f"{type(error).__name__}: {error}".rstrip(".")
        return f"{block.name} cannot be evaluated along the arrays of a log ({why})"
    return ""


# Columns


def columns(block: Block, values: Values, along: Along) -> Columns:
    """The linear columns of a block, at the values of what it is not linear in: one for a strength
    of 1, two where a phase or a rest is ``span``-ned. A block that is not linear in its strength
    has one column, its torque at these values, whose coefficient is 1."""
    return lanes(block, [values], along)


def lanes(block: Block, sets: Sequence[Values], along: Along) -> Columns:
    """The columns of :func:`columns` for each set of values, side by side."""
    known = linear(block)
    one = np.ones(len(sets))
    if not known:
        usual = _usual(block, along)
        made = _torques(block, [_completed(values, usual) for values in sets], along)
        return Columns(*made, low=one, high=one)
    p, more = block.own[block.gain], _places(block, along)
    usual, per = _usual(block, along), scaled(block) or ()
    each = [_scaled(block, values, usual, per) | place for values in sets for place in more]
    made = Columns(*_torques(block, each, along), low=one, high=one)
    neutral = p.neutral or 0.0
    low, high = one * (p.low - neutral), one * (p.high - neutral)
    if len(known) == 1:
        return replace(made, low=low, high=high)
    if block.own[known[1]].angle:
        high = np.full(2 * len(sets), p.high)
        return replace(made, low=-high, high=high)
    free = np.full(len(sets), np.inf)

    def place_and_step(x: np.ndarray) -> np.ndarray:
        return _turns(x[:, ::2].T, (x[:, 1::2] - x[:, ::2]).T).T

    return made.of(place_and_step, _turns(low, -free), _turns(high, free))


def torque(block: Block, values: Values, along: Along) -> Columns:
    """The torque of an effect or of a friction law at these values, as one column."""
    made = _torques(block, [_filled(block, values, along)], along)
    return Columns(*made, low=np.ones(1), high=np.ones(1))


def changed_input(block: Block, values: Values, along: Along) -> np.ndarray:
    """The torque (n,) that an effect on the input makes of u."""
    lost = torque(block, values, along).wide
    return along.u if lost is None else along.u - lost[:, 0]


def slopes(block: Block, values: Values, along: Along, steps: Mapping[str, float]) -> Columns:
    """Derivatives of :func:`torque` by parameters: central differences with these steps."""
    own, free = _filled(block, values, along), np.full(len(steps), np.inf)
    sets, between = [], []
    for k, step in steps.items():
        p = block.parameters[k]
        less, more = max(own[k] - step, p.low), min(own[k] + step, p.high)
        sets += [own | {k: less}, own | {k: more}]
        between.append(more - less if np.isfinite(own[k]) else 1.0)  # no limit: no slope
    both = Columns(*_torques(block, sets, along), low=-free, high=free)
    return both.of(lambda x: (x[:, 1::2] - x[:, ::2]) / np.array(between), -free, free)


def step_of(block: Block, key: str, value: float, along: Along) -> float:
    """How far to go for a difference: a share of a positive quantity; of a frequency or an order
    what moves the end of the log by 0.1 rad; of a place or an instant a share of the log's."""
    p, reach = block.parameters[key], max(float(np.ptp(along.path)), 1e-12)
    duration = max(float(np.ptp(along.t)), 1e-12)
    if p.whole or p.unit == "Hz":
        return const.STEP_TURN / (reach if p.whole else 2 * np.pi * duration)
    if p.angle or p.unit == "rad" and p.low < 0.0:
        return const.SLIGHT * (1.0 if p.angle else reach)
    if p.instant:
        return const.STEP_DURATION * duration
    least = {"s": 0.1 * along.pieces[0][1], "rad": 0.1 * const.SLIGHT * reach}.get(p.unit, 1e-6)
    size = abs(value) if np.isfinite(value) else 1.0
    return max(const.STEP_SHARE * max(size, abs(p.value or 0.0) * (p.low < 0.0)), least)


# Coefficients and parameters


def to_values(
    block: Block, coefficients: Sequence[float] | np.ndarray, values: Values, along: Along
) -> dict[str, float]:
    """The parameters that coefficients of :func:`columns` mean, beside the values given there."""
    known, made = linear(block), dict(values)
    if not known:
        return made
    unit = _scaled(block, values, _usual(block, along), scaled(block) or ())
    size, neutral = float(coefficients[0]), block.own[block.gain].neutral or 0.0
    if len(known) == 2:
        other = float(coefficients[1])
        if block.own[known[1]].angle:
            phase = float(np.arctan2(other, size))
            size, made[known[1]] = float(np.hypot(size, other)), phase if phase > -np.pi else np.pi
        else:
            made[known[1]] = _places(block, along)[0][known[1]] + (other / size if size else 0.0)
    made |= {k: size * unit[k] for k in scaled(block) or () if k in values}
    return made | {block.gain: neutral + size}


def to_coefficients(block: Block, values: Values, along: Along) -> np.ndarray:
    """The coefficients of :func:`columns` that stand for these values."""
    known = linear(block)
    if not known:
        return np.ones(1)
    own = _filled(block, values, along)
    size = own[block.gain] - (block.own[block.gain].neutral or 0.0)
    if len(known) == 1:
        return np.array([size])
    if block.own[known[1]].angle:
        return size * np.array([np.cos(own[known[1]]), np.sin(own[known[1]])])
    return np.array([size, size * (own[known[1]] - _places(block, along)[0][known[1]])])


def _usual(block: Block, along: Along) -> dict[str, Any]:
    """A value of each parameter: shared with the plant, or its default."""
    plant = {k: x for k, x in {**along.values, "J": along.J}.items() if x is not None}
    return {**block.defaults(), **borrowed(block, plant)}


def _completed(values: Values, usual: Values) -> dict[str, Any]:
    """The given values, and usual ones of the other parameters."""
    return {**usual, **{k: x for k, x in values.items() if x is not None}}


def _filled(block: Block, values: Values, along: Along) -> dict[str, Any]:
    return _completed(values, _usual(block, along))


def _scaled(block: Block, values: Values, usual: Values, per: Sequence[str]) -> dict[str, Any]:
    """All parameters for a strength of 1, with which those of ``per`` go."""
    own, gain = _completed(values, usual), block.gain
    neutral = block.parameters[gain].neutral or 0.0
    size = own[gain] - neutral if gain in values else 1.0
    per_unit = {k: own[k] / size for k in per} if size else {}
    return own | per_unit | {gain: neutral + 1.0}


def _places(block: Block, along: Along) -> list[dict[str, float]]:
    """The values of a spanned parameter at which columns are made; one empty set without one."""
    key = _spanned(block)
    if key is None:
        return [{}]
    p = block.own[key]
    assert p.span is not None
    if p.angle:
        return [{key: p.span[0]}, {key: p.span[1]}]
    middle = float(np.mean(along.theta)) if p.unit == "rad" else p.span[0]
    return [{key: middle}, {key: middle + 1.0}]


def _spanned(block: Block) -> str | None:
    return next((k for k, p in block.own.items() if p.span is not None), None)


def _turns(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Entries of a and of b in turn."""
    return np.stack([a, b], axis=1).reshape(2 * len(a), *a.shape[1:])


# The torque


def _jumps(block: Block) -> bool:
    """Whether it jumps with the direction, and so follows the bristle."""
    return block.abrupt and not block.states and "w" in block.inputs


def _is_stiff(block: Block) -> bool:
    of_mass = any(p.unit == "kg m2" for p in block.own.values())
    return of_mass or "sensor" in block.acts


def _torques(
    block: Block, sets: Sequence[Mapping[str, Any]], along: Along
) -> tuple[np.ndarray | None, np.ndarray | None]:
    """Torque (n, sets) of complete values, in the wide and in the narrow part."""
    if block.kind == "friction":
        return _outputs(block, sets, along)[0], None
    made = _outputs(block, sets, along)
    if "sensor" in block.acts:
        return None, _of_sensor(block, made, along)
    jump = []
    if _jumps(block):
        up, down = (_outputs(block, sets, along, way) for way in (1.0, -1.0))
        made = [0.5 * (a + b) for a, b in zip(up, down, strict=True)]
        jump = [0.5 * (a - b) for a, b in zip(up, down, strict=True)]
    parts = [(act, out, _weight(act, along)) for act, out in block.deeds(made)]
    if jump:
        parts += [(act, out, _weight_of_jump(act, along)) for act, out in block.deeds(jump)]
    wide, narrow = [], []
    for act, out, weight in parts:
        part = narrow if act in ("J", "+J") or _is_stiff(block) else wide
        part.append(out if weight is None else out * weight[:, None])
    both = [sum(x[1:], x[0]) if x else None for x in (wide, narrow)]
    return both[0], both[1]


def _weight(act: str, along: Along) -> np.ndarray | None:
    """The torque that a change of 1 adds, by what it acts on: relative, or in N m after a plus;
    None for a torque itself."""
    if act in ("torque", "input"):
        return None
    if act in ("J", "+J"):
        return along.acceleration if act == "+J" else along.J * along.acceleration
    if act in ("Fv", "+Fv"):
        return along.w if act == "+Fv" else along.viscous
    return _weight_of_level(act, along, along.z, along.coulomb)


def _weight_of_jump(act: str, along: Along) -> np.ndarray:
    """The same of what jumps with the direction of w."""
    if act == "torque":
        return along.z
    if act in ("Fc", "Fs", "+Fc", "+Fs"):
        return _weight_of_level(act, along, along.follows, along.follows * along.level)
    way, weight = np.sign(along.w), _weight(act, along)
    return way if weight is None else way * weight


def _weight_of_level(act: str, along: Along, z: np.ndarray, coulomb: np.ndarray) -> np.ndarray:
    """Of a level of friction; one that the friction law does not have is 0."""
    v, static = along.values, np.zeros(len(along))
    if act != "+Fc" and v.get("Fs") is None:
        return coulomb if act == "Fc" else static
    if v.get("Fs") is not None and v.get("vs") is not None:
        static = sliding_level(along.w, 0.0, 1.0, v["vs"])
    if act == "+Fc":
        return (1.0 - static) * z
    if act == "+Fs":
        return static * z
    of_Fs = static * z * v["Fs"]
    return coulomb - of_Fs if act == "Fc" else of_Fs


def _of_sensor(block: Block, errors: list[np.ndarray], along: Along) -> np.ndarray:
    """An error of the position, or of the speed alone, as a torque: the true acceleration is the
    measured one without its second, or first, derivative."""
    by_name = dict(zip(block.fresh, errors, strict=True))
    if np.any(by_name["theta_m"]):
        return -along.J * by_piece(bend, by_name["theta_m"], along.pieces)
    return -along.J * by_piece(slope, by_name["w_m"], along.pieces)


def _outputs(
    block: Block, sets: Sequence[Mapping[str, Any]], along: Along, way: float | None = None
) -> list[np.ndarray]:
    """Changes by each output (n, sets); ``way``: as if the drive moved in this direction."""
    signals = along.signals(block)
    exact: Any = block.exact
    if exact is not None and block.acts == ("input",):  # of a held input

        def held(values: Values) -> np.ndarray:
            own = {k: values[k] for k in block.own}
            return by_piece(lambda u, dt: exact(u, dt, **own), along.u, along.pieces)

        return [np.column_stack([along.u - held(values) for values in sets])]
    if block.states:
        return driven(block, sets, signals, along.pieces)
    if way is not None:
        signals["w"] = way * np.maximum(np.abs(signals["w"]), TINY)
    keys = {k: np.array([one[k] for one in sets]) for k in block.parameters}
    values = {k: float(x[0]) if np.all(x == x[0]) else x for k, x in keys.items()}
    made = block(*(signals[k][:, None] for k in block.reads), **values)
    made = changes(block, made, {k: x[:, None] for k, x in signals.items()})
    shape = (len(along), len(sets))
    return [np.broadcast_to(np.asarray(x, float), shape) for x in made]


# Linear in its strength?


@once_a_block
def scaled(block: Block) -> tuple[str, ...] | None:
    """The parameters that go with the strength, so that the torque is linear in it; or None."""
    log = _some_motion()
    p = block.own[block.gain]
    if p.neutral is None or not np.isfinite(p.neutral) or refused(block):
        return None
    mass = re.compile(r"\b(N|kg)\b")
    both = (k for k, q in block.own.items() if mass.search(q.unit) and mass.search(p.unit))
    for also in ((), tuple(k for k in both if k != block.gain)):
        sets = []
        for size in (const.PART, 2 * const.PART):
            own = _filled(block, {}, log)
            more = {k: own[k] * size for k in also}
            sets.append(own | more | {block.gain: p.neutral + size})
        with np.errstate(all="ignore"):
            parts = [x for x in _torques(block, sets, log) if x is not None]
        if all(np.all(np.abs(b - 2.0 * a) <= const.EXACT * np.max(np.abs(b))) for a, b in
               (x.T for x in parts)):  # fmt: skip
            return also
    return None


@cache
def _some_motion() -> Along:
    """A short motion to and fro, with which blocks are tried."""
    dt = 2e-3
    t = dt * np.arange(250)
    theta = 0.7 * np.sin(11.0 * t + 0.3) + 0.4 * np.sin(29.0 * t) + 3.0 * t
    w, u = slope(theta, dt), 1.5 * np.sin(17.0 * t) + 0.4
    way = np.tanh(w)
    return Along(
        t=t,
        theta=theta,
        w=w,
        acceleration=bend(theta, dt),
        path=theta,
        pieces=((slice(0, len(t)), dt),),
        u=u,
        z=way,
        follows=way**2,
        coulomb=0.3 * way,
        level=np.full(len(t), 0.3),
        viscous=0.02 * w,
        load=0.2 * np.sin(theta),
        J=0.01,
        values={"Fc": 0.3, "Fs": 0.4, "Fv": 0.02, "vs": 1.0, "sigma0": 100.0, "sigma1": 0.5},
    )

"""How effects are hidden: what is drawn of each, and which number carries its strength.

A recipe looks at a context (machine, an effect-free run of the same record) and returns a
`Size`: the parameters as a function of one number, its first guess, its bounds, and the power
with which the effect torque grows with it. Those with a text are outside the catalogue.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from .machines import GRAVITY_LOAD, Machine
from .run import FINE, STIFF

TURN = 2.0 * np.pi
MOVING = ("rich", "moves", "multisine", "torque")
ALL = ("rich", "sparse", "stopgo", "moves", "multisine", "torque")


@dataclass(frozen=True)
class Context:
    """The effect-free run: its signals, the RMS of its friction, and what is wanted."""

    machine: Machine
    t: np.ndarray
    u: np.ndarray
    theta: np.ndarray
    w: np.ndarray
    friction: float
    target: float
    rate: float
    fine: float  # s, step of the simulation

    @property
    def aim(self) -> float:
        """Wanted RMS of the effect torque."""
        return self.target * self.friction

    def scaled(self, shape: np.ndarray) -> float:
        """Factor that gives this shape the wanted RMS."""
        return self.aim / max(float(np.sqrt(np.mean(shape**2))), 1e-12)

    @property
    def acceleration(self) -> np.ndarray:
        return np.gradient(self.w, self.t)


@dataclass(frozen=True)
class Size:
    build: Callable[[float], tuple[float, ...]]
    start: float
    low: float = 0.0
    high: float = np.inf
    power: float = 1.0
    friction: Callable[[Machine, float], Machine] | None = None  # truth has other friction


@dataclass(frozen=True)
class Effect:
    name: str
    parameters: tuple[str, ...]
    depends_on: tuple[str, ...]
    recipe: Callable[[Context, np.random.Generator], Size]
    excitations: tuple[str, ...] = MOVING
    only: str = ""  # "rotary", "load" (needs a gravity load), "tacho"
    declared: str = "lugre"  # friction model of the model file
    late: bool = False  # adds phase lag to the loop: tune gently
    text: str = ""  # strangers: what it is


CATALOGUE: dict[str, Effect] = {}
STRANGERS: dict[str, Effect] = {}


def effect(name: str, parameters: str, depends_on: str, **options):
    def enter(recipe):
        home = STRANGERS if options.get("text") else CATALOGUE
        home[name] = Effect(
            name, tuple(parameters.split()), tuple(depends_on.split()), recipe, **options
        )
        return recipe

    return enter


def phase(rng) -> float:
    return float(rng.uniform(-np.pi, np.pi))


def either(rng) -> float:
    return float(rng.choice([-1.0, 1.0]))


def harmonic(c: Context, rng, low: int = 2, high: int = 24) -> float:
    """Per turn, or per metre on a linear axis; slow enough to be seen at the record's rate."""
    if not c.machine.rotary:
        return TURN / float(rng.choice([0.01, 0.02, 0.04, 0.05, 0.06]))
    fastest = 0.3 * np.pi * c.rate / float(np.max(np.abs(c.w)))
    return float(rng.integers(low, max(low + 1, min(high, int(fastest)) + 1)))


def moment(c: Context, rng) -> float:
    return float(rng.uniform(0.35, 0.65)) * float(c.t[-1])


def needs_gravity(names: list[str]) -> bool:
    return any(CATALOGUE[n].only == "load" for n in names if n in CATALOGUE)


def suits(name: str, machine: Machine, position_only: bool) -> bool:
    only = find(name).only
    if only == "load" and machine.load[0] != GRAVITY_LOAD:
        return False
    return not (only == "rotary" and not machine.rotary or only == "tacho" and position_only)


def find(name: str) -> Effect:
    """The effect of this name, or a sentence that lists the names."""
    for home in (CATALOGUE, STRANGERS):
        if name in home:
            return home[name]
    raise ValueError(f"unknown effect {name!r}: one of {', '.join([*CATALOGUE, *STRANGERS])}")


@effect("constant_torque", "torque", "", excitations=ALL)
def _constant(c, rng):
    s = either(rng)
    return Size(lambda x: (s * x,), c.aim)


@effect("gravity", "amplitude phase", "theta", only="rotary")
def _gravity(c, rng):
    phi = phase(rng)
    return Size(lambda x: (x, phi), c.scaled(np.sin(c.theta + phi)))


@effect("torque_ripple", "amplitude harmonic phase", "theta")
def _ripple(c, rng):
    n, phi = harmonic(c, rng), phase(rng)
    return Size(lambda x: (x, n, phi), c.scaled(np.sin(n * c.theta + phi)))


@effect("position_dependent_friction", "ratio harmonic phase", "theta w")
def _position_friction(c, rng):
    n, phi = harmonic(c, rng, 1, 8), phase(rng)
    return Size(lambda x: (x, n, phi), 1.4 * c.target, high=0.9)


@effect("coulomb_asymmetry", "ratio", "w", excitations=ALL)
def _coulomb(c, rng):
    s = either(rng)
    return Size(lambda x: (s * x,), c.target, high=0.8)


@effect("viscous_asymmetry", "ratio", "w")
def _viscous(c, rng):
    s = either(rng)
    return Size(lambda x: (s * x,), min(0.9, c.scaled(c.machine.Fv * c.w)), high=0.9)


@effect("quadratic_drag", "coefficient", "w")
def _quadratic(c, rng):
    return Size(lambda x: (x,), c.scaled(c.w**2))


@effect("thermal_drift", "ratio time_constant", "t w", excitations=ALL)
def _thermal(c, rng):
    s, tau = (-1.0 if rng.random() < 0.75 else 1.0), c.t[-1] * float(rng.uniform(0.15, 0.5))
    return Size(lambda x: (s * x, tau), 1.4 * c.target, high=0.75)


@effect("load_dependent_friction", "coefficient", "theta w", only="load")
def _load(c, rng):
    load = c.machine.load_peak * np.sin(c.theta + c.machine.load[2])
    return Size(lambda x: (x,), c.scaled(load), high=2.0)


@effect("dwell_stiction", "ratio time_constant", "w t", excitations=("stopgo",))
def _dwell(c, rng):
    tau = float(np.exp(rng.uniform(np.log(0.1), np.log(0.8))))
    return Size(lambda x: (x, tau), 0.6, high=1.5)


@effect("stribeck", "Fs vs", "w", excitations=("sparse", "stopgo", "moves"), declared="coulomb")
def _stribeck(c, rng):
    m, vs = c.machine, 0.1 * float(np.max(np.abs(c.w)))

    def truth(m: Machine, excess: float) -> Machine:
        # bristles so stiff that only the static map is left to see
        sigma0 = STIFF * m.J / FINE**2
        sigma1 = 0.8 * np.sqrt(sigma0 * m.J)
        Fs = m.Fc + excess
        return replace(m, Fs=Fs, Fs_twin=m.Fc, sigma0=sigma0, sigma1=sigma1, vs=vs)

    return Size(lambda x: (m.Fc + x, vs), 0.4 * m.Fc, high=2.0 * m.Fc, friction=truth)


def _presliding_truth(m: Machine, sigma0: float) -> Machine:
    sigma1 = 0.5 * np.sqrt(sigma0 * m.J)
    return replace(m, sigma0=sigma0, sigma1=sigma1, twin_static=True)


@effect("presliding", "sigma0 sigma1", "w", excitations=ALL, declared="stribeck")
def _presliding(c, rng):
    m = c.machine

    def build(sigma0):
        return sigma0, 0.5 * float(np.sqrt(sigma0 * m.J))

    low, high = 0.003 * m.sigma0, 5.0 * m.sigma0
    return Size(build, 0.1 * m.sigma0, low, high, -0.7, _presliding_truth)


def _timing(c: Context, shape: Callable[[float], np.ndarray], low: float, high: float) -> float:
    """First guess of a time from the effect-free run."""
    probe = 3e-3
    rms = float(np.sqrt(np.mean(shape(probe) ** 2)))
    return float(np.clip(probe * c.aim / max(rms, 1e-12), low, high))


def _late_torque(c: Context):
    return lambda T: c.u - np.interp(c.t - T, c.t, c.u)


@effect("input_delay", "delay", "u", late=True)
def _delay(c, rng):
    high = max(0.01, 2.5 / c.rate)
    start = _timing(c, _late_torque(c), 1e-3, high)
    return Size(lambda x: (round(x / c.fine) * c.fine,), start, 5e-4, high)


@effect("actuator_lag", "time_constant", "u", late=True)
def _lag(c, rng):
    high = max(0.016, 4.0 / c.rate)
    return Size(lambda x: (x,), _timing(c, _late_torque(c), 1e-3, high), 5e-4, high)


@effect("velocity_sensor_lag", "time_constant", "w", only="tacho", late=True)
def _sensor(c, rng):
    def shape(T):
        return c.machine.J * np.gradient(c.w - np.interp(c.t - T, c.t, c.w), c.t)

    return Size(lambda x: (x,), _timing(c, shape, 1e-3, 0.016), 5e-4, 0.016)


@effect("actuator_saturation", "limit", "u", excitations=("rich", "torque"))
def _saturation(c, rng):
    m, u = c.machine, np.abs(c.u)
    floor = 1.15 * (m.Fs + m.load_peak)
    levels = np.linspace(0.999, 0.2, 80) * float(u.max())
    rms = [np.sqrt(np.mean(np.maximum(0.0, u - level) ** 2)) for level in levels]
    start = max(floor, float(np.interp(c.aim, rms, levels)))
    return Size(lambda x: (x,), start, floor, max(floor, float(u.max())), -4.0)


@effect("actuator_dead_zone", "half_width", "u", excitations=ALL)
def _dead_zone(c, rng):
    return Size(lambda x: (x,), c.aim, high=0.6 * float(np.max(np.abs(c.u))))


@effect("return_spring", "stiffness rest", "theta")
def _spring(c, rng):
    middle, span = 0.5 * (c.theta.max() + c.theta.min()), np.ptp(c.theta)
    rest = float(middle + rng.uniform(-0.3, 0.3) * span)
    return Size(lambda x: (x, rest), c.scaled(c.theta - rest))


@effect("hard_stop", "position stiffness side", "theta")
def _stop(c, rng):
    side, span = either(rng), float(np.ptp(c.theta))
    edge = float(c.theta.max() if side > 0 else c.theta.min())
    k = float(rng.uniform(2.0, 8.0)) * c.friction / (0.1 * span)
    depth = np.linspace(0.005, 0.45, 90) * span
    rms = [np.sqrt(np.mean(np.maximum(0, side * (c.theta - edge) + d) ** 2)) for d in depth]
    start = float(np.interp(c.aim, k * np.array(rms), depth))
    return Size(lambda x: (edge - side * x, k, side), start, 0.003 * span, 0.6 * span, 1.6)


def _second_mass(c: Context, rng) -> tuple[float, float, float]:
    """First guess of the load inertia, frequency of its spring with the motor held, damping."""
    start = float(np.clip(c.scaled(c.acceleration), 0.05 * c.machine.J, 2.0 * c.machine.J))
    highest = min(40.0, c.rate / 12.0)
    omega = TURN * float(rng.uniform(min(10.0, 0.7 * highest), highest))
    return start, omega, float(rng.uniform(0.03, 0.12))


@effect("elastic_coupling", "load_inertia stiffness damping", "w u")
def _elastic(c, rng):
    start, omega, zeta = _second_mass(c, rng)
    j = c.machine.J
    return Size(lambda x: (x, x * omega**2, 2.0 * zeta * x * omega), start, 0.03 * j, 2.0 * j, 1.0)


@effect("backlash", "load_inertia gap stiffness damping", "w u")
def _backlash(c, rng):
    start, omega, zeta = _second_mass(c, rng)
    j, omega = c.machine.J, 2.0 * omega
    gap = float(np.ptp(c.theta)) * float(np.exp(rng.uniform(np.log(0.002), np.log(0.01))))
    return Size(
        lambda x: (x, gap, x * omega**2, 4.0 * zeta * x * omega), start, 0.03 * j, 2.0 * j, 1.0
    )


@effect("inertia_step", "ratio time", "t w")
def _inertia(c, rng):
    s, t0 = (1.0 if rng.random() < 0.7 else -1.0), moment(c, rng)
    start = c.scaled(c.machine.J * c.acceleration * (c.t >= t0))
    top = 2.0 if s > 0 else 0.6
    return Size(lambda x: (s * x, t0), min(start, top), high=top)


@effect("friction_step", "ratio time", "t w", excitations=ALL)
def _friction(c, rng):
    s, t0 = either(rng), moment(c, rng)
    return Size(lambda x: (s * x, t0), 1.5 * c.target, high=1.5 if s > 0 else 0.75)


@effect("periodic_disturbance", "amplitude frequency phase", "t", excitations=ALL)
def _periodic(c, rng):
    f = float(np.exp(rng.uniform(np.log(0.7), np.log(min(20.0, c.rate / 10.0)))))
    phi = phase(rng)
    return Size(lambda x: (x, f, phi), np.sqrt(2.0) * c.aim)


@effect("encoder_eccentricity", "amplitude phase", "theta w", only="rotary")
def _eccentric(c, rng):
    phi = phase(rng)
    change = np.cos(c.theta + phi) * c.acceleration - np.sin(c.theta + phi) * c.w**2
    return Size(lambda x: (x, phi), min(0.15, c.scaled(c.machine.J * change)), high=0.15)


@effect("torque_constant_ripple", "ratio harmonic phase", "u theta")
def _constant_ripple(c, rng):
    n, phi = harmonic(c, rng, 1, 24), phase(rng)
    start = c.scaled(c.u * np.sin(n * c.theta + phi))
    return Size(lambda x: (x, n, phi), min(start, 0.5), high=0.6)


@effect("sublinear_viscous", "coefficient exponent", "w")
def _sublinear(c, rng):
    n = float(rng.uniform(0.35, 0.75))
    return Size(lambda x: (x, n), c.scaled(np.abs(c.w) ** n))


@effect("pose_dependent_inertia", "ratio harmonic phase", "theta w", only="rotary")
def _pose(c, rng):
    n, phi = float(rng.choice([1.0, 1.0, 2.0])), phase(rng)
    start = c.scaled(c.machine.J * c.acceleration * np.cos(n * c.theta + phi))
    return Size(lambda x: (x, n, phi), min(start, 0.6), high=0.8)


@effect("torque_bumps", "", "theta", text="narrow torque bumps at fixed positions")
def _bumps(c, rng):
    low, span = float(c.theta.min()), float(np.ptp(c.theta))
    count = int(rng.integers(2, 6))
    period = TURN if c.machine.rotary else 0.0
    width = (0.04 if c.machine.rotary else 0.012 * span) * float(rng.uniform(0.7, 2.0))
    centres = rng.uniform(-np.pi, np.pi, count) if period else low + span * rng.random(count)
    shapes = rng.uniform(0.5, 1.0, count) * rng.choice([-1.0, 1.0], count)
    tail = (width, period, float(count), *map(float, centres), *map(float, shapes))
    return Size(lambda x: (x, *tail), 2.0 * c.aim, power=1.0)


@effect("contact_pulses", "", "t", text="external contacts at random times", excitations=ALL)
def _pulses(c, rng):
    count, length = int(rng.integers(3, 10)), float(rng.uniform(0.08, 0.4))
    times = np.sort(rng.uniform(0.05, 0.95, count)) * c.t[-1]
    shapes = rng.uniform(0.5, 1.0, count) * rng.choice([-1.0, 1.0], count)
    tail = (length, float(count), *map(float, times), *map(float, shapes))
    share = np.sqrt(0.5 * length * count * 0.58 / c.t[-1])
    return Size(lambda x: (x, *tail), c.aim / share)


@effect("speed_hump", "", "w", text="drag that peaks at one speed, as churning or a resonance does")
def _hump(c, rng):
    speed = np.abs(c.w)
    moving = speed[speed > 0.1 * speed.max()]
    middle = float(np.quantile(moving, rng.uniform(0.35, 0.7)))
    width = middle * float(rng.uniform(0.15, 0.35))
    shape = np.exp(-(((speed - middle) / width) ** 2))
    return Size(lambda x: (x, middle, width), c.scaled(shape))


@effect("dragged_cable", "", "theta w", text="a cable that drags behind (Maxwell-slip sliders)")
def _cable(c, rng):
    presliding, travel = c.machine.Fs / c.machine.sigma0, float(np.ptp(c.theta))
    longest = max(30.0 * presliding, float(rng.uniform(0.03, 0.12)) * travel)
    return Size(lambda x: (x, longest), 1.2 * c.aim)


def _part_of_travel(c, rng, least, most):
    """The travel or one turn of it, and of a part of it the middle and half its width; period."""
    low, span = float(c.theta.min()), float(np.ptp(c.theta))
    period = TURN if c.machine.rotary and span > TURN else 0.0
    whole = period or span
    centre = low + float(rng.uniform(0.25, 0.75)) * whole
    return whole, centre, float(rng.uniform(least, most)) * whole, period


@effect("rough_patch", "", "theta w", text="a part of the travel where friction is higher")
def _patch(c, rng):
    whole, centre, half, period = _part_of_travel(c, rng, 0.06, 0.15)
    start = c.target * float(np.sqrt(0.5 * whole / half))
    return Size(lambda x: (x, centre, half, period), start, high=4.0)


@effect("fading_gain", "", "u t", text="a torque constant that fades as the magnets warm up")
def _fading(c, rng):
    tau = float(rng.uniform(0.2, 0.5)) * float(c.t[-1])
    start = c.scaled(c.u * (1.0 - np.exp(-c.t / tau)))
    return Size(lambda x: (x, tau), min(start, 0.5), high=0.6)


@effect("cubic_drag", "", "w", text="drag with the cube of speed")
def _cubic(c, rng):
    return Size(lambda x: (x,), c.scaled(c.w**3))


@effect("pumping_load", "", "t", text="a push once per stroke of a pump", excitations=ALL)
def _pumping(c, rng):
    f, part = float(rng.uniform(0.5, 2.5)), float(rng.uniform(0.1, 0.35))
    return Size(lambda x: (x, f, part), c.aim / np.sqrt(0.5 * part))

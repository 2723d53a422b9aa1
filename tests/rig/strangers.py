"""Effects outside the catalogue."""

from __future__ import annotations

import numpy as np

from .hiding import ALL, TURN, Size, effect, either, moment, phase


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


@effect("torque_droop", "", "u", text="torque constant that droops with torque")
def _droop(c, rng):
    high = 0.4 / float(np.max(np.abs(c.u)))
    return Size(lambda x: (x,), min(high, c.scaled(c.u**2)), high=high)


@effect("decaying_burst", "", "t", text="a ringing burst that dies out", excitations=ALL)
def _burst(c, rng):
    t0, tau = moment(c, rng), float(rng.uniform(0.5, 2.0))
    f = float(rng.uniform(2.0, 12.0))
    shape = np.exp(-np.maximum(0, c.t - t0) / tau) * (c.t > t0) / np.sqrt(2.0)
    return Size(lambda x: (x, t0, tau, f), c.scaled(shape))


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


@effect(
    "voltage_limit",
    "",
    "u w",
    text="a supply that leaves less torque at speed",
    excitations=("moves", "rich"),
)
def _voltage(c, rng):
    m, fastest = c.machine, float(np.max(np.abs(c.w)))
    share = float(rng.uniform(0.25, 0.5))  # of the torque at rest that the highest speed takes
    running = 1.05 * (m.Fc + m.Fv * fastest + m.load_peak) / (1.0 - share)
    floor = max(1.15 * (m.Fs + m.load_peak), running)
    pull = np.sign(c.w) * c.u
    levels = np.linspace(3.0, 0.3, 80) * float(np.abs(c.u).max())

    def cut(level):
        return np.maximum(0.0, pull - level * (1.0 - share * np.abs(c.w) / fastest))

    rms = [float(np.sqrt(np.mean(cut(level) ** 2))) for level in levels]
    start = max(floor, float(np.interp(c.aim, rms, levels)))
    return Size(lambda x: (x, x * share / fastest), start, floor, max(floor, levels[0]), -4.0)


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


@effect("wandering_friction", "", "t w", text="friction that wanders slowly up and down")
def _wandering(c, rng):
    sines = [v for _ in range(4) for v in (float(rng.uniform(0.05, 0.5)), phase(rng))]
    return Size(lambda x: (x, *sines), 1.4 * c.target, high=0.8)


@effect("cubic_drag", "", "w", text="drag with the cube of speed")
def _cubic(c, rng):
    return Size(lambda x: (x,), c.scaled(c.w**3))


@effect("pumping_load", "", "t", text="a push once per stroke of a pump", excitations=ALL)
def _pumping(c, rng):
    f, part = float(rng.uniform(0.5, 2.5)), float(rng.uniform(0.1, 0.35))
    return Size(lambda x: (x, f, part), c.aim / np.sqrt(0.5 * part))


@effect("hardening_spring", "", "theta", text="a spring that stiffens with its travel")
def _hardening(c, rng):
    low, span = float(c.theta.min()), float(np.ptp(c.theta))
    rest = low + float(rng.uniform(0.2, 0.8)) * span
    return Size(lambda x: (x, rest), c.scaled((c.theta - rest) ** 3))


@effect("one_way_patch", "", "theta w", text="a part of the travel that drags in one direction")
def _one_way(c, rng):
    whole, centre, half, period = _part_of_travel(c, rng, 0.1, 0.2)
    way = either(rng)
    start = c.target * float(np.sqrt(whole / half))
    return Size(lambda x: (x, centre, half, period, way), start, high=6.0)


@effect("torque_dropouts", "", "u t", text="a drive that loses part of its torque for moments")
def _dropouts(c, rng):
    count, length = int(rng.integers(8, 20)), float(rng.uniform(0.15, 0.5))
    times = np.sort(rng.uniform(0.05, 0.95, count)) * c.t[-1]
    lost = np.any((c.t[:, None] > times) & (c.t[:, None] < times + length), axis=1)
    start = min(0.8, c.scaled(c.u * lost))
    return Size(lambda x: (x, length, float(count), *map(float, times)), start, high=0.9)


@effect("sticky_torque", "", "u", text="a torque with play, as magnetic hysteresis or a valve has")
def _sticky(c, rng):
    return Size(lambda x: (x,), c.aim)


@effect("field_weakening", "", "u w", text="a torque constant that falls with speed")
def _weakening(c, rng):
    high = 0.6 / float(np.max(np.abs(c.w)))
    return Size(lambda x: (x,), min(high, c.scaled(c.u * np.abs(c.w))), high=high)


@effect("mesh_loss", "", "u w", text="friction of a gear that grows with the torque it carries")
def _mesh(c, rng):
    return Size(lambda x: (x,), min(0.4, c.scaled(c.u)), high=0.5)


@effect("governor", "", "w a", text="masses that swing outward with speed")
def _governor(c, rng):
    high = 3.0 / float(np.max(c.w**2))
    start = c.scaled(3.0 * c.machine.J * c.w**2 * c.acceleration)
    return Size(lambda x: (x,), min(high, start), high=high)

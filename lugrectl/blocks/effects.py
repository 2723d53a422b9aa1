"""Physical effects that may be missing from a declared model: one registered function each.

The output of a torque effect is ``d``, a torque on the resisting side, of a level effect the change
of the plant's parameters named in ``acts``: relative, or in N m after a plus, of an input effect
the torque that reaches the drive, of a sensor effect the measured signals. At the neutral value of
its gain an effect changes nothing. The order here is that of the catalogue.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from .block import P
from .declaration import block
from .friction import EPS, FC, FS, SIGMA1, SMOOTH, VS, J, bristle, bristle_torque, level

torque_effect = partial(block, "effect", out="d", acts="torque")
level_effect = partial(block, "effect", out="level")
input_effect = partial(block, "effect", out="u", acts="input")
sensor_effect = partial(block, "effect", out="w_m theta_m", acts="sensor")
PHASE: Any = P(0.0, "rad", -np.pi, np.pi, span=(0.0, np.pi / 2), angle=True)
AMPLITUDE: Any = P(0.0, "N m", 0.0, neutral=0.0)
HARMONIC: Any = P(2.0, "1/rev", 1e-3, 1e9, whole=True)
ONCE: Any = replace(HARMONIC, value=1.0)
SHARE: Any = P(0.0, "1", 0.0, 0.95, neutral=0.0)
RATIO: Any = P(0.0, "1", -0.95, 20.0, neutral=0.0)
START = P(0.0, "s")


@torque_effect(
    load=True,
    confused="coulomb_asymmetry gravity return_spring",
    experiment="record a hold at zero torque and the same slow move in both directions",
)
def constant_torque(t, torque=P(0.0, "N m", neutral=0.0)):
    """r_e = T0.

    In a log: the mean of the residual torque, the same in both directions and at rest: a
    suspended load, or an offset of the current sensor. Over a short travel gravity and a return
    spring look the same; an asymmetry of friction vanishes at rest.
    """
    return torque + 0.0 * t


@torque_effect(
    load=True,
    confused="constant_torque return_spring torque_ripple",
    experiment="record slow moves over at least one whole turn in both directions",
)
def gravity(theta, amplitude=AMPLITUDE, phase=PHASE):
    """r_e = A sin(theta + phi).

    In a log: one period per turn, the same in both directions and at every speed. Over less than
    a quarter turn a constant torque with a return spring looks the same.
    """
    return amplitude * np.sin(theta + phase)


@torque_effect(
    confused="periodic_disturbance position_dependent_friction torque_constant_ripple "
    "encoder_eccentricity",
    experiment="record slow moves over several periods, at two speeds and in both directions",
)
def torque_ripple(theta, amplitude=AMPLITUDE, harmonic=HARMONIC, phase=PHASE):
    """r_e = A sin(N theta + phi).

    N >= 2 on rotary drives (N = 1 is gravity); on linear drives N = 2 pi / period in rad/m. In a
    log: a spectral line at a fixed order of the position, the same in both directions and at
    every torque (cogging). At one constant speed a periodic disturbance looks the same; in one
    direction position-dependent friction; at one torque a ripple of the torque constant.
    """
    return amplitude * np.sin(harmonic * theta + phase)


@torque_effect(
    confused="gravity constant_torque",
    experiment="record slow moves over the whole travel, in both directions, at two frequencies",
)
def return_spring(
    theta, stiffness: Any = P(0.0, "N m/rad", 0.0, neutral=0.0), rest=P(0.0, "rad", span=(0.0, 1.0))
):
    """r_e = K (theta - theta0).

    In a log: a torque that is linear in the position, the same in both directions (a cable, a
    torsion spring). Over a short travel gravity looks the same; with a single sine as the motion,
    so does inertia.
    """
    return stiffness * (theta - rest)


@torque_effect(
    confused="return_spring gravity",
    experiment="move slowly into the end of the travel and back, twice",
)
def hard_stop(
    theta,
    position=P(0.0, "rad", passed=True),
    stiffness: Any = P(0.0, "N m/rad", 0.0, neutral=0.0),
    side: Any = P(1.0, "1", -1.0, 1.0, choices=(-1.0, 1.0)),
):
    """r_e = K (theta - thetas) beyond thetas, side (theta - thetas) > 0.

    side = +1 stops positive motion, -1 negative. The stop is elastic, without loss. In a log: a
    torque on one side of one position and none on the other. If the drive only just reaches the
    stop, a spring or gravity near the end of the travel looks the same.
    """
    return side * stiffness * np.maximum(side * (theta - position), 0.0)


@torque_effect(
    confused="torque_ripple",
    experiment="repeat the run at another speed and at standstill: a fixed frequency does not "
    "change",
)
def periodic_disturbance(
    t, amplitude=AMPLITUDE, frequency: Any = P(1.0, "Hz", 1e-9, 1e6), phase=PHASE
):
    """r_e = A sin(2 pi f t + phi).

    In a log: a spectral line at a fixed frequency at any speed (mains, a neighbouring machine).
    At one constant speed a ripple over position looks the same. phi is the phase at t = 0 of the
    log.
    """
    return amplitude * np.sin(2 * np.pi * frequency * t + phase)


@level_effect(
    acts="Fc Fs",
    confused="torque_ripple gravity coulomb_asymmetry load_dependent_friction",
    experiment="record the same slow path forwards and backwards: half the difference of the two "
    "torques is friction, half their sum is not",
)
def position_dependent_friction(theta, ratio=SHARE, harmonic=ONCE, phase=PHASE):
    """G = 1 + a sin(N theta + phi).

    N >= 1 on rotary drives; on linear drives N = 2 pi / period in rad/m. In a log: a spectral
    line at an order of the position that changes sign with the direction (a bent shaft, a tight
    spot in a guide). In one direction only, a torque ripple or gravity looks the same.
    """
    return ratio * np.sin(harmonic * theta + phase)


@level_effect(
    acts="Fc Fs",
    abrupt=True,
    confused="constant_torque viscous_asymmetry",
    experiment="record the same slow move in both directions, with holds at zero torque between",
)
def coulomb_asymmetry(w, ratio=P(0.0, "1", -0.95, 0.95, neutral=0.0)):
    """G = 1 + a sign(w).

    In a log: a torque that is constant while the drive moves and zero while it rests. If the
    drive hardly rests, a constant torque looks the same.
    """
    return ratio * np.sign(w)


@level_effect(
    acts="Fv",
    confused="quadratic_drag coulomb_asymmetry",
    experiment="record constant speeds, slow to fast, in both directions",
)
def viscous_asymmetry(w, ratio=P(0.0, "1", -1.0, 1.0, neutral=0.0)):
    """Fv (1 + a sign(w)).

    In a log: a residual that grows with speed and has the same sign in both directions. At a
    single speed an asymmetry of Coulomb friction looks the same.
    """
    return ratio * np.sign(w)


@level_effect(
    acts="Fc Fs Fv",
    confused="friction_step quadratic_drag",
    experiment="repeat the same run cold and warm, alternating two speeds, and log the temperature",
)
def thermal_drift(t, ratio=RATIO, time_constant=P(10.0, "s", 1e-9)):
    """G, Fv scaled by 1 + a (1 - exp(-t/tau)).

    t is the time of the log; the drive is cold until t = 0. In a log: all friction drifts
    towards a new level, a < 0 as grease warms up. A log much shorter than tau shows a straight
    drift, from which a and tau cannot be determined separately; a log that starts with a warm
    drive shows none.
    """
    return ratio * (1.0 - np.exp(-np.maximum(t, 0.0) / time_constant))


@level_effect(
    acts="+Fc +Fs",
    confused="position_dependent_friction torque_ripple gravity",
    experiment="repeat the run with another payload: load-dependent friction changes with it",
)
def load_dependent_friction(load, coefficient=P(0.0, "1", 0.0, 20.0, neutral=0.0)):
    """Fc + mu |load|, Fs + mu |load|.

    ``load`` is the sum of d and the torques of gravity and a constant torque, not the motor
    torque. In a log: friction is higher where the load is large, whatever its sign; with gravity
    twice per turn, as position-dependent friction of order N = 2. A constant load only shifts
    Fc: no log distinguishes the two.
    """
    return coefficient * np.abs(load)


@level_effect(
    acts="Fc Fs",
    confused="thermal_drift inertia_step",
    experiment="repeat the run, check whether the change recurs, and log the temperature",
)
def friction_step(t, ratio=RATIO, time=START):
    """G = 1 + a from t0.

    In a log: the residual torque times sign(w) jumps at one time. A drift that is faster than
    the moves in the log looks the same.
    """
    return ratio * np.where(t >= time, 1.0, 0.0)


SHARED_FC: Any = replace(FC, shared=True)
SHARED_FS: Any = replace(FS, shared=True)
SHARED_VS: Any = replace(VS, shared=True)
SHARED_EPS: Any = replace(EPS, shared=True)
RIGID = 1e12  # N m/rad; bristles of this stiffness and above count as rigid
LEAST = 1e-12  # N m
ONSET = 0.05  # the drive slides fully at a speed higher by this share than where sliding begins


@torque_effect(
    confused="viscous_asymmetry thermal_drift sublinear_viscous",
    experiment="record constant speeds up to the highest that the drive allows, then a coast-down",
)
def quadratic_drag(w, coefficient: Any = P(0.0, "N m s2/rad2", 0.0, neutral=0.0)):
    """r_e = c w |w|.

    In a log: a torque that is odd and convex over speed (air drag, churning oil). Over a narrow
    range of speeds more viscous and less Coulomb friction look the same.
    """
    return coefficient * w * np.abs(w)


@torque_effect(
    confused="thermal_drift stribeck quadratic_drag",
    experiment="record constant speeds, each twice as fast as the one before, at one temperature",
)
def sublinear_viscous(
    w,
    coefficient: Any = P(0.0, "N m (s/rad)^n", 0.0, neutral=0.0),
    exponent: Any = P(0.5, "1", 0.02, 0.98),
    eps=SMOOTH,
):
    """r_e = c |w|^n sign(w), 0 < n < 1.

    Computed as c w (w^2 + eps^2)^((n - 1)/2), eps = 1e-4 rad/s, which is smooth at rest. In a
    log: a torque that is odd and concave over speed (shear-thinning grease). With n near 0 it
    equals Coulomb, with n near 1 viscous friction; over one decade of speed the sum of both looks
    almost the same.
    """
    return coefficient * w * (w * w + eps * eps) ** (0.5 * (exponent - 1.0))


@level_effect(
    states="rest",
    acts="Fs",
    confused="stribeck thermal_drift",
    experiment="break away after rests of 0.01 s, 0.1 s, 1 s and 10 s and compare the peaks",
    source="Armstrong-Helouvry, Dupont and Canudas de Wit, Automatica 30(7), 1994, section 2",
)
def dwell_stiction(
    w,
    rest,
    ratio: Any = P(0.0, "1", 0.0, 20.0, neutral=0.0),
    time_constant=P(1.0, "s", 1e-9),
    release=P(3e-4, "s", 1e-9, fitted=False),
    vs=SHARED_VS,
):
    """Fs (1 + a (1 - exp(-t_rest/tau))).

    The drive counts as resting while |w| < vs/2, which includes slow presliding. The state
    ``rest`` = 1 - exp(-t_rest/tau) grows at rest by d rest/dt = (1 - rest)/tau and decays with
    the time constant ``release`` when sliding, above 1.05 vs/2; in between the two rates are
    blended. In a log: the longer the rest, the higher the peak at break-away
    (Armstrong-Helouvry, Dupont and Canudas de Wit, Automatica 30(7), 1994, section 2). If all
    rests are equally long, a higher Fs looks the same. Only for friction laws with an Fs.
    """
    part = np.minimum(np.maximum((np.abs(2.0 * w / vs) - 1.0) / ONSET, 0.0), 1.0)
    slips = part * part * (3.0 - 2.0 * part)
    rate = (1.0 - slips) * (1.0 - rest) / time_constant - slips * rest / release
    return ratio * rest, rate


@level_effect(
    acts="Fc",
    confused="sublinear_viscous presliding dwell_stiction",
    experiment="record many constant speeds, from the slowest steady one upwards",
)
def stribeck(w, Fs=P(0.0, "N m", 0.0, neutral=0.0), vs=VS, Fc=SHARED_FC):
    """G = 1 + max(Fs/Fc - 1, 0) exp(-(w/vs)^2).

    Turns Coulomb friction into the static Stribeck map; no change if Fs <= Fc. In a log: below
    some speed vs friction falls with speed, and slow motion sticks and slips. Only for friction
    laws without an Fs; the others contain it. If the drive passes vs within a few samples,
    presliding or a lower Fc looks the same.
    """
    excess = np.maximum(Fs / np.maximum(Fc, LEAST) - 1.0, 0.0)
    return level(w, 0.0, excess, vs)


@torque_effect(
    states="z",
    confused="stribeck backlash elastic_coupling coulomb_asymmetry",
    experiment="record small slow moves of several sizes that reverse before they break away",
)
def presliding(
    w,
    z,
    sigma0: Any = P(np.inf, "N m/rad", 0.0, neutral=np.inf),
    sigma1=SIGMA1,
    Fc=SHARED_FC,
    Fs=SHARED_FS,
    vs=SHARED_VS,
    eps=SHARED_EPS,
):
    """r_e = sigma0 z + sigma1 dz/dt - h(w) sign(w), dz/dt = w - sigma0 |w| z / h(w).

    The bristles of the LuGre law in place of the jump at w = 0: Coulomb or Stribeck friction
    with this effect is the LuGre law. At 1e12 N m/rad and above the bristles count as rigid. In
    a log: after every reversal the drive acts as a spring, with a stiffness that does not depend
    on position, until the friction level is reached. A gap or a soft coupling also delays the
    torque after a reversal. Only for static friction laws; LuGre contains the bristles.
    """
    soft = np.logical_and(sigma0 < RIGID, np.maximum(Fc, Fs) > LEAST)
    low, high = np.maximum(Fc, LEAST), np.maximum(Fs, LEAST)
    k = np.minimum(sigma0, RIGID)
    dz = bristle(w, z, k, low, high, vs)
    d = bristle_torque(w, z, dz, k, sigma1, 0.0) - level(w, low, high, vs) * np.tanh(w / eps)
    return np.where(soft, d, 0.0), np.where(soft, dz, 0.0)


def held_late(u: np.ndarray, dt: float, delay: float) -> np.ndarray:
    """u(t - T) of an input held over cells of length dt, averaged over each cell."""
    whole, part = divmod(max(delay, 0.0) / dt, 1.0)
    index = np.arange(len(u)) - int(whole)
    late, later = u[np.maximum(index, 0)], u[np.maximum(index - 1, 0)]
    return (1.0 - part) * late + part * later


def held_lagging(u: np.ndarray, dt: float, time_constant: float) -> np.ndarray:
    """A first-order lag of an input held over cells of length dt, averaged over each cell.

    Before the first sample the lag has settled at the first value.
    """
    if time_constant <= 0.0:
        return u
    from scipy.signal import lfilter  # slow to import

    left = np.exp(-dt / time_constant)
    ends, _ = lfilter([1.0 - left], [1.0, -left], u, zi=[left * u[0]])
    begins = np.append(u[:1], ends[:-1])
    return u + (begins - u) * (1.0 - left) * time_constant / dt


def _is_signal(state: Any, delay: Any) -> bool:
    """Whether the engine keeps the past of u: the state is then u(t - T), and its rate says u."""
    graph = getattr(state, "graph", None)
    if graph is None:
        return False
    graph.late[state.index] = delay
    return state.index in graph.exact


@input_effect(
    states="p1 p2",
    start="u 0",
    confused="actuator_lag velocity_sensor_lag elastic_coupling",
    experiment="record a torque chirp: the phase lag of a delay grows linearly with frequency",
    exact=held_late,
)
def input_delay(u, p1, p2, delay: Any = P(0.0, "s", 0.0, 0.2, neutral=0.0)):
    """u(t - T).

    In ``lg.simulate``, and along a log for a held input, the delay is exact; elsewhere
    (python-control) the block is the Pade approximation of order 2,
    1 - 12 s T/(s^2 T^2 + 6 s T + 12), exact to 1 degree of phase up to w T = 1.7. In a log:
    the motion follows the torque late, by the same time at all frequencies. An actuator lag with
    tau = T looks the same if the torque changes little within T. The torque of a log counts as
    held from each sample to the next: where it was read at instants, as from a current sensor, T
    comes out half a sample short.
    """
    if _is_signal(p1, delay):
        return p1, u, 0.0
    rate = np.where(delay > 0.0, 1.0 / np.maximum(delay, 1e-12), 0.0)
    return u - p2, rate * p2, rate * (12.0 * (u - p1) - 6.0 * p2)


def _lag(signal: Any, lagged: Any, time_constant: Any) -> tuple[Any, Any]:
    """A first-order lag and its rate; the signal itself without a time constant."""
    lags = time_constant > 0.0
    rate = np.where(lags, 1.0 / np.maximum(time_constant, 1e-12), 0.0)
    return np.where(lags, lagged, signal), rate * (signal - lagged)


@input_effect(
    states="lagged",
    start="u",
    confused="input_delay velocity_sensor_lag",
    experiment="record a torque chirp to well above 1/tau, and log the measured current",
    exact=held_lagging,
)
def actuator_lag(u, lagged, time_constant: Any = P(0.0, "s", 0.0, 10.0, neutral=0.0)):
    """tau du'/dt + u' = u.

    The current loop as a first-order lag; tau = 0 passes u unchanged. In a log: fast changes of
    the torque arrive late and smaller. Well below 1/tau it looks like a delay.
    """
    return _lag(u, lagged, time_constant)


@input_effect(
    confused="quadratic_drag sublinear_viscous",
    experiment="record the same move at increasing torques, up to the highest",
)
def actuator_saturation(u, limit: Any = P(np.inf, "N m", 0.0, neutral=np.inf)):
    """u' = clip(u, -limit, limit).

    In a log: the residual is zero until the commanded torque exceeds the limit, and equals the
    excess above it. If a log exceeds the limit only at high speed, drag looks the same.
    """
    return np.clip(u, -limit, limit)


@input_effect(
    confused="coulomb_asymmetry backlash stribeck",
    experiment="speed up and brake at torques just above friction: the loss follows the sign of "
    "the torque, not of the speed",
)
def actuator_dead_zone(u, half_width: Any = P(0.0, "N m", 0.0, neutral=0.0)):
    """u' = u - clip(u, -half_width, half_width).

    The torque is reduced by half_width towards 0. In a log: a constant loss that opposes the
    torque. While torque and speed have the same sign, higher Coulomb friction looks the same;
    only braking distinguishes them.
    """
    return u - np.clip(u, -half_width, half_width)


@input_effect(
    confused="torque_ripple position_dependent_friction",
    experiment="repeat the same slow path under two loads: this ripple grows with the torque",
)
def torque_constant_ripple(u, theta, ratio=SHARE, harmonic=HARMONIC, phase=PHASE):
    """u' = u (1 + a sin(N theta + phi)).

    N >= 1 on rotary drives; on linear drives N = 2 pi / period in rad/m. In a log: a spectral
    line at an order of the position, proportional to the torque. If the torque is mostly Coulomb
    friction, it changes sign with the direction, as position-dependent friction does; under a
    large constant load it looks like a torque ripple.
    """
    return u * (1.0 + ratio * np.sin(harmonic * theta + phase))


SHARED_J: Any = replace(J, shared=True)
LOAD: Any = P(0.0, "kg m2", 0.0, neutral=0.0)
STIFFNESS: Any = P(10.0, "N m/rad", 0.0)
DAMPING: Any = P(0.01, "N m s/rad", 0.0)


@level_effect(
    acts="J",
    confused="friction_step pose_dependent_inertia",
    experiment="accelerate and brake along the same path before and after the change",
)
def inertia_step(t, ratio=RATIO, time=START):
    """J (1 + a) from t0.

    A payload picked up or put down at the speed of the drive. In a log: from one time on the
    residual torque is proportional to the acceleration. If all moves are alike, a step of
    friction looks the same.
    """
    return ratio * np.where(t >= time, 1.0, 0.0)


@block(
    "effect",
    out="level d",
    acts="J torque",
    confused="inertia_step gravity encoder_eccentricity torque_ripple",
    experiment="run through the same positions at two accelerations and at a constant high speed",
)
def pose_dependent_inertia(
    theta, w, ratio=P(0.0, "1", 0.0, 0.9, neutral=0.0), harmonic=ONCE, phase=PHASE, J=SHARED_J
):
    """J(theta) = J (1 + a cos(N theta + phi)), r_e = (1/2) dJ/dtheta w^2.

    The torque r_e belongs to the change of J: together they conserve the kinetic energy. N = 1 is
    an arm with an elbow, N = 2 a crank; on linear drives N = 2 pi / period in rad/m. In a log:
    the residual is proportional to the acceleration, by a factor that depends on position, and
    at constant speed to w^2, as for an eccentric encoder. At one acceleration gravity or a
    ripple looks the same. A model may contain only one such effect.
    """
    angle = harmonic * theta + phase
    return ratio * np.cos(angle), -0.5 * J * ratio * harmonic * np.sin(angle) * w * w


def _load_side(
    motion: tuple[Any, Any, Any], load_inertia: Any, gap: Any, k: Any, c: Any, slowed: Any = 0.0
):
    """Torque on the motor and the rates of twist and load speed; all 0 without a load.

    ``motion`` holds w, twist and w_load, ``slowed`` is the torque of the load's own friction.
    """
    w, twist, w_load = motion
    there = load_inertia > 0.0
    touching = np.abs(twist) >= 0.5 * gap
    stretch = np.maximum(twist - 0.5 * gap, 0.0) + np.minimum(twist + 0.5 * gap, 0.0)
    torque = k * stretch + np.where(touching, c * (w - w_load), 0.0)
    torque = np.where(there, torque, 0.0)
    return (
        torque,
        np.where(there, w - w_load, 0.0),
        np.where(there, torque - slowed, 0.0) / np.where(there, load_inertia, 1.0),
    )


def load_motion(theta: Any, w: Any, twist: Any, w_load: Any, load_inertia: Any) -> tuple[Any, Any]:
    there = load_inertia > 0.0
    return np.where(there, theta - twist, theta), np.where(there, w_load, w)


@torque_effect(
    states="twist w_load",
    start="0 w",
    confused="input_delay velocity_sensor_lag backlash presliding",
    experiment="record a torque chirp through the resonance, with an encoder on the load if any",
)
def elastic_coupling(w, twist, w_load, load_inertia=LOAD, stiffness=STIFFNESS, damping=DAMPING):
    """r_e = K twist + D (w - w_load), Jl dw_load/dt = r_e, dtwist/dt = w - w_load.

    A load inertia Jl in addition to J, behind a spring and a damper; friction acts on the motor.
    The states are 0 and w if both turn together. In a log: the motor hardly moves at
    sqrt(K/Jl) (anti-resonance) and moves most at sqrt(K (1/J + 1/Jl)) (resonance). Well below
    that a larger J looks the same; near it a sensor lag or a delay has a similar phase.
    """
    return _load_side((w, twist, w_load), load_inertia, 0.0, stiffness, damping)


@torque_effect(
    states="twist w_load",
    start="0 w",
    confused="elastic_coupling presliding actuator_dead_zone",
    experiment="reverse slowly and fast at several amplitudes: the gap is a fixed angle",
)
def backlash(
    w,
    twist,
    w_load,
    load_inertia=LOAD,
    gap=P(0.01, "rad", 0.0),
    stiffness=STIFFNESS,
    damping=DAMPING,
    load_friction: Any = P(0.0, "N m", 0.0, usual=True),
    eps=EPS,
):
    """r_e = K s + D (w - w_load), s = twist beyond +-gap/2, Jl dw_load/dt = r_e.

    dtwist/dt = w - w_load; no torque while |twist| < gap/2; gap is the total width. twist = 0
    is the middle of the gap. With dry friction Fl of the load's own,
    Jl dw_load/dt = r_e - Fl sign(w_load): the load stays where the drive left it, where without
    friction it flies on through the gap. In a log: after each reversal the drive moves with J alone
    over a fixed angle, then hits the load. With a gap of 0 it is an elastic coupling; at one small
    amplitude presliding may look the same.
    """
    slowed = load_friction * np.tanh(w_load / eps)
    return _load_side((w, twist, w_load), load_inertia, gap, stiffness, damping, slowed)


@sensor_effect(
    states="lagged",
    start="w",
    confused="input_delay actuator_lag elastic_coupling",
    experiment="also record the raw position and differentiate it: the lag is between the two",
)
def velocity_sensor_lag(w, theta, lagged, time_constant: Any = P(0.0, "s", 0.0, 10.0, neutral=0.0)):
    """tau dw_m/dt + w_m = w.

    The filter of a tachometer or of a differentiated encoder; theta_m = theta. In a log: friction
    over w has loops whose direction changes with the sign of the acceleration, and w differs
    from dtheta/dt if theta was recorded. Without theta a delay of the torque looks the same.
    """
    measured, rate = _lag(w, lagged, time_constant)
    return measured, theta, rate


@sensor_effect(
    confused="torque_ripple pose_dependent_inertia gravity",
    experiment="record two constant speeds: the ripple of w grows with the speed, that of a "
    "torque does not",
)
def encoder_eccentricity(w, theta, amplitude=P(0.0, "rad", 0.0, 0.9, neutral=0.0), phase=PHASE):
    """theta_m = theta + A sin(theta + phi), w_m = w (1 + A cos(theta + phi)).

    w_m is the derivative of theta_m; with A < 1 it has the sign of w. In a log: one period per
    turn, as large as a torque J A w^2, so that slow turns do not show it. At one speed gravity
    looks the same. A is an angle of the drive's turn; it has no meaning on a linear drive.
    """
    angle = theta + phase
    return w * (1.0 + amplitude * np.cos(angle)), theta + amplitude * np.sin(angle)

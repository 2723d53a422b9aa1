"""What the compiled drive is checked by: the equations of the catalogue, integrated with events.

Written from the list of effects alone, for one effect or several, and slow. Between the instants
at which a torque, a sign or a contact changes the equations are smooth: each such instant is
located, and the integration begins anew there.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from math import exp, inf, pi, sin

import numpy as np
from scipy.integrate import solve_ivp

from .machines import GRAVITY_LOAD, NO_LOAD, Machine

TH, W, Z, THL, WL, UA, WM = range(7)  # the state; UA behind the actuator's lag, WM as measured
PASSED = 1e-12  # beyond a kink by so much it is behind
SIZES = np.array([1.0, 1.0, 1e-3, 1.0, 1.0, 1.0, 1.0])


@dataclass
class Drive:
    """A machine with effects ``{name: {parameter: value}}``, and its side of each kink."""

    machine: Machine
    effects: dict[str, dict[str, float]]
    side: float = 1.0  # of w
    stuck: bool = False  # static friction holds it
    beyond: bool = False  # the hard stop
    contact: float = 0.0  # of the gap: -1, 0, 1
    resting: float | None = 0.0  # since when it rests
    held: float = 0.0  # torque as commanded
    ends: dict = field(default_factory=dict)

    def of(self, effect: str, name: str, neutral: float = 0.0) -> float:
        return self.effects.get(effect, {}).get(name, neutral)

    def load(self, theta: float) -> float:
        """The declared load."""
        kind, size, phase = self.machine.load
        return (
            0.0 if kind == NO_LOAD else size * (sin(theta + phase) if kind == GRAVITY_LOAD else 1)
        )

    def wave(self, effect: str, theta: float, size: str = "amplitude") -> float:
        p = self.effects.get(effect, {})
        return p[size] * sin(p.get("harmonic", 1) * theta + p["phase"]) if p else 0.0

    def heat(self, t: float) -> float:
        tau = self.of("thermal_drift", "time_constant", 1.0)
        return 1 + self.of("thermal_drift", "ratio") * (1 - exp(-t / tau))

    def level(self, t: float, x) -> float:
        """The friction torque at which it slides, viscous part apart."""
        m = self.machine
        G = self.heat(t) * (1 + self.wave("position_dependent_friction", x[TH], "ratio"))
        G *= 1 + self.of("coulomb_asymmetry", "ratio") * self.side
        if t >= self.of("friction_step", "time", inf):
            G *= 1 + self.of("friction_step", "ratio")
        rest = 0.0 if self.resting is None else t - self.resting
        tau = self.of("dwell_stiction", "time_constant", 1.0)
        Fs = m.Fs * (1 + self.of("dwell_stiction", "ratio") * (1 - exp(-rest / tau)))
        dip = exp(-((abs(x[W]) / m.vs) ** m.delta))
        on_load = self.of("load_dependent_friction", "coefficient") * abs(self.load(x[TH]))
        return G * (m.Fc + (Fs - m.Fc) * dip) + on_load

    def viscous(self, t: float, w: float) -> float:
        m, n = self.machine, self.of("sublinear_viscous", "exponent", 1.0)
        Fv = m.Fv * self.heat(t) * (1 + self.of("viscous_asymmetry", "ratio") * self.side)
        more = self.of("sublinear_viscous", "coefficient") * abs(w) ** n
        return self.side * (Fv * abs(w) ** m.power + more)

    def resisting(self, t: float, x) -> float:
        """r_e of the effects that are torques over place, speed and time."""
        r = self.of("constant_torque", "torque")
        r += self.wave("gravity", x[TH]) + self.wave("torque_ripple", x[TH])
        r += self.of("quadratic_drag", "coefficient") * x[W] * abs(x[W])
        r += self.of("return_spring", "stiffness") * (x[TH] - self.of("return_spring", "rest"))
        if self.beyond:
            r += self.of("hard_stop", "stiffness") * (x[TH] - self.of("hard_stop", "position"))
        angle = 2 * pi * self.of("periodic_disturbance", "frequency") * t
        return r + self.wave("periodic_disturbance", angle)

    def shaft(self, x) -> float:
        """Torque of the motor on a load behind a spring, or behind a gap."""
        p = self.effects.get("elastic_coupling") or self.effects.get("backlash")
        if not p or ("gap" in p and not self.contact):
            return 0.0
        twist = x[TH] - x[THL] - 0.5 * p.get("gap", 0.0) * self.contact
        return p["stiffness"] * twist + p["damping"] * (x[W] - x[WL])

    def wanted(self) -> float:
        """The commanded torque behind dead zone and limit."""
        width = self.of("actuator_dead_zone", "half_width")
        u = np.sign(self.held) * max(abs(self.held) - width, 0.0)
        limit = self.of("actuator_saturation", "limit", inf)
        return min(max(u, -limit), limit)

    def drive(self, x) -> float:
        u = x[UA] if "actuator_lag" in self.effects else self.wanted()
        return u * (1 + self.wave("torque_constant_ripple", x[TH], "ratio"))

    def free(self, t: float, x) -> float:
        """All torque on the motor but the dry friction."""
        against = self.load(x[TH]) + self.resisting(t, x) + self.shaft(x) + self.viscous(t, x[W])
        pose = self.effects.get("pose_dependent_inertia")
        if pose:  # (1/2) J' w^2 of J (1 + a cos(N theta + phi))
            angle = pose["harmonic"] * x[TH] + pose["phase"]
            slope = -pose["ratio"] * pose["harmonic"] * sin(angle)
            against += 0.5 * self.machine.J * slope * x[W] ** 2
        return self.drive(x) - against

    def inertia(self, t: float, theta: float) -> float:
        pose = self.effects.get("pose_dependent_inertia")
        swing = pose["ratio"] * np.cos(pose["harmonic"] * theta + pose["phase"]) if pose else 0.0
        step = self.of("inertia_step", "ratio") * (t >= self.of("inertia_step", "time", inf))
        return self.machine.J * (1 + swing) * (1 + step)

    def slip(self, z: float, level: float) -> float:
        """The share of the motion that a bristle does not follow, over that of LuGre's."""
        top, m = level / self.machine.sigma0, self.machine
        if m.law != "elastoplastic":
            return 1.0
        if z * self.side < 0 or abs(z) <= 0.6 * top:
            return 0.0
        return 1.0 if abs(z) >= top else 0.5 + 0.5 * sin(pi * (abs(z) - 0.8 * top) / (0.4 * top))

    def rates(self, t: float, x):
        m, level, dz = self.machine, self.level(t, x), 0.0
        if m.law == "static":
            F = self.side * level
        else:
            dz = x[W] - m.sigma0 * abs(x[W]) * x[Z] / level * self.slip(x[Z], level)
            F = m.sigma0 * x[Z] + m.sigma1 * dz
        dw = 0.0 if self.stuck else (self.free(t, x) - F) / self.inertia(t, x[TH])
        inert = self.of("elastic_coupling", "load_inertia") or self.of("backlash", "load_inertia")
        dwl = self.shaft(x) / inert if inert else dw
        du = (self.wanted() - x[UA]) / self.of("actuator_lag", "time_constant", inf)
        dm = (x[W] - x[WM]) / self.of("velocity_sensor_lag", "time_constant", inf)
        return [x[W], dw, dz, x[WL], dwl, du, dm]

    def kinks(self):
        """(function of t and x that falls through 0 at a kink, what is different beyond it)."""
        made = [(lambda t, x: self.side * x[W], self._turned)]
        if self.machine.law == "static" and self.stuck:
            made = [(lambda t, x: self.level(t, x) - abs(self.free(t, x)), self._released)]
        if "hard_stop" in self.effects:
            s = self.of("hard_stop", "side") * (-1 if self.beyond else 1)
            made.append((lambda t, x: s * (self.of("hard_stop", "position") - x[TH]), self._stop))
        if "backlash" in self.effects:
            half = 0.5 * self.of("backlash", "gap")
            if self.contact:
                open_ = self.contact
                made.append((lambda t, x: open_ * (x[TH] - x[THL]) - half, self._parted))
            else:
                made.append((lambda t, x: half - abs(x[TH] - x[THL]), self._touched))
        if "dwell_stiction" in self.effects:  # presliding counts as rest
            sign = 1 if self.resting is not None else -1
            made.append((lambda t, x: sign * (0.5 * self.machine.vs - abs(x[W])), self._rested))
        return made

    def _turned(self, t, x):
        x[W] = 0.0
        self.stuck = self.machine.law == "static" and abs(self.free(t, x)) <= self.level(t, x)
        self.side = -self.side

    def _released(self, t, x):
        self.stuck, self.side = False, float(np.sign(self.free(t, x)))

    def _stop(self, t, x):
        self.beyond = not self.beyond

    def _parted(self, t, x):
        self.contact = 0.0

    def _touched(self, t, x):
        self.contact = float(np.sign(x[TH] - x[THL]))

    def _rested(self, t, x):
        self.resting = None if self.resting is not None else t


def simulate(machine: Machine, effects: dict, torque, rate: float, theta0: float = 0.0):
    """theta, w, and both as measured, (4, N) at the samples of a torque that is held between."""
    drive, end, n = Drive(machine, effects), len(torque) / rate, np.arange(len(torque))
    late = drive.of("input_delay", "delay")
    steps = (drive.of("inertia_step", "time", inf), drive.of("friction_step", "time", inf))
    instants = np.unique(np.round([*(n / rate), *(n / rate + late), *steps, end], 12))
    instants = instants[instants <= end]
    x, rows = np.zeros(len(SIZES)), []
    x[[TH, THL]] = theta0
    drive.stuck = machine.law == "static"
    for start, stop in zip(instants[:-1], instants[1:], strict=True):
        if abs(start * rate - round(start * rate)) < 1e-9:
            rows.append(x.copy())
        at = int(np.floor((0.5 * (start + stop) - late) * rate))
        drive.held = float(torque[at]) if at >= 0 else 0.0
        x = _smooth(drive, start, stop, x)
    theta, w, measured = np.array(rows).T[[TH, W, WM]]
    p = effects.get("encoder_eccentricity", {"amplitude": 0.0, "phase": 0.0})
    w_m = measured if "velocity_sensor_lag" in effects else w
    slope = 1 + p["amplitude"] * np.cos(theta + p["phase"])
    return np.array([theta, w, theta + p["amplitude"] * np.sin(theta + p["phase"]), w_m * slope])


def _smooth(drive: Drive, t: float, stop: float, x):
    """The state at ``stop``, from kink to kink."""
    if drive.stuck and abs(drive.free(t, x)) > drive.level(t, x):
        drive._released(t, x)
    while t < stop:
        kinks, events = drive.kinks(), []
        for fall, _ in kinks:
            event = lambda time, state, fall=fall: fall(time, state) + PASSED  # noqa: E731
            event.terminal, event.direction = True, -1
            events.append(event)
        how = {"method": "LSODA", "rtol": 1e-8, "atol": 1e-10 * SIZES, "events": events}
        made = solve_ivp(drive.rates, (t, stop), x, **how)
        t, x = made.t[-1], made.y[:, -1].copy()
        for (_, change), times in zip(kinks, made.t_events, strict=True):
            if len(times):
                change(t, x)
    return x

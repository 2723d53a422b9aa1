"""Gains of the other observers by their rules, each with what they guarantee.

A rule is a function of the drive's values and the choices; it returns the gains by name and a
certificate. The derivations stand in the docstrings of the observers.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from ..blocks.friction import level, relaxation
from ..linear import position_T, spr_check
from .certificate import Certificate
from .quadratic import common_rate

SPEED = 1.0  # rad/s, up to which a certificate that has a limit holds, unless given
SAMPLED = 0.5  # largest rate times sample time
SHARE = 0.9  # of a double pole, which no quadratic function reaches
RIGHT = "the observer's parameters are those of the drive, and no load torque acts"
FORWARD = "the loop has the feed-forward J dr (velocity) or J ddr (position)"
RELAXES = "z - zhat decays only while the drive moves (Excitation.rate)"
COULOMB = "the drive has F = a sign(w) + Fv w, J and Fv are right, and no load torque acts"


class Rule(NamedTuple):
    """``needs``: values of the drive; ``choices``: names and defaults, None for one by rule."""

    build: Callable[[Mapping[str, float], dict[str, Any]], tuple[dict[str, float], Certificate]]
    needs: str
    choices: Mapping[str, float | None]


@dataclass(frozen=True)
class _Made:
    """What a certificate needs, with the usual fields left out."""

    rule: str
    valid: str
    conditions: tuple[str, ...]
    pole: float
    rate: float | None = None
    holds: bool = True
    more: Mapping[str, Any] = field(default_factory=dict)

    def certificate(self) -> Certificate:
        return Certificate(
            holds=self.holds,
            lemma=self.rule,
            conditions=self.conditions,
            pole_at_rest=self.pole,
            rate=self.rate,
            valid=self.valid,
        )


def _limited(rate: float, c: Mapping[str, Any], most: float = SAMPLED) -> float:
    """A rate that a drive with the sample time dt can follow: ``most`` times 1/dt."""
    return rate if c["dt"] is None else min(rate, most / c["dt"])


def _slides(m: Mapping[str, float], w: float) -> float:
    """a = sigma0 |w|/h(w) in 1/s."""
    return float(relaxation(w, m["sigma0"], level(w, m["Fc"], m["Fs"], m["vs"])))


def _natural(m: Mapping[str, float], c: dict[str, Any]) -> Any:
    said = (RELAXES, RIGHT)
    return {}, _Made("natural", "for every motion", said, 0.0).certificate()


def _corrected(m: Mapping[str, float], c: dict[str, Any]) -> float:
    """k for which the error loop at rest, J e'' + (kp + sigma1 k) e' + (ki + sigma0 k) e, has
    the stiffness J rate^2."""
    rate = c["rate"] or (0.5 * m["sigma0"] / m["sigma1"])
    return m["J"] * rate**2 / m["sigma0"] if c["k"] is None else c["k"]


def _existing(m: Mapping[str, float], c: dict[str, Any]) -> Any:
    k = _corrected(m, c)
    most = 4.0 / m["sigma1"] * (1.0 + c["kp"] / (k * m["sigma1"])) if k else math.inf
    fast = most * min(m["Fc"], m["Fs"])
    said = (
        f"|w|/h(w) <= {most:.4g} rad/(N m s); this limits the proof, not the loop",
        FORWARD,
        "e tends to 0; " + RELAXES,
        RIGHT,
    )
    return {"k": k}, _Made("existing", f"for |w| <= {fast:.3g} rad/s", said, 0.0).certificate()


def _lyapunov(m: Mapping[str, float], c: dict[str, Any]) -> Any:
    said = (FORWARD, "s tends to 0; " + RELAXES, RIGHT)
    made = _Made("lyapunov", "for every motion", said, 0.0)
    return {"k": _corrected(m, c)}, made.certificate()


def _normal_force(m: Mapping[str, float], c: dict[str, Any]) -> Any:
    kd = 1.25 * m["sigma0"] * m["J"] / m["sigma1"] if c["kd"] is None else c["kd"]
    kp = kd**2 / (4.0 * m["J"]) if c["kp"] is None else c["kp"]
    verdict = spr_check(position_T(_Values(m), kp=kp, ki=0.0, kd=kd))
    classed = verdict.classification
    said = (
        f"a position loop with PD kp = {kp:.4g}, kd = {kd:.4g} on e and the feed-forward J ddr; "
        f"(sigma1 s + sigma0)/(J s^2 + kd s + kp) is {classed}",
        "sigma0, sigma1, Fc, Fs are all wrong by one factor; J and Fv are right, no load acts",
        "e tends to 0 for every such factor; the proof gives no rate",
    )
    made = _Made("normal_force", "for every motion", said, 0.0, holds=bool(verdict))
    gamma = 670.0 / m["Fs"] if c["gamma"] is None else c["gamma"]
    return {"k": c["k"], "gamma": gamma}, made.certificate()


class _Values:
    def __init__(self, m: Mapping[str, float]) -> None:
        self.__dict__.update(m)


def _temperature(m: Mapping[str, float], c: dict[str, Any]) -> Any:
    k, gamma = c["k"], c["gamma"]
    a = _slides(m, c["M"])
    low = min(m["Fc"], m["Fs"]) / m["Fs"]
    root = np.roots([1.0, a + k, gamma * (a * low) ** 2]).real.max()
    said = (
        "Fc and Fs are wrong by one factor; J, sigma0, sigma1, Fv are right, and no load acts",
        "no rate by itself: at rest the factor keeps its value",
        f"sliding at {c['M']:g} rad/s, linearised: the errors decay with {-root:.4g} 1/s; zbar "
        f"is right within {m['sigma1'] / m['sigma0']:.3g} s",
    )
    made = _Made("temperature", "for every motion", said, 0.0 - k)
    return {"k": k, "gamma": gamma}, made.certificate()


def _friction_state(m: Mapping[str, float], c: dict[str, Any]) -> Any:
    usual = _limited(1.5 * math.sqrt(m["sigma0"] / m["J"]), c)
    p, most = c["bandwidth"] or usual, c["M"]
    top = _slides(m, most)
    corners = [np.array([[-2.0 * p, -p], [p, -a]]) for a in (0.0, top)]
    found = common_rate(corners)
    said = (
        "Fc, Fs, Fv, vs, sigma0, J are right, and no load torque acts; sigma1 dz/dt counts as an "
        "error for about sigma1/sigma0",
        f"noise of w reaches Fhat with up to {0.5 * m['J'] * p:.3g} N m s/rad",
    )
    rate = None if found is None else found[0]
    made = _Made(
        "friction_state", f"for |w| <= {most:g} rad/s", said, -p, rate, holds=rate is not None
    )
    return {"bandwidth": p}, made.certificate()


def _position_lugre(m: Mapping[str, float], c: dict[str, Any]) -> Any:
    p = c["pole"] or _limited(3.0 * math.sqrt(m["sigma0"] / m["J"]), c, 1.0)
    gains, corners = position_corners(m, p, c["M"])
    found, slowest = common_rate(corners), max(_slowest(A) for A in corners)
    said = ["|z| <= max(Fc, Fs)/sigma0", RIGHT]
    if found:
        made = _Made("position_lugre", f"for |w| <= {c['M']:g} rad/s", tuple(said), -p, found[0])
        return gains, made.certificate()
    said += [
        "no common quadratic function was found: the triple pole holds at rest only",
        f"sliding at a constant speed, the slowest pole can be {slowest:+.4g} 1/s"
        + ("" if slowest < 0.0 else ": choose a faster pole"),
    ]
    made = _Made("position_lugre", "linearised at rest only", tuple(said), -p, holds=slowest < 0.0)
    return gains, made.certificate()


def position_corners(
    m: Mapping[str, float], p: float, most: float
) -> tuple[dict[str, float], list[np.ndarray]]:
    """l1, l2, l3 with a triple pole at -p at rest, and the error matrices at the corners.

    At rest the errors have the polynomial s^3 + (b + l1) s^2 + (g + l1 b + l2) s + g (l1 - l3),
    b = (sigma1 + Fv)/J, g = sigma0/J. The matrices are affine in a = sigma0 |w|/h(w) and in the
    slope b of dz/dt over w, which stays within 1 +- max(Fc, Fs) max d(|w|/h)/dw. States are
    scaled by p.
    """
    b, g = (m["sigma1"] + m["Fv"]) / m["J"], m["sigma0"] / m["J"]
    l1 = 3.0 * p - b
    l2, l3 = 3.0 * p**2 - g - l1 * b, l1 - p**3 / g
    w = np.linspace(0.0, max(most, 10.0 * m["vs"]), 4001)
    slope = np.abs(np.gradient(w / level(w, m["Fc"], m["Fs"], m["vs"]), w))
    wide = float(slope.max()) * max(m["Fc"], m["Fs"])
    top = relaxation(most, m["sigma0"], min(m["Fc"], m["Fs"]))
    S = np.diag([1.0, 1.0 / p, g / p**2])
    corners = []
    for a in (0.0, top):
        for s in (1.0 - wide, 1.0 + wide):
            speed = [-l2, -(m["sigma1"] * s + m["Fv"]) / m["J"], -(g - m["sigma1"] * a / m["J"])]
            corners.append(S @ np.array([[-l1, 1.0, 0.0], speed, [-l3, s, -a]]) @ np.linalg.inv(S))
    return {"l1": l1, "l2": l2, "l3": l3}, corners


def _slowest(A: np.ndarray) -> float:
    return float(np.linalg.eigvals(A).real.max())


def _position_coulomb(m: Mapping[str, float], c: dict[str, Any]) -> Any:
    r = c["rate"] or _limited(200.0, c) / 4.0
    L = c["L"] or 8.0 * r
    k = m["J"] * r
    slow = _slowest(np.array([[0.0, 1.0], [-k * L / m["J"], -(L + m["Fv"] / m["J"])]]))
    said = (
        COULOMB,
        "a - ahat never grows, through reversals and at rest; no rate by itself",
        f"sliding in one direction: the slowest pole is {slow:.4g} 1/s",
    )
    made = _Made("position_coulomb", "for every motion", said, 0.0)
    return {"k": k, "L": L}, made.certificate()


def _disturbance(m: Mapping[str, float], c: dict[str, Any]) -> Any:
    tau = c["tau"] or 1.0 / _limited(100.0 if c["dt"] is None else math.inf, c)
    said = (
        "J is right; the sum D of all resisting torques is constant, else the error is at most "
        "tau sup|dD/dt|",
        f"noise of w reaches Fhat with {m['J'] / tau:.3g} N m s/rad",
    )
    made = _Made("disturbance", "for every motion", said, -1.0 / tau, 1.0 / tau)
    return {"tau": tau}, made.certificate()


def _extended(m: Mapping[str, float], c: dict[str, Any]) -> Any:
    p = c["bandwidth"] or _limited(100.0 if c["dt"] is None else math.inf, c)
    said = (
        "J is right; the sum D of all resisting torques is constant, else the error is at most "
        "(2/p) sup|dD/dt|, p = bandwidth",
        f"the errors decay as (1 + p t) exp(-p t), which is faster than {SHARE:g} p in the end",
        f"noise of w reaches Fhat with up to {0.5 * m['J'] * p:.3g} N m s/rad",
    )
    made = _Made("extended_state", "for every motion", said, -p, SHARE * p)
    return {"bandwidth": p}, made.certificate()


def _general_coulomb(m: Mapping[str, float], c: dict[str, Any]) -> Any:
    r, w0 = c["rate"] or _limited(50.0, c), c["w0"]
    said = (
        COULOMB,
        "a - ahat never grows; at rest it keeps its value",
        f"while |w| >= v it decays with at least {r:.4g} v/sqrt(v^2 + {w0:g}^2) 1/s",
    )
    made = _Made("general_coulomb", "for every motion", said, 0.0)
    return {"k": m["J"] * r, "w0": w0}, made.certificate()


def _friedland_park(m: Mapping[str, float], c: dict[str, Any]) -> Any:
    r, mu, v = c["rate"] or _limited(50.0, c), c["mu"], c["speed"]
    said = (
        COULOMB,
        "a - ahat never grows",
        f"at |w| = {v:g} rad/s it decays with {r:.4g} 1/s, at other speeds with "
        f"{r:.4g} (|w|/{v:g})^{mu - 1:.3g}",
    )
    made = _Made("friedland_park", "for every motion", said, 0.0)
    return {"k": m["J"] * r / (mu * v ** (mu - 1.0)), "mu": mu}, made.certificate()


def _adaptive(m: Mapping[str, float], c: dict[str, Any]) -> Any:
    gamma = c["gamma"]
    K2 = c["K2"] or m["J"] * max(_limited(40.0 * gamma, c), 4.0 * gamma)
    said = (
        "sigma0, sigma1, Fc, Fs are all wrong by one factor; J and Fv are right, no load acts",
        f"w - what tends to 0, and the factor settles at about {gamma:g} 1/s while the drive "
        "slides; no rate by itself",
        "at rest the factor follows the torque that balances u",
    )
    made = _Made("adaptive", "for every motion", said, 0.0)
    return {"K2": K2, "gamma": gamma}, made.certificate()


LUGRE = "J sigma0 sigma1 Fc Fs Fv vs"
RULES: dict[str, Rule] = {
    "natural_observer": Rule(_natural, "sigma0 Fc Fs vs", {}),
    "existing_observer": Rule(_existing, LUGRE, {"rate": None, "k": None, "kp": 0.0}),
    "lyapunov_observer": Rule(_lyapunov, LUGRE, {"rate": None, "k": None}),
    "temperature_observer": Rule(_temperature, LUGRE, {"k": 0.0, "gamma": 5.0, "M": SPEED}),
    "friction_state_observer": Rule(
        _friction_state, "J sigma0 Fc Fs Fv vs", {"bandwidth": None, "M": SPEED, "dt": None}
    ),
    "normal_force_observer": Rule(
        _normal_force, LUGRE, {"k": 1.0, "gamma": None, "kp": None, "kd": None}
    ),
    "position_lugre_observer": Rule(_position_lugre, LUGRE, {"pole": None, "M": SPEED, "dt": None}),
    "position_coulomb_observer": Rule(
        _position_coulomb, "J Fv", {"rate": None, "L": None, "dt": None}
    ),
    "disturbance_observer": Rule(_disturbance, "J", {"tau": None, "dt": None}),
    "extended_state_observer": Rule(_extended, "J", {"bandwidth": None, "dt": None}),
    "general_coulomb_observer": Rule(
        _general_coulomb, "J Fv", {"rate": None, "w0": 0.1, "dt": None}
    ),
    "friedland_park_observer": Rule(
        _friedland_park, "J Fv", {"rate": None, "mu": 1.5, "speed": 0.1, "dt": None}
    ),
    "adaptive_observer": Rule(_adaptive, LUGRE, {"gamma": 10.0, "K2": None, "dt": None}),
}

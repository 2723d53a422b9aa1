"""Gains of the observers: by rule, and of the proposed one by the source paper's constructions.

A rule is a function of the drive's values and the choices; it returns the gains by name and what
they guarantee. The derivations stand in the docstrings of the observers.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any, Literal, NamedTuple, overload

import numpy as np
from scipy.linalg import solve_continuous_lyapunov
from scipy.optimize import minimize

from ..blocks.declaration import meant
from ..blocks.friction import level, relaxation
from ..blocks.observers import observer_block
from ..core.display import Row, Shown
from ..core.errors import InputError
from ..core.result import Result
from ..core.validation import number, shown
from ..linear import position_T, spr_check
from .certificate import (
    ANY_MOTION,
    MATCHED,
    Certificate,
    bristle_errors,
    checked,
    constant_certificate,
    slowest_pole,
)

ROUNDS = 3  # searches, each from the best so far
LEAST = 1e-9  # of the fastest rate: below it no decay is claimed


def common_rate(corners: Sequence[np.ndarray]) -> tuple[float, np.ndarray] | None:
    """The largest r found with A'P + P A + 2 r P <= 0 for all A of ``corners``, and P: V = x'P x
    then decays as exp(-2 r t) however the errors move between them. Every r is a bound, the best
    one or not."""
    size, n = max(float(np.abs(A).max()) for A in corners), len(corners[0])
    scaled = [A / size for A in corners]
    starts: list[np.ndarray] = [np.eye(n)]  # and functions of stable corners and their mean
    for A in (np.mean(scaled, axis=0), *scaled):
        if (slowest := _slowest(A)) < -LEAST:
            shifted = A - 0.8 * slowest * np.eye(n)
            starts.append(np.asarray(solve_continuous_lyapunov(shifted.T, -np.eye(n))))
    best, P = -np.inf, np.eye(n)
    for start in starts:
        rate, made = _improved(scaled, start / np.trace(start))
        if rate > best:
            best, P = rate, made
    return (best * size, P) if best > LEAST else None


def decay(P: np.ndarray, corners: Sequence[np.ndarray]) -> float:
    """The largest r with A'P + P A + 2 r P <= 0 for all corners."""
    L = np.linalg.cholesky(P)
    inverse = np.linalg.inv(L)
    worst = (inverse @ (A.T @ P + P @ A) @ inverse.T for A in corners)
    return -0.5 * max(float(np.linalg.eigvalsh(0.5 * (M + M.T))[-1]) for M in worst)


def _improved(corners: Sequence[np.ndarray], P: np.ndarray) -> tuple[float, np.ndarray]:
    lower = np.tril_indices(len(P))

    def matrix(x: np.ndarray) -> np.ndarray:
        L = np.zeros_like(P)
        L[lower] = x
        return L @ L.T + 1e-12 * np.eye(len(P))

    def missed(x: np.ndarray) -> float:
        try:
            return -decay(matrix(x), corners)
        except np.linalg.LinAlgError:
            return np.inf

    x = np.linalg.cholesky(P)[lower]
    for _ in range(ROUNDS):
        x = minimize(missed, x, method="Nelder-Mead", options={"maxiter": 600}).x
    made = matrix(x)
    return -missed(x), made / np.trace(made)


SPEED = 1.0  # rad/s, up to which a certificate that has a limit holds, unless given
SAMPLED = 0.5  # largest rate times sample time
SHARE = 0.9  # of a double pole, which no quadratic function reaches
RIGHT = "the observer's parameters are those of the drive, and no load torque acts"
FORWARD = "the loop has the feed-forward J dr (velocity) or J ddr (position)"
RELAXES = "z - zhat decays only while the drive moves (Excitation.rate)"
ONE_FACTOR = "sigma0, sigma1, Fc, Fs are all wrong by one factor; J and Fv are right, no load acts"
CONSTANT = "J is right; the sum D of all resisting torques is constant, else the error is at most"
DAMPED = ("existing_observer", "lyapunov_observer", "temperature_observer", "normal_force_observer")
COULOMB = "the drive has F = a sign(w) + Fv w, J and Fv are right, and no load torque acts"


Choices = Mapping[str, Any]
Made = tuple[dict[str, Any], Certificate]


def claim(
    *conditions: str,
    pole: float = 0.0,
    rate: float | None = None,
    valid: str = "for every motion",
    holds: bool = True,
) -> Certificate:
    """What gains guarantee: ``valid`` says for which motions; pole at rest and rate in 1/s."""
    return Certificate(holds, "", conditions, pole, rate, valid=valid)


class Rule(NamedTuple):
    """``needs``: values of the drive; ``choices``: names and defaults, None for one by rule."""

    build: Callable[[Any, Choices], Made]
    needs: str
    choices: Mapping[str, float | None]


RULES: dict[str, Rule] = {}  # by observer
METHODS: dict[str, Rule] = {}  # of the proposed one
BRISTLES = "J sigma0 sigma1 Fc Fs vs"
LUGRE = f"{BRISTLES} Fv"


def rule(table: dict[str, Rule], name: str, needs: str, /, **choices: float | None) -> Any:
    """Enter the function below as the rule of an observer, or a method of the proposed one."""

    def enter(build: Any) -> Any:
        table[name] = Rule(build, needs, choices)
        return build

    return enter


def _limited(rate: float, c: Choices, most: float = SAMPLED) -> float:
    """A rate that a drive with the sample time dt can follow: ``most`` times 1/dt."""
    return rate if c["dt"] is None else min(rate, most / c["dt"])


def _slides(m: Any, w: float) -> float:
    """a = sigma0 |w|/h(w) in 1/s."""
    return float(relaxation(w, m.sigma0, level(w, m.Fc, m.Fs, m.vs)))


def _noise(m: Any, rate: float, bound: str = "") -> str:
    return f"noise of w reaches Fhat with {bound}{m.J * rate:.3g} N m s/rad"


@rule(RULES, "natural_observer", "sigma0 Fc Fs vs")
def _natural(m: Any, c: Choices) -> Made:
    return {}, claim(RELAXES, RIGHT)


def _corrected(m: Any, c: Choices) -> float:
    """k for which the error loop at rest, J e'' + (kp + sigma1 k) e' + (ki + sigma0 k) e, has
    the stiffness J rate^2."""
    rate = c["rate"] or (0.5 * m.sigma0 / m.sigma1)
    return m.J * rate**2 / m.sigma0 if c["k"] is None else c["k"]


@rule(RULES, "existing_observer", LUGRE, rate=None, k=None, kp=0.0)
def _existing(m: Any, c: Choices) -> Made:
    k = _corrected(m, c)
    most = 4.0 / m.sigma1 * (1.0 + c["kp"] / (k * m.sigma1)) if k else math.inf
    return {"k": k}, claim(
        f"|w|/h(w) <= {most:.4g} rad/(N m s); this limits the proof, not the loop",
        FORWARD,
        "e tends to 0; " + RELAXES,
        RIGHT,
        valid=f"for |w| <= {most * min(m.Fc, m.Fs):.3g} rad/s",
    )


@rule(RULES, "lyapunov_observer", LUGRE, rate=None, k=None)
def _lyapunov(m: Any, c: Choices) -> Made:
    return {"k": _corrected(m, c)}, claim(FORWARD, "s tends to 0; " + RELAXES, RIGHT)


@rule(RULES, "normal_force_observer", LUGRE, k=1.0, gamma=None, kp=None, kd=None)
def _normal_force(m: Any, c: Choices) -> Made:
    kd = 1.25 * m.sigma0 * m.J / m.sigma1 if c["kd"] is None else c["kd"]
    kp = kd**2 / (4.0 * m.J) if c["kp"] is None else c["kp"]
    verdict = spr_check(position_T(m, kp=kp, ki=0.0, kd=kd))
    gamma = 670.0 / m.Fs if c["gamma"] is None else c["gamma"]
    return {"k": c["k"], "gamma": gamma}, claim(
        f"a position loop with PD kp = {kp:.4g}, kd = {kd:.4g} on e and the feed-forward J ddr; "
        f"(sigma1 s + sigma0)/(J s^2 + kd s + kp) is {verdict.classification}",
        ONE_FACTOR,
        "e tends to 0 for every such factor; the proof gives no rate",
        holds=bool(verdict),
    )


@rule(RULES, "temperature_observer", LUGRE, k=0.0, gamma=5.0, M=SPEED)
def _temperature(m: Any, c: Choices) -> Made:
    k, gamma = c["k"], c["gamma"]
    a, low = _slides(m, c["M"]), min(m.Fc, m.Fs) / m.Fs
    root = np.roots([1.0, a + k, gamma * (a * low) ** 2]).real.max()
    return {"k": k, "gamma": gamma}, claim(
        "Fc and Fs are wrong by one factor; J, sigma0, sigma1, Fv are right, and no load acts",
        "no rate by itself: at rest the factor keeps its value",
        f"sliding at {c['M']:g} rad/s, linearised: the errors decay with {-root:.4g} 1/s; zbar "
        f"is right within {m.sigma1 / m.sigma0:.3g} s",
        pole=0.0 - k,
    )


@rule(RULES, "friction_state_observer", "J sigma0 Fc Fs Fv vs", bandwidth=None, M=SPEED, dt=None)
def _friction_state(m: Any, c: Choices) -> Made:
    p, most = c["bandwidth"] or _limited(1.5 * math.sqrt(m.sigma0 / m.J), c), c["M"]
    found = common_rate([np.array([[-2.0 * p, -p], [p, -a]]) for a in (0.0, _slides(m, most))])
    return {"bandwidth": p}, claim(
        "Fc, Fs, Fv, vs, sigma0, J are right, and no load torque acts; sigma1 dz/dt counts as an "
        "error for about sigma1/sigma0",
        _noise(m, 0.5 * p, "up to "),
        pole=-p,
        rate=found[0] if found else None,
        valid=f"for |w| <= {most:g} rad/s",
        holds=bool(found),
    )


@rule(RULES, "position_lugre_observer", LUGRE, pole=None, M=SPEED, dt=None)
def _position_lugre(m: Any, c: Choices) -> Made:
    p = c["pole"] or _limited(3.0 * math.sqrt(m.sigma0 / m.J), c, 1.0)
    gains, corners = position_corners(m, p, c["M"])
    found, slowest = common_rate(corners), max(map(_slowest, corners))
    said = ["|z| <= max(Fc, Fs)/sigma0", RIGHT]
    if found:
        valid = f"for |w| <= {c['M']:g} rad/s"
        return gains, claim(*said, pole=-p, rate=found[0], valid=valid)
    said += [
        "no common quadratic function was found: the triple pole holds at rest only",
        f"sliding at a constant speed, the slowest pole can be {slowest:+.4g} 1/s"
        + ("" if slowest < 0.0 else ": choose a faster pole"),
    ]
    return gains, claim(*said, pole=-p, valid="linearised at rest only", holds=slowest < 0.0)


def position_corners(m: Any, p: float, most: float) -> tuple[dict[str, float], list[np.ndarray]]:
    """l1, l2, l3 with a triple pole at -p at rest, and the error matrices, states scaled by p, at
    the corners of a = sigma0 |w|/h(w) and of the slope of dz/dt over w."""
    # at rest the errors have s^3 + (b + l1) s^2 + (g + l1 b + l2) s + g (l1 - l3); the slope stays
    # within 1 +- max(Fc, Fs) max d(|w|/h)/dw
    b, g = (m.sigma1 + m.Fv) / m.J, m.sigma0 / m.J
    l1 = 3.0 * p - b
    l2, l3 = 3.0 * p**2 - g - l1 * b, l1 - p**3 / g
    w = np.linspace(0.0, max(most, 10.0 * m.vs), 4001)
    steepest = np.abs(np.gradient(w / level(w, m.Fc, m.Fs, m.vs), w)).max()
    wide = float(steepest) * max(m.Fc, m.Fs)
    top = relaxation(most, m.sigma0, min(m.Fc, m.Fs))
    S = np.diag([1.0, 1.0 / p, g / p**2])
    corners = []
    for a, slope in itertools.product((0.0, top), (1.0 - wide, 1.0 + wide)):
        at_rest, sliding = bristle_errors(m, slope, m.Fv)
        errors = np.array([[-l1, 1.0, 0.0], [-l2, 0.0, 0.0], [-l3, 0.0, 0.0]])
        errors[1:, 1:] = (at_rest + a * sliding)[::-1, ::-1]  # of what, then of zhat
        corners.append(S @ errors @ np.linalg.inv(S))
    return {"l1": l1, "l2": l2, "l3": l3}, corners


def _slowest(A: np.ndarray) -> float:
    return float(np.linalg.eigvals(A).real.max())


@rule(RULES, "position_coulomb_observer", "J Fv", rate=None, L=None, dt=None)
def _position_coulomb(m: Any, c: Choices) -> Made:
    r = c["rate"] or _limited(200.0, c) / 4.0
    L, k = c["L"] or 8.0 * r, m.J * r
    slow = _slowest(np.array([[0.0, 1.0], [-k * L / m.J, -(L + m.Fv / m.J)]]))
    return {"k": k, "L": L}, claim(
        COULOMB,
        "a - ahat never grows, through reversals and at rest; no rate by itself",
        f"sliding in one direction: the slowest pole is {slow:.4g} 1/s",
    )


@rule(RULES, "disturbance_observer", "J", tau=None, dt=None)
def _disturbance(m: Any, c: Choices) -> Made:
    r = 1.0 / c["tau"] if c["tau"] else _limited(100.0 if c["dt"] is None else math.inf, c)
    said = (f"{CONSTANT} tau sup|dD/dt|", _noise(m, r))
    return {"tau": c["tau"] or 1.0 / r}, claim(*said, pole=-r, rate=r)


@rule(RULES, "extended_state_observer", "J", bandwidth=None, dt=None)
def _extended(m: Any, c: Choices) -> Made:
    p = c["bandwidth"] or _limited(100.0 if c["dt"] is None else math.inf, c)
    return {"bandwidth": p}, claim(
        f"{CONSTANT} (2/p) sup|dD/dt|, p = bandwidth",
        f"the errors decay as (1 + p t) exp(-p t), which is faster than {SHARE:g} p in the end",
        _noise(m, 0.5 * p, "up to "),
        pole=-p,
        rate=SHARE * p,
    )


@rule(RULES, "general_coulomb_observer", "J Fv", rate=None, w0=0.1, dt=None)
def _general_coulomb(m: Any, c: Choices) -> Made:
    r, w0 = c["rate"] or _limited(50.0, c), c["w0"]
    return {"k": m.J * r, "w0": w0}, claim(
        COULOMB,
        "a - ahat never grows; at rest it keeps its value",
        f"while |w| >= v it decays with at least {r:.4g} v/sqrt(v^2 + {w0:g}^2) 1/s",
    )


@rule(RULES, "friedland_park_observer", "J Fv", rate=None, mu=1.5, speed=0.1, dt=None)
def _friedland_park(m: Any, c: Choices) -> Made:
    r, mu, v = c["rate"] or _limited(50.0, c), c["mu"], c["speed"]
    return {"k": m.J * r / (mu * v ** (mu - 1.0)), "mu": mu}, claim(
        COULOMB,
        "a - ahat never grows",
        f"at |w| = {v:g} rad/s it decays with {r:.4g} 1/s, at other speeds with "
        f"{r:.4g} (|w|/{v:g})^{mu - 1:.3g}",
    )


@rule(RULES, "adaptive_observer", LUGRE, gamma=10.0, K2=None, dt=None)
def _adaptive(m: Any, c: Choices) -> Made:
    gamma = c["gamma"]
    K2 = c["K2"] or m.J * max(_limited(40.0 * gamma, c), 4.0 * gamma)
    return {"K2": K2, "gamma": gamma}, claim(
        ONE_FACTOR,
        f"w - what tends to 0, and the factor settles at about {gamma:g} 1/s while the drive "
        "slides; no rate by itself",
        "at rest the factor follows the torque that balances u",
    )


@dataclass(frozen=True, repr=False)
class ObserverDesign(Result):
    """Gains of an observer by its rule, and what they guarantee.

    ``gains`` holds them by name, for ``velocity_loop(p, design.observer, **design.gains)`` or
    ``gains=design.gains`` of any loop. ``choices``: what the rule was given.

    Attributes
    ----------
    observer : str
        Its name, without ``_observer``.
    gains : dict
        By name, for ``velocity_loop(p, design.observer, **design.gains)`` or ``gains=design.gains``
        of any loop.
    choices : dict
        What the rule was given.
    certificate : Certificate
        What the gains guarantee.

    Examples
    --------
    >>> p = lg.table1()
    >>> design = lg.design_gains(p, observer="extended_state", bandwidth=200.0)
    >>> design.gains
    {'bandwidth': 200.0}
    >>> loop = lg.velocity_loop(p, design.observer, **design.gains)
    """

    observer: str
    gains: Mapping[str, float]
    choices: Mapping[str, float]
    certificate: Certificate

    @property
    def method(self) -> str:
        """The name of the rule."""
        return self.certificate.lemma

    def _title(self) -> str:
        return f"Design: {self.observer} observer"

    def _rows(self) -> Iterable[Row]:
        return _shown(self)

    def summary(self) -> dict[str, Any]:
        """Plain Python."""
        own = {"observer": self.observer, "gains": dict(self.gains), "choices": dict(self.choices)}
        return own | {"certificate": self.certificate.summary()}


def _shown(design: Any) -> list[Row]:
    declared = observer_block(design.observer).parameters
    units = {k: declared[k].unit for k in design.gains}
    gains = [Row(k, v, "" if units[k] == "1" else units[k]) for k, v in design.gains.items()]
    gains = gains or [Row("gains", "it has none")]
    return [*gains, Row("certificate", design.certificate), *design.certificate._rows()]


def _chosen(short: str, rule: Rule, choices: Mapping[str, Any]) -> dict[str, Any]:
    """The choices of a rule with those given; each a number above 0, or 0 where that is usual."""
    made = dict(rule.choices)
    for key, value in choices.items():
        if key not in made:
            hint = meant(key, made) if made else "it has none."
            raise InputError(f"the design rule of {short} has no choice '{key}'; {hint}")
        least = number(value, key)
        if least < 0.0 or (least == 0.0 and rule.choices[key] != 0.0):
            raise InputError(f"{key} must be a positive number, not {shown(value)}.")
        made[key] = least
    return made


@dataclass(frozen=True, repr=False)
class ScheduledGain(Shown):
    """offset + slope |w|/h(w): a gain that ``proposed_observer`` accepts in place of a number.

    ``slope`` is in the gain's unit times N m s/rad; Fc, Fs, vs are those of h(w).
    """

    offset: float
    slope: float
    Fc: float
    Fs: float
    vs: float

    def _title(self) -> str:
        return f"{self.offset:.6g} {self.slope:+.6g} |w|/h(w)"

    def _rows(self) -> Iterable[Row]:
        return ()

    def __call__(self, w: Any) -> Any:
        return self.offset + self.slope * np.abs(w) / level(w, self.Fc, self.Fs, self.vs)


@dataclass(frozen=True, repr=False)
class Design(Result):
    """Gains of the proposed observer and their guaranteed error decay.

    ``K1`` (without unit) and ``K2`` (N m s/rad) are numbers or functions of w, as
    ``proposed_observer`` accepts; ``gains`` holds both, for ``velocity_loop(..., **gains)``.

    Attributes
    ----------
    method : str
        "time-varying", "bounded" or "constant".
    K1, K2 : float or ScheduledGain
        Without unit, and in N m s/rad: numbers or functions of w, as ``proposed_observer`` accepts;
        ``gains`` holds both, for ``velocity_loop(..., **gains)``.
    certificate : Certificate
        What the gains guarantee.

    Examples
    --------
    Gains that follow the measured speed:

    >>> p = lg.table1()
    >>> design = lg.design_gains(p, "time-varying")
    >>> [round(float(design.K1(w)), 2) for w in (0.0, 0.5)]
    [-1.59, 0.08]
    >>> loop = lg.velocity_loop(p, design.observer, **design.gains)
    """

    method: str
    K1: float | ScheduledGain
    K2: float | ScheduledGain
    certificate: Certificate

    @property
    def observer(self) -> str:
        return "proposed"

    @property
    def gains(self) -> dict[str, float | ScheduledGain]:
        return {"K1": self.K1, "K2": self.K2}

    def _title(self) -> str:
        return f"Design: {self.method}"

    def _rows(self) -> Iterable[Row]:
        return _shown(self)

    def summary(self) -> dict[str, Any]:
        """Plain Python; a gain that depends on w as its offset and slope."""

        def plain(K: float | ScheduledGain) -> Any:
            if isinstance(K, ScheduledGain):
                return {"offset": K.offset, "slope": K.slope, "of": "|w|/h(w)"}
            return K

        own = {"method": self.method, "K1": plain(self.K1), "K2": plain(self.K2)}
        return own | {"certificate": self.certificate.summary()}


@overload
def design_gains(
    p: Any, method: str = ..., *, observer: Literal["proposed"] = ..., **choices: float
) -> Design: ...


@overload
def design_gains(
    p: Any, method: str = ..., *, observer: str, **choices: float
) -> Design | ObserverDesign: ...


def design_gains(
    p: Any, method: str = "constant", *, observer: str = "proposed", **choices: float
) -> Design | ObserverDesign:
    """Gains of an observer by its design rule, with a certificate of what they guarantee.

    Parameters
    ----------
    p : Parameters, Model, dict or path
        The values that the rule needs; for most of them those of LuGre friction, J, sigma0, Fc,
        Fs > 0.
    method : str
        Of the proposed observer only.
        "time-varying" (lemma4): K1 = C sigma0/(A J) (sigma1 |w|/h - 1), K2 = alpha + sigma1 K1,
        both functions of w; alpha in N m s/rad.
        "bounded" (lemma5): the same K1(w) and the constant K2 = alpha + sigma1 C sigma0/(A J)
        (sigma1 M/C1 - 1), C1 = min(Fc, Fs); for |w| <= M, with a chosen M in rad/s.
        "constant" (lemma6): K1 = -2 C (sigma1 alpha + sigma0)/(beta J), K2 = J alpha; alpha in
        1/s.
    choices : float
        Positive numbers. A, C, alpha ("time-varying"), A, C, alpha, M ("bounded"; M has no
        default), C, alpha, beta ("constant"; A and B follow by eq. AB). Defaults: C = 1;
        A = C sigma1^2/J^2 and alpha = 2 J sigma0/sigma1, which give the errors a double pole at
        -sigma0/sigma1 at rest; in "constant" alpha = sigma0/sigma1, beta = 2 C sigma1^2/J^2,
        with the poles -sigma0/sigma1 and -2 sigma0/sigma1 at rest. With sigma1 = 0 there are no
        defaults. Of the other observers (a rule replaces what is left out):
        "existing", "lyapunov": rate of the error loop at rest in 1/s, sqrt(sigma0 k/J)
        (sigma0/(2 sigma1)), or k itself; "existing" also kp, the controller's gain, which widens
        the proof. "temperature": k, gamma, M. "friction_state": bandwidth
        (1.5 sqrt(sigma0/J)), M. "position_lugre": pole (3 sqrt(sigma0/J)), the triple pole at
        rest, and M. "position_coulomb": rate of ahat (50), L (8 rate). "disturbance": tau (0.01).
        "extended_state": bandwidth (100). "general_coulomb": rate (50), w0. "friedland_park":
        rate (50) at speed (0.1 rad/s), mu. "adaptive": gamma, K2. "normal_force": k, gamma
        (670/Fs), and kp, kd of the position loop's PD. M is the largest |w| in rad/s for which
        the certificate holds (1). With dt, the sample time of the drive in s, no
        rate is above 0.5/dt, no pole of "position_lugre" above 1/dt, and "disturbance" and
        "extended_state" use that rate.
    observer : str
        As in ``lugrectl.observers()``, with or without ``_observer``.

    Returns
    -------
    Design or ObserverDesign
        ``.gains`` by name, for ``velocity_loop(p, observer, **design.gains)``. Its certificate is
        truthy if the proof holds; ``valid`` says for which motions, "linearised at rest only"
        where no proof was found. Of the proposed observer only "constant" has a guaranteed rate;
        the others decay while the drive moves, see :meth:`Certificate.rate_at` and
        :meth:`Excitation.rate`.

    Raises
    ------
    InputError
        For an unknown method, observer or choice, an observer without a rule, a choice that is
        missing or not positive, or sigma1 = 0 in "bounded" and "constant".

    Notes
    -----
    Source paper, eq. K1, eq1 and eq2 (with the factor sigma1 that is missing inside the paper's
    bracket), AB, K3_new. For the same constant gains :func:`certify` may find a faster decay at
    every speed, because it is not limited to the paper's V.

    Examples
    --------
    Of the proposed observer, with the rate at which its errors decay at least, in 1/s:

    >>> p = lg.table1()
    >>> design = lg.design_gains(p)
    >>> sorted(design.gains), bool(design.certificate)
    (['K1', 'K2'], True)
    >>> round(design.certificate.rate, 1)
    165.5

    Of a disturbance observer in a drive that runs at 1 kHz:

    >>> fast = lg.design_gains(p, observer="disturbance", dt=1e-3)
    >>> fast.gains
    {'tau': 0.002}
    """
    name = observer_block(observer).name
    short, proposed = name.removesuffix("_observer"), name == "proposed_observer"
    if not proposed and method != "constant":
        raise InputError(f"method = {shown(method)} belongs to the proposed observer only.")
    if proposed and (not isinstance(method, str) or method not in METHODS):
        raise InputError(f"unknown method {shown(method)}; {meant(method, METHODS)}")
    rule = METHODS[method] if proposed else RULES.get(name)
    if rule is None:
        raise InputError(
            f"there is no design rule for {name}: choose its gains yourself and test them "
            "with lugrectl.compare_observers."
        )
    given = _chosen(f"method '{method}'" if proposed else short, rule, choices)
    free = {"Fv"} if name in DAMPED or (proposed and method != "time-varying") else {"Fv", "sigma1"}
    values = checked(p, rule.needs.split(), free, f"the design rule of {name}")
    gains, certificate = rule.build(SimpleNamespace(**values), given)
    if proposed:
        return Design(method, gains["K1"], gains["K2"], certificate)
    own = {k: v for k, v in given.items() if v is not None}
    return ObserverDesign(short, gains, own, replace(certificate, lemma=short))


@rule(METHODS, "bounded", BRISTLES, C=1.0, alpha=None, A=None, M=None)
@rule(METHODS, "time-varying", BRISTLES, C=1.0, alpha=None, A=None)
def _scheduled(m: Any, c: Choices) -> Made:
    """K1(w) of eq. K1 with the K2 of lemma4, or of lemma5 up to the speed M:
    V = A e_z^2 + C e_w^2 has -dV/dt >= 2 A a e_z^2 + 2 C (alpha/J) e_w^2."""
    C, M = c["C"], c.get("M")
    if "M" in c and M is None:
        raise InputError("method 'bounded' needs M, the largest |w| in rad/s: give M.")
    for key in ("A", "alpha"):
        if c[key] is None and m.sigma1 == 0.0:
            raise InputError(f"with sigma1 = 0 there is no default for {key}: give {key}.")
    A = c["A"] or C * (m.sigma1 / m.J) ** 2
    alpha = c["alpha"] or 2.0 * m.J * m.sigma0 / m.sigma1
    size, low = C * m.sigma0 / (A * m.J), min(m.Fc, m.Fs)
    K1 = ScheduledGain(-size, size * m.sigma1, m.Fc, m.Fs, m.vs)
    if M is None:
        at_rest = alpha + m.sigma1 * K1.offset
        K2 = ScheduledGain(at_rest, m.sigma1 * K1.slope, m.Fc, m.Fs, m.vs)
        said = (
            "e_w tends to 0 for every bounded w",
            "no rate by itself: exponential if |w| stays above a positive bound, or if w is "
            "bounded and persistently exciting (Excitation.rate)",
        )
    else:
        at_rest = K2 = alpha + m.sigma1 * (K1.offset + K1.slope * M / low)
        said = (
            f"|w| <= M = {M:g} rad/s",
            "sigma1 > 0",
            "e_z and e_w tend to 0, also at rest; the lemma gives no rate",
        )
    constants: Any = {"A": A, "B": 0.0, "C": C, "alpha": alpha, "alpha_unit": "N m s/rad"}
    certificate = Certificate(
        holds=True,
        lemma="lemma4" if M is None else "lemma5",
        conditions=(*said, MATCHED),
        pole_at_rest=slowest_pole(m, K1.offset, at_rest),
        **constants,
        P=np.diag([A, C]),
        Q0=np.diag([0.0, 2.0 * C * alpha / m.J]),
        Q1=np.diag([2.0 * A, 0.0]),
    )
    return {"K1": K1, "K2": K2}, certificate


@rule(METHODS, "constant", BRISTLES, C=1.0, alpha=None, beta=None)
def _constant(m: Any, c: Choices) -> Made:
    C, alpha = c["C"], c["alpha"] or m.sigma0 / m.sigma1
    beta = c["beta"] or 2.0 * C * (m.sigma1 / m.J) ** 2
    K1, K2 = -2.0 * C * (m.sigma1 * alpha + m.sigma0) / (beta * m.J), m.J * alpha
    sentences = ("sigma1 > 0", MATCHED, ANY_MOTION)
    return {"K1": K1, "K2": K2}, constant_certificate(m, (K1, K2), C, beta, "lemma6", sentences)

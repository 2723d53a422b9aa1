"""Gains of the observers: of the proposed one by the three constructions of the source paper."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any, Literal, overload

import numpy as np

from ..blocks.aliases import meant
from ..blocks.friction import level
from ..blocks.model import model_first
from ..blocks.observers import observer_block
from ..core.display import Row, Shown
from ..core.errors import InputError
from ..core.result import Result
from ..core.validation import positive, shown
from .certificate import (
    ANY_MOTION,
    MATCHED,
    Certificate,
    Drive,
    constant_certificate,
    drive,
    lyapunov,
    slowest_pole,
)
from .observer_rules import ObserverDesign, design_observer


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
        gains = [Row("K1", self.K1), Row("K2", self.K2, "N m s/rad")]
        return [*gains, Row("certificate", self.certificate), *self.certificate._rows()]

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
    model_first(p, method, "method")
    if observer_block(observer).name != "proposed_observer":
        if method != "constant":
            raise InputError(f"method = {shown(method)} belongs to the proposed observer only.")
        return design_observer(p, observer, choices)
    if not isinstance(method, str) or method not in _METHODS:
        raise InputError(f"unknown method {shown(method)}; {meant(method, _METHODS)}")
    build, allowed = _METHODS[method]
    for key in choices:
        if key not in allowed:
            raise InputError(f"method '{method}' has no choice '{key}'; it has {allowed}.")
    m = drive(p)
    if m.sigma1 == 0.0 and method != "time-varying":
        raise InputError(f"method '{method}' needs sigma1 > 0; use method='time-varying'.")
    K1, K2, certificate = build(m, {k: positive(v, k) for k, v in choices.items()})
    return Design(method, K1, K2, certificate)


def _default(m: Drive, given: dict[str, float], key: str, make: Callable[[], float]) -> float:
    if key not in given and m.sigma1 == 0.0:
        raise InputError(f"with sigma1 = 0 there is no default for {key}: give {key}.")
    return given[key] if key in given else make()


def _scheduled(m: Drive, given: dict[str, float]) -> tuple[float, float, float, ScheduledGain]:
    """A, C, alpha and K1(w) of eq. K1."""
    C = given.get("C", 1.0)
    A = _default(m, given, "A", lambda: C * (m.sigma1 / m.J) ** 2)
    alpha = _default(m, given, "alpha", lambda: 2.0 * m.J * m.sigma0 / m.sigma1)
    size = C * m.sigma0 / (A * m.J)
    return A, C, alpha, ScheduledGain(-size, size * m.sigma1, m.Fc, m.Fs, m.vs)


def _diagonal(
    m: Drive, V: tuple[float, float], alpha: float, pole: float, lemma: str, said: tuple[str, ...]
) -> Certificate:
    """V = A e_z^2 + C e_w^2 with -dV/dt >= 2 A a e_z^2 + 2 C (alpha/J) e_w^2."""
    A, C = V
    return Certificate(
        holds=True,
        lemma=lemma,
        conditions=(*said, MATCHED),
        pole_at_rest=pole,
        A=A,
        B=0.0,
        C=C,
        alpha=alpha,
        alpha_unit="N m s/rad",
        P=lyapunov(A, 0.0, C),
        Q0=np.diag([0.0, 2.0 * C * alpha / m.J]),
        Q1=np.diag([2.0 * A, 0.0]),
    )


def _time_varying(
    m: Drive, given: dict[str, float]
) -> tuple[ScheduledGain, ScheduledGain, Certificate]:
    A, C, alpha, K1 = _scheduled(m, given)
    K2 = ScheduledGain(alpha + m.sigma1 * K1.offset, m.sigma1 * K1.slope, m.Fc, m.Fs, m.vs)
    sentences = (
        "e_w tends to 0 for every bounded w",
        "no rate by itself: exponential if |w| stays above a positive bound, or if w is "
        "bounded and persistently exciting (Excitation.rate)",
    )
    pole = slowest_pole(m, K1.offset, K2.offset)
    return K1, K2, _diagonal(m, (A, C), alpha, pole, "lemma4", sentences)


def _bounded(m: Drive, given: dict[str, float]) -> tuple[ScheduledGain, float, Certificate]:
    if "M" not in given:
        raise InputError("method 'bounded' needs M, the largest |w| in rad/s: give M.")
    A, C, alpha, K1 = _scheduled(m, given)
    K2 = alpha + m.sigma1 * (K1.offset + K1.slope * given["M"] / m.low)
    sentences = (
        f"|w| <= M = {given['M']:g} rad/s",
        "sigma1 > 0",
        "e_z and e_w tend to 0, also at rest; the lemma gives no rate",
    )
    pole = slowest_pole(m, K1.offset, K2)
    return K1, K2, _diagonal(m, (A, C), alpha, pole, "lemma5", sentences)


def _constant(m: Drive, given: dict[str, float]) -> tuple[float, float, Certificate]:
    C = given.get("C", 1.0)
    alpha = given.get("alpha", m.sigma0 / m.sigma1)
    beta = given.get("beta", 2.0 * C * (m.sigma1 / m.J) ** 2)
    K1, K2 = -2.0 * C * (m.sigma1 * alpha + m.sigma0) / (beta * m.J), m.J * alpha
    sentences = ("sigma1 > 0", MATCHED, ANY_MOTION)
    return K1, K2, constant_certificate(m, (K1, K2), C, beta, "lemma6", sentences)


_METHODS: dict[str, tuple[Callable[..., Any], str]] = {
    "time-varying": (_time_varying, "A, C, alpha"),
    "bounded": (_bounded, "A, C, alpha, M"),
    "constant": (_constant, "C, alpha, beta"),
}

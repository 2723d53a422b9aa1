"""Strict positive realness, decided on rational numbers, and the least change that gives it."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, field, replace
from decimal import ROUND_FLOOR, Context, Decimal
from fractions import Fraction
from typing import Any

import control as ct

from ..core.display import Shown
from ..core.errors import InputError
from ..core.views import view
from .exact import classify
from .loops import Loop, LoopT, rounded
from .state_system import StateSystem
from .system import last, realness
from .systems import EXACT, system_of
from .transfer import lowest_terms, read_transfer, to_float
from .verdict import Realness, Verdict

DIGITS = Context(prec=4, rounding=ROUND_FLOOR)
WORDS = {
    "kp": "Kp above {} (say {})",
    "kd": "Kd above {} (say {})",
    "leak": "a leak in the integral, Ki/(s + leak), above {} 1/s (say {})",
}


@dataclass(frozen=True, repr=False)
class Repair(Shown):
    """A change of the controller that makes T SPR.

    ``gains``: keyword arguments of ``position_T``, ``velocity_T`` to change, with limits rounded
    up to four digits. ``limits``: what each of them must exceed, given those before it.
    """

    gains: dict[str, float | None] = field(default_factory=dict)
    limits: dict[str, float] = field(default_factory=dict)

    @property
    def sentence(self) -> str:
        steps = [
            "no filter on the derivative"
            if value is None
            else WORDS[name].format(f"{self.limits[name]:.6g}", f"{value:.4g}")
            for name, value in self.gains.items()
        ]
        return f"T becomes SPR with {', and '.join(steps)}."


def find_repair(loop: Loop) -> Repair | None:
    """The repair of a T that is not SPR, as ``lugrectl.linear.spr_repair`` describes it."""
    C = loop.controller
    if min(loop.J, loop.sigma0, loop.sigma1) <= 0 or (C.ki and C.kp < 0):
        return None
    repair = Repair()
    if loop.order == 2 and C.kd and C.derivative_filter:
        loop = _with(loop, derivative_filter=Fraction(0))
        repair = Repair({"derivative_filter": None})
    if _is_spr(loop):
        return repair
    integral = _with_leak(loop, repair) if C.ki and not C.tau else None
    if integral:
        return integral
    names = () if C.pure_integral else ("kd", "kp") if loop.order == 2 else ("kp",)
    made = (_least(loop, name, repair) for name in names)
    return next(filter(None, made), None)


def _with_leak(loop: Loop, repair: Repair) -> Repair | None:
    """The least leak, after the least Kd that the position loop needs without its integral."""
    C = loop.controller
    if C.added[0] or (C.kd and C.derivative_filter):
        return None  # the leaks that pass need not be an upward interval
    bare = _with(loop, ki=Fraction(0))
    if loop.order == 2 and not _is_spr(bare):
        if not C.pure_integral or not (first := _least(bare, "kd", repair)):
            return None
        loop, repair = _with(loop, kd=Fraction(first.gains["kd"] or 0)), first
    return _least(loop, "leak", repair)


def _least(loop: Loop, name: str, repair: Repair) -> Repair | None:
    """The repair with a further step: the least value of a gain, rounded up to four digits."""

    def passes(value: Fraction) -> bool:
        return _is_spr(_with(loop, **{name: value}))

    most = Fraction(2) ** 256
    limit = last(lambda value: not passes(value), most)
    if limit == most:
        return None
    start = limit or _usual(loop, name)
    value = DIGITS.create_decimal(Decimal(start.numerator) / Decimal(start.denominator))

    def fails(value: Decimal) -> bool:
        if Fraction(value) <= limit:
            return True
        T = read_transfer(rounded(*_with(loop, **{name: Fraction(float(value))}).T()))
        return classify(*T) != "SPR"

    while fails(value):
        if value > 2 * start:
            return None
        value = value.next_plus(DIGITS)
    gains = repair.gains | {name: float(value)}
    return Repair(gains, repair.limits | {name: to_float(limit)})


def _usual(loop: Loop, name: str) -> Fraction:
    """A sensible value for a gain that only needs to be above 0."""
    C = loop.controller
    if name == "leak" and C.kp:
        return abs(C.ki / C.kp) / 10  # still an integral over a decade below its corner
    if name == "kp" and loop.order == 2:
        return C.kd**2 / (4 * loop.J) or Fraction(1)  # critical damping
    return loop.sigma0 / loop.sigma1 * (loop.J if name == "kp" else Fraction(1, 1000))


def _with(loop: Loop, **changes: Any) -> Loop:
    return replace(loop, controller=replace(loop.controller, **changes))


def _is_spr(loop: Loop) -> bool:
    num, den = loop.T()
    return bool(den) and classify(*lowest_terms(num, den)) == "SPR"


@dataclass(frozen=True, repr=False)
class SprVerdict(Verdict):
    """Truthy iff T(s) is strictly positive real.

    ``classification``: "SPR", "WSPR" (Re T(jw) > 0 at every finite w, but not T(s - eps)
    positive real for any eps > 0), "PR", "not PR". ``margin``: the largest eps in 1/s for which
    T(s - eps) is positive real, of a sampled T(z) T(exp(-eps dt) z); inf for a positive constant,
    0 unless SPR. ``band_edge``: end of the band (0+, band_edge) with Re T(jw) > 0 in rad/s; inf if
    it has no end (sampled: if it reaches half the sampling rate), 0 if Re T is not positive just
    above w = 0. ``repair``: a sentence on the change of the controller that makes T
    SPR; None for an SPR T, if ``spr_repair`` finds no such change, and for a T that was not made
    by ``position_T`` or ``velocity_T``.
    """

    classification: str
    margin: float
    band_edge: float
    reason: str
    repair: str | None = None
    _units = {"margin": "1/s", "band_edge": "rad/s"}

    def __bool__(self) -> bool:
        return self.classification == "SPR"

    def plot(self, ax: Any = None) -> Any:
        """Draw Re T(jw) with band edge and margin; returns a list of its Axes.

        ``ax``: an Axes; else a new figure.
        """
        return view("loop_plots.realness")(self, ax)


def spr_check(T: Any) -> SprVerdict:
    """Whether T(s) is strictly positive real (SPR), weakly so, positive real (PR) or not.

    With T = n/d in lowest terms, x = w^2 and P(x) = Re(n(jw) conj d(jw)), so that
    Re T(jw) = P(x)/|d(jw)|^2:

    - PR iff P >= 0 on x >= 0 and n + d is Hurwitz, that is, (T - 1)/(T + 1) is bounded real;
      this covers simple imaginary-axis poles with positive residues.
    - WSPR iff also P > 0 on x >= 0 and d is Hurwitz.
    - SPR iff also Re T(jw) does not vanish as w grows, or for relative degree 1
      w^2 Re T(jw) does not (Ioannou and Tao, IEEE TAC 32(1), 1987). For relative degree -1 the
      limit of Re T is required to be positive too, as 1/T must be SPR along with T:
      s + 1/(s + 1) is WSPR only.

    Parameters
    ----------
    T : control.TransferFunction, control.StateSpace, control.frd or pair (num, den)
        A system with one input and one output, continuous or sampled; the pair in descending
        powers of s; or a measured response: the verdict then holds for its frequencies alone, and
        its margin is nan. With an exact dead time: a :class:`DelayedTransfer`.

    Returns
    -------
    SprVerdict
        Truthy if T is SPR; ``classification``, ``margin`` in 1/s, ``band_edge`` in rad/s, the
        ``reason``, and a ``repair`` where there is one.

    Raises
    ------
    InputError
        If T is none of these.

    Notes
    -----
    The sign of P is decided by Sturm chains and n + d by Routh, both on rational numbers, never
    on a frequency grid. The given coefficients are taken as exact, so an equality such as
    sigma1 Kd = sigma0 J holds only if it holds for the floats; the reason mentions a coefficient
    of P that is within 1e-12 of zero, relative to its terms. Give the pair (num, den) as
    fractions.Fraction to decide on decimal numbers. T = 0 counts as PR. The verdict is about
    T(s): where a mode that is not stable cancelled from it, the reason says so.

    A state-space model of more than 6 states is decided in floating point, from the zeros of
    T(s) + T(-s): time grows with the third power of the order. Where the rounding of its matrices
    may decide, as after a change of coordinates, T counts as PR and the reason says so.
    A band edge that rounding blurs by more than 1e-6 is the last frequency before it at which the
    sign is sure, and the reason gives both sides.

    With dead times n and d are sums of p(s) exp(-s h). The sign of Re T(jw) and the number of
    zeros of d right of the axis are decided in floating point, and none is missed between points
    of a grid:

    - T = G(s) exp(-s h), h > 0, with a rational G that is not 0, is never PR: the phase of G tends
      to a limit while -w h falls without end, so that Re T changes its sign for ever. The reason
      names the first band with Re T < 0; below it T is as good as PR.
    - With a dead time inside a loop, as in n/(J s + k exp(-s h)), T is SPR iff d has no zero with
      Re s >= 0, Re T(jw) > 0 at every w, and Re T, or for relative degree 1 w^2 Re T, stays above
      a positive number as w grows. The condition of Ioannou and Tao carries over, because the
      zeros of d then stay left of some Re s = -a, and right of it T'(s), or s^2 T'(s), is
      bounded: Re T(jw - eps), or w^2 times it, is less by no more than eps times a constant.

    A sampled T(z) is SPR iff its poles lie inside the unit circle and Re T(exp(jw dt)) > 0 at
    every w, 0 and half the sampling rate among them: the circle is closed, so there is no WSPR.
    z = (1 + v)/(1 - v) makes a rational function of v of it, on which the same exact arithmetic
    decides. Without a direct part (a delay of one sample at least) no T(z) is positive real.
    Where T.dt is True, w and the margin are per sample.

    Examples
    --------
    The velocity loop of the source paper: pure integral action puts a zero at 0.

    >>> check = lg.spr_check(lg.velocity_T(lg.table1(), kp=1.6, ki=0.16))
    >>> check.classification
    'PR'
    """
    found = _realness(T)
    repair = find_repair(T.loop) if isinstance(T, LoopT) and found.kind != "SPR" else None
    reason, sentence = f"{found.kind}: {found.reason}.", repair.sentence if repair else None
    return SprVerdict(found.kind, found.margin, found.edge, reason, sentence).of(T)


def _realness(T: Any) -> Realness:
    """How real T is; of few states in floating point where T is PR within rounding."""
    system = system_of(T)
    if isinstance(T, ct.StateSpace) and 0 < T.nstates <= EXACT:
        with suppress(InputError):  # of any size in exact arithmetic
            found = realness(StateSystem.of(T).shown())
            if found.kind == "PR" and found.rounded:
                return found
    return realness(system)


def spr_repair(T: Any) -> Repair | None:
    """The least change of the controller that makes a T of ``position_T``, ``velocity_T`` SPR.

    Position: a filter on the derivative is removed (with a bounded C(s), w^2 Re T tends to
    -sigma0/J); pure integral action gets the least leak, with its gain and Kp unchanged, after
    the least Kd if the controller without the integral needs one; else the least Kd. Velocity:
    the least leak of a pure or leaky integral. Otherwise, for either loop, the least Kp.

    Parameters
    ----------
    T : control.TransferFunction
        As :func:`position_T` or :func:`velocity_T` returned it.

    Returns
    -------
    Repair or None
        ``gains`` are the arguments of the two functions to change, ``sentence`` says it in words.
        None for an SPR T, if no such change helps, for J, sigma0 or sigma1 not above 0 (or
        Kp < 0 with an integral), and for a T without a known loop.

    Raises
    ------
    InputError
        If T is none of what :func:`spr_check` takes.

    Notes
    -----
    The leak is tried for C(s) = Kp + Kd s + I(s) only. In Kd and Kp the set of SPR controllers is
    an upward interval, because Kd s/(sigma1 s + sigma0) and Kp/(sigma1 s + sigma0) are positive
    real and add to 1/T; in the leak it is one for Kp >= 0 and sigma1 Kd > sigma0 J. Its end is
    found by bisection of the exact decision.

    Examples
    --------
    A PD controller with too little damping:

    >>> p = lg.table1()
    >>> repair = lg.spr_repair(lg.position_T(p, kp=15.0, kd=0.3))
    >>> {name: round(value, 2) for name, value in repair.gains.items()}
    {'kd': 0.95}
    >>> bool(lg.spr_check(lg.position_T(p, **{"kp": 15.0, **repair.gains})))
    True
    """
    num, den = read_transfer(T)
    if not isinstance(T, LoopT) or classify(num, den) == "SPR":
        return None
    return find_repair(T.loop)

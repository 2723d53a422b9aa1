"""The least change of a controller that makes T(s) strictly positive real."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from decimal import ROUND_FLOOR, Context, Decimal
from fractions import Fraction
from typing import Any

from ..core.display import Shown
from .loops import Loop, rounded
from .realness import classify
from .transfer import lowest_terms, read_transfer, to_float

SMALLEST = -200  # a limit is searched for between 2^-200 and 2^200
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
    return None if C.pure_integral else _with_gain(loop, repair)


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


def _with_gain(loop: Loop, repair: Repair) -> Repair | None:
    for name in ("kd", "kp") if loop.order == 2 else ("kp",):
        if found := _least(loop, name, repair):
            return found
    return None


def _least(loop: Loop, name: str, repair: Repair) -> Repair | None:
    """The repair with a further step: the least value of a gain, rounded up to four digits."""

    def passes(value: Fraction) -> bool:
        return _is_spr(_with(loop, **{name: value}))

    limit = least_passing(passes)
    if limit is None:
        return None
    start = limit or _usual(loop, name)
    value = DIGITS.create_decimal(Decimal(start.numerator) / Decimal(start.denominator))
    while Fraction(value) <= limit or not _rounded_is_spr(loop, name, float(value)):
        if value > 2 * start:
            return None
        value = value.next_plus(DIGITS)
    gains = repair.gains | {name: float(value)}
    return Repair(gains, repair.limits | {name: to_float(limit)})


def least_passing(passes: Callable[[Fraction], bool]) -> Fraction | None:
    """Lower end, to 50 bits, of the upward interval of positive numbers that pass.

    0 if 2^-200 passes, None if 2^200 does not.
    """
    low, high = SMALLEST, -SMALLEST
    if passes(Fraction(2) ** low):
        return Fraction(0)
    if not passes(Fraction(2) ** high):
        return None
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if passes(Fraction(2) ** middle) else (middle, high)
    fails, passed = Fraction(2) ** low, Fraction(2) ** high
    for _ in range(50):
        middle = (fails + passed) / 2
        fails, passed = (fails, middle) if passes(middle) else (middle, passed)
    return passed


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
    return bool(den) and classify(*lowest_terms(num, den)[:2]) == "SPR"


def _rounded_is_spr(loop: Loop, name: str, value: float) -> bool:
    T = read_transfer(rounded(*_with(loop, **{name: Fraction(value)}).T()))
    return classify(*T[:2]) == "SPR"
